"""Fuzzy sets from window counts, and flanks from ratios."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzzytree.learning.shapes import (
    REACH,
    SAMPLES,
    _interpolated,
    fitted_flanks,
    fitted_sets,
)
from fuzzytree.learning.units import FloatArray, IntArray
from fuzzytree.model.rulebase import LR, Side
from fuzzytree.semantics.reference import degree

ONE = np.array([0.0]), np.array([1.0])
FIRST: IntArray = np.array([0])


def degrees(counts: list[int], points: list[float], *, apart: bool) -> list[float]:
    fitted = fitted_sets(*ONE, np.array([counts]), separate_sides=apart)
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
    repairs = fitted_sets(means, spreads, counts, separate_sides=False).repairs
    assert repairs.off_peak == 2
    assert repairs.empty_centre == 1
    assert repairs.clipped == 1
    assert repairs.lowered == 2
    assert repairs.overshooting == 1
    assert repairs.rising == 2


@given(st.lists(st.integers(0, 50), min_size=7, max_size=7))
def test_degrees_are_those_of_the_reference(counts: list[int]) -> None:
    fitted = fitted_sets(
        np.array([2.0]), np.array([0.3]), np.array([counts]), separate_sides=True
    )
    shape = LR(
        2.0,
        Side(0.3, tuple(fitted.left[0].tolist()), REACH),
        Side(0.3, tuple(fitted.right[0].tolist()), REACH),
    )
    points = np.linspace(0.0, 4.0, 41)
    expected = [degree(shape, x) for x in points.tolist()]
    np.testing.assert_allclose(fitted.degrees(FIRST, points)[0], expected, atol=1e-15)


@given(st.lists(st.floats(0, 1, width=16), min_size=SAMPLES - 2, max_size=SAMPLES - 2))
def test_a_flank_never_falls_towards_its_cut(inner: list[float]) -> None:
    ratios = np.array([[0.0, *sorted(inner), 1.0]])
    curve, error = fitted_flanks(ratios)
    q = np.linspace(0.0, 1.0, 201)
    flank = q * (curve[0, 0] + q * (curve[0, 1] + q * curve[0, 2]))
    assert (np.diff(flank) >= -1e-12).all()
    assert flank[0] == 0.0
    assert flank[-1] == pytest.approx(1.0, abs=1e-12)
    assert error[0] == pytest.approx(largest_gap(curve[0], ratios[0]), abs=1e-12)


def largest_gap(curve: FloatArray, ratios: FloatArray) -> float:
    q = np.linspace(0.0, 1.0, SAMPLES)
    fit = q * (curve[0] + q * (curve[1] + q * curve[2]))
    return float(np.abs(fit - ratios).max())


@pytest.mark.parametrize(
    ("first", "second", "allowed"), [(0.25, 0.75, 1e-15), (0.2, 0.7, 2.0**-32)]
)
def test_a_ratio_that_is_such_a_cubic_is_fitted_to_32_binary_digits(
    first: float, second: float, allowed: float
) -> None:
    q = np.linspace(0.0, 1.0, SAMPLES)
    ratios = 3 * first * q * (1 - q) ** 2 + 3 * second * q**2 * (1 - q) + q**3
    _, error = fitted_flanks(ratios[None])
    assert error[0] <= allowed


def test_a_flank_is_1_at_its_cut_without_any_rounding() -> None:
    ratios = np.sort(np.random.default_rng(0).random((200, SAMPLES)), axis=1)
    curves, _ = fitted_flanks(ratios)
    for c0, c1, c2 in curves.tolist():
        assert c0 + (c1 + c2) == Fraction(c0) + Fraction(c1) + Fraction(c2) == 1


@pytest.mark.parametrize("n", range(1, 9))
def test_a_curve_goes_through_its_points(n: int) -> None:
    degrees = np.sort(np.random.default_rng(n).random((20, n)), axis=1)[:, ::-1]
    t = np.arange(1, n + 1) / n
    powers = np.vander(2.0 * t - 1.0, n, increasing=True)
    found = 1.0 - t * (_interpolated(degrees) @ powers.T)
    np.testing.assert_allclose(found, degrees, atol=1e-12)


def test_no_other_monotone_cubic_fits_better() -> None:
    q = np.linspace(0.0, 1.0, SAMPLES)
    ratios = np.where(q > 0.6, 1.0, 0.0)
    curve, _ = fitted_flanks(ratios[None])
    fit = q * (curve[0, 0] + q * (curve[0, 1] + q * curve[0, 2]))
    best = ((fit - ratios) ** 2).sum()
    for b1 in np.linspace(0, 1, 51):
        for b2 in np.linspace(b1, 1, 51):
            other = 3 * b1 * q * (1 - q) ** 2 + 3 * b2 * q**2 * (1 - q) + q**3
            assert ((other - ratios) ** 2).sum() >= best - 1e-12
