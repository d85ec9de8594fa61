"""Predictions name classes, count what is odd, and say why."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.errors import MissingExtraError
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
    text = "IF age is low (1) THEN soft"
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
