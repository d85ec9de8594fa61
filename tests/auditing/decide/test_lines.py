"""Functions between two functions of straight lines: nowhere beyond, and not far."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import get_args

import pytest

from fuzzytree.auditing.decide.lines import APART, Between, Hedged, lines_of
from fuzzytree.model import (
    LR,
    Band,
    Curve,
    Gaussian,
    Hedge,
    MembershipFunction,
    Points,
    SCurve,
    Side,
    Sigmoid,
    SigmoidProduct,
)
from fuzzytree.numerics import degree_between, exact_degree
from fuzzytree.semantics.inference.degrees import hedged

LOW, HIGH = Fraction(-3), Fraction(4)
NEAR = 2.0**-40  # what evaluation in doubles may be off by, and more

TRIANGLE = Points((0.0, 1.0, 2.0), (0.0, 1.0, 0.0))
STEPS = Points((0.0, 0.0, 1.0, 1.0), (0.0, 1.0, 1.0, 0.3))
CURVES: tuple[Curve, ...] = (
    *(Gaussian(0.3, 0.7), SCurve(-1.0, 2.0), TRIANGLE, STEPS),
    LR(0.0, Side(1.0, (0.5,), 2.0), Side(0.5, (0.5, 0.3), 3.0)),
)


def places(known: Between) -> list[Fraction]:
    """Return drawn values, and knots with values close to them."""
    chance = random.Random(7)
    found = [Fraction(chance.uniform(float(LOW), float(HIGH))) for _ in range(40)]
    every = known.lower.x
    for x in every[:: max(len(every) // 20, 1)]:
        found += [x + Fraction(off, 10**15) for off in (-1, 0, 1)]
    return [x for x in found if LOW <= x <= HIGH]


@pytest.mark.parametrize("hedge", get_args(Hedge))
@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: type(curve).__name__)
def test_what_hedges_make_of_a_curve_lies_between_two_lines(
    curve: Curve, hedge: Hedge
) -> None:
    height = 0.75
    known = lines_of(Hedged(curve, height, (hedge,)), LOW, HIGH)
    for x in places(known):
        true = degree_between(curve, x)
        assert true is not None
        ends = sorted(hedged((hedge,), height * float(one)) for one in true)
        low, high = known.lower.value(x), known.upper.value(x)
        assert low <= ends[1] + NEAR
        assert high >= ends[0] - NEAR
        assert high - low <= 2 * APART  # of two neighbours


@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: type(curve).__name__)
def test_a_single_value_has_the_degree_of_the_curve(curve: MembershipFunction) -> None:
    x = Fraction(1, 2)
    known = lines_of(curve, x, x)
    assert known.lower.x == known.upper.x == (x,)
    assert 0 <= known.upper.at[0] - known.lower.at[0] <= Fraction(1, 1 << 30)


@pytest.mark.heavy
@pytest.mark.parametrize("slope", [1e16, 1e300])
def test_a_curve_of_any_steepness_has_lines(slope: float) -> None:
    steep = SigmoidProduct(Sigmoid(0.0, 5e-15), Sigmoid(-4e-6, slope))
    lines = lines_of(steep, LOW, HIGH)
    for x in places(lines):
        true = degree_between(steep, x)
        assert true is not None
        assert lines.lower.value(x) <= true.high
        assert lines.upper.value(x) >= true.low


@pytest.mark.parametrize(
    "inner",
    [
        Points((0.0, 0.0, 1.0, 1.0), (0.25, 1.0, 1.0, 0.5)),
        Band(0.0, 1.0),
        Band(0.0, 1.0, left=-1.0, right=3.0),
    ],
)
def test_both_limits_are_met_where_a_function_within_hedges_may_jump(
    inner: Band | Points,
) -> None:
    lines, tiny = lines_of(Hedged(inner, 1.0, ("not",)), LOW, HIGH), Fraction(1, 10**9)
    for x in (Fraction(0), Fraction(1)):
        place = lines.lower.x.index(x)
        for limit, near in (("before", x - tiny), ("after", x + tiny)):
            number = place - (limit == "before")
            low, high = (getattr(one, limit)[number] for one in lines)
            degree = 1 - exact_degree(inner, near)
            assert low - 10 * tiny <= degree <= high + 10 * tiny
            assert high - low <= APART
