"""The user's rows as exact points, and how far they are from a box."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction

import msgspec
import numpy as np

from fuzzytree.auditing.decide.costs import Costs, Nearest
from fuzzytree.auditing.decide.domain import Domain, DomainSide, contains
from fuzzytree.auditing.decide.domain import span as ends_on
from fuzzytree.auditing.decide.polytopes import Polytopes, polytope_of
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Declined,
    Span,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.subject import AuditRows, Subject
from fuzzytree.model import Variable
from fuzzytree.numerics import decide, outwards

_MOST_DIGITS = 80  # of an exact number beside a double


class DomainRows(msgspec.Struct, frozen=True, eq=False):
    """Rows that lie in the domain.

    Attributes:
        at: The row's number, from 1, and its values; equal rows stand once, close
            calls first.
        left_out: How many different ones have a value that is missing, or outside the
            domain.
        total: How many rows there are.
    """

    at: tuple[tuple[int, dict[str, Fraction]], ...]
    left_out: int
    total: int

    @property
    def facts(self) -> dict[str, FactValue]:
        """Which rows these are, as sentences show it."""
        facts: dict[str, FactValue] = {"total": self.total}
        return {**facts, "incomplete": self.left_out} if self.left_out else facts


def points_of(subject: Subject, rows: AuditRows) -> DomainRows:
    """Return the user's rows as points of the domain, close calls first.

    A call is close where the margin of the rules is small: there another decision tends
    to be near.
    """
    names = subject.rules.inputs
    total = rows.values.shape[1]
    margins = decide(subject.rules, rows.values, with_strengths=False).margin
    numbers: dict[tuple[float, ...], int] = {}
    for row in np.argsort(margins, kind="stable").tolist():
        numbers.setdefault(tuple(rows.values[:, row].tolist()), row + 1)
    complete = [
        (number, dict(zip(names, map(Fraction, values), strict=True)))
        for values, number in numbers.items()
        if all(map(math.isfinite, values))
    ]
    at = tuple(
        (number, point)
        for number, point in complete
        if contains(subject.domain, subject.rules.variables, point)
    )
    return DomainRows(at, len(numbers) - len(at), total)


def distance_measure(name: str, value: Fraction) -> Measure:
    """Return a distance in widths of the inputs' ranges, with the exact one if short.

    Where it is not, the double is at most the distance.
    """
    exact = str(value)
    if len(exact) <= _MOST_DIGITS:
        return Measure(f"{name}, in ranges", float(value), exact)
    return Measure(f"{name}, in ranges", outwards(value)[0])


def rank_by_distance(
    gaps: Sequence[AuditAnswer],
    rows: AuditRows,
    domain: Domain,
    inputs: Sequence[str],
    variables: Sequence[Variable] = (),
) -> tuple[AuditAnswer, ...]:
    """Return answers in order of how near they are to a row, with the distance.

    A gap far from all that was ever seen matters less than one among the rows. Answers
    that name no place stand last, as they are.

    Args:
        gaps: Answers about places: with a region, or else the point of a witness.
        rows: The rows.
        domain: In whose widths distance is measured.
        inputs: The names of the rows' values.
        variables: The combinations that regions name.
    """
    combined = {one.name: one for one in variables if one.parts}
    boxes = [_box(gap, domain, combined) for gap in gaps]
    costs = Costs(domain, inputs)
    parts = Polytopes(
        inputs, [polytope_of(box or domain, inputs, combined.values()) for box in boxes]
    )
    fixed = {one.variable: one.low for one in domain.sides if one.low == one.high}
    fixed_point = {name: Fraction(fixed[name]) for name in inputs if name in fixed}
    points = {
        number: dict(zip(inputs, map(Fraction, values), strict=True)) | fixed_point
        for number, values in enumerate(rows.values.T.tolist(), 1)
        if all(map(math.isfinite, values))
    }
    bounds = {number: parts.bounds(point, costs) for number, point in points.items()}
    known: list[tuple[Fraction, AuditAnswer]] = []
    unknown: list[AuditAnswer] = []
    for place, (gap, box) in enumerate(zip(gaps, boxes, strict=True)):
        best: tuple[Fraction, int] | None = None
        for bound, number in sorted((bounds[one][place], one) for one in points):
            if box is None or (best is not None and bound > best[0]):
                break
            low = parts.nearest(points[number], [place], costs).low
            best = (low, number) if best is None or low < best[0] else best
        if best is None:
            unknown.append(gap)
            continue
        away, number = best
        added = (
            distance_measure("distance to the nearest row", away),
            Measure("nearest row", number),
        )
        measures = (*gap.measures, *added)
        known.append((away, msgspec.structs.replace(gap, measures=measures)))
    return (*(gap for _, gap in sorted(known, key=lambda one: one[0])), *unknown)


def _box(
    gap: AuditAnswer, domain: Domain, combined: Mapping[str, Variable]
) -> Domain | None:
    """Return where a gap is: its region, else its point; None if it names neither."""
    spans = gap.region
    if not spans and isinstance(gap.state, Witness):
        point = point_of(gap.state.point)
        spans = tuple(Span(name, *outwards(value)) for name, value in point.items())
    sides = {side.variable: side for side in domain.sides}
    for one in spans:
        name = one.variable
        if name not in sides:
            low, high = ends_on(combined[name], domain)
            sides[name] = DomainSide(name, outwards(low)[0], outwards(high)[1])
        whole = sides[name]
        low_end = whole.low if one.low is None else max(whole.low, one.low)
        high_end = whole.high if one.high is None else min(whole.high, one.high)
        inside = tuple(x for x in whole.points if low_end <= x <= high_end)
        sides[name] = DomainSide(name, low_end, high_end, values=inside)
    return Domain(tuple(sides.values())) if spans else None


def rows_left_out(code: str, count: int) -> AuditAnswer:
    """Return an answer that says how many rows the budget left out."""
    declined = Declined("FTD03", "the budget was spent")
    facts = {"count": count}
    return audit_answer(f"{code}.more-rows", "more rows", declined, facts=facts)


def narrowed_state(
    name: str, low: Fraction, result: Nearest, claims: Sequence[Claim], why: str
) -> State:
    """Return how a distance is known: by a witness, or between two bounds."""
    assert result.point is not None  # checked by the caller
    assert result.high is not None
    point = coordinates(result.point)
    if msgspec.structs.replace(result, low=low).is_narrow:
        return Witness(point, tuple(claims))
    high = outwards(result.high)[1]
    return Bracket(name, outwards(low)[0], high, why, point, tuple(claims))
