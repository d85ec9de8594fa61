"""A rule viewer: what each rule makes of one row, and what becomes of all, drawn."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence

from fuzzytree.model import (
    Document,
    Proposition,
    Rule,
    SystemOutput,
    SystemRule,
    questions,
)
from fuzzytree.report.drawing import (
    Axis,
    Block,
    Curve,
    Scale,
    Sheet,
    axis_marks,
    axis_of,
    curve_points,
    listing,
    path_of,
    polyline,
    term_curve,
    text_block,
)
from fuzzytree.report.markup import mark
from fuzzytree.report.models import Rules, rule_text, value_word
from fuzzytree.report.pictures import Picture, class_mark
from fuzzytree.report.svg_terms import scale_of, sum_words
from fuzzytree.report.text import number
from fuzzytree.semantics import (
    Status,
    answer_of,
    consequents,
    hedged,
    input_values,
    rules_of,
)

MOST_RULES = 100
"""Of a picture."""

_NUMBER, _CELL, _GAP, _END = 34.0, 132.0, 16.0, 104.0  # wide: from left to right
_COLUMNS = 7  # at most, of variables; more are named in cells
_PLOT, _ROW = 30.0, 10.0  # high: curves, and between rows
_ABOUT = "A row for each rule, a cell for each proposition: curve, value and degree. "
_STYLE = ".filled { fill: var(--k, var(--c0)); fill-opacity: .35; }\n"


def draw_rules(
    model: Document, row: Mapping[str, float], *, title: str | None = None
) -> Picture:
    """Draw what at most `MOST_RULES` rules make of a row; of a tree the relative rules.

    Each rule is a row, each of its propositions a cell: the curve of the terms, a line
    at the value, and the area up to its degree. The strength stands at the right. Of a
    system follow the conclusions, cut as the rules are activated, and below them the
    joined area with the number that it becomes.
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
    numbers = [*zip(base.outputs, answer.outputs, strict=True)]
    columns = scene.width + len(numbers)
    sheet = Sheet(
        _NUMBER + columns * (_CELL + _GAP) + _END,
        title or f"The rules of {model.name} for a row",
    )
    verdict = "; ".join(f"{one.name} is {number(value)}" for one, value in numbers)
    if not numbers:
        by = f"by rule {answer.rule}" if answer.rule else "as no rule fires"
        verdict = (
            f"The class is {answer.label}, {by}" if answer.label else f"No class, {by}"
        )
    sheet.words(verdict, "words")
    sheet.words(listing([f"{name} = {scene.word(name)}" for name in base.inputs]))
    for column in scene.columns:
        sheet.words(sum_words(column, model.variables))
    heads = [f"{column.name} = {scene.word(column.name)}" for column in scene.columns]
    heads = [*(heads if scene.is_table else [""] * scene.width)]
    heads += [output.name for output in base.outputs]
    blocks = [text_block(0.0, 0.0, head, _CELL, "term") for head in heads]
    sheet.top += _ROW
    _add_row(sheet, blocks, look="")
    for k, rule in enumerate(rules, 1):
        strength = answer.strengths[k - 1]
        blocks = scene.cells(rule)
        blocks += [scene.conclusion(rule, k, output) for output in base.outputs]
        names = (p.variable for p in _propositions(rule))
        before = [name for name in names if name not in scene.variables]
        note = f"with {', '.join(before)} as concluded before" if before else ""
        blocks.append(_strength(base, rule, strength, note))
        about = f"rule {k}, strength {number(strength)}: {rule_text(rule)}"
        _add_row(sheet, blocks, str(k), about, is_winner=k == answer.rule)
    if numbers:
        blocks = [([], 0.0)] * scene.width
        blocks += [scene.result(output, value) for output, value in numbers]
        _add_row(sheet, blocks, about=verdict, look="axis")
    return sheet.picture(_ABOUT + verdict, _STYLE)


def _add_row(
    sheet: Sheet,
    blocks: Sequence[Block],
    words: str = "",
    about: str | None = None,
    *,
    look: str = "grid",
    is_winner: bool = False,
) -> None:
    """Add blocks to the right of a number, below a line."""
    high = max((high for _, high in blocks), default=0.0) + _ROW
    marks = [mark("line", 0.0, sheet.inside, 0.0, 0.0, look)] if look else []
    if is_winner:
        marks.append(mark("rect", -4.0, 1.0, sheet.inside + 8.0, high - 4.0, "track"))
    marks += text_block(0.0, 2.0, words, _NUMBER, "strong")[0]
    for place, (parts, _) in enumerate(blocks):
        move = f"translate({_NUMBER + place * (_CELL + _GAP):.1f} 4)"
        marks += [mark("group", parts, move=move)] if parts else []
    sheet.row([(marks, high)], about=about)


def _strength(
    model: Document, rule: Rule | SystemRule, strength: float, note: str
) -> Block:
    """Return the strength of a rule as a number and a bar, with its class or a note."""
    own, name = "", ""
    if isinstance(rule, Rule):
        own, name = f" {class_mark(model.classes.index(rule.then))}", rule.then
    marks, top = text_block(0.0, 0.0, name, _END, f"strong{own}")
    wide = _END - 44.0
    marks += [
        mark("rect", 0.0, top + 4.0, wide, 8.0, "track"),
        mark("rect", 0.0, top + 4.0, wide * min(strength, 1.0), 8.0, f"bar{own}"),
        mark("words", wide + 6.0, top + 12.0, _short(strength), "small"),
    ]
    words, high = text_block(0.0, top + 14.0, note, _END)
    return [*marks, *words], top + 18.0 + high


def _short(value: float) -> str:
    return f"{value:.3g}"


class _Scene:
    """A model at a row: what its cells show."""

    def __init__(self, model: Document, row: Mapping[str, float]) -> None:
        self.values = dict(input_values(model.variables, row))
        self.variables = {one.name: one for one in model.variables}
        rules: Rules = model.rules
        names = {p.variable for rule in rules for p in _propositions(rule)}
        self.columns = [one for one in model.variables if one.name in names]
        counts = [len({p.variable for p in _propositions(r)}) for r in rules]
        self.is_table = len(self.columns) <= max(_COLUMNS, *counts)
        self.width = len(self.columns) if self.is_table else max(counts)
        self.conclusions = consequents(model, row)
        ends = {one.name: [self.values[one.name]] for one in self.columns}
        for name, (activated, _) in self.conclusions.items():
            ends[name] = [value for one in activated for value, _ in one.points]
        axes = [*map(axis_of, self.columns), *map(axis_of, model.outputs)]
        self.scales = {axis.name: _scale(axis, ends[axis.name]) for axis in axes}

    def word(self, name: str) -> str:
        """Return the value of a variable in words."""
        return value_word(self.variables[name], self.values[name])

    def cells(self, rule: Rule | SystemRule) -> list[Block]:
        """Return the propositions of a rule, those about a variable below one another.

        Each variable has its column, or where these are many only its name.
        """
        plots: dict[str, list[Block]] = {one.name: [] for one in self.columns}
        for proposition in _propositions(rule):
            name = proposition.variable
            if name in plots:
                x, curve = self.scales[name], self._curve(proposition)
                level = curve.degree(self.values[name])
                points = curve_points(_clipped(curve, level), x.low, x.high)
                words = " or ".join(proposition.terms)
                if proposition.hedges:
                    words = f"{' '.join(proposition.hedges)} ({words})"
                words = words if self.is_table else f"{name} is {words}"
                plot = _plot(words, level, x, [curve], points, self.values[name])
                plots[name].append(plot)
        blocks = [_below(own) for own in plots.values() if own or self.is_table]
        return [*blocks, *[([], 0.0)] * (self.width - len(blocks))]

    def _curve(self, proposition: Proposition) -> Curve:
        variable = self.variables[proposition.variable]
        terms = [term for term in variable.terms if term.name in proposition.terms]
        curves = [term_curve(term, self.values) for term in terms]

        @functools.cache
        def degree(value: float) -> float:
            degrees = (curve.degree(value) for curve in curves)
            return hedged(proposition.hedges, max(degrees, default=1.0))

        corners = {corner for curve in curves for corner in curve.corners}
        return Curve(variable.name, degree, tuple(sorted(corners)))

    def conclusion(
        self, rule: Rule | SystemRule, position: int, output: SystemOutput
    ) -> Block:
        """Return what a rule concludes of an output, as far as it is activated."""
        x, is_weighted = self.scales[output.name], output.defuzzifier.is_weighted
        activated = {
            c.term: c for c in self.conclusions[output.name][0] if c.rule == position
        }
        plots: list[Block] = []
        for end in rule.then if isinstance(rule, SystemRule) else ():
            if end.output != output.name:
                continue
            own, name = activated.get(end.term), end.term
            curves = [c for c in axis_of(output).curves if c.name == name]
            level, points = (own.degree, own.points) if own else (0.0, ())
            if is_weighted:
                name += f": {number(points[0][0])}" if points else ""
                curves = []
            plots.append(_plot(name, level, x, curves, points, is_area=not is_weighted))
        return _below(plots)

    def result(self, output: SystemOutput, value: float) -> Block:
        """Return all conclusions of an output together, and its number."""
        activated, joined = self.conclusions[output.name]
        x = self.scales[output.name]
        points = joined or [point for one in activated for point in one.points]
        words = f"{output.name} = {number(value)} {output.unit}".rstrip()
        pin = value if x.low <= value <= x.high else None
        marks, high = _plot(words, None, x, [], points, pin, is_area=bool(joined))
        return [*marks, *axis_marks(x, high - 4.0)], high + 16.0


def _scale(axis: Axis, values: Sequence[float]) -> Scale:
    """Return the scale of a cell, with the range of a variable and some values."""
    whole, finite = scale_of(axis, None), [*filter(math.isfinite, values)]
    return Scale(min([whole.low, *finite]), max([whole.high, *finite]), 0.0, _CELL)


def _below(blocks: Sequence[Block]) -> Block:
    """Return blocks below one another."""
    tops = [0.0, *itertools.accumulate(high for _, high in blocks)]
    moves = (f"translate(0 {top:.1f})" for top in tops)
    pairs = zip(blocks, moves, strict=False)
    return [mark("group", marks, move=move) for (marks, _), move in pairs], tops[-1]


def _clipped(curve: Curve, level: float) -> Curve:
    def degree(value: float) -> float:
        return min(curve.degree(value), level)

    return curve._replace(degree=degree)


def _plot(
    words: str,
    level: float | None,
    x: Scale,
    curves: Sequence[Curve],
    points: Sequence[tuple[float, float]],
    value: float | None = None,
    *,
    is_area: bool = True,
) -> Block:
    """Return curves over an area or spikes, under words with a number at the right."""
    marks, top = text_block(0.0, -2.0, words, _CELL - (0.0 if level is None else 36.0))
    if level is not None:
        marks.append(mark("words", x.end, 8.0, _short(level), "small", "end"))
    y = Scale(0.0, 1.0, top + 4.0 + _PLOT, top + 4.0)
    dots = [(x.at(v), y.at(degree)) for v, degree in points if math.isfinite(v)]
    if is_area and dots:
        area = [(dots[0][0], y.start), *dots, (dots[-1][0], y.start)]
        marks.append(mark("path", path_of(area), "filled"))
    elif dots:
        marks += [mark("line", at, at, y.start, high, "line") for at, high in dots]
    marks.append(mark("line", x.start, x.end, y.start, y.start, "axis"))
    marks += [mark("path", polyline(curve, x, y), "curve") for curve in curves]
    if value is not None:
        marks.append(
            mark("line", x.at(value), x.at(value), y.end - 2.0, y.start, "pin")
        )
    return marks, y.start + 4.0


def _propositions(rule: Rule | SystemRule) -> Iterable[Proposition]:
    return rule.when if isinstance(rule, Rule) else questions(rule.when)
