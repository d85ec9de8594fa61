"""`fuzzytree tactile export`: files from frame to class."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

from fuzzytree.api.verbs import save
from fuzzytree.cli.program import main
from fuzzytree.model.contracts import Written
from fuzzytree.tactile.cli.sensors import frames_of_file
from fuzzytree.tactile.exporters import onnx_frames
from fuzzytree.tactile.exporters.onnx_frames import write_frames
from fuzzytree.tactile.presses import labelled
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.archives import write_presses
from tests.tactile.frame_models import SMALL, learnt_tree, raw_rules

pytestmark = pytest.mark.usefixtures("few_objects")

SIZE = ["--sensor", "6x4", "--full", "100"]
Said = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tree = learnt_tree(SMALL, ("area", "S1"))
    save(tree, "tree.yaml")
    save(raw_rules(tree), "rules.yaml")
    cells = np.random.default_rng(0).integers(0, 101, (9, 6, 4)).astype(np.uint8)
    cells[0] = 0
    write_presses("f.npz", labelled(cells, SMALL))


def test_a_graph_is_checked_and_written(capsys: Said) -> None:
    words = ["tactile", "export", "tree.yaml", "pad.onnx", *SIZE, "--data", "f.npz"]
    assert main(words) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0].startswith("tree: none of 5 comparisons disagrees (")
    assert lines[1].split()[:2] == ["compared", "with"]
    assert lines[-1].startswith("f.npz: 9 frames, 1 empty, 0 unknown, ")
    assert "plain Python" in lines[2]
    assert all(line.endswith("agree") for line in lines[2:5])
    content = Path("pad.onnx").read_bytes()
    assert err.startswith(f"wrote    pad.onnx onnx, {len(content)} bytes, sha256 ")
    onnx.checker.check_model(onnx.load_model_from_string(content))


def test_frames_that_were_pressed_above_another_threshold_are_reported(
    capsys: Said,
) -> None:
    cells = np.ones((1, 6, 4), np.uint8)
    write_presses("six.npz", labelled(cells, Sensor(6, 4, 100, 6)))
    for threshold in (4, 6):
        frames_of_file("six.npz", Sensor(6, 4, 100, threshold))
    stated = capsys.readouterr().err
    assert stated == "differs  six.npz states the threshold 6, not 4\n"


def test_c_goes_to_standard_output(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    words = ["tactile", "export", "rules.yaml", "-", "--to", "c", *SIZE]
    assert main([*words, "--set", "name=pad", "--set", "reject=0.25", "--quiet"]) == 0
    out, err = capfdbinary.readouterr()
    assert b"pad_recognise(const pad_cell *frame)" in out
    assert b"< 0x1p-2" in out
    assert err == b""


def test_facts_for_programs(capsys: Said) -> None:
    words = ["tactile", "export", "tree.yaml", "pad.c", *SIZE, "--data", "f.npz"]
    assert main([*words, "--json", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] is True
    assert found["bytes"] == Path("pad.c").stat().st_size
    assert found["shown"]["empty"] == 1


def test_nothing_is_written_where_a_way_disagrees(
    capsys: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    def other(*given: object, **options: Any) -> Written:
        return write_frames(learnt_tree(SMALL, ("S1",), classes=5), SMALL, **options)

    monkeypatch.setattr(onnx_frames, "write_frames", other)
    words = ["tactile", "export", "tree.yaml", "pad.onnx", *SIZE]
    assert main(words) == 1
    assert (
        capsys.readouterr().err == "3 of 5 comparisons disagree; nothing is written\n"
    )
    assert not Path("pad.onnx").exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["pad.txt", *SIZE], "pad.txt: a file from frame to class ends in .onnx or .c"),
        (["pad.c"], "name the board with --board, or its size: --sensor 16x16"),
        (["pad.c", "--sensor", "6by4"], "--sensor 6by4: rows and columns are as in "
         "16x16"),
        (["pad.c", "--board", "b.yaml", "--full", "9"], "--board sets --full; "
         "choose one of them"),
        (["pad.c", *SIZE, "--threshold", "100"], "the threshold lies in 0 to full - 1, "
         "not 100"),
        (["pad.c", *SIZE, "--set", "name"], "--set name: must be NAME=VALUE"),
        (["pad.c", *SIZE, "--set", "opset=17"], "c has no option 'opset'; it has name, "
         "reject"),
        (["pad.onnx", *SIZE, "--set", "ir=8", "--set", "ir=9"], "the option 'ir' is "
         "given twice"),
        (["pad.onnx", "--sensor", "4x6", "--data", "f.npz"], "f.npz: a frame of "
         "6 x 4 cells does not fit a sensor of 4 x 6"),
    ],
)  # fmt: skip
def test_mistakes_in_the_command_are_one_sentence(
    words: list[str], text: str, capsys: Said
) -> None:
    assert main(["tactile", "export", "tree.yaml", *words]) == 2
    assert capsys.readouterr().err.splitlines()[0] == text


def test_a_model_for_other_things_is_refused(capsys: Said) -> None:
    example = Path(__file__).parents[3] / "examples" / "tipper.fll"
    assert main(["tactile", "export", str(example), "pad.c", *SIZE]) == 2
    assert capsys.readouterr().err == (
        f"{example}: a model of frames is a tree or a rule base\n"
    )
