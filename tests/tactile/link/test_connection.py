"""A line gives the frames of a board, through all that may happen to a port."""

from __future__ import annotations

import itertools
import os
import stat
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
from serial_faults import ConnectionFaults, FaultyDevice
from simulated_board import Device, Faults, Pause, blob, encoded

from fuzzytree.errors import MissingExtraError, PortError
from fuzzytree.tactile.boards import (
    Board,
    Marker,
    Port,
    Protocol,
    Request,
    Sentinel,
    Start,
    Text,
)
from fuzzytree.tactile.link import Connection, open_connection, opened, ports, start
from fuzzytree.tactile.sensor import Cells, Frame, Sensor

BOARD = Board("mat", Sensor(8, 6), Marker("AA 55", checksum="crc16"))


def _frames(count: int, board: Board = BOARD) -> list[Cells]:
    return list(itertools.islice(blob(board), count))


def _taken(line: Connection, count: int, timeout_s: float = 120.0) -> list[Frame]:
    """Return so many frames, or those that come before nothing comes for too long."""
    found: list[Frame] = []
    while len(found) < count and (frame := line.take(timeout_s)) is not None:
        found.append(frame)
    return found


def _until(is_so: Callable[[], bool]) -> None:
    """Wait until something is so, for at most two minutes."""
    end = time.monotonic() + 120.0
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.001)


class Terminal:
    """A pseudo-terminal: the board's end, and the name of the host's."""

    def __init__(self) -> None:
        self.end, slave = os.openpty()
        self.name = os.ttyname(slave)
        self._is_plugged = True
        os.close(slave)

    def write(self, content: bytes) -> None:
        assert os.write(self.end, content) == len(content)

    def unplug(self) -> None:
        if self._is_plugged:
            self._is_plugged = False
            os.close(self.end)


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    terminal = Terminal()
    yield terminal
    terminal.unplug()


PROTOCOLS: list[Protocol] = [
    Marker("AA 55"),
    Marker("AA 55", bits=16, checksum="sum8"),
    Sentinel(),
    Request("41", timeout_s=0.2),
    Text(),
]


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda found: type(found).__name__)
def test_the_frames_of_every_family_come_as_they_were_sent(protocol: Protocol) -> None:
    board = Board("mat", Sensor(8, 6, full=254), protocol, banner=1)
    sent = _frames(30, board)
    with (
        Device(board, sent, rate=None) as device,
        open_connection(board, device.port) as line,
    ):
        found = _taken(line, 30)
        assert line.counters.frames == 30
        _until(lambda: line.counters.bytes == device.counts.bytes)
        assert line.state == "open"
    assert [frame.number for frame in found] == list(range(30))
    assert (np.array([frame.cells for frame in found]) == np.array(sent)).all()
    times = [frame.time for frame in found]
    assert times == sorted(times)
    assert times[0] > 0


def test_the_rest_of_a_line_that_began_before_is_no_frame(terminal: Terminal) -> None:
    board = Board("mat", Sensor(2, 2), Text())
    with open_connection(board, terminal.name) as line:
        terminal.write(b"2 2 3 4\n1 2 3 4\n")  # of 12 2 3 4, say
        frame = line.take(120.0)
        assert frame is not None
        assert frame.cells.tolist() == [[1, 2], [3, 4]]
        assert (line.counters.frames, line.counters.skipped) == (1, 8)


def test_a_frame_has_the_time_of_its_last_byte(terminal: Terminal) -> None:
    cells = _frames(1)[0]
    with open_connection(BOARD, terminal.name) as line:
        content = encoded(BOARD, cells, 0)
        terminal.write(content[:-1])
        _until(lambda: line.counters.bytes == len(content) - 1)
        before = time.monotonic()
        terminal.write(content[-1:])
        frame = line.take(120.0)
        after = time.monotonic()
    assert frame is not None
    assert before <= line.opened_at + frame.time <= after


def test_a_slow_reader_gets_the_newest_frames_and_the_count_of_the_others() -> None:
    sent = _frames(40)
    with (
        Device(BOARD, sent, rate=None) as device,
        open_connection(BOARD, device.port, most_waiting=5) as line,
    ):
        _until(lambda: line.counters.frames == 40)
        found = _taken(line, 5)
        assert line.take(0) is None
    assert [frame.number for frame in found] == [35, 36, 37, 38, 39]
    assert line.counters.dropped == 35


def test_frames_can_be_taken_after_the_line_is_closed() -> None:
    with Device(BOARD, _frames(4), rate=None) as device:
        line = open_connection(BOARD, device.port)
        _until(lambda: line.counters.frames == 4)
        line.close()
        line.close()
        assert [frame.number for frame in line] == [0, 1, 2, 3]
        assert line.take() is None


@pytest.mark.heavy
def test_a_line_waits_for_a_plug_that_was_pulled() -> None:
    """What the system had not given yet when the plug was pulled is lost."""
    faults = Faults(unplug=Pause(seconds=0.05, every=10))
    sent = _frames(1000)
    with (
        Device(BOARD, sent, faults) as device,
        open_connection(BOARD, device.port) as line,
    ):
        _until(lambda: line.counters.reconnects == 2)
        before = line.counters.frames
        _until(lambda: line.counters.frames > before)
    found = list(line)
    assert [frame.number for frame in found] == list(range(len(found)))
    rest = iter([cells.tolist() for cells in sent])
    assert all(frame.cells.tolist() in rest for frame in found)  # in their order
    assert line.counters.frames == line.counters.dropped + len(found)


def test_a_line_ends_with_the_port_if_reported(terminal: Terminal) -> None:
    with open_connection(BOARD, terminal.name, wait=False) as line:
        terminal.write(encoded(BOARD, _frames(1)[0], 0))
        assert line.take(120.0) is not None
        terminal.unplug()
        with pytest.raises(PortError) as caught:
            line.take(120.0)
        assert line.take(120.0) is None
        assert line.state == "ended"
    assert str(caught.value) == f"{terminal.name}: went away after 1 frames"


def test_a_line_that_waits_says_that_the_port_is_away(
    terminal: Terminal,
) -> None:
    with open_connection(BOARD, terminal.name) as line:
        terminal.unplug()
        _until(lambda: line.state == "away")
        assert line.take(0.01) is None


def test_silence_is_counted_once_and_ends_with_the_next_frame(
    terminal: Terminal,
) -> None:
    content = encoded(BOARD, _frames(1)[0], 0)
    with open_connection(BOARD, terminal.name) as line:
        terminal.write(content)
        assert line.take(120.0) is not None
        _until(lambda: line.state == "silent")
        assert line.take(0.05) is None
        assert line.counters.stalls == 1
        terminal.write(content)
        assert line.take(120.0) is not None
        assert line.state == "open"
        assert line.counters.stalls == 1


def test_a_board_that_does_not_answer_is_requested_again(
    terminal: Terminal,
) -> None:
    board = Board("mat", Sensor(2, 2), Request("3F 0A", timeout_s=0.03))
    with open_connection(board, terminal.name) as line:
        assert os.read(terminal.end, 9) == b"?\n"
        terminal.write(b"\1\2\3")  # one byte is missing
        assert os.read(terminal.end, 9) == b"?\n"
        terminal.write(b"\4\5\6\7")
        frame = line.take(120.0)
    assert frame is not None
    assert frame.cells.tolist() == [[4, 5], [6, 7]]
    assert line.counters.damaged == 1


def test_bytes_that_are_no_frames_are_reported_and_the_line_goes_on(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fuzzytree.tactile.link.watching.PATIENCE_S", 0.2)
    other = Board("mat", Sensor(4, 6), Marker("AA 55", checksum="crc16"))
    cells = np.full((4, 6), 7)
    with open_connection(BOARD, terminal.name) as line:
        stop = threading.Event()

        def talk() -> None:
            while not stop.wait(0.005):
                terminal.write(encoded(other, cells, 0))

        thread = threading.Thread(target=talk)
        thread.start()
        with pytest.raises(PortError) as caught:
            line.take(120.0)
        stop.set()
        thread.join()
        for cells in _frames(3):
            terminal.write(encoded(BOARD, cells, 0))
        assert line.take(120.0) is not None
    text = str(caught.value)
    assert text.startswith(f"{terminal.name}: for ")
    assert " s bytes came but no frame of 'mat': the marker AA 55 came " in text
    assert text.endswith("mostly 28 bytes apart, which is 4 x 6 and not 8 x 6")


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("/dev/null", "/dev/null: is not a serial port"),
        ("{folder}", "{folder}: is not a serial port"),
        ("{folder}/file", "{folder}/file: is not a serial port"),
        (
            "socket://localhost:7",
            "socket://localhost:7: a port is a device, such as /dev/ttyUSB0 or COM3, "
            "and no address",
        ),
        ("a\0b", "'a\\x00b' cannot be opened: embedded null byte"),
    ],
)
def test_what_is_no_port_is_one_sentence(
    tmp_path: Path, port: str, message: str
) -> None:
    (tmp_path / "file").write_text("no port")
    with pytest.raises(PortError) as caught:
        open_connection(BOARD, port.format(folder=tmp_path))
    assert str(caught.value) == message.format(folder=tmp_path)


def test_a_port_that_is_not_there_names_those_that_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    there = ", ".join(port.device for port in ports()) or "none"
    with pytest.raises(PortError) as caught:
        open_connection(BOARD, "/dev/ttyUSB77")
    assert str(caught.value) == f"there is no port '/dev/ttyUSB77'; there is {there}"


def test_a_port_is_opened_once_only(terminal: Terminal) -> None:
    with open_connection(BOARD, terminal.name), pytest.raises(PortError) as caught:
        open_connection(BOARD, terminal.name)
    assert str(caught.value) == f"{terminal.name}: another program has it open"


def test_a_port_that_is_not_allowed_names_its_group(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    import grp

    before = stat.S_IMODE(Path(terminal.name).stat().st_mode)
    Path(terminal.name).chmod(0)
    is_root = os.geteuid() == 0
    monkeypatch.setenv("USER", "ada")
    if is_root:
        os.seteuid(65534)
    try:
        with pytest.raises(PortError) as caught:
            open_connection(BOARD, terminal.name)
    finally:
        if is_root:
            os.seteuid(0)
        Path(terminal.name).chmod(before)
    group = grp.getgrgid(Path(terminal.name).stat().st_gid).gr_name
    assert str(caught.value) == (
        f"{terminal.name}: you may not open it; it belongs to the group {group!r}: "
        f"`sudo usermod -aG {group} ada`, then log in again"
    )


def test_a_line_without_its_library_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("serial", "serial.tools"):
        monkeypatch.setitem(sys.modules, name, None)
    for call in (ports, lambda: open_connection(BOARD, "/dev/ttyS0")):
        with pytest.raises(MissingExtraError) as caught:
            call()
        assert str(caught.value) == (
            "reading a serial port needs pyserial: pip install 'pyserial>=3.5'"
        )


def test_at_least_one_frame_waits() -> None:
    with pytest.raises(ValueError, match="at least 1 frame waits, not 0"):
        open_connection(BOARD, "/dev/null", most_waiting=0)


def test_the_settings_of_the_port_are_those_of_the_board(terminal: Terminal) -> None:
    """A pseudo-terminal keeps no parity, so pyserial is asked for that."""
    port = Port(19200, data_bits=7, parity="even", stop_bits=2)
    board = Board("mat", Sensor(2, 2), Text(), port=port)
    with opened(board, terminal.name) as serial:
        flags = termios.tcgetattr(terminal.end)
        assert flags[4] == flags[5] == termios.B19200
        assert flags[2] & termios.CSTOPB
        assert (serial.bytesize, serial.parity, serial.stopbits) == (7, "E", 2)


def test_the_first_frames_of_a_line_are_the_baseline() -> None:
    board = msgspec.structs.replace(BOARD, start=Start(frames=5))
    cells = np.arange(48).reshape(8, 6)
    with (
        Device(board, itertools.repeat(cells, 9), rate=None) as device,
        open_connection(board, device.port) as line,
    ):
        found, remarks = start(board, line)
        frame = line.take(120.0)
    assert found.sensor.baseline == tuple(range(48))
    assert remarks == []
    assert frame is not None
    assert frame.number == 5


def test_a_board_can_do_without_a_baseline() -> None:
    board = msgspec.structs.replace(BOARD, start=Start(frames=0))
    assert start(board, ()).board == board


def test_a_line_that_ends_too_early_has_no_baseline() -> None:
    frames = [Frame(np.zeros((8, 6), int), 0.0, 0)]
    with pytest.raises(PortError) as caught:
        start(BOARD, frames)
    text = "mat: the baseline needs 30 frames, and only 1 came"
    assert str(caught.value) == text


def test_what_fails_within_the_line_is_raised_where_frames_are_taken(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def feed(_decoder: object, _data: bytes) -> list[Cells]:
        raise RuntimeError("a decoder failed")

    monkeypatch.setattr("fuzzytree.tactile.link.decoder.Decoder.feed", feed)
    with open_connection(BOARD, terminal.name) as line:
        terminal.write(b"any")
        with pytest.raises(RuntimeError, match="a decoder failed"):
            line.take(120.0)
        assert line.take(120.0) is None


@pytest.mark.heavy
@pytest.mark.parametrize(
    "protocol",
    [Marker("AA 55", checksum="crc16"), Request("41", checksum="crc16", timeout_s=0.1)],
    ids=lambda found: type(found).__name__,
)
def test_no_frame_is_made_up_and_none_is_lost_uncounted(protocol: Protocol) -> None:
    board = Board("mat", Sensor(8, 6), protocol)
    faults = ConnectionFaults(
        flip=2e-5,
        lose=2e-5,
        noise=0.01,
        unplug=Pause(seconds=0.05, every=400),
        stall=Pause(seconds=0.5, every=900),
    )
    sent = _frames(2000, board)
    known = {str(cells.tolist()) for cells in sent}
    found: list[Frame] = []
    with (
        FaultyDevice(board, sent, faults, rate=20.0, seed=3) as device,
        open_connection(board, device.port, most_waiting=50) as line,
    ):
        while not device.over.is_set() and line.state != "ended":
            found += _taken(line, 10, 0.1)
        counters = line.counters
        _until(lambda: line.counters.reconnects == device.counts.unplugs)
    found += list(line)
    assert all(str(frame.cells.tolist()) in known for frame in found)
    numbers = [frame.number for frame in found]
    assert numbers == sorted(set(numbers))
    assert len(found) + line.counters.dropped == line.counters.frames
    assert counters.stalls >= device.counts.stalls
    assert device.counts.unplugs >= 4
