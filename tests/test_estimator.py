"""The classifier keeps scikit-learn's contract and answers like its tree."""

from __future__ import annotations

import copy
import importlib
import io
import pickle
import struct
import sys
from typing import TYPE_CHECKING, Any

import joblib  # type: ignore[import-untyped]  # it has no types of its own
import msgspec
import numpy as np
import pandas as pd
import polars as pl
import pytest
from numpy.testing import assert_allclose
from sklearn import config_context
from sklearn.base import clone
from sklearn.datasets import load_iris, load_wine
from sklearn.exceptions import NotFittedError
from sklearn.metrics import accuracy_score, make_scorer
from sklearn.model_selection import GridSearchCV, cross_val_score, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier
from sklearn.utils.estimator_checks import parametrize_with_checks

import fuzzytree as ft
from fuzzytree.errors import MissingExtraError
from fuzzytree.estimator import FuzzyTreeClassifier, Mode
from fuzzytree.model import leaf_paths
from fuzzytree.model.rulebase import Band, Part, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.reference import descend, evaluate, row_probabilities

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

IRIS, SPECIES = load_iris(return_X_y=True)
WINE = load_wine(as_frame=True)


def refused_in_paper_mode(estimator: Any) -> dict[str, str]:
    """Return the checks of what the paper does not have."""
    text = "the paper's algorithm has no weights of classes"
    return {"check_class_weight_classifiers": text} if estimator.mode == "paper" else {}


@pytest.mark.heavy
@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [FuzzyTreeClassifier(), FuzzyTreeClassifier(mode="paper")],
    expected_failed_checks=refused_in_paper_mode,
)
def test_scikit_learn_finds_nothing_wrong(estimator: Any, check: Any) -> None:
    check(estimator)


def test_predict_descends_the_tree() -> None:
    model = FuzzyTreeClassifier().fit(WINE.data, WINE.target)
    rows = WINE.data.to_dict("records")
    answers = [descend(model.tree_, row) for row in rows]
    assert model.predict(WINE.data).tolist() == [int(a.label or -1) for a in answers]
    ends = [leaf_paths(model.tree_)[answer.rule - 1][-1] for answer in answers]
    assert model.apply(WINE.data).tolist() == ends


def test_the_probabilities_are_those_of_the_reference() -> None:
    model = FuzzyTreeClassifier().fit(IRIS, SPECIES)
    rules = rules_from_tree(model.tree_)
    found = model.predict_proba(IRIS[50:60])
    for row, shares in zip(IRIS[50:60], found, strict=True):
        answer = evaluate(rules, dict(zip(["x1", "x2", "x3", "x4"], row, strict=True)))
        assert tuple(shares) == row_probabilities(rules, answer)


def test_the_probabilities_are_better_than_the_frequencies_of_the_classes() -> None:
    halves = np.arange(len(IRIS)) % 2 == 0
    model = FuzzyTreeClassifier().fit(IRIS[halves], SPECIES[halves])
    shares = model.predict_proba(IRIS[~halves])
    own = shares[np.arange(len(shares)), SPECIES[~halves]]
    assert np.abs(shares.sum(axis=1) - 1.0).max() <= 1e-15
    assert -np.log(own).mean() < 0.25  # of even frequencies log(3), about 1.1


def test_the_largest_probability_belongs_to_the_prediction_on_every_edge() -> None:
    model = FuzzyTreeClassifier().fit(IRIS, SPECIES)
    cuts = [cut for node in model.tree_.nodes for cut in node.cuts]
    edges = sorted({near for c in cuts for near in (c, np.nextafter(c, 99.0))})
    rows = np.array([[e] * 4 for e in edges] + [list(row) for row in IRIS])
    shares = model.predict_proba(rows)
    assert (shares.argmax(axis=1) == model.predict(rows)).all()
    assert ((shares == shares.max(axis=1, keepdims=True)).sum(axis=1) == 1).all()


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    "labels",
    [
        np.array(["no", "1e-05", "off"]),
        np.array([True, False, True]),
        np.array([-1.0, 2.0, 1e6]),
        np.array(["é", "a b", "x: y"], dtype=object),
    ],
    ids=["words", "booleans", "numbers", "objects"],
)
def test_labels_of_any_kind_come_back_as_they_were(labels: np.ndarray) -> None:
    model = FuzzyTreeClassifier().fit(IRIS, labels[SPECIES])
    predicted = model.predict(IRIS)
    assert predicted.dtype == labels.dtype
    assert (predicted == labels[SPECIES]).mean() > 0.9


def test_the_names_of_a_table_are_those_of_the_tree() -> None:
    model = FuzzyTreeClassifier().fit(WINE.data, WINE.target)
    assert model.tree_.columns == tuple(WINE.data.columns)
    assert set(model.tree_.inputs) <= set(WINE.data.columns)


def test_clones_and_pickles_learn_and_answer_alike() -> None:
    model = FuzzyTreeClassifier(mode="paper").fit(IRIS, SPECIES)
    again = clone(model).fit(IRIS, SPECIES)
    loaded = pickle.loads(pickle.dumps(model))
    assert model.tree_ == again.tree_ == loaded.tree_
    assert (loaded.predict_proba(IRIS) == model.predict_proba(IRIS)).all()


@pytest.mark.parametrize("mode", ["default", "paper"])
def test_a_pickle_holds_no_value_of_a_training_row(mode: Mode) -> None:
    values = IRIS + np.random.default_rng(0).uniform(-0.01, 0.01, IRIS.shape)
    model = FuzzyTreeClassifier(mode=mode).partial_fit(
        values, SPECIES, classes=[0, 1, 2]
    )
    file = io.BytesIO()
    joblib.dump(model, file)
    pickles = [pickle.dumps(model), file.getvalue(), pickle.dumps(copy.deepcopy(model))]
    shown = msgspec.json.encode(model.tree_)  # ranges and centres are values of rows
    inner = [v for v in values.ravel().tolist() if repr(v).encode() not in shown]
    assert len(inner) > 580
    for content in pickles:
        for order in "<>":
            assert not [v for v in inner if struct.pack(order + "d", v) in content]


@pytest.mark.heavy
def test_partial_fit_does_not_go_on_from_a_pickle_or_a_copy() -> None:
    model = FuzzyTreeClassifier().partial_fit(IRIS, SPECIES, classes=[0, 1, 2])
    for other in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        with pytest.raises(ValueError, match="pickled or copied") as caught:
            other.partial_fit(IRIS, SPECIES, classes=[0, 1, 2])
        assert str(caught.value) == (
            "a pickled or copied classifier holds no training rows, so partial_fit "
            "cannot continue; call fit, or partial_fit on the original"
        )
        other.fit(IRIS, SPECIES).partial_fit(IRIS, SPECIES)
    model.partial_fit(IRIS, SPECIES)


@pytest.mark.heavy
def test_chunks_of_any_size_give_the_tree_of_the_whole_table() -> None:
    order = np.random.default_rng(0).permutation(len(IRIS))
    values, labels = IRIS[order], SPECIES[order]
    whole = FuzzyTreeClassifier().fit(values, labels)
    for size in (20, 64):
        model = FuzzyTreeClassifier()
        for start in range(0, len(values), size):
            rows = slice(start, start + size)
            model.partial_fit(values[rows], labels[rows], classes=[0, 1, 2])
        assert model.tree_ == whole.tree_


def test_the_report_says_of_which_classes_rows_were_left_out() -> None:
    labels = np.repeat([0, 1, 2], [20, 70, 60])
    values = np.random.default_rng(0).normal(size=(150, 2)) + labels[:, None]
    model = FuzzyTreeClassifier(rows_per_class=30).fit(values, labels)
    assert model.report_.sampled == {"1": (30, 70), "2": (30, 60)}
    text = "learnt from 30 of 70 rows of class '1', 30 of 60 rows of class '2'"
    assert text in str(model.report_)
    assert not FuzzyTreeClassifier().fit(values, labels).report_.sampled
    many = FuzzyTreeClassifier(rows_per_class=2, mode="paper")
    text = str(many.fit(np.arange(20.0)[:, None], np.arange(20) // 4).report_)
    assert "2 of 4 rows of class '1', 3 more classes" in text


def test_chunks_may_have_whole_weights() -> None:
    weights = np.arange(150) % 4
    whole = FuzzyTreeClassifier().fit(IRIS, SPECIES, sample_weight=weights)
    model = FuzzyTreeClassifier()
    order = np.arange(150) * 7 % 150
    for rows in np.array_split(order, 3):
        model.partial_fit(IRIS[rows], SPECIES[rows], [0, 1, 2], weights[rows])
    assert model.tree_ == whole.tree_
    with pytest.raises(ValueError, match="all rows at once, not in chunks"):
        model.partial_fit(IRIS, SPECIES, sample_weight=weights + 0.5)


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        (None, "the first call of partial_fit needs classes"),
        ([0, 1], "label 2 is not among the classes [0 1]"),
    ],
    ids=["no classes", "unknown label"],
)
def test_partial_fit_needs_to_know_every_class(
    classes: list[int] | None, message: str
) -> None:
    with pytest.raises(ValueError, match="classes") as caught:
        FuzzyTreeClassifier().partial_fit(IRIS, SPECIES, classes=classes)
    assert str(caught.value) == message


def test_a_pipeline_and_a_grid_search_take_it() -> None:
    pipeline = make_pipeline(StandardScaler(), FuzzyTreeClassifier())
    assert cross_val_score(pipeline, IRIS, SPECIES, cv=5).mean() > 0.93
    grid = {"mode": ["default", "paper"]}
    search = GridSearchCV(FuzzyTreeClassifier(), grid, cv=3).fit(IRIS, SPECIES)
    assert search.best_score_ > 0.93


@pytest.mark.parametrize(
    ("values", "labels", "message"),
    [
        (IRIS[:1], SPECIES[:1], "cannot learn from one sample (n_samples = 1)"),
        (IRIS[:9], SPECIES[:9], "cannot learn from one class: every row is '0'"),
        (
            IRIS,
            np.arange(150),
            "y: the target is continuous, with 150 different numbers in 150 rows, and "
            "a tree predicts classes; divide the numbers into ranges and learn these",
        ),
        (
            IRIS,
            np.array([f"n{k}" for k in range(150)]),
            "y: the target has another class in each of 150 rows, as an identifier "
            "has, and nothing can be learnt about a class of one row; name the column "
            "of the classes",
        ),
        (
            IRIS[:3],
            np.array([1, "a", None], object),
            "y holds labels of several kinds: NoneType, int, str",
        ),
        (
            pd.DataFrame({"a": [{}, {}, 1.0]}),
            SPECIES[49:52],
            "X, row 3: column 'a' holds a number: '1.0' (1 among 2 other cells)\n"
            "  leave columns out with ignore (--ignore a), or take all their cells as "
            "categories with categorical (--categorical a)",
        ),
    ],
    ids=["one row", "one class", "numbers", "names", "kinds", "cells"],
)
@pytest.mark.filterwarnings("ignore:The number of unique classes")
def test_a_table_that_teaches_nothing_is_refused(
    values: FloatArray, labels: IntArray, message: str
) -> None:
    with pytest.raises(ValueError, match=r"learn|holds") as caught:
        FuzzyTreeClassifier().fit(values, labels)
    assert str(caught.value) == message


def test_a_row_that_overflows_a_combination_is_named() -> None:
    model = FuzzyTreeClassifier().fit(IRIS[:, :2], SPECIES > 0)
    low = Term("low", Band(high=0.0, right=1.0))
    high = Term("high", Band(low=0.0, left=-1.0))
    twice = Variable("twice", (low, high), parts=(Part("x1", 2.0),))
    ways = (Branch(("low",), leaf=1), Branch(("high",), leaf=2))
    model.model_ = FuzzyTree(
        "tree", ("False", "True"), (Variable("x1"), twice),
        (Node("twice", (0.0,), (0, 1), ways),), (Leaf("False"), Leaf("True")),
    )  # fmt: skip
    model = pickle.loads(pickle.dumps(model))
    rows = np.array([[-1.0, 0.0], [1.7e308, 0.0]])
    assert model.predict(rows[:1]).tolist() == [False]
    with pytest.raises(ValueError, match="overflows") as caught:
        model.predict(rows)
    assert str(caught.value) == (
        "row 1: its values are so large that a combination of columns overflows "
        "(1 such rows)"
    )


def test_missing_values_are_refused_in_paper_mode() -> None:
    model = FuzzyTreeClassifier(mode="paper").fit(WINE.data, WINE.target)
    with pytest.raises(ValueError, match="Input X contains NaN"):
        model.predict(pd.DataFrame([[np.nan] * 13], columns=WINE.data.columns))


def test_a_frame_may_have_texts_dates_and_missing_values() -> None:
    rows = 40
    table = pd.DataFrame(
        {
            "island": pd.Categorical(["Biscoe", "Dream", "Torgersen", "Dream"] * 10),
            "seen": pd.to_datetime("2020-01-01") + pd.to_timedelta(range(rows), "D"),
            "is wild": [True, False] * 20,
            "bill": [1.0, np.nan] * 20,
        },
        index=range(5, 5 + rows),
    )
    labels = np.array([0, 1, 1, 0] * 10)
    model = FuzzyTreeClassifier().fit(table, labels)
    known = {v.name: v for v in model.tree_.variables if not v.parts}
    assert all(v.missing is not None for v in known.values())
    assert {v.categories for v in known.values()} <= {
        ("Biscoe", "Dream", "Torgersen"),
        ("False", "True"),
        (),
    }
    found = model.predict(table).tolist()
    assert ft.run(model.tree_, table).classes == found
    table["island"] = "Mars"
    assert len(model.predict(table)) == rows


def test_a_category_may_be_a_number_at_prediction() -> None:
    rows = pd.DataFrame({"z": [10115, 20095, 80331, "unk"] * 30})
    model = FuzzyTreeClassifier().fit(rows, list("nnss") * 30)
    zips = [10115, 20095, 80331]
    expected = model.predict_proba(rows[:3])
    for table in (
        pd.DataFrame({"z": zips}),
        pd.DataFrame({"z": zips}, dtype=float),
        pd.DataFrame({"z": pd.Categorical(zips)}),
        pd.DataFrame({"z": pd.array(zips, "Int64")}),
        pl.DataFrame({"z": list(map(str, zips))}),
    ):
        assert model.predict(table).tolist() == [*"nns"]
        assert ft.run(model.tree_, table).classes == [*"nns"]
        assert model.apply(table).tolist() == model.apply(rows[:3]).tolist()
        assert (model.predict_proba(table) == expected).all()
        paths = model.decision_path(table).toarray()
        assert (paths == model.decision_path(rows[:3]).toarray()).all()
    with pytest.warns(UserWarning, match="valid feature names"):
        assert model.predict(np.array([zips]).T).tolist() == [*"nns"]


@pytest.mark.parametrize("names", [["a", "b"], [0, 1]], ids=["texts", "numbers"])
def test_columns_of_text_may_have_numbers_as_names(names: list[Any]) -> None:
    table = pd.DataFrame({names[0]: [0.5] * 40, names[1]: [*"pq"] * 20})
    model = FuzzyTreeClassifier().fit(table, [*"xy"] * 20)
    assert model.tree_.variables[0].categories == ("p", "q")
    assert model.predict(table[:4]).tolist() == [*"xyxy"]


def test_infinity_is_missing_but_in_paper_mode() -> None:
    values = np.array([[1.0], [np.inf], [3.0], [-np.inf], [2.0], [np.nan]] * 9)
    labels = [*"abcbab"] * 9
    model = FuzzyTreeClassifier().fit(values, labels)
    assert model.report_.rows_filled == 27
    missing = np.where(np.isinf(values), np.nan, values)
    assert FuzzyTreeClassifier().fit(missing, labels).tree_ == model.tree_
    for rows in (values, missing):
        assert model.predict(rows).tolist() == ft.run(model.tree_, rows).classes
    chunks = FuzzyTreeClassifier()
    for part in (slice(0, 30), slice(30, None)):
        chunks.partial_fit(values[part], labels[part], classes=[*"abc"])
    assert chunks.tree_ == model.tree_
    with pytest.raises(ValueError, match="Input X contains infinity"):
        FuzzyTreeClassifier(mode="paper").fit(values[:2], labels[:2])


def test_partial_fit_refuses_categories() -> None:
    table = pd.DataFrame({"z": pd.Categorical([1, 2, 1, 2])})
    with pytest.raises(ValueError, match="no numbers") as caught:
        FuzzyTreeClassifier().partial_fit(table, [*"abab"], classes=["a", "b"])
    assert str(caught.value) == (
        "X: column 'z' holds no numbers (Categorical), and only all rows show what it "
        "is: call fit, or learn with fuzzytree.Learner"
    )


def test_a_column_that_is_left_out_is_named() -> None:
    table = pd.DataFrame(IRIS[:, 2:], columns=["length", "width"])
    table["flower"] = [f"flower {k}" for k in range(150)]
    with pytest.warns(UserWarning, match="flower") as caught:
        model = FuzzyTreeClassifier().fit(table, SPECIES)
    assert str(caught[0].message) == (
        "X: flower has 150 different texts in 150 rows, as an identifier has; it is "
        "left out; --categorical flower keeps it"
    )
    assert set(model.tree_.inputs) <= {"length", "width"}
    assert model.feature_importances_[2] == 0
    assert (model.predict(table) == SPECIES).mean() > 0.9


def test_a_weight_counts_as_so_many_equal_rows_of_a_frame() -> None:
    rng = np.random.default_rng(0)
    table = pd.DataFrame(
        {"place": [*"abcd"] * 20, "size": rng.normal(size=80)}, index=range(9, 89)
    )
    labels = np.where(table["place"].isin(["a", "b"]), "in", "out")
    weights = pd.Series(rng.integers(0, 3, 80))
    weights[3::4] = 0  # no d
    order = np.repeat(np.arange(80), weights)
    one = FuzzyTreeClassifier().fit(table, labels, sample_weight=weights)
    other = FuzzyTreeClassifier().fit(table.iloc[order], labels[order])
    assert one.tree_ == other.tree_
    assert {*one.tree_.variables[0].categories} == {"a", "b", "c"}


def test_labels_of_rows_without_weight_are_no_classes() -> None:
    weights = (SPECIES < 2).astype(float)
    model = FuzzyTreeClassifier().fit(IRIS, SPECIES, sample_weight=weights)
    assert model.classes_.tolist() == [0, 1]
    assert model.tree_ == FuzzyTreeClassifier().fit(IRIS[:100], SPECIES[:100]).tree_


def test_weights_of_classes_are_given_by_label() -> None:
    rare = np.flatnonzero((SPECIES == 1) | (np.arange(150) % 5 == 0))
    values, labels = IRIS[rare][:, :2], SPECIES[rare] == 1
    plain, *heavy = (
        FuzzyTreeClassifier(class_weight=wanted).fit(values, labels)
        for wanted in (None, {False: 50.0}, {False: 50.0, True: 1})
    )
    assert heavy[0].tree_ == heavy[1].tree_
    assert heavy[0].predict(values).sum() < plain.predict(values).sum()
    with pytest.raises(ValueError, match="no class"):
        FuzzyTreeClassifier(class_weight={7: 1.0}).fit(values, labels)


def test_weights_are_routed_through_pipelines_and_searches() -> None:
    weights = np.where(SPECIES == 2, 0.0, 1.0)
    alone = np.flatnonzero(weights)
    with config_context(enable_metadata_routing=True):
        model = FuzzyTreeClassifier().set_fit_request(sample_weight=True)
        scaler = StandardScaler().set_fit_request(sample_weight=False)
        scorer = make_scorer(accuracy_score).set_score_request(sample_weight=True)
        pipeline = make_pipeline(scaler, model).fit(
            IRIS, SPECIES, sample_weight=weights
        )
        grid = {"columns_per_node": [1, 2]}
        search = GridSearchCV(model, grid, cv=3, scoring=scorer).fit(
            IRIS, SPECIES, sample_weight=weights
        )
        tested = cross_validate(
            model,
            IRIS,
            SPECIES,
            cv=3,
            scoring=scorer,
            params={"sample_weight": weights},
        )
    assert set(pipeline.predict(IRIS)) == {0, 1}
    assert set(search.predict(IRIS)) == {0, 1}
    assert (search.predict(IRIS[alone]) == SPECIES[alone]).all()
    assert tested["test_score"].min() > 0.95


@pytest.mark.parametrize("kept", [150, 100], ids=["three classes", "two classes"])
def test_the_decision_function_is_the_logarithm_of_the_probabilities(
    kept: int,
) -> None:
    values, labels = IRIS[:kept], SPECIES[:kept]
    model = FuzzyTreeClassifier().fit(values, labels)
    shares, found = model.predict_proba(values), model.decision_function(values)
    assert np.isfinite(found).all()
    if kept == 150:
        assert found.shape == (150, 3)
        assert (found.argmax(axis=1) == model.predict(values)).all()
        assert_allclose(np.exp(found), shares, atol=1e-6)
    else:
        assert found.shape == (100,)
        assert ((found > 0) == (model.predict(values) == 1)).all()
        assert_allclose(1 / (1 + np.exp(-found)), shares[:, 1], atol=1e-6)
    with np.errstate(divide="ignore"):
        assert (model.predict_log_proba(values) == np.log(shares)).all()


def test_paths_lead_through_nodes_to_the_leaf_that_answers() -> None:
    model = FuzzyTreeClassifier().fit(WINE.data, WINE.target)
    tree, found = model.tree_, model.decision_path(WINE.data)
    ends, rules = model.apply(WINE.data), ft.run(tree, WINE.data).rule
    size = len(tree.nodes) + len(tree.leaves)
    assert found.format == "csr"
    assert found.shape == (178, size)
    assert model.get_n_leaves() == len(tree.leaves)
    assert set(found.data) == {1}
    assert (found[np.arange(178), ends] == 1).all()
    assert (found[:, [0]].toarray() == 1).all()
    assert found.sum(axis=1).max() - 1 == model.get_depth()
    support = dict(zip(ends.tolist(), rules.tolist(), strict=True))
    for end, rule in support.items():
        assert found[:, [end]].sum() == tree.leaves[rule - 1].support
    assert len(support) == len(tree.leaves)


@pytest.mark.parametrize("depth", [1, 3, None])
def test_nodes_have_the_numbers_of_scikit_learn(depth: int | None) -> None:
    grown = DecisionTreeClassifier(max_depth=depth, random_state=0).fit(IRIS, SPECIES)
    tree = ft.from_sklearn(grown)
    paths, rules = leaf_paths(tree), ft.run(tree, IRIS).rule
    assert grown.apply(IRIS).tolist() == [paths[rule - 1][-1] for rule in rules]
    passed = grown.decision_path(IRIS).toarray()
    for row, rule in zip(passed, rules, strict=True):
        assert np.flatnonzero(row).tolist() == [*paths[rule - 1]]
    assert len(tree.leaves) == grown.get_n_leaves()


def test_a_classifier_draws_and_prints_its_tree() -> None:
    model = FuzzyTreeClassifier(leaves=3).fit(WINE.data, WINE.target)
    assert model.plot() == ft.draw(model.tree_)
    assert ">three classes<" in model.plot(title="three classes").svg
    row = dict.fromkeys(model.tree_.inputs, 1.0)
    assert model.plot(row=row) == ft.draw(model, row=row)
    two = model.tree_.inputs[:2]
    assert model.plot(surface=two) == ft.draw(model, surface=two)
    text = ft.export_text(model)
    assert text == ft.export_text(model.tree_)
    assert text.splitlines()[0].startswith("tree: fuzzy tree, 2 nodes, 3 leaves")
    with pytest.raises(NotFittedError):
        FuzzyTreeClassifier().plot()


def test_importances_are_those_of_the_columns_that_decide() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(400, 4))
    labels = np.where(values[:, 2] > 0, "up", np.where(values[:, 0] > 1, "up", "down"))
    model = FuzzyTreeClassifier(columns_per_node=1).fit(values, labels)
    found = model.feature_importances_
    assert found.shape == (4,)
    assert abs(found.sum() - 1.0) < 1e-12
    assert found[2] > found[0] > 0.05
    assert found[[1, 3]].max() < 0.05
    labels = values[:, 0] + 2 * values[:, 1] > 0
    found = FuzzyTreeClassifier(leaves=2).fit(values, labels).feature_importances_
    assert 0.25 < found[0] < 0.4
    loaded = pickle.loads(pickle.dumps(model))
    assert (loaded.feature_importances_ == model.feature_importances_).all()


def test_a_pickle_is_as_small_as_the_model() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(100_000, 5))
    labels = (values[:, 0] > 0.3) ^ (values[:, 1] > 0.1)
    model = FuzzyTreeClassifier(leaves=8).fit(values, labels)
    size = len(pickle.dumps(model))
    assert size < 2 * len(msgspec.json.encode(model.tree_)) + 4096
    assert size < 20_000  # of 4,000,000 bytes of rows


def test_a_fitted_classifier_is_drawn() -> None:
    model = FuzzyTreeClassifier().fit(WINE.data, WINE.target)
    assert ft.draw(model).svg == ft.draw(model.tree_).svg


def test_without_scikit_learn_the_classifier_says_what_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.base", None)
    monkeypatch.delitem(sys.modules, "fuzzytree.estimator")
    with pytest.raises(MissingExtraError) as caught:
        importlib.import_module("fuzzytree.estimator")
    assert str(caught.value) == (
        "FuzzyTreeClassifier needs scikit-learn: pip install 'scikit-learn>=1.6'"
    )


def test_masked_cells_and_times_are_no_numbers_to_the_classifier() -> None:
    values, labels = np.array([[1.0], [1.5], [7.0], [8.0]]), [0, 0, 1, 1]
    model = FuzzyTreeClassifier(mode="paper").fit(values, labels)
    masked = np.ma.MaskedArray(values, [[True], [False], [False], [False]])
    for call in (model.predict, lambda rows: model.fit(rows, labels)):
        with pytest.raises(ValueError, match="Input X contains NaN"):
            call(masked)
        times = values.astype("datetime64[s]")
        with pytest.raises(
            ValueError, match=r"^X holds datetime64\[s\], and no numbers$"
        ):
            call(times)
    with pytest.raises(ValueError, match=r"^y holds masked labels$"):
        model.fit(values, np.ma.MaskedArray(labels, [True, False, False, False]))
