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

import itertools
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.recheck.curves import bounds, is_straight, knots
from fuzzytree.auditing.recheck.models import (
    ONE,
    ZERO,
    Curve,
    Proposition,
    Rule,
    Variable,
)
from fuzzytree.auditing.recheck.outcomes import UndecidedError

MOST_LINES, MOST_STEPS = 60_000, 1_000_000
Interval = tuple[Fraction, Fraction]
Needs = tuple[int, ...]
"""The propositions of a rule on each axis, as bits."""
Pattern = tuple[int, int]
"""Which propositions can be at a level or above together; which are, for certain."""


class Cell(NamedTuple):
    """A point of an axis, or what lies between two: of each line its two ends."""

    low: Fraction
    high: Fraction
    lines: list[Interval]


class Function(NamedTuple):
    """A proposition on its axis: the numbers of its lower and of its upper lines."""

    proposition: Proposition
    lower: tuple[int, ...]
    upper: tuple[int, ...]

    def ends(self, cell: Cell, *, is_upper: bool) -> Interval:
        """Return its degrees at both ends of a cell."""
        numbers = self.upper if is_upper else self.lower
        if len(numbers) == 1:
            return cell.lines[numbers[0]]
        lines = [cell.lines[n] for n in numbers]
        return min(lines, key=sum) if self.proposition.negated else max(lines, key=sum)


class Axis:
    """A variable: its propositions and cells; and groups of lines with levels."""

    def __init__(
        self,
        variable: Variable,
        ends: Interval,
        propositions: Iterable[Proposition],
        step: int,
    ) -> None:
        self.variable, self.name, self.ends = variable, variable.name, ends
        self.functions: list[Function] = []
        self.known: dict[tuple[object, ...], int] = {}
        self.lines: dict[tuple[Curve, bool, Fraction, bool], int] = {}
        self.is_exact = True
        for one in propositions:
            curves = [variable.curves[term] for term in one.terms]
            key = (frozenset(curves), one.negated, one.weight)
            if key in self.known:
                continue
            self.known[key] = len(self.functions)
            sides: list[tuple[int, ...]] = []
            for is_upper in (False, True):
                numbers: list[int] = []
                for c in curves:
                    line = c, *key[1:], is_upper and not is_straight(c)
                    numbers.append(self.lines.setdefault(line, len(self.lines)))
                sides.append(tuple(numbers))
            self.is_exact &= all(map(is_straight, curves))
            self.functions.append(Function(one, *sides))
        self.cells = [*self._cells(step)]
        self.groups: list[list[tuple[int, int, int]]] = []
        self.marks: list[int] = []
        self.patterns: dict[int, list[Pattern]] = {}

    def function(self, curve: Curve) -> Function:
        """Return the proposition that is a curve alone."""
        return self.functions[self.known[frozenset([curve]), False, ONE]]

    def _cells(self, step: int) -> Iterator[Cell]:
        low, high = self.ends
        curves = [*dict.fromkeys(curve for curve, *_ in self.lines)]
        cuts = {low, high}
        steps: dict[Curve, list[tuple[Fraction, Interval]]] = {}
        for curve in curves:
            inner = sorted({low, *(x for x in knots(curve) if low < x < high), high})
            cuts.update(inner)
            if not is_straight(curve):
                steps[curve] = [*_stairs(curve, inner, step)]
                cuts.update(x for x, _ in steps[curve])
            if len(cuts) * len(self.lines) > MOST_LINES:
                raise UndecidedError(f"more than {MOST_LINES:,} lines in cells")
        order, room = sorted(cuts), MOST_LINES
        for place, x in enumerate(order):
            yield Cell(x, x, [self._ends(line, x, x, steps) for line in self.lines])
            if x < high:
                end = order[place + 1]
                whole = Cell(x, end, [self._ends(n, x, end, steps) for n in self.lines])
                for cell in _uncrossed(whole):
                    room -= len(cell.lines)
                    if room < 0:
                        raise UndecidedError(f"more than {MOST_LINES:,} lines in cells")
                    yield cell

    def _ends(
        self,
        line: tuple[Curve, bool, Fraction, bool],
        low: Fraction,
        high: Fraction,
        steps: Mapping[Curve, list[tuple[Fraction, Interval]]],
    ) -> Interval:
        """Return the degrees at both ends of a line that does not bend between them."""
        curve, negated, weight, is_upper = line
        if curve in steps:
            place = bisect_right(steps[curve], low, key=lambda pair: pair[0]) - 1
            one = steps[curve][place][1][is_upper is not negated]
            degrees = one, one
        elif low == high:
            degrees = bounds(curve, low, low)
        else:
            p, q = (
                bounds(curve, x, x)[0]
                for x in ((2 * low + high) / 3, (low + 2 * high) / 3)
            )
            degrees = 2 * p - q, 2 * q - p
        if negated:
            degrees = 1 - degrees[0], 1 - degrees[1]
        return weight * degrees[0], weight * degrees[1]

    def number(self, levels: Mapping[Fraction, int]) -> None:
        """Group the lines of each cell, the highest first, by the numbers of levels."""
        marks: set[int] = set()
        for cell in self.cells:
            groups: dict[Interval, int] = {}
            for bit, ends in enumerate(cell.lines):
                groups[ends] = groups.get(ends, 0) | 1 << bit
            order = sorted(groups, key=sum, reverse=True)
            ranges = [
                (levels[min(one)], levels[max(one)], groups[one]) for one in order
            ]
            marks.update(end for one in ranges for end in one[:2])
            self.groups.append(ranges)
        self.marks = sorted(marks)

    def at(self, gap: int) -> list[Pattern]:
        """Return which propositions can be above the gap behind a level together."""
        place = bisect_right(self.marks, gap)
        if place not in self.patterns:
            sets = {one for groups in self.groups for one in _chain(groups, gap)}
            self.patterns[place] = [*{self.pattern(one, one) for one in sets}]
        return self.patterns[place]

    def pattern(self, possible: int, certain: int) -> Pattern:
        """Return the propositions whose lines are among some, given as bits."""
        result = [0, 0]
        for number, one in enumerate(self.functions):
            choose = all if one.proposition.negated else any
            for side, lines, bits in (
                (0, one.upper, possible),
                (1, one.lower, certain),
            ):
                if choose(bits >> line & 1 for line in lines):
                    result[side] |= 1 << number
        return result[0], result[1]


def _chain(groups: Sequence[tuple[int, int, int]], gap: int) -> Iterator[int]:
    """Yield which lines of a cell can be above a gap together."""
    base, crossing = 0, [0]
    for low, high, bits in groups:
        if low > gap:
            base |= bits
        elif high > gap:
            crossing.append(crossing[-1] | bits)
    yield from (base | one for one in crossing)


def _uncrossed(cell: Cell) -> Iterator[Cell]:
    """Yield the parts of a cell in which no two lines cross."""
    order = sorted(cell.lines)
    places: set[Fraction] = set()
    if any(one[1] > other[1] for one, other in itertools.pairwise(order)):
        for one, other in itertools.combinations({*order}, 2):
            left, right = one[0] - other[0], one[1] - other[1]
            if left * right < 0:
                places.add(left / (left - right))
    for u, v in itertools.pairwise(sorted({ZERO, *places, ONE})):
        ends = [(p + u * (q - p), p + v * (q - p)) for p, q in cell.lines]
        a, b = (cell.low + w * (cell.high - cell.low) for w in (u, v))
        if u:
            yield Cell(a, a, [(one, one) for one, _ in ends])
        yield Cell(a, b, ends)


def _stairs(
    curve: Curve, inner: Sequence[Fraction], step: int
) -> Iterator[tuple[Fraction, Interval]]:
    """Yield where each step of a curve begins, and the degrees that enclose it."""
    todo = [(a, b, 0) for a, b in itertools.pairwise(inner)][::-1]
    while todo:
        a, b, depth = todo.pop()
        low, high = bounds(curve, a, b)
        if (high - low) * step > 1 and depth < 30:
            middle = (a + b) / 2
            todo += [(middle, b, depth + 1), (a, middle, depth + 1)]
            continue
        whole = Fraction(low * step * 2 // 1, step * 2)
        if low and not whole:  # a little, but not nothing
            bits = low.denominator.bit_length() - low.numerator.bit_length()
            whole = Fraction(1, 2 ** (64 * (bits // 64 + 1)))
        yield (
            a,
            (
                low if low == high else whole,
                high if low == high else -(-high * step * 2 // 1) / Fraction(step * 2),
            ),
        )


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
        levels: Iterable[Fraction] = (),
        step: int = 16,
    ) -> None:
        every = dict.fromkeys(one for rule in rules for one in rule.when)
        self.variables = variables
        self.axes = [
            Axis(v, ends[v.name], (p for p in every if p.variable == v.name), step)
            for v in variables.values()
            if any(p.variable == v.name for p in every)
        ]
        lines = (line for axis in self.axes for c in axis.cells for line in c.lines)
        self.levels = sorted({ZERO, ONE, *levels, *itertools.chain(*lines)})
        numbers = {level: n for n, level in enumerate(self.levels)}
        for axis in self.axes:
            axis.number(numbers)
        self.is_exact = all(axis.is_exact for axis in self.axes)
        self.of = [self.needs(rule.when) for rule in rules]
        self.all = (1 << len(rules)) - 1
        self.left = MOST_STEPS
        self.masks: dict[tuple[int, int], int] = {}

    def needs(self, when: Iterable[Proposition]) -> Needs:
        """Return the propositions of a rule on each axis."""
        bits = dict.fromkeys((axis.name for axis in self.axes), 0)
        for proposition in when:
            axis = next(axis for axis in self.axes if axis.name == proposition.variable)
            curves = frozenset(
                self.variables[axis.name].curves[t] for t in proposition.terms
            )
            bits[axis.name] |= (
                1 << axis.known[curves, proposition.negated, proposition.weight]
            )
        return tuple(bits.values())

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
            self.left -= len(patterns)
            every.append(
                least(
                    self.on(place, certain | own) & rivals
                    for possible, certain in patterns
                    if not own & ~possible
                )
            )
            if not every[-1]:
                return False
        live = [rivals]
        for masks in sorted(every, key=len):
            self.left -= len(live) * len(masks)
            if self.left < 0:
                raise UndecidedError(f"more than {MOST_STEPS:,} steps")
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
        low, high = 0, len(self.levels) - 1
        while low < high:  # the gap below `high` may be reached, that above is not
            gap = (low + high) // 2
            if self._at(mine, 0, gap):
                low = gap + 1
            else:
                high = gap
        return self.levels[low]

    def least_cover(self) -> Fraction:
        """Return a level that some rule reaches everywhere, the highest known."""
        low, high = 0, len(self.levels) - 1
        while low < high:
            gap = (low + high) // 2
            if self._at((), self.all, gap):
                high = gap
            else:
                low = gap + 1
        return self.levels[low]

    def is_bare(self) -> bool:
        """Return whether all rules can be exactly 0 together."""
        every: list[list[int]] = []
        for place, axis in enumerate(self.axes):
            masks: set[int] = set()
            straight = bits_of(is_straight(line[0]) for line in axis.lines)
            for groups in axis.groups:
                lines = sum(bits for _, high, bits in groups if high > 0) & straight
                lines |= sum(bits for low, _, bits in groups if low > 0)
                masks.add(self.on(place, axis.pattern(lines, lines)[1]))
            every.append(least(masks))
        live = [self.all]
        for masks_ in every:
            live = least(a & b for a in live for b in masks_)
        return live == [0]

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
                for f, g in itertools.product(
                    *(
                        [f for n, f in enumerate(axis.functions) if one[place] >> n & 1]
                        for one in mine
                    )
                )
                if f == g
                or not _always_differ(f.proposition, g.proposition, axis.variable)
            ]
            for cell, groups in zip(axis.cells, axis.groups, strict=True):
                if cell.low == cell.high:
                    continue
                ranges = set()
                for f, g in pairs:
                    ends = [
                        [one.ends(cell, is_upper=up) for up in (False, True)]
                        for one in (f, g)
                    ]
                    is_line = all(low == high for low, high in ends)
                    if is_line and ends[0] != ends[1]:
                        continue
                    low = max(min(lower) for lower, _ in ends)
                    high = min(max(upper) for _, upper in ends)
                    if low < high:
                        ranges.add((low, high, ends[0][0] if is_line else None))
                for low, high, line in ranges:
                    for gap in range(
                        bisect_left(self.levels, low), bisect_left(self.levels, high)
                    ):
                        fixed = {place: [self._pivot(axis, cell, groups, gap, line)]}
                        if self._at(mine, rivals, gap, fixed):
                            return True
        return False

    def _pivot(
        self,
        axis: Axis,
        cell: Cell,
        groups: Sequence[tuple[int, int, int]],
        gap: int,
        line: Interval | None,
    ) -> Pattern:
        """Return what can be at a level where a line crosses it, and what is above."""
        possible = certain = 0
        pivot = 0 if line is None else 1 << cell.lines.index(line)
        is_above = line is not None
        for low, high, bits in groups:
            is_pivot = bool(bits & pivot)
            is_above &= not is_pivot
            is_on = high > gap and (is_above or line is None or low > gap or is_pivot)
            possible |= bits if is_on else 0
            certain |= bits if low > gap or (is_above and high > gap) else 0
        return axis.pattern(possible, certain)

    def _stands(self, mine: tuple[Needs, Needs], rivals: int) -> bool:
        levels = [self._flat(one) for one in mine]
        for level in sorted((levels[0] & levels[1]) - {0}):
            every: list[list[int]] = []
            size = len(self.of)
            for place, axis in enumerate(self.axes):
                masks: set[int] = set()
                for possible, certain, equal in axis_flats(axis, level):
                    if (mine[0][place] | mine[1][place]) & ~possible:
                        continue
                    mask = self.on(place, certain) & rivals
                    for k in (0, 1):
                        mask |= 0 if mine[k][place] & equal else 1 << (size + k)
                    masks.add(mask)
                every.append(least(masks))
            live = [rivals | 3 << size]
            for masks_ in every:
                self.left -= len(live) * len(masks_)
                live = least(a & b for a in live for b in masks_)
            if self.left < 0:
                raise UndecidedError(f"more than {MOST_STEPS:,} steps")
            if live == [0]:
                return True
        return False

    def _flat(self, mine: Needs) -> set[int]:
        """Return the levels at which a proposition of a rule stays in some cell."""
        return {
            level
            for place, axis in enumerate(self.axes)
            for cell, groups in zip(axis.cells, axis.groups, strict=True)
            if cell.low < cell.high
            for level, high, bits in groups
            if level == high
            and any(
                mine[place] >> n & 1 and any(bits >> line & 1 for line in f.lower)
                for n, f in enumerate(axis.functions)
            )
        }


def axis_flats(axis: Axis, level: int) -> set[tuple[int, int, int]]:
    """Return what can be at a level in open cells, what is above it, what stays."""
    result: set[tuple[int, int, int]] = set()
    for cell, groups in zip(axis.cells, axis.groups, strict=True):
        if cell.low == cell.high and axis.ends[0] < axis.ends[1]:
            continue
        flat = sum(bits for low, high, bits in groups if low == high == level)
        above = sum(bits for low, high, bits in groups if low >= level and high > level)
        crossing = [0]
        for low, high, bits in groups:
            if low < level < high:
                crossing.append(crossing[-1] | bits)
        for one in crossing:
            possible, certain = axis.pattern(above | one | flat, above | one)
            result.add((possible, certain, possible & ~certain))
    return result


_ANALYTIC = ("gaussian", "sigmoid", "bell", "two gaussians")


def _always_differ(one: Proposition, other: Proposition, variable: Variable) -> bool:
    """Return whether two propositions are surely on no interval the same function."""
    if one.negated != other.negated or not len(one.terms) == len(other.terms) == 1:
        return False
    a, b = (variable.curves[term] for term in (*one.terms, *other.terms))
    is_known = (
        a.kind == b.kind and a.kind in _ANALYTIC[:3] and not (a.hedges or b.hedges)
    )
    return is_known and (a != b or one.weight != other.weight)


def bits_of(flags: Iterable[bool]) -> int:
    """Return a number whose n-th bit is the n-th flag."""
    return sum(1 << place for place, flag in enumerate(flags) if flag)


def least(masks: Iterable[int]) -> list[int]:
    """Return the sets, as bits, that contain no other one of them."""
    kept: list[int] = []
    for one in sorted({*masks}, key=int.bit_count):
        if not any(other & one == other for other in kept):
            kept.append(one)
    return kept
