"""What every value of a model is, and what models of all kinds have."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Literal, Protocol

import msgspec

if TYPE_CHECKING:
    from fuzzytree.model.variables import Variable

ModelKind = Literal["tree", "rules", "system"]


class Value(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A frozen, comparable, hashable record."""


_ONE = {"leaves": "leaf", "classes": "class", "losses": "loss", "criteria": "criterion"}


def summary(name: str, **counts: int) -> str:
    """Return what `repr` shows of something large: its name and how much it holds.

    Example:
        >>> summary("RuleBase", rules=3, classes=1)
        'RuleBase(3 rules, 1 class)'
    """
    shown = (
        f"{count} {noun if count != 1 else _ONE.get(noun, noun.removesuffix('s'))}"
        for noun, count in counts.items()
    )
    return f"{name}({', '.join(shown)})"


class Result:
    """What a verb returns: `str` is the text of its command; a notebook shows it.

    `fuzzytree.report.notebook` has the text of each kind, and its HTML.
    """

    __slots__ = ()

    def __str__(self) -> str:
        """Return what the command line prints."""
        return "\n".join(_notebook().lines_of(self))

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return str(_notebook().html_of(self))


def _notebook() -> Any:
    """Return the module that knows the texts, which stands above the results."""
    return importlib.import_module("fuzzytree.report.notebook")


class _WithVariables(Protocol):
    @property
    def variables(self) -> tuple[Variable, ...]: ...


class AnyModel(Result, Value, frozen=True):
    """What a model of any kind has."""

    @property
    def inputs(self: _WithVariables) -> tuple[str, ...]:
        """The names of the columns that the model needs, in order."""
        return tuple(v.name for v in self.variables if not v.parts)
