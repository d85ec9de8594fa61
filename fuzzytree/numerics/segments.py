"""The lines between points, in a number type: one table for everybody who joins them.

Runtimes and exporters that promise equal bits take their constants from here. On the
line that ends at (`right`, `to`), with `position = (x - right) / width`, the degree is
`to + position * (start - to)`, held between `start` and `to`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.rulebase import Points

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import IntArray

    Reals = npt.NDArray[np.floating[Any]]
    Real = np.dtype[np.floating[Any]]


@dataclass(frozen=True, slots=True)
class Segments:
    """The lines of some shapes, one shape behind the other.

    n points make n + 1 lines: before the first point, between the points, and behind
    the last one. Each shape has room for a power of two of them, so that the line of a
    value can be found by halving.

    Attributes:
        first: Of each shape, the place of its first line.
        room: Of each shape, half as many lines as there is room for.
        values: The points; x lies `k` lines behind the first if k points are below x.
            Infinite where there is no further point.
        right: Where a line ends.
        width: Its beginning minus its end: below 0. A level line ends at 0 and is as
            wide as the type allows, so that nothing overflows on it.
        start: The degree at its beginning.
        to: The degree at its end.
    """

    first: IntArray
    room: IntArray
    values: Reals
    right: Reals
    width: Reals
    start: Reals
    to: Reals


def segments(shapes: Sequence[Points], axis: Real, degree: Real) -> Segments:
    """Return the lines of shapes, rounded to nearest.

    A degree below 1 stays below 1, and a value stays finite. Different values that
    become one are a step, with no line between them.

    Args:
        shapes: The shapes.
        axis: The type of values, differences and quotients.
        degree: The type of degrees.

    Example:
        >>> double = np.dtype(np.float64)
        >>> segments([Points((1.0, 3.0), (0.0, 1.0))], double, double).to.tolist()
        [0.0, 1.0, 1.0, 0.0]
    """
    sizes = np.array([1 << len(shape.values).bit_length() for shape in shapes], int)
    first = np.cumsum(sizes) - sizes
    whole = int(sizes.sum())
    values = np.full(whole, np.inf, axis)
    right, width = np.zeros(whole, axis), np.full(whole, -np.finfo(axis).max, axis)
    start, to = np.zeros(whole, degree), np.zeros(whole, degree)
    tables = values, right, width, start, to
    for place, shape in zip(first.tolist(), shapes, strict=True):
        found = _lines(shape, axis, degree)
        for table, part in zip(tables, found, strict=True):
            table[place : place + len(part)] = part
    return Segments(first, sizes // 2, *tables)


def _lines(points: Points, axis: Real, degree: Real) -> tuple[Reals, ...]:
    """Return values, right, width, start and to of one shape."""
    largest = np.finfo(axis).max
    values = np.clip(points.values, -largest, largest).astype(axis)
    below_one = np.nextafter(degree.type(1), degree.type(0))
    exact = np.array(points.degrees)
    degrees = exact.astype(degree)
    degrees = np.where(exact < 1.0, np.minimum(degrees, below_one), degrees)
    start, to = np.append(degrees[0], degrees), np.append(degrees, degrees[-1])
    between = values[:-1].astype(np.float64) - values[1:]
    width = np.clip(np.concatenate([[0], between, [0]]), -largest, largest)
    width = width.astype(axis)
    is_level = (start == to) | (width == 0)
    right = np.where(is_level, axis.type(0), np.append(values, axis.type(0)))
    width = np.where(is_level, -largest, width).astype(axis)
    return values, right, width, start, to
