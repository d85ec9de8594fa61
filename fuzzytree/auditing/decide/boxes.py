"""Boxes: branch and bound for products, curves and outputs, rounded outwards.

Their ends are positions on axes, counted in knots (`stretches`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Literal as Choice

import numpy as np

from fuzzytree.auditing.decide.answers import (
    Answer,
    Budget,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.rules import Literal
from fuzzytree.auditing.decide.stretches import Stretches
from fuzzytree.model import BoolArray, FloatArray

Side = Choice[0, 1]
Factor = tuple[str, Literal]

STEPS = 2_000_000
"""The most steps of a search."""

_SMALL = 2e-3  # of a piece between two knots: no box is halved further
_MOST_SLIVERS = 500
_MOST_LOOKS, _LOOKS = 256, 8  # middles of each round: tried in doubles, exactly


class Boxes:
    """Boxes of an axis-parallel domain: bounds of degrees and strengths on each.

    Attributes:
        low: The lower ends in positions, shape (boxes, axes).
        high: The upper ones.
    """

    def __init__(
        self,
        base: Base,
        stretches: Mapping[str, Stretches],
        low: FloatArray,
        high: FloatArray,
    ) -> None:
        self.base, self.low, self.high = base, low, high
        self.stretches = stretches
        self.places = {name: n for n, name in enumerate(stretches)}
        self._degrees: dict[Factor, tuple[FloatArray, FloatArray]] = {}

    @classmethod
    def whole(cls, base: Base) -> Boxes:
        """Return the whole domain as the only box, but for stand-ins beside ranges."""
        stretches = {axis.name: axis.stretches for axis in base.axes_in_use}
        high = np.array([[float(stretch.last) for stretch in stretches.values()]])
        return cls(base, stretches, np.zeros_like(high), high)

    def degree(self, name: str, literal: Literal) -> tuple[FloatArray, FloatArray]:
        """Return bounds of a literal's degrees on each box."""
        key = name, literal
        if key not in self._degrees:
            place = self.places[name]
            self._degrees[key] = self.stretches[name].range(
                literal, self.low[:, place], self.high[:, place]
            )
        return self._degrees[key]

    def slope(self, name: str, literal: Literal) -> tuple[FloatArray, FloatArray]:
        """Return bounds of the slope of a literal with its axis on each box."""
        place = self.places[name]
        return self.stretches[name].slope(
            literal, self.low[:, place], self.high[:, place]
        )

    def value(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return bounds of an input on each box."""
        if name not in self.places:
            axis, ones = self.base.inputs[name], np.ones(len(self.low))
            return ones * float(axis.least), ones * float(axis.largest)
        place, xs = self.places[name], [float(x) for x in self.stretches[name].x]
        knots = range(len(xs))
        low = np.interp(self.low[:, place], knots, xs)
        return low, np.interp(self.high[:, place], knots, xs)

    def strength(
        self, rule: int, side: Side, without: frozenset[Factor] = frozenset()
    ) -> FloatArray:
        """Return bounds of a rule's strength on boxes: from below 0, from above 1."""
        own = self.base.rules[rule]
        result = np.full(len(self.low), float(own.factor))
        for name, literal in own.literals:
            if (name, literal) in without:
                continue
            degree = self.degree(name, literal)[side]
            if own.norm == "product":
                result = result * degree
            else:
                result = np.minimum(result, degree)
        return result


def search_boxes(
    base: Base,
    is_excluded: Callable[[Boxes], BoolArray],
    accepts: Callable[[dict[str, Fraction]], bool],
    budget: Budget,
    steps: int = STEPS,
) -> Answer:
    """Halve boxes until each is excluded, or a point is accepted.

    Args:
        base: Rules whose axes share no inputs.
        is_excluded: Which boxes have no point for certain.
        accepts: Whether a point is one, exactly.
        budget: The budget of the caller.
        steps: The most steps that this search takes.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    if base.is_coupled or any(axis.extra for axis in base.axes_in_use):
        return Open("axes share inputs, or have a value beside their range", "FTD04")
    own = Budget(steps, budget)
    whole = Boxes.whole(base)
    stretches, boxes = whole.stretches, np.stack([whole.low, whole.high], axis=1)
    seen = slivers = 0
    while len(boxes):
        try:
            own.spend(100 + base.count * (20 + 2 * len(boxes)))
        except OutOfStepsError:
            if budget.is_spent:
                raise
            return Open(f"{len(boxes)} boxes are left")
        seen += len(boxes)
        excluded = is_excluded(Boxes(base, stretches, boxes[:, 0], boxes[:, 1]))
        boxes = boxes[~excluded]
        for middle in _middles(base, stretches, boxes[:_MOST_LOOKS], is_excluded):
            pairs = zip(stretches.items(), middle, strict=True)
            values = {name: stretch.value(x) for (name, stretch), x in pairs}
            point = base.point(values)
            if point is not None and base.contains(point) and accepts(point):
                return Point(point, f"{seen} boxes")
        width = boxes[:, 1] - boxes[:, 0]
        small = width.max(axis=1, initial=0.0) < _SMALL
        slivers += int(small.sum())
        boxes, width = boxes[~small], width[~small]
        if slivers > _MOST_SLIVERS:
            return Open("they touch on too many small boxes")
        if len(boxes):
            boxes = _halve(boxes, width, [*stretches.values()])
    return (
        Open(f"{slivers} small boxes are left") if slivers else Proved(f"{seen} boxes")
    )


def _middles(
    base: Base,
    stretches: Mapping[str, Stretches],
    boxes: FloatArray,
    is_excluded: Callable[[Boxes], BoolArray],
) -> list[list[float]]:
    """Return the middles of boxes, but for those that doubles exclude already."""
    axes = [stretch.axis for stretch in stretches.values()]
    has_values = np.array([bool(axis.values) for axis in axes], dtype=bool)
    middles = boxes.mean(axis=1)
    middles = np.where(has_values, np.round(middles), middles)
    if len(middles) and not any(axis.is_whole for axis in axes):
        middles = middles[~is_excluded(Boxes(base, stretches, middles, middles))]
    result: list[list[float]] = middles[:_LOOKS].tolist()
    return result


def _halve(
    boxes: FloatArray, width: FloatArray, stretches: list[Stretches]
) -> FloatArray:
    """Return both halves of boxes, which are halved where they are longest."""
    rows, longest = np.arange(len(boxes)), width.argmax(axis=1)
    has_values = np.array([bool(stretch.axis.values) for stretch in stretches])[longest]
    low, high = boxes[rows, 0, longest], boxes[rows, 1, longest]
    middle = (low + high) / 2
    middle = np.where(high - low > 1.5, np.round(middle), middle)
    middle = np.where(has_values, np.floor((low + high) / 2), middle)
    left, right = boxes.copy(), boxes.copy()
    left[rows, 1, longest] = middle
    right[rows, 0, longest] = middle + has_values
    return np.concatenate([left, right])


def by_boxes(
    base: Base, question: Question, budget: Budget, steps: int = STEPS
) -> Answer:
    """Decide a question on boxes; factors that two products share are cancelled.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    fine = base.fine
    factors = [frozenset(rule.literals) for rule in base.rules]
    twice = [len(rule.literals) > len(set(rule.literals)) for rule in base.rules]
    level = None if question.level is None else float(question.level)
    most, least = 1.0 + 1e-12, 1.0 - 1e-12
    order = [*question.rivals, *question.weak]
    needed: dict[int, None] = {}  # rivals that excluded a box, which are tried first

    def is_beaten(boxes: Boxes, j: int) -> BoolArray:
        """Return on which boxes a rival shows that there is no point."""
        if level is not None:
            return boxes.strength(j, 0) > level * most
        out = np.zeros(len(boxes.low), dtype=bool)
        for i in question.reach:
            shared: frozenset[Factor] = frozenset()
            own, rival = base.rules[i], base.rules[j]
            if own.norm == rival.norm == "product" and not (twice[i] or twice[j]):
                shared = factors[i] & factors[j]
            mine = boxes.strength(i, 1, shared)
            theirs = boxes.strength(j, 0, shared)
            out |= mine < theirs * least
            if j in question.rivals:
                is_never = own.norm == rival.norm and own.factor <= rival.factor
                if is_never and factors[j] <= factors[i] and not twice[j]:
                    out |= True
                out |= (theirs >= 1.0) & (mine <= 1.0) & (own.factor <= 1)
        return out

    def is_excluded(boxes: Boxes) -> BoolArray:
        out = np.zeros(len(boxes.low), dtype=bool)
        for i in question.reach:
            top = boxes.strength(i, 1)
            out |= top <= 0.0 if level is None else top < level * least
        for j in [*needed, *(j for j in order if j not in needed)]:
            if out.all():
                break
            beaten = is_beaten(boxes, j) & ~out
            if beaten.any():
                needed[j] = None
                out |= beaten
        return out

    def accepts(point: dict[str, Fraction]) -> bool:
        return question.holds(*base.strengths(point, question.rules))

    answer = search_boxes(fine, is_excluded, accepts, budget, steps)
    if isinstance(answer, Proved):
        return answer._replace(rivals=tuple(sorted(needed)))
    return answer
