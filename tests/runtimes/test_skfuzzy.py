"""scikit-fuzzy: what it refuses, and the certified error of its points."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Shape,
    Side,
    Term,
    Variable,
)
from fuzzytree.runtimes.degrees import shape_degrees
from fuzzytree.runtimes.skfuzzy import bound, load
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree

SHAPES: list[Shape] = [
    Band(0.0, 1.0, -1.0, 3.0),
    Band(high=0.0, right=2.0),
    Band(0.0, 1.0),
    LR(0.0, Side(1.0, (0.4, 0.3, -0.2), 1.5), Side(3.0, (2.0, 0.5))),
    LR(1e6, Side(1e-3, (0.4,)), Side(1e-3, (0.4,))),
    LR(0.0, Side(4.0, (0.1,)), Side(0.1, (0.9,))),  # its left tail bends most
    Points((-3.0, 0.0, 0.0, 2.0, 5.0), (0.0, 0.3, 1.0, 1.0, 0.5)),
]


@pytest.mark.parametrize("shape", SHAPES, ids=repr)
def test_degrees_keep_their_certified_error_and_are_one_on_the_plateau_alone(
    shape: Shape,
) -> None:
    x = Variable("x", (Term("t", shape),))
    rules = RuleBase("r", ("a",), (x,), (Rule((Proposition("x", ("t",)),), "a"),))
    center = 1e6 if isinstance(shape, LR) and shape.mean else 0.0
    width = 1e-2 if center else 20.0
    chance = np.random.default_rng(0)
    values = center + width * chance.uniform(-1.0, 1.0, 100_000)
    exact = shape_degrees(shape, values)
    found = load(rules)(values[np.newaxis]).strengths
    assert found is not None
    assert np.abs(found[0] - exact).max() <= bound(rules)[0]
    if isinstance(shape, Band):
        assert np.array_equal(found[0] == 1.0, exact == 1.0)


def test_a_tree_is_refused() -> None:
    with pytest.raises(LossError) as caught:
        load(random_tree(0))
    assert str(caught.value) == (
        "cannot run random 7 as scikit-fuzzy: it runs rule bases, and this is a tree\n"
        "  pass rules_from_tree(tree)"
    )


def test_a_rule_without_a_proposition_is_refused() -> None:
    rules = RuleBase("r", ("a",), (), (Rule((), "a"),))
    with pytest.raises(LossError) as caught:
        load(rules)
    assert (
        str(caught.value) == "cannot run r as scikit-fuzzy: rule 1 has no proposition"
    )


def test_too_many_rules_are_refused() -> None:
    rules = rules_from_tree(random_tree(0, leaves=201, inputs=6))
    with pytest.raises(LossError) as caught:
        load(rules)
    assert str(caught.value) == (
        "cannot run random 201 as scikit-fuzzy: it has 201 rules, more than 200"
    )


def test_the_bound_says_where_it_comes_from() -> None:
    x = Variable("x", (Term("low", SHAPES[2]),))
    rules = RuleBase("r", ("a",), (x,), (Rule((Proposition("x", ("low",)),), "a"),))
    assert bound(rules) == (
        2.0**-40,
        "largest certified error of a degree: lines within 0.0001 of the curves, "
        "and rounding",
    )


def test_a_second_run_forgets_the_first() -> None:
    rules = rules_from_tree(random_tree(2, leaves=5))
    run = load(rules)
    values = np.random.default_rng(0).normal(size=(len(rules.inputs), 50)) * 1e3
    first = run(values)
    run(values[:, :7] * 100)
    again = run(values)
    assert first.strengths is not None
    np.testing.assert_array_equal(first.strengths, again.strengths)


def _falling(width: float) -> RuleBase:
    low = Term("low", Band(high=0.0, right=width))
    rule = Rule((Proposition("x", ("low",)),), "a")
    return RuleBase("r", ("a",), (Variable("x", (low,)),), (rule,))


def test_a_width_whose_slope_overflows_is_refused() -> None:
    with pytest.raises(LossError) as caught:
        load(_falling(1e-310))
    assert str(caught.value) == (
        "cannot run r as scikit-fuzzy: term 'low' of 'x' is too narrow for the slope "
        "of a line in double"
    )


def test_a_width_whose_slope_just_fits_has_finite_strengths() -> None:
    result = load(_falling(1e-307))(np.array([[0.0, 0.5e-307, 1e-307]]))
    assert result.strengths is not None
    assert np.isfinite(result.strengths).all()
