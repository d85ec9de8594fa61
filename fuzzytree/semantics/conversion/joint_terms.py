"""One term for several conditions on one input, for rules with one term for each input.

It is the least or the greatest of their degrees at each value, which is exact but for
rounding, or their product within a tolerance.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence

from msgspec.structs import replace

from fuzzytree import numerics
from fuzzytree.errors import LossError
from fuzzytree.model import (
    TOLERANCE,
    And,
    Condition,
    FuzzySystem,
    Not,
    Or,
    Points,
    Proposition,
    RuleBlock,
    Term,
    combined,
    questions,
    unlike,
)
from fuzzytree.numerics import Lines
from fuzzytree.semantics.conversion.points import shape_of

_MOST = 1 << 16  # points of all joint terms, so that a file is read in seconds

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


def with_joint_terms(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose rules test each input once, in the order of the inputs.

    Raises:
        LossError: As `joint_points`, or if the joint terms have too many points.
    """
    labels = {one.name: [*one.terms] for one in system.variables}
    joint_labels: dict[Condition, str] = {}
    size = 0

    def joint(when: Condition | None, block: RuleBlock) -> Condition | None:
        nonlocal size
        if when is None:
            return None
        kind = Or if isinstance(when, Or) else And
        groups: dict[str, list[Condition]] = {name: [] for name in labels}
        for part in operands(when, block):
            groups[next(questions(part)).variable].append(part)
        for name, parts in groups.items():
            if len(parts) > 1 or any(not isinstance(p, Proposition) for p in parts):
                whole = combined(kind, parts)
                if whole not in joint_labels:
                    points, _ = joint_points(whole, labels, block)
                    joint_labels[whole] = _label_of(labels[name], points)
                    size += len(points.values)
                    if size > _MOST:
                        raise LossError(f"joint terms have more than {_MOST} points")
                groups[name] = [Proposition(name, (joint_labels[whole],))]
        return combined(kind, itertools.chain.from_iterable(groups.values()))

    blocks = tuple(
        replace(
            block,
            rules=tuple(replace(r, when=joint(r.when, block)) for r in block.rules),
        )
        for block in system.blocks
    )
    inputs = (replace(v, terms=tuple(labels[v.name])) for v in system.variables)
    return replace(system, variables=tuple(inputs), blocks=blocks)


def _label_of(labels: list[Term], points: Points) -> str:
    """Return the name of the term with some points, which is added if there is none."""
    for label in labels:
        if label.function == points and label.height == 1.0:
            return label.name
    labels.append(Term(unlike("joint", [one.name for one in labels]), points))
    return labels[-1].name


def joint_points(
    condition: Condition,
    labels: Mapping[str, Sequence[Term]],
    block: RuleBlock,
    tolerance: float = TOLERANCE,
) -> tuple[Points, float]:
    """Return the points of a condition on one input, and how far they can be off.

    Args:
        condition: What tests the input.
        labels: The terms of each input.
        block: The rules' norms.
        tolerance: The largest error of a product.

    Raises:
        LossError: If a term is no list of points, or a hedge or norm has no lines.
    """
    lines, bound = _lines(condition, labels, block, tolerance)
    points, rounding = numerics.rounded_lines(lines)
    return points, bound + rounding


def _lines(
    condition: Condition,
    labels: Mapping[str, Sequence[Term]],
    block: RuleBlock,
    tolerance: float,
) -> tuple[Lines, float]:
    """Return the degree of a condition on one input as lines, and their error."""
    match condition:
        case Proposition():
            return _lines_of(condition, labels), 0.0
        case Not(part=part):
            lines, bound = _lines(part, labels, block, tolerance)
            return numerics.negated(lines), bound
        case And(parts=parts) | Or(parts=parts):
            result = [_lines(part, labels, block, tolerance) for part in parts]
            total, bound = result[0]
            is_or = isinstance(condition, Or)
            join = _join(block.disjunction if is_or else block.conjunction, tolerance)
            for lines, error in result[1:]:
                total, more = join(total, lines)
                # Errors of a product add; least and greatest pass one on.
                bound = bound + error + more
            return total, bound


def _lines_of(proposition: Proposition, labels: Mapping[str, Sequence[Term]]) -> Lines:
    variable, hedges = proposition.variable, proposition.hedges
    if hedges[:1] == ("any",):
        return numerics.lines_of(EVERYWHERE)
    if proposition.term is None or hedges not in ((), ("not",)):
        raise LossError(f"{variable!r} has several conditions with hedges")
    label = next(one for one in labels[variable] if one.name == proposition.term)
    shape = shape_of(label.function)
    if not isinstance(shape, Points):
        text = f"the term {proposition.term!r} of {variable!r}"
        raise LossError(f"{text} has several conditions and is no list of points")
    lines = numerics.scaled(numerics.lines_of(shape), label.height)
    return numerics.negated(lines) if hedges else lines


def _join(
    norm: str | None, tolerance: float
) -> Callable[[Lines, Lines], tuple[Lines, float]]:
    match norm:
        case "minimum":
            return lambda one, other: (numerics.least(one, other), 0.0)
        case "maximum":
            return lambda one, other: (numerics.greatest(one, other), 0.0)
        case "product":
            return lambda one, other: numerics.product(one, other, tolerance)
        case _:
            raise LossError(f"one input has several conditions, joined by {norm}")
