"""A box around a point on which two models predict the same as they do there."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping
from fractions import Fraction

from fuzzytree.auditing.decide.answers import ZERO
from fuzzytree.auditing.decide.axes import Axis
from fuzzytree.auditing.decide.boxes import Factor
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
    used = both.base.axes_in_use
    if not (all(axis.is_input for axis in used) and both.base.contains(point)):
        return ()
    region = _Region(both, point)
    return tuple(span for axis in used if (span := region.span(axis)) is not None)


class _Region:
    """A box around a point, which grows as long as both models predict the same."""

    def __init__(self, both: Agreement, point: Mapping[str, Fraction]) -> None:
        self.both, self.base = both, both.base
        self.labels, self.point = both.labels(point), point
        keys = {key for rule in self.base.rules for key in rule.literals}
        at = {key: (point[key[0]], point[key[0]]) for key in keys}
        self.degrees = {key: self._range(key, ends) for key, ends in at.items()}

    def span(self, axis: Axis) -> Span | None:
        """Return how far the box reaches along an axis, None if all of it will do."""
        low = high = here = self.point[axis.name]
        if self._grows(axis, (axis.least, axis.largest)):
            return None
        low = self._stretch(axis, axis.least, lambda end: (end, high))
        high = self._stretch(axis, axis.largest, lambda end: (low, end))
        if axis.values:
            inside = [x for x in axis.values if low <= x <= high]
            low, high = inside[0], inside[-1]
        elif axis.is_whole:
            low = min(Fraction(math.ceil(low)), here)
            high = max(Fraction(math.floor(high)), here)
        return Span(axis.name, float(low), float(high))

    def _stretch(
        self, axis: Axis, beyond: Fraction, ends: Callable[[Fraction], Ends]
    ) -> Fraction:
        """Return how far one end may go, where the other one stays."""
        best = self.point[axis.name]
        if self._grows(axis, ends(beyond)):
            return beyond
        for _ in range(_HALVINGS):
            near = Fraction(float((best + beyond) / 2))
            if near in (best, beyond):
                break
            if self._grows(axis, ends(near)):
                best = near
            else:
                beyond = near
        return best

    def _grows(self, axis: Axis, ends: Ends) -> bool:
        """Make the box wider, if predictions are the same on all of it."""
        before = self.degrees
        keys = [key for key in before if key[0] == axis.name]
        self.degrees = {**before, **{key: self._range(key, ends) for key in keys}}
        if self._is_sure(0) and self._is_sure(1):
            return True
        self.degrees = before
        return False

    def _is_sure(self, side: Side) -> bool:
        """Return whether a model predicts its class in all of the box."""
        label, lead, first = self.labels[side], ZERO, -1
        others: list[tuple[Fraction, int]] = []
        for k in self.both.groups[side]:
            rule = self.base.rules[k]
            low = high = rule.factor
            for key in rule.literals:
                a, b = self.degrees[key]
                is_product = rule.norm == "product"
                low, high = (
                    (low * a, high * b) if is_product else (min(low, a), min(high, b))
                )
            if rule.then != label:
                others.append((high, k))
            elif low > lead:
                lead, first = low, k
        if first < 0:  # no rule of the class fires surely, or the class is that of none
            is_none = label == self.both.models[side].semantics.uncovered
            return is_none and not any(high for high, _ in others)
        return all(high < lead or (high == lead and k > first) for high, k in others)

    def _range(self, key: Factor, ends: Ends) -> Ends:
        """Return bounds of a degree between two values of an axis."""
        name, literal = key
        pick = min if literal.negated else max
        low, high = self.base.axes[name].parts[literal]
        return (
            pick(min(_values(lines, *ends)) for lines in low),
            pick(max(_values(lines, *ends)) for lines in high),
        )


def _values(lines: Lines, low: Fraction, high: Fraction) -> list[Fraction]:
    """Return values and limits between two places, which the others lie between."""
    start, stop = bisect_left(lines.x, low), bisect_right(lines.x, high)
    above, below = bisect_right(lines.x, low), bisect_left(lines.x, high)
    values = [value_at(lines, low), value_at(lines, high), *lines.at[start:stop]]
    values += lines.before[max(above - 1, 0) : max(stop - 1, 0)]
    return [*values, *lines.after[start:below]]
