"""Leaves of a tree, and the values that lead to them: FT101, FT203, FT205."""

from __future__ import annotations

import math
from fractions import Fraction

from fuzzytree.auditing.recheck.audit_records import Answer, Witness
from fuzzytree.auditing.recheck.cases import Case
from fuzzytree.auditing.recheck.claims import point_of
from fuzzytree.auditing.recheck.meaning import leaf_of
from fuzzytree.auditing.recheck.model_records import Tree, Variable
from fuzzytree.auditing.recheck.outcomes import DoesNotHoldError, require

Interval = tuple[Fraction, Fraction, bool]  # True opens the low end


def dead_leaf(case: Case, tree: Tree, answer: Answer) -> None:
    """Ask of a leaf whether it is reached, or of all whether those told are all."""
    reached = {n for n in case.numbers if _is_reached(case, tree, n)}
    if answer.is_finding:
        case.never(not reached.isdisjoint(answer.rules), "the leaf is reached")
    elif not answer.rules:
        told = {one.rules for one in case.coded("FT101") if one.is_finding}
        hidden = [n for n in case.numbers if n not in reached]
        missing = [n for n in hidden if (n,) not in told]
        require(not missing, f"leaves that are not reached are not told: {missing}")


def shows_region(case: Case, answer: Answer, state: Witness) -> None:
    """Compare the region of a leaf with the intervals on the path to it."""
    tree = case.model
    if not isinstance(tree, Tree) or len(answer.rules) != 1:
        raise DoesNotHoldError("it is of no leaf")
    number = answer.rules[0]
    is_there = leaf_of(tree, point_of(state.point)) == number
    require(is_there, "the witness reaches another leaf")
    label = tree.leaves[number - 1].label
    require([c.label for c in state.claims] == [label], "it is not the leaf's class")
    asked = {node.variable for node, _ in case.paths[number]}
    require({s.variable for s in state.region} == asked, "not what its path asks")
    for span in state.region:
        is_one = any(
            math.isclose(span.low or 0.0, low, rel_tol=2.0**-50)
            and math.isclose(span.high or 0.0, high, rel_tol=2.0**-50)
            for low, high, _ in _ways(case, number, case.variables[span.variable])
        )
        require(is_one, f"the path leads elsewhere in {span.variable!r}")


def shows_difference(case: Case, answer: Answer, state: Witness) -> None:
    """Ask that the tree and its raw rules are claimed to answer differently."""
    said = {claim.of: claim.label for claim in state.claims if claim.kind == "decides"}
    require(said.keys() == {"tree", "raw rules"}, "it is not claimed what both answer")
    is_near = not answer.rules  # the nearest to a row is no finding
    require(answer.is_finding or is_near, "two answers that differ are a finding")
    require(said["tree"] != said["raw rules"], "the two answers are the same")


def _is_reached(case: Case, tree: Tree, number: int) -> bool:
    """Return whether the intervals on the path to a leaf meet the domain."""
    return all(_ways(case, number, variable) for variable in tree.variables)


def _ways(case: Case, number: int, variable: Variable) -> list[Interval]:
    """Return the values of a variable that lead to a leaf."""
    line = case.line(variable)
    met: list[Interval] = [(line.low, line.high, False)]
    for node, way in case.paths[number]:
        if node.variable == variable.name:
            ends = zip((None, *node.cuts), (*node.cuts, None), node.owners, strict=True)
            place = node.branches.index(way)
            mine = [(low, high) for low, high, owner in ends if owner == place]
            met = [_met(one, low, high) for one in met for low, high in mine]
    return [one for one in met if one[0] < one[1] or (one[0] == one[1] and not one[2])]


def _met(one: Interval, low: float | None, high: float | None) -> Interval:
    """Return what an interval has in common with `low < x <= high`."""
    start, end, is_open = one
    if low is not None and low >= start:
        start, is_open = Fraction(low), True
    return start, end if high is None else min(end, Fraction(high)), is_open
