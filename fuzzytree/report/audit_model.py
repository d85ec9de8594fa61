"""The audited model on the page: its tree, its terms, its rules with what rows say."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.auditing import AuditAnswer, AuditView, Sampled
from fuzzytree.model import Document
from fuzzytree.report.audit_rows import Data, Passing
from fuzzytree.report.audit_states import percent
from fuzzytree.report.drawing import Axis
from fuzzytree.report.markup import Markup
from fuzzytree.report.models import rule_text, sum_text, term_text, tree_lines
from fuzzytree.report.parts import MOST_LINES, MOST_RULES, part
from fuzzytree.report.svg_terms import terms_picture
from fuzzytree.report.svg_tree import MOST_LEAVES, tree_picture
from fuzzytree.report.text import counted, number

MOST_VARIABLES = 60
_MOST_TERMS = 40  # of a variable that are described in words


def tree_section(tree: Document, passed: Passing | None) -> Markup:
    """Return a tree as a picture and as an outline."""
    lines = [*itertools.islice(tree_lines(tree), MOST_LINES)]
    is_small = len(tree.leaves) <= MOST_LEAVES
    picture = tree_picture(tree, passed) if is_small else None
    return part("tree", tree, picture, _bars_mean(tree, passed), lines, MOST_LEAVES)


def _bars_mean(tree: Document, passed: Passing | None) -> str:
    if passed is not None:
        said = "The bar in a box shows the rows that pass it, by their class"
        if passed.missing:
            said += f"; {counted(passed.missing, 'row')} with a missing value left out"
        return said
    if all(leaf.counts for leaf in tree.leaves):
        return "The bar in a box shows the training rows that reach it, by their class"
    if all(leaf.support is not None for leaf in tree.leaves):
        return "A branch is the thicker the more training rows took it"
    return "How many rows reach the leaves is not known"


def terms_section(
    model: Document,
    axes: Mapping[str, Axis],
    data: Data | None,
) -> Markup:
    """Return a picture of each variable; those without terms folded away."""
    with_terms = [a for a in axes.values() if a.curves or a.undrawn]
    others = [axis for axis in axes.values() if not (axis.curves or axis.undrawn)]
    caption = (
        "Lines are degrees, from 0 to 1; hatched is what lies outside of the domain"
    )
    if data is not None:
        by = " by class" if data.classes else ""
        caption += (
            f"; bars count the {counted(len(data.codes), 'row')} of the table{by}"
        )
    title = f"{counted(len(others), 'input')} without terms of "
    title += "its own" if len(others) == 1 else "their own"
    if len(others) > MOST_VARIABLES:
        title += f", {MOST_VARIABLES} drawn"
    return part(
        "terms",
        caption,
        [*_cards(with_terms, model, data, "v")],
        len(with_terms) - MOST_VARIABLES,
        title,
        [*_cards(others, model, data, "i")],
    )


def _cards(
    axes: Sequence[Axis], model: Document, data: Data | None, name: str
) -> Iterator[tuple[Axis, Markup, list[str]]]:
    """Yield variables with their pictures and their terms in words."""
    variables = {one.name: one for one in model.variables}
    for place, axis in enumerate(axes[:MOST_VARIABLES]):
        lines = [
            f"{term.name}: {term_text(variables[axis.name], term, model.inputs)}"
            for term in variables[axis.name].terms[:_MOST_TERMS]
        ]
        if axis.parts:
            said = sum_text(axis.parts, variables)
            lines.append(f"{axis.name} = {said}")
        if axis.undrawn:
            lines.append(f"not drawn: {', '.join(axis.undrawn)}")
        yield axis, terms_picture(axis, data, f"{name}{place}")[0], lines


def rules_section(
    viewed: AuditView, answers: Sequence[AuditAnswer], links: Mapping[int, Markup]
) -> Markup:
    """Return the rules as a table, with what the rows say of each."""
    rules = viewed.rules.rules if viewed.rules else ()
    classes = viewed.rules.classes if viewed.rules else ()
    is_supported = any(rule.support is not None for rule in rules)
    of_rows = (one for one in answers if one.code == "FT701" and len(one.rules) == 1)
    supported = {one.rules[0]: one for one in of_rows}
    names = [*dict.fromkeys(m.name for one in supported.values() for m in one.measures)]
    is_shared = any(isinstance(one.state, Sampled) for one in supported.values())
    head = ["rule", "sentence", *(["training rows"] if is_supported else []), *names]
    head += [*(["confidence"] if is_shared else []), "findings"]
    rows: list[list[str]] = []
    for k, rule in enumerate(rules[:MOST_RULES], 1):
        answer = supported.get(k)
        name = viewed.rule_names[k - 1] if viewed.rule_names else str(k)
        row: list[str] = [part("rule_id", name, k), part("rule", rule, classes)]
        if is_supported:
            row.append("-" if rule.support is None else str(rule.support))
        values = {one.name: one.value for one in answer.measures} if answer else {}
        row += [number(values[name]) if name in values else "-" for name in names]
        if is_shared:
            row.append(_confidence(answer))
        rows.append([*row, links.get(k, "-")])
    system, known = viewed.system, set(viewed.numbers)
    unaudited: list[tuple[int, str]] = []
    if system is not None and (viewed.rules is None or viewed.rule_names):
        unaudited = [
            (k, rule_text(rule))
            for k, rule in enumerate(system.rules, 1)
            if k not in known
        ]
    return part(
        "rules",
        head,
        None if viewed.rules is None else rows,
        len(rules),
        [*_notes(viewed)],
        unaudited,
        len(system.rules) if system else 0,
    )


def _notes(viewed: AuditView) -> Iterator[tuple[str, str]]:
    """Yield what a reader must know of the rules, each with its look."""
    system, rules = viewed.system, viewed.rules
    if rules is None:
        said = "None of the rules has an exact counterpart; the reasons are below"
        yield "left-out", said
    elif len(rules.rules) > MOST_RULES:
        more = counted(len(rules.rules) - MOST_RULES, "more rule")
        yield "left-out", f"{more} not shown"
    if system is None or (rules is not None and not viewed.rule_names):
        return
    if rules is not None:
        said = "These are the system's conditions as they are audited: one that says "
        yield "caption", f"{said}'or' is examined as several rules"
    weights = [
        f"rule {k} by {rule.weight!r}"
        for k, rule in enumerate(system.rules, 1)
        if k in viewed.numbers and rule.weight != 1.0
    ]
    if weights:
        said = "The strengths of these are multiplied by their weights: "
        yield "caption", said + ", ".join(weights[:MOST_RULES])


def _confidence(answer: AuditAnswer | None) -> str:
    state = answer.state if answer else None
    if not isinstance(state, Sampled) or "its class" not in state.of:
        return "-"  # a share of something else, such as of the rows that it wins
    shares = (state.hits / state.rows, state.low, state.high)
    return part("confidence", *map(percent, shares))
