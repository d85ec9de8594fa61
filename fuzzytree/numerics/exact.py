"""The meaning of a model in rational numbers: nothing is rounded anywhere.

The formulas of `fuzzytree.model.rulebase` are taken over the real numbers, at the
doubles that a model and a row hold. Every such double is a fraction, and the formulas
need nothing but `+ - * /`, comparisons, minima and maxima: so every degree is one, too.
What a float changes about a formula stays out, with two exceptions that are part of the
definition and not of its rounding:

- off a plateau a degree is at most `1 - 2**-53`, so that only the plateau has 1;
- a combination that overflows in its stated chain of doubles is missing, although its
  exact value is a number: the model says so (`Semantics.missing`), and whether
  something overflows is a question about doubles. Where the chain does not overflow,
  its rounded value plays no further part.

This module shares no line with the runtimes; it is what they are judged by.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from fractions import Fraction
from functools import lru_cache
from typing import assert_never

import msgspec

from fuzzytree.model import (
    LR,
    Band,
    Model,
    Points,
    Proposition,
    Shape,
    Side,
    Variable,
    checkpoint,
)

DECIDED, TIE, UNCOVERED, MISSING = range(4)
"""How an answer came about, numbered as in `fuzzytree.model.contracts.Outcome`."""

CAP = 1 - Fraction(1, 2**53)
"""The largest degree off a plateau."""

_ZERO, _ONE = Fraction(0), Fraction(1)


class Exact(msgspec.Struct, frozen=True):
    """What a model says about one row, exactly.

    Attributes:
        rule: The number of the winning rule or leaf, from 1; 0 if there is none.
        label: The class, or None for "no class".
        status: `DECIDED`, `TIE`, `UNCOVERED` or `MISSING`.
        strengths: Of every rule, in order. Empty for a tree and for a missing value.
        margin: How far the strongest class is ahead of the next; having no rule counts
            as a class of strength 0. It is 1 where nothing was weighed: for a tree,
            and where a value is missing.
    """

    rule: int
    label: str | None
    status: int
    strengths: tuple[Fraction, ...]
    margin: Fraction


def exact_answer(model: Model, row: Mapping[str, float]) -> Exact:
    """Return what a rule base or a tree says about a row.

    Raises:
        KeyError: If an input has no value.

    Example:
        >>> from fuzzytree.model.rulebase import Rule, RuleBase, Term
        >>> low = Term("low", Band(high=1.0, right=4.0))
        >>> rules = RuleBase(
        ...     "grip", ("soft",), (Variable("force", (low,)),),
        ...     (Rule((Proposition("force", ("low",)),), "soft"),),
        ... )
        >>> exact_answer(rules, {"force": 2.0}).strengths
        (Fraction(2, 3),)
    """
    stand = {v.name: v.missing for v in model.variables if v.missing is not None}
    row = {n: x if math.isfinite(x) else stand.get(n, x) for n, x in row.items()}
    if any(is_missing(variable, row) for variable in model.variables):
        return Exact(0, model.semantics.missing, MISSING, (), _ONE)
    return _fired(model, row) if model.rules else _descended(model, row)


def is_missing(variable: Variable, row: Mapping[str, float]) -> bool:
    """Return whether a variable has no finite value, by the chain that defines it."""
    if not variable.parts:
        return not math.isfinite(row[variable.name])
    first, *others = variable.parts
    total = first.weight * (float(row[first.input]) - first.centre)
    for part in others:
        total += part.weight * (float(row[part.input]) - part.centre)
    return not math.isfinite(total)


def exact_axis(variable: Variable, row: Mapping[str, float]) -> Fraction:
    """Return the value of a variable: the input, or the exact sum of exact products.

    Raises:
        KeyError: If an input has no value.
        ValueError: If a value is not finite.

    Example:
        >>> from fuzzytree.model.rulebase import Part
        >>> mix = Variable("mix", parts=(Part("a", 1e16), Part("b", 1.0)))
        >>> exact_axis(mix, {"a": 1.0, "b": 1.0}) - 10**16
        Fraction(1, 1)
    """
    if not variable.parts:
        return _fraction(variable.name, row)
    parts = (
        Fraction(p.weight) * (_fraction(p.input, row) - Fraction(p.centre))
        for p in variable.parts
    )
    return sum(parts, start=_ZERO)


def _fraction(name: str, row: Mapping[str, float]) -> Fraction:
    value = float(row[name])
    if not math.isfinite(value):
        raise ValueError(f"{name!r} has no exact value: it is {value!r}")
    return Fraction(value)


def exact_degree(shape: Shape, value: Fraction) -> Fraction:
    """Return how far a value belongs to a shape, in [0, 1].

    Example:
        >>> exact_degree(Band(0.0, 1.0, right=4.0), Fraction(3))
        Fraction(1, 3)
    """
    checkpoint()
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            if low is not None and value <= low:
                return _ZERO if left is None else exact_flank(low, left, value)
            if high is not None and value > high:
                return _ZERO if right is None else exact_flank(high, right, value)
            return _ONE
        case LR(mean=mean, left=left, right=right):
            distance = value - Fraction(mean)
            return min(_side_degree(left, -distance), _side_degree(right, distance))
        case Points():
            return _points_degree(shape, value)
    assert_never(shape)


def exact_flank(edge: float, end: float, value: Fraction) -> Fraction:
    """Return the degree on the line from a plateau's edge to 0 at `end`, below 1."""
    zero = Fraction(end)
    return _clipped((value - zero) / (Fraction(edge) - zero), CAP)


def _side_degree(side: Side, distance: Fraction) -> Fraction:
    if distance <= 0:
        return _ONE
    u, reach = distance / Fraction(side.spread), Fraction(side.reach)
    if u >= reach:
        return _ZERO
    t = min(u, _ONE)
    body = _clipped(1 - t * _polynomial(side.curve, 2 * t - 1), _ONE)
    return body if u <= 1 else body * ((reach - u) / (reach - 1)) ** 4


def _points_degree(points: Points, value: Fraction) -> Fraction:
    after = bisect_left(points.values, value)
    if after in (0, len(points.values)):
        return Fraction(points.degrees[after and -1])
    (a, b), (p, r) = (
        map(Fraction, pair[after - 1 : after + 1])
        for pair in (points.values, points.degrees)
    )
    return r + (value - b) / (a - b) * (p - r)


def _clipped(value: Fraction, high: Fraction) -> Fraction:
    return min(max(value, _ZERO), high)


def _polynomial(curve: tuple[float, ...], x: Fraction) -> Fraction:
    """Return c0 + x (c1 + x (c2 + ...)), in integers: one division, at the end."""
    coefficients, common = _integers(curve)
    top, bottom = x.numerator, x.denominator
    total, power = 0, 1
    for position, coefficient in enumerate(reversed(coefficients)):
        power = power * bottom if position else 1
        total = total * top + coefficient * power
    return Fraction(total, common * power)


@lru_cache(maxsize=1 << 14)
def _integers(curve: tuple[float, ...]) -> tuple[tuple[int, ...], int]:
    """Return coefficients over a common denominator, and the denominator."""
    ratios = [coefficient.as_integer_ratio() for coefficient in curve]
    common = max(bottom for _, bottom in ratios)  # all are powers of two
    return tuple(top * (common // bottom) for top, bottom in ratios), common


def _proposition_degree(
    proposition: Proposition, shapes: Mapping[tuple[str, str], Shape], value: Fraction
) -> Fraction:
    degrees = (
        exact_degree(shapes[proposition.variable, t], value) for t in proposition.terms
    )
    highest = max(degrees)
    return 1 - highest if proposition.negated else highest


def _fired(rules: Model, row: Mapping[str, float]) -> Exact:
    shapes = {(v.name, t.name): t.shape for v in rules.variables for t in v.terms}
    propositions = dict.fromkeys(
        proposition for rule in rules.rules for proposition in rule.when
    )
    variables = {v.name: v for v in rules.variables}
    names = dict.fromkeys(proposition.variable for proposition in propositions)
    axes = {name: exact_axis(variables[name], row) for name in names}
    degrees = {
        c: _proposition_degree(c, shapes, axes[c.variable]) for c in propositions
    }
    is_product = rules.semantics.conjunction == "product"
    strengths = tuple(
        _joined((degrees[c] for c in rule.when), is_product=is_product)
        for rule in rules.rules
    )
    best = max(strengths)
    if best == 0:
        return Exact(0, rules.semantics.uncovered, UNCOVERED, strengths, _ZERO)
    winner = strengths.index(best)
    strongest = {rules.rules[k].then for k, s in enumerate(strengths) if s == best}
    rivals = (
        strength
        for rule, strength in zip(rules.rules, strengths, strict=True)
        if rule.then not in strongest
    )
    margin = _ZERO if len(strongest) > 1 else best - max(rivals, default=_ZERO)
    status = TIE if strengths.count(best) > 1 else DECIDED
    return Exact(winner + 1, rules.rules[winner].then, status, strengths, margin)


def _joined(degrees: Iterable[Fraction], *, is_product: bool) -> Fraction:
    return math.prod(degrees, start=_ONE) if is_product else min(degrees, default=_ONE)


def _descended(tree: Model, row: Mapping[str, float]) -> Exact:
    variables = {v.name: v for v in tree.variables}
    node, leaf = (1, None) if tree.nodes else (None, 1)
    while node is not None:
        node_tested = tree.nodes[node - 1]
        value = exact_axis(variables[node_tested.variable], row)
        interval = sum(1 for cut in node_tested.cuts if value > cut)
        branch = node_tested.branches[node_tested.owners[interval]]
        node, leaf = branch.node, branch.leaf
    number = leaf or 0
    return Exact(number, tree.leaves[number - 1].label, DECIDED, (), _ONE)


def outwards(number: Fraction) -> tuple[float, float]:
    """Return the doubles between which a number lies; itself twice if it is one.

    Example:
        >>> outwards(Fraction(1, 4))
        (0.25, 0.25)
        >>> low, high = outwards(Fraction(1, 3))
        >>> low < Fraction(1, 3) < high
        True
    """
    near = float(number)
    low = near if near <= number else math.nextafter(near, -math.inf)
    high = near if near >= number else math.nextafter(near, math.inf)
    return low, high
