"""Probabilities of a walk that skips rules have the bits of all rules fired."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.estimator import FuzzyTreeClassifier
from fuzzytree.model.contracts import FloatArray, Outcome
from fuzzytree.model.probabilities import SHARPNESS, least_strength
from fuzzytree.model.rulebase import RuleBase, Semantics
from fuzzytree.runtimes import mixing
from fuzzytree.runtimes.mixing import class_probabilities, mix, weights_of
from fuzzytree.runtimes.native import load
from fuzzytree.semantics.lowering import rules_from_tree, rules_of
from fuzzytree.semantics.probing import probe_values
from fuzzytree.testing import random_tree, rated, with_points

SEEDS = pytest.mark.parametrize("seed", range(8))


def all_mixed(rules: RuleBase, values: FloatArray) -> Outcome:
    """Return what firing every rule on every row gives."""
    outcome = load(rules)(values)
    assert outcome.strengths is not None
    shares = class_probabilities(rules, outcome.strengths, outcome.rule)
    return replace(outcome, probabilities=shares)


def assert_same(found: Outcome, expected: Outcome) -> None:
    assert found.rule.tolist() == expected.rule.tolist()
    assert found.status.tolist() == expected.status.tolist()
    assert found.probabilities is not None
    assert expected.probabilities is not None
    assert found.probabilities.tobytes() == expected.probabilities.tobytes()


def edge_values(rules: RuleBase) -> FloatArray:
    """Return rows on and beside every cut and end, with missing and huge values."""
    values = probe_values(rules, 600)
    values[:1, ::50], values[-1:, ::70], values[:1, ::90] = (
        math.nan,
        math.inf,
        -math.inf,
    )
    values[:, ::110] = 1.7e308
    return values


@pytest.fixture
def walks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Walk tables of any size, in chunks of 128 rows, and note how many walks."""
    counts: list[int] = []
    walk = mixing.walk_rows

    def counting(*arguments: object) -> object:
        counts.append(1)
        return walk(*arguments)  # type: ignore[arg-type]  # they are passed on

    for name, value in (("_FEWEST", 1), ("_LEAST_COST", 0.0), ("_WALK", 128)):
        monkeypatch.setattr(mixing, name, value)
    monkeypatch.setattr(mixing, "walk_rows", counting)
    return counts


@SEEDS
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
@pytest.mark.parametrize("leaves", [1, 2, 30])
def test_skipped_rules_change_no_bit(
    walks: list[int], seed: int, conjunction: str, leaves: int
) -> None:
    semantics = Semantics(conjunction=conjunction)  # type: ignore[arg-type]
    tree = random_tree(seed, leaves=leaves, inputs=3, semantics=semantics)
    rules = rules_from_tree(rated(tree, seed))
    values = edge_values(rules)
    assert_same(mix(rules)(values), all_mixed(rules, values))
    assert walks


@pytest.mark.parametrize("sharpness", SHARPNESS)
def test_every_sharpness_skips_what_has_no_weight(
    walks: list[int], sharpness: int
) -> None:
    least = least_strength(sharpness)
    below, above = np.array([math.nextafter(least, 0.0), 0.0]), np.array([1.0])
    assert not weights_of(below, sharpness).any()
    assert weights_of(above * least * (1.0 + 2e-9), sharpness).all()
    rules = rules_from_tree(rated(random_tree(4, leaves=25), 4))
    rules = replace(rules, semantics=replace(rules.semantics, sharpness=sharpness))
    values = edge_values(rules)
    assert_same(mix(rules)(values), all_mixed(rules, values))
    assert walks


@SEEDS
def test_stand_ins_replace_missing_values(walks: list[int], seed: int) -> None:
    rules = rules_from_tree(rated(random_tree(seed, leaves=12, inputs=3), seed))
    first, *others = rules.variables
    rules = replace(rules, variables=(replace(first, missing=0.25), *others))
    values = edge_values(rules)
    assert_same(mix(rules)(values), all_mixed(rules, values))
    assert walks


@SEEDS
def test_rules_that_divide_no_axis_are_all_fired(walks: list[int], seed: int) -> None:
    rules = with_points(
        rules_from_tree(rated(random_tree(seed, leaves=9), seed)), seed, share=1.0
    )
    values = edge_values(rules)
    assert_same(mix(rules)(values), all_mixed(rules, values))
    assert not walks


def test_the_classifier_and_the_functions_share_what_a_tree_needs() -> None:
    values = np.random.default_rng(0).normal(size=(60, 2))
    model = FuzzyTreeClassifier().fit(values, values[:, 0] > 0.0)
    model.predict(values)
    model.predict_proba(values)
    sources = model.tree_, rules_of(model.tree_)
    before = [dict(vars(source)["_made"]) for source in sources]
    ft.run(model.tree_, values)
    ft.run(model.tree_, values, with_strengths=False, with_probabilities=True)
    for source, kept in zip(sources, before, strict=True):
        added = set(vars(source)["_made"]) - set(kept)
        assert added <= {"owners", "rule codes", "parts"}


def test_a_large_table_has_the_probabilities_of_its_parts() -> None:
    chance = np.random.default_rng(0)
    x, kind = chance.normal(size=(6000, 2)), chance.integers(0, 5, 6000)
    score = np.sin(3.0 * x[:, 0]) + x[:, 1] * (kind % 2) + chance.normal(size=6000)
    x[::17, 1] = math.nan
    columns = {"a": x[:, 0], "b": x[:, 1], "kind": [f"k{code}" for code in kind]}
    table = pd.DataFrame(columns)
    model = FuzzyTreeClassifier(leaves=60, min_rows=3, columns_per_node=1)
    model.fit(table, np.digitize(score, [-0.5, 0.5]))
    whole = model.predict_proba(table)
    parts = [model.predict_proba(table[k : k + 500]) for k in range(0, 6000, 500)]
    assert whole.tobytes() == np.concatenate(parts).tobytes()
    answers = ft.run(model, table, with_strengths=False, with_probabilities=True)
    assert isinstance(answers, ft.Predictions)
    assert answers.probabilities is not None
    assert (whole == answers.probabilities.T).all()
    assert list(answers) == model.predict(table).tolist()
