"""Questions about inputs that no rule covers, or none covers well."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from msgspec.structs import replace

from fuzzytree.auditing.decide import Open, Point
from fuzzytree.auditing.decide import Proved as NoPoint
from fuzzytree.auditing.decide.cover import (
    Sides,
    around,
    gap,
    least_cover,
)
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Declined,
    Span,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.rows import rank_by_distance
from fuzzytree.auditing.findings.subject import Subject, state_of
from fuzzytree.numerics import outwards

MOST_GAPS: Final = 8
"""The most gaps that are listed one by one."""


def answers(subject: Subject) -> Iterator[AuditAnswer]:
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
    measures = (
        Measure("strength where it is least, at least", low),
        Measure("strength where it is least, at most", high),
    )
    region: tuple[Span, ...] = ()
    message = "FT301.reaches"
    if isinstance(answer, Point):
        sides = around(subject.base, answer.values, Fraction(epsilon))
        state: State = _witness(subject, answer, Fraction(epsilon), sides)
        region = _spans(sides)
        message = "FT301.weak"
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
        region=region,
        measures=measures,
        facts={"epsilon": epsilon},
    )


def _witness(subject: Subject, point: Point, level: Fraction, sides: Sides) -> Witness:
    rules = tuple(range(1, subject.base.count + 1))
    claims = (Claim("below", rules=rules, level=str(level)),)
    return Witness(coordinates(point.values), claims, _spans(sides))


def _spans(sides: Sides) -> tuple[Span, ...]:
    return tuple(Span(name, float(a), float(b)) for name, (a, b) in sides.items())


def _gaps(subject: Subject, first: Point) -> Iterator[AuditAnswer]:
    """Answer with gaps in separate parts of the domain, the nearest to a row first."""
    gaps: list[AuditAnswer] = []
    boxes: list[Sides] = []
    answer: object = first
    while isinstance(answer, Point) and len(gaps) < MOST_GAPS:
        sides = around(subject.base, answer.values, Fraction(0))
        boxes.append(sides)
        gaps.append(_gap(subject, _witness(subject, answer, Fraction(0), sides)))
        answer = gap(subject.base, subject.budget, boxes)
    if subject.rows is not None:
        rules = subject.rules
        near = rank_by_distance(
            gaps, subject.rows, subject.domain, rules.inputs, rules.variables
        )
        gaps = [*near]
    yield from (
        replace(one, subject=f"gap {place}") for place, one in enumerate(gaps, 1)
    )
    if not isinstance(answer, NoPoint):
        reason = f"{MOST_GAPS} gaps at most are looked for, within the budget"
        state, facts = Declined("FTD05", reason), {"count": len(gaps)}
        yield audit_answer("FT301.more", "more gaps", state, facts=facts)


def _gap(subject: Subject, state: Witness) -> AuditAnswer:
    label, region = subject.policy.uncovered, state.region
    if label is not None:
        facts = {"then": label}
        return audit_answer(
            "FT301.gap-with-class", "gap", state, region=region, facts=facts
        )
    is_system = subject.policy.decision == "all"
    message = "FT301.gap-of-system" if is_system else "FT301.gap"
    return audit_answer(message, "gap", state, region=region)
