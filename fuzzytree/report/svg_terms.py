"""A variable as a picture of the page: its terms over the rows, within the domain."""

from __future__ import annotations

from collections.abc import Iterator

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
from fuzzytree.report.text import counted, number

WIDE, HIGH = 340.0, 184.0
MOST_CURVES = 24
"""Of one variable that are drawn."""

DASHES = (None, "7 3", "2 2.5", "9 3 2 3")
"""How the lines of neighbouring terms look, in turn."""

_LEFT, _RIGHT = 8.0, 332.0
_TOP, _BASE = 36.0, 162.0
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
    """Return the terms of a variable, over the histogram of its rows.

    Args:
        axis: The variable.
        data: The rows, if there are any.
        name: A word that only this picture of the page has.
    """
    x = scale_of(axis, data, _LEFT, _RIGHT)
    y = Scale(0.0, 1.0, _BASE, _TOP)
    drawn = axis.curves[:MOST_CURVES]
    parts = [*_bins(axis, data, x)]
    parts += outside(axis, x, _TOP - 4, _BASE)
    parts.append(tag("line", x1=_LEFT, x2=_RIGHT, y1=_BASE, y2=_BASE, class_="axis"))
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
    parts += _labels(drawn, x)
    parts += axis_marks(x, _BASE)
    return svg(WIDE, HIGH, f"The terms of {axis.title}", _told(axis), *parts, name=name)


def _told(axis: Axis) -> str:
    terms = ", ".join(curve.name for curve in axis.curves[:MOST_CURVES]) or "none"
    domain = ""
    if axis.low is not None and axis.high is not None:
        domain = f"; the domain is {number(axis.low)} to {number(axis.high)}"
    left_out = len(axis.curves) - MOST_CURVES
    more = f"; {counted(left_out, 'term')} more not drawn" if left_out > 0 else ""
    return f"Degrees from 0 to 1 over the values; terms: {terms}{more}{domain}"


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


def _bins(axis: Axis, data: Data | None, x: Scale) -> Iterator[Markup]:
    """Yield the bars of the rows, those of each class upon another."""
    if data is None or axis.name not in data.axes:
        return
    bins = histogram(data, axis.name, x.low, x.high, _BINS)
    tallest = max(map(sum, bins), default=0)
    wide = (x.end - x.start) / _BINS
    for place, counts in enumerate(bins):
        base = _BASE
        for code, count in enumerate(counts):
            if not count:
                continue
            high = (_BASE - _TOP) * 0.86 * count / tallest
            mark = class_mark(code) if data.classes else "none"
            if code == len(data.classes) and data.classes:
                mark = "none"
            base -= high
            yield tag(
                "rect",
                x=x.start + place * wide + 0.4,
                y=base,
                width=wide - 0.8,
                height=high,
                class_=f"bin {mark}",
            )


def _labels(curves: tuple[Curve, ...], x: Scale) -> Iterator[Markup]:
    """Yield the names of the terms above their plateaus, in rows, where they fit."""
    free = [x.start - 9.0] * 2
    left_out = 0
    tops = sorted((_top(curve, x), place) for place, curve in enumerate(curves))
    for top, place in tops:
        said = cut(curves[place].name, 22)
        half = LETTER * _FONT * len(said) / 2.0
        middle = min(max(top, x.start + half), x.end - half)
        row = next((r for r in (0, 1) if free[r] + 8.0 <= middle - half), None)
        if row is None:
            left_out += 1
            continue
        free[row] = middle + half
        base = _TOP - 9.0 - 14.0 * row
        if row:
            yield tag(
                "line", x1=middle, x2=middle, y1=base + 3, y2=_TOP - 4, class_="lead"
            )
        yield words(middle, base, said, "term", "middle")
    if left_out:
        yield words(x.end, 10.0, f"+ {left_out} unnamed", "small", "end")


def _top(curve: Curve, x: Scale) -> float:
    """Return the point in the middle of where a curve is highest."""
    steps = 60
    values = [between(x.low, x.high, k / steps) for k in range(steps + 1)]
    values += [corner for corner in curve.corners if x.low <= corner <= x.high]
    degrees = [curve.degree(value) for value in values]
    highest = max(degrees)
    tops = [v for v, d in zip(values, degrees, strict=True) if d == highest]
    return x.at(between(min(tops), max(tops), 0.5))
