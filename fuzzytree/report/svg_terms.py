"""Variables as pictures: terms over rows, a part of the values, a point."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing import Span
from fuzzytree.model import Document, SystemOutput, Variable, printable
from fuzzytree.rechecking import table_word
from fuzzytree.report.audit_rows import Data, histogram
from fuzzytree.report.drawing import (
    Axis,
    Block,
    Curve,
    Scale,
    Sheet,
    axis_marks,
    axis_of,
    between,
    listing,
    polyline,
    spread,
    text_block,
    text_width,
)
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.models import places_of, summands
from fuzzytree.report.pictures import Picture, class_mark
from fuzzytree.report.text import number

WIDE = 340.0
MOST_CURVES = 60
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
_GAP = 12.0


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
) -> tuple[Markup, float]:
    """Return the terms of a variable over the histogram of its rows, and the height.

    Args:
        axis: The variable.
        data: The rows; without them terms have colours.
        name: Of the picture, unlike all others of the page.
        span: A part of its values, which is hatched.
        value: A point, which is marked.
        named: The terms that a finding is about; the others are faint.
    """
    x = scale_of(axis, data)
    curves = axis.curves[:MOST_CURVES]
    names, notes = _names_of(curves, x)
    top = 8.0 + _ROW * max((name.row + 1 for name in names), default=0)
    y = Scale(0.0, 1.0, top + _PLOT, top)
    marks = [*_bins(axis, data, x, y)]
    marks += _outside(axis, x, top - 4, y.start)
    if span is not None:
        start, end = _ends(span, x)
        marks.append(
            mark("rect", start, top - 4, end - start, y.start - top + 4, "region")
        )
    marks.append(mark("line", _LEFT, _RIGHT, y.start, y.start, "axis"))
    has_colours = data is None and not named
    colours = [class_mark(k) if has_colours else "" for k in range(len(curves))]
    marks += _curves(curves, x, y, named, colours)
    marks += _name_marks(names, top, colours)
    if value is not None:
        at = x.at(value)
        marks.append(mark("line", at, at, top - 4, y.start, "pin"))
        diamond = f"M{at:.1f} {y.start - 5.5:.1f}l5.5 5.5l-5.5 5.5l-5.5 -5.5z"
        marks.append(mark("path", diamond, "witness"))
    marks += axis_marks(x, y.start, axis)
    rest = len(axis.curves) - len(curves)
    notes += [f"{rest} not drawn"] if rest else []
    words, high = text_block(_LEFT, y.start + 22.0, notes, WIDE - 2 * _LEFT)
    terms = ", ".join(curve.name for curve in curves) or "none"
    domain = ""
    if axis.low is not None and axis.high is not None:
        ends = [table_word(axis, v) or number(v) for v in (axis.low, axis.high)]
        domain = f"; the domain is {ends[0]} to {ends[1]}"
    about = f"Degrees from 0 to 1 over the values{domain}; terms: {terms}"
    title, high = f"The terms of {axis.title}", y.start + 22.0 + high
    return mark("svg", WIDE, high, name, title, about, [*marks, *words]), high


def draw_terms(model: Document, *, title: str | None = None) -> Picture:
    """Draw the terms of each variable of a model, and those of a system's outputs.

    Where names of terms do not fit above their curves, numbers stand there, and the
    names below.
    """
    variables: list[Variable | SystemOutput] = [*model.variables, *model.outputs]
    cards = [
        _card(one, f"v{k}", model.variables)
        for k, one in enumerate(variables)
        if one.terms
    ]
    if not cards:
        raise ValueError(f"{model.name} has no terms that are curves")
    step = WIDE + 2 * _GAP
    heading = f"The terms of {model.name}" if title is None else title
    sheet = Sheet(step * min(len(cards), _ACROSS) - 2 * _GAP, heading)
    for first in range(0, len(cards), _ACROSS):
        sheet.row(cards[first : first + _ACROSS], step)
    return sheet.picture("A curve for each term: degrees from 0 to 1 over the values")


def _card(
    variable: Variable | SystemOutput, name: str, known: Sequence[Variable]
) -> Block:
    """Return the terms of a variable under its name, and what these do not show."""
    axis = axis_of(variable)
    categories = [
        f"{place} is {text}" for place, text in enumerate(variable.categories)
    ]
    undrawn = f"not drawn: {', '.join(axis.undrawn)}" if axis.undrawn else ""
    notes = [", ".join(categories), undrawn, sum_words(variable, known)]
    marks, top = text_block(0.0, _GAP, axis.title, WIDE, "strong")
    top += _GAP
    for note in notes:
        words, high = text_block(0.0, top, note, WIDE)
        marks, top = marks + words, top + high
    if axis.curves:
        terms, high = terms_picture(axis, None, name)
        marks.append(mark("group", [terms], move=f"translate(0 {top + 4.0:.1f})"))
        top += high
    return marks, top + _GAP


def sum_words(
    variable: Variable | SystemOutput, variables: Iterable[Variable]
) -> list[str]:
    """Return what a combination is, in words that stay together; none of an input."""
    if not variable.parts:
        return []
    known = {one.name: one for one in variables}
    first, *others = summands(variable.parts, known)
    places = [f"({line})" for line in places_of(variable.parts, known)]
    return [f"{variable.name} = {first.removeprefix('+ ')}", *others, *places]


def _curves(
    curves: Sequence[Curve],
    x: Scale,
    y: Scale,
    named: Collection[str] | None,
    colours: Sequence[str],
) -> Iterator[Markup]:
    """Yield the curves of terms; all but those that are named, if any, are faint."""
    for place, curve in enumerate(curves):
        look = "curve faint" if named and curve.name not in named else "curve"
        look, dashes = f"{look} {colours[place]}".rstrip(), DASHES[place % len(DASHES)]
        yield mark("curve", curve.name, polyline(curve, x, y), look, dashes)


def _outside(axis: Axis, x: Scale, top: float, base: float) -> Iterator[Markup]:
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
    """The name of a term above its curve, or its number; row 0 stands lowest."""

    text: str
    middle: float
    row: int
    place: int


def _names_of(curves: Sequence[Curve], x: Scale) -> tuple[list[_Name], list[str]]:
    """Return names above the plateaus, from left to right, or numbers and their names.

    Names stand in a few rows; where they do not fit, each has a number.
    """
    middles = sorted((_top(curve, x), k) for k, curve in enumerate(curves))
    names = _rows_of([(curves[k].name, top, k) for top, k in middles], x)
    if max((name.row for name in names), default=0) < _MOST_ROWS:
        return names, []
    order = [k for _, k in middles]
    numbers = [(str(n), top, k) for n, (top, k) in enumerate(middles, 1)]
    texts = [f"{n} {curves[k].name}" for n, k in enumerate(order, 1)]
    return _rows_of(numbers, x), listing(texts, ",")


def _rows_of(texts: Sequence[tuple[str, float, int]], x: Scale) -> list[_Name]:
    """Return texts near their places, each in the lowest row where it has room."""
    ends: list[float] = []
    names: list[_Name] = []
    for text, top, place in texts:
        half = text_width(printable(text), _FONT) / 2.0
        middle = max(min(top, x.end - half), x.start + half)
        is_long = half > (x.end - x.start) / 2.0
        free = (k for k, end in enumerate(ends) if end + 6.0 <= middle - half)
        row = _MOST_ROWS if is_long else next(free, len(ends))
        ends += [0.0] * (row + 1 - len(ends))
        ends[row] = middle + half
        names.append(_Name(text, middle, row, place))
    return names


def _name_marks(
    names: Sequence[_Name], top: float, colours: Sequence[str]
) -> Iterator[Markup]:
    bases = [top - 9.0 - _ROW * name.row for name in names]
    for name, base in zip(names, bases, strict=True):
        if name.row:
            yield mark("line", name.middle, name.middle, base + 3, top - 4, "lead")
    for name, base in zip(names, bases, strict=True):
        look = f"name {colours[name.place]}".rstrip()
        yield mark("words", name.middle, base, name.text, look, "middle")


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
