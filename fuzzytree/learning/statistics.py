"""Fuzzy statistics (paper, 2.2.1): means and spreads per class, without rounding.

A `Statistics` value takes rows in chunks of any size and in any order, and gives the
same bits: sums are exact (`sums`), and the sample that it keeps for everything that
needs rows (clusters, combinations, inner validation, window counts) depends on the rows
alone (`sampling`). The sample has incomplete rows too, with NaN where a value is
missing, and codes of texts (`fuzzytree.columns`); sums are those of complete rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fuzzytree.cells import EXACT
from fuzzytree.columns import is_missing_code
from fuzzytree.learning.sampling import (
    DistinctRows,
    Sample,
    hashed_digits,
    usual_rows,
)
from fuzzytree.learning.sums import (
    MOST_ROWS,
    Sums,
    Totals,
    narrow,
    padded,
    runs,
    sized,
)
from fuzzytree.learning.units import BoolArray, ColumnUnits, FloatArray, IntArray

BLOCK_VALUES = 1 << 18
"""A block holds about this many numbers (2 MiB), and never more than 2^13 rows."""


@dataclass(frozen=True)
class Moments:
    """What is known of each class and feature.

    Attributes:
        counts: Rows per class, shape (classes,).
        means: Shape (classes, features); NaN for a class without rows.
        spreads: Standard deviation with n - 1; exactly 0 where all values are equal
            and where there is one row.
        lows: Smallest value per class and feature.
        highs: Largest value per class and feature.
    """

    counts: IntArray
    means: FloatArray
    spreads: FloatArray
    lows: FloatArray
    highs: FloatArray


@dataclass
class Statistics:
    """An accumulator of class moments and a bounded sample of rows.

    Attributes:
        classes: How many classes there are.
        features: How many columns there are.
        rows_per_class: How many rows of each class the sample keeps at most; None for
            `usual_rows`.
        dropped: Rows without a class, which are left out, and rows with a value that is
            missing or not finite, which the sums leave out.
        unlabelled: How many of these have no class.

    Example:
        >>> table = np.array([[1.0], [3.0], [7.0]])
        >>> statistics = Statistics(classes=2, features=1)
        >>> statistics.update(table, np.array([0, 0, 1]))
        >>> statistics.moments().means.tolist()
        [[2.0], [7.0]]
    """

    classes: int
    features: int
    rows_per_class: int | None = None
    dropped: int = 0
    unlabelled: int = 0
    _filled: int = 0
    _block: FloatArray = field(init=False, repr=False)
    _block_codes: IntArray = field(init=False, repr=False)
    _counts: IntArray = field(init=False, repr=False)
    _complete: IntArray = field(init=False, repr=False)
    _lows: FloatArray = field(init=False, repr=False)
    _highs: FloatArray = field(init=False, repr=False)
    _fractions: IntArray = field(init=False, repr=False)  # cells that may not be whole
    _sums: Sums = field(init=False, repr=False)
    _rows: DistinctRows = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Make room for one block and for the moments."""
        rows = max(1, BLOCK_VALUES // max(1, self.features))
        power = 1 << (rows.bit_length() - 1)
        size = min(MOST_ROWS, max(1 << 6, power))
        shape = (self.classes, self.features)
        self._block = np.empty((size, self.features))
        self._block_codes = np.empty(size, np.int64)
        self._counts = np.zeros(self.classes, np.int64)
        self._complete = np.zeros(self.classes, np.int64)
        self._lows = np.full(shape, np.inf)
        self._highs = np.full(shape, -np.inf)
        self._fractions = np.zeros(self.features, np.int64)
        self._sums = Sums(self.classes, self.features)
        most = self.rows_per_class or usual_rows(self.features, 2)
        self._rows = DistinctRows(self.classes, self.features, most)

    def update(self, values: npt.NDArray[np.generic], codes: IntArray) -> None:
        """Take more rows.

        Args:
            values: Shape (rows, features), of any real type and memory order; read in
                blocks, never copied whole.
            codes: Class of each row, 0 to classes - 1; a negative code drops the row.
        """
        size = len(self._block)
        first = 0
        while first < len(values):
            last = min(len(values), first + size - self._filled)
            piece = np.asarray(values[first:last], np.float64)
            chosen = codes[first:last]
            self._append(piece, chosen, chosen >= 0)
            first = last
            if self._filled == size:
                self._absorb()

    def _append(self, piece: FloatArray, codes: IntArray, usable: BoolArray) -> None:
        count = int(np.count_nonzero(usable))
        self.dropped += len(piece) - count
        self.unlabelled += len(piece) - count
        place = slice(self._filled, self._filled + count)
        everything = count == len(piece)
        chosen = piece if everything else piece[usable]
        self.dropped += _copy_rows(chosen, self._block[place])
        self._block_codes[place] = codes if everything else codes[usable]
        self._filled += count

    def _absorb(self) -> None:
        """Fold the gathered block into the moments and the sample."""
        if not self._filled:
            return
        values, codes = self._block[: self._filled], self._block_codes[: self._filled]
        self._rows.offer(values, codes)
        has_fraction = (np.floor(values) < values) | (np.abs(values) >= EXACT)
        self._fractions += np.count_nonzero(has_fraction, axis=0)
        order = np.argsort(narrow(codes), kind="stable")
        present, starts, counts = runs(codes[order])
        columns = np.take(values.T, order, axis=1)
        lows = np.fmin.reduceat(columns, starts, axis=1).T
        highs = np.fmax.reduceat(columns, starts, axis=1).T
        self._lows[present] = np.fmin(self._lows[present], lows)
        self._highs[present] = np.fmax(self._highs[present], highs)
        self._counts[present] += counts
        is_complete = finite_rows(values)
        if not is_complete.all():
            order = order[is_complete[order]]
        if 0 < len(order) < len(is_complete):
            present, starts, counts = runs(codes[order])
            columns = np.take(values.T, order, axis=1)
        if len(order):
            self._complete[present] += counts
            self._sums.add(columns, present, starts, counts)
        self._filled = 0

    def merge(self, other: Statistics) -> Statistics:
        """Return the statistics of both tables: the bits of one pass over both."""
        joined = Statistics(self.classes, self.features, self.rows_per_class)
        for part in (self, other):
            joined._take(part, np.arange(self.classes))
        joined._rows.settle()
        return joined

    def arrays(self) -> dict[str, npt.NDArray[np.generic]]:
        """Return everything that was counted as arrays of one dimension, by name.

        Whole numbers of any size are the bytes of two's complement, the lowest first.
        """
        self._absorb()
        rows = self._rows.arrays()
        counted = {
            "counts": self._counts,
            "complete": self._complete,
            "lows": self._lows,
            "highs": self._highs,
            "fractions": self._fractions,
        }
        arrays = {**counted, **self._sums.arrays(), **rows}
        return {name: array.reshape(-1) for name, array in arrays.items()}

    def fill(self, arrays: Mapping[str, npt.NDArray[np.generic]]) -> None:
        """Take what `arrays` gave; nothing was taken before.

        Raises:
            ValueError: If an array has another type or size than it must have, or holds
                what cannot be counted.
        """
        shape = (self.classes, self.features)
        self._counts = sized(arrays, "counts", np.int64, (self.classes,))
        self._complete = sized(arrays, "complete", np.int64, (self.classes,))
        self._lows = sized(arrays, "lows", np.float64, shape)
        self._highs = sized(arrays, "highs", np.float64, shape)
        self._fractions = sized(arrays, "fractions", np.int64, (self.features,))
        is_count = (self._complete >= 0) & (self._complete <= self._counts)
        if not is_count.all() or self.dropped < 0:
            raise ValueError("counts a negative number of rows")
        is_low = self._lows <= self._highs
        is_none = (self._lows == np.inf) & (self._highs == -np.inf)
        if not np.where((self._counts == 0)[:, None], is_none, is_low | is_none).all():
            raise ValueError("has smallest values above the largest")
        self._sums.fill(arrays)
        self._rows.fill(arrays)

    def grow(self, classes: int) -> None:
        """Make room for classes without rows."""
        more = classes - self.classes
        self._counts = padded(self._counts, more, 0)
        self._complete = padded(self._complete, more, 0)
        self._lows = padded(self._lows, more, np.inf)
        self._highs = padded(self._highs, more, -np.inf)
        self._sums.grow(classes)
        self._rows.grow(classes)
        self.classes = classes

    def placed(self, positions: IntArray, classes: int) -> Statistics:
        """Return the statistics with other numbers of classes.

        Args:
            positions: The new number of each class; two may become one.
            classes: How many classes there are then.
        """
        found = Statistics(classes, self.features, self.rows_per_class)
        found._take(self, positions)
        found._rows.settle()
        return found

    def _take(self, other: Statistics, positions: IntArray) -> None:
        """Add what was counted of other rows, by the numbers of their classes here."""
        other._absorb()
        self.dropped += other.dropped
        self.unlabelled += other.unlabelled
        np.add.at(self._counts, positions, other._counts)
        np.add.at(self._complete, positions, other._complete)
        np.minimum.at(self._lows, positions, other._lows)
        np.maximum.at(self._highs, positions, other._highs)
        self._fractions += other._fractions
        self._sums.take(other._sums, positions, np.arange(self.features))
        self._rows.take(other._rows, positions)

    def moments(self, units: ColumnUnits | None = None) -> Moments:
        """Return the moments of all complete rows so far, each number rounded once.

        Args:
            units: Of the columns; the table's own unless given.
        """
        self._absorb()
        counts = self._complete.tolist()
        if units is None:
            means, spreads = self._sums.moments(counts)
        else:
            origins = np.where(units.is_sound, units.origins, 0.0)
            means, spreads = self._sums.moments(counts, origins, units.exponents)
            means[:, ~units.is_sound] = spreads[:, ~units.is_sound] = 0.0
        lows, highs = self._lows.copy(), self._highs.copy()
        if units is not None:
            filled = self._complete > 0
            lows[filled], highs[filled] = map(
                units.moved, (lows[filled], highs[filled])
            )
        return Moments(self._complete.copy(), means, spreads, lows, highs)

    def totals(self, feature: int) -> Totals:
        """Return the exact sums of one column by class, of complete rows."""
        self._absorb()
        return self._sums.totals(feature, self._complete.tolist())

    def counts(self) -> IntArray:
        """Return how many rows of each class were taken so far."""
        self._absorb()
        return self._counts.copy()

    def extent(self, feature: int) -> tuple[float, float]:
        """Return the smallest and the largest value of a column that are known."""
        self._absorb()
        return float(self._lows[:, feature].min()), float(self._highs[:, feature].max())

    def is_whole(self, feature: int) -> bool:
        """Return whether all known numbers of a column are whole."""
        self._absorb()
        return not self._fractions[feature]

    def sample(self) -> Sample:
        """Return the rows kept, in an order that depends on the rows alone."""
        self._absorb()
        usual = usual_rows(self.features, int(np.count_nonzero(self._counts)))
        return self._rows.sample(
            self._lows.min(axis=0, initial=np.inf),
            self._highs.max(axis=0, initial=-np.inf),
            self.rows_per_class or min(usual, self._rows.most),
        )

    def limits(self) -> tuple[int, ...]:
        """Return the largest hash of a row that is kept of each class (`rows_beyond`).

        2^64 - 1 where all rows are.
        """
        self._absorb()
        return self._rows.limits()

    def of_columns(self, kept: Sequence[int]) -> Statistics:
        """Return the statistics of some of the columns."""
        if len(kept) == self.features:
            return self
        found = Statistics(self.classes, len(kept), self.rows_per_class)
        self._absorb()
        found.dropped, found.unlabelled = self.dropped, self.unlabelled
        found._counts, found._complete = self._counts.copy(), self._complete.copy()
        found._lows, found._highs = self._lows[:, kept], self._highs[:, kept]
        found._fractions = self._fractions[[*kept]]
        found._sums = self._sums.of_features(np.array(kept, np.int64))
        found._rows = self._rows.of_columns(kept)
        return found

    def complete(self) -> Statistics:
        """Return what was counted of complete rows, and those of the sample.

        The range of a column stays that of all rows.
        """
        found = Statistics(self.classes, self.features, self.rows_per_class)
        found._take(self, np.arange(self.classes))
        found._counts = found._complete.copy()
        found._rows.keep_complete()
        return found


def rows_beyond(
    values: FloatArray, codes: IntArray, limits: Sequence[int]
) -> BoolArray:
    """Return which rows have larger hashes than those that were kept of their class.

    Args:
        values: Shape (rows, features), as `Statistics.update` takes them.
        codes: The class of each row, from 0.
        limits: Those of the statistics of the table.
    """
    largest = np.array(limits, np.uint64)
    is_beyond = np.zeros(len(values), bool)
    for first in range(0, len(values), MOST_ROWS):
        piece = slice(first, first + MOST_ROWS)
        block = np.empty(values[piece].shape)
        _copy_rows(values[piece], block)
        is_beyond[piece] = hashed_digits(block) > largest[codes[piece]]
    return is_beyond


def _copy_rows(values: FloatArray, block: FloatArray) -> int:
    """Copy rows, equal numbers with equal bits; return how many miss a value."""
    # Adding zero makes a negative zero a positive one: they are equal numbers.
    np.add(values, 0.0, out=block)
    if finite_rows(block).all():
        return 0
    block[:] = values  # no sum, which may change the codes of texts
    block[block == 0.0] = 0.0
    is_missing = is_missing_code(block)
    block[is_missing] = np.nan
    return int(np.count_nonzero(is_missing.any(axis=1)))


def finite_rows(values: FloatArray) -> BoolArray:
    """Return which rows hold finite numbers only."""
    with np.errstate(over="ignore", invalid="ignore"):
        suspects = ~np.isfinite(values.sum(axis=1))
    usable: BoolArray = ~suspects
    if suspects.any():
        usable[suspects] = np.isfinite(values[suspects]).all(axis=1)
    return usable


def grouped_moments(values: FloatArray, groups: IntArray, size: int) -> Moments:
    """Return the moments of rows by group number, 0 to `size` - 1.

    A spread is 0 where the smallest value equals the largest one, whatever the sums
    say, and above 0 elsewhere, even if the squares underflow.

    Args:
        values: Shape (rows, features), finite.
        groups: The group of each row, in ascending order.
        size: How many groups there are; a group may be empty.
    """
    counts = np.bincount(groups, minlength=size).astype(np.int64)
    shape = (size, values.shape[1])
    means, spreads = np.full(shape, np.nan), np.full(shape, np.nan)
    lows, highs = np.full(shape, np.inf), np.full(shape, -np.inf)
    if not len(values):
        return Moments(counts, means, spreads, lows, highs)
    present, starts, lengths = runs(groups)
    shift = values[0].copy()
    columns = np.array(values.T, order="C", copy=True)
    low = np.minimum.reduceat(columns, starts, axis=1).T
    high = np.maximum.reduceat(columns, starts, axis=1).T
    with np.errstate(over="ignore", invalid="ignore"):
        columns -= shift[:, None]
        middle = np.add.reduceat(columns, starts, axis=1) / lengths
        columns -= np.repeat(middle, lengths, axis=1)
        rest = np.add.reduceat(columns, starts, axis=1)
        np.multiply(columns, columns, out=columns)
        squares = np.add.reduceat(columns, starts, axis=1) - rest * rest / lengths
        middle += rest / lengths
        rows = np.maximum(lengths - 1, 1)[:, None]
        spread = np.sqrt(np.maximum(squares, 0.0).T / rows)
        half = 0.5 * high - 0.5 * low
    spread = np.where(spread > 0, spread, half)
    constant = low == high
    spreads[present] = np.where(constant, 0.0, spread)
    means[present] = np.where(constant, low, np.clip(middle.T + shift, low, high))
    lows[present], highs[present] = low, high
    return Moments(counts, means, spreads, lows, highs)
