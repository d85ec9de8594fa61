"""Point lists joined value by value, against the degrees themselves."""

from __future__ import annotations

import random

import pytest

from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import Points
from fuzzytree.numerics.pointwise import (
    greatest,
    least,
    lines_of,
    negated,
    product,
    rounded_lines,
)
from fuzzytree.semantics.inference.degrees import curve_degree


def random_points(chance: random.Random) -> Points:
    values = sorted(chance.uniform(-3.0, 3.0) for _ in range(chance.randint(1, 6)))
    if len(values) > 2:
        values[1] = values[0]  # a step
    degrees = [chance.choice((0.0, 1.0, chance.random())) for _ in values]
    return Points(tuple(values), tuple(degrees))


def looked_at(chance: random.Random, *curves: Points) -> list[float]:
    knots = [value for curve in curves for value in curve.values]
    return [*knots, *(chance.uniform(-4.0, 4.0) for _ in range(200))]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("seed", range(30))
def test_the_least_and_the_greatest_are_within_their_bound(seed: int) -> None:
    chance = random.Random(seed)
    one, other = random_points(chance), random_points(chance)
    for join, meant in ((least, min), (greatest, max)):
        points, bound = rounded_lines(join(lines_of(one), lines_of(other)))
        assert bound < 1e-12  # steep lines cross at a rounded value
        for x in looked_at(chance, one, other):
            expected = meant(curve_degree(one, x, {}), curve_degree(other, x, {}))
            assert abs(curve_degree(points, x, {}) - expected) <= bound + 1e-14


@pytest.mark.one_in(2)
@pytest.mark.parametrize("seed", range(30))
def test_a_product_is_within_its_tolerance(seed: int) -> None:
    chance = random.Random(seed)
    one, other = random_points(chance), random_points(chance)
    lines, error = product(lines_of(one), lines_of(other), 1e-4)
    points, bound = rounded_lines(lines)
    assert error <= 1e-4
    for x in looked_at(chance, one, other):
        expected = curve_degree(one, x, {}) * curve_degree(other, x, {})
        assert abs(curve_degree(points, x, {}) - expected) <= error + bound + 1e-14


def test_a_negated_step_steps_the_other_way() -> None:
    step = Points((2.0, 2.0), (1.0, 0.25))
    points, bound = rounded_lines(negated(lines_of(step)))
    assert points == Points((2.0, 2.0), (0.0, 0.75))
    assert bound == 0.0


def test_a_degree_below_1_is_not_rounded_to_1() -> None:
    one = Points((0.0, 3.0), (1.0 - 2**-53, 1.0))
    other = Points((0.0, 3.0), (1.0, 1.0 - 2**-53))
    points, _ = rounded_lines(least(lines_of(one), lines_of(other)))
    assert max(points.degrees) < 1.0


def test_knots_on_a_line_are_left_out() -> None:
    one = Points((0.0, 4.0), (0.0, 1.0))
    other = Points((0.0, 1.0, 4.0), (1.0, 1.0, 1.0))
    points, bound = rounded_lines(least(lines_of(one), lines_of(other)))
    assert points == one
    assert bound == 0.0


def test_a_product_with_too_many_points_is_refused() -> None:
    ramp = lines_of(Points((0.0, 1.0), (0.0, 1.0)))
    with pytest.raises(LossError, match="the product of two curves needs more than"):
        product(ramp, ramp, 1e-12)


def test_points_that_would_be_too_far_apart_keep_one_between() -> None:
    far = Points((-1e308, 0.0, 1e308), (0.5, 0.5, 0.5))
    points, error = rounded_lines(lines_of(far))
    assert (points.values, error) == ((-1e308, 0.0, 1e308), 0.0)
    near = Points((-1e307, 0.0, 1e307), (0.5, 0.5, 0.5))
    assert rounded_lines(lines_of(near))[0].values == (-1e307, 1e307)
