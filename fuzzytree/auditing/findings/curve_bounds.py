"""Bounds of curves that are not polynomial: lines of points below and above them.

The engine encloses any membership function, and what hedges make of it, between two
functions of straight lines (`fuzzytree.auditing.decide.lines`). Here these are points,
as terms of rules have them, *lower* <= curve <= *upper* on all of a range; degrees are
rounded downwards in the lower line and upwards in the upper one.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Final, Literal, NamedTuple

from fuzzytree.auditing.decide.lines import APART, Hedged, Lines, lines_of
from fuzzytree.auditing.decide.measures import curve_distance
from fuzzytree.model import MOST_POINTS, Curve, Formula, Hedge, Points, Shape
from fuzzytree.numerics import outwards

Side = Literal["lower", "upper"]
Interval = tuple[Fraction, Fraction]
Name = tuple[str, str]
"""A variable and one of its terms."""

_JUMP: Final = 4 * APART
"""Values and limits of a line at a place that are nearer than this become one."""


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
def curve_bounds(
    curve: Curve,
    of: Interval | None,
    height: float = 1.0,
    hedges: tuple[Hedge, ...] = (),
) -> CurveBounds | None:
    """Return two lines between which a curve is on a range.

    `height`: what its degrees are multiplied by; `hedges`: what changes them then.

    Returns:
        None if there are no such lines: the range is not known, the curve is a formula,
        or it would need too many points.

    Example:
        >>> from fuzzytree.model import Gaussian
        >>> of = Fraction(-3), Fraction(3)
        >>> bounds = curve_bounds(Gaussian(0.0, 1.0), of)
        >>> bounds.lower.degrees[0] > 0.01, float(gap(bounds, of)) < 0.002
        (True, True)
    """
    if of is None or isinstance(curve, Formula):
        return None
    ends = Fraction(outwards(of[0])[0]), Fraction(outwards(of[1])[1])
    known = lines_of(Hedged(curve, height, hedges), *ends)
    lower, upper = _points(known.lower, "lower"), _points(known.upper, "upper")
    if max(len(lower.values), len(upper.values)) > MOST_POINTS:
        return None
    return CurveBounds(lower, upper, (curve, height, hedges))


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
    if bounds.is_exact:
        return Fraction(0)
    return curve_distance(bounds.lower, bounds.upper, *of).high


def _points(lines: Lines, side: Side) -> Points:
    """Return a line as points that are nowhere on its other side.

    Points that jump at a value have the degree before the jump there.
    """
    pick, rounded = (min, 0) if side == "lower" else (max, 1)
    kept: list[tuple[float, float]] = []

    def put(x: float, degree: Fraction) -> None:
        kept.append((x, min(max(outwards(degree)[rounded], 0.0), 1.0)))

    limits = zip(lines.x, (None, *lines.before), (*lines.after, None), strict=True)
    for (exact, before, after), at in zip(limits, lines.at, strict=True):
        x = float(exact)
        known = [one for one in (before, at, after) if one is not None]
        if max(known) - min(known) <= _JUMP:
            put(x, pick(known))
            continue
        near = math.nextafter(x, -math.inf)
        here = at
        if before is not None and pick(before, at) == before:
            here = before
        elif before is not None and kept[-1][0] < near:
            put(near, before)
        elif before is not None:
            here = pick(before, at)
        put(x, here)
        if after is not None and after != here:
            put(x, after)
    values, degrees = zip(*_joints(kept), strict=True)
    return Points(values, degrees)


def _joints(
    knots: Sequence[tuple[float, float]],
) -> Iterator[tuple[float, float]]:
    """Yield the points of a line without those within a level stretch."""
    for place, (x, degree) in enumerate(knots):
        beside = knots[max(place - 1, 0) : place + 2]
        if len(beside) < 3 or any(d != degree for _, d in beside):
            yield x, degree
