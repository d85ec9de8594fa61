"""Files and estimators: read as their programs compute, and bad ones refused."""

from __future__ import annotations

import io
import pickle
import random
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper
from sklearn.datasets import load_iris
from sklearn.ensemble import (
    GradientBoostingClassifier,
    HistGradientBoostingClassifier,
    HistGradientBoostingRegressor,
    RandomForestClassifier,
)
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier

import fuzzytree as ft
from fuzzytree.ensembles.onnx_trees import from_onnx
from fuzzytree.ensembles.programs import opened
from fuzzytree.errors import LossError, ReadError
from fuzzytree.numerics import cuts_of_rounded
from tests.ensembles.graphs import MODES, of_node, random_graph, run, written

IRIS = load_iris(return_X_y=True)


@pytest.mark.parametrize("kind", [TensorProto.FLOAT, TensorProto.DOUBLE])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", range(4))
def test_each_test_of_a_node_is_read_as_onnxruntime_runs_it(
    mode: str, kind: int, seed: int
) -> None:
    content = random_graph(seed, kind=kind, modes=(mode,))
    number: Any = np.float32 if kind == TensorProto.FLOAT else np.float64
    points = [number(p) for p in (-1, 0, 0.25, 0.5, 1, 2, np.nan, np.inf, -np.inf)]
    points += [np.nextafter(p, number(9)) for p in points[1:6]]
    rows = np.array(np.meshgrid(points, points), number).reshape(2, -1).T
    ensemble = from_onnx(content, "m.onnx").ensemble
    right = run(content, rows)[0]
    np.testing.assert_array_equal(ensemble.scores(rows.astype(np.float64)), right)


def test_doubles_are_rounded_as_scikit_learn_rounds_them() -> None:
    draw = np.random.default_rng(0)
    thresholds = np.concatenate([draw.normal(size=200), [0.0, 0.1, 1e-46, 3e38, -3e38]])
    cuts = cuts_of_rounded(thresholds)
    for value, is_left in ((cuts, True), (np.nextafter(cuts, np.inf), False)):
        rounded = value.astype(np.float32).astype(np.float64)
        assert ((rounded <= thresholds) == is_left).all()


@pytest.mark.parametrize(
    "model",
    [
        HistGradientBoostingClassifier(max_iter=5),
        HistGradientBoostingRegressor(max_iter=5),
        GradientBoostingClassifier(n_estimators=3),
    ],
)
def test_boosted_trees_are_read(model: Any) -> None:
    rows, target = IRIS
    model.fit(rows, target)
    result = opened(model)
    assert result is not None
    scores = result.ensemble.scores(rows)
    right = getattr(model, "decision_function", model.predict)(rows)
    np.testing.assert_allclose(scores, right.reshape(scores.shape), rtol=1e-12)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (LogisticRegression(), "a LogisticRegression is no tree"),
        (GradientBoostingClassifier(loss="exponential"), "loss 'exponential'"),
        (GradientBoostingClassifier(init=DecisionTreeClassifier()), "another model"),
    ],
)
def test_estimators_that_are_not_read_are_named(model: Any, words: str) -> None:
    rows, target = IRIS
    model.fit(rows[:100], target[:100])
    with pytest.raises(LossError, match=words):
        opened(model)


def test_an_estimator_that_is_not_fitted_is_refused() -> None:
    with pytest.raises(ValueError, match="is not fitted"):
        opened(RandomForestClassifier())


def bad_graphs() -> dict[str, tuple[bytes, str]]:
    """Return files that no reader should take, and what is said of them."""
    good = random_graph(0)

    def edit(change: Any) -> bytes:
        proto = onnx.load_from_string(good)
        change(proto)
        content: bytes = proto.SerializeToString()
        return content

    def set_list(name: str, place: int, value: Any) -> Any:
        def change(proto: onnx.ModelProto) -> None:
            for each in proto.graph.node[0].attribute:
                if each.name == name:
                    (each.floats if len(each.floats) else each.ints)[place] = value

        return change

    def shorten(proto: onnx.ModelProto) -> None:
        next(
            a for a in proto.graph.node[0].attribute if a.name == "nodes_modes"
        ).strings.pop()

    def before(proto: onnx.ModelProto) -> None:
        proto.graph.node[0].input[0] = "Y"
        proto.graph.node.insert(0, helper.make_node("Abs", ["X"], ["Y"]))

    def twice(proto: onnx.ModelProto) -> None:
        proto.graph.node.append(helper.make_node("Abs", ["X"], ["scores"]))

    def loop(proto: onnx.ModelProto) -> None:
        proto.graph.node.append(helper.make_node("Loop", ["X"], ["Y"]))

    def whole(proto: onnx.ModelProto) -> None:
        proto.graph.input[0].type.tensor_type.elem_type = TensorProto.INT64

    return {
        "cycle": (edit(set_list("nodes_truenodeids", 1, 0)), "no root|comes back"),
        "child": (edit(set_list("nodes_truenodeids", 1, 99)), "has no node 99"),
        "NaN": (edit(set_list("nodes_values", 0, np.nan)), "a cut is NaN"),
        "weight": (edit(set_list("target_weights", 0, np.inf)), "not finite"),
        "score": (edit(set_list("target_ids", 0, 7)), "score that is not there"),
        "column": (edit(set_list("nodes_featureids", 0, 7)), "column 8 of 2"),
        "negative column": (edit(set_list("nodes_featureids", 0, -1)), "column"),
        "lengths": (edit(shorten), "equally long"),
        "before": (edit(before), "'Abs' before the trees"),
        "twice": (edit(twice), "the same name"),
        "loop": (edit(loop), "'Loop' beside the trees"),
        "type": (edit(whole), "its input is int64"),
        "text": (b"hello", "not an ONNX file"),
        "nothing": (b"", "0 nodes of trees"),
        "cut short": (good[:-40], "ONNX|lacks|equally long"),
    }


@pytest.mark.parametrize("name", bad_graphs())
def test_a_bad_graph_is_refused_in_a_sentence(name: str) -> None:
    content, words = bad_graphs()[name]
    with pytest.raises(ReadError, match=words) as caught:
        from_onnx(content, "bad.onnx")
    assert str(caught.value).startswith("bad.onnx: ")


def test_two_classes_with_weights_of_both_are_read_as_onnxruntime_decides() -> None:
    content = random_graph(1, classes=2)
    rows = np.array([[0.1, 0.1], [0.7, 0.7], [2, -1]], np.float32)
    assert run(content, rows)[0].tolist() == [1, 1, 1]  # though class 0 may lead
    ensemble = from_onnx(content, "m.onnx").ensemble
    assert (ensemble.scores(rows.astype(float))[:, -1] > ensemble.bar).all()


def test_a_version_5_ensemble_is_read(tmp_path: Path) -> None:
    splits = helper.make_tensor("s", TensorProto.FLOAT, [2], [0.5, 1.5])
    node = helper.make_node(
        "TreeEnsemble",
        ["X"],
        ["scores"],
        domain="ai.onnx.ml",
        n_targets=2,
        aggregate_function=1,
        post_transform=0,
        tree_roots=[0],
        nodes_modes=helper.make_tensor("m", TensorProto.UINT8, [2], [0, 1]),
        nodes_featureids=[0, 1],
        nodes_splits=splits,
        nodes_truenodeids=[1, 0],
        nodes_trueleafs=[0, 1],
        nodes_falsenodeids=[2, 1],
        nodes_falseleafs=[1, 1],
        leaf_targetids=[0, 1, 0],
        leaf_weights=helper.make_tensor("w", TensorProto.FLOAT, [3], [1.0, 2.0, 4.0]),
    )
    proto = onnx.load_from_string(
        of_node(node, TensorProto.FLOAT, 2, is_classifier=False)
    )
    proto.opset_import[1].version = 5
    content = proto.SerializeToString()
    rows = np.array([[0.5, 1.5], [0.5, 1.0], [0.6, 1.0], [np.nan, 0]], np.float32)
    ensemble = from_onnx(content, "m.onnx").ensemble
    np.testing.assert_array_equal(
        ensemble.scores(rows.astype(float)), run(content, rows)[0]
    )
    path = tmp_path / "m.onnx"
    path.write_bytes(content)
    assert ft.check(path, path).ok


def test_thresholds_and_weights_of_doubles_are_read(tmp_path: Path) -> None:
    doubles = {
        "nodes_values_as_tensor": [0.1, 0.0, 0.0],
        "target_weights_as_tensor": [1 / 3, 2 / 3],
    }
    tensors: dict[str, Any] = {
        name: helper.make_tensor(name, TensorProto.DOUBLE, [len(values)], values)
        for name, values in doubles.items()
    }
    node = helper.make_node(
        "TreeEnsembleRegressor",
        ["X"],
        ["scores"],
        domain="ai.onnx.ml",
        n_targets=1,
        nodes_treeids=[0, 0, 0],
        nodes_nodeids=[0, 1, 2],
        nodes_featureids=[0, 0, 0],
        nodes_modes=["BRANCH_LEQ", "LEAF", "LEAF"],
        nodes_truenodeids=[1, 0, 0],
        nodes_falsenodeids=[2, 0, 0],
        target_treeids=[0, 0],
        target_nodeids=[1, 2],
        target_ids=[0, 0],
        **tensors,
    )
    proto = onnx.load_from_string(
        of_node(node, TensorProto.DOUBLE, 1, is_classifier=False)
    )
    proto.opset_import[1].version = 3
    proto.graph.output[0].type.tensor_type.elem_type = TensorProto.FLOAT
    content = proto.SerializeToString()
    rows = np.array([[0.1], [np.nextafter(0.1, 1)], [float(np.float32(0.1))]])
    ensemble = from_onnx(content, "m.onnx").ensemble
    scores = ensemble.scores(rows)
    assert scores.ravel().tolist() == [1 / 3, 2 / 3, 2 / 3]
    np.testing.assert_allclose(run(content, rows)[0], scores, rtol=1e-7)


def skops_file(model: Any) -> bytes:
    import skops.io

    content: bytes = skops.io.dumps(model)
    return content


def test_a_skops_file_is_the_estimator(tmp_path: Path) -> None:
    rows, target = IRIS
    model = GradientBoostingClassifier(n_estimators=3).fit(rows, target)
    path = tmp_path / "m.skops"
    path.write_bytes(skops_file(model))
    found = ft.check(path, written(model, 4, tmp_path / "m.onnx"), limit=100)
    assert found.ok


def bad_files(model: Any) -> dict[str, tuple[bytes, str]]:
    """Return .skops files that are refused."""
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(5):
            archive.writestr(f"{number}.npy", bytes(1 << 28))
    foreign = skops_file({"model": model, "path": Path("x")})
    return {
        "pickle": (pickle.dumps(model), "skops does not read it"),
        "bomb": (bomb.getvalue(), "unpacks to 1,342,177,280 bytes"),
        "types": (foreign, "which no file may load"),
        "list": (skops_file([1, 2]), "a list is no tree"),
    }


@pytest.mark.parametrize("name", ["pickle", "bomb", "types", "list"])
def test_a_bad_skops_file_is_refused(name: str, tmp_path: Path) -> None:
    model = DecisionTreeClassifier().fit(*IRIS)
    content, words = bad_files(model)[name]
    path = tmp_path / "bad.skops"
    path.write_bytes(content)
    with pytest.raises((ReadError, LossError), match=words):
        opened(path)


def test_indices_of_a_skops_file_that_lead_out_of_a_tree_are_refused(
    tmp_path: Path,
) -> None:
    model = DecisionTreeClassifier().fit(*IRIS)
    model.tree_.children_left[0] = 10_000
    path = tmp_path / "bad.skops"
    path.write_bytes(skops_file(model))
    with pytest.raises(ReadError, match="child of a node"):
        opened(path)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("m.pkl", "skops.io.dump"),
        ("m.joblib", "skops.io.dump"),
        ("m.ubj", "save_model"),
    ],
)
def test_files_that_are_not_read_name_what_is(name: str, words: str) -> None:
    with pytest.raises(ReadError, match=words):
        opened(name)


def test_a_pipeline_of_ours_is_compared_by_its_classes(tmp_path: Path) -> None:
    model = make_pipeline(StandardScaler(), DecisionTreeClassifier()).fit(*IRIS)
    bare = DecisionTreeClassifier(random_state=0).fit(*IRIS)
    found = ft.check(model, written(bare, 4, tmp_path / "m.onnx"), limit=100)
    assert isinstance(found, ft.model.TreeAgreement)
    scaled = written(model, 4, tmp_path / "scaled.onnx")
    with pytest.raises(ReadError, match="'Scaler' before the trees"):
        ft.check(model, scaled)


def test_settings_of_models_of_ours_are_refused(tmp_path: Path) -> None:
    model = DecisionTreeClassifier().fit(*IRIS)
    path = written(model, 4, tmp_path / "m.onnx")
    with pytest.raises(ValueError, match="runtimes: trees of other libraries"):
        ft.check(model, path, runtimes=["native"])
    forest = RandomForestClassifier(2).fit(*IRIS)
    with pytest.raises(LossError, match="one other file or estimator, and not with 0"):
        ft.check(forest)


def test_a_skops_file_whose_parts_are_no_trees_is_refused(tmp_path: Path) -> None:
    model = RandomForestClassifier(2).fit(*IRIS)
    model.estimators_ = [1, 2]
    path = tmp_path / "bad.skops"
    path.write_bytes(skops_file(model))
    with pytest.raises(ReadError, match="holds no whole RandomForestClassifier"):
        opened(path)


def test_broken_bytes_are_read_or_refused_in_a_sentence() -> None:
    draw = random.Random(0)
    good = [random_graph(0), random_graph(1, classes=3)]
    whole = 0
    refusals: list[str] = []
    for _ in range(1500):
        content = bytearray(draw.choice(good))
        for _ in range(draw.choice([1, 2, 5])):
            place = draw.randrange(len(content))
            if draw.random() < 0.5:
                content[place] = draw.randrange(256)
            else:
                del content[place : place + draw.randrange(1, 9)]
        try:
            from_onnx(bytes(content), "m.onnx")
            whole += 1
        except ReadError as error:
            refusals.append(str(error))
    assert whole
    assert refusals
    for text in refusals:
        assert text.startswith("m.onnx: ")
        assert "\n" not in text
