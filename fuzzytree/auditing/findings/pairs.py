"""Questions about two rules, such as one and itself without a proposition."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.decide import BaseRule, Open, Point
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.claims import Claims
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
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    FactValue,
    Measure,
    TermName,
)
from fuzzytree.auditing.findings.subject import Subject, state_of
from fuzzytree.model import Proposition, proposition_text
from fuzzytree.numerics import outwards

NEARLY: Final = Fraction(1, 10**6)
"""Two antecedents are nearly the same if no degree differs by more than this."""

MOST_SHOWN: Final = 20  # the most conflicts that are listed one by one

MOST_PROPOSITIONS: Final = 100
"""The most propositions that matter that are listed one by one."""

_CLOSE = 1e-9  # levels in doubles that are so near are compared in fractions

Pair = tuple[int, int]  # positions, from 0


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer what is to be said of pairs of rules, and of single propositions."""
    if subject.base.is_empty:
        return
    yield from _dominance(subject)
    yield from _copies(subject)
    if subject.rules.kind != "relative":
        yield from _conflicts(subject)
    if subject.policy.decision == "strongest":
        yield from _propositions(subject)


def _pairs(subject: Subject) -> list[Pair]:
    """Return the pairs of rules; not two ways in which one rule of a system holds."""
    numbers = subject.numbers
    pairs = itertools.combinations(range(subject.base.count), 2)
    return [(a, b) for a, b in pairs if numbers[a] != numbers[b]]


def _facts(subject: Subject, pair: Pair) -> dict[str, FactValue]:
    """Return what two rules conclude, and what that is called."""
    a, b = (subject.base.rules[place].then for place in pair)
    is_class = subject.policy.decision == "strongest"
    return {"noun": "class" if is_class else "conclusion", "then": a, "other": b}


# --- FT104 and FT105: is one rule at least as strong everywhere?


def _dominance(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer which rules another one hides, of their class (FT104) or not (FT105)."""
    claims, budget, rules = subject.claims, subject.budget, subject.base.rules
    budget.report("subsumed rule", 0.0)
    above = claims.above_at_samples(budget)
    fires = [
        bool(above[place].any()) or not isinstance(claims.fires(place, budget), NoPoint)
        for place in range(subject.base.count)
    ]
    for is_alike in (True, False)[: 1 + (subject.policy.decision == "strongest")]:
        pairs = [
            (a, b)
            for a, b in _pairs(subject)
            if fires[a] and fires[b] and (rules[a].then == rules[b].then) == is_alike
        ]
        if not pairs:
            continue
        hidden, left = dict[int, list[int]](), list[Open]()
        for pair in pairs:
            for weak, strong in (pair[::-1], pair):
                if above[weak, strong]:
                    continue
                is_tied = not is_alike and weak < strong
                answer = claims.above(weak, strong, budget, is_tied=is_tied)
                if isinstance(answer, Open):
                    left.append(answer)
                if isinstance(answer, NoPoint):
                    hidden.setdefault(weak, []).append(strong)
                    break
        yield from (
            _hides(subject, weak, stronger, is_alike=is_alike)
            for weak, stronger in sorted(hidden.items())
        )
        state: State = Proved("of each, there is a point where it is the stronger one")
        if left:
            why = f"{counted(len(left), 'pair')}: {left[0].why}"
            state = state_of(left[0]._replace(why=why))
        listed = {"listed": len(hidden)} if hidden else {}
        yield audit_answer(
            "FT104.others" if is_alike else "FT105.others",
            "pairs of rules",
            state,
            Measure("pairs", len(pairs)),
            Measure("pairs too near to compare", len(left)),
            Measure("rules that never fire", fires.count(False)),
            facts=_facts(subject, pairs[0]) | listed,
        )


def _hides(
    subject: Subject, weak: int, stronger: list[int], *, is_alike: bool
) -> AuditAnswer:
    """Return that some rules, the first of them above all, hide a weak one."""
    message, verb = "FT104.subsumed", "subsume"
    if not is_alike:
        message, verb = "FT105.weaker", "mask"
        if stronger[0] < weak:
            message = "FT105.masked"
    return subject.answer(
        message,
        (weak, *stronger),
        Proved("levels, boxes or a solver: nowhere is it stronger"),
        Measure(f"rules that {verb} it", len(stronger)),
        subject=subject.rule_name(weak + 1),
        facts={
            **_facts(subject, (stronger[0], weak)),
            "by": subject.rule_name(stronger[0] + 1),
        },
    )


# --- FT106: do two rules have the same antecedent?


def _copies(subject: Subject) -> Iterator[AuditAnswer]:
    pairs = _pairs(subject)
    copies, near = 0, 0
    is_class = subject.policy.decision == "strongest"
    for pair in pairs:
        distance = subject.pairs.distance(*pair, NEARLY)
        if distance.low > NEARLY:
            continue
        if distance.high > NEARLY:
            near += 1
            continue
        copies += 1
        facts = _facts(subject, pair)
        message = "FT106.contradiction" if is_class else "FT106.different"
        if facts["then"] == facts["other"]:
            message = "FT106.same"
        exact = str(distance.low) if distance.low == distance.high else None
        measures = [Measure("largest distance", float(distance.high), exact)]
        if distance.high and distance.axis:
            facts["variable"] = distance.axis
            unit = subject.base.variables[distance.axis].unit
            measures.append(Measure("place of it", float(distance.at), unit=unit))
        state: State = Proved("their degrees were compared axis by axis in fractions")
        yield subject.answer(message, pair, state, *measures, facts=facts)
    if not pairs:
        return
    state = Proved(f"somewhere their degrees differ by more than {float(NEARLY):g}")
    if near:
        why = f"{counted(near, 'pair')} of degrees are too near to compare"
        state = Declined("FTD02", why)
    listed = {"listed": copies} if copies else {}
    count = Measure("pairs", len(pairs))
    yield audit_answer("FT106.others", "pairs of rules", state, count, facts=listed)


# --- FT201: do rules of different classes reach a level together?


def _conflicts(subject: Subject) -> Iterator[AuditAnswer]:
    level, most = Fraction(subject.settings.level), subject.pairs.most(subject.budget)
    near: list[tuple[float, Pair]] = []
    clean = hidden = listed = 0
    for pair in _pairs(subject):
        if not _may_conflict(subject, pair):
            continue
        if most[pair] < float(level) - _CLOSE:
            clean += 1
        else:
            near.append((-most[pair], pair))
    near.sort()
    for number, (_, pair) in enumerate(near):
        if listed == MOST_SHOWN and subject.base.is_lattice:
            hidden += len(near) - number
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
        is_class = subject.policy.decision == "strongest"
        nouns = "classes" if is_class else "conclusions"
        yield audit_answer(
            "FT201.unlisted" if hidden else "FT201.never",
            "pairs of rules",
            Proved("the largest common degrees on each axis, then all axes together"),
            Measure("pairs that never do", clean),
            Measure("pairs not listed", hidden),
            facts={"level": subject.settings.level, "nouns": nouns},
        )


def _may_conflict(subject: Subject, pair: Pair) -> bool:
    """Return whether two rules say different things, of one output if all decide."""
    rules = [subject.base.rules[place] for place in pair]
    if rules[0].then == rules[1].then or subject.policy.decision == "strongest":
        return rules[0].then != rules[1].then
    texts = [
        {
            output: {
                t for t in rule.then.split(" and ") if t.startswith(f"{output} is ")
            }
            for output, _ in rule.conclusions
        }
        for rule in rules
    ]
    shared = texts[0].keys() & texts[1].keys()
    return any(texts[0][output] != texts[1][output] for output in shared)


def _conflict(subject: Subject, pair: Pair, common: Common) -> AuditAnswer:
    facts, high = _facts(subject, pair), outwards(common.high)[1]
    most = Measure("highest common level at most", high)
    if common.point is None:
        why = common.answer.why if isinstance(common.answer, Open) else "not narrower"
        both = " and ".join(subject.rule_name(place + 1) for place in pair)
        bracket = Bracket(f"the highest level that {both} reach", 0.0, high, why)
        return subject.answer("FT201.may", pair, bracket, most, facts=facts)
    low, _ = subject.base.strengths(common.point.values, pair)
    level = min(low[place] for place in pair)
    rules = pair[0] + 1, pair[1] + 1
    claims = (Claim("reaches", rules=rules, level=str(level)),)
    state = Witness(coordinates(common.point.values), claims)
    facts["level"] = float(common.low)
    if level < common.low:  # a limit, at a jump
        facts["falls short"] = float(common.low - level)
    least = Measure("highest common level at least", float(common.low))
    if common.low == common.high:
        exact = Measure("highest common level", float(common.low), str(common.low))
        return subject.answer("FT201.conflict", pair, state, exact, facts=facts)
    return subject.answer("FT201.conflict", pair, state, least, most, facts=facts)


# --- FT107: is some input classified differently without a proposition?


def _propositions(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer for each proposition whether some decision changes without it."""
    shorter = [*_shorter(subject)]
    if not shorter:
        return
    count, budget = subject.base.count, subject.budget
    base = subject.base.with_rules(rule for _, _, rule in shorter)
    claims = Claims(base, subject.policy.uncovered)
    silent = [
        place
        for place in range(count)
        if isinstance(subject.claims.fires(place, budget), NoPoint)
    ]
    needed = 0
    for number, (place, proposition, _) in enumerate(shorter):
        if place in silent:
            continue
        budget.report("irrelevant proposition", number / len(shorter))
        same, others = subject.claims.same(place), subject.claims.others(place)
        answer = claims.changes(count + number, place, (place, *same), others, budget)
        needed += isinstance(answer, Point)
        if isinstance(answer, Point) and needed > MOST_PROPOSITIONS:
            continue
        name, text = subject.rule_name(place + 1), proposition_text(proposition)
        facts: dict[str, FactValue] = {"rule": name, "proposition": text}
        if isinstance(answer, Point):
            message, before = "FT107.needed", subject.class_at(answer.values)
            facts |= {"before": before, "then": base.rules[place].then}
            claim = Claim("decides", label=before)
            state: State = Witness(coordinates(answer.values), (claim,))
        else:
            state, message = state_of(answer), "FT107.open"
            if isinstance(answer, NoPoint):
                message = "FT107.irrelevant"
        variable, title = proposition.variable, f"{name}, {text!r}"
        terms = tuple(TermName(variable, term) for term in proposition.terms)
        yield subject.answer(
            message, [place], state, subject=title, terms=terms, facts=facts
        )
    for place in silent:
        proof = Proved("one of its propositions is 0 on all of the domain")
        yield subject.answer("FT107.silent", [place], proof)
    if needed > MOST_PROPOSITIONS:
        proof = Proved("an input was found for each, and evaluated in fractions")
        more = Measure("propositions", needed - MOST_PROPOSITIONS)
        yield audit_answer("FT107.more", "propositions", proof, more)


def _shorter(subject: Subject) -> Iterator[tuple[int, Proposition, BaseRule]]:
    """Yield positions of rules, a proposition of each, and the rule without it.

    Of relative rules only propositions where one class is left: below a node of several
    classes a rule that is shortened ties with all of them.
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
            yield place, proposition, whole._replace(literals=literals, norm=norm)
