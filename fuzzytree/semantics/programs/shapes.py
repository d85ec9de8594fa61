"""Degrees of a rule base's shapes as steps: the reference's operations, in its order.

Each function here mirrors one of `fuzzytree.semantics.reference`; it may leave out what
changes no bit, such as a multiplication by 1, and nothing else.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fuzzytree.model.rulebase import LR, Band, Flank, Points, Shape, Side, Variable
from fuzzytree.semantics.programs.steps import Maker

BELOW_ONE = 1.0 - 2.0**-53

FEW_POINTS = 8
"""Up to so many points each line has steps of its own; more are looked up."""


def degree(make: Maker, shape: Shape, x: int) -> int:
    """Return how far a value belongs to a shape."""
    match shape:
        case Band():
            return _band(make, shape, x)
        case LR(mean=mean, left=below, right=above):
            distance = make("subtract", x, make.constant(mean))
            left = _side(make, below, make("negate", distance))
            return make("minimum", left, _side(make, above, distance))
        case Points():
            return _points(make, shape, x)


def axis(make: Maker, variable: Variable) -> int:
    """Return the value of a variable: an input, or a sum of parts in order."""
    if not variable.parts:
        return make.input(variable.name)
    terms: list[int] = []
    for part in variable.parts:
        value = make.input(part.input)
        offset = make("subtract", value, make.constant(part.centre))
        terms.append(make("multiply", make.constant(part.weight), offset))
    return make.chain("add", terms)


def clip(make: Maker, x: int, high: float) -> int:
    """Return min(max(x, 0), high)."""
    above = make("maximum", x, make.constant(0.0))
    return make("minimum", above, make.constant(high))


def horner(make: Maker, coefficients: Sequence[float], x: int) -> int:
    """Return c0 + x (c1 + x (c2 + ...)), from the inside out."""
    total = make.constant(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = make("add", make("multiply", total, x), make.constant(coefficient))
    return total


def _band(make: Maker, band: Band, x: int) -> int:
    found = make.constant(1.0)
    if band.high is not None:
        right = _flank(make, band.right, x)
        found = make("where", make("less", make.constant(band.high), x), right, found)
    if band.low is not None:
        left = _flank(make, band.left, x)
        found = make("where", make("at_most", x, make.constant(band.low)), left, found)
    return found


def _flank(make: Maker, flank: Flank | None, x: int) -> int:
    if flank is None:
        return make.constant(0.0)
    offset = make("subtract", x, make.constant(flank.end))
    slope = make("divide", offset, make.constant(flank.start - flank.end))
    position = clip(make, slope, 1.0)
    curve = make("multiply", horner(make, flank.curve, position), position)
    return clip(make, curve, BELOW_ONE)


def _side(make: Maker, side: Side, distance: int) -> int:
    one = make.constant(1.0)
    u = clip(make, make("divide", distance, make.constant(side.spread)), side.reach)
    t = make("minimum", u, one)
    v = make("subtract", make("multiply", make.constant(2.0), t), one)
    fall = make("multiply", t, horner(make, side.curve, v))
    body = clip(make, make("subtract", one, fall), 1.0)
    rest = make("subtract", make.constant(side.reach), u)
    w = clip(make, make("divide", rest, make.constant(side.reach - 1.0)), 1.0)
    square = make("multiply", w, w)
    return make("multiply", body, make("multiply", square, square))


def smaller_slope(make: Maker, slopes: Sequence[int], *, is_peak: bool) -> int:
    """Return the smaller of some slopes, held in [0, 1].

    Rounding keeps order, so a slope is at least 1 wherever the other one counts.

    Args:
        make: Where the steps go.
        slopes: One or two.
        is_peak: Whether they meet at 1, so that one of them is at most 1 anywhere.
    """
    found = make.chain("minimum", slopes)
    if not is_peak:
        found = make("minimum", found, make.constant(1.0))
    return make("maximum", found, make.constant(0.0))


def _points(make: Maker, points: Points, x: int) -> int:
    if len(points.values) > FEW_POINTS:
        return _looked_up(make, points, x)
    slopes = _slopes(make, points, x)
    if slopes:
        return smaller_slope(make, slopes, is_peak=len(points.values) == 3)
    found = make.constant(points.degrees[-1])
    pairs = list(zip(points.values, points.degrees, strict=True))
    for (left, below), (right, above) in reversed(list(itertools.pairwise(pairs))):
        if left < right:
            line = _piece(make, left, below, right, above, x)
            inside = make("at_most", x, make.constant(right))
            found = make("where", inside, line, found)
    first = make("at_most", x, make.constant(points.values[0]))
    return make("where", first, make.constant(points.degrees[0]), found)


def _piece(
    make: Maker, left: float, below: float, right: float, above: float, x: int
) -> int:
    """Return the degree between two points; elsewhere it may be anything.

    Level, it is one number. From 0, the quotient's part of the other degree needs no
    hold: the quotient lies in [0, 1].
    """
    if below == above:
        return make.constant(below)
    places = [make.constant(end) for end in _ends(left, below, right, above)]
    anchor, other, near, far = places
    if make.number(near) != 0.0:
        return _line(make, places, x)
    width = make("subtract", other, anchor)
    share = make("divide", make("subtract", x, anchor), width)
    return make("multiply", share, far)


def _slopes(make: Maker, points: Points, x: int) -> list[int]:
    """Return the slopes of ramps, triangles and trapezoids; none of other points."""
    values = points.values
    widths = [right - left for left, right in itertools.pairwise(values)]
    if not all(0.0 < width < math.inf for width in widths):
        return []
    match points.degrees:
        case (0.0, 1.0) | (0.0, 1.0, 0.0) | (0.0, 1.0, 1.0, 0.0) | (1.0, 0.0):
            pass
        case _:
            return []
    slopes: list[int] = []
    if points.degrees[0] == 0.0:
        offset = make("subtract", x, make.constant(values[0]))
        slopes.append(make("divide", offset, make.constant(values[1] - values[0])))
    if points.degrees[-1] == 0.0:
        offset = make("subtract", x, make.constant(values[-1]))
        slopes.append(make("divide", offset, make.constant(values[-2] - values[-1])))
    return slopes


def _looked_up(make: Maker, points: Points, x: int) -> int:
    """Return the degree on a line whose ends are looked up in tables.

    Before the first point and behind the last one the line is level.
    """
    pairs = list(zip(points.values, points.degrees, strict=True))
    (first, low), (last, high) = pairs[0], pairs[-1]
    ends = [(first, first - 1.0, low, low)]
    for (left, below), (right, above) in itertools.pairwise(pairs):
        ends.append(_ends(left, below, right, above))
    ends.append((last, last - 1.0, high, high))
    place = make.table("below", x, points.values)
    looked = [make.table("pick", place, table) for table in zip(*ends, strict=True)]
    line = _line(make, looked, x)
    outer = [0.0] * len(ends)
    outer[0] = outer[-1] = 1.0
    is_outer = make("less", make.constant(0.5), make.table("pick", place, outer))
    return make("where", is_outer, looked[2], line)


def _ends(
    left: float, below: float, right: float, above: float
) -> tuple[float, float, float, float]:
    """Return the anchor of a line, its other end, and the degrees of the two."""
    if below == 0.0:
        return left, right, below, above
    return right, left, above, below


def _line(make: Maker, ends: Sequence[int], x: int) -> int:
    anchor, other, near, far = ends
    share = make("divide", make("subtract", x, anchor), make("subtract", other, anchor))
    rise = make("multiply", share, make("subtract", far, near))
    line = make("add", near, rise)
    held = make("maximum", line, make("minimum", near, far))
    return make("minimum", held, make("maximum", near, far))
