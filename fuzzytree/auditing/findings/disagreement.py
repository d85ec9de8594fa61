"""Where a tree and its raw rules decide differently, and how near that is to rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

import numpy as np

from fuzzytree.auditing.decide.answers import Budget, OutOfStepsError, Point
from fuzzytree.auditing.decide.answers import Proved as NoPoint
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.contest import Contest, decided
from fuzzytree.auditing.decide.costs import Costs, Nearest
from fuzzytree.auditing.decide.domain import Domain, contains, simplified
from fuzzytree.auditing.decide.nearest import nearest
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.auditing.decide.regions import point_in, regions
from fuzzytree.auditing.decide.search import Search
from fuzzytree.auditing.decide.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.leaves import too_many_boxes
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.rows import (
    DomainRows,
    distance_measure,
    narrowed_state,
    points_of,
    rows_left_out,
)
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import FuzzyTree, RuleBase
from fuzzytree.numerics import decide

MOST_ROWS = 2000
"""Rows around which the nearest disagreement is sought."""

_PART = 0.9  # of the steps, to seek; the rest is for other codes
_LEAF_PART = 0.25  # of the steps that are left, for one leaf

_HINTS = 16  # rows from which a point where both differ is sought at first

_Row = tuple[int, dict[str, Fraction]]


class TreeAndRules:
    """A tree and its raw rules, compared with each other.

    Attributes:
        leaves: The regions of the leaves.
        base: The raw rules.
    """

    def __init__(self, tree: FuzzyTree, raw: RuleBase, domain: Domain) -> None:
        self.tree, self.raw, self.domain = tree, raw, domain
        self.leaves, self.base = Leaves(tree, domain), Base.of(raw, domain)
        self.costs = Costs(domain, tree.inputs)
        labels = dict.fromkeys(self.leaves.labels)
        self.contests = {label: Contest(self.base, label) for label in labels}

    def differ(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether both decide differently at a point of the domain."""
        label, _ = self.leaves.decided(point)
        return label != decided(self.base, point)[0] and contains(
            self.domain, self.tree.variables, point
        )

    def claims(self, point: Mapping[str, Fraction]) -> tuple[Claim, Claim]:
        """Return what both decide at a point."""
        return (
            Claim("decides", of="tree", label=self.leaves.decided(point)[0]),
            Claim("decides", of="raw rules", label=decided(self.base, point)[0]),
        )

    def drawn(self) -> dict[int, dict[str, Fraction]]:
        """Return for leaves a point that was drawn, at which both differ."""
        values = np.array([[*map(float, one)] for one in self.base.samples])
        leaves = decide(self.tree, values).rule
        result: dict[int, dict[str, Fraction]] = {}
        for place in np.flatnonzero(self._differ(values)).tolist():
            leaf, point = int(leaves[place]), self.base.sample(place)
            if leaf not in result and self.differ(point):
                result[leaf] = point
        return result

    def _differ(self, values: np.ndarray) -> np.ndarray:
        """Return at which points in doubles both differ, shape (points,)."""
        own = [leaf.label for leaf in self.tree.leaves]
        other = [self.raw.semantics.uncovered, *(rule.then for rule in self.raw.rules)]
        raw = decide(self.raw, values, with_strengths=False).rule.tolist()
        tree = decide(self.tree, values).rule.tolist()
        pairs = zip(tree, raw, strict=True)
        return np.array([own[leaf - 1] != other[rule] for leaf, rule in pairs])

    def search(
        self,
        part: int,
        point: Mapping[str, Fraction],
        budget: Budget,
        most: Fraction | None = None,
    ) -> Search:
        """Return the search for where both differ in a part of a leaf."""
        contest = self.contests[self.leaves.labels[part]]
        box = self.leaves.boxes[part]
        return Search(
            contest, point, self.costs, budget, part=box, most=most, accepts=self.differ
        )

    def nearest(
        self, row: Mapping[str, Fraction], best: Nearest | None, budget: Budget
    ) -> Nearest:
        """Return the nearest point to a row where both differ, nearer than a best."""
        most = None if best is None else best.high
        low, result, why = most, Nearest(Fraction(1), is_none=True), ""
        bounds = self.leaves.parts.bounds(row, self.costs)
        for part in sorted(range(len(bounds)), key=bounds.__getitem__):
            if most is not None and bounds[part] >= most:
                break
            near = self.search(part, row, budget, most).run()
            why = why or near.why
            if near.high is not None or most is not None or near.why:
                low = near.low if low is None else min(low, near.low)
            if near.high is not None:
                most, result = near.high, near
        if low is None:
            return result
        low = max(low, Fraction(0))
        return Nearest(low, result.high, result.point, why)


def nearest_difference(
    both: TreeAndRules,
    points: DomainRows,
    subject: Subject,
    *,
    known: Sequence[Mapping[str, Fraction]] = (),
    is_alike: bool = False,
) -> Iterator[AuditAnswer]:
    """Yield how near to a row a tree and its raw rules differ.

    Rows at which they differ already are counted, and then left aside.
    """
    alike = [(n, point) for n, point in points.at if not both.differ(point)]
    differ = [point for _, point in points.at if both.differ(point)]
    search = _Rows(both, alike[:MOST_ROWS], subject)
    if is_alike:
        search.count = len(search.rows)
    else:
        search.run([*differ, *known])
    yield _nearest_answer(points, search, len(differ), len(alike))
    if 0 < search.count < len(search.rows):
        yield rows_left_out("FT203", len(search.rows) - search.count)


class _Rows:
    """The nearest disagreement to any of some rows, as far as it is known.

    Attributes:
        count: How many rows were settled: around them none is nearer than `low`.
        low: Nearer than this there is none; None if there is none at all.
        best: The nearest one that is known, and `row` the number of its row.
        why: Why more is not known.
    """

    def __init__(
        self, both: TreeAndRules, rows: Sequence[_Row], subject: Subject
    ) -> None:
        self.both, self.rows, self.subject = both, rows, subject
        self.budget = subject.budget.share(_PART)
        self.count = self.row = 0
        self.low: Fraction | None = None
        self.best: Nearest | None = None
        self.why = ""

    def run(self, points: Sequence[Mapping[str, Fraction]]) -> None:
        """Look around one row after the other, no farther than the best one is.

        `points`: where both differ; the rows that are nearest to one come first.
        """
        costs, leaves = self.both.costs, self.both.leaves
        order: list[tuple[float, int]] = []
        for place, (number, row) in enumerate(self.rows):
            self._hint(number, row, points)
            chosen = leaves.chosen(leaves.decided(row)[0], None)
            bounds = leaves.parts.bounds(row, costs)
            order.append((min((bounds[n] for n in chosen), default=1.0), place))
        order.sort()
        for _, place in order[:_HINTS]:  # just beyond a cut both may differ
            number, row = self.rows[place]
            beyond = nearest(leaves, row, budget=self.budget).point
            if beyond is not None and self.both.differ(beyond):
                self._hint(number, row, [beyond])
        for _, place in order:
            if self.budget.is_spent:
                self.why = self.why or "the budget was spent"
                return
            number, row = self.rows[place]
            share = self.count / len(self.rows)
            text = f"nearest disagreement to row {number}"
            self.subject.budget.report(text, share)
            result = self.both.nearest(row, self.best, self.budget)
            if result.is_none:  # and so for all of them: it covered the domain
                self.count, self.low = len(self.rows), None
                return
            self.low = result.low if self.low is None else min(self.low, result.low)
            if result.why and not result.is_narrow:
                self.why = self.why or f"around row {number}: {result.why}"
            if result.point is not None:
                self.best, self.row = result, number
            self.count += 1

    def _hint(
        self,
        number: int,
        row: Mapping[str, Fraction],
        points: Sequence[Mapping[str, Fraction]],
    ) -> None:
        """Keep a point at which both differ, if it is nearer than the best."""
        for point in points:
            away = self.both.costs.distance(row, point)
            high = None if self.best is None else self.best.high
            if high is None or away < high:
                self.best, self.row = Nearest(away, away, dict(point)), number


def _nearest_answer(
    points: DomainRows, search: _Rows, differ: int, alike: int
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
    claims = search.both.claims(best.point)
    state = narrowed_state(
        "the distance of the nearest disagreement", low, best, claims, search.why
    )
    return audit_answer(
        "FT203.nearest", "rows", state, measures=tuple(measures), facts=facts
    )


def _no_nearest(search: _Rows, low: Fraction) -> State:
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
    declined = too_many_boxes(regions(tree))
    if declined is not None:
        yield audit_answer("FT203.leaves-declined", "leaves", declined)
        return
    both = TreeAndRules(tree, raw, subject.domain)
    known: list[dict[str, Fraction]] = []
    is_alike = True
    drawn = both.drawn()
    alike = 0
    for leaf in range(1, len(tree.leaves) + 1):
        subject.budget.report(
            f"leaf {leaf} against the raw rules", leaf / len(tree.leaves)
        )
        budget = subject.budget.share(_LEAF_PART)
        point, state = _leaf_difference(both, leaf, drawn.get(leaf), budget)
        if point is not None:
            known.append(point)
        if isinstance(state, Proved):
            alike += 1
        else:
            is_alike = False
            yield _difference(both, leaf, point, state)
    count = len(both.leaves.boxes)
    how = f"all other decisions were sought in {count} boxes of the leaves"
    facts = {"alike": alike, "leaves": len(tree.leaves)}
    yield audit_answer("FT203.leaves", "leaves", Proved(how), facts=facts)
    if subject.rows is not None:
        points = points_of(subject, subject.rows)
        yield from nearest_difference(
            both, points, subject, known=known, is_alike=is_alike
        )


def _leaf_difference(
    both: TreeAndRules, leaf: int, point: dict[str, Fraction] | None, budget: Budget
) -> tuple[dict[str, Fraction] | None, State]:
    """Return a point of a leaf at which both differ, and the state of the answer."""
    why = ""
    for part, number in enumerate(both.leaves.numbers):
        if number != leaf or point is not None:
            continue
        start = point_in(both.leaves.boxes[part], both.tree)
        if start is None:
            continue
        try:
            answer = both.search(part, start, budget).any()
        except OutOfStepsError:
            why = why or "the budget was spent"
            continue
        if isinstance(answer, Point):
            point = dict(answer.values)
        elif not isinstance(answer, NoPoint):
            why = why or answer.why
    if point is not None:
        label = decided(both.base, point)[0]
        near = simplified(
            point,
            both.domain,
            lambda other: (
                both.differ(other)
                and both.leaves.decided(other)[1] == leaf
                and decided(both.base, other)[0] == label
            ),
        )
        return near, Witness(coordinates(near), both.claims(near))
    if why:
        return None, Declined("FTD03", why)
    return None, Proved("")


def _difference(
    both: TreeAndRules, leaf: int, point: dict[str, Fraction] | None, state: State
) -> AuditAnswer:
    name, rules = f"leaf {leaf}", [leaf]
    if point is None:
        return audit_answer("FT203.open", name, state, rules=(leaf,))
    other, place = decided(both.base, point)
    if place is not None and place + 1 != leaf:
        rules.append(place + 1)
    facts = {"then": both.tree.leaves[leaf - 1].label, "other": other}
    return audit_answer("FT203.differs", name, state, rules=tuple(rules), facts=facts)
