"""Boxes: branch and bound for products, curves and outputs, rounded outwards.

Where a position lies on an axis is counted in knots: at a whole number it is a knot,
between two of them a place on the lines between. Degrees on a stretch of positions are
bounded by values and limits at its ends and at the knots inside, kept in tables of
extremes over runs of knots.
"""

from __future__ import annotations

import math
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
from fuzzytree.auditing.decide.axes import Axis, value_at
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.lines import Between, Lines
from fuzzytree.auditing.decide.rules import Literal
from fuzzytree.model import BoolArray, FloatArray, IntArray
from fuzzytree.numerics import outwards
from fuzzytree.semantics import jet

Side = Choice[0, 1]
_Pick = Callable[[FloatArray, FloatArray], FloatArray]
Factor = tuple[str, Literal]

_SMALL = 2e-3  # of a piece between two knots: no box is halved further
_MOST_SLIVERS = 500
_LOOKS = 8  # boxes of each round whose middle is tried
_JUMP = 2.0**-50  # a degree at a plateau's end is this near to that of its flank
_ROUND = 1e-13  # more than a sum or product of a few doubles is rounded by


class Stretches:
    """The literals of an axis on stretches of it."""

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.x = [*axis.values] or [x for x in axis.knots if axis.low <= x <= axis.high]
        self.last_number = len(self.x) - 1
        if not axis.values:  # values beside the range stand behind it
            self.x += axis.extra
        self.last = len(self.x) - 1
        self.sides = {
            literal: (self._floats(both.lower), self._floats(both.upper))
            for literal, both in axis.bounds.items()
        }
        self._tables: dict[tuple[int, bool], FloatArray] = {}
        self._are_doubles: dict[Literal, bool] = {}
        self._slopes: dict[Literal, tuple[FloatArray, FloatArray]] = {}

    def _floats(self, lines: Lines) -> tuple[FloatArray, FloatArray, FloatArray]:
        start = lines.x.index(self.x[0])
        end = start + self.last_number
        beside = [float(value_at(lines, x)) for x in self.x[self.last_number + 1 :]]
        at = np.array([*map(float, lines.at[start : end + 1]), *beside])
        if self.axis.values:
            return at, at[:-1], at[1:]
        after = [*map(float, lines.after[start:end]), *at[self.last_number : -1]]
        before = [*map(float, lines.before[start:end]), *beside]
        return at, np.array(after), np.array(before)

    def range(
        self, literal: Literal, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of a literal's degrees on stretches of positions."""
        lower, upper = self.sides[literal]
        least = self._extreme(lower, low, high, is_most=False)
        most = self._extreme(upper, low, high, is_most=True)
        off = self._rounding(literal, low, high)
        return (
            np.where(least >= 1.0, 1.0, np.clip(least - off, 0.0, None)),
            np.where(most <= 0.0, 0.0, most + off),
        )

    def _rounding(
        self, literal: Literal, low: FloatArray, high: FloatArray
    ) -> FloatArray:
        """Return how far degrees may be off: not at all where they are doubles."""
        if literal not in self._are_doubles:
            both = self.axis.bounds[literal]
            values = [v for lines in both for side in lines[1:] for v in side]
            self._are_doubles[literal] = all(Fraction(float(v)) == v for v in values)
        off = np.full_like(low, _ROUND)
        if not self._are_doubles[literal] or not self.last:
            return off
        flat = np.ones(len(low), dtype=bool)
        for _, after, before in self.sides[literal]:
            for end in (low, high):
                piece = np.minimum(end.astype(int), self.last - 1)
                flat &= (end == np.floor(end)) | (after[piece] == before[piece])
        return np.where(flat, 0.0, off)

    def _extreme(
        self,
        part: tuple[FloatArray, FloatArray, FloatArray],
        low: FloatArray,
        high: FloatArray,
        *,
        is_most: bool,
    ) -> FloatArray:
        at, after, before = part
        pick = np.maximum if is_most else np.minimum
        if not self.last:
            return np.full_like(low, at[0])
        first, last = np.floor(low).astype(int), np.ceil(high).astype(int)
        piece = np.minimum(first, self.last - 1)
        end = np.maximum(last - 1, 0)
        start = after[piece] + (before[piece] - after[piece]) * (low - piece)
        on_first = np.where(high > first, pick(at[first], after[piece]), at[first])
        start = np.where(low == first, on_first, start)
        stop = after[end] + (before[end] - after[end]) * (high - end)
        on_last = np.where(low < last, pick(at[last], before[end]), at[last])
        stop = np.where(high == last, on_last, stop)
        result: FloatArray = pick(start, stop)
        # knots strictly inside: their values, with both limits
        u = np.floor(low).astype(int) + 1
        v = np.ceil(high).astype(int) - 1
        inside = v >= u
        u, v = np.where(inside, u, 0), np.where(inside, v, 0)
        key = id(part), is_most
        if key not in self._tables:
            row = at.copy()
            row[:-1] = pick(row[:-1], after)
            row[1:] = pick(row[1:], before)
            self._tables[key] = _runs(row, pick)
        extreme = _picked(self._tables[key], u, v, pick)
        return np.where(inside, pick(result, extreme), result)

    def slope(
        self, literal: Literal, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of the slope of a literal on stretches; infinite at a jump."""
        if literal not in self._slopes:
            least, most = self._steps(literal)
            self._slopes[literal] = _runs(least, np.minimum), _runs(most, np.maximum)
        first, last = (
            (np.floor(end) + np.ceil(end)).astype(int) for end in (low, high)
        )
        least, most = self._slopes[literal]
        return (
            _picked(least, first, last, np.minimum),
            _picked(most, first, last, np.maximum),
        )

    def _steps(self, literal: Literal) -> tuple[FloatArray, FloatArray]:
        """Return bounds of slopes at knots, in even places, and between them."""
        least = np.full(2 * self.last + 1, np.inf)
        most = -least
        both = self.axis.bounds[literal]
        start = both.lower.x.index(self.x[0])
        for n in range(self.last):
            least[2 * n + 1], most[2 * n + 1] = _slope(both, literal, start + n)
        (at, after, before), (at_most, after_most, before_most) = self.sides[literal]
        most[2::2][at[1:] - before_most > _JUMP] = np.inf
        most[:-1:2][after - at_most[:-1] > _JUMP] = np.inf
        least[2::2][before - at_most[1:] > _JUMP] = -np.inf
        least[:-1:2][at[:-1] - after_most > _JUMP] = -np.inf
        return least, most

    def value(self, position: float) -> Fraction:
        """Return the exact value at a position; of single values the nearest one."""
        if self.axis.values:
            return self.x[round(position)]
        piece = min(int(position), self.last)
        if piece == self.last:
            return self.x[self.last]
        x = self.x[piece] + (self.x[piece + 1] - self.x[piece]) * (
            Fraction(position) - piece
        )
        return Fraction(round(x)) if self.axis.is_whole else x


def _runs(row: FloatArray, pick: _Pick) -> FloatArray:
    """Return extremes over 2**k neighbours from each on, by k."""
    rows = [row]
    while 2 ** len(rows) <= len(row):
        step, last = 2 ** (len(rows) - 1), rows[-1]
        rows.append(np.concatenate([pick(last[:-step], last[step:]), last[-step:]]))
    return np.array(rows)


def _picked(
    runs: FloatArray, first: IntArray, last: IntArray, pick: _Pick
) -> FloatArray:
    """Return extremes from each first to each last neighbour."""
    k = np.log2(last - first + 1).astype(int)
    return pick(runs[k, first], runs[k, last - 2**k + 1])


def _slope(both: Between, literal: Literal, place: int) -> tuple[float, float]:
    """Return bounds of the slope of a literal between two knots."""
    lower, (a, b) = both.lower, both.lower.x[place : place + 2]
    if both.is_exact:
        return outwards((lower.before[place] - lower.after[place]) / (b - a))
    ends = outwards(a)[0], outwards(b)[1]
    slopes = [jet(function, *ends).slope for function in literal.functions]
    scale = float(-literal.scale if literal.negated else literal.scale)
    every = [scale * end for slope in slopes for end in (slope.low, slope.high)]
    return math.nextafter(min(every), -math.inf), math.nextafter(max(every), math.inf)


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
        stretches = {axis.name: Stretches(axis) for axis in base.used}
        high = np.array([[float(each.last) for each in stretches.values()]])
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
        one = self.base.rules[rule]
        result = np.full(len(self.low), float(one.factor))
        for name, literal in one.literals:
            if (name, literal) in without:
                continue
            degree = self.degree(name, literal)[side]
            if one.norm == "product":
                result = result * degree
            else:
                result = np.minimum(result, degree)
        return result


def search_boxes(
    base: Base,
    is_excluded: Callable[[Boxes], BoolArray],
    accepts: Callable[[dict[str, Fraction]], bool],
    budget: Budget,
    steps: int = 4_000_000,
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
    if base.is_coupled or any(axis.extra for axis in base.used):
        return Open("axes share inputs, or have a value beside their range", "FTD04")
    own = Budget(steps, budget)
    whole = Boxes.whole(base)
    stretches, boxes = whole.stretches, np.stack([whole.low, whole.high], axis=1)
    seen = slivers = 0
    while len(boxes):
        try:
            own.spend(len(boxes) * (10 + 4 * base.count))
        except OutOfStepsError:
            if budget.is_spent:
                raise
            return Open(f"{len(boxes)} boxes are left")
        seen += len(boxes)
        excluded = is_excluded(Boxes(base, stretches, boxes[:, 0], boxes[:, 1]))
        boxes = boxes[~excluded]
        for box in boxes[:_LOOKS]:
            values = {
                name: stretch.value(float(low + high) / 2)
                for (name, stretch), low, high in zip(
                    stretches.items(), box[0], box[1], strict=True
                )
            }
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
            boxes = _halved(boxes, width, [*stretches.values()])
    return (
        Open(f"{slivers} small boxes are left") if slivers else Proved(f"{seen} boxes")
    )


def _halved(
    boxes: FloatArray, width: FloatArray, stretches: list[Stretches]
) -> FloatArray:
    """Return both halves of boxes, which are halved where they are longest."""
    rows, longest = np.arange(len(boxes)), width.argmax(axis=1)
    has_values = np.array([bool(one.axis.values) for one in stretches])[longest]
    low, high = boxes[rows, 0, longest], boxes[rows, 1, longest]
    middle = (low + high) / 2
    middle = np.where(high - low > 1.5, np.round(middle), middle)
    middle = np.where(has_values, np.floor((low + high) / 2), middle)
    left, right = boxes.copy(), boxes.copy()
    left[rows, 1, longest] = middle
    right[rows, 0, longest] = middle + has_values
    return np.concatenate([left, right])


def by_boxes(base: Base, question: Question, budget: Budget) -> Answer:
    """Decide a question on boxes; factors that two products share are cancelled.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    fine = base.fine
    factors = [frozenset(rule.literals) for rule in base.rules]
    twice = [len(rule.literals) > len(set(rule.literals)) for rule in base.rules]
    level = None if question.level is None else float(question.level)
    most, least = 1.0 + 1e-12, 1.0 - 1e-12

    def is_excluded(boxes: Boxes) -> BoolArray:
        out = np.zeros(len(boxes.low), dtype=bool)
        for i in question.reach:
            top = boxes.strength(i, 1)
            out |= top <= 0.0 if level is None else top < level * least
            for j in (*question.rivals, *question.weak) if level is None else ():
                shared: frozenset[Factor] = frozenset()
                one, other = base.rules[i], base.rules[j]
                if one.norm == other.norm == "product" and not (twice[i] or twice[j]):
                    shared = factors[i] & factors[j]
                mine = boxes.strength(i, 1, shared)
                theirs = boxes.strength(j, 0, shared)
                out |= mine < theirs * least
                if j in question.rivals:
                    is_never = one.norm == other.norm and one.factor <= other.factor
                    if is_never and factors[j] <= factors[i] and not twice[j]:
                        out |= True
                    out |= (theirs >= 1.0) & (mine <= 1.0) & (one.factor <= 1)
        if level is not None:
            for j in (*question.rivals, *question.weak):
                out |= boxes.strength(j, 0) > level * most
        return out

    def accepts(point: dict[str, Fraction]) -> bool:
        return question.holds(*base.strengths(point, question.rules))

    return search_boxes(fine, is_excluded, accepts, budget)
