"""From the raw frame to the class in one graph: what it holds, gives and refuses."""

import json
import re

import numpy as np
import onnx
import pytest
from msgspec.structs import replace
from onnx import numpy_helper

from fuzzytree.errors import InvalidModelError, ReadError, TableError
from fuzzytree.exporters.onnx_session import open_bare
from fuzzytree.model.rulebase import fingerprint
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.onnxruntime import open_onnx
from fuzzytree.tactile.exporters.onnx_frames import Output, write_frames
from fuzzytree.tactile.features import frame_program
from fuzzytree.tactile.features.aimed import aimed_frames, proving_frames
from fuzzytree.tactile.features.plain import plain_features
from fuzzytree.tactile.recognition.checking import check_frames
from fuzzytree.tactile.recognition.recogniser import Recogniser
from fuzzytree.tactile.sensor import Cells, Sensor
from fuzzytree.testing import random_tree
from tests.tactile.frame_models import PLAIN, SMALL, WIDE, learnt_tree, raw_rules

MIXED = ("force", "area", "peak", "angle", "log S1", "cell r1 c3", "block r1 c0 of 2x2")
ALL: tuple[Output, ...] = ("label", "state", "rule", "features")
TREE = learnt_tree(PLAIN, ("S1", "S9"))


def answers(
    content: bytes, frames: Cells, names: tuple[Output, ...]
) -> dict[str, np.ndarray[tuple[int, ...], np.dtype[np.generic]]]:
    found = open_bare(content)([*names], {"frames": frames})
    return dict(zip(names, map(np.asarray, found), strict=True))


@pytest.mark.parametrize("sensor", [PLAIN, WIDE, SMALL], ids=["16x16", "5x7", "6x4"])
def test_a_graph_gives_every_bit_of_the_recogniser(sensor: Sensor) -> None:
    tree = learnt_tree(sensor, MIXED)
    content = write_frames(tree, sensor, outputs=ALL).content
    frames = aimed_frames(sensor, 120, seed=1)
    found, right = answers(content, frames, ALL), Recogniser(tree, sensor)(frames)
    bits = np.ascontiguousarray(found["features"].T).view(np.uint64)
    assert np.array_equal(bits, right.features.values.view(np.uint64))
    assert found["state"].tolist() == right.states.tolist()
    labels = [tree.classes[code] if code >= 0 else "" for code in right.codes]
    assert found["label"].tolist() == labels
    assert {0, 1} <= {*found["state"].tolist()}


def test_a_floor_makes_what_is_weak_unknown() -> None:
    rules = raw_rules(TREE)
    names: tuple[Output, ...] = ("state", "label", "rule", "strengths")
    content = write_frames(rules, PLAIN, outputs=names, reject=0.5).content
    frames = aimed_frames(PLAIN, 120, seed=1)
    found = answers(content, frames, names)
    right = Recogniser(rules, PLAIN, 0.5)(frames)
    assert found["state"].tolist() == right.states.tolist()
    assert {*found["state"].tolist()} == {0, 1, 2}
    by_class = np.zeros((len(rules.classes), len(frames)))
    for line, rule in enumerate(rules.rules):
        own = found["strengths"][:, line]
        code = rules.classes.index(rule.then)
        by_class[code] = np.maximum(by_class[code], own.astype(np.float64))
    assert np.array_equal(by_class, right.strengths)
    assert not found["rule"][found["state"] != 0].any()


def test_no_frames_give_no_answers() -> None:
    content = write_frames(TREE, PLAIN, outputs=ALL).content
    found = answers(content, np.zeros((0, 16, 16), np.uint8), ALL)
    assert [found[name].shape for name in ALL] == [(0,), (0,), (0,), (0, 2)]


def test_only_the_moments_that_the_model_uses_have_weights() -> None:
    sizes = {}
    for names in (("S1", "S9"), ("S1",), ("force",)):
        content = write_frames(learnt_tree(PLAIN, names), PLAIN).content
        graph = onnx.load_model_from_string(content).graph
        sizes[names] = [
            numpy_helper.to_array(one).shape
            for one in graph.initializer
            if one.name == "weights"
        ]
    # sums 00 10 01 20 02 of S1; S9 also needs 11, 30, 21, 12, 03, 40, 22 and 04
    assert sizes == {
        ("S1", "S9"): [(256, 13)],
        ("S1",): [(256, 5)],
        ("force",): [(256, 1)],
    }


def test_cells_are_picked_and_not_multiplied() -> None:
    tree = learnt_tree(PLAIN, ("cell r8 c8", "cell r3 c5"))
    graph = onnx.load_model_from_string(write_frames(tree, PLAIN).content).graph
    weights = [one for one in graph.initializer if one.name == "weights"]
    assert numpy_helper.to_array(weights[0]).shape == (256, 1)  # the force


def test_what_a_sensor_does_not_have_is_no_node() -> None:
    bare = Sensor(16, 16)
    for sensor, expected in ((bare, set()), (PLAIN, {"Less", "Where"})):
        content = write_frames(TREE, sensor, outputs=("features",)).content
        nodes = onnx.load_model_from_string(content).graph.node
        before = [node.op_type for node in nodes]
        assert set(before[: before.index("MatMul")]) == {"Reshape", "Cast"} | expected


def test_every_constant_is_taken_by_a_node() -> None:
    graph = onnx.load_model_from_string(write_frames(TREE, PLAIN).content).graph
    taken = {name for node in graph.node for name in node.input}
    assert {one.name for one in graph.initializer} <= taken


def test_the_same_model_gives_the_same_bytes() -> None:
    one, two = (write_frames(TREE, PLAIN).content for _ in range(2))
    assert one == two


def test_the_file_says_what_it_is() -> None:
    found = onnx.load_model_from_string(write_frames(TREE, WIDE).content)
    facts = {one.key: one.value for one in found.metadata_props}
    assert facts["fuzzytree.carrier"] == "frames"
    assert facts["fuzzytree.fingerprint"] == fingerprint(TREE)
    assert json.loads(facts["fuzzytree.features"]) == ["S1", "S9"]
    assert json.loads(facts["fuzzytree.sensor"])["masked"] == [[1, 2], [4, 6]]
    assert json.loads(facts["fuzzytree.states"]) == ["object", "nothing", "unknown"]
    kind = found.graph.input[0].type.tensor_type.elem_type
    assert kind == onnx.TensorProto.UINT16
    onnx.checker.check_model(found, full_check=True)


def test_a_graph_of_frames_is_no_graph_of_rows() -> None:
    content = write_frames(TREE, PLAIN).content
    with pytest.raises(ReadError) as caught:
        open_onnx(content, "frames.onnx")
    assert str(caught.value) == (
        "frames.onnx: the file takes frames of a sensor, not rows; "
        "`fuzzytree tactile check` checks it"
    )


def test_a_tree_does_without_tree_operators() -> None:
    found = onnx.load_model_from_string(write_frames(TREE, PLAIN, plain=True).content)
    assert {one.domain for one in found.opset_import} == {""}


@pytest.mark.parametrize(
    "opset",
    [12, 18, *(pytest.param(n, marks=pytest.mark.heavy) for n in (13, 17, 20, 26))],
)
def test_operator_sets_give_the_same_answers(opset: int) -> None:
    tree = learnt_tree(SMALL, MIXED)
    ir = 8 if opset < 20 else 10
    content = write_frames(tree, SMALL, opset=opset, ir=ir, outputs=ALL).content
    assert check_frames(tree, SMALL, files={"small.onnx": content}).ok


def test_a_model_of_one_leaf_reports_something_from_nothing() -> None:
    tree = _one_leaf()
    content = write_frames(tree, SMALL).content
    frames = np.zeros((2, 6, 4), np.uint8)
    frames[1, 2, 2] = 9
    found = answers(content, frames, ("label", "state"))
    assert found["label"].tolist() == ["", "thing"]
    assert found["state"].tolist() == [1, 0]


def _one_leaf() -> FuzzyTree:
    tree = learnt_tree(SMALL, ("area",))
    leaf = replace(tree.leaves[0], label="thing", probabilities=(1.0,), counts=())
    return replace(
        tree, classes=("thing",), variables=(), nodes=(), leaves=(leaf,), sets=()
    )


def test_the_check_finds_a_file_of_another_model() -> None:
    other = learnt_tree(PLAIN, ("S9", "area"))
    content = write_frames(other, PLAIN, outputs=ALL).content
    found = check_frames(TREE, PLAIN, files={"pad.onnx": content})
    assert [(one.representation, one.verdict) for one in found.wrong] == [
        ("pad.onnx", "DISAGREES")
    ] * 3
    assert found.wrong[2].detail[0].startswith("frame 2: label ")


def test_frames_to_prove_with_lie_on_either_side_of_each_cut() -> None:
    tree = learnt_tree(PLAIN, ("area",))
    made = frame_program(PLAIN, tree.inputs)
    frames = proving_frames(made, tree)
    areas = [plain_features(made, frame)[0][0] for frame in frames]
    for node in tree.nodes:
        for cut in node.cuts:
            assert {np.floor(cut), np.floor(cut) + 1} <= {*areas}


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            {"outputs": ("class",)},
            "outputs: there is label, state, rule, features, strengths, not 'class'",
        ),
        ({"outputs": ()}, "outputs: name each once, at least one, not ()"),
        (
            {"outputs": ("strengths",)},
            "outputs: a tree has no strengths; write its rules to have them",
        ),
        ({"opset": 11}, "opset: onnx files are written for 12 to 26, not 11"),
        ({"ir": 3}, "ir: onnx files are written for 4 to 13, not 3"),
        ({"reject": 1.5}, "reject lies in 0 to 1, not 1.5"),
        (
            {"reject": 0.5},
            f"{TREE.name}: a tree has no strengths to reject by; give its raw rules",
        ),
    ],
)
def test_wrong_options_are_refused(options: dict[str, object], text: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(text)}$"):
        write_frames(TREE, PLAIN, **options)  # type: ignore[arg-type] # they are wrong


def test_what_is_no_feature_of_the_sensor_is_refused() -> None:
    with pytest.raises(InvalidModelError):
        write_frames(learnt_tree(PLAIN, ("cell r9 c9",)), SMALL)
    text = "'x1' is no feature of a frame"
    with pytest.raises(TableError, match=text):
        write_frames(random_tree(1), SMALL)
