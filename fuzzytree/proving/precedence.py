"""Does a rule decide by its place, where it ties with later ones? Exactly, under min.

Of equally strong rules the first one decides. Under the minimum, ties fill whole
regions: rules that grew from one node share clauses, and are equally strong wherever a
shared one is the weakest.

On such a region the rule's strength t is its degree on one axis, which *binds*; a later
rule that is below t on no axis has there the same degree. So for each axis that may
bind, and each level t between two critical ones, a cell in which the rule's degree
takes the value t leaves behind every rival that is weaker there, and every later one
that is equal; the other axes leave below t what they can
(`fuzzytree.proving.contests`). Or a later rule's degree stays at a critical level
throughout a cell: then the rule must reach it, and no more. Ties at single levels or
places, without an interior, are not looked for.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.proving.clock import Clock, OutOfTimeError
from fuzzytree.proving.contests import NEVER, Contest, Options, weakest
from fuzzytree.proving.covering import cover, maximal
from fuzzytree.proving.ground import Ground, Laid, strengths_at
from fuzzytree.proving.linear import simple
from fuzzytree.proving.parts import START, Stretch, stretch
from fuzzytree.proving.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
)
from fuzzytree.proving.witnesses import is_within, point_with

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import IntArray


def precedes(
    given: Ground,
    rule: int,
    before: Collection[int],
    after: Collection[int],
    clock: Clock | None = None,
) -> State:
    """Return whether a rule ties with later rules, and no rival is stronger.

    Args:
        given: The rules and the box; its rules are joined by the minimum.
        rule: The number of the rule, from 1.
        before: The numbers of rivals that it must be stronger than.
        after: The numbers of rivals that it must be at least as strong as.
        clock: How much time there is; no limit unless given.

    Returns:
        `Proved`: nowhere on a set with an interior, unless the rule is even stronger
        than all rivals; that is to be asked before. `Witness`: at a point that was
        evaluated in fractions. `Bracket`: it is left open.
    """
    clock = clock or Clock()
    if given.is_empty or not after:
        return Proved("no later rule to tie with")
    search = _Search(given, rule, tuple(sorted(before)), tuple(sorted(after)), clock)
    try:
        found = search.found()
        if found is None and search.may_hide():
            search = search.refined()
            found = search.found()
            if found is None and search.may_hide():
                search.is_open = True
    except OutOfTimeError:
        return _left_open(rule, "the budget was spent")
    if found is not None:
        return found
    if search.is_open:
        return _left_open(rule, "critical levels or inputs depend on each other")
    return Proved(f"{search.levels} levels visited")


def _left_open(rule: int, why: str) -> Bracket:
    return Bracket(f"the strength at which rule {rule} wins a tie", 0.0, 1.0, why)


class _Options(NamedTuple):
    """What a rule has on one axis, option by option.

    A level is told by a whole number: 2 b is band b itself, 2 b + 1 is all that lies
    between it and the next one.

    Attributes:
        where: The cell; `START` for the axis's lower end; below it for a place that is
            not known exactly, which counts within bands only.
        least: The level of the rule's least degree there.
        most: That of its largest one.
        floor: Shape (options, rivals): the level of each weaker rival's least degree;
            `NEVER` for one that is not weaker.
        flat: Shape (options, rivals): the level at which a later rival stays; -1 for
            any other.
        tied: The rivals that are weaker or, being later, equal, as bits; 0 if none is
            equal.
    """

    where: IntArray
    least: IntArray
    most: IntArray
    floor: IntArray
    flat: IntArray
    tied: tuple[int, ...]

    def behind(self, at: int, *, is_vague: bool = False) -> tuple[int, ...]:
        """Return the largest sets of rivals that do not exceed a level."""
        if is_vague:
            fits, below = self.most >= at, self.floor <= at
        else:
            fits, below = self._reach(at), self.floor < at
        return maximal(map(_bits, (below | (self.flat == at))[fits]))

    def _reach(self, at: int) -> npt.NDArray[np.bool_]:
        is_held = (self.least == at) & (self.most == at)
        return np.asarray((self.where >= START) & ((self.most > at) | is_held))

    def binding(self, at: int, *, is_vague: bool = False) -> list[int]:
        """Return the options on which the rule's degree takes a level, in a tie."""
        if is_vague:
            fits = (self.least <= at) & (self.most >= at)
        else:
            fits = (self.least < at) & (self.most > at)
        fits &= self.where > START
        return [n for n in fits.nonzero()[0].tolist() if self.tied[n]]

    def reaching(self, at: int, rivals: Sequence[int]) -> list[int]:
        """Return the options on which some rivals do not exceed a level."""
        below = (self.floor < at) | (self.flat == at)
        fits = self._reach(at) & below[:, rivals].all(axis=1)
        return [int(number) for number in fits.nonzero()[0]]


def _bits(flags: npt.NDArray[np.bool_]) -> int:
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")


def _options(contest: Contest, laid: Laid, plain: Options, late: int) -> _Options:
    """Return the options of an axis.

    Args:
        contest: The rule and its rivals, the later ones last.
        laid: The axis.
        plain: Its options without ties.
        late: How many rivals are later.
    """
    rule = contest.ours[0]
    rivals = np.array(contest.rivals, dtype=np.int64)
    is_late = np.arange(len(rivals)) >= len(rivals) - late
    least = plain.top.copy()
    flat = np.full(plain.floor.shape, -1, dtype=np.int64)
    tied: list[int] = []
    for number, cell in enumerate(plain.where.tolist()):
        if cell < START:
            tied.append(0)
            continue
        rank = laid.cells.start_rank if cell == START else laid.cells.rank[cell]
        of = laid.of_start if cell == START else laid.of[:, cell]
        low = high = laid.at[of[rivals], 0]
        if cell > START:
            least[number] = laid.least[of[rule], cell]
            low, high = laid.least[of[rivals], cell], laid.most[of[rivals], cell]
        flat[number] = np.where(is_late & (low == high), 2 * low, -1)
        mine, theirs = rank[of[rule]], rank[of[rivals]]
        equal = is_late & (theirs == mine)
        tied.append(_bits(equal | (theirs < mine)) if equal.any() else 0)
    floor = np.where(
        plain.floor < NEVER, 2 * np.minimum(plain.floor, NEVER // 4), NEVER
    )
    return _Options(plain.where, 2 * least, 2 * plain.top, floor, flat, tuple(tied))


class _Search:
    """One question, with what was visited for it."""

    def __init__(
        self,
        given: Ground,
        rule: int,
        before: tuple[int, ...],
        after: tuple[int, ...],
        clock: Clock,
    ) -> None:
        self.given, self.rule, self.clock = given, rule, clock
        self.before, self.after = before, after
        rivals = tuple(number - 1 for number in (*before, *after))
        self.contest = Contest(given, (rule - 1,), rivals)
        self.laid, self.bands = given.laid
        self.options = tuple(
            _options(self.contest, laid, plain, len(after))
            for laid, plain in zip(self.laid, self.contest.all_options, strict=True)
        )
        self.axes = [n for n, one in enumerate(self.options) if any(one.tied)]
        flats = np.concatenate([one.flat.ravel() for one in self.options])
        self.flats = set(flats[flats >= 0].tolist())
        self.levels = 0
        self.is_open = False

    def refined(self) -> _Search:
        """Return the same search with levels known as fractions."""
        fine = self.given.fine
        return _Search(fine, self.rule, self.before, self.after, self.clock)

    def found(self) -> Witness | None:
        """Return a witness at some level, None if there is none."""
        for at in self._levels():
            if at % 2 == 0 and not self.bands.is_sharp[at // 2]:
                continue
            for axis, chosen in self._choices(at):
                found = self._witness(axis, at, chosen)
                if found is not None:
                    return found
                self.is_open = True
        return None

    def may_hide(self) -> bool:
        """Return whether a tie within a band cannot be excluded."""
        return any(
            True
            for at in self._levels()
            if at % 2 == 0 and not self.bands.is_sharp[at // 2]
            for _ in self._choices(at, is_vague=True)
        )

    def _levels(self) -> list[int]:
        """Return the levels of a tie between which nothing changes, highest first."""
        if not self.axes and not self.flats:
            return []
        found = set(self.flats)
        for options in self.options:
            ends = (options.least, options.most, options.floor.ravel())
            found.update(at for one in ends for at in one.tolist() if at < NEVER)
        last = 2 * (len(self.bands.low) - 1)
        every = found | {at + 1 for at in found if at < last}
        is_zero = {0} if not self.bands.high[0] else set[int]()
        return sorted(every - is_zero, reverse=True)

    def _choices(
        self, at: int, *, is_vague: bool = False
    ) -> Iterator[tuple[int | None, tuple[int, ...]]]:
        """Yield which axis binds at a level, if any, and what all leave behind."""
        self.clock.check()
        self.levels += 1
        axes: dict[int | None, tuple[int, ...]] = {None: ()} if at in self.flats else {}
        if at % 2 or is_vague:
            for axis in self.axes:
                options = self.options[axis]
                numbers = options.binding(at, is_vague=is_vague)
                if numbers:
                    axes[axis] = maximal(options.tied[n] for n in numbers)
        others = [one.behind(at, is_vague=is_vague) for one in self.options if axes]
        for bound, masks in axes.items():
            families = [masks if n == bound else one for n, one in enumerate(others)]
            chosen = cover(families, self.contest.full, self.clock)
            if chosen is not None:
                yield bound, chosen

    # --- witnesses

    def _witness(
        self, axis: int | None, at: int, chosen: Sequence[int]
    ) -> Witness | None:
        """Return a point at a level where an axis binds, checked in fractions."""
        if axis is None:
            return self._checked(self._others({}, at, self.bands.low[at // 2], chosen))
        options = self.options[axis]
        for number in options.binding(at):
            if chosen[axis] & ~options.tied[number]:
                continue
            bound = self._bound(axis, int(options.where[number]), at // 2)
            if bound is not None:
                part, level = bound
                found = self._checked(self._others({axis: part}, at, level, chosen))
                if found is not None:
                    return found
        return None

    def _bound(
        self, axis: int, cell: int, band: int
    ) -> tuple[Stretch, Fraction] | None:
        """Return a value in a cell whose degree lies just above a band, and that."""
        laid = self.laid[axis]
        mine = weakest(laid, self.contest.ours, cell)
        low, high = self.bands.high[band], self.bands.low[band + 1]
        above = stretch(laid, cell, low + (high - low) / 4, [mine], [])
        below = stretch(laid, cell, high - (high - low) / 4, [], [mine])
        if above is None or below is None:
            return None
        ends = max(above.low, below.low), min(above.high, below.high)
        if ends[0] >= ends[1]:
            return None
        value = simple(*ends)
        level = laid.axis.elements[mine].degree(value)
        return Stretch(value, value, is_open=False), level

    def _others(
        self,
        wanted: dict[int, Stretch],
        at: int,
        level: Fraction,
        chosen: Sequence[int],
    ) -> dict[int, Stretch] | None:
        """Return values of the other axes that leave behind what they are to leave."""
        found, left = dict(wanted), self.contest.full
        for axis in wanted:
            left &= ~chosen[axis]
        order = sorted(range(len(chosen)), key=lambda n: -chosen[n].bit_count())
        for axis in order:
            if axis in found:
                continue
            need = chosen[axis] & left
            part = self._part(axis, at, level, need)
            if part is None:
                return None
            found[axis] = part
            left &= ~need
        return found

    def _part(self, axis: int, at: int, level: Fraction, need: int) -> Stretch | None:
        laid, options = self.laid[axis], self.options[axis]
        bits = [n for n in range(len(self.contest.rivals)) if need >> n & 1]
        fits = options.reaching(at, bits)
        for number in sorted(fits, key=lambda n: -int(options.most[n]))[:4]:
            cell = int(options.where[number])
            if cell > START and options.least[number] == options.most[number] == at:
                return Stretch(*laid.cells.between[cell])
            lows = {
                weakest(laid, [self.contest.rivals[n]], cell)
                for n in bits
                if options.flat[number, n] != at
            }
            mine = weakest(laid, self.contest.ours, cell)
            part = stretch(laid, cell, level, [mine], lows)
            if part is not None:
                return part
        return None

    def _checked(self, wanted: dict[int, Stretch] | None) -> Witness | None:
        """Return a point of some values of the axes, if it is one in fractions."""
        point = None if wanted is None else point_with(self.given, wanted)
        if point is None or not is_within(self.given, point):
            return None
        strengths = strengths_at(self.given, point)
        mine = strengths[self.rule - 1]
        is_first = (
            mine > 0
            and all(strengths[n - 1] < mine for n in self.before)
            and all(strengths[n - 1] <= mine for n in self.after)
        )
        if not is_first:
            return None
        claim = Claim("strength", rules=(self.rule,), level=str(mine))
        return Witness(coordinates(point), (claim,))
