"""Axes cut into cells, and rules on a box of them: levels, winners and ties.

A rule is stronger than some rivals at a point exactly if, at some level t, all of its
propositions are at t or above and each rival has a proposition below t. An axis is cut
where a piece ends, where two degrees cross, and where one turns: in a cell between two
cuts all are monotone and in one order. Their values at cuts are the critical levels;
nothing changes between two of these, so one level there decides for all. Which
propositions can be at t or above together is computed per axis, and combined by `Grid`.

Ties, under the minimum: around a point of an open set each strength is one function of
one axis. Two of them are equal there only if they are the same function of the same
axis, or constant and equal. Both show in the cells: functions of one rank are one
function, and a constant one has the same level at both ends.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from operator import or_
from typing import NamedTuple

from fuzzytree.auditing.recheck.model_records import Proposition, Rules, Shape
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.auditing.recheck.polynomials import (
    ONE,
    ZERO,
    Piece,
    Poly,
    Root,
    at,
    derivative,
    enclosed,
    is_same,
    piece_at,
    pieces,
    plus,
    roots,
    times,
)

MOST_ROOTS, MOST_CRITICAL = 4_000, 4_000
FINE = Fraction(1, 2**50)

End = Root | Fraction
Function = tuple[tuple[Shape, ...], bool, Fraction]
"""The largest of some degrees, or 1 minus it; and what that is multiplied by."""


class Cell(NamedTuple):
    """A part of an axis where functions are in one order: per function, by number."""

    rank: list[int]
    left: list[int]  # the level at its left end
    right: list[int]


class Line(NamedTuple):
    """The values of a variable in the domain."""

    low: Fraction
    high: Fraction


class Levels:
    """The critical levels, numbered as they come, and later by bands."""

    def __init__(self) -> None:
        self.numbers: dict[object, int] = {}
        self.known: list[tuple[Poly, End]] = []
        self.band: list[int] = []
        self.bands: list[tuple[Fraction, Fraction]] = []

    def add(self, poly: Poly, end: End) -> int:
        """Return the number of the level that a polynomial has at an end."""
        if isinstance(end, Root) and (end.low == end.high or len(poly) < 2):
            end = end.low
        if isinstance(end, Fraction):
            poly, end = (at(poly, end),), ZERO
        number = self.numbers.setdefault((poly, end), len(self.known))
        if number == len(self.known):
            self.known.append((poly, end))
        if number > MOST_CRITICAL:
            raise UndecidedError(f"more than {MOST_CRITICAL} critical levels")
        return number

    def sort(self) -> None:
        """Give every level its band: levels that cannot be distinguished share one."""
        order = sorted((*self._bounds(n), n) for n in range(len(self.known)))
        self.band = [0] * len(order)
        for low, high, number in order:
            if not self.bands or low > self.bands[-1][1]:
                self.bands.append((low, high))
            else:
                self.bands[-1] = (self.bands[-1][0], max(high, self.bands[-1][1]))
            self.band[number] = len(self.bands) - 1

    def _bounds(self, number: int) -> tuple[Fraction, Fraction]:
        poly, end = self.known[number]
        if isinstance(end, Fraction):
            return poly[0], poly[0]
        low, high = enclosed(poly, end.low, end.high)
        width = end.high - end.low
        while high - low > FINE:
            width = min(width, end.high - end.low) / 2**16
            end.narrow(width)
            low, high = enclosed(poly, end.low, end.high)
        return low, high


def cells(functions: Sequence[Function], line: Line, levels: Levels) -> list[Cell]:
    """Return the cells of a line, and its lower end as a cell of its own."""
    result: list[Cell] = []
    is_wide = line.low < line.high
    for left, right, polys in stretches(functions, line) if is_wide else ():
        inside = (left.high + right.low) / 2
        ends = [[levels.add(poly, end) for poly in polys] for end in (left, right)]
        result.append(Cell(_ranks([at(poly, inside) for poly in polys]), *ends))
    here = {s: piece_at(s, line.low) for group, *_ in functions for s in group}
    values = [at(_chosen(f, here, line.low), line.low) for f in functions]
    lowest = [levels.add((value,), ZERO) for value in values]
    return [*result, Cell(_ranks(values), lowest, lowest)]


def _ranks(values: Sequence[Fraction]) -> list[int]:
    """Return the place of each value in their order; equal ones share it."""
    order = {value: place for place, value in enumerate(sorted(set(values)))}
    return [order[value] for value in values]


def stretches(
    functions: Sequence[Function], line: Line
) -> Iterator[tuple[Root, Root, list[Poly]]]:
    """Yield the parts of an axis, from left to right, and what functions are there."""
    shapes = dict.fromkeys(shape for group, *_ in functions for shape in group)
    ends = {e for s in shapes for p in pieces(s) for e in p[:2] if e is not None}
    inner = sorted(end for end in ends if line.low < end < line.high)
    cuts = [line.low, *inner, line.high]
    for a, b in itertools.pairwise(cuts):
        here = {shape: piece_at(shape, (a + b) / 2) for shape in shapes}
        low, high = (Root((-end, ONE), end, end) for end in (a, b))
        met = [low, *crossings(_curves(functions, here), a, b), high]
        for left, right in itertools.pairwise(met):
            inside = (left.high + right.low) / 2
            yield left, right, [_chosen(one, here, inside) for one in functions]


def _chosen(function: Function, here: Mapping[Shape, Piece], x: Fraction) -> Poly:
    """Return the polynomial that a function is around x."""
    best: tuple[Fraction, Poly] = (-ONE, ())
    for shape in function[0]:
        piece = here[shape]
        value = at(piece.poly, x)
        part = () if value <= 0 else piece.poly if value < piece.cap else (piece.cap,)
        best = max(best, (at(part, x), part), key=lambda pair: pair[0])
    result = plus((ONE,), best[1], -1) if function[1] else best[1]
    return result if function[2] == 1 else times(result, (function[2],))


def _curves(functions: Sequence[Function], here: Mapping[Shape, Piece]) -> list[Poly]:
    """Return every polynomial that a function can be in a part of the axis."""
    result: dict[Poly, None] = {}
    for group, negated, weight in functions:
        for shape in group:
            for part in (here[shape].poly, (here[shape].cap,), ()):
                one = plus((ONE,), part, -1) if negated else part
                result[one if weight == 1 else times(one, (weight,))] = None
    return list(result)


def crossings(curves: Sequence[Poly], a: Fraction, b: Fraction) -> list[Root]:
    """Return where two of some polynomials cross or one turns, in order."""
    polynomials = dict.fromkeys(derivative(poly) for poly in curves)
    pairs = itertools.combinations(curves, 2)
    polynomials |= dict.fromkeys(plus(one, other, -1) for one, other in pairs)
    if len(polynomials) > MOST_ROOTS:
        text = f"more than {MOST_ROOTS} crossings to look for in one place"
        raise UndecidedError(text)
    met: list[Root] = []
    for poly in polynomials:
        for root in roots(poly, a, b):
            while root.low <= a or root.high >= b:
                root.halve()
            if not any(is_same(root, other) for other in met):
                met.append(root)
    return sorted(met, key=lambda root: root.low)


# --- heights and areas of terms


def height(shape: Shape, line: Line, level: Fraction) -> Fraction:
    """Return the largest degree on a line, from below; exactly at or below a level."""
    levels = Levels()
    mark = levels.add((level,), ZERO)
    result = cells([((shape,), False, ONE)], line, levels)
    levels.sort()
    most = max(levels.band[end] for cell in result for end in (*cell.left, *cell.right))
    bounds = levels.bands[most]
    if most == levels.band[mark] and bounds[0] < bounds[1]:
        raise UndecidedError("a height is too near to the level to decide")
    return bounds[0] if most <= levels.band[mark] else max(bounds[0], level)


def shared(one: Shape, other: Shape, line: Line) -> tuple[Fraction, Fraction] | None:
    """Return between which numbers the integral of min by that of max lies."""
    least = most = slack = ZERO
    if line.low == line.high:
        return None
    both = [((one,), False, ONE), ((other,), False, ONE)]
    for left, right, curves in stretches(both, line):
        for root in (left, right):
            root.narrow(FINE * (line.high - line.low))
            slack += root.high - root.low
        a, b = left.high, right.low
        inside = (a + b) / 2
        order = sorted(curves, key=lambda poly: at(poly, inside))
        wholes = [(ZERO, *(c / n for n, c in enumerate(p, 1))) for p in order]
        areas = [at(whole, b) - at(whole, a) for whole in wholes]
        least, most = least + areas[0], most + areas[1]
    return (least / (most + slack), (least + slack) / most) if most else None


MOST_SETS = 50_000
TOO_NEAR = "two critical levels are too near to distinguish"
RuleBits = tuple[int, ...]
"""The functions of a rule on each axis, as bits; and how many are repeated."""


Pattern = tuple[int, int]
"""The functions that are above a level, or at it where none stays; those that stay."""

Span = list[tuple[int, int, int, int]]
"""Of a cell the rank of each function, the highest first; its bands; its bit."""


class Axis(NamedTuple):
    """A variable: the numbers of the functions of the rules, and its cells."""

    numbers: dict[tuple[Proposition, Fraction], int]
    cells: list[Cell]
    spans: list[Span]


class Grid:
    """Rules on a box, cut into cells, with their critical levels in order."""

    def __init__(
        self,
        rules: Rules,
        lines: Mapping[str, Line],
        extra: Iterable[Fraction],
        weights: Sequence[Fraction],
    ) -> None:
        self.is_product = rules.semantics.conjunction == "product"
        self.levels = Levels()
        self.marks = {one: self.levels.add((one,), ZERO) for one in (ZERO, ONE, *extra)}
        self.axes: list[Axis] = []
        shapes = {
            (v.name, t.name): t.function for v in rules.variables for t in v.terms
        }
        every: dict[tuple[Proposition, Fraction], Function] = {}
        for rule, weight in zip(rules.rules, weights, strict=True):
            for c, w in self._weighted(rule.when, weight):
                group = tuple(shapes[c.variable, term] for term in c.terms)
                every[c, w] = group, c.negated, w
        for variable in rules.variables:
            of = {
                one: f for one, f in every.items() if one[0].variable == variable.name
            }
            known = [*dict.fromkeys(of.values())]
            if known:
                result = cells(known, lines[variable.name], self.levels)
                numbers = {one: known.index(f) for one, f in of.items()}
                self.axes.append(Axis(numbers, result, []))
        self.levels.sort()
        for axis in self.axes:
            axis.spans.extend(map(self._spans, axis.cells))
        pairs = zip(rules.rules, weights, strict=True)
        self.of = [self.bits_of(rule.when, weight) for rule, weight in pairs]
        self.patterns: dict[tuple[int, bool], list[set[Pattern]]] = {}

    def _weighted(
        self, when: Iterable[Proposition], weight: Fraction
    ) -> list[tuple[Proposition, Fraction]]:
        """Return propositions and their weights: all of a minimum, one of a product."""
        return [
            (proposition, ONE if place and self.is_product else weight)
            for place, proposition in enumerate(when)
        ]

    def bits_of(self, when: Iterable[Proposition], weight: Fraction = ONE) -> RuleBits:
        """Return the functions on each axis that all of some rules have."""
        bits, again = [0] * len(self.axes), 0
        for proposition in self._weighted(when, weight):
            for place, axis in enumerate(self.axes):
                if proposition in axis.numbers:
                    bit = 1 << axis.numbers[proposition]
                    again += bool(bits[place] & bit)
                    bits[place] |= bit
        return (*bits, again)

    def _spans(self, cell: Cell) -> Span:
        band, result = self.levels.band, list[tuple[int, int, int, int]]()
        for number, rank in enumerate(cell.rank):
            one, other = band[cell.left[number]], band[cell.right[number]]
            result.append((rank, min(one, other), max(one, other), 1 << number))
        return sorted(result, key=lambda span: -span[0])

    def sets(self, band: int, *, is_gap: bool) -> list[set[Pattern]]:
        """Return per axis which sets of functions can be at a level or above.

        The level is any between a band and the next one, or any within the band.
        """
        key = (band, is_gap)
        if key not in self.patterns:
            self.patterns[key] = [
                {
                    (reached, 0)
                    for cell in axis.spans
                    for reached in _of_cell(cell, band, is_gap)
                }
                for axis in self.axes
            ]
        return self.patterns[key]

    def wins(self, mine: RuleBits, rivals: Sequence[RuleBits]) -> bool:
        """Return whether a rule is somewhere stronger than each rival.

        Variables are free of each other.

        Raises:
            UndecidedError: If it is too much, or levels are too near to distinguish.
        """
        bands = self.levels.bands
        work = len(bands) * sum(len(a.cells) for a in self.axes) * (1 + len(rivals))
        if work > 6_000_000:
            raise UndecidedError(f"too large to decide again here: {work:,} steps")
        if any(self.leaves(mine, rivals, band) for band in range(len(bands) - 1)):
            return True
        for band, (low, high) in enumerate(bands):
            if low < high and self.leaves(mine, rivals, band, is_gap=False):
                raise UndecidedError(TOO_NEAR)
        return False

    def fires(self, mine: RuleBits) -> bool:
        """Return whether a rule is above 0 somewhere: on each axis in some cell."""
        bits_of_rule = zip(self.axes, mine[:-1], strict=True)
        every = ((self._zeros(axis, is_vague=False), own) for axis, own in bits_of_rule)
        return all(any(not own & zeros for zeros in sets) for sets, own in every)

    def is_bare(self, rules: Sequence[RuleBits]) -> bool | None:
        """Return whether all rules are somewhere exactly 0; None if it is not known."""
        result: list[bool] = []
        for is_vague in (False, True):
            every = [self._zeros(axis, is_vague=is_vague) for axis in self.axes]
            axes = [
                {bits(of[place] & zeros for of in rules) for zeros in sets}
                for place, sets in enumerate(every)
            ]
            result.append(reach(axes, len(rules)))
        return result[0] if result[0] == result[1] else None

    def _zeros(self, axis: Axis, *, is_vague: bool) -> set[int]:
        """Return which functions are 0 together: in a cell, or at its right end."""
        band, zero = self.levels.band, self.marks[ZERO]
        low, high = self.levels.bands[band[zero]]
        near = [number for number, one in enumerate(band) if one == band[zero]]
        ends = {zero, *near} if is_vague or low == high else {zero}
        result: set[int] = set()
        for cell in axis.cells:
            pairs = zip(cell.left, cell.right, strict=True)
            result.add(bits(pair == (zero, zero) for pair in pairs))
            result.add(bits(end in ends for end in cell.right))
        return result

    def gap(self, level: Fraction, *, is_above: bool) -> int:
        """Return the band whose gap is just above or just below an extra level."""
        return self.levels.band[self.marks[level]] - (not is_above)

    def is_below(self, mine: RuleBits, theirs: RuleBits) -> bool:
        """Return whether a rule's degree is nowhere above a rival's, on every axis.

        That suffices for min and product alike. A rule of several propositions on one
        variable is not looked at.
        """
        if mine[-1] or theirs[-1]:
            return False
        for axis, own, other in zip(self.axes, mine[:-1], theirs[:-1], strict=True):
            if max(own.bit_count(), other.bit_count()) > 1:
                return False
            one, two = own.bit_length() - 1, other.bit_length() - 1
            for cell in axis.cells if other else ():
                ends = [self.levels.known[end[two]] for end in (cell.left, cell.right)]
                is_one = ends == [((ONE,), ZERO)] * 2
                if not is_one and (not own or cell.rank[one] > cell.rank[two]):
                    return False
        return True

    def leaves(
        self,
        mine: RuleBits | None,
        rivals: Sequence[RuleBits],
        band: int,
        *,
        is_gap: bool = True,
    ) -> bool:
        """Return whether at a level a rule can be there and each rival below."""
        return _are_at([mine] if mine else [], rivals, self.sets(band, is_gap=is_gap))


def _of_cell(cell: Span, band: int, is_gap: bool) -> list[int]:
    """Return which functions can be at a level or above in parts of a cell."""
    base, crossing, last = 0, 0, -1
    every: list[int] = []
    for rank, least, most, bit in cell:
        if least > band:
            base |= bit
        elif most > band or (most == band and not is_gap):
            if rank != last and crossing:
                every.append(crossing)
            crossing, last = crossing | bit, rank
    return [base, *(base | one for one in every), base | crossing]


def bits(flags: Iterable[int]) -> int:
    """Return a number whose n-th bit is the n-th flag."""
    return sum(1 << place for place, flag in enumerate(flags) if flag)


def reach(axes: Iterable[set[int]], count: int) -> bool:
    """Return whether a set of each axis, taken together, can hold all of `count`.

    Raises:
        UndecidedError: If there are too many ways to take them.
    """
    live = {0}
    for sets in axes:
        live = _largest(a | b for a in live for b in _largest(sets))
        if len(live) > MOST_SETS:
            raise UndecidedError(f"more than {MOST_SETS} sets of rivals")
    return (1 << count) - 1 in live


def _largest(sets: Iterable[int]) -> set[int]:
    """Return the sets, as bits, that no other one contains."""
    kept: list[int] = []
    for one in sorted(set(sets), key=lambda bits: -bits.bit_count()):
        if all(one | other != other for other in kept):
            kept.append(one)
    return set(kept)


# --- ties

MOST_STEPS = 400_000


class Ties:
    """The pairs of rules that tie; all of them together take so many steps at most."""

    def __init__(self, grid: Grid) -> None:
        self.grid, self.left = grid, MOST_STEPS
        self.wide = [axis.spans[:-1] or axis.spans for axis in grid.axes]
        self.lowest = grid.levels.band[grid.marks[ZERO]]
        self.levels: dict[int, list[set[Pattern]]] = {}

    def tie(self, one: RuleBits, other: RuleBits, rivals: Sequence[RuleBits]) -> bool:
        """Return whether both are equal on an open set, and no rival is stronger.

        Inputs are free of each other.

        Raises:
            UndecidedError: If it is too much, or levels are too near to distinguish.
        """
        return self._moves(one, other, rivals) or self._stands(one, other, rivals)

    def _step(self, size: int) -> None:
        self.left -= size
        if self.left < 0:
            raise UndecidedError(f"ties that take more than {MOST_STEPS:,} steps")

    def _moves(
        self, one: RuleBits, other: RuleBits, rivals: Sequence[RuleBits]
    ) -> bool:
        """Return whether both follow one function of one axis."""
        for place, spans in enumerate(self.wide):
            own = one[place], other[place]
            for cell in spans if all(own) else ():
                for band, above, equal in _shared(cell, *own):
                    self._step(1 + len(rivals))
                    if (own[0] | own[1]) & ~(above | equal):
                        continue
                    axes = [*self.grid.sets(band, is_gap=True)]
                    axes[place] = {(above, equal)}
                    if _are_at((one, other), rivals, axes, is_tie=True):
                        return True
        return False

    def _stands(
        self, one: RuleBits, other: RuleBits, rivals: Sequence[RuleBits]
    ) -> bool:
        """Return whether both are constant, at one level."""
        flat = self._flat(one) & self._flat(other)
        for band in sorted(flat - {self.lowest}):
            self._step(len(self.wide) * (1 + len(rivals)))
            low, high = self.grid.levels.bands[band]
            if _are_at((one, other), rivals, self._at(band), is_tie=True):
                if low < high:
                    raise UndecidedError(TOO_NEAR)
                return True
        return False

    def _flat(self, bits_of_rule: RuleBits) -> set[int]:
        """Return the bands at which a proposition stays in some cell."""
        return {
            least
            for place, spans in enumerate(self.wide)
            for cell in spans
            for _, least, most, bit in cell
            if least == most and bits_of_rule[place] & bit
        }

    def _at(self, band: int) -> list[set[Pattern]]:
        """Return per axis what is above a level in parts of cells, and what at it."""
        if band not in self.levels:
            self.levels[band] = [
                {pair for cell in spans for pair in _patterns(cell, band)}
                for spans in self.wide
            ]
        return self.levels[band]


def _are_at(
    rules: Sequence[RuleBits],
    rivals: Sequence[RuleBits],
    axes: Sequence[set[Pattern]],
    *,
    is_tie: bool = False,
) -> bool:
    """Return whether rules can be at a level, in a tie exactly, and no rival above it.

    `axes`: of each axis, which functions can be above the level, and which at it.
    """
    sets: list[set[int]] = []
    ties = rules if is_tie else ()
    for k, patterns in enumerate(axes):
        own = reduce(or_, (rule[k] for rule in rules), 0)
        met = [one for one in patterns if not own & ~(one[0] | one[1])]
        flags = [
            [*(r[k] & ~above for r in rivals), *(r[k] & equal for r in ties)]
            for above, equal in met
        ]
        sets.append({*map(bits, flags)})
    return reach(sets, len(rivals) + len(ties))


def _shared(cell: Span, one: int, other: int) -> Iterator[tuple[int, int, int]]:
    """Yield each band that functions of both rules cross as one.

    With it: the functions that are above the level there, and those that are at it.
    """
    groups: dict[int, tuple[int, int, int]] = {}
    for rank, least, most, bit in cell:
        groups[rank] = least, most, groups.get(rank, (0, 0, 0))[2] | bit
    for rank, (least, most, equal) in groups.items():
        if not (equal & one and equal & other):
            continue
        for band in range(least, most):
            above = 0
            for k, low, high, bit in cell:
                if low > band or (high > band and k > rank):
                    above |= bit
            yield band, above & ~equal, equal


def _patterns(cell: Span, band: int) -> Iterator[Pattern]:
    """Yield which functions are above a level in parts of a cell, and which at it."""
    above = equal = 0
    for _, least, most, bit in cell:
        above |= bit if least >= band and most > band else 0
        equal |= bit if least == most == band else 0
    yield above, equal
    last = -1
    for rank, least, most, bit in cell:
        if least < band < most:
            if last not in (-1, rank):
                yield above, equal
            above, last = above | bit, rank
    yield above, equal
