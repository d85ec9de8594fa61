"""An axis: a variable with the values that rows can have, and the literals on it.

Degrees along a range are straight lines in fractions, which may jump; a curve lies
between two functions of lines. All literals of an axis share their knots, among them
every place where two of them cross. So between two knots the literals keep their order,
and between two *critical levels* (values at which a line ends, bends or meets another
one, with both limits of all of them at each jump) the ends of the cuts of all literals
keep theirs: one level stands for all between.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, cast

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.rules import Literal
from fuzzytree.auditing.engine.lines import (
    Between,
    Hedged,
    Lines,
    degree_within,
    lines_of,
)
from fuzzytree.model import Curve, MembershipFunction
from fuzzytree.numerics import degree_between

MOST_WHOLE = 64
"""The most whole numbers that are looked at one by one."""

MOST_PIECES = 24
"""Lines of a curve, where levels are asked; boxes take more."""

_MOST_CROSSINGS = 4_000_000  # pairs of lines times pieces


class Masks(NamedTuple):
    """The rules that reach a level on a cell of an axis, as bits.

    Attributes:
        surely: Those whose degree is at least the level, where it is least.
        surely_above: Those above it.
        perhaps: Those that may be at least at it.
        perhaps_above: Those that may be above it.
    """

    surely: int
    surely_above: int
    perhaps: int
    perhaps_above: int


class Cell(NamedTuple):
    """A part of an axis on which no literal passes a level; `x` is a value of it."""

    masks: Masks
    x: Fraction
    is_wide: bool  # whether it has an interior


class Axis:
    """An input, or a sum of inputs, and the literals on it.

    Attributes:
        name: Of the variable.
        weights: The weights of the inputs whose sum it is; of an input itself 1.
        constant: What is added to the sum.
        low: The least value of the range.
        high: The largest one.
        is_open: Whether `low` itself is left out.
        values: The only values, if it has no range.
        extra: Values beside the range: a stand-in for missing values.
        is_whole: Whether rows have whole numbers only.
        literals: The literals, each with the rules that use it, as bits.
    """

    def __init__(
        self,
        name: str,
        weights: dict[str, Fraction],
        constant: Fraction,
        ends: tuple[Fraction, Fraction],
    ) -> None:
        self.name, self.weights, self.constant = name, weights, constant
        self.low, self.high = ends
        self.is_open = self.is_whole = False
        self.values: tuple[Fraction, ...] = ()
        self.extra: tuple[Fraction, ...] = ()
        self.literals: dict[Literal, int] = {}
        self.most_pieces = MOST_PIECES
        self._tables: dict[int, list[Cell]] = {}

    def set_values(self, values: Iterable[Fraction]) -> None:
        """Let rows have only some values."""
        self.values = tuple(sorted(set(values)))
        self.low, self.high = self.values[0], self.values[-1]

    @property
    def is_input(self) -> bool:
        """Whether it is an input itself."""
        return self.weights == {self.name: ONE} and not self.constant

    @property
    def least(self) -> Fraction:
        """The least of all values."""
        return min(self.low, *self.extra) if self.extra else self.low

    @property
    def largest(self) -> Fraction:
        """The largest of all values."""
        return max(self.high, *self.extra) if self.extra else self.high

    def contains(self, x: Fraction) -> bool:
        """Return whether rows can have a value."""
        if self.values:
            return x in self.values
        if x in self.extra:
            return True
        if self.is_whole and x.denominator != 1:
            return False
        return self.low <= x <= self.high and not (self.is_open and x == self.low)

    # --- literals as lines

    @cached_property
    def parts(self) -> dict[Literal, tuple[list[Lines], list[Lines]]]:
        """Of each literal the lower and the upper lines of its functions, with weights.

        It is the largest of them; of a negated literal the least.
        """
        result: dict[Literal, tuple[list[Lines], list[Lines]]] = {}
        for literal in self.literals:
            lower: list[Lines] = []
            upper: list[Lines] = []
            for function in literal.functions:
                both = function_lines(function, self.least, self.largest)
                both = _coarser(both, self.most_pieces)
                if literal.negated:
                    both = both.negated()
                low = _scaled(both.lower, literal.scale)
                lower.append(low)
                high = low if both.is_exact else _scaled(both.upper, literal.scale)
                upper.append(high)
            result[literal] = lower, upper
        return result

    @cached_property
    def is_exact(self) -> bool:
        """Whether all degrees are known exactly."""
        return all(
            a is b
            for lower, upper in self.parts.values()
            for a, b in zip(lower, upper, strict=True)
        )

    @cached_property
    def bounds(self) -> dict[Literal, Between]:
        """Each literal between two functions of lines on the common `knots`."""
        return self._arranged[1]

    @cached_property
    def knots(self) -> tuple[Fraction, ...]:
        """Where literals bend, jump or cross; or all values, if it has no range."""
        return self._arranged[0]

    @cached_property
    def is_crossed(self) -> bool:
        """Whether all crossings are knots, as levels need; not with too many lines."""
        if self.values:
            return True
        count = len({x for one in self._distinct for x in one.x})
        return len(self._distinct) ** 2 * count <= _MOST_CROSSINGS

    @cached_property
    def _distinct(self) -> list[Lines]:
        every = (one for sides in self.parts.values() for side in sides for one in side)
        return [*dict.fromkeys(every)]

    @cached_property
    def _arranged(self) -> tuple[tuple[Fraction, ...], dict[Literal, Between]]:
        ends = {self.low, self.high, self.least, self.largest}
        xs = sorted(ends.union(*(one.x for one in self._distinct)))
        if self.values:
            xs = [*self.values]
            lines = {one: _sampled(one, xs) for one in self._distinct}
        else:
            lines = {one: _refined(one, xs) for one in self._distinct}
            if self.is_crossed:
                more = sorted({*xs, *_crossings([*lines.values()])})
                if len(more) > len(xs):
                    xs = more
                    lines = {one: _refined(on, xs) for one, on in lines.items()}
        result: dict[Literal, Between] = {}
        for literal, (lower, upper) in self.parts.items():
            pick = min if literal.negated else max
            low = _extreme([lines[one] for one in lower], pick)
            is_exact = all(a is b for a, b in zip(lower, upper, strict=True))
            high = low if is_exact else _extreme([lines[one] for one in upper], pick)
            result[literal] = Between(low, high)
        return tuple(xs), result

    # --- levels

    @cached_property
    def levels(self) -> tuple[Fraction, ...]:
        """The critical levels, in order."""
        lines = [*dict.fromkeys(one for two in self.bounds.values() for one in two)]
        values = {v for x in self.extra for one in lines for v in (value_at(one, x),)}
        last = len(self.knots) - 1
        for k in range(last + 1):
            if self.values:
                values.update(one.at[k] for one in lines)
                continue
            around = [
                (one.at[k], *one.before[max(k - 1, 0) : k], *one.after[k : k + 1])
                for one in lines
            ]
            if k in (0, last) or any(len(set(each)) > 1 for each in around):
                values.update(*around)
                continue
            seen: dict[Fraction, int] = {}
            a = self.knots[k] - self.knots[k - 1]
            b = self.knots[k + 1] - self.knots[k]
            for one, (v, *_) in zip(lines, around, strict=True):
                is_bent = (v - one.after[k - 1]) * b != (one.before[k] - v) * a
                seen[v] = seen.get(v, 0) + 1 + is_bent
            values.update(v for v, count in seen.items() if count > 1)
        return tuple(sorted(values))

    def place(self, level: Fraction) -> int:
        """Return the number of a level: odd on a critical one, even between two."""
        at = bisect_left(self.levels, level)
        is_on = at < len(self.levels) and self.levels[at] == level
        return 2 * at + is_on

    def cells(self, place: int) -> list[Cell]:
        """Return the cells of the axis at a level, by its `place`; alike ones once."""
        if place not in self._tables:
            at, is_on = divmod(place, 2)
            if is_on:
                level = self.levels[at]
            elif 0 < at < len(self.levels):
                level = (self.levels[at - 1] + self.levels[at]) / 2
            elif at:
                level = self.levels[-1] + 1
            else:
                level = self.levels[0] - 1 if self.levels else ONE
            kept: dict[tuple[Masks, bool], Cell] = {}
            for cell in self.cells_at(level):
                kept.setdefault((cell.masks, cell.is_wide), cell)
            self._tables[place] = [*kept.values()]
        return self._tables[place]

    def cells_at(self, level: Fraction) -> Iterator[Cell]:
        """Yield all cells at a level."""
        literals = [(users, *self.bounds[one]) for one, users in self.literals.items()]
        every = -1
        for x in self.extra:
            yield Cell(self._masks(literals, x, level), x, is_wide=False)
        for k, x in enumerate(self.knots):
            if not self.values and not self.low <= x <= self.high:
                continue
            if self.values or self.contains(x):
                below = [every] * 4
                for users, low, high in literals:
                    _exclude(below, users, low.at[k], high.at[k], level)
                yield Cell(Masks(*below), x, is_wide=False)
            if not self.values and x < self.high:
                yield from self._between(k, literals, level)

    def _between(
        self, k: int, literals: Sequence[tuple[int, Lines, Lines]], level: Fraction
    ) -> Iterator[Cell]:
        """Yield the cells between two knots."""
        a, b = self.knots[k], self.knots[k + 1]
        cuts: set[Fraction] = set()
        crossing: list[tuple[int, Lines, Lines]] = []
        fixed = [-1] * 4
        for users, low, high in literals:
            passes = False
            for one in (low,) if low is high else (low, high):
                p, q = one.after[k], one.before[k]
                if p < level < q or q < level < p:
                    cuts.add(a + (b - a) * (level - p) / (q - p))
                    passes = True
            if passes:
                crossing.append((users, low, high))
            else:  # within the piece it stays on one side: its middle stands for it
                ends = [(one.after[k] + one.before[k]) / 2 for one in (low, high)]
                _exclude(fixed, users, ends[0], ends[1], level)
        order = [a, *sorted(cuts), b]
        for n, (first, last) in enumerate(itertools.pairwise(order)):
            places = [((first + last) / 2, True)]
            if n:
                places.insert(0, (first, False))
            for x, is_wide in places:
                masks = [*fixed]
                share = (x - a) / (b - a)
                for users, low, high in crossing:
                    values = [
                        one.after[k] + (one.before[k] - one.after[k]) * share
                        for one in (low, high)
                    ]
                    _exclude(masks, users, values[0], values[1], level)
                if self.is_whole:
                    whole = Fraction(math.floor(first) + 1)
                    x = whole if is_wide and whole < last else x
                yield Cell(Masks(*masks), x, is_wide)

    def _masks(
        self,
        literals: Sequence[tuple[int, Lines, Lines]],
        x: Fraction,
        level: Fraction,
    ) -> Masks:
        masks = [-1] * 4
        for users, low, high in literals:
            _exclude(masks, users, value_at(low, x), value_at(high, x), level)
        return Masks(*masks)


def _exclude(
    masks: list[int], users: int, low: Fraction, high: Fraction, level: Fraction
) -> None:
    """Take the rules of a literal out of masks, where its degree does not suffice."""
    if low <= level:
        masks[1] &= ~users
        if low < level:
            masks[0] &= ~users
    if high <= level:
        masks[3] &= ~users
        if high < level:
            masks[2] &= ~users


# --- functions of lines


def function_lines(
    function: MembershipFunction, low: Fraction, high: Fraction
) -> Between:
    """Return a membership function between lines; its height is exact."""
    if isinstance(function, Hedged) and not function.hedges:
        inner = lines_of(function.function, low, high)
        height = Fraction(function.height)
        lower = _scaled(inner.lower, height)
        upper = lower if inner.is_exact else _scaled(inner.upper, height)
        return Between(lower, upper)
    return lines_of(function, low, high)


def degree_bounds(
    function: MembershipFunction, x: Fraction
) -> tuple[Fraction, Fraction]:
    """Return between which fractions a degree lies, closely; equal if it is one."""
    if isinstance(function, Hedged) and not function.hedges:
        low, high = degree_bounds(function.function, x)
        return low * Fraction(function.height), high * Fraction(function.height)
    if isinstance(function, Hedged):
        return degree_within(function, x)
    # The curve of a rule; only `Hedged` is a function that is none.
    bounds = degree_between(cast("Curve", function), x)
    return bounds or degree_within(function, x)


def literal_bounds(literal: Literal, x: Fraction) -> tuple[Fraction, Fraction]:
    """Return between which fractions the degree of a literal lies."""
    every = [degree_bounds(function, x) for function in literal.functions]
    low, high = max(one[0] for one in every), max(one[1] for one in every)
    if literal.negated:
        low, high = 1 - high, 1 - low
    return literal.scale * low, literal.scale * high


def value_at(lines: Lines, x: Fraction) -> Fraction:
    """Return the value of lines at a place, beyond their ends that of the end."""
    if x <= lines.x[0]:
        return lines.at[0]
    if x >= lines.x[-1]:
        return lines.at[-1]
    return lines.value(x)


def _scaled(lines: Lines, by: Fraction) -> Lines:
    if by == ONE:
        return lines
    parts = (tuple(v * by for v in of) for of in lines[1:])
    return Lines(lines.x, *parts)


def _sampled(lines: Lines, xs: Sequence[Fraction]) -> Lines:
    """Return lines at single values."""
    at = tuple(value_at(lines, x) for x in xs)
    return Lines(tuple(xs), at, at[:-1], at[1:])


def _refined(lines: Lines, xs: Sequence[Fraction]) -> Lines:
    """Return lines on more knots."""
    if len(xs) == len(lines.x) and lines.x == tuple(xs):
        return lines
    at: list[Fraction] = []
    after: list[Fraction] = []
    before: list[Fraction] = []
    piece, last = 0, len(lines.x) - 1
    for n, x in enumerate(xs):
        while piece < last and lines.x[piece + 1] <= x:
            piece += 1
        if x == lines.x[piece] or last == 0:
            at.append(lines.at[piece])
        else:
            at.append(_on(lines, piece, x))
        if n + 1 < len(xs):
            if last == 0:
                after.append(lines.at[0])
                before.append(lines.at[0])
            else:
                place = min(piece, last - 1)
                after.append(_on(lines, place, x))
                before.append(_on(lines, place, xs[n + 1]))
    return Lines(tuple(xs), tuple(at), tuple(after), tuple(before))


def _on(lines: Lines, piece: int, x: Fraction) -> Fraction:
    p, q = lines.after[piece], lines.before[piece]
    a, b = lines.x[piece], lines.x[piece + 1]
    return p if p == q or x == a else q if x == b else p + (q - p) * (x - a) / (b - a)


def _extreme(
    every: Sequence[Lines], pick: Callable[[Iterable[Fraction]], Fraction]
) -> Lines:
    """Return the largest or least of lines that cross at knots alone."""
    if len(every) == 1:
        return every[0]
    parts = [
        tuple(pick(values) for values in zip(*(one[n] for one in every), strict=True))
        for n in (1, 2, 3)
    ]
    return Lines(every[0].x, *parts)


def _crossings(every: Sequence[Lines]) -> Iterator[Fraction]:
    """Yield where two lines cross within a piece."""
    xs = every[0].x if every else ()
    for k, (a, b) in enumerate(itertools.pairwise(xs)):
        ends = [*dict.fromkeys((one.after[k], one.before[k]) for one in every)]
        values = sorted({v for pair in ends for v in pair})
        rank = {v: n for n, v in enumerate(values)}
        ranked = sorted((rank[p], rank[q], p, q) for p, q in ends)
        for n, (i, j, p, q) in enumerate(ranked):
            for r, s, u, v in ranked[n + 1 :]:
                if i < r and j > s:
                    yield a + (b - a) * (p - u) / (p - u - q + v)


def _coarser(both: Between, most: int) -> Between:
    """Return a curve between fewer lines, on the same sides."""
    if both.is_exact:
        return both
    return Between(
        _chords(both.lower, most, is_upper=False),
        _chords(both.upper, most, is_upper=True),
    )


def _chords(lines: Lines, most: int, *, is_upper: bool) -> Lines:
    """Return chords over groups of lines, moved outwards as far as need be."""
    count = len(lines.x) - 1
    if count <= most:
        return lines
    cuts = sorted({count * n // most for n in range(most + 1)})
    after: list[Fraction] = []
    before: list[Fraction] = []
    for a, b in itertools.pairwise(cuts):
        p, q = lines.after[a], lines.before[b - 1]
        width, off = lines.x[b] - lines.x[a], ZERO
        for k in range(a, b):
            for place, values in (
                (k, (lines.after[k], lines.at[k])),
                (k + 1, (lines.before[k], lines.at[k + 1])),
            ):
                chord = p + (q - p) * (lines.x[place] - lines.x[a]) / width
                for v in values:
                    off = max(off, v - chord if is_upper else chord - v)
        moved = Fraction(math.ceil(off * 2**20), 2**20) * (1 if is_upper else -1)
        after.append(p + moved)
        before.append(q + moved)
    pick = max if is_upper else min
    at = [
        pick([lines.at[c], *after[n : n + 1], *before[max(n - 1, 0) : n]])
        for n, c in enumerate(cuts)
    ]
    return Lines(
        tuple(lines.x[c] for c in cuts), tuple(at), tuple(after), tuple(before)
    )
