"""The meaning of a rule base and of a tree, written to be believed and not to be fast.

One row at a time, in plain Python floats (IEEE 754 double), without an array library.
Each operation below is one rounding; every other runtime that promises equal bits
performs the same operations in the same order.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from enum import IntEnum

import msgspec

from fuzzytree.model import (
    LR,
    WEIGHT_OF_ONE,
    Band,
    FuzzyTree,
    Points,
    Proposition,
    RuleBase,
    Shape,
    Side,
    Variable,
    parts_of,
    shapes_of,
    squarings,
    stand_ins,
)

BELOW_ONE = 1.0 - 2.0**-53
"""The largest double below 1: the highest degree off a plateau."""


class Status(IntEnum):
    """How an answer came about."""

    DECIDED = 0
    TIE = 1
    UNCOVERED = 2
    MISSING = 3


class Answer(msgspec.Struct, frozen=True):
    """What a model says about one row.

    Attributes:
        rule: The number of the winning rule or leaf, from 1; 0 if there is none.
        label: The class, or None for "no class".
        status: Decided, decided by order among equals, uncovered, or missing.
        strengths: Of every rule, in order, of a system its activation; NaN where a
            needed value is missing. Empty for a tree.
        outputs: The numbers of a system.
    """

    rule: int
    label: str | None
    status: Status
    strengths: tuple[float, ...] = ()
    outputs: tuple[float, ...] = ()


def evaluate(rules: RuleBase, row: Mapping[str, float]) -> Answer:
    """Fire every rule on one row and let the first of the strongest decide.

    Returns:
        The answer, with the strength of every rule.

    Raises:
        KeyError: If an input has no value.

    Example:
        >>> from fuzzytree.model.rulebase import Rule, Term
        >>> low = Term("low", Band(high=1.0, right=3.0))
        >>> rules = RuleBase(
        ...     "grip", ("soft",), (Variable("force", (low,)),),
        ...     (Rule((Proposition("force", ("low",)),), "soft"),),
        ... )
        >>> evaluate(rules, {"force": 2.0}).strengths
        (0.5,)
    """
    axes = axis_values(rules.variables, row)
    if not all(map(math.isfinite, axes.values())):
        missing = (math.nan,) * len(rules.rules)
        return Answer(0, rules.semantics.missing, Status.MISSING, missing)
    shapes = shapes_of(rules.variables)
    # The rules of a tree share their propositions: each is evaluated once.
    propositions = {
        id(proposition): proposition
        for rule in rules.rules
        for proposition in rule.when
    }
    degrees = {
        key: proposition_degree(proposition, shapes, axes[proposition.variable])
        for key, proposition in propositions.items()
    }
    strengths = tuple(
        strength(
            [degrees[id(proposition)] for proposition in rule.when],
            is_product=rules.semantics.conjunction == "product",
        )
        for rule in rules.rules
    )
    best = max(strengths)
    if best == 0.0:
        return Answer(0, rules.semantics.uncovered, Status.UNCOVERED, strengths)
    winner = strengths.index(best)
    status = Status.TIE if strengths.count(best) > 1 else Status.DECIDED
    return Answer(winner + 1, rules.rules[winner].then, status, strengths)


def row_probabilities(rules: RuleBase, answer: Answer) -> tuple[float, ...]:
    """Return the probability of each class, as `fuzzytree.model.probabilities` says.

    Returns:
        Numbers in the order of the classes, with the sum 1 but for rounding, of which
        that of the predicted class is the largest alone; NaN where no rule decided.

    Raises:
        ValueError: If the rule base has no probabilities.
    """
    if rules.semantics.sharpness is msgspec.UNSET:
        raise ValueError(f"{rules.name!r} has no probabilities")
    if not answer.rule:
        return (math.nan,) * len(rules.classes)
    counts = [0] * len(rules.classes)
    for rule, value in zip(rules.rules, answer.strengths, strict=True):
        for _ in range(squarings(rules.semantics.sharpness)):
            value = value * value
        weight = math.floor(WEIGHT_OF_ONE * value)
        for code, part in enumerate(parts_of(rule.probabilities)):
            counts[code] += weight * part
    winner = rules.classes.index(rules.rules[answer.rule - 1].then)
    others = counts[:winner] + counts[winner + 1 :]
    counts[winner] = max(counts[winner], max(others, default=0) + 1)
    return tuple(count / sum(counts) for count in counts)


def descend(tree: FuzzyTree, row: Mapping[str, float]) -> Answer:
    """Follow one path of the tree, at each node the interval that holds the value.

    Raises:
        KeyError: If an input has no value.
    """
    axes = axis_values(tree.variables, row)
    if not all(map(math.isfinite, axes.values())):
        return Answer(0, tree.semantics.missing, Status.MISSING)
    node, leaf = (1, None) if tree.nodes else (None, 1)
    while node is not None:
        current = tree.nodes[node - 1]
        value = axes[current.variable]
        interval = sum(1 for cut in current.cuts if value > cut)
        branch = current.branches[current.owners[interval]]
        node, leaf = branch.node, branch.leaf
    number = leaf or 0
    return Answer(number, tree.leaves[number - 1].label, Status.DECIDED)


def axis_values(
    variables: tuple[Variable, ...], row: Mapping[str, float]
) -> dict[str, float]:
    """Return the value of each variable: the input, or the sum of its parts in order.

    A value that is not finite is replaced by what stands for a missing one, if the
    input has such a value. A combination is `w1 (x1 - c1) + w2 (x2 - c2) + ...`,
    rounded after each step.
    """
    known = filled_row(variables, row)
    axes: dict[str, float] = {}
    for variable in variables:
        if not variable.parts:
            axes[variable.name] = known[variable.name]
            continue
        first, *others = variable.parts
        total = first.weight * (known[first.input] - first.centre)
        for part in others:
            total = total + part.weight * (known[part.input] - part.centre)
        axes[variable.name] = total
    return axes


def filled_row(
    variables: Iterable[Variable], row: Mapping[str, float]
) -> dict[str, float]:
    """Return a row with the stand-ins in the place of values that are not finite.

    Example:
        >>> age = Variable("age", missing=30.0)
        >>> filled_row([age], {"age": math.nan}), filled_row([age], {"age": 7.0})
        ({'age': 30.0}, {'age': 7.0})
    """
    known = {name: float(value) for name, value in row.items()}
    for name, value in stand_ins(variables).items():
        if not math.isfinite(known[name]):
            known[name] = value
    return known


def proposition_degree(
    proposition: Proposition, shapes: Mapping[tuple[str, str], Shape], value: float
) -> float:
    """Return the degree of a proposition: the largest of its terms, or 1 minus it."""
    highest = max(
        degree(shapes[proposition.variable, term], value) for term in proposition.terms
    )
    return 1.0 - highest if proposition.negated else highest


def strength(degrees: list[float], *, is_product: bool) -> float:
    """Return the minimum, or the product from left to right; 1 without any."""
    if not is_product:
        return min(degrees, default=1.0)
    total = 1.0
    for value in degrees:
        total = total * value
    return total


def degree(shape: Shape, value: float) -> float:
    """Return how far a finite value belongs to a shape, in [0, 1].

    Example:
        >>> degree(Band(0.0, 1.0, right=2.0), 1.25)
        0.75
    """
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and value <= low:
                return 0.0 if left is None else flank_degree(low, left, value)
            if high is not None and value > high:
                return 0.0 if right is None else flank_degree(high, right, value)
            return 1.0
        case LR(mean=mean, left=below, right=above):
            distance = value - mean
            return min(side_degree(below, -distance), side_degree(above, distance))
        case Points():
            return points_degree(shape, value)


def flank_degree(edge: float, end: float, value: float) -> float:
    """Return the degree off a plateau's edge: 0 at `end` and beyond, below 1."""
    return _clip((value - end) / (edge - end), BELOW_ONE)


def side_degree(side: Side, distance: float) -> float:
    """Return the degree of one side of an LR set (paper, 2.2.2, with a tail).

    Exactly 1 for a distance of 0 or less, exactly 0 at `reach` spreads and beyond.
    """
    u = _clip(distance / side.spread, side.reach)
    t = min(u, 1.0)
    body = _clip(1.0 - t * horner(side.curve, 2.0 * t - 1.0), 1.0)
    w = _clip((side.reach - u) / (side.reach - 1.0), 1.0)
    square = w * w
    return body * (square * square)


def points_degree(points: Points, value: float) -> float:
    """Return the degree on the line between the points on either side of a value.

    The quotient lies in [0, 1] and is monotone, in rounded numbers too; so are the
    product and the sum, which is clamped between the two degrees. Measured from its
    right end, a line is exact there, and from a left end of degree 0 it is exact at
    both and near 0 to the last digit.
    """
    values, degrees = points.values, points.degrees
    after = bisect_left(values, value)  # so many points lie below the value
    if after in (0, len(values)):
        return degrees[after and -1]
    anchor, other = values[after], values[after - 1]
    near, far = degrees[after], degrees[after - 1]
    if far == 0.0:
        anchor, other, near, far = other, anchor, far, near
    line = near + (value - anchor) / (other - anchor) * (far - near)
    return min(max(line, min(near, far)), max(near, far))


def horner(coefficients: tuple[float, ...], x: float) -> float:
    """Return c0 + x (c1 + x (c2 + ...)), from the inside out."""
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


def _clip(value: float, high: float) -> float:
    return min(max(0.0, value), high)
