"""The largest value of something on a domain, by parting it into boxes.

The most promising boxes are parted first, thousands at a time. What a box cannot reach
is bounded by doubles rounded outwards; what a point reaches is evaluated in fractions.
So both ends of a result are certain, and where no box is left, all were put away.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.ground import Ground
from fuzzytree.auditing.engine.space import Seen, Space
from fuzzytree.auditing.engine.variables import Point
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.numerics.exact import outwards

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

TOO_MANY: Final = "too many boxes are left"

_BATCH = 4096  # boxes that are parted at a time
_MOST_SEEN = 1 << 22  # degrees of rules on lines, in the boxes of one batch
_MOST_BOXES = 3_000_000  # that may wait, for the sake of memory
_MOST_PARTS = 24_000_000  # of inputs, in all boxes that wait
_TRIES = 4  # middles of boxes that are evaluated exactly, for each batch


class Verdict(NamedTuple):
    """What boxes can reach.

    Attributes:
        bound: At most this; minus infinity where a box is put away.
        value: About this in the middle.
        worth: Shape (boxes, lines): how much parting each line promises.
    """

    bound: FloatArray
    value: FloatArray
    worth: FloatArray


class Found(NamedTuple):
    """The result of a search for the largest value of something.

    Attributes:
        point: Where the largest known value is, if it is above the floor.
        value: That value, exactly; the floor if none is known.
        bound: No value is larger.
        boxes: How many boxes were looked at.
        why: What stopped the search; empty if no box is left.
    """

    point: Point | None
    value: Fraction
    bound: float
    boxes: int
    why: str


def search(
    space: Space,
    judge: Callable[[Seen, IntArray], Verdict],
    exact: Callable[[Point], tuple[Fraction, Point] | None],
    clock: Clock,
    *,
    floor: Fraction,
    tolerance: float,
    patience: int = 0,
    limit: float = math.inf,
    is_first_enough: bool = False,
) -> Found:
    """Return the largest value of something on a domain, within bounds.

    Args:
        space: The domain.
        judge: Bounds it on boxes.
        exact: Its value at a point, or at a better one near it; None where it has none.
        clock: How much time there is.
        floor: Boxes that cannot be above this are put away.
        tolerance: How near to each other the two bounds must come.
        patience: How many boxes are looked at, at least, before that is enough.
        limit: How many boxes are looked at before it gives up.
        is_first_enough: Whether any value above the floor ends the search.
    """
    best, point = floor, None
    most = min(_MOST_BOXES, _MOST_PARTS // len(space.lines))
    if space.root_count > most:
        return Found(None, floor, math.inf, 0, TOO_MANY)
    size = len(space.lines) * len(space.lines[0].asked.rules)
    batch = min(_BATCH, max(_MOST_SEEN // size, 64))
    boxes = space.roots()
    new, verdict = len(boxes), judge(space.look(boxes), boxes)
    looked, stuck = len(boxes), -math.inf
    while True:
        # Middles first: a better best value puts away more boxes.
        for row in np.argsort(-verdict.value[:new], kind="stable")[:_TRIES].tolist():
            if not verdict.value[row] >= float(best):
                break
            found = exact(space.point(boxes[row]))
            if found is not None and found[0] > best:
                best, point = found
        threshold = outwards(best)[0]
        kept = verdict.bound > threshold
        boxes, verdict = boxes[kept], Verdict(*(one[kept] for one in verdict))
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
            return Found(point, best, max(bound, outwards(best)[1]), looked, why)
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
        verdict = Verdict(
            *(np.concatenate([a, b[rest]]) for a, b in zip(below, verdict, strict=True))
        )


def _highest(bound: FloatArray, count: int) -> IntArray:
    if len(bound) <= count:
        return np.arange(len(bound))
    return np.argpartition(-bound, count)[:count]


def filled(given: Ground, point: Mapping[str, Fraction]) -> Point:
    """Return a point with the middle of the domain for inputs that do not matter."""
    whole: Point = {}
    for name in given.rules.inputs:
        side = given.domain.side(name)
        assert side is not None  # checked when the ground was made
        middle = Fraction(side.low * 0.5 + side.high * 0.5)
        whole[name] = point.get(name, middle)
    return whole


def simplified(
    given: Ground, point: Mapping[str, Fraction], holds: Callable[[Point], bool]
) -> Point:
    """Return a point of few digits near another one at which something holds."""
    sides = [given.domain.side(name) for name in point]
    for digits in range(1, 17):
        near: Point = {}
        for (name, value), side in zip(point.items(), sides, strict=True):
            assert side is not None  # checked when the ground was made
            span = max(side.high - side.low, abs(float(value)) * 2.0**-52)
            places = digits - math.floor(math.log10(span)) - 1 if span > 0.0 else 0
            rough = round(float(value), min(places, 320))
            near[name] = Fraction(min(max(rough, side.low), side.high))
        if is_within(given, near) and holds(near):
            return near
    return dict(point)
