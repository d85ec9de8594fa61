"""LearningSettings out of their range, in sentences."""

from __future__ import annotations

from typing import Any

import pytest

from fuzzytree.learning import LearningSettings


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
