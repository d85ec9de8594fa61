"""Questions about what each rule decides: does it ever win, by how much, or tie?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.records import Answer, Measure
from fuzzytree.auditing.sides import Sides, sides_of
from fuzzytree.auditing.subject import Subject
from fuzzytree.proving.ground import Ground
from fuzzytree.proving.leads import largest_lead
from fuzzytree.proving.states import (
    Bracket,
    Declined,
    Proved,
    State,
    Witness,
)
from fuzzytree.proving.ties import decides_by_order, tie
from fuzzytree.proving.wins import wins

MOST_SHOWN: Final = 20
"""The most ties that are told one by one."""

_PART = 0.25  # of the time that is left, for one question


def answers(subject: Subject) -> Iterator[Answer]:
    """Answer whether rules win, lead, are needed, and tie.

    Where every rule that fires takes part in the answer, it is asked whether it fires.
    """
    sides = sides_of(subject)
    given = sides.ground
    if given.is_empty:
        return
    if subject.policy.decision == "all":
        yield from _firing(subject, sides)
        return
    yield from _winning(subject, given)
    ties = _Ties(subject, given)
    yield from _needed(subject, given, ties)
    yield from ties.answers()


def _firing(subject: Subject, sides: Sides) -> Iterator[Answer]:
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
        sentence = (
            f"{name} never fires: no value of the domain makes its condition hold"
            if is_dead
            else f"{name} fires"
            if isinstance(state, Witness)
            else f"it is open whether {name} ever fires"
        )
        yield Answer(
            "FT101", name, sentence, state, is_dead, "error", rules=(numbers[0],)
        )


def _rivals(subject: Subject, number: int) -> tuple[int, ...]:
    """Return the rules of other classes."""
    label = subject.rules.rules[number - 1].then
    return tuple(
        other for other, rule in enumerate(subject.rules.rules, 1) if rule.then != label
    )


def _winning(subject: Subject, given: Ground) -> Iterator[Answer]:
    """Answer whether each rule wins strictly, and whether it leads by enough."""
    count = len(subject.rules.rules)
    for number in range(1, count + 1):
        subject.clock.check()
        name = subject.rule_name(number)
        subject.clock.tell(f"does {name} win", number / count)
        rivals = _rivals(subject, number)
        state = wins(given, number, rivals, subject.clock.share(_PART))
        # A tree's own cuts tell this of its leaves: `fuzzytree.auditing.trees`.
        if subject.tree is None:
            yield _won(subject, given, number, state)
        if isinstance(state, Witness):
            yield _led(subject, given, number, rivals, state)
        elif not isinstance(state, Proved):
            sentence = f"how far {name} leads is open, for it is open whether it wins"
            yield Answer("FT102", name, sentence, state, False, rules=(number,))


def _won(subject: Subject, given: Ground, number: int, state: State) -> Answer:
    name = subject.rule_name(number)
    if isinstance(state, Witness):
        sentence = f"{name} wins somewhere"
        return Answer(
            "FT101", name, sentence, state, False, rules=(number,), region=state.region
        )
    if not isinstance(state, Proved):
        sentence = f"it is open whether {name} ever wins"
        return Answer("FT101", name, sentence, state, False, rules=(number,))
    rivals = _rivals(subject, number)
    order = decides_by_order(
        given,
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
        return Answer("FT101", name, sentence, order, True, "warning", rules=(number,))
    fires = wins(given, number, (), subject.clock.share(_PART))
    if isinstance(fires, Proved):
        sentence = f"{name} never fires on the domain"
        return Answer("FT101", name, sentence, fires, True, "error", rules=(number,))
    sentence = (
        f"{name} never wins: wherever it fires, a rule of another class is at least "
        "as strong"
    )
    return Answer("FT101", name, sentence, state, True, "error", rules=(number,))


def _led(
    subject: Subject, given: Ground, number: int, rivals: tuple[int, ...], won: Witness
) -> Answer:
    name = subject.rule_name(number)
    enough = Fraction(subject.settings.lead)
    found = largest_lead(given, number, rivals, won, enough, subject.clock.share(_PART))
    measures = (
        Measure("largest lead, at least", found.low),
        Measure("largest lead, at most", found.high),
    )
    if found.low >= subject.settings.lead:
        state = Witness(found.point, found.claims)
        sentence = f"{name} leads by {found.low:.4g} at least somewhere"
        return Answer(
            "FT102",
            name,
            sentence,
            state,
            False,
            rules=(number,),
            measures=measures[:1],
        )
    is_marginal = found.high < subject.settings.lead
    sentence = (
        f"{name} never leads by {subject.settings.lead:g}: at most by {found.high:.3g}"
        if is_marginal
        else f"no lead of {name} above {found.low:.3g} was found, and one above "
        f"{found.high:.3g} is excluded"
    )
    return Answer(
        "FT102", name, sentence, found, is_marginal, "warning",
        rules=(number,), region=won.region, measures=measures,
    )  # fmt: skip


class _Ties:
    """Which rules of different classes tie as the strongest; each pair asked once."""

    def __init__(self, subject: Subject, given: Ground) -> None:
        self.subject, self.given = subject, given
        self.known: dict[tuple[int, int], State] = {}

    def of(self, one: int, other: int) -> State:
        pair = min(one, other), max(one, other)
        if pair not in self.known:
            self.subject.clock.check()
            self.known[pair] = tie(self.given, *pair, self.subject.clock.share(_PART))
        return self.known[pair]

    def answers(self) -> Iterator[Answer]:
        """Answer for pairs that tie one by one, for all others together."""
        rules = self.subject.rules.rules
        told = 0
        left_open: list[State] = []
        pairs = [
            (one, other)
            for one, other in itertools.combinations(range(1, len(rules) + 1), 2)
            if rules[one - 1].then != rules[other - 1].then
        ]
        for place, (one, other) in enumerate(pairs, 1):
            self.subject.clock.tell("which rules tie", place / len(pairs))
            state = self.of(one, other)
            if isinstance(state, Declined | Bracket):
                left_open.append(state)
            if isinstance(state, Witness):
                told += 1
                if told <= MOST_SHOWN:
                    yield self._tied(one, other, state)
        if not pairs:
            return
        how = f"{len(pairs)} pairs of rules of different classes asked"
        measures = (
            Measure("pairs", len(pairs)),
            Measure("pairs that tie", told),
            Measure("pairs told one by one", min(told, MOST_SHOWN)),
            Measure("pairs left open", len(left_open)),
        )
        sentence = (
            f"of {len(pairs)} pairs of rules of different classes, {told} tie as the "
            "strongest on more than a surface"
        )
        state = left_open[0] if left_open else Proved(how)
        yield Answer(
            "FT202", "pairs of rules", sentence, state, False, measures=measures
        )

    def _tied(self, one: int, other: int, state: Witness) -> Answer:
        first, second = self.subject.rule_name(one), self.subject.rule_name(other)
        sentence = (
            f"{first} and {second} are equally strong, and the strongest, on more than "
            "a surface: the order of the rules alone decides there"
        )
        return Answer(
            "FT202", f"{first} and {second}", sentence, state, True, "warning",
            rules=(one, other),
        )  # fmt: skip


def _needed(subject: Subject, given: Ground, ties: _Ties) -> Iterator[Answer]:
    """Answer whether leaving out a rule changes a decision."""
    rules = subject.rules.rules
    count = len(rules)
    for number in range(1, count + 1):
        subject.clock.check()
        name = subject.rule_name(number)
        subject.clock.tell(f"is {name} needed", number / count)
        others = tuple(n for n in range(1, count + 1) if n != number)
        if not others:
            return
        state = wins(given, number, others, subject.clock.share(_PART))
        if isinstance(state, Witness):
            sentence = f"{name} is somewhere stronger than every other rule"
            yield Answer("FT103", name, sentence, state, False, rules=(number,))
            continue
        if not isinstance(state, Proved):
            sentence = f"it is open whether {name} is needed"
            yield Answer("FT103", name, sentence, state, False, rules=(number,))
            continue
        later = [n for n in _rivals(subject, number) if n > number]
        tied = [s for n in later if not isinstance(s := ties.of(number, n), Proved)]
        if tied:
            sentence = (
                f"{name} is nowhere stronger than all others, and where it ties with "
                "another class it may decide by its place"
            )
            yield Answer("FT103", name, sentence, tied[0], False, rules=(number,))
            continue
        sentence = (
            f"{name} is superfluous: nowhere is it stronger than all other rules, and "
            "without it no decision changes"
            + (", but where strengths only touch" if later else "")
        )
        yield Answer("FT103", name, sentence, state, True, "info", rules=(number,))
