"""How far it is from a point to the nearest one of some kind, between two bounds.

Distance is the largest difference of an input, as a share of the domain's width of it.
So all points within a radius are a box, and an exact decision procedure for boxes gives
the distance by bisection: the lower bound is a radius within which none was proved to
exist, the upper one is the distance of a point that was evaluated.

A polytope is a box of the inputs cut by half-spaces. A linear program gives the radius
of the ball that meets it; bounds by doubles say which polytope is first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Domain, DomainSide, Point
from fuzzytree.auditing.engine.linear import (
    ONE,
    ZERO,
    Range,
    Row,
    feasible,
    holds,
    inequalities,
    least,
    simple,
)
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    State,
    Witness,
    point_of,
)
from fuzzytree.model import FloatArray, Value, Variable
from fuzzytree.numerics import U, outwards

NARROW = Fraction(1, 1000)
"""The two bounds differ by this share of the upper one, unless something stops it."""

LEAST = Fraction(1, 2**40)
"""Radii below it are taken for 0."""

_HALVINGS = 10  # of the way from the point to a witness


class Nearest(Value, frozen=True):
    """Bounds of a distance."""

    low: Fraction  # no point of the kind is nearer than this
    # the distance of `point`; None if no such point is known
    high: Fraction | None = None
    point: Point | None = None  # A point of the kind
    why: str = ""  # why the bounds are not narrow, or why there is no point
    # whether there proved to be no such point in all of the domain
    is_none: bool = False

    @property
    def is_narrow(self) -> bool:
        """Whether the bounds are as narrow as `NARROW` requires."""
        if self.high is None:
            return self.is_none
        return self.high - self.low <= max(2 * NARROW * self.high, 2 * LEAST)


def distance(
    domain: Domain, one: Mapping[str, Fraction], other: Mapping[str, Fraction]
) -> Fraction:
    """Return the largest difference of two points, in shares of the domain's widths.

    An input that the domain fixes at one value does not count.

    Example:
        >>> box = Domain((DomainSide("x", 0.0, 4.0), DomainSide("y", 0.0, 1.0)))
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


def width_of(side: DomainSide) -> Fraction:
    """Return how wide a side is."""
    return Fraction(side.high) - Fraction(side.low)


def ball(domain: Domain, centre: Mapping[str, Fraction], radius: Fraction) -> Domain:
    """Return all of a domain within a radius of a point, and next to nothing more.

    Example:
        >>> box = Domain((DomainSide("x", 0.0, 4.0),))
        >>> ball(box, {"x": Fraction(1)}, Fraction(1, 2)).sides[0].high
        3.0
    """
    return Domain(tuple(_near(side, centre, radius) for side in domain.sides))


def _near(
    side: DomainSide, centre: Mapping[str, Fraction], radius: Fraction
) -> DomainSide:
    if side.variable not in centre:  # a combination
        return side
    at, reach = centre[side.variable], radius * width_of(side)
    low = max(side.low, outwards(at - reach)[0])
    high = min(side.high, outwards(at + reach)[1])
    is_open = side.is_open and low == side.low
    return DomainSide(side.variable, low, high, side.origin, is_open)


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
    search.low = clear or ZERO
    return search.run(within, near)


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

    def run(self, within: Fraction | None, near: Iterable[Point]) -> Nearest:
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
        result = distance(self.domain, self.centre, point)
        if self.high is None or result < self.high:
            self.high, self.point = result, point

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


# --- polytopes

Half = tuple[Mapping[int, Fraction], Fraction]
"""A half-space: weights of the inputs, by number, and what their sum is at least."""


class Polytope(NamedTuple):
    """A part of the inputs."""

    ranges: tuple[Range, ...]  # the closed range of each input
    rows: tuple[Row, ...]  # combinations within bounds, and open ends of inputs
    halves: tuple[Half, ...]  # the closed half-spaces of the combinations


def polytope_of(
    box: Domain, inputs: Sequence[str], variables: Mapping[str, Variable]
) -> Polytope:
    """Return a box of inputs and combinations as a polytope."""
    ranges, rows = inequalities(box, inputs, variables.values())
    halves: list[Half] = []
    for weights, low, high, *_ in rows:
        if low is not None and high is not None:
            halves.append((weights, low))
            halves.append(({place: -w for place, w in weights.items()}, -high))
    return Polytope(tuple(ranges), tuple(rows), tuple(halves))


class Polytopes:
    """Some polytopes of a domain, to find the nearest of them.

    `domain`: in whose widths distance is measured; `parts`: the polytopes; those
    without a point may be among them.
    """

    def __init__(
        self, domain: Domain, inputs: Sequence[str], parts: Sequence[Polytope]
    ) -> None:
        self.domain, self.inputs, self.parts = domain, inputs, parts
        wholes = {side.variable: side for side in domain.sides}
        self.wholes: list[DomainSide] = [wholes[name] for name in inputs]
        self.widths = [width_of(side) for side in self.wholes]
        self._bound = _Bound(parts, self.widths)

    def nearest(
        self,
        centre: Mapping[str, Fraction],
        chosen: Sequence[int],
        clock: Clock | None = None,
    ) -> Nearest:
        """Return how far the nearest of some of the polytopes is from a point.

        The lower bound is the distance itself, or less by next to nothing.

        Example:
            >>> whole = Domain((DomainSide("x", 0.0, 4.0),))
            >>> right = Domain((DomainSide("x", 2.0, 4.0, is_open=True),))
            >>> parts = Polytopes(whole, ["x"], [polytope_of(right, ["x"], {})])
            >>> result = parts.nearest({"x": Fraction(1)}, [0])
            >>> str(result.low), 2 < result.point["x"] < Fraction("2.01")
            ('1/4', True)
        """
        at = [centre[name] for name in self.inputs]
        bounds = self.bounds(centre)
        best: Nearest | None = None
        least = Fraction(1)
        clock = clock or Clock()
        for place in sorted(chosen, key=lambda one: (bounds[one], one)):
            if best is not None and best.high is not None and bounds[place] > best.high:
                break
            if clock.is_over:
                low = min(least, Fraction(bounds[place]))
                high, point = (None, None) if best is None else (best.high, best.point)
                return Nearest(low, high, point, "the budget was spent")
            reached = self._reached(place, at, None if best is None else best.high)
            if reached is None:
                continue
            low, values = reached
            least = min(least, low)
            if values is not None:
                point = dict(zip(self.inputs, values, strict=True))
                high = distance(self.domain, centre, point)
                if best is None or best.high is None or high < best.high:
                    best = Nearest(low, high, point)
        if best is None:
            return Nearest(Fraction(1), is_none=True)
        return Nearest(least, best.high, best.point)

    def bounds(self, centre: Mapping[str, Fraction]) -> list[float]:
        """Return a radius within which each polytope is not, quickly."""
        return self._bound.of([centre[name] for name in self.inputs])

    def _reached(
        self, place: int, at: Sequence[Fraction], enough: Fraction | None
    ) -> tuple[Fraction, list[Fraction] | None] | None:
        """Return a radius within which a polytope is not, and a point just beyond.

        No point is sought beyond a radius that is enough.

        Returns:
            None if the polytope has no point.
        """
        part = self.parts[place]
        low = self._least(part, at)
        if low is None:
            return None
        if enough is not None and low >= enough:
            return low, None
        step = max(low * NARROW, LEAST) / 2
        ball = self._ball(part, at, simple(low + step / 2, low + step))
        result = feasible(ball, part.rows)
        if result is None:
            return None
        return low, _plainer(result, at, part, [step * w for w in self.widths])

    def _least(self, part: Polytope, at: Sequence[Fraction]) -> Fraction | None:
        """Return how far a polytope is, with its open ends; None if it is empty."""
        low = self._gap(part, at)
        used = sorted({place for weights, _ in part.halves for place in weights})
        if not used:
            return low
        number = {place: n for n, place in enumerate(used)}
        radius = len(used)
        rows = [
            row._replace(weights={number[p]: w for p, w in row.weights.items()})
            for row in part.rows
            if number.keys() >= row.weights.keys()
        ]
        for place, n in number.items():
            x, width = at[place], self.widths[place]
            rows.append(Row({n: ONE, radius: width}, low=x))
            rows.append(Row({n: ONE, radius: -width}, high=x))
        ranges = [*(part.ranges[place] for place in used), (low, max(low, ONE))]
        return least(ranges, rows, radius)

    def _gap(self, part: Polytope, at: Sequence[Fraction]) -> Fraction:
        """Return how far a polytope's box is from a point."""
        result = ZERO
        for x, (low, high), width in zip(at, part.ranges, self.widths, strict=True):
            gap = max(low - x, x - high, ZERO)
            result = max(result, gap / width if gap else ZERO)
        return result

    def _ball(
        self, part: Polytope, at: Sequence[Fraction], radius: Fraction
    ) -> list[Range]:
        return [
            (max(low, x - radius * width), min(high, x + radius * width))
            for x, (low, high), width in zip(at, part.ranges, self.widths, strict=True)
        ]


def _plainer(
    values: Sequence[Fraction],
    at: Sequence[Fraction],
    part: Polytope,
    slack: Sequence[Fraction],
) -> list[Fraction]:
    """Return a point of a polytope, each value as near to the centre as may be.

    `slack`: how much farther than needed a value may be, to have fewer digits.
    """
    result = list(values)
    for place, ((low, high), x) in enumerate(zip(part.ranges, at, strict=True)):
        near = x
        if x < low:
            near = simple(low, min(high, low + slack[place]))
        elif x > high:
            near = simple(max(low, high - slack[place]), high)
        other = [*result[:place], near, *result[place + 1 :]]
        touched = (row for row in part.rows if row.weights.get(place))
        if all(holds(row, other) for row in touched):
            result = other
    return result


class _Bound:
    """Lower bounds of distances to all polytopes at once, by doubles."""

    def __init__(self, parts: Sequence[Polytope], widths: Sequence[Fraction]) -> None:
        shape = (len(parts), len(widths))
        self.low = np.array([[float(a) for a, _ in p.ranges] for p in parts])
        self.high = np.array([[float(b) for _, b in p.ranges] for p in parts])
        self.low, self.high = self.low.reshape(shape), self.high.reshape(shape)
        self.width = np.array([float(width) or np.inf for width in widths])
        owned = [(n, half) for n, p in enumerate(parts) for half in p.halves]
        self.owner = np.array([n for n, _ in owned], dtype=np.int64)
        self.weights = np.zeros((len(owned), len(widths)))
        for row, (_, (weights, _)) in enumerate(owned):
            for place, weight in weights.items():
                self.weights[row, place] = float(weight)
        self.goal = np.array([float(goal) for _, (_, goal) in owned])

    def of(self, at: Sequence[Fraction]) -> list[float]:
        """Return a radius within which each polytope cannot be.

        Every number is off by at most a rounding, a sum of n products by n more.
        """
        x = np.array([float(value) for value in at])
        with np.errstate(all="ignore"):
            some = 8 * (len(x) + 4) * U
            size = np.maximum(np.abs(self.low), np.abs(self.high)) + np.abs(x)
            gap = np.maximum(self.low - x, x - self.high) - some * size
            result = np.max(gap / self.width, axis=1, initial=0.0)
            reach = np.abs(self.weights) @ np.where(
                self.width < np.inf, self.width, 0.0
            )
            size = np.abs(self.weights) @ np.abs(x) + np.abs(self.goal)
            lack = self.goal - self.weights @ x - some * size
            is_short = (lack > 0.0) & (reach > 0.0)
            radius = np.divide(lack, reach, out=np.zeros_like(lack), where=is_short)
            np.maximum.at(result, self.owner, radius)
        floor = np.maximum(result * (1.0 - some) - 2.0**-1000, 0.0)
        known: FloatArray = np.where(np.isfinite(floor), floor, 0.0)
        return list(known.tolist())
