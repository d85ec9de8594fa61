"""Doubles that float32 takes for 0 or 1 keep their effect in onnxruntime."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.checking.comparing import unequal
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.probing import probe_values

pytest.importorskip("onnxruntime")

NEARLY_ONE = 1.0 + 2.0**-40
SMALL = 2.0**-200

SHAPES: dict[str, Shape] = {
    "width": Band(high=0.0, right=NEARLY_ONE),
    "end": Band(high=-1.0, right=SMALL),
    "spread": LR(0.5, Side(NEARLY_ONE, (0.75,)), Side(NEARLY_ONE, (0.75,))),
    "mean": LR(SMALL, Side(SMALL, (0.75,)), Side(SMALL, (0.75,))),
    "reach": LR(0.0, Side(1.0, (0.5,), 1.0 + NEARLY_ONE), Side(1.0, (0.5,), 2.0)),
    "points": Points((0.0, 1.0), (1e-300, 5e-324)),
    "curve": Band(high=0.0, right=1.0),
}


def one_term(shape: Shape, parts: tuple[Part, ...] = ()) -> RuleBase:
    own = () if not parts else (Variable("x"),)
    name = "mix" if parts else "x"
    variable = Variable(name, (Term("t", shape),), parts=parts)
    rule = Rule((Proposition(name, ("t",)),), "yes")
    return RuleBase("one", ("yes",), (*own, variable), (rule,))


def assert_equal_bits(rules: RuleBase | FuzzyTree, runtime: str) -> None:
    values = probe_values(rules, 300)
    values = np.concatenate([values, values * SMALL], axis=1)
    base = "native mixed" if "mixed" in runtime else "native"
    expected = find_runtime(base).load(rules)(values)
    found = find_runtime(runtime).load(rules)(values)
    assert not unequal(found, expected).any()


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("form", ["float64", "mixed", "readable"])
def test_a_number_of_a_shape_that_is_nearly_neutral_counts(
    name: str, form: str
) -> None:
    assert_equal_bits(one_term(SHAPES[name]), f"onnxruntime {form}")


@pytest.mark.parametrize("weight", [NEARLY_ONE, -NEARLY_ONE, 3.0])
@pytest.mark.parametrize("centre", [SMALL, -SMALL, 0.0])
@pytest.mark.parametrize("form", ["float64", "mixed", "readable"])
def test_a_part_that_is_nearly_neutral_counts(
    weight: float, centre: float, form: str
) -> None:
    rules = one_term(SHAPES["width"], (Part("x", weight, centre),))
    assert_equal_bits(rules, f"onnxruntime {form}")


@pytest.mark.parametrize("form", ["float64", "plain"])
def test_a_tree_turns_at_the_very_value(form: str) -> None:
    low = Term("low", Band(high=SMALL, right=1.0))
    high = Term("high", Band(low=SMALL, left=-1.0))
    mix = Variable("mix", (low, high), parts=(Part("x", NEARLY_ONE, SMALL),))
    branches = (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    tree = FuzzyTree(
        "one",
        ("a", "b"),
        (Variable("x"), mix),
        (Node("mix", (SMALL,), (0, 1), branches),),
        (Leaf("a"), Leaf("b")),
    )
    assert_equal_bits(tree, f"onnxruntime {form}")
