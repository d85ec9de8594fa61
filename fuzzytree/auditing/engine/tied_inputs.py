"""Ties where axes share inputs: values of theirs that some inputs have together."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.engine.choices import (
    Part,
    at_most,
    choices,
    nested,
    parts_of,
    union,
)
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.contests import Contest, weakest
from fuzzytree.auditing.engine.covering import cover
from fuzzytree.auditing.engine.parts import START, Stretch, widest
from fuzzytree.auditing.engine.pivots import (
    Pivot,
    flat_family,
    part_at,
    stays,
    value_of,
    whole,
)
from fuzzytree.auditing.engine.seeking import leader
from fuzzytree.auditing.engine.states import Witness
from fuzzytree.auditing.engine.tied import Asked, checked
from fuzzytree.auditing.engine.variables import variable_value
from fuzzytree.auditing.engine.witnesses import coupled, point_with

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
