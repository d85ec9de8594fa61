"""Two models side by side, and the rows on which they are compared."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

import msgspec
import numpy as np

from fuzzytree.auditing.decide import Budget, OutOfStepsError
from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import Declined
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.support import rows_outside, sample_points
from fuzzytree.model import (
    Document,
    FloatArray,
    FuzzySystem,
    Rule,
    RuleBase,
    Variable,
)

_PORTION = 1024  # rows between two looks at the budget

Progress = Callable[[str, float], None]
Model = TypeVar("Model", RuleBase, FuzzySystem)


def silent(_: str, __: float) -> None:
    """Report nothing."""


def all_inputs(old: Document, new: Document) -> tuple[str, ...]:
    """Return the columns that either of two models needs, the old ones first."""
    return tuple(dict.fromkeys((*old.inputs, *new.inputs)))


def union(old: Document, new: Document) -> RuleBase:
    """Return a rule base with the inputs of both models, and no proposition.

    Raises:
        ValueError: If a category stands at two places.
    """
    inputs: dict[str, Variable] = {}
    for variable in (*old.variables, *new.variables):
        if variable.parts:
            continue
        plain = msgspec.structs.replace(variable, terms=(), clips=False)
        codes, more = (
            inputs.setdefault(variable.name, plain).categories,
            plain.categories,
        )
        if any(code != other for code, other in zip(codes, more, strict=False)):
            raise ValueError(
                f"the categories of {variable.name!r} are {', '.join(codes)} in one "
                f"model and {', '.join(more)} in the other, so that one code is "
                "two values"
            )
        if len(more) > len(codes):
            inputs[variable.name] = plain
    rows = tuple(inputs[name] for name in all_inputs(old, new))
    return RuleBase("both", ("x",), rows, (Rule((), "x"),))


class Pair(msgspec.Struct, Generic[Model], frozen=True, eq=False):
    """Two models, as rules or as systems, and where they are compared.

    Attributes:
        inputs: The inputs of either, the old ones first.
        domain: A side for each.
        are_trees: Whether both come from trees.
    """

    old: Model
    new: Model
    inputs: tuple[str, ...]
    domain: Domain
    are_trees: bool = False

    def rows_of(self, model: Model, values: FloatArray) -> FloatArray:
        """Return the columns of one model, of values of shape (inputs, rows)."""
        return values[[self.inputs.index(name) for name in model.inputs]]

    def draw(self, count: int, seed: int) -> FloatArray:
        """Return points drawn evenly from the domain."""
        return sample_points(union(self.old, self.new), self.domain, count, seed)

    def within(self, tables: Iterable[FloatArray]) -> FloatArray:
        """Return rows of both models in the domain, with other inputs in the middle."""
        sides = {side.variable: side for side in self.domain.sides}
        middle = [sides[name].low / 2 + sides[name].high / 2 for name in self.inputs]
        parts: list[FloatArray] = []
        for model, rows in zip((self.old, self.new), tables, strict=True):
            table = np.repeat(np.array(middle)[:, None], rows.shape[1], axis=1)
            table[[self.inputs.index(name) for name in model.inputs]] = rows
            parts.append(table)
        values = np.hstack(parts)
        outside = rows_outside(union(self.old, self.new), self.domain, values)
        inside: FloatArray = values[:, ~outside]
        return inside


class Differences(ABC):
    """What is known of rows on which two models differ.

    Attributes:
        steps: What a row costs.
        left: How many rows were not compared.
    """

    def __init__(self, steps: int) -> None:
        self.steps, self.left = steps, 0

    def add(
        self, values: FloatArray, budget: Budget, name: str = ""
    ) -> tuple[int, int]:
        """Compare the answers to some rows, as long as steps are left.

        Returns:
            How many differ, of how many that were looked at.
        """
        hits = start = 0
        count = values.shape[1]
        while start < count:
            size = max(min(_PORTION, budget.left // self.steps, count - start), 1)
            try:
                budget.spend(size * self.steps)
            except OutOfStepsError:
                break
            hits += self.compare(values[:, start : start + size], name, start)
            start += size
        self.left += count - start
        return hits, start

    @abstractmethod
    def compare(self, values: FloatArray, name: str, start: int) -> int:
        """Return on how many rows the two differ, and keep what is worth it."""


def left_out(subject: str, points: str, reason: str) -> AuditAnswer:
    """Return that some points were not compared."""
    state, facts = Declined("FTD03", reason), {"points": points}
    return audit_answer("FT801.not-compared", subject, state, facts=facts)
