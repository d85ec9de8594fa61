"""Points joined by lines, as a block of the graph of rules.

A line is found in one of two ways, whichever onnxruntime does faster. Few points are a
chain: the line behind each point takes the place of the one before it where the value
is above the point. Many points are searched by halving, and the line's numbers are
gathered: five passes over the rows for each halving instead of eight for each point.
For 4 points a chain takes less than half the time of a search, for 64 four times it;
from 8 to 12 they are even.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from onnx import helper

from fuzzytree.exporters.onnx_ends import Numbers
from fuzzytree.exporters.onnx_graph import Sheet
from fuzzytree.model.rulebase import Points
from fuzzytree.numerics.segments import Segments, segments

if TYPE_CHECKING:
    from fuzzytree.numerics.segments import Real, Reals

MOST_CHAINED = 8
"""Points up to which a chain is the faster way."""


class Polyline(msgspec.Struct, frozen=True):
    """Points on one variable, joined by lines."""

    variable: str
    points: Points
    sign: int = 1


def is_chained(polyline: Polyline) -> bool:
    """Return whether points are few enough for a chain."""
    return len(polyline.points.values) <= MOST_CHAINED


def polylines(
    sheet: Sheet, values: str, shapes: Sequence[Points], numbers: Numbers
) -> str:
    """Add the degrees of shapes, given their finite values, as one block."""
    axis: Real = np.dtype(numbers.axis)
    degree: Real = np.dtype(numbers.degree)
    lines = segments(shapes, axis, degree)
    longest = max(len(shape.values) for shape in shapes)
    if longest > MOST_CHAINED:
        return _searched(sheet, values, lines, numbers)
    return _chained(sheet, values, lines, numbers, longest)


def _chained(
    sheet: Sheet, values: str, lines: Segments, numbers: Numbers, longest: int
) -> str:
    """Go from point to point; behind a shape's last one nothing changes."""
    degree = _column(sheet, lines.far[lines.first], "degrees")
    point_count = 2 * lines.room - 1
    for number in range(longest):
        has_line = number < point_count
        here = lines.first + np.where(has_line, number, 0)
        behind = lines.first + np.where(has_line, number + 1, 0)
        point = np.where(has_line, lines.values[here], lines.values[-1])
        is_above = sheet.node("Greater", values, _column(sheet, point, "points"))
        line = far = _column(sheet, lines.far[behind], "degrees")
        if (lines.near[behind] != lines.far[behind]).any():
            parts = {
                "anchor": _column(sheet, lines.anchor[behind], "anchors"),
                "width": _column(sheet, lines.width[behind], "widths"),
                "near": _column(sheet, lines.near[behind], "degrees"),
                "far": far,
            }
            line = _line(sheet, values, parts, numbers)
        degree = sheet.node("Where", is_above, line, degree)
    return degree


def _searched(sheet: Sheet, values: str, lines: Segments, numbers: Numbers) -> str:
    """Halve the room of all shapes at once; a smaller one stays where it is."""
    points = sheet.constant(lines.values, "points")
    room = lines.room.astype(np.int32).reshape(-1, 1)
    place = sheet.constant(lines.first.astype(np.int32).reshape(-1, 1), "firsts")
    zero = sheet.constant(np.array(0, np.int32), "zero")
    while room.any():
        before = sheet.constant(room - np.int32(1), "rooms")
        point = sheet.node("Gather", points, sheet.node("Add", place, before), axis=0)
        is_above = sheet.node("Greater", values, point)
        step = sheet.node("Where", is_above, sheet.constant(room, "rooms"), zero)
        place = sheet.node("Add", place, step)
        room = room >> 1
    parts = {
        name: sheet.node("Gather", sheet.constant(table, name), place, axis=0)
        for name, table in (
            ("anchor", lines.anchor),
            ("width", lines.width),
            ("near", lines.near),
            ("far", lines.far),
        )
    }
    return _line(sheet, values, parts, numbers)


def _column(sheet: Sheet, table: Reals, hint: str) -> str:
    return sheet.constant(table.reshape(-1, 1), hint)


def _line(sheet: Sheet, values: str, parts: dict[str, str], numbers: Numbers) -> str:
    """Add the degree on a line, as in `fuzzytree.numerics.segments`."""

    def body(inner: Sheet, inputs: Sequence[str], named: str) -> str:
        x, anchor, width, near, far = inputs
        position = inner.node("Div", inner.node("Sub", x, anchor), width)
        if numbers.is_mixed:
            kind = helper.np_dtype_to_tensor_dtype(np.dtype(numbers.degree))
            position = inner.node("Cast", position, to=kind)
        change = inner.node("Mul", position, inner.node("Sub", far, near))
        degree = inner.node("Add", change, near)
        degree = inner.node("Max", degree, inner.node("Min", near, far))
        return inner.node("Min", degree, inner.node("Max", near, far), named=named)

    return sheet.block("Line", body, {"x": values, **parts})
