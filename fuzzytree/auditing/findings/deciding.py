"""Questions about what each rule decides: does it ever win, by how much, or tie?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from typing import Final

from fuzzytree.auditing.engine.arrangement import Arrangement
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.probes import RandomProbes
from fuzzytree.auditing.engine.questions import (
    decides_by_order,
    largest_lead,
    may_tie,
    tie,
    wins,
)
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    State,
    Witness,
)
from fuzzytree.auditing.findings.bounded_arrangement import (
    BoundedArrangement,
    bounded_arrangement,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
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
        message = "FT101.fires-open"
        if isinstance(state, Proved):
            message = "FT101.never-fires"
        elif isinstance(state, Witness):
            message = "FT101.fires"
        yield audit_answer(message, name, state, rules=(numbers[0],))


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
            yield audit_answer("FT102.open", name, state, rules=(number,))
    yield from slices.rest("FT101", "rule")
    # Only rules that are known to win have a lead.
    yield from slices.rest("FT102", "rule")


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
    yield from slices.rest("FT102", "rule")


def _won(
    subject: Subject, arrangement: Arrangement, number: int, state: State
) -> AuditAnswer:
    name, rules = subject.rule_name(number), (number,)
    if isinstance(state, Witness):
        region = state.region
        return audit_answer("FT101.wins", name, state, rules=rules, region=region)
    if not isinstance(state, Proved):
        return audit_answer("FT101.open", name, state, rules=rules)
    rivals = _rivals(subject, number)
    order = decides_by_order(
        arrangement,
        number,
        [n for n in rivals if n < number],
        [n for n in rivals if n > number],
        subject.clock.share(_PART),
    )
    if isinstance(order, Witness):
        return audit_answer("FT101.decides-by-place", name, order, rules=rules)
    fires = wins(arrangement, number, (), subject.clock.share(_PART))
    if isinstance(fires, Proved):
        return audit_answer("FT101.never-fires", name, fires, rules=rules)
    is_last = isinstance(order, Proved)
    message = "FT101.never-wins" if is_last else "FT101.may-decide-by-place"
    return audit_answer(message, name, state, rules=rules)


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
    lead, rules = subject.settings.lead, (number,)
    if bracket.low >= lead:
        state = Witness(bracket.point, bracket.claims)
        return audit_answer(
            "FT102.leads", name, state, rules=rules, measures=measures[:1]
        )
    return audit_answer(
        "FT102.marginal" if bracket.high < lead else "FT102.between",
        name,
        bracket,
        rules=rules,
        region=won.region,
        measures=measures,
        facts={"lead": lead},
    )


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
        state = left_open[0] if left_open else Proved(how)
        if untested:
            state = Declined("FTD03", "the budget was spent")
        yield audit_answer(
            "FT202.others",
            "pairs of rules",
            state,
            measures=measures,
            facts={"untested": untested} if untested else {},
        )

    def _tied(self, one: int, other: int, state: Witness) -> AuditAnswer:
        first, second = self.subject.rule_name(one), self.subject.rule_name(other)
        both = f"{first} and {second}"
        return audit_answer("FT202.tie", both, state, rules=(one, other))


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
        if not isinstance(state, Proved):
            message = "FT103.alone" if isinstance(state, Witness) else "FT103.open"
            yield audit_answer(message, name, state, rules=(number,))
            continue
        later = [n for n in _rivals(subject, number) if n > number]
        known = [ties.of(number, n, len(later)) for n in later]
        if None in known:
            slices.left_out += 1
            continue
        tied = [one for one in known if one and not isinstance(one, Proved)]
        if tied:
            state = next((one for one in tied if isinstance(one, Witness)), tied[0])
            message = "FT103.by-place" if isinstance(state, Witness) else "FT103.open"
            yield audit_answer(message, name, state, rules=(number,))
            continue
        facts = {"later": len(later)} if later else {}
        yield audit_answer(
            "FT103.superfluous", name, state, rules=(number,), facts=facts
        )
    yield from slices.rest("FT103", "rule")
