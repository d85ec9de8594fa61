"""What each membership function is, in operations of programs.

The inference performs the operations on doubles, programs hold them as steps. Where
there is a choice between formulas, all are computed and `where` takes one, so that a
formula may give NaN or an infinity where it is not taken. The steps of rule bases'
functions mirror `fuzzytree.semantics.reference`; they may leave out what changes no
bit, such as a multiplication by 1, and nothing else.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import assert_never

from fuzzytree.model import (
    LR,
    Band,
    Curve,
    Flank,
    Points,
    Shape,
    Side,
    SystemCurve,
    Variable,
    curves,
)
from fuzzytree.semantics.programs.formulas import as_number, value_of
from fuzzytree.semantics.programs.operations import N, Numbers
from fuzzytree.semantics.programs.steps import Maker
from fuzzytree.semantics.reference import BELOW_ONE


def is_unit(curve: Curve) -> bool:
    """Return whether a curve's degree lies in [0, 1] at every finite value, surely."""
    match curve:
        case (
            curves.Formula() | curves.Linear() | curves.SemiEllipse()
        ):  # a root may be rounded above 1
            return False
        case curves.SCurve(start=start, end=end) | curves.Arc(start=start, end=end):
            return math.isfinite(end - start)
        case curves.PiCurve(a=a, b=b, c=c, d=d):
            return math.isfinite(b - a) and math.isfinite(d - c)
        case curves.Sigmoid(slope=slope):
            return slope != 0.0
        case (
            curves.SigmoidDifference(first=first, second=second)
            | curves.SigmoidProduct(first=first, second=second)
        ):
            return is_unit(first) and is_unit(second)
        case curves.Bell(slope=slope):
            return slope != 0.0
        case curves.Concave(inflection=inflection, end=end):
            return math.isfinite(2.0 * (end - inflection))
        case _:
            return True


def curve_degree(make: Maker, curve: Curve, x: int, names: Mapping[str, int]) -> int:
    """Return the step of the degree at a value, without the term's height."""
    match curve:
        case Band() | LR() | Points():
            return shape_degree(make, curve, x)
        case _:
            return system_degree(make, curve, x, names)


def system_degree(
    make: Numbers[N], curve: SystemCurve, x: N, names: Mapping[str, N]
) -> N:
    """Return the degree at a value, without the term's height."""
    match curve:
        case curves.Trapezoid():
            return _trapezoid(make, curve, x)
        case curves.Gaussian(mean=mean, deviation=deviation):
            return _gaussian(make, x, mean, deviation)
        case curves.TwoGaussians():
            left, right = curve.left, curve.right
            low = make("minimum", x, make.constant(left))
            high = make("maximum", x, make.constant(right))
            below = _gaussian(make, low, left, curve.left_deviation)
            above = _gaussian(make, high, right, curve.right_deviation)
            return make("multiply", below, above)
        case curves.Bell(center=center, width=width, slope=slope):
            size = make("absolute", _scaled(make, x, center, width))
            power = make("power", size, make.constant(2.0 * slope))
            return _one_by_one_plus(make, power)
        case curves.Sigmoid(inflection=inflection, slope=slope):
            offset = make("subtract", x, make.constant(inflection))
            steep = make("multiply", make.constant(-slope), offset)
            return _one_by_one_plus(make, make("exponential", steep))
        case curves.SigmoidDifference(first=first, second=second):
            pair = [system_degree(make, one, x, names) for one in (first, second)]
            return make("absolute", make("subtract", *pair))
        case curves.SigmoidProduct(first=first, second=second):
            pair = [system_degree(make, one, x, names) for one in (first, second)]
            return make("multiply", *pair)
        case curves.SCurve(start=start, end=end):
            return _s(make, x, start, end)
        case curves.PiCurve():
            return _pi(make, curve, x)
        case curves.Cosine(center=center, width=width):
            return _cosine(make, _scaled(make, x, center, width))
        case curves.Concave(inflection=inflection, end=end):
            return _concave(make, x, inflection, end)
        case curves.Spike(center=center, width=width):
            t = _scaled(make, x, center, width)
            size = make("absolute", make("multiply", make.constant(10.0), t))
            return make("exponential", make("negate", size))
        case curves.Arc(start=start, end=end):
            return _arc(make, _scaled(make, x, start, end - start))
        case curves.SemiEllipse(start=start, end=end):
            return _semi_ellipse(make, x, start, end)
        case curves.Binary(start=start, is_above=is_above):
            ends = (make.constant(start), x) if is_above else (x, make.constant(start))
            return as_number(make, make("at_most", *ends))
        case curves.Singleton(value=value):
            return as_number(make, make("equal", x, make.constant(value)))
        case curves.Linear():
            return make.constant(math.nan)
        case curves.Formula(expression=expression):
            return value_of(make, expression, {**names, "x": x})
        case _:
            assert_never(curve)


def value_at(make: Numbers[N], curve: Curve, degree: N) -> N | None:
    """Return where a monotone curve has a degree; None for the other curves."""
    one = make.constant(1.0)
    match curve:
        case Points(values=(first, last), degrees=(0.0, 1.0)) if first < last:
            rise = make("multiply", make.constant(last - first), degree)
            return make("add", make.constant(first), rise)
        case Points(values=(first, last), degrees=(1.0, 0.0)) if first < last:
            rise = make("multiply", make.constant(first - last), degree)
            return make("add", make.constant(last), rise)
        case curves.Sigmoid(inflection=inflection, slope=slope):
            odds = make("logarithm", _odds(make, degree))
            steep = make("divide", odds, make.constant(slope))
            return make("subtract", make.constant(inflection), steep)
        case curves.SCurve(start=start, end=end):
            width, half = make.constant(end - start), make.constant(0.5)
            low = make("square_root", make("multiply", half, degree))
            rest = make("multiply", half, make("subtract", one, degree))
            high = make("square_root", rest)
            low = make("add", make.constant(start), make("multiply", width, low))
            high = make("subtract", make.constant(end), make("multiply", width, high))
            return make("where", make("at_most", degree, half), low, high)
        case curves.Concave(inflection=inflection, end=end):
            back = make(
                "multiply", make.constant(end - inflection), _odds(make, degree)
            )
            return make("subtract", make.constant(end), back)
        case curves.Arc(start=start, end=end):
            below, above = make("subtract", one, degree), make("add", one, degree)
            root = make("square_root", make("multiply", below, above))
            back = make("multiply", make.constant(end - start), root)
            return make("subtract", make.constant(end), back)
        case _:
            return None


def _odds(make: Numbers[N], degree: N) -> N:
    one = make.constant(1.0)
    return make("subtract", make("divide", one, degree), one)


def _scaled(make: Numbers[N], x: N, start: float, width: float) -> N:
    offset = make("subtract", x, make.constant(start))
    return make("divide", offset, make.constant(width))


def _one_by_one_plus(make: Numbers[N], a: N) -> N:
    one = make.constant(1.0)
    return make("divide", one, make("add", one, a))


def _trapezoid(make: Numbers[N], curve: curves.Trapezoid, x: N) -> N:
    """Return the smaller slope, clamped to [0, 1]; an upright side is cut off last."""
    a, b, c, d = curve.a, curve.b, curve.c, curve.d
    slopes: list[N] = []
    if a is not None and a < b:
        slopes.append(_scaled(make, x, a, b - a))
    if d is not None and c < d:
        rest = make("subtract", make.constant(d), x)
        slopes.append(make("divide", rest, make.constant(d - c)))
    zero, one = make.constant(0.0), make.constant(1.0)
    result = one
    if slopes:
        is_peak = len(slopes) == 2 and b == c
        result = smaller_slope(make, slopes, is_peak=is_peak)
    if a is not None and a == b:
        result = make("where", make("less", x, make.constant(a)), zero, result)
    if d is not None and c == d:
        result = make("where", make("less", make.constant(d), x), zero, result)
    return result


def smaller_slope(make: Numbers[N], slopes: Sequence[N], *, is_peak: bool) -> N:
    """Return the smaller of some slopes, clamped to [0, 1].

    Rounding keeps order, so a slope is at least 1 wherever the other one counts.
    """
    result = make.chain("minimum", slopes)
    if not is_peak:
        result = make("minimum", result, make.constant(1.0))
    return make("maximum", result, make.constant(0.0))


def _gaussian(make: Numbers[N], x: N, mean: float, deviation: float) -> N:
    t = _scaled(make, x, mean, deviation)
    square = make("multiply", t, t)
    return make("exponential", make("multiply", make.constant(-0.5), square))


def _s(make: Numbers[N], x: N, start: float, end: float) -> N:
    zero, one, two = (make.constant(number) for number in (0.0, 1.0, 2.0))
    if start == end:
        return make("where", make("at_most", x, make.constant(start)), zero, one)
    t = _scaled(make, x, start, end - start)
    rest = _scaled(make, x, end, end - start)
    low = make("multiply", two, make("multiply", t, t))
    high = make("subtract", one, make("multiply", two, make("multiply", rest, rest)))
    result = make("where", make("at_most", one, t), one, high)
    result = make("where", make("at_most", t, make.constant(0.5)), low, result)
    return make("where", make("at_most", t, zero), zero, result)


def _pi(make: Numbers[N], curve: curves.PiCurve, x: N) -> N:
    zero, one = make.constant(0.0), make.constant(1.0)
    falling = _s(make, x, curve.d, curve.c)
    is_behind = make("at_most", make.constant(curve.d), x)
    falling = make("where", is_behind, zero, falling)
    falling = make("where", make("at_most", x, make.constant(curve.c)), one, falling)
    return make("multiply", _s(make, x, curve.a, curve.b), falling)


def _cosine(make: Numbers[N], t: N) -> N:
    one, half = make.constant(1.0), make.constant(0.5)
    wave = make("cosine", make("multiply", make.constant(2.0 * math.pi), t))
    inside = make("at_most", make("absolute", t), half)
    degree = make("multiply", half, make("add", one, wave))
    return make("where", inside, degree, make.constant(0.0))


def _concave(make: Numbers[N], x: N, inflection: float, end: float) -> N:
    one, there = make.constant(1.0), make.constant(end)
    if inflection <= end:
        width, gap = make.constant(end - inflection), make("subtract", there, x)
        outside = make("less", x, there)
    else:
        width, gap = make.constant(inflection - end), make("subtract", x, there)
        outside = make("less", there, x)
    share = make("divide", width, make("add", width, gap))
    return make("where", outside, share, one)


def _arc(make: Numbers[N], u: N) -> N:
    zero, one = make.constant(0.0), make.constant(1.0)
    rest = make("subtract", make.constant(2.0), u)
    root = make("square_root", make("multiply", u, rest))
    result = make("where", make("at_most", one, u), one, root)
    return make("where", make("at_most", u, zero), zero, result)


def _semi_ellipse(make: Numbers[N], x: N, start: float, end: float) -> N:
    width = make.constant(end - start)
    left = _scaled(make, x, start, end - start)
    right = make("divide", make("subtract", make.constant(end), x), width)
    root = make("square_root", make("multiply", left, right))
    degree = make("multiply", make.constant(2.0), root)
    above = make("at_most", make.constant(start), x)
    inside = make("and", above, make("at_most", x, make.constant(end)))
    return make("where", inside, degree, make.constant(0.0))


FEW_POINTS = 8
"""Up to so many points each line has steps of its own; more are looked up."""


def shape_degree(make: Maker, shape: Shape, x: int) -> int:
    """Return how far a value belongs to a shape."""
    match shape:
        case Band():
            return _band(make, shape, x)
        case LR(mean=mean, left=below, right=above):
            distance = make("subtract", x, make.constant(mean))
            left = _side(make, below, make("negate", distance))
            return make("minimum", left, _side(make, above, distance))
        case Points():
            return _points_degree(make, shape, x)


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
    result = make.constant(1.0)
    if band.high is not None:
        right = _flank(make, band.right, x)
        result = make("where", make("less", make.constant(band.high), x), right, result)
    if band.low is not None:
        left = _flank(make, band.left, x)
        result = make(
            "where", make("at_most", x, make.constant(band.low)), left, result
        )
    return result


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


def _points_degree(make: Maker, points: Points, x: int) -> int:
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
            inside = make("at_most", x, make.constant(right))
            result = make("where", inside, line, result)
    first = make("at_most", x, make.constant(points.values[0]))
    return make("where", first, make.constant(points.degrees[0]), result)


def _piece(
    make: Maker, left: float, below: float, right: float, above: float, x: int
) -> int:
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
    return make("multiply", make("divide", offset, width), far)


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
    clamped = make("maximum", line, make("minimum", near, far))
    return make("minimum", clamped, make("maximum", near, far))
