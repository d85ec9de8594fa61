"""The probabilities of classes: their definition, and what makes and mixes them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree import api
from fuzzytree.errors import InvalidModelError, ReadError
from fuzzytree.exporters.yaml import write
from fuzzytree.formats.yaml.yaml_reader import read_yaml
from fuzzytree.learning.learner import learn_arrays
from fuzzytree.learning.probabilities import leaf_strengths
from fuzzytree.runtimes.mixing import class_probabilities
from fuzzytree.runtimes.native import load
from fuzzytree.semantics.conversion.facts import as_rules, facts_of
from fuzzytree.semantics.conversion.scores import as_system
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.probing import probe_values
from fuzzytree.semantics.reference import Status, evaluate, row_probabilities
from fuzzytree.testing import random_tree, rated

if TYPE_CHECKING:
    from fuzzytree.model.rulebase import RuleBase

SEEDS = pytest.mark.parametrize("seed", range(6))


def rules_of(seed: int) -> RuleBase:
    return rules_from_tree(rated(random_tree(seed), seed))


def test_two_rules_are_mixed_by_weight() -> None:
    rules = rules_from_tree(random_tree(1, leaves=2, inputs=1))
    vectors = ((0.75, 0.25, 0.0), (0.25, 0.75, 0.0))
    both = zip(rules.rules, "ab", vectors, strict=True)
    rules = replace(
        rules,
        classes=("a", "b", "c"),
        rules=tuple(replace(r, then=c, probabilities=v) for r, c, v in both),
        semantics=replace(rules.semantics, sharpness=2),
    )
    mixed = class_probabilities(rules, np.array([[1.0], [0.5]]), np.array([1]))
    assert mixed is not None
    # weights 65536 and 16384: (4 * 0.75 + 0.25) / 5 and (4 * 0.25 + 0.75) / 5
    assert mixed[:, 0].tolist() == [0.65, 0.35, 0.0]


@SEEDS
def test_numpy_gives_the_bits_of_the_reference(seed: int) -> None:
    rules = rules_of(seed)
    values = probe_values(rules, 200)
    outcome = load(rules)(values)
    assert outcome.strengths is not None
    mixed = class_probabilities(rules, outcome.strengths, outcome.rule)
    assert mixed is not None
    for row, found in zip(values.T.tolist(), mixed.T, strict=True):
        answer = evaluate(rules, dict(zip(rules.inputs, row, strict=True)))
        expected = row_probabilities(rules, answer)
        if answer.status is Status.MISSING:
            assert np.isnan([*found, *expected]).all()
            continue
        assert tuple(found.tolist()) == expected
        assert answer.label is not None
        largest = [
            c
            for c, p in zip(rules.classes, expected, strict=True)
            if p == max(expected)
        ]
        assert largest == [answer.label]
        assert abs(sum(expected) - 1.0) <= 1e-15


@SEEDS
def test_trees_and_rules_with_probabilities_come_back_from_yaml(seed: int) -> None:
    tree = rated(random_tree(seed), seed)
    for model in (tree, rules_from_tree(tree)):
        assert read_yaml(write(model).content, "model.yaml").model == model


@SEEDS
def test_the_facts_of_a_system_keep_the_probabilities(seed: int) -> None:
    rules = rules_of(seed)
    assert as_rules(as_system(rules), facts_of(rules)) == rules


def test_raw_rules_have_no_probabilities() -> None:
    rules = rules_from_tree(rated(random_tree(1), 1), "raw")
    assert rules.semantics.sharpness is msgspec.UNSET
    assert {rule.probabilities for rule in rules.rules} == {msgspec.UNSET}


@pytest.mark.parametrize(
    ("shares", "message"),
    [
        ((0.5, 0.25, 0.2), "leaf 1: the probabilities add up to 0.95, not to 1"),
        ((0.5, 0.5), "leaf 1: 2 probabilities for 3 classes"),
        ((1.5, -0.5, 0.0), "leaf 1: a probability lies in [0, 1]"),
        ((math.nan, 0.5, 0.5), "leaf 1: a probability lies in [0, 1]"),
        (
            (0.33333333, 0.66666667, 0.0),
            "leaf 1: a probability has six digits behind the point at most",
        ),
        (
            msgspec.UNSET,
            "leaf 1: it has no probabilities, and the semantics has a sharpness",
        ),
    ],
)
def test_wrong_probabilities_are_refused(
    shares: tuple[float, ...] | msgspec.UnsetType, message: str
) -> None:
    tree = rated(random_tree(1), 0)
    tree = replace(tree, semantics=replace(tree.semantics, sharpness=1))
    leaves = replace(tree.leaves[0], probabilities=shares), *tree.leaves[1:]
    with pytest.raises(InvalidModelError) as error:
        replace(tree, leaves=leaves)
    assert str(error.value) == message


def test_a_file_with_wrong_probabilities_says_where() -> None:
    text = """\
format: fuzzytree/1
kind: rule base
name: odd
classes: [a, b, c]
rules:
- {if: [], then: a, probabilities: {a: 0.5, d: 0.5}}
- {if: [], then: a, probabilities: {a: 0.999999}}
semantics:
  and: minimum
  or: maximum
  not: 1 - degree
  uncovered: no class
  missing: no class
  sharpness: 3
  answer: the class of the first of the strongest rules
"""
    with pytest.raises(ReadError) as error:
        read_yaml(text.encode(), "odd.yaml")
    for line in (
        "odd.yaml:6:36: no class 'd'; there is a, b, c",
        "odd.yaml:7:36: 2 classes cannot share 1e-06 evenly in millionths",
        "the sharpness is a power of 2 from 1 to 1024, not 3",
    ):
        assert line in str(error.value)


def test_learnt_probabilities_say_how_often_a_class_is_met() -> None:
    chance = np.random.default_rng(0)
    values = chance.uniform(0.0, 1.0, (4000, 1))
    codes = (chance.uniform(size=4000) < np.where(values[:, 0] < 0.5, 0.2, 0.9)) * 1
    learnt = learn_arrays(values, codes, columns=["x"], classes=["no", "yes"])
    rows = np.array([[0.1], [0.9]])
    found = api.run(learnt.tree, rows, with_probabilities=True, with_strengths=False)
    assert found.probabilities is not None
    assert np.abs(found.probabilities[1] - [0.2, 0.9]).max() < 0.04
    assert [*found.columns()][-2:] == [
        "probability of class no",
        "probability of class yes",
    ]


@SEEDS
def test_the_learner_reckons_with_the_strengths_of_the_rules(seed: int) -> None:
    tree = random_tree(seed)
    rules = rules_from_tree(tree)
    values = np.random.default_rng(seed).normal(0.0, 5.0, (len(tree.inputs), 50))
    places = {name: place for place, name in enumerate(tree.inputs)}
    found = leaf_strengths(tree, values, places)
    by_name = values[[places[name] for name in rules.inputs]]
    expected = load(rules)(by_name).strengths
    assert expected is not None
    assert np.abs(found - expected).max() <= 1e-15


def test_the_order_of_the_rows_does_not_change_learnt_probabilities() -> None:
    chance = np.random.default_rng(1)
    values = chance.normal(size=(300, 3))
    codes = (values[:, 0] + chance.normal(size=300) > 0) * 1
    order = chance.permutation(300)
    one, other = (
        learn_arrays(
            values[k], codes[k], columns=["x", "y", "z"], classes=["no", "yes"]
        )
        for k in (np.arange(300), order)
    )
    assert one.tree == other.tree


def test_a_model_without_probabilities_says_so() -> None:
    with pytest.raises(ValueError, match="random 7 has no probabilities of classes"):
        api.run(random_tree(0), np.zeros((1, 9)), with_probabilities=True)
