"""The search for the nearest point to a row where some rules win."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import (
    ONE,
    ZERO,
    Answer,
    Budget,
    Open,
    OutOfStepsError,
    Point,
    Proved,
)
from fuzzytree.auditing.decide.contest import Contest
from fuzzytree.auditing.decide.costs import LEAST, NARROW, Costs, Nearest
from fuzzytree.auditing.decide.decider import Decider
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.polytopes import Polytopes, polytope_of
from fuzzytree.model import BoolArray, FloatArray
from fuzzytree.numerics import U, outwards

STEPS = 300_000
"""The most steps for one row."""

_QUESTIONS = 16  # to the decider for a row
_MOST_ASKED = 0.25  # of the steps that are left, for a question to the decider
_ROUND = 128  # boxes that are looked at together
_TURNS = 12  # of moving a point towards the row
_HINTS = 3  # points that are moved
_BEYOND = float(NARROW) / 2  # of a cost, how far beyond it points are sought
_TINY = 1e-9  # of a piece between two knots: no box is halved further

Accepts = Callable[[Mapping[str, Fraction]], bool]


_TOUCH = "rules only touch there, or lines around curves are too far apart"


class Search:
    """One search around a row.

    Args:
        contest: What is sought.
        point: The row.
        costs: What changes cost.
        budget: How many steps may be taken.
        part: Where it is sought; all of the domain by default.
        most: Changes that cost more do not matter.
        accepts: Whether a point of the domain is of the kind, exactly.
    """

    def __init__(
        self,
        contest: Contest,
        point: Mapping[str, Fraction],
        costs: Costs,
        budget: Budget,
        *,
        part: Domain | None = None,
        most: Fraction | None = None,
        accepts: Accepts | None = None,
    ) -> None:
        self.contest, self.point, self.costs = contest, point, costs
        self.field = contest.field
        self.part = part or contest.base.domain
        self.budget = Budget(STEPS, budget)
        self.accepts = accepts or contest.accepts
        self.most, self.is_whole = most, most is None and part is None
        self.is_any = False
        self.high: Fraction | None = None
        self.best: dict[str, Fraction] | None = None
        field = self.field
        self.size = len(field.inputs)
        self.exact = [point[name] for name in field.inputs]
        self.v0 = np.array([float(x) for x in self.exact])
        self.sides = [costs.sides[name] for name in field.inputs]
        self.rate = np.array([float(costs.rate[name]) for name in field.inputs])
        self.whole = np.array([outwards(costs.whole[n])[0] for n in field.inputs])
        self.is_free = np.array([name not in costs.fixed for name in field.inputs])
        self.is_code = np.array([bool(side.values) for side in self.sides])
        self.stand_in = [costs.stand_in(name) for name in field.inputs]
        self.missing = np.array(
            [math.nan if x is None else float(x) for x in self.stand_in]
        )
        self.is_missing = self.v0 == self.missing
        self.here = [self._here(n) for n in range(len(field.axes))]

    def _here(self, n: int) -> float:
        """Return the value of an axis at the row."""
        return float(self.contest.base.value(self.field.axes[n], self.point))

    @cached_property
    def _reach(self) -> FloatArray:
        """How far a cost of 1 takes each input."""
        result = np.zeros(self.size)
        for n, axis in enumerate(self.field.axes[: self.size]):
            rate = self.rate[n]
            if not self._is_plain(n):
                width = float(axis.largest - axis.least) or 1.0
                jump = self.whole[n] / width
                rate = jump if self.is_code[n] else min(rate, jump)
            if self.is_free[n] and rate:
                result[n] = 1.0 / rate * (1.0 + 16 * U)
        return result

    @cached_property
    def _sums(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """What it costs when a sum lacks something, or two lack it together.

        Two sums that share inputs may pull them to either side: then what both lack is
        shared by inputs that help both, with any weights; those count at which an input
        is of no help.

        Returns:
            For each: the weights of what each axis lacks upwards, and downwards; some
            lacks in order, and what they cost.
        """
        count, weights = len(self.field.axes), self._weights
        result: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        plain = [n for n in range(count) if n >= self.size or self._is_plain(n)]
        for u, v in itertools.combinations_with_replacement(plain, 2):
            if v < self.size:
                continue
            both = (weights[u] != 0.0) & (weights[v] != 0.0)
            for one, other in itertools.product((1.0, -1.0), repeat=2):
                shares = {0.0} if u == v and one == other else set[float]()
                for k in np.flatnonzero(both) if u != v else ():
                    shares.add(-one * weights[u, k] / (other * weights[v, k]))
                for share in sorted(share for share in shares if share >= 0.0):
                    column = np.zeros(2 * count)
                    column[u + (one < 0.0) * count] = 1.0
                    column[v + (other < 0.0) * count] += share
                    mixed = one * weights[u] + share * other * weights[v]
                    result.append((column, *self._range(mixed)))
        return result

    def _range(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far a weighted sum of the inputs rises, at costs in order."""
        room = np.where(weights > 0.0, self._room[1], self._room[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            stops = np.where(self._reach > 0.0, room / self._reach, 0.0)
        costs = np.unique(np.concatenate([[0.0], stops]))
        far = np.minimum(costs[:, None] * self._reach, room * (1.0 + 16 * U))
        return far @ np.abs(weights) * (1.0 + 16 * U), costs

    @cached_property
    def _room(self) -> FloatArray:
        """How far each input may move down, and up."""
        axes = self.field.axes[: self.size]
        low = np.array([outwards(axis.least)[0] for axis in axes])
        high = np.array([outwards(axis.largest)[1] for axis in axes])
        room: FloatArray = np.maximum(np.stack([self.v0 - low, high - self.v0]), 0.0)
        return room

    def _is_plain(self, n: int) -> bool:
        return not self.is_code[n] and self.stand_in[n] is None

    @cached_property
    def _weights(self) -> FloatArray:
        """The weights of the inputs of each axis, shape (axes, inputs)."""
        result = np.zeros((len(self.field.axes), self.size))
        for n, axis in enumerate(self.field.axes):
            for name, weight in axis.weights.items():
                result[n, self.field.place[name]] = float(weight)
        return result

    def run(self, near: Sequence[Mapping[str, Fraction]] = ()) -> Nearest:
        """Return bounds of the least cost; some points are tried first."""
        why, low = "", math.inf
        try:
            for other in near:
                self._offer(dict(other))
            if self.is_whole:
                self._draw()
            radius = self.most if self.high is None else self.high
            start = self._start(math.inf if radius is None else outwards(radius)[1])
            if start is not None:
                few = self.contest.few(*start)
                low = self._boxes(few, start)
                low, why = self._bisect(few, low)
        except OutOfStepsError:
            low, why = (0.0 if low == math.inf else low), "the budget was spent"
        if self.high is None:
            if low == math.inf and self.is_whole:
                return Nearest(ONE, is_none=True)
            top = self.most if self.most is not None else ONE
            return Nearest(min(Fraction(low), top) if low < math.inf else top, why=why)
        for name in self.best or ():  # what need not change does not
            self._keep_value(name)
        low_end = self.high if low == math.inf else min(Fraction(low), self.high)
        result = Nearest(low_end, self.high, self.best, why)
        return result if result.is_narrow else replace(result, why=why or _TOUCH)

    def _keep_value(self, name: str) -> None:
        assert self.best is not None  # checked by the caller
        other = {**self.best, name: self.point[name]}
        if other != self.best and self.accepts(other):
            self.best, self.high = other, self.costs.distance(self.point, other)

    def any(self) -> Answer:
        """Return some point of the kind, or that there is none.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        start = self._start(math.inf)
        if start is None:
            return Proved("the part has no point")
        self.is_any = True
        few = self.contest.few(*start)
        low = self._boxes(few, start)
        if self.best is None and low < math.inf:
            answer = self._ask(few, math.inf)
            if not isinstance(answer, Point):
                return answer
            self._offer(dict(answer.values))
        if self.best is not None:
            return Point(self.best)
        return Proved("boxes") if low == math.inf else Open(_TOUCH)

    # --- points

    def _goal(self) -> float:
        """Return the cost up to which it is to be shown that there is nothing."""
        top = self.most if self.high is None else self.high
        return math.inf if top is None else float(top * (1 - NARROW))

    def _cost(self, points: FloatArray) -> FloatArray:
        """Return about what changes to points cost, shape (points,)."""
        v0, missing = self.v0[:, None], self.missing[:, None]
        cost = np.abs(points - v0) * self.rate[:, None]
        jumps = self.is_code[:, None] | (points == missing) | (v0 == missing)
        cost = np.where(jumps, self.whole[:, None] * (points != v0), cost)
        result: FloatArray = cost.max(axis=0, initial=0.0)
        return result

    def _offer(self, point: dict[str, Fraction]) -> bool:
        """Keep a point if it is of the kind, and the best so far."""
        cost = self.costs.distance(self.point, point)
        is_better = self.high is None or cost < self.high
        if self.most is not None and cost > self.most:
            is_better = False
        if not is_better or not self.accepts(point):
            return False
        self.high, self.best = cost, point
        return True

    def _best_of(self, points: FloatArray) -> bool:
        """Keep the best of some points; return whether it is better than before."""
        self.budget.spend(points.shape[1] * (self.size + self.contest.base.count) // 8)
        cost = self._cost(points)
        if self.high is not None:
            points = points[:, cost < float(self.high)]
            cost = cost[cost < float(self.high)]
        at = self.field.at(points)
        order = np.flatnonzero(self.contest.lead(at, at) > 0.0)
        order = order[np.argsort(cost[order], kind="stable")]
        return any(self._offer(self._exactly(points[:, k])) for k in order[:_HINTS])

    def _exactly(self, values: FloatArray) -> dict[str, Fraction]:
        pairs = zip(self.field.inputs, self.sides, values.tolist(), strict=True)
        point = {name: side.nearest(Fraction(x)) for name, side, x in pairs}
        return {
            name: self.point[name] if name in self.costs.fixed else x
            for name, x in point.items()
        }

    def _snap(self, points: FloatArray) -> FloatArray:
        """Return points with values that rows can have, where they move by numbers."""
        for k, side in enumerate(self.sides):
            is_number = ~(np.isin(points[k], self.missing[k]) | self.is_code[k])
            row = np.clip(points[k], side.low, side.high)
            row = np.round(row) if side.is_whole else row
            points[k] = np.where(is_number, row, points[k])
            if not self.is_free[k]:
                points[k] = self.v0[k]
        return points

    def _draw(self) -> None:
        """Move points that were drawn towards the row."""
        field, base = self.field, self.contest.base
        drawn = field.drawn
        strengths = base.sampled
        mine = strengths[self.contest.reach].max(axis=0, initial=0.0)
        others = strengths[self.contest.rivals].max(axis=0, initial=0.0)
        is_one = mine > others
        if self.contest.is_bare:
            is_one |= (mine == 0.0) & (others == 0.0)
        points = drawn[:, is_one] if self.is_free.all() else drawn
        points = self._snap(points.copy())
        if not points.size:
            return
        order = np.argsort(self._cost(points), kind="stable")[:512]
        self._best_of(points[:, order])
        self._move()

    def _move(self) -> None:
        """Move the best point towards the row as far as it stays of the kind."""
        is_wide = True
        for _ in range(_TURNS):
            if self.best is None or self.high is None or self.high <= LEAST:
                return
            best = np.array([float(self.best[name]) for name in self.field.inputs])
            before = self.high
            self._best_of(self._moves(best, is_wide=is_wide))
            if self.high > before * (1 - NARROW / 8):
                if not is_wide:
                    return
                is_wide = False

    def _moves(self, best: FloatArray, *, is_wide: bool) -> FloatArray:
        """Return points nearer to the row, the same way or with other inputs."""
        step = best - self.v0
        numbers = ~self.is_code & (best != self.missing) & ~self.is_missing
        way = np.where(numbers, np.sign(step), 0.0)
        ways, starts = [way], [np.where(numbers, self.v0, best)]
        for k in np.flatnonzero(self.is_free) if is_wide else ():
            if numbers[k]:
                for sign in {-1.0, 0.0, 1.0} - {float(way[k])}:
                    other = way.copy()
                    other[k] = sign
                    ways.append(other)
                    starts.append(starts[0])
            elif step[k]:
                back = starts[0].copy()
                back[k] = self.v0[k]
                ways.append(way)
                starts.append(back)
        assert self.high is not None  # checked by the caller
        shares = np.linspace(0.0, 1.0, 25 if is_wide else 65)[:-1]
        shares = np.concatenate([shares, 1.0 - 2.0 ** -np.arange(5.0, 14.0)])
        shares = np.concatenate([shares, 2.0 ** -np.arange(6.0, 30.0, 2.0)])
        radius = float(self.high) * shares
        with np.errstate(divide="ignore"):
            width = np.where(self.rate > 0.0, 1.0 / self.rate, 0.0)
        moved = [
            start[:, None] + (sign * width)[:, None] * radius
            for start, sign in zip(starts, ways, strict=True)
        ]
        moved.append(
            np.where(numbers, self.v0, best)[:, None]
            + (numbers * step)[:, None] * shares
        )
        for k in np.flatnonzero(step):
            back = best.copy()
            back[k] = self.v0[k]
            moved.append(back[:, None])
        return self._snap(np.concatenate(moved, axis=1))

    # --- boxes

    def _start(self, radius: float) -> tuple[FloatArray, FloatArray] | None:
        """Return the box of all changes up to a cost; None if it is empty."""
        field = self.field
        ends = np.zeros((2, len(field.axes)))
        for n, axis in enumerate(field.axes):
            side = self.part.side(axis.name)
            places: list[float] = []
            stretch = field.stretches[n]
            if n < self.size:
                assert side is not None  # of an input
                first = 0 if axis.values else stretch.last_number + 1
                for k, x in enumerate(stretch.x[first:], first):
                    cost = outwards(self.costs.of(axis.name, self.exact[n], x))[0]
                    stays = self.is_free[n] or x == self.exact[n]
                    if cost <= radius and stays and side.has(x):
                        places.append(float(k))
            if not axis.values:
                places += self._numbers(n, side, radius)
            if not places:
                return None
            ends[:, n] = min(places), max(places)
        return ends[:1], ends[1:]

    def _numbers(self, n: int, side: DomainSide | None, radius: float) -> list[float]:
        """Return the ends of the numbers of an axis up to a cost."""
        axis = self.field.axes[n]
        low, high = outwards(axis.low)[0], outwards(axis.high)[1]
        if side is not None:
            if side.values:  # a stand-in alone
                return []
            low, high = max(low, side.low), min(high, side.high)
        if n < self.size:
            x = self.v0[n]
            if self.is_missing[n]:
                if radius < self.whole[n] or not self.is_free[n]:
                    return []
            elif not self.is_free[n]:
                low, high = max(low, x), min(high, x)
            elif self.rate[n] and radius < math.inf:
                reach = radius / self.rate[n] * (1.0 + 4 * U)
                slack = 4 * U * (abs(x) + reach)
                low, high = max(low, x - reach - slack), min(high, x + reach + slack)
        elif radius < math.inf:
            x = self.here[n]
            for sign in (1.0, -1.0):
                rise, costs = self._range(sign * self._weights[n])
                reach = float(np.interp(radius, costs, rise)) * (1.0 + 16 * U)
                reach += 16 * U * (abs(x) + reach)
                low, high = (
                    (low, min(high, x + reach))
                    if sign > 0.0
                    else (max(low, x - reach), high)
                )
        if low > high:
            return []
        both = np.array([low, high])
        down, up = (self.field.places(n, both, is_up=way) for way in (False, True))
        return [float(down[0]), float(up[1])]

    def _distance(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Return costs below which boxes are not reached."""
        result, count = np.zeros(len(low)), len(self.field.axes)
        lacks = np.zeros((len(low), 2 * count))
        for n, axis in enumerate(self.field.axes):
            stretch, first, last = self.field.stretches[n], low[:, n], high[:, n]
            gap = np.full(len(low), np.inf)
            if not axis.values:
                top, x = stretch.last_number, self.here[n]
                a, b = (self.field.values(n, np.minimum(e, top)) for e in (first, last))
                slack = 16 * U * (np.abs(a) + np.abs(b) + abs(x))
                lacks[:, n], lacks[:, n + count] = a - x - slack, x - b - slack
                if n >= self.size:
                    continue
                gap = np.maximum(lacks[:, n], lacks[:, n + count])
                gap = np.maximum(gap, 0.0) * (1.0 - 16 * U) * self.rate[n]
                if self.is_missing[n]:
                    gap = np.full(len(low), self.whole[n])
                gap = np.where(first > top, np.inf, gap)
            start = 0 if axis.values else stretch.last_number + 1
            for k, value in enumerate(stretch.x[start:], start):
                cost = outwards(self.costs.of(axis.name, self.exact[n], value))[0]
                inside = (first <= k) & (k <= last)
                gap = np.where(inside, np.minimum(gap, cost), gap)
            result = np.maximum(result, gap)
        if count > self.size:
            size = np.abs(lacks)
            for weights, rise, costs in self._sums:
                lack = lacks @ weights - 1e-13 * (size @ weights)
                least = np.interp(lack, rise, costs, right=np.inf)
                result = np.maximum(result, least * (1.0 - 16 * U))
        return result

    def _boxes(self, few: Contest, start: tuple[FloatArray, FloatArray]) -> float:
        """Return a cost below which there is nothing; better points are kept."""
        boxes = np.stack(start, axis=1)  # shape (boxes, 2, axes)
        queue, order = boxes, self._distance(boxes[:, 0], boxes[:, 1])
        base = self.contest.base
        is_decided = base.is_lattice and base.is_exact and not base.is_coupled
        budget = self.budget.share(0.1 if is_decided else 0.7)
        rules = len(few.reach) + len(few.rivals)
        far, rounds = math.inf, 0
        while len(queue):
            goal = self._goal()
            if self.high is not None and (self.is_any or self.high <= 2 * LEAST):
                return 0.0
            some = np.argsort(order, kind="stable")
            if order[some[0]] >= min(goal, far * (1.0 + _BEYOND)):
                break
            chosen, rest = some[:_ROUND], some[_ROUND:]
            boxes, near = queue[chosen], order[chosen]
            queue, order = queue[rest], order[rest]
            try:
                budget.spend(len(boxes) * (10 + 4 * rules) + 100)
            except OutOfStepsError:
                return min(far, float(near.min()))
            is_open = ~few.is_clear(boxes[:, 0], boxes[:, 1]) & self._has_whole(boxes)
            boxes, near = boxes[is_open], near[is_open]
            if not len(boxes):
                continue
            self._best_of(self._candidates(boxes))
            rounds += 1
            if base.is_coupled and not rounds % 3:
                self._program(boxes[0])
            goal = self._goal()
            is_far = near >= goal
            far = min(far, float(near[is_far].min(initial=math.inf)))
            boxes, near = boxes[~is_far], near[~is_far]
            is_small = (
                self._sizes(boxes)
                < np.maximum(near * _BEYOND / 8, float(LEAST))[:, None]
            )
            halves, small = self._halved(few, boxes, is_small)
            far = min(far, float(near[small].min(initial=math.inf)))
            if len(halves):
                queue = np.concatenate([queue, halves])
                more = self._distance(halves[:, 0], halves[:, 1])
                order = np.concatenate([order, more])
        return min(far, float(order.min(initial=math.inf)))

    def _has_whole(self, boxes: FloatArray) -> BoolArray:
        """Return which boxes have a whole number of each input that needs it."""
        result = np.ones(len(boxes), dtype=bool)
        for n, side in enumerate(self.sides):
            top = self.field.stretches[n].last_number
            if side.is_whole and not self.field.axes[n].values:
                first, last = (self.field.values(n, boxes[:, k, n]) for k in (0, 1))
                has = np.floor(last + 1e-6) >= np.ceil(first - 1e-6)
                result &= has | (boxes[:, 1, n] > top)
        return result

    def _candidates(self, boxes: FloatArray) -> FloatArray:
        """Return points of boxes, two of each: in the middle, and near the row."""
        count = len(boxes)
        points = np.repeat(self.v0[:, None], 2 * count, axis=1)
        for n, axis in enumerate(self.field.axes):
            low, high = boxes[:, 0, n], boxes[:, 1, n]
            top = self.field.stretches[n].last_number
            a, b = (self.field.values(n, np.minimum(end, top)) for end in (low, high))
            near = np.clip(self.here[n], a + (b - a) / 16, b - (b - a) / 16)
            goal = np.concatenate([near, (a + b) / 2])
            if n < self.size:
                if axis.values:
                    middle = np.floor((low + high) / 2).astype(int)
                    goal = self.field.x[n][np.concatenate([high.astype(int), middle])]
                    here = np.flatnonzero(self.field.x[n] == self.v0[n])
                    stays = (low <= here[0]) & (here[0] <= high)
                    goal[:count] = np.where(stays, self.v0[n], goal[:count])
                only = np.concatenate([low, low]) > top
                points[n] = (
                    np.where(only, self.missing[n], goal) if not axis.values else goal
                )
                continue
            weights = self._weights[n]
            reach = np.abs(weights) @ self._reach
            if not reach:
                continue
            value = float(axis.constant) + weights @ points
            step = np.sign(weights) * self._reach
            points = points + step[:, None] * ((goal - value) / reach)
        return self._snap(points)

    def _program(self, box: FloatArray) -> None:
        """Keep the nearest point of a box whose axes share inputs."""
        sides, variables = [], self.contest.base.variables
        for n, axis in enumerate(self.field.axes):
            _low, high = box[:, n]
            a, b = self.field.values(n, box[:, n]).tolist()
            far_side, here = (b - a) * 0.75, self.here[n]
            a, b = a + far_side * (here < a), b - far_side * (here > b)
            if axis.values or high > self.field.stretches[n].last_number or a > b:
                side = self.part.side(axis.name)
                if side is not None:
                    sides.append(side)
                continue
            is_whole = n < self.size and self.sides[n].is_whole
            if is_whole:
                a, b = math.ceil(a), math.floor(b)
            sides.append(DomainSide(axis.name, a, max(a, b), is_whole=is_whole))
        part = polytope_of(Domain(tuple(sides)), self.field.inputs, variables.values())
        parts = Polytopes(self.field.inputs, [part])
        point = parts.nearest(self.point, [0], self.costs, self.budget).point
        if point is not None and self._offer(dict(point)):
            self._move()

    def _sizes(self, boxes: FloatArray) -> FloatArray:
        """Return about what it costs to pass through boxes along each axis."""
        result = np.zeros((len(boxes), len(self.field.axes)))
        for n, axis in enumerate(self.field.axes):
            reach = np.abs(self._weights[n]) @ self._reach
            if axis.values or not reach:
                result[:, n] = boxes[:, 1, n] - boxes[:, 0, n]
            if axis.values or not reach or not axis.literals:
                continue
            low, high = (self.field.values(n, boxes[:, k, n]) for k in (0, 1))
            result[:, n] = np.abs(high - low) / reach
        return result

    def _halved(
        self, few: Contest, boxes: FloatArray, is_small: BoolArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return halves of boxes where degrees vary most, and which are too small."""
        low, high = boxes[:, 0], boxes[:, 1]
        vary = np.zeros(low.shape)
        rules = self.contest.base.rules
        keys = {key for i in (*few.reach, *few.rivals) for key in rules[i].literals}
        for name, literal in keys:
            n = self.field.place[name]
            least, most = self.field.stretches[n].range(literal, low[:, n], high[:, n])
            vary[:, n] = np.maximum(vary[:, n], most - least)
        ends = np.stack([self.field.jumps(low), self.field.jumps(high)])
        ends &= low < high
        vary[(is_small | (high - low < _TINY)) & ~ends.any(axis=0)] = 0.0
        at, rows = vary.argmax(axis=1), np.arange(len(boxes))
        small = vary[rows, at] <= 1e-12
        a, b = low[rows, at], high[rows, at]
        values = np.array([bool(axis.values) for axis in self.field.axes])[at]
        tops = np.array([float(s.last_number) for s in self.field.stretches])[at]
        middle = np.where(b - a > 1.5, np.round((a + b) / 2), (a + b) / 2)
        stop = np.where(values, np.floor((a + b) / 2), middle)
        start = stop + values
        # The stand-in is apart from all numbers, a knot at a jump from those beside it.
        cases = [
            (~values & (a <= tops) & (tops < b), tops, tops + 1),
            (ends[0, rows, at], a, np.nextafter(a, np.inf)),
            (ends[1, rows, at], np.nextafter(b, -np.inf), b),
        ]
        for is_case, left_end, right_end in reversed(cases):
            stop = np.where(is_case, left_end, stop)
            start = np.where(is_case, right_end, start)
        left, right = boxes.copy(), boxes.copy()
        left[rows, 1, at], right[rows, 0, at] = stop, start
        return np.concatenate([left[~small], right[~small]]), small

    # --- what boxes leave

    def _bisect(self, few: Contest, low: float) -> tuple[float, str]:
        """Return a cost below which there is nothing, by the decider, or why not."""
        is_tight, top = True, math.inf if self.is_whole else float(self.most or ONE)
        for _ in range(_QUESTIONS):
            if self.high is not None and self.high <= 2 * LEAST:
                return low, ""
            goal = min(self._goal(), top)
            if low >= goal:
                return low, ""
            if self.high is not None and not is_tight:
                goal = (low + float(self.high)) / 2
            answer = self._ask(few, goal)
            if isinstance(answer, Point):
                self._offer(dict(answer.values))
                self._move()
                is_tight = not is_tight
            elif isinstance(answer, Proved):
                low, is_tight = goal, False
            else:
                return low, answer.why
        return low, ""

    def _ask(self, few: Contest, goal: float) -> Answer:
        """Return whether there is something up to a cost."""
        sides = []
        for side in self.part.sides:
            near: DomainSide | None = side
            if side.variable in self.point and goal < math.inf:
                near = self._near(side, Fraction(goal))
            if near is None:
                return Proved("no row of the part is that near")
            sides.append(near)
        decider = Decider(self.contest.base.on(Domain(tuple(sides))))
        left: Answer = Proved("the decider")
        for question in few.questions():
            answer = decider.ask(question, self.budget.share(_MOST_ASKED))
            if isinstance(answer, Point):
                return answer
            left = left if isinstance(answer, Proved) else answer
        return left

    def _near(self, side: DomainSide, goal: Fraction) -> DomainSide | None:
        """Return the part of a side up to a cost; None if it is empty."""
        name = side.variable
        at = self.point[name]

        def is_near(x: float) -> bool:
            cost = self.costs.of(name, at, Fraction(x))
            return cost <= goal and (name not in self.costs.fixed or cost == 0)

        values = tuple(x for x in side.values if is_near(x))
        missing = side.missing
        if missing is not None and not is_near(missing):
            missing = None
        low, high, rate = side.low, side.high, self.costs.rate[name]
        if not side.values and at != self.costs.stand_in(name) and rate:
            reach = ZERO if name in self.costs.fixed else goal / rate
            low = max(low, outwards(at - reach)[0])
            high = min(high, outwards(at + reach)[1])
        elif side.values:
            if not values:
                return None
            low, high = values[0], values[-1]
        if side.is_whole:
            low, high = float(math.ceil(low)), float(math.floor(high))
        if low > high:
            return None
        is_open = side.is_open and low == side.low
        return replace(
            side, low=low, high=high, values=values, missing=missing, is_open=is_open
        )
