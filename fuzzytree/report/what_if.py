"""A model as one HTML page that runs it: inputs to move, the answer, and why.

The page is `templates/what_if.html`. The program that the JavaScript writer makes of
the model gives its answers; what else it needs stands in it as JSON. It loads nothing,
and the same model and rows give the same bytes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import Any, NamedTuple

from fuzzytree.checking import export
from fuzzytree.files import PathLike, write_atomically
from fuzzytree.formats import conclusions_text
from fuzzytree.model import (
    DATE_UNIT,
    And,
    Condition,
    Document,
    FloatArray,
    Formula,
    FuzzySystem,
    Linear,
    Or,
    Proposition,
    Rule,
    RuleBase,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    combined,
    condition_text,
    fingerprint,
    joints,
    questions,
)
from fuzzytree.report.drawing import axis_of, curve_points, term_curve
from fuzzytree.report.markup import Markup, source
from fuzzytree.report.models import document_text
from fuzzytree.report.parts import whole_page
from fuzzytree.report.text import number
from fuzzytree.semantics import rules_of

MOST_ROWS = 300
"""Of a table that a page holds."""

_EXAMPLES = 8  # with which the page tests itself
_STEPS = 200.0  # of a slider, at least
_WORD = "\x1f"  # around words such as AND; no name has it

_Facts = dict[str, Any]
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
        command: That proves why, without its row.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> what_if_page(random_tree(1)).html.startswith("<!doctype html>")
        True
    """
    rules = rules_of(model)
    options: dict[str, Any] = {"module": "script", "examples": _EXAMPLES}
    if rules.classes and rules.semantics.sharpness:
        options["probabilities"] = True
    program = export(rules, "javascript", **options).content
    rows = [] if values is None else values.T[:MOST_ROWS].tolist()
    total = 0 if values is None else values.shape[1]
    variables = [*_variable_facts(model, values)]
    facts: _Facts = {
        "name": model.name,
        "fingerprint": fingerprint(model),
        "command": command,
        "classes": model.classes,
        "variables": variables,
        "outputs": [_output_facts(output) for output in model.outputs],
        "rules": [*_rule_facts(rules)],
        "rows": [[_finite(value) for value in row] for row in rows],
        "total": total,
    }
    html = whole_page(
        "what_if.html",
        title=model.name,
        about=document_text(model),
        facts=_json(facts),
        program=Markup(program.decode("ascii")),
        script=Markup(source("what_if.js")),
    )
    return Page(html, len(rows), total)


def _json(facts: _Facts) -> Markup:
    """Return facts as JSON in ASCII that neither ends a script nor begins one."""
    text = json.dumps(facts, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", r"\u003c"))


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _variable_facts(model: Document, values: FloatArray | None) -> Iterator[_Facts]:
    """Yield inputs and combinations, with the ends of their sliders and their terms."""
    ends: dict[str, _Ends] = {}
    places = {one.name: place for place, one in enumerate(model.variables)}
    columns: dict[str, list[float]] = {}
    if values is not None:
        columns = dict(zip(model.inputs, values.tolist(), strict=True))
    for one in model.variables:
        cells = [*filter(math.isfinite, columns.get(one.name, ()))]
        low, high = _ends(one, cells, ends)
        step = 1.0 if one.is_whole or one.categories else _step(high - low)
        if not one.parts:
            low, high = _rounded(low, step, math.floor), _rounded(high, step, math.ceil)
        ends[one.name] = low, high
        middle = low / 2 + high / 2 if one.missing is None else max(one.missing, low)
        first = columns[one.name][0] if columns.get(one.name) else math.nan
        if not math.isfinite(first):
            first = _rounded(middle, step, round)
        yield {
            "name": one.name,
            "unit": "" if one.unit == DATE_UNIT else one.unit,
            "isDate": one.unit == DATE_UNIT,
            "low": low,
            "high": high,
            "step": step,
            "start": first,
            "clip": [one.low, one.high] if one.clips else None,
            "categories": one.categories,
            "missing": one.missing,
            "parts": [[places[p.input], p.weight, p.centre] for p in one.parts],
            "terms": [_term_facts(term, low, high) for term in one.terms],
        }


def _ends(one: Variable, cells: Sequence[float], ends: dict[str, _Ends]) -> _Ends:
    """Return from where to where the values of a variable go."""
    if one.categories:
        return 0.0, len(one.categories) - 1.0
    if cells:
        low, high = min(cells), max(cells)
    elif one.low is not None and one.high is not None:
        low, high = one.low, one.high
    elif one.parts:
        pairs = [[p.weight * (x - p.centre) for x in ends[p.input]] for p in one.parts]
        low, high = sum(map(min, pairs)), sum(map(max, pairs))
    else:
        known = [end for end in (one.low, one.high, one.missing) if end is not None]
        known += [x for curve in axis_of(one).curves for x in curve.corners]
        low, high = min(known, default=0.0), max(known, default=1.0)
    room = 0.5 * max(abs(low), 1.0)
    return (low, high) if high > low else (low - room, high + room)


def _step(width: float) -> float:
    """Return a step of round numbers that makes 200 steps or more of a width."""
    if not 0.0 < width < math.inf:
        return 1.0
    power = 10.0 ** math.floor(math.log10(width / _STEPS))
    return max(k * power for k in (1.0, 2.0, 5.0) if k * power <= width / _STEPS)


def _rounded(value: float, step: float, whole: Any) -> float:
    """Return the multiple of a step beside a value, without the digits of rounding."""
    count = value / step
    return float(f"{whole(count) * step:.12g}") if abs(count) < 1e15 else value


def _term_facts(term: Term, low: float, high: float) -> _Facts:
    """Return a term as points with lines between them, or as what it concludes."""
    match term.function:
        case Singleton(value=value):
            return {"name": term.name, "at": value}
        case Linear(weights=weights, offset=offset):
            return {"name": term.name, "weights": weights, "offset": offset}
        case Formula():
            return {"name": term.name}
        case _:
            points = curve_points(term_curve(term), low, high)
            return {"name": term.name, "points": [(x, round(y, 5)) for x, y in points]}


def _output_facts(output: SystemOutput) -> _Facts:
    known = [x for curve in axis_of(output).curves for x in curve.corners]
    low = min(known, default=0.0) if output.low is None else output.low
    high = max(known, default=1.0) if output.high is None else output.high
    high = high if high > low else low + 1.0
    return {
        "name": output.name,
        "unit": output.unit,
        "low": low,
        "high": high,
        "isWeighted": output.defuzzifier.is_weighted,
        "aggregation": output.aggregation or "sum",
        "terms": [_term_facts(term, low, high) for term in output.terms],
    }


def _rule_facts(model: RuleBase | FuzzySystem) -> Iterator[_Facts]:
    """Yield the rules: their words, their propositions, and what they conclude."""
    named: list[Variable | SystemOutput] = [*model.variables, *model.outputs]
    rules: Sequence[Rule | SystemRule] = model.rules
    variables = {one.name: k for k, one in enumerate(model.variables)}
    outputs = {one.name: k for k, one in enumerate(model.outputs)}
    terms = {(v.name, t.name): k for v in named for k, t in enumerate(v.terms)}
    implications = [one.implication for one in model.blocks for _ in one.rules]
    for place, rule in enumerate(rules):
        facts: _Facts = {"text": _sentence(rule)}
        facts["isAny"] = Or in {*joints(_condition(rule))}
        facts["when"] = [
            [variables[p.variable], [terms[p.variable, t] for t in p.terms], p.hedges]
            for p in questions(_condition(rule))
            if p.variable in variables
        ]
        if isinstance(rule, Rule):
            facts["class"] = model.classes.index(rule.then)
        else:
            facts["implication"] = implications[place] or "minimum"
            facts["then"] = [
                [outputs[c.output], terms[c.output, c.term], c.hedges]
                for c in rule.then
            ]
        yield facts


def _condition(rule: Rule | SystemRule) -> Condition | None:
    if isinstance(rule, SystemRule):
        return rule.when
    return combined(And, rule.when) if rule.when else None


def _sentence(rule: Rule | SystemRule) -> str:
    """Return a rule in words, with a mark around IF, AND, OR, NOT and THEN."""

    def marked(word: str) -> str:
        return f"{_WORD}{word.upper()}{_WORD}"

    def proposition(one: Proposition) -> str:
        words = [one.variable, "is", *one.hedges, " or ".join(one.terms)]
        return " ".join(filter(None, words))

    condition, end = _condition(rule), ""
    if isinstance(rule, Rule):
        end = rule.then
    else:
        end = conclusions_text(rule.then)
        end += "" if rule.weight == 1.0 else f" (weight {number(rule.weight)})"
    if condition is None:
        return f"{marked('always')} {end}"
    words = condition_text(condition, proposition, marked)
    return f"{marked('if')} {words} {marked('then')} {end}"
