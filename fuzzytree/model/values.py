"""What every value of a model is, and what models of all kinds have."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar

import msgspec

if TYPE_CHECKING:
    from fuzzytree.model.variables import Variable

T = TypeVar("T")
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


class AnyModel(Result, Value, frozen=True, dict=True):
    """What a model of any kind has.

    Beside its fields it has room for what was made of it (`remember`), which no
    comparison, copy or file sees.
    """

    @functools.cached_property
    def inputs(self: _WithVariables) -> tuple[str, ...]:
        """The names of the columns that the model needs, in order."""
        return tuple(v.name for v in self.variables if not v.parts)


def remember(model: object, key: Hashable, make: Callable[[], T]) -> T:
    """Return what was made of a model, which lives as long as the model does.

    Args:
        model: A tree, a rule base or a fuzzy system.
        key: What is made, and with which options.
        make: Makes it, at the first call with this key.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(0)
        >>> text = remember(tree, "outline", lambda: str(tree))
        >>> remember(tree, "outline", str) is text
        True
    """
    made: dict[Hashable, Any] = vars(model).setdefault("_made", {})
    if key not in made:
        made[key] = make()
    result: T = made[key]
    return result
