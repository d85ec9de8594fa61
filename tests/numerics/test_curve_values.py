"""Bounds of the degrees of curves, against interval arithmetic of another library."""

from __future__ import annotations

import random
from decimal import Context, Decimal, localcontext
from fractions import Fraction

import pytest

from fuzzytree.model import (
    Arc,
    Bell,
    Binary,
    Concave,
    Cosine,
    Curve,
    Formula,
    Gaussian,
    Linear,
    Name,
    PiCurve,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.model.rulebase import Points
from fuzzytree.numerics.curve_values import degree_between, root
from fuzzytree.semantics.inference import curve_degree

LONG = Context(prec=120)
ONE = Decimal(1)
PI = Decimal(
    "3.141592653589793238462643383279502884197169399375105820974944592307816406286"
)
CURVES: tuple[Curve, ...] = (
    Points((0.0, 1.0, 3.0), (0.0, 1.0, 0.25)),
    Trapezoid(-1.0, 0.5, 1.0, 3.0),
    Trapezoid(None, 0.5, 1.0, 3.0),
    Trapezoid(-1.0, 0.5, 1.0, None),
    Gaussian(0.3, 0.7),
    TwoGaussians(0.0, 0.5, 1.0, 2.0),
    TwoGaussians(1.0, 0.5, 0.0, 2.0),
    Bell(0.1, 1.5, 2.3),
    Bell(0.1, 1.5, -0.4),
    Sigmoid(0.2, 7.0),
    Sigmoid(0.2, -0.3),
    SigmoidDifference(Sigmoid(0.0, 5.0), Sigmoid(1.0, 3.0)),
    SigmoidProduct(Sigmoid(0.0, 5.0), Sigmoid(1.0, -3.0)),
    SCurve(-1.0, 2.0),
    SCurve(2.0, -1.0),
    SCurve(1.0, 1.0),
    PiCurve(-2.0, -1.0, 0.0, 3.0),
    PiCurve(-2.0, -2.0, 0.0, 0.0),
    Cosine(0.5, 3.0),
    Concave(0.0, 1.5),
    Concave(1.5, 0.0),
    Spike(0.1, 4.0),
    Arc(-1.0, 2.0),
    Arc(2.0, -1.0),
    SemiEllipse(-1.0, 2.5),
    Binary(0.5),
    Binary(0.5, is_above=False),
    Singleton(0.5),
)


@pytest.mark.parametrize("curve", CURVES, ids=str)
def test_the_degree_that_runtimes_compute_lies_between_the_bounds(curve: Curve) -> None:
    chance = random.Random(4)
    for x in (
        -2.0,
        -1.0,
        0.0,
        0.5,
        1.0,
        3.0,
        *(chance.uniform(-4, 4) for _ in "12345"),
    ):
        found = degree_between(curve, Fraction(x))
        assert found is not None
        assert 0 <= found.low <= found.high <= 1
        assert found.high - found.low < Fraction(1, 10**40)
        near = Fraction(curve_degree(curve, x))
        assert abs(near - found.low) < Fraction(1, 10**13)


def test_bounds_hold_what_more_digits_tell() -> None:
    chance = random.Random(5)
    for _ in range(30):
        x = Fraction(chance.uniform(0, 1))
        number = LONG.divide(Decimal(x.numerator), Decimal(x.denominator))
        log = LONG.ln(number)
        square = LONG.multiply(number, number)
        for bounds, right in (
            (
                degree_between(Gaussian(0.0, 0.5), x),
                LONG.exp(LONG.multiply(square, Decimal(-2))),
            ),
            (
                degree_between(Bell(0.0, 1.0, 1.75), x),
                LONG.divide(
                    ONE, LONG.add(ONE, LONG.exp(LONG.multiply(log, Decimal("3.5"))))
                ),
            ),
            (degree_between(Cosine(0.0, 2.0), x), raised_cosine(number)),
            (root(x), LONG.sqrt(number)),
        ):
            assert bounds is not None
            assert bounds.low <= Fraction(right) <= bounds.high


def raised_cosine(number: Decimal) -> Decimal:
    """Return (1 + cos(pi x)) / 2, the angle halved often: cos 2 t = 2 (cos t)^2 - 1."""
    with localcontext(LONG):
        small = PI * number / 2**60
        found = 1 - small**2 / 2 + small**4 / 24
        for _ in range(60):
            found = 2 * found * found - 1
        return (1 + found) / 2


def test_degrees_far_out_are_above_0() -> None:
    found = degree_between(Gaussian(0.0, 1.0), Fraction(1000))
    assert found is not None
    assert 0 < found.low < found.high < Fraction(1, 10**200000)
    far = degree_between(Gaussian(0.0, 1.0), Fraction(10**5))
    assert far is not None
    assert far.low == 0 < far.high


def test_nothing_is_known_of_formulas() -> None:
    assert degree_between(Formula(Name("x")), Fraction(1)) is None
    assert degree_between(Linear((1.0,)), Fraction(1)) is None
