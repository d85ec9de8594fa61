"""`fuzzytree tactile interpolate`: a picture of a frame, or the numbers of all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fuzzytree.cli.program import main
from fuzzytree.tactile.interpolation import interpolated
from fuzzytree.tactile.presses import Presses
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.archives import write_presses

CELLS = np.zeros((3, 4, 5), np.uint8)
CELLS[1, 1:3, 1:4] = [[9, 255, 3], [80, 90, 200]]
CELLS[2, 0, 0] = 7


@pytest.fixture
def frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    write_presses("f.npz", Presses(CELLS, Sensor(4, 5)))
    return "f.npz"


def run(*words: str) -> int:
    return main(["tactile", "interpolate", *words])


def test_an_archive_has_all_frames_at_every_number_of_times(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(frames, "--times", "2,3", "--threshold", "5", "-o", "o.npz") == 0
    cells = np.where(CELLS > 5, CELLS, 0)
    with np.load("o.npz", allow_pickle=False) as found:
        assert sorted(found) == ["frames", "times_2", "times_3"]
        assert np.array_equal(found["frames"], cells)
        for times in (2, 3):
            assert np.array_equal(found[f"times_{times}"], interpolated(cells, times))
    size = Path("o.npz").stat().st_size
    assert capsys.readouterr().err == (
        "read     f.npz   3 frames, 4 x 5 cells\n"
        "empty    1 frame nothing presses\n"
        "full     1 frame a cell reads 255 or more\n"
        f"wrote    o.npz   8 x 10, 12 x 15 points, {size} bytes\n"
    )


def test_a_frame_can_be_named(frames: str) -> None:
    assert run(frames, "--times", "7", "--frame", "2", "-o", "o.npz", "--quiet") == 0
    with np.load("o.npz", allow_pickle=False) as found:
        assert np.array_equal(found["times_7"], interpolated(CELLS[2:], 7))


def test_the_same_frames_are_the_same_bytes(frames: str) -> None:
    written: set[bytes] = set()
    for _ in range(2):
        assert run(frames, "-o", "o.npz", "--quiet") == 0
        written.add(Path("o.npz").read_bytes())
    assert len(written) == 1


def test_the_class_of_a_frame_stands_above_its_picture(
    frames: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fuzzytree.tactile import plots as module

    titles: list[str] = []
    draw = module.draw_frames

    def remembered(*given: Any, title: str, **options: Any) -> Any:
        titles.append(title)
        return draw(*given, title=title, **options)

    monkeypatch.setattr(module, "draw_frames", remembered)
    label = np.array([1, 0, 1])
    presses = Presses(CELLS, Sensor(4, 5), label, ("bar", "disc"))
    write_presses("named.npz", presses)
    assert run("named.npz", "-o", "p.svg", "--quiet") == 0
    assert run(frames, "-o", "q.svg", "--quiet") == 0
    assert titles == ["named.npz, frame 1, bar", "f.npz, frame 1"]


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_a_picture_is_of_the_first_frame_that_something_presses_on(
    frames: str, capsys: pytest.CaptureFixture[str], suffix: str
) -> None:
    if suffix == "png":
        pytest.importorskip("resvg_py")
        pytest.importorskip("font_roboto")
    assert run(frames, "--axis", "-o", f"p.{suffix}", "--json") == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {
        "file": f"p.{suffix}",
        "bytes": Path(f"p.{suffix}").stat().st_size,
        "frame": 1,
        "frames": 1,
        "of": 3,
        "rows": 4,
        "columns": 5,
        "times": [3, 5, 7],
        "nothing": 0,
        "saturated": 1,
    }
    assert err.startswith("read     f.npz   frame 1 of 3 frames, 4 x 5 cells\n")


def test_an_empty_frame_is_a_picture_that_says_so(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(frames, "--frame", "0", "--axis", "-o", "p.svg") == 0
    assert "empty    1 frame nothing presses\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["-o", "o.pdf"], "o.pdf: the name ends in .svg, .png or .npz"),
        (
            ["-o", "o.npz", "--times", "3,x"],
            "--times 3,x: must be whole numbers from 1 to 9999, such as 3,5,7",
        ),
        (["-o", "o.npz", "--times", "3,3"], "--times 3,3: names a number twice"),
        (["-o", "o.npz", "--frame", "3"], "--frame 3: f.npz has frames 0 to 2"),
        (
            ["-o", "o.npz", "--times", "9999"],
            "3 interpolated frames are 47990400480 bytes, more than 1073741824; "
            "name one --frame, or fewer --times",
        ),
        (
            ["-o", "o.svg", "--times", "999"],
            "4 x 5 cells, 999 times on each side, are more than 16777216 points",
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_done_is_one_sentence(
    frames: str, capsys: pytest.CaptureFixture[str], words: list[str], text: str
) -> None:
    assert run(frames, *words) == 2
    assert text in capsys.readouterr().err
    assert not Path(words[1]).exists()


def test_no_frames_make_no_picture(
    frames: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_presses("none.npz", Presses(CELLS[:0], Sensor(4, 5)))
    assert run("none.npz", "-o", "p.svg") == 2
    assert capsys.readouterr().err == "none.npz: holds no frame\n"
