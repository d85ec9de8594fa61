"""ONNX files of frames that were shipped, held against their model."""

from __future__ import annotations

import json

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.errors import ReadError
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.tactile.exporters.onnx_frames import write_frames
from fuzzytree.tactile.recognition.onnx_files import check_onnx_files, frames_file
from fuzzytree.tactile.sensor import Sensor

SENSOR = Sensor(4, 4, threshold=3)
AREAS = np.array([[4.0, 1.0], [5.0, 1.5], [16.0, 3.0], [15.0, 3.5]])


def tree(name: str = "pad") -> FuzzyTree:
    labels = ["s", "s", "l", "l"]
    return learn(table(AREAS, columns=["area", "S1"]), target=labels, name=name)


def verdicts(content: bytes, model: FuzzyTree) -> list[str]:
    found = check_onnx_files(model, {"pad.onnx": content})
    return [one.verdict for one in found.comparisons]


@pytest.mark.parametrize("plain", [False, True])
def test_a_file_of_the_model_agrees_in_every_way(plain: bool) -> None:
    content = write_frames(
        tree(), SENSOR, plain=plain, outputs=("label", "rule", "features")
    ).content
    assert verdicts(content, tree()) == ["agrees"] * 3
    known = frames_file(content, "pad.onnx")
    assert known.sensor == SENSOR
    assert known.features == tree().inputs


def test_frames_of_ones_own_are_requested_as_well() -> None:
    rules = rules_from_tree(tree(), "raw")
    content = write_frames(rules, SENSOR, reject=0.2, outputs=("strengths",)).content
    frames = np.random.default_rng(0).integers(0, 256, (9, 4, 4))
    found = check_onnx_files(rules, {"pad.onnx": content}, frames, reject=0.2)
    assert found.ok
    assert found.comparisons[-1].rows == found.probes + 9


def test_a_changed_constant_is_found_by_the_graph_and_by_the_answers() -> None:
    proto = onnx.load_model_from_string(write_frames(tree(), SENSOR).content)
    weights = next(
        one for one in proto.graph.initializer if numpy_helper.to_array(one).size >= 16
    )
    moved = 0.0 * numpy_helper.to_array(weights)
    weights.CopyFrom(numpy_helper.from_array(moved, weights.name))
    found = verdicts(proto.SerializeToString(), tree())
    assert found == ["agrees", "DISAGREES", "DISAGREES"]


def test_a_file_of_another_model_is_reported() -> None:
    other = learn(table(AREAS[:, :1], columns=["peak"]), target=["s", "s", "l", "l"])
    content = write_frames(other, SENSOR).content
    found = check_onnx_files(tree(), {"pad.onnx": content})
    assert [one.detail for one in found.comparisons] == [
        ("it uses peak, and has the classes l, s",),
    ]


def test_a_file_that_takes_rows_is_refused() -> None:
    with pytest.raises(ReadError) as caught:
        frames_file(write_onnx(tree()).content, "rows.onnx")
    assert str(caught.value) == (
        "rows.onnx: the file takes rows, and not frames of a sensor; "
        "`fuzzytree check` checks it"
    )


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("sensor", '{"rows": 0, "columns": 4}', "the file's metadata is broken: "),
        ("outputs", '["state"]', "the graph's inputs and outputs are not those of"),
        ("features", "[" * 3000, "the file's metadata is broken: "),
        ("carrier", "tree", "the file takes rows, and not frames of a sensor; "),
        ("format", "99", "the file has format '99', and this fuzzytree reads"),
    ],
)
def test_metadata_that_cannot_be_is_refused(key: str, value: str, text: str) -> None:
    proto = onnx.load_model_from_string(write_frames(tree(), SENSOR).content)
    for entry in proto.metadata_props:
        if entry.key == f"fuzzytree.{key}":
            entry.value = value
    with pytest.raises(ReadError) as caught:
        frames_file(proto.SerializeToString(), "pad.onnx")
    assert str(caught.value).startswith(f"pad.onnx: {text}")


def test_the_metadata_say_which_sensor_it_is() -> None:
    proto = onnx.load_model_from_string(write_frames(tree(), SENSOR).content)
    stated = {entry.key: entry.value for entry in proto.metadata_props}
    assert json.loads(stated["fuzzytree.sensor"])["threshold"] == 3


def test_a_file_that_another_version_wrote_is_compared_as_any() -> None:
    proto = onnx.load_model_from_string(write_frames(tree(), SENSOR).content)
    for entry in proto.metadata_props:
        if entry.key == "fuzzytree.version":
            entry.value = "0.0.1"
    proto.graph.node[-1].name += " of old"
    files = {"pad.onnx": proto.SerializeToString()}
    found = check_onnx_files(tree(), files)
    assert not found.ok
    assert [one.verdict for one in found.comparisons] == [
        "agrees", "rows only", "agrees",
    ]  # fmt: skip
    assert check_onnx_files(tree(), files, rows_only=True).ok


def test_a_file_cannot_choose_its_sensor_and_reject() -> None:
    rules = rules_from_tree(tree(), "raw")
    content = write_frames(rules, Sensor(4, 4, threshold=200), reject=0.9).content
    found = check_onnx_files(rules, {"pad.onnx": content}, sensor=SENSOR)
    assert [one.verdict for one in found.comparisons] == [
        "DISAGREES", "agrees", "agrees",
    ]  # fmt: skip
    assert found.comparisons[0].detail == (
        "its sensor is 4 x 4 cells up to 255, threshold 200, "
        "not 4 x 4 cells up to 255, threshold 3",
        "its reject is 0.9, not 0.0",
    )


def test_a_sensor_that_only_the_file_states_is_reported() -> None:
    content = write_frames(tree(), SENSOR).content
    found = check_onnx_files(tree(), {"pad.onnx": content})
    assert found.skipped == (
        "pad.onnx: its sensor, which is 4 x 4 cells up to 255, threshold 3; "
        "name the right one with --sensor or --board",
    )
