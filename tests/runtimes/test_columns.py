"""Categories and stand-ins: a missing value is a point of the input space."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.exporters import yaml
from fuzzytree.formats import read_yaml
from fuzzytree.model import FuzzyTree, Part, RuleBase, Variable, fingerprint
from fuzzytree.numerics import decide, exact_answer, strength_bounds
from fuzzytree.runtimes import native
from fuzzytree.semantics import (
    descend,
    evaluate,
    evaluate_program,
    from_rules,
    rules_from_tree,
)
from fuzzytree.semantics.samples import everyday_tree

ROWS = np.array([[0.0, 2.0, math.nan, 1.0], [3.0, math.nan, 1.0, math.inf]])


@pytest.fixture
def tree() -> FuzzyTree:
    return everyday_tree()


def test_yaml_gives_back_categories_and_stand_ins(tree: FuzzyTree) -> None:
    text = yaml.write(tree).content
    assert b"categories: [Biscoe, Dream, Torgersen]" in text
    assert read_yaml(text, "penguins.yaml").model == tree


def test_tree_and_rules_answer_rows_with_missing_values(tree: FuzzyTree) -> None:
    rules = rules_from_tree(tree)
    for row in ROWS.T.tolist():
        named = dict(zip(tree.inputs, row, strict=True))
        one, other = descend(tree, named), evaluate(rules, named)
        assert (one.label, one.rule) == (other.label, other.rule)
        assert one.rule > 0
        assert exact_answer(tree, named).label == one.label


def test_native_runtimes_replace_missing_values(tree: FuzzyTree) -> None:
    rules = rules_from_tree(tree)
    expected = [
        descend(tree, dict(zip(tree.inputs, row, strict=True))).rule
        for row in ROWS.T.tolist()
    ]
    for model in (tree, rules):
        run = native.load(model)
        assert run(ROWS).rule.tolist() == expected
        one = [run(ROWS[:, [k]]).rule[0] for k in range(ROWS.shape[1])]
        assert one == expected
        assert decide(model, ROWS).rule.tolist() == expected
    program = from_rules(rules)
    bounds, _ = strength_bounds(rules, "float32", ROWS)
    assert (bounds < 1e-3).all()
    for row, rule in zip(ROWS.T.tolist(), expected, strict=True):
        named = dict(zip(rules.inputs, row, strict=True))
        assert evaluate_program(program, named).of("rule") == (rule,)


def test_fingerprints_of_plain_models_are_as_before() -> None:
    plain = Variable("x")
    assert fingerprint(plain) != fingerprint(replace(plain, missing=0.0))


@pytest.mark.parametrize(
    ("variable", "text"),
    [
        (Variable("a", categories=("x", "x")), "category of 'a' 'x' stands twice"),
        (
            Variable("a", missing=math.inf),
            "what stands for a missing 'a' must be finite",
        ),
        (
            Variable("a", categories=("x", "y"), missing=2.0),
            "what stands for a missing 'a' is -1 or the position of a category, "
            "up to 1, not 2.0",
        ),
    ],
)
def test_wrong_columns_are_refused(variable: Variable, text: str) -> None:
    with pytest.raises(InvalidModelError) as caught:
        RuleBase("r", ("k",), (variable,), ())
    assert text in str(caught.value)


def test_a_sum_has_no_categories() -> None:
    mixed = Variable("s", parts=(Part("a", 1.0),), missing=1.0)
    with pytest.raises(InvalidModelError, match="only an input has categories"):
        RuleBase("r", ("k",), (Variable("a"), mixed), ())
