"""What a tree decides where: the regions of its leaves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from fuzzytree.auditing.decide.domain import Domain, DomainSide
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
    Witness,
    coordinates,
)
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import AuditAnswer, FactValue, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import FuzzyTree
from fuzzytree.rechecking import listed, open_interval

MOST_BOXES = 20_000
"""Boxes of all leaves together, beyond which a tree's regions are not looked at."""

MOST_LISTED = 1000
"""Boxes beyond which the regions of leaves are not listed."""


def answers(subject: Subject) -> Iterator[AuditAnswer]:
    """Yield the region of each leaf, and the leaves that are never reached.

    Models other than trees have no leaves.
    """
    tree = subject.tree
    if tree is None:
        return
    tree_regions = regions(tree)
    declined = too_many_boxes(tree_regions)
    if declined is not None:
        for code in ("FT101", "FT205"):
            yield audit_answer(f"{code}.leaves-declined", "leaves", declined)
        return
    yield from leaf_regions(subject, tree, tree_regions)


def too_many_boxes(tree_regions: Sequence[Region]) -> Declined | None:
    """Return why the regions of a tree are not looked at, None if they are."""
    count = sum(map(box_count, tree_regions))
    if count <= MOST_BOXES:
        return None
    why = f"the leaves are made of {count} boxes, more than {MOST_BOXES}"
    return Declined("FTD05", why)


def leaf_regions(
    subject: Subject, tree: FuzzyTree, tree_regions: Sequence[Region]
) -> Iterator[AuditAnswer]:
    """Yield where each leaf decides, or that it never does."""
    live, count = 0, sum(map(box_count, tree_regions))
    if count > MOST_LISTED:
        why = f"the leaves are made of {count} boxes, more than {MOST_LISTED}"
        yield audit_answer("FT205.not-listed", "leaves", Declined("FTD05", why))
    for region in tree_regions:
        subject.budget.check()
        inside = [*boxes(region, tree, subject.domain)]
        met = [(box, point_in(box, tree)) for box in inside]
        parts = [(box, point) for box, point in met if point is not None]
        if not parts:
            yield _unreached(subject, tree, region, len(inside))
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
    cut_sides = [side for side in box.sides if side.variable in unions]
    hulls = [(side.variable, *side.ends) for side in cut_sides]
    spans = tuple(Span(name, float(low), float(high)) for name, low, high in hulls)
    ends = [
        (side.variable, *_ends(side, unions[side.variable], subject.domain))
        for side in cut_sides
    ]
    claim = Claim("decides", of="tree", label=region.label)
    share = share_of(box, tree, subject.domain)
    measures = () if share is None else (Measure("share of the domain", share),)
    state = Witness(coordinates(point), (claim,), spans)
    return audit_answer(
        "FT205.region",
        name,
        state,
        rules=(region.leaf,),
        region=spans,
        measures=measures,
        facts={"then": region.label, "ends": tuple(ends)},
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
    wholes = {side.variable: side for side in domain.sides}
    combined = {variable.name for variable in tree.variables if variable.parts}
    for side in box.sides:
        if side.variable in combined:
            return None
        whole = wholes[side.variable]
        if values := listed(whole):
            share *= Fraction(len(listed(side) or side.values), len(values))
        elif whole.low < whole.high:
            width = Fraction(whole.high) - Fraction(whole.low)
            share *= (Fraction(side.high) - Fraction(side.low)) / width
    return float(share)


def _unreached(
    subject: Subject, tree: FuzzyTree, region: Region, count: int
) -> AuditAnswer:
    name = f"leaf {region.leaf}"
    how = "the intervals on its path have nothing in common with the domain"
    if count:
        how = f"{count} boxes of combinations tested: no point of the inputs is in them"
    message, facts = _reason(tree, region, subject.domain)
    facts["leaf"] = region.leaf
    return audit_answer(message, name, Proved(how), rules=(region.leaf,), facts=facts)


def _reason(
    tree: FuzzyTree, region: Region, domain: Domain
) -> tuple[str, dict[str, FactValue]]:
    """Return why no input reaches a leaf: the message, and what it says."""
    for variable, union in region.sides:
        if not union:
            return "FT101.leaf-excluded", {"variable": variable}
        side = domain.side(variable)
        if side is not None and not any(cut_side(side, one) for one in union):
            ends = {"low": side.low, "high": side.high}
            values = values_text(union)
            return "FT101.leaf-outside", {
                "variable": variable,
                "values": values,
                **ends,
            }
    combined = {variable.name for variable in tree.variables if variable.parts}
    names = [repr(name) for name, _ in region.sides if name in combined]
    return "FT101.leaf-unmet", {"variables": " and ".join(names)}


def values_text(union: Union) -> str:
    """Return values as people read them.

    Example:
        >>> values_text(((None, 0.5), (1.0, 2.0)))
        'at most 0.5 or above 1 and at most 2'
    """
    return " or ".join(open_interval(low, high) for low, high in union)
