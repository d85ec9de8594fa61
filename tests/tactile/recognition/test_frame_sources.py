"""A line as a source: what it says while no frames come, and that it goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from simulated_board import Wire, encoded

import fuzzytree as ft
from fuzzytree.errors import WriteError
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link import Connection, open_connection
from fuzzytree.tactile.link.recording import FrameRecord, Recorder, read_recording
from fuzzytree.tactile.presses import open_frames
from fuzzytree.tactile.recognition.frame_sources import Recorded, Replayed
from fuzzytree.tactile.recognition.live import Live
from fuzzytree.tactile.sensor import Counters, Frame, Sensor
from tests.tactile.replays import first_label, replayed

BOARD = Board("mat", Sensor(4, 4), Marker("AA 55", checksum="crc16"))
FRAME = encoded(BOARD, np.arange(16).reshape(4, 4), 0)


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[Wire]:
    """Return the board's end of a line, to send bytes by hand."""
    found = Wire(BOARD.port, tmp_path / "board", threading.Event(), rate=None)
    found.plug_in()
    yield found
    found.plug_out()


@pytest.fixture
def source(wire: Wire, tmp_path: Path) -> Iterator[Connection]:
    found = open_connection(BOARD, str(tmp_path / "board"))
    yield found
    found.close()


def until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + 120.0
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_line_says_that_it_is_silent_away_and_back(
    wire: Wire, source: Connection, tmp_path: Path
) -> None:
    frames = iter(source)
    wire.send(FRAME * 2)
    assert next(frames).number == 0
    assert source.trouble == ""
    until(lambda: source.trouble == "the board is silent")
    wire.plug_out()
    gone = f"{tmp_path / 'board'} went away; waiting until it is back"
    until(lambda: source.trouble == gone)
    wire.plug_in()
    until(lambda: wire.is_open)
    wire.send(FRAME * 2)
    assert next(frames).number == 1
    assert next(frames).number == 2
    assert source.counters.reconnects == 1
    assert source.trouble == ""


def test_a_line_that_is_closed_gives_no_more_frames(
    wire: Wire, source: Connection, tmp_path: Path
) -> None:
    source.close()
    assert list(source) == []
    assert source.trouble == f"{tmp_path / 'board'} gives no more frames"


def test_the_time_of_a_line_is_that_of_its_frames(
    wire: Wire, source: Connection
) -> None:
    wire.send(FRAME)
    frame = next(iter(source))
    assert 0.0 <= frame.time <= source.now() < frame.time + 20.0


@pytest.mark.heavy
def test_bytes_that_are_no_frames_end_nothing_once_there_were_frames(
    wire: Wire, source: Connection
) -> None:
    seen: list[int] = []

    def read() -> None:
        seen.extend(frame.number for frame in source)

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    wire.send(FRAME * 3)
    until(lambda: len(seen) == 3)

    def is_told() -> bool:
        wire.send(bytes(range(1, 40)))
        return "no frame of 'mat'" in source.trouble

    until(is_told)
    wire.send(FRAME * 3)
    until(lambda: len(seen) >= 5)
    assert "no frame of" not in source.trouble
    source.close()
    reader.join(20.0)
    assert not reader.is_alive()


def records(count: int) -> Iterator[FrameRecord]:
    """Yield frames that come at 1,000 a second."""
    for number in range(count):
        cells = np.full((4, 4), number % 256, np.uint8)
        yield FrameRecord(Frame(cells, number / 1000, number), Counters(frames=number))


def test_a_recording_keeps_every_frame_however_slow_its_reader_is(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.ftr"
    recorded = Recorded(replayed(records(2000), speed=0.0), Recorder(path, BOARD), 4)
    until(lambda: recorded.written == 2000)
    recorded.close()
    assert [frame.number for frame in recorded] == [1996, 1997, 1998, 1999]
    assert recorded.counters.dropped == 1996
    found = read_recording(path)
    assert found.numbers.tolist() == [*range(2000)]
    assert found.counters.dropped == 0


def test_a_full_disk_ends_the_recording_and_the_frames_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = Recorder.write

    def full(self: Recorder, frame: Frame, counters: Counters) -> None:
        if frame.number == 3:
            raise WriteError("a.ftr: cannot be written: no space left on device")
        honest(self, frame, counters)

    monkeypatch.setattr(Recorder, "write", full)
    source = replayed(records(9), speed=0.0)
    recorded = Recorded(source, Recorder(tmp_path / "a.ftr", BOARD))
    assert [frame.number for frame in recorded] == [*range(9)]
    assert recorded.trouble == (
        "the recording ended: a.ftr: cannot be written: no space left on device"
    )
    recorded.close()
    assert recorded.written == 3
    assert len(read_recording(tmp_path / "a.ftr").frames) == 3


def test_a_tare_and_a_hot_cell_are_in_the_recording_and_hold_when_it_is_played(
    tmp_path: Path,
) -> None:
    path, areas = tmp_path / "a.ftr", np.array([[4.0], [5.0], [16.0], [15.0]])
    tree = ft.learn(ft.table(areas, columns=["area"]), target=["s", "s", "l", "l"])
    cells = np.zeros((60, 4, 4), np.int64)
    cells[:, :2, :2] = 90  # lies there at the beginning, and is tared away
    cells[12:, 3, 3] = 60  # hot from there on
    coming = (
        FrameRecord(Frame(one, 0.1 * k, k), Counters(frames=k + 1))
        for k, one in enumerate(cells)
    )
    recorded = Recorded(replayed(coming, 0.0), Recorder(path, BOARD))
    live = Live(tree, BOARD.sensor, recorded, "x")
    live.tare()
    assert len(list(live.answers())) == 60
    recorded.close()
    with open_frames(path) as file:
        played = Live(tree, file.board.sensor, Replayed(file, 0.0), "again")
        answers = list(played.answers())
    assert [first_label(one) for one in answers[:9]] == ["s"] * 9
    assert {first_label(one) for one in answers[10:]} == {""}
    assert played.rest.sensor.masked == ((3, 3),)
    found = [event.kind for one in answers for event in one.events]
    assert found == ["hot"]  # it is found again, and the tare is only recorded
