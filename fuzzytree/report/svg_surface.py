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
    Sheet,
    axis_of,
    between,
    frame_marks,
    legend,
    listing,
    tick_words,
    ticks,
)
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.models import value_word
from fuzzytree.report.pictures import Picture, class_mark
from fuzzytree.report.svg_rules import draw_rules
from fuzzytree.report.svg_terms import draw_terms, scale_of
from fuzzytree.report.svg_tree import draw_tree
from fuzzytree.runtimes import Predictions, answers_of, baseline

CELLS = 48
"""On each side of a surface."""

_SIDE, _LEFT, _RIGHT, _TOP, _BELOW = 336.0, 78.0, 92.0, 20.0, 50.0  # points, around it
_LEVELS = 24
_FLAT = 1e-9  # of a number: smaller differences have no colours
_ANCHORS = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))
"""Colours from least to most, which the colour-blind see as ever lighter."""


class Surface(NamedTuple):
    """The answers of a model at the middles of cells, and why others have their value.

    A panel has shape (ys, xs): numbers by the name of an output, or by "" the numbers
    of classes; -1 and NaN stand for no answer.
    """

    x: Scale
    y: Scale
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
    """Draw a tree, or terms; what rules make of a row; or a surface over two inputs."""
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
    else the middle of their range; categories the first. Raises a ValueError where
    that is not possible.
    """
    inputs = {one.name: one for one in model.variables if not one.parts}
    if len(names) != 2 or names[0] == names[1]:
        words = ",".join(names)
        raise ValueError(f"a surface needs two different inputs, not {words!r}")
    for name in names:
        if name not in inputs:
            choice = name_choice(name, inputs)
            raise ValueError(f"a surface over {name!r}, which is no input; {choice}")
        if inputs[name].categories:
            raise ValueError(
                f"a surface needs two inputs of numbers, and {name!r} has categories"
            )
    x = Scale(*_ends(inputs[names[0]]), _LEFT, _LEFT + _SIDE)
    y = Scale(*_ends(inputs[names[1]]), _TOP + _SIDE, _TOP)
    parts = [(k + 0.5) / CELLS for k in range(CELLS)]
    xs, ys = ([between(axis.low, axis.high, part) for part in parts] for axis in (x, y))
    rest = {
        name: (row[name], "of the row") if name in row else _default(variable)
        for name, variable in inputs.items()
        if name not in names
    }
    columns = {names[0]: np.tile(xs, CELLS), names[1]: np.repeat(ys, CELLS)}
    columns |= {name: np.full(CELLS**2, value) for name, (value, _) in rest.items()}
    values = np.array([columns[name] for name in inputs])
    outcome = baseline().load(model, with_strengths=False)(values)
    answers = answers_of(outcome, model, with_strengths=False, with_probabilities=False)
    panels = (
        {"": answers.codes.astype(np.float64)}
        if isinstance(answers, Predictions)
        else {output.name: answers[output.name] for output in model.outputs}
    )
    grids = {name: panel.reshape((CELLS, CELLS)) for name, panel in panels.items()}
    return Surface(x, y, xs, ys, rest, grids)


def _ends(variable: Variable) -> tuple[float, float]:
    axis = axis_of(variable)
    if axis.low is not None and axis.high is not None and axis.low < axis.high:
        return axis.low, axis.high
    if not axis.curves:
        raise ValueError(
            f"{variable.name!r} has no range; write its low and high into the model"
        )
    return scale_of(axis, None)[:2]


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
    """Draw the class or the outputs over two inputs, and mark a row that has both."""
    surface = surface_of(model, names, row)
    step = _LEFT + _SIDE + _RIGHT
    what = ", ".join(filter(None, surface.panels)) or "the class"
    heading = title or f"{model.name}: {what} over {names[0]} and {names[1]}"
    sheet = Sheet(len(surface.panels) * step, heading)
    variables = {one.name: one for one in model.variables}
    for why in dict.fromkeys(why for _, why in surface.rest.values()):
        words = [
            f"{name} = {value_word(variables[name], value)}"
            for name, (value, reason) in surface.rest.items()
            if reason == why
        ]
        sheet.words([f"{why}:", *listing(words)])
    if not model.outputs:
        labels = [*model.classes, "no class"]
        codes = sorted({int(code) for code in surface.panels[""].flat})
        signs = [mark("rect", 0, -9, 18, 9, _class_look(code)) for code in codes]
        entries = zip(signs, [labels[code] for code in codes], strict=True)
        sheet.row([legend([*entries], sheet.inside)])
    point: list[Markup] = []
    if names[0] in row and names[1] in row:
        across, up = surface.x.at(row[names[0]]), surface.y.at(row[names[1]])
        diamond = f"M{across:.1f} {up - 6:.1f}l6 6l-6 6l-6 -6z"
        point = [mark("path", diamond, "witness")]
    axes = [axis_of(variables[name]) for name in names]
    frame = [*frame_marks(surface.x, surface.y, *axes), *point]
    blocks = [([*_cells(surface, name), *frame], 0.0) for name in surface.panels]
    sheet.row(blocks, step)
    sheet.top += _TOP + _SIDE + _BELOW
    about = f"A grid of {CELLS} x {CELLS} cells, coloured by what the model answers"
    return sheet.picture(about, _STYLE)


def _class_look(code: float) -> str:
    return "cell none" if code < 0 else f"cell {class_mark(int(code))}"


def _cells(surface: Surface, name: str) -> Iterator[Markup]:
    """Yield the cells of an output or of classes, neighbours of one colour as one."""
    panel, size = surface.panels[name], _SIDE / CELLS
    low = high = 0.0
    if name:
        finite = panel[np.isfinite(panel)]
        low, high = (f(finite).item() if finite.size else 0.0 for f in (np.min, np.max))
        if high - low <= _FLAT * max(abs(low), abs(high)):
            high = low  # but for rounding
        yield from _colour_bar(low, high, surface.y, name, surface.x.end + 16.0)
    for row, line in enumerate(panel.tolist()):
        looks = [_level_look(v, low, high) if name else _class_look(v) for v in line]
        left, top = surface.x.start, surface.y.start - size * (row + 1)
        for look, run in itertools.groupby(looks):
            wide = size * len([*run])
            yield mark("rect", left, top, wide, size, look)
            left += wide


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
        look = _level_look(between(low, high, (level + 0.5) / _LEVELS), low, high)
        yield mark("rect", left, y.start - step * (level + 1), 14.0, step, look)
    scale, values = Scale(low, high, y.start, y.end), ticks(low, high, 5)
    for value, word in zip(values, tick_words(values), strict=True):
        base = scale.at(value) + 4.0 if high > low else y.start
        yield mark("words", left + 20.0, base, word, "small")


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
    + "".join(f"rect.s{k} {{ fill: {_shade(k)}; }}\n" for k in range(_LEVELS))
)
