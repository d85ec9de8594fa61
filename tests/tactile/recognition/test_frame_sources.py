"""A line as a source: what it says while no frames come, and that it goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link import open_connection
from fuzzytree.tactile.recognition.frame_sources import FromPort
from fuzzytree.tactile.sensor import Sensor
from fuzzytree.tactile.simulation.device import Wire
from fuzzytree.tactile.simulation.encoding import encoded

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
def source(wire: Wire, tmp_path: Path) -> Iterator[FromPort]:
    found = FromPort(open_connection(BOARD, str(tmp_path / "board")))
    yield found
    found.close()


def until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_line_says_that_it_is_silent_away_and_back(
    wire: Wire, source: FromPort, tmp_path: Path
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
    wire: Wire, source: FromPort, tmp_path: Path
) -> None:
    source.close()
    assert list(source) == []
    assert source.trouble == f"{tmp_path / 'board'} gives no more frames"


def test_the_time_of_a_line_is_that_of_its_frames(wire: Wire, source: FromPort) -> None:
    wire.send(FRAME)
    frame = next(iter(source))
    assert 0.0 <= frame.time <= source.now() < frame.time + 20.0


@pytest.mark.heavy
def test_bytes_that_are_no_frames_end_nothing_once_there_were_frames(
    wire: Wire, source: FromPort
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
