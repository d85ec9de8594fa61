"""One check from frame to class: all implementations, and files that were shipped."""

from __future__ import annotations

import json

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.errors import ReadError, TableError
from fuzzytree.exporters.onnx import write_onnx
from fuzzytree.model.agreement import Comparison
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.tactile.exporters.onnx_frames import write_frames
from fuzzytree.tactile.features.aimed import aimed_frames
from fuzzytree.tactile.recognition import checking
from fuzzytree.tactile.recognition.checking import check_frames
from fuzzytree.tactile.recognition.runners import Answers, Runner, runners
from fuzzytree.tactile.sensor import Cells, Sensor
from fuzzytree.testing import random_tree
from tests.tactile.frame_models import PLAIN, SMALL, WIDE, learnt_tree

SENSOR = Sensor(4, 4, threshold=3)
AREAS = np.array([[4.0, 1.0], [5.0, 1.5], [16.0, 3.0], [15.0, 3.5]])


def tree(name: str = "pad") -> FuzzyTree:
    labels = ["s", "s", "l", "l"]
    return learn(table(AREAS, columns=["area", "S1"]), target=labels, name=name)


def verdicts(content: bytes, model: FuzzyTree) -> list[str]:
    """Return those of a file: its metadata, its graph and its answers."""
    found = check_frames(model, SENSOR, files={"pad.onnx": content})
    return [c.verdict for c in found.comparisons if c.representation == "pad.onnx"]


MIXED = ("force", "area", "peak", "angle", "log S1", "cell r1 c3", "block r1 c0 of 2x2")


@pytest.mark.parametrize("sensor", [PLAIN, WIDE], ids=["16x16", "5x7"])
def test_every_way_gives_the_same_bits_and_classes(sensor: Sensor) -> None:
    tree = learnt_tree(sensor, MIXED)
    found = check_frames(tree, sensor, aimed_frames(sensor, 40, seed=5))
    assert found.ok
    ways = ["numpy", "c", "onnx"]
    assert [one.representation for one in found.comparisons] == ways
    assert {one.against for one in found.comparisons} == {"plain Python"}


def wrong_third(one: Runner) -> Runner:
    """Return a runner that is wrong about its third frame."""

    def answer(frames: Cells) -> Answers:
        found = one(frames)
        features = found["features"].copy()
        features[2:3, 0] = np.nextafter(features[2:3, 0], np.inf)
        return {**found, "features": features}

    return answer


def test_a_bit_that_differs_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    tree = learnt_tree(SMALL, ("area",))

    def broken(*given: object) -> tuple[dict[str, Runner], list[str]]:
        ways, missing = runners(tree, SMALL)
        return ways | {"onnx": wrong_third(ways["onnx"])}, missing

    monkeypatch.setattr(checking, "runners", broken)
    (wrong,) = check_frames(tree, SMALL).wrong
    assert isinstance(wrong, Comparison)
    assert (wrong.representation, wrong.differing) == ("onnx", 1)
    assert wrong.detail == ("frame 2: features [24.000000000000004], not [24.0]",)


def test_frames_beyond_what_plain_python_takes_are_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(checking, "_MOST_CELLS", 16 * 30)
    found = check_frames(tree(), SENSOR, np.zeros((9, 4, 4), np.uint8))
    left = found.skipped[0].split()
    assert left[1:] == ["frames,", "to", "save", "time"]
    assert {one.rows for one in found.comparisons} == {30}


def test_a_model_for_other_features_is_refused_by_its_name() -> None:
    model = random_tree(1)
    with pytest.raises(TableError, match=f"^{model.name} uses other features: "):
        check_frames(model, SMALL)


@pytest.mark.parametrize("plain", [False, True])
def test_a_file_of_the_model_agrees_in_every_way(plain: bool) -> None:
    content = write_frames(
        tree(), SENSOR, plain=plain, outputs=("label", "rule", "features")
    ).content
    assert verdicts(content, tree()) == ["agrees"] * 3


def test_frames_of_ones_own_are_requested_as_well() -> None:
    rules = rules_from_tree(tree(), "raw")
    content = write_frames(rules, SENSOR, reject=0.2, outputs=("strengths",)).content
    frames = np.random.default_rng(0).integers(0, 256, (9, 4, 4))
    found = check_frames(rules, SENSOR, frames, files={"pad.onnx": content}, reject=0.2)
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
    assert verdicts(write_frames(other, SENSOR).content, tree()) == ["DISAGREES"] * 3


def test_a_file_that_takes_rows_is_refused() -> None:
    with pytest.raises(ReadError) as caught:
        verdicts(write_onnx(tree()).content, tree())
    assert str(caught.value) == (
        "pad.onnx: the file takes rows, and not frames of a sensor; "
        "`fuzzytree check` checks it"
    )


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("sensor", '{"rows": 0, "columns": 4}', "the file's sensor is none: "),
        ("sensor", "[" * 3000, "the file's sensor is none: "),
        ("carrier", "tree", "the file takes rows, and not frames of a sensor; "),
        ("format", "99", "the file has format '99', and this fuzzytree reads"),
    ],
)
def test_metadata_that_cannot_be_is_refused(key: str, value: str, text: str) -> None:
    with pytest.raises(ReadError) as caught:
        verdicts(stating(key, value), tree())
    assert str(caught.value).startswith(f"pad.onnx: {text}")


def stating(key: str, value: str) -> bytes:
    """Return a file of the tree that states something else."""
    proto = onnx.load_model_from_string(write_frames(tree(), SENSOR).content)
    for entry in proto.metadata_props:
        if entry.key == f"fuzzytree.{key}":
            entry.value = value
    content: bytes = proto.SerializeToString()
    return content


@pytest.mark.parametrize(
    ("key", "value"), [("outputs", '["state"]'), ("features", "[" * 3000)]
)
def test_metadata_that_are_not_the_models_are_reported(key: str, value: str) -> None:
    found = verdicts(stating(key, value), tree())
    assert found == ["DISAGREES", "agrees", "agrees"]


def test_a_graph_that_takes_or_gives_something_else_is_refused() -> None:
    for ends in ("input", "output"):
        proto = onnx.load_model_from_string(write_frames(tree(), SENSOR).content)
        name = getattr(proto.graph, ends)[0].name
        getattr(proto.graph, ends)[0].name = "other"
        for node in proto.graph.node:
            for names in (node.input, node.output):
                names[:] = ["other" if one == name else one for one in names]
        with pytest.raises(ReadError) as caught:
            verdicts(proto.SerializeToString(), tree())
        assert str(caught.value) == (
            "pad.onnx: the graph's inputs and outputs are not those of frames"
        )


def test_the_metadata_say_which_sensor_it_is() -> None:
    proto = onnx.load_model_from_string(write_frames(tree(), SENSOR).content)
    stated = {entry.key: entry.value for entry in proto.metadata_props}
    assert json.loads(stated["fuzzytree.sensor"])["threshold"] == 3


def test_a_file_that_another_version_wrote_is_compared_as_any() -> None:
    proto = onnx.load_model_from_string(stating("version", "0.0.1"))
    proto.graph.node[-1].name += " of old"
    files = {"pad.onnx": proto.SerializeToString()}
    assert verdicts(files["pad.onnx"], tree()) == ["agrees", "rows only", "agrees"]
    assert not check_frames(tree(), SENSOR, files=files).ok
    assert check_frames(tree(), SENSOR, files=files, rows_only=True).ok


def test_a_file_cannot_choose_its_sensor_and_reject() -> None:
    rules = rules_from_tree(tree(), "raw")
    content = write_frames(rules, Sensor(4, 4, threshold=200), reject=0.9).content
    found = check_frames(rules, SENSOR, files={"pad.onnx": content})
    metadata, graph, answers = found.wrong
    for text in ("it states sensor ", '"threshold": 200', "reject '0.9', and '0.0' is"):
        assert text in "; ".join(metadata.detail)
    assert graph.verdict == answers.verdict == "DISAGREES"


def test_a_file_for_frames_of_another_size_disagrees() -> None:
    content = write_frames(tree(), Sensor(5, 4)).content
    found = check_frames(tree(), SENSOR, files={"pad.onnx": content})
    assert len(found.wrong) == 3
    assert (
        found.wrong[2].detail[0].startswith("pad.onnx: onnxruntime does not run it: ")
    )


def test_a_sensor_that_only_the_file_states_is_reported() -> None:
    content = write_frames(tree(), SENSOR).content
    found = check_frames(tree(), None, files={"pad.onnx": content})
    assert found.ok
    assert found.skipped == (
        "pad.onnx: its sensor, which is 4 x 4 cells up to 255, threshold 3; "
        "name the right one with --sensor or --board",
    )
