"""Point lists joined value by value: the least, the greatest, the product, 1 minus.

For formats in which a rule tests a variable only once: `x is low and x is not far` is
one term there. Everything is computed with rational numbers and rounded once at the
end; the bound covers that rounding, at every real value.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.errors import LossError
from fuzzytree.model import MOST_POINTS, Points
from fuzzytree.numerics.curves import BELOW_ONE
from fuzzytree.numerics.exact import outwards

_FARTHEST = Fraction(sys.float_info.max)  # between neighbouring points


class _Knot(NamedTuple):
    """A value, the degree at it, and the degree right above it."""

    x: Fraction
    at: Fraction
    above: Fraction


Lines = tuple[_Knot, ...]
"""Knots in rising order, joined by lines; level before the first, behind the last."""


def lines_of(points: Points) -> Lines:
    """Return a point list as knots.

    Example:
        >>> len(lines_of(Points((0.0, 1.0, 1.0), (0.0, 1.0, 0.5))))
        2
    """
    knots: list[_Knot] = []
    for value, degree in zip(points.values, points.degrees, strict=True):
        x, y = Fraction(value), Fraction(degree)
        if knots and knots[-1].x == x:
            knots[-1] = knots[-1]._replace(above=y)
        else:
            knots.append(_Knot(x, y, y))
    return tuple(knots)


def least(one: Lines, other: Lines) -> Lines:
    """Return the smaller degree of two at each value, exactly."""
    return _joined(one, other, min)


def greatest(one: Lines, other: Lines) -> Lines:
    """Return the larger degree of two at each value, exactly."""
    return _joined(one, other, max)


def negated(lines: Lines) -> Lines:
    """Return 1 minus the degree at each value, exactly."""
    return tuple(_Knot(k.x, 1 - k.at, 1 - k.above) for k in lines)


def scaled(lines: Lines, height: float) -> Lines:
    """Return the degree times a height at each value, exactly."""
    by = Fraction(height)
    return tuple(_Knot(k.x, k.at * by, k.above * by) for k in lines)


def product(one: Lines, other: Lines, tolerance: float) -> tuple[Lines, float]:
    """Return the product of two degrees at each value, and its largest error.

    On a piece where the slopes are p and r, a line over a width h misses the product
    by `|p r| h^2 / 4` at most; pieces are halved in number until that is below the
    tolerance.
    """
    knots: list[_Knot] = []
    worst = Fraction(0)
    for before, here in itertools.pairwise([None, *_common(one, other)]):
        assert here is not None  # only the first is
        if before is not None:
            rise = (here[1].at - before[1].above) * (here[2].at - before[2].above)
            count = math.isqrt(int(abs(rise) / Fraction(4.0 * tolerance))) + 1
            worst = max(worst, abs(rise) / (4 * count * count))
            _refuse_many(len(knots) + count)
            for step in range(1, count):
                share = Fraction(step, count)
                x = before[0] + (here[0] - before[0]) * share
                y = Fraction(1)
                for low, high in zip(before[1:], here[1:], strict=True):
                    y *= low.above + (high.at - low.above) * share
                knots.append(_Knot(x, y, y))
        x, first, second = here
        knots.append(_Knot(x, first.at * second.at, first.above * second.above))
    _refuse_many(len(knots))
    return tuple(knots), outwards(worst)[1]


def _refuse_many(points: int) -> None:
    if points > MOST_POINTS:
        raise LossError(
            f"the product of two curves needs more than {MOST_POINTS} points; "
            "allow a larger error"
        )


def rounded_lines(lines: Lines) -> tuple[Points, float]:
    """Return a point list, and the largest difference from the lines.

    A degree that is below 1 stays below 1.

    Raises:
        LossError: If it would need more than 4096 points.
    """
    values: list[float] = []
    degrees: list[float] = []
    for knot in _needed(lines):
        x = float(knot.x)
        for y in (knot.at, knot.above) if knot.at != knot.above else (knot.at,):
            if len(values) > 1 and values[-2] == x:
                values.pop()  # three at one value; the last is what follows
                degrees.pop()
            values.append(x)
            degrees.append(min(float(y), BELOW_ONE) if y < 1 else 1.0)
    if len(values) > MOST_POINTS:
        raise LossError(f"{len(values)} points are more than {MOST_POINTS}")
    points = Points(tuple(values), tuple(degrees))
    return points, _distance(lines, lines_of(points))


def _needed(lines: Sequence[_Knot]) -> Iterator[_Knot]:
    """Yield the knots at which something changes, none too far from the next."""
    kept = lines[0].x
    floats = [(float(knot.x), float(knot.at), float(knot.above)) for knot in lines]
    for place, knot in enumerate(lines):
        if 0 < place < len(lines) - 1 and knot.at == knot.above:
            is_bent = _is_surely_bent(*floats[place - 1 : place + 2])
            before, after = lines[place - 1], lines[place + 1]
            if not is_bent and after.x - kept <= _FARTHEST:
                left = (knot.at - before.above) * (after.x - knot.x)
                if left == (after.at - knot.above) * (knot.x - before.x):
                    continue
        kept = knot.x
        yield knot


_Floats = tuple[float, float, float]


def _is_surely_bent(before: _Floats, knot: _Floats, after: _Floats) -> bool:
    """Return whether doubles tell that a knot does not lie on the line of two others.

    Numbers are off by half a unit in the last place each, and so are results: 16 units
    of the sizes that enter are more than all of it.
    """
    left, right = knot[0] - before[0], after[0] - knot[0]
    rise = (knot[1] - before[2]) * right - (after[1] - knot[2]) * left
    degrees = abs(knot[1]) + abs(before[2]) + abs(after[1])
    values = abs(knot[0]) + abs(before[0]) + abs(after[0])
    return abs(rise) > 2.0**-48 * (degrees * (left + right) + 2.0 * degrees * values)


def _joined(
    one: Lines, other: Lines, choose: Callable[[Fraction, Fraction], Fraction]
) -> Lines:
    knots: list[_Knot] = []
    for before, here in itertools.pairwise([None, *_common(one, other)]):
        assert here is not None  # only the first is
        if before is not None and _is_crossing(before[1], before[2], here[1], here[2]):
            start = before[1].above - before[2].above
            share = start / (start - here[1].at + here[2].at)
            x = before[0] + (here[0] - before[0]) * share
            y = before[1].above + (here[1].at - before[1].above) * share
            knots.append(_Knot(x, y, y))
        x, first, second = here
        knots.append(
            _Knot(x, choose(first.at, second.at), choose(first.above, second.above))
        )
    return tuple(_needed(knots))


def _is_crossing(one: _Knot, other: _Knot, end: _Knot, other_end: _Knot) -> bool:
    if one.above < other.above:
        return end.at > other_end.at
    return end.at < other_end.at and one.above != other.above


def _common(one: Lines, other: Lines) -> list[tuple[Fraction, _Knot, _Knot]]:
    """Return the values of all knots, and what each of the two has there."""
    result: list[tuple[Fraction, _Knot, _Knot]] = []
    i = j = 0
    while i < len(one) or j < len(other):
        first = one[i] if i < len(one) else None
        second = other[j] if j < len(other) else None
        if second is None or (first is not None and first.x < second.x):
            assert first is not None  # one of the two is left
            i, second = i + 1, _inner(other, j, first.x)
        elif first is None or second.x < first.x:
            j, first = j + 1, _inner(one, i, second.x)
        else:
            i, j = i + 1, j + 1
        result.append((first.x, first, second))
    return result


def _inner(lines: Lines, place: int, x: Fraction) -> _Knot:
    """Return what lines have at a value between two knots, or beyond all of them."""
    low, high = lines[max(place - 1, 0)], lines[min(place, len(lines) - 1)]
    if place == 0:
        y = high.at
    elif place == len(lines) or low.above == high.at:
        y = low.above
    else:
        y = low.above + (high.at - low.above) * (x - low.x) / (high.x - low.x)
    return _Knot(x, y, y)


def _distance(one: Lines, other: Lines) -> float:
    """Return how far two can be apart, rounded up; a moved step counts in whole."""
    worst = Fraction(0)
    for _, first, second in _common(one, other):
        worst = max(worst, abs(first.at - second.at), abs(first.above - second.above))
    return outwards(worst)[1]
