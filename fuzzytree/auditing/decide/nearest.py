"""The cheapest change of a row that gives another class, or a wanted one.

Of a tree the regions of its leaves say it (`polytopes`). Of rules, points that are
drawn and moved towards the row give an upper bound; for the lower one the decider is
asked whether there is such a point up to a cost, first one that is a little smaller.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from fractions import Fraction

import numpy as np

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
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.contest import STEPS, Contest, decision
from fuzzytree.auditing.decide.costs import LEAST, NARROW, Costs, Nearest
from fuzzytree.auditing.decide.linear import simple
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.model import BoolArray, FloatArray

_QUESTIONS = 16  # to the decider for a row
_MOST_ASKED = 0.25  # of the steps that are left, for a question to the decider
_TURNS = 12  # of moving a point towards the row
_WIDER = Fraction(8, 5)  # than `NARROW`, and still narrow
_HINTS = 3  # points that are evaluated in fractions, of many


def nearest(
    base: Base | Leaves,
    point: Mapping[str, Fraction],
    wanted: str | None = None,
    fixed: Collection[str] = (),
    costs: Mapping[str, Fraction] | None = None,
    budget: Budget | None = None,
) -> Nearest:
    """Return what the cheapest change costs that gives another class.

    A change costs as much as that of the input that costs most: by default a number
    its share of the domain's width, a category 1.

    Args:
        base: Rules of which the strongest decides, or the regions of a tree's leaves.
        point: From where; a row of the domain.
        wanted: The class that is wanted; any other than that of the row by default.
        fixed: Inputs that do not change.
        costs: What a change by 1 costs, or of a category any change, by input.
        budget: How many steps may be taken; what is known then is returned.

    Raises:
        ValueError: If an input is unknown, or a cost is not above 0.

    Example:
        >>> from fuzzytree.auditing.decide.domain import Domain, DomainSide
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> box = Domain(tuple(DomainSide(name, -9.0, 9.0) for name in tree.inputs))
        >>> leaves = Leaves(tree, box)
        >>> row = dict.fromkeys(tree.inputs, ZERO)
        >>> change = nearest(leaves, row)
        >>> change.is_narrow, leaves.decision(change.point) != leaves.decision(row)
        (True, True)
    """
    budget = budget or Budget()
    of = Costs(base.domain, tuple(base.inputs), fixed, costs)
    own = (
        base.decision(point)[0]
        if isinstance(base, Leaves)
        else decision(base, point)[0]
    )
    if own == wanted is not None:
        return Nearest(ZERO, ZERO, dict(point))
    if isinstance(base, Leaves):
        return base.parts.nearest(point, base.goals(own, wanted), of, budget)
    return _Search(Contest(base, own, wanted), point, of, budget).run()


class _Search:
    """A search around a row.

    Attributes:
        low: No point of the kind costs less.
        best: The nearest one so far.
        high: What it costs.
    """

    def __init__(
        self,
        contest: Contest,
        point: Mapping[str, Fraction],
        costs: Costs,
        budget: Budget,
    ) -> None:
        self.contest, self.base, self.point = contest, contest.base, point
        self.costs, self.budget = costs, Budget(STEPS, budget)
        self.low = ZERO
        self.high: Fraction | None = None
        self.best: dict[str, Fraction] = {}
        self.inputs = list(self.base.inputs)
        self.sides = [costs.sides[name] for name in self.inputs]
        stand_ins = map(costs.stand_in, self.inputs)
        self.start = np.array([float(point[name]) for name in self.inputs])
        self.rate = np.array([float(costs.rate[name]) for name in self.inputs])
        self.whole = np.array([float(costs.whole[name]) for name in self.inputs])
        self.missing = np.array(
            [math.nan if x is None else float(x) for x in stand_ins]
        )
        self.is_code = np.array([bool(side.values) for side in self.sides])
        self.is_free = np.array([name not in costs.fixed for name in self.inputs])

    def run(self) -> Nearest:
        """Return bounds of the least cost."""
        try:
            self._draw()
            why = self._bisect()
        except OutOfStepsError:
            why = "the budget was spent"
        if self.high is None:
            is_none = self.low >= self.costs.most
            return Nearest(ONE if is_none else self.low, why=why, is_none=is_none)
        for name in self.inputs:  # what need not change does not
            self._offer({**self.best, name: self.point[name]}, is_as_good=True)
        return Nearest(min(self.low, self.high), self.high, self.best, why)

    # --- points

    def _offer(self, point: dict[str, Fraction], *, is_as_good: bool = False) -> bool:
        """Keep a point if it is of the kind, and better than the best so far."""
        cost = self.costs.distance(self.point, point)
        is_better = self.high is None or cost < self.high
        if is_as_good and point != self.best:
            is_better = cost == self.high
        if not is_better or not self.contest.accepts(point):
            return False
        self.high, self.best = cost, point
        return True

    def _cost(self, points: FloatArray) -> FloatArray:
        """Return about what changes to points cost, shape (points,)."""
        start, missing = self.start[:, None], self.missing[:, None]
        jumps = self.is_code[:, None] | (points == missing) | (start == missing)
        cost = np.abs(points - start) * self.rate[:, None]
        cost = np.where(jumps, self.whole[:, None] * (points != start), cost)
        result: FloatArray = cost.max(axis=0, initial=0.0)
        return result

    def _best_of(self, points: FloatArray) -> None:
        """Keep the best of some points, shape (inputs, points)."""
        self.budget.spend(points.shape[1] * (len(points) + self.base.count) // 8)
        cost = self._cost(points)
        if self.high is not None:
            points = points[:, cost < float(self.high)]
            cost = cost[cost < float(self.high)]
        order = np.flatnonzero(self._is_sought(points))
        for k in order[np.argsort(cost[order], kind="stable")][:_HINTS]:
            values = zip(self.inputs, self.sides, points[:, k].tolist(), strict=True)
            point = {name: side.nearest(Fraction(x)) for name, side, x in values}
            kept = {name: self.point[name] for name in self.costs.fixed}
            if self._offer({**point, **kept}):
                return

    def _is_sought(self, points: FloatArray) -> BoolArray:
        """Return at which points rules that count win, as doubles say."""
        columns = dict(zip(self.inputs, points, strict=True))
        strengths = self.base.in_doubles(columns)
        if not self.base.is_exact:
            strengths = (strengths + self.base.in_doubles(columns, is_upper=True)) / 2
        mine = strengths[self.contest.reach].max(axis=0, initial=0.0)
        others = strengths[self.contest.rivals].max(axis=0, initial=0.0)
        is_bare = self.contest.is_bare & (mine == 0.0) & (others == 0.0)
        result: BoolArray = (mine > others) | is_bare
        return result

    def _snap(self, points: FloatArray) -> FloatArray:
        """Return points with values that rows can have, where they move by numbers."""
        result = points.copy()
        for k, side in enumerate(self.sides):
            if not self.is_free[k]:
                result[k] = self.start[k]
            elif not self.is_code[k]:
                row = np.clip(points[k], side.low, side.high)
                row = np.round(row) if side.is_whole else row
                result[k] = np.where(points[k] == self.missing[k], points[k], row)
        return result

    def _draw(self) -> None:
        """Move points that were drawn towards the row."""
        points = self._snap(np.array(self.base.samples, dtype=float))
        order = np.argsort(self._cost(points), kind="stable")
        self._best_of(points[:, order])
        self._move()

    def _move(self) -> None:
        """Move the best point towards the row as far as it stays of the kind."""
        is_wide = True
        for _ in range(_TURNS):
            if self.high is None or self.high <= LEAST:
                return
            before = self.high
            self._best_of(self._moves(float(before), is_wide=is_wide))
            if self.high > before * (1 - NARROW / 8):
                if not is_wide:
                    return
                is_wide = False

    def _moves(self, high: float, *, is_wide: bool) -> FloatArray:
        """Return points nearer to the row, the same way or with other inputs."""
        best = np.array([float(self.best[name]) for name in self.inputs])
        step = best - self.start
        numbers = ~(
            self.is_code | (best == self.missing) | (self.start == self.missing)
        )
        way = np.where(numbers, np.sign(step), 0.0)
        base = np.where(numbers, self.start, best)
        ways, starts = [way], [base]
        for k in np.flatnonzero(self.is_free) if is_wide else ():
            for sign in {-1.0, 0.0, 1.0} - {float(way[k])} if numbers[k] else ():
                ways.append(way.copy())
                ways[-1][k] = sign
                starts.append(base)
            if step[k] and not numbers[k]:
                ways.append(way)
                starts.append(base.copy())
                starts[-1][k] = self.start[k]
        shares = np.linspace(0.0, 1.0, 25 if is_wide else 65)[:-1]
        shares = np.concatenate([shares, 1.0 - 2.0 ** -np.arange(5.0, 14.0)])
        shares = np.concatenate([shares, 2.0 ** -np.arange(6.0, 30.0, 2.0)])
        with np.errstate(divide="ignore"):
            width = np.where(self.rate > 0.0, high / self.rate, 0.0)
        moved = [
            start[:, None] + (sign * width)[:, None] * shares
            for start, sign in zip(starts, ways, strict=True)
        ]
        moved.append(base[:, None] + (numbers * step)[:, None] * shares)
        back = np.repeat(best[:, None], len(best), axis=1)
        np.fill_diagonal(back, self.start)
        return self._snap(np.concatenate([*moved, back], axis=1))

    # --- the lower bound

    def _bisect(self) -> str:
        """Raise the lower bound by questions; return why it is not near the upper."""
        why, limit, is_tight = "", None, True
        for _ in range(_QUESTIONS):
            goal = self.costs.most
            if self.high is not None:
                goal = self.high * (1 - NARROW)
                if self.high - self.low <= max(2 * NARROW * self.high, 2 * LEAST):
                    return ""
            elif self.low >= goal:
                return ""
            if limit is not None and limit <= goal:
                if limit - self.low <= NARROW * limit / 8:
                    return why
                goal = (self.low + limit) / 2
                if self.high is not None:
                    gap = self.high - limit
                    is_close = gap < _WIDER * NARROW * self.high
                    goal = max(goal, self.high - gap * (_WIDER if is_close else 8))
            elif self.high is not None and not is_tight:
                goal = (self.low + self.high) / 2
            goal = simple(goal * (1 - NARROW / 8), goal) if self.high else goal
            answer = self._ask(goal)
            if isinstance(answer, Point):
                self._offer(dict(answer.values))
                self._move()
                is_tight = not is_tight
            elif isinstance(answer, Proved):
                self.low, is_tight = goal, False
            else:
                limit, why = goal, answer.why
        return why or "many questions to the decider were not enough"

    def _ask(self, goal: Fraction) -> Answer:
        """Return whether there is something up to a cost."""
        domain = self.costs.within(self.point, goal)
        try:
            return self.contest.ask(domain, self.budget.share(_MOST_ASKED))
        except OutOfStepsError:
            if self.budget.is_spent:
                raise
            return Open("the budget was spent")
