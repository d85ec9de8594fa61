"""How far a row is from another decision is certified, and never too much."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.costs import Costs
from fuzzytree.auditing.decide.states import Declined, Proved, Witness, point_of
from fuzzytree.auditing.findings.records import AuditAnswer
from fuzzytree.auditing.findings.robustness import (
    RowDecider,
    answers,
    row_answers,
)
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model.rulebase import Conjunction, RuleBase
from fuzzytree.numerics.exact import exact_answer
from fuzzytree.testing import random_tree
from tests.auditing.decide.old_bases import random_base
from tests.auditing.findings.small_trees import one_cut, subject_of, two_cuts


def radius(subject: Subject, row: Mapping[str, float]) -> AuditAnswer:
    """Return the last of what is said of a row."""
    return [*row_answers(replace(subject, row=row))][-1]


def _number(answer: AuditAnswer, name: str) -> float:
    return next(one.value for one in answer.measures if one.name == name)


def test_the_radius_of_a_row_of_a_tree_is_the_distance_to_its_cut() -> None:
    found = radius(subject_of(one_cut()), {"x": 0.25})
    assert found.code == "FT204"
    assert not found.is_finding
    assert (found.measures[0].value, found.measures[0].exact) == (0.25, "1/4")
    assert found.sentence == (
        "the row is 'a'; where 'x' is 0.5001 it becomes 'b', and it stays 'a' while "
        "no input changes by more than 25 % of its range"
    )
    assert isinstance(found.state, Witness)
    assert found.state.claims[0].label == "b"


def test_the_point_that_is_reported_is_decided_as_the_sentence_says() -> None:
    grip = Path(__file__).parents[3] / "examples" / "grip.yaml"
    rules = ft.read(grip).model
    assert isinstance(rules, RuleBase)
    subject = subject_of(rules, limits={"force": (0.0, 10.0), "slip": (0.0, 2.0)})
    found = radius(subject, {"force": 4.9, "slip": 0.3})
    moved = re.search(
        "; where 'force' is (5.0000[0-9]+) it becomes 'soft'", found.sentence
    )
    assert moved is not None
    decision = RowDecider(subject).decision
    slip = Fraction(0.3)
    assert decision({"force": Fraction(moved[1]), "slip": slip})[0] == "soft"
    assert decision({"force": Fraction(5), "slip": slip})[0] == "open"


def test_a_cut_moved_away_makes_the_radius_larger() -> None:
    far = radius(subject_of(two_cuts(0.75)), {"x": 0.6, "y": 0.5})
    near = radius(subject_of(two_cuts(0.625)), {"x": 0.6, "y": 0.5})
    assert 0.0249 < _number(near, "certified radius, in ranges") < 0.0251
    assert 0.0999 < _number(far, "certified radius, in ranges") < 0.1001


def test_the_radius_to_a_combination_is_shared_by_its_inputs() -> None:
    # From (0.6, 0.1) the sum grows to 0.9 when both inputs grow by 0.1.
    found = radius(subject_of(two_cuts(0.9, combined=True)), {"x": 0.6, "y": 0.1})
    assert 0.0999 * 0.998 < _number(found, "certified radius, in ranges") <= 0.1
    assert 0.1 <= _number(found, "distance of the witness, in ranges") < 0.1002


def test_a_domain_decided_alike_has_no_other_decision() -> None:
    found = radius(subject_of(one_cut(), limits={"x": (0.0, 0.4)}), {"x": 0.25})
    assert found.sentence == "no row of the domain has another class than the row, 'a'"
    assert isinstance(found.state, Proved)


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_the_radius_of_a_row_of_rules_is_found_by_their_strengths(
    conjunction: Conjunction,
) -> None:
    raw = subject_of(one_cut(0.25, conjunction)).raw
    assert raw is not None
    found = radius(subject_of(raw), {"x": 0.75})
    assert 0.499 < _number(found, "certified radius, in ranges") <= 0.5
    assert 0.5 <= _number(found, "distance of the witness, in ranges") < 0.501
    assert isinstance(found.state, Witness)
    assert found.state.claims[0].of == "rules"


def test_exact_ties_are_decided_by_the_order_of_rules() -> None:
    # Both rules are as strong at 0.25; the first one goes first.
    raw = subject_of(one_cut(0.25)).raw
    assert raw is not None
    whole, second = answers(subject_of(raw, rows=[[0.75]]))
    assert "ties" not in second.sentence + whole.sentence
    assert _number(second, "certified radius, in ranges") <= 0.5
    assert isinstance(second.state, Witness)
    assert RowDecider(subject_of(raw)).decision({"x": Fraction(1, 4)})[0] == "a"


def test_a_row_has_its_decision_first_and_then_its_radius() -> None:
    first, second = row_answers(replace(subject_of(one_cut()), row={"x": 0.75}))
    assert first.sentence == "the row is decided as 'b' by leaf 2"
    assert second.sentence.endswith("by more than 25 % of its range")


def test_a_row_outside_the_domain_is_refused() -> None:
    with pytest.raises(ValueError, match="outside") as caught:
        list(row_answers(replace(subject_of(one_cut()), row={"x": 1.5})))
    assert str(caught.value) == (
        "the row lies outside the domain: 'x' is 1.5, and the domain is 0.0 to 1.0; "
        "widen it (--limits 'x=LOW:HIGH')"
    )


def test_all_rows_are_summarised_and_the_nearest_are_named() -> None:
    rows = [[0.1], [0.4], [0.9], [0.4], [2.0]]
    results = [*answers(subject_of(one_cut(), rows=rows))]
    assert results[0].sentence == (
        "of 5 rows (1 incomplete or outside the domain) 3 different ones were "
        "evaluated: each keeps its decision within at least 10 % of each input's "
        "range, half of them within 40 %"
    )
    assert [one.subject for one in results] == ["rows", "row 2", "row 1", "row 3"]
    assert _number(results[0], "row") == 2


def test_all_rows_of_a_tree_are_tested_and_only_close_calls_of_rules() -> None:
    rows = [[number / 100] for number in range(80)]
    whole = next(answers(subject_of(one_cut(), rows=rows)))
    assert _number(whole, "rows evaluated") == 80
    assert "with the smallest margins" not in whole.sentence
    raw = subject_of(one_cut()).raw
    assert raw is not None
    some = next(answers(subject_of(raw, rows=rows)))
    assert _number(some, "rows evaluated") == 50
    assert "50 different ones with the smallest margins were evaluated" in some.sentence


def test_without_rows_it_is_declined() -> None:
    [results] = answers(subject_of(one_cut()))
    assert results.state == Declined("FTD06", "rows are needed (--data TABLE)")


def test_a_budget_that_ends_keeps_the_rows_that_were_tested() -> None:
    rows = [[number / 10] for number in range(1, 9)]
    results = [*answers(subject_of(one_cut(), rows=rows, budget=Budget(5)))]
    count = int(_number(results[0], "rows evaluated"))
    assert 0 < count < 8
    assert results[-1].sentence == f"{8 - count} more rows are not evaluated"
    assert results[-1].state == Declined("FTD03", "the budget was spent")


def _check(subject: Subject, row: Mapping[str, float], points: int, seed: int) -> None:
    """Compare a row's radius with points within it and the witness."""
    draw = random.Random(seed)
    found = radius(subject, row)
    start = {name: Fraction(value) for name, value in row.items()}
    decider = RowDecider(subject)
    label, _ = decider.decision(start)
    model = subject.tree or subject.rules
    if isinstance(found.state, Witness):
        point = point_of(found.state.point)
        assert decider.decision(point)[0] == found.state.claims[0].label != label
        near = float(Costs(subject.domain, [*row]).distance(start, point))
        assert near == pytest.approx(
            _number(found, "distance of the witness, in ranges")
        )
        assert near - _number(found, "certified radius, in ranges") <= 0.003 * near
    within = 1.0 if isinstance(found.state, Proved) else found.measures[0].value
    for _ in range(points):
        moved = {}
        for side in subject.domain.sides:
            reach = within * (side.high - side.low) * (1.0 - 1e-12)
            shift = draw.choice([-1.0, 1.0, draw.uniform(-1.0, 1.0)]) * reach
            value = row[side.variable] + shift
            moved[side.variable] = min(max(value, side.low), side.high)
        assert exact_answer(model, moved).label == label


@pytest.mark.parametrize("seed", range(4))
def test_no_point_within_the_radius_of_a_tree_decides_otherwise(seed: int) -> None:
    tree = random_tree(seed, inputs=3, combinations=0.5 * (seed % 2))
    cuts = [abs(cut) for node in tree.nodes for cut in node.cuts]
    reach = 2.0 * max(cuts)
    limits = dict.fromkeys(tree.inputs, (-reach, reach))
    draw = random.Random(seed)
    row = {name: draw.uniform(-reach, reach) for name in tree.inputs}
    _check(subject_of(tree, limits=limits), row, 60, seed)


def _rules(seed: int) -> tuple[Subject, dict[str, float]]:
    rules = random_base(seed, 6, 3, kind="mixed", shared=0.5)
    draw = random.Random(seed)
    return subject_of(rules), {name: draw.random() for name in rules.inputs}


@pytest.mark.parametrize("seed", range(2))
def test_no_point_within_the_radius_of_rules_decides_otherwise(seed: int) -> None:
    subject, row = _rules(seed)
    _check(subject, row, 60, seed)


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(2, 17))
def test_no_point_of_many_within_the_radius_decides_otherwise(seed: int) -> None:
    subject, row = _rules(seed)
    _check(subject, row, 1000, seed)
