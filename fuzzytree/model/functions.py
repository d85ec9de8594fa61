"""Membership functions: what each is, and those of rule bases.

Each says in one place what it is: its numbers, what is wrong with them, its degree for
any kind of number (`fuzzytree.model.algebra`), where it changes, and, if it is
monotone, where it has a degree. Evaluation, programs, enclosures and points in its
place are derived from that.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import msgspec

from fuzzytree.model.algebra import N, Numbers, square
from fuzzytree.model.values import Value

_LARGEST_COEFFICIENT = 1e6  # keeps every polynomial finite, in float32 too

MOST_POINTS = 4096

FEW_POINTS = 8
"""Up to so many points each line has steps of its own; more are looked up."""

BELOW_ONE = 1.0 - 2.0**-53
"""The largest double below 1: the highest degree off a plateau."""

_ABOVE_ZERO = frozenset({"deviation", "left_deviation", "right_deviation", "width"})


class MembershipFunction(Value, frozen=True):
    """A function from the values of a variable to degrees.

    A new one is a subclass with a tag, its numbers as fields and `degree`.
    """

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the degree at a value, without the term's height."""
        raise NotImplementedError

    def inverse(self, n: Numbers[N], degree: N) -> N | None:
        """Return where it has a degree, after Tsukamoto; None if it is not monotone."""
        del n, degree
        return None

    def knots(self) -> tuple[float, ...]:
        """Return, in order, where it changes its formula, its direction or its bend.

        Between two neighbours it is one smooth monotone piece. In the place of a number
        that was computed and rounded two stand around it.
        """
        return ()

    @property
    def extent(self) -> tuple[float, float] | None:
        """The values between which it changes most; None if nothing is known."""
        knots = self.knots()
        return (knots[0], knots[-1]) if knots else None

    @property
    def is_unit(self) -> bool:
        """Whether the degree lies in [0, 1] at every finite value, surely."""
        return True

    @property
    def is_open(self) -> bool:
        """Whether it stays above 0 without end."""
        return False

    @property
    def is_bent_once(self) -> bool:
        """Whether it bends to one side only between two neighbouring knots."""
        return True

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its numbers."""
        for field in self.__struct_fields__:
            value = getattr(self, field)
            name = field.replace("_", " ")
            if not isinstance(value, float | int) or isinstance(value, bool):
                continue
            if not math.isfinite(value):
                yield f"the {name} must be finite, not {value!r}"
            elif field in _ABOVE_ZERO and value <= 0.0:
                yield f"the {name} must be above 0, not {value!r}"


def scaled(n: Numbers[N], x: N, start: float, end: float) -> N:
    """Return 0 at one value, 1 at another, and the line through them elsewhere."""
    return (x - start) / (n.constant(end) - start)


def smaller_slope(n: Numbers[N], slopes: Sequence[N], *, is_peak: bool) -> N:
    """Return the smaller of some slopes, clamped to [0, 1].

    Rounding keeps order, so a slope is at least 1 wherever the other one counts.
    """
    degree = slopes[0]
    for slope in slopes[1:]:
        degree = n.minimum(degree, slope)
    if not is_peak:
        degree = n.minimum(degree, 1.0)
    return n.maximum(degree, 0.0)


def around(place: float, *others: float) -> tuple[float, float]:
    """Return numbers below and above one that was computed from others and rounded."""
    near = 8.0 * math.ulp(max(map(abs, (place, *others))))
    return place - near, place + near


class Band(MembershipFunction, frozen=True, tag="band"):
    """A plateau with straight flanks: degree exactly 1 for `low < x <= high`.

    For `x <= low` the degree is `clip((x - left) / (low - left), 0, 1)`, and for
    `x > high` it is `clip((x - right) / (high - right), 0, 1)`: 0 at `left` and `right`
    and beyond. Both are at most the largest number below 1.

    Attributes:
        low: The plateau's open lower end; None reaches down without end.
        high: The plateau's closed upper end; None reaches up without end.
        left: Where the degree has fallen to 0, below `low`; None is a step at `low`.
        right: Where it has fallen to 0, above `high`; None is a step at `high`.
    """

    low: float | None = None
    high: float | None = None
    left: float | None = None
    right: float | None = None

    @property
    def flanks(self) -> tuple[tuple[float, float], ...]:
        """The lines beside the plateau: where each starts, and where it is 0."""
        sides = (self.low, self.left), (self.high, self.right)
        return tuple((a, b) for a, b in sides if a is not None and b is not None)

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return 1 on the plateau and the line of a flank beside it."""
        degree = n.constant(1.0)
        if self.high is not None:
            right = _flank(n, self.high, self.right, x)
            degree = n.where(n.less(self.high, x), right, degree)
        if self.low is not None:
            left = _flank(n, self.low, self.left, x)
            degree = n.where(n.at_most(x, self.low), left, degree)
        return degree

    def knots(self) -> tuple[float, ...]:
        """Return the ends of the plateau and of the flanks."""
        ends = (self.left, self.low, self.high, self.right)
        return tuple(end for end in ends if end is not None)

    @property
    def is_open(self) -> bool:
        """Whether a side of the plateau is open."""
        return self.low is None or self.high is None

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its numbers."""
        for name, value in (("low", self.low), ("high", self.high)):
            if value is not None and not math.isfinite(value):
                yield f"{name} must be finite or left out, not {value!r}"
                return
        low, high = self.low, self.high
        if low is not None and high is not None and low >= high:
            text = f"the plateau starts at {low!r} and must end above it"
            yield f"{text}, not at {high!r}"
        for name, bound, end, sign in (
            ("left", low, self.left, 1),
            ("right", high, self.right, -1),
        ):
            if end is None:
                continue
            if bound is None:
                yield f"a plateau that is open on the {name} has no {name} flank"
            elif not math.isfinite(bound - end):
                yield f"the {name} flank must end at a finite value, not {end!r}"
            elif (bound - end) * sign <= 0:
                side = "below" if sign > 0 else "above"
                yield f"the {name} flank must end {side} {bound!r}, not at {end!r}"


class Side(Value, frozen=True):
    """One side of an LR set, in `u`, the distance from the mean in spreads.

    With `t = min(u, 1)`, `v = 2 t - 1` and `w = clip((reach - u) / (reach - 1), 0, 1)`
    the degree is `clip(1 - t * (c0 + v * (c1 + ...)), 0, 1) * w**4`: the paper's
    fitted polynomial within one spread, a falling tail beyond.

    Attributes:
        spread: The unit of u, in the variable's unit; above 0.
        curve: c0, c1, ...: one to eight coefficients.
        reach: Where the degree becomes exactly 0, in spreads; above 1.
    """

    spread: float
    curve: tuple[float, ...]
    reach: float = 5.0


class LR(MembershipFunction, frozen=True, tag="lr"):
    """The paper's LR-type fuzzy set (2.2.2): degree exactly 1 at the mean.

    Attributes:
        mean: The peak, in the variable's unit.
        left: The side below the mean.
        right: The side above the mean.
    """

    mean: float
    left: Side
    right: Side

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the smaller degree of the two sides."""
        distance = x - self.mean
        below = _side(n, self.left, -distance)
        return n.minimum(below, _side(n, self.right, distance))

    def knots(self) -> tuple[float, ...]:
        """Return the mean, and where each side's polynomial and tail end."""
        knots = {self.mean}
        for sign, side in ((-1.0, self.left), (1.0, self.right)):
            for u in (1.0, side.reach):
                knots |= {*around(self.mean + sign * side.spread * u, self.mean)}
        return tuple(sorted(knots))

    @property
    def extent(self) -> tuple[float, float]:
        """Where both tails end."""
        low = self.mean - self.left.spread * self.left.reach
        return low, self.mean + self.right.spread * self.right.reach

    @property
    def is_bent_once(self) -> bool:
        """Not surely."""
        return False

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its numbers."""
        if not math.isfinite(self.mean):
            yield f"the mean must be finite, not {self.mean!r}"
        for name, side in (("left", self.left), ("right", self.right)):
            yield from _side_mistakes(name, side)


class Points(MembershipFunction, frozen=True, tag="points"):
    """Points joined by lines: triangles, trapezoids, ramps, steps and free curves.

    Between two neighbours `(a, p)` and `(b, r)`, for `a < x <= b`, the degree is
    `r + (x - b) / (a - b) * (p - r)`, or `(x - a) / (b - a) * r` if p is 0, each
    operation rounded once, clamped between p and r: so it is exact at the points and
    where p = r, and monotone between them. Before the first point its degree holds,
    behind the last one the last one's.

    A value that occurs twice is a step: at the value itself the first degree holds,
    above it the second.

    Attributes:
        values: One to 4096, in the variable's unit, none below the one before it and
            none more than twice.
        degrees: As many, in [0, 1].

    Example:
        >>> triangle = Points((0.0, 1.0, 3.0), (0.0, 1.0, 0.0))
        >>> step = Points((2.5, 2.5), (1.0, 0.0))
    """

    values: tuple[float, ...]
    degrees: tuple[float, ...]

    def __post_init__(self) -> None:
        """Make a degree of -0.0 a 0.0, so that every runtime gives the same bits."""
        if 0.0 in self.degrees:
            degrees = tuple(degree + 0.0 for degree in self.degrees)
            msgspec.structs.force_setattr(self, "degrees", degrees)

    def degree(self, n: Numbers[N], x: N) -> N:
        """Return the degree on the line on which a value lies."""
        if len(self.values) > FEW_POINTS:
            return _looked_up(n, self, x)
        slopes = _slopes(n, self, x)
        if slopes:
            return smaller_slope(n, slopes, is_peak=len(self.values) == 3)
        degree = n.constant(self.degrees[-1])
        pairs = list(zip(self.values, self.degrees, strict=True))
        for (left, below), (right, above) in reversed(list(itertools.pairwise(pairs))):
            if left < right:
                line = _piece(n, (left, below), (right, above), x)
                degree = n.where(n.at_most(x, right), line, degree)
        return n.where(n.at_most(x, self.values[0]), self.degrees[0], degree)

    def inverse(self, n: Numbers[N], degree: N) -> N | None:
        """Return where a ramp has a degree; None for other points."""
        match self.values, self.degrees:
            case (first, last), (0.0, 1.0) if first < last:
                return first + (n.constant(last) - first) * degree
            case (first, last), (1.0, 0.0) if first < last:
                return last + (n.constant(first) - last) * degree
            case _:
                return None

    def knots(self) -> tuple[float, ...]:
        """Return the values of the points."""
        return tuple(dict.fromkeys(self.values))

    @property
    def is_open(self) -> bool:
        """Whether an outermost degree is above 0."""
        return self.degrees[0] > 0.0 or self.degrees[-1] > 0.0

    def mistakes(self) -> Iterator[str]:
        """Yield what is wrong with its numbers."""
        values, degrees = self.values, self.degrees
        if len(values) != len(degrees):
            text = f"{len(values)} values of points need as many degrees"
            yield f"{text}, not {len(degrees)}"
        if not 1 <= len(values) <= MOST_POINTS:
            yield f"a shape needs 1 to {MOST_POINTS} points, not {len(values)}"
        if not all(map(math.isfinite, values)):
            wrong = next(value for value in values if not math.isfinite(value))
            yield f"the values of points must be finite, not {wrong!r}"
            return
        yield from itertools.islice(_order_mistakes(values), 1)
        for value, degree in zip(values, degrees, strict=False):
            if not 0.0 <= degree <= 1.0:
                yield f"the degree at {value!r} must lie in [0, 1], not {degree!r}"
                return


Shape = Band | LR | Points
"""The membership functions of rule bases."""


def clip(n: Numbers[N], x: N, high: float) -> N:
    """Return min(max(x, 0), high)."""
    return n.minimum(n.maximum(x, 0.0), high)


def _flank(n: Numbers[N], edge: float, end: float | None, x: N) -> N:
    if end is None:
        return n.constant(0.0)
    return clip(n, (x - end) / (n.constant(edge) - end), BELOW_ONE)


def _horner(n: Numbers[N], coefficients: Sequence[float], x: N) -> N:
    """Return c0 + x (c1 + x (c2 + ...)), from the inside out."""
    total = n.constant(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


def _side(n: Numbers[N], side: Side, distance: N) -> N:
    u = clip(n, distance / side.spread, side.reach)
    t = n.minimum(u, 1.0)
    body = clip(n, 1.0 - t * _horner(n, side.curve, 2.0 * t - 1.0), 1.0)
    w = clip(n, (side.reach - u) / (n.constant(side.reach) - 1.0), 1.0)
    return body * square(square(w))


def _slopes(n: Numbers[N], points: Points, x: N) -> list[N]:
    """Return the slopes of ramps, triangles and trapezoids; none of other points."""
    values, degrees = points.values, points.degrees
    widths = [right - left for left, right in itertools.pairwise(values)]
    if not all(0.0 < width < math.inf for width in widths):
        return []
    if degrees not in ((0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0, 0.0), (1.0, 0.0)):
        return []
    slopes: list[N] = []
    if degrees[0] == 0.0:
        slopes.append(scaled(n, x, values[0], values[1]))
    if degrees[-1] == 0.0:
        slopes.append(scaled(n, x, values[-1], values[-2]))
    return slopes


_Pair = tuple[float, float]


def _piece(n: Numbers[N], left: _Pair, right: _Pair, x: N) -> N:
    """Return the degree between two points; elsewhere it may be anything.

    Level, it is one number. From 0, the quotient's part of the other degree needs no
    clamping: the quotient lies in [0, 1].
    """
    if left[1] == right[1]:
        return n.constant(left[1])
    anchor, other, near, far = map(n.constant, _ends(left, right))
    if left[1] != 0.0 != right[1]:
        return _line(n, (anchor, other, near, far), x)
    if left[1] == 0.0:
        return ((x - anchor) / (other - anchor)) * far
    return ((anchor - x) / (anchor - other)) * far  # the other way round: 0, never -0


def _ends(left: _Pair, right: _Pair) -> tuple[float, float, float, float]:
    """Return the anchor of a line, its other end, and the degrees of the two."""
    (a, below), (b, above) = left, right
    return (a, b, below, above) if below == 0.0 else (b, a, above, below)


def _line(n: Numbers[N], ends: Sequence[N], x: N) -> N:
    anchor, other, near, far = ends
    line = near + n.divide(x - anchor, other - anchor) * (far - near)
    clamped = n.maximum(line, n.minimum(near, far))
    return n.minimum(clamped, n.maximum(near, far))


def _looked_up(n: Numbers[N], points: Points, x: N) -> N:
    """Return the degree on a line whose ends are looked up in tables.

    Before the first point and behind the last one the line is level.
    """
    pairs = list(zip(points.values, points.degrees, strict=True))
    (first, low), (last, high) = pairs[0], pairs[-1]
    ends = [(first, first - 1.0, low, low)]
    ends += [_ends(left, right) for left, right in itertools.pairwise(pairs)]
    ends.append((last, last - 1.0, high, high))
    place = n.table("below", x, points.values)
    looked = [n.table("pick", place, table) for table in zip(*ends, strict=True)]
    outer = [0.0] * len(ends)
    outer[0] = outer[-1] = 1.0
    is_outer = n.less(0.5, n.table("pick", place, outer))
    return n.where(is_outer, looked[2], _line(n, looked, x))


def _order_mistakes(values: tuple[float, ...]) -> Iterator[str]:
    for before, value in itertools.pairwise(values):
        if value < before:
            yield (
                f"the values of points must not decrease: {value!r} stands "
                f"behind {before!r}"
            )
        elif not math.isfinite(value - before):
            yield f"the points at {before!r} and {value!r} are too far apart"
    for before, after in zip(values, values[2:], strict=False):
        if before == after:
            yield f"three points at {before!r}; two make a step"


def _side_mistakes(name: str, side: Side) -> Iterator[str]:
    if not (math.isfinite(side.spread) and side.spread > 0):
        yield f"the {name} spread must be finite and above 0, not {side.spread!r}"
    if not (math.isfinite(side.reach) and side.reach > 1):
        yield f"the {name} reach must be finite and above 1, not {side.reach!r}"
    yield from _curve_mistakes(f"{name} side", side.curve)


def _curve_mistakes(name: str, curve: tuple[float, ...]) -> Iterator[str]:
    if not 1 <= len(curve) <= 8:
        yield f"the {name} needs 1 to 8 coefficients, not {len(curve)}"
    if not all(abs(coefficient) <= _LARGEST_COEFFICIENT for coefficient in curve):
        yield f"the coefficients of the {name} must lie within +-1e6"
