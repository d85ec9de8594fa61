"""Tuning a grown tree: its gradient, what it gains, what it keeps to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fuzzytree.learning import LearningSettings, learn_arrays
from fuzzytree.learning.binary import BinaryTree, GrowingTree, pruned
from fuzzytree.learning.learner import ArrayLearner
from fuzzytree.learning.rows import SplitRules, TrainingRows
from fuzzytree.learning.tuning import SHARPNESS, SoftTree
from fuzzytree.learning.units import FloatArray, IntArray
from fuzzytree.model import Band


def _rings(size: int, seed: int) -> tuple[FloatArray, IntArray]:
    """Return points around three centres of a bent class and of two others."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 3, size)
    angle = rng.uniform(0.0, np.pi, size) + np.pi * (labels == 1)
    values = np.stack([np.cos(angle), np.sin(angle), rng.normal(size=size)], axis=1)
    values[:, 0] += (labels == 1) * 1.0
    values[labels == 2] *= 0.2
    return values + rng.normal(scale=0.15, size=values.shape), labels


def _grown(values: FloatArray, labels: IntArray) -> tuple[BinaryTree, TrainingRows]:
    columns = [f"x{k}" for k in range(values.shape[1])]
    classes = [str(k) for k in range(int(labels.max()) + 1)]
    learner = ArrayLearner(columns=columns, classes=classes)
    learner.partial_fit(values, labels)
    rows, rules = learner._rules(learner._prepared())
    assert isinstance(rules, SplitRules)
    at = np.arange(rows.size)
    return GrowingTree(rows, at, rules, "mixed", 4).grown(0.0), rows


def test_the_gradient_is_that_of_the_loss() -> None:
    tree, rows = _grown(*_rings(200, 1))
    soft = SoftTree.of(tree, rows, np.arange(rows.size))
    seen = soft._seen(soft.at)
    free = [soft.weights[soft.is_free], soft.offsets, np.log(soft.shares).ravel()]
    rng = np.random.default_rng(2)
    point = np.concatenate(free)
    point = point + 0.1 * rng.normal(size=len(point))
    slope = soft._loss(point, seen, 3.0)[1]
    for _ in range(20):
        way = rng.normal(size=len(point))
        step = 1e-5 * way
        ahead = soft._loss(point + step, seen, 3.0)[0]
        behind = soft._loss(point - step, seen, 3.0)[0]
        rise = (ahead - behind) / 2e-5
        assert rise == pytest.approx(float(slope @ way), rel=1e-5, abs=1e-4)


def test_a_tuned_tree_gives_its_rows_better_chances() -> None:
    values, labels = _rings(600, 3)
    tree, rows = _grown(values, labels)
    soft = SoftTree.of(tree, rows, np.arange(rows.size))
    own = np.arange(rows.size), rows.codes
    before = np.log(soft.chances(soft.at)[own]).mean()
    tuned = soft.tuned(3.0)
    assert np.log(tuned.chances(soft.at)[own]).mean() > before + 0.01
    crisp = tuned.crisp(3)
    reached = crisp.reaching(rows, soft.at)
    leaves = [k for k, split in enumerate(crisp.splits) if split is None]
    assert {k: crisp.labels[k] for k in leaves} == {
        k: int(np.bincount(rows.codes[reached[k]]).argmax()) for k in leaves
    }


def test_prunings_are_alike_if_they_keep_the_same_splits() -> None:
    tree, _ = _grown(*_rings(200, 1))
    assert pruned(tree, 8.0).is_alike(pruned(tree, 8.0))
    assert not pruned(tree, 8.0).is_alike(pruned(tree, 0.0))
    assert not pruned(tree, 8.0).is_alike(pruned(_grown(*_rings(200, 1))[0], 8.0))


def test_a_branch_keeps_the_rows_that_are_wanted() -> None:
    values, labels = _rings(600, 4)
    settings = LearningSettings(min_rows=40)
    tree = learn_arrays(
        values,
        labels,
        columns=["a", "b", "c"],
        classes=["x", "y", "z"],
        settings=settings,
    ).tree
    assert tree.semantics.sharpness == SHARPNESS
    assert all(sum(leaf.counts) >= 40 for leaf in tree.leaves)


def test_last_bits_of_the_rows_do_not_move_the_tree() -> None:
    tree, rows = _grown(*_rings(500, 5))
    soft = SoftTree.of(tree, rows, np.arange(rows.size))
    noise = 1.0 + 2.0**-51 * np.random.default_rng(6).choice(
        [-1.0, 1.0], rows.standard.shape
    )
    other = replace(soft, rows=replace(rows, standard=rows.standard * noise))
    first, second = soft.tuned(3.0).crisp(3), other.tuned(3.0).crisp(3)
    assert first.children == second.children
    for split, same in zip(first.splits, second.splits, strict=True):
        if split is not None and same is not None:
            assert split.axis.weights.tolist() == same.axis.weights.tolist()


def test_the_flanks_of_a_tuned_tree_are_as_wide_as_its_gates() -> None:
    values, labels = _rings(600, 7)
    tree = learn_arrays(
        values, labels, columns=["a", "b", "c"], classes=["x", "y", "z"]
    ).tree
    assert tree.semantics.sharpness == SHARPNESS
    for variable in tree.variables:
        if len(variable.parts) > 1:
            low, high = (term.function for term in variable.terms)
            assert isinstance(low, Band)
            assert isinstance(high, Band)
            assert low.high is not None
            assert high.low == low.high
            assert low.right is not None
            assert high.left is not None
            reach = low.right - low.high
            assert reach == pytest.approx(low.high - high.left, rel=1e-9)


def test_columns_that_say_nothing_or_the_same_do_not_stop_it() -> None:
    values, labels = _rings(300, 8)
    awkward = np.column_stack([values, values[:, 0], np.ones(300), 1e300 * values])
    columns = [f"x{k}" for k in range(awkward.shape[1])]
    learnt = learn_arrays(awkward, labels, columns=columns, classes=["a", "b", "c"])
    assert learnt.report.inner_accuracy is not None
    assert learnt.report.inner_accuracy > 0.85
