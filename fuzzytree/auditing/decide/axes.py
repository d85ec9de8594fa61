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

import numpy as np

from fuzzytree.auditing.decide.answers import ONE, ZERO, Budget
from fuzzytree.auditing.decide.lines import (
    Between,
    Hedged,
    Lines,
    degree_within,
    lines_of,
    refine,
    value_at,
)
from fuzzytree.auditing.decide.rules import Literal
from fuzzytree.auditing.decide.stretches import Stretches
from fuzzytree.model import Curve, IntArray, MembershipFunction
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
        self.kept: dict[Literal, tuple[list[Lines], list[Lines]]] = {}
        self._tables: dict[int, list[Cell]] = {}
        self._restricted: dict[frozenset[Literal], Axis] = {}

    def set_values(self, values: Iterable[Fraction]) -> None:
        """Let rows have only some values."""
        self.values = tuple(sorted(set(values)))
        self.low, self.high = self.values[0], self.values[-1]

    def with_literals(self, literals: frozenset[Literal]) -> Axis:
        """Return the same axis with some of its literals; it is made once."""
        if literals not in self._restricted:
            axis = Axis(self.name, self.weights, self.constant, (self.low, self.high))
            axis.is_open, axis.is_whole = self.is_open, self.is_whole
            axis.values, axis.extra = self.values, self.extra
            own = {
                literal: users
                for literal, users in self.literals.items()
                if literal in literals
            }
            axis.literals = own
            axis.parts = {literal: self.parts[literal] for literal in own}
            self._restricted[literals] = axis
        return self._restricted[literals]

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
            if literal in self.kept:
                result[literal] = self.kept[literal]
                continue
            lower: list[Lines] = []
            upper: list[Lines] = []
            for function in literal.functions:
                both = function_lines(function, self.least, self.largest)
                both = _coarser(both, self.most_pieces)
                if literal.negated:
                    both = both.complement()
                low = _adjust(both.lower, literal)
                lower.append(low)
                upper.append(low if both.is_exact else _adjust(both.upper, literal))
            result[literal] = self.kept[literal] = lower, upper
        return result

    def peak(self, literal: Literal) -> Fraction:
        """Return a value at which a literal is about as high as it gets."""
        lines = self.parts[literal][0][0]
        if self.values:
            return max(self.values, key=lambda x: value_at(lines, x))
        top = lines.highest
        flat = [(a, b) for a, b, p, q in lines.pieces() if p == q == top]
        spans = flat or [
            (x, x) for x, v in zip(lines.x, lines.at, strict=True) if v == top
        ]
        a, b = max(spans or [(self.low, self.high)], key=lambda span: span[1] - span[0])
        x = (max(a, self.low) + min(b, self.high)) / 2
        near = Fraction(round(x)) if self.is_whole else Fraction(float(x))
        return near if a <= near <= b else x

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
        return self._knots_and_bounds[1]

    @cached_property
    def knots(self) -> tuple[Fraction, ...]:
        """Where literals bend, jump or cross; or all values, if it has no range."""
        return self._knots_and_bounds[0]

    @cached_property
    def bends(self) -> list[Fraction]:
        """Where a function of a literal bends or jumps, and the ends, in order."""
        ends = self.low, self.high, self.least, self.largest
        return _in_order([*ends, *(x for line in self._distinct for x in line.x)])

    @cached_property
    def stretches(self) -> Stretches:
        """The literals on stretches of the axis, in doubles."""
        return Stretches(self)

    def arrange(self, budget: Budget) -> None:
        """Look for crossings and knots, which takes steps at the first time.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        if "_knots_and_bounds" not in vars(self):
            count, size = len(self._distinct), len(self.bends)
            budget.spend(count * size * (10 + (0 if self.values else count // 4)))

    @cached_property
    def is_crossed(self) -> bool:
        """Whether all crossings are knots, as levels need; not with too many lines."""
        if self.values:
            return True
        count = len({x for line in self._distinct for x in line.x})
        return len(self._distinct) ** 2 * count <= _MOST_CROSSINGS

    @cached_property
    def _distinct(self) -> list[Lines]:
        every = (
            line for sides in self.parts.values() for side in sides for line in side
        )
        return _once(every)

    @cached_property
    def _knots_and_bounds(self) -> tuple[tuple[Fraction, ...], dict[Literal, Between]]:
        xs = self.bends
        if self.values:
            xs = [*self.values]
            lines = {id(line): _at_values(line, xs) for line in self._distinct}
        else:
            lines = {id(line): refine(line, xs) for line in self._distinct}
            if self.is_crossed:
                more = [*_crossings([*lines.values()])]
                if more:
                    xs = _in_order([*xs, *more])
                    lines = {name: refine(line, xs) for name, line in lines.items()}
        result: dict[Literal, Between] = {}
        for literal, (lower, upper) in self.parts.items():
            pick = min if literal.negated else max
            low = _extreme([lines[id(line)] for line in lower], pick)
            is_exact = all(a is b for a, b in zip(lower, upper, strict=True))
            high = (
                low if is_exact else _extreme([lines[id(line)] for line in upper], pick)
            )
            result[literal] = Between(low, high)
        return tuple(xs), result

    # --- levels

    @cached_property
    def levels(self) -> tuple[Fraction, ...]:
        """The critical levels, in order."""
        lines = _once(line for both in self.bounds.values() for line in both)
        values = [value_at(line, x) for x in self.extra for line in lines]
        last = len(self.knots) - 1
        for k in range(last + 1):
            if self.values:
                values += [line.at[k] for line in lines]
                continue
            before, after = max(k - 1, 0), min(k, last - 1)
            around = [
                (line.at[k], *line.before[before:k], *line.after[k : k + 1])
                for line in lines
            ]
            if k in (0, last) or any(len({*ends}) > 1 for ends in around):
                values += [v for ends in around for v in ends]
                continue
            a, b = self.knots[k] - self.knots[before], self.knots[k + 1] - self.knots[k]
            seen: dict[Fraction, int] = {}
            for line, (v, *_) in zip(lines, around, strict=True):
                p, q = line.after[before], line.before[after]
                is_bent = p != v if v == q else (v - p) * b != (q - v) * a
                seen[v] = seen.get(v, 0) + 1 + is_bent
            values += [v for v, count in seen.items() if count > 1]
        return tuple(_in_order(values))

    def place(self, level: Fraction) -> int:
        """Return the number of a level: odd on a critical one, even between two."""
        at = bisect_left(self.levels, level)
        is_on = at < len(self.levels) and self.levels[at] == level
        return 2 * at + is_on

    def cells(self, place: int, budget: Budget) -> list[Cell]:
        """Return the cells of the axis at a level, by its `place`; alike ones once.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
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
            for cell in self.cells_at(level, budget):
                kept.setdefault((cell.masks, cell.is_wide), cell)
            self._tables[place] = [*kept.values()]
        return self._tables[place]

    def cells_at(self, level: Fraction, budget: Budget) -> Iterator[Cell]:
        """Yield the cells at a level; of those with equal masks one at least.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        budget.spend(4 * len(self.knots))
        ranks = self._ranks
        rank = ranks.of(level)
        for x in self.extra:
            values = [value_at(line, x) for line in ranks.lines]
            states = [(v > level) - (v < level) for v in values]
            yield Cell(self._masks(states), x, is_wide=False)
        for column, places in _distinct(np.sign(ranks.at - rank)):
            for place in places:
                x = self.knots[place]
                if self.contains(x) and (self.values or self.low <= x <= self.high):
                    yield Cell(self._masks(column), x, is_wide=False)
                    break
        if self.values or len(self.knots) == 1:
            return
        first, last = (bisect_left(self.knots, x) for x in (self.low, self.high))
        after, before = ranks.after[:, first:last], ranks.before[:, first:last]
        states = np.sign(np.sign(after - rank) + np.sign(before - rank))
        passes = np.sign(after - rank) * np.sign(before - rank) < 0
        for k in np.flatnonzero(passes.any(axis=0)).tolist():
            is_cut = passes[:, k].tolist()
            yield from self._cut(first + k, states[:, k].tolist(), is_cut, level)
        plain = np.flatnonzero(~passes.any(axis=0))
        for column, places in _distinct(states[:, plain]):
            x = self._inside(
                (self.knots[first + k], self.knots[first + k + 1])
                for k in plain[places].tolist()
            )
            yield Cell(self._masks(column), x, is_wide=True)

    def _cut(
        self, k: int, states: list[int], is_cut: Sequence[bool], level: Fraction
    ) -> Iterator[Cell]:
        """Yield the cells between two knots, where some literals pass a level."""
        a, b = self.knots[k], self.knots[k + 1]
        cuts: dict[int, tuple[Fraction, int]] = {}
        for n, line in enumerate(self._ranks.lines):
            if is_cut[n]:
                p, q = line.after[k], line.before[k]
                way = 1 if p < q else -1
                cuts[n] = a + (b - a) * (level - p) / (q - p), way
        order = [a, *sorted({cut for cut, _ in cuts.values()}), b]
        for first, last in itertools.pairwise(order):
            if first > a:
                for n, (cut, way) in cuts.items():
                    states[n] = way * ((first > cut) - (first < cut))
                yield Cell(self._masks(states), first, is_wide=False)
            for n, (cut, way) in cuts.items():
                states[n] = way if first >= cut else -way
            x = self._inside([(first, last)])
            yield Cell(self._masks(states), x, is_wide=True)

    def _inside(self, pieces: Iterable[tuple[Fraction, Fraction]]) -> Fraction:
        """Return a value strictly inside of one of some pieces, whole if need be."""
        x = ZERO
        for n, (first, last) in enumerate(pieces):
            x = x if n else (first + last) / 2
            if not self.is_whole:
                break
            if math.floor(first) + 1 < last:
                return Fraction(math.floor(first) + 1)
        return x

    @cached_property
    def _ranks(self) -> _Ranks:
        bounds = [self.bounds[literal] for literal in self.literals]
        lines = [pair.lower for pair in bounds] + [pair.upper for pair in bounds]
        return _Ranks(lines)

    def _masks(self, states: Sequence[int]) -> Masks:
        """Return masks from where each lower and each upper line is: -1 is below."""
        masks = [-1] * 4
        count = len(self.literals)
        for n, users in enumerate(self.literals.values()):
            for place, state in ((0, states[n]), (2, states[count + n])):
                if state <= 0:
                    masks[place + 1] &= ~users
                    if state < 0:
                        masks[place] &= ~users
        return Masks(*masks)


class _Ranks:
    """Values of lines at and between knots, by their place among all of them."""

    def __init__(self, lines: Sequence[Lines]) -> None:
        self.lines = lines
        every = [v for side in (1, 2, 3) for line in lines for v in line[side]]
        self.values, places = _values_and_places(every)
        ranks = 2 * np.array(places, dtype=np.int64) + 1
        count, size = len(lines), len(lines[0].x)
        ends = count * size, count * (2 * size - 1)
        self.at = ranks[: ends[0]].reshape(count, size)
        self.after = ranks[ends[0] : ends[1]].reshape(count, size - 1)
        self.before = ranks[ends[1] :].reshape(count, size - 1)

    def of(self, level: Fraction) -> int:
        """Return the rank of a level: even if it is none of the values."""
        at = bisect_left(self.values, level)
        return 2 * at + (at < len(self.values) and self.values[at] == level)


def _values_and_places(values: Sequence[Fraction]) -> tuple[list[Fraction], list[int]]:
    """Return the different values in order, and the place of each value among them."""
    near = [float(v) for v in values]
    order = sorted(range(len(values)), key=near.__getitem__)
    places, result = [0] * len(values), list[Fraction]()
    for _, group in itertools.groupby(order, key=near.__getitem__):
        some = [*group]
        first = values[some[0]]
        if any(values[n] != first for n in some):  # doubles do not tell them apart
            some.sort(key=values.__getitem__)
        for n in some:
            if not result or values[n] != result[-1]:
                result.append(values[n])
            places[n] = len(result) - 1
    return result, places


def _in_order(values: Sequence[Fraction]) -> list[Fraction]:
    """Return the different values in order."""
    return _values_and_places(values)[0]


def _once(lines: Iterable[Lines]) -> list[Lines]:
    return [*{id(line): line for line in lines}.values()]


def _distinct(columns: IntArray) -> Iterator[tuple[list[int], IntArray]]:
    """Yield the different columns of a table, and where each of them stands."""
    places: dict[bytes, list[int]] = {}
    rows = np.ascontiguousarray(columns.T.astype(np.int8))
    for k, row in enumerate(rows):
        places.setdefault(row.tobytes(), []).append(k)
    for where in places.values():
        yield columns[:, where[0]].tolist(), np.array(where, dtype=np.int64)


# --- functions of lines


def function_lines(
    function: MembershipFunction, low: Fraction, high: Fraction
) -> Between:
    """Return a membership function between lines; its height is exact."""
    if isinstance(function, Hedged) and not function.hedges:
        inner = lines_of(function.function, low, high)
        height = Fraction(function.height)
        lower = _times(inner.lower, height)
        upper = lower if inner.is_exact else _times(inner.upper, height)
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
    low, high = max(low for low, _ in every), max(high for _, high in every)
    if literal.negated:
        low, high = 1 - high, 1 - low
    by = literal.lowered
    return literal.scale * low - by, literal.scale * high - by


def _times(lines: Lines, by: Fraction) -> Lines:
    if by == ONE:
        return lines
    parts = (tuple(v * by for v in of) for of in lines[1:])
    return Lines(lines.x, *parts)


def _adjust(lines: Lines, literal: Literal) -> Lines:
    lines = _times(lines, literal.scale)
    if not literal.lowered:
        return lines
    return lines.minus(literal.lowered)


def _at_values(lines: Lines, xs: Sequence[Fraction]) -> Lines:
    """Return lines at single values."""
    at = tuple(value_at(lines, x) for x in xs)
    return Lines(tuple(xs), at, at[:-1], at[1:])


def _extreme(
    every: Sequence[Lines], pick: Callable[[Iterable[Fraction]], Fraction]
) -> Lines:
    """Return the largest or least of lines that cross at knots alone."""
    if len(every) == 1:
        return every[0]
    parts = [
        tuple(pick(values) for values in zip(*(line[n] for line in every), strict=True))
        for n in (1, 2, 3)
    ]
    return Lines(every[0].x, *parts)


def _crossings(every: Sequence[Lines]) -> Iterator[Fraction]:
    """Yield where two lines cross within a piece."""
    xs = every[0].x if every else ()
    for k, (a, b) in enumerate(itertools.pairwise(xs)):
        ends = [*dict.fromkeys((line.after[k], line.before[k]) for line in every)]
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
