"""Bounds of degrees and values, worked by hand in units of rounding."""

import numpy as np
import pytest

from fuzzytree.model.rulebase import LR, Band, Part, Points, Side, Variable
from fuzzytree.numerics.rounding import (
    UNIT,
    degree_bound,
    degree_errors,
    value_error,
)

RAMP = Band(high=1.0, right=3.0)
MIX = Variable("mix", parts=(Part("a", 2.0, 1.0), Part("b", -1.0)))


def test_a_ramp_in_double_rounds_its_place() -> None:
    # Difference, width and quotient.
    bound = degree_bound(RAMP, "float64")
    assert bound.fixed == pytest.approx(3 * 2.0**-53, rel=2e-3, abs=0.0)


def test_a_ramp_in_mixed_type_rounds_place_and_cap() -> None:
    # One for the cast, one for the largest number below 1, which float32 has farther
    # from it.
    bound = degree_bound(RAMP, "mixed")
    assert bound.fixed == pytest.approx(2 * UNIT, rel=2e-3)
    assert bound.steps.blur == 0.0


def test_a_ramp_in_float32_also_moves_its_end() -> None:
    # 3 for the place, 3 / 2 for the end at 3 over a width of 2; then as in mixed.
    bound = degree_bound(RAMP, "float32")
    assert bound.fixed == pytest.approx((3 + 1.5 + 1) * UNIT, rel=2e-3)
    assert bound.per_unit == pytest.approx(0.5, rel=2e-3)


def test_a_narrow_flank_far_from_zero_is_hopeless_in_float32_and_fine_in_mixed() -> (
    None
):
    stiff = Band(high=1e9, right=1e9 + 1.0)
    assert degree_bound(stiff, "float32").fixed == 1.0
    assert degree_bound(stiff, "mixed").fixed < 1e-6


def test_a_step_costs_its_height_only_within_the_rounding_of_a_value() -> None:
    step = degree_bound(Band(high=8.0), "float32")
    x = np.array([7.0, 8.0, 8.0000005, 9.0])
    off = value_error(Variable("x"), "float32", {"x": (x, x)})
    assert degree_errors(step, x, off, is_input=True).tolist() == [0, 1, 1, 0]


def test_an_input_in_double_never_crosses_a_step() -> None:
    x = np.array([8.0, 8.000000000000002])
    assert value_error(Variable("x"), "float64", {"x": (x, x)}) is None
    step = degree_bound(Band(high=8.0), "float64")
    assert degree_errors(step, x, None, is_input=True).tolist() == [0, 0]


@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_an_lr_set_of_default_reach_costs_less_than_fifty_units(dtype: str) -> None:
    shape = LR(0.0, Side(1.0, (0.4,)), Side(1.0, (0.4,)))
    unit = 2.0**-53 if dtype == "float64" else UNIT
    bound = degree_bound(shape, dtype)
    assert 1 * unit < bound.fixed < 50 * unit


def test_an_lr_set_pays_for_a_tail_that_ends_soon_after_one_spread() -> None:
    near = LR(0.0, Side(1.0, (0.4,), 1.01), Side(1.0, (0.4,), 1.01))
    far = LR(0.0, Side(1.0, (0.4,), 5.0), Side(1.0, (0.4,), 5.0))
    assert degree_bound(far, "mixed").fixed < degree_bound(near, "mixed").fixed < 1e-4


def test_a_value_within_a_spread_can_be_rounded_into_the_tail() -> None:
    shape = LR(0.0, Side(1.0, (-10.0, 10.0)), Side(1.0, (-10.0, 10.0)))
    roundings = 2 * 10 + 5 * 10 + 1  # of the body; 16 of the tail, which starts at 1
    slope = 1 * abs(-10 + 10) + 2 * 10
    bound = degree_bound(shape, "float64").fixed
    expected = (3 * slope + roundings + 16) * 2.0**-53
    assert bound == pytest.approx(expected, rel=2e-3, abs=0.0)


def test_a_value_that_is_off_has_no_bound_on_a_flank_of_next_to_no_width() -> None:
    x, off = np.array([0.0]), np.array([5e-324])  # which makes 1/20 of the width
    flank = degree_bound(Band(high=0.0, right=1e-322), "float64")
    points = degree_bound(Points((0.0, 1e-322), (1.0, 0.0)), "float64")
    for bound in (flank, points):
        assert bound.per_unit < np.inf
        assert degree_errors(bound, x, off, is_input=False).tolist() == [1.0]
        assert degree_errors(bound, x, None, is_input=True)[0] < 1e-15


def test_a_slope_that_is_zero_in_doubles_still_costs_something() -> None:
    flank = Band(low=-1e289, left=-2e289)
    for shape in (flank, Points((0.0, 1e300), (0.0, 1e-50))):
        assert degree_bound(shape, "float64").per_unit > 0.0


def test_level_points_cost_nothing_but_the_rounding_of_their_degree() -> None:
    level = Points((0.0, 1.0), (0.5, 0.5))
    assert degree_bound(level, "float64").fixed < 2 * 2.0**-53
    assert degree_bound(level, "float64").per_unit == 0.0


def test_a_line_narrower_than_float32_can_tell_is_a_step_in_it() -> None:
    close = Points((1e9, 1e9 + 1.0), (1.0, 0.0))
    assert degree_bound(close, "float32").steps.heights == (1.0,)
    assert degree_bound(close, "mixed").steps.heights == ()


def test_a_shape_at_the_end_of_float32_has_no_bound_in_it() -> None:
    huge = Band(high=3e38, right=3.3e38)
    assert degree_bound(huge, "float32").fixed == 1.0
    assert degree_bound(huge, "mixed").fixed < 1e-6


def test_a_combination_rounds_each_summand_in_float32() -> None:
    # Summands 2 (3 - 1) = 4 and 4, four roundings each; inputs and centres besides,
    # one each: 2 (3 + 1) + 1 (4 + 0) = 12.
    line = {"a": (np.array([3.0]),) * 2, "b": (np.array([-4.0]),) * 2}
    found = value_error(MIX, "float32", line)
    assert found is not None
    assert found[0] == pytest.approx(UNIT * (4 * 8 + 12), rel=2e-3)


def test_a_combination_in_double_rounds_each_summand_four_times() -> None:
    line = {"a": (np.array([3.0]),) * 2, "b": (np.array([-4.0]),) * 2}
    found = value_error(MIX, "float64", line)
    assert found is not None
    assert found.tolist() == pytest.approx([2.0**-53 * 4 * 8], rel=2e-3, abs=0.0)


def test_a_combination_beyond_float32_has_no_bound() -> None:
    line = {"a": (np.array([3e38]),) * 2, "b": (np.array([0.0]),) * 2}
    with np.errstate(all="ignore"):
        found = value_error(MIX, "float32", line)
    assert found is not None
    assert found[0] == np.inf
