"""Where a tree and its raw rules differ is found, leaf by leaf and near rows."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.states import (
    Bracket,
    Declined,
    Proved,
    Witness,
    percent,
    point_of,
)
from fuzzytree.auditing.findings.disagreement import (
    TreeAndRules,
    answers,
)
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model.rulebase import Conjunction
from fuzzytree.numerics.exact import exact_answer
from fuzzytree.testing import random_tree
from tests.auditing.findings.small_trees import one_cut, subject_of, two_cuts


def _findings(subject: Subject) -> list[AuditAnswer]:
    return [answer for answer in answers(subject) if answer.is_finding]


def _number(answer: AuditAnswer, name: str) -> float:
    return next(one.value for one in answer.measures if one.name == name)


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


def test_the_nearest_disagreement_to_a_row_is_bounded_on_both_sides() -> None:
    # Both differ on (0.25, 0.5]: rows 1 and 2 are 0.15 and 0.1 away, row 3 is inside.
    rows = [[0.1], [0.6], [0.3], [7.0]]
    results = [*answers(subject_of(one_cut(0.25), rows=rows))][-1]
    assert results.subject == "rows"
    assert results.sentence == (
        "of 4 rows (1 incomplete or outside the domain) 1 differ already; around 2 "
        "others the nearest disagreement is 10 % of each input's range from row 2"
    )
    assert _number(results, "row") == 2
    assert 0.0998 < _number(results, "certified distance, in ranges") <= 0.1
    assert 0.0999 < _number(results, "distance of the witness, in ranges") < 0.1002
    assert isinstance(results.state, Witness)


@pytest.mark.parametrize("steps", [1, 200, 400, 700, 1200])
def test_a_budget_that_ends_certifies_no_more_than_was_tested(steps: int) -> None:
    rows, budget = [[0.1], [0.6], [0.8]], Budget(steps)
    results = [*answers(subject_of(one_cut(0.25), rows=rows, budget=budget))]
    near = next(one for one in results if one.subject == "rows")
    queries = _number(near, "rows evaluated")
    assert [one.state for one in results[results.index(near) + 1 :]] == (
        [Declined("FTD03", "the budget was spent")] if 0 < queries < 3 else []
    )
    if not queries:
        assert near.state == Declined(
            "FTD03", "the budget was spent before the first row"
        )
        return
    away = {1: 0.15, 2: 0.1, 3: 0.3}[int(_number(near, "row"))]
    assert _number(near, "certified distance, in ranges") <= away
    assert isinstance(near.state, (Bracket, Witness))


def test_rows_around_which_nothing_differs_are_reported_as_such() -> None:
    results = [*answers(subject_of(one_cut(0.5), rows=[[0.1], [0.9]]))][-1]
    assert results.sentence == (
        "of 2 rows 0 differ already; no disagreement is known around 2 others"
    )
    assert isinstance(results.state, Proved)


def test_rows_that_all_differ_leave_nothing_to_seek() -> None:
    results = [*answers(subject_of(one_cut(0.25), rows=[[0.3]]))][-1]
    assert results.sentence == (
        "of 1 rows 1 differ already; the nearest disagreement to others is not sought"
    )
    assert results.state == Declined(
        "FTD06", "no row of the domain is decided alike by both"
    )


def test_a_tree_without_sets_has_no_disagreement() -> None:
    assert [*answers(subject_of(two_cuts(0.75)))] == []


def test_a_share_is_shown_in_three_digits() -> None:
    assert percent(Fraction(123456, 1000000)) == "12.3 %"


def _sampled(seed: int, points: int) -> None:
    """Compare the answers of a random tree with many points."""
    tree = random_tree(seed, leaves=4, inputs=2, combinations=0.0)
    draw = random.Random(seed)
    reach = {}
    for name in tree.inputs:
        cuts = [abs(c) for n in tree.nodes if n.variable == name for c in n.cuts]
        reach[name] = 3.0 * max(cuts, default=1.0)
    limits = {name: (-r, r) for name, r in reach.items()}
    rows = [[draw.uniform(-r, r) for r in reach.values()] for _ in range(3)]
    subject = subject_of(tree, limits=limits, rows=rows, budget=Budget(20_000_000))
    results = [*answers(subject)]
    differing = {one.rules[0] for one in results if one.is_finding}
    assert subject.raw is not None
    both = TreeAndRules(tree, subject.raw, subject.domain)
    near = next(one for one in results if one.subject == "rows")
    starts = [
        {name: Fraction(x) for name, x in zip(reach, row, strict=True)} for row in rows
    ]
    starts = [start for start in starts if not both.differ(start)]
    certified = [
        m.value for m in near.measures if m.name == "certified distance, in ranges"
    ]
    for number in range(points):
        start = starts[number % len(starts)] if starts else None
        share = draw.random() if start is None else draw.random() ** 3
        point = {
            name: Fraction(
                draw.uniform(-r, r)
                if start is None
                else min(r, max(-r, float(start[name]) + draw.uniform(-r, r) * share))
            )
            for name, r in reach.items()
        }
        if both.differ(point):
            leaf = exact_answer(tree, {k: float(v) for k, v in point.items()}).rule
            assert leaf in differing
            if start is not None:
                assert both.costs.distance(start, point) >= certified[0]
    if isinstance(near.state, (Witness, Bracket)) and near.state.point:
        assert both.differ(point_of(near.state.point))


def test_no_sampled_point_differs_where_nothing_was_to_differ() -> None:
    _sampled(3, 100)


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(8))
def test_no_point_of_many_differs_where_nothing_was_to_differ(seed: int) -> None:
    _sampled(seed, 1500)
