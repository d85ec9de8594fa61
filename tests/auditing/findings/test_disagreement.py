"""Where a tree and its raw rules differ is found, leaf by leaf and near rows."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.states import (
    Declined,
    Proved,
    Sampled,
    Witness,
)
from fuzzytree.auditing.findings.leaves import TreeAndRules
from fuzzytree.auditing.findings.leaves import raw_answers as answers
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model.rulebase import Conjunction
from fuzzytree.numerics.exact import exact_answer
from fuzzytree.testing import random_tree
from tests.auditing.findings.small_trees import one_cut, subject_of, two_cuts


def _findings(subject: Subject) -> list[AuditAnswer]:
    return [answer for answer in answers(subject) if answer.is_finding]


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_sets_that_meet_off_the_cut_are_found_and_those_at_the_cut_are_not(
    conjunction: Conjunction,
) -> None:
    subject = subject_of(one_cut(0.25, conjunction))
    [found] = _findings(subject)
    assert (found.code, found.severity, found.rules) == ("FT203", "warning", (1, 2))
    assert found.sentence == (
        "in leaf 1 the tree answers 'a', and somewhere there the raw rules answer 'b'"
    )
    assert isinstance(found.state, Witness)
    assert [claim.of for claim in found.state.claims] == ["tree", "raw rules"]
    point = {one.input: float(one.decimal) for one in found.state.point}
    assert 0.25 < point["x"] <= 0.5
    assert subject.tree is not None
    assert subject.raw is not None
    assert exact_answer(subject.tree, point).label == "a"
    assert exact_answer(subject.raw, point).label == "b"
    assert _findings(subject_of(one_cut(0.5, conjunction))) == []


def test_all_leaves_that_agree_share_one_answer() -> None:
    [results] = answers(subject_of(one_cut(0.5)))
    assert results.sentence == "in 2 of 2 leaves the raw rules decide as the tree does"
    assert results.state == Proved(
        "all other decisions were sought in 2 boxes of the leaves"
    )


def test_a_part_of_a_leaf_that_no_raw_rule_covers_is_found() -> None:
    [found] = _findings(subject_of(one_cut(0.5, is_steep=True)))
    assert found.rules == (1,)
    assert found.sentence == (
        "in leaf 1 the tree answers 'a', and somewhere there "
        "the raw rules answer no class"
    )


def test_rows_on_which_both_differ_are_counted() -> None:
    rows = [[0.1], [0.6], [0.3], [np.nan]]
    results = [*answers(subject_of(one_cut(0.25), rows=rows))][-1]
    assert results.sentence == (
        "on 1 of 3 complete rows the raw rules decide differently from the tree"
    )
    assert isinstance(results.state, Sampled)


def test_a_spent_budget_leaves_a_leaf_open() -> None:
    results = [*answers(subject_of(one_cut(0.5), budget=Budget(1)))]
    assert {type(one.state) for one in results} <= {Declined, Proved}


def test_a_tree_without_sets_has_no_disagreement() -> None:
    assert [*answers(subject_of(two_cuts(0.75)))] == []


def _sampled(seed: int, points: int) -> None:
    """Compare the answers of a random tree with many points."""
    tree = random_tree(seed, leaves=4, inputs=2, combinations=0.0)
    draw = random.Random(seed)
    reach = {}
    for name in tree.inputs:
        cuts = [abs(c) for n in tree.nodes if n.variable == name for c in n.cuts]
        reach[name] = 3.0 * max(cuts, default=1.0)
    limits = {name: (-r, r) for name, r in reach.items()}
    subject = subject_of(tree, limits=limits, budget=Budget(20_000_000))
    results = [*answers(subject)]
    differing = {one.rules[0] for one in results if one.is_finding}
    assert subject.raw is not None
    both = TreeAndRules(tree, subject.raw, subject.domain)
    for _ in range(points):
        point = {name: Fraction(draw.uniform(-r, r)) for name, r in reach.items()}
        if both.differ(point):
            leaf = exact_answer(tree, {k: float(v) for k, v in point.items()}).rule
            assert leaf in differing


def test_no_sampled_point_differs_where_nothing_was_to_differ() -> None:
    _sampled(3, 100)


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(8))
def test_no_point_of_many_differs_where_nothing_was_to_differ(seed: int) -> None:
    _sampled(seed, 1500)
