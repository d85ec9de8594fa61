"""Slopes of strengths with an input, on boxes.

Between two knots of an axis a line has one slope, and a curve has bounds of it; at a
jump it is infinite.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from fuzzytree.auditing.decide import Base, Boxes, Literal
from fuzzytree.auditing.decide.lines import Between
from fuzzytree.auditing.require.bounds import Bounds, exact, largest
from fuzzytree.numerics import outwards
from fuzzytree.semantics import jet

_LEAST_JUMP = 2.0**-50  # the degree at a plateau's end is this near to its flank's


class NotBoundedError(ValueError):
    """A number or a slope that is not bounded here; the sentence names the part."""


class Slopes:
    """The slopes of the rules of a base with an input.

    Raises:
        NotBoundedError: If rows can have only some values of the input.
    """

    def __init__(self, base: Base, name: str) -> None:
        self.base, self.name = base, name
        if base.inputs[name].values or base.inputs[name].is_whole:
            text = f"{name!r} has only some values, between which there is no slope"
            raise NotBoundedError(text)
        self.tables: dict[tuple[str, Literal], Bounds] = {}

    def rule(self, boxes: Boxes, place: int) -> tuple[Bounds, Bounds]:
        """Return bounds of a rule's strength, and of its slope, on each box."""
        rule = self.base.rules[place]
        zero = np.zeros(len(boxes.low))
        value, slope = exact(zero + float(rule.factor)), exact(zero)
        values, slopes = [value], [slope]
        for axis, literal in rule.literals:
            degree, rise = Bounds(*boxes.degree(axis, literal)), exact(zero)
            if weight := self.base.axes[axis].weights.get(self.name):
                rise = self._literal(boxes, axis, literal)
                rise = rise.times(exact(zero + float(weight)))
            slope = slope.times(degree).plus(value.times(rise))
            value = value.times(degree)
            values.append(-degree)
            slopes.append(-rise)
        if rule.norm == "product":
            return value, slope
        values[0] = -values[0]
        value, slope = largest(values, slopes)
        return -value, -slope

    def _literal(self, boxes: Boxes, axis: str, literal: Literal) -> Bounds:
        """Return bounds of the slope of a literal with its axis."""
        key = axis, literal
        if key not in self.tables:
            knots = len(boxes.stretches[axis].x)
            both = self.base.axes[axis].bounds[literal]
            start = both.lower.x.index(boxes.stretches[axis].x[0])
            self.tables[key] = _table(both, literal, start, knots)
        place, table = boxes.places[axis], self.tables[key]
        first, last = (
            (np.floor(end) + np.ceil(end)).astype(int)
            for end in (boxes.low[:, place], boxes.high[:, place])
        )
        level = np.log2(last - first + 1).astype(int)
        back = last - (1 << level) + 1
        return Bounds(
            np.minimum(table.low[level, first], table.low[level, back]),
            np.maximum(table.high[level, first], table.high[level, back]),
        )


def _table(both: Between, literal: Literal, start: int, knots: int) -> Bounds:
    """Return extremes of slopes over 2^k neighbours from each on, by k.

    Knots have even places in it, and the pieces between them odd ones.
    """
    low, high = np.full(2 * knots - 1, np.inf), np.full(2 * knots - 1, -np.inf)
    for k, place in enumerate(range(start, start + knots)):
        if k < knots - 1:
            low[2 * k + 1], high[2 * k + 1] = _piece(both, literal, place)
        lines = both.lower, both.upper
        ends = [[line.at[place] for line in lines]]
        if k:
            ends.insert(0, [line.before[place - 1] for line in lines])
        if k < knots - 1:
            ends.append([line.after[place] for line in lines])
        for first, second in itertools.pairwise(ends):  # lower and upper lines apart
            if second[0] - first[1] > _LEAST_JUMP:
                high[2 * k] = np.inf
            if first[0] - second[1] > _LEAST_JUMP:
                low[2 * k] = -np.inf
    lows, highs = [low], [high]
    for step in itertools.takewhile(
        lambda n: 2 * n <= len(low), (1 << k for k in itertools.count())
    ):
        for rows, pick in ((lows, np.minimum), (highs, np.maximum)):
            row = rows[-1]
            rows.append(np.concatenate([pick(row[:-step], row[step:]), row[-step:]]))
    return Bounds(np.array(lows), np.array(highs))


def _piece(both: Between, literal: Literal, place: int) -> tuple[float, float]:
    """Return bounds of the slope of a literal between two knots."""
    a, b = both.lower.x[place : place + 2]
    if both.is_exact:
        return outwards((both.lower.before[place] - both.lower.after[place]) / (b - a))
    ends = outwards(a)[0], outwards(b)[1]
    slopes = [jet(function, *ends).slope for function in literal.functions]
    low, high = min(one.low for one in slopes), max(one.high for one in slopes)
    if literal.negated:
        low, high = -high, -low
    scale = float(literal.scale)
    return math.nextafter(scale * low, -math.inf), math.nextafter(
        scale * high, math.inf
    )
