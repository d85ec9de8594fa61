"""Bounds of curves that are not polynomial: lines of points below and above them.

The engine decides questions about points joined by lines. A curve such as a gaussian
lies between two of these, *lower* <= curve <= *upper* on all of a range:

- `fuzzytree.semantics.conversion.points` places points that are off by a bound at most,
  so the curve is within the bound of them, above and below.
- The lower line is also at least the curve's least degree on the range, where that is
  known: a gaussian is 0 nowhere. Both lines are within 0 and 1.
- Where a curve meets 0 or 1 at a point, and bends towards it, lines meet it there too.
  A point at which the upper line is 0 is then a point of degree 0.

Degrees of points are rounded downwards in the lower line and upwards in the upper one.
Every point is compared with the curve's own value, as enclosed by `fuzzytree.numerics
.curve_values`.

Each hedge h but `not` and `any` rises, so where l <= d <= u, h(l) <= h(d) <= h(u). A
line of points l makes a curve h(l), on which points are so close that chords are near:
between two degrees p < q the chord of h is off by at most
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

from fuzzytree.auditing.engine.pieces import RuleCurve
from fuzzytree.errors import LossError
from fuzzytree.model import (
    MOST_POINTS,
    Bell,
    Concave,
    Cosine,
    Curve,
    Gaussian,
    Hedge,
    PiCurve,
    Points,
    SCurve,
    Shape,
    Sigmoid,
    SigmoidProduct,
    Spike,
    TwoGaussians,
)
from fuzzytree.numerics import Between, degree_between, outwards, powered, root
from fuzzytree.semantics import points_for

HALF_GAP: Final = 2.0**-11
"""How far a curve is from the points in its place at most."""

_MORE = 1 + Fraction(1, 2**20)  # of a bound that was computed in doubles
_SLOPE_MORE = float(_MORE)  # of slopes in doubles

Side = Literal["lower", "upper"]
Interval = tuple[Fraction, Fraction]
Knot = tuple[float, Fraction]
"""A point of a line before it is rounded."""
Name = tuple[str, str]
"""A variable and one of its terms."""


class CurveBounds(NamedTuple):
    """A curve between two lines.

    Attributes:
        lower: Nowhere above it on the range.
        upper: Nowhere below it.
        key: What the curve is: equal for equal curves only.
    """

    lower: Shape
    upper: Shape
    key: tuple[object, ...]

    @property
    def is_exact(self) -> bool:
        """Whether both lines are the curve itself."""
        return self.lower == self.upper

    @property
    def swapped(self) -> CurveBounds:
        """The same with the upper line in the place of the lower one."""
        return CurveBounds(self.upper, self.lower, ("swapped", *self.key))


@functools.lru_cache(maxsize=256)
def curve_bounds(curve: Curve, of: Interval | None) -> CurveBounds | None:
    """Return two lines between which a curve is on a range; everywhere if it is None.

    Returns:
        None if there are no such lines: of a formula nothing is known between points.

    Example:
        >>> of = Fraction(-3), Fraction(3)
        >>> bounds = curve_bounds(Gaussian(0.0, 1.0), of)
        >>> bounds.lower.degrees[0] > 0.01, float(gap(bounds, of)) < 0.001
        (True, True)
    """
    try:
        fit = points_for(curve, HALF_GAP)
    except LossError:
        return None
    off = Fraction(fit.bound) * _MORE
    values, degrees = fit.points.values, fit.points.degrees
    if not _is_near(curve, fit.points, off):
        return None
    middle = [*zip(values, map(Fraction, degrees), strict=True)]
    below, above = [(x, d - off) for x, d in middle], [(x, d + off) for x, d in middle]
    if _is_smooth(curve):
        for place in range(len(middle)):
            x, degree = middle[place]
            if degree in (0, 1) and _is_exact(curve, fit.points, place):
                line = above if degree == 0 else below
                line[place] = x, degree
    least = Fraction(0) if of is None else _least(curve, of)
    lower = rounded_line([*clip(below, least, "lower")], "lower", of)
    upper = rounded_line([*clip(above, Fraction(1), "upper")], "upper", of)
    return CurveBounds(lower, upper, (curve,))


def as_points(shape: Shape, of: Interval | None) -> CurveBounds | None:
    """Return a shape as points: itself if it is points, else lines around it."""
    if isinstance(shape, Points):
        return CurveBounds(shape, shape, (shape,))
    return curve_bounds(shape, of)


def complement(bounds: CurveBounds) -> CurveBounds | None:
    """Return 1 minus a curve; None if it is no points."""
    turned = CurveBounds(bounds.upper, bounds.lower, ("not", *bounds.key))
    return _mapped(turned, lambda degree: 1 - degree)


def scale(bounds: CurveBounds, factor: float) -> CurveBounds | None:
    """Return a curve times a factor in [0, 1]; None if it is no points."""
    scaled = bounds._replace(key=(factor, *bounds.key))
    return _mapped(scaled, lambda degree: degree * Fraction(factor))


def _mapped(
    bounds: CurveBounds, change: Callable[[Fraction], Fraction]
) -> CurveBounds | None:
    """Return lines whose degrees are changed, and rounded down or up; if of points."""
    lower, upper = bounds.lower, bounds.upper
    if not (isinstance(lower, Points) and isinstance(upper, Points)):
        return None
    low = (outwards(change(Fraction(one)))[0] for one in lower.degrees)
    high = (outwards(change(Fraction(one)))[1] for one in upper.degrees)
    lines = Points(lower.values, tuple(low)), Points(upper.values, tuple(high))
    return CurveBounds(*lines, bounds.key)


@functools.lru_cache(maxsize=256)
def gap(bounds: CurveBounds, of: Interval) -> Fraction:
    """Return how far two lines are apart at most on a range."""
    low, high = of
    apart = Fraction(0)
    lines = RuleCurve(bounds.lower), RuleCurve(bounds.upper)
    for shape in (bounds.lower, bounds.upper):
        if isinstance(shape, Points):
            inner = (Fraction(x) for x in shape.values)
            for x in (low, *(x for x in inner if low <= x <= high), high):
                lower, upper = (line.degree(x) for line in lines)
                behind = [line.degree_after(x) for line in lines]
                apart = max(apart, abs(upper - lower), abs(behind[1] - behind[0]))
    return apart


# --- points that are believed


def _is_near(curve: Curve, points: Points, off: Fraction) -> bool:
    """Return whether the points are as near to the curve as they are said to be."""
    for place, x in enumerate(points.values):
        if _is_step(points, place):
            continue
        between, degree = degree_between(curve, Fraction(x)), points.degrees[place]
        if between is None or not between.low + off >= degree >= between.high - off:
            return False
    return True


def _is_step(points: Points, place: int) -> bool:
    """Return whether a point is the upper end of a step: only what is behind has it."""
    return place > 0 and points.values[place] == points.values[place - 1]


def _is_exact(curve: Curve, points: Points, place: int) -> bool:
    """Return whether a curve has the degree of a point, or jumps to it."""
    if _is_step(points, place):
        return True
    between = degree_between(curve, Fraction(points.values[place]))
    degree = Fraction(points.degrees[place])
    return between is not None and between.low == between.high == degree


def _is_smooth(curve: Curve) -> bool:
    """Return whether a curve bends towards 0 where it is 0, and towards 1 at 1.

    Below 1 it is then above its chords, and above 0 below them.
    """
    match curve:
        case Bell(slope=slope):
            return slope > 0.5
        case _:
            kinds = (SCurve, PiCurve, Cosine, Gaussian, TwoGaussians)
            return isinstance(curve, kinds)


def _least(curve: Curve, of: Interval) -> Fraction:
    """Return what a curve is not below on a range; it rises, then falls, or is 0."""
    kinds = (Gaussian, TwoGaussians, Sigmoid, SigmoidProduct, Concave, Spike)
    is_risen = isinstance(curve, kinds) or (isinstance(curve, Bell) and curve.slope > 0)
    if not is_risen:
        return Fraction(0)
    ends = [degree_between(curve, x) for x in of]
    low = min(one.low for one in ends if one is not None)
    return Fraction(outwards(low)[0])


# --- lines


def clip(knots: Sequence[Knot], limit: Fraction, side: Side) -> Iterator[Knot]:
    """Yield a line clamped at a limit; crossings are rounded to the safe side."""
    sign = 1 if side == "lower" else -1
    previous: Knot | None = None
    for x, degree in knots:
        if previous is not None and previous[0] < x:
            yield from _meeting(previous, (x, degree), limit, sign)
        yield x, limit if (limit - degree) * sign > 0 else degree
        previous = x, degree


def _meeting(one: Knot, other: Knot, limit: Fraction, sign: int) -> Iterator[Knot]:
    (a, p), (b, q) = one, other
    is_beyond = (limit - p) * sign > 0
    if is_beyond == ((limit - q) * sign > 0):
        return
    exact = Fraction(a) + (limit - p) / (q - p) * (Fraction(b) - Fraction(a))
    low, high = outwards(exact)
    place = high if is_beyond else low
    yield min(max(place, a), b), limit


def rounded_line(knots: Sequence[Knot], side: Side, of: Interval | None) -> Points:
    """Return a line as points, with degrees rounded to its side; only on a range."""
    pick = 0 if side == "lower" else 1
    line = [(x, outwards(degree)[pick]) for x, degree in knots]
    kept: list[tuple[float, float]] = []
    for x, degree in line:
        if len(kept) > 1 and kept[-1][0] == kept[-2][0] == x:
            kept.pop()  # within a step only its two ends count
        kept.append((x, degree))
    if of is not None:
        kept = _trimmed(kept, of)
    kept = [*_joints(kept)]
    values, degrees = zip(*kept, strict=True)
    return Points(values, degrees)


def _trimmed(
    knots: list[tuple[float, float]], of: Interval
) -> list[tuple[float, float]]:
    """Return the points of a line on a range, and one more on either side."""
    low, high = of
    first = next((n for n, (x, _) in enumerate(knots) if x >= low), len(knots))
    last = next((n for n, (x, _) in enumerate(knots) if x > high), len(knots) - 1)
    return knots[max(first - 1, 0) : last + 1]


def _joints(knots: Sequence[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """Yield the points of a line without those within a level stretch."""
    for place, (x, degree) in enumerate(knots):
        beside = knots[max(place - 1, 0) : place + 2]
        if len(beside) < 3 or any(d != degree for _, d in beside):
            yield x, degree


_HALF = Fraction(1, 2)

Bend = Literal["upwards", "downwards", "both"]


class _Rising(NamedTuple):
    """A hedge that rises: its value, its slope, how it bends below 1/2 and above."""

    value: Callable[[Fraction], Between]
    slope: Callable[[float], float]
    bend: tuple[Bend, Bend]


def hedged_bounds(bounds: CurveBounds, hedge: Hedge) -> CurveBounds | None:
    """Return what a hedge makes of a curve between lines.

    Returns:
        None if the lines are no points, or it would need too many.

    Example:
        >>> ramp = Points((0.0, 1.0), (0.0, 1.0))
        >>> very = hedged_bounds(CurveBounds(ramp, ramp, (ramp,)), "very")
        >>> from fuzzytree.numerics.exact import exact_degree
        >>> low, high = (exact_degree(one, Fraction(1, 3)) for one in very[:2])
        >>> low < Fraction(1, 9) < high, high - low < 0.001
        (True, True)
    """
    if hedge == "not":
        return complement(bounds)
    if hedge == "any":
        one = Points((0.0,), (1.0,))
        return CurveBounds(one, one, (one,))
    if not isinstance(bounds.lower, Points) or not isinstance(bounds.upper, Points):
        return None
    lower = _line(bounds.lower, _RISING[hedge], "lower")
    upper = _line(bounds.upper, _RISING[hedge], "upper")
    if lower is None or upper is None:
        return None
    return CurveBounds(lower, upper, (hedge, *bounds.key))


def _line(points: Points, hedge: _Rising, side: Side) -> Points | None:
    """Return a line nowhere above, or nowhere below, what a hedge makes of another."""
    pick = 0 if side == "lower" else 1
    parts = [*_stretches(points, hedge)]
    if sum(map(len, parts)) > MOST_POINTS:
        return None
    off = Fraction(max((_off(hedge, of, side) for of in parts), default=0.0))
    knots: list[Knot] = []
    for of in parts:
        is_level = all(degree == of[0][1] for _, degree in of)
        shift = Fraction(0) if is_level else off if pick else -off
        ends = [(x, hedge.value(degree)[pick] + shift) for x, degree in of]
        knots += ends if not knots or knots[-1] != ends[0] else ends[1:]
    extreme = (max if pick else min)(map(Fraction, points.degrees))
    return rounded_line([*clip(knots, hedge.value(extreme)[pick], side)], side, None)


def _stretches(points: Points, hedge: _Rising) -> Iterator[list[Knot]]:
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
    most = 0.0
    for (_, p), (_, q) in itertools.pairwise(of):
        if _bend(hedge, p, q) in counts:
            most = max(most, _error(hedge, p, q))
    return most


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
    return min(bent, float(hedge.value(q).high - hedge.value(p).low)) * _SLOPE_MORE


def _power(power: Fraction) -> _Rising:
    exponent = float(power)

    def slope(degree: float) -> float:
        if degree == 0.0:
            return math.inf if exponent < 1.0 else 0.0
        return exponent * math.pow(degree, exponent - 1.0)

    def value(degree: Fraction) -> Between:
        return powered(degree, power)

    def whole(degree: Fraction) -> Between:
        exact = degree**power.numerator
        return Between(exact, exact)

    bend: Bend = "upwards" if power > 1 else "downwards"
    return _Rising(whole if power.denominator == 1 else value, slope, (bend, bend))


def _extremely(degree: Fraction) -> Between:
    exact = 2 * degree**2 if degree <= _HALF else 1 - 2 * (1 - degree) ** 2
    return Between(exact, exact)


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
