"""A model as one HTML page that runs it: inputs to move, the answer, and why.

The page is `templates/what_if.html`. The program that the JavaScript writer makes of
the model gives its answers; the model itself, with the points of its curves, stands in
it as JSON. It loads nothing, and the same model and rows give the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape
from typing import Any, NamedTuple

import msgspec

from fuzzytree.checking import export
from fuzzytree.files import PathLike, write_atomically
from fuzzytree.model import (
    DATE_UNIT,
    Document,
    FloatArray,
    Formula,
    Linear,
    SystemOutput,
    Variable,
    fingerprint,
)
from fuzzytree.report.drawing import axis_of, curve_points, term_curve
from fuzzytree.report.markup import Markup, source
from fuzzytree.report.models import document_text
from fuzzytree.report.parts import whole_page
from fuzzytree.report.svg_terms import scale_of
from fuzzytree.semantics import rules_of

MOST_ROWS = 300
"""Of a table that a page holds."""

_EXAMPLES = 8  # with which the page tests itself
_STEPS = 200.0  # of a slider, at least

_KEPT = "low", "high", "value", "weights", "offset"  # of functions, beside the points

_Ends = tuple[float, float]


class Page(NamedTuple):
    """A page that a notebook shows.

    Attributes:
        html: The content of an HTML file.
        rows: How many rows of a table it holds.
        total: How many rows the table has.
    """

    html: str
    rows: int = 0
    total: int = 0

    def __repr__(self) -> str:
        """Show how large the page is; `html` is its text."""
        return f"Page({len(self.html.encode())} bytes, {self.rows} rows)"

    def save(self, path: PathLike) -> None:
        """Write the page to a file whole, or leave what stood there.

        Raises:
            WriteError: If the file cannot be written.
        """
        write_atomically(path, self.html.encode())

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the page in a frame of its own."""
        look = 'width="100%" height="720" frameborder="0" sandbox="allow-scripts"'
        return f'<iframe title="what if" {look} srcdoc="{escape(self.html)}"></iframe>'


def what_if_page(
    model: Document, values: FloatArray | None = None, *, command: str = ""
) -> Page:
    """Return a model as a page that runs it.

    Args:
        model: A tree, a rule base or a fuzzy system.
        values: Rows to choose from, of shape (inputs, rows); the first 300 are in the
            page, and all of them give the ends of the inputs.
        command: That explains a row, without the row.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> what_if_page(random_tree(1)).html.startswith("<!doctype html>")
        True
    """
    rules = rules_of(model)
    used = {one.name: one for one in rules.variables}
    every = tuple(
        used.get(one.name, msgspec.structs.replace(one, terms=()))
        for one in model.variables
    )  # a tree needs its inputs even where no node tests them
    rules = msgspec.structs.replace(rules, variables=every)
    options: dict[str, Any] = {"module": "script", "examples": _EXAMPLES}
    if rules.classes and rules.semantics.sharpness:
        options["probabilities"] = True
    program = export(rules, "javascript", **options).content
    facts: dict[str, Any] = msgspec.to_builtins(rules)
    for rule in facts.get("rules", ()):
        del rule["counts"]
        rule.pop("probabilities", None)  # the program has them
    _add_ends(facts, rules, values)
    rows = [] if values is None else values.T[:MOST_ROWS].tolist()
    total = 0 if values is None else values.shape[1]
    facts |= {"command": command, "rows": rows, "total": total}
    facts |= {"fingerprint": fingerprint(model)}
    content = msgspec.json.encode(_lean(facts)).decode()
    html = whole_page(
        "what_if.html",
        title=model.name,
        about=document_text(model),
        facts=Markup(content.replace("<", r"\u003c")),
        program=Markup(program.decode("ascii")),
        script=Markup(source("what_if.js")),
    )
    return Page(html, len(rows), total)


def _lean(value: Any) -> Any:
    """Return facts without those that are empty."""
    if isinstance(value, dict):
        empty: list[object] = [None, "", [], ()]
        return {k: _lean(part) for k, part in value.items() if part not in empty}
    return [*map(_lean, value)] if isinstance(value, list | tuple) else value


def _add_ends(
    facts: dict[str, Any], model: Document, values: FloatArray | None
) -> None:
    """Add ends, step and start of each input, ends of outputs, and points of terms."""
    ends: dict[str, _Ends] = {}
    columns: dict[str, list[float]] = {}
    if values is not None:
        columns = dict(zip(model.inputs, values.tolist(), strict=True))
    for shown, one in zip(facts["variables"], model.variables, strict=True):
        cells = columns.get(one.name, [])
        low, high = _ends(one, [*filter(math.isfinite, cells)], ends)
        step = 1.0 if one.is_whole or one.categories else _step(high - low)
        if not one.parts:
            low, high = _rounded(low, step, math.floor), _rounded(high, step, math.ceil)
        ends[one.name] = low, high
        middle = low / 2 + high / 2 if one.missing is None else max(one.missing, low)
        start = cells[0] if cells and math.isfinite(cells[0]) else None
        shown["start"] = _rounded(middle, step, round) if start is None else start
        shown |= {"from": low, "to": high, "step": step, "date": one.unit == DATE_UNIT}
        _add_points(shown, one, low, high)
    for shown, output in zip(facts.get("outputs", ()), model.outputs, strict=True):
        low, high = _ends(output, [], ends)
        shown |= {"from": low, "to": high}
        _add_points(shown, output, low, high)


def _add_points(
    shown: dict[str, Any], one: Variable | SystemOutput, low: float, high: float
) -> None:
    for fact, term in zip(shown["terms"], one.terms, strict=True):
        if not isinstance(term.function, Linear | Formula):
            points = curve_points(term_curve(term), low, high)
            fact["points"] = [(value, round(degree, 5)) for value, degree in points]
        function = fact.pop("function")
        fact |= {name: function[name] for name in _KEPT if name in function}


def _ends(
    one: Variable | SystemOutput, cells: Sequence[float], ends: dict[str, _Ends]
) -> _Ends:
    """Return from where to where the values of a variable go."""
    axis = axis_of(one)
    if cells and not one.categories:
        low, high = min(cells), max(cells)
    elif axis.low is not None and axis.high is not None:
        low, high = axis.low, axis.high
    elif one.parts:
        pairs = [[p.weight * (x - p.centre) for x in ends[p.input]] for p in one.parts]
        low, high = sum(map(min, pairs)), sum(map(max, pairs))
    else:
        low, high, *_ = scale_of(axis, None)
    room = 0.5 * max(abs(low), 1.0)
    return (low, high) if high > low or one.categories else (low - room, high + room)


def _step(width: float) -> float:
    """Return a step of round numbers that makes 200 steps or more of a width."""
    if not 0.0 < width < math.inf:
        return 1.0
    power = 10.0 ** math.floor(math.log10(width / _STEPS))
    return max(k * power for k in (1.0, 2.0, 5.0) if k * power <= width / _STEPS)


def _rounded(value: float, step: float, whole: Callable[[float], float]) -> float:
    """Return the multiple of a step beside a value, without the digits of rounding."""
    count = value / step
    return float(f"{whole(count) * step:.12g}") if abs(count) < 1e15 else value
