"""The paper's steps on numbers small enough to do by hand."""

import numpy as np
import pytest

from fuzzytree.learning.paper import components, most_powerful, threshold
from fuzzytree.learning.shapes import fitted_sets, window_counts
from fuzzytree.learning.statistics import Statistics
from fuzzytree.learning.sums import Totals


def test_the_threshold_is_the_mean_spread_times_half_the_levels_left() -> None:
    spreads = np.array([[1.0], [3.0]])  # M_SD = 2
    assert threshold(spreads, 4, 0).tolist() == [4.0]
    assert threshold(spreads, 4, 1).tolist() == [3.0]
    assert threshold(spreads, 4, 4).tolist() == [0.0]


def test_the_threshold_is_never_below_zero() -> None:
    assert threshold(np.array([[1.0], [3.0]]), 4, 9).tolist() == [0.0]


def test_the_distance_weighs_means_and_spreads() -> None:
    # d = 0.9 |0 - 10| + 0.1 |1 - 3| = 9.2
    means, spreads = np.array([0.0, 10.0]), np.array([1.0, 3.0])
    assert components(means, spreads, 9.2, 0.9).tolist() == [0, 0]
    assert components(means, spreads, 9.199, 0.9).tolist() == [0, 1]


def test_what_is_close_to_a_member_belongs_to_its_group() -> None:
    means = np.array([0.0, 3.0, 1.0, 2.0, 9.0])
    assert components(means, np.ones(5), 1.0, 1.0).tolist() == [0, 0, 0, 0, 1]


@pytest.mark.parametrize("seed", range(20))
def test_groups_are_the_connected_components_of_near_pairs(seed: int) -> None:
    chance = np.random.default_rng(seed)
    means, spreads = chance.normal(size=60), chance.exponential(size=60) * 5
    limit = float(chance.uniform(0.01, 0.6))
    apart = 0.7 * np.abs(means[:, None] - means)
    apart += (1.0 - 0.7) * np.abs(spreads[:, None] - spreads)
    reach = np.linalg.matrix_power((apart <= limit).astype(float), 60) > 0
    found = components(means, spreads, limit, 0.7)
    assert np.array_equal(found[:, None] == found, reach)


def powerful(costs: list[float]) -> int:
    """Return which of three features splits three patterns best."""
    means = np.array([[0.0, 0.0, 0.0], [0.5, 5.0, 9.0], [9.0, 10.0, 18.0]])
    found = most_powerful(
        means,
        np.ones((3, 3)),
        np.full(3, 2.0),
        alpha=1.0,
        costs=np.array(costs),
    )
    assert found is not None
    return found.feature


def test_the_most_powerful_feature_makes_the_most_groups() -> None:
    assert powerful([1.0, 1.0, 1.0]) == 1  # three groups, and the first that does


def test_of_equally_powerful_features_the_cheapest_is_taken() -> None:
    assert powerful([0.0, 2.0, 1.0]) == 2  # the cheap first one makes fewer groups


def test_patterns_too_similar_to_split_stop_the_node() -> None:
    means, spreads = np.array([[1.0], [1.5]]), np.ones((2, 1))
    assert (
        most_powerful(
            means,
            spreads,
            np.array([2.0]),
            alpha=0.9,
            costs=np.ones(1),
        )
        is None
    )


def test_mean_and_spread_divide_by_n_and_by_n_minus_one() -> None:
    statistics = Statistics(classes=1, features=1)
    statistics.update(np.array([[1.0], [3.0], [5.0]]), np.zeros(3, np.int64))
    found = statistics.moments()
    assert (found.means.item(), found.spreads.item()) == (3.0, 2.0)


@pytest.mark.parametrize("value", [0.1, 1e13 + 0.1, 1e-300, -7.3])
def test_equal_values_have_no_spread_at_all(value: float) -> None:
    statistics = Statistics(classes=1, features=1)
    statistics.update(np.full((400, 1), value), np.zeros(400, np.int64))
    found = statistics.moments()
    assert (found.means.item(), found.spreads.item()) == (value, 0.0)


@pytest.mark.parametrize("ratio", [1e-3, 1e-6, 1e-9, 1e-11])
def test_a_spread_keeps_its_digits_far_from_zero(ratio: float) -> None:
    chance = np.random.default_rng(0)
    values = 1e12 * (1.0 + ratio * chance.normal(size=200))
    statistics = Statistics(classes=1, features=1)
    statistics.update(values[:, None], np.zeros(200, np.int64))
    exact = np.std(values - values[0], ddof=1)
    assert abs(statistics.moments().spreads.item() / exact - 1) < 1e-12


def test_windows_overlap_by_half_and_are_closed_at_both_ends() -> None:
    # M = 0, SD = 2, n = 2: S(k) counts [k - 1, k + 1].
    values = np.array([-2.0, -1.0, 0.0, 0.5, 1.0, 2.0, 3.5])
    table = Totals(counts=[3], sums=[0], squares=[8], unit=0)  # -2, 0 and 2
    half = Totals(table.counts, table.sums, [32], unit=-1)  # the same in halves
    found = window_counts(values, np.zeros(7, np.int64), half, 2)
    assert half.spreads() == table.spreads() == 2.0
    assert found.tolist() == [[2, 3, 4, 4, 2]]


def test_a_set_goes_through_its_points() -> None:
    # S = 2, 6, 8, 6, 2: degrees 3/4 at half a spread and 1/4 at one.
    counts = np.array([[2, 6, 8, 6, 2]])
    found = fitted_sets(
        np.array([0.0]), np.array([1.0]), counts, separate_sides=False, keeps_flaws=True
    )
    degrees = found.degrees(np.array([0]), np.array([0.0, 0.5, -0.5, 1.0, 5.0]))
    assert np.allclose(degrees, [[1.0, 0.75, 0.75, 0.25, 0.0]], atol=1e-15)


def test_the_two_sides_are_averaged_unless_they_are_separate() -> None:
    counts = np.array([[2, 8, 6]])
    means, spreads = np.array([0.0]), np.array([1.0])
    ends = np.array([-1.0, 1.0])
    same = fitted_sets(means, spreads, counts, separate_sides=False, keeps_flaws=True)
    apart = fitted_sets(means, spreads, counts, separate_sides=True, keeps_flaws=True)
    assert np.allclose(same.degrees(np.array([0]), ends), [[0.5, 0.5]])
    assert np.allclose(apart.degrees(np.array([0]), ends), [[0.25, 0.75]])


def test_every_repair_of_a_set_is_counted() -> None:
    counts = np.array([[0, 9, 4, 9, 0], [5, 1, 0, 1, 5], [1, 2, 4, 2, 1]])
    found = fitted_sets(
        np.zeros(3), np.ones(3), counts, separate_sides=False, keeps_flaws=True
    ).repairs
    assert found.off_peak == 2
    assert found.empty_centre == 1
    assert found.clipped >= 1
    assert found.lowered >= 1
