"""Products and differences of two sigmoids, which bend to either side.

With `t = slope (x - inflection)` and `s = 1 / (1 + exp(-t))` a sigmoid's derivatives
by t are `s' = s (1 - s)`, largest at 0, and `s'' = s' (1 - 2 s)`, whose extremes are
at `t = +-ln(2 + sqrt(3))`. So each has a range over an interval of t, and

    (s1 s2)'' = k1^2 s1'' s2 + 2 k1 k2 s1' s2' + k2^2 s1 s2''
    (s1 - s2)'' = k1^2 s1'' - k2^2 s2''

have one over an interval of x, by interval arithmetic. The absolute difference has an
edge where both are equal, `k1 (x - c1) = k2 (x - c2)`, and is smooth elsewhere.
"""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.model.system import Sigmoid, SigmoidDifference, SigmoidProduct
from fuzzytree.semantics.conversion.pieces import Error, Piece, Plan
from fuzzytree.semantics.inference.curves import curve_degree

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


def sigmoid_plan(curve: SigmoidDifference | SigmoidProduct, tolerance: float) -> Plan:
    """Return how points can be placed along two sigmoids.

    Where each sigmoid is within an eighth of the tolerance of 0 or 1, and so on for
    ever, product and difference are within a half of it of what they are there.
    """
    pair = [one for one in (curve.first, curve.second) if one.slope != 0.0]
    if not pair:
        x = curve.first.inflection
        return Plan(((x, curve_degree(curve, x)),))
    reach = math.log(8.0 / tolerance)
    start = min(one.inflection - reach / abs(one.slope) for one in pair)
    end = max(one.inflection + reach / abs(one.slope) for one in pair)
    knots = {start, end, *(one.inflection for one in pair)}
    if isinstance(curve, SigmoidDifference):
        edge = _crossing(curve.first, curve.second)
        if edge is not None and start < edge < end:
            knots.add(edge)
    error = _error(curve)
    places = sorted(knots)
    parts = [Piece(a, b, error) for a, b in itertools.pairwise(places)]
    steepness = sum(abs(one.slope) for one in pair) / 4.0
    slack = 2.0**-44 + 16.0 * math.ulp(max(map(abs, places))) * steepness
    return Plan(tuple(parts), tolerance / 2.0, slack)


def _crossing(first: Sigmoid, second: Sigmoid) -> float | None:
    """Return where two sigmoids are equal, rounded once."""
    k, m = Fraction(first.slope), Fraction(second.slope)
    if k == m:
        return None
    place = (k * Fraction(first.inflection) - m * Fraction(second.inflection)) / (k - m)
    try:
        return float(place)
    except OverflowError:
        return None


def _error(curve: SigmoidDifference | SigmoidProduct) -> Error:
    first, second = curve.first, curve.second
    k, m = first.slope, second.slope

    def error(a: float, b: float) -> float:
        value_1, slope_1, bend_1 = _ranges(first, a, b)
        value_2, slope_2, bend_2 = _ranges(second, a, b)
        if isinstance(curve, SigmoidDifference):
            found = bend_1.scaled(k * k).plus(bend_2.scaled(-m * m))
        else:
            found = (
                bend_1.times(value_2)
                .scaled(k * k)
                .plus(slope_1.times(slope_2).scaled(2.0 * k * m))
                .plus(value_1.times(bend_2).scaled(m * m))
            )
        width = b - a
        return max(-found.low, found.high) * width * width / 8.0

    return error


def _ranges(one: Sigmoid, a: float, b: float) -> tuple[_Range, _Range, _Range]:
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
