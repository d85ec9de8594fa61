"""`benchmarks/press.py`: the files that it writes, and what it refuses."""

from __future__ import annotations

import doctest
from pathlib import Path
from types import ModuleType

import numpy as np
import press as script
import press_physics
import press_shapes
import pytest
from press import main
from press_physics import PAPER, PhysicsSettings, press
from press_shapes import OBJECTS

from fuzzytree.tactile.link.recording import read_recording
from fuzzytree.tactile.presses import read_frames

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "simulator.md"


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_presses_of_all_objects_are_written_with_their_labels() -> None:
    for name in ("a.npz", "b.npz"):
        main(["all", "--count", "3", "--seed", "9", "-o", name])
    found = read_frames("a.npz")
    assert found.label_names == tuple(OBJECTS)
    assert found.label.tolist() == np.repeat(range(7), 3).tolist()
    assert (found.sensor.full, found.sensor.threshold) == (255, PAPER.threshold)
    assert np.array_equal(found.frames[9:12], press("circle", 3, 9).frames)
    assert Path("a.npz").read_bytes() == Path("b.npz").read_bytes()


def test_a_recording_shows_the_objects_one_after_another() -> None:
    words = ("circle", "--frames", "90", "--set", "threshold=3")
    for name in ("a.ftr", "b.ftr"):
        main([*words, "-o", name])
    found = read_recording("a.ftr")
    assert found.frames.shape == (90, 16, 16)
    assert found.frames[40].max() > 100
    assert found.frames[88].max() <= 4
    assert found.board.sensor.threshold == 3
    assert Path("a.ftr").read_bytes() == Path("b.ftr").read_bytes()


def test_a_setting_is_changed_by_name() -> None:
    changes = ("--set", "tilt=0", "--set", "bend_n=inf", "--set", "wiring=diodes")
    main(["circle", "--count", "2", "-o", "a.npz", *changes])
    settings = PhysicsSettings(tilt=0.0, bend_n=float("inf"), wiring="diodes")
    wanted = press("circle", 2, settings=settings).frames
    assert np.array_equal(read_frames("a.npz").frames, wanted)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["foot"], "invalid choice: 'foot' (choose from "),
        (["circle", "--set", "tild=1"], "the simulator has no setting 'tild'; it has "),
        (["circle", "--set", "tilt=steep"], "to float: 'steep'"),
        (["circle", "--set", "tilt=-1"], "tilt lies in 0 to 10, not -1"),
        (["circle", "--count", "0"], "1 to 100000 presses can be made at a time"),
    ],
)
def test_what_cannot_be_pressed_is_one_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*words, "-o", "a.npz"])
    assert sentence in capsys.readouterr().err + str(caught.value)


def test_the_documented_settings_are_those_that_there_are() -> None:
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    stated = {row.split("`")[1]: row.split("|")[2].strip() for row in rows}
    for name in PhysicsSettings.__struct_fields__:
        value = getattr(PAPER, name)
        assert stated[name] == (f"{value:g}" if not isinstance(value, str) else value)


@pytest.mark.parametrize("module", [script, press_physics, press_shapes])
def test_the_examples_give_what_they_show(module: ModuleType) -> None:
    assert doctest.testmod(module).failed == 0
