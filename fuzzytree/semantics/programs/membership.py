"""What each membership function is, as steps of programs.

The steps of rule bases' functions mirror `fuzzytree.semantics.reference`; they may
leave out what changes no bit, such as a multiplication by 1, and nothing else.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fuzzytree.model import (
    LR,
    Band,
    Curve,
    N,
    Numbers,
    Points,
    Shape,
    Side,
    Variable,
    smaller_slope,
)
from fuzzytree.semantics.programs.steps import Maker, Place
from fuzzytree.semantics.reference import BELOW_ONE


def is_unit(curve: Curve) -> bool:
    """Return whether a curve's degree lies in [0, 1] at every finite value, surely."""
    return isinstance(curve, Shape) or curve.is_unit


def curve_degree(make: Maker, curve: Curve, x: Place) -> Place:
    """Return the step of the degree at a value, without the term's height."""
    if isinstance(curve, Shape):
        return shape_degree(make, curve, x)
    return curve.degree(make, x)


def value_at(n: Numbers[N], curve: Curve, degree: N) -> N | None:
    """Return where a monotone curve has a degree; None for the other curves."""
    match curve:
        case Points(values=(first, last), degrees=(0.0, 1.0)) if first < last:
            return first + (last - first) * degree
        case Points(values=(first, last), degrees=(1.0, 0.0)) if first < last:
            return last + (first - last) * degree
        case Band() | LR() | Points():
            return None
        case _:
            return curve.inverse(n, degree)


FEW_POINTS = 8
"""Up to so many points each line has steps of its own; more are looked up."""


def shape_degree(make: Maker, shape: Shape, x: Place) -> Place:
    """Return how far a value belongs to a shape."""
    match shape:
        case Band():
            return _band(make, shape, x)
        case LR(mean=mean, left=below, right=above):
            distance = x - mean
            left = _side(make, below, -distance)
            return make.minimum(left, _side(make, above, distance))
        case Points():
            return _points_degree(make, shape, x)


def axis(make: Maker, variable: Variable) -> Place:
    """Return the value of a variable: an input, or a sum of parts in order."""
    if not variable.parts:
        return make.input(variable.name)
    terms: list[Place] = []
    for part in variable.parts:
        value = make.input(part.input)
        offset = value - part.centre
        terms.append(part.weight * offset)
    return make.chain("add", terms)


def clip(make: Maker, x: Place, high: float) -> Place:
    """Return min(max(x, 0), high)."""
    above = make.maximum(x, 0.0)
    return make.minimum(above, high)


def horner(make: Maker, coefficients: Sequence[float], x: Place) -> Place:
    """Return c0 + x (c1 + x (c2 + ...)), from the inside out."""
    total = make.constant(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = (total * x) + coefficient
    return total


def _band(make: Maker, band: Band, x: Place) -> Place:
    result = make.constant(1.0)
    if band.high is not None:
        right = _flank(make, band.high, band.right, x)
        result = make.where(make.less(band.high, x), right, result)
    if band.low is not None:
        left = _flank(make, band.low, band.left, x)
        result = make("where", make.at_most(x, band.low), left, result)
    return result


def _flank(make: Maker, edge: float, end: float | None, x: Place) -> Place:
    if end is None:
        return make.constant(0.0)
    return clip(make, (x - end) / (edge - end), BELOW_ONE)


def _side(make: Maker, side: Side, distance: Place) -> Place:
    one = make.constant(1.0)
    u = clip(make, distance / side.spread, side.reach)
    t = make.minimum(u, one)
    v = (2.0 * t) - one
    fall = t * horner(make, side.curve, v)
    body = clip(make, one - fall, 1.0)
    rest = side.reach - u
    w = clip(make, rest / (side.reach - 1.0), 1.0)
    square = w * w
    return body * (square * square)


def _points_degree(make: Maker, points: Points, x: Place) -> Place:
    if len(points.values) > FEW_POINTS:
        return _looked_up(make, points, x)
    slopes = _slopes(make, points, x)
    if slopes:
        return smaller_slope(make, slopes, is_peak=len(points.values) == 3)
    result = make.constant(points.degrees[-1])
    pairs = list(zip(points.values, points.degrees, strict=True))
    for (left, below), (right, above) in reversed(list(itertools.pairwise(pairs))):
        if left < right:
            line = _piece(make, left, below, right, above, x)
            inside = make.at_most(x, right)
            result = make.where(inside, line, result)
    first = make.at_most(x, points.values[0])
    return make.where(first, points.degrees[0], result)


def _piece(
    make: Maker, left: float, below: float, right: float, above: float, x: Place
) -> Place:
    """Return the degree between two points; elsewhere it may be anything.

    Level, it is one number. From 0, the quotient's part of the other degree needs no
    clamping: the quotient lies in [0, 1].
    """
    if below == above:
        return make.constant(below)
    places = [make.constant(end) for end in _ends(left, below, right, above)]
    anchor, other, near, far = places
    if make.number(near) != 0.0:
        return _line(make, places, x)
    rise = ((x, anchor), (other, anchor))
    if right == make.number(anchor):  # the other way round, for 0 and never -0
        rise = ((anchor, x), (anchor, other))
    offset, width = (make("subtract", *pair) for pair in rise)
    return (offset / width) * far


def _slopes(make: Maker, points: Points, x: Place) -> list[Place]:
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
    slopes: list[Place] = []
    if points.degrees[0] == 0.0:
        offset = x - values[0]
        slopes.append(offset / (values[1] - values[0]))
    if points.degrees[-1] == 0.0:
        offset = x - values[-1]
        slopes.append(offset / (values[-2] - values[-1]))
    return slopes


def _looked_up(make: Maker, points: Points, x: Place) -> Place:
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
    is_outer = make.less(0.5, make.table("pick", place, outer))
    return make.where(is_outer, looked[2], line)


def _ends(
    left: float, below: float, right: float, above: float
) -> tuple[float, float, float, float]:
    """Return the anchor of a line, its other end, and the degrees of the two."""
    if below == 0.0:
        return left, right, below, above
    return right, left, above, below


def _line(make: Maker, ends: Sequence[Place], x: Place) -> Place:
    anchor, other, near, far = ends
    share = (x - anchor) / (other - anchor)
    rise = share * (far - near)
    line = near + rise
    clamped = make.maximum(line, make.minimum(near, far))
    return make.minimum(clamped, make.maximum(near, far))
