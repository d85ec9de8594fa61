"""Points along a membership function, as far apart as a tolerance allows.

Between two neighbouring knots a function is one smooth piece, of which `jet` bounds the
slope and the bend. Where it bends to one side only, it lies between its chord and its
tangents: with tangents at both ends and in the middle, the chord is furthest from the
outermost of them where two tangents meet. Where that is not known, a chord over a width
h is off by at most `max |f''| h^2 / 8`, and by no more than the values are apart.

Where a function goes on for ever towards a degree, the outermost point stands where it
is as near to it as the tolerance, and stays as it is there. What rounding moves a
point's own degree by is added to the bound.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

from fuzzytree.errors import LossError
from fuzzytree.model import MOST_POINTS, Formula, Linear, MembershipFunction
from fuzzytree.semantics.enclosing import degree_bounds, plain_jet
from fuzzytree.semantics.programs.operations import DOUBLES

_TAIL = 0.99  # tails end a little below the tolerance, so that rounding has room
_ROOM = 1.0 - 2.0**-40
_MORE = 1.0 + 2.0**-40  # of a bound that is computed in doubles
_TRIES = 40  # of a chord's end
_MOST_STUCK = 16  # neighbouring doubles on one piece
_FARTHEST = 2.0**1000
_NOTHING = 2.0**-60
_LEAST = 2.0**-43  # tolerance; below it rounding counts
_JUMP = 2.0**-10  # between neighbouring doubles
_TOO_COARSE = "doubles around it are too coarse"
_TOO_MANY = f"it would need more than {MOST_POINTS} points"

Point = tuple[float, float]


class PointPlan(NamedTuple):
    """Points along a function.

    Attributes:
        points: Values and degrees, in order; a value twice is a step.
        bound: How far the lines between them can be from the function.
        is_cut: Whether the function goes on changing beyond them.
    """

    points: tuple[Point, ...]
    bound: float
    is_cut: bool


class _Knot(NamedTuple):
    """A knot, and the numbers between which it lies before rounding."""

    low: float
    place: float
    high: float


def plan_of(function: MembershipFunction, tolerance: float) -> PointPlan:
    """Return points along a function that is no points itself.

    Raises:
        LossError: If the function has no degrees of its own, or needs too many points.

    Example:
        >>> from fuzzytree.model import SCurve
        >>> plan = plan_of(SCurve(0.0, 4.0), 0.01)
        >>> plan.points[0], plan.points[-1], plan.bound <= 0.01, plan.is_cut
        ((0.0, 0.0), (4.0, 1.0), True, False)
    """
    if isinstance(function, Formula | Linear):
        raise LossError("it is a formula, of which nothing is known between points")
    knots = _knots(function)
    if tolerance < _LEAST or not math.isfinite(knots[-1].high - knots[0].low):
        raise LossError(_TOO_COARSE)
    (low, off), (high, rest) = (
        _tail_end(function, knots, sign, tolerance * _TAIL) for sign in (-1, 1)
    )
    worst = max(off, rest)
    if low >= high:  # nowhere further than the tolerance from where it goes
        low = high = knots[len(knots) // 2].place
    ends = [_Knot(low, low, low), *knots, _Knot(high, high, high)]
    inner = [knot for knot in ends if low <= knot.place <= high]
    points = [*_at(function, low)]
    for start, end in itertools.pairwise(inner):
        if start.place < end.place:
            for place, error in _march(function, start, end, tolerance * _ROOM):
                worst = max(worst, error)
                points += _at(function, place)
                if len(points) > MOST_POINTS:
                    raise LossError(_TOO_MANY)
    rounding = max(_rounding(function, point) for point in points)
    bound = math.nextafter(worst + rounding, math.inf)
    if bound > tolerance:
        raise LossError(_TOO_COARSE)
    return PointPlan(tuple(points), bound, max(off, rest) > _NOTHING)


def _knots(function: MembershipFunction) -> list[_Knot]:
    """Return the knots; numbers around one that was rounded are one knot."""
    known = sorted({knot for knot in function.knots() if math.isfinite(knot)})
    if not known:
        raise LossError(_TOO_COARSE)
    near = 40.0 * math.ulp(max(map(abs, known)))
    knots: list[_Knot] = []
    for value in known:
        if knots and value - knots[-1].high <= near:
            low = knots.pop().low
            knots.append(_Knot(low, low + (value - low) / 2.0, value))
        else:
            knots.append(_Knot(value, value, value))
    return knots


def _degree(function: MembershipFunction, x: float) -> float:
    return function.degree(DOUBLES, x)


def _tail_end(
    function: MembershipFunction, knots: list[_Knot], sign: int, tail: float
) -> tuple[float, float]:
    """Return where a function is as near to where it goes, and how near it is."""
    knot = knots[0].place if sign < 0 else knots[-1].place

    def off(x: float) -> float:
        here = degree_bounds(function, x)
        ends = (x, _FARTHEST) if sign > 0 else (-_FARTHEST, x)
        beyond = plain_jet(function, *ends).value.hull(here)
        return max(beyond.high - here.low, here.high - beyond.low)

    beyond = off(math.nextafter(knot, sign * math.inf))
    if beyond <= tail:
        return knot, beyond
    near, far = 0.0, max(knots[-1].high - knots[0].low, math.ulp(knot) * 4.0)
    while off(knot + sign * far) > tail:
        near, far = far, far * 2.0
        if far > _FARTHEST:
            raise LossError("it reaches beyond the largest double")
    while far - near > 2.0**-10 * far:
        middle = near + (far - near) / 2.0
        if not near < middle < far:
            break
        is_far = off(knot + sign * middle) > tail
        near, far = (middle, far) if is_far else (near, middle)
    end = knot + sign * far
    return end, off(end)


def _march(
    function: MembershipFunction, start: _Knot, end: _Knot, room: float
) -> Iterator[tuple[float, float]]:
    """Yield where the chords of a piece end, and the error of each.

    Where it jumps at an end, chords start or end at the double beside it.
    """
    above = math.nextafter(start.place, math.inf)
    below = math.nextafter(end.place, -math.inf)
    if abs(_degree(function, above) - _degree(function, start.place)) > _JUMP:
        start = _Knot(above, above, max(above, start.high))
    last = end
    if abs(_degree(function, below) - _degree(function, end.place)) > _JUMP:
        last = _Knot(min(below, end.low), below, below)
    if start.place >= last.place:
        yield end.place, 0.0
    place, width, stuck = start.place, last.place - start.place, 0
    while place < last.place:
        after, error = _chord_end(function, place, (start, last), width, room)
        stuck += after == math.nextafter(place, math.inf)
        if stuck > _MOST_STUCK:
            raise LossError(_TOO_COARSE)
        yield end.place if after == last.place else after, error
        share = math.sqrt(room / error) if error > 0.0 else 4.0
        width, place = min(0.98 * share, 4.0) * (after - place), after


def _chord_end(
    function: MembershipFunction,
    start: float,
    piece: tuple[_Knot, _Knot],
    width: float,
    room: float,
) -> tuple[float, float]:
    """Return how far one chord is near enough, and its error."""
    end = piece[1].place
    after, bad = start + width, math.inf
    after = _snapped(after, piece)
    best = math.nextafter(start, math.inf), 0.0  # no double lies between
    for _ in range(_TRIES):
        if not best[0] < after < bad:
            break
        error = _error(function, start, after, piece)
        if error <= room:
            best = after, error
            if after == end or error > 0.8 * room or bad < math.inf:
                break
        else:
            bad = after
        share = math.sqrt(room / error) if error > 0.0 else 4.0
        after = start + (after - start) * min(max(0.97 * share, 2.0**-6), 4.0)
        after = _snapped(after, piece)
    return best


def _snapped(x: float, piece: tuple[_Knot, _Knot]) -> float:
    """Return a value, or the end of its piece if rounding can hardly tell them."""
    start, end = piece
    near = 4.0 * math.ulp(end.place - start.place)
    is_end = x >= end.low or end.place - x <= near + _near(x, end.place)
    return end.place if is_end else x


def _near(a: float, b: float) -> float:
    """Return a distance that rounding can hardly tell from none."""
    return 64.0 * math.ulp(max(abs(a), abs(b)))


def _error(
    function: MembershipFunction,
    start: float,
    end: float,
    piece: tuple[_Knot, _Knot],
) -> float:
    """Return how far the chord between two values can be from a function.

    Of a knot that was rounded the chord counts from behind it, and how much it moves.
    """
    if math.nextafter(start, math.inf) >= end:
        return 0.0  # no double lies between
    first, last = max(start, piece[0].high), min(end, piece[1].low)
    if last - first <= _near(start, end):
        return plain_jet(function, start, end).value.width
    moved = 0.0
    for a, b in ((start, first), (last, end)):
        if a < b:
            moved += plain_jet(function, a, b).value.width + 2.0 * (b - a) / (
                end - start
            )
    if function.is_bent_once:
        return (_bent(function, first, last) + moved) * _MORE
    bounds, h = plain_jet(function, first, last), math.nextafter(last - first, math.inf)
    bent = bounds.bend.size * h * h / 8.0
    return (min(bent, bounds.value.width) + moved) * _MORE


def _bent(function: MembershipFunction, a: float, b: float) -> float:
    """Return the error of the chord of a stretch that bends to one side only."""
    middle = a + (b - a) / 2.0
    (p, outer), (q, rise), (r, other) = (_tangent(function, x) for x in (a, middle, b))
    chord = (r - p) / (b - a)

    def apart(end: float, at: float, slope: float) -> float:
        """Return how far the chord is from where the tangent meets the middle's."""
        x = end
        if math.isfinite(slope) and slope != rise:
            share = (rise - (q - at) / (middle - end)) / (rise - slope)
            x = end + (middle - end) * min(max(share, 0.0), 1.0)
        return abs((p + chord * (x - a)) - (q + rise * (x - middle)))

    error = max(apart(a, p, outer), apart(b, r, other))
    return error + 2.0**-48 * (1.0 + abs(rise) * (b - a))


def _tangent(function: MembershipFunction, x: float) -> tuple[float, float]:
    """Return the degree and the slope at a value."""
    point = plain_jet(function, x, x)
    slope = point.slope.low / 2.0 + point.slope.high / 2.0
    return _degree(function, x), math.inf if math.isnan(slope) else slope


def _at(function: MembershipFunction, x: float) -> Iterator[Point]:
    """Yield the points at a value: two where the function jumps behind it.

    Where it jumps before it the step stands one double below.
    """
    below, above = math.nextafter(x, -math.inf), math.nextafter(x, math.inf)
    before, here, after = (_degree(function, one) for one in (below, x, above))
    if abs(before - here) > _JUMP:
        _refuse_steep(function, below, x, here)
        yield from ((below, before), (below, here))
    else:
        yield x, here
    if abs(after - here) > _JUMP:
        _refuse_steep(function, x, above, here)
        yield x, after


def _refuse_steep(
    function: MembershipFunction, low: float, high: float, here: float
) -> None:
    """Refuse a function that comes near a degree between neighbours: it is no step."""
    between = plain_jet(function, low, high).value
    if between.low - _JUMP <= here <= between.high + _JUMP:
        raise LossError(_TOO_COARSE)


def _rounding(function: MembershipFunction, point: Point) -> float:
    """Return how far the degree of a point can be from the function's; 0 at a step."""
    bounds = degree_bounds(function, point[0])
    off = max(bounds.high - point[1], point[1] - bounds.low)
    return 0.0 if off > _JUMP else max(off, 0.0)
