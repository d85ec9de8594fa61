"""Variables as pictures: terms over rows, a part of the values, a point."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing import Span
from fuzzytree.model import Document, SystemOutput, Variable
from fuzzytree.report.audit_rows import Data, histogram
from fuzzytree.report.drawing import (
    LETTER,
    Axis,
    Curve,
    Scale,
    axis_marks,
    axis_of,
    between,
    cut,
    lines_within,
    polyline,
    spread,
)
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.models import summands
from fuzzytree.report.pictures import Picture, class_mark, picture
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
_ACROSS = 3  # variables beside each other in a picture of their own
_GAP, _LINE = 12.0, 16.0
_PANEL = 8.0 + _ROW * _MOST_ROWS + _PLOT + 22.0  # at most, of one variable
_SMALL = 10.5  # the size of small words
_STYLE = """
svg .term { font-size: 11px; }
.curve { fill: none; stroke: #1b1c1e; stroke-width: 1.7; stroke-linejoin: round; }
.axis, .tick { stroke: #595d66; }
.lead { stroke: #c9ccd3; }
.outside { fill: #eceef2; }
.domain { stroke: #595d66; stroke-dasharray: 1 3; stroke-width: 1.5; }
"""


def scale_of(axis: Axis, data: Data | None) -> Scale:
    """Return the scale of a variable: its domain and its rows, with some room."""
    ends = [value for value in (axis.low, axis.high) if value is not None]
    if data is not None and axis.name in data.axes:
        values = data.axes[axis.name]
        finite = values[np.isfinite(values)]
        if finite.size:
            ends += [float(finite.min()), float(finite.max())]
    if not ends:
        ends = [corner for curve in axis.curves for corner in curve.corners] or [0, 1]
    return Scale(*spread(ends), _LEFT, _RIGHT)


def terms_picture(
    axis: Axis,
    data: Data | None,
    name: str,
    *,
    span: Span | None = None,
    value: float | None = None,
    named: Collection[str] | None = None,
) -> Markup:
    """Return the terms of a variable, over the histogram of its rows.

    Args:
        axis: The variable.
        data: The rows.
        name: Of the picture, unlike all others of the page.
        span: A part of its values, which is hatched.
        value: A point, which is marked.
        named: The terms that a finding is about; the others are faint.
    """
    x = scale_of(axis, data)
    drawn = axis.curves[:MOST_CURVES]
    names = _placed(drawn, x)
    top = 8.0 + _ROW * max((name.row + 1 for name in names), default=0)
    y = Scale(0.0, 1.0, top + _PLOT, top)
    parts = [*_bins(axis, data, x, y)]
    parts += outside(axis, x, top - 4, y.start)
    if span is not None:
        start, end = _ends(span, x)
        parts.append(
            mark("rect", start, top - 4, end - start, y.start - top + 4, "region")
        )
    parts.append(mark("line", _LEFT, _RIGHT, y.start, y.start, "axis"))
    parts += _curves(drawn, x, y, named)
    parts += _names(names, top)
    if value is not None:
        at = x.at(value)
        parts.append(mark("line", at, at, top - 4, y.start, "pin"))
        diamond = f"M{at:.1f} {y.start - 5.5:.1f}l5.5 5.5l-5.5 5.5l-5.5 -5.5z"
        parts.append(mark("path", diamond, "witness"))
    if len(names) < len(axis.curves):
        said = f"+ {len(drawn) - len(names)} unnamed"
        if len(drawn) < len(axis.curves):
            said += f", {len(axis.curves) - len(drawn)} not drawn"
        parts.append(mark("words", x.end, top + 10.0, said, "small", "end"))
    parts += axis_marks(x, y.start)
    high = y.start + 22.0
    title = f"The terms of {axis.title}"
    terms = ", ".join(curve.name for curve in drawn) or "none"
    domain = ""
    if axis.low is not None and axis.high is not None:
        domain = f"; the domain is {number(axis.low)} to {number(axis.high)}"
    about = f"Degrees from 0 to 1 over the values{domain}; terms: {terms}"
    return mark("svg", WIDE, high, name, title, about, parts)


def draw_terms(model: Document) -> Picture:
    """Draw the terms of each variable of a model, and those of a system's outputs.

    Raises:
        ValueError: If the model has no terms that are curves.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> draw_terms(random_system(2)).svg.startswith("<svg")
        True
    """
    marks: list[Markup] = []
    left = high = top = wide = 0.0
    variables: list[Variable | SystemOutput] = [*model.variables, *model.outputs]
    for axis, variable in zip(map(axis_of, variables), variables, strict=True):
        if not (axis.curves or axis.undrawn):
            continue
        notes = [axis.title, *_note_lines(variable, axis)]
        drawn = terms_picture(axis, None, f"v{len(marks)}")
        words = [
            mark("words", 0.0, _LINE * k, note, "small" if k > 1 else "strong")
            for k, note in enumerate(notes, 1)
        ]
        below = _LINE * (len(notes) + 0.5)
        if axis.curves:
            words.append(mark("group", [drawn], move=f"translate(0 {below:.1f})"))
        move = f"translate({left + _GAP:.0f} {top + _GAP:.0f})"
        marks.append(mark("group", words, move=move))
        high = max(high, top + below + _PANEL)
        wide = max(wide, left + WIDE + 2 * _GAP)
        left += WIDE + 2 * _GAP
        if left >= _ACROSS * (WIDE + 2 * _GAP):
            left, top = 0.0, high
    if not marks:
        raise ValueError(f"{model.name} has no terms that are curves")
    return picture(marks, wide, high + _GAP, f"The terms of {model.name}", _STYLE)


def _note_lines(variable: Variable | SystemOutput, axis: Axis) -> Iterator[str]:
    """Yield what a picture of terms does not show."""
    words = [f"{place} is {name}" for place, name in enumerate(variable.categories)]
    texts = [", ".join(words)] if words else []
    if axis.undrawn:
        texts.append(f"not drawn: {', '.join(axis.undrawn)}")
    for text in texts:
        yield from lines_within(text, WIDE, _SMALL)
    yield from sum_lines(variable, WIDE, _SMALL)


def sum_lines(variable: Variable | SystemOutput, wide: float, size: float) -> list[str]:
    """Return what a combination is, in lines that fit a width; none of an input."""
    if not variable.parts:
        return []
    first, *others = summands(variable.parts)
    first = f"{variable.name} = {first.removeprefix('+ ')}"
    return lines_within([first, *others], wide, size)


def _curves(
    curves: Sequence[Curve], x: Scale, y: Scale, named: Collection[str] | None = None
) -> Iterator[Markup]:
    """Yield the curves of terms; all but those that are named, if any, are faint."""
    for place, curve in enumerate(curves):
        is_faint = bool(named) and curve.name not in (named or ())
        look = "curve faint" if is_faint else "curve"
        dashes = DASHES[place % len(DASHES)]
        yield mark("curve", curve.name, polyline(curve, x, y), look, dashes)


def outside(axis: Axis, x: Scale, top: float, base: float) -> Iterator[Markup]:
    """Yield what shows where a variable is outside of the domain."""
    if axis.low is None or axis.high is None:
        return
    left, right = x.at(axis.low), x.at(axis.high)
    for start, end in ((x.start, left), (right, x.end)):
        if end - start > 0.3:
            yield mark("rect", start, top, end - start, base - top, "outside")
    for at in (left, right):
        yield mark("line", at, at, top, base, "domain")


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
            own = class_mark(code) if code < len(data.classes) else "none"
            base -= high
            left = x.start + place * wide + 0.4
            yield mark("rect", left, base, wide - 0.8, high, f"bin {own}")


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
            yield mark("line", middle, middle, base + 3, top - 4, "lead")
        yield mark("words", middle, base, said, "term", "middle")


def _top(curve: Curve, x: Scale) -> float:
    """Return the point in the middle of where a curve is highest."""
    steps = 60
    values = [between(x.low, x.high, k / steps) for k in range(steps + 1)]
    values += curve.corners_between(x.low, x.high)
    degrees = [curve.degree(value) for value in values]
    highest = max(degrees)
    tops = [v for v, d in zip(values, degrees, strict=True) if d == highest]
    return x.at(between(min(tops), max(tops), 0.5))


_SLIVER = 3.0  # points: a region is drawn at least so wide


def span_text(span: Span, unit: str = "", digits: int = 6) -> str:
    """Return a side of a region in words; its ends have digits enough to differ.

    Example:
        >>> span_text(Span("force", 0.5, None), "N")
        'from 0.5 N'
    """
    if span.word:
        return span.word
    after = f" {unit}" if unit else ""
    if span.low is not None and span.low == span.high:
        return f"at {span.low!r}{after}"
    low, high = _ends_text(span, digits)
    if low is None and high is None:
        return "anywhere"
    if low is None:
        return f"up to {high}{after}"
    if high is None:
        return f"from {low}{after}"
    return f"{low} to {high}{after}"


def _ends_text(span: Span, digits: int) -> tuple[str | None, str | None]:
    low, high = (
        None if end is None else f"{end:.{digits}g}" for end in (span.low, span.high)
    )
    is_hidden = low is not None and low == high and span.low != span.high
    return _ends_text(span, digits + 1) if is_hidden else (low, high)


def _ends(span: Span, x: Scale) -> tuple[float, float]:
    start = x.start if span.low is None else x.at(span.low)
    end = x.end if span.high is None else x.at(span.high)
    if abs(end - start) < _SLIVER:
        middle = (start + end) / 2.0
        return middle - _SLIVER / 2.0, middle + _SLIVER / 2.0
    return start, end
