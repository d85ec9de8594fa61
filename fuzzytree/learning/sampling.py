"""A bounded sample of rows that depends on the rows alone, and their weights.

Of each class the distinct rows with the smallest hashes are kept, and how often each
occurs. Whether a row is among them depends on no other row's place, so any order, any
chunks and any merging keep the same ones; and a row that is kept at the end was never
left out before, so its count is exact. The hash looks at the digits of the numbers and
not at their exponents: columns multiplied by powers of two keep the same rows.

Rows that agree in all digits (1, 2 and 4, say) are kept together or not at all, so a
class may have a few rows less than it may have. Only where they alone are more than
half of what may be kept, a hash of the whole numbers decides between them; there a
column multiplied by a power of two may keep others. So it may for numbers below
2^-1022, which have fewer digits. With no more distinct rows than wanted all are
kept.

A row of the whole weight k counts as k equal rows, and learning sees no difference. Of
weights that are no whole numbers, or add up to more rows than can be counted, only
their ratios matter: they are divided by their mean. Such a row counts as often as its
weight says when rounded, once at least, and each time with an equal share of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
import numpy.typing as npt

from fuzzytree.learning.settings import ClassWeight
from fuzzytree.learning.sums import narrow, padded, runs, sized
from fuzzytree.learning.units import (
    ColumnUnits,
    FloatArray,
    IntArray,
    tallied,
    units_of,
)

Hashes = npt.NDArray[np.uint64]

_DIGITS = np.uint64((1 << 63) | ((1 << 52) - 1))
_HALF = np.uint64(32)
_ONE = np.uint64(1)
_BUFFER = 1 << 15
_FEW, _MANY, _CELLS = 5_000, 20_000, 1 << 20


def usual_rows(columns: int, classes: int) -> int:
    """Return how many rows of a class are kept unless a number is set.

    20,000, or as many as give all classes 2^20 numbers, but 5,000 at least.

    Example:
        >>> usual_rows(11, 2), usual_rows(11, 7), usual_rows(64, 10)
        (20000, 13617, 5000)
    """
    return max(_FEW, min(_MANY, _CELLS // max(columns * classes, 1)))


@dataclass(frozen=True)
class Sample:
    """Rows of a table, ordered by class and then by the hash of their moved values.

    Attributes:
        rows: Shape (kept, features).
        moved: The same rows in the columns' units.
        codes: Class of each row.
        units: The columns' units.
    """

    rows: FloatArray
    moved: FloatArray
    codes: IntArray
    units: ColumnUnits

    def at(self, chosen: IntArray) -> Sample:
        """Return some of the rows, ordered by class."""
        return Sample(
            self.rows[chosen], self.moved[chosen], self.codes[chosen], self.units
        )

    def without_last_column(self) -> tuple[Sample, FloatArray]:
        """Return the sample without its last column, and that column, in its order."""
        rows, moved = self.rows[:, :-1], self.moved[:, :-1]
        keys = self.rows[:, -1], hashed_rows(rows), hashed_rows(moved), self.codes
        order = np.lexsort(keys)
        units = self.units
        found = Sample(
            np.ascontiguousarray(rows[order]),
            np.ascontiguousarray(moved[order]),
            self.codes[order],
            ColumnUnits(units.origins[:-1], units.exponents[:-1], units.is_sound[:-1]),
        )
        return found, self.rows[order, -1]


@dataclass(frozen=True)
class _Rows:
    """Some rows with their class, their hashes and how often they occur."""

    values: FloatArray
    codes: IntArray
    digits: Hashes
    hashes: Hashes
    copies: IntArray

    def at(self, chosen: IntArray) -> _Rows:
        """Return some of the rows."""
        return _Rows(*(getattr(self, one.name)[chosen] for one in fields(self)))

    @staticmethod
    def joined(parts: list[_Rows]) -> _Rows:
        """Return the rows of all parts."""
        return _Rows(
            *(
                np.concatenate([getattr(part, one.name) for part in parts])
                for one in fields(_Rows)
            )
        )


@dataclass
class DistinctRows:
    """Keeps distinct rows of each class, those with the smallest hashes.

    Attributes:
        classes: How many classes there are.
        features: How many columns there are.
        most: How many distinct rows of a class are kept at most.
    """

    classes: int
    features: int
    most: int
    _parts: list[_Rows] = field(default_factory=list[_Rows], repr=False)
    _kept: int = 0
    _settled: int = 0
    _limits: Hashes = field(init=False, repr=False)
    _refused: Hashes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Start without rows and without limits.

        `_limits` are the largest hashes of digits that may be kept, by class, and
        `_refused` the smallest that are known to be too many, with those below them.
        """
        self._limits = np.full(self.classes, np.iinfo(np.uint64).max, np.uint64)
        self._refused = self._limits.copy()

    def offer(self, values: FloatArray, codes: IntArray) -> None:
        """Offer rows; those that are kept are copied.

        Args:
            values: Shape (rows, features), finite or codes, without negative zeros.
            codes: Class of each row.
        """
        digits = hashed_digits(values)
        chosen = np.flatnonzero(digits <= self._limits[codes])
        if not len(chosen):
            return
        kept = values[chosen]
        ones = np.ones(len(chosen), np.int64)
        self._parts.append(
            _Rows(kept, codes[chosen], digits[chosen], hashed_rows(kept), ones)
        )
        self._kept += len(chosen)
        if self._kept > self._settled + self._settled // 2 + _BUFFER:
            self.settle()

    def limits(self) -> tuple[int, ...]:
        """Return the largest hash of digits that a row of each class may have."""
        self.settle()
        return tuple(self._limits.tolist())

    def take(self, other: DistinctRows, positions: IntArray) -> None:
        """Add the rows of another table; two classes may become one.

        Args:
            other: The rows kept of that table.
            positions: The number that each of its classes has here.
        """
        np.minimum.at(self._limits, positions, other._limits)
        np.minimum.at(self._refused, positions, other._refused)
        for part in other._parts:
            self._parts.append(replace(part, codes=positions[part.codes]))
        self._kept += other._kept

    def arrays(self) -> dict[str, npt.NDArray[np.generic]]:
        """Return the rows kept and the limits of what may be kept, as arrays."""
        found = self.settle()
        nothing = np.empty(0, np.int64)
        return {
            "rows": np.empty((0, self.features)) if found is None else found.values,
            "codes": nothing if found is None else found.codes,
            "copies": nothing if found is None else found.copies,
            "limits": self._limits,
            "refused": self._refused,
        }

    def fill(self, arrays: Mapping[str, npt.NDArray[np.generic]]) -> None:
        """Take the rows that `arrays` gave; their hashes are computed again.

        Raises:
            ValueError: If an array has another type or size than it must have, or holds
                a row that cannot have been kept.
        """
        kept = len(arrays.get("codes", ()))
        codes: IntArray = sized(arrays, "codes", np.int64, (kept,))
        values = sized(arrays, "rows", np.float64, (kept, self.features)).copy()
        values[values == 0.0] = 0.0
        copies = sized(arrays, "copies", np.int64, (kept,))
        self._limits = sized(arrays, "limits", np.uint64, (self.classes,))
        self._refused = sized(arrays, "refused", np.uint64, (self.classes,))
        is_class = (codes >= 0) & (codes < self.classes)
        if not (is_class.all() and (copies > 0).all() and not np.isinf(values).any()):
            raise ValueError("keeps a row that cannot have been kept")
        if kept:
            digits, hashes = hashed_digits(values), hashed_rows(values)
            self._parts = [_Rows(values, codes, digits, hashes, copies)]
            self._kept = kept
            self.settle()

    def grow(self, classes: int) -> None:
        """Make room for classes without rows."""
        more, all_hashes = classes - self.classes, np.iinfo(np.uint64).max
        self._limits = padded(self._limits, more, all_hashes)
        self._refused = padded(self._refused, more, all_hashes)
        self.classes = classes

    def of_columns(self, kept: Sequence[int]) -> DistinctRows:
        """Return the rows kept, with some of their columns."""
        result = DistinctRows(self.classes, len(kept), self.most)
        found = self.settle()
        if found is not None:
            values = np.ascontiguousarray(found.values[:, kept])
            hashes = hashed_digits(values), hashed_rows(values)
            result._parts = [_Rows(values, found.codes, *hashes, found.copies)]
            result._kept = len(values)
        return result

    def keep_complete(self) -> None:
        """Leave out rows with a value that is no finite number."""
        found = self.settle()
        if found is not None:
            kept = np.flatnonzero(np.isfinite(found.values).all(axis=1))
            self._parts = [found.at(kept)] if len(kept) else []
            self._kept = self._settled = len(kept)

    def sample(
        self, lows: FloatArray, highs: FloatArray, most: int | None = None
    ) -> Sample:
        """Return `most` rows of each class at most, in a canonical order.

        Where a class has more rows than that, distinct rows have copies in proportion
        to how often they occur (largest remainders first).

        Args:
            lows: The smallest value of each column, over the whole table.
            highs: The largest.
            most: No more than are kept; as many unless given.
        """
        found = self.settle()
        if found is None:
            nothing = np.empty((0, self.features))
            units = units_of(np.zeros((1, self.features)), lows, lows)
            return Sample(nothing, nothing, np.empty(0, np.int64), units)
        units = units_of(found.values, lows, highs)
        order = _order(found, hashed_rows(units.moved(found.values)))
        found = found.at(order)
        chosen = np.repeat(np.arange(len(order)), _shares(found, most or self.most))
        rows = found.values[chosen]
        return Sample(rows, units.moved(rows), found.codes[chosen], units)

    def settle(self) -> _Rows | None:
        """Join equal rows, and leave out all but the smallest hashes of each class."""
        if not self._parts:
            return None
        if len(self._parts) == 1 and self._kept == self._settled:
            return self._parts[0]
        found = _Rows.joined(self._parts)
        self._parts = []
        order = _order(found, found.digits)
        first, copies = _distinct(found, order)
        order = order[first]
        chosen = self._chosen(found.codes[order], found.digits[order])
        kept = found.at(order[chosen])
        kept.copies[:] = copies[chosen]
        self._parts = [kept]
        self._kept = self._settled = len(kept.codes)
        return kept

    def _chosen(self, codes: IntArray, digits: Hashes) -> IntArray:
        """Return which distinct rows, ordered by class and hashes, are kept.

        The first digits that are too many with all before them are refused for good:
        more rows cannot make them fewer. They fill up what is left where less than
        half has been kept, by their second hash.
        """
        present, starts, counts = runs(codes)
        rank = np.arange(len(codes)) - np.repeat(starts, counts)
        is_last = np.ones(len(codes), bool)
        is_last[:-1] = (np.diff(codes) != 0) | (digits[1:] != digits[:-1])
        is_much = is_last & (rank >= self.most)
        np.minimum.at(self._refused, codes[is_much], digits[is_much])
        is_before = digits < self._refused[codes]
        before = np.bincount(codes[is_before], minlength=self.classes)
        is_few = 2 * before < self.most
        refused = self._refused[present]
        self._limits[present] = np.where(is_few[present], refused, refused - _ONE)
        fills = is_few[codes] & (digits == self._refused[codes]) & (rank < self.most)
        return np.flatnonzero(is_before | fills)


def _order(found: _Rows, keys: Hashes) -> IntArray:
    """Return the order of rows by class, by keys, and where these tie by hashes.

    Sorting one key after another is several times faster than `lexsort`.
    """
    order = np.argsort(keys)
    order = order[np.argsort(narrow(found.codes[order]), kind="stable")]
    codes, keys_in_order = found.codes[order], keys[order]
    is_tie = np.zeros(len(order) + 1, bool)
    is_tie[1:-1] = (codes[1:] == codes[:-1]) & (keys_in_order[1:] == keys_in_order[:-1])
    places = np.flatnonzero(is_tie[1:] | is_tie[:-1])
    ties = order[places]
    order[places] = ties[
        np.lexsort((found.hashes[ties], keys[ties], found.codes[ties]))
    ]
    return order


def _distinct(found: _Rows, order: IntArray) -> tuple[IntArray, IntArray]:
    """Return where each distinct row begins in an order by hashes, and its copies.

    Rows are equal if 127 bits of their hashes are.
    """
    is_new = np.zeros(len(order), bool)
    is_new[0] = True
    for key in (found.codes, found.digits, found.hashes):
        ordered = key[order]
        is_new[1:] |= ordered[1:] != ordered[:-1]
    first = np.flatnonzero(is_new)
    return first, np.add.reduceat(found.copies[order], first)


def _shares(found: _Rows, most: int) -> IntArray:
    """Return how many copies of each distinct row the sample holds."""
    copies = found.copies.copy()
    _, starts, counts = runs(found.codes)
    totals = np.add.reduceat(found.copies, starts)
    for start, count, total in zip(starts, counts, totals.tolist(), strict=True):
        if total <= most:
            continue
        mine = slice(start, start + count)
        wanted = found.copies[mine] * most
        copies[mine] = wanted // total
        missing = most - int(copies[mine].sum())
        largest = np.argsort(-(wanted % total), kind="stable")[:missing]
        copies[start + largest] += 1
    return copies


def hashed(numbers: npt.NDArray[np.integer]) -> Hashes:
    """Return a well mixed number for each whole number (splitmix64)."""
    mixed = numbers.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


def hashed_digits(values: FloatArray) -> Hashes:
    """Return a hash of each row that no power of two in a column changes.

    Signs and mantissas are multiplied by an odd number for each column and added up,
    their upper halves a second time, for numbers of few digits; zero counts as none.
    It has 63 bits.

    Example:
        >>> rows = np.array([[3.0, 0.7], [-3.0, 0.7]])
        >>> scaled = rows * [2.0**-300, 1024.0]
        >>> (hashed_digits(rows) == hashed_digits(scaled)).tolist()
        [True, True]
        >>> len(set(hashed_digits(rows).tolist()))
        2
    """
    digits = np.ascontiguousarray(values).view(np.uint64) & _DIGITS
    digits += digits >> _HALF
    digits += values != 0
    return hashed(digits.dot(_odd_numbers(values.shape[1]))) >> _ONE


def hashed_rows(values: FloatArray) -> Hashes:
    """Return a hash of the bits of each row."""
    bits = np.ascontiguousarray(values).view(np.uint64)
    return hashed(hashed(bits).dot(_odd_numbers(values.shape[1])))


def _odd_numbers(count: int) -> Hashes:
    return hashed(np.arange(1, count + 1)) | np.uint64(1)


MOST_COPIES = 1 << 24
"""Whole weights that add up to more count by their ratios."""

_SMALLEST = 1e-9
_PIECE = 1 << 16


@dataclass(frozen=True)
class RowWeights:
    """Weights of the rows of a table.

    Attributes:
        copies: How often each row counts; 0 leaves it out.
        shares: The weight of each copy; None where it is 1, as of whole weights.
    """

    copies: IntArray
    shares: FloatArray | None

    def pieces(self) -> Iterator[IntArray]:
        """Yield the positions of the rows, as often as they count, piece by piece."""
        ends = np.cumsum(self.copies)
        total = int(ends[-1]) if len(ends) else 0
        for first in range(0, total, _PIECE):
            places = np.arange(first, min(total, first + _PIECE))
            yield np.searchsorted(ends, places, side="right")


def row_weights(values: FloatArray) -> RowWeights:
    """Return how often each row counts, and with which share each time.

    Args:
        values: Finite, not negative, and not all 0.

    Example:
        >>> row_weights(np.array([2.0, 0.0, 1.0])).copies.tolist()
        [2, 0, 1]
        >>> found = row_weights(np.array([0.5, 1.5, 4.0]))  # their mean is 2
        >>> found.copies.tolist(), found.shares.tolist()
        ([1, 1, 2], [0.25, 0.75, 1.0])
    """
    largest = values.max()
    is_whole = largest <= MOST_COPIES and (values == np.floor(values)).all()
    if is_whole and values.sum() <= MOST_COPIES:
        return RowWeights(values.astype(np.int64), None)
    is_kept = values > 0
    scaled = values / largest  # no sum overflows then
    mean = math.fsum(scaled) / int(np.count_nonzero(is_kept))
    relative = np.where(is_kept, np.maximum(scaled / mean, _SMALLEST), 0.0)
    copies = np.where(is_kept, np.maximum(np.rint(relative), 1.0), 0.0)
    return RowWeights(copies.astype(np.int64), relative / np.maximum(copies, 1.0))


def class_weights(
    wanted: ClassWeight, classes: Sequence[str], codes: IntArray, weights: FloatArray
) -> FloatArray:
    """Return by what the weights of each class are multiplied.

    Args:
        wanted: As in `fuzzytree.learning.LearningSettings`.
        classes: Their names.
        codes: The class of each row.
        weights: Of the rows.

    Example:
        >>> codes = np.array([0, 0, 0, 1])
        >>> class_weights("balanced", ["a", "b"], codes, np.ones(4)).round(2).tolist()
        [0.67, 2.0]
        >>> class_weights({"b": 3.0}, ["a", "b"], codes, np.ones(4)).tolist()
        [1.0, 3.0]
    """
    if wanted == "balanced":
        totals = tallied(codes, weights, len(classes))
        shares = np.where(totals > 0, totals, np.inf) / totals.sum()
        balanced: FloatArray = 1.0 / (np.count_nonzero(totals) * shares)
        return balanced
    return np.array([(wanted or {}).get(name, 1.0) for name in classes], np.float64)
