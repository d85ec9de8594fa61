"""Are rules equally strong, and the strongest, on a set with an interior?

Under the minimum, rules tie on more than a surface where their weakest clause is the
same curve on one axis, the *pivot*: there the level is that curve's value, all the
rules reach it on the other axes, and every rival stays at or below it: on some other
axis strictly below, or on the pivot as a curve that is below or equal. The level moves
with the pivot's value, so levels between two critical ones suffice; a constant curve
has one level, which is a critical one. Two rules may also be constant at one level on
different axes; then there are two pivots.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.engine.arrangement import Ground, TooManyCellsError
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import variable_value
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.options import (
    Contest,
    Part,
    at_most,
    choices,
    cover,
    nested,
    parts_of,
    union,
    weakest,
)
from fuzzytree.auditing.engine.pivots import (
    Asked,
    Pivot,
    checked,
    crossed,
    ends_of,
    flat_family,
    levels_of,
    part_at,
    pivots,
    stays,
    value_of,
    whole,
)
from fuzzytree.auditing.engine.probes import leader
from fuzzytree.auditing.engine.product_ties import tie_of_products
from fuzzytree.auditing.engine.states import Declined, Proved, State, Witness
from fuzzytree.auditing.engine.witnesses import (
    START,
    Stretch,
    coupled,
    have_one_direction,
    point_with,
    widest,
)

_DEEPEST: Final = 5  # halvings of the levels of a pivot
_MOST_CHOICES: Final = 4_000  # of values for axes that share inputs, in one question

_Levels = tuple[Fraction, Fraction]


class Sharing:
    """One question, on axes some of which share inputs.

    Args:
        contest: The rules and their rivals.
        asked: Which of them.
        clock: How much time there is.
    """

    def __init__(self, contest: Contest, asked: Asked, clock: Clock) -> None:
        self.contest, self.asked, self.clock = contest, asked, clock
        given = contest.ground
        self.joined = sorted({axis for group in coupled(given) for axis in group})
        self.tell = at_most(_MOST_CHOICES, clock)

    def leader(self) -> Witness | None:
        """Return a point at which a single rule leads, if floats lead to one."""
        given, asked = self.contest.ground, self.asked
        if len(asked.ours) > 1:
            return None
        point = leader(given, asked.ours, asked.rivals)
        for laid in given.laid[0]:
            value = variable_value(laid.axis.variable, point)
            cells = laid.cells.between
            if cells and not any(low < value < high for low, high in cells):
                return None
        return checked(given, asked, point)

    def search(
        self, pivot: Pivot, band: int, *, is_flat: bool
    ) -> tuple[Witness | None, bool]:
        """Return a point at which ours tie, and whether there may be one unfound.

        Args:
            pivot: What holds ours.
            band: The band of its level; or the one below, where it is not constant.
            is_flat: Whether it is.
        """
        bands = self.contest.bands
        first, last = bands.high[band], bands.low_after(band)
        if is_flat:
            first = last = bands.low[band]
        todo = [((first, last), 0)]
        is_open = False
        while todo:
            levels, depth = todo.pop()
            if not any(self._fitting(pivot, band, levels, is_flat, is_outer=True)):
                continue
            for wanted in self._fitting(pivot, band, levels, is_flat, is_outer=False):
                point = point_with(self.contest.ground, wanted)
                if point is not None:
                    found = checked(self.contest.ground, self.asked, point)
                    if found is not None:
                        return found, False
            if is_flat or depth == _DEEPEST:
                is_open = True
                continue
            low, high = levels
            middle = (low + high) / 2
            todo += [((low, middle), depth + 1), ((middle, high), depth + 1)]
        return None, is_open

    def _fitting(
        self,
        pivot: Pivot,
        band: int,
        levels: _Levels,
        is_flat: bool,
        *,
        is_outer: bool,
    ) -> Iterator[dict[int, Stretch]]:
        """Yield values of the axes at which ours tie, or may at some of the levels."""
        held = self._held(pivot, levels, is_flat=is_flat, is_outer=is_outer)
        if held is None:
            return
        contest, laid = self.contest, self.contest.ground.laid[0][pivot.axis]
        goal = contest.full & ~union(part.mask for part in pivot.all)
        if not is_outer and not is_flat:
            level = laid.axis.elements[pivot.element].degree(held[pivot.axis].low)
            levels = level, level
        parts = {
            axis: [*self._parts(axis, band, levels, is_flat=is_flat, is_outer=is_outer)]
            for axis in self.joined
            if axis not in held
        }
        free = [
            axis
            for axis in range(len(contest.inner_options))
            if axis not in held and axis not in parts
        ]
        families = [
            flat_family(contest, self.asked, axis, band)
            if is_flat
            else contest.inner_options[axis].at_gap(band)
            for axis in free
        ]
        rest = union(mask for family in families for mask in family)
        given = contest.ground
        for wanted, covered in choices(given, parts, goal, rest, held, self.tell):
            left = goal & ~covered
            chosen = cover(families, left, self.clock)
            if chosen is None:
                continue
            if is_outer:
                yield wanted
                continue
            flat = band if is_flat else None
            found = {
                axis: part_at(contest, axis, levels[0], mask & left, flat)
                for axis, mask in zip(free, chosen, strict=True)
            }
            whole_of = {axis: part for axis, part in found.items() if part is not None}
            if len(whole_of) == len(found):
                yield wanted | whole_of

    def _held(
        self, pivot: Pivot, levels: _Levels, *, is_flat: bool, is_outer: bool
    ) -> dict[int, Stretch] | None:
        """Return where the pivot is at some of the levels: one value if not outer."""
        every = self.contest.ground.laid[0]
        if is_flat:
            return {part.axis: whole(every[part.axis], part.cell) for part in pivot.all}
        laid = every[pivot.axis]
        if is_outer:
            part = widest(laid, pivot.cell, levels, [pivot.element], [pivot.element])
            return None if part is None else {pivot.axis: part}
        at = value_of(laid, pivot, levels)
        return None if at is None else {pivot.axis: Stretch(at, at, is_open=False)}

    def _parts(
        self,
        axis: int,
        band: int,
        levels: _Levels,
        *,
        is_flat: bool,
        is_outer: bool,
    ) -> Iterator[Part]:
        """Yield where ours reach a level on an axis, with the rivals left below."""
        contest = self.contest
        options = contest.all_inner[axis]
        if not is_flat:
            yield from parts_of(contest, options, axis, band, levels, is_outer=is_outer)
            return
        laid = contest.ground.laid[0][axis]
        first_weak = len(self.asked.strict)
        for number in (options.where >= START).nonzero()[0].tolist():
            cell = int(options.where[number])
            mine = weakest(laid, contest.ours, cell)
            equal = {
                n
                for n in range(first_weak, len(contest.rivals))
                if stays(contest, laid, cell, n, band)
            }
            below = {
                n: weakest(laid, [contest.rivals[n]], cell)
                for n in range(len(contest.rivals))
                if n not in equal and options.floor[number, n] < band
            }
            held = union(1 << n for n in equal)
            found = nested(laid, cell, levels, mine, below, is_outer=is_outer)
            yield from ((part, mask | held) for part, mask in found)


# --- the search


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
    sharing = Sharing(contest, asked, clock) if coupled(given) else None
    led = None if sharing is None else sharing.leader()
    if led is not None:
        return led
    is_each = sharing is not None
    held_by = [
        pivot
        for axis in range(len(given.laid[0]))
        for pivot in pivots(contest, asked, axis, is_each=is_each)
    ]
    held_by += crossed(contest, asked, is_each=is_each)
    bands, levels = contest.bands, 0
    is_vague = is_open = False
    floors = [options.at_gap for options in contest.inner_options]
    for pivot in held_by:
        held = {part.axis: part.mask for part in pivot.all}
        masks = [(mask,) for mask in held.values()]
        least, most = ends_of(given.laid[0][pivot.axis], pivot.element, pivot.cell)
        is_flat = least == most
        if is_flat and not bands.is_sharp[least]:
            clock.check()
            vague = [
                flat_family(contest, asked, axis, least, is_within=True)
                for axis in range(len(floors))
                if axis not in held
            ]
            if cover([*masks, *vague], contest.full, clock) is None:
                continue
            # What may be there is looked for as at a level that is known exactly.
            is_vague = True
        tried = [least] if is_flat else levels_of(contest, least, most, is_each=is_each)
        for band in tried:
            clock.check()
            levels += 1
            families = [
                flat_family(contest, asked, axis, band)
                if is_flat
                else floors[axis](band)
                for axis in range(len(floors))
                if axis not in held
            ]
            chosen = cover([*masks, *families], contest.full, clock)
            if chosen is None:
                continue
            if sharing is not None:
                found, is_left = sharing.search(pivot, band, is_flat=is_flat)
                is_open |= is_left
            else:
                rest = chosen[len(held) :]
                found = _witness(contest, asked, pivot, band, rest, is_flat=is_flat)
                is_vague |= found is None
            if found is not None:
                return found
    if is_vague and not given.is_fine:
        return _searched(given.fine, asked, clock)
    if is_vague:
        return asked.open("two critical levels are too near to tell")
    if is_open or have_one_direction(given):
        reason = "the inputs of its variables depend on each other"
        return Declined("FTD04", reason)
    return Proved(f"{len(held_by)} cells where they share a curve, {levels} levels")


def _witness(
    contest: Contest,
    asked: Asked,
    pivot: Pivot,
    band: int,
    chosen: Sequence[int],
    *,
    is_flat: bool,
) -> Witness | None:
    """Return a point at which ours tie, if one is found."""
    given = contest.ground
    laid = given.laid[0][pivot.axis]
    if is_flat:
        at: Fraction | None = simple(*whole(laid, pivot.cell)[:2])
    else:
        levels = contest.bands.high[band], contest.bands.low_after(band)
        at = value_of(laid, pivot, levels)
    if at is None:
        return None
    level = laid.axis.elements[pivot.element].degree(at)
    wanted = {pivot.axis: Stretch(at, at, is_open=False)}
    left = contest.full
    for held in pivot.all:
        if is_flat:
            wanted[held.axis] = whole(given.laid[0][held.axis], held.cell)
        left &= ~held.mask
    others = [axis for axis in range(len(given.laid[0])) if axis not in wanted]
    for axis, mask in zip(others, chosen, strict=True):
        flat = band if is_flat else None
        found = part_at(contest, axis, level, mask & left, flat)
        if found is None:
            return None
        wanted[axis] = found
        left &= ~mask
    point = point_with(given, wanted)
    return None if point is None else checked(given, asked, point)
