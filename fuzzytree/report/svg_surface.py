"""What a model answers over two of its inputs, as a picture."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing import row_values
from fuzzytree.model import Document, FloatArray, Variable, name_choice
from fuzzytree.report.drawing import (
    Scale,
    axis_marks,
    axis_of,
    between,
    legend,
    lines_within,
    tick_words,
    ticks,
    word_lines,
)
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.pictures import Picture, class_mark, picture
from fuzzytree.report.svg_rules import draw_rules, value_word
from fuzzytree.report.svg_terms import draw_terms, scale_of
from fuzzytree.report.svg_tree import draw_tree
from fuzzytree.report.text import number
from fuzzytree.runtimes import Predictions, answers_of, baseline

CELLS = 48
"""On each side of a surface."""

_EDGE, _SIDE, _BELOW = 12.0, 330.0, 44.0  # around the picture, of a surface, below it
_LEFT, _RIGHT = 78.0, 92.0  # beside a surface, for numbers
_SMALL, _STRONG, _LINE = 10.5, 14.0, 13.0
_LEVELS = 24
_FLAT = 1e-9  # of a number: smaller differences have no colours
_ANCHORS = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))
"""Colours from least to most, which the colour-blind see as ever lighter."""


class Surface(NamedTuple):
    """The answers of a model over two inputs, at the middles of cells.

    Attributes:
        x: The input across.
        y: The input upwards.
        xs: Its values, from left to right.
        ys: Its values, from below.
        rest: The values of the other inputs, and why they are these.
        panels: By output, or as "" the numbers of classes, shape (ys, xs); -1 and NaN
            stand for no answer.
    """

    x: Variable
    y: Variable
    xs: list[float]
    ys: list[float]
    rest: dict[str, tuple[float, str]]
    panels: dict[str, FloatArray]


def draw_model(
    model: Document,
    *,
    title: str | None = None,
    row: Mapping[str, float | str] | None = None,
    surface: Sequence[str] | None = None,
) -> Picture:
    """Draw a model: a tree, or terms; its rules for a row; or a surface.

    Args:
        model: The model.
        title: Above the picture.
        row: Values of inputs, in numbers or words: all, or for a surface some.
        surface: The names of two inputs.

    Raises:
        ValueError: If the model is too large, the row does not fit, or there is no such
            surface.
    """
    values = row_values(model, row or {}, is_partial=surface is not None or row is None)
    if surface is not None:
        return draw_surface(model, surface, values, title=title)
    if row is not None:
        return draw_rules(model, values, title=title)
    return (draw_tree if model.leaves else draw_terms)(model, title=title)


def surface_of(
    model: Document, names: Sequence[str], row: Mapping[str, float]
) -> Surface:
    """Return what the native runtime answers over two inputs in their ranges.

    Other inputs have the value of the row, or else what stands for a missing value, or
    else the middle of their range; categories the first.

    Raises:
        ValueError: If these are not two inputs of numbers with a range, or another
            input has no value.
    """
    inputs = {one.name: one for one in model.variables if not one.parts}
    if len(names) != 2 or names[0] == names[1]:
        given = ",".join(names) or "none"
        raise ValueError(f"a surface needs two different inputs, not {given!r}")
    for name in names:
        if name not in inputs:
            raise ValueError(
                f"a surface over {name!r}, which is no input; "
                f"{name_choice(name, inputs)}"
            )
        if inputs[name].categories:
            raise ValueError(
                f"a surface needs two inputs of numbers, and {name!r} has categories"
            )
    ends = [_ends(inputs[name]) for name in names]
    middles = [(k + 0.5) / CELLS for k in range(CELLS)]
    xs, ys = ([between(low, high, part) for part in middles] for low, high in ends)
    rest = {
        name: (row[name], "of the row") if name in row else _default(variable)
        for name, variable in inputs.items()
        if name not in names
    }
    values = np.empty((len(inputs), CELLS * CELLS))
    for place, name in enumerate(inputs):
        if name not in names:
            values[place] = rest[name][0]
    order = [*inputs]
    values[order.index(names[0])] = np.tile(xs, CELLS)
    values[order.index(names[1])] = np.repeat(ys, CELLS)
    outcome = baseline().load(model, with_strengths=False)(values)
    answers = answers_of(outcome, model, with_strengths=False, with_probabilities=False)
    if isinstance(answers, Predictions):
        panels = {"": answers.codes.astype(np.float64)}
    else:
        panels = {one.name: answers[one.name] for one in model.outputs}
    shape = (CELLS, CELLS)
    grids = {name: np.reshape(panel, shape) for name, panel in panels.items()}
    return Surface(inputs[names[0]], inputs[names[1]], xs, ys, rest, grids)


def _ends(variable: Variable) -> tuple[float, float]:
    axis = axis_of(variable)
    if axis.low is not None and axis.high is not None and axis.low < axis.high:
        return axis.low, axis.high
    if not axis.curves:
        raise ValueError(
            f"{variable.name!r} has no range; write its low and high into the model"
        )
    scale = scale_of(axis, None)
    return scale.low, scale.high


def _default(variable: Variable) -> tuple[float, str]:
    """Return the value of an input that a row lacks, and why it is this."""
    if variable.missing is not None:
        return variable.missing, "as where values are missing"
    if variable.categories:
        return 0.0, "first categories"
    return between(*_ends(variable), 0.5), "in the middle of ranges"


def draw_surface(
    model: Document,
    names: Sequence[str],
    row: Mapping[str, float],
    *,
    title: str | None = None,
) -> Picture:
    """Draw the class or the outputs of a model over two inputs, as `surface_of` does.

    A row that has values of these two is marked.

    Args:
        model: The model.
        names: The input across, and the one upwards.
        row: Finite values of inputs.
        title: Above the picture.

    Raises:
        ValueError: As `surface_of`.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(3, leaves=6)
        >>> "over" in draw_surface(tree, tree.inputs[:2], {}).svg
        True
    """
    surface = surface_of(model, names, row)
    x, y = surface.x, surface.y
    wide = max(len(surface.panels) * (_LEFT + _SIDE + _RIGHT), 300.0) + 2 * _EDGE
    inside = wide - 2 * _EDGE
    what = "the class" if not model.outputs else ", ".join(surface.panels)
    heading = title or f"{model.name}: {what} over {x.name} and {y.name}"
    lines = lines_within(heading, inside, _STRONG)
    marks = [*word_lines(_EDGE, 20.0, lines, "strong", 17.0)]
    top = 17.0 * len(lines) + 8.0
    lines = [
        line
        for text in _rest_texts(model, surface)
        for line in lines_within(text, inside, _SMALL)
    ]
    marks += word_lines(_EDGE, top + _LINE, lines, "small", _LINE)
    top += _LINE * (len(lines) + 1)
    if not model.outputs:
        codes = sorted({int(code) for code in surface.panels[""].flat})
        keys = [
            (
                mark("rect", 0, -9, 18, 9, _class_look(code)),
                [*model.classes, "no class"][code],
            )
            for code in codes
        ]
        signs, high = legend(keys, _EDGE, top, inside)
        marks, top = marks + signs, top + high + 4.0
    for place, (name, panel) in enumerate(surface.panels.items()):
        parts = [*_panel(surface, panel, name)]
        if x.name in row and y.name in row:
            across, up = _scales(surface)
            at, base = across.at(row[x.name]), up.at(row[y.name])
            diamond = f"M{at:.1f} {base - 6:.1f}l6 6l-6 6l-6 -6z"
            parts.append(mark("path", diamond, "witness"))
        left = _EDGE + place * (_LEFT + _SIDE + _RIGHT)
        marks.append(mark("group", parts, name, f"translate({left:.1f} {top:.1f})"))
    about = f"A grid of {CELLS} x {CELLS} cells, coloured by what the model answers"
    high = top + _SIDE + _BELOW + 30.0
    return picture(marks, wide, high, heading, _STYLE, about)


def _rest_texts(model: Document, surface: Surface) -> Iterator[list[str]]:
    """Yield the values of the other inputs, those of one reason together."""
    variables = {one.name: one for one in model.variables}
    for why in dict.fromkeys(why for _, why in surface.rest.values()):
        words = [
            f"{name} = {value_word(variables[name], value)}"
            for name, (value, reason) in surface.rest.items()
            if reason == why
        ]
        yield [f"{why}:", *(f"{word};" for word in words[:-1]), words[-1]]


def _scales(surface: Surface) -> tuple[Scale, Scale]:
    (low, high), (least, most) = _ends(surface.x), _ends(surface.y)
    top = 20.0
    return Scale(low, high, _LEFT, _LEFT + _SIDE), Scale(least, most, top + _SIDE, top)


def _class_look(code: int) -> str:
    return "cell none" if code < 0 else f"cell {class_mark(code)}"


def _panel(
    surface: Surface,
    panel: FloatArray,
    name: str,
) -> Iterator[Markup]:
    """Yield the cells of a surface, neighbours of one colour as one, with the axes."""
    x, y = _scales(surface)
    looks = (
        [[_class_look(int(v)) for v in line] for line in panel] if not name else None
    )
    if looks is None:
        known = panel[np.isfinite(panel)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0, 0)
        if high - low <= _FLAT * max(abs(low), abs(high)):
            high = low  # but for rounding
        looks = [[_level_look(v, low, high) for v in line] for line in panel.tolist()]
        yield from _colour_bar(low, high, y, name, x.end + 16.0)
    size = _SIDE / CELLS
    for row, line in enumerate(looks):
        start = 0
        for look, run in itertools.groupby(line):
            count = len([*run])
            left, top = x.start + size * start, y.start - size * (row + 1)
            yield mark("rect", left, top, size * count, size, look)
            start += count
    yield mark("rect", x.start, y.end, _SIDE, _SIDE, "axis")
    yield from axis_marks(x, y.start)
    yield from _numbers_at(y, x.start)
    titles = [lines_within(axis_of(v).title, _SIDE, 11.0) for v in surface[:2]]
    middle = (x.start + x.end) / 2.0
    yield from word_lines(middle, y.start + 32.0, titles[0], "term", _LINE, "middle")
    turned = f"translate(22 {(y.start + y.end) / 2.0:.1f}) rotate(-90)"
    yield mark(
        "group", [*word_lines(0, 0, titles[1], "term", _LINE, "middle")], move=turned
    )


def _numbers_at(y: Scale, left: float) -> Iterator[Markup]:
    """Yield the numbers of an axis that goes upwards, left of it."""
    values = ticks(y.low, y.high, 5)
    for value, word in zip(values, tick_words(values), strict=True):
        yield mark("line", left - 4.0, left, y.at(value), y.at(value), "tick")
        yield mark("words", left - 8.0, y.at(value) + 4.0, word, "small", "end")


def _level_look(value: float, low: float, high: float) -> str:
    if not math.isfinite(value):
        return "cell none"
    part = (value - low) / (high - low) if high > low else 0.5
    return f"cell s{min(int(part * _LEVELS), _LEVELS - 1)}"


def _colour_bar(
    low: float, high: float, y: Scale, name: str, left: float
) -> Iterator[Markup]:
    """Yield the colours from the least number to the largest."""
    yield mark("words", left, y.end - 7.0, name, "term")
    step = (y.start - y.end) / _LEVELS
    for level in range(_LEVELS if high > low else 1):
        value = between(low, high, (level + 0.5) / _LEVELS)
        look = _level_look(value, low, high)
        yield mark("rect", left, y.start - step * (level + 1), 14.0, step, look)
    scale = Scale(low, high, y.start, y.end)
    if high > low:
        values = ticks(low, high, 5)
        for value, word in zip(values, tick_words(values), strict=True):
            yield mark("words", left + 20.0, scale.at(value) + 4.0, word, "small")
    else:
        yield mark("words", left + 20.0, y.start, number(low), "small")


def _shade(level: int) -> str:
    """Return the colour of a level, between the anchors."""
    place = level / (_LEVELS - 1) * (len(_ANCHORS) - 1)
    first = min(int(place), len(_ANCHORS) - 2)
    pairs = zip(_ANCHORS[first], _ANCHORS[first + 1], strict=True)
    return "#" + "".join(
        f"{round(a + (b - a) * (place - first)):02x}" for a, b in pairs
    )


_STYLE = (
    ".cell { fill: var(--k, var(--soft)); shape-rendering: crispEdges; }\n"
    + "".join(f".s{level} {{ fill: {_shade(level)}; }}\n" for level in range(_LEVELS))
)
