"""Hedged curves between two lines: `very`, `somewhat` and the others.

Each hedge h but `not` and `any` rises, so where l <= d <= u, h(l) <= h(d) <= h(u). A
line of points l makes a curve h(l), on which points are put so close that chords are
near: between two degrees p < q the chord of h is off by at most
`(q - p) (largest slope - least slope) / 4`, and by at most `h(q) - h(p)`. Where h bends
upwards its chords are above it, so only the lower line gives way; where it bends
downwards only the upper one does.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

from fuzzytree.auditing.findings.enclosing import (
    HALF_GAP,
    Enclosed,
    Knot,
    Side,
    clipped,
    complement,
    laid,
)
from fuzzytree.model.rulebase import MOST_POINTS, Points
from fuzzytree.model.system import Hedge
from fuzzytree.numerics.curve_values import Between, powered, root

_HALF = Fraction(1, 2)
_MORE = 1.0 + 2.0**-20  # of slopes in doubles

Bend = Literal["upwards", "downwards", "both"]


class _Rising(NamedTuple):
    """A hedge that rises.

    Attributes:
        value: What it makes of a degree.
        slope: How fast it rises there.
        bend: How it bends below 1/2, and above.
    """

    value: Callable[[Fraction], Between]
    slope: Callable[[float], float]
    bend: tuple[Bend, Bend]


def hedged(found: Enclosed, hedge: Hedge) -> Enclosed | None:
    """Return what a hedge makes of a curve between lines.

    Returns:
        None if the lines are no points, or it would need too many.

    Example:
        >>> ramp = Points((0.0, 1.0), (0.0, 1.0))
        >>> very = hedged(Enclosed(ramp, ramp, (ramp,)), "very")
        >>> from fuzzytree.numerics.exact import exact_degree
        >>> low, high = (exact_degree(one, Fraction(1, 3)) for one in very[:2])
        >>> low < Fraction(1, 9) < high, high - low < 0.001
        (True, True)
    """
    if hedge == "not":
        return complement(found)
    if hedge == "any":
        one = Points((0.0,), (1.0,))
        return Enclosed(one, one, (one,))
    if not isinstance(found.lower, Points) or not isinstance(found.upper, Points):
        return None
    lower = _line(found.lower, _RISING[hedge], "lower")
    upper = _line(found.upper, _RISING[hedge], "upper")
    if lower is None or upper is None:
        return None
    return Enclosed(lower, upper, (hedge, *found.key))


def _line(points: Points, hedge: _Rising, side: Side) -> Points | None:
    """Return a line nowhere above, or nowhere below, what a hedge makes of another."""
    pick = 0 if side == "lower" else 1
    parts = [*_parts(points, hedge)]
    if sum(map(len, parts)) > MOST_POINTS:
        return None
    off = Fraction(max((_off(hedge, of, side) for of in parts), default=0.0))
    made: list[Knot] = []
    for of in parts:
        is_level = all(degree == of[0][1] for _, degree in of)
        shift = Fraction(0) if is_level else off if pick else -off
        ends = [(x, hedge.value(degree)[pick] + shift) for x, degree in of]
        made += ends if not made or made[-1] != ends[0] else ends[1:]
    extreme = (max if pick else min)(map(Fraction, points.degrees))
    return laid([*clipped(made, hedge.value(extreme)[pick], side)], side, None)


def _parts(points: Points, hedge: _Rising) -> Iterator[list[Knot]]:
    """Yield the stretches of a line between its points, each with points of its own."""
    known = [*zip(points.values, map(Fraction, points.degrees), strict=True)]
    if len(known) == 1:
        yield known
    for (a, p), (b, q) in itertools.pairwise(known):
        if a == b:  # a step has two ends and nothing between
            yield [(a, p)]
            yield [(b, q)]
            continue
        degree = functools.partial(_along, (a, p), (b, q))
        done: list[Knot] = [(a, p)]
        todo = [b]
        while todo and len(done) + len(todo) <= MOST_POINTS:
            x, y = done[-1]
            end = todo[-1]
            middle = x + (end - x) / 2
            is_near = _error(hedge, y, degree(end)) <= HALF_GAP
            if is_near or not x < middle < end:
                done.append((todo.pop(), degree(end)))
            else:
                todo.append(middle)
        yield done


def _along(one: Knot, other: Knot, x: float) -> Fraction:
    """Return the degree of the line between two points."""
    (a, p), (b, q) = one, other
    return p + (q - p) * (Fraction(x) - Fraction(a)) / (Fraction(b) - Fraction(a))


def _off(hedge: _Rising, of: Sequence[Knot], side: Side) -> float:
    """Return how far chords are beyond the curve on the side that counts."""
    counts = ("both", "upwards" if side == "lower" else "downwards")
    found = 0.0
    for (_, p), (_, q) in itertools.pairwise(of):
        if _bend(hedge, p, q) in counts:
            found = max(found, _error(hedge, p, q))
    return found


def _bend(hedge: _Rising, p: Fraction, q: Fraction) -> Bend:
    """Return how a hedge bends between two degrees."""
    first, last = hedge.bend[min(p, q) >= _HALF], hedge.bend[max(p, q) > _HALF]
    return first if first == last else "both"


def _error(hedge: _Rising, p: Fraction, q: Fraction) -> float:
    """Return how far the chord between two degrees can be from the curve."""
    if p == q:
        return 0.0
    p, q = min(p, q), max(p, q)
    slopes = [hedge.slope(float(one)) for one in (p, q)]
    if p < _HALF < q:
        slopes.append(hedge.slope(0.5))
    bent = float(q - p) * (max(slopes) - min(slopes)) / 4.0
    return min(bent, float(hedge.value(q).high - hedge.value(p).low)) * _MORE


def _power(power: Fraction) -> _Rising:
    exponent = float(power)

    def slope(degree: float) -> float:
        if degree == 0.0:
            return math.inf if exponent < 1.0 else 0.0
        return exponent * math.pow(degree, exponent - 1.0)

    def value(degree: Fraction) -> Between:
        return powered(degree, power)

    def whole(degree: Fraction) -> Between:
        found = degree**power.numerator
        return Between(found, found)

    bend: Bend = "upwards" if power > 1 else "downwards"
    return _Rising(whole if power.denominator == 1 else value, slope, (bend, bend))


def _extremely(degree: Fraction) -> Between:
    found = 2 * degree**2 if degree <= _HALF else 1 - 2 * (1 - degree) ** 2
    return Between(found, found)


def _slope_of_extremely(degree: float) -> float:
    return 4.0 * min(degree, 1.0 - degree)


def _seldom(degree: Fraction) -> Between:
    if degree <= _HALF:
        return root(degree / 2)
    low, high = root((1 - degree) / 2)
    return Between(1 - high, 1 - low)


def _slope_of_seldom(degree: float) -> float:
    near = min(degree, 1.0 - degree)
    return math.inf if near <= 0.0 else 0.25 / math.sqrt(0.5 * near)


_RISING: Final[Mapping[Hedge, _Rising]] = MappingProxyType(
    {
        "very": _power(Fraction(2)),
        "somewhat": _power(_HALF),
        "extremely": _Rising(_extremely, _slope_of_extremely, ("upwards", "downwards")),
        "seldom": _Rising(_seldom, _slope_of_seldom, ("downwards", "upwards")),
        "cubed": _power(Fraction(3)),
        "very very": _power(Fraction(4)),
        "plus": _power(Fraction(5, 4)),
        "minus": _power(Fraction(3, 4)),
        "cube root": _power(Fraction(1, 3)),
    }
)
