"""The user's rows as exact points, and how far they are from a box."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction

import msgspec
import numpy as np

from fuzzytree.auditing.engine.domain import Domain, DomainSide, contains
from fuzzytree.auditing.engine.domain import span as ends_on
from fuzzytree.auditing.engine.nearest import Nearest, Polytope, Polytopes, polytope_of
from fuzzytree.auditing.engine.states import (
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
        variables: The combinations that regions may name; where one of another name
            is met, the point of the witness counts.
    """
    known: list[tuple[Fraction, int, AuditAnswer]] = []
    unknown: list[AuditAnswer] = []
    for place, gap in enumerate(gaps):
        part = _part(gap, domain, inputs, variables)
        if part is None:
            near = _nearest_row(_spans(gap, inputs), rows, domain, inputs)
        else:
            near = _nearest_to_part(part, rows, domain, inputs)
        if near is None:
            unknown.append(gap)
            continue
        away, number = near
        added = (
            distance_measure("distance to the nearest row", away),
            Measure("nearest row", number),
        )
        measures = (*gap.measures, *added)
        known.append((away, place, msgspec.structs.replace(gap, measures=measures)))
    ordered = sorted(known, key=lambda one: one[:2])
    return (*(gap for _, _, gap in ordered), *unknown)


def _part(
    gap: AuditAnswer,
    domain: Domain,
    inputs: Sequence[str],
    variables: Sequence[Variable],
) -> Polytope | None:
    """Return the region of a gap whose combinations are known; None of any other."""
    combined = {one.name: one for one in variables if one.parts}
    names = {span.variable for span in gap.region}
    if not names & set(combined) or not names <= {*combined, *inputs}:
        return None
    sides = {side.variable: side for side in domain.sides}
    for one in gap.region:
        name = one.variable
        if name not in sides:
            low, high = ends_on(combined[name], domain)
            sides[name] = DomainSide(name, outwards(low)[0], outwards(high)[1])
        whole = sides[name]
        low_end = whole.low if one.low is None else max(whole.low, one.low)
        high_end = whole.high if one.high is None else min(whole.high, one.high)
        sides[name] = DomainSide(name, low_end, high_end)
    return polytope_of(Domain(tuple(sides.values())), inputs, combined)


def _nearest_to_part(
    part: Polytope, rows: AuditRows, domain: Domain, inputs: Sequence[str]
) -> tuple[Fraction, int] | None:
    """Return how near a row is to a part of the inputs, at least, and which is it."""
    regions = Polytopes(domain, inputs, [part])
    near: list[tuple[float, int, dict[str, Fraction]]] = []
    for row, values in enumerate(rows.values.T.tolist()):
        if all(map(math.isfinite, values)):
            point = dict(zip(inputs, map(Fraction, values), strict=True))
            near.append((regions.bounds(point)[0], row, point))
    best: tuple[Fraction, int] | None = None
    for bound, row, point in sorted(near, key=lambda one: one[:2]):
        if best is not None and bound > best[0]:
            break
        result = regions.nearest(point, [0])
        if not result.is_none and (best is None or result.low < best[0]):
            best = result.low, row + 1
    return best


def _spans(gap: AuditAnswer, inputs: Sequence[str]) -> tuple[Span, ...]:
    """Return where a gap is: its region, or the point where that needs more."""
    if gap.region and all(span.variable in inputs for span in gap.region):
        return gap.region
    if not isinstance(gap.state, Witness):
        return ()
    point = point_of(gap.state.point)
    return tuple(Span(name, *outwards(value)) for name, value in point.items())


def _nearest_row(
    spans: Sequence[Span], rows: AuditRows, domain: Domain, inputs: Sequence[str]
) -> tuple[Fraction, int] | None:
    """Return the least distance of a row from a box, and the row's number."""
    column = {name: place for place, name in enumerate(inputs)}
    away = np.zeros(rows.values.shape[1])
    for span in spans:
        side = domain.side(span.variable)
        if side is None or side.low == side.high:
            continue
        x = rows.values[column[span.variable]]
        below = -np.inf if span.low is None else span.low
        above = np.inf if span.high is None else span.high
        width = side.high - side.low
        away = np.maximum(away, np.maximum(below - x, x - above) / width)
    away[~np.isfinite(rows.values).all(axis=0)] = np.inf
    if not spans or not np.isfinite(away).any():
        return None
    row = int(np.argmin(away))
    values = {
        name: Fraction(float(rows.values[at, row])) for name, at in column.items()
    }
    return box_distance(spans, values, domain), row + 1


def box_distance(
    spans: Sequence[Span], point: Mapping[str, Fraction], domain: Domain
) -> Fraction:
    """Return how far a point is from a box, in shares of the domain's widths."""
    away = Fraction(0)
    for span in spans:
        side = domain.side(span.variable)
        if side is None or side.low == side.high:
            continue
        width, x = Fraction(side.high) - Fraction(side.low), point[span.variable]
        if span.low is not None:
            away = max(away, (Fraction(span.low) - x) / width)
        if span.high is not None:
            away = max(away, (x - Fraction(span.high)) / width)
    return away


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
