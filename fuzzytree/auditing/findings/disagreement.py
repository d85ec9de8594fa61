"""Where a tree and its raw rules decide differently, and how near that is to rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.engine.arrangement import (
    Arrangement,
    arrange,
    restricted,
    strengths_at,
)
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.decisions import (
    BoxBounds,
    columns,
    decision_at,
    other_decision,
)
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.nearest import NARROW, Nearest, nearest
from fuzzytree.auditing.engine.regions import Region, boxes, leaf_at, regions
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    State,
    Witness,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.leaves import too_many_boxes
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.robustness import CrispDecider
from fuzzytree.auditing.findings.rows import (
    DomainRows,
    distance_measure,
    narrowed_state,
    points_of,
    rows_left_out,
)
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import FuzzyTree, RuleBase
from fuzzytree.numerics import decide, outwards

MOST_ROWS = 2000
"""Rows around which the nearest disagreement is sought."""

_LEAF_PART = 0.25  # of the time that is left, for one leaf
_PART = 0.9  # of the time, to seek; the rest is for the answers
_HINTS = 16  # rows from which a point where both differ is sought by doubles


class TreeAndRules:
    """A tree and its raw rules, compared with each other."""

    def __init__(
        self,
        tree: FuzzyTree,
        raw: RuleBase,
        domain: Domain,
        leaf_regions: Sequence[Region],
    ) -> None:
        self.tree, self.domain, self.leaf_regions = tree, domain, leaf_regions
        self.arrangement = arrange(raw, domain)
        self.crisp = CrispDecider(tree, domain)
        self.around = BoxBounds(raw, domain)

    def claims(self, point: Mapping[str, Fraction]) -> tuple[Claim, Claim]:
        """Return what both decide at a point."""
        label = self.tree.leaves[leaf_at(self.tree, point) - 1].label
        other = decision_at(self.arrangement, point)
        return (
            Claim("decides", of="tree", label=label),
            Claim("decides", of="raw rules", label=other),
        )

    def differ(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether both decide differently at a point of the domain."""
        one, other = self.claims(point)
        return one.label != other.label and is_within(self.arrangement, point)

    def disagree(self, box: Domain, clock: Clock) -> State:
        """Return whether both decide differently somewhere in a box."""
        left_open: State | None = None
        for region in self.leaf_regions:
            inside = [*boxes(region, self.tree, box)]
            state = other_in_boxes(self.arrangement, inside, region.label, clock)
            if isinstance(state, Witness):
                return state
            if not isinstance(state, Proved):
                left_open = left_open or state
        return left_open or Proved("all leaves compared")

    def clear_of_cuts(self, point: Mapping[str, Fraction], label: str | None) -> float:
        """Return a radius within which the tree decides alike, by doubles."""
        return self.crisp.bound(point, label)


def other_in_boxes(
    arrangement: Arrangement, inside: Sequence[Domain], label: str, clock: Clock
) -> State:
    """Return whether raw rules decide for another class somewhere in some boxes."""
    left_open: State | None = None
    for box in inside:
        state = other_decision(
            restricted(arrangement, box), label, clock, of="raw rules"
        )
        if isinstance(state, Witness):
            tree_too = Claim("decides", of="tree", label=label)
            return Witness(state.point, (tree_too, *state.claims), state.region)
        if not isinstance(state, Proved):
            left_open = left_open or state
    return left_open or Proved(f"{len(inside)} boxes compared")


class _Row(NamedTuple):
    """A row at which both decide alike: its number, values, class, distance to cuts."""

    number: int
    point: dict[str, Fraction]
    label: str | None
    cut: float


def nearest_difference(
    both: TreeAndRules,
    points: DomainRows,
    clock: Clock,
    *,
    known: Sequence[Mapping[str, Fraction]] = (),
    is_alike: bool = False,
) -> Iterator[AuditAnswer]:
    """Yield how near to a row a tree and its raw rules differ.

    Rows at which they differ already are counted, and then left aside.
    """
    inputs = both.tree.inputs
    values = columns([point for _, point in points.at], inputs)
    tree = decide(both.tree, values)
    raw = decide(both.arrangement.rules, values, with_strengths=False)
    alike: list[_Row] = []
    differ: list[Mapping[str, Fraction]] = []
    for place in np.argsort(raw.margin, kind="stable").tolist():
        number, point = points.at[place]
        label = both.tree.leaves[int(tree.rule[place]) - 1].label
        if label == answer_of(both.arrangement.rules, int(raw.rule[place])):
            cut = both.clear_of_cuts(point, label)
            alike.append(_Row(number, point, label, cut))
        else:
            differ.append(point)
    search = _Search(both, alike[:MOST_ROWS], clock)
    if is_alike:
        search.count = len(search.rows)
    else:
        search.run([*differ, *known])
    yield _nearest_answer(points, search, len(differ), len(alike))
    if 0 < search.count < len(search.rows):
        yield rows_left_out("FT203", len(search.rows) - search.count)


def answer_of(rules: RuleBase, number: int) -> str | None:
    """Return what rules answer where a rule wins, by its number; 0 is none."""
    return rules.rules[number - 1].then if number else rules.semantics.uncovered


class _Search:
    """The nearest disagreement to any of some rows, as far as it is known.

    Attributes:
        count: How many rows were settled: around them none is nearer than `low`.
        low: Nearer than this there is none; None if there is none at all.
        best: The nearest one that is known, and `row` the number of its row.
        claims: What both decide there.
        why: Why more is not known.
    """

    def __init__(self, both: TreeAndRules, rows: Sequence[_Row], clock: Clock) -> None:
        self.both, self.rows, self.clock = both, rows, clock
        self.end = clock.share(_PART)
        self.count = self.row = 0
        self.low: Fraction | None = None
        self.best: Nearest | None = None
        self.claims: tuple[Claim, ...] = ()
        self.why = ""

    def run(self, points: Sequence[Mapping[str, Fraction]]) -> None:
        """Look around one row after the other, no farther than the best one is.

        `points`: where both may differ; the rows that are nearest to one come first.
        """
        try:
            if self.rows:
                self._run(points)
        except OutOfTimeError:
            self.why = "the budget was spent"

    def _run(self, points: Sequence[Mapping[str, Fraction]]) -> None:
        inputs, around = self.both.tree.inputs, self.both.around
        values = columns([row.point for row in self.rows], inputs)
        some = self.rows[:_HINTS]
        near, away = around.approached(values[:, :_HINTS], [row.label for row in some])
        moved = near[:, away < np.inf].T.tolist()
        points = [
            *points,
            *(dict(zip(inputs, map(Fraction, one), strict=True)) for one in moved),
        ]
        hints = around.pairs(values, columns(points, inputs))
        for place in np.argsort([far for _, far in hints], kind="stable").tolist():
            row, (hint, far) = self.rows[place], hints[place]
            share = self.count / len(self.rows)
            self.clock.report(f"nearest disagreement to row {row.number}", share)
            if not self._is_clear(row):
                result = nearest(
                    self.both.domain,
                    row.point,
                    lambda box: self.both.disagree(box, self.end),
                    self.both.differ,
                    self.end,
                    within=None if self.best is None else self.best.high,
                    near=[points[hint]] if far < np.inf else (),
                )
                if result.is_none:  # and so for all of them: it covered the domain
                    self.count, self.low = len(self.rows), None
                    return
                self._keep(row, result)
            self.count += 1
            if self.end.is_over and self.count < len(self.rows):
                self.why = self.why or "the budget was spent"
                return

    def _keep(self, row: _Row, result: Nearest) -> None:
        """Keep what is known around a row, and its point if it is the nearest."""
        self._lower(result.low)
        high, best = result.high, None if self.best is None else self.best.high
        if result.why and not result.is_narrow:
            self.why = self.why or f"around row {row.number}: {result.why}"
        if result.point is not None and high is not None and (not best or high < best):
            self.claims = self.both.claims(result.point)
            self.best, self.row = result, row.number

    def _lower(self, low: Fraction) -> None:
        self.low = low if self.low is None else min(self.low, low)

    def _is_clear(self, row: _Row) -> bool:
        """Return whether bounds show that both agree around a row, up to the best."""
        if self.best is None or self.best.high is None:
            return False
        radius = max(self.best.low, self.best.high * (1 - NARROW))
        around = self.both.around
        centre = columns([row.point], around.inputs)
        ball = around.ball(centre, outwards(radius)[1])
        if row.cut < radius or not around.is_clear(*ball, [row.label]).all():
            return False
        self._lower(radius)
        return True


def _nearest_answer(
    points: DomainRows, search: _Search, differ: int, alike: int
) -> AuditAnswer:
    measures = [Measure("rows that differ already", differ)]
    measures.append(Measure("rows evaluated", search.count))
    facts = points.facts
    count = search.count
    if not count:
        why = "no row of the domain is decided alike by both"
        if alike:
            why = "the budget was spent before the first row"
        declined = Declined("FTD03" if alike else "FTD06", why)
        return audit_answer(
            "FT203.not-sought",
            "rows",
            declined,
            measures=tuple(measures),
            facts=facts,
        )
    if count < alike:
        facts["others"] = alike
    best, low = search.best, search.low or Fraction(0)
    if best is None or best.point is None or best.high is None:
        state = _no_nearest(search, low)
        return audit_answer(
            "FT203.none-known", "rows", state, measures=tuple(measures), facts=facts
        )
    measures.append(distance_measure("certified distance", low))
    measures.append(distance_measure("distance of the witness", best.high))
    measures.append(Measure("row", search.row))
    state = narrowed_state(
        "the distance of the nearest disagreement", low, best, search.claims, search.why
    )
    return audit_answer(
        "FT203.nearest", "rows", state, measures=tuple(measures), facts=facts
    )


def _no_nearest(search: _Search, low: Fraction) -> State:
    if search.why:
        name = "the distance of the nearest disagreement"
        return Bracket(name, float(low), 1.0, search.why)
    return Proved("both were compared on the whole domain")


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield where a tree and its raw rules differ, leaf by leaf, and near which rows.

    Only trees with fitted sets have raw rules.
    """
    tree, raw = subject.tree, subject.raw
    if tree is None or raw is None:
        return
    leaf_regions = regions(tree)
    declined = too_many_boxes(leaf_regions)
    if declined is not None:
        yield audit_answer("FT203.leaves-declined", "leaves", declined)
        return
    known: list[AuditAnswer] = []
    for answer in leaf_differences(subject, raw, tree, leaf_regions):
        known.append(answer)
        yield answer
    if subject.rows is not None:
        both = TreeAndRules(tree, raw, subject.domain, leaf_regions)
        points = points_of(subject, subject.rows)
        points_known = [
            point_of(one.state.point) for one in known if isinstance(one.state, Witness)
        ]
        # Only the answer about all leaves is left where they are alike everywhere.
        is_alike = len(known) == 1
        yield from nearest_difference(
            both, points, subject.clock, known=points_known, is_alike=is_alike
        )


def leaf_differences(
    subject: Subject, raw: RuleBase, tree: FuzzyTree, leaf_regions: Sequence[Region]
) -> Iterator[AuditAnswer]:
    """Yield the leaves in whose regions the raw rules decide differently."""
    arrangement = arrange(raw, subject.domain)
    alike = count = 0
    for region in leaf_regions:
        subject.clock.report(
            f"leaf {region.leaf} against the raw rules", region.leaf / len(leaf_regions)
        )
        inside = [*boxes(region, tree, subject.domain)]
        subject.clock.check()
        part = subject.clock.share(_LEAF_PART)
        state = other_in_boxes(arrangement, inside, region.label, part)
        count += len(inside)
        if isinstance(state, Proved):
            alike += 1
        else:
            yield _difference(arrangement, region, state)
    how = f"all other decisions were sought in {count} boxes of the leaves"
    facts = {"alike": alike, "leaves": len(leaf_regions)}
    yield audit_answer("FT203.leaves", "leaves", Proved(how), facts=facts)


def _difference(arrangement: Arrangement, region: Region, state: State) -> AuditAnswer:
    name = f"leaf {region.leaf}"
    rules: tuple[int, ...] = (region.leaf,)
    if not isinstance(state, Witness):
        return audit_answer("FT203.open", name, state, rules=rules)
    strengths = strengths_at(arrangement, point_of(state.point))
    best = max(strengths)
    winner = strengths.index(best) + 1
    if best and winner != region.leaf:
        rules = (*rules, winner)
    facts = {"then": region.label, "other": state.claims[-1].label}
    span = state.region
    return audit_answer(
        "FT203.differs", name, state, rules=rules, region=span, facts=facts
    )
