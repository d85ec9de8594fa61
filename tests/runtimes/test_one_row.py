"""A single frame takes another way than many, and has the same bits."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from fuzzytree.runtimes.one_row import load, row_runner
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.programs.steps import Maker, Program, result_of
from fuzzytree.testing import random_tree


def program(operation: str) -> Program:
    make = Maker()
    result = make(operation, make.input("x"))
    return make.program("p", ("x",), (result_of("output", "y", result),))


def test_functions_that_round_in_their_own_way_are_left_to_numpy() -> None:
    assert row_runner(program("sine")) is None
    run = row_runner(program("square_root"))
    assert run is not None
    assert run([9.0]) == [3.0]


@pytest.mark.parametrize("kind", ["raw", "relative"])
@pytest.mark.parametrize("seed", range(4))
def test_one_row_of_rules_has_the_bits_of_many(
    seed: int, kind: Literal["raw", "relative"]
) -> None:
    rules = rules_from_tree(random_tree(seed), kind)
    values = np.random.default_rng(seed).normal(0.0, 3.0, (len(rules.inputs), 40))
    values[0, 0], values[:, 1] = np.nan, 1e9
    answer = load(rules)
    many = answer(values)
    for row in range(values.shape[1]):
        one = answer(values[:, row : row + 1])
        assert one.rule == many.rule[row]
        assert one.status == many.status[row]
        assert one.strengths is not None
        assert many.strengths is not None
        assert one.strengths.tobytes() == many.strengths[:, row].tobytes()
