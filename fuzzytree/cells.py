"""Single cells of a table as numbers and as Python's own values."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from fuzzytree.errors import TableError

if TYPE_CHECKING:
    import pyarrow as pa

    Cells: TypeAlias = Sequence[object] | npt.NDArray[np.generic] | pa.ChunkedArray

IntArray = npt.NDArray[np.int64]

MISSING = frozenset({"", "na", "n/a", "nan", "null", "none"})
"""The texts, in small letters, that stand for a missing number."""

REAL = frozenset("biuf")
"""Numpy's letters for truth values, integers and floats."""

NO_WEIGHT = "all weights are zero, and a row of weight zero is left out"
"""Why there is nothing to learn from."""

EXACT = 2.0**53
"""Below it each whole number is a double."""

_NUMBERS = (bool, int, float, np.bool_, np.integer, np.floating)
_NO_NUMBER = frozenset("cmMSV")  # complex, times, bytes
_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|inf|infinity|nan)",
    re.IGNORECASE,
)


def numbers_only(array: npt.NDArray[np.generic], name: str) -> npt.NDArray[np.generic]:
    """Return an array of numbers, NaN where it is masked.

    Raises:
        TableError: If it holds times, complex numbers or bytes.
    """
    if array.dtype.kind in _NO_NUMBER:
        raise TableError(f"{name} holds {array.dtype}, and no numbers")
    return unmasked(array)


def unmasked(array: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
    """Return an array whose masked cells are missing: NaN, or None in objects."""
    if not np.ma.isMaskedArray(array) or array.dtype.kind in _NO_NUMBER:
        return array
    is_real = array.dtype.kind in REAL
    filled = np.ma.getdata(array).astype(np.float64 if is_real else object)
    filled[np.ma.getmaskarray(array)] = math.nan if is_real else None
    return filled


def is_weight(values: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return which numbers may be the weight of a row: finite and not negative ones."""
    return np.isfinite(values) & (values >= 0)


def checked_weights(
    weights: Sequence[float] | npt.NDArray[np.generic], rows: int
) -> npt.NDArray[np.float64]:
    """Return the weights of some rows as numbers.

    Raises:
        ValueError: If there are more or fewer, one is negative, missing or infinite, or
            all are 0.
    """
    found = unmasked(np.asanyarray(weights))
    if found.dtype.kind not in REAL:
        raise ValueError("weights are numbers, one for each row")
    if found.ndim != 1:
        shape = tuple(found.shape)
        raise ValueError(f"weights have the shape {shape}, and they need (rows,)")
    if len(found) != rows:
        raise ValueError(f"{len(found)} weights, but {rows} rows")
    values = found.astype(np.float64)
    bad = np.flatnonzero(~is_weight(values))
    if len(bad):
        raise ValueError(
            f"the weight of row {bad[0] + 1} is {values[bad[0]]:g}; a weight is finite "
            "and not negative"
        )
    if not values.any():
        raise ValueError(NO_WEIGHT)
    return values


def is_missing(value: object) -> bool:
    """Return whether a value stands for none, in any library."""
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return True
    return isinstance(value, float) and math.isnan(value)


def distinct_values(cells: Cells) -> tuple[IntArray, Sequence[object]]:
    """Return where the value of each cell is among values that rarely repeat."""
    if isinstance(cells, np.ndarray) and cells.dtype.kind in REAL:
        numbers = cells.astype(np.float64) if cells.dtype.kind == "f" else cells
        is_float = cells.dtype.kind == "f"  # whose bits tell -0.0 from 0.0
        bits = numbers.view(np.int64) if is_float else np.ascontiguousarray(numbers)
        distinct, indices = np.unique(bits, return_inverse=True)
        return indices.astype(np.int64), distinct.view(numbers.dtype).tolist()
    if hasattr(cells, "dictionary_encode") and len(cells):
        encoded = cast("pa.ChunkedArray", cells).combine_chunks().dictionary_encode()
        indices = np.from_dlpack(encoded.indices).astype(np.int64)
        return indices, encoded.dictionary.to_pylist()
    values = plain(cells)
    if not {*map(type, values)} <= {str, type(None)}:  # 1, 1.0 and True are equal
        return np.arange(len(values)), values
    places = {value: place for place, value in enumerate(dict.fromkeys(values))}
    return np.fromiter(map(places.__getitem__, values), np.int64), [*places]


def plain(cells: Cells) -> Sequence[object]:
    """Return cells as Python's own values."""
    if isinstance(cells, np.ndarray) and cells.dtype.kind in "mM":
        times = cast("npt.NDArray[np.datetime64]", cells)
        return [None if np.isnat(time) else str(time) for time in times]
    if isinstance(cells, np.ndarray):
        return cast("Sequence[object]", cells.tolist())
    if isinstance(cells, Sequence):
        return cells
    result: list[object] = (  # a pandas or polars series is no Sequence either
        cells.to_pylist() if hasattr(cells, "to_pylist") else [*cells]
    )
    return result


def number_of(cell: object) -> float | None:
    """Return a cell as a number, NaN if it is missing, None if it is something else."""
    if isinstance(cell, str):
        text = cell.strip()
        if text.lower() in MISSING:
            return math.nan
        return float(text) if _NUMBER.fullmatch(text) else None
    if is_missing(cell):
        return math.nan
    is_number = isinstance(cell, _NUMBERS) or type(cell).__name__ == "Decimal"
    is_number = is_number and not isinstance(cell, np.timedelta64)
    return float(cast("float", cell)) if is_number else None
