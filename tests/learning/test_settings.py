"""LearningSettings out of their range, in sentences."""

from __future__ import annotations

import inspect
from typing import Any, get_type_hints

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.learning import LearningSettings, SettingArguments, settings_of


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"mode": "fast"}, "mode is 'default' or 'paper', not 'fast'"),
        ({"mode": "paper", "alpha": 1.5}, "alpha lies in [0, 1], not 1.5"),
        ({"mode": "paper", "l_max": 0.0}, "l_max is above 0, not 0.0"),
        ({"points": 9}, "points lies in 1 to 8, not 9"),
        ({"shrinkage": 1.0}, "shrinkage lies in [0, 1), not 1.0"),
        ({"entry": -1.0}, "entry is at least 0, not -1.0"),
        ({"entry": float("nan")}, "entry is at least 0, not nan"),
        ({"rows_per_class": 0}, "rows_per_class is at least 1, not 0"),
        ({"missing": "guess"}, "missing is 'learn', 'drop' or 'refuse', not 'guess'"),
        (
            {"mode": "paper", "patterns_per_class": 0},
            "patterns_per_class is at least 1, not 0",
        ),
        (
            {"mode": "paper", "patterns_per_class": {"a": 0}},
            "patterns_per_class of class 'a' is at least 1, not 0",
        ),
        (
            {"costs": {"x": -1.0}},
            "the cost of 'x' is finite and at least 0, not -1.0",
        ),
        (
            {"columns_per_node": 0},
            "columns_per_node is at least 1, not 0",
        ),
        (
            {"alpha": 0.5},
            "alpha is a setting of the mode 'paper', not of 'default'",
        ),
        (
            {"mode": "paper", "leaves": 5},
            "leaves is a setting of the mode 'default', not of 'paper'",
        ),
        (
            {"mode": "paper", "alpha": -1.0, "points": 0},
            "alpha lies in [0, 1], not -1.0\npoints lies in 1 to 8, not 0",
        ),
    ],
    ids=str,
)
def test_a_setting_out_of_its_range_is_refused(
    wrong: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        LearningSettings(**wrong)
    assert str(caught.value) == message


def test_every_setting_can_be_named_with_its_type() -> None:
    assert get_type_hints(SettingArguments) == get_type_hints(LearningSettings)


def test_settings_by_name_go_before_a_mapping_or_an_object() -> None:
    both = LearningSettings(leaves=5, columns_per_node=1)
    assert (
        settings_of(LearningSettings(leaves=4, columns_per_node=1), {"leaves": 5})
        == both
    )
    assert settings_of({"leaves": 4, "columns_per_node": 1}, {"leaves": 5}) == both
    assert settings_of(None, {}) == LearningSettings()
    rows, labels = [[1.0], [2.0], [4.0], [5.0], [8.0], [9.0]] * 4, [*"aabbcc"] * 4
    values = np.array(rows)
    assert len(ft.learn(values, target=labels, leaves=2).leaves) == 2
    assert len(ft.learn(values, target=labels, settings={"leaves": 2}).leaves) == 2
    with pytest.raises(ValueError, match="leaves is at least 1, not 0"):
        ft.learn(values, target=labels, leaves=0)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("max_depth", "it is called 'depth' here"),
        ("max_leaf_nodes", "it is called 'leaves' here"),
        ("min_samples_leaf", "it is called 'min_rows' here"),
        ("random_state", "it is called 'seed' here"),
        ("n_estimators", "one tree is learnt, and no forest"),
        (
            "criterion",
            "each split is scored by the classes of the rows that it separates",
        ),
        ("leafs", "there is {}, ... (did you mean 'leaves'?)"),
    ],
)
def test_a_setting_of_another_name_is_refused_with_ours(
    name: str, message: str
) -> None:
    wrong: Any = {name: 3}
    names = [*LearningSettings.__struct_fields__][:12]
    for settings, more in ((None, wrong), (wrong, {})):
        with pytest.raises(TypeError) as caught:
            ft.learn(np.zeros((2, 1)), target=[0, 1], settings=settings, **more)
        shown = message.format(", ".join(names))
        assert str(caught.value) == f"learn has no setting {name!r}; {shown}"
    with pytest.raises(TypeError) as caught:
        ft.FuzzyTreeClassifier(**wrong)
    names = [*inspect.signature(ft.FuzzyTreeClassifier).parameters][:12]
    shown = message.format(", ".join(names))
    assert str(caught.value) == f"FuzzyTreeClassifier has no setting {name!r}; {shown}"


def test_an_argument_of_another_name_is_refused_with_ours() -> None:
    wrong: Any = {"weight": [1, 1]}
    with pytest.raises(TypeError, match=r"\(did you mean 'weights'\?\)$"):
        ft.learn(np.zeros((2, 1)), target=[0, 1], **wrong)
