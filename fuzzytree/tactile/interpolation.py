"""Fuzzy interpolation: a frame of more points than the sensor has cells.

Each cell is a fuzzy number over the plane, a pyramid whose top stands on its centre
and whose base reaches to the centres of the diagonal neighbours: a point dx and dy
away from the centre, in cells, belongs to it by the degree `1 - max(|dx|, |dy|)`.
Every point lies in four pyramids, and its value is the mean of the four cells,
weighted by these degrees (paper, 3.2, whose printed divisor is a misprint).

`docs/explanation/interpolation.md` derives what is known of a value: it lies between
its four cells, changes by at most twice their range a cell's width, and differs from
the bilinear one by at most 0.105 of it.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from fuzzytree.errors import TableError

MOST_POINTS = 2**24
"""The most points that a frame may get."""

_BLOCK = 2**15  # points that are computed at once: they stay in the cache


def weights(times: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return how much the four cells around a point weigh, and what to divide by.

    A phase is where a point lies between the centres of neighbouring cells: there are
    `times` of them downwards and as many to the right. The weights are the degrees
    times `2 times`, of shape (4, times, times): upper left, upper right, lower left and
    lower right cell; by phase downwards and to the right. The sums have the shape
    (times, times).

    Example:
        >>> cells, sums = weights(2)  # a quarter and three quarters of a cell away
        >>> cells[:, 0, 0].tolist(), int(sums[0, 0])
        ([3, 1, 1, 1], 6)
    """
    whole = 2 * times
    away = np.arange(times, dtype=np.int64) * 2 + (1 - times % 2)
    near, far = whole - away, away  # the degree of the cell before, and behind
    pairs = ((near, near), (near, far), (far, near), (far, far))
    cells = np.array([np.minimum(down[:, None], right) for down, right in pairs])
    return cells, cells.sum(axis=0)


def interpolated(
    cells: npt.NDArray[np.integer],
    times: int,
    *,
    dtype: npt.DTypeLike = np.float64,
) -> npt.NDArray[Any]:
    """Return frames of `times` as many points as cells on each side.

    Points lie in the middle of equal parts of a cell, and behind the border the
    cells of the border are repeated. For an odd number the middle point of a cell has
    its value. Whole numbers are weighted by whole numbers and divided once: a value is
    the float nearest to the exact one, also in frames that are turned or mirrored.

    Args:
        cells: Whole numbers of shape (..., rows, columns).
        times: Points for a cell on each side, at least 1.
        dtype: float64 or float32, of the result.

    Returns:
        Shape (..., times rows, times columns).

    Raises:
        TypeError: If `times` is no whole number.
        ValueError: If `times` or `dtype` is out of range.
        TableError: If there is no cell, a number is no whole one or too large for exact
            sums, or a frame would have more than `MOST_POINTS` points.

    Example:
        >>> found = interpolated(np.array([[100, 50], [20, 10]]), 3)
        >>> found[1:5, 1:3].round(1).tolist()
        [[100.0, 83.3], [73.3, 56.0], [46.7, 40.0], [20.0, 16.7]]
    """
    kind = np.dtype(dtype)
    if kind.name not in ("float64", "float32"):
        raise ValueError(f"interpolated values are float64 or float32, not {kind}")
    found = _checked(cells, times, kind)
    *many, rows, columns = found.shape
    whole = np.empty((*many, times * rows, times * columns), kind)
    frames = found.reshape(-1, rows, columns)
    points = whole.reshape(-1, times * rows, times * columns)
    step = max(1, _BLOCK // (times * rows * times * columns))
    for first in range(0, len(frames), step):
        part = slice(first, first + step)
        points[part] = _points(frames[part], times, kind)
    return whole


def _points(
    frames: npt.NDArray[np.integer], times: int, kind: np.dtype[Any]
) -> npt.NDArray[Any]:
    """Return the points of some frames, of shape (frames, rows, columns)."""
    count, rows, columns = frames.shape
    around = np.pad(frames.astype(kind), ((0, 0), (1, 1), (1, 1)), "edge")
    corners = sliding_window_view(around, (2, 2), (1, 2))
    degrees, sums = weights(times)
    values: npt.NDArray[Any] = corners.reshape(-1, 4) @ degrees.reshape(4, -1).astype(
        kind
    )
    values /= sums.reshape(-1).astype(kind)
    turned = values.reshape(count, rows + 1, columns + 1, times, times).swapaxes(2, 3)
    dense = turned.reshape(count, (rows + 1) * times, (columns + 1) * times)
    skip = (times + 1) // 2  # from the centre of the border to the first point
    return dense[:, skip : skip + rows * times, skip : skip + columns * times]


def _checked(cells: Any, times: int, kind: np.dtype[Any]) -> npt.NDArray[Any]:
    found: npt.NDArray[Any] = np.asarray(cells)
    if operator.index(times) < 1:
        raise ValueError(f"times is a whole number of at least 1, not {times}")
    if found.dtype.kind not in "iu":
        raise TableError(f"frames hold whole numbers, not {found.dtype}")
    if found.ndim < 2 or 0 in found.shape[-2:]:
        raise TableError(f"an array of shape {found.shape} holds no frame")
    rows, columns = found.shape[-2:]
    if rows * columns * times**2 > MOST_POINTS:
        raise TableError(
            f"{rows} x {columns} cells, {times} times on each side, are more than "
            f"{MOST_POINTS} points"
        )
    most = (1 << (np.finfo(kind).nmant + 1)) // (4 * times)  # sums of weights are exact
    if found.size and not -most <= int(found.min()) <= int(found.max()) <= most:
        raise TableError(f"cells lie in {-most} to {most}, for {times} times as {kind}")
    return found
