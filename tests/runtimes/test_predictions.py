"""Predictions name classes, count what is odd, and say why."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.errors import MissingExtraError
from fuzzytree.model import Label
from fuzzytree.model.rulebase import (
    Band,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.runtimes.predictions import Predictions, joined, reasons
from fuzzytree.semantics.reference import Status, evaluate
from fuzzytree.testing import random_tree

LOW = Term("low", Band(high=1.0, right=3.0))
RULES = RuleBase(
    "grip",
    ("soft", "firm", "hard"),
    (Variable("force", (LOW,)),),
    (
        Rule((Proposition("force", ("low",)),), "soft"),
        Rule((Proposition("force", ("low",)),), "firm"),
    ),
    Semantics(uncovered="hard"),
)
VALUES = np.array([[2.0], [9.0], [math.nan]])


def test_ties_uncovered_and_missing_rows_are_counted_apart() -> None:
    answers = ft.run(RULES, VALUES, columns=["force"])
    assert answers.classes == ["soft", "hard", None]
    assert answers.rule.tolist() == [1, 0, 0]
    assert answers.status.tolist() == [Status.TIE, Status.UNCOVERED, Status.MISSING]
    assert str(answers) == (
        "3 rows: soft 1, firm 0, hard 1, no class 1; 1 decided by the order of the "
        "rules, 1 uncovered, 1 with missing values"
    )


def test_csv_leaves_empty_what_is_not_there() -> None:
    answers = ft.run(RULES, VALUES, columns=["force"])
    assert answers.to_csv("class") == (
        "class,rule,status,strength of class soft,strength of class firm,"
        "strength of class hard\n"
        "soft,1,tie,0.5,0.5,0.0\n"
        "hard,0,uncovered,0.0,0.0,0.0\n"
        ",0,missing,,,\n"
    )


def test_a_tree_has_no_strengths_to_tell() -> None:
    answers = ft.run(random_tree(1), np.zeros((2, 4)))
    assert answers.strengths is None
    assert answers.class_strengths is None
    with pytest.raises(ValueError, match="strengths by rule") as caught:
        answers.to_csv("rule")
    assert str(caught.value) == (
        "there are no strengths by rule: rules have them, and a tree follows one path"
    )


@pytest.mark.parametrize("seed", range(4))
def test_strengths_of_classes_are_those_of_their_strongest_rules(seed: int) -> None:
    rules = ft.rules_from_tree(random_tree(seed))
    row = np.random.default_rng(seed).normal(size=4)
    answers = ft.run(rules, row[None, :])
    expected = evaluate(rules, dict(zip(rules.columns, row, strict=True)))
    best = {
        name: max(
            (
                strength
                for rule, strength in zip(rules.rules, expected.strengths, strict=True)
                if rule.then == name
            ),
            default=0.0,
        )
        for name in rules.classes
    }
    assert answers.class_strengths is not None
    result = dict(zip(rules.classes, answers.class_strengths[:, 0], strict=True))
    assert result == best
    assert answers.classes == [expected.label]


def test_batches_join_to_the_predictions_of_the_whole() -> None:
    rules = ft.rules_from_tree(random_tree(2))
    values = np.random.default_rng(0).normal(size=(10, 4))
    whole = ft.run(rules, values)
    parts = joined([ft.run(rules, values[:3]), ft.run(rules, values[3:])])
    assert parts.to_csv("rule") == whole.to_csv("rule")


def test_reasons_show_ties_gaps_and_missing_values() -> None:
    answers = ft.run(RULES, VALUES, columns=["force"])
    assert reasons(RULES, VALUES.T, answers) == [
        "IF force is low (0.5) THEN soft; as strong: rule 2",
        "no rule fires",
        "no finite value: force",
    ]


def test_a_reason_names_the_values_that_stand_for_missing_ones() -> None:
    age = Variable("age", (LOW,), missing=1.5)
    colours = [Variable(name, categories=("blue", "red")) for name in ("eye", "hair")]
    eye, hair = (replace(v, missing=float(k)) for k, v in enumerate(colours, -1))
    rule = Rule((Proposition("age", ("low",)),), "soft")
    rules = RuleBase("grip", ("soft",), (age, eye, hair), (rule,))
    values = np.array([[1.0, math.nan, math.inf], [1.0, math.nan, 0.0], [0.0] * 3])
    answers = ft.run(rules, values.T, columns=["age", "eye", "hair"])
    text = "IF age is low THEN soft"
    assert reasons(rules, values, answers) == [
        text,
        "IF age is low (0.75) THEN soft; missing and replaced: age by 1.5, "
        "eye by no category",
        "IF age is low (0.75) THEN soft; missing and replaced: age by 1.5",
    ]


def test_a_degree_just_below_one_is_not_shown_as_one() -> None:
    codes, rule, status = np.array([0]), np.array([1]), np.array([0])
    answers = Predictions(("soft",), codes, rule, status=status)
    values = np.array([[1.0000001]])
    assert reasons(RULES, values, answers) == ["IF force is low (<1) THEN soft"]


def test_a_rule_without_propositions_always_holds() -> None:
    rules = RuleBase("grip", ("soft",), (), (Rule((), "soft"),))
    answers = ft.run(rules, np.zeros((1, 1)), columns=["force"])
    assert reasons(rules, np.zeros((0, 1)), answers) == ["ALWAYS soft"]


def test_a_frame_of_pandas_without_pandas_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError) as caught:
        ft.run(RULES, VALUES, columns=["force"]).to_pandas()
    assert str(caught.value) == "to_pandas needs pandas: pip install pandas"


def test_answers_become_frames_with_nothing_where_nothing_is_known() -> None:
    result = ft.run(RULES, VALUES, columns=["force"])
    frame = result.to_pandas("class")
    assert frame.columns.tolist() == [*result.columns("class")]
    assert frame["class"].isna().tolist() == [False, False, True]
    assert frame["strength of class soft"].dtype == np.float64
    assert frame["strength of class soft"].isna().tolist() == [False, False, True]
    assert result.to_arrow("class").to_pydict() == {
        "class": ["soft", "hard", None],
        "rule": [1, 0, 0],
        "status": ["tie", "uncovered", "missing"],
        "strength of class soft": [0.5, 0.0, None],
        "strength of class firm": [0.5, 0.0, None],
        "strength of class hard": [0.0, 0.0, None],
    }


def test_predictions_are_a_sequence_of_labels() -> None:
    codes, rule, status = np.array([1, 0, -1]), np.array([2, 1, 0]), np.array([0, 0, 2])
    answers = Predictions(("no", "yes"), codes, rule, status=status)
    assert [*answers] == [answers[row] for row in range(3)] == ["yes", "no", None]
    assert (answers[-2], answers[np.int64(0)], len(answers[1:])) == ("no", "yes", 2)
    assert answers[1:].rule.tolist() == [1, 0]
    assert answers[::-1].classes == [None, "no", "yes"]
    assert "yes" in answers
    assert np.asarray(answers).tolist() == ["yes", "no", None]
    assert np.asarray(answers[:2]).dtype.kind == "U"
    with pytest.raises(IndexError):
        answers[3]
    wrong: Any = "class"
    with pytest.raises(TypeError, match="'str' object cannot be interpreted"):
        answers[wrong]
    with pytest.raises(ValueError, match="an array of predictions is a copy"):
        np.array(answers, copy=False)


@pytest.mark.parametrize("labels", [["a", "b"], [3, 7], [True, False], [0.5, 2.0]])
def test_a_metric_of_scikit_learn_takes_predictions(labels: list[Label]) -> None:
    metrics = pytest.importorskip("sklearn.metrics")
    values = np.array([[1.0], [1.5], [2.0], [7.0], [7.5], [8.0]])
    target = [labels[0]] * 3 + [labels[1]] * 3
    predictions = ft.run(ft.learn(values, target=target), values)
    array = np.asarray(predictions)
    assert array.tolist() == target
    assert [type(label) for label in array.tolist()] == [*map(type, target)]
    if not isinstance(labels[0], float):  # which metrics take for measurements
        assert metrics.accuracy_score(target, predictions) == 1.0
        assert metrics.accuracy_score([labels[0]] * 6, predictions) == 0.5


def test_a_slice_keeps_strengths_and_probabilities() -> None:
    values = np.arange(9.0)[:, None]
    tree = ft.learn(values, target=["no"] * 4 + ["yes"] * 5)
    rules = ft.rules_from_tree(tree)
    answers = ft.run(rules, values, with_strengths=True, with_probabilities=True)
    few, lines = answers[2:5], answers.to_csv("rule").splitlines()
    assert few.to_csv("rule").splitlines() == [lines[0], *lines[3:6]]
    assert "probability of class no" in lines[0]


def test_a_frame_of_polars_has_the_columns_of_arrow() -> None:
    pl = pytest.importorskip("polars")
    codes, rule, status = np.array([1, -1]), np.array([2, 0]), np.array([0, 2])
    answers = Predictions(("no", "yes"), codes, rule, status=status)
    frame = answers.to_polars()
    assert frame["class"].to_list() == ["yes", None]
    assert frame["rule"].dtype == pl.Int32
    assert frame["status"].cast(pl.String).to_list() == ["decided", "uncovered"]


def test_polars_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "polars", None)
    answers = Predictions(("no",), *np.array([[0], [1]]), status=np.array([0]))
    with pytest.raises(MissingExtraError) as caught:
        answers.to_polars()
    text = "to_polars needs polars: pip install 'polars>=1.34'"
    assert str(caught.value) == text
