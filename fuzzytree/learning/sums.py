"""Sums of values and of their squares without any rounding.

Every float is a whole number times a power of two. A column is cut into limbs of 20
bits, counted from an exponent above its largest value: `x = 2^top (q1 2^-20 + q2 2^-40
+ q3 2^-60 + q4 2^-80)`, each `|q| <= 2^20`. A product of two limbs is at most 2^40, and
2^13 of them add up to at most 2^53, so the Gram matrix of the limbs (and of a row of
ones, which adds up the limbs themselves) is exact in double precision, in whatever
order the machine adds. Gram matrices are added as 64-bit integers, and these, now and
then, as Python's integers. Nothing is lost, so the order of the rows, and how they were
cut into chunks, cannot matter.

A value too small beside the largest of its column to fit into four limbs waits, and is
cut from an exponent of its own: a table that spans all exponents takes longer, and is
exact all the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from fuzzytree.learning.units import BoolArray, FloatArray, IntArray

MOST_ROWS = 1 << 13
"""How many rows may be added at once, for their limbs to add up exactly."""

_BITS = 20
_LIMBS = 4
_HEADROOM = 2
_MOST_BLOCKS = 1 << 7
_LOWEST = -1074  # the exponent of the smallest float
_HIGHEST = 1024

Wholes = npt.NDArray[np.object_]
"""Python's integers, of any size."""


@dataclass(frozen=True)
class Totals:
    """The exact sums of one column, group by group.

    Attributes:
        counts: How many values.
        sums: Their sums, in units of `2**unit`.
        squares: The sums of their squares, in units of `2**(2 unit)`.
        unit: An exponent of which every value is a whole multiple.

    Example:
        >>> found = totals_of(np.array([0.1, 0.2, 0.3]), np.zeros(3, np.int64), 1)
        >>> found.means().tolist(), found.spreads().tolist()
        ([0.2], [0.09999999999999999])
    """

    counts: Sequence[int]
    sums: Sequence[int]
    squares: Sequence[int]
    unit: int

    def means(self, origin: float = 0.0, exponent: int = 0) -> FloatArray:
        """Return `(mean - origin) / 2**exponent`, rounded once; NaN without values.

        Args:
            origin: One of the values, or 0.
            exponent: Of the unit.
        """
        start, unit = whole(origin, self.unit), self.unit - exponent
        return np.array(
            [
                rounded_ratio(total - count * start, count, unit) if count else math.nan
                for count, total in zip(self.counts, self.sums, strict=True)
            ]
        )

    def spreads(self, exponent: int = 0) -> FloatArray:
        """Return standard deviations with n - 1, rounded once; NaN without values.

        The variance is `(n Q - S^2) / (n (n - 1))` for sums S and Q. One value alone
        has no spread.

        Args:
            exponent: Of the unit.
        """
        columns = zip(self.counts, self.sums, self.squares, strict=True)
        unit = self.unit - exponent
        return np.array(
            [
                rounded_root(n * square - total**2, n * max(n - 1, 1), unit)
                if n
                else math.nan
                for n, total, square in columns
            ]
        )

    @property
    def exponent(self) -> int:
        """An exponent e so that no mean and no spread is above 2^e."""
        bits = max((square.bit_length() for square in self.squares), default=0)
        return self.unit + bits // 2 + 1

    def variance(self, group: int) -> int:
        """Return `n Q - S^2` of a group, in units of `2**(2 unit)`; never negative."""
        total = self.sums[group]
        return self.counts[group] * self.squares[group] - total * total


def whole(value: float, unit: int) -> int:
    """Return a value as a multiple of `2**unit`, which it must be."""
    if value == 0.0:
        return 0
    top, bottom = value.as_integer_ratio()
    return (top << max(-unit, 0)) // (bottom << max(unit, 0))


def rounded_ratio(top: int, bottom: int, exponent: int) -> float:
    """Return `top / bottom * 2**exponent`, rounded once.

    Python rounds the quotient of two integers once, whatever their size.

    Example:
        >>> rounded_ratio(1, 3, -1) == (1 / 3) / 2
        True
    """
    return (top << exponent) / bottom if exponent >= 0 else top / (bottom << -exponent)


def rounded_root(top: int, bottom: int, exponent: int) -> float:
    """Return `sqrt(top / bottom) * 2**exponent`, rounded once.

    The root is taken of a whole number of 110 bits or more; one more bit shows whether
    something was cut off, so that the last rounding cannot mistake it for a tie.

    Example:
        >>> rounded_root(2, 1, 0) == math.sqrt(2.0)
        True
    """
    if top == 0:
        return 0.0
    shift = max(0, (112 + bottom.bit_length() - top.bit_length()) // 2)
    square, rest = divmod(top << (2 * shift), bottom)
    root = math.isqrt(square)
    is_cut = rest != 0 or root * root != square
    return rounded_ratio(2 * root + is_cut, 1, exponent - shift - 1)


def totals_of(values: FloatArray, groups: IntArray, size: int) -> Totals:
    """Return the exact sums of one axis.

    Args:
        values: Shape (rows,), finite.
        groups: The group of each row.
        size: How many groups there are.
    """
    sums = Sums(size, 1)
    for first in range(0, len(values), MOST_ROWS):
        piece = groups[first : first + MOST_ROWS]
        order = np.argsort(piece, kind="stable")
        present, starts, counts = runs(piece[order])
        column = values[first : first + MOST_ROWS][order]
        sums.add(column[None], present, starts, counts)
    return sums.totals(0, np.bincount(groups, minlength=size).tolist())


def runs(codes: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the codes present in a sorted array, where each starts, how many."""
    starts = np.flatnonzero(np.diff(codes, prepend=codes[0] - 1)).astype(np.int64)
    counts = np.diff(starts, append=len(codes))
    return codes[starts], starts, counts


def narrow(codes: IntArray) -> npt.NDArray[np.integer]:
    """Return codes in the smallest type, which sorts by radix."""
    return codes.astype(np.uint16) if codes.max(initial=0) < 1 << 16 else codes


@dataclass
class Sums:
    """Adds up columns and their squares by group, exactly.

    Attributes:
        groups: How many groups there are.
        features: How many columns there are.
    """

    groups: int
    features: int
    _top: IntArray = field(init=False, repr=False)
    _limb_sums: IntArray = field(init=False, repr=False)
    _limb_squares: IntArray = field(init=False, repr=False)
    _blocks: int = 0
    _unit: IntArray = field(init=False, repr=False)
    _sums: Wholes = field(init=False, repr=False)
    _squares: Wholes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Start from nothing."""
        shape = (self.groups, self.features)
        self._top = np.full(self.features, _LOWEST, np.int64)
        self._limb_sums = np.zeros((*shape, _LIMBS), np.int64)
        self._limb_squares = np.zeros((*shape, 2 * _LIMBS - 1), np.int64)
        self._unit = np.full(self.features, _HIGHEST, np.int64)
        self._sums = np.zeros(shape, object)
        self._squares = np.zeros(shape, object)

    def add(
        self, columns: FloatArray, present: IntArray, starts: IntArray, counts: IntArray
    ) -> None:
        """Add some rows.

        Args:
            columns: Shape (features, rows), finite, ordered by group; 2^13 rows at
                most.
            present: The groups that occur, each once.
            starts: Where the rows of each begin.
            counts: How many they are.
        """
        largest = np.maximum(columns.max(axis=1), -columns.min(axis=1))
        exponents = np.frexp(largest)[1].astype(np.int64)  # of 2^e above all values
        tops = np.where(largest > 0, exponents, _LOWEST)
        has_grown = tops > self._top
        if has_grown.any() or self._blocks == _MOST_BLOCKS:
            self._settle()
            self._top = np.where(has_grown, tops + _HEADROOM, self._top)
        limbs, waiting = _limbs(columns, self._top)
        self._count(_grams(limbs, starts, counts), present)
        if waiting is None:
            return
        chosen = np.flatnonzero(waiting.any(axis=1))
        small = np.where(waiting[chosen], columns[chosen], 0.0)
        part = Sums(len(present), len(chosen))
        part.add(small, np.arange(len(present)), starts, counts)
        self.take(part, present, chosen)

    def _count(self, grams: FloatArray, present: IntArray) -> None:
        """Add Gram matrices: sums of limbs, and products by the unit they have."""
        wholes = grams.astype(np.int64)
        for i in range(1, wholes.shape[2]):
            self._limb_sums[present, :, i - 1] += wholes[:, :, 0, i]
            for j in range(1, wholes.shape[2]):
                self._limb_squares[present, :, i + j - 2] += wholes[:, :, i, j]
        self._blocks += 1

    def _settle(self) -> None:
        """Move what the limbs hold to the totals."""
        if not self._blocks:
            return
        unit = self._top - _BITS * _LIMBS
        everything = np.arange(self.groups), np.arange(self.features)
        sums, squares = _joined(self._limb_sums), _joined(self._limb_squares)
        self._add_wholes(unit, sums, squares, *everything)
        self._limb_sums[:] = 0
        self._limb_squares[:] = 0
        self._blocks = 0

    def grow(self, groups: int) -> None:
        """Make room for groups without values."""
        more = groups - self.groups
        self._limb_sums = padded(self._limb_sums, more, 0)
        self._limb_squares = padded(self._limb_squares, more, 0)
        self._sums = padded(self._sums, more, 0)
        self._squares = padded(self._squares, more, 0)
        self.groups = groups

    def of_features(self, features: IntArray) -> Sums:
        """Return the totals of some features."""
        self._settle()
        found = Sums(len(self._sums), len(features))
        found._unit = self._unit[features]
        found._sums = self._sums[:, features]
        found._squares = self._squares[:, features]
        return found

    def take(self, other: Sums, groups: IntArray, features: IntArray) -> None:
        """Add the totals of some groups and features."""
        other._settle()
        self._add_wholes(other._unit, other._sums, other._squares, groups, features)

    def _add_wholes(
        self,
        unit: IntArray,
        sums: Wholes,
        squares: Wholes,
        groups: IntArray,
        features: IntArray,
    ) -> None:
        """Add whole numbers in a unit per feature; the finer unit is kept."""
        mine = self._unit[features]
        unit = np.where((squares != 0).any(axis=0), unit, _HIGHEST)
        finer = np.minimum(mine, unit)
        self._unit[features] = finer
        place = np.ix_(groups, features)
        for total, added, power in (
            (self._sums, sums, 1),
            (self._squares, squares, 2),
        ):
            total[:, features] <<= (power * (mine - finer)).astype(object)
            shifted = added << (power * (unit - finer)).astype(object)
            np.add.at(total, place, shifted)  # two groups may become one

    def arrays(self) -> dict[str, npt.NDArray[np.generic]]:
        """Return the totals as arrays, whole numbers as bytes of one width."""
        self._settle()
        return {
            "units": self._unit,
            "sums": _bytes_of(self._sums),
            "squares": _bytes_of(self._squares),
        }

    def fill(self, arrays: Mapping[str, npt.NDArray[np.generic]]) -> None:
        """Take the totals that `arrays` gave; nothing was added before.

        Raises:
            ValueError: If an array has another type or size than it must have.
        """
        self._unit = sized(arrays, "units", np.int64, (self.features,))
        if not ((self._unit >= _LOWEST) & (self._unit <= _HIGHEST)).all():
            raise ValueError("has a unit that no double has")
        self._sums = _wholes_of(arrays, "sums", self.groups, self.features)
        self._squares = _wholes_of(arrays, "squares", self.groups, self.features)

    def moments(
        self,
        counts: Sequence[int],
        origins: FloatArray | None = None,
        exponents: IntArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the means and the spreads of all columns, shape (groups, features).

        Args:
            counts: The rows of each group.
            origins: For each column what `Totals.means` takes; 0 unless given.
            exponents: For each column what both methods take; 0 unless given.
        """
        means = np.empty((self.groups, self.features))
        spreads = np.empty_like(means)
        for k in range(self.features):
            totals = self.totals(k, counts)
            exponent = 0 if exponents is None else int(exponents[k])
            origin = 0.0 if origins is None else float(origins[k])
            means[:, k] = totals.means(origin, exponent)
            spreads[:, k] = totals.spreads(exponent)
        return means, spreads

    def totals(self, feature: int, counts: Sequence[int]) -> Totals:
        """Return the totals of one column.

        Args:
            feature: Its number.
            counts: The rows of each group.
        """
        self._settle()
        return Totals(
            counts,
            self._sums[:, feature].tolist(),
            self._squares[:, feature].tolist(),
            int(self._unit[feature]),
        )


def sized(
    arrays: Mapping[str, npt.NDArray[np.generic]],
    name: str,
    kind: type[np.generic],
    shape: tuple[int, ...],
) -> npt.NDArray[Any]:
    """Return one of some arrays in its shape.

    Raises:
        ValueError: If it is absent, or has another type or size.
    """
    array = arrays.get(name)
    if array is None or array.dtype != kind or array.size != math.prod(shape):
        wanted = f"{math.prod(shape)} numbers of type {kind.__name__}"
        raise ValueError(f"has not the {wanted} that {name!r} needs")
    return array.reshape(shape).copy()


def padded(array: npt.NDArray[Any], more: int, value: float) -> npt.NDArray[Any]:
    """Return an array with some more entries of one value along the first axis."""
    rest = np.full((more, *array.shape[1:]), value, array.dtype)
    return np.concatenate([array, rest])


def _bytes_of(wholes: Wholes) -> npt.NDArray[np.generic]:
    """Return the bytes of whole numbers, all as wide as the widest needs."""
    numbers = wholes.reshape(-1).tolist()
    width = max((number.bit_length() // 8 + 1 for number in numbers), default=1)
    content = b"".join(
        number.to_bytes(width, "little", signed=True) for number in numbers
    )
    return np.frombuffer(content, np.uint8)


def _wholes_of(
    arrays: Mapping[str, npt.NDArray[np.generic]], name: str, groups: int, features: int
) -> Wholes:
    count = groups * features
    width = arrays[name].size // max(count, 1) if name in arrays else 0
    content = sized(arrays, name, np.uint8, (count, width)).tobytes()
    result = np.zeros(count, object)
    for place in range(count if width else 0):
        number = content[place * width : (place + 1) * width]
        result[place] = int.from_bytes(number, "little", signed=True)
    return result.reshape(groups, features)


def _limbs(columns: FloatArray, tops: IntArray) -> tuple[FloatArray, BoolArray | None]:
    """Return a row of ones and the limbs, shape (features, 1 + limbs, rows).

    Returns:
        The limbs, all 0 for a value that does not fit; and which values do not fit,
        or None if all do.
    """
    limbs = np.empty((len(columns), 1 + _LIMBS, columns.shape[1]))
    limbs[:, 0] = 1.0
    rest = np.ldexp(columns, (_BITS - tops)[:, None])
    waiting: BoolArray | None = None
    if tops.max(initial=_LOWEST) > _BITS:  # only then a value can shrink to nothing
        waiting = (rest == 0) & (columns != 0)
    for limb in range(1, 1 + _LIMBS):
        np.rint(rest, out=limbs[:, limb])
        rest -= limbs[:, limb]
        rest *= 2.0**_BITS
        if not rest.any():
            limbs = limbs[:, : limb + 1]
            break
    else:
        waiting = (rest != 0) if waiting is None else waiting | (rest != 0)
    if waiting is None or not waiting.any():
        return limbs, None
    limbs[:, 1:] *= ~waiting[:, None]
    return limbs, waiting


def _grams(limbs: FloatArray, starts: IntArray, counts: IntArray) -> FloatArray:
    """Return the products of limbs added up by run, shape (runs, features, k, k)."""
    features, size, rows = limbs.shape
    found = np.empty((len(starts), features, size, size))
    if len(starts) <= rows // 16:
        pairs = zip(starts.tolist(), counts.tolist(), strict=True)
        for run, (start, count) in enumerate(pairs):
            piece = limbs[:, :, start : start + count]
            np.matmul(piece, piece.transpose(0, 2, 1), out=found[run])
        return found
    for i in range(size):
        for j in range(i, size):
            products = np.add.reduceat(limbs[:, i] * limbs[:, j], starts, axis=1).T
            found[:, :, i, j] = found[:, :, j, i] = products
    return found


def _joined(limbs: IntArray) -> Wholes:
    """Return whole numbers from limbs, the highest first along the last axis."""
    total: Wholes = limbs[..., 0].astype(object)
    for limb in range(1, limbs.shape[-1]):
        total = (total << _BITS) + limbs[..., limb]
    return total
