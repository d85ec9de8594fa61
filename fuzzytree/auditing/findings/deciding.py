"""Questions about what each rule decides: does it ever win, by how much, or tie?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.decide import Answer, Open, Point
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import Subject, state_of
from fuzzytree.numerics import outwards

MOST_SHOWN: Final = 20
"""The most ties that are listed one by one."""


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether rules win, lead, are needed, and tie.

    Where every rule that fires takes part in the answer: whether it fires.
    """
    if subject.base.is_empty:
        return
    if subject.policy.decision == "all":
        yield from _firing(subject)
        return
    yield from _winning(subject)
    yield from _needed(subject)
    yield from _ties(subject)


def _firing(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether each rule fires; a rule of several ways, whether one of them."""
    ways: dict[str, list[int]] = {}
    for place in range(subject.base.count):
        ways.setdefault(subject.rule_name(place + 1), []).append(place)
    for name, places in ways.items():
        results: list[Answer] = []
        for place in places:
            results.append(subject.claims.fires(place, subject.budget))
            if isinstance(results[-1], Point):
                break
        last, rules = results[-1], (places[0] + 1,)
        if isinstance(last, Point):
            claims = _beats(subject, last, places[len(results) - 1], ())
            state = Witness(coordinates(last.values), claims)
            yield audit_answer("FT101.fires", name, state, rules=rules)
            continue
        answer = next((one for one in results if isinstance(one, Open)), last)
        message = "fires-open" if isinstance(answer, Open) else "never-fires"
        yield audit_answer(f"FT101.{message}", name, state_of(answer), rules=rules)


def _winning(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether each rule wins, and if it does whether by enough."""
    claims, budget, count = subject.claims, subject.budget, subject.base.count
    for place in range(count):
        name, rules = subject.rule_name(place + 1), (place + 1,)
        budget.report(f"does {name} win", 0.5 * place / count)
        answer = claims.wins(place, budget)
        if subject.tree is None:  # for leaves see `fuzzytree.auditing.findings.leaves`
            yield _won(subject, place, answer)
        if isinstance(answer, Point):
            yield _led(subject, place)
        elif isinstance(answer, Open):
            yield audit_answer("FT102.open", name, state_of(answer), rules=rules)


def _won(subject: Subject, place: int, answer: Answer) -> AuditAnswer:
    claims, budget = subject.claims, subject.budget
    name, rules = subject.rule_name(place + 1), (place + 1,)
    rivals = claims.others(place)
    if isinstance(answer, Point):
        facts = _beats(subject, answer, place, rivals)
        state: State = Witness(coordinates(answer.values), facts)
        return audit_answer("FT101.wins", name, state, rules=rules)
    state = state_of(answer)
    if isinstance(answer, Open):
        return audit_answer("FT101.open", name, state, rules=rules)
    order = claims.decides(place, budget)
    if isinstance(order, Point):
        tie = _tie(subject, order, place, [place, *rivals])
        return audit_answer("FT101.decides-by-place", name, tie, rules=rules)
    fires = claims.fires(place, budget)
    if isinstance(fires, NoPoint):
        return audit_answer("FT101.never-fires", name, state_of(fires), rules=rules)
    message = "may-decide-by-place" if isinstance(order, Open) else "never-wins"
    return audit_answer(f"FT101.{message}", name, state, rules=rules)


def _beats(
    subject: Subject, point: Point, place: int, rivals: Sequence[int]
) -> tuple[Claim, ...]:
    """Return that a rule is stronger than others at a point, and how strong it is."""
    low, high = subject.base.strengths(point.values, (place,))
    others = tuple(j + 1 for j in rivals)
    claims = (Claim("beats", rules=(place + 1,), rivals=others),)
    if low != high:
        return claims
    return (Claim("strength", rules=(place + 1,), level=str(low[place])), *claims)


def _tie(subject: Subject, point: Point, place: int, every: Sequence[int]) -> Witness:
    """Return the rules that are as strong as one of them, and the strongest."""
    low, _ = subject.base.strengths(point.values, every)
    equal = tuple(j + 1 for j in sorted(every) if low[j] == low[place])
    others = tuple(j + 1 for j in sorted(every) if low[j] != low[place])
    claims = (
        Claim("strength", rules=(place + 1,), level=str(low[place])),
        Claim("ties", rules=equal, rivals=others),
    )
    return Witness(coordinates(point.values), claims)


def _led(subject: Subject, place: int) -> AuditAnswer:
    """Return by how much a rule leads that is known to win."""
    name, rules = subject.rule_name(place + 1), (place + 1,)
    lead = subject.settings.lead
    known = subject.claims.lead(place, Fraction(lead), subject.budget)
    low, high = outwards(known.low)[0], outwards(known.high)[1]
    points = {} if known.point is None else known.point.values
    claims: tuple[Claim, ...] = ()
    if known.point is not None:
        rivals = subject.claims.others(place)
        claims = _beats(subject, known.point, place, rivals)
    measures = (
        Measure("largest lead, at least", low),
        Measure("largest lead, at most", high),
    )
    if known.low >= Fraction(lead):
        state: State = Witness(coordinates(points), claims)
        leads = (Measure("largest lead, at least", max(low, lead)),)
        return audit_answer("FT102.leads", name, state, rules=rules, measures=leads)
    why = "the budget was spent" if known.is_open else "halved until it is narrow"
    of = f"the largest lead of {name}"
    state = Bracket(of, low, high, why, coordinates(points), claims)
    return audit_answer(
        "FT102.between" if known.is_open else "FT102.marginal",
        name,
        state,
        rules=rules,
        measures=measures,
        facts={"lead": lead},
    )


def _needed(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether leaving out a rule changes a decision."""
    claims, base = subject.claims, subject.base
    for place in range(base.count if base.count > 1 else 0):
        name, rules = subject.rule_name(place + 1), (place + 1,)
        subject.budget.report(f"is {name} needed", 0.5 + 0.3 * place / base.count)
        answer = claims.needed(place, subject.budget)
        if isinstance(answer, Point):
            before = base.rules[place].then
            after = subject.class_at(answer.values, place)
            claim = Claim("decides", label=before)
            state: State = Witness(coordinates(answer.values), (claim,))
            facts = {"before": before, "then": after}
            yield audit_answer("FT103.needed", name, state, rules=rules, facts=facts)
            continue
        message = "open" if isinstance(answer, Open) else "superfluous"
        yield audit_answer(f"FT103.{message}", name, state_of(answer), rules=rules)


def _ties(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer for pairs that tie one by one, for all others together."""
    base, every = subject.base, range(subject.base.count)
    pairs = [
        (one, other)
        for one, other in itertools.combinations(every, 2)
        if base.rules[one].then != base.rules[other].then
    ]
    ties, left = 0, list[Open]()
    for place, (one, other) in enumerate(pairs):
        if not place % 100:
            subject.budget.report("which rules tie", 0.8 + 0.2 * place / len(pairs))
        answer = subject.pairs.tie(one, other, subject.budget)
        if isinstance(answer, Open):
            left.append(answer)
        elif isinstance(answer, Point):
            ties += 1
            if ties <= MOST_SHOWN:
                names = subject.rule_name(one + 1), subject.rule_name(other + 1)
                yield audit_answer(
                    "FT202.tie",
                    " and ".join(names),
                    _tie(subject, answer, one, every),
                    rules=(one + 1, other + 1),
                )
    if not pairs:
        return
    measures = (
        Measure("pairs", len(pairs)),
        Measure("pairs that tie", ties),
        Measure("pairs listed", min(ties, MOST_SHOWN)),
        Measure("pairs left open", len(left)),
    )
    state = Proved(f"{len(pairs)} pairs of rules of different classes tested")
    spent = [one for one in left if one.code == "FTD03"]
    yield audit_answer(
        "FT202.others",
        "pairs of rules",
        state_of((spent or left)[0]) if left else state,
        measures=measures,
        facts={"untested": len(spent)} if spent else {},
    )
