"""What is proved of curves, against values worked by hand and against samples."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.model.rulebase import LR, Band, Points, Side
from fuzzytree.numerics.conditioning import bernstein, conduct, halves, maximum

UNIT_SIDE = Side(1.0, (1.0,))


def polynomial(*coefficients: int) -> tuple[Fraction, ...]:
    return tuple(map(Fraction, coefficients))


def test_bernstein_coefficients_of_a_cubic() -> None:
    # 1 + 6 x + 12 x**2 + 8 x**3: b_k = sum_j C(k, j) / C(3, j) a_j
    assert bernstein(polynomial(1, 6, 12, 8)) == polynomial(1, 3, 9, 27)


def test_halves_meet_at_the_value_in_the_middle() -> None:
    first, second = halves(bernstein(polynomial(1, 6, 12, 8)))
    assert first[-1] == second[0] == 8  # (1 + 2 / 2)**3


def test_the_maximum_of_a_hill_lies_in_its_bracket() -> None:
    # x (1 - x)**2 = x - 2 x**2 + x**3 has its largest value 4 / 27 at 1 / 3.
    low, high = maximum(polynomial(0, 1, -2, 1))
    assert low <= Fraction(4, 27) <= high
    assert high - low <= Fraction(1, 2**40)


def test_an_overshoot_is_known_to_forty_bits() -> None:
    # 1 - t (c0 + c1 v) with c0 = 1, c1 = 3, v = 2 t - 1: 1 + 2 t - 6 t**2, largest at
    # 1 / 6: 7 / 6. It ends at -3, which is 3 below 0.
    _, right = conduct(LR(0.0, UNIT_SIDE, Side(2.0, (1.0, 3.0))))
    assert right.above.low <= 1 / 6 <= right.above.high
    assert right.above.high - right.above.low < 1e-11
    assert right.below == (3.0, 3.0)


def test_a_rise_is_found_where_it_is() -> None:
    # 1 - t Q with Q = 1 + v - 2 v**2 in t: slope zero at 1/2 +- 1/(2 sqrt 3) ...
    side = Side(2.0, (1.0, 1.0, -2.0))
    left, right = conduct(LR(10.0, side, side))
    curve = np.polynomial.Polynomial([1.0])
    t = np.polynomial.Polynomial([0.0, 1.0])
    v = 2.0 * t - 1.0
    curve = 1.0 - t * (1.0 + v - 2.0 * v**2)
    turns = sorted(float(np.real(root)) for root in curve.deriv().roots())
    (rise,) = right.rises
    assert rise.start == pytest.approx(10.0 + 2.0 * turns[1], abs=1e-5)
    assert rise.end == pytest.approx(12.0)
    lowest = max(float(curve(turns[1])), 0.0)
    assert rise.height == pytest.approx(float(curve(1.0)) - lowest, abs=1e-9)
    assert left.rises[0].start == pytest.approx(10.0 - 2.0 * turns[1], abs=1e-5)


def test_what_clipping_hides_is_no_rise() -> None:
    # 1 + t / 2 - 3 t**2 / 2 rises up to 1 / 6, all of it above 1.
    _, right = conduct(LR(0.0, UNIT_SIDE, Side(1.0, (0.25, 0.75))))
    assert right.above.high > 0.04
    assert right.rises == ()


def test_lines_and_steps_have_no_curve() -> None:
    assert conduct(Points((0.0, 1.0), (0.0, 1.0))) == ()
    assert conduct(Band(high=1.0)) == ()


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(40))
def test_no_sample_lies_outside_what_was_proved(seed: int) -> None:
    chance = random.Random(seed)
    curve = tuple(chance.uniform(-2.0, 2.0) for _ in range(chance.randint(1, 8)))
    _, right = conduct(LR(0.0, UNIT_SIDE, Side(1.0, curve)))
    t = np.linspace(0.0, 1.0, 4001)
    v = 2.0 * t - 1.0
    body = 1.0 - t * np.polynomial.polynomial.polyval(v, np.array(curve))
    slack = 1e-9
    assert right.above.high + slack >= max(body.max() - 1.0, 0.0) >= 0.0
    assert right.above.low <= max(body.max() - 1.0, 0.0) + 1e-4
    assert right.below.high + slack >= max(-body.min(), 0.0)
    sizes = 1.0 + t * np.polynomial.polynomial.polyval(np.abs(v), np.abs(curve))
    assert right.size.high + slack >= sizes.max() >= right.size.low - 1e-4
    ratio = sizes / np.maximum(np.abs(body), 2.0**-10)
    assert right.condition.high >= ratio.max() * (1.0 - 1e-9)
    # Between samples the clipped degree rises only where a rise was proved.
    clipped = np.clip(body, 0.0, 1.0)
    rising = np.flatnonzero(np.diff(clipped) > slack)
    for step in rising.tolist():
        middle = 0.5 * (t[step] + t[step + 1])
        assert any(r.start - 1e-3 <= middle <= r.end + 1e-3 for r in right.rises)
