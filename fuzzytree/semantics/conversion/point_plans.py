"""How curves bend: the pieces along which points can be placed, and chords' errors.

Products and differences of two sigmoids bend to either side. With
`t = slope (x - inflection)` and `s = 1 / (1 + exp(-t))` a sigmoid's derivatives by t
are `s' = s (1 - s)`, largest at 0, and `s'' = s' (1 - 2 s)`, whose extremes are at
`t = +-ln(2 + sqrt(3))`. So each has a range over an interval of t, and

    (s1 s2)'' = k1^2 s1'' s2 + 2 k1 k2 s1' s2' + k2^2 s1 s2''
    (s1 - s2)'' = k1^2 s1'' - k2^2 s2''

have one over an interval of x, by interval arithmetic. The absolute difference has an
edge where both are equal, `k1 (x - c1) = k2 (x - c2)`, and is smooth elsewhere.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.errors import LossError
from fuzzytree.model import (
    Curve,
    curves,
)
from fuzzytree.semantics.inference.degrees import curve_degree
from fuzzytree.semantics.programs.operations import divide
from fuzzytree.semantics.programs.operations import power as raised

Function = Callable[[float], float]
Error = Callable[[float, float], float]


class CurvePiece(NamedTuple):
    """A stretch of a curve."""

    start: float
    end: float
    error: Error


class PointPlan(NamedTuple):
    """How points can be placed along a curve.

    Attributes:
        parts: Pieces, and points that must be there, from left to right; the curve is
            constant between two that do not meet.
        tail: How far it can be from its outermost points' degrees beyond them.
        slack: What rounding can add to any error.
        first: The degree of the first point, if it is known better than computed.
        last: The degree of the last one.
    """

    parts: tuple[CurvePiece | tuple[float, float], ...]
    tail: float = 0.0
    slack: float = 0.0
    first: float | None = None
    last: float | None = None


def bent(value: Function, slope: Function) -> Error:
    """Return the error of chords of a curve that bends to one side only.

    Example:
        >>> bent(lambda x: x * x, lambda x: 2.0 * x)(0.0, 1.0)
        0.25
    """

    def error(a: float, b: float) -> float:
        middle = a + (b - a) / 2
        if not a < middle < b:
            return 0.0  # no double lies between
        at_a, at_m, at_b = value(a), value(middle), value(b)
        rise = slope(middle)
        chord = (at_b - at_a) / (b - a)

        def apart(x: float) -> float:
            return abs((at_a + chord * (x - a)) - (at_m + rise * (x - middle)))

        left = _meeting(a, at_a, slope(a), middle, at_m, rise)
        right = _meeting(b, at_b, slope(b), middle, at_m, rise)
        return max(apart(left), apart(right))

    return error


def _meeting(
    end: float, at_end: float, outer: float, middle: float, at_m: float, rise: float
) -> float:
    """Return where the tangent at an end meets that in the middle, between the two."""
    if math.isinf(outer) or outer == rise:
        return end
    chord = (at_m - at_end) / (middle - end)
    share = (rise - chord) / (rise - outer)
    return end + (middle - end) * min(max(share, 0.0), 1.0)


_TAIL = 0.99  # tails end a little below the tolerance, so that rounding has room


def plan_of(curve: Curve, tolerance: float) -> PointPlan:
    """Return how points can be placed along a curve that is no points itself.

    Raises:
        LossError: If the curve has no degrees of its own.
    """
    tail = tolerance * _TAIL
    match curve:
        case curves.Gaussian(mean=mean, deviation=deviation):
            return _two_gaussians(
                curve, curves.TwoGaussians(mean, deviation, mean, deviation), tail
            )
        case curves.TwoGaussians():
            return _two_gaussians(curve, curve, tail)
        case curves.Bell():
            return _bell(curve, tail)
        case curves.Sigmoid():
            return _sigmoid(curve, tail)
        case curves.SigmoidDifference() | curves.SigmoidProduct():
            return sigmoid_plan(curve, tolerance)
        case curves.SCurve():
            return _s(curve)
        case curves.PiCurve():
            return _pi(curve)
        case curves.Cosine():
            return _cosine(curve)
        case curves.Concave():
            return _concave(curve, tail)
        case curves.Spike():
            return _spike(curve, tail)
        case curves.Arc():
            return _arc(curve)
        case curves.SemiEllipse():
            return _semi_ellipse(curve)
        case _:
            raise LossError("it is a formula, of which nothing is known between points")


def _pieces(curve: Curve, knots: Iterable[float], slope: Function) -> list[CurvePiece]:
    """Return the pieces between some places, on each of which the curve bends once."""

    def value(x: float) -> float:
        return curve_degree(curve, x)

    error = bent(value, slope)
    places = sorted(set(knots))
    return [CurvePiece(a, b, error) for a, b in itertools.pairwise(places)]


def _slack(scale: float, knots: Iterable[float], power: float = 1.0) -> float:
    """Return what rounding can add to the error of a chord.

    Degrees and slopes are good to a few units, amplified by `power`. A smooth
    inflection that is rounded by h leaves a stretch of that width, and a bend of its
    order, on the wrong side: it moves a chord by the order of its square.
    """
    coarse = divide(16.0 * math.ulp(max(map(abs, knots))), scale)
    return (2.0**-44 + coarse * coarse) * (1.0 + power)


def _two_gaussians(curve: Curve, two: curves.TwoGaussians, tail: float) -> PointPlan:
    left, right = two.left, two.right
    below, above = two.left_deviation, two.right_deviation
    reach = math.sqrt(-2.0 * math.log(tail))
    start, end = left - reach * below, right + reach * above
    knots = [left, right]
    knots += [x for x in (left - below,) if x < right]
    knots += [x for x in (right + above,) if x > left]
    if left > right:  # between them both fall: a gaussian of their precisions' sum
        ratio = below / above
        mean = right + (left - right) / (1.0 + ratio * ratio)
        spread = below * (above / math.hypot(below, above))
        knots += [mean]
        knots += [x for x in (mean - spread, mean + spread) if right < x < left]
        if not start < end:  # nowhere above the tolerance
            return PointPlan(((mean, curve_degree(curve, mean)),), tail)

    def slope(x: float) -> float:
        rising = (left - min(x, left)) / below / below
        falling = (max(x, right) - right) / above / above
        return curve_degree(curve, x) * (rising - falling)

    inner = [start, *(x for x in knots if start < x < end), end]
    slack = _slack(min(below, above), [*inner, left, right])
    return PointPlan(tuple(_pieces(curve, inner, slope)), tail, slack)


def _halves(
    curve: Curve, center: float, places: Sequence[float], steepness: Function
) -> list[CurvePiece]:
    """Return the pieces of a curve that falls alike on both sides of its center."""
    left = [*(center - d for d in places), center]
    right = [center, *(center + d for d in places)]
    return [
        *_pieces(curve, left, lambda x: steepness(center - x)),
        *_pieces(curve, right, lambda x: -steepness(x - center)),
    ]


def _bell(curve: curves.Bell, tail: float) -> PointPlan:
    power, width = 2.0 * abs(curve.slope), curve.width
    if power == 0.0:
        return PointPlan(((curve.center, 0.5),))
    sign = math.copysign(1.0, curve.slope)

    def steepness(distance: float) -> float:
        if distance == 0.0:
            return 0.0 if power > 1.0 else math.inf if power < 1.0 else sign / width
        u = raised(distance / width, power)
        return sign * power / distance / ((1.0 + u) * (1.0 + divide(1.0, u)))

    places = [width * raised(1.0 / tail - 1.0, 1.0 / power)]
    if power > 1.0:
        places.append(width * raised((power - 1.0) / (power + 1.0), 1.0 / power))
    inflections = [curve.center + d for d in (0.0, *places[1:])]
    slack = _slack(width, inflections, power)
    return PointPlan(
        tuple(_halves(curve, curve.center, places, steepness)), tail, slack
    )


def _spike(curve: curves.Spike, tail: float) -> PointPlan:
    rate = 10.0 / curve.width

    def steepness(distance: float) -> float:
        return rate * math.exp(-rate * distance)

    places = [-math.log(tail) / rate]
    ends = [curve.center + places[0], curve.center - places[0]]
    slack = _slack(curve.width / 10.0, ends)
    return PointPlan(
        tuple(_halves(curve, curve.center, places, steepness)), tail, slack
    )


def _cosine(curve: curves.Cosine) -> PointPlan:
    width = curve.width

    def steepness(distance: float) -> float:
        return math.pi / width * math.sin(2.0 * math.pi * (distance / width))

    places = [width / 2.0, width / 4.0]
    ends = [curve.center + places[0], curve.center - places[0]]
    parts = _halves(curve, curve.center, places, steepness)
    return PointPlan(tuple(parts), 0.0, _slack(width / 6.0, ends), 0.0, 0.0)


def _sigmoid(curve: curves.Sigmoid, tail: float) -> PointPlan:
    center, rate = curve.inflection, curve.slope
    if rate == 0.0:
        return PointPlan(((center, 0.5),))

    def slope(x: float) -> float:
        small = math.exp(-abs(rate * (x - center)))
        return rate * (small / (1.0 + small)) / (1.0 + small)

    reach = math.log(1.0 / tail - 1.0) / abs(rate)
    knots = [center - reach, center, center + reach]
    slack = _slack(1.0 / abs(rate), knots)
    return PointPlan(tuple(_pieces(curve, knots, slope)), tail, slack)


def _s_pieces(curve: Curve, start: float, end: float) -> tuple[list[CurvePiece], float]:
    """Return the pieces of an S from one value to another, and its slack.

    In the middle the bend jumps to the other side: a middle that is rounded moves a
    chord by the order of the rounding itself.
    """
    width = end - start
    middle = start + width / 2.0

    def slope(x: float) -> float:
        t = min(max((x - start) / width, 0.0), 1.0)
        return 4.0 * min(t, 1.0 - t) / width

    knots = [start, middle, end]
    coarse = 16.0 * math.ulp(max(map(abs, knots))) / abs(width)
    return _pieces(curve, knots, slope), 2.0**-44 + coarse


def _s(curve: curves.SCurve) -> PointPlan:
    if curve.start == curve.end:
        return PointPlan(((curve.start, 0.0), (curve.start, 1.0)))
    parts, slack = _s_pieces(curve, curve.start, curve.end)
    return PointPlan(tuple(parts), 0.0, slack)


def _pi(curve: curves.PiCurve) -> PointPlan:
    a, b, c, d = curve.a, curve.b, curve.c, curve.d
    if a == d:
        return PointPlan(((a, 0.0),))
    parts: list[CurvePiece | tuple[float, float]] = [(a, 0.0), (a, 1.0)]
    slack = 0.0
    if a < b:
        rising, slack = _s_pieces(curve, a, b)
        parts = [*rising]
    if c == d:
        return PointPlan((*parts, (c, 1.0), (c, 0.0)), 0.0, slack)
    falling, more = _s_pieces(curve, d, c)
    return PointPlan((*parts, *falling), 0.0, max(slack, more))


def _concave(curve: curves.Concave, tail: float) -> PointPlan:
    end = curve.end
    width = end - curve.inflection
    if width == 0.0:
        before = math.nextafter(end, -math.inf)
        return PointPlan(((before, 0.0), (before, 1.0)))

    def slope(x: float) -> float:
        degree = curve_degree(curve, x)
        return degree * degree / width

    knots = [end, end - width * (1.0 / tail - 1.0)]
    slack = _slack(abs(width), knots)
    return PointPlan(tuple(_pieces(curve, knots, slope)), tail, slack)


def _arc(curve: curves.Arc) -> PointPlan:
    start, end = curve.start, curve.end
    width = end - start
    if width == 0.0:
        raise LossError("it is an arc without width")

    def slope(x: float) -> float:
        u = (x - start) / width
        return math.inf if u <= 0.0 else (1.0 - u) / math.sqrt(u * (2.0 - u)) / width

    knots = [start, end]
    return PointPlan(
        tuple(_pieces(curve, knots, slope)), 0.0, _slack(abs(width), knots)
    )


def _semi_ellipse(curve: curves.SemiEllipse) -> PointPlan:
    start, end = curve.start, curve.end
    width = end - start
    if not width > 0.0:
        return PointPlan(((start, 0.0),))

    def slope(x: float) -> float:
        p, q = (x - start) / width, (end - x) / width
        return (q - p) / math.sqrt(p * q) / width if p * q > 0.0 else math.inf

    knots = [start, start + width / 2.0, end]
    return PointPlan(tuple(_pieces(curve, knots, slope)), 0.0, _slack(width, knots))


_EXTREME = math.log(2.0 + math.sqrt(3.0))


class _Range(NamedTuple):
    low: float
    high: float

    def times(self, other: _Range) -> _Range:
        products = [a * b for a in self for b in other]
        return _Range(min(products), max(products))

    def scaled(self, factor: float) -> _Range:
        ends = self.low * factor, self.high * factor
        return _Range(min(ends), max(ends))

    def plus(self, other: _Range) -> _Range:
        return _Range(self.low + other.low, self.high + other.high)


def sigmoid_plan(
    curve: curves.SigmoidDifference | curves.SigmoidProduct, tolerance: float
) -> PointPlan:
    """Return how points can be placed along two sigmoids.

    Where each sigmoid is within an eighth of the tolerance of 0 or 1, and so on for
    ever, product and difference are within a half of it of what they are there.
    """
    pair = [one for one in (curve.first, curve.second) if one.slope != 0.0]
    if not pair:
        x = curve.first.inflection
        return PointPlan(((x, curve_degree(curve, x)),))
    reach = math.log(8.0 / tolerance)
    start = min(one.inflection - reach / abs(one.slope) for one in pair)
    end = max(one.inflection + reach / abs(one.slope) for one in pair)
    knots = {start, end, *(one.inflection for one in pair)}
    if isinstance(curve, curves.SigmoidDifference):
        edge = _crossing(curve.first, curve.second)
        if edge is not None and start < edge < end:
            knots.add(edge)
    error = _error(curve)
    places = sorted(knots)
    parts = [CurvePiece(a, b, error) for a, b in itertools.pairwise(places)]
    steepness = sum(abs(one.slope) for one in pair) / 4.0
    slack = 2.0**-44 + 16.0 * math.ulp(max(map(abs, places))) * steepness
    return PointPlan(tuple(parts), tolerance / 2.0, slack)


def _crossing(first: curves.Sigmoid, second: curves.Sigmoid) -> float | None:
    """Return where two sigmoids are equal, rounded once."""
    k, m = Fraction(first.slope), Fraction(second.slope)
    if k == m:
        return None
    place = (k * Fraction(first.inflection) - m * Fraction(second.inflection)) / (k - m)
    try:
        return float(place)
    except OverflowError:
        return None


def _error(curve: curves.SigmoidDifference | curves.SigmoidProduct) -> Error:
    first, second = curve.first, curve.second
    k, m = first.slope, second.slope

    def error(a: float, b: float) -> float:
        value_1, slope_1, bend_1 = _ranges(first, a, b)
        value_2, slope_2, bend_2 = _ranges(second, a, b)
        if isinstance(curve, curves.SigmoidDifference):
            result = bend_1.scaled(k * k).plus(bend_2.scaled(-m * m))
        else:
            result = (
                bend_1.times(value_2)
                .scaled(k * k)
                .plus(slope_1.times(slope_2).scaled(2.0 * k * m))
                .plus(value_1.times(bend_2).scaled(m * m))
            )
        width = b - a
        return max(-result.low, result.high) * width * width / 8.0

    return error


def _ranges(one: curves.Sigmoid, a: float, b: float) -> tuple[_Range, _Range, _Range]:
    """Return the ranges of s, s' and s'' between two values of x."""
    ends = sorted(one.slope * (x - one.inflection) for x in (a, b))
    low, high = _sigmoids(ends[0]), _sigmoids(ends[1])
    slopes, bends = [low[1], high[1]], [low[2], high[2]]
    if ends[0] < 0.0 < ends[1]:
        slopes.append(0.25)
    for extreme in (-_EXTREME, _EXTREME):
        if ends[0] < extreme < ends[1]:
            bends.append(_sigmoids(extreme)[2])
    return (
        _Range(low[0], high[0]),
        _Range(min(slopes), max(slopes)),
        _Range(min(bends), max(bends)),
    )


def _sigmoids(t: float) -> tuple[float, float, float]:
    """Return s, s' and s'' at t."""
    small = math.exp(-abs(t))
    below = small / (1.0 + small)
    above = 1.0 / (1.0 + small)
    slope = below * above
    bend = slope * (above - below)
    return (above, slope, -bend) if t > 0 else (below, slope, bend)
