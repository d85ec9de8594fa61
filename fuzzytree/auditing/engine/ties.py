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

from fuzzytree.auditing.engine.arrangement import Arrangement, TooManyCellsError
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import variable_value
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.options import (
    Duel,
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
    Pivot,
    TieQuestion,
    constant_pairs,
    ends_of,
    flat_family,
    levels_of,
    part_at,
    pivots,
    stays,
    tie_witness,
    value_of,
    whole,
)
from fuzzytree.auditing.engine.probes import leader
from fuzzytree.auditing.engine.product_ties import tie_of_products
from fuzzytree.auditing.engine.states import Declined, Proved, State, Witness
from fuzzytree.auditing.engine.witnesses import (
    START,
    AxisStretch,
    coupled,
    have_one_direction,
    point_with,
    widest,
)

_DEEPEST: Final = 5  # halvings of the levels of a pivot
_MOST_CHOICES: Final = 4_000  # of values for axes that share inputs, in one question

_Levels = tuple[Fraction, Fraction]


class SharedInputs:
    """One question, on axes some of which share inputs."""

    def __init__(self, duel: Duel, question: TieQuestion, clock: Clock) -> None:
        self.duel, self.question, self.clock = duel, question, clock
        base = duel.base
        self.joined = sorted({axis for group in coupled(base) for axis in group})
        self.count = at_most(_MOST_CHOICES, clock)

    def leader(self) -> Witness | None:
        """Return a point at which a single rule leads, if floats lead to one."""
        base, question = self.duel.base, self.question
        if len(question.ours) > 1:
            return None
        point = leader(base, question.ours, question.rivals)
        for grid in base.grids:
            value = variable_value(grid.axis.variable, point)
            cells = grid.cells.between
            if cells and not any(low < value < high for low, high in cells):
                return None
        return tie_witness(base, question, point)

    def search(
        self, pivot: Pivot, band: int, *, is_flat: bool
    ) -> tuple[Witness | None, bool]:
        """Return a point at which ours tie, and whether there may be one unfound.

        `pivot`: what holds ours.
        """
        bands = self.duel.bands
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
                point = point_with(self.duel.base, wanted)
                if point is not None:
                    result = tie_witness(self.duel.base, self.question, point)
                    if result is not None:
                        return result, False
            if is_flat or depth == _DEEPEST:
                is_open = True
                continue
            low, high = levels
            middle = (low + high) / 2
            todo += [((low, middle), depth + 1), ((middle, high), depth + 1)]
        return None, is_open

    def _fitting(
        self, pivot: Pivot, band: int, levels: _Levels, is_flat: bool, *, is_outer: bool
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield values of the axes at which ours tie, or may at some of the levels."""
        fixed = self._pivot_stretches(pivot, levels, is_flat=is_flat, is_outer=is_outer)
        if fixed is None:
            return
        duel, grid = self.duel, self.duel.base.grids[pivot.axis]
        goal = duel.full & ~union(part.mask for part in pivot.all)
        if not is_outer and not is_flat:
            level = grid.axis.elements[pivot.element].degree(fixed[pivot.axis].low)
            levels = level, level
        parts = {
            axis: [*self._parts(axis, band, levels, is_flat=is_flat, is_outer=is_outer)]
            for axis in self.joined
            if axis not in fixed
        }
        free = [
            axis
            for axis in range(len(duel.inner_options))
            if axis not in fixed and axis not in parts
        ]
        families = [
            flat_family(duel, self.question, axis, band)
            if is_flat
            else duel.inner_options[axis].at_gap(band)
            for axis in free
        ]
        rest = union(mask for family in families for mask in family)
        base = duel.base
        for wanted, covered in choices(base, parts, goal, rest, fixed, self.count):
            missing = goal & ~covered
            chosen = cover(families, missing, self.clock)
            if chosen is None:
                continue
            if is_outer:
                yield wanted
                continue
            flat = band if is_flat else None
            result = {
                axis: part_at(duel, axis, levels[0], mask & missing, flat)
                for axis, mask in zip(free, chosen, strict=True)
            }
            whole_of = {axis: part for axis, part in result.items() if part is not None}
            if len(whole_of) == len(result):
                yield wanted | whole_of

    def _pivot_stretches(
        self, pivot: Pivot, levels: _Levels, *, is_flat: bool, is_outer: bool
    ) -> dict[int, AxisStretch] | None:
        """Return where the pivot is at some of the levels: one value if not outer."""
        every = self.duel.base.grids
        if is_flat:
            return {part.axis: whole(every[part.axis], part.cell) for part in pivot.all}
        grid = every[pivot.axis]
        if is_outer:
            part = widest(grid, pivot.cell, levels, [pivot.element], [pivot.element])
            return None if part is None else {pivot.axis: part}
        at = value_of(grid, pivot, levels)
        return None if at is None else {pivot.axis: AxisStretch(at, at, is_open=False)}

    def _parts(
        self, axis: int, band: int, levels: _Levels, *, is_flat: bool, is_outer: bool
    ) -> Iterator[Part]:
        """Yield where ours reach a level on an axis, with the rivals left below."""
        duel = self.duel
        options = duel.all_inner[axis]
        if not is_flat:
            yield from parts_of(duel, options, axis, band, levels, is_outer=is_outer)
            return
        grid = duel.base.grids[axis]
        first_weak = len(self.question.strict)
        for number in (options.where >= START).nonzero()[0].tolist():
            cell = int(options.where[number])
            mine = weakest(grid, duel.ours, cell)
            equal = {
                n
                for n in range(first_weak, len(duel.rivals))
                if stays(duel, grid, cell, n, band)
            }
            below = {
                n: weakest(grid, [duel.rivals[n]], cell)
                for n in range(len(duel.rivals))
                if n not in equal and options.floor[number, n] < band
            }
            fixed = union(1 << n for n in equal)
            result = nested(grid, cell, levels, mine, below, is_outer=is_outer)
            yield from ((part, mask | fixed) for part, mask in result)


# --- the search


def tie(base: Arrangement, one: int, other: int, clock: Clock | None = None) -> State:
    """Return whether two rules tie as the strongest, on a set with an interior.

    Returns:
        `Proved`: they never do. `Witness`: here they do. `Bracket`: the budget leaves
        it open. `Declined`: inputs that depend on each other do.
    """
    every = range(1, len(base.rules.rules) + 1)
    rest = tuple(n for n in every if n not in (one, other))
    return _result(base, TieQuestion((one, other), (), rest), clock or Clock())


def decides_by_order(
    base: Arrangement,
    rule: int,
    before: Collection[int],
    behind: Collection[int],
    clock: Clock | None = None,
) -> State:
    """Return whether a rule is somewhere as strong as any, on a set with an interior.

    Returns:
        As `tie`.
    """
    question = TieQuestion((rule,), tuple(sorted(before)), tuple(sorted(behind)))
    return _result(base, question, clock or Clock())


def _result(base: Arrangement, question: TieQuestion, clock: Clock) -> State:
    if base.is_empty:
        return Proved("the domain has no point")
    if not base.axes:
        point = point_with(base, {})
        result = None if point is None else tie_witness(base, question, point)
        return result or Proved("no rule has a clause")
    try:
        if base.rules.semantics.conjunction == "product":
            return tie_of_products(base, question, clock)
        return _searched(base, question, clock)
    except OutOfTimeError:
        return question.open("the budget was spent")
    except TooManyCellsError as error:
        return question.open(str(error))


def _searched(base: Arrangement, question: TieQuestion, clock: Clock) -> State:
    duel = Duel(
        base, tuple(n - 1 for n in question.ours), tuple(n - 1 for n in question.rivals)
    )
    sharing = SharedInputs(duel, question, clock) if coupled(base) else None
    led = None if sharing is None else sharing.leader()
    if led is not None:
        return led
    is_each = sharing is not None
    candidates = [
        pivot
        for axis in range(len(base.grids))
        for pivot in pivots(duel, question, axis, is_each=is_each)
    ]
    candidates += constant_pairs(duel, question, is_each=is_each)
    bands, levels = duel.bands, 0
    is_vague = is_open = False
    floors = [options.at_gap for options in duel.inner_options]
    for pivot in candidates:
        fixed = {part.axis: part.mask for part in pivot.all}
        masks = [(mask,) for mask in fixed.values()]
        least, most = ends_of(base.grids[pivot.axis], pivot.element, pivot.cell)
        is_flat = least == most
        if is_flat and not bands.is_sharp[least]:
            clock.check()
            vague = [
                flat_family(duel, question, axis, least, is_within=True)
                for axis in range(len(floors))
                if axis not in fixed
            ]
            if cover([*masks, *vague], duel.full, clock) is None:
                continue
            # What may be there is looked for as at a level that is known exactly.
            is_vague = True
        tried = [least] if is_flat else levels_of(duel, least, most, is_each=is_each)
        for band in tried:
            clock.check()
            levels += 1
            families = [
                flat_family(duel, question, axis, band)
                if is_flat
                else floors[axis](band)
                for axis in range(len(floors))
                if axis not in fixed
            ]
            chosen = cover([*masks, *families], duel.full, clock)
            if chosen is None:
                continue
            if sharing is not None:
                result, is_left = sharing.search(pivot, band, is_flat=is_flat)
                is_open |= is_left
            else:
                rest = chosen[len(fixed) :]
                result = _witness(duel, question, pivot, band, rest, is_flat=is_flat)
                is_vague |= result is None
            if result is not None:
                return result
    if is_vague and not base.is_fine:
        return _searched(base.fine, question, clock)
    if is_vague:
        return question.open("two critical levels are too near to tell")
    if is_open or have_one_direction(base):
        reason = "the inputs of its variables depend on each other"
        return Declined("FTD04", reason)
    return Proved(f"{len(candidates)} cells where they share a curve, {levels} levels")


def _witness(
    duel: Duel,
    question: TieQuestion,
    pivot: Pivot,
    band: int,
    chosen: Sequence[int],
    *,
    is_flat: bool,
) -> Witness | None:
    """Return a point at which ours tie, if one is found."""
    base = duel.base
    grid = base.grids[pivot.axis]
    if is_flat:
        at: Fraction | None = simple(*whole(grid, pivot.cell)[:2])
    else:
        levels = duel.bands.high[band], duel.bands.low_after(band)
        at = value_of(grid, pivot, levels)
    if at is None:
        return None
    level = grid.axis.elements[pivot.element].degree(at)
    wanted = {pivot.axis: AxisStretch(at, at, is_open=False)}
    missing = duel.full
    for fixed in pivot.all:
        if is_flat:
            wanted[fixed.axis] = whole(base.grids[fixed.axis], fixed.cell)
        missing &= ~fixed.mask
    others = [axis for axis in range(len(base.grids)) if axis not in wanted]
    for axis, mask in zip(others, chosen, strict=True):
        flat = band if is_flat else None
        result = part_at(duel, axis, level, mask & missing, flat)
        if result is None:
            return None
        wanted[axis] = result
        missing &= ~mask
    point = point_with(base, wanted)
    return None if point is None else tie_witness(base, question, point)
