"""The largest difference of two clipped polynomials, and the stretches of shapes."""

from __future__ import annotations

import contextlib
import io
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.model.rulebase import LR, Shape, Side
from fuzzytree.numerics.curves import (
    DegreePiece,
    body_coefficients,
    distance,
    lowest,
    side_stretches,
)
from fuzzytree.numerics.exact import exact_degree

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "bounds.md"
CURVES = st.lists(st.floats(-4.0, 4.0), min_size=1, max_size=8)
SHARES = [Fraction(number, 32) for number in range(33)]


def value(coefficients: list[float], z: Fraction) -> Fraction:
    return sum((Fraction(c) * z**k for k, c in enumerate(coefficients)), Fraction(0))


def clipped(height: Fraction) -> Fraction:
    return min(max(height, Fraction(0)), Fraction(1))


def bound_of(p: list[float], r: list[float]) -> float:
    zero, one = np.zeros(1), np.ones(1)
    first, second = (np.array(c, np.float64).reshape(-1, 1) for c in (p, r))
    return distance(zero, one, first, second, 1.0)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(CURVES, CURVES)
def test_no_difference_is_above_the_bound(p: list[float], r: list[float]) -> None:
    bound = Fraction(bound_of(p, r))
    for z in SHARES:
        assert abs(clipped(value(p, z)) - clipped(value(r, z))) <= bound


@settings(max_examples=60, deadline=None, derandomize=True)
@given(CURVES, CURVES)
def test_the_bound_is_little_above_what_occurs(p: list[float], r: list[float]) -> None:
    z = np.linspace(0.0, 1.0, 20_001)
    heights = [np.clip(np.polynomial.polynomial.polyval(z, c), 0, 1) for c in (p, r)]
    seen = float(np.abs(heights[0] - heights[1]).max())
    assert bound_of(p, r) <= seen * 1.01 + 0.004  # what a grid of that step can miss


@pytest.mark.parametrize(
    ("p", "r", "largest"),
    [
        ([0.0, 1.0], [0.0, 0.0, 1.0], 0.25),  # z - z**2 at 1/2
        ([0.0, 2.0], [1.0], 1.0),  # 1 at 0, and 0 from 1/2 on
        ([3.0], [2.0, 5.0], 0.0),  # both above 1
        ([-1.0, 0.5], [0.0], 0.0),  # never above 0
        ([0.0, 4.0, -4.0], [0.0], 1.0),  # a hill of height 1
        ([0.0, 8.0, -8.0], [1.0, -1.0], 1.0),  # a hill of height 2, clipped
        ([0.5], [0.5], 0.0),
    ],
)
def test_the_bound_is_what_one_finds_by_hand(
    p: list[float], r: list[float], largest: float
) -> None:
    assert largest <= bound_of(p, r) <= largest * 1.01 + 1e-13


def test_a_bound_that_ignored_the_bend_would_be_too_small() -> None:
    p, r = [0.0, 0.0, 1.0], [0.0, 1.0]
    ends = max(abs(value(p, z) - value(r, z)) for z in (Fraction(0), Fraction(1)))
    assert ends == 0
    assert bound_of(p, r) >= 0.25


@settings(max_examples=60, deadline=None, derandomize=True)
@given(CURVES, st.floats(0.125, 1.0))
def test_the_lowest_value_is_never_missed(p: list[float], last: float) -> None:
    found = lowest(np.array(p).reshape(-1, 1), last)
    heights = [value(p, Fraction(last) * share) for share in SHARES]
    assert Fraction(found) <= min(heights)
    assert found >= float(min(heights)) - 2.0


@settings(max_examples=50, deadline=None, derandomize=True)
@given(CURVES)
def test_a_body_is_expanded_without_rounding(curve: list[float]) -> None:
    expanded = body_coefficients(curve)
    for t in SHARES:
        inner = value(curve, 2 * t - 1)
        assert sum(c * t**k for k, c in enumerate(expanded)) == 1 - t * inner


def test_stretches_are_the_shapes_that_they_come_from() -> None:
    uneven = LR(3.0, Side(0.5, (0.5, 0.25), 4.0), Side(2.0, (1.0,), 1.5))
    cases: list[tuple[DegreePiece, Shape]] = []
    for side, sign in ((uneven.left, -1), (uneven.right, 1)):
        cases += [(one, uneven) for one in side_stretches(side, uneven.mean, sign)]
    for one, shape in cases:
        for share in SHARES:
            z = one.first + share * (one.last - one.first)
            height = clipped(value(list(one.coefficients), z))
            exact = exact_degree(shape, one.origin + one.unit * z)
            assert abs(min(height, Fraction(one.top)) - exact) < 1e-15


@pytest.mark.heavy
def test_the_page_prints_what_its_code_prints() -> None:
    text = PAGE.read_text("utf-8")
    found = re.search(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, re.DOTALL)
    assert found is not None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(found[1], {})
    assert printed.getvalue() == found[2]
