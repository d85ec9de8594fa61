"""One term for several conditions on one input, for rules with one term for each input.

It is the least or the greatest of their degrees at each value, which is exact but for
rounding, or their product within a tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from msgspec.structs import replace

from fuzzytree import numerics
from fuzzytree.errors import LossError
from fuzzytree.model import (
    TOLERANCE,
    And,
    Condition,
    FuzzySystem,
    Loss,
    Not,
    Or,
    Points,
    Proposition,
    RuleBlock,
    SystemRule,
    Term,
    combined,
    condition_text,
    questions,
    unlike,
)
from fuzzytree.numerics import Lines
from fuzzytree.semantics.conversion.points import shape_of

MOST_JOINT = 1 << 16
"""Points of all joint terms of a file that is read, so that it takes seconds."""

EVERYWHERE = Points((0.0,), (1.0,))
"""Degree 1 at every value."""


def operands(condition: Condition, block: RuleBlock) -> list[Condition]:
    """Return the operands of a condition; an and within an and adds its own."""
    if not isinstance(condition, And | Or):
        return [condition]
    norm = block.disjunction if isinstance(condition, Or) else block.conjunction
    parts: list[Condition] = []
    for place, part in enumerate(condition.parts):
        is_open = place == 0 or norm in ("minimum", "maximum")
        is_same = isinstance(part, type(condition))
        parts += operands(part, block) if is_same and is_open else [part]
    return parts


class JointTerms:
    """The terms of all inputs; those that rules need for joint conditions are added.

    Attributes:
        labels: The terms of each input.
        losses: A loss for each joint term, with its bound.
    """

    def __init__(
        self,
        system: FuzzySystem,
        tolerance: float = TOLERANCE,
        *,
        room: float = math.inf,
    ) -> None:
        self.system, self.tolerance, self.room = system, tolerance, room
        self.labels = {one.name: [*one.terms] for one in system.variables}
        self.losses: list[Loss] = []
        self._names: dict[Condition, str] = {}
        self._joins: dict[tuple[type, tuple[Condition, ...]], tuple[Lines, float]] = {}

    def by_input(
        self, parts: Iterable[Condition], *, is_or: bool
    ) -> dict[str, Proposition]:
        """Return one proposition for each input that conditions test.

        Raises:
            LossError: If one tests several inputs or an output, or if what tests one
                input has no lines, or there are more points than room.
        """
        groups: dict[str, list[Condition]] = {name: [] for name in self.labels}
        for part in parts:
            names = {proposition.variable for proposition in questions(part)}
            if len(names) > 1:
                raise LossError("it mixes and, or and not over several inputs")
            (name,) = names
            if name not in groups:
                raise LossError(f"it tests the output {name!r}")
            groups[name].append(part)
        results: dict[str, Proposition] = {}
        for name, own in groups.items():
            if len(own) == 1 and isinstance(own[0], Proposition):
                results[name] = own[0]
            elif own:
                label = self._joint(name, combined(Or if is_or else And, own))
                results[name] = Proposition(name, (label,))
        return results

    def add(self, variable: str, name: str, points: Points) -> str:
        """Return the name of a term with some points; it is added if there is none."""
        labels = self.labels[variable]
        for label in labels:
            if label.function == points and label.height == 1.0:
                return label.name
        labels.append(Term(unlike(name, [one.name for one in labels]), points))
        return labels[-1].name

    def _joint(self, variable: str, condition: Condition) -> str:
        if condition in self._names:
            return self._names[condition]
        try:
            lines, bound = self._lines(condition)
            points, rounding = numerics.rounded_lines(lines)
            self.room -= len(points.values)
            if self.room < 0:
                raise LossError("they have too many points")
        except LossError as error:
            text = f"{variable!r} has several conditions, and {error}"
            raise LossError(text) from error
        text = condition_text(
            condition, lambda one: " ".join((*one.hedges, *one.terms))
        )
        label = self.add(variable, text[:60], points)
        self._names[condition] = label
        what = f"the rules test it jointly; the term {label!r} stands for that"
        where = f"{text} of {variable!r}"[:200]
        self.losses.append(Loss(where, what, bound + rounding))
        return label

    def _lines(self, condition: Condition) -> tuple[Lines, float]:
        """Return the degree of a condition on one input as lines, and their error."""
        match condition:
            case Proposition():
                return self._lines_of(condition), 0.0
            case Not(part=part):
                lines, bound = self._lines(part)
                return numerics.negated(lines), bound
            case And(parts=parts) | Or(parts=parts):
                total, bound = self._lines(parts[0])
                join = self._join(is_or=isinstance(condition, Or))
                for count, part in enumerate(parts[1:], 2):
                    key = (type(condition), parts[:count])
                    if key not in self._joins:  # rules begin with the same conditions
                        lines, error = self._lines(part)
                        joint, more = join(total, lines)
                        # Errors of a product add; least and greatest pass one on.
                        self._joins[key] = joint, bound + error + more
                    total, bound = self._joins[key]
                return total, bound

    def _lines_of(self, proposition: Proposition) -> Lines:
        variable, hedges = proposition.variable, proposition.hedges
        if hedges[:1] == ("any",):
            return numerics.lines_of(EVERYWHERE)
        if proposition.term is None or hedges not in ((), ("not",)):
            raise LossError(f"{variable!r} has several conditions with hedges")
        labels = self.labels[variable]
        label = next(one for one in labels if one.name == proposition.term)
        shape = shape_of(label.function)
        if not isinstance(shape, Points):
            text = f"the term {proposition.term!r} of {variable!r}"
            raise LossError(f"{text} has several conditions and is no list of points")
        lines = numerics.scaled(numerics.lines_of(shape), label.height)
        return numerics.negated(lines) if hedges else lines

    def _join(self, *, is_or: bool) -> Callable[[Lines, Lines], tuple[Lines, float]]:
        block = self.system.blocks[0]
        match norm := block.disjunction if is_or else block.conjunction:
            case "minimum":
                return lambda one, other: (numerics.least(one, other), 0.0)
            case "maximum":
                return lambda one, other: (numerics.greatest(one, other), 0.0)
            case "product":
                return lambda one, other: numerics.product(one, other, self.tolerance)
            case _:
                raise LossError(f"one input has several conditions, joined by {norm}")


def with_joint_terms(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose rules test each input once, in the order of the inputs.

    Raises:
        LossError: As `JointTerms.by_input`.
    """
    terms = JointTerms(system, room=MOST_JOINT)

    def joint(rule: SystemRule, block: RuleBlock) -> SystemRule:
        if rule.when is None:
            return rule
        is_or = isinstance(rule.when, Or)
        parts = terms.by_input(operands(rule.when, block), is_or=is_or).values()
        return replace(rule, when=combined(Or if is_or else And, parts))

    blocks = tuple(
        replace(block, rules=tuple(joint(rule, block) for rule in block.rules))
        for block in system.blocks
    )
    inputs = (replace(v, terms=tuple(terms.labels[v.name])) for v in system.variables)
    return replace(system, variables=tuple(inputs), blocks=blocks)
