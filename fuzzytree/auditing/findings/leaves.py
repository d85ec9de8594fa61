"""What a tree decides where: the regions of its leaves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.regions import (
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
from fuzzytree.auditing.engine.states import (
    Claim,
    Declined,
    Proved,
    Span,
    Witness,
    coordinates,
    number_text,
)
from fuzzytree.auditing.findings.codes import finding, note
from fuzzytree.auditing.findings.records import AuditAnswer, Measure
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import FuzzyTree

MOST_BOXES = 20_000
"""Boxes of all leaves together, beyond which a tree's regions are not looked at."""

MOST_LISTED = 1000
"""Boxes beyond which the regions of leaves are not listed."""

NOT_LOOKED_AT = "the regions of the leaves are not looked at"


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
            yield note(code, "leaves", NOT_LOOKED_AT, declined)
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
        text = "the regions of the leaves are not listed"
        yield note("FT205", "leaves", text, Declined("FTD05", why))
    for region in tree_regions:
        subject.clock.check()
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
    text = f"{live} of {len(tree_regions)} leaves are reached"
    how = "a point in each of their regions was found and evaluated in fractions"
    yield note("FT101", "leaves", text, Proved(how))


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
    spans = tuple(Span(side.variable, side.low, side.high) for side in cut_sides)
    ends = [(side.variable, _ends(side, unions[side.variable])) for side in cut_sides]
    texts = [
        f"{variable!r} is {values_text((interval,))}"
        for variable, interval in ends
        if interval != (None, None)
    ]
    where = f"where {' and '.join(texts)}" if texts else "everywhere"
    claim = Claim("decides", of="tree", label=region.label)
    share = share_of(box, tree, subject.domain)
    measures = () if share is None else (Measure("share of the domain", share),)
    state = Witness(coordinates(point), (claim,), spans)
    text, rules = f"{name} decides {region.label!r} {where}", (region.leaf,)
    return note(
        "FT205", name, text, state, rules=rules, region=spans, measures=measures
    )


def _ends(side: DomainSide, union: Union) -> Interval:
    """Return the ends of a box's side that the tree sets, and not the domain."""
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
        if whole.low < whole.high:
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
    text = f"{name} (rule {region.leaf}) is never reached: "
    text += _reason(tree, region, subject.domain)
    return finding("FT101", name, text, Proved(how), rules=(region.leaf,))


def _reason(tree: FuzzyTree, region: Region, domain: Domain) -> str:
    """Return why no input reaches a leaf."""
    for variable, union in region.sides:
        if not union:
            return f"the nodes for {variable!r} on its path exclude each other"
        side = domain.side(variable)
        if side is not None and not any(cut_side(side, one) for one in union):
            return (
                f"its path needs {variable!r} {values_text(union)}, and the domain "
                f"is {number_text(side.low)} to {number_text(side.high)}"
            )
    combined = {variable.name for variable in tree.variables if variable.parts}
    names = [repr(name) for name, _ in region.sides if name in combined]
    return f"no input of the domain meets what its path needs of {' and '.join(names)}"


def values_text(union: Union) -> str:
    """Return values as people read them.

    Example:
        >>> values_text(((None, 0.5), (1.0, 2.0)))
        'at most 0.5 or above 1 and at most 2'
    """
    texts: list[str] = []
    for low, high in union:
        above = [] if low is None else [f"above {number_text(low)}"]
        below = [] if high is None else [f"at most {number_text(high)}"]
        texts.append(" and ".join([*above, *below]) or "any value")
    return " or ".join(texts)
