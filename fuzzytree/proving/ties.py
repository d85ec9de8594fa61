"""Are rules equally strong on a set with an interior, and nobody stronger?

Under the minimum, rules tie on more than a surface where their weakest clause is the
same curve on one axis, the *pivot*: there the level is that curve's value, all the
rules reach it on the other axes, and every rival stays at or below it: on some other
axis strictly below, or on the pivot as a curve that is below or equal. The level moves
with the pivot's value, so levels between two critical ones suffice; a curve that is
constant has its one level, which is then a critical one. Two rules may be constant at
one level on different axes too; there are two pivots then.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.proving.clock import Clock, OutOfTimeError
from fuzzytree.proving.contests import Contest, weakest
from fuzzytree.proving.covering import cover, maximal
from fuzzytree.proving.ground import Ground, Laid, TooManyCellsError
from fuzzytree.proving.linear import simple
from fuzzytree.proving.parts import START, Stretch, part_of, stretch
from fuzzytree.proving.products import tie_of_products
from fuzzytree.proving.shared import is_constant
from fuzzytree.proving.states import Declined, Proved, State, Witness
from fuzzytree.proving.tied import Asked, checked
from fuzzytree.proving.witnesses import point_with

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import IntArray

    BoolArray = npt.NDArray[np.bool_]


class _Pivot(NamedTuple):
    """Where a rule, or all of ours, are as strong as one curve.

    Attributes:
        axis: The axis.
        cell: The cell.
        element: The curve.
        mask: The rivals that do not exceed it.
        beside: Where the rest of ours are as strong as theirs, of the same level.
    """

    axis: int
    cell: int
    element: int
    mask: int
    beside: _Pivot | None = None

    @property
    def all(self) -> tuple[_Pivot, ...]:
        return (self,) if self.beside is None else (self, self.beside)


def tie(given: Ground, one: int, other: int, clock: Clock | None = None) -> State:
    """Return whether two rules tie as the strongest, on a set with an interior.

    Args:
        given: The rules and the box.
        one: The number of a rule, from 1.
        other: The number of another one.
        clock: How much time there is; no limit unless given.

    Returns:
        `Proved`: they never do. `Witness`: here they do. `Bracket`: the budget leaves
        it open. `Declined`: inputs that depend on each other do.
    """
    every = range(1, len(given.rules.rules) + 1)
    rest = tuple(n for n in every if n not in (one, other))
    return _asked(given, Asked((one, other), (), rest), clock or Clock())


def decides_by_order(
    given: Ground,
    rule: int,
    before: Collection[int],
    behind: Collection[int],
    clock: Clock | None = None,
) -> State:
    """Return whether a rule is somewhere as strong as any, on a set with an interior.

    Args:
        given: The rules and the box.
        rule: The number of the rule, from 1.
        before: The numbers of the rivals that win ties against it.
        behind: The numbers of the rivals that lose them.
        clock: How much time there is; no limit unless given.

    Returns:
        As `tie`.
    """
    asked = Asked((rule,), tuple(sorted(before)), tuple(sorted(behind)))
    return _asked(given, asked, clock or Clock())


def _asked(given: Ground, asked: Asked, clock: Clock) -> State:
    if given.is_empty:
        return Proved("the domain has no point")
    if not given.axes:
        point = point_with(given, {})
        found = None if point is None else checked(given, asked, point)
        return found or Proved("no rule asks anything")
    try:
        if given.rules.semantics.conjunction == "product":
            return tie_of_products(given, asked, clock)
        return _searched(given, asked, clock)
    except OutOfTimeError:
        return asked.open("the budget was spent")
    except TooManyCellsError as error:
        return asked.open(str(error))


def _searched(given: Ground, asked: Asked, clock: Clock) -> State:
    contest = Contest(
        given,
        tuple(n - 1 for n in asked.ours),
        tuple(n - 1 for n in asked.rivals),
    )
    pivots = [
        pivot
        for axis, laid in enumerate(given.laid[0])
        for pivot in _pivots(contest, asked, axis, laid)
    ]
    pivots += _crossed(contest, asked)
    bands, levels, is_open = contest.bands, 0, False
    floors = [options.at_gap for options in contest.inner_options]
    for pivot in pivots:
        held = {part.axis: part.mask for part in pivot.all}
        masks = [(mask,) for mask in held.values()]
        least, most = _ends(given.laid[0][pivot.axis], pivot.element, pivot.cell)
        is_flat = least == most
        if is_flat and not bands.is_sharp[least]:
            clock.check()
            vague = [
                options.at_band(least)
                for axis, options in enumerate(contest.inner_options)
                if axis not in held
            ]
            if cover([*masks, *vague], contest.full, clock) is None:
                continue
            # What may be there is looked for as at a level that is known exactly.
            is_open = True
        tried = [least] if is_flat else _levels(contest, least, most)
        for band in tried:
            clock.check()
            levels += 1
            families = [
                _flat_family(contest, asked, axis, band)
                if is_flat
                else floors[axis](band)
                for axis in range(len(floors))
                if axis not in held
            ]
            chosen = cover([*masks, *families], contest.full, clock)
            if chosen is None:
                continue
            found = _witness(
                contest, asked, pivot, band, chosen[len(held) :], is_flat=is_flat
            )
            if found is not None:
                return found
            is_open = True
    if is_open and not given.is_fine:
        return _searched(given.fine, asked, clock)
    if is_open:
        reason = "the inputs of its variables depend on each other, or levels touch"
        return Declined("FTD04", reason)
    return Proved(f"{len(pivots)} cells where they share a curve, {levels} levels")


class _Seen(NamedTuple):
    """The rules' degrees in the cells of an axis; at its value where it has only one.

    Attributes:
        cells: The cells.
        of: Shape (rules, cells): the element that is a rule's degree.
        height: The same shape: its rank.
        is_zero: The same shape: whether it is 0 throughout.
    """

    cells: list[int]
    of: IntArray
    height: IntArray
    is_zero: BoolArray


def _seen(laid: Laid) -> _Seen:
    count = len(laid.cells.rank)
    if not count:
        of = laid.of_start[:, np.newaxis]
        return _Seen(
            [START], of, laid.cells.start_rank[of], laid.is_zero_at[of[:, 0], :1]
        )
    columns = np.arange(count)
    height = laid.cells.rank[columns, laid.of]
    is_zero = laid.is_zero[laid.of, columns]
    return _Seen([*range(count)], laid.of, height, is_zero)


def _whole(laid: Laid, cell: int) -> Stretch:
    """Return all of a cell, or the one value of an axis."""
    if cell == START:
        return Stretch(*laid.cells.zones[0], is_open=False)
    return Stretch(*laid.cells.between[cell])


def _ends(laid: Laid, element: int, cell: int) -> tuple[int, int]:
    """Return the bands of the least and the largest value of a curve in a cell."""
    if cell == START:
        return int(laid.at[element, 0]), int(laid.at[element, 0])
    return int(laid.least[element, cell]), int(laid.most[element, cell])


def _levels(contest: Contest, least: int, most: int) -> list[int]:
    """Return bands from which on, up to the next one, nothing changes."""
    inner = {band for band in contest.inner_events if least < band < most}
    return sorted({least, *inner})


def _pivots(contest: Contest, asked: Asked, axis: int, laid: Laid) -> list[_Pivot]:
    """Return the cells of an axis in which all of ours are the same curve, not 0."""
    seen = _seen(laid)
    ours = seen.height[np.array(contest.ours)]
    rivals = seen.height[np.array(contest.rivals, dtype=np.int64)]
    mine = seen.of[contest.ours[0]]
    fits = (ours == ours[0]).all(axis=0) & ~seen.is_zero[contest.ours[0]]
    is_below = rivals < ours[0] + _limits(asked)
    found: dict[tuple[int, int, int, int], _Pivot] = {}
    for column in np.flatnonzero(fits).tolist():
        mask = sum(1 << n for n in np.flatnonzero(is_below[:, column]).tolist())
        element, cell = int(mine[column]), seen.cells[column]
        key = element, mask, *_ends(laid, element, cell)
        found.setdefault(key, _Pivot(axis, cell, element, mask))
    return list(found.values())


def _crossed(contest: Contest, asked: Asked) -> list[_Pivot]:
    """Return pairs of constants of one level, on two axes, that hold two rules."""
    if len(asked.ours) < 2:
        return []
    one, other = ([*_held(contest, asked, rule)] for rule in contest.ours)
    found: dict[tuple[int, ...], _Pivot] = {}
    for first, level in one:
        for second, same in other:
            if first.axis != second.axis and level == same:
                key = level, first.axis, first.mask, second.axis, second.mask
                found.setdefault(key, first._replace(beside=second))
    return list(found.values())


def _held(contest: Contest, asked: Asked, rule: int) -> Iterator[tuple[_Pivot, int]]:
    """Yield where a rule, the least of ours, is constant and not 0, with the band."""
    for axis, laid in enumerate(contest.ground.laid[0]):
        seen = _seen(laid)
        height, mine = seen.height[rule], seen.of[rule]
        fits = (height <= seen.height[np.array(contest.ours)]).all(axis=0)
        fits &= ~seen.is_zero[rule]
        rivals = seen.height[np.array(contest.rivals, dtype=np.int64)]
        is_behind = rivals < height + _limits(asked)
        for column in np.flatnonzero(fits).tolist():
            element, cell = int(mine[column]), seen.cells[column]
            least, most = _ends(laid, element, cell)
            if least == most and is_constant(laid, element, cell):
                mask = sum(
                    1 << n for n in np.flatnonzero(is_behind[:, column]).tolist()
                )
                yield _Pivot(axis, cell, element, mask), least


def _limits(asked: Asked) -> IntArray:
    """Return, of each rival, by how many ranks it must stay below: 0, or 1 less."""
    return np.array([0] * len(asked.strict) + [1] * len(asked.weak), dtype=np.int64)[
        :, np.newaxis
    ]


def _flat_family(
    contest: Contest, asked: Asked, axis: int, band: int
) -> tuple[int, ...]:
    """Return what does not exceed a sharp level where ours reach it.

    Rivals are left strictly below it, or stay at it as curves that are constant.
    """
    options, laid = contest.all_inner[axis], contest.ground.laid[0][axis]
    masks: list[int] = []
    for number in np.flatnonzero(options.where >= START).tolist():
        cell = int(options.where[number])
        one = weakest(laid, contest.ours, cell)
        if options.top[number] > band or (
            options.top[number] == band
            and (cell == START or int(laid.least[one, cell]) == band)
        ):
            behind = options.floor[number] < band
            for place in range(len(asked.strict), len(behind)):
                behind[place] |= _stays(contest, laid, cell, place, band)
            masks.append(sum(1 << n for n in np.flatnonzero(behind).tolist()))
    return maximal(masks)


def _stays(contest: Contest, laid: Laid, cell: int, rival: int, band: int) -> bool:
    """Return whether a rival's curve is constant in a cell, in a band."""
    if cell == START:
        return bool(laid.at[laid.of_start[contest.rivals[rival]], 0] == band)
    element = laid.of[contest.rivals[rival], cell]
    return bool(laid.least[element, cell] == band == laid.most[element, cell])


def _witness(
    contest: Contest,
    asked: Asked,
    pivot: _Pivot,
    band: int,
    chosen: Sequence[int],
    *,
    is_flat: bool,
) -> Witness | None:
    """Return a point at which ours tie, if one is found."""
    given = contest.ground
    laid = given.laid[0][pivot.axis]
    low, high, _ = _whole(laid, pivot.cell)
    ends = low, high
    element = laid.axis.elements[pivot.element]
    if not is_flat:
        first, last = contest.bands.high[band], contest.bands.low_after(band)
        room = (last - first) / 4
        for level, is_high in ((first + room, True), (last - room, False)):
            part = part_of(element, ends, level, is_high=is_high, bits=64)
            low, high = max(low, part.low), min(high, part.high)
        if not low < high:
            return None
    at = simple(low, high)
    level = element.degree(at)
    wanted = {pivot.axis: Stretch(at, at, is_open=False)}
    left = contest.full
    for held in pivot.all:
        if is_flat:
            wanted[held.axis] = _whole(given.laid[0][held.axis], held.cell)
        left &= ~held.mask
    others = [axis for axis in range(len(given.laid[0])) if axis not in wanted]
    for axis, mask in zip(others, chosen, strict=True):
        flat = band if is_flat else None
        found = _part(contest, axis, level, mask & left, flat)
        if found is None:
            return None
        wanted[axis] = found
        left &= ~mask
    point = point_with(given, wanted)
    return None if point is None else checked(given, asked, point)


def _part(
    contest: Contest, axis: int, level: Fraction, mask: int, flat: int | None
) -> Stretch | None:
    """Return where on an axis ours reach a level and some rivals stay below it.

    Where the level is a band, `flat`, rivals may also stay in it.
    """
    options, laid = contest.all_inner[axis], contest.ground.laid[0][axis]
    every = [n for n in range(len(contest.rivals)) if mask >> n & 1]
    order = np.argsort(-options.top, kind="stable")
    for number in order[options.where[order] >= START].tolist():
        rivals = [
            n
            for n in every
            if flat is None
            or not _stays(contest, laid, int(options.where[number]), n, flat)
        ]
        if (options.floor[number, rivals] > options.top[number]).any():
            continue
        cell = int(options.where[number])
        mine = weakest(laid, contest.ours, cell)
        below = {weakest(laid, [contest.rivals[n]], cell) for n in rivals}
        found = stretch(laid, cell, level, [mine], below)
        if found is not None:
            return found
    return None
