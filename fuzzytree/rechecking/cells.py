"""Is there a point at which these rules reach a level that those do not?

Under the minimum a rule reaches a level t if all its propositions do, so the question
falls apart axis by axis once t is known. Each axis is cut into points and open cells in
which all membership functions are lines that do not cross; a function that is no line
has two, a lower and an upper one. The values at the ends of cells are the critical
levels. Between two neighbouring ones nothing changes, so one *gap* between levels after
the other decides: per axis, which propositions can be at t or above together; then,
over all axes, whether each rival misses one of its own somewhere.

With lower and upper lines a `False` is certain and a `True` is not.
"""

from __future__ import annotations

import functools
import itertools
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.rechecking.curves import bounds, is_straight, knots
from fuzzytree.rechecking.models import (
    ONE,
    ZERO,
    Curve,
    Proposition,
    Rule,
    Variable,
)
from fuzzytree.rechecking.outcomes import Limit

Interval = tuple[Fraction, Fraction]
Needs = tuple[int, ...]
"""The propositions of a rule on each axis, as bits."""
Pattern = tuple[int, int]
"""Which propositions can be at a level or above together; which are, for certain."""
Group = tuple[int, int, int, int]
"""Lines of a cell with the same ends: the numbers of their lower and of their higher
level, and the propositions of which they are the upper and the lower line, as bits."""
LINE = 20  # steps that a line of a cell takes
_Line = tuple[Curve, bool, Fraction, bool]
"""A curve, whether it is negated, its weight, and whether it is the upper line."""


class Cell(NamedTuple):
    """A point of an axis, or what lies between two: lines of each proposition.

    Attributes:
        lower: The ends of a line that each proposition is nowhere below.
        upper: The ends of one that it is nowhere above; the same if it is a line.
    """

    low: Fraction
    high: Fraction
    lower: list[Interval]
    upper: list[Interval]

    def part(self, u: Fraction, v: Fraction) -> Cell:
        """Return the part between two shares of its width."""
        low, high = ((1 - w) * self.low + w * self.high for w in (u, v))
        return Cell(low, high, _part(self.lower, u, v), _part(self.upper, u, v))


class Stairs(NamedTuple):
    """A curve that is no line: where each step begins, and what encloses it there."""

    starts: tuple[Fraction, ...]
    degrees: tuple[Interval, ...]

    def at(self, x: Fraction) -> Interval:
        """Return what encloses the degrees of the step from a value on."""
        return self.degrees[bisect_right(self.starts, x) - 1]


@functools.lru_cache(maxsize=512)
def stairs_of(curve: Curve, low: Fraction, high: Fraction, step: int) -> Stairs:
    """Return a curve in steps of degrees no wider than 1 / step."""
    inner = sorted({low, *(x for x in knots(curve) if low < x < high), high})
    todo = [(a, b, 0) for a, b in itertools.pairwise(inner)][::-1] or [(low, low, 0)]
    result: list[tuple[Fraction, Interval]] = []
    while todo:
        a, b, depth = todo.pop()
        least, most = bounds(curve, a, b)
        if (most - least) * step > 1 and depth < 30:
            middle = (a + b) / 2
            todo += [(middle, b, depth + 1), (a, middle, depth + 1)]
        else:
            result.append((a, _rounded(least, most, 2 * step)))
    return Stairs(*zip(*result, strict=True))


def _rounded(low: Fraction, high: Fraction, step: int) -> Interval:
    """Return the ends of an interval on a grid: few levels are fast."""
    whole = Fraction(low * step // 1, step)
    if low and not whole:  # a little, but not nothing
        bits = low.denominator.bit_length() - low.numerator.bit_length()
        whole = Fraction(1, 2 ** (64 * (bits // 64 + 1)))
    return (low, low) if low == high else (whole, -(-high * step // 1) / Fraction(step))


class Axis:
    """A variable: its propositions and cells; and groups of lines with levels."""

    def __init__(
        self,
        variable: Variable,
        ends: Interval,
        propositions: Iterable[Proposition],
        step: int,
        limit: Limit,
    ) -> None:
        self.variable, self.name, self.ends = variable, variable.name, ends
        self.limit = limit
        self.known: dict[tuple[object, ...], int] = {}
        self.propositions: list[Proposition] = []
        for one in propositions:
            if self.known.setdefault(self._key(one), len(self.known)) == len(
                self.propositions
            ):
                self.propositions.append(one)
        curves = [variable.curves[t] for p in self.propositions for t in p.terms]
        self.is_exact = all(map(is_straight, curves))
        self.cells = [*self._cells(step)]
        self.groups: list[list[Group]] = []
        self.marks: list[int] = []
        self.patterns: dict[int, list[Pattern]] = {}

    def _key(self, one: Proposition) -> tuple[object, ...]:
        curves = frozenset(self.variable.curves[term] for term in one.terms)
        return curves, one.negated, one.weight

    def number_of(self, one: Proposition) -> int:
        """Return the number of a proposition."""
        return self.known[self._key(one)]

    def _cells(self, step: int) -> Iterator[Cell]:
        low, high = self.ends
        numbers: dict[_Line, int] = {}
        sides: list[list[list[int]]] = []
        for one in self.propositions:
            curves = [self.variable.curves[term] for term in one.terms]
            both: list[list[int]] = [[], []]
            for c, up in itertools.product(curves, (False, True)):
                line = c, one.negated, one.weight, up and not is_straight(c)
                both[up].append(numbers.setdefault(line, len(numbers)))
            sides.append(both)
        cuts, stairs = {low, high}, dict[Curve, Stairs]()
        for curve, *_ in numbers:
            if is_straight(curve):
                cuts.update(x for x in knots(curve) if low < x < high)
            else:
                stairs[curve] = stairs_of(curve, low, high, step)
                cuts.update(stairs[curve].starts)
        order = sorted(cuts)
        for place, x in enumerate(order):
            for end in order[place : place + 2]:
                lines = [_ends(line, x, end, stairs) for line in numbers]
                for a, b, ends in _uncrossed(x, end, lines):
                    self.limit.spend(LINE * len(lines))
                    yield Cell(a, b, *(self._chosen(ends, sides, k) for k in (0, 1)))

    def _chosen(
        self, ends: Sequence[Interval], sides: Sequence[Sequence[list[int]]], side: int
    ) -> list[Interval]:
        """Return of each proposition the line of the term that is highest."""
        result: list[Interval] = []
        for one, numbers in zip(self.propositions, sides, strict=True):
            choose = min if one.negated else max
            result.append(choose((ends[n] for n in numbers[side]), key=sum))
        return result

    def always_differ(self, one: int, other: int) -> bool:
        """Return whether two propositions are surely on no interval one function."""
        a, b = self.propositions[one], self.propositions[other]
        if a.negated != b.negated or not len(a.terms) == len(b.terms) == 1:
            return False
        p, q = (self.variable.curves[term] for term in (*a.terms, *b.terms))
        is_known = p.kind == q.kind and p.kind in _ANALYTIC
        is_known &= not (p.hedges or q.hedges)
        return is_known and (p, a.weight) != (q, b.weight)

    def number(self, levels: Mapping[Fraction, int]) -> None:
        """Group the lines of each cell, the highest first, by the numbers of levels."""
        marks: set[int] = set()
        for cell in self.cells:
            groups: dict[Interval, list[int]] = {}
            for side, lines in enumerate((cell.upper, cell.lower)):
                for number, ends in enumerate(lines):
                    groups.setdefault(ends, [0, 0])[side] |= 1 << number
            ranges: list[Group] = [
                (levels[min(one)], levels[max(one)], groups[one][0], groups[one][1])
                for one in sorted(groups, key=sum, reverse=True)
            ]
            marks.update(end for one in ranges for end in one[:2])
            self.groups.append(ranges)
        self.marks = sorted(marks)

    def at(self, gap: int) -> list[Pattern]:
        """Return which propositions can be above the gap behind a level together."""
        place = bisect_right(self.marks, gap)
        if place not in self.patterns:
            every = (one for groups in self.groups for one in _chain(groups, gap))
            self.patterns[place] = [*{*every}]
        return self.patterns[place]


def _part(lines: Iterable[Interval], u: Fraction, v: Fraction) -> list[Interval]:
    return [((1 - u) * p + u * q, (1 - v) * p + v * q) for p, q in lines]


def _ends(
    line: _Line, low: Fraction, high: Fraction, stairs: Mapping[Curve, Stairs]
) -> Interval:
    """Return the degrees at both ends of a line that does not bend between them."""
    curve, negated, weight, is_upper = line
    if curve in stairs:
        degree = stairs[curve].at(low)[is_upper is not negated]
        degrees = degree, degree
    elif low == high:
        degrees = bounds(curve, low, low)
    else:
        inner = (2 * low + high) / 3, (low + 2 * high) / 3
        p, q = (bounds(curve, x, x)[0] for x in inner)
        degrees = 2 * p - q, 2 * q - p
    if negated:
        degrees = 1 - degrees[0], 1 - degrees[1]
    return degrees if weight == 1 else (weight * degrees[0], weight * degrees[1])


def _chain(groups: Sequence[Group], gap: int) -> Iterator[Pattern]:
    """Yield which propositions of a cell can be above a gap together."""
    base, crossing = (0, 0), [(0, 0)]
    for low, high, upper, lower in groups:
        if low > gap:
            base = base[0] | upper, base[1] | lower
        elif high > gap:
            crossing.append((crossing[-1][0] | upper, crossing[-1][1] | lower))
    yield from ((base[0] | one[0], base[1] | one[1]) for one in crossing)


def _uncrossed(
    low: Fraction, high: Fraction, lines: list[Interval]
) -> Iterator[tuple[Fraction, Fraction, list[Interval]]]:
    """Yield the parts of a cell in which no two lines cross, with their lines."""
    order = sorted({*lines})
    places: set[Fraction] = set()
    if any(one[1] > other[1] for one, other in itertools.pairwise(order)):
        for one, other in itertools.combinations(order, 2):
            left, right = one[0] - other[0], one[1] - other[1]
            if left * right < 0:
                places.add(left / (left - right))
    for u, v in itertools.pairwise(sorted({ZERO, *places, ONE})):
        a, b = (low + w * (high - low) for w in (u, v))
        if u:
            yield a, a, _part(lines, u, u)
        yield a, b, _part(lines, u, v) if places else lines


class Cells:
    """Rules on a box, cut into cells, and their critical levels in order.

    Attributes:
        of: The propositions of each rule.
        is_exact: Whether all functions are lines.
    """

    def __init__(
        self,
        rules: Sequence[Rule],
        variables: Mapping[str, Variable],
        ends: Mapping[str, Interval],
        levels: Iterable[Fraction],
        step: int,
        limit: Limit,
    ) -> None:
        every = dict.fromkeys(one for rule in rules for one in rule.when)
        self.limit = limit
        self.axes = [
            Axis(v, ends[v.name], own, step, limit)
            for v in variables.values()
            if (own := [one for one in every if one.variable == v.name])
        ]
        cells = [cell for axis in self.axes for cell in axis.cells]
        lines = (line for cell in cells for line in (*cell.lower, *cell.upper))
        self.levels = sorted({ZERO, ONE, *levels, *itertools.chain(*lines)})
        numbers = {level: n for n, level in enumerate(self.levels)}
        for axis in self.axes:
            axis.number(numbers)
        self.is_exact = all(axis.is_exact for axis in self.axes)
        self.of = [self.needs(rule.when) for rule in rules]
        self.all = (1 << len(rules)) - 1
        self.masks: dict[tuple[int, int], int] = {}

    def needs(self, when: Sequence[Proposition]) -> Needs:
        """Return the propositions of a rule on each axis."""
        return tuple(
            sum({1 << axis.number_of(p) for p in when if p.variable == axis.name})
            for axis in self.axes
        )

    def exists(
        self,
        mine: Sequence[Needs],
        rivals: int,
        low: Fraction = ZERO,
        high: Fraction = ONE,
    ) -> bool:
        """Return whether all of some rules can reach a level that no rival does.

        Args:
            mine: The rules.
            rivals: Others, as bits.
            low: The level is above this one, which is a level.
            high: The level is below this one, which is a level.

        Raises:
            UndecidedError: If it takes too many steps.
        """
        first = bisect_left(self.levels, low)
        last = bisect_left(self.levels, high)
        return any(
            self._at(mine, rivals, gap) for gap in range(last - 1, first - 1, -1)
        )

    def _at(
        self,
        mine: Sequence[Needs],
        rivals: int,
        gap: int,
        fixed: Mapping[int, Sequence[Pattern]] | None = None,
    ) -> bool:
        every: list[list[int]] = []
        for place, axis in enumerate(self.axes):
            own = 0
            for one in mine:
                own |= one[place]
            patterns = fixed[place] if fixed and place in fixed else axis.at(gap)
            self.limit.spend(len(patterns))
            masks = (
                self.on(place, certain | own) & rivals
                for possible, certain in patterns
                if not own & ~possible
            )
            every.append(least(masks))
            if not every[-1]:
                return False
        return self._are_missed(rivals, every)

    def _are_missed(self, whole: int, every: Sequence[Sequence[int]]) -> bool:
        """Return whether one mask of each axis can be chosen that have no bit alike."""
        live = [whole]
        for masks in sorted(every, key=len):
            self.limit.spend(len(live) * len(masks))
            live = least(a & b for a in live for b in masks)
        return live == [0]

    def on(self, place: int, bits: int) -> int:
        """Return the rules, as bits, all of whose propositions on an axis are on."""
        if (place, bits) not in self.masks:
            self.masks[place, bits] = sum(
                1 << n for n, one in enumerate(self.of) if not one[place] & ~bits
            )
        return self.masks[place, bits]

    def highest(self, *mine: Needs) -> Fraction:
        """Return the largest level that all of some rules reach together, at most."""
        return self._first(lambda gap: not self._at(mine, 0, gap))

    def least_cover(self) -> Fraction:
        """Return a level that some rule reaches everywhere, the highest known."""
        return self._first(lambda gap: self._at((), self.all, gap))

    def _first(self, is_so: Callable[[int], bool]) -> Fraction:
        """Return the level before the first gap of which something is so."""
        gaps = range(len(self.levels) - 1)
        return self.levels[bisect_left(gaps, 1, key=is_so)]

    def is_bare(self) -> bool:
        """Return whether all rules can be exactly 0 together."""
        every: list[list[int]] = []
        for place, axis in enumerate(self.axes):
            positive = (
                sum(lower for _, high, _, lower in groups if high > 0)
                for groups in axis.groups
            )
            every.append(least(self.on(place, one) for one in positive))
        return self._are_missed(self.all, every)

    def tie(self, one: int, other: int, *, rivals: int) -> bool:
        """Return whether two rules can be equal on an open set, no rival above them.

        On such a set each strength is one function of one axis, the *pivot*: both are
        the same function of the same axis, or both are constant.
        """
        mine = self.of[one], self.of[other]
        return self._moves(mine, rivals) or self._stands(mine, rivals)

    def _moves(self, mine: tuple[Needs, Needs], rivals: int) -> bool:
        for place, axis in enumerate(self.axes):
            pairs = [
                (f, g)
                for f in numbers_in(mine[0][place])
                for g in numbers_in(mine[1][place])
                if f == g or not axis.always_differ(f, g)
            ]
            for cell, groups in zip(axis.cells, axis.groups, strict=True):
                for low, high, line in _pivots(cell, pairs):
                    numbers = [bisect_left(self.levels, end) for end in (low, high)]
                    for gap in range(*numbers):
                        on = _pivot(groups, gap, numbers if line else [])
                        if self._at(mine, rivals, gap, {place: [on]}):
                            return True
        return False

    def _stands(self, mine: tuple[Needs, Needs], rivals: int) -> bool:
        levels = [self._flat(one) for one in mine]
        size = len(self.of)
        for level in sorted((levels[0] & levels[1]) - {0}):
            every: list[list[int]] = []
            for place, axis in enumerate(self.axes):
                own, masks = (mine[0][place], mine[1][place]), set[int]()
                for possible, certain in axis_flats(axis, level):
                    if not (own[0] | own[1]) & ~possible:
                        open_ = [not bits & possible & ~certain for bits in own]
                        mask = self.on(place, certain) & rivals
                        masks.add(mask | open_[0] << size | open_[1] << size + 1)
                every.append(least(masks))
            if self._are_missed(rivals | 3 << size, every):
                return True
        return False

    def _flat(self, mine: Needs) -> set[int]:
        """Return the levels at which a proposition of a rule stays in some cell."""
        return {
            level
            for place, axis in enumerate(self.axes)
            for cell, groups in zip(axis.cells, axis.groups, strict=True)
            for level, high, _, lower in groups
            if cell.low < cell.high and level == high and lower & mine[place]
        }


def _pivots(
    cell: Cell, pairs: Iterable[tuple[int, int]]
) -> set[tuple[Fraction, Fraction, bool]]:
    """Return between which levels two propositions can be one function in a cell.

    True is a line, which both are.
    """
    result: set[tuple[Fraction, Fraction, bool]] = set()
    for f, g in pairs if cell.low < cell.high else ():
        is_line = all(cell.lower[n] == cell.upper[n] for n in (f, g))
        low = max(min(cell.lower[n]) for n in (f, g))
        high = min(max(cell.upper[n]) for n in (f, g))
        if low < high and not (is_line and cell.lower[f] != cell.lower[g]):
            result.add((low, high, is_line))
    return result


def _pivot(groups: Sequence[Group], gap: int, ends: Sequence[int]) -> Pattern:
    """Return what can be at a level in a gap, and what is above it, for certain.

    `ends`: The levels of the line that crosses it there; none if it is not known.
    """
    possible = certain = 0
    is_above = bool(ends)
    for low, high, upper, lower in groups:
        is_pivot = [low, high] == ends
        is_above &= not is_pivot
        if low > gap or (high > gap and (is_above or is_pivot or not ends)):
            possible |= upper
        if low > gap or (high > gap and is_above):
            certain |= lower
    return possible, certain


def axis_flats(axis: Axis, level: int) -> set[Pattern]:
    """Return what can be at a level or above in open cells, and what is above it."""
    result: set[Pattern] = set()
    for cell, groups in zip(axis.cells, axis.groups, strict=True):
        if cell.low < cell.high or axis.ends[0] == axis.ends[1]:
            flat = sum(upper for low, high, upper, _ in groups if low == high == level)
            chained = _chain([one for one in groups if one[1] > level], level - 1)
            result.update((a | flat, b) for a, b in chained)
    return result


_ANALYTIC = ("gaussian", "sigmoid", "bell")


def numbers_in(bits: int) -> list[int]:
    """Return the places of the bits of a number that are 1."""
    return [place for place in range(bits.bit_length()) if bits >> place & 1]


def least(masks: Iterable[int]) -> list[int]:
    """Return the sets, as bits, that contain no other one of them."""
    kept: list[int] = []
    for one in sorted({*masks}, key=int.bit_count):
        if not any(other & one == other for other in kept):
            kept.append(one)
    return kept
