"""Is a proposition needed? It is if some input is classified differently without it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import (
    Arrangement,
    arrange,
    prediction_at,
    rule_strengths,
)
from fuzzytree.auditing.engine.compared import RulePairs
from fuzzytree.auditing.engine.equivalence import equivalence
from fuzzytree.auditing.engine.states import (
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    FactValue,
    Measure,
    TermName,
)
from fuzzytree.auditing.findings.subject import Subject, TimeSlices
from fuzzytree.auditing.findings.support import sample_points
from fuzzytree.model import (
    FloatArray,
    IntArray,
    Proposition,
    Rule,
    RuleBase,
    proposition_text,
)
from fuzzytree.numerics import decide

MOST_ROWS: Final = 4096
"""The most rows that are drawn to find an input where a proposition matters."""

MOST_SHOWN: Final = 100
"""The most propositions that matter that are listed one by one."""

_MOST_STRENGTHS = 1 << 24  # of all rules with and without each proposition, at all rows
_MOST_BOXES = 500  # for one proposition; proofs took 50
_MOST_TRIED = 4  # rows that are evaluated in fractions for one proposition


class _Dropped(NamedTuple):
    """A proposition, the number of its rule, and the rule without it."""

    rule: int
    proposition: Proposition
    shorter: Rule

    def of(self, rules: RuleBase) -> RuleBase:
        """Return the rule base without the proposition."""
        every = list(rules.rules)
        every[self.rule - 1] = self.shorter
        return replace(rules, rules=tuple(every))


def proposition_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer for each proposition whether some decision changes without it."""
    every = [*_dropped(subject.rules)]
    if not every:
        return
    both = replace(
        subject.rules,
        rules=(*subject.rules.rules, *(one.shorter for one in every)),
    )
    arrangement = arrange(both, subject.domain)
    compared = RulePairs(arrangement)
    sample = _Sample(subject, arrangement, both)
    count = len(subject.rules.rules)
    silent = [
        number for number in range(1, count + 1) if not compared.fires[number - 1]
    ]
    needed, slices = 0, TimeSlices(subject.clock, 0.9)
    for number, one in enumerate(every, count + 1):
        if one.rule in silent:
            continue
        subject.clock.check()
        subject.clock.report("irrelevant proposition", (number - count) / len(every))
        state = _state(subject, compared, sample, one, number, slices)
        if state is None:
            slices.left_out += 1
            continue
        if isinstance(state, Witness):
            needed += 1
            if needed > MOST_SHOWN:
                continue
        yield _answer(subject, one, state)
    yield from slices.rest("FT107", "proposition")
    for number in silent:
        name = subject.rule_name(number)
        proof = Proved("one of its propositions is 0 on all of the domain")
        yield audit_answer("FT107.silent", name, proof, rules=(number,))
    if needed > MOST_SHOWN:
        proof = Proved("an input was found for each, and evaluated in fractions")
        measures = (Measure("propositions", needed - MOST_SHOWN),)
        yield audit_answer("FT107.more", "propositions", proof, measures=measures)


def _dropped(rules: RuleBase) -> Iterator[_Dropped]:
    """Yield the propositions; of relative rules those where only one class is left.

    Below a node of several classes a rule that is shortened ties with all of them.
    """
    classes: dict[tuple[Proposition, ...], set[str]] = {}
    for rule in rules.rules:
        for place in range(len(rule.when)):
            classes.setdefault(rule.when[:place], set()).add(rule.then)
    for number, rule in enumerate(rules.rules, 1):
        for place, proposition in enumerate(rule.when):
            if rules.kind == "relative" and len(classes[rule.when[:place]]) > 1:
                continue
            rest = (*rule.when[:place], *rule.when[place + 1 :])
            yield _Dropped(number, proposition, replace(rule, when=rest))


def _state(
    subject: Subject,
    compared: RulePairs,
    sample: _Sample,
    one: _Dropped,
    number: int,
    slices: TimeSlices,
) -> State | None:
    left = len(compared.base.rules.rules) - number + 1
    if compared.never_weaker(one.rule, number) == "always":
        return Proved("the rule is as strong without it everywhere")
    by = _backed(subject, compared, one, number)
    if by is not None:
        return Proved(by)
    witness = sample.witness(one, number - 1)
    if witness is not None:
        return witness
    shorter = one.of(subject.rules)
    turn = partial(
        equivalence, subject.rules, shorter, subject.domain, most=_MOST_BOXES
    )
    state = slices.run(left, turn)
    if isinstance(state, Witness):
        point = point_of(state.point)
        return _witness(subject.rules, point)
    return state


def _backed(
    subject: Subject, compared: RulePairs, one: _Dropped, number: int
) -> str | None:
    """Return why the shorter rule never decides what another one does not."""
    rules = subject.rules.rules
    for other in range(1, len(rules) + 1):
        if other == one.rule:
            continue
        between = rules[min(other, one.rule) : max(other, one.rule) - 1]
        is_alike = rules[other - 1].then == one.shorter.then
        # Behind it a rule of the class counts only if none of another stands between.
        is_first = other < one.rule or (
            is_alike and all(rule.then == one.shorter.then for rule in between)
        )
        if is_first and compared.never_weaker(other, number) == "always":
            kind = "the same" if is_alike else "another"
            name = subject.rule_name(other)
            return f"{name} of {kind} class is as strong everywhere"
    return None


def _witness(rules: RuleBase, point: dict[str, Fraction]) -> Witness:
    """Return a point as a witness, with what the rules decide there."""
    label = prediction_at(rules, point).label
    return Witness(coordinates(point), (Claim("decides", label=label),))


class _Sample:
    """Rows of the domain, and the strengths of rules with and without propositions."""

    def __init__(
        self, subject: Subject, arrangement: Arrangement, both: RuleBase
    ) -> None:
        self.rules, self.arrangement = subject.rules, arrangement
        self.count = len(subject.rules.rules)
        most = min(MOST_ROWS, _MOST_STRENGTHS // len(both.rules))
        rows, seed = subject.settings.rows, subject.settings.seed
        self.values = sample_points(
            subject.rules, subject.domain, min(rows, most), seed
        )
        strengths = decide(both, self.values).strengths
        assert strengths is not None  # the default
        self.strengths: FloatArray = strengths
        numbers = {label: n for n, label in enumerate(subject.rules.classes)}
        self.classes: IntArray = np.array(
            [numbers[rule.then] for rule in subject.rules.rules]
        )
        uncovered = subject.rules.semantics.uncovered
        self.uncovered = -1 if uncovered is None else numbers[uncovered]
        whole = self.strengths[: self.count]
        self.best, self.first = whole.max(axis=0), whole.argmax(axis=0)
        winners = self.classes[self.first]
        self.labels = np.where(self.best > 0.0, winners, self.uncovered)
        self.known: dict[int, list[Fraction]] = {}

    def _point(self, row: int) -> dict[str, Fraction]:
        values = map(Fraction, self.values[:, row].tolist())
        return dict(zip(self.rules.inputs, values, strict=True))

    def _label(self, strengths: Sequence[Fraction]) -> str | None:
        best = max(strengths)
        if not best:
            return self.rules.semantics.uncovered
        return self.rules.rules[strengths.index(best)].then

    def witness(self, one: _Dropped, number: int) -> Witness | None:
        """Return a row whose class changes without a proposition, if there is one."""
        own, strengths = one.rule - 1, self.strengths[number]
        # A rule only gains without a proposition: it wins, or everything stays the
        # same.
        wins = (strengths > self.best) | ((strengths == self.best) & (own < self.first))
        is_other = self.labels != self.classes[own]
        rows = np.flatnonzero(wins & is_other & (strengths > 0.0))
        # The clearest first: those where the rule gains most.
        gain = strengths[rows] - self.strengths[own, rows]
        for row in rows[np.argsort(-gain, kind="stable")][:_MOST_TRIED].tolist():
            point = self._point(row)
            if not is_within(self.arrangement, point):
                continue
            if row not in self.known:
                self.known[row] = rule_strengths(self.rules, point)
            exact = [*self.known[row]]
            label = self._label(exact)
            (exact[own],) = rule_strengths(self.rules, point, [one.shorter])
            if self._label(exact) != label:
                return Witness(coordinates(point), (Claim("decides", label=label),))
        return None


def _answer(subject: Subject, one: _Dropped, state: State) -> AuditAnswer:
    name, text = subject.rule_name(one.rule), proposition_text(one.proposition)
    facts: dict[str, FactValue] = {"rule": name, "proposition": text}
    message = "FT107.irrelevant" if isinstance(state, Proved) else "FT107.open"
    if isinstance(state, Witness):
        message = "FT107.needed"
        facts |= {"before": state.claims[0].label, "then": one.shorter.then}
    return audit_answer(
        message,
        f"{name}, {text!r}",
        state,
        rules=(one.rule,),
        terms=tuple(
            TermName(one.proposition.variable, term) for term in one.proposition.terms
        ),
        facts=facts,
    )
