"""How far a row is from the nearest other decision: its certified radius."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.contest import decided
from fuzzytree.auditing.decide.costs import Nearest
from fuzzytree.auditing.decide.domain import contains, simplified, variable_value
from fuzzytree.auditing.decide.nearest import nearest
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.auditing.decide.regions import regions
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    Representation,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.leaves import too_many_boxes
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.rows import (
    DomainRows,
    distance_measure,
    narrowed_state,
    points_of,
    rows_left_out,
)
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.numerics import outwards


class RowDecider:
    """What decides rows: the regions of a tree's leaves, or the strongest rule."""

    def __init__(self, subject: Subject) -> None:
        self.subject, self.domain = subject, subject.domain
        self.base: Base | Leaves
        self.of: Representation = "rules"
        if subject.tree is not None:
            self.base, self.of = Leaves(subject.tree, subject.domain), "tree"
        else:
            self.base = Base.of(subject.rules, subject.domain)

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class at a point, and the leaf or the rule that decides."""
        if isinstance(self.base, Leaves):
            label, leaf = self.base.decided(point)
            return label, f"leaf {leaf}"
        own, place = decided(self.base, point)
        return own, "no rule" if place is None else self.subject.rule_name(place + 1)


MOST_ROWS = 50
"""Rows whose radius is sought by strengths."""

MOST_ROWS_OF_TREE = 1000
"""Rows whose radius is sought by regions, which is quick."""

SHOWN_ROWS = 5
"""Rows of the smallest radius that have an answer of their own."""

_PART = 0.9  # of the steps, to seek; the rest is for other codes
_MOST_NAMED = 4  # inputs in a sentence


# --- a row


def radius(subject: Subject, row: Mapping[str, float]) -> AuditAnswer:
    """Return how far the nearest point is that is decided otherwise than a row.

    Raises:
        ValueError: If the row lies outside the domain.
    """
    point = _point(subject, row)
    decider = RowDecider(subject)
    result = nearest(decider.base, point, budget=subject.budget)
    return _answer(decider, "the row", point, result)


def row_answers(subject: Subject, row: Mapping[str, float]) -> Iterator[AuditAnswer]:
    """Yield how a row is decided, and how far the nearest other decision is.

    Raises:
        ValueError: If the row lies outside the domain.
    """
    declined = _declined(subject)
    if declined is not None:
        yield audit_answer("FT204.not-sought", "row", declined)
        return
    point = _point(subject, row)
    decider = RowDecider(subject)
    label, by = decider.decided(point)
    claim = Claim("decides", of=decider.of, label=label)
    yield audit_answer(
        "FT204.decided",
        "row",
        Witness(coordinates(point), (claim,)),
        facts={"then": label, "by": by},
    )
    yield radius(subject, row)


def _declined(subject: Subject) -> Declined | None:
    """Return why rows of a model are declined, None if they are not."""
    if subject.policy.decision != "strongest":
        why = "every rule takes part in the answer, so that no class decides"
        return Declined("FTD07", why)
    if not subject.is_whole:
        return Declined("FTD07", "rules are left out that may decide")
    return None if subject.tree is None else too_many_boxes(regions(subject.tree))


def _point(subject: Subject, row: Mapping[str, float]) -> dict[str, Fraction]:
    point = {name: Fraction(float(row[name])) for name in subject.rules.inputs}
    for variable in subject.rules.variables:
        side = subject.domain.side(variable.name)
        if not contains(subject.domain, [variable], point) and side is not None:
            raise ValueError(
                f"the row lies outside the domain: {variable.name!r} is "
                f"{float(variable_value(variable, point))!r}, and the domain is "
                f"{side.low!r} to {side.high!r}; "
                f"widen it (--limits '{variable.name}=LOW:HIGH')"
            )
    return point


def _answer(
    decider: RowDecider, name: str, point: Mapping[str, Fraction], result: Nearest
) -> AuditAnswer:
    own, _ = decider.decided(point)
    facts: dict[str, FactValue] = {"name": name, "then": own}
    title = name.removeprefix("the ")
    what = f"the distance from {name} to another decision"
    state: State
    if result.point is None or result.high is None:
        if result.is_none:
            state = Proved("other decisions were sought on the whole domain")
            return audit_answer("FT204.alike", title, state, facts=facts)
        state = Bracket(what, outwards(result.low)[0], 1.0, result.why)
        return audit_answer("FT204.none-known", title, state, facts=facts)
    other, _ = decider.decided(result.point)
    claim = Claim("decides", of=decider.of, label=other)
    moved = [axis for axis, value in result.point.items() if value != point[axis]]
    near = simplified(
        {axis: result.point[axis] for axis in moved},
        decider.domain,
        lambda some: decider.decided({**point, **some})[0] == other,
    )
    values = tuple((axis, repr(float(value))) for axis, value in near.items())
    facts |= {"other": other, "moved": values}
    message = "FT204.nearest"
    if len(moved) > _MOST_NAMED:
        message, facts["moved"] = "FT204.nearest-of-many", len(moved)
    state = narrowed_state(what, result.low, result, [claim], result.why)
    low = distance_measure("certified radius", result.low)
    measures = low, distance_measure("distance of the witness", result.high)
    return audit_answer(message, title, state, measures=measures, facts=facts)


# --- all rows


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield how far rows are from another decision: the nearest of them, and in all.

    Systems in which more than one rule answers have no such rows.
    """
    if subject.policy.decision != "strongest":
        return
    declined = _declined(subject)
    if declined is not None or subject.rows is None:
        needed = Declined("FTD06", "rows are needed (--data TABLE)")
        yield audit_answer("FT204.not-sought", "rows", declined or needed)
        return
    points = points_of(subject, subject.rows)
    decider = RowDecider(subject)
    budget = subject.budget.share(_PART)
    radii: list[_RowRadius] = []
    most = MOST_ROWS if subject.tree is None else MOST_ROWS_OF_TREE
    chosen = points.at[:most]
    for number, point in chosen:
        if budget.is_spent:
            break
        subject.budget.report(f"radius of row {number}", len(radii) / len(chosen))
        result = nearest(decider.base, point, budget=budget)
        is_worth_keeping = result.is_narrow or (not radii and result.high is not None)
        if budget.is_spent and not is_worth_keeping:
            break
        answer = _answer(decider, f"row {number}", point, result)
        radii.append(_RowRadius(number, result.low, answer))
    radii.sort(key=lambda one: (one.low, one.number))
    yield _in_all(points, radii)
    yield from (one.answer for one in radii[:SHOWN_ROWS])
    if 0 < len(radii) < len(chosen):
        yield rows_left_out("FT204", len(chosen) - len(radii))


class _RowRadius(NamedTuple):
    number: int
    low: Fraction
    answer: AuditAnswer


def _in_all(points: DomainRows, radii: Sequence[_RowRadius]) -> AuditAnswer:
    """Return an answer about all rows together; `radii` is in order of their radius."""
    count = Measure("rows evaluated", len(radii))
    if not radii:
        state = (
            Declined("FTD03", "the budget was spent before the first row")
            if points.at
            else Declined("FTD06", "no row lies in the domain")
        )
        return audit_answer("FT204.not-sought", "rows", state, measures=(count,))
    first = radii[0]
    least = first.low
    facts = points.facts
    if len(radii) < len(points.at):
        facts["different"] = len(points.at)
    median = statistics.median_low([one.low for one in radii])
    measures = (
        count,
        distance_measure("smallest certified radius", least),
        distance_measure("median certified radius", median),
        Measure("row", first.number),
    )
    return audit_answer(
        "FT204.rows", "rows", first.answer.state, measures=measures, facts=facts
    )
