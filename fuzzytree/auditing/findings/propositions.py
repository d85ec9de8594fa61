"""Is a proposition needed? It is if some input is classified differently without it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

from fuzzytree.auditing.decide import Answer, BaseRule, Point
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.claims import Claims
from fuzzytree.auditing.decide.states import (
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    FactValue,
    Measure,
    TermName,
)
from fuzzytree.auditing.findings.subject import Subject, state_of
from fuzzytree.model import Proposition, proposition_text

MOST_SHOWN: Final = 100
"""The most propositions that matter that are listed one by one."""


class _Shorter(NamedTuple):
    """A rule without one of its propositions; the rule by its position."""

    place: int
    proposition: Proposition
    rule: BaseRule


def proposition_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer for each proposition whether some decision changes without it."""
    every = [*_shorter(subject)]
    if not every:
        return
    base = subject.base.with_rules(one.rule for one in every)
    claims = Claims(base, subject.policy.uncovered)
    silent = {
        place
        for place in range(subject.base.count)
        if isinstance(subject.claims.fires(place, subject.budget), NoPoint)
    }
    needed = 0
    for number, one in enumerate(every, subject.base.count):
        if one.place in silent:
            continue
        share = (number - subject.base.count) / len(every)
        subject.budget.report("irrelevant proposition", share)
        answer = claims.changes(
            number,
            one.place,
            (one.place, *subject.claims.same(one.place)),
            subject.claims.others(one.place),
            subject.budget,
        )
        if isinstance(answer, Point):
            needed += 1
            if needed > MOST_SHOWN:
                continue
        yield _answer(subject, one, answer)
    for place in sorted(silent):
        name = subject.rule_name(place + 1)
        proof = Proved("one of its propositions is 0 on all of the domain")
        yield audit_answer("FT107.silent", name, proof, rules=(place + 1,))
    if needed > MOST_SHOWN:
        proof = Proved("an input was found for each, and evaluated in fractions")
        measures = (Measure("propositions", needed - MOST_SHOWN),)
        yield audit_answer("FT107.more", "propositions", proof, measures=measures)


def _shorter(subject: Subject) -> Iterator[_Shorter]:
    """Yield the propositions; of relative rules those where only one class is left.

    Below a node of several classes a rule that is shortened ties with all of them.
    """
    rules = subject.rules
    classes: dict[tuple[Proposition, ...], set[str]] = {}
    for rule in rules.rules:
        for at in range(len(rule.when)):
            classes.setdefault(rule.when[:at], set()).add(rule.then)
    for place, rule in enumerate(rules.rules):
        whole = subject.base.rules[place]
        for at, proposition in enumerate(rule.when):
            if rules.kind == "relative" and len(classes[rule.when[:at]]) > 1:
                continue
            literals = (*whole.literals[:at], *whole.literals[at + 1 :])
            norm = whole.norm if len(literals) > 1 else "minimum"
            rest = whole._replace(literals=literals, norm=norm)
            yield _Shorter(place, proposition, rest)


def _answer(subject: Subject, one: _Shorter, answer: Answer) -> AuditAnswer:
    name = subject.rule_name(one.place + 1)
    text, then = proposition_text(one.proposition), one.rule.then
    facts: dict[str, FactValue] = {"rule": name, "proposition": text}
    if isinstance(answer, Point):
        before = subject.class_at(answer.values)
        claim = Claim("decides", label=before)
        state: State = Witness(coordinates(answer.values), (claim,))
        message, facts = "FT107.needed", {**facts, "before": before, "then": then}
    else:
        state = state_of(answer)
        is_proof = isinstance(answer, NoPoint)
        message = "FT107.irrelevant" if is_proof else "FT107.open"
    return audit_answer(
        message,
        f"{name}, {text!r}",
        state,
        rules=(one.place + 1,),
        terms=tuple(
            TermName(one.proposition.variable, term) for term in one.proposition.terms
        ),
        facts=facts,
    )
