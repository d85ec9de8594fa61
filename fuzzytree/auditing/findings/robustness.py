"""How far a row is from the nearest other decision: its certified radius."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.engine.arrangement import arrange, restricted, strengths_at
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.decisions import (
    BoxBounds,
    columns,
    decision_at,
    other_decision,
)
from fuzzytree.auditing.engine.domain import Domain, contains, variable_value
from fuzzytree.auditing.engine.nearest import (
    NARROW,
    Nearest,
    Polytope,
    Polytopes,
    nearest,
    polytope_of,
)
from fuzzytree.auditing.engine.regions import boxes, leaf_at, regions
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    Representation,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.engine.witnesses import is_within, simplified
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
from fuzzytree.model import FuzzyTree
from fuzzytree.numerics import outwards

Point = dict[str, Fraction]

_HALVINGS = 16  # of a radius, to find one within which bounds decide the class


def decider_of(subject: Subject) -> Decider:
    """Return what decides: the regions of a tree, or the strengths of rules."""
    if subject.tree is not None:
        return CrispDecider(subject.tree, subject.domain)
    return RuleDecider(subject)


class CrispDecider:
    """A tree, by the regions of its leaves."""

    of: Representation = "tree"

    def __init__(self, tree: FuzzyTree, domain: Domain) -> None:
        self.tree, self.domain = tree, domain
        self.labels: list[str] = []
        parts: list[Polytope] = []
        variables = {variable.name: variable for variable in tree.variables}
        for region in regions(tree):
            for box in boxes(region, tree, domain):
                self.labels.append(region.label)
                parts.append(polytope_of(box, tree.inputs, variables))
        self.polytopes = Polytopes(domain, tree.inputs, parts)

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class of the leaf that a point reaches, and the leaf."""
        leaf = leaf_at(self.tree, point)
        return self.tree.leaves[leaf - 1].label, f"leaf {leaf}"

    def leaves_out(self, label: str | None) -> bool:
        """Return False: regions are exact, and have no strengths."""
        del label
        return False

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest region of another class is."""
        label, _ = self.decided(point)
        return self.polytopes.nearest(point, self._others(label), clock)

    def bound(self, point: Mapping[str, Fraction], label: str | None) -> float:
        """Return a radius within which no region of another class is, by doubles."""
        bounds = self.polytopes.bounds(point)
        return min((bounds[number] for number in self._others(label)), default=np.inf)

    def _others(self, label: str | None) -> list[int]:
        return [number for number, own in enumerate(self.labels) if own != label]


class RuleDecider:
    """Rules of which the strongest decides."""

    of: Representation = "rules"

    def __init__(self, subject: Subject) -> None:
        self.subject, self.domain = subject, subject.domain
        self.arrangement = arrange(subject.rules, subject.domain)
        self.around = BoxBounds(subject.rules, subject.domain)

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class of the first of the strongest rules, and the rule."""
        strengths = strengths_at(self.arrangement, point)
        best = max(strengths)
        if not best:
            return self.subject.rules.semantics.uncovered, "no rule"
        number = strengths.index(best) + 1
        label = self.subject.rules.rules[number - 1].then
        return label, self.subject.rule_name(number)

    def leaves_out(self, label: str | None) -> bool:
        """Return whether a rule of another class stands before one of a class's.

        It wins where both are equally strong, and only sets with an interior are
        searched.
        """
        order = [rule.then == label for rule in self.subject.rules.rules]
        return any(order) and not all(order[: len(order) - order[::-1].index(True)])

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest point is where a rule of another class wins."""
        label = decision_at(self.arrangement, point)
        inputs = self.subject.rules.inputs
        ahead, far = self.around.approached(columns([point], inputs), [label])
        hint = dict(zip(inputs, map(Fraction, ahead[:, 0].tolist()), strict=True))
        away = float(far[0])

        def is_one(other: Mapping[str, Fraction]) -> bool:
            return is_within(self.arrangement, other) and (
                decision_at(self.arrangement, other) != label
            )

        return nearest(
            self.subject.domain,
            point,
            lambda box: other_decision(restricted(self.arrangement, box), label, clock),
            is_one,
            clock,
            clear=self._clear(point, label, away),
            near=[hint] if away < np.inf else (),
        )

    def _clear(
        self, point: Mapping[str, Fraction], label: str | None, away: float
    ) -> Fraction | None:
        """Return a radius within which bounds in doubles decide the class."""
        centre = columns([point], self.subject.rules.inputs)
        top = min(away, 1.0) * (1.0 - float(NARROW))
        radii = [top * 0.5**number for number in range(_HALVINGS)]
        balls = [self.around.ball(centre, radius) for radius in radii]
        low, high = (np.concatenate(ends, axis=1) for ends in zip(*balls, strict=True))
        clear = self.around.is_clear(low, high, [label] * len(radii))
        return Fraction(radii[int(clear.argmax())]) if clear.any() else None


Decider = CrispDecider | RuleDecider

MOST_ROWS = 50
"""Rows whose radius is sought by strengths."""

MOST_ROWS_OF_TREE = 1000
"""Rows whose radius is sought by regions, which is quick."""

SHOWN_ROWS = 5
"""Rows of the smallest radius that have an answer of their own."""

_PART = 0.9  # of the time, to seek; the rest is for the answers
_MOST_NAMED = 4  # inputs in a sentence


# --- a row


def radius(subject: Subject, row: Mapping[str, float]) -> AuditAnswer:
    """Return how far the nearest point is that is decided otherwise than a row.

    Raises:
        ValueError: If the row lies outside the domain.
    """
    point = _point(subject, row)
    decider = decider_of(subject)
    result = decider.nearest_other(point, subject.clock)
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
    label, by = decider_of(subject).decided(point)
    claim = Claim("decides", of=decider_of(subject).of, label=label)
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
    decider: Decider, name: str, point: Mapping[str, Fraction], result: Nearest
) -> AuditAnswer:
    own, _ = decider.decided(point)
    facts: dict[str, FactValue] = {"name": name, "then": own}
    if decider.leaves_out(own):  # rules of other classes go first in a tie
        facts["aside"] = 1
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
    decider = decider_of(subject)
    clock = subject.clock.share(_PART)
    radii: list[_RowRadius] = []
    most = MOST_ROWS if subject.tree is None else MOST_ROWS_OF_TREE
    chosen = points.at[:most]
    for number, point in chosen:
        if clock.is_over:
            break
        subject.clock.report(f"radius of row {number}", len(radii) / len(chosen))
        result = decider.nearest_other(point, clock)
        is_worth_keeping = result.is_narrow or (not radii and result.high is not None)
        if clock.is_over and not is_worth_keeping:
            break
        answer = _answer(decider, f"row {number}", point, result)
        is_aside = decider.leaves_out(decider.decided(point)[0])
        radii.append(_RowRadius(number, result.low, answer, is_aside))
    radii.sort(key=lambda one: (one.low, one.number))
    yield _in_all(points, radii)
    yield from (one.answer for one in radii[:SHOWN_ROWS])
    if 0 < len(radii) < len(chosen):
        yield rows_left_out("FT204", len(chosen) - len(radii))


class _RowRadius(NamedTuple):
    number: int
    low: Fraction
    answer: AuditAnswer
    is_aside: bool


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
    if any(one.is_aside for one in radii):
        facts["aside"] = 1
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
