"""How far it is from a point to the nearest one of some kind, between two bounds.

Distance is the largest difference of an input, in shares of the domain's width of it.
So all points within a radius are a box, and a question about boxes that is answered
exactly gives the distance by bisection: the lower bound is a radius within which there
proved to be none, the upper one is the distance of a point that was evaluated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Domain, Side
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    State,
    Witness,
    point_of,
)
from fuzzytree.auditing.engine.variables import Point
from fuzzytree.model.rulebase import Value
from fuzzytree.numerics.exact import outwards

NARROW = Fraction(1, 1000)
"""The two bounds differ by this share of the upper one, unless something stops it."""

LEAST = Fraction(1, 2**40)
"""Radii below it are taken for 0."""

_HALVINGS = 10  # of the way from the point to a witness


class Nearest(Value, frozen=True):
    """Bounds of a distance.

    Attributes:
        low: No point of the kind is nearer than this.
        high: The distance of `point`; None if no such point is known.
        point: A point of the kind.
        why: Why the bounds are not narrow, or why there is no point.
        is_none: Whether there proved to be no such point in all of the domain.
    """

    low: Fraction
    high: Fraction | None = None
    point: Point | None = None
    why: str = ""
    is_none: bool = False

    @property
    def is_narrow(self) -> bool:
        """Whether the distance is known as well as it was asked for."""
        if self.high is None:
            return self.is_none
        return self.high - self.low <= max(2 * NARROW * self.high, 2 * LEAST)


def distance(
    domain: Domain, one: Mapping[str, Fraction], other: Mapping[str, Fraction]
) -> Fraction:
    """Return the largest difference of two points, in shares of the domain's widths.

    An input that the domain fixes at one value does not count.

    Example:
        >>> box = Domain((Side("x", 0.0, 4.0), Side("y", 0.0, 1.0)))
        >>> zero = {"x": Fraction(0), "y": Fraction(0)}
        >>> str(distance(box, zero, {"x": Fraction(1), "y": Fraction(1, 8)}))
        '1/4'
    """
    return max(
        (
            abs(one[side.variable] - other[side.variable]) / width_of(side)
            for side in domain.sides
            if side.variable in one and side.low < side.high
        ),
        default=Fraction(0),
    )


def width_of(side: Side) -> Fraction:
    """Return how wide a side is."""
    return Fraction(side.high) - Fraction(side.low)


def ball(domain: Domain, centre: Mapping[str, Fraction], radius: Fraction) -> Domain:
    """Return all of a domain within a radius of a point, and next to nothing more.

    Example:
        >>> box = Domain((Side("x", 0.0, 4.0),))
        >>> ball(box, {"x": Fraction(1)}, Fraction(1, 2)).sides[0].high
        3.0
    """
    return Domain(tuple(_near(side, centre, radius) for side in domain.sides))


def _near(side: Side, centre: Mapping[str, Fraction], radius: Fraction) -> Side:
    if side.variable not in centre:  # a combination
        return side
    at, reach = centre[side.variable], radius * width_of(side)
    low = max(side.low, outwards(at - reach)[0])
    high = min(side.high, outwards(at + reach)[1])
    is_open = side.is_open and low == side.low
    return Side(side.variable, low, high, side.origin, is_open)


def nearest(
    domain: Domain,
    centre: Mapping[str, Fraction],
    ask: Callable[[Domain], State],
    is_one: Callable[[Mapping[str, Fraction]], bool],
    clock: Clock | None = None,
    *,
    within: Fraction | None = None,
    clear: Fraction | None = None,
    near: Iterable[Point] = (),
) -> Nearest:
    """Return how far the nearest point of a kind is.

    Args:
        domain: Where it is sought.
        centre: From where; a point of the domain.
        ask: Whether a box has such a point: `Proved` if not, or a `Witness`. Any other
            state leaves it open.
        is_one: Whether a point of the inputs' box is in the domain and of the kind,
            exactly.
        clock: How much time there is.
        within: Only points up to this distance matter; all of the domain unless given.
        clear: A radius within which there is known to be none.
        near: Points that may be of the kind, and near.
    """
    search = _Search(domain, centre, ask, is_one, clock or Clock())
    if clear is not None:
        search.low = clear
    return search.found(within, near)


def nearest_box(
    domain: Domain, centre: Mapping[str, Fraction], targets: Iterable[Domain]
) -> Nearest:
    """Return how far the nearest of some boxes of the inputs is, exactly.

    The lower bound is the distance itself; where a box is open at that end, no point of
    it has just this distance, and the point is a little farther.

    Args:
        domain: In whose widths distance is measured.
        centre: From where.
        targets: Boxes within the domain, none empty, each with a side for every input.

    Example:
        >>> line = Domain((Side("x", 0.0, 4.0),))
        >>> right = Domain((Side("x", 2.0, 4.0, is_open=True),))
        >>> found = nearest_box(line, {"x": Fraction(1)}, [right])
        >>> str(found.low), 2 < found.point["x"] < Fraction("2.01")
        ('1/4', True)
    """
    best: tuple[Fraction, int] | None = None
    chosen: Domain | None = None
    wholes = {side.variable: side for side in domain.sides}
    for target in targets:
        gaps = [_gap(side, wholes[side.variable], centre) for side in target.sides]
        rank = max(gaps, default=Fraction(0)), sum(1 for gap in gaps if gap)
        if best is None or rank < best:
            best, chosen = rank, target
    if best is None or chosen is None:
        return Nearest(Fraction(1), is_none=True)
    slack = max(best[0] * NARROW, LEAST) / 2
    point = {
        side.variable: _closest(side, centre[side.variable], slack * width_of(whole))
        for side in chosen.sides
        if (whole := wholes[side.variable])
    }
    return Nearest(best[0], distance(domain, centre, point), point)


def _gap(side: Side, whole: Side, centre: Mapping[str, Fraction]) -> Fraction:
    """Return how far a value is from a side, in shares of the whole side's width."""
    at = centre[side.variable]
    gap = max(Fraction(side.low) - at, at - Fraction(side.high), Fraction(0))
    return gap / width_of(whole) if gap else gap


def _closest(side: Side, at: Fraction, slack: Fraction) -> Fraction:
    """Return a plain value of a side that is all but the closest to another."""
    low, high = Fraction(side.low), Fraction(side.high)
    if low < at <= high or (at == low and not side.is_open):
        return at
    if at <= low:
        return simple(low, min(high, low + slack))
    return simple(max(low, high - slack), high)


class _Search:
    """One search, with the bounds so far."""

    def __init__(
        self,
        domain: Domain,
        centre: Mapping[str, Fraction],
        ask: Callable[[Domain], State],
        is_one: Callable[[Mapping[str, Fraction]], bool],
        clock: Clock,
    ) -> None:
        self.domain, self.centre, self.clock = domain, centre, clock
        self.ask, self.is_one = ask, is_one
        self.low = Fraction(0)
        self.high: Fraction | None = None
        self.point: Point | None = None
        self.why = ""

    def found(self, within: Fraction | None, near: Iterable[Point]) -> Nearest:
        try:
            if self.is_one(self.centre):
                return Nearest(Fraction(0), Fraction(0), dict(self.centre))
            top = Fraction(1) if within is None else within
            for point in near:
                if self.is_one(point):
                    self._keep(self._drawn(point))
            is_met = self.high is not None and self.high <= top
            whole = self.domain if within is None else self._ball(top)
            if not is_met and self._is_clear(whole):
                return Nearest(top, is_none=within is None)
            self._bisect(top if self.high is None else min(top, self.high))
        except OutOfTimeError:
            self.why = "the budget was spent"
        return Nearest(self.low, self.high, self.point, self.why)

    def _bisect(self, top: Fraction) -> None:
        """Narrow the bounds; `top` is the least radius that is not clear, as known."""
        is_tight = self.high is not None
        while top > LEAST and top - self.low > NARROW * top:
            # A witness drawn near is often all but the nearest: try just below it.
            radius = top * (1 - NARROW) if is_tight else (self.low + top) / 2
            if self._is_clear(self._ball(radius)):
                self.low = radius
                is_tight = False
            else:
                before, top = top, radius
                if self.high is not None and self.high < top:
                    top = self.high
                is_tight = not is_tight and top < before

    def _ball(self, radius: Fraction) -> Domain:
        return ball(self.domain, self.centre, radius)

    def _is_clear(self, box: Domain) -> bool:
        """Return whether a box has no such point; a witness is drawn near."""
        self.clock.check()
        state = self.ask(box)
        if isinstance(state, Proved):
            return True
        if isinstance(state, Witness):
            self._keep(self._drawn(point_of(state.point)))
        elif isinstance(state, Declined):
            self.why = state.reason
        elif isinstance(state, Bracket):
            self.why = state.why
        return False

    def _keep(self, point: Point) -> None:
        found = distance(self.domain, self.centre, point)
        if self.high is None or found < self.high:
            self.high, self.point = found, point

    def _drawn(self, point: Point) -> Point:
        """Return a point of the kind between a witness and the centre."""
        for name in sorted(point):
            other = {**point, name: self.centre[name]}
            if self.is_one(other):
                point = other
        far, near = Fraction(1), Fraction(0)
        for _ in range(_HALVINGS):
            middle = (far + near) / 2
            other = self._between(point, middle)
            if self.is_one(other):
                far = middle
            else:
                near = middle
        drawn = self._between(point, far)
        return drawn if far < 1 and self.is_one(drawn) else point

    def _between(self, point: Point, share: Fraction) -> Point:
        """Return a point on the way from the centre to another, with plain values."""
        moved: Point = {}
        for name, value in point.items():
            at = self.centre[name]
            goal = at + (value - at) * share
            slack = abs(value - at) * share / 4096
            moved[name] = simple(goal - slack, goal + slack) if slack else goal
        return moved
