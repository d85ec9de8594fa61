"""Models that decide, asked how far the nearest other decision is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Protocol

import numpy as np

from fuzzytree.auditing.engine.arrangement import Ground, ground, narrowed, strengths_at
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.decisions import (
    Around,
    columns,
    decision_at,
    other_decision,
)
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.nearest import (
    NARROW,
    Nearest,
    Polytope,
    Polytopes,
    nearest,
    nearest_box,
    polytope_of,
)
from fuzzytree.auditing.engine.regions import Region, boxes, leaf_at, regions
from fuzzytree.auditing.engine.states import (
    Claim,
    Proved,
    Representation,
    State,
    Witness,
)
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.model.tree import FuzzyTree

Point = dict[str, Fraction]

_HALVINGS = 16  # of a radius, to find one within which bounds tell the decision


class Decider(Protocol):
    """A model that decides, asked exactly."""

    of: Representation

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the answer at a point, and what gave it."""
        ...

    def leaves_out(self, label: str | None) -> bool:
        """Return whether another answer may be where strengths only touch a class's."""
        ...

    def look(self, points: Sequence[Mapping[str, Fraction]]) -> None:
        """Look at points together, before each is asked about."""
        ...

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest point with another answer is."""
        ...


def decider_of(subject: Subject) -> Decider:
    """Return a model as it is asked: trees by regions, rules by strengths."""
    if subject.tree is not None:
        return CrispDecider(subject.tree, subject.domain)
    return RuleDecider(subject)


class CrispDecider:
    """A tree, by the regions of its leaves.

    Args:
        tree: The tree.
        domain: Where it is asked.
    """

    of: Representation = "tree"

    def __init__(self, tree: FuzzyTree, domain: Domain) -> None:
        self.tree, self.domain = tree, domain
        self.labels: list[str] = []
        self.boxes: list[Domain] = []
        parts: list[Polytope] = []
        variables = {variable.name: variable for variable in tree.variables}
        for region in regions(tree):
            for box in boxes(region, tree, domain):
                self.labels.append(region.label)
                self.boxes.append(box)
                parts.append(polytope_of(box, tree.inputs, variables))
        self.is_plain = not any(variable.parts for variable in tree.variables)
        self.polytopes = Polytopes(domain, tree.inputs, parts)

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class of the leaf that a point reaches, and the leaf."""
        leaf = leaf_at(self.tree, point)
        return self.tree.leaves[leaf - 1].label, f"leaf {leaf}"

    def leaves_out(self, label: str | None) -> bool:
        """Return False: regions are exact, and have no strengths."""
        del label
        return False

    def look(self, points: Sequence[Mapping[str, Fraction]]) -> None:
        """Do nothing: regions are known."""

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest region of another class is."""
        label, _ = self.decided(point)
        chosen = self._others(label)
        if self.is_plain:
            others = [self.boxes[number] for number in chosen]
            return nearest_box(self.domain, point, others)
        return self.polytopes.nearest(point, chosen, clock)

    def bound(self, point: Mapping[str, Fraction], label: str | None) -> float:
        """Return a radius within which no region of another class is, by doubles."""
        bounds = self.polytopes.bounds(point)
        return min((bounds[number] for number in self._others(label)), default=np.inf)

    def _others(self, label: str | None) -> list[int]:
        return [number for number, own in enumerate(self.labels) if own != label]


class RuleDecider:
    """Rules of which the strongest decides.

    Args:
        subject: The rules as they are audited.
    """

    of: Representation = "rules"

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self.given = ground(subject.rules, subject.domain)
        self.around = Around(subject.rules, subject.domain)
        self.ahead: dict[tuple[Fraction, ...], tuple[Point, float]] = {}

    def decided(self, point: Mapping[str, Fraction]) -> tuple[str | None, str]:
        """Return the class of the first of the strongest rules, and the rule."""
        strengths = strengths_at(self.given, point)
        best = max(strengths)
        if not best:
            return self.subject.rules.semantics.uncovered, "no rule"
        number = strengths.index(best) + 1
        label = self.subject.rules.rules[number - 1].then
        return label, self.subject.rule_name(number)

    def leaves_out(self, label: str | None) -> bool:
        """Return whether a rule of another class stands before one of a class's.

        It wins where both are equally strong, and that is asked on sets with an
        interior only.
        """
        order = [rule.then == label for rule in self.subject.rules.rules]
        return any(order) and not all(order[: len(order) - order[::-1].index(True)])

    def look(self, points: Sequence[Mapping[str, Fraction]]) -> None:
        """Seek points near some others that are decided otherwise, by doubles."""
        inputs = self.subject.rules.inputs
        labels = [decision_at(self.given, point) for point in points]
        found, away = self.around.approached(columns(points, inputs), labels)
        for place, point in enumerate(points):
            values = map(Fraction, found[:, place].tolist())
            other = dict(zip(inputs, values, strict=True))
            self.ahead[tuple(point[n] for n in inputs)] = other, float(away[place])

    def nearest_other(self, point: Mapping[str, Fraction], clock: Clock) -> Nearest:
        """Return how far the nearest point is where a rule of another class wins."""
        label = decision_at(self.given, point)
        key = tuple(point[name] for name in self.subject.rules.inputs)
        if key not in self.ahead:
            self.look([point])
        other, away = self.ahead[key]

        def is_one(other: Mapping[str, Fraction]) -> bool:
            return is_within(self.given, other) and (
                decision_at(self.given, other) != label
            )

        return nearest(
            self.subject.domain,
            point,
            lambda box: other_decision(narrowed(self.given, box), label, clock),
            is_one,
            clock,
            clear=self._clear(point, label, away),
            near=[other] if away < np.inf else (),
        )

    def _clear(
        self, point: Mapping[str, Fraction], label: str | None, away: float
    ) -> Fraction | None:
        """Return a radius within which bounds of doubles tell the decision."""
        centre = columns([point], self.subject.rules.inputs)
        top = min(away, 1.0) * (1.0 - float(NARROW))
        radii = [top * 0.5**number for number in range(_HALVINGS)]
        balls = [self.around.ball(centre, radius) for radius in radii]
        low, high = (np.concatenate(ends, axis=1) for ends in zip(*balls, strict=True))
        clear = self.around.is_clear(low, high, [label] * len(radii))
        return Fraction(radii[int(clear.argmax())]) if clear.any() else None


# --- a tree and its raw rules


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
        self.crisp = CrispDecider(tree, domain)
        self.around = Around(raw, domain)

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

    def clear_of_cuts(self, point: Mapping[str, Fraction], label: str | None) -> float:
        """Return a radius within which the tree decides alike, by doubles."""
        return self.crisp.bound(point, label)


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
