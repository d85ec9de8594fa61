"""The literals of an axis on stretches of it, in doubles rounded outwards.

A position is counted in knots: at a whole number it is a knot, between two of them a
place on the lines between. Degrees on a stretch of positions are bounded by values and
limits at its ends and at the knots inside, kept in tables of extremes over runs of
knots.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.decide.lines import Lines, refine, value_at
from fuzzytree.model import BoolArray, FloatArray, IntArray
from fuzzytree.numerics import U, outwards
from fuzzytree.semantics import jet

if TYPE_CHECKING:
    from fuzzytree.auditing.decide.axes import Axis
    from fuzzytree.auditing.decide.rules import Literal

_Pick = Callable[[FloatArray, FloatArray], FloatArray]

_MOST_FRACTIONS = 50_000  # values at knots of an axis that are worked out exactly
_TINY = 1e-300
_JUMP = 2.0**-50  # a degree at a plateau's end is this near to that of its flank
_ROUND = 1e-13  # more than a sum or product of a few doubles is rounded by


class _Row(NamedTuple):
    """Values and limits of lines at the knots of an axis, as `Lines` has them."""

    at: FloatArray
    after: FloatArray
    before: FloatArray

    @property
    def ends(self) -> FloatArray:
        """The values at both ends of each knot and each stretch between two."""
        after, before = [self.at, self.after], [self.at, self.before]
        return np.array([np.concatenate(after), np.concatenate(before)])


_Rows = tuple[list[_Row], list[_Row]]  # of the lower and the upper lines of a literal


class Stretches:
    """The literals of an axis on stretches of it."""

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.x = [*axis.values] or [x for x in axis.bends if axis.low <= x <= axis.high]
        self.last_number = len(self.x) - 1
        self._first = 0 if axis.values else axis.bends.index(self.x[0])
        if not axis.values:  # values beside the range stand behind it
            self.x += axis.extra
        self.last = len(self.x) - 1
        self._places = {x: n for n, x in enumerate(axis.bends)}
        self._floats = np.array([float(x) for x in self.x])
        off = [abs(x - Fraction(float(x))) for x in self.x]
        self._off = np.array([outwards(gap)[1] for gap in off])
        count = len(axis.bends) * sum(len(parts[0]) for parts in axis.parts.values())
        self._is_exact = axis.is_exact and count <= _MOST_FRACTIONS
        rows: dict[int, _Row] = {}
        self.sides: dict[Literal, _Rows] = {}
        for literal, parts in axis.parts.items():
            for lines in itertools.chain(*parts):
                if id(lines) not in rows:
                    rows[id(lines)] = self._row(lines)
            lower, upper = ([rows[id(lines)] for lines in side] for side in parts)
            self.sides[literal] = lower, upper
        self._tables: dict[tuple[int, bool], FloatArray] = {}
        self._are_doubles: dict[Literal, bool] = {}
        self._slopes: dict[Literal, tuple[FloatArray, FloatArray]] = {}

    def _row(self, lines: Lines) -> _Row:
        beside = [float(value_at(lines, x)) for x in self.x[self.last_number + 1 :]]
        if self.axis.values:
            at = np.array([float(value_at(lines, x)) for x in self.x])
            return _Row(at, at[:-1], at[1:])
        row = self._exactly(lines) if self._is_exact else self._nearly(lines)
        if not beside:
            return row
        after = np.concatenate([row.after, row.at[-1:], beside[:-1]])
        before = np.concatenate([row.before, beside])
        return _Row(np.concatenate([row.at, beside]), after, before)

    def _exactly(self, lines: Lines) -> _Row:
        start, end = self._first, self._first + self.last_number
        fine = refine(lines, self.axis.bends)
        parts = fine.at[start : end + 1], fine.after[start:end], fine.before[start:end]
        return _Row(*(np.array([float(v) for v in part]) for part in parts))

    def _nearly(self, lines: Lines) -> _Row:
        """Return values that are off by less than is rounded outwards later."""
        parts = (np.array([float(v) for v in part]) for part in lines[1:])
        at, after, before = parts
        x, size = self._floats[: self.last_number + 1], self.last_number + 1
        if len(lines.x) == 1:
            return _Row(*(np.full(n, at[0]) for n in (size, size - 1, size - 1)))
        ends = np.array([self._places[knot] for knot in lines.x]) - self._first
        places = np.arange(size)
        piece = np.clip(np.searchsorted(ends, places, "right") - 1, 0, len(after) - 1)
        a, b = (np.array([float(knot) for knot in lines.x])[piece + k] for k in (0, 1))
        p, q = after[piece], before[piece]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (x - a) / (b - a)
        inside = np.where(p == q, p, p + (q - p) * share)
        is_above = (p >= 0.0) & (q >= 0.0) & (p != q)  # so it is above 0 between them
        inside = np.where(is_above, np.maximum(inside, _TINY), inside)
        off = self._off[:size] + (np.abs(a) + np.abs(b)) * U
        is_far = (p != q) & (np.abs(q - p) * off > (b - a) * _ROUND / 4)
        is_own = np.zeros(size, dtype=bool)
        kept = (ends >= 0) & (ends < size)
        is_own[ends[kept]] = True
        for n in np.flatnonzero(is_far & ~is_own).tolist():
            inside[n] = float(lines.value(self.x[n]))
        whole = inside.copy()
        whole[ends[kept]] = at[kept]
        right, left = inside.copy(), inside.copy()
        first = np.flatnonzero(kept[:-1])
        right[ends[first]] = after[first]
        last = np.flatnonzero(kept[1:])
        left[ends[last + 1]] = before[last]
        return _Row(whole, right[:-1], left[1:])

    def range(
        self, literal: Literal, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of a literal's degrees on stretches of positions."""
        pick = np.minimum if literal.negated else np.maximum
        lower, upper = self.sides[literal]
        least = [self._extreme(row, low, high, is_most=False) for row in lower]
        most = [self._extreme(row, low, high, is_most=True) for row in upper]
        bottom, top = reduce(pick, least), reduce(pick, most)
        if literal not in self._are_doubles:
            self._are_doubles[literal] = self._has_doubles(literal)
        is_flat = self._is_flat(literal, low, high)
        off = np.where(is_flat & self._are_doubles[literal], 0.0, _ROUND)
        return (
            np.where(bottom >= 1.0, 1.0, np.clip(bottom - off, 0.0, None)),
            np.where((top <= 0.0) & is_flat, 0.0, np.maximum(top, 0.0) + off),
        )

    def _is_flat(
        self, literal: Literal, low: FloatArray, high: FloatArray
    ) -> BoolArray:
        """Return whether the values at both ends are those at knots."""
        flat = np.ones(len(low), dtype=bool)
        for row in itertools.chain(*self.sides[literal]) if self.last else ():
            for end in (low, high):
                piece = np.minimum(end.astype(int), self.last - 1)
                is_flat = row.after[piece] == row.before[piece]
                flat &= (end == np.floor(end)) | is_flat
        return flat

    def _has_doubles(self, literal: Literal) -> bool:
        """Return whether degrees at knots are doubles, as far as they are known."""
        every = [*itertools.chain(*self.axis.parts[literal])]
        if not self._is_exact and not self.axis.values:
            return all(lines.is_flat for lines in every)
        xs = self.axis.bends
        fine = every if self.axis.values else [refine(lines, xs) for lines in every]
        values = (v for lines in fine for side in lines[1:] for v in side)
        return all(Fraction(float(v)) == v for v in values)

    def _extreme(
        self, row: _Row, low: FloatArray, high: FloatArray, *, is_most: bool
    ) -> FloatArray:
        at, after, before = row
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
        key = id(row), is_most
        if key not in self._tables:
            extremes = at.copy()
            extremes[:-1] = pick(extremes[:-1], after)
            extremes[1:] = pick(extremes[1:], before)
            self._tables[key] = _runs(extremes, pick)
        extreme = _extremes(self._tables[key], u, v, pick)
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
            _extremes(least, first, last, np.minimum),
            _extremes(most, first, last, np.maximum),
        )

    def _steps(self, literal: Literal) -> tuple[FloatArray, FloatArray]:
        """Return bounds of slopes at knots, in even places, and between them."""
        least = np.full(2 * self.last + 1, np.inf)
        most = -least
        scale = float(-literal.scale if literal.negated else literal.scale)
        parts = zip(*self.axis.parts[literal], literal.functions, strict=True)
        for lower, upper, function in parts:
            for n, (a, b) in enumerate(
                itertools.pairwise(self.x[: self.last_number + 1])
            ):
                ends = outwards(a)[0], outwards(b)[1]
                if lower is upper:
                    slopes = outwards(lower.slope(a))
                else:
                    slope = jet(function, *ends).slope
                    low, high = sorted((slope.low * scale, slope.high * scale))
                    slopes = math.nextafter(low, -np.inf), math.nextafter(high, np.inf)
                least[2 * n + 1] = min(least[2 * n + 1], slopes[0])
                most[2 * n + 1] = max(most[2 * n + 1], slopes[1])
        for low_row, high_row in zip(*self.sides[literal], strict=True):
            (at, after, before), (at_most, after_most, before_most) = low_row, high_row
            most[2::2][at[1:] - before_most > _JUMP] = np.inf
            most[:-1:2][after - at_most[:-1] > _JUMP] = np.inf
            least[2::2][before - at_most[1:] > _JUMP] = -np.inf
            least[:-1:2][at[:-1] - after_most > _JUMP] = -np.inf
        return least, most

    @property
    def jumps(self) -> FloatArray:
        """The knots at which a degree jumps."""
        is_jump = np.zeros(self.last + 1, dtype=bool)
        every = itertools.chain(
            *(side for rows in self.sides.values() for side in rows)
        )
        for at, after, before in () if self.axis.values else every:
            is_jump[:-1] |= at[:-1] != after
            is_jump[1:] |= at[1:] != before
        return np.flatnonzero(is_jump).astype(float)

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


def _extremes(
    runs: FloatArray, first: IntArray, last: IntArray, pick: _Pick
) -> FloatArray:
    """Return extremes from each first to each last neighbour."""
    k = np.log2(last - first + 1).astype(int)
    return pick(runs[k, first], runs[k, last - 2**k + 1])
