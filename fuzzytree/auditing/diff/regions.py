"""A box around a point on which two models predict the same as they do there."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from fractions import Fraction

from fuzzytree.auditing.decide import Literal
from fuzzytree.auditing.decide.answers import ZERO
from fuzzytree.auditing.decide.lines import Lines, value_at
from fuzzytree.auditing.decide.states import Span
from fuzzytree.auditing.diff.agreement import Agreement, Side

_HALVINGS = 60  # of what a region may still grow by

Ends = tuple[Fraction, Fraction]


def difference_region(
    both: Agreement, point: Mapping[str, Fraction]
) -> tuple[Span, ...]:
    """Return a closed box around a point on which both predict as they do there.

    Variables of which any value on the domain will do are left out. It is found by
    stretching one side after the other, so a larger box may exist.

    Returns:
        Nothing where a rule uses a combination, or the point is not on the domain.
    """
    is_free = all(axis.is_input for axis in both.base.used)
    if not is_free or not both.base.contains(point):
        return ()
    return tuple(_Region(both, point).spans())


class _Region:
    """A box around a point, which grows as long as both models predict the same."""

    def __init__(self, both: Agreement, point: Mapping[str, Fraction]) -> None:
        self.both, self.base, self.point = both, both.base, point
        self.labels = tuple(one.label for one in both.predictions(point))
        self.box: dict[str, Ends] = {}
        for axis in self.base.used:
            self.box[axis.name] = point[axis.name], point[axis.name]
        self.degrees = {
            key: self._range(*key, self.box[key[0]])
            for rule in self.base.rules
            for key in rule.literals
        }

    def spans(self) -> list[Span]:
        """Return the ends of the axes that matter."""
        result: list[Span] = []
        for axis in self.base.used:
            if self._grows(axis.name, (axis.least, axis.largest)):
                continue
            for beyond in (axis.least, axis.largest):
                self._stretch(axis.name, beyond)
            low, high = self.box[axis.name]
            if axis.values:
                inside = [x for x in axis.values if low <= x <= high]
                low, high = inside[0], inside[-1]
            elif axis.is_whole:
                here = self.point[axis.name]
                low = min(Fraction(math.ceil(low)), here)
                high = max(Fraction(math.floor(high)), here)
            result.append(Span(axis.name, float(low), float(high)))
        return result

    def _stretch(self, name: str, beyond: Fraction) -> None:
        def moved(end: Fraction) -> Ends:
            low, high = self.box[name]
            return min(low, end), max(high, end)

        if self._grows(name, moved(beyond)):
            return
        best = self.box[name][beyond > self.box[name][0]]
        for _ in range(_HALVINGS):
            near = Fraction(float((best + beyond) / 2))
            if near in (best, beyond):
                break
            if self._grows(name, moved(near)):
                best = near
            else:
                beyond = near

    def _grows(self, name: str, ends: Ends) -> bool:
        """Make the box wider, if predictions are the same on all of it."""
        kept = self.degrees
        own = {key: self._range(*key, ends) for key in kept if key[0] == name}
        self.degrees = {**kept, **own}
        if all(self._is_sure(side) for side in (0, 1)):
            self.box[name] = ends
            return True
        self.degrees = kept
        return False

    def _is_sure(self, side: Side) -> bool:
        label, lead, first = self.labels[side], ZERO, -1
        others: list[tuple[Fraction, int]] = []
        for k in self.both.groups[side]:
            rule = self.base.rules[k]
            low = high = rule.factor
            for key in rule.literals:
                a, b = self.degrees[key]
                if rule.norm == "product":
                    low, high = low * a, high * b
                else:
                    low, high = min(low, a), min(high, b)
            if rule.then != label:
                others.append((high, k))
            elif low > lead:
                lead, first = low, k
        if first < 0:  # no rule of the class fires surely, or the class is that of none
            is_none = label == self.both.models[side].semantics.uncovered
            return is_none and not any(high for high, _ in others)
        return all(high < lead or (high == lead and k > first) for high, k in others)

    def _range(self, name: str, degree: Literal, ends: Ends) -> Ends:
        """Return bounds of a degree between two values of an axis."""
        pick = min if degree.negated else max
        low, high = self.base.axes[name].parts[degree]
        return (
            pick(min(_values(one, ends)) for one in low),
            pick(max(_values(one, ends)) for one in high),
        )


def _values(lines: Lines, ends: Ends) -> list[Fraction]:
    """Return values and limits between two places, which the others lie between."""
    low, high = ends
    result = [value_at(lines, low), value_at(lines, high)]
    last = len(lines.x) - 1
    first, stop = bisect_left(lines.x, low), bisect_right(lines.x, high)
    for k in range(first, stop):
        x = lines.x[k]
        result.append(lines.at[k])
        if x > low and k:
            result.append(lines.before[k - 1])
        if x < high and k < last:
            result.append(lines.after[k])
    return result
