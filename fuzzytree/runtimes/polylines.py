"""Degrees of points joined by lines, for many values.

First the line of each value is found: `counted` compares it with every point, which is
best for few points; `halved` moves on from the shape's first line, by half of the room
that is left, wherever the value is above the point there. Then `join` computes the
degree; the operations on one number, and their order, are those of
`fuzzytree.semantics.reference`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fuzzytree.model.contracts import IntArray
    from fuzzytree.numerics.segments import Reals, Segments


def join(lines: Segments, place: IntArray, x: Reals) -> Reals:
    """Return the degree of each value on its line.

    Args:
        lines: The lines of all shapes.
        place: The place of each value's line.
        x: Finite values, in the lines' type.
    """
    position = _taken(lines.anchor, place)
    np.subtract(x, position, out=position)
    position /= _taken(lines.width, place)
    near, far = _taken(lines.near, place), _taken(lines.far, place)
    found = position.astype(near.dtype, copy=False)
    found *= far - near
    found += near
    np.maximum(found, np.minimum(near, far), out=found)
    np.minimum(found, np.maximum(near, far, out=far), out=found)
    return found


def counted(lines: Segments, shape: IntArray, x: Reals) -> IntArray:
    """Return the place of the line on which each value lies, by comparisons.

    Args:
        lines: The lines of all shapes.
        shape: Numbers of shapes of less than 128 points, in a form that broadcasts to
            that of the values.
        x: The values.
    """
    first = lines.first.take(shape)
    last = 2 * lines.room.take(shape) - 1  # a line without a further point
    below = np.zeros(x.shape, np.int8)
    is_above = np.empty(x.shape, np.bool_)
    for number in range(int(last.max(initial=0))):
        limit = lines.values.take(first + np.minimum(number, last))
        if np.isinf(limit).all():
            break
        np.greater(x, limit, out=is_above)
        below += is_above.view(np.int8)
    return first + below


def halved(lines: Segments, shape: IntArray, x: Reals) -> IntArray:
    """Return the place of the line on which each value lies, by halving.

    Args:
        lines: The lines of all shapes.
        shape: Numbers of shapes, in a form that broadcasts to that of the values.
        x: The values.
    """
    place = np.empty(x.shape, np.int64)
    place[:] = lines.first.take(shape)
    room = lines.room.take(shape)
    probe = np.empty_like(place)
    is_above = np.empty(x.shape, np.bool_)
    for _ in range(int(room.max(initial=0)).bit_length()):
        np.add(place, room - 1, out=probe)
        np.greater(x, _taken(lines.values, probe), out=is_above)
        np.multiply(is_above, room, out=probe)
        place += probe
        room = room >> 1
    return place


def _taken(table: Reals, place: IntArray) -> Reals:
    """Return entries of a table; a place outside of it gives that at its end."""
    return table.take(place, mode="clip")  # faster than a check of each place
