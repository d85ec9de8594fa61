"""Steps 4 and 5: groups, threshold and the most powerful feature."""

from __future__ import annotations

import numpy as np

from fuzzytree.learning.paper import components, most_powerful, threshold
from fuzzytree.learning.units import FloatArray


def test_the_threshold_falls_with_the_level_and_never_below_zero() -> None:
    spreads = np.array([[1.0, 2.0], [3.0, 2.0]])
    assert threshold(spreads, 4.0, 0).tolist() == [4.0, 4.0]
    assert threshold(spreads, 4.0, 3).tolist() == [1.0, 1.0]
    assert threshold(spreads, 4.0, 9).tolist() == [0.0, 0.0]


def test_patterns_are_connected_over_others() -> None:
    means = np.array([0.0, 5.0, 1.0, 2.0])
    found = components(means, np.zeros(4), 0.9, 0.9)
    assert found.tolist() == [0, 1, 0, 0]


def test_a_narrow_pattern_within_a_wide_one_is_apart_by_its_spread() -> None:
    means, spreads = np.zeros(3), np.array([1.0, 1.1, 9.0])
    assert components(means, spreads, 0.5, 0.9).tolist() == [0, 0, 1]


def chosen(means: FloatArray, costs: list[float]) -> int | None:
    spreads = np.ones_like(means)
    found = most_powerful(
        means,
        spreads,
        threshold(spreads, 4.0, 0),
        alpha=1.0,
        costs=np.array(costs),
    )
    return None if found is None else found.feature


def test_the_feature_with_the_most_groups_is_the_most_powerful() -> None:
    means = np.array([[0.0, 0.0], [5.0, 5.0], [6.0, 10.0]])
    assert chosen(means, [1.0, 1.0]) == 1


def test_ties_go_to_cost_then_order() -> None:
    means = np.array([[0.0, 0.0, 0.0], [5.0, 9.0, 5.0]])
    assert chosen(means, [1.0, 1.0, 1.0]) == 0
    assert chosen(means, [2.0, 2.0, 1.0]) == 2


def test_no_feature_splits_what_is_close() -> None:
    assert chosen(np.array([[0.0], [1.0]]), [1.0]) is None
