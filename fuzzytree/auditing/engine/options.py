"""What each axis can contribute to a duel, and a choice on every axis that suffices.

Under the minimum, a rule is stronger than its rivals at a point exactly if some level t
lies above all of their strengths and not above its own. At such a level every axis must
keep the rule at t or above, and every rival must be below t on some axis. In a cell the
elements are in strict order, so the sets of rivals below t are nested: an element below
the rule's is below t at exactly the levels above its least value in the cell, up to the
rule's largest. So a cell is one option, given by bands: `top` of the rule, and `floor`
of each rival.

One option on each axis must together leave all rivals below. That is set cover with
bit masks, solved by a dynamic program over the covered set, one axis after another,
which keeps only sets that no other contains. Where axes share inputs, linear
inequalities in fractions decide whether any inputs have the chosen values.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid, Bands
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Point
from fuzzytree.auditing.engine.states import Witness
from fuzzytree.auditing.engine.witnesses import (
    START,
    AxisStretch,
    point_with,
    stretch,
    widest,
)
from fuzzytree.model import checkpoint

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import IntArray


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


def cover(
    families: Sequence[Sequence[int]], full: int, clock: Clock
) -> tuple[int, ...] | None:
    """Return an option of each family that together cover `full`, or None.

    `full`: what must be covered; `clock`: checked between two axes.

    Raises:
        OutOfTimeError: If the clock is over.

    Example:
        >>> cover([[0b01, 0b10], [0b01]], 0b11, Clock())
        (2, 1)
    """
    if not all(families):
        return None
    order = sorted(range(len(families)), key=lambda axis: len(families[axis]))
    rest = [0] * (len(order) + 1)
    for place in range(len(order) - 1, -1, -1):
        rest[place] = union([rest[place + 1], *families[order[place]]]) & full
    if rest[0] != full:
        return None
    steps: list[dict[int, tuple[int, int]]] = []
    live: Iterable[int] = (0,)
    for place, axis in enumerate(order):
        clock.check()
        reached: dict[int, tuple[int, int]] = {}
        for before in live:
            checkpoint()
            for mask in families[axis]:
                after = (before | mask) & full
                if after | rest[place + 1] == full:
                    reached.setdefault(after, (before, mask))
        if not reached:
            return None
        steps.append(reached)
        live = maximal(reached)
    chosen = [0] * len(order)
    at = full
    for place in range(len(order) - 1, -1, -1):
        at, chosen[order[place]] = steps[place][at]
    return tuple(chosen)


# --- options of the axes

NEVER = np.iinfo(np.int64).max
_MOST_BITS = 63


class AxisOptions(msgspec.Struct, frozen=True, eq=False, dict=True):
    """The options on one axis.

    Attributes:
        where: Of each option its cell; `START` for the axis's lower end; `-2 - zone`
            for a zone that may hold several places, which counts within bands only.
        top: The band of the rule's largest value.
        floor: Shape (options, rivals): the band of each rival's least value; `NEVER`
            where it is not below the rule.
    """

    where: IntArray
    top: IntArray
    floor: IntArray

    def masks(self, is_open: npt.NDArray[np.bool_], band: int) -> tuple[int, ...]:
        """Return the largest sets of rivals that open options leave below a band."""
        below = self.floor[is_open] <= band
        if below.shape[1] < _MOST_BITS:
            weights = np.left_shift(1, np.arange(below.shape[1], dtype=np.int64))
            return maximal(np.unique(below @ weights).tolist())
        packed = np.packbits(below, axis=1, bitorder="little")
        return maximal(int.from_bytes(row.tobytes(), "little") for row in packed)

    def at_gap(self, band: int) -> tuple[int, ...]:
        """Return what is left below at levels between a band and the next one."""
        return self._known(band, is_within=False)

    def at_band(self, band: int) -> tuple[int, ...]:
        """Return what may be left below somewhere within a band: never too little."""
        return self._known(band, is_within=True)

    @functools.cached_property
    def events(self) -> IntArray:
        """The bands at which options come or go, in ascending order."""
        return np.unique(np.concatenate([self.top, self.floor[self.floor < NEVER]]))

    @functools.cached_property
    def _masks(self) -> dict[tuple[int, bool, bool], tuple[int, ...]]:
        return {}

    def _known(self, band: int, *, is_within: bool) -> tuple[int, ...]:
        """Return masks, worked out once for all bands between two events."""
        place = int(np.searchsorted(self.events, band, side="right"))
        is_event = bool(place) and int(self.events[place - 1]) == band
        key = place, is_within, is_event and is_within
        if key not in self._masks:
            is_open = self.top >= band
            if not is_within:
                is_open = (self.top > band) & (self.where >= START)
            self._masks[key] = self.masks(is_open, band)
        return self._masks[key]


class Duel(msgspec.Struct, frozen=True, eq=False, dict=True):
    """Some rules, taken together as their minimum, against rivals.

    Attributes:
        base: Where.
        ours: The positions of the rules; without any, a rule without clauses.
        rivals: The positions of the rivals.
        is_inner: Whether lower ends are left out: these are surfaces, but where an axis
            is one value.
    """

    base: Arrangement
    ours: tuple[int, ...]
    rivals: tuple[int, ...]
    is_inner: bool = False

    @property
    def full(self) -> int:
        """All rivals as bits."""
        return (1 << len(self.rivals)) - 1

    @property
    def bands(self) -> Bands:
        """The critical levels."""
        return self.base.bands

    @functools.cached_property
    def options(self) -> tuple[AxisOptions, ...]:
        """The options on each axis, without those that another one makes useless."""
        return tuple(map(_undominated, self.all_options))

    @functools.cached_property
    def all_options(self) -> tuple[AxisOptions, ...]:
        """The options on each axis."""
        every = (_options(self, grid) for grid in self.base.grids)
        return tuple(map(_inner, every) if self.is_inner else every)

    @functools.cached_property
    def events(self) -> tuple[int, ...]:
        """The bands at which options come or go, the highest first."""
        return _events(self.options)

    @functools.cached_property
    def all_events(self) -> tuple[int, ...]:
        """The same for all options, the useless ones too."""
        return _events(self.all_options)


def _events(every: Iterable[AxisOptions]) -> tuple[int, ...]:
    result = {0}  # without rivals nothing happens down to the lowest level
    for options in every:
        result.update(options.events.tolist())
    return tuple(sorted(result, reverse=True))


def weakest(grid: AxisGrid, rules: Sequence[int], cell: int) -> int:
    """Return the element that is the least of some rules' degrees in a cell."""
    rank = grid.cells.start_rank if cell == START else grid.cells.rank[cell]
    of = grid.of_start if cell == START else grid.of[:, cell]
    chosen = [int(of[rule]) for rule in rules] or [0]
    return min(chosen, key=lambda one: int(rank[one]))


def _options(duel: Duel, grid: AxisGrid) -> AxisOptions:
    checkpoint()
    cells = grid.cells
    count = len(cells.rank)
    columns = np.arange(count)
    rivals = np.array(duel.rivals, dtype=np.int64)
    mine = np.zeros(count, dtype=np.int64)  # the curve that is always 1
    for rule in duel.ours:
        other = grid.of[rule]
        mine = np.where(
            cells.rank[columns, other] < cells.rank[columns, mine], other, mine
        )
    theirs = grid.of[rivals]
    is_below = cells.rank[columns, theirs] < cells.rank[columns, mine]
    floor = np.where(is_below, grid.least[theirs, columns], NEVER).T
    top = grid.most[mine, columns]
    parts = [(columns, top, floor)]
    if not duel.base.opens(grid.axis.variable.name):
        parts.append(_start(duel, grid, rivals))
    parts.append(_zones(duel, grid))
    where, tops, floors = (np.concatenate(part) for part in zip(*parts, strict=True))
    return AxisOptions(where, tops, floors)


def _start(
    duel: Duel, grid: AxisGrid, rivals: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the option of the axis's lower end, which no cell holds."""
    mine = weakest(grid, duel.ours, START)
    theirs = grid.of_start[rivals]
    rank = grid.cells.start_rank
    floor = np.where(rank[theirs] < rank[mine], grid.at[theirs, 0], NEVER)
    return np.array([START]), grid.at[mine, :1], floor[np.newaxis]


def _zones(duel: Duel, grid: AxisGrid) -> tuple[IntArray, IntArray, IntArray]:
    """Return options of places with more than one in them: whatever may be there."""
    vague = np.flatnonzero(grid.cells.is_vague)

    def bands_of(rule: int) -> tuple[IntArray, IntArray]:
        groups = grid.axis.clauses[rule]
        at = grid.at[:, vague]
        low = high = np.full(len(vague), np.iinfo(np.int64).max - 1)
        if not groups:
            low = high = at[0]
        for group in groups:
            low = np.minimum(low, at[list(group)].max(axis=0))
            high = np.minimum(high, at[list(group)].max(axis=0))
        return low, high

    tops = [grid.at[0, vague], *(bands_of(rule)[1] for rule in duel.ours)]
    top = np.min(tops, axis=0)
    floor = np.array([bands_of(rule)[0] for rule in duel.rivals], dtype=np.int64)
    floor = floor.reshape(len(duel.rivals), len(vague)).T
    return -2 - vague, top, floor


def _inner(options: AxisOptions) -> AxisOptions:
    kept = options.where != START
    if not (options.where >= 0).any():
        return options
    return AxisOptions(options.where[kept], options.top[kept], options.floor[kept])


def _undominated(options: AxisOptions) -> AxisOptions:
    """Leave out options that another one is at least as good as at every level."""
    if len(options.where) > 400:  # the comparison takes its square
        return options
    # An option of a vague place must not make one of a cell useless.
    order = np.lexsort((-options.top, options.where < START))
    top, floor = options.top[order], options.floor[order]
    is_better = top[:, np.newaxis] >= top
    for rival in range(floor.shape[1]):
        checkpoint()
        is_better &= floor[:, np.newaxis, rival] <= floor[:, rival]
    chosen = order[~np.triu(is_better, 1).any(axis=0)]
    return AxisOptions(
        options.where[chosen], options.top[chosen], options.floor[chosen]
    )


# --- axes that share inputs

Part = tuple[AxisStretch, int]
"""A stretch of an axis, and the rivals that it leaves below, as bits."""


def union(masks: Iterable[int]) -> int:
    """Return all bits of some masks.

    Example:
        >>> union([0b001, 0b100])
        5
    """
    return functools.reduce(operator.or_, masks, 0)


def at_most(calls: int, clock: Clock | None = None) -> Callable[[], None]:
    """Return what raises OutOfTimeError when called too often, or too late."""
    left = iter(range(calls))

    def count() -> None:
        if clock is not None:
            clock.check()
        if next(left, None) is None:
            raise OutOfTimeError

    return count


def choices(
    base: Arrangement,
    parts: Mapping[int, Sequence[Part]],
    goal: int,
    rest: int,
    extra: Mapping[int, AxisStretch],
    count: Callable[[], None],
) -> Iterator[tuple[dict[int, AxisStretch], int]]:
    """Yield choices that some point has, each with what it leaves below.

    Args:
        base: The rules and the box.
        parts: What each axis can be.
        goal: What must be left below, by the other axes too.
        rest: What the other axes can leave below.
        extra: The required values of further axes.
        count: Called before inequalities are solved; it may raise.
    """
    axes = list(parts)
    reach = [rest]
    for axis in reversed(axes):
        reach.append(reach[-1] | union(mask for _, mask in parts[axis]))
    reach.reverse()
    todo: list[tuple[int, dict[int, AxisStretch], int]] = [(0, dict(extra), 0)]
    while todo:
        place, wanted, covered = todo.pop()
        if (covered | reach[place]) & goal != goal:
            continue
        if wanted:
            count()
            if point_with(base, wanted) is None:
                continue
        if place == len(axes):
            yield wanted, covered
            continue
        axis = axes[place]
        todo += [
            (place + 1, {**wanted, axis: part}, covered | mask)
            for part, mask in parts[axis]
        ]


def selections(
    base: Arrangement,
    parts: Mapping[int, Sequence[Part]],
    families: Mapping[int, Sequence[int]],
    goal: int,
    count: Callable[[], None],
    clock: Clock,
    realize: Callable[[int, int], AxisStretch | None] | None,
    extra: Mapping[int, AxisStretch] | None = None,
) -> Iterator[dict[int, AxisStretch]]:
    """Yield values of the axes that leave all of a goal below, and that some point has.

    Args:
        base: The rules and the box.
        parts: What each axis that shares inputs can be.
        families: What each free axis can leave below.
        goal: What must be left below.
        count: Called before inequalities are solved; it may raise.
        clock: Checked between two axes.
        realize: Returns values of a free axis that leave some rivals below, None if it
            finds none; without it the free axes are left out.
        extra: The required values of further axes.
    """
    rest = union(mask for family in families.values() for mask in family)
    for wanted, covered in choices(base, parts, goal, rest, extra or {}, count):
        missing = goal & ~covered
        chosen = cover([*families.values()], missing, clock)
        if chosen is None:
            continue
        result = dict(wanted)
        # Axes that leave many rivals below come first: few axes then matter.
        order = sorted(zip(families, chosen, strict=True), key=_size)
        for axis, mask in order if realize else ():
            assert realize is not None  # there is no order without it
            part = realize(axis, mask & missing)
            if part is None:
                break
            result[axis] = part
            missing &= ~mask
        else:
            yield result


def _size(chosen: tuple[int, int]) -> int:
    return -chosen[1].bit_count()


Levels = tuple[Fraction, Fraction]
"""Two levels: what lies between them is meant."""


def witness_between(
    base: Arrangement,
    levels: Levels,
    select: Callable[[Levels, bool], Iterator[dict[int, AxisStretch]]],
    check: Callable[[Point], Witness | None],
    deepest: int | None,
) -> tuple[Witness | None, bool]:
    """Return a witness at one of some levels, and whether there may be one unfound.

    Args:
        base: The rules and the box.
        levels: From where to where.
        select: Returns values of the axes for levels: all that may do at any of them if
            the second argument is true, and otherwise some that do at one of them.
        check: Returns a point as a witness, if it is one.
        deepest: How often levels are halved; None where axes share no inputs.
    """
    todo, is_open = [(levels, 0)], False
    while todo:
        (low, high), depth = todo.pop()
        if deepest is not None and not any(select((low, high), True)):
            continue
        for wanted in select((low, high), False):
            point = point_with(base, wanted)
            result = None if point is None else check(point)
            if result is not None:
                return result, False
        if depth >= (deepest or 0):
            is_open = True
            continue
        middle = (low + high) / 2
        todo += [((low, middle), depth + 1), ((middle, high), depth + 1)]
    return None, is_open


def parts_of(
    duel: Duel,
    options: AxisOptions,
    axis: int,
    band: int,
    levels: tuple[Fraction, Fraction],
    *,
    is_outer: bool,
) -> Iterator[Part]:
    """Yield the stretches of an axis, each with the rivals left below there.

    `levels`: the rule must reach the lower one, the rivals stay below the upper;
    `is_outer`: whether what may suffice at some level between counts.
    """
    grid = duel.base.grids[axis]
    for number in ((options.top > band) & (options.where >= START)).nonzero()[0]:
        cell = int(options.where[number])
        mine = weakest(grid, duel.ours, cell)
        floors = options.floor[number]
        theirs = {
            n: weakest(grid, [duel.rivals[n]], cell)
            for n in range(len(floors))
            if floors[n] <= band
        }
        yield from nested(grid, cell, levels, mine, theirs, is_outer=is_outer)


def nested(
    grid: AxisGrid,
    cell: int,
    levels: tuple[Fraction, Fraction],
    mine: int,
    theirs: Mapping[int, int],
    *,
    is_outer: bool,
) -> Iterator[Part]:
    """Yield stretches of a cell, each with the rivals left below there.

    What is left below is nested: everything up to some element of the order.
    """
    rank = grid.cells.start_rank if cell == START else grid.cells.rank[cell]
    for limit in sorted({-1, *(int(rank[e]) for e in theirs.values())}):
        kept = {n: e for n, e in theirs.items() if int(rank[e]) <= limit}
        below = set(kept.values())
        if is_outer:
            part = widest(grid, cell, levels, [mine], below)
        else:
            part = stretch(grid, cell, levels[0], [mine], below)
        if part is not None:
            yield part, union(1 << n for n in kept)
