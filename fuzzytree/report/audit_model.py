"""The audited model on the page: its tree, its terms, its rules with what rows say."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.auditing import Answer, AuditView, Sampled
from fuzzytree.model import FuzzySystem, FuzzyTree, Rule, RuleBase
from fuzzytree.report.audit_rows import Data, Passing
from fuzzytree.report.audit_states import percent
from fuzzytree.report.drawing import Axis
from fuzzytree.report.markup import (
    Content,
    Markup,
    folded,
    joined,
    listed,
    table,
    tag,
    text,
    text_lines,
)
from fuzzytree.report.svg_terms import terms_picture
from fuzzytree.report.svg_tree import MOST_LEAVES, class_mark, tree_picture
from fuzzytree.report.systems import curve_text, rule_text, sum_text
from fuzzytree.report.text import counted, number, shape_text, tree_lines

Audited = FuzzyTree | RuleBase | FuzzySystem

MOST_RULES = 1000
MOST_VARIABLES = 60
_MOST_LINES = 400  # of a tree as an outline
_MOST_TERMS = 40  # of a variable that are described in words
_MOST_PARTS = 12  # of a combination that are written


def class_name(label: str, code: int) -> Markup:
    """Return a class with the mark of its colour."""
    mark = tag("span", class_=f"chip {class_mark(code)}", aria_hidden="true")
    return tag("span", mark, label, class_="class")


def legend(classes: Sequence[str]) -> Markup:
    """Return the classes with their colours."""
    shown = [class_name(label, code) for code, label in enumerate(classes[:40])]
    if len(classes) > len(shown):
        shown.append(text(f"and {len(classes) - len(shown)} more"))
    return tag("p", "Classes: ", joined(shown, " "), class_="legend")


def sentence_of(rule: Rule, rules: RuleBase) -> Markup:
    """Return a rule of a rule base as a person reads it."""
    then = class_name(rule.then, rules.classes.index(rule.then))
    if not rule.when:
        return joined([_word("ALWAYS"), then], " ")
    clauses = [
        joined(
            [
                tag("b", one.variable),
                " is not " if one.negated else " is ",
                joined((tag("i", term) for term in one.terms), " or "),
            ]
        )
        for one in rule.when
    ]
    parts = [_word("IF"), clauses[0]]
    for clause in clauses[1:]:
        parts += [_word("AND"), clause]
    return joined([*parts, _word("THEN"), then], " ")


def _word(said: str) -> Markup:
    return tag("span", said, class_="word")


def tree_section(tree: FuzzyTree, passed: Passing | None) -> Markup:
    """Return a tree as a picture and as an outline."""
    lines = [*itertools.islice(tree_lines(tree), _MOST_LINES)]
    outline = tag("pre", text_lines(lines), tabindex="0")
    parts: list[Content] = []
    if len(tree.leaves) <= MOST_LEAVES:
        parts.append(legend(tree.classes))
        picture = tree_picture(tree, passed)
        frame = {"role": "region", "aria_label": "The tree"}
        parts.append(tag("div", picture, class_="scrolls tree", tabindex="0", **frame))
        parts.append(tag("p", _bars_mean(tree, passed), class_="caption"))
        parts.append(folded("The tree as an outline", outline))
    else:
        said = f"A picture shows at most {MOST_LEAVES} leaves, and this tree has "
        parts += [tag("p", f"{said}{len(tree.leaves)}; here is its outline"), outline]
    if len(lines) == _MOST_LINES:
        said = f"Only the first {_MOST_LINES} lines are shown"
        parts.append(tag("p", said, class_="left-out"))
    return joined(parts)


def _bars_mean(tree: FuzzyTree, passed: Passing | None) -> str:
    if passed is not None:
        said = "The bar in a box shows the rows that pass it, by their class"
        if passed.missing:
            said += f"; {counted(passed.missing, 'row')} with a missing value left out"
        return said
    if all(leaf.support is not None for leaf in tree.leaves):
        return "The bar in a box shows training rows, by the class of their leaf"
    return "How many rows reach the leaves is not known"


def terms_section(
    model: Audited,
    axes: Mapping[str, Axis],
    data: Data | None,
) -> Markup:
    """Return a picture of each variable; those without terms folded away."""
    with_terms = [a for a in axes.values() if a.curves or a.undrawn]
    others = [axis for axis in axes.values() if not (axis.curves or axis.undrawn)]
    parts: list[Content] = [_lines_mean(data)]
    parts.append(_grid(with_terms[:MOST_VARIABLES], model, data, "v"))
    more = len(with_terms) - MOST_VARIABLES
    if more > 0:
        said = f"{counted(more, 'more variable')} not drawn"
        parts.append(tag("p", said, class_="left-out"))
    if others:
        said = f"{counted(len(others), 'input')} without terms of "
        said += "its own" if len(others) == 1 else "their own"
        inner: list[Content] = [_grid(others[:MOST_VARIABLES], model, data, "i")]
        if len(others) > MOST_VARIABLES:
            said += f", {MOST_VARIABLES} drawn"
        parts.append(folded(said, *inner))
    return joined(parts)


def _lines_mean(data: Data | None) -> Markup:
    said = "Lines are degrees, from 0 to 1; hatched is what lies outside of the domain"
    if data is not None:
        rows = counted(len(data.codes), "row")
        by = " by class" if data.classes else ""
        said += f"; bars count the {rows} of the table{by}"
    return tag("p", said, class_="caption")


def _grid(axes: Sequence[Axis], model: Audited, data: Data | None, name: str) -> Markup:
    cards: list[Markup] = []
    for place, axis in enumerate(axes):
        lines: list[Content] = [*_in_words(model, axis.name)]
        if axis.parts:
            lines.append(_sum(axis))
        if axis.undrawn:
            lines.append(f"not drawn: {', '.join(axis.undrawn)}")
        words = [tag("p", line) for line in lines]
        cards.append(
            tag(
                "figure",
                tag("figcaption", tag("b", axis.name), _unit(axis.unit)),
                terms_picture(axis, data, f"{name}{place}"),
                folded("In words", *words) if words else None,
            )
        )
    return tag("div", *cards, class_="cards")


def _unit(unit: str) -> str:
    return f" in {unit}" if unit else ""


def _sum(axis: Axis) -> str:
    more = len(axis.parts) - _MOST_PARTS
    after = f" + {counted(more, 'more input')}" if more > 0 else ""
    return f"{axis.name} = {sum_text(axis.parts[:_MOST_PARTS])}{after}"


def _in_words(model: Audited, name: str) -> list[str]:
    """Return the terms of a variable in words."""
    if isinstance(model, FuzzySystem):
        own = next(one for one in model.inputs if one.name == name)
        return [
            f"{label.name}: {curve_text(label.curve, model.columns)}"
            for label in own.labels[:_MOST_TERMS]
        ]
    variable = next(one for one in model.variables if one.name == name)
    return [
        f"{term.name}: {shape_text(term.shape)}"
        for term in variable.terms[:_MOST_TERMS]
    ]


def rules_section(
    viewed: AuditView, answers: Sequence[Answer], links: Mapping[int, Sequence[Markup]]
) -> Markup:
    """Return the rules as a table, with what the rows say of each."""
    notes = [*_notes(viewed)]
    if viewed.rules is None:
        return joined(notes)
    rules = viewed.rules.rules
    is_supported = any(rule.support is not None for rule in rules)
    supported = {k: answer for answer in answers for k in _of_rows(answer)}
    names = [*dict.fromkeys(m.name for one in supported.values() for m in one.measures)]
    is_shared = any(isinstance(one.state, Sampled) for one in supported.values())
    head = ["rule", "sentence", *(["training rows"] if is_supported else []), *names]
    head += [*(["confidence"] if is_shared else []), "findings"]
    rows: list[list[Content]] = []
    for k, rule in enumerate(rules[:MOST_RULES], 1):
        said = sentence_of(rule, viewed.rules)
        answer = supported.get(k)
        name = viewed.rule_names[k - 1] if viewed.rule_names else str(k)
        row: list[Content] = [tag("span", name, id=f"rule-{k}"), said]
        if is_supported:
            row.append("-" if rule.support is None else str(rule.support))
        row += _measured(answer, names)
        if is_shared:
            row.append(_confidence(answer))
        row.append(joined(links.get(k, ()), " ") or "-")
        rows.append(row)
    right = tuple(range(2, len(head) - 1))
    caption = f"{counted(len(rules), 'rule')}, in the order of the model"
    return joined([table(head, rows, caption=caption, right=right, sorts=True), *notes])


def _notes(viewed: AuditView) -> Iterator[Markup]:
    """Yield what a reader must know of rules that are not in the table."""
    system, rules = viewed.system, viewed.rules
    if rules is None:
        said = "None of the rules has an exact counterpart; the reasons are below"
        yield tag("p", said, class_="left-out")
    elif len(rules.rules) > MOST_RULES:
        more = counted(len(rules.rules) - MOST_RULES, "more rule")
        yield tag("p", f"{more} not shown", class_="left-out")
    if system is None or (rules is not None and not viewed.rule_names):
        return
    if rules is not None:
        said = "These are the system's conditions as they are audited: one that says "
        yield tag("p", f"{said}'or' is examined as several rules", class_="caption")
    known = set(viewed.numbers)
    weights = [
        f"rule {k} by {rule.weight!r}"
        for k, rule in enumerate(system.rules, 1)
        if k in known and rule.weight != 1.0
    ]
    if weights:
        said = "The strengths of these are multiplied by their weights: "
        yield tag("p", said + ", ".join(weights[:MOST_RULES]), class_="caption")
    others = [
        joined([text(f"rule {k}: "), text(rule_text(rule))])
        for k, rule in enumerate(system.rules, 1)
        if k not in known
    ]
    if others:
        some = f"{counted(len(others), 'rule')} of {len(system.rules)} not audited"
        yield folded(some, listed(others[:MOST_RULES]))


def _of_rows(answer: Answer) -> Iterator[int]:
    """Yield the rule that an answer about rows is about."""
    if answer.code == "FT701" and len(answer.rules) == 1:
        yield answer.rules[0]


def _measured(answer: Answer | None, names: Sequence[str]) -> list[Content]:
    known = {one.name: one.value for one in answer.measures} if answer else {}
    return [number(known[name]) if name in known else "-" for name in names]


def _confidence(answer: Answer | None) -> Content:
    state = answer.state if answer else None
    if not isinstance(state, Sampled) or "its class" not in state.of:
        return "-"  # a share of something else, such as of the rows that it wins
    ends = f"{percent(state.low)} to {percent(state.high)}"
    sure = tag("span", f" ({ends})", class_="interval", title="95 % sure")
    return joined([f"{percent(state.hits / state.rows)} %", sure])
