"""Sums without rounding, against the rational numbers."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.learning.sums import (
    MOST_ROWS,
    Sums,
    Totals,
    rounded_ratio,
    rounded_root,
    runs,
    totals_of,
)
from fuzzytree.learning.units import FloatArray, IntArray

FLOATS = st.floats(allow_nan=False, allow_infinity=False)


def exactly(totals: Totals, group: int) -> tuple[Fraction, Fraction]:
    unit = Fraction(2) ** totals.unit
    return totals.sums[group] * unit, totals.squares[group] * unit**2


def assert_exact(totals: Totals, values: FloatArray, groups: IntArray) -> None:
    for group, count in enumerate(totals.counts):
        own = [Fraction(v) for v in values[groups == group].tolist()]
        assert count == len(own)
        assert exactly(totals, group) == (sum(own), sum(v * v for v in own))


@given(st.lists(st.tuples(FLOATS, st.integers(0, 2)), min_size=1, max_size=40))
@settings(max_examples=200, deadline=None)
def test_sums_of_any_floats_are_exact(rows: list[tuple[float, int]]) -> None:
    values = np.array([value for value, _ in rows])
    groups = np.array([group for _, group in rows])
    assert_exact(totals_of(values, groups, 3), values, groups)


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    "values",
    [
        np.random.default_rng(0).normal(size=20_000),
        np.random.default_rng(0).normal(size=20_000) + 1e12,
        np.exp(30 * np.random.default_rng(0).normal(size=3_000)),
        np.full(MOST_ROWS, np.nextafter(1.0, 0.0)),
        np.full(MOST_ROWS, np.finfo(np.float64).max),
        np.array([5e-324, 1.0, -1.7e308, 1e-310, 0.0, -5e-324]),
        np.zeros(5),
    ],
    ids=["normal", "far", "wide", "all bits", "largest", "all exponents", "zeros"],
)
def test_sums_of_columns_are_exact(values: FloatArray) -> None:
    groups = np.arange(len(values)) % 3
    assert_exact(totals_of(values, groups, 3), values, groups)


def test_many_groups_are_added_up_as_few_are() -> None:
    rng = np.random.default_rng(1)
    values, groups = rng.normal(size=3000), np.sort(rng.integers(0, 1500, 3000))
    assert_exact(totals_of(values, groups, 1500), values, groups)


def test_columns_that_grow_keep_their_sums() -> None:
    sums = Sums(1, 2)
    columns = np.array([[2.0**-40, 3.0], [0.0, 0.1]])
    everything = np.array([0]), np.array([0]), np.array([2])
    for power in range(0, 400, 37):
        sums.add(np.ldexp(columns, power), *everything)
    for feature in (0, 1):
        values = np.concatenate(
            [np.ldexp(columns[feature], power) for power in range(0, 400, 37)]
        )
        totals = sums.totals(feature, [len(values)])
        assert_exact(totals, values, np.zeros(len(values), np.int64))


def test_more_blocks_than_64_bits_hold_are_exact() -> None:
    sums, column = Sums(1, 1), np.full((1, MOST_ROWS), 1.0 - 2.0**-20)
    for _ in range(300):
        sums.add(column, np.array([0]), np.array([0]), np.array([MOST_ROWS]))
    value, count = Fraction(column[0, 0]), 300 * MOST_ROWS
    assert exactly(sums.totals(0, [count]), 0) == (count * value, count * value**2)


def test_runs_say_where_each_code_begins() -> None:
    present, starts, counts = runs(np.array([2, 2, 5, 7, 7, 7]))
    assert present.tolist() == [2, 5, 7]
    assert starts.tolist() == [0, 2, 3]
    assert counts.tolist() == [2, 1, 3]


@given(st.integers(-(10**40), 10**40), st.integers(1, 10**30), st.integers(-200, 200))
@settings(deadline=None)
def test_a_ratio_is_rounded_once(top: int, bottom: int, exponent: int) -> None:
    exact = Fraction(top, bottom) * Fraction(2) ** exponent
    assert rounded_ratio(top, bottom, exponent) == float(exact)


@given(st.integers(0, 10**40), st.integers(1, 10**30), st.integers(-500, 500))
@settings(deadline=None)
def test_a_root_is_the_nearest_float(top: int, bottom: int, exponent: int) -> None:
    found = Fraction(rounded_root(top, bottom, exponent))
    square = Fraction(top, bottom) * Fraction(4) ** exponent
    below = (found + Fraction(math.nextafter(float(found), -math.inf))) / 2
    above = (found + Fraction(math.nextafter(float(found), math.inf))) / 2
    assert found == 0 == square or below**2 <= square <= above**2


def test_a_mean_and_a_spread_are_those_of_more_digits() -> None:
    values = 1e12 + np.random.default_rng(2).normal(size=501)
    totals = totals_of(values, np.zeros(501, np.int64), 1)
    with localcontext() as context:
        context.prec = 80
        exact = [Decimal(v) for v in values.tolist()]
        mean = sum(exact, Decimal(0)) / len(exact)
        squares = sum(((v - mean) ** 2 for v in exact), Decimal(0))
        variance = squares / (len(exact) - 1)
        assert totals.means()[0] == float(mean)
        assert totals.spreads()[0] == float(variance.sqrt())
        assert totals.means(float(exact[0]), -3)[0] == float((mean - exact[0]) * 8)


@pytest.mark.parametrize(
    ("values", "mean", "spread"),
    [
        ([7.0], 7.0, 0.0),
        ([0.1] * 3, 0.1, 0.0),
        ([-1e308, 1e308], 0.0, math.sqrt(2.0) * 1e308),
        ([0.0, 5e-324], 0.0, 5e-324),
        ([1e16, 1.0, -1e16], 1 / 3, 1e16),
        ([1e300, 1e300 * (1 + 2**-52)], 1e300, math.sqrt(0.5) * math.ulp(1e300)),
    ],
)
def test_hard_cases_have_the_exact_mean_and_spread(
    values: list[float], mean: float, spread: float
) -> None:
    totals = totals_of(np.array(values), np.zeros(len(values), np.int64), 1)
    assert totals.means()[0] == mean
    assert totals.spreads()[0] == pytest.approx(spread, rel=1e-15)


def test_a_group_without_values_has_no_mean() -> None:
    totals = totals_of(np.array([1.0]), np.array([1]), 2)
    assert np.isnan(totals.means()).tolist() == [True, False]
    assert np.isnan(totals.spreads()).tolist() == [True, False]
