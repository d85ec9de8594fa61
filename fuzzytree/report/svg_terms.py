"""Variables and decisions as pictures: terms over rows, a part of the values, a map."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import msgspec
import numpy as np

from fuzzytree.auditing import Span
from fuzzytree.model import IntArray, RuleBase
from fuzzytree.report.audit_rows import Data, histogram
from fuzzytree.report.drawing import (
    LETTER,
    Axis,
    Curve,
    Markup,
    Scale,
    axis_marks,
    between,
    cut,
    line,
    polyline,
    rect,
    spread,
    svg,
    tag,
    tick_words,
    ticks,
    trimmed,
    words,
)
from fuzzytree.report.svg_tree import class_mark
from fuzzytree.report.text import number
from fuzzytree.runtimes import fire

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
        values = data.axes[axis.name]
        finite = values[np.isfinite(values)]
        if finite.size:
            ends += [float(finite.min()), float(finite.max())]
    if not ends:
        ends = [corner for curve in axis.curves for corner in curve.corners] or [0, 1]
    return Scale(*spread(ends), start, end)


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
    x = scale_of(axis, data, _LEFT, _RIGHT)
    drawn = axis.curves[:MOST_CURVES]
    names = _placed(drawn, x)
    top = 8.0 + _ROW * max((name.row + 1 for name in names), default=0)
    y = Scale(0.0, 1.0, top + _PLOT, top)
    parts = [*_bins(axis, data, x, y)]
    parts += outside(axis, x, top - 4, y.start)
    if span is not None:
        start, end = _ends(span, x)
        parts.append(_box(start, end, top - 4, y.start))
    parts.append(line(_LEFT, _RIGHT, y.start, y.start, "axis"))
    parts += _curves(drawn, x, y, named)
    parts += _names(names, top)
    if value is not None:
        at = x.at(value)
        parts.append(line(at, at, top - 4, y.start, "pin"))
        parts.append(tag("path", d=_diamond(at, y.start), class_="witness"))
    if len(names) < len(axis.curves):
        said = f"+ {len(drawn) - len(names)} unnamed"
        if len(drawn) < len(axis.curves):
            said += f", {len(axis.curves) - len(drawn)} not drawn"
        parts.append(words(x.end, top + 10.0, said, "small", "end"))
    parts += axis_marks(x, y.start)
    high = y.start + 22.0
    title = f"The terms of {axis.title}"
    return svg(WIDE, high, title, _description(axis), *parts, name=name)


def _curves(
    curves: Sequence[Curve], x: Scale, y: Scale, named: Collection[str] | None = None
) -> Iterator[Markup]:
    """Yield the curves of terms; all but those that are named, if any, are faint."""
    for place, curve in enumerate(curves):
        is_faint = bool(named) and curve.name not in (named or ())
        yield tag(
            "path",
            tag("title", curve.name),
            d=polyline(curve, x, y),
            class_="curve faint" if is_faint else "curve",
            stroke_dasharray=DASHES[place % len(DASHES)],
        )


def _description(axis: Axis) -> str:
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
            yield rect(start, top, end - start, base - top, "outside")
    for at in (left, right):
        yield line(at, at, top, base, "domain")


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
            left = x.start + place * wide + 0.4
            yield rect(left, base, wide - 0.8, high, f"bin {mark}")


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
            yield line(middle, middle, base + 3, top - 4, "lead")
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


_SLIVER = 3.0  # points: a region is drawn at least so wide

_MAP_HIGH = 288.0
_MAP = (56.0, 332.0, 8.0, 248.0)  # left, right, top, base
_CELLS = 48
_MAP_FONT = 12.0


class Window(NamedTuple):
    """Which part of two axes a map shows."""

    across: tuple[float, float]
    down: tuple[float, float]


def span_text(span: Span, unit: str = "", digits: int = 6) -> str:
    """Return a side of a region in words; its ends have digits enough to differ.

    Example:
        >>> span_text(Span("force", 0.5, None), "N")
        'from 0.5 N'
    """
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


def _box(start: float, end: float, top: float, base: float) -> Markup:
    return rect(start, top, end - start, base - top, "region")


def _diamond(x: float, y: float) -> str:
    return f"M{x:.1f} {y - 5.5:.1f}l5.5 5.5l-5.5 5.5l-5.5 -5.5z"


def windows(
    across: Axis, down: Axis, region: Mapping[str, Span]
) -> list[tuple[str, Window]]:
    """Return what maps show, with a word for it: the domain, and near a sliver.

    There is none if an axis has no domain, or one without width.
    """
    whole: list[tuple[float, float]] = []
    near: list[tuple[float, float]] = []
    is_sliver = False
    for axis in (across, down):
        if axis.low is None or axis.high is None or not axis.low < axis.high:
            return []
        low, high = axis.low, axis.high
        whole.append((low, high))
        span = region.get(axis.name)
        start = low if span is None or span.low is None else max(span.low, low)
        end = high if span is None or span.high is None else min(span.high, high)
        is_sliver |= 0.0 < end - start < 0.04 * (high - low)
        room = 1.5 * (end - start)
        near.append((max(start - room, low), min(end + room, high)))
    shown = [("on the domain", Window(whole[0], whole[1]))]
    if is_sliver and all(a < b for a, b in near):
        shown.append(("near the region", Window(near[0], near[1])))
    return shown


def map_picture(
    rules: RuleBase,
    axes: tuple[Axis, Axis],
    window: Window,
    region: Mapping[str, Span],
    values: Mapping[str, Fraction],
    name: str,
) -> Markup:
    """Return the classes on two variables, the others being those of a point."""
    across, down = axes
    left, right, top, base = _MAP
    x = Scale(*window.across, left, right)
    y = Scale(*window.down, base, top)
    codes = decisions(
        rules,
        (across.name, _middles(window.across)),
        (down.name, _middles(window.down)),
        values,
    )
    cells, names = _cells(codes, rules.classes)
    parts = cells
    spans = [region.get(axis.name) or Span(axis.name, None, None) for axis in axes]
    if any(axis.name in region for axis in axes):
        start, end = _ends(spans[0], x)
        low, high = _ends(spans[1], y)
        parts.append(_box(start, end, min(low, high), max(low, high)))
    parts += names
    point = float(values[across.name]), float(values[down.name])
    if x.low <= point[0] <= x.high and y.low <= point[1] <= y.high:
        way = _diamond(x.at(point[0]), y.at(point[1]))
        parts.append(tag("path", d=way, class_="witness"))
    parts += axis_marks(x, base)
    parts += _marks_upwards(y, left)
    parts.append(words((left + right) / 2, base + 33, across.title, "small", "middle"))
    turned = f"rotate(-90 11 {(top + base) / 2:.0f})"
    parts.append(
        words(11, (top + base) / 2, down.title, "small", "middle", transform=turned)
    )
    title = f"The classes on {across.title} and {down.title}"
    desc = "Each part has the name of its class; the hatched part is the region, the "
    desc += "diamond the witness; all other variables are those of the witness"
    return svg(WIDE, _MAP_HIGH, title, desc, *parts, name=name)


def decisions(
    rules: RuleBase,
    across: tuple[str, Sequence[float]],
    down: tuple[str, Sequence[float]],
    others: Mapping[str, Fraction],
) -> IntArray:
    """Return the number of the class decided for at each point of a grid, -1 for none.

    The native runtime decides, in double; a combination is a variable like any other.
    The result has the shape (values down, values across).

    Example:
        >>> from fuzzytree.model.rulebase import Band, Clause, Rule, Term, Variable
        >>> low = Term("low", Band(high=0.0))
        >>> axes = Variable("a", (low,)), Variable("b", (low,))
        >>> both = Rule((Clause("a", ("low",)), Clause("b", ("low",))), "k")
        >>> rules = RuleBase("r", ("k",), axes, (both,))
        >>> decisions(rules, ("a", [-1.0, 1.0]), ("b", [-1.0, 1.0]), {}).tolist()
        [[0, -1], [-1, -1]]
    """
    tested = {clause.variable for rule in rules.rules for clause in rule.when}
    variables = (one for one in rules.variables if one.name in tested)
    free = tuple(msgspec.structs.replace(one, parts=()) for one in variables)
    rules = msgspec.structs.replace(rules, variables=free, columns=())
    columns = {name: float(value) for name, value in others.items()}
    x, y = np.meshgrid(across[1], down[1])
    values = np.stack(
        [
            x if name == across[0] else y if name == down[0] else x * 0 + columns[name]
            for name in rules.inputs
        ]
    )
    outcome = fire(rules)(values.reshape(len(rules.inputs), -1))
    codes = {label: code for code, label in enumerate(rules.classes)}
    uncovered = rules.semantics.uncovered
    none = -1 if uncovered is None else codes[uncovered]
    classes = np.array([none, *(codes[rule.then] for rule in rules.rules)])
    grid: IntArray = classes[outcome.rule].reshape(x.shape)
    return grid


def _middles(ends: tuple[float, float]) -> list[float]:
    return [between(*ends, (k + 0.5) / _CELLS) for k in range(_CELLS)]


def _cells(
    codes: IntArray, classes: Sequence[str]
) -> tuple[list[Markup], list[Markup]]:
    """Return the part of each class as a path of runs of cells, and their names.

    A name stands in the longest run of its class.
    """
    left, right, top, base = _MAP
    wide, high = (right - left) / _CELLS, (base - top) / _CELLS
    ways: dict[int, list[str]] = {}
    longest: dict[int, tuple[int, float, float]] = {}
    for row, cells in enumerate(codes.tolist()):
        start = 0
        for place in range(1, _CELLS + 1):
            if place < _CELLS and cells[place] == cells[start]:
                continue
            code, x, y = cells[start], left + start * wide, base - (row + 1) * high
            run = f"M{trimmed(x)} {trimmed(y)}h{trimmed((place - start) * wide)}"
            ways.setdefault(code, []).append(f"{run}v{trimmed(high)}H{trimmed(x)}z")
            middle = x + (place - start) * wide / 2.0
            run_here = (place - start, middle, y + high / 2.0)
            longest[code] = max(longest.get(code, run_here), run_here)
            start = place
    parts: list[Markup] = []
    names: list[Markup] = []
    for code, runs in sorted(ways.items()):
        mark = "none" if code < 0 else class_mark(code)
        parts.append(tag("path", d=Markup("".join(runs)), class_=f"cell {mark}"))
        _, x, y = longest[code]
        said = cut("no class" if code < 0 else classes[code], 18)
        half = LETTER * _MAP_FONT * len(said) / 2.0
        x = min(max(x, left + half), right - half)
        names.append(words(x, y + 4, said, "on-map", "middle"))
    return parts, names


def _marks_upwards(y: Scale, left: float) -> Iterator[Markup]:
    values = ticks(y.low, y.high)
    for value, said in zip(values, tick_words(values), strict=True):
        at = y.at(value)
        yield line(left - 4, left, at, at, "tick")
        yield words(left - 6, at + 3.5, cut(said, 5), "small", "end")
