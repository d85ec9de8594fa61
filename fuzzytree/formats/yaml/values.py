"""Records of a file to parts of the model; the model checks what they mean together."""

from __future__ import annotations

import msgspec

from fuzzytree.formats.yaml import layout
from fuzzytree.model import (
    LR,
    Band,
    Branch,
    Leaf,
    Node,
    Part,
    Points,
    Semantics,
    Sets,
    Shape,
    Side,
    Term,
    Variable,
)


def variable(one: layout.VariableOfModel) -> Variable:
    """Return an input or a combination."""
    return Variable(
        name=one.name,
        terms=tuple(map(_term, one.terms)),
        unit=one.unit or "",
        low=one.range.from_ if one.range else None,
        high=one.range.to if one.range else None,
        parts=tuple(Part(p.input, p.weight, p.centre) for p in one.sum_of),
    )


def _term(one: layout.TermOfVariable) -> Term:
    return Term(one.name, shape(one))


def shape(one: layout.TermOfVariable) -> Shape:
    """Return the shape of a term."""
    if one.points is not None:
        pairs = zip(*one.points, strict=True)
        return Points(*map(tuple, pairs))
    if one.mean is None:
        return Band(one.above, one.up_to, one.zero_up_to, one.zero_from)
    if one.left is not None and one.right is not None:
        return LR(one.mean, _side(one.left), _side(one.right))
    # The layout's forms demand these three where the sides are not given.
    spread, curve, reach = one.spread or 0.0, one.curve or (), one.reach or 0.0
    side = Side(spread, curve, reach)
    return LR(one.mean, side, side)


def _side(side: layout.HalfSet) -> Side:
    return Side(side.spread, side.curve, side.reach)


def semantics(value: layout.RuleSemantics | layout.TreeSemantics | None) -> Semantics:
    """Return the semantics, the defaults if there are none."""
    if value is None:
        return Semantics()
    return Semantics(
        value.and_,
        _answer(value.uncovered),
        _answer(value.missing),
        value.label_type or msgspec.UNSET,
    )


def _answer(text: str) -> str | None:
    return None if text == "no class" else text.removeprefix("class ")


def leaf(one: layout.End) -> Leaf:
    """Return a leaf."""
    return Leaf(one.class_, one.pattern or "", one.support)


def sets(one: layout.SetsOfVariable) -> Sets:
    """Return the fitted sets on a variable."""
    return Sets(one.variable, tuple(map(_term, one.terms)))


def node(one: layout.NodeOfTree) -> Node:
    """Return a node; its owners count from 0, those of the file from 1."""
    branches = tuple(_branch(way) for way in one.branches)
    owners = tuple(owner - 1 for owner in one.interval_owners)
    return Node(one.ask, one.cuts, owners or tuple(range(len(branches))), branches)


def _branch(way: layout.Way) -> Branch:
    kind, number = way.go_to.split(" ")
    if kind == "node":
        return Branch(way.is_, way.sets, node=int(number))
    return Branch(way.is_, way.sets, leaf=int(number))
