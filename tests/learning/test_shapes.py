"""Fuzzy sets from window counts, and flanks from ratios."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzzytree.learning.shapes import (
    REACH,
    _interpolated,
    fitted_sets,
)
from fuzzytree.learning.units import IntArray
from fuzzytree.model.rulebase import LR, Side
from fuzzytree.semantics.reference import degree

ONE = np.array([0.0]), np.array([1.0])
FIRST: IntArray = np.array([0])


def degrees(counts: list[int], points: list[float], *, apart: bool) -> list[float]:
    fitted = fitted_sets(
        *ONE, np.array([counts]), separate_sides=apart, keeps_flaws=True
    )
    found: list[float] = fitted.degrees(FIRST, np.array(points))[0].tolist()
    return found


def test_the_curve_goes_through_the_points() -> None:
    found = degrees([2, 6, 9, 10, 9, 6, 2], [0.0, 1 / 3, 2 / 3, -1.0], apart=False)
    expected = [1.0, 0.9, 0.6, 0.2 * 1.0]
    assert found == pytest.approx(expected, abs=1e-12)


def test_sides_are_averaged_unless_they_are_fitted_apart() -> None:
    counts = [4, 10, 8]
    assert degrees(counts, [-1.0, 1.0], apart=False) == pytest.approx([0.6, 0.6])
    assert degrees(counts, [-1.0, 1.0], apart=True) == pytest.approx([0.4, 0.8])


def test_a_set_is_one_at_its_mean_and_zero_from_its_reach_on() -> None:
    found = degrees([1, 2, 3, 4, 3, 2, 1], [0.0, REACH, -REACH, 9.0], apart=False)
    assert found == [1.0, 0.0, 0.0, 0.0]


def test_every_repair_is_counted() -> None:
    counts = np.array([[0, 12, 10, 10, 10, 12, 0], [3, 2, 1, 0, 1, 2, 3]])
    means, spreads = np.zeros(2), np.ones(2)
    repairs = fitted_sets(
        means, spreads, counts, separate_sides=False, keeps_flaws=True
    ).repairs
    assert repairs.off_peak == 2
    assert repairs.empty_centre == 1
    assert repairs.clipped == 1
    assert repairs.lowered == 2
    assert repairs.overshooting == 1
    assert repairs.rising == 2


@given(st.lists(st.integers(0, 50), min_size=7, max_size=7))
def test_degrees_are_those_of_the_reference(counts: list[int]) -> None:
    fitted = fitted_sets(
        np.array([2.0]),
        np.array([0.3]),
        np.array([counts]),
        separate_sides=True,
        keeps_flaws=True,
    )
    shape = LR(
        2.0,
        Side(0.3, tuple(fitted.left[0].tolist()), REACH),
        Side(0.3, tuple(fitted.right[0].tolist()), REACH),
    )
    points = np.linspace(0.0, 4.0, 41)
    expected = [degree(shape, x) for x in points.tolist()]
    np.testing.assert_allclose(fitted.degrees(FIRST, points)[0], expected, atol=1e-15)


@pytest.mark.parametrize("n", range(1, 9))
def test_a_curve_goes_through_its_points(n: int) -> None:
    degrees = np.sort(np.random.default_rng(n).random((20, n)), axis=1)[:, ::-1]
    t = np.arange(1, n + 1) / n
    powers = np.vander(2.0 * t - 1.0, n, increasing=True)
    found = 1.0 - t * (_interpolated(degrees) @ powers.T)
    np.testing.assert_allclose(found, degrees, atol=1e-12)
