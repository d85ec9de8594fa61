"""Step 7 of the paper: where no single feature splits a node, several are combined."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import pytest
from sklearn import datasets

import fuzzytree as ft
from fuzzytree.learning import LearningSettings, Learnt, learn_arrays
from fuzzytree.learning.units import FloatArray, IntArray
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import descend, evaluate


def learn(values: FloatArray, labels: IntArray, **settings: Any) -> Learnt:
    return learn_arrays(
        values,
        labels,
        columns=[f"x{k}" for k in range(values.shape[1])],
        classes=[f"c{k}" for k in range(int(labels.max()) + 1)],
        settings=LearningSettings(mode="paper", **settings),
    )


def accuracy(learnt: Learnt, values: FloatArray, labels: IntArray) -> float:
    names = learnt.tree.columns
    rows = [dict(zip(names, row, strict=True)) for row in values.tolist()]
    right = [
        descend(learnt.tree, row).label == f"c{k}"
        for row, k in zip(rows, labels, strict=True)
    ]
    return float(np.mean(right))


def ridges(classes: int, rows: int = 150, seed: int = 0) -> tuple[FloatArray, IntArray]:
    """Return classes along parallel lines, and a third column that is noise."""
    rng = np.random.default_rng(seed)
    labels = np.repeat(np.arange(classes), rows)
    along = 5.0 * rng.normal(size=len(labels))
    across = 4.0 * labels + rng.normal(size=len(labels))
    noise = rng.normal(size=len(labels))
    return np.column_stack([along, along + across, noise]), labels


def test_classes_that_no_feature_separates_are_separated_by_a_combination() -> None:
    values, labels = ridges(3)
    learnt = learn(values, labels)
    assert learnt.report.features_per_node[0] > 1
    assert learnt.report.leaves == 3
    assert accuracy(learnt, *ridges(3, seed=1)) > 0.9
    plain = learn(values, labels, columns_per_node=1)
    assert set(plain.report.features_per_node) == {1}
    assert accuracy(plain, *ridges(3, seed=1)) < 0.7


def test_the_weights_are_those_of_fishers_direction() -> None:
    values, labels = ridges(2)
    tree = learn(values, labels, shrinkage=0.0).tree
    (combination,) = [v for v in tree.variables if v.parts]
    chosen = values[:, [int(part.input[1:]) for part in combination.parts]]
    groups = [chosen[labels == k] for k in (0, 1)]
    within = sum(np.cov(group.T) for group in groups)
    exact = np.linalg.solve(within, groups[1].mean(axis=0) - groups[0].mean(axis=0))
    weights = np.array([part.weight for part in combination.parts])
    assert weights / weights[0] == pytest.approx(exact / exact[0], rel=1e-2)


def test_a_combination_has_no_more_columns_than_split_the_node() -> None:
    values, labels = ridges(2)
    assert learn(values, labels).report.features_per_node == (2,)


def test_of_equally_wide_columns_the_cheaper_ones_are_combined() -> None:
    values, labels = ridges(2)
    doubled = np.column_stack([values[:, 1], values])
    orders: list[list[str]] = []
    for costs in ({}, {"x0": 2.0}):
        tree = learn(doubled, labels, costs=costs).tree
        (combination,) = [v for v in tree.variables if v.parts]
        orders.append([part.input for part in combination.parts])
    assert orders == [["x0", "x2", "x1"], ["x2", "x0", "x1"]]


@pytest.mark.parametrize("name", ["iris", "wine", "breast_cancer"])
def test_where_single_features_split_every_node_nothing_is_combined(name: str) -> None:
    values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
    report = learn(values, labels, l_max=4.0).report
    assert set(report.features_per_node) == {1}


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_patterns_with_the_same_means_and_spreads_share_a_leaf(turn: float) -> None:
    across = np.tile(np.arange(8.0), 2)
    values = np.column_stack([across, across])
    values[8:, 1] = np.arange(8.0)[:: int(turn)]  # along the other diagonal for -1
    report = learn(values, np.repeat([0, 1], 8)).report
    assert (report.inseparable, report.leaves) == (2, 1)


def _strange(name: str) -> tuple[FloatArray, IntArray]:
    rng = np.random.default_rng(5)
    values, labels = ridges(3, rows=30)
    if name == "a class of one row":
        return np.vstack([values, [[2.0, 5.0, 0.0]]]), np.append(labels, 3)
    if name == "a constant column":
        return np.column_stack([np.full(len(labels), 0.1), values]), labels
    if name == "columns that are equal":
        return np.column_stack([values, values, 3.0 * values]), labels
    if name == "more columns than rows":
        return rng.normal(size=(9, 40)), np.repeat([0, 1, 2], 3)
    if name == "one row for each class":
        return rng.normal(size=(6, 4)), np.arange(6)
    if name == "columns constant within classes":
        return np.column_stack([labels % 2, labels // 2]).astype(float), labels
    return values * [1e-290, 1e290, 1.0], labels


@pytest.mark.parametrize("shrinkage", [0.0, 1e-3])
@pytest.mark.parametrize(
    "name",
    [
        "a class of one row",
        "a constant column",
        "columns that are equal",
        "more columns than rows",
        "one row for each class",
        "columns constant within classes",
        "units at the ends of the floats",
    ],
)
def test_a_strange_table_gives_the_same_tree_in_any_order_and_equal_rules(
    name: str, shrinkage: float
) -> None:
    values, labels = _strange(name)
    learnt = learn(values, labels, shrinkage=shrinkage)
    order = np.random.default_rng(1).permutation(len(labels))
    again = learn(values[order], labels[order], shrinkage=shrinkage)
    assert msgspec.json.encode(again.tree) == msgspec.json.encode(learnt.tree)
    assert learnt.report.leaves == len(np.unique(labels))
    rules = rules_from_tree(learnt.tree)
    for row in values.tolist():
        named = dict(zip(learnt.tree.columns, row, strict=True))
        assert evaluate(rules, named).rule == descend(learnt.tree, named).rule


def test_a_tree_with_a_combination_runs_and_is_written_as_any_other(
    tmp_path: Path,
) -> None:
    values, labels = ridges(3)
    tree = learn(values, labels).tree
    ft.save(tree, tmp_path / "tree.yaml")
    assert ft.load(tmp_path / "tree.yaml") == tree
    rows = [dict(zip(tree.columns, row, strict=True)) for row in values.tolist()]
    expected = [descend(tree, row).label for row in rows]
    assert list(ft.run(tree, pd.DataFrame(rows))) == expected
