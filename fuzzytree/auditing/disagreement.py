"""Where a tree and its raw rules decide differently, and how near that is to rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

import msgspec

from fuzzytree.auditing.records import Answer, Measure
from fuzzytree.auditing.rows import OF_RANGES, Points, distance_measure, points_of
from fuzzytree.auditing.subject import Subject
from fuzzytree.auditing.trees import NOT_LOOKED_AT, too_many
from fuzzytree.numerics.exact import outwards
from fuzzytree.proving.answers import answer_at
from fuzzytree.proving.clock import Clock
from fuzzytree.proving.decisions import decision_at, other_decision
from fuzzytree.proving.domain import Domain
from fuzzytree.proving.ground import Ground, ground, narrowed, strengths_at
from fuzzytree.proving.nearest import Nearest, nearest
from fuzzytree.proving.regions import Region, boxes, leaf_at, regions
from fuzzytree.proving.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.proving.witnesses import is_within
from fuzzytree.proving.wording import answer_text, percent
from fuzzytree.rulebase import RuleBase
from fuzzytree.tree import FuzzyTree

MOST_ROWS = 50
"""Rows around which the nearest disagreement is sought."""

_PART = 0.25  # of the time that is left, for one leaf


def answers(subject: Subject) -> Iterator[Answer]:
    """Yield where a tree and its raw rules differ, leaf by leaf, and near which rows.

    Nothing is asked of a model that is no tree, or has no fitted sets.
    """
    tree, raw = subject.tree, subject.raw
    if tree is None or raw is None:
        return
    found = regions(tree)
    declined = too_many(found)
    if declined is not None:
        yield Answer("FT203", "leaves", NOT_LOOKED_AT, declined, False)
        return
    yield from differing(subject, raw, tree, found)
    if subject.rows is not None:
        both = Both(tree, raw, subject.domain, found)
        points = points_of(subject, subject.rows)
        yield from nearest_difference(both, points, subject.clock)


def differing(
    subject: Subject, raw: RuleBase, tree: FuzzyTree, found: Sequence[Region]
) -> Iterator[Answer]:
    """Yield the leaves in whose regions the raw rules decide otherwise.

    Args:
        subject: The tree as it is audited.
        raw: Its raw rules.
        tree: The tree itself.
        found: Its regions.
    """
    given = ground(raw, subject.domain)
    alike = asked = 0
    for region in found:
        subject.clock.tell(
            f"leaf {region.leaf} against the raw rules", region.leaf / len(found)
        )
        inside = [*boxes(region, tree, subject.domain)]
        subject.clock.check()
        part = subject.clock.share(_PART)
        state = other_in(given, inside, region.label, part)
        asked += len(inside)
        if isinstance(state, Proved):
            alike += 1
        else:
            yield _difference(given, region, state)
    text = f"in {alike} of {len(found)} leaves the raw rules decide as the tree does"
    how = f"all other decisions asked in {asked} boxes of the leaves"
    yield Answer("FT203", "leaves", text, Proved(how), False)


def other_in(
    given: Ground, inside: Sequence[Domain], label: str, clock: Clock
) -> State:
    """Return whether raw rules decide somewhere in some boxes otherwise than a class.

    Args:
        given: The raw rules.
        inside: The boxes.
        label: The class.
        clock: How much time there is.
    """
    left_open: State | None = None
    for box in inside:
        state = other_decision(narrowed(given, box), label, clock, of="raw rules")
        if isinstance(state, Witness):
            tree_too = Claim("decides", of="tree", label=label)
            return Witness(state.point, (tree_too, *state.claims), state.region)
        if not isinstance(state, Proved):
            left_open = left_open or state
    return left_open or Proved(f"{len(inside)} boxes asked")


def _difference(given: Ground, region: Region, state: State) -> Answer:
    name, rules = f"leaf {region.leaf}", (region.leaf,)
    if not isinstance(state, Witness):
        text = f"whether the raw rules decide otherwise in {name} is left open"
        return Answer("FT203", name, text, state, False, rules=rules)
    strengths = strengths_at(given, point_of(state.point))
    best = max(strengths)
    winner = strengths.index(best) + 1
    return Answer(
        code="FT203",
        subject=name,
        sentence=f"in {name} the tree answers {region.label!r}, and somewhere there "
        f"the raw rules answer {answer_text(state.claims[-1].label)}",
        state=state,
        is_finding=True,
        severity="warning",
        rules=rules if not best or (winner,) == rules else (*rules, winner),
        region=state.region,
    )


# --- near rows


class Both:
    """A tree and its raw rules, asked together.

    Args:
        tree: The tree.
        raw: Its raw rules.
        domain: Where they are asked.
        found: The tree's regions.
    """

    def __init__(
        self,
        tree: FuzzyTree,
        raw: RuleBase,
        domain: Domain,
        found: Sequence[Region],
    ) -> None:
        self.tree, self.domain, self.found = tree, domain, found
        self.given = ground(raw, domain)

    def claims(self, point: Mapping[str, Fraction]) -> tuple[Claim, Claim]:
        """Return what both decide at a point."""
        label = self.tree.leaves[leaf_at(self.tree, point) - 1].label
        other = decision_at(self.given, point)
        return (
            Claim("decides", of="tree", label=label),
            Claim("decides", of="raw rules", label=other),
        )

    def differ(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether both decide differently at a point of the domain."""
        one, other = self.claims(point)
        return one.label != other.label and is_within(self.given, point)

    def ask(self, box: Domain, clock: Clock) -> State:
        """Return whether both decide differently somewhere in a box."""
        left_open: State | None = None
        for region in self.found:
            inside = [*boxes(region, self.tree, box)]
            state = other_in(self.given, inside, region.label, clock)
            if isinstance(state, Witness):
                return state
            if not isinstance(state, Proved):
                left_open = left_open or state
        return left_open or Proved("all leaves asked")

    def margin(self, point: Mapping[str, Fraction]) -> Fraction:
        """Return how far the strongest raw rule is ahead of other classes."""
        return answer_at(self.given.rules, point).margin


def nearest_difference(both: Both, points: Points, clock: Clock) -> Iterator[Answer]:
    """Yield how near to a row a tree and its raw rules differ.

    Rows at which they differ already are counted, and then left aside.

    Args:
        both: The two.
        points: The rows.
        clock: How much time there is.
    """
    differ = [number for number, point in points.at if both.differ(point)]
    aside = set(differ)
    alike = [one for one in points.at if one[0] not in aside]
    alike.sort(key=lambda one: both.margin(one[1]))
    search = _Search(both, clock)
    search.run(alike[:MOST_ROWS])
    yield _nearest_answer(both, points, search, len(differ), len(alike))


class _Search:
    """The nearest disagreement to any of some rows, as far as it is known."""

    def __init__(self, both: Both, clock: Clock) -> None:
        self.both, self.clock = both, clock
        self.row = self.asked = 0
        self.low: Fraction | None = None
        self.best: Nearest | None = None
        self.why = ""

    def run(self, rows: Sequence[tuple[int, dict[str, Fraction]]]) -> None:
        for number, point in rows:
            if self.clock.is_over:
                return
            share = self.asked / len(rows)
            self.clock.tell(f"nearest disagreement to row {number}", share)
            self._add(number, self._found(point))
            self.asked += 1

    def _found(self, point: Mapping[str, Fraction]) -> Nearest:
        return nearest(
            self.both.domain,
            point,
            lambda box: self.both.ask(box, self.clock),
            self.both.differ,
            self.clock,
            within=None if self.best is None else self.best.high,
        )

    def _add(self, number: int, found: Nearest) -> None:
        self.low = found.low if self.low is None else min(self.low, found.low)
        if found.high is not None:
            self.best, self.row = found, number
        if found.why and not found.is_narrow:
            self.why = self.why or f"around row {number}: {found.why}"


def _nearest_answer(
    both: Both, points: Points, search: _Search, differ: int, alike: int
) -> Answer:
    measures = [Measure("rows that differ already", differ)]
    measures.append(Measure("rows asked", search.asked))
    before = f"of {points.text} {differ} differ already"
    if not search.asked:
        why = "no row of the domain is decided alike by both"
        if alike:
            why = "the budget was spent before the first row"
        declined = Declined("FTD03" if alike else "FTD06", why)
        text = f"{before}; the nearest disagreement to others is not sought"
        return Answer("FT203", "rows", text, declined, False, measures=tuple(measures))
    some = f"{search.asked} of {alike}" if search.asked < alike else str(alike)
    best, low = search.best, search.low or Fraction(0)
    if best is None or best.point is None or best.high is None:
        state = _no_nearest(search, low)
        text = f"{before}; no disagreement is known around {some} others"
        return Answer("FT203", "rows", text, state, False, measures=tuple(measures))
    measures.append(distance_measure("certified distance", low))
    measures.append(distance_measure("distance of the witness", best.high))
    measures.append(Measure("row", search.row))
    claims = both.claims(best.point)
    state = narrowed_state(
        "the distance of the nearest disagreement", low, best, claims, search.why
    )
    return Answer(
        code="FT203",
        subject="rows",
        sentence=f"{before}; around {some} others the nearest disagreement is "
        f"{percent(best.high)} {OF_RANGES} from row {search.row}",
        state=state,
        is_finding=False,
        measures=tuple(measures),
    )


def _no_nearest(search: _Search, low: Fraction) -> State:
    if search.why:
        name = "the distance of the nearest disagreement"
        return Bracket(name, float(low), 1.0, search.why)
    return Proved("both asked on the whole domain")


def narrowed_state(
    name: str, low: Fraction, found: Nearest, claims: Sequence[Claim], why: str
) -> State:
    """Return how a distance is known: by a witness, or between two bounds.

    Args:
        name: What the distance is.
        low: Its lower bound.
        found: The search for it, which found a point.
        claims: What holds at that point.
        why: Why the bounds are wide, if they are.
    """
    assert found.point is not None  # asked by the caller
    assert found.high is not None
    point = coordinates(found.point)
    if msgspec.structs.replace(found, low=low).is_narrow:
        return Witness(point, tuple(claims))
    high = outwards(found.high)[1]
    return Bracket(name, outwards(low)[0], high, why, point, tuple(claims))
