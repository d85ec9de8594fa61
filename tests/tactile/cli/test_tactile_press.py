"""`fuzzytree tactile press`: what it writes, what it says, and what it refuses."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.tactile.presses import read_presses
from fuzzytree.tactile.simulation.objects import OBJECTS
from fuzzytree.tactile.simulation.physics import PAPER, PhysicsSettings, press

Call = Callable[..., tuple[int, str, str]]


def test_presses_of_all_objects_are_written_with_their_labels(
    call: Call, folder: Path
) -> None:
    code, out, err = call("tactile", "press", "all", "--count", "3", "-o", "p.npz")
    assert (code, out) == (0, "")
    found = read_presses(folder / "p.npz")
    assert found.label_names == tuple(OBJECTS)
    assert found.label.tolist() == np.repeat(range(7), 3).tolist()
    assert (found.sensor.full, found.sensor.threshold) == (255, PAPER.threshold)
    assert np.array_equal(found.frames[9:12], press("circle", 3).frames)
    content = (folder / "p.npz").read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    assert f"wrote    p.npz {len(content)} bytes, sha256 {digest}" in err
    assert err.splitlines()[-1] == (
        "next     fuzzytree tactile features p.npz --features 'S1, S9'"
    )
    assert call(*shlex.split(err.splitlines()[-1])[2:])[0] == 0


def test_the_same_presses_give_the_same_bytes(call: Call, folder: Path) -> None:
    words = ("tactile", "press", "square", "--count", "4", "--seed", "9", "-o")
    call(*words, "one.npz")
    call(*words, "two.npz")
    call(*words[:5], "--seed", "8", "-o", "three.npz")
    one, two, three = (
        (folder / f"{n}.npz").read_bytes() for n in ("one", "two", "three")
    )
    assert one == two != three


def test_a_setting_is_changed_by_name(call: Call, folder: Path) -> None:
    words = ("--set", "tilt=0", "--set", "bend-n=inf", "--set", "wiring=diodes")
    code, out, _ = call(
        "tactile", "press", "circle", "--count", "2", "-o", "p.npz", "--json", *words
    )
    assert code == 0
    settings = PhysicsSettings(tilt=0.0, bend_n=float("inf"), wiring="diodes")
    wanted = press("circle", 2, settings=settings)
    assert np.array_equal(read_presses(folder / "p.npz").frames, wanted.frames)
    facts = json.loads(out)
    assert facts["settings"]["tilt"] == 0.0
    assert facts["settings"]["bend_n"] is None  # JSON has no infinity
    assert facts["objects"][0]["force_n"] == wanted.truth.force_n.tolist()
    assert facts["objects"][0]["clipped"] == wanted.clipped.tolist()


def test_frames_on_standard_output_leave_no_room_for_more(
    call: Call, folder: Path
) -> None:
    code, out, err = call("tactile", "press", "circle", "-o", "-", "--json")
    assert (code, out) == (2, "")
    text = "`-o -` leaves no room for --json on stdout"
    assert err.splitlines()[0] == text


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("circle",), "missing option '-o' / '--output'"),
        (("circle", "--set", "tilt", "-o", "p.npz"), "--set tilt: must be NAME=VALUE"),
        (
            ("circle", "--set", "tild=1", "-o", "p.npz"),
            "the simulator has no setting 'tild'; "
            f"it has {', '.join(PhysicsSettings.__struct_fields__)} "
            "(did you mean 'tilt'?)",
        ),
        (
            ("circle", "--set", "tilt=1", "--set", "tilt=2", "-o", "p.npz"),
            "the setting 'tilt' is given twice",
        ),
        (
            ("circle", "--set", "tilt=steep", "-o", "p.npz"),
            "tilt: must be a number, not 'steep'",
        ),
        (
            ("circle", "--set", "board=1.5", "-o", "p.npz"),
            "board: must be a whole number, not '1.5'",
        ),
        (
            ("circle", "--set", "tilt=-1", "-o", "p.npz"),
            "tilt lies in 0 to 10, not -1",
        ),
        (
            ("foot", "-o", "p.npz"),
            "no object 'foot'; the objects are rectangle-0, rectangle-27, "
            "rectangle-45, circle, square, hand-0, hand-45",
        ),
        (
            ("circle", "--count", "0", "-o", "p.npz"),
            "1 to 100000 presses can be made at a time, not 0",
        ),
    ],
)
def test_what_cannot_be_pressed_is_reported(
    call: Call, words: tuple[str, ...], text: str
) -> None:
    code, out, err = call("tactile", "press", *words)
    assert (code, out) == (2, "")
    assert err.splitlines()[0] == text


def test_the_documented_settings_are_those_that_there_are() -> None:
    page = Path(__file__).parents[3] / "docs" / "explanation" / "simulator.md"
    rows = [line for line in page.read_text().splitlines() if line.startswith("| `")]
    stated = {row.split("`")[1]: row.split("|")[2].strip() for row in rows}
    for name in PhysicsSettings.__struct_fields__:
        value = getattr(PAPER, name)
        assert stated[name] == (f"{value:g}" if not isinstance(value, str) else value)
