"""Bounds of membership functions hold against 50 digits, on random functions."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable
from fractions import Fraction

import pytest

from fuzzytree.model import LR, Band, Curve, MembershipFunction, Points, Side, curves
from fuzzytree.numerics.curve_values import Between, degree_between
from fuzzytree.semantics.enclosing import Interval, Jet, degree_bounds, jet

Make = Callable[[random.Random], Curve]


def _number(chance: random.Random) -> float:
    whole, near = float(chance.randint(-5, 5)), chance.uniform(-3.0, 3.0)
    return chance.choice([whole, near])


def _above_zero(chance: random.Random) -> float:
    return abs(_number(chance)) or 1.0


def _sigmoid(chance: random.Random) -> curves.Sigmoid:
    return curves.Sigmoid(_number(chance), _number(chance))


def _corners(chance: random.Random) -> list[float]:
    return sorted(_number(chance) for _ in range(4))


def _points(chance: random.Random) -> Points:
    count = chance.choice([1, 2, 3, 5, 12])
    values = sorted({_number(chance) for _ in range(count)})
    degrees = [chance.choice([0.0, 1.0, chance.random()]) for _ in values]
    return Points(tuple(values), tuple(degrees))


def _lr(chance: random.Random) -> LR:
    left, right = (
        Side(_above_zero(chance), (chance.random(), chance.random() / 2))
        for _ in range(2)
    )
    return LR(_number(chance), left, right)


MAKERS: dict[str, Make] = {
    "points": _points,
    "lr": _lr,
    "band": lambda c: Band(-_above_zero(c), _above_zero(c), None, 9.0),
    "trapezoid": lambda c: curves.Trapezoid(*_corners(c)),
    "gaussian": lambda c: curves.Gaussian(_number(c), _above_zero(c)),
    "two gaussians": lambda c: curves.TwoGaussians(
        _number(c), _above_zero(c), _number(c), _above_zero(c)
    ),
    "bell": lambda c: curves.Bell(_number(c), _above_zero(c), _number(c)),
    "sigmoid": _sigmoid,
    "sigmoid difference": lambda c: curves.SigmoidDifference(_sigmoid(c), _sigmoid(c)),
    "sigmoid product": lambda c: curves.SigmoidProduct(_sigmoid(c), _sigmoid(c)),
    "s": lambda c: curves.SCurve(_number(c), _number(c)),
    "pi": lambda c: curves.PiCurve(*_corners(c)),
    "cosine": lambda c: curves.Cosine(_number(c), _above_zero(c)),
    "concave": lambda c: curves.Concave(_number(c), _number(c)),
    "spike": lambda c: curves.Spike(_number(c), _above_zero(c)),
    "arc": lambda c: curves.Arc(_number(c), _number(c)),
    "semi ellipse": lambda c: curves.SemiEllipse(-_above_zero(c), _above_zero(c)),
    "binary": lambda c: curves.Binary(_number(c), c.random() < 0.5),
    "singleton": lambda c: curves.Singleton(_number(c)),
}


@pytest.mark.parametrize("name", MAKERS)
def test_bounds_hold_between_knots_and_at_values(name: str) -> None:
    chance = random.Random(name)
    for _ in range(12):
        function = MAKERS[name](chance)
        if [*function.mistakes()]:
            continue
        knots = function.knots()
        for start, end in itertools.pairwise([-20.0, *knots, 20.0]):
            for share in (1.0, 0.01):
                low = start + (1.0 - share) * chance.random() * (end - start)
                high = min(end, low + share * (end - start))
                if low < high:
                    _check_between(function, low, high, chance)
        for x in (_number(chance), *knots):
            bounds = degree_bounds(function, x)
            assert _meet(_between(function, Fraction(x)), bounds)
            assert bounds.width < 1e-12


def _between(function: MembershipFunction, x: Fraction) -> Between:
    degree = degree_between(function, x)  # type: ignore[arg-type] # all that are made
    assert degree is not None
    return degree


def _check_between(
    function: MembershipFunction, low: float, high: float, chance: random.Random
) -> None:
    """Check values, and the quotients that stand for slopes and bends."""
    bounds: Jet = jet(function, low, high)
    width = Fraction(high) - Fraction(low)
    shares = sorted(chance.sample(range(1, 999), 4))
    xs = [Fraction(low) + width * Fraction(share, 999) for share in shares]
    values = [_between(function, x) for x in xs]
    slopes = _quotients(xs, values)
    middles = [(a + b) / 2 for a, b in itertools.pairwise(xs)]
    bends = _quotients(middles, slopes)
    for found, bound in ((values, bounds.value), (slopes, bounds.slope)):
        assert all(_meet(one, bound) for one in found), (function, low, high)
    assert all(_meet(one, bounds.bend) for one in bends), (function, low, high)


def _quotients(xs: list[Fraction], values: list[Between]) -> list[Between]:
    pairs = itertools.pairwise(zip(xs, values, strict=True))
    return [
        Between((q.low - p.high) / (b - a), (q.high - p.low) / (b - a))
        for (a, p), (b, q) in pairs
    ]


def _meet(one: Between, bound: Interval) -> bool:
    is_above = math.isinf(bound.low) or one.high >= Fraction(bound.low)
    return is_above and (math.isinf(bound.high) or one.low <= Fraction(bound.high))


def test_a_smooth_stretch_is_enclosed_the_better_the_shorter_it_is() -> None:
    function = curves.Gaussian(0.0, 1.0)
    wide, near = jet(function, 0.25, 0.5), jet(function, 0.25, 0.2501)
    assert near.value.width < wide.value.width / 1000
    assert near.bend.width < wide.bend.width / 100


def test_nothing_is_known_of_the_slope_over_a_jump() -> None:
    over = jet(curves.Binary(1.0), 0.0, 2.0)
    assert over.value == Interval(0.0, 1.0)
    assert math.isinf(over.slope.high)
