"""Frames as tables, arrays and pictures that move, read back by other libraries."""

from __future__ import annotations

import gc
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest
from msgspec import structs
from numpy.testing import assert_allclose
from PIL import Image, ImageSequence

from fuzzytree.errors import MissingExtraError, WriteError, install_hint
from fuzzytree.tactile.board_file import read_board
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.calibration import Calibration
from fuzzytree.tactile.link.recording import Recorder, Recording, RecordingFile
from fuzzytree.tactile.plots import draw_frames
from fuzzytree.tactile.report.live import PALETTE, shades
from fuzzytree.tactile.sensor import Counters, Frame, Sensor, pressed
from fuzzytree.tactile.writers import (
    WRITERS,
    write_gif,
    write_hdf5,
    write_mp4,
    write_picture,
)

SENSOR = Sensor(4, 6, 255, 3, baseline=(5,) * 24, masked=((0, 1), (3, 5)))
LOST = 12
"""How far a colour of a video may be away, of 255: the encoder blurs colours."""


def recording(times: Sequence[float], sensor: Sensor = SENSOR) -> Recording:
    """Return frames on which a spot wanders from left to right."""
    rows, columns = sensor.rows, sensor.columns
    frames = np.full((len(times), rows, columns), 5, sensor.dtype)
    for place, frame in enumerate(frames):
        frame[rows // 2, place % columns] = sensor.full
    board = Board("mat", sensor, Marker("AA 55", bits=sensor.bits))
    numbers = np.arange(len(times)) * 3
    return Recording(board, frames, np.array(times), numbers, Counters(), 0, 0, 0)


def expected(file: Recording, place: int, times: int) -> Any:
    """Return the colours of a frame."""
    sensor = file.board.sensor
    cells = pressed(sensor, file.frames[place])[0]
    return np.array(PALETTE)[shades(cells, sensor.full, times)]


def gif(path: Path) -> tuple[list[Any], list[float]]:
    """Return the pictures of a GIF, and how many milliseconds each stays."""
    with Image.open(path) as image:
        assert image.info["loop"] == 0
        pictures = [
            np.array(one.convert("RGB")) for one in ImageSequence.Iterator(image)
        ]
        return pictures, [one.info["duration"] for one in ImageSequence.Iterator(image)]


def video(path: Path) -> tuple[list[Any], float]:
    """Return the pictures of a video, and how many there are a second."""
    found = cv2.VideoCapture(str(path))
    pictures = []
    while (answer := found.read())[0]:
        pictures.append(answer[1][:, :, ::-1])  # blue comes first
    rate = found.get(cv2.CAP_PROP_FPS)
    found.release()
    return pictures, rate


@pytest.mark.parametrize("sensor", [SENSOR, Sensor(256, 256, 65535, 0, (5,) * 65536)])
def test_hdf5_has_the_numbers_and_the_board(tmp_path: Path, sensor: Sensor) -> None:
    file = recording([0.1, 0.25, 1.0], sensor)
    write_hdf5(tmp_path / "a.h5", file)
    with h5py.File(tmp_path / "a.h5") as found:
        assert sorted(found) == ["frames", "numbers", "times"]
        assert found["frames"].dtype == sensor.dtype
        assert (found["frames"][:] == file.frames).all()
        assert found["times"][:].tolist() == [0.1, 0.25, 1.0]
        assert found["numbers"][:].tolist() == [0, 3, 6]
        facts = dict(found.attrs)
    assert (facts["full"], facts["threshold"]) == (sensor.full, sensor.threshold)
    assert (facts["baseline"] == 5).all()
    assert facts["baseline"].shape == (sensor.rows, sensor.columns)
    assert read_board(facts["board"].encode(), "a.yaml").sensor == sensor
    masked = facts["masked"].tolist() if "masked" in facts else []
    assert masked == [[*cell] for cell in sensor.masked]


def test_a_picture_is_of_the_first_frame_that_something_presses_on(
    tmp_path: Path,
) -> None:
    file = recording([0.0, 0.1, 0.2])
    file.frames[:2] = 5  # the baseline
    titles: list[str] = []
    for number in (None, 0, 2):
        write_picture(tmp_path / "a.svg", file, number)
        found = (tmp_path / "a.svg").read_text("utf-8")
        titles += re.findall('class="strong">(.*?)<', found)
        assert (">0</text>" in found, "reading" in found) == (True, True)
        assert ('class="centre"' in found) == (number != 0)
    assert titles == ["a, frame 2", "a, frame 0", "a, frame 2"]


def test_a_picture_of_a_calibrated_board_shows_its_unit(tmp_path: Path) -> None:
    file = recording([0.0], Sensor(4, 6, 250))
    law = Calibration("kPa", ((100.0, 2.0), (200.0, 6.0)))
    board = structs.replace(file.board, calibration=law)
    write_picture(tmp_path / "a.svg", replace(file, board=board))
    words = re.findall(">([^<>]+)</text>", (tmp_path / "a.svg").read_text("utf-8"))
    assert words[-6:] == ["0", "2", "4", "6", "8", "kPa"]  # 250 reads 8 kPa


def test_pictures_take_the_baseline_of_the_last_tare(tmp_path: Path) -> None:
    board = Board("mat", Sensor(2, 3), Marker("AA 55"))
    cells = np.array([[9, 9, 9], [9, 9, 80]])
    with Recorder(tmp_path / "a.ftr", board) as recorder:
        for number in range(2):
            frame = Frame(cells, float(number), number)
            recorder.write(frame, Counters())
            baseline = Sensor(2, 3, baseline=(9,) * 6)
            recorder.write_rest(baseline, frame, Counters())
    with RecordingFile(tmp_path / "a.ftr") as file:
        for number in range(2):
            write_picture(tmp_path / "a.svg", file, number)
            pressing = (cells - 9 * number)[None]
            wanted = draw_frames(Sensor(2, 3), pressing, [f"a, frame {number}"])
            assert (tmp_path / "a.svg").read_text("utf-8") == wanted.svg
        write_gif(tmp_path / "a.gif", file)
    darkest = [picture.sum(axis=2).min() for picture in gif(tmp_path / "a.gif")[0]]
    assert darkest[0] > darkest[1] == sum(PALETTE[0])


def test_a_gif_has_every_colour_and_the_recorded_times(tmp_path: Path) -> None:
    times = [7.0 + place / 44 for place in range(45)] + [10.0, 10.02]
    file = recording(times)
    write_gif(tmp_path / "a.gif", file)
    pictures, stays = gif(tmp_path / "a.gif")
    assert len(pictures) == 47
    for place in (0, 20, 46):
        assert (pictures[place] == expected(file, place, 64)).all()
    starts = np.cumsum([0.0, *stays[:-1]]) / 1000
    assert_allclose(starts, np.array(times) - 7.0, atol=0.0051)  # hundredths


def test_a_video_has_the_frames_at_their_rate(tmp_path: Path) -> None:
    file = recording([place / 44 for place in range(30)])
    write_mp4(tmp_path / "a.mp4", file)
    pictures, rate = video(tmp_path / "a.mp4")
    assert (len(pictures), rate) == (30, 44.0)
    for place in (0, 17, 29):
        assert pictures[place].shape == (256, 384, 3)
        difference = abs(pictures[place].astype(int) - expected(file, place, 64))
        assert difference.mean() < LOST / 4
        assert difference[32::64, 32::64].max() <= LOST  # where the cells are


def test_a_pause_lasts_as_long_in_a_video(tmp_path: Path) -> None:
    file = recording([*np.arange(10) / 10, *(5.0 + np.arange(10) / 10)])
    write_mp4(tmp_path / "a.mp4", file)
    pictures, rate = video(tmp_path / "a.mp4")
    assert (len(pictures), rate) == (60, 10.0)
    for place, number in ((9, 9), (40, 9), (50, 10), (59, 19)):
        away = abs(pictures[place].astype(int) - expected(file, number, 64)).mean()
        assert away < LOST / 4


@pytest.mark.one_in(3)
@pytest.mark.parametrize("shape", [(1, 1), (1, 256), (5, 24), (256, 256)])
@pytest.mark.parametrize("times", [[3.0], [1.0, 0.5], [0.0, 0.0, 100.0]])
def test_pictures_of_any_size_and_times_are_written(
    tmp_path: Path, shape: tuple[int, int], times: list[float]
) -> None:
    file = recording(times, Sensor(*shape, 65535))
    write_gif(tmp_path / "a.gif", file)
    write_mp4(tmp_path / "a.mp4", file)
    size = gif(tmp_path / "a.gif")[0][0].shape
    pictures, _ = video(tmp_path / "a.mp4")
    assert {one.shape for one in pictures} == {size}
    assert size[:2] == tuple(side * (size[0] // shape[0]) for side in shape)
    assert max(size) <= 512


def test_frames_that_come_too_fast_are_left_out_and_keep_their_times(
    tmp_path: Path,
) -> None:
    file = recording([place / 1000 for place in range(501)])
    write_gif(tmp_path / "a.gif", file)
    write_mp4(tmp_path / "a.mp4", file)
    stays = gif(tmp_path / "a.gif")[1]
    assert (len(stays), sum(stays)) == (26, 520)
    pictures, rate = video(tmp_path / "a.mp4")
    assert (len(pictures), rate) == (31, 60.0)


@pytest.mark.parametrize("suffix", sorted({*WRITERS} - {".ftr"}))
def test_the_same_frames_give_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    contents = []
    for _ in range(2):
        WRITERS[suffix](tmp_path / f"a{suffix}", recording([0.0, 0.1, 0.2]))
        contents.append((tmp_path / f"a{suffix}").read_bytes())
    assert contents[0] == contents[1]


@pytest.mark.parametrize("suffix", [".svg", ".png", ".gif", ".mp4"])
def test_without_a_frame_there_is_no_picture(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    with pytest.raises(WriteError) as caught:
        WRITERS[suffix](path, recording([]))
    assert str(caught.value) == f"{path}: cannot be written: there is no frame"
    assert [*tmp_path.iterdir()] == []


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # imageio leaves a pipe open
def test_an_encoder_that_fails_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/bin/false")
    path = tmp_path / "a.mp4"
    with pytest.raises(WriteError) as caught:
        write_mp4(path, recording([place / 44 for place in range(30)]))
    assert str(caught.value) == f"{path}: cannot be written: ffmpeg failed"
    assert [*tmp_path.iterdir()] == []
    del caught
    gc.collect()


@pytest.mark.parametrize(
    ("suffix", "module", "what", "extra"),
    [
        (".png", "resvg_py", "a PNG", "plots"),
        (".h5", "h5py", "HDF5", "hdf5"),
        (".gif", "PIL", "a GIF", "video"),
        (".mp4", "imageio_ffmpeg", "an MP4", "video"),
    ],
)
def test_a_library_that_is_missing_is_named(
    *,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    suffix: str,
    module: str,
    what: str,
    extra: str,
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as caught:
        WRITERS[suffix](tmp_path / f"a{suffix}", recording([0.0]))
    assert str(caught.value) == f"{what} needs {install_hint(extra)}"
    assert [*tmp_path.iterdir()] == []
