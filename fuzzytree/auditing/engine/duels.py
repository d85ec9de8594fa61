"""Is a rule stronger than some rivals at any input, and by how much at most?

Under the minimum, a rule is stronger than its rivals at a point exactly if some level t
lies above all of their strengths and not above its own. At such a level every axis must
keep the rule at t or above, and every rival must be below t on some axis. In a cell the
elements are in strict order, so the sets of rivals below t are nested: an element below
the rule's is below t at exactly the levels above its least value in the cell, up to the
rule's largest. So a cell is one option, given by bands: `top` of the rule, and `floor`
of each rival. One option on each axis must together leave all rivals below: set cover
with bit masks, by a dynamic program over the covered set, one axis after another, which
keeps only sets that no other contains.

A strict lead spans an open interval of levels, so it shows at a level
between two bands, or it lies within one band, where the bounds of critical levels leave
their order open. There every option that may be open counts as open: if even these do
not suffice, nothing is missed; otherwise the search runs again with critical levels as
fractions.

Axes that share inputs are first treated as free. If that finds nothing, there is
nothing; otherwise linear inequalities in fractions look for values of the inputs.
"""

from __future__ import annotations

import functools
import operator
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from typing import Final, NamedTuple

import msgspec
import numpy as np

from fuzzytree.auditing.engine.arrangement import (
    Arrangement,
    AxisGrid,
    Bands,
    TooManyCellsError,
    lead_at,
    strengths_at,
)
from fuzzytree.auditing.engine.axes import between
from fuzzytree.auditing.engine.bounding import (
    largest_lead_by_boxes,
    plainer,
    wins_by_boxes,
)
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Point
from fuzzytree.auditing.engine.probes import leader
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
    counted,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import (
    START,
    AxisStretch,
    coupled,
    is_within,
    point_with,
    region_around,
    stretch,
    widest,
)
from fuzzytree.model import BoolArray, IntArray, checkpoint
from fuzzytree.numerics import outwards


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
    """The options on one axis."""

    # of each option its cell; `START` for the axis's lower end; `-2 - zone` for a zone
    # that may hold several places, which counts within bands only
    where: IntArray
    top: IntArray  # the band of the rule's largest value
    # shape (options, rivals): the band of each rival's least value; `NEVER` where it is
    # not below the rule
    floor: IntArray

    def masks(self, is_open: BoolArray, band: int) -> tuple[int, ...]:
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
    """Some rules, taken together as their minimum, against rivals."""

    base: Arrangement  # where
    # the positions of the rules; without any, a rule without propositions
    ours: tuple[int, ...]
    rivals: tuple[int, ...]  # the positions of the rivals
    # whether lower ends are left out: these are surfaces, but where an axis is one
    # value
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
        groups = grid.axis.propositions[rule]
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


def stays(duel: Duel, grid: AxisGrid, cell: int, rival: int, band: int) -> bool:
    """Return whether a rival's curve is constant in a cell, in a band."""
    if cell == START:
        return bool(grid.at[grid.of_start[duel.rivals[rival]], 0] == band)
    element = grid.of[duel.rivals[rival], cell]
    return bool(grid.least[element, cell] == band == grid.most[element, cell])


def part_at(
    duel: Duel, band: int, level: Fraction, is_flat: bool, axis: int, mask: int
) -> AxisStretch | None:
    """Return where on an axis ours reach a level and some rivals stay below it.

    `band`: the one below the level; or, if `is_flat`, its own, in which rivals may also
    stay.
    """
    options, grid = duel.all_options[axis], duel.base.grids[axis]
    every = [n for n in range(len(duel.rivals)) if mask >> n & 1]
    fits = options.where >= START
    if not is_flat:
        fits &= (options.top > band) & (options.floor[:, every] <= band).all(axis=1)
    for number in sorted(fits.nonzero()[0], key=lambda n: -int(options.top[n])):
        cell = int(options.where[number])
        rivals = [
            n for n in every if not (is_flat and stays(duel, grid, cell, n, band))
        ]
        if (options.floor[number, rivals] > options.top[number]).any():
            continue
        below = {weakest(grid, [duel.rivals[n]], cell) for n in rivals}
        mine = weakest(grid, duel.ours, cell)
        result = stretch(grid, cell, level, [mine], below)
        if result is not None:
            return result
    return None


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


# --- a level that separates rules from rivals


_MOST_CHOICES = 2_000  # of values for axes that share inputs, in one question
_DEEPEST = 4  # halvings of levels for axes that share inputs


class LevelQuestion(NamedTuple):
    """Is there a point at which some level separates rules from rivals?"""

    # the numbers of the rules that must reach the level; without any, nothing need
    # reach it
    ours: tuple[int, ...]
    rivals: tuple[int, ...]  # the numbers of the rules that must stay below it
    ceiling: Fraction | None  # the level is at most this; None if any will do
    of: str  # what a bracket is about


def search_level(base: Arrangement, question: LevelQuestion, clock: Clock) -> State:
    """Return whether there is such a point: `Proved` if there is none."""
    return _Search(base, question, clock).state()


class _Search:
    """One question, with what was visited for it."""

    def __init__(
        self, base: Arrangement, question: LevelQuestion, clock: Clock
    ) -> None:
        self.base, self.question, self.clock = base, question, clock
        self.groups = coupled(base)
        self.levels = self.choices = 0
        self.is_open = False

    def state(self) -> State:
        if not self.base.axes:
            point = point_with(self.base, {})
            result = None if point is None else self._checked(self.base, point)
            return result or Proved("no rule has a proposition")
        try:
            result = self._sought() if self.groups else None
            if result is not None:
                return result
            result = self._at_levels(self.base)
            if result is None and self._may_hide_in_bands(self.base):
                result = self._at_levels(self.base.fine)
                if result is None and self._may_hide_in_bands(self.base.fine):
                    return self._bracket(
                        self._widest_band(), "two critical levels are too near to tell"
                    )
        except OutOfTimeError:
            return self._bracket(1.0, "the budget was spent")
        except TooManyCellsError as error:
            return self._bracket(1.0, str(error))
        if result is not None:
            return result
        if self.is_open:
            return self._bracket(
                1.0, "the inputs of its variables depend on each other"
            )
        return Proved(self._how())

    def _sought(self) -> Witness | None:
        """Return a witness that floats led to, if there is one."""
        ours, rivals, _, _ = self.question
        point = leader(self.base, ours, rivals)
        result = self._checked(self.base, point)
        if result is None:
            return None
        plain = plainer(self.base, point, ours, rivals)
        return self._checked(self.base, plain) or result

    def _duel(self, base: Arrangement) -> Duel:
        ours, rivals, _, _ = self.question
        return Duel(base, tuple(n - 1 for n in ours), tuple(n - 1 for n in rivals))

    def _levels(self, duel: Duel) -> Iterator[tuple[int, Fraction]]:
        """Yield bands from which up to another level nothing changes, and that level.

        With a ceiling, what is left below only grows with the level: the highest do.
        """
        bands, ceiling = duel.bands, self.question.ceiling
        events = duel.all_events if self.groups else duel.events
        if ceiling is not None:
            below = [n for n, high in enumerate(bands.high) if high < ceiling]
            if below:
                yield below[-1], min(ceiling, bands.low_after(below[-1]))
            return
        lows, highs = duel.base.near_levels
        result: list[tuple[float, int, int]] = []
        above = len(lows) - 1
        for band in events:
            if band + 1 < len(lows):
                result.append((highs[band] - lows[above], -band, above))
                above = band
        # Between levels far apart the lead is large, and so is the box around it.
        for _, band, above in sorted(result):
            yield -band, bands.low[above]

    def _doubtful(self, duel: Duel) -> Iterator[int]:
        """Yield bands within which the order of levels is not known and matters."""
        bands, ceiling = duel.bands, self.question.ceiling
        if ceiling is not None:
            yield from (
                n
                for n, (low, high) in enumerate(zip(bands.low, bands.high, strict=True))
                if low < ceiling <= high
            )
            return
        for band in duel.events:
            if not bands.is_sharp[band] and bands.high[band]:
                yield band

    def _how(self) -> str:
        duel = self._duel(self.base)
        cells = sum(len(options.where) for options in duel.all_options)
        axes = len(self.base.axes)
        levels, parts = counted(self.levels, "level"), counted(cells, "cell")
        text = f"{levels} with {parts} on {counted(axes, 'axis', 'axes')} visited"
        if not self.choices:
            return text
        return f"{text}, {counted(self.choices, 'choice')} of inputs"

    def _bracket(self, high: float, why: str) -> Bracket:
        return Bracket(self.question.of, 0.0, high, f"{why}: {self._how()}")

    def _widest_band(self) -> float:
        bands = self.base.fine.bands
        widest = max(b - a for a, b in zip(bands.low, bands.high, strict=True))
        return outwards(widest)[1]

    def _at_levels(self, base: Arrangement) -> Witness | None:
        duel = self._duel(base)
        known: dict[tuple[tuple[int, ...], ...], tuple[int, ...] | None] = {}
        for band, above in self._levels(duel):
            self.levels += 1
            families = tuple(options.at_gap(band) for options in duel.options)
            if families not in known:
                known[families] = cover(families, duel.full, self.clock)
            chosen = known[families]
            if chosen is None:
                continue
            result, is_open = witness_between(
                base,
                (duel.bands.high[band], above),
                partial(self._select, duel, band),
                partial(self._checked, base),
                _DEEPEST if self.groups else None,
            )
            self.is_open |= is_open
            if result is not None:
                return result
        return None

    def _may_hide_in_bands(self, base: Arrangement) -> bool:
        """Return whether a lead may be within a band."""
        duel = self._duel(base)
        known: dict[tuple[tuple[int, ...], ...], bool] = {}
        for band in self._doubtful(duel):
            self.levels += 1
            families = tuple(options.at_band(band) for options in duel.options)
            if families not in known:
                known[families] = cover(families, duel.full, self.clock) is not None
            if known[families]:
                return True
        return False

    # --- witnesses

    def _select(
        self, duel: Duel, band: int, levels: Levels, is_outer: bool
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield values of the axes that leave all rivals below at some levels."""
        if not is_outer:
            level = between(*levels)
            levels = level, level
        joined = sorted({axis for group in self.groups for axis in group})
        parts = {
            axis: [
                *parts_of(
                    duel, duel.all_options[axis], axis, band, levels, is_outer=is_outer
                )
            ]
            for axis in joined
        }
        families = {
            axis: options.at_gap(band)
            for axis, options in enumerate(duel.options)
            if axis not in parts
        }
        return selections(
            duel.base,
            parts,
            families,
            duel.full,
            self._tell,
            self.clock,
            None if is_outer else partial(part_at, duel, band, levels[0], False),
        )

    def _tell(self) -> None:
        """Count a choice of inputs, and end the search where they are too many."""
        self.clock.check()
        self.choices += 1
        if self.choices > _MOST_CHOICES:
            raise OutOfTimeError

    def _checked(self, base: Arrangement, point: Point) -> Witness | None:
        """Return a point as a witness, if it is one in fractions."""
        ours, rivals, ceiling, _ = self.question
        strengths = strengths_at(base, point)
        mine = min((strengths[n - 1] for n in ours), default=ceiling or Fraction(1))
        best = max((strengths[n - 1] for n in rivals), default=Fraction(0))
        if not (mine > best and is_within(base, point)):
            return None
        claims: tuple[Claim, ...]
        if ceiling is not None:
            claims = (Claim("below", rules=rivals, level=str(ceiling)),)
        else:
            claims = (
                Claim("beats", rules=ours, rivals=rivals),
                *(
                    Claim("strength", rules=(n,), level=str(strengths[n - 1]))
                    for n in ours
                ),
            )
        region = region_around(base, point, ours, rivals, between=(best, mine))
        return Witness(coordinates(point), claims, region)


# --- does a rule win

_TOLERANCE: Final = 1e-6  # of a lead, at which boxes end


def wins(
    base: Arrangement, rule: int, rivals: Collection[int], clock: Clock | None = None
) -> State:
    """Return whether a rule is somewhere stronger than each of some others.

    Returns:
        `Proved`: it never is. `Witness`: it is, at a point that was evaluated in
        fractions. `Bracket`: the largest lead, where time or inputs that depend on each
        other leave it open.
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    if base.is_empty:
        return Proved("the domain has no point")
    by_boxes = partial(
        wins_by_boxes, base.rules, base.domain, rule, others, tolerance=_TOLERANCE
    )
    if base.rules.semantics.conjunction == "product" or not base.is_kept:
        return by_boxes(clock)
    question = LevelQuestion((rule,), others, None, f"the largest lead of rule {rule}")
    # Half of the time for cells, the rest for boxes: they see that propositions cancel,
    # and know inputs that depend on each other.
    result = search_level(base, question, clock.share(0.5))
    if not isinstance(result, Bracket):
        return result
    other = by_boxes(clock.share(0.9))
    if not isinstance(other, Bracket):
        return other
    return min(result, other, key=lambda one: one.high)


# --- by how much a rule leads

_STEPS = 10  # halvings of the upper end


def largest_lead(
    base: Arrangement,
    rule: int,
    rivals: Collection[int],
    won: Witness,
    enough: Fraction,
    clock: Clock | None = None,
) -> Bracket:
    """Return bounds of a rule's largest lead over the strongest of some others.

    Under the minimum a lead of d somewhere means that a choice of cells has the rule
    reach a level d above one below which every rival has values. The places within the
    cells are not determined, so this bounds the lead from above. From below it is the
    best point that floats led to, evaluated in fractions.

    `won`: A point at which the rule wins; `enough`: once a lead of this much is found,
    the upper end is not worked out.
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    best = point_of(won.point)
    low = lead_at(base, best, (rule,), others)
    if low < enough:
        result = leader(base, (rule,), others)
        if is_within(base, result) and lead_at(base, result, (rule,), others) > low:
            best = plainer(base, result, (rule,), others)
            low = lead_at(base, best, (rule,), others)
    name = f"the largest lead of rule {rule}"
    claims = (
        Claim("beats", rules=(rule,), rivals=others),
        *_strengths(base, best, (rule, *others)),
    )
    high, why = Fraction(1), "a lead that large is enough"
    if low < enough:
        if base.rules.semantics.conjunction == "product" or not base.is_kept:
            wide = largest_lead_by_boxes(base.rules, base.domain, rule, others, clock)
            high, why = Fraction(wide.high), wide.why
        else:
            high, why = _bound(base, rule, others, low, clock)
    return Bracket(
        name, outwards(low)[0], outwards(high)[1], why, coordinates(best), claims
    )


def _strengths(
    base: Arrangement, point: Point, rules: Collection[int]
) -> tuple[Claim, ...]:
    """Return claims of the strengths of a rule and of the strongest of others."""
    strengths = strengths_at(base, point)
    first, *others = rules
    strongest = [first]
    if others:
        strongest.append(max(others, key=lambda number: strengths[number - 1]))
    return tuple(
        Claim("strength", rules=(number,), level=str(strengths[number - 1]))
        for number in strongest
    )


def _bound(
    base: Arrangement, rule: int, rivals: tuple[int, ...], low: Fraction, clock: Clock
) -> tuple[Fraction, str]:
    """Return what the lead does not exceed, and how that is known."""
    duel = Duel(base, (rule - 1,), tuple(number - 1 for number in rivals))
    high = Fraction(1)
    try:
        for step in range(_STEPS):
            # The true lead tends to be small: begin near the lower end.
            middle = low + (high - low) / (64 if step == 0 else 2)
            if middle <= low:
                break
            if _may_reach(duel, middle, clock):
                low = middle
            else:
                high = middle
    except OutOfTimeError:
        return high, "the budget was spent"
    return high, "the places within the cells are not determined"


def _may_reach(duel: Duel, lead: Fraction, clock: Clock) -> bool:
    """Return whether a lead cannot be excluded."""
    bands = duel.bands
    for band in duel.events:
        top = bisect_left(bands.high, bands.low[band] + lead)
        families = [options.masks(options.top >= top, band) for options in duel.options]
        if cover(families, duel.full, clock) is not None:
            return True
    return False
