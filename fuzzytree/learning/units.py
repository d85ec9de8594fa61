"""Each column in a unit of its own, so that its scale and its place do not matter.

Learning reckons in `z = (x - origin) / 2^exponent`. The origin is a value of the
column, in its middle; the exponent is that of its range. A column multiplied by a power
of two, or moved by an offset that leaves all differences as they are, has the same z,
bit for bit; so everything that is decided on z is decided alike, nothing overflows, and
a column at 1e12 with a spread of 1 is as good as one at 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

_WIDEST = 900


@dataclass(frozen=True)
class ColumnUnits:
    """The origin and the unit of each column.

    Attributes:
        origins: A value of each column, in its middle.
        exponents: Each range lies between `2**(exponent - 1)` and `2**exponent`.
        is_sound: Which columns vary and have a range that does not overflow. The
            others are 0 in their unit.
    """

    origins: FloatArray
    exponents: IntArray
    is_sound: BoolArray

    @property
    def is_combinable(self) -> BoolArray:
        """Which columns may have a weight in a combination, without overflow."""
        return self.is_sound & (np.abs(self.exponents) <= _WIDEST)

    def moved(self, rows: FloatArray) -> FloatArray:
        """Return rows in the columns' units, shape (rows, features)."""
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            moved = np.ldexp(rows - self.origins, -self.exponents)
        moved[:, ~self.is_sound] = 0.0
        return moved


def units_of(rows: FloatArray, lows: FloatArray, highs: FloatArray) -> ColumnUnits:
    """Return the units of a table.

    Args:
        rows: Rows of the table, one at least, in any order; the origin is the lower
            median of each column.
        lows: The smallest value of each column, over the whole table.
        highs: The largest.

    Example:
        >>> rows = np.array([[10.0], [11.0], [14.0]])
        >>> units = units_of(rows, np.array([10.0]), np.array([14.0]))
        >>> units.origins.tolist(), units.exponents.tolist()
        ([11.0], [3])
        >>> units.moved(rows).tolist()
        [[-0.125], [0.0], [0.375]]
    """
    middle = (len(rows) - 1) // 2
    origins = np.partition(rows, middle, axis=0)[middle]
    with np.errstate(over="ignore", invalid="ignore"):
        ranges = highs - lows
    is_sound = (lows < highs) & np.isfinite(ranges)
    exponents = np.frexp(np.where(is_sound, ranges, 1.0))[1].astype(np.int64)
    return ColumnUnits(origins, np.where(is_sound, exponents, 0), is_sound)


FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def tallied(groups: IntArray, weights: FloatArray, size: int) -> FloatArray:
    """Return the weight of each group, 0 to `size` - 1."""
    return np.bincount(groups, weights, size).astype(np.float64, copy=False)
