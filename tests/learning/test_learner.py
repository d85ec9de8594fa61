"""Learning from tables: trees, reports, chunks and bad input."""

from __future__ import annotations

import itertools
from typing import Any, Literal

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from sklearn import datasets
from sklearn.model_selection import StratifiedKFold

from fuzzytree.errors import LearningError
from fuzzytree.learning import ArrayLearner, LearningSettings, Learnt, learn_arrays
from fuzzytree.learning.units import FloatArray, IntArray
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.crisp_regions import grid
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import descend, evaluate

Mode = Literal["default", "paper"]
MODES: tuple[Mode, ...] = ("default", "paper")


def learn(
    values: npt.NDArray[np.generic],
    labels: npt.NDArray[np.generic],
    settings: LearningSettings | None = None,
    **others: Any,
) -> Learnt:
    columns = [f"x{k}" for k in range(values.shape[1])]
    classes = [f"c{k}" for k in range(int(labels.max(initial=0)) + 1)]
    arguments: dict[str, Any] = {"columns": columns, "classes": classes, **others}
    return learn_arrays(values, labels, settings=settings, **arguments)


def answers(tree: FuzzyTree, values: FloatArray) -> list[str | None]:
    return [
        descend(tree, dict(zip(tree.columns, row, strict=True))).label
        for row in values.tolist()
    ]


def accuracy(tree: FuzzyTree, values: FloatArray, labels: IntArray) -> float:
    right = [
        answer == f"c{label}"
        for answer, label in zip(answers(tree, values), labels, strict=True)
    ]
    return float(np.mean(right))


def blobs(rows: int = 100, gap: float = 3.0) -> tuple[FloatArray, IntArray]:
    rng = np.random.default_rng(0)
    labels = np.repeat([0, 1], rows)
    return rng.normal(size=(2 * rows, 3)) + gap * labels[:, None], labels


@pytest.mark.parametrize("mode", MODES)
def test_relative_rules_answer_like_the_tree_and_raw_rules_exist(mode: Mode) -> None:
    values, labels = datasets.load_wine(return_X_y=True)
    tree = learn(values, labels, LearningSettings(mode=mode)).tree
    relative = rules_from_tree(tree)
    assert len(rules_from_tree(tree, "raw").rules) == len(tree.leaves)
    for row in values[::5].tolist():
        named = dict(zip(tree.columns, row, strict=True))
        assert evaluate(relative, named).rule == descend(tree, named).rule


@pytest.mark.parametrize("mode", MODES)
def test_the_same_table_gives_the_same_tree(mode: Mode) -> None:
    values, labels = datasets.load_iris(return_X_y=True)
    first = learn(values, labels, LearningSettings(mode=mode))
    second = learn(np.asfortranarray(values), labels, LearningSettings(mode=mode))
    assert msgspec.json.encode(first) == msgspec.json.encode(second)


def test_the_tree_does_not_depend_on_the_chunks() -> None:
    values, labels = datasets.load_breast_cancer(return_X_y=True)
    whole = learn(values, labels)
    learner = ArrayLearner(whole.tree.columns, whole.tree.classes)
    for rows, codes in zip(
        np.array_split(values, 7), np.array_split(labels, 7), strict=True
    ):
        learner.partial_fit(rows, codes)
    assert learner.finish() == whole


def test_merged_statistics_are_those_of_both_tables() -> None:
    values, labels = blobs()
    parts = [ArrayLearner(["a", "b", "c"], ["c0", "c1"]) for _ in range(2)]
    for part, rows, codes in zip(
        parts, np.split(values, 2), np.split(labels, 2), strict=True
    ):
        part.partial_fit(rows, codes)
    parts[0].statistics = parts[0].statistics.merge(parts[1].statistics)
    found = parts[0].finish()
    assert found.report.rows == 200
    assert accuracy(found.tree, values, labels) > 0.95


def test_paper_mode_without_combinations_tests_one_feature_a_node() -> None:
    values, labels = datasets.load_digits(return_X_y=True)
    settings = LearningSettings(mode="paper", columns_per_node=1)
    report = learn(values, labels, settings).report
    assert set(report.features_per_node) == {1}
    assert report.leaves == sum(report.patterns.values()) == 10


def test_a_combination_asks_no_feature_that_does_not_help() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=(400, 10))
    labels = (values[:, 3] + values[:, 7] > 0).astype(np.int64)
    found = learn(values, labels, LearningSettings(entry=12.0))
    assert set(found.report.features_per_node) == {2}
    assert set(found.tree.inputs) == {"x3", "x7"}


def test_a_dear_feature_is_left_out_if_a_cheap_one_does_it() -> None:
    values, labels = blobs(gap=5.0)
    cheap = learn(values[:, [0, 0]], labels, LearningSettings(costs={"x0": 5.0}))
    assert cheap.tree.inputs == ("x1",)


def test_a_feature_that_costs_nothing_ends_no_combination() -> None:
    values = np.random.default_rng(1).normal(size=(400, 3))
    labels = (values.sum(axis=1) > 0).astype(np.int64)
    free = learn(values, labels, LearningSettings(costs={"x0": 0.0}))
    assert set(free.report.features_per_node) == {3}


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("name", "least"), [("xor", 0.95), ("ring", 0.88), ("checkerboard", 0.85)]
)
def test_classes_of_several_shapes_get_several_leaves(name: str, least: float) -> None:
    rng = np.random.default_rng(3)
    values = rng.uniform(-1.5, 1.5, (900, 2))
    tables = {
        "xor": values[:, 0] * values[:, 1] > 0,
        "ring": (values**2).sum(axis=1) > 1.0,
        "checkerboard": np.floor(values).sum(axis=1) % 2 == 0,
    }
    labels = tables[name].astype(np.int64)
    found = learn(values[:600], labels[:600])
    assert found.report.leaves <= sum(found.report.patterns.values())
    assert accuracy(found.tree, values[600:], labels[600:]) >= least


def test_a_narrow_class_within_a_wide_one_takes_two_cuts_and_two_branches() -> None:
    rng = np.random.default_rng(4)
    values = np.concatenate([rng.normal(0, 1, 300), rng.normal(0, 8, 300)])[:, None]
    labels = np.repeat([0, 1], 300)
    tree = learn(values, labels, LearningSettings(mode="paper")).tree
    (node,) = tree.nodes
    assert len(node.cuts) == 2
    assert node.owners[0] == node.owners[2] != node.owners[1]
    assert accuracy(tree, values, labels) > 0.8
    three = learn(values, labels, LearningSettings(leaves=3)).tree
    assert [leaf.label for leaf in three.leaves] == ["c1", "c0", "c1"]
    assert [branch.terms for branch in three.nodes[0].branches] == [
        ("low",),
        ("medium",),
        ("high",),
    ]


def test_a_cut_lies_between_the_values_of_a_discrete_column() -> None:
    values = np.repeat([[0.0], [1.0], [2.0], [3.0]], 20, axis=0)
    labels = np.repeat([0, 0, 1, 1], 20)
    for mode in MODES:
        (node,) = learn(values, labels, LearningSettings(mode=mode)).tree.nodes
        assert all(1.0 < cut < 2.0 for cut in node.cuts)


@pytest.mark.parametrize("offset", [0.0, 1e6, 1e12])
@pytest.mark.parametrize("scale", [1.0, 2.0**-40, 2.0**40])
def test_offsets_and_scales_do_not_matter(offset: float, scale: float) -> None:
    values, labels = blobs()
    moved = (values + offset) * scale
    tree = learn(moved, labels).tree
    assert accuracy(tree, moved, labels) > 0.98


def test_strongly_correlated_columns_are_combined() -> None:
    rng = np.random.default_rng(5)
    labels = np.repeat([0, 1], 200)
    common = rng.normal(size=400)
    values = np.stack([common, common + 1e-3 * labels + 1e-4 * rng.normal(size=400)], 1)
    found = learn(values * [1e-12, 1e12], labels)
    assert found.report.features_per_node == (2,)
    assert accuracy(found.tree, values * [1e-12, 1e12], labels) > 0.99


def test_every_departure_is_reported() -> None:
    values, labels = blobs()
    values = np.column_stack([values, np.full(200, 0.1)])
    values[5, 1] = np.nan
    values[9, 0] = np.inf
    settings = LearningSettings(missing="drop")
    found = learn(values, labels, settings, classes=["c0", "c1", "ghost"])
    report = found.report
    assert report.rows == 198
    assert report.rows_dropped == 2
    assert report.features_ignored == ("x3",)
    assert report.classes_without_rows == ("ghost",)
    assert report.patterns == {"c0": 1, "c1": 1}
    assert found.tree.classes == ("c0", "c1", "ghost")
    assert "rows dropped, a value or the class is missing: 2" in str(report)


def test_patterns_without_rows_are_refused_and_counted() -> None:
    values, labels = blobs(2)
    report = learn(
        values, labels, LearningSettings(mode="paper", patterns_per_class=3)
    ).report
    assert report.patterns_refused == 2


def test_a_class_with_one_row_has_a_leaf_if_a_leaf_may_have_one_row() -> None:
    values, labels = blobs()
    values = np.vstack([values, [[30.0, 30.0, 30.0]]])
    found = learn(values, np.append(labels, 2), LearningSettings(mode="paper"))
    assert found.report.single_rows == 1
    assert answers(found.tree, np.array([[29.0, 30.0, 31.0]])) == ["c2"]


def test_patterns_that_nothing_tells_apart_share_a_leaf() -> None:
    values = np.tile(np.arange(10.0)[:, None], (2, 1))
    report = learn(values, np.repeat([0, 1], 10), LearningSettings(mode="paper")).report
    assert report.inseparable == 2
    assert report.leaves == 1


def test_held_out_rows_choose_what_splits_the_nodes() -> None:
    values, labels = datasets.load_wine(return_X_y=True)
    report = learn(values, labels).report
    assert report.chosen["splits"] in (
        "columns and combinations, tuned together",
        "combinations between the classes, tuned together",
    )
    assert report.inner_accuracy is not None
    assert report.inner_accuracy > 0.93
    alone = learn(values, labels, LearningSettings(columns_per_node=1)).report
    assert alone.chosen == {"splits": "single columns"}
    assert set(alone.features_per_node) == {1}


@pytest.mark.parametrize("leaves", [2, 3, 5])
def test_a_tree_has_no_more_leaves_than_it_may(leaves: int) -> None:
    values, labels = datasets.load_digits(return_X_y=True)
    found = learn(
        values[:600], labels[:600], LearningSettings(leaves=leaves, columns_per_node=1)
    )
    assert found.report.leaves == leaves


def test_a_leaf_has_so_many_rows_and_a_path_so_many_conditions() -> None:
    values, labels = datasets.load_digits(return_X_y=True)
    settings = LearningSettings(min_rows=25, depth=3, columns_per_node=1)
    tree = learn(values[:600], labels[:600], settings).tree
    assert min(leaf.support or 0 for leaf in tree.leaves) >= 25
    assert len(tree.leaves) <= 8


@pytest.mark.one_in(3)
@pytest.mark.parametrize("noise", [0, 20])
@pytest.mark.parametrize(
    ("name", "least"), [("bands", 0.99), ("rectangle", 0.99), ("xor", 0.98)]
)
def test_columns_that_do_not_matter_do_not_matter(
    name: str, least: float, noise: int
) -> None:
    rng = np.random.default_rng(5)
    values = rng.uniform(size=(4000, 2 + noise))
    x, y = values[:, 0], values[:, 1]
    tables = {
        "bands": np.floor(5 * x) % 2 == 0,
        "rectangle": (np.abs(x - 0.5) < 0.2) & (np.abs(y - 0.5) < 0.3),
        "xor": (x > 0.5) ^ (y > 0.5),
    }
    labels = tables[name].astype(np.int64)
    found = learn(values[:2000], labels[:2000])
    assert accuracy(found.tree, values[2000:], labels[2000:]) >= least
    assert found.report.leaves <= 12


def test_leaves_are_as_sure_as_rows_that_were_held_out_allow() -> None:
    rng = np.random.default_rng(8)
    values = rng.uniform(size=(400, 3))
    clear = (values[:, 0] > 0.5).astype(np.int64)
    flipped = np.where(rng.uniform(size=400) < 0.3, 1 - clear, clear)
    sure: list[float] = []
    for labels in (clear, flipped):
        tree = learn(values, labels).tree
        largest = [max(leaf.probabilities or (0.0,)) for leaf in tree.leaves]
        supports = [leaf.support or 0 for leaf in tree.leaves]
        sure.append(float(np.average(largest, weights=supports)))
    assert sure[0] > 0.99
    assert 0.6 < sure[1] < 0.8


@pytest.mark.heavy
def test_many_classes_are_divided_as_clouds() -> None:
    rng = np.random.default_rng(3)
    centres = 4.6 * rng.normal(size=(120, 6))
    labels, fresh = np.repeat(np.arange(120), 20), np.repeat(np.arange(120), 10)
    values = centres[labels] + rng.normal(size=(len(labels), 6))
    others = centres[fresh] + rng.normal(size=(len(fresh), 6))
    found = learn(values, labels)
    assert accuracy(found.tree, others, fresh) > 0.9


def test_patterns_can_be_given_by_class() -> None:
    values, labels = blobs()
    found = learn(
        values, labels, LearningSettings(mode="paper", patterns_per_class={"c1": 3})
    )
    assert found.report.patterns == {"c0": 1, "c1": 3}
    names = [term.name for group in found.tree.sets for term in group.terms]
    assert names[:4] == ["c0", "c1 #1", "c1 #2", "c1 #3"]


def test_progress_is_reported_and_ends_with_the_sets() -> None:
    values, labels = blobs()
    heard: list[tuple[str, float]] = []
    learn(values, labels, progress=lambda what, share: heard.append((what, share)))
    assert heard[0] == ("counting", 0.0)
    assert heard[-1] == ("fitting sets", 1.0)
    assert all(0.0 <= share <= 1.0 for _, share in heard)


def test_units_ranges_and_columns_are_kept() -> None:
    values, labels = blobs()
    tree = learn(
        values,
        labels,
        columns=["force", "slip", "area"],
        units={"force": "N"},
        name="grip",
    ).tree
    force = {v.name: v for v in tree.variables}["force"]
    assert (tree.name, tree.columns) == ("grip", ("force", "slip", "area"))
    assert (force.unit, force.low, force.high) == (
        "N",
        values[:, 0].min(),
        values[:, 0].max(),
    )


def test_a_combination_is_never_named_like_a_column() -> None:
    values, labels = blobs(gap=1.0)
    names = ["combination 1", "combination 1'", "c"]
    tree = learn(values, labels, columns=names).tree
    called = [v.name for v in tree.variables if v.parts]
    assert called
    assert not set(called) & set(names)


def test_a_class_named_like_a_pattern_keeps_its_name() -> None:
    values, labels = blobs()
    found = learn(
        values,
        labels,
        LearningSettings(mode="paper", patterns_per_class={"a": 2}),
        classes=["a", "a #1"],
    )
    names = {term.name for group in found.tree.sets for term in group.terms}
    assert names == {"a #1'", "a #2", "a #1"}


def test_whole_numbers_and_single_precision_are_taken() -> None:
    values, labels = blobs()
    expected = learn(np.round(values * 9), labels).tree
    assert learn(np.round(values * 9).astype(np.int32), labels).tree == expected
    assert learn(np.round(values * 9).astype(np.float32), labels).tree == expected


def test_labels_may_be_names_with_gaps() -> None:
    values, labels = blobs()
    named: list[Any] = [f"c{k}" for k in labels]
    named[3], named[4], named[5] = None, float("nan"), ""
    found = learn_arrays(
        values, named, columns=["a", "b", "c"], classes=["c0", "c1"]
    ).report
    assert found.rows_dropped == 3


NONE = np.empty((0, 2))


@pytest.mark.parametrize(
    ("values", "labels", "message"),
    [
        (NONE, [], "cannot learn from a table without rows"),
        (
            np.full((3, 2), np.nan),
            [0, 1, 0],
            "cannot learn from a table without complete rows: all 3 hold a missing or "
            "infinite value or no class",
        ),
        (
            np.ones((1, 2)),
            [0],
            "cannot learn from one row; two classes need two at least",
        ),
        (
            np.eye(2),
            [1, 1],
            "cannot learn from one class: every row is 'c1'",
        ),
        (
            np.ones((4, 2)),
            [0, 1, 0, 1],
            "cannot learn without a column that varies: every column is constant, or "
            "so wide that its range overflows",
        ),
    ],
    ids=["empty", "all missing", "one row", "one class", "constant"],
)
def test_a_table_that_teaches_nothing_is_refused(
    values: FloatArray, labels: list[int], message: str
) -> None:
    with pytest.raises(LearningError) as caught:
        learn_arrays(
            values,
            np.array(labels, np.int64),
            columns=["a", "b"],
            classes=["c0", "c1"],
        )
    assert str(caught.value) == message


def test_missing_values_can_be_refused() -> None:
    values, labels = blobs()
    values[0, 0] = np.nan
    with pytest.raises(LearningError) as caught:
        learn(values, labels, LearningSettings(missing="refuse"))
    assert str(caught.value) == (
        "1 of 200 rows hold a missing or infinite value or no class\n"
        "  pass missing='drop' to leave them out"
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"columns": ["a", "a", "b"]}, "the column 'a' is named twice"),
        ({"classes": ["a", "a"]}, "the class 'a' is named twice"),
        ({"columns": ["a"]}, "values have 3 columns, but 1 are named"),
        ({"classes": ["a"]}, "label 1 has no name among the classes"),
        (
            {"settings": LearningSettings(costs={"z": 1.0})},
            "costs: there is no column 'z'",
        ),
        (
            {"settings": LearningSettings(mode="paper", patterns_per_class={"z": 2})},
            "patterns_per_class: there is no class 'z'",
        ),
        ({"labels": np.zeros(7, np.int64)}, "200 rows, but 7 labels"),
        ({"labels": ["c0", "zebra"] * 100}, "row 2: 'zebra' is not among the classes"),
        (
            {"labels": np.full(200, 0.5)},
            "labels in numbers are positions of classes, from 0",
        ),
        ({"values": np.zeros(200)}, "values need two dimensions, not 1"),
    ],
)
def test_arguments_that_do_not_fit_are_named(
    arguments: dict[str, Any], message: str
) -> None:
    values, labels = blobs()
    given: dict[str, Any] = {
        "values": values,
        "labels": labels,
        "columns": ["a", "b", "c"],
        "classes": ["c0", "c1"],
        **arguments,
    }
    with pytest.raises(ValueError, match=r".") as caught:
        learn_arrays(given.pop("values"), given.pop("labels"), **given)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("name", "mode", "least", "most"),
    [
        ("iris", "paper", 96, 100),
        ("wine", "paper", 90, 98),
        ("breast_cancer", "paper", 92, 97),
        ("digits", "paper", 58, 65),
        ("iris", "default", 95.0, 100),
        ("wine", "default", 97.5, 100),
        ("breast_cancer", "default", 96.0, 100),
        ("digits", "default", 95.0, 100),
    ],
)
@pytest.mark.heavy
def test_accuracy_is_what_is_promised(
    name: str, mode: Mode, least: float, most: float
) -> None:
    values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
    folds = StratifiedKFold(10, shuffle=True, random_state=0)
    found: list[float] = []
    for fit, answer in folds.split(values, labels):
        learnt = learn(values[fit], labels[fit], LearningSettings(mode=mode))
        assert learnt.report.leaves <= sum(learnt.report.patterns.values())
        found.append(100 * accuracy(learnt.tree, values[answer], labels[answer]))
    assert least <= np.mean(found) <= most


@pytest.mark.heavy
@pytest.mark.parametrize("mode", MODES)
def test_a_thousand_classes_are_learnt(mode: Mode) -> None:
    rng = np.random.default_rng(6)
    labels = np.repeat(np.arange(1000), 5)
    values = rng.normal(size=(1000, 8))[labels] + 0.01 * rng.normal(size=(5000, 8))
    settings = LearningSettings(mode=mode)
    if mode == "default":
        settings = LearningSettings(form="tree")
    found = learn(values, labels, settings)
    assert found.report.leaves >= 900
    assert accuracy(found.tree, values[::97], labels[::97]) > 0.85


def test_rules_equal_the_tree_on_the_cells_of_a_learnt_tree() -> None:
    values, labels = datasets.load_iris(return_X_y=True)
    settings = LearningSettings(mode="paper", columns_per_node=1)
    tree = learn(values, labels, settings).tree
    rules = rules_from_tree(tree)
    for points in itertools.islice(grid(tree), 1):
        for row in points.T[:200].tolist():
            named = dict(zip(tree.inputs, row, strict=True))
            assert evaluate(rules, named).rule == descend(tree, named).rule
