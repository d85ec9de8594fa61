"""Two trees at once: which leaves can one row reach in both?

A box holds the rows that reach a node of the first tree and a node of the second: for
each column that was tested an interval `(low, high]`, and whether NaN is in it. Trees
with the same tests in the same places need no walk.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fuzzytree.ensembles.trees import Rows, Tree
from fuzzytree.model import FloatArray
from fuzzytree.numerics import floats_below

_LARGEST = {
    "float32": float(np.finfo(np.float32).max),
    "float64": float(np.finfo(np.float64).max),
}
_STEPS_OF_A_LEAF = 256  # of a walk, before it ends open
_FEWEST_STEPS = 200_000
_FAR = 1e37  # above it an interval goes to the end of a number type


class Domain(NamedTuple):
    """The rows that both sides accept.

    Attributes:
        rows: Their number type.
        high: No value is above it.
        is_infinite: Whether infinities are among the values.
        has_missing: Whether NaN is.
    """

    rows: Rows
    high: float
    is_infinite: bool
    has_missing: bool

    @staticmethod
    def of(rows: Rows, *, rounds: bool, infinite: bool, missing: bool) -> Domain:
        """Return a domain; `rounds` says whether a side rounds to 32 bits."""
        high = _LARGEST[rows]
        if rows == "float64" and rounds and not infinite:
            # The last double that is not rounded to infinity.
            high = math.nextafter(2.0**128 - 2.0**103, 0.0)
        return Domain(rows, math.inf if infinite else high, infinite, missing)


Box = dict[int, tuple[float, float, bool]]
"""For each tested column `low < x <= high`, and whether NaN is in it, too.

The lowest `low` is `-inf`, and stands for `-inf <= x` where infinities are accepted."""


class Pair(NamedTuple):
    """Leaves of two trees that one row can reach, and which rows those are."""

    box: Box
    first: int
    second: int


class Walk:
    """All pairs of leaves of two trees, over a domain.

    Attributes:
        is_whole: Whether the walk came to its end.
    """

    def __init__(
        self,
        first: Tree,
        second: Tree,
        domain: Domain,
        settled: set[tuple[int, bool]] | None = None,
    ) -> None:
        self.is_whole = True
        self._sides = [
            (
                tree.columns.tolist(),
                in_type(tree.cuts, domain.rows).tolist(),
                tree.is_missing_left.tolist(),
                tree.left.tolist(),
                tree.right.tolist(),
            )
            for tree in (first, second)
        ]
        self._domain = domain
        self._settled = set() if settled is None else settled
        self._parted: tuple[int, bool] | None = None
        leaves = len(first.values) + len(second.values)
        self._steps = max(_FEWEST_STEPS, _STEPS_OF_A_LEAF * leaves)

    def pairs(self) -> Iterator[Pair]:
        """Yield the pairs of leaves.

        Where NaN of a column takes another side in the second tree than in the first,
        boxes multiply; `settle` leaves out what is alike.
        """
        lowest = (-math.inf, self._domain.high, self._domain.has_missing)
        first, second = (0 if side[0] else -1 for side in self._sides)
        todo: list[tuple[Box, int, int, tuple[int, bool] | None]]
        todo = [({}, first, second, None)]
        while todo:
            box, first, second, parted = todo.pop()
            if parted in self._settled:
                continue
            self._steps -= 1
            if self._steps < 0:
                self.is_whole = False
                return
            if first < 0 and second < 0:
                self._parted = parted
                yield Pair(box, ~first, ~second)
                continue
            side, at = (0, first) if first >= 0 else (1, second)
            columns, cuts, ways, left, right = self._sides[side]
            column, cut = columns[at], cuts[at]
            low, high, missing = box.get(column, lowest)
            parts = (
                (right[at], (max(low, cut), high, missing and not ways[at])),
                (left[at], (low, min(high, cut), missing and ways[at])),
            )
            for child, part in parts:
                here = parted
                if not part[0] < part[1] and not is_lowest(
                    part[0], part[1], self._domain
                ):
                    if not part[2]:
                        continue
                    if side and here is None:  # NaN alone goes this way
                        here = (column, child == left[at])
                narrowed = {**box, column: part}
                todo.append(
                    (narrowed, first, child, here)
                    if side
                    else (narrowed, child, second, here)
                )

    def settle(self) -> None:
        """Leave out further rows in which NaN of this column goes to this side."""
        if self._parted is not None:
            self._settled.add(self._parted)


def is_lowest(low: float, high: float, domain: Domain) -> bool:
    """Return whether an interval is minus infinity alone."""
    return low == high == -math.inf and domain.is_infinite


def row_of(
    box: Box, width: int, domain: Domain, *, prefers_missing: bool = False
) -> FloatArray:
    """Return a row of a box, shape (1, width), with a missing value if it may."""
    row = np.zeros((1, width))
    for column, (low, high, missing) in box.items():
        if prefers_missing and missing and not np.isnan(row).any():
            row[0, column] = math.nan
            continue
        if low < high:
            row[0, column] = _between(low, high, domain)
        else:
            row[0, column] = -math.inf if is_lowest(low, high, domain) else math.nan
    return row


def in_type(cuts: FloatArray, rows: Rows) -> FloatArray:
    """Return for cuts the largest numbers of a type that are not above them."""
    return cuts if rows == "float64" else floats_below(cuts).astype(np.float64)


def _between(low: float, high: float, domain: Domain) -> float:
    """Return a number in `(low, high]`, a short one where there is one.

    Example:
        >>> _between(0.25, 0.75, Domain("float32", 9.0, False, False))
        0.5
    """
    if low < 0.0 <= high:
        return 0.0
    if high >= _FAR:
        return min(low + max(1.0, abs(low)), domain.high)
    if low == -math.inf:
        return high
    middle = low / 2 + high / 2
    for digits in (1, 3, 6, 12):
        short = float(f"{middle:.{digits}g}")
        if domain.rows == "float32":
            short = float(np.float32(short))
        if low < short <= high:
            return short
    return high


def is_same_shape(first: Tree, second: Tree, domain: Domain) -> bool:
    """Return whether two trees test the same in the same places.

    Both are in depth-first order, so equal arrays are equal trees.
    """
    if len(first.columns) != len(second.columns):
        return False
    one, two = (in_type(tree.cuts, domain.rows) for tree in (first, second))
    return (
        np.array_equal(first.columns, second.columns)
        and np.array_equal(one, two)
        and np.array_equal(first.left, second.left)
        and np.array_equal(first.right, second.right)
        and (
            not domain.has_missing
            or np.array_equal(first.is_missing_left, second.is_missing_left)
        )
    )
