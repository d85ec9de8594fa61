"""Are rules equally strong, and the strongest, on a set with an interior?

Under the minimum, rules tie on more than a surface where their weakest proposition is
the same curve on one axis, the *pivot*: there the level is that curve's value, all the
rules reach it on the other axes, and every rival stays at or below it: on some other
axis strictly below, or on the pivot as a curve that is below or equal. The level moves
with the pivot's value, so levels between two critical ones suffice; a constant curve
has one level, which is a critical one. Two rules may also be constant at one level on
different axes; then there are two pivots.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from typing import Final

from fuzzytree.auditing.engine.arrangement import Arrangement, TooManyCellsError
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import variable_value
from fuzzytree.auditing.engine.duels import (
    Duel,
    Levels,
    Part,
    at_most,
    cover,
    nested,
    part_at,
    parts_of,
    selections,
    stays,
    union,
    weakest,
    witness_between,
)
from fuzzytree.auditing.engine.pivots import (
    Pivot,
    TieQuestion,
    constant_pairs,
    ends_of,
    flat_family,
    levels_of,
    pivots,
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
        return result or Proved("no rule has a proposition")
    try:
        if base.rules.semantics.conjunction == "product":
            return tie_of_products(base, question, clock)
        return _Search(base, question, clock).state()
    except OutOfTimeError:
        return question.open("the budget was spent")
    except TooManyCellsError as error:
        return question.open(str(error))


class _Search:
    """One question under the minimum."""

    def __init__(self, base: Arrangement, question: TieQuestion, clock: Clock) -> None:
        self.base, self.question, self.clock = base, question, clock
        ours, rivals = ([n - 1 for n in of] for of in (question.ours, question.rivals))
        self.duel = Duel(base, tuple(ours), tuple(rivals), is_inner=True)
        self.joined = sorted({axis for group in coupled(base) for axis in group})
        self.count = at_most(_MOST_CHOICES, clock)

    def state(self) -> State:
        led = self._leader() if self.joined else None
        if led is not None:
            return led
        base, question, duel = self.base, self.question, self.duel
        is_each = bool(self.joined)
        candidates = [
            pivot
            for axis in range(len(base.grids))
            for pivot in pivots(duel, question, axis, is_each=is_each)
        ]
        candidates += constant_pairs(duel, question, is_each=is_each)
        levels = 0
        is_vague = is_open = False
        for pivot in candidates:
            least, most = ends_of(base.grids[pivot.axis], pivot.element, pivot.cell)
            is_flat = least == most
            if is_flat and not duel.bands.is_sharp[least]:
                if not self._may_do(pivot, least, is_flat=True, is_within=True):
                    continue
                # What may be there is looked for as at a level that is known exactly.
                is_vague = True
            tried = [least]
            if not is_flat:
                tried = levels_of(duel, least, most, is_each=is_each)
            for band in tried:
                levels += 1
                if not self._may_do(pivot, band, is_flat=is_flat):
                    continue
                result, is_left = self._witness(pivot, band, is_flat=is_flat)
                if result is not None:
                    return result
                is_open |= is_left and is_each
                is_vague |= is_left and not is_each
        if is_vague and not base.is_fine:
            return _Search(base.fine, question, self.clock).state()
        if is_vague:
            return question.open("two critical levels are too near to tell")
        if is_open or have_one_direction(base):
            reason = "the inputs of its variables depend on each other"
            return Declined("FTD04", reason)
        return Proved(
            f"{len(candidates)} cells where they share a curve, {levels} levels"
        )

    def _leader(self) -> Witness | None:
        """Return a point at which a single rule leads, if floats lead to one."""
        base, question = self.base, self.question
        if len(question.ours) > 1:
            return None
        point = leader(base, question.ours, question.rivals)
        for grid in base.grids:
            value = variable_value(grid.axis.variable, point)
            cells = grid.cells.between
            if cells and not any(low < value < high for low, high in cells):
                return None
        return tie_witness(base, question, point)

    def _families(
        self, pivot: Pivot, band: int, *, is_flat: bool, is_within: bool = False
    ) -> dict[int, tuple[int, ...]]:
        """Return what all axes but those of a pivot can leave below."""
        duel, fixed = self.duel, {part.axis for part in pivot.all}
        return {
            axis: flat_family(duel, self.question, axis, band, is_within=is_within)
            if is_flat
            else options.at_gap(band)
            for axis, options in enumerate(duel.options)
            if axis not in fixed
        }

    def _may_do(
        self, pivot: Pivot, band: int, *, is_flat: bool, is_within: bool = False
    ) -> bool:
        """Return whether all rivals can be left below at a level, if axes are free."""
        self.clock.check()
        families = self._families(pivot, band, is_flat=is_flat, is_within=is_within)
        masks = [(part.mask,) for part in pivot.all]
        every = [*masks, *families.values()]
        return cover(every, self.duel.full, self.clock) is not None

    def _witness(
        self, pivot: Pivot, band: int, *, is_flat: bool
    ) -> tuple[Witness | None, bool]:
        """Return a point at which ours tie, and whether there may be one unfound."""
        bands, grid = self.duel.bands, self.base.grids[pivot.axis]
        levels = bands.high[band], bands.low_after(band)
        if is_flat:
            low, high, _ = whole(grid, pivot.cell)
            level = grid.axis.elements[pivot.element].degree((low + high) / 2)
            levels = level, level
        deepest = 0 if is_flat else _DEEPEST
        return witness_between(
            self.base,
            levels,
            partial(self._select, pivot, band, is_flat),
            partial(tie_witness, self.base, self.question),
            deepest if self.joined else None,
        )

    def _select(
        self, pivot: Pivot, band: int, is_flat: bool, levels: Levels, is_outer: bool
    ) -> Iterator[dict[int, AxisStretch]]:
        """Yield values of the axes at which ours tie, or may at some of the levels."""
        fixed = self._pivot_stretches(pivot, levels, is_flat=is_flat, is_outer=is_outer)
        if fixed is None:
            return iter(())
        grid = self.base.grids[pivot.axis]
        if not is_outer and not is_flat:
            level = grid.axis.elements[pivot.element].degree(fixed[pivot.axis].low)
            levels = level, level
        parts = {
            axis: [*self._parts(axis, band, levels, is_flat=is_flat, is_outer=is_outer)]
            for axis in self.joined
            if axis not in fixed
        }
        families = self._families(pivot, band, is_flat=is_flat)
        return selections(
            self.base,
            parts,
            {axis: masks for axis, masks in families.items() if axis not in parts},
            self.duel.full & ~union(part.mask for part in pivot.all),
            self.count,
            self.clock,
            None if is_outer else partial(part_at, self.duel, band, levels[0], is_flat),
            fixed,
        )

    def _pivot_stretches(
        self, pivot: Pivot, levels: Levels, *, is_flat: bool, is_outer: bool
    ) -> dict[int, AxisStretch] | None:
        """Return where the pivot is at some of the levels: one value if not outer."""
        every = self.base.grids
        if is_flat:
            return {part.axis: whole(every[part.axis], part.cell) for part in pivot.all}
        grid = every[pivot.axis]
        if is_outer:
            part = widest(grid, pivot.cell, levels, [pivot.element], [pivot.element])
            return None if part is None else {pivot.axis: part}
        at = value_of(grid, pivot, levels)
        return None if at is None else {pivot.axis: AxisStretch(at, at, is_open=False)}

    def _parts(
        self, axis: int, band: int, levels: Levels, *, is_flat: bool, is_outer: bool
    ) -> Iterator[Part]:
        """Yield where ours reach a level on an axis, with the rivals left below."""
        duel = self.duel
        options = duel.all_options[axis]
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
