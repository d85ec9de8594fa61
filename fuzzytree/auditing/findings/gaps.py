"""Questions about inputs that no rule covers, or none covers well."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import Arrangement, restricted
from fuzzytree.auditing.engine.clock import OutOfTimeError
from fuzzytree.auditing.engine.domain import Domain, DomainSide, span
from fuzzytree.auditing.engine.questions import uncovered
from fuzzytree.auditing.engine.regions import cut_side
from fuzzytree.auditing.engine.states import Declined, Proved, Span, State, Witness
from fuzzytree.auditing.findings.bounded_arrangement import (
    BoundedArrangement,
    bounded_arrangement,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.rows import rank_by_distance
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.numerics import outwards

MOST_GAPS: Final = 8
"""The most gaps that are listed one by one."""

_MOST_BOXES = 64  # parts of the domain in which a gap is looked for
_PART = 0.3  # of the time that is left, for one question


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Answer whether some input is covered by no rule, or by less than epsilon."""
    if not subject.is_whole:
        reason = "rules that are left out of the view may cover what the others do not"
        yield audit_answer("FT301.not-decided", "cover", Declined("FTD07", reason))
        return
    sides = bounded_arrangement(subject)
    if sides.lower.is_empty:
        return
    bare = sides.uncovered(subject.clock.share(_PART))
    if isinstance(bare, Witness):
        yield from _gaps(subject, sides.upper, bare)
        return
    message = "FT301.fires" if isinstance(bare, Proved) else "FT301.open"
    yield audit_answer(message, "cover", bare)
    yield _weak(subject, sides)


def _weak(subject: Subject, sides: BoundedArrangement) -> AuditAnswer:
    """Answer whether some rule reaches epsilon everywhere, and how little is least."""
    epsilon = subject.settings.epsilon
    state = sides.below(Fraction(epsilon), subject.clock.share(_PART))
    least = sides.least_cover(subject.clock.share(_PART))
    measures = (
        Measure("strength where it is least, at least", least.low),
        Measure("strength where it is least, at most", least.high),
    )
    message = "FT301.reaches" if isinstance(state, Proved) else "FT301.reaches-open"
    return audit_answer(
        "FT301.weak" if isinstance(state, Witness) else message,
        f"cover of {epsilon:g}",
        state,
        region=state.region if isinstance(state, Witness) else (),
        measures=measures,
        facts={"epsilon": epsilon},
    )


def _gaps(
    subject: Subject, arrangement: Arrangement, first: Witness
) -> Iterator[AuditAnswer]:
    """Answer with the gaps that were found, the nearest to a row first."""
    witnesses, is_all = _separate(subject, arrangement, first)
    gaps = [_gap(subject, state) for state in witnesses]
    if subject.rows is not None:
        rules = subject.rules
        found_near = rank_by_distance(
            gaps, subject.rows, subject.domain, rules.inputs, rules.variables
        )
        gaps = [*found_near]
    yield from (
        replace(one, subject=f"gap {place}") for place, one in enumerate(gaps, 1)
    )
    if not is_all:
        reason = f"{MOST_GAPS} gaps at most are looked for, within the budget"
        state, facts = Declined("FTD05", reason), {"count": len(witnesses)}
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


def _separate(
    subject: Subject, arrangement: Arrangement, first: Witness
) -> tuple[list[Witness], bool]:
    """Return gaps in separate parts of the domain, and whether these are all."""
    witnesses = [first]
    todo = deque(_around(arrangement, subject.domain, first.region))
    tried = 0
    clock = subject.clock.share(_PART)
    while todo:
        if len(witnesses) == MOST_GAPS or tried == _MOST_BOXES:
            return witnesses, False
        box = todo.popleft()
        tried += 1
        try:
            state: State = uncovered(restricted(arrangement, box), clock)
            clock.check()
        except OutOfTimeError:
            return witnesses, False
        if isinstance(state, Witness):
            witnesses.append(
                replace(state, region=_region_in(state, box, subject.domain))
            )
            todo += _around(arrangement, box, state.region)
        elif not isinstance(state, Proved):
            return witnesses, False
    return witnesses, True


def _region_in(state: Witness, box: Domain, domain: Domain) -> tuple[Span, ...]:
    """Return the region of a gap in a part of the domain, with the part's own ends."""
    known = {one.variable for one in state.region}
    parts = (
        Span(side.variable, side.low, side.high)
        for side in box.sides
        if side.variable not in known and side != domain.side(side.variable)
    )
    return (*state.region, *parts) if known else ()


def _around(
    arrangement: Arrangement, box: Domain, region: tuple[Span, ...]
) -> Iterator[Domain]:
    """Yield the parts of a box outside an inner one; together they are all of it."""
    sides = {side.variable: side for side in box.sides}
    variables = {axis.variable.name: axis.variable for axis in arrangement.axes}
    for inner in region:
        if inner.low is None or inner.high is None:
            return  # no finite region
        side = sides.get(inner.variable)
        if side is None:
            ends = span(variables[inner.variable], box)
            low, high = outwards(ends[0])[0], outwards(ends[1])[1]
            side = DomainSide(inner.variable, low, high, "model")
        for part in (
            cut_side(side, (None, math.nextafter(inner.low, -math.inf))),
            cut_side(side, (inner.high, None)),
        ):
            if part is not None:
                yield Domain(tuple({**sides, side.variable: part}.values()))
        low = inner.low if inner.low > side.low else -math.inf
        inside = cut_side(side, (math.nextafter(low, -math.inf), inner.high))
        sides[side.variable] = inside or side
