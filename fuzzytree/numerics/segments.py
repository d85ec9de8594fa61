"""The lines between points, in a number type: one table for everybody who joins them.

Runtimes and exporters that promise equal bits take their constants from here. On each
line, with `position = (x - anchor) / width`, the degree is
`near + position * (far - near)`, clamped between `near` and `far`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.model import IntArray, Points, checkpoint

if TYPE_CHECKING:
    import numpy.typing as npt

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
        anchor: The end of a line from which x is measured: the right one, or the left
            one if the degree is 0 there.
        width: The other end minus the anchor. A level line has an anchor of 0 and is
            as wide as the type allows, so that nothing overflows on it.
        near: The degree at the anchor.
        far: The degree at the other end.
    """

    first: IntArray
    room: IntArray
    values: Reals
    anchor: Reals
    width: Reals
    near: Reals
    far: Reals


def segments_of(shapes: Sequence[Points], axis: Real, degree: Real) -> Segments:
    """Return the lines of shapes, rounded to nearest.

    A degree below 1 stays below 1, and a value stays finite. Different values that
    become one are a step, with no line between them.

    Args:
        shapes: The shapes.
        axis: The type of values, differences and quotients.
        degree: The type of degrees.

    Example:
        >>> double = np.dtype(np.float64)
        >>> segments_of([Points((1.0, 3.0), (0.0, 1.0))], double, double).far.tolist()
        [0.0, 1.0, 1.0, 0.0]
    """
    checkpoint()
    sizes = np.array([1 << len(shape.values).bit_length() for shape in shapes], int)
    first = np.cumsum(sizes) - sizes
    whole = int(sizes.sum())
    values = np.full(whole, np.inf, axis)
    anchor, width = np.zeros(whole, axis), np.full(whole, np.finfo(axis).max, axis)
    near, far = np.zeros(whole, degree), np.zeros(whole, degree)
    tables = values, anchor, width, near, far
    for place, shape in zip(first.tolist(), shapes, strict=True):
        found = _lines(shape, axis, degree)
        for table, part in zip(tables, found, strict=True):
            table[place : place + len(part)] = part
    return Segments(first, sizes // 2, *tables)


def _lines(points: Points, axis: Real, degree: Real) -> tuple[Reals, ...]:
    """Return values, anchor, width, near and far of one shape."""
    largest = np.finfo(axis).max
    values = np.clip(points.values, -largest, largest).astype(axis)
    below_one = np.nextafter(degree.type(1), degree.type(0))
    exact = np.array(points.degrees)
    degrees = exact.astype(degree)
    degrees = np.where(exact < 1.0, np.minimum(degrees, below_one), degrees)
    start, end = np.append(values[0], values), np.append(values, values[-1])
    here, there = np.append(degrees[0], degrees), np.append(degrees, degrees[-1])
    is_rising = here == 0
    anchor, other = np.where(is_rising, [start, end], [end, start])
    near, far = np.where(is_rising, [here, there], [there, here])
    with np.errstate(over="ignore"):  # of points that only float32 finds too far apart
        width = np.clip(other - anchor, -largest, largest)
    is_level = (here == there) | (start == end)
    anchor = np.where(is_level, axis.type(0), anchor)
    width = np.where(is_level, largest, width)
    return values, anchor, width, near, far
