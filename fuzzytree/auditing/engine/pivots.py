"""Where rules can tie under the minimum: curves that determine their strengths.

Where two rules are equally strong on an open set, each is as strong as one of its
curves there. Either that is the same curve on one axis, in one cell; or the curves are
on two axes, and both are constant and of one level. Tables of shared curves and of
constants exclude most pairs; `fuzzytree.auditing.engine.ties` decides the others.

A *pivot* is a cell of an axis in which one curve is the degree of all our rules; where
it is their least one, it is the strength of all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid, strengths_at
from fuzzytree.auditing.engine.domain import Point
from fuzzytree.auditing.engine.duels import Duel, maximal, stays, weakest
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.measures import local_polynomial
from fuzzytree.auditing.engine.states import Bracket, Claim, Witness, coordinates
from fuzzytree.auditing.engine.witnesses import (
    START,
    AxisStretch,
    have_one_direction,
    is_within,
    part_of,
)
from fuzzytree.model import BoolArray, IntArray, checkpoint


class TieQuestion(NamedTuple):
    """Is there a set with an interior on which rules are the strongest?"""

    # the numbers of the rules that shall tie, from 1; or of a single one
    ours: tuple[int, ...]
    strict: tuple[int, ...]  # the numbers of the rivals that must be weaker
    weak: tuple[int, ...]  # the numbers of the rivals that may be equally strong

    @property
    def rivals(self) -> tuple[int, ...]:
        """All rivals; those that must be weaker come first."""
        return self.strict + self.weak

    def open(self, why: str) -> Bracket:
        """Return the answer that it is not known."""
        names = " and ".join(map(str, self.ours))
        verb = "tie" if len(self.ours) > 1 else "is first"
        noun = "rules" if len(self.ours) > 1 else "rule"
        return Bracket(f"whether {noun} {names} {verb} (1) or not (0)", 0.0, 1.0, why)


def tie_witness(
    base: Arrangement, question: TieQuestion, point: Point
) -> Witness | None:
    """Return a point as a witness, if it is one in fractions."""
    strengths = strengths_at(base, point)
    mine = strengths[question.ours[0] - 1]
    holds = (
        all(strengths[n - 1] == mine for n in question.ours)
        and all(strengths[n - 1] < mine for n in question.strict)
        and all(strengths[n - 1] <= mine for n in question.weak)
        and mine > 0
        and is_within(base, point)
    )
    if not holds:
        return None
    return Witness(coordinates(point), _claims(question, strengths, mine))


def _claims(
    question: TieQuestion, strengths: Sequence[Fraction], mine: Fraction
) -> tuple[Claim, ...]:
    every = question.ours + question.rivals
    level = tuple(sorted(n for n in every if strengths[n - 1] == mine))
    below = tuple(sorted(n for n in every if strengths[n - 1] < mine))
    return (
        Claim("ties", rules=level, rivals=below),
        Claim("strength", rules=(question.ours[0],), level=str(mine)),
    )


# --- pairs of rules that may tie


def may_tie(base: Arrangement) -> BoolArray:
    """Return which pairs of rules may be equally strong, and not 0, on an open set.

    Returns:
        Shape (rules, rules), symmetric. All are true under the product, where cells
        are too many to be kept, where an axis is a single value, and where two axes
        have one direction.
    """
    count = len(base.rules.rules)
    every: BoolArray = np.ones((count, count), dtype=bool)
    is_product = base.rules.semantics.conjunction == "product"
    if is_product or base.is_empty or not base.is_kept or not base.axes:
        return every
    grids, bands = base.grids, base.bands
    if any(not len(one.cells.rank) for one in grids) or have_one_direction(base):
        return every
    flat = [_flat(one, bands.is_sharp) for one in grids]
    result = _constants(grids, flat, bands.is_sharp)
    for one, is_flat in zip(grids, flat, strict=True):
        rank, _, _, is_zero = _degrees_in_cells(one)
        alive = ~is_zero & ~is_flat  # constants are seen to
        for rule in range(count):
            checkpoint()
            cells = np.flatnonzero(alive[rule])
            same = rank[:, cells] == rank[rule, cells]
            result[rule] |= same.any(axis=1)
    return np.asarray(result | result.T)


def _degrees_in_cells(grid: AxisGrid) -> tuple[IntArray, IntArray, IntArray, BoolArray]:
    """Return order, bands and zeros of the rules' degrees in cells: (rules, cells)."""
    columns = np.arange(grid.of.shape[1])
    return (
        grid.cells.rank[columns, grid.of],
        grid.least[grid.of, columns],
        grid.most[grid.of, columns],
        grid.is_zero[grid.of, columns],
    )


def is_constant(grid: AxisGrid, element: int, cell: int) -> bool:
    """Return whether a curve is constant in a cell, or an axis a single value."""
    if cell == START:
        return True
    low, high = grid.cells.between[cell]
    return len(local_polynomial(grid.axis.elements[element], (low + high) / 2)) == 1


def _flat(grid: AxisGrid, is_sharp: BoolArray) -> BoolArray:
    """Return which rules' degrees are constant in a cell, and not 0: (rules, cells)."""
    flat = (grid.least == grid.most) & ~grid.is_zero
    # Within a band that is not one level, the curve itself decides.
    for row, cell in np.argwhere(flat & ~is_sharp[grid.least]).tolist():
        flat[row, cell] = is_constant(grid, row, cell)
    return np.asarray(flat[grid.of, np.arange(grid.of.shape[1])])


def _constants(
    grid: Sequence[AxisGrid], flat: Sequence[BoolArray], is_sharp: BoolArray
) -> BoolArray:
    """Return which pairs may have one constant level in a box: (rules, rules).

    On one axis each is constant at the level; on the others it is too, or goes above.
    Within a band that is not one level, what goes above is not known.
    """
    degrees = [_degrees_in_cells(one) for one in grid]
    levels = [
        least[is_flat] for (_, least, _, _), is_flat in zip(degrees, flat, strict=True)
    ]
    count = len(grid[0].of)
    result: BoolArray = np.zeros((count, count), dtype=bool)
    for band in np.unique(np.concatenate(levels)).tolist():
        is_some: BoolArray = np.zeros(count, dtype=bool)
        both: BoolArray = np.ones((count, count), dtype=bool)
        for (_, least, most, _), is_flat in zip(degrees, flat, strict=True):
            checkpoint()
            here = is_flat & (least == band)
            above = most > band if is_sharp[band] else most >= band
            is_some |= here.any(axis=1)
            reach = (here | above).astype(np.float32)
            both &= reach @ reach.T > 0.0
        result |= both & is_some & is_some[:, np.newaxis]
    return result


# --- pivots


class Pivot(NamedTuple):
    """Where a rule, or all of ours, are as strong as one curve."""

    axis: int
    cell: int
    element: int  # the curve
    mask: int  # the rivals that do not exceed it
    # where the rest of ours are as strong as theirs, of the same level
    beside: Pivot | None = None

    @property
    def all(self) -> tuple[Pivot, ...]:
        """This one, and the one beside it."""
        return (self,) if self.beside is None else (self, self.beside)


class _CellDegrees(NamedTuple):
    """The rules' degrees in the cells of an axis, or at its only value."""

    cells: list[int]
    of: IntArray  # shape (rules, cells): the element that is a rule's degree
    height: IntArray  # the same shape: its rank
    is_zero: BoolArray  # the same shape: whether it is 0 throughout


def _cell_degrees(grid: AxisGrid) -> _CellDegrees:
    count = len(grid.cells.rank)
    if not count:
        of = grid.of_start[:, np.newaxis]
        return _CellDegrees(
            [START], of, grid.cells.start_rank[of], grid.is_zero_at[of[:, 0], :1]
        )
    columns = np.arange(count)
    height = grid.cells.rank[columns, grid.of]
    is_zero = grid.is_zero[grid.of, columns]
    return _CellDegrees([*range(count)], grid.of, height, is_zero)


def whole(grid: AxisGrid, cell: int) -> AxisStretch:
    """Return all of a cell, or the one value of an axis."""
    if cell == START:
        return AxisStretch(*grid.cells.zones[0], is_open=False)
    return AxisStretch(*grid.cells.between[cell])


def value_of(
    grid: AxisGrid, pivot: Pivot, levels: tuple[Fraction, Fraction]
) -> Fraction | None:
    """Return a value of a pivot's axis at which its level is well between two."""
    low, high, _ = whole(grid, pivot.cell)
    ends, room = (low, high), (levels[1] - levels[0]) / 4
    element = grid.axis.elements[pivot.element]
    for level, is_high in ((levels[0] + room, True), (levels[1] - room, False)):
        part = part_of(element, ends, level, is_high=is_high, bits=64)
        low, high = max(low, part.low), min(high, part.high)
    return simple(low, high) if low < high else None


def ends_of(grid: AxisGrid, element: int, cell: int) -> tuple[int, int]:
    """Return the bands of the least and the largest value of a curve in a cell."""
    if cell == START:
        return int(grid.at[element, 0]), int(grid.at[element, 0])
    return int(grid.least[element, cell]), int(grid.most[element, cell])


def levels_of(duel: Duel, least: int, most: int, *, is_each: bool) -> list[int]:
    """Return bands from which on, up to the next one, nothing changes.

    Where axes share inputs every level matters: at another one other values are free.
    """
    if is_each:
        return [*range(least, most)] or [least]
    inner = {band for band in duel.events if least < band < most}
    return sorted({least, *inner})


def pivots(
    duel: Duel, question: TieQuestion, axis: int, *, is_each: bool
) -> list[Pivot]:
    """Return the cells of an axis in which all of ours are the same curve, not 0.

    Of cells between the same levels one suffices, unless `is_each`.
    """
    grid = duel.base.grids[axis]
    degrees = _cell_degrees(grid)
    ours = degrees.height[np.array(duel.ours)]
    rivals = degrees.height[np.array(duel.rivals, dtype=np.int64)]
    mine = degrees.of[duel.ours[0]]
    fits = (ours == ours[0]).all(axis=0) & ~degrees.is_zero[duel.ours[0]]
    is_below = rivals < ours[0] + _limits(question)
    result: dict[tuple[int, ...], Pivot] = {}
    for column in np.flatnonzero(fits).tolist():
        mask = sum(1 << n for n in np.flatnonzero(is_below[:, column]).tolist())
        element, cell = int(mine[column]), degrees.cells[column]
        key = element, mask, *ends_of(grid, element, cell), cell * is_each
        result.setdefault(key, Pivot(axis, cell, element, mask))
    return list(result.values())


def constant_pairs(duel: Duel, question: TieQuestion, *, is_each: bool) -> list[Pivot]:
    """Return pairs of constants of one level, on two axes, that hold two rules."""
    if len(question.ours) < 2:
        return []
    one, other = ([*_constants_of(duel, question, rule)] for rule in duel.ours)
    result: dict[tuple[int, ...], Pivot] = {}
    key: tuple[int, ...]
    for first, level in one:
        for second, same in other:
            if first.axis != second.axis and level == same:
                key = level, first.axis, first.mask, second.axis, second.mask
                if is_each:
                    key = *key, first.cell, second.cell
                result.setdefault(key, first._replace(beside=second))
    return list(result.values())


def _constants_of(
    duel: Duel, question: TieQuestion, rule: int
) -> Iterator[tuple[Pivot, int]]:
    """Yield where a rule, the least of ours, is constant and not 0, with the band."""
    for axis, grid in enumerate(duel.base.grids):
        degrees = _cell_degrees(grid)
        height, mine = degrees.height[rule], degrees.of[rule]
        fits = (height <= degrees.height[np.array(duel.ours)]).all(axis=0)
        fits &= ~degrees.is_zero[rule]
        rivals = degrees.height[np.array(duel.rivals, dtype=np.int64)]
        is_behind = rivals < height + _limits(question)
        for column in np.flatnonzero(fits).tolist():
            element, cell = int(mine[column]), degrees.cells[column]
            least, most = ends_of(grid, element, cell)
            if least == most and is_constant(grid, element, cell):
                mask = sum(
                    1 << n for n in np.flatnonzero(is_behind[:, column]).tolist()
                )
                yield Pivot(axis, cell, element, mask), least


def _limits(question: TieQuestion) -> IntArray:
    """Return, of each rival, by how many ranks it must stay below: 0, or 1 less."""
    return np.array(
        [0] * len(question.strict) + [1] * len(question.weak), dtype=np.int64
    )[:, np.newaxis]


def flat_family(
    duel: Duel, question: TieQuestion, axis: int, band: int, *, is_within: bool = False
) -> tuple[int, ...]:
    """Return what does not exceed a level where ours reach it.

    Rivals are left strictly below it, or stay at it as curves that are constant.

    `is_within`: of a band that is not sharp, what is possible somewhere in it.
    """
    options, grid = duel.all_options[axis], duel.base.grids[axis]
    masks: list[int] = []
    limit = band + 1 if is_within else band  # below which rivals are left
    least = -np.iinfo(np.int64).max if is_within else START
    for number in np.flatnonzero(options.where >= least).tolist():
        cell, top = int(options.where[number]), int(options.top[number])
        if top > band or (
            top == band and (is_within or _least(duel, grid, cell) == band)
        ):
            behind = options.floor[number] < limit
            for place in range(len(question.strict), len(behind)):
                behind[place] |= cell >= START and stays(duel, grid, cell, place, band)
            masks.append(sum(1 << n for n in np.flatnonzero(behind).tolist()))
    return maximal(masks)


def _least(duel: Duel, grid: AxisGrid, cell: int) -> int:
    """Return the band of the least value of our weakest rule in a cell."""
    return ends_of(grid, weakest(grid, duel.ours, cell), cell)[0]
