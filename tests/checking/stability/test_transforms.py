"""Models in other units: exact where it is promised, refused where it cannot be."""

from __future__ import annotations

import math

import pytest

from fuzzytree.checking.stability.transforms import (
    exactly_scaled,
    exponent_range,
    moved,
    numbers_in_units,
    scaled,
)
from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import Band, Points, Term
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.checking.stability.defects import one_rule, small_rules


@pytest.mark.parametrize("seed", range(6))
def test_scaling_there_and_back_is_the_same_model(seed: int) -> None:
    tree = random_tree(seed, leaves=1 + 3 * seed)
    there = {name: 7 * k - 20 for k, name in enumerate(tree.inputs)}
    back = {name: -k for name, k in there.items()}
    assert scaled(scaled(tree, there), back) == tree
    rules = rules_from_tree(tree, "raw" if tree.sets else "relative")
    assert scaled(scaled(rules, there), back) == rules


def test_a_scaled_tree_gives_the_scaled_rules() -> None:
    tree = random_tree(3, leaves=9)
    ks = dict.fromkeys(tree.inputs, 5)
    assert rules_from_tree(scaled(tree, ks), "raw") == scaled(
        rules_from_tree(tree, "raw"), ks
    )


def test_a_combination_can_be_scaled_by_itself() -> None:
    rules = scaled(small_rules(), {"mix": 3})
    mix = rules.variables[2]
    assert [part.weight for part in mix.parts] == [4.0, 16.0]
    assert mix.parts[0].centre == 1.0


def test_points_scale_and_move() -> None:
    rules = one_rule(Term("ramp", Points((1.0, 2.0), (0.0, 1.0))))
    twice = scaled(rules, {"a": 1}).variables[0].terms[0].shape
    assert twice == Points((2.0, 4.0), (0.0, 1.0))
    there = moved(rules, {"a": 8.0}).variables[0].terms[0].shape
    assert there == Points((9.0, 10.0), (0.0, 1.0))


def test_a_number_that_would_leave_the_range_is_refused() -> None:
    with pytest.raises(LossError) as caught:
        exactly_scaled(3.0, 1100, "force")
    assert str(caught.value) == (
        "cannot scale 'force' by 2**1100: 3.0 would leave the normal range of doubles"
    )
    with pytest.raises(LossError):
        exactly_scaled(1.0, -1050, "force")
    assert exactly_scaled(0.0, -1050, "force") == 0.0


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_ends_of_the_usable_range_can_be_reached(dtype: str) -> None:
    tree = random_tree(5, leaves=9)
    low, high = exponent_range(tree, "float32" if dtype == "float32" else "float64")
    limit = 2.0**128 if dtype == "float32" else math.inf
    for k in (low, high):
        other = scaled(tree, dict.fromkeys(tree.inputs, k))
        for name, _, value in numbers_in_units(other):
            if name in tree.inputs:
                assert value == 0.0 or 2.0**-1022 <= abs(value) < limit


def test_a_narrow_flank_ends_the_usable_range() -> None:
    narrow = Term("low", Band(high=2.25, right=2.296875))
    low, _ = exponent_range(one_rule(narrow), "float32")
    assert (2.296875 - 2.25) * 2.0**low == 3 * 2.0**-127
    lines = Points((2.25, 2.25, 2.296875), (0.0, 1.0, 0.0))
    assert exponent_range(one_rule(Term("low", lines)), "float32")[0] == low


def test_a_model_without_change_of_units_is_itself() -> None:
    tree = random_tree(4, leaves=6)
    assert scaled(tree, {}) == moved(tree, {}) == tree
