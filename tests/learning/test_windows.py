"""Window counts against rational arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.learning.shapes import window_counts
from fuzzytree.learning.sums import totals_of
from fuzzytree.learning.units import FloatArray


def counted(values: list[float] | FloatArray, n: int) -> list[int]:
    rows = np.asarray(values, np.float64)
    groups = np.zeros(len(rows), np.int64)
    found = window_counts(rows, groups, totals_of(rows, groups, 1), n)
    return [int(count) for count in found[0]]


def counted_by_fractions(values: list[float] | FloatArray, n: int) -> list[int]:
    """Count by comparing n (x - M) with (k - 1) SD and (k + 1) SD, both squared."""
    rows = [Fraction(v) for v in np.asarray(values, np.float64).tolist()]
    mean = sum(rows, Fraction(0)) / len(rows)
    variance = sum(((v - mean) ** 2 for v in rows), Fraction(0)) / max(len(rows) - 1, 1)

    def is_at_most(left: Fraction, factor: int) -> bool:
        """Return whether left <= factor * SD."""
        if left < 0 <= factor:
            return True
        if left >= 0 > factor:
            return left == 0 == variance
        is_less = left**2 <= factor**2 * variance
        is_more = left**2 >= factor**2 * variance
        return is_less if left >= 0 else is_more

    if variance == 0:
        return [len(rows) if abs(k) <= 1 else 0 for k in range(-n, n + 1)]
    return [
        sum(
            is_at_most(-n * (v - mean), 1 - k) and is_at_most(n * (v - mean), k + 1)
            for v in rows
        )
        for k in range(-n, n + 1)
    ]


@pytest.mark.one_in(8)
@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("low", [0.0, 0.1, 1e12, -3e-310])
def test_two_valued_columns_are_counted_exactly(low: float, n: int) -> None:
    high = low + max(math.ulp(low) * 3, 1e-320)
    for few in range(1, 9):
        for many in range(1, 9):
            values = [low] * few + [high] * many
            assert counted(values, n) == counted_by_fractions(values, n)


@pytest.mark.heavy
@given(
    st.lists(st.integers(-6, 6), min_size=1, max_size=12),
    st.integers(1, 8),
    st.integers(-60, 60),
    st.sampled_from([0.0, 1.0, 2.0**52, 1e15]),
)
@settings(max_examples=300, deadline=None)
def test_lattices_are_counted_exactly(
    steps: list[int], n: int, exponent: int, offset: float
) -> None:
    values = np.ldexp(np.array(steps, np.float64), exponent) + offset
    assert counted(values, n) == counted_by_fractions(values, n)


@pytest.mark.heavy
@given(
    st.lists(st.floats(-1e6, 1e6) | st.floats(), min_size=1, max_size=12),
    st.integers(1, 8),
)
@settings(max_examples=200, deadline=None)
def test_any_column_is_counted_exactly(values: list[float], n: int) -> None:
    finite = [v for v in values if math.isfinite(v)] or [0.0]
    assert counted(finite, n) == counted_by_fractions(finite, n)


def test_the_spread_itself_lies_on_two_edges() -> None:
    # M = 0 and SD = 1: -1 and 1 are the edges k = -n and n, and centres of the last.
    assert counted([-1.0, 0.0, 1.0], 2) == [1, 2, 1, 2, 1]
    assert counted([-1.0 / 3, 0.0, 1.0 / 3], 2) == [1, 2, 1, 2, 1]


def test_two_rows_lie_alike_on_both_sides() -> None:
    found = counted([3.1, 3.7], 3)
    assert found == found[::-1] == counted_by_fractions([3.1, 3.7], 3)


def test_equal_values_lie_in_the_middle_windows() -> None:
    assert counted([0.1] * 7, 3) == [0, 0, 7, 7, 7, 0, 0]
    assert counted([0.1], 2) == [0, 1, 1, 1, 0]


def test_groups_are_counted_apart() -> None:
    values = np.array([-1.0, 0.0, 1.0, 9.0, 9.0])
    groups = np.array([0, 0, 0, 2, 2])
    found = window_counts(values, groups, totals_of(values, groups, 3), 1)
    assert found.tolist() == [[2, 3, 2], [0, 0, 0], [2, 2, 2]]


@pytest.mark.heavy
def test_many_rows_on_edges_are_counted_exactly() -> None:
    rng = np.random.default_rng(0)
    for offset in (0.0, 1e3, 1e9, 1e15):
        values = np.round(rng.normal(size=3000) * 4) / 4 + offset
        assert counted(values, 4) == counted_by_fractions(values, 4)
