"""What every value of a model is, and what models of all kinds have."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Literal, Protocol

import msgspec

if TYPE_CHECKING:
    from fuzzytree.model.variables import Variable

ModelKind = Literal["tree", "rules", "system"]


class Value(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A frozen, comparable, hashable record."""


class _WithVariables(Protocol):
    @property
    def variables(self) -> tuple[Variable, ...]: ...


class AnyModel(Value, frozen=True):
    """What a model of any kind has."""

    @property
    def inputs(self: _WithVariables) -> tuple[str, ...]:
        """The names of the columns that the model needs, in order."""
        return tuple(v.name for v in self.variables if not v.parts)

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        page = importlib.import_module("fuzzytree.report.notebook")
        shown: str = page.model_html(self)
        return shown
