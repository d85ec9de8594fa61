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

from fuzzytree.exporters.onnx_graph import OnnxGraph
from fuzzytree.model import Points
from fuzzytree.numerics import Segments, segments_of

if TYPE_CHECKING:
    from fuzzytree.numerics import Real

MOST_CHAINED = 8
"""Points up to which a chain is the faster way."""


class PointsPart(msgspec.Struct, frozen=True):
    """Points on one variable, joined by lines."""

    variable: str
    points: Points
    sign: int = 1


def is_chained(points_part: PointsPart) -> bool:
    """Return whether points are few enough for a chain."""
    return len(points_part.points.values) <= MOST_CHAINED


def polylines(graph: OnnxGraph, values: str, shapes: Sequence[Points]) -> str:
    """Add the degrees of shapes, given their finite values, as one block."""
    numbers = graph.types
    axis: Real = np.dtype(numbers.axis)
    degree: Real = np.dtype(numbers.degree)
    lines = segments_of(shapes, axis, degree)
    longest = max(len(shape.values) for shape in shapes)
    if longest > MOST_CHAINED:
        return _searched(graph, values, lines)
    return _chained(graph, values, lines, longest)


def _chained(
    graph: OnnxGraph,
    values: str,
    lines: Segments,
    longest: int,
) -> str:
    """Go from point to point; behind a shape's last one nothing changes."""
    degree = graph.column(lines.far[lines.first], "degrees")
    point_count = 2 * lines.room - 1
    for number in range(longest):
        has_line = number < point_count
        here = lines.first + np.where(has_line, number, 0)
        behind = lines.first + np.where(has_line, number + 1, 0)
        point = np.where(has_line, lines.values[here], lines.values[-1])
        is_above = graph.node("Greater", values, graph.column(point, "points"))
        line = far = graph.column(lines.far[behind], "degrees")
        if (lines.near[behind] != lines.far[behind]).any():
            parts = {
                "anchor": graph.column(lines.anchor[behind], "anchors"),
                "width": graph.column(lines.width[behind], "widths"),
                "near": graph.column(lines.near[behind], "degrees"),
                "far": far,
            }
            line = _line(graph, values, parts)
        degree = graph.node("Where", is_above, line, degree)
    return degree


def _searched(graph: OnnxGraph, values: str, lines: Segments) -> str:
    """Halve the room of all shapes at once; a smaller one stays where it is."""
    points = graph.constant(lines.values, "points")
    room = lines.room.astype(np.int32).reshape(-1, 1)
    place = graph.constant(lines.first.astype(np.int32).reshape(-1, 1), "firsts")
    zero = graph.constant(np.array(0, np.int32), "zero")
    while room.any():
        before = graph.constant(room - np.int32(1), "rooms")
        point = graph.node("Gather", points, graph.node("Add", place, before), axis=0)
        is_above = graph.node("Greater", values, point)
        step = graph.node("Where", is_above, graph.constant(room, "rooms"), zero)
        place = graph.node("Add", place, step)
        room = room >> 1
    parts = {
        name: graph.node("Gather", graph.constant(table, name), place, axis=0)
        for name, table in (
            ("anchor", lines.anchor),
            ("width", lines.width),
            ("near", lines.near),
            ("far", lines.far),
        )
    }
    return _line(graph, values, parts)


def _line(graph: OnnxGraph, values: str, parts: dict[str, str]) -> str:
    """Add the degree on a line, as in `fuzzytree.numerics.segments`."""
    numbers = graph.types

    def body(inner: OnnxGraph, inputs: Sequence[str], named: str) -> str:
        x, anchor, width, near, far = inputs
        position = inner.node("Div", inner.node("Sub", x, anchor), width)
        if numbers.is_mixed:
            kind = helper.np_dtype_to_tensor_dtype(np.dtype(numbers.degree))
            position = inner.node("Cast", position, to=kind)
        change = inner.node("Mul", position, inner.node("Sub", far, near))
        degree = inner.node("Add", change, near)
        degree = inner.node("Max", degree, inner.node("Min", near, far))
        return inner.node("Min", degree, inner.node("Max", near, far), named=named)

    return graph.block("Line", body, {"x": values, **parts})
