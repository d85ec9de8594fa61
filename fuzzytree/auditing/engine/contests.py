"""What a rule can reach and which rivals it can leave below, axis by axis.

Under the minimum, a rule is stronger than its rivals at a point exactly if some level t
lies above all of their strengths and not above its own. At such a level every axis must
keep the rule at t or above, and every rival must be below t on some axis. In a cell the
elements are in strict order, so what a value of the axis leaves below t is nested: as
far as it is below the rule's element, an element is left below at exactly the levels
above its least value in the cell and up to the rule's largest. So a cell is one option,
told by bands: `top` of the rule, and `floor` of each rival.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.auditing.engine.covering import maximal
from fuzzytree.auditing.engine.ground import Bands, Ground, Laid
from fuzzytree.auditing.engine.parts import START
from fuzzytree.model.interrupts import checkpoint

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import IntArray

NEVER = np.iinfo(np.int64).max
_MOST_BITS = 63


class Options(msgspec.Struct, frozen=True, eq=False, dict=True):
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


class Contest(msgspec.Struct, frozen=True, eq=False, dict=True):
    """Some rules, taken together as their minimum, against rivals.

    Attributes:
        ground: Where.
        ours: The positions of the rules; without any it is a rule that asks nothing.
        rivals: The positions of the rivals.
    """

    ground: Ground
    ours: tuple[int, ...]
    rivals: tuple[int, ...]

    @property
    def full(self) -> int:
        """All rivals as bits."""
        return (1 << len(self.rivals)) - 1

    @property
    def bands(self) -> Bands:
        """The critical levels."""
        return self.ground.laid[1]

    @functools.cached_property
    def options(self) -> tuple[Options, ...]:
        """The options on each axis, without those that another one makes useless."""
        return tuple(map(_undominated, self.all_options))

    @functools.cached_property
    def all_inner(self) -> tuple[Options, ...]:
        """All but lower ends: these are surfaces, but where an axis is one value."""
        return tuple(map(_inner, self.all_options))

    @functools.cached_property
    def inner_options(self) -> tuple[Options, ...]:
        """Of these the ones that no other one makes useless."""
        return tuple(map(_undominated, self.all_inner))

    @functools.cached_property
    def all_options(self) -> tuple[Options, ...]:
        """The options on each axis."""
        return tuple(_options(self, laid) for laid in self.ground.laid[0])

    @functools.cached_property
    def events(self) -> tuple[int, ...]:
        """The bands at which options come or go, the highest first."""
        return _events(self.options)

    @functools.cached_property
    def inner_events(self) -> tuple[int, ...]:
        """The same without lower ends."""
        return _events(self.inner_options)

    @functools.cached_property
    def all_events(self) -> tuple[int, ...]:
        """The same for all options, the useless ones too."""
        return _events(self.all_options)


def _events(every: Iterable[Options]) -> tuple[int, ...]:
    found = {0}  # without rivals nothing happens down to the lowest level
    for options in every:
        found.update(options.events.tolist())
    return tuple(sorted(found, reverse=True))


def weakest(laid: Laid, rules: Sequence[int], cell: int) -> int:
    """Return the element that is the least of some rules' degrees in a cell."""
    rank = laid.cells.start_rank if cell == START else laid.cells.rank[cell]
    of = laid.of_start if cell == START else laid.of[:, cell]
    chosen = [int(of[rule]) for rule in rules] or [0]
    return min(chosen, key=lambda one: int(rank[one]))


def _options(contest: Contest, laid: Laid) -> Options:
    checkpoint()
    cells = laid.cells
    count = len(cells.rank)
    columns = np.arange(count)
    rivals = np.array(contest.rivals, dtype=np.int64)
    mine = np.zeros(count, dtype=np.int64)  # the curve that is always 1
    for rule in contest.ours:
        other = laid.of[rule]
        mine = np.where(
            cells.rank[columns, other] < cells.rank[columns, mine], other, mine
        )
    theirs = laid.of[rivals]
    is_below = cells.rank[columns, theirs] < cells.rank[columns, mine]
    floor = np.where(is_below, laid.least[theirs, columns], NEVER).T
    top = laid.most[mine, columns]
    parts = [(columns, top, floor)]
    if not contest.ground.opens(laid.axis.variable.name):
        parts.append(_start(contest, laid, rivals))
    parts.append(_zones(contest, laid))
    where, tops, floors = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Options(where, tops, floors)


def _start(
    contest: Contest, laid: Laid, rivals: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the option of the axis's lower end, which no cell holds."""
    mine = weakest(laid, contest.ours, START)
    theirs = laid.of_start[rivals]
    rank = laid.cells.start_rank
    floor = np.where(rank[theirs] < rank[mine], laid.at[theirs, 0], NEVER)
    return np.array([START]), laid.at[mine, :1], floor[np.newaxis]


def _zones(contest: Contest, laid: Laid) -> tuple[IntArray, IntArray, IntArray]:
    """Return options of places with more than one in them: whatever may be there."""
    vague = np.flatnonzero(laid.cells.is_vague)

    def bands_of(rule: int) -> tuple[IntArray, IntArray]:
        groups = laid.axis.asked[rule]
        at = laid.at[:, vague]
        low = high = np.full(len(vague), np.iinfo(np.int64).max - 1)
        if not groups:
            low = high = at[0]
        for group in groups:
            low = np.minimum(low, at[list(group)].max(axis=0))
            high = np.minimum(high, at[list(group)].max(axis=0))
        return low, high

    tops = [laid.at[0, vague], *(bands_of(rule)[1] for rule in contest.ours)]
    top = np.min(tops, axis=0)
    floor = np.array([bands_of(rule)[0] for rule in contest.rivals], dtype=np.int64)
    floor = floor.reshape(len(contest.rivals), len(vague)).T
    return -2 - vague, top, floor


def _inner(options: Options) -> Options:
    kept = options.where != START
    if not (options.where >= 0).any():
        return options
    return Options(options.where[kept], options.top[kept], options.floor[kept])


def _undominated(options: Options) -> Options:
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
    return Options(options.where[chosen], options.top[chosen], options.floor[chosen])
