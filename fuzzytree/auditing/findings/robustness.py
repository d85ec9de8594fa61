"""How far rows are from another decision, and gaps from rows."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.contest import decision
from fuzzytree.auditing.decide.costs import Costs, Nearest
from fuzzytree.auditing.decide.cover import Sides
from fuzzytree.auditing.decide.domain import (
    Domain,
    DomainSide,
    contains,
    simplify,
    variable_value,
)
from fuzzytree.auditing.decide.domain import span as ends_on
from fuzzytree.auditing.decide.nearest import nearest
from fuzzytree.auditing.decide.polytopes import Leaves, Polytopes, polytope_of
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
from fuzzytree.auditing.findings.subject import AuditRows, Subject
from fuzzytree.model import Variable
from fuzzytree.numerics import decide, outwards

MOST_ROWS = 50  # rows whose radius is sought by strengths
MOST_ROWS_OF_TREE = 1000  # rows whose radius is sought by regions, which is quick
SHOWN_ROWS = 5  # rows of the smallest radius that have an answer of their own
_PART = 0.9  # of the steps, to seek; the rest is for other codes
_MOST_NAMED = 4  # inputs in a sentence
_MOST_DIGITS = 80  # of an exact number beside a double


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

    def decision(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class at a point, and the leaf or the rule that decides."""
        if isinstance(self.base, Leaves):
            label, leaf = self.base.decision(point)
            return label, f"leaf {leaf}"
        own, place = decision(self.base, point)
        return own, "no rule" if place is None else self.subject.rule_name(place + 1)


# --- the row of the user


def row_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield how a row is decided, and how far the nearest other decision is."""
    if subject.row is None:
        return
    declined = _refusal(subject)
    if declined is not None:
        yield audit_answer("FT204.not-sought", "row", declined)
        return
    point = {name: Fraction(float(subject.row[name])) for name in subject.rules.inputs}
    for variable in subject.rules.variables:
        side = subject.domain.side(variable.name)
        if not contains(subject.domain, [variable], point) and side is not None:
            raise ValueError(
                f"the row lies outside the domain: {variable.name!r} is "
                f"{float(variable_value(variable, point))!r}, and the domain is "
                f"{side.low!r} to {side.high!r}; "
                f"widen it (--limits '{variable.name}=LOW:HIGH')"
            )
    decider = RowDecider(subject)
    label, by = decider.decision(point)
    state = Witness(coordinates(point), (Claim("decides", of=decider.of, label=label),))
    yield audit_answer("FT204.decided", "row", state, facts={"then": label, "by": by})
    result = nearest(decider.base, point, budget=subject.budget)
    yield _radius(decider, "the row", point, result)


def _refusal(subject: Subject) -> Declined | None:
    """Return why rows of a model are declined, None if they are not."""
    if subject.policy.decision != "strongest":
        why = "every rule takes part in the answer, so that no class decides"
        return Declined("FTD07", why)
    if not subject.is_whole:
        return Declined("FTD07", "rules are left out that may decide")
    return None if subject.tree is None else too_many_boxes(subject.tree)


def _radius(
    decider: RowDecider, name: str, point: Mapping[str, Fraction], result: Nearest
) -> AuditAnswer:
    """Return how far a point is from another decision."""
    own, _ = decider.decision(point)
    facts: dict[str, FactValue] = {"name": name, "then": own}
    title = name.removeprefix("the ")
    what = f"the distance from {name} to another decision"
    if result.point is None or result.high is None:
        if result.is_none:
            proof = Proved("other decisions were sought on the whole domain")
            return audit_answer("FT204.alike", title, proof, facts=facts)
        bracket = Bracket(what, outwards(result.low)[0], 1.0, result.why)
        return audit_answer("FT204.none-known", title, bracket, facts=facts)
    other, _ = decider.decision(result.point)
    moved = [axis for axis, value in result.point.items() if value != point[axis]]
    near = simplify(
        {axis: result.point[axis] for axis in moved},
        decider.domain,
        lambda some: decider.decision({**point, **some})[0] == other,
    )
    values = tuple((axis, repr(float(value))) for axis, value in near.items())
    facts |= {"other": other, "moved": values}
    message = "FT204.nearest"
    if len(moved) > _MOST_NAMED:
        message, facts["moved"] = "FT204.nearest-of-many", len(moved)
    claims = (Claim("decides", of=decider.of, label=other),)
    at, high = coordinates(result.point), outwards(result.high)[1]
    state: State = Witness(at, claims)
    if not result.is_narrow:
        low = outwards(result.low)[0]
        state = Bracket(what, low, high, result.why, at, claims)
    return audit_answer(
        message,
        title,
        state,
        distance_measure("certified radius", result.low),
        distance_measure("distance of the witness", result.high),
        facts=facts,
    )


def distance_measure(name: str, value: Fraction) -> Measure:
    """Return a distance in widths of the inputs' ranges, with the exact one if short.

    Where it is not, the double is at most the distance.
    """
    exact = str(value)
    if len(exact) <= _MOST_DIGITS:
        return Measure(f"{name}, in ranges", float(value), exact)
    return Measure(f"{name}, in ranges", outwards(value)[0])


# --- all rows


class _RowRadius(NamedTuple):
    low: Fraction
    number: int
    answer: AuditAnswer


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield how far rows are from another decision: the nearest of them, and in all.

    Systems in which more than one rule answers have no such rows.
    """
    if subject.policy.decision != "strongest":
        return
    declined = _refusal(subject)
    if declined is not None or subject.rows is None:
        needed = Declined("FTD06", "rows are needed (--data TABLE)")
        yield audit_answer("FT204.not-sought", "rows", declined or needed)
        return
    points = row_points(subject, subject.rows)
    decider = RowDecider(subject)
    budget = subject.budget.share(_PART)
    radii: list[_RowRadius] = []
    most = MOST_ROWS if subject.tree is None else MOST_ROWS_OF_TREE
    chosen = [*points.items()][:most]
    for number, point in chosen:
        if budget.is_spent:
            break
        subject.budget.report(f"radius of row {number}", len(radii) / len(chosen))
        result = nearest(decider.base, point, budget=budget)
        is_worth_keeping = result.is_narrow or (not radii and result.high is not None)
        if budget.is_spent and not is_worth_keeping:
            break
        answer = _radius(decider, f"row {number}", point, result)
        radii.append(_RowRadius(result.low, number, answer))
    radii.sort(key=lambda row: row[:2])
    yield _summary(subject.rows, points, radii)
    yield from (row.answer for row in radii[:SHOWN_ROWS])
    if 0 < len(radii) < len(chosen):
        spent = Declined("FTD03", "the budget was spent")
        rest = {"count": len(chosen) - len(radii)}
        yield audit_answer("FT204.more-rows", "more rows", spent, facts=rest)


def row_points(subject: Subject, rows: AuditRows) -> dict[int, dict[str, Fraction]]:
    """Return the user's rows in the domain as points, by number, close calls first.

    Equal rows stand once. A call is close where the margin of the rules is small: there
    another decision tends to be near.
    """
    names, variables = subject.rules.inputs, subject.rules.variables
    margins = decide(subject.rules, rows.values, with_strengths=False).margin
    numbers: dict[tuple[float, ...], int] = {}
    for row in np.argsort(margins, kind="stable").tolist():
        numbers.setdefault(tuple(rows.values[:, row].tolist()), row + 1)
    points = {
        number: dict(zip(names, map(Fraction, values), strict=True))
        for values, number in numbers.items()
        if all(map(math.isfinite, values))
    }
    return {
        number: point
        for number, point in points.items()
        if contains(subject.domain, variables, point)
    }


def _summary(
    rows: AuditRows, points: Mapping[int, object], radii: Sequence[_RowRadius]
) -> AuditAnswer:
    """Return an answer about all rows together; `radii` is in order of their radius."""
    count = Measure("rows evaluated", len(radii))
    if not radii:
        state = Declined("FTD06", "no row lies in the domain")
        if points:
            state = Declined("FTD03", "the budget was spent before the first row")
        return audit_answer("FT204.not-sought", "rows", state, count)
    facts: dict[str, FactValue] = {"total": rows.values.shape[1]}
    different = len({tuple(row) for row in rows.values.T.tolist()})
    if len(points) < different:
        facts["incomplete"] = different - len(points)
    if len(radii) < len(points):
        facts["different"] = len(points)
    median = statistics.median_low([row.low for row in radii])
    return audit_answer(
        "FT204.rows",
        "rows",
        radii[0].answer.state,
        count,
        distance_measure("smallest certified radius", radii[0].low),
        distance_measure("median certified radius", median),
        Measure("row", radii[0].number),
        facts=facts,
    )


# --- gaps


def nearest_rows(
    boxes: Sequence[Sides],
    rows: AuditRows,
    domain: Domain,
    variables: Sequence[Variable],
) -> list[tuple[Fraction, int]]:
    """Return how far each of some boxes is from the nearest row, and its number.

    A gap far from all that was ever seen matters less than one among the rows. Nothing
    is returned without a complete row.
    """
    inputs = [variable.name for variable in variables if not variable.parts]
    sums = [variable for variable in variables if variable.parts]
    costs = Costs(domain, inputs)
    every = [_part(domain, sides, sums) for sides in boxes]
    parts = Polytopes(inputs, [polytope_of(part, inputs, sums) for part in every])
    points = {
        number: dict(zip(inputs, map(Fraction, values), strict=True))
        for number, values in enumerate(rows.values.T.tolist(), 1)
        if all(map(math.isfinite, values))
    }
    bounds = {number: parts.bounds(point, costs) for number, point in points.items()}
    result: list[tuple[Fraction, int]] = []
    for place in range(len(boxes) if points else 0):
        best: tuple[Fraction, int] | None = None
        for number in sorted(points, key=lambda number: bounds[number][place]):
            if best is not None and bounds[number][place] > best[0]:
                break
            low = parts.nearest(points[number], [place], costs).low
            best = (low, number) if best is None or low < best[0] else best
        assert best is not None  # there is a point
        result.append(best)
    return result


def _part(domain: Domain, box: Sides, sums: Sequence[Variable]) -> Domain:
    """Return the part of a domain in a box."""
    sides = {side.variable: side for side in domain.sides}
    combined = {variable.name: variable for variable in sums}
    for name, (low, high) in box.items():
        if name not in sides:
            ends = ends_on(combined[name], domain)
            sides[name] = DomainSide(name, outwards(ends[0])[0], outwards(ends[1])[1])
        whole = sides[name]
        least, most = max(whole.low, float(low)), min(whole.high, float(high))
        values = tuple(x for x in whole.points if least <= x <= most)
        sides[name] = DomainSide(name, least, most, values=values)
    return Domain(tuple(sides.values()))
