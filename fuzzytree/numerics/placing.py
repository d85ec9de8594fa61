"""Points in the place of curves: few, and no line further off than it may be.

A line between two points of a curve is `|p''| h**2 / 8` away from it, always on the
same side. Points that are off the curve by half of that, to the other side, divide it,
so that lines may be longer by the root of 2. Where a point must lie on the curve, at an
end, at an inflection or where the curve is clipped, the lines that meet there are as
long as without. Places are chosen so that all lines of a piece need the same; then the
error of the points, as they are rounded, is certified (`fuzzytree.numerics.curves`).
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.errors import LossError
from fuzzytree.model import LR, MOST_POINTS, FloatArray, Points
from fuzzytree.numerics.curves import (
    BELOW_ONE,
    DegreePiece,
    derivative,
    distance,
    side_stretches,
    values_at,
)

_GRID = 512  # places on a curve at which its bend is looked at
_TRIES = 12  # of placing points before the bound counts as out of reach
_SHORT = math.sqrt(0.5)  # the length of a line with an end on the curve
_ROUNDING = 1.0 + 2.0**-40
_TOO_COARSE = "doubles around {!r} are too coarse for them"
_TOO_MANY = f"it would need more than {MOST_POINTS} points"


@functools.lru_cache(maxsize=128)  # each format takes the same points of a set
def points_of(shape: LR, tolerance: float) -> tuple[Points, float]:
    """Return points in the place of an LR set, and the largest error of a degree.

    Raises:
        LossError: If there would be too many, or doubles are too far apart for them.
    """
    left = _side_half(shape, -1, tolerance)
    right = _side_half(shape, 1, tolerance)
    points = [*left.points, (shape.mean, 1.0), *reversed(right.points)]
    if len(points) > MOST_POINTS:
        raise LossError(_TOO_MANY)
    values, degrees = zip(*points, strict=True)
    return Points(values, degrees), max(left.bound, right.bound)


class _Half(NamedTuple):
    """Points from outside inwards, and how far lines between them are from a curve."""

    points: list[tuple[float, float]]
    bound: float


def _side_half(shape: LR, sign: int, tolerance: float) -> _Half:
    """Return the points of one side of an LR set, without its peak.

    Neither the support's end nor the end of the first spread need be doubles. The
    point in the place of the former is the next double outside, so that the same
    doubles have degree 0. Between a point and the end that it stands for another
    formula holds than the one that it was compared with: `slack` is how far the two
    can be apart there.
    """
    side = shape.right if sign > 0 else shape.left
    tail, body = side_stretches(side, shape.mean, sign)
    knee = tail.origin + tail.unit
    outer, inner = _double(tail.origin), _double(knee)
    if (Fraction(outer) - tail.origin) * sign < 0:
        outer = math.nextafter(outer, sign * math.inf)
    if inner == shape.mean:
        raise LossError(_TOO_COARSE.format(inner))
    slack = _steepness(tail) * abs(Fraction(outer) - tail.origin)
    slack += (_steepness(tail) + _steepness(body)) * abs(Fraction(inner) - knee)
    lost = float(slack) * _ROUNDING
    points, bound = _joined(tail, (outer, inner), tolerance - lost)
    others, other = _joined(body, (inner, shape.mean), tolerance - lost)
    lost += abs(others[0][1] - points[-1][1])  # the same degree, rounded twice
    return _Half([*points, *others[1:-1]], max(bound, other) + lost)


def _double(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        raise LossError("it reaches beyond the largest double") from None


def _steepness(stretch: DegreePiece) -> Fraction:
    """Return what the slope of a stretch is at most, per unit of the variable."""
    slope = sum(k * abs(c) * 1.125**k for k, c in enumerate(stretch.coefficients))
    return Fraction(slope * _ROUNDING) / abs(stretch.unit)


def _joined(
    stretch: DegreePiece, ends: tuple[float, float], tolerance: float
) -> tuple[list[tuple[float, float]], float]:
    """Return points along a stretch, its ends included, and the error of the lines.

    Args:
        stretch: The stretch.
        ends: The doubles that stand for its first and last value.
        tolerance: The largest error that is allowed.
    """
    curve = np.array(stretch.coefficients).reshape(-1, 1)
    knots = _knots(stretch)
    share = 1.0 - 2.0**-6  # the bound may be above the error by a hundredth
    for _ in range(_TRIES):
        if tolerance <= 0:
            break
        z, degrees = _placed(curve, knots, stretch.top, share * tolerance)
        points, exact = _rounded(stretch, ends, z, degrees)
        if not all(-0.125 <= place <= 1.125 for place in exact):
            break
        bound = _line_error(curve, np.array(exact), points, stretch.top)
        if bound <= tolerance:
            return points, bound
        share *= 0.95
    raise LossError(_TOO_COARSE.format(ends[1]))


def _knots(stretch: DegreePiece) -> list[float]:
    """Return the places of a stretch where points must lie, in its direction.

    They are its ends, where its polynomial leaves [0, top], and where it bends from
    one side to the other.
    """
    first, last = float(stretch.first), float(stretch.last)
    p = np.polynomial.Polynomial(stretch.coefficients)
    roots = [r for q in (p, p - stretch.top, p.deriv(2)) for r in _real_roots(q)]
    near = 2.0**-45 * abs(last - first)  # roots that rounding has split
    low, high = min(first, last) + near, max(first, last) - near
    inner = sorted(root for root in roots if low < root < high)
    apart = [b for a, b in zip([-1.0, *inner], inner, strict=False) if b - a > near]
    return [first, *(apart if first < last else reversed(apart)), last]


def _real_roots(p: np.polynomial.Polynomial) -> Iterator[float]:
    least = 2.0**-100 * float(np.abs(p.coef).max())  # less only overflows
    for root in p.trim(least).roots():
        if abs(root.imag) <= 2.0**-30:
            yield float(root.real)


def _placed(
    curve: FloatArray, knots: Sequence[float], top: float, tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """Return places along a curve, knots included, and the degrees of points there."""
    places, offsets = [np.array(knots[:1])], [np.zeros(1)]
    second = derivative(curve, 2)
    for start, end in itertools.pairwise(knots):
        middle = float(values_at(curve, np.array([start / 2 + end / 2]))[0])
        inner = np.empty(0)
        shift = 0.0
        if 0.0 < middle < top:
            grid = np.linspace(start, end, _GRID + 1)
            bend = values_at(second, grid)
            density = np.sqrt(np.abs(bend)) / (4.0 * math.sqrt(tolerance))
            steps = (density[1:] + density[:-1]) / 2 * (abs(end - start) / _GRID)
            needed = np.append(0.0, np.cumsum(steps))
            room = 1.0 if needed[-1] <= _SHORT else _room(float(needed[-1]))
            if room > MOST_POINTS:
                raise LossError(_TOO_MANY)
            share = float(needed[-1]) / room
            marks = np.arange(_SHORT, room, 1.0) * share if room > 1.0 else inner
            inner = np.interp(marks, needed, grid)
            shift = -math.copysign(tolerance * share * share, bend[_GRID // 2])
        places += [inner, np.array([end])]
        offsets += [np.full(len(inner), shift), np.zeros(1)]
    z, offset = np.concatenate(places), np.concatenate(offsets)
    degrees = np.clip(values_at(curve, z), 0.0, top)
    moved = np.clip(degrees + offset, np.nextafter(0.0, 1.0), BELOW_ONE)
    return z, np.where(offset == 0.0, degrees, moved)


def _room(needed: float) -> float:
    """Return the least room of two short lines and some whole ones."""
    return math.ceil(max(needed - 2 * _SHORT, 0.0)) + 2 * _SHORT


def _rounded(
    stretch: DegreePiece,
    ends: tuple[float, float],
    z: FloatArray,
    degrees: FloatArray,
) -> tuple[list[tuple[float, float]], list[float]]:
    """Return points at doubles, each once, and the exact place of each in z."""
    origin, unit = stretch.origin, stretch.unit
    (first, last), sign = ends, math.copysign(1.0, ends[1] - ends[0])
    points = [(first, float(degrees[0]))]
    for place, degree in zip(z[1:-1].tolist(), degrees[1:-1].tolist(), strict=True):
        value = float(origin + unit * Fraction(place))
        if points[-1][0] * sign < value * sign < last * sign:
            points.append((value, degree))
    points.append((last, float(degrees[-1])))
    exact = [float((Fraction(value) - origin) / unit) for value, _ in points]
    return points, exact


def _line_error(
    curve: FloatArray,
    z: FloatArray,
    points: Sequence[tuple[float, float]],
    top: float,
) -> float:
    """Return how far lines between points can be from a curve, clipped."""
    degrees = np.array([degree for _, degree in points])
    width = np.diff(z)
    is_wide = width != 0  # places that doubles cannot distinguish are one
    slope = np.diff(degrees)[is_wide] / width[is_wide]
    first, last = z[:-1][is_wide], z[1:][is_wide]
    lines = np.stack([degrees[:-1][is_wide] - slope * first, slope])
    return distance(first, last, curve, lines, top)
