"""What a tree decides where: the regions of its leaves, and where raw rules differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Final

import numpy as np

from fuzzytree.auditing.decide.answers import Budget, OutOfStepsError, Point
from fuzzytree.auditing.decide.answers import Proved as NoPoint
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.contest import Contest, decision
from fuzzytree.auditing.decide.domain import Domain, DomainSide, contains, simplify
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.auditing.decide.regions import (
    Interval,
    Region,
    Union,
    box_count,
    boxes,
    cut_side,
    leaf_at,
    point_in,
    regions,
)
from fuzzytree.auditing.decide.states import (
    Claim,
    Declined,
    Proved,
    Span,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.auditing.findings.support import share_in_sample
from fuzzytree.model import BoolArray, FloatArray, FuzzyTree, RuleBase
from fuzzytree.numerics import decide
from fuzzytree.rechecking import open_interval, side_values

MOST_BOXES: Final = 20_000
"""Boxes of all leaves together, beyond which a tree's regions are not looked at."""

MOST_LISTED: Final = 1000  # boxes beyond which the regions of leaves are not listed
_LEAF_PART = 0.25  # of the steps that are left, to compare a leaf with the raw rules


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield where each leaf decides, or that it never does; only trees have leaves."""
    tree = subject.tree
    if tree is None:
        return
    declined = too_many_boxes(tree)
    if declined is not None:
        for code in ("FT101", "FT205"):
            yield audit_answer(f"{code}.leaves-declined", "leaves", declined)
        return
    tree_regions = regions(tree)
    live, count = 0, sum(map(box_count, tree_regions))
    if count > MOST_LISTED:
        why = f"the leaves are made of {count} boxes, more than {MOST_LISTED}"
        yield audit_answer("FT205.not-listed", "leaves", Declined("FTD05", why))
    for region in tree_regions:
        subject.budget.check()
        inside = [*boxes(region, tree, subject.domain)]
        places = [(box, point_in(box, tree)) for box in inside]
        parts = [(box, point) for box, point in places if point is not None]
        if not parts:
            yield _dead_leaf(subject, tree, region, len(inside))
            continue
        live += 1
        for number, (box, point) in enumerate(parts if count <= MOST_LISTED else (), 1):
            name = f"leaf {region.leaf}"
            if len(parts) > 1:
                name += f", part {number} of {len(parts)}"
            yield _region(subject, tree, region, name, box, point)
    how = "a point in each of their regions was found and evaluated in fractions"
    facts = {"live": live, "leaves": len(tree_regions)}
    yield audit_answer("FT101.leaves", "leaves", Proved(how), facts=facts)


def too_many_boxes(tree: FuzzyTree) -> Declined | None:
    """Return why the regions of a tree are not looked at, None if they are."""
    count = sum(map(box_count, regions(tree)))
    if count <= MOST_BOXES:
        return None
    why = f"the leaves are made of {count} boxes, more than {MOST_BOXES}"
    return Declined("FTD05", why)


def _region(
    subject: Subject,
    tree: FuzzyTree,
    region: Region,
    name: str,
    box: Domain,
    point: dict[str, Fraction],
) -> AuditAnswer:
    assert leaf_at(tree, point) == region.leaf  # a point of its box
    unions = dict(region.sides)
    sides = [side for side in box.sides if side.variable in unions]
    ends = tuple(
        (side.variable, *_ends(side, unions[side.variable], subject.domain))
        for side in sides
    )
    spans = tuple(
        Span(side.variable, float(side.ends[0]), float(side.ends[1])) for side in sides
    )
    claim = Claim("decides", of="tree", label=region.label)
    share = share_of(box, tree, subject.domain)
    return audit_answer(
        "FT205.region",
        name,
        Witness(coordinates(point), (claim,), spans),
        *(() if share is None else [Measure("share of the domain", share)]),
        rules=(region.leaf,),
        region=spans,
        facts={"then": region.label, "ends": ends},
    )


def _ends(side: DomainSide, union: Union, domain: Domain) -> Interval:
    """Return the ends of a box's side that the tree sets, and not the domain."""
    if side == domain.side(side.variable):
        return None, None
    if side.values or side.is_whole:
        return side.low, side.high
    low, high = next(
        (low, high)
        for low, high in union
        if (low is None or low <= side.low) and (high is None or side.high <= high)
    )
    is_low_set = side.is_open and low == side.low
    return low if is_low_set else None, high if high == side.high else None


def share_of(box: Domain, tree: FuzzyTree, domain: Domain) -> float | None:
    """Return which share of a domain's volume a box takes; None if it is not plain.

    Inputs that the domain fixes at one value do not count. The sides of combinations
    cut a polytope, whose volume is not worked out.
    """
    share = Fraction(1)
    for side in box.sides:
        whole = domain.side(side.variable)
        if whole is None or side.variable not in tree.inputs:
            return None
        if values := side_values(whole):
            share *= Fraction(len(side_values(side) or side.values), len(values))
        elif whole.low < whole.high:
            width = Fraction(whole.high) - Fraction(whole.low)
            share *= (Fraction(side.high) - Fraction(side.low)) / width
    return float(share)


def _dead_leaf(
    subject: Subject, tree: FuzzyTree, region: Region, count: int
) -> AuditAnswer:
    """Return that no input reaches a leaf, and why."""
    how = "the intervals on its path have nothing in common with the domain"
    if count:
        how = f"{count} boxes of combinations tested: no point of the inputs is in them"
    names = (repr(name) for name, _ in region.sides if name not in tree.inputs)
    message = "FT101.leaf-unmet"
    facts: dict[str, FactValue] = {"variables": " and ".join(names)}
    for variable, union in region.sides:
        side = subject.domain.side(variable)
        if not union:
            message, facts["variable"] = "FT101.leaf-excluded", variable
            break
        if side is not None and not any(cut_side(side, part) for part in union):
            values = " or ".join(open_interval(low, high) for low, high in union)
            ends = {"low": side.low, "high": side.high}
            message = "FT101.leaf-outside"
            facts |= {"variable": variable, "values": values, **ends}
            break
    return audit_answer(
        message,
        f"leaf {region.leaf}",
        Proved(how),
        rules=(region.leaf,),
        facts={**facts, "leaf": region.leaf},
    )


# --- FT203: do raw rules decide as their tree does?


class TreeAndRules:
    """A tree and its raw rules, compared with each other."""

    def __init__(self, tree: FuzzyTree, raw: RuleBase, domain: Domain) -> None:
        self.tree, self.raw, self.domain = tree, raw, domain
        self.leaves, self.base = Leaves(tree, domain), Base.of(raw, domain)
        labels = dict.fromkeys(self.leaves.labels)
        self.contests = {label: Contest(self.base, label) for label in labels}

    def differ(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether both decide differently at a point of the domain."""
        label, _ = self.leaves.decision(point)
        return label != decision(self.base, point)[0] and contains(
            self.domain, self.tree.variables, point
        )

    def rows_that_differ(self, values: FloatArray) -> BoolArray:
        """Return on which complete rows both differ, exactly; shape (rows,)."""
        own = [leaf.label for leaf in self.tree.leaves]
        other = [self.raw.semantics.uncovered, *(rule.then for rule in self.raw.rules)]
        leaves = decide(self.tree, values).rule.tolist()
        rules = decide(self.raw, values, with_strengths=False).rule.tolist()
        pairs = zip(leaves, rules, strict=True)
        return np.array(
            [own[leaf - 1] != other[rule] for leaf, rule in pairs], np.bool_
        )

    def difference(self, leaf: int, budget: Budget) -> State:
        """Return where both differ in a leaf, or that they do nowhere."""
        why, point = "", None
        for part, number in enumerate(self.leaves.numbers):
            box = self.leaves.boxes[part]
            start = point_in(box, self.tree) if number == leaf else None
            if point is not None or start is None:
                continue
            try:
                answer = self.contests[self.leaves.labels[part]].ask(box, budget)
            except OutOfStepsError:
                why = why or "the budget was spent"
                continue
            if isinstance(answer, Point):
                point = answer.values
            elif not isinstance(answer, NoPoint):
                why = why or answer.why
        if point is None:
            return Declined("FTD03", why) if why else Proved("")
        label = decision(self.base, point)[0]
        near = simplify(
            point,
            self.domain,
            lambda other: (
                self.differ(other)
                and self.leaves.decision(other)[1] == leaf
                and decision(self.base, other)[0] == label
            ),
        )
        own = Claim("decides", of="tree", label=self.leaves.decision(near)[0])
        other = Claim("decides", of="raw rules", label=label)
        return Witness(coordinates(near), (own, other))


def raw_answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield where a tree and its raw rules differ, leaf by leaf, and on which rows.

    Only trees with fitted sets have raw rules.
    """
    tree, raw = subject.tree, subject.raw
    if tree is None or raw is None:
        return
    declined = too_many_boxes(tree)
    if declined is not None:
        yield audit_answer("FT203.leaves-declined", "leaves", declined)
        return
    both = TreeAndRules(tree, raw, subject.domain)
    alike, count = 0, len(tree.leaves)
    for leaf in range(1, count + 1):
        subject.budget.report(f"leaf {leaf} against the raw rules", leaf / count)
        state = both.difference(leaf, subject.budget.share(_LEAF_PART))
        name, rules = f"leaf {leaf}", [leaf]
        if isinstance(state, Proved):
            alike += 1
        elif isinstance(state, Witness):
            point = {at.input: Fraction(at.exact) for at in state.point}
            other, place = decision(both.base, point)
            if place is not None and place + 1 != leaf:
                rules.append(place + 1)
            facts = {"then": tree.leaves[leaf - 1].label, "other": other}
            yield audit_answer(
                "FT203.differs", name, state, rules=tuple(rules), facts=facts
            )
        else:
            yield audit_answer("FT203.open", name, state, rules=(leaf,))
    boxes_of_all = len(both.leaves.boxes)
    how = f"all other decisions were sought in {boxes_of_all} boxes of the leaves"
    leaves = {"alike": alike, "leaves": count}
    yield audit_answer("FT203.leaves", "leaves", Proved(how), facts=leaves)
    if subject.rows is not None:
        values = subject.rows.values[:, np.isfinite(subject.rows.values).all(axis=0)]
        if values.shape[1]:
            what = "rows that raw rules decide differently"
            hits = int(both.rows_that_differ(values).sum())
            of = f"rows of {subject.rows.name}"
            state = share_in_sample(what, hits, values.shape[1], of)
            yield audit_answer("FT203.rows", "rows", state)
