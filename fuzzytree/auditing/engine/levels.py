"""One question under the minimum: do rules reach a level that others stay below?

A rule reaches a level at a point if its degree on every axis does, and stays below it
if its degree on some axis does. So at one level each axis is cut into cells, and all
that a cell says of a rule is whether it is below the level there: a bit. Cells, one of
each axis, are sought that keep all rivals below together, and none of ours: a dynamic
program over sets of rivals, one axis after another.

Degrees are straight lines (`lines`). Where they are known exactly, nothing changes
between two *critical levels*: the values at knots, where two functions of an axis meet,
and of each where another one jumps across it. So one level between each two of them
decides. Where degrees are enclosed, or axes share inputs, a range of levels is asked
for what may hold at any of them; if that does not exclude it, points are tried and the
range is halved.

Axes that share inputs are first treated as free of each other. If that finds nothing,
there is nothing; otherwise linear inequalities in fractions choose among the cells.
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple, TypeVar

from fuzzytree.auditing.decide.lines import (
    Between,
    Lines,
    combined,
    constant,
    lines_of,
    meetings,
)
from fuzzytree.auditing.engine.arrangement import Arrangement, RuleAxis
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Point, variable_value
from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.auditing.engine.states import Span
from fuzzytree.auditing.engine.witnesses import AxisStretch, coupled, point_with
from fuzzytree.model import checkpoint
from fuzzytree.numerics import outwards

_MOST_CHOICES: Final = 2_000  # tried for axes that share inputs, for one question
_DEEPEST: Final = 4  # halvings of levels for axes that share inputs
_DEEPEST_ENCLOSED: Final = 7  # where degrees are enclosed
_TRIES: Final = 16  # levels between two critical ones
_KEPT: Final = 1 << 12  # levels of an axis whose cells are kept
_PLACES: Final = 12  # of an axis with a curve that rules share

T = TypeVar("T")
Propositions = tuple[tuple[int, ...], ...]
"""A rule's propositions on an axis: the least of the largest of elements, by number."""


def bits(numbers: Iterable[int]) -> int:
    """Return the numbers of rules, from 1, as bits.

    Example:
        >>> bits([1, 3])
        5
    """
    return functools.reduce(operator.or_, (1 << (n - 1) for n in numbers), 0)


def maximal(masks: Iterable[int]) -> tuple[int, ...]:
    """Return the sets that no other one contains, in a fixed order.

    Example:
        >>> maximal([0b011, 0b001, 0b100])
        (3, 4)
    """
    kept: list[int] = []
    for mask in sorted(set(masks), key=lambda one: (-one.bit_count(), one)):
        checkpoint()
        if all(mask | other != other for other in kept):
            kept.append(mask)
    return tuple(kept)


def joint_choice(
    families: Sequence[Iterable[int]], goal: int, clock: Clock
) -> tuple[int, ...] | None:
    """Return a set of each family that together contain a goal, or None.

    Raises:
        OutOfTimeError: If the clock is over.

    Example:
        >>> joint_choice([[0b01, 0b10], [0b01]], 0b11, Clock())
        (2, 1)
    """
    useful = [maximal(mask & goal for mask in family) for family in families]
    if not all(useful):
        return None
    order = sorted(range(len(useful)), key=lambda axis: len(useful[axis]))
    rest = [0]
    for axis in reversed(order):
        rest.append(functools.reduce(operator.or_, useful[axis], rest[-1]))
    rest.reverse()
    steps: list[dict[int, tuple[int, int]]] = []
    live: Iterable[int] = (0,)
    for place, axis in enumerate(order):
        clock.check()
        reached: dict[int, tuple[int, int]] = {}
        for before in live:
            for mask in useful[axis]:
                after = before | mask
                if after | rest[place + 1] == goal:
                    reached.setdefault(after, (before, mask))
        steps.append(reached)
        live = maximal(reached)
    if goal not in live:
        return None
    chosen = [0] * len(order)
    at = goal
    for step, axis in zip(reversed(steps), reversed(order), strict=True):
        at, chosen[axis] = step[at]
    return tuple(chosen)


# --- an axis at a level


class Cell(NamedTuple):
    """A part of an axis on which no rule changes its side of a level.

    Attributes:
        part: The values.
        reach: The rules whose degree reaches the level there, as bits.
        below: The rules whose degree is below it.
        level: The rules whose degree is the level on all of the part; of those that
            are enclosed, the bound that keeps them below.
    """

    part: AxisStretch
    reach: int
    below: int
    level: int = 0

    @property
    def is_point(self) -> bool:
        """Whether it is a single value."""
        return self.part.low == self.part.high


class LevelAxis:
    """An axis of the rules on a box: the lines of its elements.

    Attributes:
        ends: The least and the largest value of the axis.
        elements: Their degrees, in the order of the arrangement's elements.
        propositions: For each rule its propositions here.
    """

    def __init__(
        self,
        ends: tuple[Fraction, Fraction],
        is_open: bool,
        elements: Sequence[Between],
        propositions: Sequence[Propositions],
    ) -> None:
        self.ends, self.is_open = ends, is_open and ends[0] < ends[1]
        self.elements, self.propositions = tuple(elements), tuple(propositions)
        self.kinds: dict[Propositions, int] = {}
        for number, groups in enumerate(self.propositions):
            self.kinds[groups] = self.kinds.get(groups, 0) | 1 << number
        self.is_exact = all(element.is_exact for element in self.elements)
        self._known: dict[tuple[Fraction, Fraction, bool, bool], list[Cell]] = {}
        self._by_elements: dict[tuple[int, int, int], tuple[int, int, int]] = {}
        self._functions: dict[Propositions, Between] = {}

    @functools.cached_property
    def levels(self) -> tuple[Fraction, ...]:
        """The critical levels, from 0 to 1."""
        result = {ZERO, ONE}
        used = sorted({one for kind in self.kinds for group in kind for one in group})
        every = list(dict.fromkeys(self.elements[one].lower for one in used))
        jumps = [jump for one in every for jump in one.jumps()]
        for place, one in enumerate(every):
            checkpoint()
            values = ((one.value(x), low, high) for x, low, high in jumps)
            result |= one.values | {y for y, low, high in values if low < y < high}
            for other in every[:place]:
                result |= meetings(other, one)
        return tuple(sorted(level for level in result if 0 <= level <= 1))

    def function(self, rule: int) -> Between:
        """Return a rule's degree along the axis, by its position."""
        return self.function_of(self.propositions[rule])

    def function_of(self, groups: Propositions) -> Between:
        """Return the least of the largest of some elements along the axis."""
        if groups not in self._functions:
            self._functions[groups] = self._function(groups)
        return self._functions[groups]

    def _function(self, groups: Propositions) -> Between:
        if not groups:
            always = constant(ONE, *self.ends)
            return Between(always, always)

        def joined(side: int) -> Lines:
            largest = (
                combined([self.elements[one][side] for one in group], max)
                for group in groups
            )
            return combined([*largest], min)

        lower = joined(0)
        is_exact = all(self.elements[i].is_exact for group in groups for i in group)
        return Between(lower, lower if is_exact else joined(1))

    @functools.cached_property
    def _coded(self) -> list[tuple[_Coded, ...]]:
        return [tuple(map(_coded, element)) for element in self.elements]

    def between_own(self, place: int) -> Sequence[Cell]:
        """Return the cells between two critical levels of this axis.

        `place`: the number of the upper one. The bits are those at all levels between,
        the parts those at one of them.
        """
        middle = (self.levels[place - 1] + self.levels[place]) / 2
        return self.cells(middle, middle)

    def cells(
        self,
        reached: Fraction,
        kept: Fraction,
        *,
        is_sure: bool = False,
        has_points: bool = False,
    ) -> list[Cell]:
        """Return the cells of the axis, neighbours that are alike as one.

        `reached`, `kept`: rules reach the one, or are below the other; where degrees
        are enclosed, they may be so, or, if `is_sure`, they are. `has_points`: whether
        all single values at which something changes are among the cells, and neighbours
        stay apart; else only those where a function jumps.
        """
        key = reached, kept, is_sure, has_points
        if key not in self._known:
            if len(self._known) >= _KEPT:
                self._known.clear()
            cells = self._cells(reached, kept, is_sure)
            self._known[key] = cells if has_points else _merged(cells)
        return self._known[key]

    def _cells(self, reached: Fraction, kept: Fraction, is_sure: bool) -> list[Cell]:
        checkpoint()
        lower, upper = ([coded[side] for coded in self._coded] for side in (0, 1))
        high, low = (lower, upper) if is_sure else (upper, lower)
        is_one = reached == kept and self.is_exact
        events: list[tuple[float, Fraction, int, int, int, int]] = []
        for side, level, every in ((0, reached, high), (1, kept, low)):
            if side and is_one:
                continue
            for element, lines in enumerate(every):
                found = _changes(lines, level)
                events += ((f, x, side, element, at, then) for f, x, at, then in found)
        events.sort()
        # Of the elements, as bits: those at the level or above it, and those above it.
        at_least, above, masks = [0, 0], [0, 0], (0, 0, 0)
        kept_side = 0 if is_one else 1
        result: list[Cell] = []
        for (_, x), group in itertools.groupby(events, _place_of):
            changed = [*group]
            if result:
                last = AxisStretch(result[-1].part.high, x)
                result.append(Cell(last, *masks))
            for kind in (4, 5):  # at the place itself, and after it
                for event in changed:
                    side, bit, sign = event[2], 1 << event[3], event[kind]
                    at_least[side] = at_least[side] & ~bit | (bit if sign >= 0 else 0)
                    above[side] = above[side] & ~bit | (bit if sign > 0 else 0)
                masks = self._masks(at_least[0], at_least[kept_side], above[kept_side])
                if kind == 4:
                    part = AxisStretch(x, x, is_open=False)
                    result.append(Cell(part, *masks))
        return result[1:] if self.is_open else result

    def _masks(self, up: int, down: int, above: int) -> tuple[int, int, int]:
        """Return which rules reach, are below and are at a level, by elements.

        `up`, `down`: the elements that are not below the level reached, or kept;
        `above`: those above the latter.
        """
        key = up, down, above
        if key not in self._by_elements:
            reach = below = level = 0
            for groups, rules in self._groups:
                if all(group & up for group in groups):
                    reach |= rules
                if not all(group & down for group in groups):
                    below |= rules
                elif not all(group & above for group in groups):
                    level |= rules
            self._by_elements[key] = reach, below, level
        return self._by_elements[key]

    @functools.cached_property
    def _groups(self) -> tuple[tuple[tuple[int, ...], int], ...]:
        """The propositions of rules as elements, as bits; none is the element 0."""
        return tuple(
            (tuple(_union(1 << e for e in group) for group in kind or ((0,),)), rules)
            for kind, rules in self.kinds.items()
        )


class _Coded(NamedTuple):
    """Lines ready for many levels: heights in order, places as doubles as well."""

    places: tuple[tuple[float, Fraction], ...]
    heights: tuple[Fraction, ...]
    at: tuple[int, ...]  # numbers of heights
    after: tuple[int, ...]
    before: tuple[int, ...]
    per_height: tuple[Fraction, ...]  # how far a line goes while it rises by 1


def _coded(lines: Lines) -> _Coded:
    heights = {height: number for number, height in enumerate(sorted(lines.values))}
    at, after, before = (
        tuple(heights[height] for height in of)
        for of in (lines.at, lines.after, lines.before)
    )
    per_height = (
        (b - a) / (q - p) if p != q else ZERO for a, b, p, q in lines.pieces()
    )
    places = tuple((float(x), x) for x in lines.x)
    return _Coded(places, (*heights,), at, after, before, tuple(per_height))


def _place_of(
    event: tuple[float, Fraction, int, int, int, int],
) -> tuple[float, Fraction]:
    return event[:2]


def _changes(
    lines: _Coded, level: Fraction
) -> Iterator[tuple[float, Fraction, int, int]]:
    """Yield where a function changes its side of a level: there, and after it.

    The first and the last place are among them. A place is a double and a fraction, as
    doubles are faster to sort.
    """
    least = bisect_left(lines.heights, level)
    sides = [-1] * least + [1] * (len(lines.heights) - least)
    if least < len(lines.heights) and lines.heights[least] == level:
        sides[least] = 0
    last, end = None, len(lines.after)
    for number, (near, x) in enumerate(lines.places):
        here = sides[lines.at[number]]
        if number == end:
            yield near, x, here, here
            return
        first, then = sides[lines.after[number]], sides[lines.before[number]]
        after = first or then
        if last is None or here != last or after != last:
            yield near, x, here, after
        last = after
        if first * then < 0:
            rise = level - lines.heights[lines.after[number]]
            place = x + rise * lines.per_height[number]
            yield float(place), place, 0, then
            last = then


def _merged(cells: Sequence[Cell]) -> list[Cell]:
    """Return cells without points where nothing jumps, alike neighbours as one."""
    if len(cells) == 1:
        return [*cells]
    result: list[Cell] = []
    for number, cell in enumerate(cells):
        before = cells[number - 1] if number else None
        after = cells[number + 1] if number + 1 < len(cells) else None
        if cell.is_point and any(
            one is not None and _serves(one, cell) for one in (before, after)
        ):
            continue
        last = result[-1] if result else None
        if (
            last is not None
            and last[1:] == cell[1:]
            and last.part.high == cell.part.low
            and not (last.is_point or cell.is_point)
            and before is not None
            and before[1:] == cell[1:]
        ):
            result[-1] = last._replace(part=AxisStretch(last.part.low, cell.part.high))
        else:
            result.append(cell)
    return result


def _serves(one: Cell, other: Cell) -> bool:
    """Return whether a part does at least what the point beside it does."""
    return not (other.reach & ~one.reach or other.below & ~one.below)


# --- all axes


class Tries:
    """How many values of axes that share inputs were tried for one question.

    Attributes:
        used: How many.
        clock: When no more are.
    """

    def __init__(self, clock: Clock) -> None:
        self.used, self.clock = 0, clock

    def count(self) -> None:
        """Count one more.

        Raises:
            OutOfTimeError: If they are too many, or the clock is over.
        """
        self.clock.check()
        self.used += 1
        if self.used > _MOST_CHOICES:
            raise OutOfTimeError


class Sides(NamedTuple):
    """What is to be kept apart: rules, as bits."""

    ours: int
    rivals: int


class LevelRange(NamedTuple):
    """Two neighbouring critical levels.

    Attributes:
        low: The lower one.
        high: The upper one.
        places: For each axis the number of its own first critical level above them.
    """

    low: Fraction
    high: Fraction
    places: tuple[int, ...]


class Levels:
    """The rules of an arrangement under the minimum, at levels."""

    def __init__(self, base: Arrangement, axes: Sequence[LevelAxis]) -> None:
        self.base, self.axes = base, tuple(axes)
        self.joined = sorted({axis for group in coupled(base) for axis in group})
        self.is_exact = all(axis.is_exact for axis in self.axes)

    @functools.cached_property
    def levels(self) -> tuple[Fraction, ...]:
        """The critical levels of all axes, from 0 to 1."""
        every = {level for axis in self.axes for level in axis.levels}
        return tuple(sorted(every | {ZERO, ONE}))

    def lowered(self, rule: int, lead: Fraction) -> Levels:
        """Return the same with a rule, by position, weaker by a lead everywhere."""
        axes: list[LevelAxis] = []
        for axis in self.axes:
            groups = axis.propositions[rule] or ((0,),)
            used = sorted({one for group in groups for one in group})
            place = {one: len(axis.elements) + k for k, one in enumerate(used)}
            shifted = (axis.elements[one] for one in used)
            added = (Between(*(side.lowered(lead) for side in e)) for e in shifted)
            own = tuple(tuple(place[one] for one in group) for group in groups)
            propositions = [*axis.propositions]
            propositions[rule] = own
            exact = (Between(b.lower, b.lower) for b in added)
            every = [*axis.elements, *(exact if self.is_exact else added)]
            axes.append(LevelAxis(axis.ends, axis.is_open, every, propositions))
        return Levels(self.base, axes)

    # --- are all kept apart at some level

    @functools.cached_property
    def ranges(self) -> tuple[LevelRange, ...]:
        """Neighbouring critical levels, those far apart first."""
        places = [0] * len(self.axes)
        every: list[LevelRange] = []
        for low, high in itertools.pairwise(self.levels):
            for number, axis in enumerate(self.axes):
                place = places[number]
                places[number] = place + (axis.levels[place] == low)
            every.append(LevelRange(low, high, tuple(places)))
        return tuple(sorted(every, key=lambda one: (one.low - one.high, -one.low)))

    def apart(self, sides: Sides, clock: Clock) -> Iterator[tuple[Fraction, Fraction]]:
        """Yield ranges of levels at which cells keep rivals below, and none of ours.

        Axes are treated as free, and degrees must be known exactly.
        """
        known: dict[tuple[int, ...], bool] = {}
        families: dict[tuple[int, int], tuple[int, ...]] = {}
        for low, high, places in self.ranges:
            if places not in known:
                for place in enumerate(places):
                    if place not in families:
                        families[place] = self._below(place[0], sides, place[1])
                every = [families[place] for place in enumerate(places)]
                known[places] = joint_choice(every, sides.rivals, clock) is not None
            if known[places]:
                yield low, high

    def _below(self, axis: int, sides: Sides, place: int) -> tuple[int, ...]:
        """Return the largest sets of rivals that an axis keeps below a level."""
        cells = self.axes[axis].between_own(place)
        return maximal(c.below & sides.rivals for c in cells if _keeps(c, sides))

    def _is_apart(self, sides: Sides, places: Sequence[int], clock: Clock) -> bool:
        families = [
            self._below(axis, sides, place) for axis, place in enumerate(places)
        ]
        return joint_choice(families, sides.rivals, clock) is not None

    def at_least(self, clock: Clock) -> tuple[Fraction, Fraction]:
        """Return bounds of the least level that all rules together go down to.

        Axes are treated as free; where degrees are enclosed the bounds are apart.
        """
        count = len(self.base.rules.rules)
        sides = Sides(0, (1 << count) - 1)
        if self.is_exact:
            rising = sorted(self.ranges)

            def is_apart(one: LevelRange) -> bool:
                return self._is_apart(sides, one.places, clock)

            first = bisect_left(rising, True, key=is_apart)  # where it first succeeds
            return self.levels[first], self.levels[first]
        return self._first(sides, clock, False), self._first(sides, clock, True)

    def _first(self, sides: Sides, clock: Clock, is_sure: bool) -> Fraction:
        low, high = ZERO, ONE
        for _ in range(20):
            middle = (low + high) / 2
            every = self._parts(sides, middle, middle, is_sure=is_sure)
            masks = [{mask for _, mask in parts} for parts in every]
            if joint_choice(masks, sides.rivals, clock) is None:
                low = middle
            else:
                high = middle
        return high if is_sure else low

    def _parts(
        self,
        sides: Sides,
        reached: Fraction,
        kept: Fraction,
        *,
        is_sure: bool = False,
    ) -> list[list[tuple[AxisStretch, int]]]:
        """Return for each axis its parts, each with the rivals kept below there."""
        result: list[list[tuple[AxisStretch, int]]] = []
        for axis in self.axes:
            cells = axis.cells(reached, kept, is_sure=is_sure)
            wrong = 0 if reached == kept and self.is_exact else self._same(axis, sides)
            goal = sides.rivals & ~wrong
            result.append([(c.part, c.below & goal) for c in cells if _keeps(c, sides)])
        return result

    def _same(self, axis: LevelAxis, sides: Sides) -> int:
        """Return the rivals that on an axis are nowhere below one of ours."""
        result = 0
        for groups, rules in axis.kinds.items():
            if rules & sides.ours:
                for others, rivals in axis.kinds.items():
                    if set(others) <= set(groups):
                        result |= rivals
        return result

    def zeros(self, *, is_sure: bool) -> list[list[tuple[AxisStretch, int]]]:
        """Return the parts of each axis with the rules that are 0 there, or may be."""
        every: list[list[tuple[AxisStretch, int]]] = []
        for axis in self.axes:
            cells = axis.cells(ZERO, ZERO, is_sure=is_sure, has_points=True)
            known = [(cell, cell.below | cell.level) for cell in cells]
            inner = [(c.part, zero) for c, zero in known if zero and not c.is_point]
            points = [
                (cell.part, zero)
                for place, (cell, zero) in enumerate(known)
                if cell.is_point
                and all(zero & ~beside for _, beside in _beside(known, place))
            ]
            # Those with an interior are tried first: a point there has others around.
            whole = AxisStretch(*axis.ends, is_open=False)
            every.append([(whole, 0), *points, *runs(inner)])
        return every

    # --- points

    def selections(
        self,
        every: Sequence[Sequence[tuple[AxisStretch, int]]],
        goal: int,
        tries: Tries,
        fixed: Mapping[int, AxisStretch] | None = None,
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield parts of the axes that some point has and that contain a goal.

        `every`: the parts of each axis; `fixed`: those of axes that are not to be
        chosen.
        """
        fixed = dict(fixed or {})
        free = [a for a in range(len(every)) if a not in self.joined and a not in fixed]
        masks = [{mask for _, mask in every[axis]} for axis in free]
        joined = [axis for axis in self.joined if axis not in fixed]
        reach = [_union(mask for family in masks for mask in family)]
        for axis in reversed(joined):
            reach.append(reach[-1] | _union(mask for _, mask in every[axis]))
        reach.reverse()
        todo: list[tuple[int, dict[int, AxisStretch], int]] = [(0, fixed, 0)]
        while todo:
            place, wanted, covered = todo.pop()
            if (covered | reach[place]) & goal != goal:
                continue
            if self.joined and wanted:
                tries.count()
                if point_with(self.base, wanted) is None:
                    continue
            if place == len(joined):
                found = joint_choice(masks, goal & ~covered, tries.clock)
                if found is not None:
                    rest = zip(free, found, strict=True)
                    yield wanted | {a: _widest(every[a], mask) for a, mask in rest}
                continue
            axis = joined[place]
            todo += [
                (place + 1, wanted | {axis: part}, covered | mask)
                for part, mask in every[axis]
            ]

    def search(
        self,
        sides: Sides,
        levels: tuple[Fraction, Fraction],
        tries: Tries,
        accept: Callable[[Point], T | None],
    ) -> tuple[T | None, bool]:
        """Return what a point keeps apart at some of the levels, and if it is open.

        `accept`: returns what a point shows, None if it shows nothing.
        """
        is_plain = self.is_exact and not self.joined
        deepest = _DEEPEST if self.is_exact else _DEEPEST_ENCLOSED
        todo = [(*levels, 0 if is_plain else deepest)]
        is_open = False
        while todo:
            low, high, depth = todo.pop()
            middle = (low + high) / 2
            found, may_be = None, True
            if not is_plain:  # is there anything, at any of the levels?
                found, may_be = self._at(sides, (low, high), tries, accept)
            if found is None and may_be:
                found, is_there = self._at(sides, (middle, middle), tries, accept)
                may_be = is_there or not is_plain
            if found is not None:
                return found, False
            if may_be and depth:
                todo += [(low, middle, depth - 1), (middle, high, depth - 1)]
            is_open |= may_be and not depth
        return None, is_open

    def _at(
        self,
        sides: Sides,
        between: tuple[Fraction, Fraction],
        tries: Tries,
        accept: Callable[[Point], T | None],
    ) -> tuple[T | None, bool]:
        """Return what one point shows at a level, and whether any parts do."""
        parts = self._parts(sides, *between)
        if between[0] != between[1]:
            parts = [[(_closed(p), m) for p, m in of] for of in parts]
        some = self.selections(parts, sides.rivals, tries)
        return first_accepted(self.base, itertools.islice(some, 1), accept)

    # --- ties

    def tied(
        self, ours: Sequence[int], strict: int, weak: int, clock: Clock
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield parts of the axes on which rules are equally strong, and strongest.

        Each of `ours` (positions) is as strong as all others of them, above 0, stronger
        than each of `strict` and not weaker than any of `weak`, on parts that are open
        but for one single value: there all are as strong as one line, at a level that
        is not critical. Axes are treated as free, and degrees must be exact.
        """
        mine, goal = _union(1 << one for one in ours), strict | weak
        sides = Sides(mine, goal)
        for low, high, places in self.ranges:
            families: list[set[int]] = []
            for number, axis in enumerate(self.axes):
                clock.check()
                if axis.ends[0] == axis.ends[1]:
                    continue
                pivots = self._pivots(number, places[number], mine)
                dones = {cell.below | cell.level & weak for cell in pivots}
                if dones and not families:
                    families = [
                        self._kept(*one, sides)
                        for one in zip(self.axes, places, strict=True)
                    ]
                for done in maximal(mask & goal for mask in dones):
                    every = [*families]
                    every[number] = {done}
                    if joint_choice(every, goal, clock) is not None:
                        shares = range(1, _TRIES) if self.joined else (_TRIES // 2,)
                        for k in shares:  # where inputs are shared any may do
                            at = low + (high - low) * k / _TRIES
                            yield from self._pinned(
                                number, (at, done), sides, strict, clock
                            )
        yield from self._flat(ours, strict, weak, clock)

    def _kept(self, axis: LevelAxis, place: int, sides: Sides) -> set[int]:
        """Return what parts of an axis with an interior keep below a level."""
        cells = _inner(axis.between_own(place))
        return {cell.below for cell in cells if _keeps(cell, sides)}

    def _pivots(self, number: int, place: int, mine: int) -> list[Cell]:
        axis = self.axes[number]
        key = number, place
        if key not in self._pivot_cells:
            middle = (axis.levels[place - 1] + axis.levels[place]) / 2
            cells = axis.cells(middle, middle, has_points=True)
            self._pivot_cells[key] = [c for c in cells if c.is_point and c.level]
        return [c for c in self._pivot_cells[key] if mine & ~c.level == 0]

    @functools.cached_property
    def _pivot_cells(self) -> dict[tuple[int, int], list[Cell]]:
        return {}

    def _pinned(
        self,
        number: int,
        wanted: tuple[Fraction, int],
        sides: Sides,
        strict: int,
        clock: Clock,
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield the parts for a pivot, by what it leaves to do at a level."""
        level, done = wanted
        axis = self.axes[number]
        weak = sides.rivals & ~strict
        points = [
            cell
            for cell in axis.cells(level, level, has_points=True)
            if cell.is_point
            and sides.ours & ~cell.level == 0
            and (cell.below | cell.level & weak) & sides.rivals == done
        ]
        parts = [
            [
                (c.part, c.below & sides.rivals)
                for c in _inner(a.cells(level, level))
                if _keeps(c, sides)
            ]
            for a in self.axes
        ]
        tries = Tries(clock)
        for point in points:
            goal = sides.rivals & ~done
            yield from self.selections(parts, goal, tries, {number: point.part})

    def _flat(
        self, ours: Sequence[int], strict: int, weak: int, clock: Clock
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield parts on which each of ours has a constant strength, at a level."""
        mine = _union(1 << one for one in ours)
        first = len(self.base.rules.rules)
        pins = {one: 1 << (first + k) for k, one in enumerate(ours)}
        goal = strict | weak | _union(pins.values())
        sides = Sides(mine, strict | weak)
        for level in reversed(self.levels):
            clock.check()
            if not level:
                continue
            every: list[list[tuple[AxisStretch, int]]] = []
            for axis in self.axes:
                parts: list[tuple[AxisStretch, int]] = []
                for cell in _inner(axis.cells(level, level)):
                    if not _keeps(cell, sides):
                        continue
                    held = _union(p for n, p in pins.items() if cell.level >> n & 1)
                    parts.append(
                        (
                            cell.part,
                            cell.below & sides.rivals | cell.level & weak | held,
                        )
                    )
                every.append(parts)
            masks = [{mask for _, mask in parts} for parts in every]
            if joint_choice(masks, goal, clock) is not None:
                tries = Tries(clock)
                yield from self.selections(every, goal, tries)

    def pinned_by_curve(
        self, ours: Sequence[int], strict: int, weak: int, clock: Clock
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield parts at which rules may tie by a proposition that they share.

        For degrees that are enclosed: the axis of the proposition has one of some
        values, the other parts hold for sure.
        """
        mine = _union(1 << one for one in ours)
        tries = Tries(clock)
        for number, axis in enumerate(self.axes):
            low, high = axis.ends
            shared = set.intersection(*(set(axis.propositions[one]) for one in ours))
            for group in shared:
                known = axis.function_of((group,))
                has = _union(r for kind, r in axis.kinds.items() if group in kind)
                for step in range(1, _PLACES):
                    clock.check()
                    x = low + (high - low) * step / _PLACES
                    least, most = known.lower.value(x), known.upper.value(x)
                    if least <= 0:
                        continue
                    done = has & weak | _union(
                        rules
                        for kind, rules in axis.kinds.items()
                        if axis.function_of(kind).upper.value(x) < least
                    )
                    goal = (strict | weak) & ~done
                    sides = Sides(mine, goal)
                    parts = self._parts(sides, most, least, is_sure=True)
                    fixed = {number: AxisStretch(x, x, is_open=False)}
                    yield from self.selections(parts, goal, tries, fixed)
        yield from self._flat(ours, strict, weak, clock)

    # --- boxes around points

    def region(
        self, point: Mapping[str, Fraction], sides: Sides, level: Fraction
    ) -> tuple[Span, ...]:
        """Return a box around a point on which rules keep to two sides of a level.

        On all of it each of ours is at least as strong as the level, and each rival is
        weaker, or 0 where the level is. Only variables that matter have a span; its
        ends are doubles. It is empty where degrees or doubles do not tell.
        """
        values = [variable_value(axis.variable, point) for axis in self.base.axes]
        every = [
            axis.cells(level, level, is_sure=True, has_points=True)
            for axis in self.axes
        ]
        places: list[int] = []
        low_at: list[int] = []
        for cells, x in zip(every, values, strict=True):
            place = next((k for k, c in enumerate(cells) if _has(c.part, x)), None)
            if place is None or not _keeps(cells[place], sides):
                return ()
            places.append(place)
            low_at.append(_low(cells[place], level) & sides.rivals)
        missing, wanted = sides.rivals, [0] * len(every)
        while missing:
            best = max(
                range(len(every)), key=lambda k: (low_at[k] & missing).bit_count()
            )
            if not low_at[best] & missing:
                return ()
            wanted[best] = low_at[best] & missing
            missing &= ~low_at[best]
        spans: list[Span] = []
        for number, cells in enumerate(every):

            def holds(cell: Cell, low: int = wanted[number]) -> bool:
                return _keeps(cell, sides) and not low & ~_low(cell, level)

            span = _span(cells, places[number], values[number], holds)
            if span is None:
                continue
            low, high = span
            if not low <= values[number] <= high:
                return ()  # narrower than doubles tell
            spans.append(Span(self.base.axes[number].variable.name, low, high))
        return tuple(spans)


@functools.lru_cache(maxsize=16)
def levels_of(base: Arrangement) -> Levels:
    """Return the rules of an arrangement at levels; worked out once for each."""
    assert base.ends is not None  # of a box that is not empty
    axes = [
        _level_axis(axis, ends, is_open=base.opens(axis.variable.name))
        for axis, ends in zip(base.axes, base.ends, strict=True)
    ]
    return Levels(base, axes)


def _level_axis(
    axis: RuleAxis, ends: tuple[Fraction, Fraction], *, is_open: bool
) -> LevelAxis:
    elements: list[Between] = []
    for shape, is_complement in axis.elements:
        lines = lines_of(shape, *ends)
        elements.append(lines.negated() if is_complement else lines)
    return LevelAxis(ends, is_open, elements, axis.propositions)


def first_accepted(
    base: Arrangement,
    selections: Iterable[Mapping[int, AxisStretch]],
    accept: Callable[[Point], T | None],
) -> tuple[T | None, bool]:
    """Return what the first point that is accepted shows, and if any parts were tried.

    `selections`: parts of the axes; `accept`: returns what a point of them shows, None
    if it shows nothing.
    """
    is_any = False
    for wanted in selections:
        is_any = True
        point = point_with(base, wanted)
        found = None if point is None else accept(point)
        if found is not None:
            return found, True
    return None, is_any


def _beside(known: Sequence[T], place: int) -> Sequence[T]:
    """Return the neighbours of a place in a sequence."""
    return [*known[max(place - 1, 0) : place], *known[place + 1 : place + 2]]


def _union(masks: Iterable[int]) -> int:
    return functools.reduce(operator.or_, masks, 0)


def _keeps(cell: Cell, sides: Sides) -> bool:
    """Return whether all of ours reach the level."""
    return not sides.ours & ~cell.reach


def _inner(cells: Sequence[Cell]) -> Sequence[Cell]:
    """Return the cells with an interior; of a single value that one."""
    return cells if len(cells) == 1 else [cell for cell in cells if not cell.is_point]


def _low(cell: Cell, level: Fraction) -> int:
    return cell.below | (0 if level else cell.level)


def _has(part: AxisStretch, x: Fraction) -> bool:
    return part.low < x < part.high or part.low == x == part.high


def _closed(part: AxisStretch) -> AxisStretch:
    return part._replace(is_open=False)


def runs(
    parts: Iterable[tuple[AxisStretch, int]],
) -> list[tuple[AxisStretch, int]]:
    """Return neighbouring parts with the same mask as one."""
    result: list[tuple[AxisStretch, int]] = []
    for part, mask in parts:
        if result and result[-1][1] == mask and result[-1][0].high == part.low:
            part = AxisStretch(result.pop()[0].low, part.high)
        result.append((part, mask))
    return result


def _widest(parts: Iterable[tuple[AxisStretch, int]], mask: int) -> AxisStretch:
    """Return the longest of the parts with all bits of a mask."""
    fits = (part for part, bits_ in parts if not mask & ~bits_)
    return max(fits, key=lambda part: part.high - part.low)


def _span(
    cells: Sequence[Cell], place: int, x: Fraction, holds: Callable[[Cell], bool]
) -> tuple[float, float] | None:
    """Return from where to where neighbours of a cell hold; None if all do."""
    if all(map(holds, cells)):
        return None
    first = last = place
    while first and holds(cells[first - 1]):
        first -= 1
    while last + 1 < len(cells) and holds(cells[last + 1]):
        last += 1
    low, high = cells[first].part.low, cells[last].part.high
    near = outwards(low)[1], outwards(high)[0]
    if near[0] == low != x and not cells[first].is_point:
        near = math.nextafter(near[0], math.inf), near[1]
    if near[1] == high != x and not cells[last].is_point:
        near = near[0], math.nextafter(near[1], -math.inf)
    return near
