"""What is said otherwise in a new rule base: by identity, and not by order."""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence

from fuzzytree.auditing.diff.drafting import Draft, Shown
from fuzzytree.auditing.diff.matching import (
    Curves,
    Match,
    Matching,
    Said,
    matching,
    words_of,
)
from fuzzytree.auditing.diff.structure_terms import set_drafts, variable_drafts
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.states import answer_text, listed
from fuzzytree.model.rulebase import Path, Rule, RuleBase, clause_text, sentence
from fuzzytree.model.tree import FuzzyTree


def drafts(
    old: RuleBase,
    new: RuleBase,
    domain: Domain,
    trees: tuple[FuzzyTree, FuzzyTree] | None = None,
) -> Iterator[Draft]:
    """Yield what a new rule base says otherwise than an old one.

    Args:
        old: The old rules.
        new: The new rules.
        domain: Where curves are compared; a side for each input of either.
        trees: The trees that the rules come from, if both are trees.
    """
    curves = Curves()
    names = _renamed_classes(old, new, curves)
    yield from _class_drafts(old, new, names)
    yield from _answer_drafts(old, new, names)
    found = matching(Said(old, curves, names), Said(new, curves))
    yield from _rule_drafts(old, new, found, curves, names)
    yield from variable_drafts(old, new, curves, domain)
    if trees is not None:
        yield from set_drafts(*trees, curves)
    yield from _head_drafts(old, new, found)


def _head_drafts(old: RuleBase, new: RuleBase, found: Matching) -> Iterator[Draft]:
    if old.name != new.name:
        yield Draft(
            "name",
            f"the model {old.name!r} is called {new.name!r}",
            "never",
            ("name",),
            ("name",),
            is_harmless=True,
        )
    if old.columns != new.columns:
        yield Draft(
            "columns",
            "the columns of the training table are "
            f"{listed(new.columns)}, and were {listed(old.columns)}",
            "never",
            ("columns",),
            ("columns",),
        )
    if old.inputs != new.inputs and sorted(old.inputs) == sorted(new.inputs):
        yield Draft(
            "input",
            f"the inputs stand in another order: {listed(new.inputs)}",
            "never",
            ("variables",),
            ("variables",),
        )
    moved = [
        (match.old, match.new)
        for match in found.matches
        if old.rules[match.old - 1].support != new.rules[match.new - 1].support
    ]
    if moved:
        rules = "1 rule is" if len(moved) == 1 else f"{len(moved)} rules are"
        yield Draft(
            "support",
            f"{rules} supported by another number of rows",
            "never",
            old_rules=tuple(one for one, _ in moved),
            new_rules=tuple(other for _, other in moved),
            is_harmless=True,
        )


# --- classes and answers


def _renamed_classes(old: RuleBase, new: RuleBase, curves: Curves) -> dict[str, str]:
    """Return which classes are called otherwise: their rules ask the same."""
    gone = [label for label in old.classes if label not in new.classes]
    come = [label for label in new.classes if label not in old.classes]
    if not gone or not come:
        return {}
    one, other = Said(old, curves), Said(new, curves)
    asked = {
        label: {other.asked(rule) for rule in new.rules if rule.then == label}
        for label in come
    }
    found: dict[str, str] = {}
    for label in gone:
        mine = {one.asked(rule) for rule in old.rules if rule.then == label}
        match = next((k for k in come if mine and asked[k] == mine), None)
        if match is not None and match not in found.values():
            found[label] = match
    return found


def _class_drafts(
    old: RuleBase, new: RuleBase, names: Mapping[str, str]
) -> Iterator[Draft]:
    here: tuple[Path, Path] = (("classes",), ("classes",))
    for label, other in names.items():
        text = f"the class {label!r} is called {other!r}"
        yield Draft("class", text, "always", *here)
    for label in old.classes:
        if label not in new.classes and label not in names:
            yield Draft("class", f"the class {label!r} was removed", "always", *here)
    for label in new.classes:
        if label not in old.classes and label not in names.values():
            yield Draft("class", f"the class {label!r} was added", "always", *here)
    if old.classes != new.classes and sorted(old.classes) == sorted(new.classes):
        text = f"the classes have other numbers: {listed(new.classes)}"
        yield Draft("class", text, "never", *here)


def _answer_drafts(
    old: RuleBase, new: RuleBase, names: Mapping[str, str]
) -> Iterator[Draft]:
    one, other = old.semantics, new.semantics
    asked: tuple[tuple[str, str, Shown], ...] = (
        ("uncovered", "where no rule fires", "uncovered"),
        ("missing", "where a value is missing", "always"),
    )
    for field, where, shown in asked:
        was: str | None = getattr(one, field)
        now: str | None = getattr(other, field)
        if (names.get(was, was) if was is not None else None) != now:
            text = f"the answer {where} is {answer_text(now)}"
            text += f", and was {answer_text(was)}"
            path = ("semantics", field)
            yield Draft("answer", text, shown, path, path)
    if one.label_type != other.label_type:
        text = f"the label type is {other.label_type or 'text'}"
        text += f", and was {one.label_type or 'text'}"
        yield Draft("class", text, "never", ("semantics",), ("semantics",))
    if one.conjunction != other.conjunction:
        text = f"the AND of rules is {other.conjunction}, and was {one.conjunction}"
        path = ("semantics", "conjunction")
        yield Draft("answer", text, "any", path, path)


# --- rules


def _rule_drafts(
    old: RuleBase,
    new: RuleBase,
    found: Matching,
    curves: Curves,
    names: Mapping[str, str],
) -> Iterator[Draft]:
    one, other = Said(old, curves, names), Said(new, curves)
    for match in found.matches:
        yield from _changed_rule(match, one, other)
    for number in found.removed:
        text = f"rule {number} was removed: {sentence(old.rules[number - 1])}"
        path = ("rules", number - 1)
        yield Draft("rule", text, "rules", path, None, (number,))
    for number in found.added:
        text = f"rule {number} is new: {sentence(new.rules[number - 1])}"
        path = ("rules", number - 1)
        yield Draft("rule", text, "rules", None, path, (), (number,))
    if found.left:
        text = f"{found.left} rules are too many to be matched with each other"
        yield Draft("rule", text, "never", is_harmless=True)
    yield from _order_drafts(found.matches)


def _changed_rule(match: Match, one: Said, other: Said) -> Iterator[Draft]:
    if match.how in ("same", "curves"):
        return  # what the curves do is told of the terms
    was, now = one.rules[match.old - 1], other.rules[match.new - 1]
    texts = [*_clause_texts(was, now, one, other)]
    if one.then(was) != now.then:
        texts.append(f"its class is {now.then!r}, and was {was.then!r}")
    numbered = f"rule {match.old}"
    if match.old != match.new:
        numbered += f" (now {match.new})"
    yield Draft(
        "rule",
        f"{numbered} has changed: {'; '.join(texts)}",
        "rules",
        ("rules", match.old - 1),
        ("rules", match.new - 1),
        (match.old,),
        (match.new,),
    )


def _clause_texts(was: Rule, now: Rule, one: Said, other: Said) -> Iterator[str]:
    """Yield which clauses a rule has lost and gained."""
    asked, read = {other.clause(c) for c in now.when}, {words_of(c) for c in now.when}
    gone = [c for c in was.when if one.clause(c) not in asked]
    gone = [c for c in gone if words_of(c) not in read]
    known, told = {one.clause(c) for c in was.when}, {words_of(c) for c in was.when}
    come = [c for c in now.when if other.clause(c) not in known]
    come = [c for c in come if words_of(c) not in told]
    for clause in gone:
        match = next((c for c in come if c.variable == clause.variable), None)
        if match is None:
            yield f"it no longer asks {clause_text(clause)!r}"
        else:
            come.remove(match)
            yield f"it asks {clause_text(match)!r} in place of {clause_text(clause)!r}"
    for clause in come:
        yield f"it asks {clause_text(clause)!r} as well"


def _order_drafts(matches: Sequence[Match]) -> Iterator[Draft]:
    """Yield that rules stand in another order, told by those that were overtaken."""
    moved = [(a, b) for (a, b) in itertools.pairwise(matches) if b.new < a.new]
    if moved:
        kept = _longest_run([match.new for match in matches])
        count = len(matches) - kept
        rules = "1 rule stands" if count == 1 else f"{count} rules stand"
        yield Draft(
            "order",
            f"{rules} at another place among the others, which matters where two "
            "are equally strong",
            "ties",
            ("rules",),
            ("rules",),
        )


def _longest_run(numbers: Sequence[int]) -> int:
    """Return how many numbers of a list can stay where they are: its longest rise."""
    ends: list[int] = []
    for number in numbers:
        place = bisect_left(ends, number)
        ends[place : place + 1] = [number]
    return len(ends)
