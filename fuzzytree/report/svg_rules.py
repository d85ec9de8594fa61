"""A rule viewer: what each rule makes of one row, and what becomes of all, drawn."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from fuzzytree.model import (
    And,
    Condition,
    Document,
    Not,
    Or,
    Proposition,
    Rule,
    SystemOutput,
    SystemRule,
    Variable,
)
from fuzzytree.report.drawing import (
    Curve,
    Scale,
    axis_marks,
    axis_of,
    curve_points,
    lines_within,
    path_of,
    polyline,
    spread,
    word_lines,
)
from fuzzytree.report.markup import Markup, mark
from fuzzytree.report.models import Rules, rule_text
from fuzzytree.report.pictures import Picture, class_mark, picture
from fuzzytree.report.svg_terms import scale_of, sum_lines
from fuzzytree.report.text import number
from fuzzytree.semantics import (
    Status,
    answer_of,
    consequents,
    curve_degree,
    hedged,
    input_values,
    rules_of,
)

MOST_RULES = 100
"""Of a picture."""

_EDGE, _GAP = 12.0, 16.0
_NUMBER, _CELL, _END = 34.0, 132.0, 120.0  # wide: rule numbers, cells, strengths
_PLOT, _LINE, _ROW = 30.0, 13.0, 10.0  # high: curves, lines of words, between rows
_SMALL, _STRONG = 10.5, 14.0  # sizes of words


class _Cell(NamedTuple):
    """The marks of a part of a row, and how high they are."""

    marks: list[Markup]
    high: float


def draw_rules(
    model: Document, row: Mapping[str, float], *, title: str | None = None
) -> Picture:
    """Draw what the rules of a model make of a row; of a tree, its relative rules.

    Each rule is a row, each of its propositions a cell: the curve of the terms, a line
    at the value, and the area up to its degree. The strength stands at the right. Of a
    system follow the conclusions, cut as the rules are activated, and below them the
    joined area with the number that it becomes.

    Args:
        model: At most `MOST_RULES` rules.
        row: A finite number for each input.
        title: Above the picture; by default the name of the model.

    Raises:
        ValueError: If there are more rules, or a combination of the values overflows.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, leaves=2)
        >>> "rule 1" in draw_rules(tree, dict.fromkeys(tree.inputs, 0.0)).svg
        True
    """
    base = rules_of(model)
    rules: Rules = base.rules
    if len(rules) > MOST_RULES:
        raise ValueError(
            f"a picture shows at most {MOST_RULES} rules, and {model.name} has "
            f"{len(rules)}; draw its terms, or run the row"
        )
    answer = answer_of(base, row)
    if answer.status == Status.MISSING:
        raise ValueError(
            "the values of the row are so large that a combination overflows"
        )
    scene = _Scene(base, row)
    columns = [*scene.columns, *base.outputs]
    wide = _NUMBER + len(columns) * (_CELL + _GAP) + _END + 2 * _EDGE
    heading = f"The rules of {model.name} for a row" if title is None else title
    verdict = _verdict(base, answer.rule, answer.label, answer.outputs)
    inside = wide - 2 * _EDGE
    lines = lines_within(heading, inside, _STRONG)
    marks = [*word_lines(_EDGE, 20.0, lines, "strong", 17.0)]
    top = 17.0 * len(lines) + 8.0
    lines = lines_within(verdict, inside, 12.0)
    marks += word_lines(_EDGE, top + _LINE, lines, "words", 15.0)
    top += 15.0 * len(lines)
    pairs = [f"{name} = {scene.word(name)}" for name in base.inputs]
    notes = lines_within(
        [f"{pair};" for pair in pairs[:-1]] + pairs[-1:], inside, _SMALL
    )
    for column in scene.columns:
        notes += sum_lines(column, inside, _SMALL)
    marks += word_lines(_EDGE, top + _LINE, notes, "small", _LINE)
    top += _LINE * (len(notes) + 1)
    heads = [
        [*lines_within(column.name, _CELL, 11.0), f"= {scene.word(column.name)}"]
        for column in scene.columns
    ]
    heads += [lines_within(output.name, _CELL, 11.0) for output in base.outputs]
    for place, head in enumerate(heads):
        marks += word_lines(_left(place), top + _LINE, head, "term", _LINE)
    top += _LINE * max(map(len, heads), default=0) + _ROW
    for k, rule in enumerate(rules, 1):
        strength = answer.strengths[k - 1]
        cells = [scene.cell(rule, column) for column in scene.columns]
        cells += [scene.conclusion(rule, k, output) for output in base.outputs]
        end = _end(base, rule, strength)
        high = max(cell.high for cell in [*cells, end])
        parts = [mark("line", _EDGE, wide - _EDGE, 0.0, 0.0, "grid")]
        if k == answer.rule:
            size = high + _ROW / 2
            parts.append(mark("rect", _EDGE - 4, 1.0, inside + 8, size, "track", 4.0))
        parts.append(mark("words", _EDGE, _LINE + 3.0, str(k), "strong"))
        parts += _moved(cells, end)
        about = f"rule {k}, strength {number(strength)}: {rule_text(rule)}"
        marks.append(mark("group", parts, about, f"translate(0 {top:.1f})"))
        top += high + _ROW
    if base.outputs:
        numbers = zip(base.outputs, answer.outputs, strict=True)
        cells = [_Cell([], 0.0) for _ in scene.columns]
        cells += [scene.result(output, value) for output, value in numbers]
        parts = [mark("line", _EDGE, wide - _EDGE, 0.0, 0.0, "axis")]
        parts += _moved(cells, _Cell([], 0.0))
        marks.append(mark("group", parts, verdict, f"translate(0 {top:.1f})"))
        top += max(cell.high for cell in cells) + _ROW
    about = "A row for each rule, a cell for each proposition: curve, value and degree"
    return picture(marks, wide, top + _ROW, heading, _STYLE, f"{about}. {verdict}")


_STYLE = """
.filled { fill: var(--k, var(--c0)); fill-opacity: .35; }
"""


def _left(place: int) -> float:
    """Return where a column begins."""
    return _EDGE + _NUMBER + place * (_CELL + _GAP)


def _moved(cells: Sequence[_Cell], end: _Cell) -> Iterator[Markup]:
    for place, cell in enumerate([*cells, end]):
        if cell.marks:
            yield mark("group", cell.marks, move=f"translate({_left(place):.1f} 5)")


def _verdict(
    model: Document, rule: int, label: str | None, outputs: Sequence[float]
) -> str:
    if model.outputs:
        numbers = zip(model.outputs, outputs, strict=True)
        return "; ".join(f"{one.name} is {number(value)}" for one, value in numbers)
    by = f"by rule {rule}" if rule else "as no rule fires"
    return f"The class is {label}, {by}" if label else f"No class, {by}"


def _end(model: Document, rule: Rule | SystemRule, strength: float) -> _Cell:
    """Return the strength of a rule as a number and a bar, with its class."""
    own, lines = "", list[str]()
    if isinstance(rule, Rule):
        own = f" {class_mark(model.classes.index(rule.then))}"
        lines = lines_within(rule.then, _END - 8.0, _STRONG)
    marks = [*word_lines(0.0, _LINE, lines, f"strong{own}", 16.0)]
    top = 16.0 * len(lines)
    wide = _END - 50.0
    marks += [
        mark("rect", 0.0, top + 4.0, wide, 8.0, "track"),
        mark("rect", 0.0, top + 4.0, wide * min(strength, 1.0), 8.0, f"bar{own}"),
        mark("words", wide + 6.0, top + 12.0, _short(strength), "small"),
    ]
    return _Cell(marks, top + 18.0)


def _short(value: float) -> str:
    return f"{value:.3g}"


def value_word(variable: Variable, value: float) -> str:
    """Return a value of an input with its unit, or its category.

    Example:
        >>> value_word(Variable("mass", unit="kg"), 2.0)
        '2 kg'
    """
    if variable.categories and value in range(len(variable.categories)):
        return variable.categories[int(value)]
    return f"{number(value)} {variable.unit}".rstrip()


class _Scene:
    """A model at a row: what its cells show."""

    def __init__(self, model: Document, row: Mapping[str, float]) -> None:
        self.values = dict(input_values(model.variables, row))
        self.variables = {one.name: one for one in model.variables}
        rules: Rules = model.rules
        names = {p.variable for rule in rules for p in _propositions(rule.when)}
        self.columns = [one for one in model.variables if one.name in names]
        self.scales = {one.name: self._scale(one) for one in self.columns}
        self.conclusions = consequents(model, row)

    def word(self, name: str) -> str:
        """Return the value of a variable with its unit, or its category."""
        return value_word(self.variables[name], self.values[name])

    def _scale(self, variable: Variable) -> Scale:
        whole, value = scale_of(axis_of(variable), None), self.values[variable.name]
        return Scale(min(whole.low, value), max(whole.high, value), 0.0, _CELL)

    def cell(self, rule: Rule | SystemRule, column: Variable) -> _Cell:
        """Return the propositions of a rule about a variable, below one another."""
        marks: list[Markup] = []
        top = 0.0
        x, value = self.scales[column.name], self.values[column.name]
        for proposition in _propositions(rule.when):
            if proposition.variable != column.name:
                continue
            curve = self._curve(proposition, column)
            level = curve.degree(value)
            points = curve_points(_clipped(curve, level), x.low, x.high)
            words = (*proposition.hedges, " or ".join(proposition.terms))
            plot = _plot(" ".join(words), _short(level), x, [curve], points, value)
            marks.append(mark("group", plot.marks, move=f"translate(0 {top:.1f})"))
            top += plot.high
        return _Cell(marks, top)

    def _curve(self, proposition: Proposition, variable: Variable) -> Curve:
        terms = [term for term in variable.terms if term.name in proposition.terms]

        @functools.cache
        def degree(value: float) -> float:
            degrees = (
                term.height * curve_degree(term.function, value, self.values)
                for term in terms
            )
            return hedged(proposition.hedges, max(degrees, default=1.0))

        corners = {knot for term in terms for knot in term.function.knots()}
        return Curve(variable.name, degree, tuple(sorted(corners)))

    def conclusion(
        self, rule: Rule | SystemRule, position: int, output: SystemOutput
    ) -> _Cell:
        """Return what a rule concludes of an output, as far as it is activated."""
        marks: list[Markup] = []
        top = 0.0
        concluded = self.conclusions[output.name][0]
        x, axis = self._output_scale(output), axis_of(output)
        ends = rule.then if isinstance(rule, SystemRule) else ()
        for name in [end.term for end in ends if end.output == output.name]:
            own = [c for c in concluded if c.rule == position and c.term == name]
            is_weighted = output.defuzzifier.is_weighted
            curves = [c for c in axis.curves if c.name == name and not is_weighted]
            level, points = (own[0].degree, own[0].points) if own else (0.0, ())
            words = name
            if is_weighted and points:
                words = f"{name}: {number(points[0][0])}"
            plot = _plot(
                words, _short(level), x, curves, points, None, is_area=not is_weighted
            )
            marks.append(mark("group", plot.marks, move=f"translate(0 {top:.1f})"))
            top += plot.high
        return _Cell(marks, top)

    def _output_scale(self, output: SystemOutput) -> Scale:
        whole = scale_of(axis_of(output), None)
        concluded, _ = self.conclusions[output.name]
        values = [value for one in concluded for value, _ in one.points]
        low, high = min([whole.low, *values]), max([whole.high, *values])
        return Scale(
            *((low, high) if whole.low < whole.high else spread([low, high])),
            0.0,
            _CELL,
        )

    def result(self, output: SystemOutput, value: float) -> _Cell:
        """Return all conclusions of an output together, and its number."""
        concluded, joined = self.conclusions[output.name]
        x = self._output_scale(output)
        points = joined or [point for one in concluded for point in one.points]
        words = f"{output.name} = {number(value)} {output.unit}".rstrip()
        pin = value if x.low <= value <= x.high else None
        plot = _plot(words, "", x, [], points, pin, is_area=bool(joined))
        return _Cell([*plot.marks, *axis_marks(x, plot.high - 4.0)], plot.high + 20.0)


def _clipped(curve: Curve, level: float) -> Curve:
    def degree(value: float) -> float:
        return min(curve.degree(value), level)

    return curve._replace(degree=degree)


def _plot(
    words: str,
    level: str,
    x: Scale,
    curves: Sequence[Curve],
    points: Sequence[tuple[float, float]],
    value: float | None,
    *,
    is_area: bool = True,
) -> _Cell:
    """Return curves over an area or a spike, under words with a number at the right."""
    lines = lines_within(words, _CELL - 36.0 if level else _CELL, _SMALL)
    top = _LINE * len(lines) + 4.0
    y = Scale(0.0, 1.0, top + _PLOT, top)
    marks = [*word_lines(0.0, _LINE - 3.0, lines, "small", _LINE)]
    marks.append(mark("words", x.end, _LINE - 3.0, level, "small", "end"))
    dots = [(x.at(v), y.at(degree)) for v, degree in points]
    if is_area and points:
        ends = (dots[0][0], y.start), (dots[-1][0], y.start)
        marks.append(mark("path", path_of([ends[0], *dots, ends[1]]), "filled"))
    else:
        marks += [mark("line", at, at, y.start, high, "line") for at, high in dots]
    marks.append(mark("line", x.start, x.end, y.start, y.start, "axis"))
    for curve in curves:
        marks.append(mark("path", polyline(curve, x, y), "curve"))
    if value is not None:
        marks.append(mark("line", x.at(value), x.at(value), top - 2.0, y.start, "pin"))
    return _Cell(marks, top + _PLOT + 4.0)


def _propositions(
    when: Condition | Sequence[Condition] | None,
) -> Iterator[Proposition]:
    """Yield the propositions of a condition, from left to right."""
    match when:
        case None:
            return
        case Proposition():
            yield when
        case Not(part=part):
            yield from _propositions(part)
        case And(parts=parts) | Or(parts=parts):
            yield from _propositions(parts)
        case _:
            for part in when:
                yield from _propositions(part)
