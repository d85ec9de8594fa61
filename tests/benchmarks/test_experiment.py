"""`benchmarks/experiment.py`: what it prints, what it writes, what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import experiment_peers as peers
import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import numpy as np
import pytest
from commands import run as run_command
from experiment import command
from experiment_study import Study

import fuzzytree as ft
from fuzzytree.schemas.generation import of_result
from fuzzytree.tactile.board_file import load_board
from fuzzytree.tactile.presses import labelled, read_frames
from fuzzytree.tactile.recognition.recogniser import Recogniser
from fuzzytree.tactile.sensor import Sensor
from tests.cli.conftest import folder, originals
from tests.tactile.archives import write_presses

__all__ = ["folder", "originals"]
Call = Callable[..., tuple[int, str, str]]

SCHEMA = Path(__file__).resolve().parents[2] / "benchmarks" / "experiment.schema.json"


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Call:
    """Return a function that runs the command: exit code, stdout, stderr."""

    def run(*words: str) -> tuple[int, str, str]:
        code = run_command(command, words)
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def bars(folder: Path) -> Path:
    """Write flat and upright bars of three people."""
    random = np.random.default_rng(2)
    frames = np.zeros((24, 6, 6), np.uint8)
    for k, frame in enumerate(frames):
        place, end = random.integers(0, 4), random.integers(4, 6)
        line = frame[place] if k % 2 else frame[:, place]
        line[1:end] = random.integers(90, 200)
    frames[3, 5, 5] = 30  # a cell that is not at rest
    label, subject = np.arange(24) % 2, np.arange(24) // 8
    path = folder / "bars.npz"
    write_presses(
        path, labelled(frames, Sensor(6, 6, 200), label, ("upright", "flat"), subject)
    )
    return path


def test_an_experiment_reports_rates_table_divisions_and_accuracy(
    bars: Path, call: Call
) -> None:
    code, out, err = call("bars.npz", "--no-peers")
    assert code == 0
    assert not err
    assert out == (
        "bars.npz: 24 frames\n"
        "division  each of 3 subjects is left out in turn, and tested on\n"
        "sensor    6 x 6 cells, full 200, threshold 0\n"
        "features  log paper / force, log parts / force, axis, log size, place (24: "
        "log S1 / force, ..., y)\n"
        "learnt    default mode, shrinkage 0.001, entry 0; 2 leaves, which ask for 1 "
        "feature\n"
        "\n"
        "class    frames  right  rate\n"
        "upright  12      12     100.0 %\n"
        "flat     12      12     100.0 %\n"
        "all      24      24     100.0 %\n"
        "\n"
        "was \\ taken for  upright  flat\n"
        "upright          12       .\n"
        "flat             .        12\n"
        "\n"
        "tested     learnt from  frames  right\n"
        "subject 0  16           8       100.0 %\n"
        "subject 1  16           8       100.0 %\n"
        "subject 2  16           8       100.0 %\n"
        "\n"
        "accuracy  100.0 %, mean of 3 divisions (100.0 % to 100.0 %, "
        "standard deviation 0.0)\n"
        "          50.0 % by the commonest class alone\n"
    )


def test_the_schema_is_the_one_that_the_code_generates() -> None:
    assert SCHEMA.read_bytes() == of_result(Study)


@pytest.mark.heavy
def test_the_facts_fit_their_schema(bars: Path, call: Call) -> None:
    code, out, _ = call("bars.npz", "--json", "--features", "axis, area")
    assert code == 0
    facts = json.loads(out)
    jsonschema.validate(facts, json.loads(SCHEMA.read_text("utf-8")))
    assert facts["names"] == ["cos2", "sin2", "area"]
    assert [peer["name"] for peer in facts["peers"]] == [*peers.PEERS]


@pytest.mark.heavy
def test_a_folder_holds_a_model_that_recognises_the_frames(
    bars: Path, call: Call
) -> None:
    words = ("bars.npz", "--no-peers")
    code, _, err = call(*words, "-o", "found")
    assert code == 0
    assert "next     fuzzytree show found/tree.yaml" in err
    tree, board = ft.load("found/tree.yaml"), load_board("found/board.yaml")
    assert isinstance(tree, ft.FuzzyTree)
    presses = read_frames(bars)
    codes = Recogniser(tree, board.sensor)(presses.frames).codes
    assert codes.tolist() == presses.label.tolist()
    assert isinstance(ft.load("found/rules.yaml"), ft.RuleBase)
    table = Path("found/confusion.csv").read_text("utf-8")
    assert table == (
        "class,upright,flat,(nothing),(unknown)\nupright,12,0,0,0\nflat,0,12,0,0\n"
    )
    first = {path.name: path.read_bytes() for path in Path("found").iterdir()}
    assert {"tree.svg", "confusion.svg", "frames.svg", "report.json"} <= set(first)
    assert call(*words, "-o", "found", "--quiet") == (
        0,
        first["report.txt"].decode(),
        "",
    )
    again = {path.name: path.read_bytes() for path in Path("found").iterdir()}
    assert again == first


def test_without_scikit_learn_the_experiment_goes_on_and_says_so(
    bars: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiment.are_there", lambda: False)
    code, out, err = call("bars.npz", "--features", "axis")
    assert code == 0
    assert "learner" not in out
    assert err == (
        "without other learners: they need scikit-learn: "
        "pip install 'scikit-learn>=1.6'\n"
    )


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (
            ["hands"],
            "there is no task 'hands'; there is paper, postures, postures-17, touch, "
            "touch-fingers, and FILE.npz for frames of your own",
        ),
        (["paper", "--choose", "--repeats", "1"], "paper: settings are chosen by"),
        (["paper", "--full", "9"], "--full does nothing for 'paper'"),
        (["touch", "--test", "bars.npz"], "--test does nothing for 'touch'"),
        (["bars.npz", "--sensor", "ideal"], "--sensor does nothing for 'bars.npz'"),
        (["bars.npz", "--full", "0"], "full lies in 1 to 65535, not 0"),
        (["bars.npz", "--label", "kind"], "bars.npz: no class is known"),
        (["bars.npz", "--test", "bars.npz"], "3 subjects are both in bars.npz and in"),
        (["bars.npz", "--entry", "-1"], "entry is at least 0, not -1.0"),
        (["bars.npz", "--features", "S12"], "'S12' is no feature of a frame"),
        (
            ["bars.npz", "-o", "grasps.csv"],
            "grasps.csv/tree.yaml: cannot be written: 'grasps.csv' is not a folder",
        ),
        (["none.npz"], "none.npz: "),
        (["touch", "--data", "."], "capfinger_27x15.npz: is not there"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_done_is_reported_in_a_sentence(
    words: list[str], stated: str, bars: Path, call: Call
) -> None:
    code, out, err = call(*words)
    assert (code, out) == (2, "")
    assert err.startswith(stated)
    assert "Traceback" not in err


def test_the_papers_rates_stand_beside(call: Call, folder: Path) -> None:
    code, out, _ = call("--no-peers", "--repeats", "1", "--mode", "paper")
    assert code == 0
    assert "class         frames  right  rate     paper\n" in out
    assert "89.7 %\n" in out
    assert "paper mode" in out
