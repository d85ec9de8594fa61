"""A variable as a picture of the page: its terms over the rows, within the domain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from fuzzytree.report.audit_rows import Data, histogram
from fuzzytree.report.drawing import (
    LETTER,
    Axis,
    Curve,
    Scale,
    axis_marks,
    between,
    cut,
    polyline,
    spread,
    svg,
    words,
)
from fuzzytree.report.markup import Markup, tag
from fuzzytree.report.svg_tree import class_mark
from fuzzytree.report.text import number

WIDE = 340.0
MOST_CURVES = 24
"""Of one variable that are drawn."""

DASHES = (None, "7 3", "2 2.5", "9 3 2 3")
"""How the lines of neighbouring terms look, in turn."""

_LEFT, _RIGHT = 8.0, 332.0
_PLOT = 126.0  # high
_ROW = 14.0  # of names above it
_MOST_ROWS = 3
_BINS = 36
_FONT = 11.0


def scale_of(axis: Axis, data: Data | None, start: float, end: float) -> Scale:
    """Return the scale of a variable: its domain and its rows, with some room."""
    ends = [value for value in (axis.low, axis.high) if value is not None]
    if data is not None and axis.name in data.axes:
        import numpy as np

        values = data.axes[axis.name]
        finite = values[np.isfinite(values)]
        if finite.size:
            ends += [float(finite.min()), float(finite.max())]
    if not ends:
        ends = [corner for curve in axis.curves for corner in curve.corners] or [0, 1]
    return Scale(*spread(ends), start, end)


def terms_picture(axis: Axis, data: Data | None, name: str) -> Markup:
    """Return the terms of a variable, over the histogram of its rows."""
    x = scale_of(axis, data, _LEFT, _RIGHT)
    drawn = axis.curves[:MOST_CURVES]
    names = _placed(drawn, x)
    top = 8.0 + _ROW * max((name.row + 1 for name in names), default=0)
    y = Scale(0.0, 1.0, top + _PLOT, top)
    parts = [*_bins(axis, data, x, y)]
    parts += outside(axis, x, top - 4, y.start)
    parts.append(
        tag("line", x1=_LEFT, x2=_RIGHT, y1=y.start, y2=y.start, class_="axis")
    )
    for place, curve in enumerate(drawn):
        parts.append(
            tag(
                "path",
                tag("title", curve.name),
                d=polyline(curve, x, y),
                class_="curve",
                stroke_dasharray=DASHES[place % len(DASHES)],
            )
        )
    parts += _names(names, top)
    if len(names) < len(axis.curves):
        said = f"+ {len(drawn) - len(names)} unnamed"
        if len(drawn) < len(axis.curves):
            said += f", {len(axis.curves) - len(drawn)} not drawn"
        parts.append(words(x.end, top + 10.0, said, "small", "end"))
    parts += axis_marks(x, y.start)
    high = y.start + 22.0
    title = f"The terms of {axis.title}"
    return svg(WIDE, high, title, _told(axis), *parts, name=name)


def _told(axis: Axis) -> str:
    terms = ", ".join(curve.name for curve in axis.curves[:MOST_CURVES]) or "none"
    domain = ""
    if axis.low is not None and axis.high is not None:
        domain = f"; the domain is {number(axis.low)} to {number(axis.high)}"
    return f"Degrees from 0 to 1 over the values{domain}; terms: {terms}"


def outside(axis: Axis, x: Scale, top: float, base: float) -> Iterator[Markup]:
    """Yield what shows where a variable is outside of the domain."""
    if axis.low is None or axis.high is None:
        return
    left, right = x.at(axis.low), x.at(axis.high)
    for start, end in ((x.start, left), (right, x.end)):
        if end - start > 0.3:
            yield tag(
                "rect",
                x=start,
                y=top,
                width=end - start,
                height=base - top,
                class_="outside",
            )
    for at in (left, right):
        yield tag("line", x1=at, x2=at, y1=top, y2=base, class_="domain")


def _bins(axis: Axis, data: Data | None, x: Scale, y: Scale) -> Iterator[Markup]:
    """Yield the bars of the rows, those of each class upon another."""
    if data is None or axis.name not in data.axes:
        return
    bins = histogram(data, axis.name, x.low, x.high, _BINS)
    tallest = max(map(sum, bins), default=0)
    wide = (x.end - x.start) / _BINS
    for place, counts in enumerate(bins):
        base = y.start
        for code, count in enumerate(counts):
            if not count:
                continue
            high = _PLOT * 0.86 * count / tallest
            mark = class_mark(code) if code < len(data.classes) else "none"
            base -= high
            yield tag(
                "rect",
                x=x.start + place * wide + 0.4,
                y=base,
                width=wide - 0.8,
                height=high,
                class_=f"bin {mark}",
            )


class _Name(NamedTuple):
    """The name of a term above its curve; row 0 stands lowest."""

    said: str
    middle: float
    row: int


def _placed(curves: Sequence[Curve], x: Scale) -> list[_Name]:
    """Return the names that fit above the plateaus, from left to right."""
    free = [x.start - 9.0] * _MOST_ROWS
    names: list[_Name] = []
    for top, place in sorted((_top(curve, x), k) for k, curve in enumerate(curves)):
        said = cut(curves[place].name, 22)
        half = LETTER * _FONT * len(said) / 2.0
        middle = min(max(top, x.start + half), x.end - half)
        rows = (row for row, end in enumerate(free) if end + 8.0 <= middle - half)
        row = next(rows, None)
        if row is not None:
            free[row] = middle + half
            names.append(_Name(said, middle, row))
    return names


def _names(names: Sequence[_Name], top: float) -> Iterator[Markup]:
    for said, middle, row in names:
        base = top - 9.0 - _ROW * row
        if row:
            ends = {"x1": middle, "x2": middle, "y1": base + 3, "y2": top - 4}
            yield tag("line", class_="lead", **ends)
        yield words(middle, base, said, "term", "middle")


def _top(curve: Curve, x: Scale) -> float:
    """Return the point in the middle of where a curve is highest."""
    steps = 60
    values = [between(x.low, x.high, k / steps) for k in range(steps + 1)]
    values += curve.corners_between(x.low, x.high)
    degrees = [curve.degree(value) for value in values]
    highest = max(degrees)
    tops = [v for v, d in zip(values, degrees, strict=True) if d == highest]
    return x.at(between(min(tops), max(tops), 0.5))
