"""The rules of a model on a box, cut into cells: levels, winners and ties.

Ties, under the minimum: around a point of an open set each strength is one function of
one axis. Two of them are equal there only if they are the same function of the same
axis, or constant and equal. Both show in the cells: functions of one rank are one
function, and a constant one has the same level at both ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.recheck.cells import Cell, Function, Levels, Line, cells
from fuzzytree.auditing.recheck.model_records import Clause, Rules, Variable
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.auditing.recheck.polynomials import ONE, ZERO

MOST_SETS = 50_000
TOO_NEAR = "two critical levels are too near to distinguish"
RuleBits = tuple[int, ...]
"""The functions of a rule on each axis, as bits; and how many are repeated."""


Span = list[tuple[int, int, int, int]]
"""Of a cell the rank of each function, the highest first; its bands; its bit."""


class Axis(NamedTuple):
    """A variable: the numbers of the functions of the rules, and its cells."""

    numbers: dict[tuple[Clause, Fraction], int]
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
        shapes = {(v.name, t.name): t.shape for v in rules.variables for t in v.terms}
        every: dict[tuple[Clause, Fraction], Function] = {}
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
        self.patterns: dict[tuple[int, bool], list[set[int]]] = {}

    def _weighted(
        self, when: Iterable[Clause], weight: Fraction
    ) -> list[tuple[Clause, Fraction]]:
        """Return clauses with their weights: all of a minimum, one of a product."""
        return [
            (clause, ONE if place and self.is_product else weight)
            for place, clause in enumerate(when)
        ]

    def bits_of(self, when: Iterable[Clause], weight: Fraction = ONE) -> RuleBits:
        """Return the functions of clauses on each axis, all of which rules have."""
        bits, again = [0] * len(self.axes), 0
        for clause in self._weighted(when, weight):
            for place, axis in enumerate(self.axes):
                if clause in axis.numbers:
                    bit = 1 << axis.numbers[clause]
                    again += bool(bits[place] & bit)
                    bits[place] |= bit
        return (*bits, again)

    def _spans(self, cell: Cell) -> Span:
        band, result = self.levels.band, list[tuple[int, int, int, int]]()
        for number, rank in enumerate(cell.rank):
            one, other = band[cell.left[number]], band[cell.right[number]]
            result.append((rank, min(one, other), max(one, other), 1 << number))
        return sorted(result, key=lambda span: -span[0])

    def sets(self, band: int, *, is_gap: bool) -> list[set[int]]:
        """Return per axis which sets of functions can be at a level or above.

        The level is any between a band and the next one, or any within the band.
        """
        key = (band, is_gap)
        if key not in self.patterns:
            self.patterns[key] = [
                {one for cell in axis.spans for one in _of_cell(cell, band, is_gap)}
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

        That suffices for min and product alike. A rule of several clauses on one
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
        axes: list[set[int]] = []
        for place, sets in enumerate(self.sets(band, is_gap=is_gap)):
            own = mine[place] if mine else 0
            met = [reached for reached in sets if reached & own == own]
            axes.append(
                {bits(of[place] & ~reached for of in rivals) for reached in met}
            )
        return reach(axes, len(rivals))


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
        self.levels: dict[int, list[set[tuple[int, int]]]] = {}

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
                    every = self.grid.sets(band, is_gap=True)
                    axes = [{(reached, 0) for reached in sets} for sets in every]
                    axes[place] = {(above, equal)}
                    if _is_tie((one, other), rivals, axes):
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
            if _is_tie((one, other), rivals, self._at(band)):
                if low < high:
                    raise UndecidedError(TOO_NEAR)
                return True
        return False

    def _flat(self, bits_of_rule: RuleBits) -> set[int]:
        """Return the bands at which a clause stays in some cell."""
        return {
            least
            for place, spans in enumerate(self.wide)
            for cell in spans
            for _, least, most, bit in cell
            if least == most and bits_of_rule[place] & bit
        }

    def _at(self, band: int) -> list[set[tuple[int, int]]]:
        """Return per axis what is above a level in parts of cells, and what at it."""
        if band not in self.levels:
            self.levels[band] = [
                {pair for cell in spans for pair in _patterns(cell, band)}
                for spans in self.wide
            ]
        return self.levels[band]


def _is_tie(
    both: tuple[RuleBits, RuleBits],
    rivals: Sequence[RuleBits],
    axes: Sequence[set[tuple[int, int]]],
) -> bool:
    """Return whether two rules are at a level and no rival is above it.

    `axes`: of each axis, which functions can be above the level, and which at it.
    """
    sets: list[set[int]] = []
    for k, patterns in enumerate(axes):
        own = both[0][k], both[1][k]
        sets.append(
            {
                bits((*(r[k] & ~above for r in rivals), own[0] & equal, own[1] & equal))
                for above, equal in patterns
                if not (own[0] | own[1]) & ~(above | equal)
            }
        )
    return reach(sets, len(rivals) + 2)


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


def _patterns(cell: Span, band: int) -> Iterator[tuple[int, int]]:
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
