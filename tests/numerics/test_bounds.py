import math

import numpy as np
import pytest

from fuzzytree.lowering import rules_from_tree
from fuzzytree.numerics.bounds import UNIT, axis_errors, degree_bound, strength_bounds
from fuzzytree.probing import probes
from fuzzytree.rulebase import (
    LR,
    Band,
    Conjunction,
    Flank,
    Kind,
    Part,
    Side,
    Variable,
)
from fuzzytree.runtimes import find_runtime
from fuzzytree.testing import random_tree

RAMP = Band(high=1.0, right=Flank(1.0, 3.0))


def test_double_has_no_error_against_itself() -> None:
    assert degree_bound(RAMP, "float64") == (0.0, 0.0)


def test_a_ramp_in_mixed_type_rounds_position_coefficient_and_result() -> None:
    # slope 1 times one unit, and (1 * 4 + 1) units of rounding
    assert degree_bound(RAMP, "mixed") == (6 * UNIT, 0.0)


def test_a_narrow_flank_far_from_zero_is_hopeless_in_float32_and_fine_in_mixed() -> (
    None
):
    stiff = Band(high=1e9, right=Flank(1e9, 1e9 + 1.0))
    assert degree_bound(stiff, "float32").fixed == 1.0
    assert degree_bound(stiff, "mixed").fixed < 1e-6


def test_a_step_can_be_wrong_by_one_in_float32() -> None:
    assert degree_bound(Band(0.0, 1.0), "float32").fixed == 1.0
    assert degree_bound(Band(0.0, 1.0), "mixed").fixed == 0.0


def test_an_lr_set_pays_for_its_reach() -> None:
    near = LR(0.0, Side(1.0, (0.4,), 3.0), Side(1.0, (0.4,), 3.0))
    far = LR(0.0, Side(1.0, (0.4,), 30.0), Side(1.0, (0.4,), 30.0))
    assert degree_bound(near, "mixed").fixed < degree_bound(far, "mixed").fixed < 1e-4


def test_a_combination_rounds_each_summand() -> None:
    mix = Variable("mix", parts=(Part("a", 2.0, 1.0), Part("b", -1.0)))
    # 5 units of each summand: 2 (3 + 1) and 1 (4 + 0)
    expected = UNIT * 5 * (8 + 4)
    (found,) = axis_errors(mix, ("a", "b"), np.array([[3.0], [-4.0]]))
    assert math.isclose(found, expected, rel_tol=1e-2)


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("conjunction", ["min", "product"])
@pytest.mark.parametrize("runtime", ["native mixed", "native float32"])
def test_no_observed_error_exceeds_its_bound(
    seed: int, kind: Kind, conjunction: Conjunction, runtime: str
) -> None:
    tree = random_tree(seed, leaves=2 + seed % 9, inputs=3)
    rules = rules_from_tree(tree, kind, conjunction=conjunction)
    rows = probes(rules, limit=400)
    values = np.array([[row[name] for row in rows] for name in rules.inputs])
    narrow = find_runtime(runtime)
    bounds, _ = strength_bounds(rules, narrow.dtype, values)
    one = narrow.load(rules)(values).strengths
    two = find_runtime("native").load(rules)(values).strengths
    assert one is not None
    assert two is not None
    known = ~np.isnan(one) & ~np.isnan(two)
    gap = np.where(known, np.abs(one - two), 0.0).max(axis=0)
    assert (gap <= bounds).all()
