"""A row of weight k counts as k equal rows; other weights count by their ratios."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from sklearn.datasets import load_breast_cancer, load_iris

from fuzzytree.learning.learner import ArrayLearner, learn_arrays
from fuzzytree.learning.sampling import MOST_COPIES, row_weights
from fuzzytree.learning.settings import LearningSettings

if TYPE_CHECKING:
    from fuzzytree.learning.learner import Learnt
    from fuzzytree.model.contracts import FloatArray, IntArray
    from fuzzytree.model.tree import FuzzyTree

IRIS: FloatArray = np.asarray(load_iris()["data"])
SPECIES: IntArray = np.asarray(load_iris()["target"])


def learnt(
    values: FloatArray,
    codes: IntArray,
    weights: object = None,
    settings: LearningSettings | None = None,
) -> Learnt:
    return learn_arrays(
        values,
        codes,
        columns=[f"x{k}" for k in range(values.shape[1])],
        classes=[f"c{k}" for k in range(int(codes.max()) + 1)],
        weights=weights,  # type: ignore[arg-type]  # tests pass mistakes too
        settings=settings,
    )


def supports(tree: FuzzyTree, label: str | None = None) -> int:
    leaves = [leaf for leaf in tree.leaves if label in (None, leaf.label)]
    return sum(leaf.support or 0 for leaf in leaves)


@pytest.mark.parametrize("mode", ["default", "paper"])
@pytest.mark.parametrize("load", [load_iris, load_breast_cancer])
def test_a_whole_weight_counts_as_so_many_equal_rows(mode: str, load: object) -> None:
    values, codes = load(return_X_y=True)  # type: ignore[operator]
    rng = np.random.default_rng(0)
    weights = rng.integers(0, 4, len(codes))
    order = rng.permutation(len(codes))
    settings = LearningSettings(mode=mode)  # type: ignore[arg-type]
    repeated = np.repeat(np.arange(len(codes)), weights)
    one = learnt(values[order], codes[order], weights[order], settings)
    other = learnt(values[repeated], codes[repeated], None, settings)
    assert one.tree == other.tree
    assert one.report == other.report


def test_whole_weights_count_missing_values_and_categories_as_often() -> None:
    rng = np.random.default_rng(1)
    codes = rng.integers(0, 2, 60)
    values = np.column_stack([rng.integers(0, 3, 60), rng.normal(size=60) + codes])
    values[::7, 1] = np.nan
    values[::9, 0] = np.nan
    weights = rng.integers(0, 3, 60)
    names = {"kind": ("a", "b", "c")}
    rows = np.repeat(np.arange(60), weights)
    one, other = (
        learn_arrays(
            values[chosen],
            codes[chosen],
            columns=["kind", "size"],
            classes=["no", "yes"],
            categories=names,
            weights=given,
        )
        for chosen, given in ((np.arange(60), weights), (rows, None))
    )
    assert one == other


def test_only_the_ratios_of_other_weights_matter_and_not_the_order_of_rows() -> None:
    rng = np.random.default_rng(0)
    weights = rng.uniform(0.01, 3.0, len(IRIS))
    weights[:20] = 0.0
    order = rng.permutation(len(IRIS))
    whole = learnt(IRIS, SPECIES, weights).tree
    assert learnt(IRIS[order], SPECIES[order], weights[order]).tree == whole
    assert learnt(IRIS, SPECIES, weights / 1024).tree == whole
    assert supports(whole) in (129, 130, 131)


def test_heavy_rows_decide() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(300, 1))
    codes = (values[:, 0] + rng.normal(size=300) > 0).astype(np.int64)
    for weights, label in (
        (np.where(codes == 1, 100.0, 0.001), "c1"),
        (np.where(codes == 1, 0.001, 100.0), "c0"),
    ):
        tree = learnt(values, codes, weights).tree
        assert {leaf.label for leaf in tree.leaves} == {label}


@pytest.mark.parametrize("digits", [9, 0])
def test_copies_of_a_row_do_not_make_a_tree_larger(digits: int) -> None:
    rng = np.random.default_rng(0)
    values = np.round(rng.normal(size=(200, 9)), digits)
    codes = rng.integers(0, 2, 200)  # nothing can be learnt
    tree = learnt(values, codes, np.full(200, 4)).tree
    assert len(tree.leaves) <= 3


def test_classes_weigh_the_same_if_balanced() -> None:
    rng = np.random.default_rng(0)
    codes = (np.arange(600) % 10 == 0).astype(np.int64)
    values = rng.normal(size=(600, 2)) + 1.5 * codes[:, None]
    plain = learnt(values, codes).tree
    one, other = (
        learnt(values, codes, None, LearningSettings(class_weight=wanted)).tree
        for wanted in ("balanced", {"c1": 9.0})
    )
    assert one.nodes == other.nodes  # 540 and 60 rows
    assert supports(one) == 600
    assert supports(plain, "c1") < 60 < supports(one, "c1")


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([1.0, 2.0], "2 weights, but 4 rows"),
        ([[1.0]] * 4, "weights have the shape (4, 1), and they need (rows,)"),
        (
            [1.0, -1.0, 1.0, 1.0],
            "the weight of row 2 is -1; a weight is finite and not negative",
        ),
        (
            [1.0, 1.0, np.nan, 1.0],
            "the weight of row 3 is nan; a weight is finite and not negative",
        ),
        ([0] * 4, "all weights are zero, and a row of weight zero is left out"),
        (["a"] * 4, "weights are numbers, one for each row"),
        ([1, 1, 0, 0], "cannot learn from one class: every row is 'c0'"),
    ],
)
def test_weights_that_are_none_are_refused(weights: object, message: str) -> None:
    values, codes = np.array([[1.0], [2.0], [7.0], [8.0]]), np.array([0, 0, 1, 1])
    with pytest.raises(ValueError, match=r"weight|class") as caught:
        learnt(values, codes, weights)
    assert str(caught.value) == message


def test_paper_mode_and_chunks_take_whole_weights_alone() -> None:
    values, codes = np.array([[1.0], [2.0], [7.0], [8.0]]), np.array([0, 0, 1, 1])
    weights = np.array([1.0, 0.5, 1.0, 1.0])
    with pytest.raises(ValueError, match="whole numbers") as caught:
        learnt(values, codes, weights, LearningSettings(mode="paper"))
    assert str(caught.value) == (
        "the paper's algorithm counts rows: its weights are whole numbers, and add up "
        "to 16,777,216 at most"
    )
    learner = ArrayLearner(["x0"], ["c0", "c1"])
    learner.partial_fit(values, codes, weights=np.array([1.0, 3.0, 1.0, 1.0]))
    for more in (weights, None):
        if more is None:
            learner = ArrayLearner(["x0"], ["c0", "c1"])
            learner.partial_fit(values, codes, weights=weights)
        with pytest.raises(ValueError, match="whole numbers") as caught:
            learner.partial_fit(values, codes, weights=more)
        assert str(caught.value) == (
            "weights that are no whole numbers need all rows at once, not in chunks"
        )


def test_weights_of_classes_are_checked() -> None:
    values, codes = np.array([[1.0], [2.0], [7.0], [8.0]]), np.array([0, 0, 1, 1])
    with pytest.raises(ValueError, match="no class"):
        learnt(values, codes, None, LearningSettings(class_weight={"c7": 2.0}))
    for wanted, mode, message in (
        ("even", "default", "class_weight is 'balanced' or a weight by class"),
        ([1.0, 2.0], "default", "class_weight is 'balanced' or a weight by class"),
        ({"c0": "a"}, "default", "the weight of class 'c0' is finite and above 0"),
        ({"c0": 0.0}, "default", "the weight of class 'c0' is finite and above 0"),
        ("balanced", "paper", "class_weight is a setting of the mode 'default'"),
    ):
        with pytest.raises(ValueError, match="class") as caught:
            LearningSettings(class_weight=wanted, mode=mode)  # type: ignore[arg-type]
        assert str(caught.value).startswith(message)


def test_weights_of_very_many_rows_count_by_their_ratios() -> None:
    found = row_weights(np.array([MOST_COPIES, 3.0 * MOST_COPIES]))
    assert found.copies.tolist() == [1, 2]
    assert found.shares is not None
    assert found.shares.tolist() == [0.5, 0.75]
    assert row_weights(np.array([1e-320, 5e-324])).shares is not None
    assert row_weights(np.array([1e308, 1e308])).copies.tolist() == [1, 1]
