"""How far a row is from the nearest other decision: its certified radius."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple, Protocol

from fuzzytree.auditing.disagreement import narrowed_state
from fuzzytree.auditing.records import Answer, Measure
from fuzzytree.auditing.rows import OF_RANGES, Points, distance_measure, points_of
from fuzzytree.auditing.subject import Subject
from fuzzytree.auditing.trees import too_many
from fuzzytree.numerics.exact import outwards
from fuzzytree.proving.clock import Clock
from fuzzytree.proving.decisions import decision_at, other_decision
from fuzzytree.proving.domain import Domain
from fuzzytree.proving.ground import ground, narrowed, strengths_at
from fuzzytree.proving.nearest import Nearest, nearest, nearest_box
from fuzzytree.proving.polytopes import Polytope, Polytopes, polytope_of
from fuzzytree.proving.regions import boxes, leaf_at, regions
from fuzzytree.proving.states import (
    Bracket,
    Carrier,
    Claim,
    Declined,
    Proved,
    State,
    Witness,
    coordinates,
)
from fuzzytree.proving.variables import contains, variable_value
from fuzzytree.proving.witnesses import is_within
from fuzzytree.proving.wording import answer_text, number_text, percent
from fuzzytree.tree import FuzzyTree

MOST_ROWS = 50
"""Rows whose radius is sought."""

SHOWN_ROWS = 5
"""Rows of the smallest radius that have an answer of their own."""

_MOST_NAMED = 4  # inputs in a sentence


class Decider(Protocol):
    """A model that decides, asked exactly."""

    of: Carrier

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the answer at a point, and what gave it."""
        ...

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest point with another answer is."""
        ...


class CrispDecider:
    """A tree, by the regions of its leaves.

    Args:
        subject: The tree as it is audited.
        tree: The tree itself.
    """

    of: Carrier = "tree"

    def __init__(self, subject: Subject, tree: FuzzyTree) -> None:
        self.tree, self.domain = tree, subject.domain
        self.boxes: list[tuple[str, Domain]] = []
        parts: list[Polytope] = []
        variables = {variable.name: variable for variable in tree.variables}
        for region in regions(tree):
            for box in boxes(region, tree, subject.domain):
                self.boxes.append((region.label, box))
                parts.append(polytope_of(box, tree.inputs, variables))
        self.is_plain = not any(variable.parts for variable in tree.variables)
        self.polytopes = Polytopes(subject.domain, tree.inputs, parts)

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class of the leaf that a point reaches, and the leaf."""
        leaf = leaf_at(self.tree, point)
        return self.tree.leaves[leaf - 1].label, f"leaf {leaf}"

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest region of another class is."""
        label, _ = self.decided(point)
        chosen = [n for n, (other, _) in enumerate(self.boxes) if other != label]
        if self.is_plain:
            others = [self.boxes[number][1] for number in chosen]
            return nearest_box(self.domain, point, others)
        return self.polytopes.nearest(point, chosen, clock)


class RuleDecider:
    """Rules of which the strongest decides.

    Args:
        subject: The rules as they are audited.
    """

    of: Carrier = "rules"

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self.given = ground(subject.rules, subject.domain)

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class of the first of the strongest rules, and the rule."""
        strengths = strengths_at(self.given, point)
        best = max(strengths)
        if not best:
            return self.subject.rules.semantics.uncovered, "no rule"
        number = strengths.index(best) + 1
        label = self.subject.rules.rules[number - 1].then
        return label, self.subject.rule_name(number)

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest point is where a rule of another class wins."""
        label = decision_at(self.given, point)

        def is_one(other: Mapping[str, Fraction]) -> bool:
            decided = decision_at(self.given, other)
            return decided != label and is_within(self.given, other)

        return nearest(
            self.subject.domain,
            point,
            lambda box: other_decision(narrowed(self.given, box), label, clock),
            is_one,
            clock,
        )


# --- a row


def radius(subject: Subject, row: Mapping[str, float]) -> Answer:
    """Return how far the nearest point is that is decided otherwise than a row.

    Args:
        subject: The model, of which one class decides.
        row: A value for each input.

    Raises:
        ValueError: If the row lies outside the domain.
    """
    point = _point(subject, row)
    decider = decider_of(subject)
    found = decider.nearest_other(point, subject.clock)
    return _answer(decider, "the row", point, found)


def row_answers(subject: Subject, row: Mapping[str, float]) -> Iterator[Answer]:
    """Yield how a row is decided, and how far the nearest other decision is.

    Args:
        subject: The model; nothing is asked where more than one rule answers.
        row: A value for each input.

    Raises:
        ValueError: If the row lies outside the domain.
    """
    declined = _declined(subject)
    if declined is not None:
        yield Answer("FT204", "row", NOT_SOUGHT, declined, False)
        return
    point = _point(subject, row)
    label, by = decider_of(subject).decided(point)
    claim = Claim("decides", of=decider_of(subject).of, label=label)
    yield Answer(
        code="FT204",
        subject="row",
        sentence=f"the row is decided as {answer_text(label)} by {by}",
        state=Witness(coordinates(point), (claim,)),
        is_finding=False,
    )
    yield radius(subject, row)


NOT_SOUGHT = "the nearest other decision is not sought"


def _declined(subject: Subject) -> Declined | None:
    """Return why no row of a model is asked about, None if rows are."""
    if subject.policy.decision != "strongest":
        why = "every rule takes part in the answer, so that no class decides"
        return Declined("FTD07", why)
    if not subject.is_whole:
        return Declined("FTD07", "rules are left out that may decide")
    return None if subject.tree is None else too_many(regions(subject.tree))


def decider_of(subject: Subject) -> Decider:
    """Return a model as it is asked: trees by regions, rules by strengths."""
    if subject.tree is not None:
        return CrispDecider(subject, subject.tree)
    return RuleDecider(subject)


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
    decider: Decider, name: str, point: Mapping[str, Fraction], found: Nearest
) -> Answer:
    own, _ = decider.decided(point)
    what = f"the distance from {name} to another decision"
    if found.point is None or found.high is None:
        if found.is_none:
            text = f"all of the domain is decided as {name}, {answer_text(own)}"
            state: State = Proved("other decisions asked on the whole domain")
        else:
            text = f"no decision other than {answer_text(own)} is known around {name}"
            state = Bracket(what, outwards(found.low)[0], 1.0, found.why)
        return Answer("FT204", name.removeprefix("the "), text, state, False)
    other, _ = decider.decided(found.point)
    claim = Claim("decides", of=decider.of, label=other)
    moved = [axis for axis, value in found.point.items() if value != point[axis]]
    changed = " and ".join(
        f"{axis!r} is {_moved(found.point[axis], point[axis])}" for axis in moved
    )
    if len(moved) > _MOST_NAMED:
        changed = f"{len(moved)} inputs move by no more than {percent(found.high)}"
    text = (
        f"{name} stays {answer_text(own)} within {percent(found.low)} {OF_RANGES}; "
        f"where {changed} it is {answer_text(other)}"
    )
    return Answer(
        code="FT204",
        subject=name.removeprefix("the "),
        sentence=text,
        state=narrowed_state(what, found.low, found, [claim], found.why),
        is_finding=False,
        measures=(
            distance_measure("certified radius", found.low),
            distance_measure("distance of the witness", found.high),
        ),
    )


def _moved(value: Fraction, own: Fraction) -> str:
    """Return a value in so many digits that it looks unlike the row's own."""
    near = float(value)
    if number_text(near) != number_text(float(own)):
        return number_text(near)
    if near != float(own):
        return repr(near)
    return f"a hair {'above' if value > own else 'below'} {near!r}"


# --- all rows


def answers(subject: Subject) -> Iterator[Answer]:
    """Yield how far rows are from another decision: the nearest of them, and in all.

    Nothing is asked where more than one rule answers.
    """
    if subject.policy.decision != "strongest":
        return
    declined = _declined(subject)
    if declined is None and subject.rows is None:
        declined = Declined("FTD06", "rows are needed (--data TABLE)")
    if declined is not None or subject.rows is None:
        assert declined is not None  # set above where there are no rows
        yield Answer("FT204", "rows", NOT_SOUGHT, declined, False)
        return
    points = points_of(subject, subject.rows)
    decider = decider_of(subject)
    asked: list[_Asked] = []
    for number, point in points.at[:MOST_ROWS]:
        if subject.clock.is_over:
            break
        subject.clock.tell(f"radius of row {number}", len(asked) / len(points.at))
        found = decider.nearest_other(point, subject.clock)
        if subject.clock.is_over and not found.is_narrow:
            break
        asked.append(_Asked(number, point, found))
    asked.sort(key=lambda one: (one.found.low, one.number))
    yield _in_all(decider, points, asked)
    for one in asked[:SHOWN_ROWS]:
        yield _answer(decider, f"row {one.number}", one.point, one.found)


class _Asked(NamedTuple):
    number: int
    point: dict[str, Fraction]
    found: Nearest


def _in_all(decider: Decider, points: Points, asked: Sequence[_Asked]) -> Answer:
    """Return an answer about all rows together; `asked` is in order of their radius."""
    count = Measure("rows asked", len(asked))
    if not asked:
        state = (
            Declined("FTD03", "the budget was spent before the first row")
            if points.at
            else Declined("FTD06", "no row lies in the domain")
        )
        return Answer("FT204", "rows", NOT_SOUGHT, state, False, measures=(count,))
    first = asked[0]
    least = first.found.low
    of_all = "" if len(asked) == len(points.at) else "with the smallest margins "
    median = statistics.median_low([one.found.low for one in asked])
    one = _answer(decider, f"row {first.number}", first.point, first.found)
    return Answer(
        code="FT204",
        subject="rows",
        sentence=f"of {points.text} {len(asked)} different ones {of_all}were asked: "
        f"each keeps its decision within at least {percent(least)} {OF_RANGES}, half "
        f"of them within {percent(median)}",
        state=one.state,
        is_finding=False,
        measures=(
            count,
            distance_measure("smallest certified radius", least),
            distance_measure("median certified radius", median),
            Measure("row", first.number),
        ),
    )
