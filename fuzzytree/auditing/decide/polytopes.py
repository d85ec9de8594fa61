"""The nearest part of a domain: boxes of the inputs, cut by half-spaces.

A linear program gives the cost of the cheapest change that leads into a part; bounds by
doubles say which part is first. Where a program answers with a value that rows cannot
have, such as half a whole number, the part is split there.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import ONE, ZERO, Budget, OutOfStepsError
from fuzzytree.auditing.decide.costs import LEAST, NARROW, Costs, Nearest
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.linear import (
    Row,
    feasible,
    holds,
    least_radius,
    row_of,
    simple,
)
from fuzzytree.auditing.decide.regions import boxes, cut_side, leaf_at, regions
from fuzzytree.model import FloatArray, FuzzyTree, Variable
from fuzzytree.numerics import U, outwards

_STEPS = 2_000  # of a linear program of up to `_SMALL` weights, about
_SMALL = 16
_MOST_PARTS = 2_000  # that splits make


class Polytope(NamedTuple):
    """A part of the inputs: a side of each, and rows on sums and open ends."""

    sides: tuple[DomainSide, ...]
    rows: tuple[Row, ...]

    @property
    def sums(self) -> list[Row]:
        """The rows that limit sums of inputs."""
        return [
            row for row in self.rows if row.low is not None and row.high is not None
        ]


def polytope_of(
    box: Domain, inputs: Sequence[str], variables: Iterable[Variable]
) -> Polytope:
    """Return a box of inputs and sums as a polytope."""
    every = {side.variable: side for side in box.sides}
    sides = tuple(every[name] for name in inputs)
    number = {name: place for place, name in enumerate(inputs)}
    rows = [
        Row({place: ONE}, side.ends[0], is_open_low=True)
        for place, side in enumerate(sides)
        if side.is_open
    ]
    for variable in variables:
        if variable.parts and variable.name in every:
            side = every[variable.name]
            rows.append(row_of(variable, number, side.ends, is_open_low=side.is_open))
    return Polytope(sides, tuple(rows))


class Polytopes:
    """Some polytopes of a domain, to find the nearest of them; they may be empty.

    Example:
        >>> whole = Domain((DomainSide("x", 0.0, 4.0),))
        >>> right = Domain((DomainSide("x", 2.0, 4.0, is_open=True),))
        >>> parts = Polytopes(["x"], [polytope_of(right, ["x"], ())])
        >>> result = parts.nearest({"x": Fraction(1)}, [0], Costs(whole, ["x"]))
        >>> str(result.low), 2 < result.point["x"] < Fraction("2.01")
        ('1/4', True)
    """

    def __init__(self, inputs: Sequence[str], parts: Sequence[Polytope]) -> None:
        self.inputs, self.parts = tuple(inputs), tuple(parts)
        shape = len(self.parts), len(self.inputs)
        ends = [[[*map(float, s.ends)] for s in part.sides] for part in self.parts]
        self._low, self._high = np.array(ends).reshape(*shape, 2).transpose(2, 0, 1)
        halves = [
            (n, {i: sign * w for i, w in row.weights.items()}, sign * end)
            for n, part in enumerate(self.parts)
            for row in part.sums
            for sign, end in ((1, row.low), (-1, row.high))
            if end is not None
        ]
        self._owner = np.array([n for n, *_ in halves], dtype=np.int64)
        self._weights = np.zeros((len(halves), len(self.inputs)))
        for at, (_, weights, _) in enumerate(halves):
            for place, weight in weights.items():
                self._weights[at, place] = float(weight)
        self._goal = np.array([float(goal) for *_, goal in halves])
        self._costs: dict[tuple[int, Fraction], FloatArray] = {}

    def bounds(self, centre: Mapping[str, Fraction], costs: Costs) -> list[float]:
        """Return for each part a cost below which it is not reached, quickly.

        Every number is off by at most a rounding, a sum of n products by n more.
        """
        at = [centre[name] for name in self.inputs]
        x = np.array([float(value) for value in at])
        jumps = [_may_jump(costs, name) for name in self.inputs]
        rate = np.array([float(costs.rate[name]) for name in self.inputs])
        rate[jumps] = 0.0
        free = np.array([name not in costs.fixed for name in self.inputs], dtype=float)
        with np.errstate(all="ignore"):
            some = 8 * (len(x) + 4) * U
            size = np.maximum(np.abs(self._low), np.abs(self._high)) + np.abs(x)
            gap = np.maximum(self._low - x, x - self._high) - some * size
            result = np.max(gap * rate, axis=1, initial=0.0)
            width = np.where(rate > 0.0, free / rate, 0.0)
            reach = np.abs(self._weights) @ width
            endless = np.abs(self._weights) @ (free * jumps)
            size = np.abs(self._weights) @ np.abs(x) + np.abs(self._goal)
            lack = self._goal - self._weights @ x - some * size
            is_short = (lack > 0.0) & (reach > 0.0) & (endless == 0.0)
            radius = np.divide(lack, reach, out=np.zeros_like(lack), where=is_short)
            np.maximum.at(result, self._owner, radius)
        for place, value in enumerate(at):
            if jumps[place]:
                result = np.maximum(result, self._jumps(place, value, costs))
        floor = np.maximum(result * (1.0 - some) - 2.0**-1000, 0.0)
        return [*map(float, np.where(np.isfinite(floor), floor, 0.0))]

    def _jumps(self, place: int, x: Fraction, costs: Costs) -> FloatArray:
        every = [float(costs.nearest(p.sides[place], x)[0]) for p in self.parts]
        return np.array(every) * (1.0 - 2 * U)

    def nearest(
        self,
        centre: Mapping[str, Fraction],
        chosen: Iterable[int],
        costs: Costs,
        budget: Budget | None = None,
    ) -> Nearest:
        """Return what it costs to reach the nearest of some of the polytopes.

        The lower bound is the cost itself, or less by next to nothing.
        """
        budget = budget or Budget()
        at = [centre[name] for name in self.inputs]
        bounds, number = self.bounds(centre, costs), itertools.count()
        queue = [(bounds[n], next(number), self.parts[n]) for n in chosen]
        heapq.heapify(queue)
        best: Nearest | None = None
        low, why = None, ""
        while queue:
            bound, _, part = heapq.heappop(queue)
            if best is not None and best.high is not None and bound > best.high:
                break
            used = {place for row in part.sums for place in row.weights}
            mixed = [p for p in sorted(used) if _is_mixed(part.sides[p], at[p], costs)]
            if mixed:  # values some of which cost nothing, or that have no order
                place = mixed[0]
                for half in _split(part, part.sides[place], at[place]):
                    cost, _ = costs.nearest(half.sides[place], at[place])
                    least = max(bound, outwards(cost)[0])
                    heapq.heappush(queue, (least, next(number), half))
                continue
            try:
                budget.spend(len(part.sides))
                if next(number) > _MOST_PARTS + len(self.parts):
                    why = "sums of whole numbers have too many parts"
                    raise OutOfStepsError
                enough = None if best is None else best.high
                reached = self._least_cost(part, centre, costs, enough, budget)
            except OutOfStepsError:
                low = min(Fraction(bound), ONE if low is None else low)
                why = why or "the budget was spent"
                break
            if reached is None:
                continue
            cost, values = reached
            point = dict(zip(self.inputs, values or (), strict=bool(values)))
            bad = [s for s in part.sides if values and not s.has(point[s.variable])]
            if bad:  # half a whole number
                for half in _split(part, bad[0], point[bad[0].variable]):
                    heapq.heappush(queue, (bound, next(number), half))
                continue
            low = cost if low is None else min(low, cost)
            if values:
                high = costs.distance(centre, point)
                if best is None or best.high is None or high < best.high:
                    best = Nearest(cost, high, point)
        if best is None or best.high is None:
            return Nearest(ONE if low is None else low, why=why, is_none=low is None)
        return Nearest(min(low or ZERO, best.high), best.high, best.point, why)

    def _least_cost(
        self,
        part: Polytope,
        centre: Mapping[str, Fraction],
        costs: Costs,
        enough: Fraction | None,
        budget: Budget,
    ) -> tuple[Fraction, list[Fraction] | None] | None:
        """Return a cost below which a polytope is not reached, and a point of it.

        No point is sought beyond a cost that is enough.

        Returns:
            None if the polytope has no point.
        """
        at = [centre[name] for name in self.inputs]
        sides = part.sides
        for name, x, side in zip(self.inputs, at, sides, strict=True):
            if name in costs.fixed and not side.has(x):
                return None
        near = [costs.nearest(s, x) for s, x in zip(sides, at, strict=True)]
        low = max((cost for cost, _ in near), default=ZERO)
        limits = [s.ends for s in sides]
        for place, name in enumerate(self.inputs):
            if name in costs.fixed:
                limits[place] = at[place], at[place]
        rates = [
            ZERO
            if s.values or x == costs.stand_in(s.variable)
            else costs.rate[s.variable]
            for s, x in zip(sides, at, strict=True)
        ]
        sums = [row for row in part.sums if row.weights]
        if any(not holds(row, at) for row in part.sums if not row.weights):
            return None
        size = sum(len(row.weights) for row in sums)
        steps = _STEPS * max(1, size // _SMALL)
        if sums:
            budget.spend(steps)
            result = _least(sums, limits, at, rates, low)
            if result is None:
                return None
            low = max(low, result)
        if enough is not None and low >= enough:
            return low, None
        step = max(low * NARROW, LEAST) / 2
        if not sums:
            values = []
            for side, x, (_, value), rate in zip(sides, at, near, rates, strict=True):
                slack = step / rate if rate else ZERO
                values.append(x if side.has(x) else _beside(side, x, value, slack))
            if any(not s.has(v) for s, v in zip(sides, values, strict=True)):
                return None
            return low, values
        budget.spend(steps)
        radius = simple(low + step / 2, low + step)
        ball = [
            (max(a, x - radius / rate), min(b, x + radius / rate)) if rate else (a, b)
            for (a, b), x, rate in zip(limits, at, rates, strict=True)
        ]
        point = feasible(ball, part.rows)
        if point is None:
            return None
        slacks = [step / rate if rate else ZERO for rate in rates]
        return low, _plainer(point, at, sides, ball, part.rows, slacks)


def _may_jump(costs: Costs, name: str) -> bool:
    """Return whether an input has changes that cost the same however large they are."""
    return bool(costs.sides[name].values) or costs.stand_in(name) is not None


def _beside(
    side: DomainSide, x: Fraction, value: Fraction, slack: Fraction
) -> Fraction:
    """Return the nearest value of a side, or one of few digits just beyond it."""
    if side.points or side.is_whole or value == side.missing:
        return value
    low, high = Fraction(side.low), Fraction(side.high)
    if slack:
        return (
            simple(low, min(high, low + slack))
            if x <= value
            else simple(max(low, high - slack), high)
        )
    return value if side.has(value) else simple(low, high)


def _is_mixed(side: DomainSide, x: Fraction, costs: Costs) -> bool:
    """Return whether a side has a category and others, or numbers and a stand-in."""
    if side.values:
        return x in side.points and len(side.points) > 1
    return side.missing == costs.stand_in(side.variable) is not None


def _split(part: Polytope, side: DomainSide, x: Fraction) -> list[Polytope]:
    """Return two halves of a part: beside a value, or without a value and at it.

    The value is a category, or else the stand-in of numbers.
    """
    halves: list[DomainSide | None]
    missing = side.missing
    if missing is not None and not side.values:
        only = replace(side, low=missing, high=missing, values=(missing,))
        halves = [replace(side, missing=None), only]
    elif x in side.points:
        rest = tuple(value for value in side.points if value != x)
        halves = [
            replace(side, low=some[0], high=some[-1], values=some, missing=None)
            for some in (rest, (float(x),))
        ]
    else:
        below = float(x.numerator // x.denominator)
        if side.values:
            below = max(v for v in side.points if v < x)
        halves = [cut_side(side, (None, below)), cut_side(side, (below, None))]
    return [
        part._replace(sides=tuple(half if s is side else s for s in part.sides))
        for half in halves
        if half is not None
    ]


def _least(
    sums: Sequence[Row],
    limits: Sequence[tuple[Fraction, Fraction]],
    at: Sequence[Fraction],
    rates: Sequence[Fraction],
    low: Fraction,
) -> Fraction | None:
    """Return the least cost at which sums are within limits; None if they never are."""
    used = sorted({place for row in sums for place in row.weights})
    number = {place: n for n, place in enumerate(used)}
    rows = [
        row._replace(weights={number[p]: w for p, w in row.weights.items()})
        for row in sums
    ]
    widths = [1 / rates[place] if rates[place] else None for place in used]
    centre, ends = [at[place] for place in used], [limits[place] for place in used]
    return least_radius(centre, widths, ends, rows, low)


def _plainer(
    values: Sequence[Fraction],
    at: Sequence[Fraction],
    sides: Sequence[DomainSide],
    limits: Sequence[tuple[Fraction, Fraction]],
    rows: Sequence[Row],
    slack: Sequence[Fraction],
) -> list[Fraction]:
    """Return a point of a polytope, each value as near to the centre as may be.

    `slack`: how much farther than needed a value may be, to have fewer digits.
    """
    result = list(values)
    for place in sorted(range(len(at)), key=lambda place: not sides[place].is_whole):
        (low, high), x = limits[place], at[place]
        near = [x]
        if x < low:
            near = [simple(low, min(high, low + slack[place]))]
        elif x > high:
            near = [simple(max(low, high - slack[place]), high)]
        if sides[place].is_whole:
            below = Fraction(math.floor(result[place]))
            near += [value for value in (below, below + 1) if low <= value <= high]
        for value in near:
            other = [*result[:place], value, *result[place + 1 :]]
            if all(holds(row, other) for row in rows if row.weights.get(place)):
                result = other
                break
    return result


class Leaves:
    """The regions of a tree's leaves in a domain, as polytopes.

    Attributes:
        numbers: The leaf of each part.
        labels: The class of each part.
        boxes: Each part as a box.
    """

    def __init__(self, tree: FuzzyTree, domain: Domain) -> None:
        self.tree, self.domain, self.inputs = tree, domain, tree.inputs
        pairs = [
            (region, box)
            for region in regions(tree)
            for box in boxes(region, tree, domain)
        ]
        self.numbers = [region.leaf for region, _ in pairs]
        self.labels = [region.label for region, _ in pairs]
        self.boxes = [box for _, box in pairs]
        of = [polytope_of(box, tree.inputs, tree.variables) for box in self.boxes]
        self.parts = Polytopes(tree.inputs, of)

    def decision(self, point: Mapping[str, Fraction]) -> tuple[str, int]:
        """Return the class of the leaf that a point reaches, and the leaf's number."""
        leaf = leaf_at(self.tree, point)
        return self.tree.leaves[leaf - 1].label, leaf

    def goals(self, label: str | None, wanted: str | None) -> list[int]:
        """Return the parts of a wanted class, or of any other than a label."""
        if wanted is not None:
            return [n for n, own in enumerate(self.labels) if own == wanted]
        return [n for n, own in enumerate(self.labels) if own != label]
