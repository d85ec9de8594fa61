"""Questions about what rules decide: whether each wins, and whether some rule fires."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Final

from fuzzytree.auditing.decide import Answer, Open, Point
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.cover import Sides, around, gap, least_cover
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    Span,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.robustness import distance_measure, nearest_rows
from fuzzytree.auditing.findings.subject import Subject, state_of
from fuzzytree.numerics import outwards

MOST_SHOWN: Final = 20  # the most ties that are listed one by one
MOST_GAPS: Final = 8  # the most gaps that are listed one by one


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether rules win, lead, are needed, and tie.

    Where every rule that fires takes part in the answer: whether it fires.
    """
    if subject.base.is_empty:
        return
    if subject.policy.decision == "all":
        yield from _rules_that_fire(subject)
        return
    yield from _rules_that_win(subject)
    yield from _rules_that_matter(subject)
    yield from _ties(subject)


def _rules_that_fire(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether each rule fires; a rule of several ways, whether one of them."""
    ways: dict[str, list[int]] = {}
    for place in range(subject.base.count):
        ways.setdefault(subject.rule_name(place + 1), []).append(place)
    for places in ways.values():
        results: list[Answer] = []
        for place in places:
            results.append(subject.claims.fires(place, subject.budget))
            if isinstance(results[-1], Point):
                wins = _beats(subject, results[-1], place, ())
                yield subject.answer("FT101.fires", places[:1], wins)
                break
        else:
            left = [result for result in results if isinstance(result, Open)]
            message = "FT101.fires-open" if left else "FT101.never-fires"
            state = state_of((left or results[-1:])[0])
            yield subject.answer(message, places[:1], state)


def _rules_that_win(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether each rule wins, and if it does whether by enough."""
    count = subject.base.count
    for place in range(count):
        text = f"does {subject.rule_name(place + 1)} win"
        subject.budget.report(text, 0.5 * place / count)
        answer = subject.claims.wins(place, subject.budget)
        if subject.tree is None:  # for leaves see `fuzzytree.auditing.findings.leaves`
            yield _win(subject, place, answer)
        if isinstance(answer, Point):
            yield _lead(subject, place)
        elif isinstance(answer, Open):
            yield subject.answer("FT102.open", [place], state_of(answer))


def _win(subject: Subject, place: int, answer: Answer) -> AuditAnswer:
    """Return whether a rule wins; if not, whether it decides by its place, or fires."""
    claims, budget, rivals = (
        subject.claims,
        subject.budget,
        subject.claims.others(place),
    )
    if isinstance(answer, Point):
        state: State = _beats(subject, answer, place, rivals)
        return subject.answer("FT101.wins", [place], state)
    state = state_of(answer)
    if isinstance(answer, Open):
        return subject.answer("FT101.open", [place], state)
    order = claims.decides(place, budget)
    if isinstance(order, Point):
        state = _tie(subject, order, place, [place, *rivals])
        return subject.answer("FT101.decides-by-place", [place], state)
    fires = claims.fires(place, budget)
    if isinstance(fires, NoPoint):
        return subject.answer("FT101.never-fires", [place], state_of(fires))
    message = "may-decide-by-place" if isinstance(order, Open) else "never-wins"
    return subject.answer(f"FT101.{message}", [place], state)


def _beats(
    subject: Subject, point: Point, place: int, rivals: Sequence[int]
) -> Witness:
    """Return that a rule is stronger than others at a point, and how strong it is."""
    low, high = subject.base.strengths(point.values, (place,))
    rules = (place + 1,)
    claims = [Claim("beats", rules=rules, rivals=tuple(j + 1 for j in rivals))]
    if low == high:
        claims.insert(0, Claim("strength", rules=rules, level=str(low[place])))
    return Witness(coordinates(point.values), tuple(claims))


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


def _lead(subject: Subject, place: int) -> AuditAnswer:
    """Return by how much a rule leads that wins somewhere."""
    least, rivals = subject.settings.lead, subject.claims.others(place)
    lead = subject.claims.lead(place, Fraction(least), subject.budget)
    low, high = outwards(lead.low)[0], outwards(lead.high)[1]
    at = Witness((), ())
    if lead.point is not None:
        at = _beats(subject, lead.point, place, rivals)
    if lead.low >= Fraction(least):
        measure = Measure("largest lead, at least", max(low, least))
        return subject.answer("FT102.leads", [place], at, measure)
    why = "the budget was spent" if lead.is_open else "halved until it is narrow"
    of = f"the largest lead of {subject.rule_name(place + 1)}"
    return subject.answer(
        "FT102.between" if lead.is_open else "FT102.marginal",
        [place],
        Bracket(of, low, high, why, at.point, at.claims),
        Measure("largest lead, at least", low),
        Measure("largest lead, at most", high),
        facts={"lead": least},
    )


def _rules_that_matter(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether leaving out a rule changes a decision."""
    base = subject.base
    for place in range(base.count if base.count > 1 else 0):
        text = f"is {subject.rule_name(place + 1)} needed"
        subject.budget.report(text, 0.5 + 0.3 * place / base.count)
        answer = subject.claims.matters(place, subject.budget)
        if isinstance(answer, Point):
            before = base.rules[place].then
            facts = {"before": before, "then": subject.class_at(answer.values, place)}
            claims = (Claim("decides", label=before),)
            state: State = Witness(coordinates(answer.values), claims)
            yield subject.answer("FT103.needed", [place], state, facts=facts)
            continue
        message = "open" if isinstance(answer, Open) else "superfluous"
        yield subject.answer(f"FT103.{message}", [place], state_of(answer))


def _ties(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer for pairs that tie one by one, for all others together."""
    base, every = subject.base, range(subject.base.count)
    pairs = [
        (a, b)
        for a, b in itertools.combinations(every, 2)
        if base.rules[a].then != base.rules[b].then
    ]
    ties, left = 0, list[Open]()
    for number, pair in enumerate(pairs):
        if not number % 100:
            subject.budget.report("which rules tie", 0.8 + 0.2 * number / len(pairs))
        answer = subject.pairs.tie(*pair, subject.budget)
        if isinstance(answer, Open):
            left.append(answer)
        elif isinstance(answer, Point):
            ties += 1
            if ties <= MOST_SHOWN:
                tie = _tie(subject, answer, pair[0], every)
                yield subject.answer("FT202.tie", pair, tie)
    if not pairs:
        return
    state: State = Proved(f"{len(pairs)} pairs of rules of different classes tested")
    spent = [answer for answer in left if answer.code == "FTD03"]
    yield audit_answer(
        "FT202.others",
        "pairs of rules",
        state_of((spent or left)[0]) if left else state,
        Measure("pairs", len(pairs)),
        Measure("pairs that tie", ties),
        Measure("pairs listed", min(ties, MOST_SHOWN)),
        Measure("pairs left open", len(left)),
        facts={"untested": len(spent)} if spent else {},
    )


# --- FT301: is every input covered, and well?


def cover_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether some input is covered by no rule, or by less than epsilon."""
    if not subject.is_whole:
        reason = "rules that are left out of the view may cover what the others do not"
        yield audit_answer("FT301.not-decided", "cover", Declined("FTD07", reason))
        return
    if subject.base.is_empty:
        return
    bare = gap(subject.base, subject.budget)
    if isinstance(bare, Point):
        yield from _gaps(subject, bare)
        return
    message = "FT301.fires" if isinstance(bare, NoPoint) else "FT301.open"
    yield audit_answer(message, "cover", state_of(bare))
    yield _weak(subject)


def _weak(subject: Subject) -> AuditAnswer:
    """Answer whether some rule reaches epsilon everywhere, and how little is least."""
    epsilon = subject.settings.epsilon
    answer = subject.claims.below(Fraction(epsilon), subject.budget)
    least, most = least_cover(subject.claims, subject.budget)
    low, high = outwards(least)[0], outwards(most)[1]
    message, region = "FT301.reaches", tuple[Span, ...]()
    if isinstance(answer, Point):
        sides = around(subject.base, answer.values, Fraction(epsilon))
        state: State = _below(subject, answer, Fraction(epsilon), sides)
        message, region = "FT301.weak", _spans(sides)
    elif isinstance(answer, Open):
        message = "FT301.reaches-open"
        of = "the least strength that the strongest rule has"
        state = Bracket(of, low, high, answer.why)
    else:
        state = state_of(answer)
    return audit_answer(
        message,
        f"cover of {epsilon:g}",
        state,
        Measure("strength where it is least, at least", low),
        Measure("strength where it is least, at most", high),
        region=region,
        facts={"epsilon": epsilon},
    )


def _below(subject: Subject, point: Point, level: Fraction, sides: Sides) -> Witness:
    rules = tuple(range(1, subject.base.count + 1))
    claims = (Claim("below", rules=rules, level=str(level)),)
    return Witness(coordinates(point.values), claims, _spans(sides))


def _spans(sides: Sides) -> tuple[Span, ...]:
    return tuple(Span(name, float(a), float(b)) for name, (a, b) in sides.items())


def _gaps(subject: Subject, first: Point) -> Iterator[AuditAnswer]:
    """Answer with gaps in separate parts of the domain, the nearest to a row first."""
    label, message = subject.policy.uncovered, "FT301.gap"
    if label is not None:
        message = "FT301.gap-with-class"
    elif subject.policy.decision == "all":
        message = "FT301.gap-of-system"
    points: list[Point] = []
    boxes: list[Sides] = []
    answer: Answer = first
    while isinstance(answer, Point) and len(boxes) < MOST_GAPS:
        points.append(answer)
        boxes.append(around(subject.base, answer.values, Fraction(0)))
        answer = gap(subject.base, subject.budget, boxes)
    order: list[int] = [*range(len(boxes))]
    rows: list[tuple[Fraction, int]] = []
    if subject.rows is not None:
        variables = subject.rules.variables
        gaps = [
            sides or {name: (x, x) for name, x in point.values.items()}
            for sides, point in zip(boxes, points, strict=True)
        ]
        rows = nearest_rows(gaps, subject.rows, subject.domain, variables)
        order.sort(key=lambda place: rows[place][0] if rows else 0)
    for number, place in enumerate(order, 1):
        state = _below(subject, points[place], Fraction(0), boxes[place])
        measures = list[Measure]()
        if rows:
            away, row = rows[place]
            measures.append(distance_measure("distance to the nearest row", away))
            measures.append(Measure("nearest row", row))
        yield audit_answer(
            message,
            f"gap {number}",
            state,
            *measures,
            region=state.region,
            facts={"then": label},
        )
    if not isinstance(answer, NoPoint):
        why = f"{MOST_GAPS} gaps at most are looked for, within the budget"
        rest, count = Declined("FTD05", why), {"count": len(boxes)}
        yield audit_answer("FT301.more", "more gaps", rest, facts=count)
