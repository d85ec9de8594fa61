"""How curves of systems bend: the pieces along which points can be placed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

from fuzzytree.errors import LossError
from fuzzytree.model.system import (
    Arc,
    Bell,
    Concave,
    Cosine,
    Curve,
    Gaussian,
    PiCurve,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Spike,
    TwoGaussians,
)
from fuzzytree.semantics.conversion.pieces import Function, Piece, Plan, bent
from fuzzytree.semantics.conversion.sigmoids import sigmoid_plan
from fuzzytree.semantics.inference.curves import curve_degree
from fuzzytree.semantics.inference.formulas import power as raised
from fuzzytree.semantics.inference.formulas import quotient

_TAIL = 0.99  # tails end a little below the tolerance, so that rounding has room


def plan_of(curve: Curve, tolerance: float) -> Plan:
    """Return how points can be placed along a curve that is no points itself.

    Raises:
        LossError: If the curve has no degrees of its own.
    """
    tail = tolerance * _TAIL
    match curve:
        case Gaussian(mean=mean, deviation=deviation):
            return _two_gaussians(
                curve, TwoGaussians(mean, deviation, mean, deviation), tail
            )
        case TwoGaussians():
            return _two_gaussians(curve, curve, tail)
        case Bell():
            return _bell(curve, tail)
        case Sigmoid():
            return _sigmoid(curve, tail)
        case SigmoidDifference() | SigmoidProduct():
            return sigmoid_plan(curve, tolerance)
        case SCurve():
            return _s(curve)
        case PiCurve():
            return _pi(curve)
        case Cosine():
            return _cosine(curve)
        case Concave():
            return _concave(curve, tail)
        case Spike():
            return _spike(curve, tail)
        case Arc():
            return _arc(curve)
        case SemiEllipse():
            return _semi_ellipse(curve)
        case _:
            raise LossError("it is a formula, of which nothing is known between points")


def _pieces(curve: Curve, knots: Iterable[float], slope: Function) -> list[Piece]:
    """Return the pieces between some places, on each of which the curve bends once."""

    def value(x: float) -> float:
        return curve_degree(curve, x)

    error = bent(value, slope)
    places = sorted(set(knots))
    return [Piece(a, b, error) for a, b in itertools.pairwise(places)]


def _slack(scale: float, knots: Iterable[float], power: float = 1.0) -> float:
    """Return what rounding can add to the error of a chord.

    Degrees and slopes are good to a few units, amplified by `power`. A smooth
    inflection that is rounded by h leaves a stretch of that width, and a bend of its
    order, on the wrong side: it moves a chord by the order of its square.

    Args:
        scale: A length on which the degree changes much.
        knots: The places.
        power: How much a relative error of the value is amplified.
    """
    coarse = quotient(16.0 * math.ulp(max(map(abs, knots))), scale)
    return (2.0**-44 + coarse * coarse) * (1.0 + power)


def _two_gaussians(curve: Curve, two: TwoGaussians, tail: float) -> Plan:
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
            return Plan(((mean, curve_degree(curve, mean)),), tail)

    def slope(x: float) -> float:
        rising = (left - min(x, left)) / below / below
        falling = (max(x, right) - right) / above / above
        return curve_degree(curve, x) * (rising - falling)

    inner = [start, *(x for x in knots if start < x < end), end]
    slack = _slack(min(below, above), [*inner, left, right])
    return Plan(tuple(_pieces(curve, inner, slope)), tail, slack)


def _halves(
    curve: Curve, center: float, places: Sequence[float], steepness: Function
) -> list[Piece]:
    """Return the pieces of a curve that falls alike on both sides of its center.

    Args:
        curve: The curve.
        center: Its center.
        places: Distances from it, the largest first.
        steepness: How fast it falls at a distance.
    """
    left = [*(center - d for d in places), center]
    right = [center, *(center + d for d in places)]
    return [
        *_pieces(curve, left, lambda x: steepness(center - x)),
        *_pieces(curve, right, lambda x: -steepness(x - center)),
    ]


def _bell(curve: Bell, tail: float) -> Plan:
    power, width = 2.0 * abs(curve.slope), curve.width
    if power == 0.0:
        return Plan(((curve.center, 0.5),))
    sign = math.copysign(1.0, curve.slope)

    def steepness(distance: float) -> float:
        if distance == 0.0:
            return 0.0 if power > 1.0 else math.inf if power < 1.0 else sign / width
        u = raised(distance / width, power)
        return sign * power / distance / ((1.0 + u) * (1.0 + quotient(1.0, u)))

    places = [width * raised(1.0 / tail - 1.0, 1.0 / power)]
    if power > 1.0:
        places.append(width * raised((power - 1.0) / (power + 1.0), 1.0 / power))
    inflections = [curve.center + d for d in (0.0, *places[1:])]
    slack = _slack(width, inflections, power)
    return Plan(tuple(_halves(curve, curve.center, places, steepness)), tail, slack)


def _spike(curve: Spike, tail: float) -> Plan:
    rate = 10.0 / curve.width

    def steepness(distance: float) -> float:
        return rate * math.exp(-rate * distance)

    places = [-math.log(tail) / rate]
    ends = [curve.center + places[0], curve.center - places[0]]
    slack = _slack(curve.width / 10.0, ends)
    return Plan(tuple(_halves(curve, curve.center, places, steepness)), tail, slack)


def _cosine(curve: Cosine) -> Plan:
    width = curve.width

    def steepness(distance: float) -> float:
        return math.pi / width * math.sin(2.0 * math.pi * (distance / width))

    places = [width / 2.0, width / 4.0]
    ends = [curve.center + places[0], curve.center - places[0]]
    parts = _halves(curve, curve.center, places, steepness)
    return Plan(tuple(parts), 0.0, _slack(width / 6.0, ends), 0.0, 0.0)


def _sigmoid(curve: Sigmoid, tail: float) -> Plan:
    center, rate = curve.inflection, curve.slope
    if rate == 0.0:
        return Plan(((center, 0.5),))

    def slope(x: float) -> float:
        small = math.exp(-abs(rate * (x - center)))
        return rate * (small / (1.0 + small)) / (1.0 + small)

    reach = math.log(1.0 / tail - 1.0) / abs(rate)
    knots = [center - reach, center, center + reach]
    slack = _slack(1.0 / abs(rate), knots)
    return Plan(tuple(_pieces(curve, knots, slope)), tail, slack)


def _s_pieces(curve: Curve, start: float, end: float) -> tuple[list[Piece], float]:
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


def _s(curve: SCurve) -> Plan:
    if curve.start == curve.end:
        return Plan(((curve.start, 0.0), (curve.start, 1.0)))
    parts, slack = _s_pieces(curve, curve.start, curve.end)
    return Plan(tuple(parts), 0.0, slack)


def _pi(curve: PiCurve) -> Plan:
    a, b, c, d = curve.a, curve.b, curve.c, curve.d
    if a == d:
        return Plan(((a, 0.0),))
    parts: list[Piece | tuple[float, float]] = [(a, 0.0), (a, 1.0)]
    slack = 0.0
    if a < b:
        rising, slack = _s_pieces(curve, a, b)
        parts = [*rising]
    if c == d:
        return Plan((*parts, (c, 1.0), (c, 0.0)), 0.0, slack)
    falling, more = _s_pieces(curve, d, c)
    return Plan((*parts, *falling), 0.0, max(slack, more))


def _concave(curve: Concave, tail: float) -> Plan:
    end = curve.end
    width = end - curve.inflection
    if width == 0.0:
        before = math.nextafter(end, -math.inf)
        return Plan(((before, 0.0), (before, 1.0)))

    def slope(x: float) -> float:
        degree = curve_degree(curve, x)
        return degree * degree / width

    knots = [end, end - width * (1.0 / tail - 1.0)]
    slack = _slack(abs(width), knots)
    return Plan(tuple(_pieces(curve, knots, slope)), tail, slack)


def _arc(curve: Arc) -> Plan:
    start, end = curve.start, curve.end
    width = end - start
    if width == 0.0:
        raise LossError("it is an arc without width")

    def slope(x: float) -> float:
        u = (x - start) / width
        return math.inf if u <= 0.0 else (1.0 - u) / math.sqrt(u * (2.0 - u)) / width

    knots = [start, end]
    return Plan(tuple(_pieces(curve, knots, slope)), 0.0, _slack(abs(width), knots))


def _semi_ellipse(curve: SemiEllipse) -> Plan:
    start, end = curve.start, curve.end
    width = end - start
    if not width > 0.0:
        return Plan(((start, 0.0),))

    def slope(x: float) -> float:
        p, q = (x - start) / width, (end - x) / width
        return (q - p) / math.sqrt(p * q) / width if p * q > 0.0 else math.inf

    knots = [start, start + width / 2.0, end]
    return Plan(tuple(_pieces(curve, knots, slope)), 0.0, _slack(width, knots))
