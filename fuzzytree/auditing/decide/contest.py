"""Which rules win: whether there is a point of a domain where others do.

Where degrees are lines, the decider is asked, rule by rule. Where they are curves, or
it does not know, boxes of the inputs are halved until no such rule can win in any.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from fractions import Fraction
from functools import cached_property

import numpy as np

from fuzzytree.auditing.decide.answers import (
    ZERO,
    Answer,
    Budget,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.axes import Axis
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.boxes import Boxes
from fuzzytree.auditing.decide.decider import Decider
from fuzzytree.auditing.decide.domain import Domain, contains
from fuzzytree.auditing.decide.stretches import Stretches
from fuzzytree.model import BoolArray, FloatArray, IntArray
from fuzzytree.numerics import U

STEPS = 300_000
"""The most steps for one row, and for one question about a part of the domain."""

_ROUND = 1.0 - 1e-12  # more than strengths are rounded by
_TOUCH = "rules only touch there, or lines around curves are too far apart"
_BOXES = 256  # that are looked at together
_LOOKS = 3  # middles of them that are evaluated in fractions
_TINY = 1e-9  # of a piece between two knots: no box is halved further
_FLAT = 1e-12  # no box is halved where degrees vary less
_PART = 0.5  # of the steps, for the first of two methods


def decision(
    base: Base, point: Mapping[str, Fraction]
) -> tuple[str | None, int | None]:
    """Return the class of the first of the strongest rules, and its position.

    Where degrees are no fractions, the lower bounds of strengths decide.
    """
    low, high = base.strengths(point)
    best = max(low)
    if not best and not max(high):
        return base.uncovered, None
    place = low.index(best)
    return base.rules[place].then, place


class Contest:
    """Rules whose win counts, against those whose win does not.

    Attributes:
        reach: The positions of those that count.
        rivals: Those of the others.
        is_bare: Whether it counts where no rule fires.
    """

    def __init__(
        self, base: Base, label: str | None, wanted: str | None = None
    ) -> None:
        self.base, self.label, self.wanted = base, label, wanted
        classes = [rule.then for rule in base.rules]
        self.reach = [i for i, own in enumerate(classes) if self.counts(own)]
        self.rivals = [i for i, own in enumerate(classes) if not self.counts(own)]
        self.is_bare = self.counts(base.uncovered)

    def counts(self, label: str | None) -> bool:
        """Return whether a decision is one that is sought."""
        return label != self.label if self.wanted is None else label == self.wanted

    def accepts(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether a point of the domain is decided as is sought, exactly."""
        return self.base.contains(point) and self.counts(decision(self.base, point)[0])

    def ask(self, domain: Domain, budget: Budget) -> Answer:
        """Return a point of a part of the domain that is of the kind, if there is one.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        methods = [self._decide, self._halve]
        if not self.base.is_exact:
            methods = [self._halve] if self.base.is_coupled else methods[::-1]
        own = Budget(min(STEPS, budget.left), budget)
        result: Answer = Open("no method applies")
        for method in methods:
            is_last = method is methods[-1]
            try:
                result = method(domain, own if is_last else own.share(_PART))
            except OutOfStepsError:
                if is_last or budget.is_spent:
                    raise
            if not isinstance(result, Open):
                break
        return result

    def strongest(self, boxes: Boxes) -> tuple[FloatArray, FloatArray]:
        """Return the largest lower bound of rivals in boxes, and all upper bounds."""
        least = [boxes.strength(i, 0) for i in self.rivals]
        best = np.max([np.zeros(len(boxes.low)), *least], axis=0) * _ROUND
        return best, np.array([boxes.strength(i, 1) for i in range(self.base.count)])

    # --- the decider

    def _decide(self, domain: Domain, budget: Budget) -> Answer:
        base = self.base.on(domain)
        budget.spend(60 * base.size)
        if base.is_empty:
            return Proved("the domain has no point")
        decider = Decider(base)
        result: Answer = Proved("no rule that counts can win")
        for question in self._questions(base):
            answer = decider.ask(question, budget)
            if isinstance(answer, Point):
                return answer
            result = result if isinstance(answer, Proved) else answer
        return result

    def _questions(self, base: Base) -> list[Question]:
        """Return questions of which one must be yes, with the rules that matter."""
        best, most = self.strongest(Boxes.whole(base))
        kept = np.flatnonzero((most[:, 0] >= best) & (most[:, 0] > 0.0)).tolist()
        rivals = [i for i in self.rivals if i in kept]
        result = [
            Question(
                (j,),
                tuple(i for i in rivals if i < j),
                tuple(i for i in rivals if i > j),
            )
            for j in self.reach
            if j in kept
        ]
        if self.is_bare and not best:
            result.append(Question(weak=tuple(range(base.count)), level=ZERO))
        return result

    # --- boxes of the inputs

    def _halve(self, domain: Domain, budget: Budget) -> Answer:
        """Halve boxes until in each for certain no rule that counts wins."""
        inputs = self._inputs
        variables = self.base.variables.values()
        boxes, count, is_sure = inputs.start(domain, budget), 0, True
        leads = np.zeros(len(boxes))
        while len(boxes):
            order = np.argsort(-leads, kind="stable")
            boxes, leads = boxes[order], leads[order]
            chosen, boxes, leads = boxes[:_BOXES], boxes[_BOXES:], leads[_BOXES:]
            budget.spend(300 + len(chosen) * (3 + self.base.count))
            count += len(chosen)
            on_axes, is_inside = inputs.on_axes(chosen, domain)
            is_left = is_inside & ~self._is_clear(on_axes)
            vary, chosen = inputs.vary(on_axes, chosen)[is_left], chosen[is_left]
            middles = inputs.snap(chosen.mean(axis=1))
            lead = self._lead(middles, domain)
            order = np.argsort(-lead, kind="stable")[:_LOOKS]
            for k in order[lead[order] > 0.0]:
                point = inputs.point(middles[k])
                if contains(domain, variables, point) and self.accepts(point):
                    return Point(point, f"{count} boxes")
            is_wide = vary.max(axis=1, initial=0.0) > _FLAT
            is_sure = is_sure and bool(is_wide.all())
            halves = inputs.halves(chosen[is_wide], vary[is_wide].argmax(axis=1))
            boxes = np.concatenate([boxes, halves])
            leads = np.concatenate([leads, lead[is_wide], lead[is_wide]])
        return Proved(f"{count} boxes") if is_sure else Open(_TOUCH)

    @cached_property
    def _inputs(self) -> _Inputs:
        return _Inputs(self.base.fine)

    def _is_clear(self, boxes: Boxes) -> BoolArray:
        """Return in which boxes for certain no rule that counts wins."""
        best, most = self.strongest(boxes)
        clear = best > 0.0 if self.is_bare else np.ones(len(best), dtype=bool)
        for j in self.reach:
            beaten = (most[j] < best) | (most[j] <= 0.0)
            for i in self.rivals:
                if bool(beaten[clear].all()):
                    break
                beaten |= self._is_beaten(boxes, j, i)
            clear &= beaten
        result: BoolArray = clear
        return result

    def _is_beaten(self, boxes: Boxes, j: int, i: int) -> BoolArray:
        """Return in which boxes a rule is beaten by another one, whatever they share.

        The product of what they share is a factor of both; where it is 0, neither
        fires. Of the minimum it makes them equal at most, so that the first one wins.
        """
        mine, other = self.base.rules[j], self.base.rules[i]
        shared = frozenset(mine.literals) & frozenset(other.literals)
        is_product = other.norm == "product"
        is_twice = any(len(r.literals) > len(set(r.literals)) for r in (mine, other))
        if mine.norm != other.norm or is_twice or not (is_product or i < j):
            shared = frozenset()
        most = boxes.strength(j, 1, shared if is_product else frozenset())
        least = boxes.strength(i, 0, shared)
        is_plain = all(
            factor <= 1 and Fraction(float(factor)) == factor
            for factor in (mine.factor, other.factor)
        )
        is_rounded = ~(is_plain & ((least >= 1.0) | (not is_product)))
        least = np.where(is_rounded, least * _ROUND, least)
        result: BoolArray = most <= least if i < j else most < least
        return result

    def _lead(self, points: FloatArray, domain: Domain) -> FloatArray:
        """Return about how far rules that count are ahead at positions of inputs.

        Beyond a domain it is less than 0.
        """
        boxes, inside = self._inputs.on_axes(np.stack([points, points], axis=1), domain)
        every = range(self.base.count)
        both = np.array([boxes.strength(i, 0) + boxes.strength(i, 1) for i in every])
        mine, others = (
            both[of].max(axis=0, initial=0.0) for of in (self.reach, self.rivals)
        )
        is_bare = self.is_bare & (mine == 0.0) & (others == 0.0)
        lead = np.where(is_bare, 1.0, mine - others)
        return np.where(inside, lead, np.minimum(lead, 0.0) - 1.0)


class _Inputs:
    """Boxes of the inputs of a base, of shape (boxes, 2, inputs).

    Their ends are positions on the inputs, counted in knots (`stretches`).
    """

    def __init__(self, base: Base) -> None:
        self.base, self.axes = base, [*base.inputs.values()]
        self.has_values = np.array([bool(axis.values) for axis in self.axes])
        self.x = [np.array([*map(float, axis.stretches.x)]) for axis in self.axes]
        self.jumps = [axis.stretches.jumps for axis in self.axes]
        self.stretches = {name: axis.stretches for name, axis in base.axes.items()}
        places = {axis.name: n for n, axis in enumerate(self.axes)}
        self.weights = np.zeros((len(base.axes), len(self.axes)))
        for row, axis in zip(self.weights, base.axes.values(), strict=True):
            for name, weight in axis.weights.items():
                row[places[name]] = float(weight)
        self.sums = {
            n: (axis, _Places(axis.stretches))
            for n, axis in enumerate(base.axes.values())
            if not axis.is_input
        }
        self.size = np.abs(self.weights) @ [np.abs(x).max() for x in self.x]

    def start(self, domain: Domain, budget: Budget) -> FloatArray:
        """Return boxes of a domain: stand-ins are apart from numbers."""
        choices = [self._runs(axis, domain) for axis in self.axes]
        budget.spend(100 * math.prod(map(len, choices)))
        boxes = np.array([*itertools.product(*choices)], dtype=float)
        return boxes.reshape(-1, len(self.axes), 2).transpose(0, 2, 1)

    def _runs(self, axis: Axis, domain: Domain) -> list[tuple[float, float]]:
        side, stretch = domain.side(axis.name), axis.stretches
        assert side is not None  # of an input
        if axis.values:
            every = [k for k, x in enumerate(axis.values) if side.has(x)]
            runs = np.split(every, np.flatnonzero(np.diff(every) > 1) + 1)
            return [(run[0], run[-1]) for run in runs if len(run)]
        extra = range(stretch.last_number + 1, stretch.last + 1)
        result = [(float(k), float(k)) for k in extra if side.has(stretch.x[k])]
        if not side.values:
            ends = [Fraction(side.low), Fraction(side.high)]
            low, high = _Places(stretch)(*np.array([[side.low], [side.high]]))
            first, last = (
                float(stretch.x.index(end)) if end in stretch.x else float(place[0])
                for end, place in zip(ends, (low, high), strict=True)
            )
            result.append(
                (math.nextafter(first, math.inf) if side.is_open else first, last)
            )
        return result

    def values(self, boxes: FloatArray) -> FloatArray:
        """Return about the values of inputs at ends of boxes."""
        result = np.empty(boxes.shape)
        for n, x in enumerate(self.x):
            result[:, :, n] = np.interp(boxes[:, :, n], np.arange(len(x)), x)
        return result

    def on_axes(self, boxes: FloatArray, domain: Domain) -> tuple[Boxes, BoolArray]:
        """Return boxes on the axes, and which may be inside of a domain."""
        inside = np.ones(len(boxes), dtype=bool)
        values = self.values(boxes)
        for n, axis in enumerate(self.axes):
            if axis.is_whole and not axis.values:
                first, last = values[:, 0, n] - 1e-6, values[:, 1, n] + 1e-6
                is_number = boxes[:, 1, n] <= axis.stretches.last_number
                inside &= ~is_number | (np.ceil(first) <= np.floor(last))
        places = boxes[:, :, np.abs(self.weights).argmax(axis=1)]
        for n, (axis, places_of) in self.sums.items():
            ends = np.sort(values * self.weights[n], axis=1).sum(axis=2)
            constant = float(axis.constant)
            slack = 64 * U * (self.size[n] + abs(constant))
            first, last = ends[:, 0] + constant - slack, ends[:, 1] + constant + slack
            side = domain.side(axis.name)
            if side is not None:
                first, last = np.maximum(first, side.low), np.minimum(last, side.high)
                inside &= first <= last
            places[:, 0, n], places[:, 1, n] = places_of(first, last)
        return Boxes(self.base, self.stretches, places[:, 0], places[:, 1]), inside

    def vary(self, on_axes: Boxes, boxes: FloatArray) -> FloatArray:
        """Return by how much degrees vary in boxes with each input, about."""
        vary = np.zeros(on_axes.low.shape)
        for name, literal in {key for rule in self.base.rules for key in rule.literals}:
            low, high = on_axes.degree(name, literal)
            place = on_axes.places[name]
            vary[:, place] = np.maximum(vary[:, place], high - low)
        widths = np.ptp(self.values(boxes), axis=1)[:, None] * np.abs(self.weights)
        shares = widths / np.maximum(widths.sum(axis=2, keepdims=True), 1e-300)
        result = (vary[:, :, None] * shares).max(axis=1, initial=0.0)
        return np.where(np.ptp(boxes, axis=1) < _TINY, 0.0, result)

    def halves(self, boxes: FloatArray, at: IntArray) -> FloatArray:
        """Return both halves of boxes along an input of each.

        A knot at which a degree jumps is at last apart from what is beside it.
        """
        rows = np.arange(len(boxes))
        low, high = boxes[rows, 0, at], boxes[rows, 1, at]
        middle = (low + high) / 2
        middle = np.where(high - low > 1.5, np.round(middle), middle)
        stop = np.where(self.has_values[at], np.floor((low + high) / 2), middle)
        start = stop + self.has_values[at]
        is_short = ~self.has_values[at] & (high - low <= 1.0)
        first = is_short & self._jumps(low, at)
        last = is_short & self._jumps(high, at) & ~first
        stop = np.where(first, low, np.where(last, np.nextafter(high, -1.0), stop))
        start = np.where(first, np.nextafter(low, np.inf), np.where(last, high, start))
        left, right = boxes.copy(), boxes.copy()
        left[rows, 1, at], right[rows, 0, at] = stop, start
        return np.concatenate([left, right])

    def _jumps(self, places: FloatArray, at: IntArray) -> BoolArray:
        """Return which places are knots at which a degree jumps."""
        result = np.zeros(len(places), dtype=bool)
        for n, jumps in enumerate(self.jumps):
            result |= (at == n) & np.isin(places, jumps)
        return result

    def snap(self, places: FloatArray) -> FloatArray:
        """Return places with those of single values at one of them."""
        return np.where(self.has_values, np.round(places), places)

    def point(self, places: FloatArray) -> dict[str, Fraction]:
        """Return the exact values at places of all inputs."""
        pairs = zip(self.axes, places.tolist(), strict=True)
        return {axis.name: axis.stretches.value(x) for axis, x in pairs}


class _Places:
    """Where numbers of an axis are, rounded outwards."""

    def __init__(self, stretch: Stretches) -> None:
        self.x = np.array([*map(float, stretch.x[: stretch.last_number + 1])])
        self.knots, self.size = np.arange(len(self.x)), np.abs(self.x).max()

    def __call__(
        self, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return where stretches begin and end."""
        slack = 8 * U * (self.size + np.abs(low) + np.abs(high))
        first = np.interp(low - slack, self.x, self.knots) - 1e-12
        last = np.interp(high + slack, self.x, self.knots) + 1e-12
        return np.maximum(first, 0.0), np.minimum(last, self.knots[-1])
