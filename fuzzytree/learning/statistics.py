"""Fuzzy statistics (paper, 2.2.1): means, spreads and window counts per class.

A `Statistics` value takes rows in chunks of any size and gives the same bits for any
chunking: rows are gathered into blocks whose borders depend on the row number alone.
Within a block values are shifted by the table's first row, then summed twice (a
corrected two-pass variance); blocks are joined by Chan's formula on the shifted
values. It keeps a bounded sample of rows for everything that needs rows: clusters,
combinations, inner validation and window counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fuzzytree.learning.arrays import BoolArray, FloatArray, IntArray

BLOCK_VALUES = 1 << 19
"""A block holds about this many numbers (4 MiB), whatever its width."""

_EDGE_ULPS = 4.0


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


@dataclass(frozen=True)
class Sample:
    """Rows kept from a table, ordered by class and then by row number.

    Attributes:
        rows: Shape (kept, features).
        codes: Class of each row.
    """

    rows: FloatArray
    codes: IntArray


@dataclass
class Statistics:
    """An accumulator of class moments and a bounded sample of rows.

    Attributes:
        classes: How many classes there are.
        features: How many columns there are.
        rows_per_class: How many rows of each class the sample keeps at most: those
            with the smallest hash of their row number.
        dropped: Rows left out so far because a value is missing or not finite.

    Example:
        >>> table = np.array([[1.0], [3.0], [7.0]])
        >>> statistics = Statistics(classes=2, features=1)
        >>> statistics.update(table, np.array([0, 0, 1]))
        >>> statistics.moments().means.tolist()
        [[2.0], [7.0]]
    """

    classes: int
    features: int
    rows_per_class: int = 5_000
    dropped: int = 0
    _rows: int = 0
    _filled: int = 0
    _block: FloatArray = field(init=False, repr=False)
    _block_codes: IntArray = field(init=False, repr=False)
    _shift: FloatArray | None = field(default=None, repr=False)
    _counts: IntArray = field(init=False, repr=False)
    _sums: FloatArray = field(init=False, repr=False)
    _squares: FloatArray = field(init=False, repr=False)
    _lows: FloatArray = field(init=False, repr=False)
    _highs: FloatArray = field(init=False, repr=False)
    _kept: list[tuple[FloatArray, IntArray, npt.NDArray[np.uint64], IntArray]] = field(
        default_factory=list[
            tuple[FloatArray, IntArray, npt.NDArray[np.uint64], IntArray]
        ],
        repr=False,
    )
    _kept_rows: int = 0
    _limits: npt.NDArray[np.uint64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Make room for one block and for the moments."""
        size = block_rows(self.features)
        shape = (self.classes, self.features)
        self._block = np.empty((size, self.features))
        self._block_codes = np.empty(size, np.int64)
        self._counts = np.zeros(self.classes, np.int64)
        self._sums = np.zeros(shape)
        self._squares = np.zeros(shape)
        self._lows = np.full(shape, np.inf)
        self._highs = np.full(shape, -np.inf)
        self._limits = np.full(self.classes, np.iinfo(np.uint64).max, np.uint64)

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
            usable = finite_rows(piece) & (chosen >= 0)
            self._append(piece, chosen, usable)
            first = last
            if self._filled == size:
                self._absorb()

    def _append(self, piece: FloatArray, codes: IntArray, usable: BoolArray) -> None:
        count = int(np.count_nonzero(usable))
        self.dropped += len(piece) - count
        place = slice(self._filled, self._filled + count)
        everything = count == len(piece)
        self._block[place] = piece if everything else piece[usable]
        self._block_codes[place] = codes if everything else codes[usable]
        self._filled += count

    def _absorb(self) -> None:
        """Fold the gathered block into the moments and the sample."""
        if not self._filled:
            return
        values, codes = self._block[: self._filled], self._block_codes[: self._filled]
        shift = values[0].copy() if self._shift is None else self._shift
        self._shift = shift
        self._keep(values, codes)
        order = np.argsort(narrow(codes, self.classes), kind="stable")
        present, starts, counts = runs(codes[order])
        block = _block_moments(values[order], shift, starts, counts)
        self._join(present, counts, block)
        self._rows += self._filled
        self._filled = 0

    def _join(
        self, present: IntArray, counts: IntArray, block: tuple[FloatArray, ...]
    ) -> None:
        """Add a block's moments by Chan's formula; `_sums` holds shifted means."""
        means, squares, lows, highs = block
        before = self._counts[present][:, None].astype(np.float64)
        added = counts[:, None].astype(np.float64)
        total = before + added
        with np.errstate(over="ignore", invalid="ignore"):
            step = means - self._sums[present]
            self._sums[present] += step * (added / total)
            self._squares[present] += squares + step * step * (before * added / total)
        self._lows[present] = np.minimum(self._lows[present], lows)
        self._highs[present] = np.maximum(self._highs[present], highs)
        self._counts[present] += counts

    def _keep(self, values: FloatArray, codes: IntArray) -> None:
        """Offer a block to the sample: the smallest hashes of each class stay."""
        numbers = np.arange(self._rows, self._rows + len(values), dtype=np.int64)
        hashes = hashed(numbers)
        chosen = hashes <= self._limits[codes]
        if not chosen.any():
            return
        self._kept.append(
            (values[chosen], codes[chosen], hashes[chosen], numbers[chosen])
        )
        self._kept_rows += int(np.count_nonzero(chosen))
        room = min(self.classes * self.rows_per_class, 1 << 22)
        if self._kept_rows > 2 * max(room, len(self._block)):
            self._compact()

    def _compact(self) -> None:
        parts = list(zip(*self._kept, strict=True))
        if not parts:
            return
        codes = np.concatenate(parts[1])
        hashes = np.concatenate(parts[2])
        numbers = np.concatenate(parts[3])
        order = np.lexsort((numbers, hashes, codes))
        present, starts, counts = runs(codes[order])
        rank = np.arange(len(order)) - np.repeat(starts, counts)
        chosen = order[rank < self.rows_per_class]
        full = counts >= self.rows_per_class
        last = order[starts[full] + self.rows_per_class - 1]
        self._limits[present[full]] = hashes[last]
        chosen = chosen[np.lexsort((numbers[chosen], codes[chosen]))]
        rows = np.concatenate(parts[0])[chosen]
        self._kept = [(rows, codes[chosen], hashes[chosen], numbers[chosen])]
        self._kept_rows = len(rows)

    def merge(self, other: Statistics) -> Statistics:
        """Return the statistics of both tables, as if `other` followed.

        Counts, smallest and largest values are exact; means and spreads are equal to
        those of one pass up to rounding, for the blocks begin elsewhere.
        """
        left, right = self._closed(), other._closed()
        joined = Statistics(self.classes, self.features, self.rows_per_class)
        joined.dropped = self.dropped + other.dropped
        joined._rows = left._rows + right._rows
        joined._shift = left._shift if left._shift is not None else right._shift
        joined._limits = np.minimum(left._limits, right._limits)
        for part in (left, right):
            if part._shift is None or joined._shift is None:
                continue
            present = np.flatnonzero(part._counts)
            block = (
                part._sums[present] + (part._shift - joined._shift),
                part._squares[present],
                part._lows[present],
                part._highs[present],
            )
            joined._join(present, part._counts[present], block)
        joined._kept = [*left._kept, *right._kept]
        joined._compact()
        return joined

    def _closed(self) -> Statistics:
        """Return a copy in which the gathered rows are counted too."""
        copy = Statistics(self.classes, self.features, self.rows_per_class)
        copy.dropped, copy._rows, copy._filled = self.dropped, self._rows, self._filled
        copy._block = self._block
        copy._block_codes = self._block_codes
        copy._shift = self._shift
        copy._counts = self._counts.copy()
        copy._sums, copy._squares = self._sums.copy(), self._squares.copy()
        copy._lows, copy._highs = self._lows.copy(), self._highs.copy()
        copy._limits, copy._kept = self._limits.copy(), list(self._kept)
        copy._kept_rows = self._kept_rows
        copy._absorb()
        return copy

    def moments(self) -> Moments:
        """Return the moments of all rows taken so far."""
        closed = self._closed()
        shift = np.zeros(self.features) if closed._shift is None else closed._shift
        counts = closed._counts
        return finished_moments(
            counts, closed._sums + shift, closed._squares, closed._lows, closed._highs
        )

    def sample(self) -> Sample:
        """Return the rows kept, ordered by class and row number."""
        closed = self._closed()
        closed._compact()
        if not closed._kept:
            return Sample(np.empty((0, self.features)), np.empty(0, np.int64))
        rows, codes, _, _ = closed._kept[0]
        return Sample(rows, codes)


def block_rows(features: int) -> int:
    """Return how many rows of this width make a block: a power of two."""
    rows = max(1, BLOCK_VALUES // max(1, features))
    return int(min(1 << 16, max(1 << 6, 1 << (rows.bit_length() - 1))))


def finite_rows(values: FloatArray) -> BoolArray:
    """Return which rows hold finite numbers only."""
    with np.errstate(over="ignore", invalid="ignore"):
        suspects = ~np.isfinite(values.sum(axis=1))
    usable: BoolArray = ~suspects
    if suspects.any():
        usable[suspects] = np.isfinite(values[suspects]).all(axis=1)
    return usable


def narrow(codes: IntArray, classes: int) -> npt.NDArray[np.integer]:
    """Return the codes in the smallest type, which sorts by radix."""
    return codes.astype(np.uint16) if classes <= 1 << 16 else codes


def runs(codes: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the codes present in a sorted array, where each starts, how many."""
    starts = np.flatnonzero(np.diff(codes, prepend=codes[0] - 1)).astype(np.int64)
    counts = np.diff(starts, append=len(codes))
    return codes[starts], starts, counts


def hashed(numbers: IntArray) -> npt.NDArray[np.uint64]:
    """Return a well mixed number for each row number (splitmix64)."""
    mixed = numbers.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


def _block_moments(
    values: FloatArray, shift: FloatArray, starts: IntArray, counts: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return shifted means, squared deviations, lows and highs per run of rows."""
    columns = np.array(values.T, order="C", copy=True)
    lows = np.minimum.reduceat(columns, starts, axis=1).T
    highs = np.maximum.reduceat(columns, starts, axis=1).T
    with np.errstate(over="ignore", invalid="ignore"):
        columns -= shift[:, None]
        means = np.add.reduceat(columns, starts, axis=1) / counts
        columns -= np.repeat(means, counts, axis=1)
        rest = np.add.reduceat(columns, starts, axis=1)
        np.multiply(columns, columns, out=columns)
        squares = np.add.reduceat(columns, starts, axis=1) - rest * rest / counts
        means += rest / counts
    return means.T, np.maximum(squares, 0.0).T, lows, highs


def finished_moments(
    counts: IntArray,
    means: FloatArray,
    squares: FloatArray,
    lows: FloatArray,
    highs: FloatArray,
) -> Moments:
    """Return moments from sums of squared deviations.

    A spread is 0 where the smallest value equals the largest one, whatever the sums
    say, and above 0 elsewhere, even if the squares underflow.
    """
    empty = counts == 0
    rows = np.maximum(counts - 1, 1)[:, None]
    with np.errstate(over="ignore", invalid="ignore"):
        spreads = np.sqrt(squares / rows)
        half = 0.5 * highs - 0.5 * lows
    spreads = np.where(spreads > 0, spreads, half)
    constant = lows == highs
    spreads = np.where(constant, 0.0, spreads)
    means = np.where(constant, lows, np.clip(means, lows, highs))
    means[empty] = np.nan
    spreads[empty] = np.nan
    return Moments(counts, means, spreads, lows, highs)


def grouped_moments(values: FloatArray, groups: IntArray, size: int) -> Moments:
    """Return the moments of rows by group number, 0 to `size` - 1.

    Args:
        values: Shape (rows, features), finite.
        groups: The group of each row, in ascending order.
        size: How many groups there are; a group may be empty.
    """
    features = values.shape[1]
    counts = np.bincount(groups, minlength=size).astype(np.int64)
    means = np.zeros((size, features))
    squares = np.zeros((size, features))
    lows = np.full((size, features), np.inf)
    highs = np.full((size, features), -np.inf)
    if len(values):
        present, starts, lengths = runs(groups)
        shift = values[0].copy()
        block = _block_moments(values, shift, starts, lengths)
        means[present] = block[0] + shift
        squares[present], lows[present], highs[present] = block[1:]
    return finished_moments(counts, means, squares, lows, highs)


def window_counts(
    values: FloatArray, groups: IntArray, means: FloatArray, spreads: FloatArray, n: int
) -> IntArray:
    """Return S(k) for k = -n..n: the values in a window around M + (k/n) SD.

    The window is `[M + ((k - 1)/n) SD, M + ((k + 1)/n) SD]`, closed at both ends as
    the paper prints it, so that neighbours overlap by half. A value within four
    units of the last place of an edge counts as lying on it.

    Args:
        values: One axis, shape (rows,).
        groups: The group of each row.
        means: M per group.
        spreads: SD per group; above 0.
        n: Windows on each side.

    Returns:
        Integers of shape (groups, 2n + 1).
    """
    size = len(means)
    with np.errstate(over="ignore"):
        steps = (values - means[groups]) / spreads[groups] * n
    slack = _EDGE_ULPS * np.finfo(np.float64).eps * (np.abs(steps) + n)
    counts = np.empty((size, 2 * n + 1), np.int64)
    for column, k in enumerate(range(-n, n + 1)):
        inside = np.abs(steps - k) <= 1.0 + slack
        counts[:, column] = np.bincount(groups[inside], minlength=size)
    return counts
