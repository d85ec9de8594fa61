"""Two tree ensembles: what is proved holds for all rows, and what differs has a row."""

from __future__ import annotations

import importlib
import itertools
import json
import re
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import numpy as np
import pytest
from onnx import TensorProto
from sklearn.datasets import load_breast_cancer, load_iris
from sklearn.ensemble import (
    ExtraTreesClassifier,
    GradientBoostingClassifier,
    GradientBoostingRegressor,
    RandomForestClassifier,
    RandomForestRegressor,
)
from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor

import fuzzytree as ft
from fuzzytree.errors import LossError
from fuzzytree.model import TreeAgreement, TreeAnswer
from tests.ensembles.graphs import changed, random_graph, run, with_routes, written

ROOT = Path(__file__).resolve().parents[2]
CANCER = load_breast_cancer(return_X_y=True)
IRIS = load_iris(return_X_y=True)
FEW: dict[str, Any] = {"limit": 400}


def check(one: Any, two: Any, **options: Any) -> TreeAgreement:
    found = ft.check(one, two, **{**FEW, **options})
    assert isinstance(found, TreeAgreement)
    return found


def verdicts(found: TreeAgreement, question: str) -> set[str]:
    return {a.verdict for a in found.answers if a.question == question}


def answers(found: TreeAgreement, question: str) -> list[TreeAnswer]:
    return [a for a in found.answers if a.question == question]


RIGHT = {
    "tree": (DecisionTreeClassifier(random_state=0), CANCER),
    "tree of three classes": (DecisionTreeClassifier(random_state=0), IRIS),
    "regression tree": (DecisionTreeRegressor(max_depth=6, random_state=0), CANCER),
    "forest": (RandomForestClassifier(10, random_state=0), CANCER),
    "forest of three classes": (RandomForestClassifier(10, random_state=0), IRIS),
    "extra trees": (ExtraTreesClassifier(5, random_state=0), IRIS),
    "regression forest": (RandomForestRegressor(10, random_state=0), CANCER),
    "boosted": (GradientBoostingClassifier(n_estimators=9, random_state=0), CANCER),
    "boosted, three": (
        GradientBoostingClassifier(n_estimators=5, random_state=0),
        IRIS,
    ),
    "boosted regression": (
        GradientBoostingRegressor(n_estimators=9, random_state=0),
        CANCER,
    ),
}


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_conversion_is_proved(name: str, tmp_path: Path) -> None:
    model, (rows, target) = RIGHT[name]
    model.fit(rows, target)
    found = check(model, written(model, rows.shape[1], tmp_path / "m.onnx"))
    assert verdicts(found, "routes") == {"PROVED"}
    assert verdicts(found, "scores") == {"PROVED"}
    for answer in answers(found, "scores"):
        assert answer.bound is not None
        assert answer.bound < 1e-4
    assert not found.remarks
    labels = verdicts(found, "labels")
    if "regression" in name:
        assert labels == {"not asked"}
    elif name in ("tree", "tree of three classes", "boosted, three"):
        assert labels == {"PROVED"}


@pytest.mark.heavy
@pytest.mark.parametrize("name", RIGHT)
def test_no_score_of_many_rows_at_and_beside_cuts_differs(
    name: str, tmp_path: Path
) -> None:
    model, (rows, target) = RIGHT[name]
    model.fit(rows, target)
    path = written(model, rows.shape[1], tmp_path / "m.onnx")
    found = check(model, path, limit=20_000)
    assert verdicts(found, "scores") == {"PROVED"}
    assert all("other numbers" not in a.sentence for a in answers(found, "programs"))
    assert "0,000 rows were run" in answers(found, "programs")[0].sentence


def test_missing_values_go_elsewhere_in_the_simplest_tree(tmp_path: Path) -> None:
    model = DecisionTreeClassifier().fit([[0], [0], [1]], [0, 0, 1])
    found = check(model, written(model, 1, tmp_path / "m.onnx"))
    assert verdicts(found, "labels") == {"PROVED"}
    for answer in answers(found, "missing values"):
        assert answer.verdict == "DIFFER"
        assert answer.row == (None,)
        assert [re.sub(r" .*:", ":", text) for text in answer.answers] == [
            "scikit-learn: 0 [1, 0]",
            "onnxruntime: 1 [0, 1]",
        ]


def test_missing_values_are_proved_where_the_file_has_their_routes(
    tmp_path: Path,
) -> None:
    rows, target = CANCER
    draw = np.random.default_rng(0)
    holes = np.where(draw.random(rows.shape) < 0.2, np.nan, rows)
    model = DecisionTreeClassifier(max_depth=5, random_state=0).fit(holes, target)
    path = written(model, rows.shape[1], tmp_path / "m.onnx")
    assert verdicts(check(model, path), "missing values") == {"DIFFER"}
    right = check(model, with_routes(path, model))
    assert verdicts(right, "missing values") == {"PROVED"}
    assert right.ok


def test_ties_of_a_forest_are_rows_that_differ(tmp_path: Path) -> None:
    rows, target = CANCER
    model = RandomForestClassifier(20, random_state=0).fit(rows, target)
    path = written(model, rows.shape[1], tmp_path / "m.onnx")
    found = check(model, path, limit=2000)
    answer = answers(found, "labels")[0]
    assert answer.verdict == "DIFFER"
    assert answer.row is not None
    row = np.array([answer.row], np.float32)
    assert model.predict_proba(row)[0, 0] == 0.5
    assert run(path.read_bytes(), row)[0] != model.predict(row)


@pytest.mark.parametrize("table", [CANCER, IRIS])
@pytest.mark.parametrize("count", [16, 20])
def test_ties_are_equal_where_no_sum_is_rounded(
    table: Any, count: int, tmp_path: Path
) -> None:
    rows, target = table
    model = RandomForestClassifier(count, random_state=0).fit(rows, target)
    found = check(model, written(model, rows.shape[1], tmp_path / "m.onnx"))
    assert (verdicts(found, "labels") == {"PROVED"}) == (count == 16)


def test_one_wrong_cut_is_a_row(tmp_path: Path) -> None:
    rows, target = CANCER
    model = RandomForestClassifier(5, max_depth=4, random_state=0).fit(rows, target)
    path = written(model, rows.shape[1], tmp_path / "m.onnx")
    right = np.float32(model.estimators_[0].tree_.threshold[0])
    wrong = changed(path, nodes_values={0: float(np.nextafter(right, np.float32(99)))})
    found = check(model, wrong, limit=1)
    for answer in answers(found, "routes"):
        assert answer.verdict == "DIFFER"
        assert answer.row is not None
        row = np.array([answer.row], np.float64)
        numbers = run(wrong.read_bytes(), row.astype(np.float32))[1]
        gap = numbers[0][0] - model.predict_proba(row)[0, 0]
        assert abs(gap) > 1e-3


def test_less_than_in_place_of_at_most_is_a_row_at_a_cut(tmp_path: Path) -> None:
    model = DecisionTreeClassifier().fit([[0.0], [1.0]], [0, 1])
    path = written(model, 1, tmp_path / "m.onnx")
    wrong = changed(path, nodes_modes={0: b"BRANCH_LT"})
    found = check(model, wrong, limit=1)
    assert [a.row for a in answers(found, "routes")] == [(0.5,), (0.5,)]


def test_one_wrong_leaf_is_a_row(tmp_path: Path) -> None:
    rows, target = CANCER
    model = GradientBoostingRegressor(n_estimators=4, random_state=0).fit(rows, target)
    path = written(model, rows.shape[1], tmp_path / "m.onnx")
    found = check(model, changed(path, target_weights={3: 0.3}), limit=1)
    assert verdicts(found, "routes") == {"PROVED"}
    assert verdicts(found, "scores") == {"DIFFER"}


def test_another_forest_differs_and_its_own_trees_in_another_order_do_not(
    tmp_path: Path,
) -> None:
    rows, target = IRIS
    model, other = (
        RandomForestClassifier(4, max_depth=3, random_state=s).fit(rows, target)
        for s in (0, 1)
    )
    path = written(model, 4, tmp_path / "m.onnx")
    assert not check(other, path).ok
    model.estimators_ = model.estimators_[::-1]
    found = check(model, path)
    assert "DIFFER" not in verdicts(found, "routes") | verdicts(found, "scores")


def test_double_thresholds_rounded_to_floats_differ(tmp_path: Path) -> None:
    one, two = tmp_path / "double.onnx", tmp_path / "float.onnx"
    modes = ("LEQ",)
    double = random_graph(3, kind=TensorProto.DOUBLE, modes=modes)
    one.write_bytes(double)
    two.write_bytes(random_graph(3, modes=modes))
    found = check(one, two)
    routes = {a.rows: a.verdict for a in answers(found, "routes")}
    # 0, .5 and 1 are floats; doubles just above them are rounded onto them.
    assert routes == {"float32": "PROVED", "float64": "DIFFER"}


def cells(kind: Any) -> Any:
    """Return rows in and between all cuts of random graphs, with missing values."""
    points = [-1.0, 0.0, 0.25, 0.5, 0.75, 1.0, 2.0, np.nan, np.inf, -np.inf]
    beside = [np.nextafter(kind(p), kind(p + s)) for p in (0, 0.5, 1) for s in (1, -1)]
    return np.array([*itertools.product([*points, *beside], repeat=2)], kind)


@pytest.mark.parametrize("seed", range(60))
def test_no_proof_is_false_and_no_accusation(seed: int, tmp_path: Path) -> None:
    draw = np.random.default_rng(seed)
    classes = int(draw.choice([0, 3]))
    kind = int(draw.choice([TensorProto.FLOAT, TensorProto.DOUBLE]))
    modes = (("LEQ",), ("LEQ", "LT", "GT", "GTE"), ("EQ", "NEQ", "LEQ"))[seed % 3]
    made = [
        random_graph(
            seed // (1 + side * (seed % 2)),
            kind=kind,
            trees=1 + seed % 3,
            classes=classes,
            modes=modes if side else modes[:1],
        )
        for side in (0, 1)
    ]
    paths = [tmp_path / "one.onnx", tmp_path / "two.onnx"]
    for path, content in zip(paths, made, strict=True):
        path.write_bytes(content)
    number = np.float32 if kind == TensorProto.FLOAT else np.float64
    rows = cells(number)
    results = [run(content, rows) for content in made]
    is_missing = np.isnan(rows).any(axis=1)
    for found in (check(*paths, limit=1), check(*paths)):
        own = "float32" if kind == TensorProto.FLOAT else "float64"
        by = {a.question: a for a in found.answers if a.rows == own}
        numbers = [np.asarray(result[-1]).reshape(len(rows), -1) for result in results]
        apart = (np.abs(numbers[0] - numbers[1]) > 1e-4).any(axis=1)
        if by["scores"].verdict == "PROVED":
            assert not apart[~is_missing].any()
        if by["missing values"].verdict == "PROVED":
            assert not apart.any()
        if by["labels"].verdict == "PROVED":
            assert (results[0][0] == results[1][0])[~is_missing].all()
        for answer in found.wrong:
            assert answer.row is not None
            row = np.array([[np.nan if v is None else v for v in answer.row]], number)
            pair = [run(content, row) for content in made]
            assert any(
                not np.array_equal(left, right)
                for left, right in zip(*pair, strict=True)
            )
        assert found.ok == (not found.wrong)


def test_a_tree_of_ours_and_its_estimator(tmp_path: Path) -> None:
    rows, target = IRIS
    model = DecisionTreeClassifier(max_depth=4, random_state=0).fit(rows, target)
    path = tmp_path / "tree.yaml"
    path.write_bytes(ft.export(ft.from_sklearn(model), "yaml").content)
    onnx = written(model, 4, tmp_path / "m.onnx")
    found = check(path, onnx)
    assert verdicts(found, "labels") == {"PROVED"}
    assert found.first == str(path)
    wrong = check(path, changed(onnx, nodes_values={0: 3.0}))
    assert verdicts(wrong, "labels") == {"DIFFER"}


def test_the_result_is_text_json_and_an_error(tmp_path: Path) -> None:
    model = DecisionTreeClassifier().fit([[0], [0], [1]], [0, 0, 1])
    found = check(model, written(model, 1, tmp_path / "m.onnx"))
    assert "missing values  DIFFER        DIFFER" in str(found)
    schema = json.loads((ROOT / "schemas" / "check-trees.schema.json").read_bytes())
    jsonschema.validate(json.loads(found.to_json()), schema)
    with pytest.raises(ft.DisagreementError, match="missing values: a row with"):
        found.raise_if_not_ok()


def test_rows_of_the_user_are_run(tmp_path: Path) -> None:
    rows, target = IRIS
    model = RandomForestRegressor(3, random_state=0).fit(rows, target)
    path = written(model, 4, tmp_path / "m.onnx")
    found = check(model, path, limit=10, data=rows)
    assert "320 rows" in answers(found, "programs")[0].sentence
    with pytest.raises(ft.TableError, match="2 columns; the trees take 4"):
        check(model, path, data=rows[:, :2])


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (RandomForestRegressor(2), "predicts numbers and"),
        (RandomForestClassifier(2), "classes or outputs and"),
    ],
)
def test_what_cannot_be_compared_is_refused(
    other: Any, words: str, tmp_path: Path
) -> None:
    rows, target = IRIS
    model = DecisionTreeClassifier().fit(rows, target > 0)
    other.fit(rows, target)
    with pytest.raises(LossError, match=words):
        check(other, written(model, 4, tmp_path / "m.onnx"))


def test_booleans_are_the_classes_0_and_1_of_a_graph(tmp_path: Path) -> None:
    model = DecisionTreeClassifier().fit([[0], [1]], [False, True])
    found = check(model, written(model, 1, tmp_path / "m.onnx"))
    assert verdicts(found, "labels") == {"PROVED"}


def test_a_row_of_zeros_is_shown_as_such(tmp_path: Path) -> None:
    model = DecisionTreeRegressor().fit([[-1], [1]], [0.0, 1.0])
    other = DecisionTreeRegressor().fit([[-1], [1]], [2.0, 1.0])
    found = check(model, written(other, 1, tmp_path / "m.onnx"))
    assert "  where all columns are 0\n" in str(found)


def test_objects_of_boosters_are_compared_as_their_files(tmp_path: Path) -> None:
    lightgbm, xgboost = map(pytest.importorskip, ("lightgbm", "xgboost"))
    rows, target = IRIS
    for model, name, save in (
        (xgboost.XGBClassifier(n_estimators=2), "m.json", "save_model"),
        (lightgbm.LGBMClassifier(n_estimators=2, verbose=-1), "m.txt", None),
    ):
        model.fit(rows, target)
        path = tmp_path / name
        (model if save else model.booster_).save_model(path)
        for source in (model, model.get_booster() if save else model.booster_):
            found = check(source, path)
            assert found.ok
            assert found.first == type(source).__name__
            assert verdicts(found, "scores") == {"PROVED"}


def test_data_of_boosters_are_no_trees(tmp_path: Path) -> None:
    lightgbm, xgboost = map(pytest.importorskip, ("lightgbm", "xgboost"))
    path = written(
        DecisionTreeClassifier().fit([[0], [1]], [0, 1]), 1, tmp_path / "m.onnx"
    )
    for data in (xgboost.DMatrix(np.zeros((2, 1))), lightgbm.Dataset(np.zeros((2, 1)))):
        with pytest.raises(TypeError):
            check(data, path)


def test_graphs_of_onnxmltools_are_read_to_their_end(tmp_path: Path) -> None:
    lightgbm, onnxmltools = map(pytest.importorskip, ("lightgbm", "onnxmltools"))
    types = importlib.import_module("onnxmltools.convert.common.data_types")
    rows, target = np.round(IRIS[0] * 10), IRIS[1] > 0
    model = lightgbm.LGBMClassifier(n_estimators=2, verbose=-1)
    model.fit(rows, target.astype(int))
    graph = onnxmltools.convert_lightgbm(
        model, initial_types=[("X", types.FloatTensorType([None, 4]))], zipmap=False
    )
    assert "Mul" in [node.op_type for node in graph.graph.node]
    (tmp_path / "m.onnx").write_bytes(graph.SerializeToString())
    assert "not read" not in str(check(model, tmp_path / "m.onnx"))
