"""Do two rules tie as the strongest, on more than a surface? Under the minimum.

Around a point of an open set each strength is one function of one axis. Two of them are
equal there only if they are the same function of the same axis, or constant and equal.
Both can be read off the cells: functions of one rank are one function, and a constant
one has the same level at both ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fuzzytree.auditing.recheck.grid import Asked, Grid, bits, reach
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.auditing.recheck.polynomials import ZERO

MOST_STEPS = 400_000
Cell = list[tuple[int, int, int, int]]


class Ties:
    """The pairs of rules that tie; all of them together take so many steps at most."""

    def __init__(self, grid: Grid) -> None:
        self.grid, self.left = grid, MOST_STEPS
        self.wide = [axis.spans[:-1] or axis.spans for axis in grid.axes]
        self.lowest = grid.levels.band[grid.marks[ZERO]]
        self.levels: dict[int, list[set[tuple[int, int]]]] = {}

    def tie(self, one: Asked, other: Asked, rivals: Sequence[Asked]) -> bool:
        """Return whether both are equal on an open set, and no rival is stronger.

        Inputs are free of each other.

        Raises:
            UndecidedError: If it is too much, or levels are too near to tell apart.
        """
        return self._moves(one, other, rivals) or self._stands(one, other, rivals)

    def _step(self, size: int) -> None:
        self.left -= size
        if self.left < 0:
            raise UndecidedError(f"ties that take more than {MOST_STEPS:,} steps")

    def _moves(self, one: Asked, other: Asked, rivals: Sequence[Asked]) -> bool:
        """Return whether both follow one function of one axis."""
        for place, cells in enumerate(self.wide):
            own = one[place], other[place]
            for cell in cells if all(own) else ():
                for band, above, equal in _shared(cell, *own):
                    self._step(1 + len(rivals))
                    if (own[0] | own[1]) & ~(above | equal):
                        continue
                    axes: list[set[int]] = []
                    every = self.grid.sets(band, is_gap=True)
                    for k, sets in enumerate(every):
                        asked = one[k] | other[k]
                        met = (
                            {s for s in sets if not asked & ~s}
                            if k != place
                            else {above}
                        )
                        axes.append({bits(r[k] & ~s for r in rivals) for s in met})
                    if reach(axes, len(rivals)):
                        return True
        return False

    def _stands(self, one: Asked, other: Asked, rivals: Sequence[Asked]) -> bool:
        """Return whether both are constant, at one level."""
        flat = self._flat(one) & self._flat(other)
        for band in sorted(flat - {self.lowest}):
            self._step(len(self.wide) * (1 + len(rivals)))
            low, high = self.grid.levels.bands[band]
            axes: list[set[int]] = []
            for k, sets in enumerate(self._at(band)):
                asked = one[k] | other[k]
                axes.append(
                    {
                        bits(
                            (*(r[k] & ~gt for r in rivals), one[k] & eq, other[k] & eq)
                        )
                        for gt, eq in sets
                        if not asked & ~(gt | eq)
                    }
                )
            if reach(axes, len(rivals) + 2):
                if low < high:
                    raise UndecidedError(
                        "two critical levels are too near to tell apart"
                    )
                return True
        return False

    def _flat(self, asked: Asked) -> set[int]:
        """Return the bands at which a clause stays in some cell."""
        return {
            least
            for place, cells in enumerate(self.wide)
            for cell in cells
            for _, least, most, bit in cell
            if least == most and asked[place] & bit
        }

    def _at(self, band: int) -> list[set[tuple[int, int]]]:
        """Return per axis what is above a level in parts of cells, and what at it."""
        if band not in self.levels:
            self.levels[band] = [
                {pair for cell in cells for pair in _patterns(cell, band)}
                for cells in self.wide
            ]
        return self.levels[band]


def _shared(cell: Cell, one: int, other: int) -> Iterator[tuple[int, int, int]]:
    """Yield each band that functions of both rules cross as one.

    With it: the functions that are above the level there, and those that are at it.
    """
    groups: dict[int, tuple[int, int, int]] = {}
    for rank, least, most, bit in cell:
        groups[rank] = least, most, groups.get(rank, (0, 0, 0))[2] | bit
    for rank, (least, most, equal) in groups.items():
        if not (equal & one and equal & other):
            continue
        for band in range(least, most):
            above = 0
            for k, low, high, bit in cell:
                if low > band or (high > band and k > rank):
                    above |= bit
            yield band, above & ~equal, equal


def _patterns(cell: Cell, band: int) -> Iterator[tuple[int, int]]:
    """Yield which functions are above a level in parts of a cell, and which at it."""
    above = equal = 0
    for _, least, most, bit in cell:
        above |= bit if least >= band and most > band else 0
        equal |= bit if least == most == band else 0
    yield above, equal
    last = -1
    for rank, least, most, bit in cell:
        if least < band < most:
            if last not in (-1, rank):
                yield above, equal
            above, last = above | bit, rank
    yield above, equal
