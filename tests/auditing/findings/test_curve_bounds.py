"""Curves between two lines: nowhere beyond them, and not far from them."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.decide.lines import APART
from fuzzytree.auditing.findings.curve_bounds import (
    CurveBounds,
    complement,
    curve_bounds,
    gap,
    scale,
)
from fuzzytree.model import (
    Arc,
    Bell,
    Concave,
    Cosine,
    Curve,
    Formula,
    Gaussian,
    Name,
    PiCurve,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Spike,
    TwoGaussians,
)
from fuzzytree.model.rulebase import LR, Band, Points, Side
from fuzzytree.numerics.curve_values import degree_between
from fuzzytree.numerics.exact import exact_degree

OF = Fraction(-3), Fraction(4)
CURVES: tuple[Curve, ...] = (
    Gaussian(0.3, 0.7),
    TwoGaussians(0.0, 0.5, 1.0, 2.0),
    TwoGaussians(1.0, 0.5, 0.0, 2.0),
    Bell(0.1, 1.5, 2.3),
    Bell(0.1, 1.5, 0.4),
    Bell(0.1, 1.5, -0.4),
    Sigmoid(0.2, 7.0),
    Sigmoid(0.2, -0.3),
    SigmoidDifference(Sigmoid(0.0, 5.0), Sigmoid(1.0, 3.0)),
    SigmoidProduct(Sigmoid(0.0, 5.0), Sigmoid(1.0, -3.0)),
    SCurve(-1.0, 2.0),
    SCurve(2.0, -1.0),
    PiCurve(-2.0, -1.0, 0.0, 3.0),
    PiCurve(-2.0, -2.0, 0.0, 3.0),
    Cosine(0.5, 3.0),
    Concave(0.0, 1.5),
    Concave(1.5, 0.0),
    Spike(0.1, 4.0),
    Arc(-1.0, 2.0),
    Arc(2.0, -1.0),
    SemiEllipse(-1.0, 2.5),
    Band(0.0, 1.0, right=4.0),
    LR(0.0, Side(1.0, (0.5,), 2.0), Side(0.5, (0.5,), 3.0)),
)


def places(found: CurveBounds, count: int) -> list[Fraction]:
    """Return drawn values, the points of both lines, and values close to these."""
    chance = random.Random(7)
    made = [Fraction(chance.uniform(*map(float, OF))) for _ in range(count)]
    for shape in (found.lower, found.upper):
        assert isinstance(shape, Points)
        for x in shape.values[:: max(len(shape.values) // count, 1)]:
            made += [Fraction(x) + Fraction(off) for off in (-1e-9, -1e-15, 0, 1e-15)]
    return [x for x in made if OF[0] <= x <= OF[1]]


def beyond(curve: Curve, found: CurveBounds, count: int) -> list[Fraction]:
    """Return values at which a curve is surely beyond one of its lines."""
    made: list[Fraction] = []
    for x in places(found, count):
        true = degree_between(curve, x)
        assert true is not None
        low, high = (exact_degree(line, x) for line in (found.lower, found.upper))
        if low > true.high or high < true.low:
            made.append(x)
    return made


@pytest.mark.one_in(3)
@pytest.mark.parametrize("curve", CURVES, ids=str)
def test_a_curve_is_nowhere_beyond_its_lines_and_never_far_from_them(
    curve: Curve,
) -> None:
    found = curve_bounds(curve, OF)
    assert found is not None
    assert not beyond(curve, found, 4)
    assert 0 < gap(found, OF) <= 2 * APART  # of two neighbours


@pytest.mark.heavy
def test_drawn_curves_are_nowhere_beyond_their_lines() -> None:
    chance = random.Random(11)
    for _ in range(12):
        a, b = sorted(chance.uniform(-4, 5) for _ in range(2))
        wide, slope = chance.uniform(0.01, 5), chance.uniform(-9, 9)
        curves: tuple[Curve, ...] = (
            *(Gaussian(a, wide), TwoGaussians(b, wide, a, 0.3), SCurve(b, a)),
            *(Bell(a, wide, abs(slope)), Sigmoid(a, slope), Cosine(a, wide)),
            *(
                PiCurve(a, a + 0.1, b + 0.1, b + 0.1 + wide),
                Concave(a, b),
                Spike(a, wide),
            ),
            *(Arc(a, b), SemiEllipse(a, b)),
            SigmoidProduct(Sigmoid(a, slope), Sigmoid(b, 3.0)),
            SigmoidDifference(Sigmoid(a, slope), Sigmoid(b, 3.0)),
        )
        for curve in curves:
            found = curve_bounds(curve, OF)
            assert found is not None
            assert not beyond(curve, found, 20)


def test_a_line_that_is_too_high_is_seen_beyond_its_curve() -> None:
    curve = Gaussian(0.3, 0.7)
    found = curve_bounds(curve, OF)
    assert found is not None
    assert isinstance(found.lower, Points)
    raised = tuple(min(one + 0.002, 1.0) for one in found.lower.degrees)
    wrong = found._replace(lower=Points(found.lower.values, raised))
    assert beyond(curve, wrong, 8)


def test_a_curve_that_is_0_nowhere_has_a_lower_line_above_0() -> None:
    for curve in (Gaussian(0.0, 1.0), Bell(0.0, 1.0, 2.0), Sigmoid(0.0, -2.0)):
        found = curve_bounds(curve, OF)
        assert found is not None
        assert isinstance(found.lower, Points)
        assert min(found.lower.degrees) > 0.0


def test_a_curve_that_is_0_and_1_somewhere_has_lines_that_are() -> None:
    for curve in (SCurve(-1.0, 2.0), PiCurve(-2.0, -1.0, 0.0, 3.0), Cosine(0.5, 3.0)):
        found = curve_bounds(curve, OF)
        assert found is not None
        assert isinstance(found.lower, Points)
        assert isinstance(found.upper, Points)
        assert max(found.lower.degrees) == 1.0
        assert exact_degree(found.upper, OF[0]) == 0


def test_a_formula_has_no_lines() -> None:
    assert curve_bounds(Formula(Name("x")), OF) is None


def test_what_is_left_of_1_and_what_is_weighted_lies_between_lines_too() -> None:
    found = curve_bounds(Gaussian(0.3, 0.7), OF)
    assert found is not None
    rest, part = complement(found), scale(found, 0.3)
    assert rest is not None
    assert part is not None
    for x in places(found, 8):
        true = degree_between(Gaussian(0.3, 0.7), x)
        assert true is not None
        low, high = (exact_degree(line, x) for line in (rest.lower, rest.upper))
        assert low <= 1 - true.low
        assert high >= 1 - true.high
        low, high = (exact_degree(line, x) for line in (part.lower, part.upper))
        assert low <= Fraction(0.3) * true.high
        assert high >= Fraction(0.3) * true.low


def test_only_equal_curves_have_one_key() -> None:
    one, other = (curve_bounds(Gaussian(0.3, width), OF) for width in (0.7, 0.7))
    third = curve_bounds(Gaussian(0.3, 0.5), OF)
    assert one is not None
    assert other is not None
    assert third is not None
    assert one.key == other.key != third.key
    half = scale(one, 0.5)
    assert half is not None
    assert half.key != one.key
