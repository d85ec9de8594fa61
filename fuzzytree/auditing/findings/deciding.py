"""Questions about what each rule decides: does it ever win, by how much, or tie?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from typing import Final

from fuzzytree.auditing.engine.arrangement import Arrangement
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.duels import largest_lead, wins
from fuzzytree.auditing.engine.pivots import may_tie
from fuzzytree.auditing.engine.probes import RandomProbes
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    State,
    Witness,
    counted,
)
from fuzzytree.auditing.engine.ties import decides_by_order, tie
from fuzzytree.auditing.findings.bounded_arrangement import (
    BoundedArrangement,
    bounded_arrangement,
)
from fuzzytree.auditing.findings.codes import finding, note
from fuzzytree.auditing.findings.records import AuditAnswer, Measure, Severity
from fuzzytree.auditing.findings.subject import Subject, TimeSlices
from fuzzytree.model import BoolArray

MOST_SHOWN: Final = 20
"""The most ties that are listed one by one."""

_PART = 0.25  # of the time that is left, for one question
_APART = Proved("they share no curve, and no constant")


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether rules win, lead, are needed, and tie.

    Where every rule that fires takes part in the answer: whether it fires.
    """
    sides = bounded_arrangement(subject)
    arrangement = sides.lower
    if arrangement.is_empty:
        return
    if subject.policy.decision == "all":
        yield from _firing(subject, sides)
        return
    probes = RandomProbes(arrangement, subject.settings.seed)
    won: dict[int, Witness] = {}
    yield from _winning(subject, probes, won)
    yield from _leading(subject, probes, won)
    ties = _Ties(subject, arrangement)
    yield from _needed(subject, probes, ties)
    yield from ties.answers()


def _firing(subject: Subject, sides: BoundedArrangement) -> Iterator[AuditAnswer]:
    """Answer whether each rule fires; a rule of several ways, whether one of them."""
    ways: dict[str, list[int]] = {}
    for number in range(1, len(subject.rules.rules) + 1):
        ways.setdefault(subject.rule_name(number), []).append(number)
    for name, numbers in ways.items():
        states: list[State] = []
        for number in numbers:
            subject.clock.check()
            states.append(sides.firing(number, subject.clock.share(_PART)))
            if isinstance(states[-1], Witness):
                break
        state = next((s for s in states if not isinstance(s, Proved)), states[0])
        is_dead = isinstance(state, Proved)
        sentence = f"it is open whether {name} ever fires"
        if is_dead:
            sentence = f"{name} never fires: no value of the domain makes its condition"
            sentence += " hold"
        elif isinstance(state, Witness):
            sentence = f"{name} fires"
        rules = (numbers[0],)
        yield AuditAnswer("FT101", name, sentence, state, is_dead, "error", rules)


def _rivals(subject: Subject, number: int) -> tuple[int, ...]:
    """Return the rules of other classes."""
    label = subject.rules.rules[number - 1].then
    return tuple(
        other for other, rule in enumerate(subject.rules.rules, 1) if rule.then != label
    )


def _winning(
    subject: Subject, probes: RandomProbes, won: dict[int, Witness]
) -> Iterator[AuditAnswer]:
    """Answer whether each rule wins strictly; those that were not seen to win first."""
    arrangement = probes.base
    count = len(subject.rules.rules)
    slices = TimeSlices(subject.clock, 0.5)
    order = sorted(range(1, count + 1), key=probes.is_ahead)
    for place, number in enumerate(order):
        name = subject.rule_name(number)
        subject.clock.report(f"does {name} win", place / count)
        rivals = _rivals(subject, number)
        state = slices.run(count - place, partial(wins, arrangement, number, rivals))
        if not isinstance(state, Proved | Witness):
            state = probes.wins(number, rivals) or state
        if isinstance(state, Witness):
            won[number] = state
        if state is None:
            slices.left_out += 1
            continue
        # For the leaves of a tree see `fuzzytree.auditing.findings.leaves`.
        if subject.tree is None:
            yield _won(subject, arrangement, number, state)
        if not isinstance(state, Proved | Witness):
            sentence = f"how far {name} leads is open, for it is open whether it wins"
            yield note("FT102", name, sentence, state, rules=(number,))
    yield from slices.rest("FT101", "rule", "whether they ever win")
    # Only rules that are known to win have a lead.
    yield from slices.rest("FT102", "rule", "how far they lead")


def _leading(
    subject: Subject, probes: RandomProbes, won: dict[int, Witness]
) -> Iterator[AuditAnswer]:
    """Answer whether each rule that wins leads by enough."""
    slices = TimeSlices(subject.clock, 0.5)
    for place, (number, state) in enumerate(sorted(won.items())):
        name = subject.rule_name(number)
        subject.clock.report(f"how far does {name} lead", place / len(won))
        rivals = _rivals(subject, number)
        start = probes.wins(number, rivals) or state
        answer = slices.run(
            len(won) - place,
            partial(_led, subject, probes.base, number, rivals, (state, start)),
        )
        if answer is None:
            slices.left_out += 1
            continue
        yield answer
    yield from slices.rest("FT102", "rule", "how far they lead")


def _won(
    subject: Subject, arrangement: Arrangement, number: int, state: State
) -> AuditAnswer:
    name = subject.rule_name(number)
    if isinstance(state, Witness):
        sentence = f"{name} wins somewhere"
        return note(
            "FT101", name, sentence, state, rules=(number,), region=state.region
        )
    if not isinstance(state, Proved):
        sentence = f"it is open whether {name} ever wins"
        return note("FT101", name, sentence, state, rules=(number,))
    rivals = _rivals(subject, number)
    order = decides_by_order(
        arrangement,
        number,
        [n for n in rivals if n < number],
        [n for n in rivals if n > number],
        subject.clock.share(_PART),
    )
    if isinstance(order, Witness):
        sentence = (
            f"{name} decides by its place in the list alone: where it is strongest, a "
            "rule of another class further down is exactly as strong"
        )
        return AuditAnswer(
            "FT101", name, sentence, order, True, severity="warning", rules=(number,)
        )
    fires = wins(arrangement, number, (), subject.clock.share(_PART))
    if isinstance(fires, Proved):
        sentence = f"{name} never fires on the domain"
        return finding("FT101", name, sentence, fires, rules=(number,))
    sentence = (
        f"{name} never wins: wherever it fires, a rule of another class is at least "
        "as strong"
    )
    severity: Severity = "error"
    if not isinstance(order, Proved):
        sentence += "; whether it decides by its place in the list is open"
        severity = "warning"
    return AuditAnswer(
        "FT101", name, sentence, state, True, severity=severity, rules=(number,)
    )


def _led(
    subject: Subject,
    arrangement: Arrangement,
    number: int,
    rivals: tuple[int, ...],
    known: tuple[Witness, Witness],
    clock: Clock,
) -> AuditAnswer:
    """Return the answer for a rule of which two points are known at which it wins."""
    name = subject.rule_name(number)
    won, start = known
    enough = Fraction(subject.settings.lead)
    bracket = largest_lead(arrangement, number, rivals, start, enough, clock)
    measures = (
        Measure("largest lead, at least", bracket.low),
        Measure("largest lead, at most", bracket.high),
    )
    if bracket.low >= subject.settings.lead:
        state = Witness(bracket.point, bracket.claims)
        sentence = f"{name} leads by {bracket.low:.4g} at least somewhere"
        return note(
            "FT102", name, sentence, state, rules=(number,), measures=measures[:1]
        )
    lead, is_marginal = subject.settings.lead, bracket.high < subject.settings.lead
    sentence = f"{name} never leads by {lead:g}: at most by {bracket.high:.3g}"
    if not is_marginal:
        sentence = (
            f"no lead of {name} above {bracket.low:.3g} was found, and one above "
        )
        sentence += f"{bracket.high:.3g} is excluded"
    facts = "FT102", name, sentence, bracket
    rules, region = (number,), won.region
    return AuditAnswer(*facts, is_marginal, "warning", rules, (), region, measures)


class _Ties:
    """Which rules of different classes tie as the strongest; tests each pair once."""

    def __init__(self, subject: Subject, arrangement: Arrangement) -> None:
        self.subject, self.arrangement = subject, arrangement
        self.slices = TimeSlices(subject.clock, 0.9)
        self.known: dict[tuple[int, int], State] = {}
        self.may: BoolArray | None = None

    def of(self, one: int, other: int, left: int) -> State | None:
        """Return whether two rules tie, None if the time does not suffice."""
        pair = min(one, other), max(one, other)
        if pair in self.known:
            return self.known[pair]
        if self.may is None:
            self.may = self.slices.run(1, lambda _: may_tie(self.arrangement))
        if self.may is not None and not self.may[one - 1, other - 1]:
            return _APART
        state = self.slices.run(left, partial(tie, self.arrangement, *pair))
        if state is not None:
            self.known[pair] = state
        return state

    def answers(self) -> Iterator[AuditAnswer]:
        """Answer for pairs that tie one by one, for all others together."""
        rules = self.subject.rules.rules
        tie_count = 0
        left_open: list[State] = []
        untested = 0
        pairs = [
            (one, other)
            for one, other in itertools.combinations(range(1, len(rules) + 1), 2)
            if rules[one - 1].then != rules[other - 1].then
        ]
        for place, (one, other) in enumerate(pairs, 1):
            self.subject.clock.report("which rules tie", place / len(pairs))
            state = self.of(one, other, len(pairs) - place + 1)
            untested += state is None
            if isinstance(state, Declined | Bracket):
                left_open.append(state)
            if isinstance(state, Witness):
                tie_count += 1
                if tie_count <= MOST_SHOWN:
                    yield self._tied(one, other, state)
        if not pairs:
            return
        how = f"{len(pairs)} pairs of rules of different classes tested"
        measures = (
            Measure("pairs", len(pairs)),
            Measure("pairs that tie", tie_count),
            Measure("pairs listed", min(tie_count, MOST_SHOWN)),
            Measure("pairs left open", len(left_open) + untested),
        )
        sentence = (
            f"of {len(pairs)} pairs of rules of different classes, {tie_count} tie as "
            "the strongest on more than a surface"
        )
        state = left_open[0] if left_open else Proved(how)
        if untested:
            sentence += f"; {counted(untested, 'pair')} were not tested"
            state = Declined("FTD03", "the budget was spent")
        yield note("FT202", "pairs of rules", sentence, state, measures=measures)

    def _tied(self, one: int, other: int, state: Witness) -> AuditAnswer:
        first, second = self.subject.rule_name(one), self.subject.rule_name(other)
        sentence = (
            f"{first} and {second} are equally strong, and the strongest, on more than "
            "a surface: the order of the rules alone decides there"
        )
        return finding(
            "FT202", f"{first} and {second}", sentence, state, rules=(one, other)
        )


def _needed(
    subject: Subject, probes: RandomProbes, ties: _Ties
) -> Iterator[AuditAnswer]:
    """Answer whether leaving out a rule changes a decision."""
    count = len(subject.rules.rules)
    if count == 1:
        return
    slices = TimeSlices(subject.clock, 0.5)
    for number in range(1, count + 1):
        name = subject.rule_name(number)
        subject.clock.report(f"is {name} needed", number / count)
        others = tuple(n for n in range(1, count + 1) if n != number)
        state = probes.wins_alone(number, others) or slices.run(
            count - number + 1, partial(wins, probes.base, number, others)
        )
        if state is None:
            slices.left_out += 1
            continue
        if isinstance(state, Witness):
            sentence = f"{name} is somewhere stronger than every other rule"
            yield note("FT103", name, sentence, state, rules=(number,))
            continue
        if not isinstance(state, Proved):
            sentence = f"it is open whether {name} is needed"
            yield note("FT103", name, sentence, state, rules=(number,))
            continue
        later = [n for n in _rivals(subject, number) if n > number]
        known = [ties.of(number, n, len(later)) for n in later]
        if None in known:
            slices.left_out += 1
            continue
        tied = [one for one in known if one and not isinstance(one, Proved)]
        if tied:
            sentence = (
                f"{name} is nowhere stronger than all others, and where it ties with "
                "another class it may decide by its place"
            )
            yield note("FT103", name, sentence, tied[0], rules=(number,))
            continue
        sentence = (
            f"{name} is superfluous: nowhere is it stronger than all other rules, and "
            "without it no decision changes"
            + (", but where strengths only touch" if later else "")
        )
        yield finding("FT103", name, sentence, state, rules=(number,))
    yield from slices.rest("FT103", "rule", "whether they are needed")
