"""Certificates: what they say, and that nothing observed exceeds them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from fuzzytree.model.contracts import Dtype, Model
from fuzzytree.model.rulebase import (
    Band,
    Conjunction,
    Kind,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.numerics.bounds import certify, open_paths, strength_bounds
from fuzzytree.numerics.oracle import decide, strength_errors
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probes
from fuzzytree.testing import random_tree, with_points

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

NATIVE = {"float64": "native", "mixed": "native mixed", "float32": "native float32"}
LOW = Term("low", Band(high=1.0, right=3.0))
STEP = Term("low", Band(high=1.0))


def grip(*terms: Term, conjunction: Conjunction = "minimum") -> RuleBase:
    """Return one rule that tests the first term of each of its inputs."""
    names = [f"x{k}" for k in range(1, len(terms) + 1)]
    return RuleBase(
        "grip",
        ("soft",),
        tuple(Variable(n, (t,)) for n, t in zip(names, terms, strict=True)),
        (Rule(tuple(Proposition(n, ("low",)) for n in names), "soft"),),
        Semantics(conjunction),
    )


def values_of(model: Model, limit: int = 240) -> FloatArray:
    rows = probes(model, limit=limit)
    return np.array([[row[name] for row in rows] for name in model.inputs])


def test_the_sentence_names_twice_the_largest_error_of_a_strength() -> None:
    found = certify(grip(LOW), "mixed")
    assert found.delta == pytest.approx(2 * 2.0**-24, rel=1e-2)
    assert found.sentence == (
        "the class cannot change unless the two strongest classes differ by 2.4e-07 "
        "or less"
    )


def test_the_number_in_the_sentence_is_not_below_the_bound() -> None:
    for seed in range(30):
        found = certify(rules_from_tree(random_tree(seed, combinations=0)), "mixed")
        assert found.delta is not None
        text = found.sentence.removesuffix(" or less")
        assert float(text.rsplit(" ", 1)[1]) >= 2.0 * found.delta


def test_a_product_adds_the_errors_of_its_factors() -> None:
    single = certify(grip(LOW), "mixed").delta
    double = certify(grip(LOW, LOW, conjunction="product"), "mixed").delta
    assert single is not None
    assert double == pytest.approx(2 * (single + 2.0**-24), rel=1e-2)


def test_the_smaller_of_two_degrees_is_no_worse_than_the_worse() -> None:
    assert certify(grip(LOW), "mixed").delta == certify(grip(LOW, LOW), "mixed").delta


def test_double_has_an_error_against_the_exact_answer() -> None:
    delta = certify(grip(LOW), "float64").delta
    assert delta is not None
    assert 2.0**-53 < delta < 1e-15


def test_a_step_in_float32_says_why_there_is_no_bound() -> None:
    found = certify(grip(STEP), "float32")
    assert found.delta is None
    assert found.sentence == (
        "no bound: term 'low' of 'x1' steps at 1.0, and a value can round across it"
    )
    assert certify(grip(STEP), "mixed").delta == 0.0


def test_a_step_outside_the_declared_range_costs_nothing() -> None:
    rules = RuleBase(
        "grip",
        ("soft",),
        (Variable("x1", (STEP,), low=2.0, high=3.0),),
        (Rule((Proposition("x1", ("low",)),), "soft"),),
    )
    assert certify(rules, "float32").delta == 0.0


def test_a_combination_of_inputs_without_a_range_says_which() -> None:
    rules = RuleBase(
        "grip",
        ("soft",),
        (
            Variable("a", low=0.0, high=1.0),
            Variable("b"),
            Variable("mix", (LOW,), parts=(Part("a", 1.0), Part("b", 1.0))),
        ),
        (Rule((Proposition("mix", ("low",)),), "soft"),),
    )
    found = certify(rules, "float64")
    assert found.sentence == "no bound: input 'b' of 'mix' has no declared range"
    assert certify(rules, "float64", np.ones((2, 3))).delta is not None


def test_a_flank_narrower_than_rounding_says_so() -> None:
    stiff = Term("low", Band(high=1e9, right=1e9 + 1.0))
    assert certify(grip(stiff), "float32").sentence == (
        "no bound: term 'low' of 'x1' is not wider than the rounding of its values"
    )


def test_numbers_at_the_end_of_a_type_say_so() -> None:
    huge = Term("low", Band(high=3e38, right=3.3e38))
    assert certify(grip(huge), "float32").sentence == (
        "no bound: term 'low' of 'x1' has numbers as large as float32 can hold"
    )


def test_rows_without_a_bound_are_counted() -> None:
    found = certify(grip(STEP), "float32", np.array([[0.5, 1.0, 1e300]]))
    assert (found.delta, found.unbounded, found.rows) == (0.0, 2, 3)
    assert found.sentence == (
        "the class cannot change: every strength is exact; no bound in 2 of 3 "
        "rows: a value is beyond float32, or rounding can put it on the other side of "
        "a step"
    )


def test_a_strength_that_can_be_half_wrong_makes_no_decision_certain() -> None:
    narrow = Term("low", Band(high=1e9, right=1e9 + 250.0))
    found = certify(grip(narrow), "float32")
    assert found.delta is not None
    assert found.sentence.startswith("any class can change: a strength can be off by")


def test_a_tree_that_asks_inputs_alone_is_exact_in_double() -> None:
    tree = random_tree(1, combinations=0)
    assert certify(tree, "float64").sentence == (
        "the class cannot change: no value is rounded before it meets a cut"
    )
    assert not open_paths(tree, "float64", values_of(tree)).any()


def test_a_tree_names_the_value_that_is_rounded_most() -> None:
    tree = random_tree(1, combinations=0)
    found = certify(tree, "float32", values_of(tree, 100)[:, :50])
    worst = max(found.values, key=lambda value: value.error)
    assert found.sentence.endswith(f"({worst.variable})")
    assert found.sentence.startswith("the class cannot change for values farther than ")


@pytest.mark.one_in(3)
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_a_path_differs_only_where_it_is_open(seed: int, dtype: Dtype) -> None:
    tree = random_tree(seed, leaves=2 + seed % 9, inputs=3, combinations=0.5)
    values = values_of(tree)
    found = find_runtime(NATIVE[dtype]).load(tree)(values)
    differs = found.rule != decide(tree, values).rule
    assert not (differs & ~open_paths(tree, dtype, values)).any()


@pytest.mark.one_in(5)
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["relative", "raw"])
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_no_observed_error_exceeds_its_bound(
    seed: int, kind: Kind, conjunction: Conjunction, dtype: Dtype
) -> None:
    tree = random_tree(seed, leaves=2 + seed % 9, inputs=3)
    rules = rules_from_tree(tree, kind, conjunction=conjunction)
    if seed % 3 == 0:
        rules = with_points(rules, seed)
    values = values_of(rules)
    bounds, _ = strength_bounds(rules, dtype, values)
    found = find_runtime(NATIVE[dtype]).load(rules)(values).strengths
    assert found is not None
    low, _ = strength_errors(rules, values, found)
    assert (low <= bounds).all()


@pytest.mark.parametrize("dtype", ["float64", "mixed", "float32"])
def test_rows_far_from_all_curves_cost_no_more_than_near_ones(dtype: Dtype) -> None:
    mix = Variable("mix", (LOW,), parts=(Part("a", 0.3), Part("b", 0.7)))
    propositions = (Proposition("a", ("low",)), Proposition("mix", ("low",)))
    inputs = (Variable("a", (LOW,)), Variable("b"))
    rules = RuleBase("grip", ("soft",), (*inputs, mix), (Rule(propositions, "soft"),))
    near = np.random.default_rng(1).uniform(0.0, 4.0, (2, 50))
    far = near * np.repeat([1e3, 1e6, -1e9, 1e20, -1e30], 10)
    bounds = strength_bounds(rules, dtype, near)[0]
    found = find_runtime(NATIVE[dtype]).load(rules)(far).strengths
    assert found is not None
    of_far = strength_bounds(rules, dtype, far)[0]
    assert (strength_errors(rules, far, found)[0] <= of_far).all()
    assert of_far.max() <= bounds.max() < 1e-5
