"""Questions about two rules: is one subsumed, masked, a duplicate, or in conflict?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.decide import Open
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.pairs import Common
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    State,
    Witness,
    coordinates,
    counted,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.propositions import proposition_answers
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.subject import Subject, state_of
from fuzzytree.model import BoolArray
from fuzzytree.numerics import outwards

NEARLY: Final = Fraction(1, 10**6)
"""Two antecedents are nearly the same if no degree differs by more than this."""

MOST_SHOWN: Final = 20
"""The most conflicts that are listed one by one."""

_CLOSE = 1e-9  # levels in doubles that are so near are compared in fractions

Pair = tuple[int, int]  # positions, from 0


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer what is to be said of pairs of rules, and of single propositions."""
    if subject.base.is_empty:
        return
    yield from _hidden(subject)
    yield from _copied(subject)
    if subject.rules.kind != "relative":
        yield from _conflicts(subject)
    if subject.policy.decision == "strongest":
        yield from proposition_answers(subject)


def _then(subject: Subject, place: int) -> str:
    return subject.base.rules[place].then


def _pairs(subject: Subject) -> list[Pair]:
    """Return the pairs of rules; not two ways in which one rule of a system holds."""
    every, numbers = range(subject.base.count), subject.numbers
    return [
        pair
        for pair in itertools.combinations(every, 2)
        if numbers[pair[0]] != numbers[pair[1]]
    ]


def _noun(subject: Subject) -> str:
    return "class" if subject.policy.decision == "strongest" else "conclusion"


def _both(subject: Subject, pair: Pair) -> str:
    return " and ".join(subject.rule_name(place + 1) for place in pair)


def _facts(subject: Subject, pair: Pair) -> dict[str, FactValue]:
    """Return what two rules conclude, and what that is called."""
    one, other = (_then(subject, place) for place in pair)
    return {"noun": _noun(subject), "then": one, "other": other}


# --- FT104 and FT105: is one rule at least as strong everywhere?


def _hidden(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer which rules another one hides, of their class (FT104) or not (FT105)."""
    claims, budget = subject.claims, subject.budget
    budget.report("subsumed rule", 0.0)
    above = claims.drawn_above(budget)
    fires = [
        bool(above[place].any()) or not isinstance(claims.fires(place, budget), NoPoint)
        for place in range(subject.base.count)
    ]
    kinds: dict[bool, list[Pair]] = {True: [], False: []}
    for one, other in _pairs(subject):
        if fires[one] and fires[other]:
            is_alike = _then(subject, one) == _then(subject, other)
            kinds[is_alike].append((one, other))
    silent = len(fires) - sum(fires)
    yield from _of_kind(subject, above, kinds[True], silent, is_alike=True)
    if subject.policy.decision == "strongest":
        yield from _of_kind(subject, above, kinds[False], silent, is_alike=False)


def _of_kind(
    subject: Subject,
    above: BoolArray,
    pairs: list[Pair],
    silent: int,
    *,
    is_alike: bool,
) -> Iterator[AuditAnswer]:
    hiding: dict[int, list[int]] = {}
    left: list[Open] = []
    for pair in pairs:
        for weak, strong in (pair[::-1], pair):
            if above[weak, strong]:
                continue
            answer = subject.claims.above(
                weak, strong, subject.budget, is_tied=not is_alike and weak < strong
            )
            if isinstance(answer, Open):
                left.append(answer)
            if isinstance(answer, NoPoint):
                hiding.setdefault(weak, []).append(strong)
                break
    for weak, stronger in sorted(hiding.items()):
        message, verb = "FT104.subsumed", "subsume"
        if not is_alike:
            verb = "mask"
            message = "FT105.masked" if stronger[0] < weak else "FT105.weaker"
        yield audit_answer(
            message,
            subject.rule_name(weak + 1),
            Proved("levels, boxes or a solver: nowhere is it stronger"),
            rules=(weak + 1, *(place + 1 for place in stronger)),
            measures=(Measure(f"rules that {verb} it", len(stronger)),),
            facts={
                "by": subject.rule_name(stronger[0] + 1),
                "noun": _noun(subject),
                "then": _then(subject, stronger[0]),
            },
        )
    if not pairs:
        return
    facts: dict[str, FactValue] = {"noun": _noun(subject)}
    if hiding:
        facts["listed"] = len(hiding)
    state: State = Proved("of each, there is a point where it is the stronger one")
    if left:
        why = f"{counted(len(left), 'pair')}: {left[0].why}"
        state = state_of(left[0]._replace(why=why))
    measures = (
        Measure("pairs", len(pairs)),
        Measure("pairs too near to compare", len(left)),
        Measure("rules that never fire", silent),
    )
    message = "FT104.others" if is_alike else "FT105.others"
    yield audit_answer(message, "pairs of rules", state, measures=measures, facts=facts)


# --- FT106: do two rules have the same antecedent?


def _copied(subject: Subject) -> Iterator[AuditAnswer]:
    pairs = _pairs(subject)
    copies, near = 0, 0
    for pair in pairs:
        distance = subject.pairs.distance(*pair, NEARLY)
        if distance.low > NEARLY:
            continue
        if distance.high > NEARLY:
            near += 1
            continue
        copies += 1
        facts = _facts(subject, pair)
        decides = subject.policy.decision == "strongest"
        message = "FT106.contradiction" if decides else "FT106.different"
        measures: tuple[Measure, ...]
        measures = (_most("largest distance", distance.low, distance.high),)
        if distance.high and distance.axis:
            variable = subject.base.variables[distance.axis]
            facts["variable"] = distance.axis
            place = Measure("place of it", float(distance.at), unit=variable.unit)
            measures = (*measures, place)
        yield audit_answer(
            "FT106.same" if facts["then"] == facts["other"] else message,
            _both(subject, pair),
            Proved("their degrees were compared axis by axis in fractions"),
            rules=(pair[0] + 1, pair[1] + 1),
            measures=measures,
            facts=facts,
        )
    if not pairs:
        return
    state: State = Proved(
        f"somewhere their degrees differ by more than {float(NEARLY):g}"
    )
    if near:
        reason = f"{counted(near, 'pair')} of degrees are too near to compare"
        state = Declined("FTD02", reason)
    yield audit_answer(
        "FT106.others",
        "pairs of rules",
        state,
        measures=(Measure("pairs", len(pairs)),),
        facts={"listed": copies} if copies else {},
    )


def _most(name: str, low: Fraction, high: Fraction) -> Measure:
    """Return the upper bound of a number, with its fraction if it is known."""
    return Measure(name, float(high), str(high) if low == high else None)


# --- FT201: do rules of different classes reach a level together?


def _conflicts(subject: Subject) -> Iterator[AuditAnswer]:
    level, most = Fraction(subject.settings.level), subject.pairs.most(subject.budget)
    near: list[tuple[float, Pair]] = []
    clean = hidden = listed = 0
    for pair in _pairs(subject):
        if _then(subject, pair[0]) == _then(subject, pair[1]):
            continue
        if not _may_conflict(subject, *pair):
            continue
        if most[pair] < float(level) - _CLOSE:
            clean += 1
        else:
            near.append((-most[pair], pair))
    near.sort()
    for place, (_, pair) in enumerate(near):
        if listed == MOST_SHOWN and subject.base.is_lattice:
            hidden += len(near) - place
            break
        common = subject.pairs.common(*pair, level, subject.budget)
        if isinstance(common.answer, NoPoint):
            clean += 1
        elif common.point is not None and listed == MOST_SHOWN:
            hidden += 1
        else:
            listed += common.point is not None
            yield _conflict(subject, pair, common)
    if clean or hidden:
        yield _rest_of_conflicts(subject, clean, hidden)


def _may_conflict(subject: Subject, one: int, other: int) -> bool:
    """Return whether two rules say different things of one output."""
    if subject.policy.decision == "strongest":
        return True
    thens = [_conclusions(subject, k) for k in (one, other)]
    shared = thens[0].keys() & thens[1].keys()
    return any(thens[0][name] != thens[1][name] for name in shared)


def _conclusions(subject: Subject, place: int) -> dict[str, set[str]]:
    """Return what a rule says of each output."""
    result: dict[str, set[str]] = {}
    for text in _then(subject, place).split(" and "):
        for output, _ in subject.base.rules[place].conclusions:
            if text.startswith(f"{output} is "):
                result.setdefault(output, set()).add(text)
    return result


def _conflict(subject: Subject, pair: Pair, common: Common) -> AuditAnswer:
    both, facts = _both(subject, pair), _facts(subject, pair)
    rules = pair[0] + 1, pair[1] + 1
    high = outwards(common.high)[1]
    most = Measure("highest common level at most", high)
    if common.point is None:
        why = common.answer.why if isinstance(common.answer, Open) else "not narrower"
        of = f"the highest level that {both} reach"
        state: State = Bracket(of, 0.0, high, why)
        return audit_answer(
            "FT201.may", both, state, rules=rules, measures=(most,), facts=facts
        )
    low, _ = subject.base.strengths(common.point.values, pair)
    reached = min(low[place] for place in pair)
    claim = Claim("reaches", rules=rules, level=str(reached))
    state = Witness(coordinates(common.point.values), (claim,))
    facts["level"] = float(common.low)
    if reached < common.low:  # a limit, at a jump
        facts["falls short"] = float(common.low - reached)
    exact = str(common.low) if common.low == common.high else None
    measures: tuple[Measure, ...]
    measures = (Measure("highest common level", float(common.low), exact),)
    if exact is None:
        least = Measure("highest common level at least", float(common.low))
        measures = (least, most)
    return audit_answer(
        "FT201.conflict", both, state, rules=rules, measures=measures, facts=facts
    )


def _rest_of_conflicts(subject: Subject, clean: int, hidden: int) -> AuditAnswer:
    is_class = _noun(subject) == "class"
    facts: dict[str, FactValue] = {
        "level": subject.settings.level,
        "nouns": "classes" if is_class else "conclusions",
    }
    return audit_answer(
        "FT201.unlisted" if hidden else "FT201.never",
        "pairs of rules",
        Proved("the largest common degrees on each axis, then all axes together"),
        measures=(
            Measure("pairs that never do", clean),
            Measure("pairs not listed", hidden),
        ),
        facts=facts,
    )
