"""Branch and bound: what rules reach on a domain, under any conjunction.

The most promising boxes are halved first, thousands at a time. What a box cannot reach
is bounded by doubles rounded outwards; what a point reaches is evaluated in fractions.
So both ends of a result are certain, and where no box is left, all were excluded.

That a rule is never stronger than *one* other on a box shows almost at once, for their
ratio is a product of ratios of one input each, and common factors cancel. Only where
different rivals are ahead at different places must boxes become small.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.arrangement import (
    Arrangement,
    arrange,
    lead_at,
    strengths_at,
)
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, Point
from fuzzytree.auditing.engine.pieces import ZERO
from fuzzytree.auditing.engine.space import BoxReach, RivalPair, Space
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
    counted,
)
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.model import FloatArray, IntArray, RuleBase
from fuzzytree.numerics import U, outwards

TOO_MANY: Final = "too many boxes are left"

_BATCH = 4096  # boxes that are parted at a time
_MOST_SEEN = 1 << 22  # degrees of rules on lines, in the boxes of one batch
_MOST_BOXES = 3_000_000  # that may wait, for the sake of memory
_MOST_PARTS = 24_000_000  # of inputs, in all boxes that wait
_TRIES = 4  # middles of boxes that are evaluated exactly, for each batch


class BoxVerdict(NamedTuple):
    """What boxes can reach."""

    bound: FloatArray  # at most this; minus infinity where a box is put away
    value: FloatArray  # about this in the middle
    worth: FloatArray  # shape (boxes, lines): how much parting each line promises


class SearchResult(NamedTuple):
    """The result of a search for the largest value of something."""

    point: Point | None  # where the largest known value is, if it is above the floor
    value: Fraction  # that value, exactly; the floor if none is known
    bound: float  # no value is larger
    boxes: int  # how many boxes were looked at
    why: str  # what stopped the search; empty if no box is left


class SearchGoal(NamedTuple):
    """What ends a search, besides that no box is left."""

    floor: Fraction  # boxes that cannot be above this are put away
    tolerance: float  # how near to each other the two bounds must come
    patience: int = 0  # how many boxes are looked at before that is enough
    limit: float = math.inf  # how many boxes are looked at before it gives up
    is_first_enough: bool = False  # whether any value above the floor ends it


def search(
    space: Space,
    judge: Callable[[BoxReach, IntArray], BoxVerdict],
    value: Callable[[Point], Fraction | None],
    goal: SearchGoal,
    clock: Clock,
) -> SearchResult:
    """Return the largest value of something on a domain, within bounds.

    `judge`: bounds it on boxes; `value`: returns it at a point, None if it has none.
    """
    floor, tolerance, patience, limit, is_first_enough = goal
    best, point = floor, None
    most = min(_MOST_BOXES, _MOST_PARTS // len(space.lines))
    if space.root_count > most:
        return SearchResult(None, floor, math.inf, 0, TOO_MANY)
    size = len(space.lines) * len(space.lines[0].use.rules)
    batch = min(_BATCH, max(_MOST_SEEN // size, 64))
    boxes = space.roots()
    new, verdict = len(boxes), judge(space.look(boxes), boxes)
    looked, stuck = len(boxes), -math.inf
    while True:
        # Middles first: a better best value puts away more boxes.
        for row in np.argsort(-verdict.value[:new], kind="stable")[:_TRIES].tolist():
            if not verdict.value[row] >= float(best):
                break
            whole = filled(space.base, space.point(boxes[row]))
            result = value(whole) if is_within(space.base, whole) else None
            if result is not None and result > best:
                best, point = result, whole
        threshold = outwards(best)[0]
        kept = verdict.bound > threshold
        boxes, verdict = boxes[kept], BoxVerdict(*(one[kept] for one in verdict))
        bound = max(float(np.max(verdict.bound, initial=-math.inf)), stuck)
        why = None
        if point is not None and is_first_enough:
            why = "one was enough"
        elif bound <= threshold:
            why = ""
        elif bound - threshold <= tolerance and looked > patience:
            why = f"what is left is at most {tolerance!r}"
        elif not len(boxes):
            why = "no double lies within the boxes that are left"
        elif clock.is_over:
            why = "the budget was spent"
        elif looked > limit or len(boxes) > most:
            why = TOO_MANY
        if why is not None:
            return SearchResult(point, best, max(bound, outwards(best)[1]), looked, why)
        chosen = _highest(verdict.bound, batch)
        taken, rest = boxes[chosen], np.ones(len(boxes), dtype=bool)
        rest[chosen] = False
        worth = np.where(space.can_part(taken), verdict.worth[chosen], -1.0)
        is_stuck = worth.max(axis=1) < 0.0
        stuck = max(
            stuck, float(np.max(verdict.bound[chosen][is_stuck], initial=-math.inf))
        )
        children = space.halves(taken[~is_stuck], worth[~is_stuck].argmax(axis=1))
        below = judge(space.look(children), children)
        new = len(children)
        looked += new
        boxes = np.concatenate([children, boxes[rest]])
        verdict = BoxVerdict(
            *(np.concatenate([a, b[rest]]) for a, b in zip(below, verdict, strict=True))
        )


def _highest(bound: FloatArray, count: int) -> IntArray:
    if len(bound) <= count:
        return np.arange(len(bound))
    return np.argpartition(-bound, count)[:count]


def filled(base: Arrangement, point: Mapping[str, Fraction]) -> Point:
    """Return a point with the middle of the domain for inputs that do not matter."""
    whole: Point = {}
    for name in base.rules.inputs:
        side = base.domain.side(name)
        assert side is not None  # checked when the ground was made
        middle = side.nearest(Fraction(side.low * 0.5 + side.high * 0.5))
        whole[name] = point.get(name, middle)
    return whole


def simplified(
    base: Arrangement, point: Mapping[str, Fraction], holds: Callable[[Point], bool]
) -> Point:
    """Return a point of few digits near another one at which something holds."""
    sides = [base.domain.side(name) for name in point]
    for digits in range(1, 17):
        near: Point = {}
        for (name, value), side in zip(point.items(), sides, strict=True):
            assert side is not None  # checked when the ground was made
            span = max(side.high - side.low, abs(float(value)) * 2.0**-52)
            places = digits - math.floor(math.log10(span)) - 1 if span > 0.0 else 0
            rough = round(float(value), min(places, 320))
            near[name] = side.nearest(Fraction(rough))
        if is_within(base, near) and holds(near):
            return near
    return dict(point)


def plainer(
    base: Arrangement, point: Point, ours: Collection[int], rivals: Collection[int]
) -> Point:
    """Return a point of fewer digits at which rules still lead by nearly as much."""
    goal = lead_at(base, point, ours, rivals) * 15 / 16
    return simplified(
        base, point, lambda near: lead_at(base, near, ours, rivals) > max(goal, ZERO)
    )


# --- the questions

_EASY = 2_000  # boxes that are looked at without knowing the order of curves
_PATIENCE = 100_000  # boxes, before a lead that may be none is left open

TINY: Final = 2.0**-50
"""A lead that roundings of doubles can feign."""


# --- the lead of a rule


def wins_by_boxes(
    rules: RuleBase,
    domain: Domain,
    rule: int,
    rivals: Collection[int],
    clock: Clock | None = None,
    *,
    tolerance: float = TINY,
) -> State:
    """Return what `duels.wins` does, by boxes; `tolerance` is a lead left open."""
    lead = _Lead(rules, domain, rule, rivals)
    result = lead.search(clock or Clock(), tolerance, is_first_enough=True)
    if result.point is not None:
        return lead.witness(result.point)
    if not result.why:
        return Proved(_why(result))
    return lead.bracket(result)


def largest_lead_by_boxes(
    rules: RuleBase,
    domain: Domain,
    rule: int,
    rivals: Collection[int],
    clock: Clock | None = None,
    *,
    tolerance: float = 1e-6,
) -> Bracket:
    """Return by how much, at most, a rule is stronger than each of some others.

    `tolerance`: how near the bracket's ends should come to each other.

    Returns:
        A bracket; both ends are 0 for a rule that never is.
    """
    lead = _Lead(rules, domain, rule, rivals)
    return lead.bracket(lead.search(clock or Clock(), tolerance))


class _Lead:
    """By how much a rule is ahead of the strongest of its rivals."""

    def __init__(
        self, rules: RuleBase, domain: Domain, rule: int, rivals: Collection[int]
    ) -> None:
        self.rule, self.rivals = rule, tuple(sorted(rivals))
        self.base = arrange(rules, domain)
        self.chosen = (rule - 1, *(number - 1 for number in self.rivals))
        self.pairs = [RivalPair(rule - 1, other) for other in self.chosen[1:]]
        self.space = Space(self.base, self.chosen, self.pairs)

    def search(
        self, clock: Clock, tolerance: float, *, is_first_enough: bool = False
    ) -> SearchResult:
        def run(limit: float) -> SearchResult:
            patience = _PATIENCE if is_first_enough else 0
            goal = SearchGoal(ZERO, tolerance, patience, limit, is_first_enough)
            return search(self.space, self._judge, self.lead, goal, clock)

        first = run(_EASY)
        if first.why != TOO_MANY:
            return first
        self.space = Space(self.base, self.chosen, self.pairs, is_ordered=True)
        result = run(math.inf)
        return result._replace(boxes=first.boxes + result.boxes)

    def _judge(self, reach: BoxReach, boxes: IntArray) -> BoxVerdict:
        del boxes
        table = reach.table
        high = table.high[:, 0]
        if not self.rivals:
            bound, worth = high, np.stack([w[:, 0] for w in reach.widths], axis=1)
        else:
            bound = np.min(high[:, np.newaxis] - table.low[:, 1:], axis=1)
            bound *= 1.0 + 4 * U
            if self.space.is_product:
                most = table.most.min(axis=1)
                is_over = most <= 1.0
                with np.errstate(divide="ignore", invalid="ignore"):
                    share = (1.0 - 1.0 / most * (1.0 - 4 * U)) * (1.0 + 4 * U)
                    bound = np.minimum(bound, high * share * (1.0 + 4 * U))
            else:
                most = table.most.max(axis=1)
                is_over = most >= high
                bound = np.minimum(bound, (high - most) * (1.0 + 4 * U))
            bound = np.where(is_over, -np.inf, bound)
            is_open = table.least <= 1.0
            parts = zip(reach.spreads, reach.widths, strict=True)
            worth = np.stack(
                [(s * is_open).sum(axis=1) + w[:, 0] for s, w in parts], axis=1
            )
        value = table.at[:, 0] - table.at[:, 1:].max(axis=1, initial=0.0)
        is_over = (high == 0.0) | reach.is_empty
        return BoxVerdict(np.where(is_over, -np.inf, bound), value, worth)

    def lead(self, point: Mapping[str, Fraction]) -> Fraction:
        return lead_at(self.base, point, (self.rule,), self.rivals)

    def claims(self) -> tuple[Claim, ...]:
        return (Claim("beats", rules=(self.rule,), rivals=self.rivals),)

    def witness(self, point: Point) -> Witness:
        plain = plainer(self.base, point, (self.rule,), self.rivals)
        return Witness(coordinates(plain), self.claims())

    def bracket(self, result: SearchResult) -> Bracket:
        has_point = result.point is not None
        return Bracket(
            f"the largest lead of rule {self.rule}",
            max(outwards(result.value)[0], 0.0),
            min(max(result.bound, 0.0), 1.0),
            _why(result),
            coordinates(result.point or {}),
            self.claims() if has_point else (),
        )


def _why(result: SearchResult) -> str:
    text = f"{counted(result.boxes, 'box', 'boxes')} visited"
    return f"{result.why}: {text}" if result.why else f"{text}, none is left"


# --- the strongest rule where it is weakest


def least_cover_by_boxes(
    rules: RuleBase,
    domain: Domain,
    clock: Clock | None = None,
    *,
    tolerance: float = 1e-6,
) -> Bracket:
    """Return how strong the strongest rule is where that is least.

    `tolerance`: how near the bracket's ends should come to each other.

    Returns:
        A bracket; its point is where the strongest rule is as weak as `high`.
    """
    cover = _Cover(rules, domain)
    return cover.bracket(
        cover.search(clock or Clock(), SearchGoal(Fraction(-1), tolerance))
    )


def below_by_boxes(
    rules: RuleBase,
    domain: Domain,
    epsilon: float | Fraction,
    clock: Clock | None = None,
) -> State:
    """Return what `cover.below` does, by boxes; level 0 stands for "no rule fires"."""
    level = Fraction(epsilon)
    cover = _Cover(rules, domain, is_zero_wanted=not level)
    floor = -level if level else Fraction(-1, 2**1100)
    goal = SearchGoal(floor, 0.0, is_first_enough=True)
    result = cover.search(clock or Clock(), goal)
    if result.point is not None:
        return cover.witness(result.point, level)
    if not result.why:
        return Proved(_why(result))
    return cover.bracket(result)


class _Cover:
    """Minus the strength of the strongest rule."""

    def __init__(
        self, rules: RuleBase, domain: Domain, *, is_zero_wanted: bool = False
    ) -> None:
        self.base = arrange(rules, domain)
        self.numbers = tuple(range(1, len(rules.rules) + 1))
        self.space = Space(self.base, range(len(rules.rules)))
        self.is_zero_wanted = is_zero_wanted

    def search(self, clock: Clock, goal: SearchGoal) -> SearchResult:
        return search(self.space, self._judge, self._value, goal, clock)

    def _judge(self, reach: BoxReach, boxes: IntArray) -> BoxVerdict:
        rows = np.arange(len(boxes))
        strongest = reach.table.at.argmax(axis=1)
        bound = np.where(reach.is_empty, -np.inf, -reach.table.low.max(axis=1))
        worth = np.stack([width[rows, strongest] for width in reach.widths], axis=1)
        return BoxVerdict(bound, -reach.table.at[rows, strongest], worth)

    def strongest(self, point: Mapping[str, Fraction]) -> Fraction:
        return max(strengths_at(self.base, point))

    def _value(self, point: Point) -> Fraction | None:
        result = self.strongest(point)
        return None if self.is_zero_wanted and result else -result

    def witness(self, point: Point, level: Fraction) -> Witness:
        def holds(near: Point) -> bool:
            result = self.strongest(near)
            return result < level if level else not result

        claims = (Claim("below", rules=self.numbers, level=str(level)),)
        return Witness(coordinates(simplified(self.base, point, holds)), claims)

    def bracket(self, result: SearchResult) -> Bracket:
        point = result.point or filled(self.base, {})
        is_known = result.point is not None or is_within(self.base, point)
        high = self.strongest(point) if is_known else Fraction(1)
        return Bracket(
            "the strength of the strongest rule where it is weakest",
            min(max(-result.bound, 0.0), 1.0),
            outwards(high)[1],
            _why(result),
            coordinates(point) if is_known else (),
        )


# --- two rules at once


def highest_by_boxes(
    rules: RuleBase,
    domain: Domain,
    one: int,
    other: int,
    clock: Clock | None = None,
    *,
    tolerance: float = 1e-6,
) -> Bracket:
    """Return the highest level that two rules reach at the same input.

    `tolerance`: how near the bracket's ends should come to each other.

    Returns:
        A bracket; its point is where both reach `low`.
    """
    base = arrange(rules, domain)
    space = Space(base, (one - 1, other - 1))

    def judge(reach: BoxReach, boxes: IntArray) -> BoxVerdict:
        del boxes
        bound = np.where(reach.is_empty, -np.inf, reach.table.high.min(axis=1))
        worth = np.stack([width.sum(axis=1) for width in reach.widths], axis=1)
        return BoxVerdict(bound, reach.table.at.min(axis=1), worth)

    def value(point: Point) -> Fraction:
        strengths = strengths_at(base, point)
        return min(strengths[one - 1], strengths[other - 1])

    goal = SearchGoal(ZERO, tolerance)
    result = search(space, judge, value, goal, clock or Clock())
    reached = Claim("reaches", rules=(one, other), level=str(result.value))
    return Bracket(
        f"the highest level that rules {one} and {other} both reach",
        outwards(result.value)[0],
        min(result.bound, 1.0),
        _why(result),
        coordinates(result.point or {}),
        (reached,) if result.point is not None else (),
    )
