"""How far the nearest of some polytopes is, by linear inequalities in fractions.

A polytope is a box of the inputs cut by half-spaces. One half-space alone tells a
radius within which the polytope cannot be, in closed form. If nothing of the polytope
is just beyond that radius, some sum of multiples of its half-spaces says so, and tells
a larger radius, until something is: each step is a vertex of the dual problem, none of
which comes twice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, Side
from fuzzytree.auditing.engine.linear import (
    ZERO,
    Range,
    Row,
    feasible,
    holds,
    simple,
    solved,
)
from fuzzytree.auditing.engine.nearest import LEAST, NARROW, Nearest, distance, width_of
from fuzzytree.auditing.engine.variables import linear_form
from fuzzytree.model.rulebase import Variable
from fuzzytree.numerics.enclosures import U

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

Half = tuple[Mapping[int, Fraction], Fraction]
"""A half-space: weights of the inputs, by number, and what their sum is at least."""


class Polytope(NamedTuple):
    """A part of the inputs.

    Attributes:
        ranges: The closed range of each input.
        rows: Combinations within bounds, and open ends of inputs.
        halves: The closed half-spaces of the combinations.
    """

    ranges: tuple[Range, ...]
    rows: tuple[Row, ...]
    halves: tuple[Half, ...]


def polytope_of(
    box: Domain, inputs: Sequence[str], variables: Mapping[str, Variable]
) -> Polytope:
    """Return a box of inputs and combinations as a polytope.

    Args:
        box: A side for each input, and for any combinations.
        inputs: The names of the inputs.
        variables: The combinations, by name, and any others.
    """
    number = {name: place for place, name in enumerate(inputs)}
    sides = {side.variable: side for side in box.sides}
    ranges = tuple(
        (Fraction(sides[name].low), Fraction(sides[name].high)) for name in inputs
    )
    rows: list[Row] = []
    halves: list[Half] = []
    for name, side in sides.items():
        low, high = Fraction(side.low), Fraction(side.high)
        if name not in number:
            weights, constant = linear_form(variables[name], number)
            low, high = low - constant, high - constant
            rows.append(Row(weights, low, high, side.is_open))
            halves.append((weights, low))
            halves.append(({place: -w for place, w in weights.items()}, -high))
        elif side.is_open:
            rows.append(Row({number[name]: Fraction(1)}, low, is_open_low=True))
    return Polytope(ranges, tuple(rows), tuple(halves))


class Polytopes:
    """Some polytopes of a domain, of which the nearest is asked for.

    Args:
        domain: In whose widths distance is measured.
        inputs: The names of the inputs.
        parts: The polytopes; those without a point may be among them.
    """

    def __init__(
        self, domain: Domain, inputs: Sequence[str], parts: Sequence[Polytope]
    ) -> None:
        self.domain, self.inputs, self.parts = domain, inputs, parts
        wholes = {side.variable: side for side in domain.sides}
        self.wholes: list[Side] = [wholes[name] for name in inputs]
        self.widths = [width_of(side) for side in self.wholes]
        self._empty: dict[int, bool] = {}
        self._bound = _Bound(parts, self.widths)

    def nearest(
        self,
        centre: Mapping[str, Fraction],
        chosen: Sequence[int],
        clock: Clock | None = None,
    ) -> Nearest:
        """Return how far the nearest of some of the polytopes is from a point.

        The lower bound is the distance itself, or less by next to nothing.

        Args:
            centre: A point of the domain.
            chosen: The positions of the polytopes that count.
            clock: How much time there is; no limit unless given.

        Example:
            >>> line = Domain((Side("x", 0.0, 4.0),))
            >>> right = Domain((Side("x", 2.0, 4.0, is_open=True),))
            >>> asked = Polytopes(line, ["x"], [polytope_of(right, ["x"], {})])
            >>> found = asked.nearest({"x": Fraction(1)}, [0])
            >>> str(found.low), 2 < found.point["x"] < Fraction("2.01")
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
        low = self._gap(part, at)
        for half in part.halves:
            radius = self._radius(part, at, half, low)
            if radius is None:
                return None
            low = max(low, radius)
        beyond = low
        while enough is None or low < enough:
            step = max(beyond * NARROW, LEAST) / 2
            beyond = simple(beyond + step / 2, beyond + step)
            found = solved(self._ball(part, at, beyond), part.rows)
            if isinstance(found, Row):
                goal = found.low if found.low is not None else ZERO
                radius = self._radius(part, at, (found.weights, goal), low)
                if radius is None:
                    return None
                low = beyond = max(low, radius)
            elif found is not None:
                return low, _plainer(found, at, part)
            elif self._is_empty(place):
                return None
        return low, None

    def _is_empty(self, place: int) -> bool:
        """Return whether a polytope that is not empty with its ends is so without."""
        if place not in self._empty:
            part = self.parts[place]
            self._empty[place] = feasible(part.ranges, part.rows) is None
        return self._empty[place]

    def _gap(self, part: Polytope, at: Sequence[Fraction]) -> Fraction:
        """Return how far a polytope's box is from a point."""
        found = ZERO
        for x, (low, high), width in zip(at, part.ranges, self.widths, strict=True):
            gap = max(low - x, x - high, ZERO)
            found = max(found, gap / width if gap else ZERO)
        return found

    def _ball(
        self, part: Polytope, at: Sequence[Fraction], radius: Fraction
    ) -> list[Range]:
        return [
            (max(low, x - radius * width), min(high, x + radius * width))
            for x, (low, high), width in zip(at, part.ranges, self.widths, strict=True)
        ]

    def _radius(
        self, part: Polytope, at: Sequence[Fraction], half: Half, start: Fraction
    ) -> Fraction | None:
        """Return the least radius, at least `start`, at which a half-space is met.

        Within a radius r an input adds at most |w| min(r width, room) to the sum.
        """
        weights, goal = half
        lack = goal
        moving: list[tuple[Fraction, Fraction]] = []
        for place, weight in weights.items():
            low, high = part.ranges[place]
            x, width, size = at[place], self.widths[place], abs(weight)
            room = high - x if weight > 0 else x - low
            lack -= weight * x
            if room > 0 and width:
                moving.append((room / width, size * width))
            else:
                lack -= size * room
        slope = sum((rate for _, rate in moving), ZERO)
        radius = ZERO
        for end, rate in sorted(moving):
            if lack <= slope * (end - radius):
                break
            lack -= slope * (end - radius)
            slope -= rate
            radius = end
        if lack > 0:
            if not slope:
                return None
            radius += lack / slope
        return max(radius, start)


def _plainer(
    values: Sequence[Fraction], at: Sequence[Fraction], part: Polytope
) -> list[Fraction]:
    """Return a point of a polytope with as many values of the centre as may be."""
    found = list(values)
    for place, (low, high) in enumerate(part.ranges):
        other = [*found[:place], at[place], *found[place + 1 :]]
        touched = (row for row in part.rows if row.weights.get(place))
        if low <= at[place] <= high and all(holds(row, other) for row in touched):
            found = other
    return found


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
            found = np.max(gap / self.width, axis=1, initial=0.0)
            reach = np.abs(self.weights) @ np.where(
                self.width < np.inf, self.width, 0.0
            )
            size = np.abs(self.weights) @ np.abs(x) + np.abs(self.goal)
            lack = self.goal - self.weights @ x - some * size
            is_short = (lack > 0.0) & (reach > 0.0)
            radius = np.divide(lack, reach, out=np.zeros_like(lack), where=is_short)
            np.maximum.at(found, self.owner, radius)
        floor = np.maximum(found * (1.0 - some) - 2.0**-1000, 0.0)
        known: FloatArray = np.where(np.isfinite(floor), floor, 0.0)
        return list(known.tolist())
