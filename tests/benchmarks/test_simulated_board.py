"""The device, through a real pseudo-terminal, and pyserial as its host."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import serial
from msgspec.structs import replace
from serial_faults import ConnectionFaults, FaultyCounts, FaultyDevice, Receiver
from simulated_board import (
    BoardCounts,
    Device,
    Faults,
    Pause,
    banner,
    blob,
    bounds,
    encoded,
    main,
)

from fuzzytree.errors import TableError, WriteError
from fuzzytree.tactile.board_file import board_text
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
from fuzzytree.tactile.link import open_connection
from fuzzytree.tactile.link.recording import Recorder
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor

ROOT = Path(__file__).parents[2]
MAT = Board("mat", Sensor(8, 8), Marker("AA 55"), banner=1)


def _frames(board: Board, count: int) -> list[Cells]:
    return [*itertools.islice(blob(board), count)]


def _sent(board: Board, frames: list[Cells]) -> bytes:
    parts = [encoded(board, cells, number) for number, cells in enumerate(frames)]
    return banner(board) + b"".join(parts)


def _host(device: Device, baud: int = 115200) -> serial.Serial:
    while not Path(device.port).exists():
        time.sleep(0.005)
    return serial.Serial(device.port, baud, timeout=120.0, exclusive=True)


def _all(device: Device, host: serial.Serial) -> bytes:
    """Return what comes until the device has nothing left."""
    host.timeout = 0.01
    found, is_over = b"", False
    while not is_over:
        is_over = device.over.is_set()  # first: what follows is all there is
        while data := host.read(4096):
            found += data
    return found


@pytest.mark.parametrize(
    "protocol",
    [Marker("AA 55", checksum="crc16"), Sentinel(), Text(frame="block")],
    ids=lambda protocol: type(protocol).__name__,
)
def test_a_board_sends_its_banner_and_its_frames(protocol: Protocol) -> None:
    board = Board("mat", Sensor(8, 6), protocol, order="columns", banner=2)
    frames = _frames(board, 20)
    expected = _sent(board, frames)
    with Device(board, frames, rate=None) as device, _host(device) as host:
        assert host.read(len(expected)) == expected
        assert device.over.wait(5.0)
        assert device.counts == BoardCounts(frames=20, bytes=len(expected), opens=1)
    assert not Path(device.port).exists()


def test_a_request_board_answers_as_often_as_it_is_requested() -> None:
    board = Board("mat", Sensor(4, 4), Request("41 42", checksum="xor8"))
    frames = _frames(board, 9)
    with Device(board, frames, rate=None) as device, _host(device) as host:
        assert host.in_waiting == 0
        got = b""
        for question, answers in ((b"AB", 1), (b"AABxAB", 2), (b"A", 0), (b"B", 1)):
            host.write(question)
            got += host.read(17 * answers)
        assert got == _sent(board, frames[:4])
    assert (device.counts.asks, device.counts.frames) == (4, 4)


def test_a_line_takes_its_time() -> None:
    frames = _frames(MAT, 10)
    size = len(_sent(MAT, frames))
    begin = time.monotonic()
    with Device(MAT, frames) as device, _host(device) as host:
        assert len(host.read(size)) == size
    assert time.monotonic() - begin >= size * 10 / 115200


def test_the_bytes_of_a_seed_are_the_same_again() -> None:
    faults = ConnectionFaults(flip=0.01, lose=0.01, double=0.01, noise=0.5, marker=0.5)
    found: list[tuple[bytes, FaultyCounts]] = []
    for seed in (1, 1, 2):
        frames = _frames(MAT, 100)
        device = FaultyDevice(MAT, frames, faults, None, seed=seed)
        with device, _host(device) as host:
            found.append((_all(device, host), device.counts))
    assert found[0] == found[1] != found[2]
    data, truth = found[0]
    assert 30 < truth.markers < 70
    assert 0 < truth.touched <= truth.frames == 100
    made = 100 * 66 + len(banner(MAT))
    assert len(data) == truth.bytes
    assert truth.bytes == made + truth.noise - truth.lost + truth.doubled


def test_a_pulled_plug_cuts_a_frame_and_the_port_comes_back_under_its_name() -> None:
    faults = Faults(unplug=Pause(0.1, every=3))
    device = Device(MAT, _frames(MAT, 9), faults, None)
    sizes: list[int] = []
    with device:
        for _ in range(2):
            with _host(device) as host:
                sizes.append(_until_gone(host))
        assert device.counts.opens == 2
    # The kernel throws what was not yet read away with the port.
    assert max(sizes) <= len(banner(MAT)) + 2 * 66 + 33
    assert (device.counts.unplugs, device.counts.touched) == (2, 2)


def _until_gone(host: serial.Serial) -> int:
    size = 0
    with contextlib.suppress(serial.SerialException):
        while True:
            size += len(host.read(64))
    return size


@pytest.mark.parametrize("baud", [57600, 250000, 123456])
def test_a_host_of_another_speed_hears_what_a_receiver_would(baud: int) -> None:
    frames = _frames(MAT, 5)
    device = FaultyDevice(MAT, frames, rate=None)
    with device, _host(device, baud) as host:
        got = _all(device, host)
    receiver = Receiver(Port(), baud)
    assert got == receiver.heard(_sent(MAT, frames))
    assert device.counts.garbled == device.counts.bytes > 0
    assert device.counts.framing_errors == receiver.framing_errors > 0


def test_a_board_of_another_speed_than_it_should_have_is_garbled() -> None:
    frames = _frames(MAT, 5)
    device = FaultyDevice(MAT, frames, ConnectionFaults(baud=9600), None)
    with device, _host(device) as host:
        assert _all(device, host) == Receiver(Port(baud=9600), 115200).heard(
            _sent(MAT, frames)
        )


def test_what_a_host_does_not_read_in_time_is_lost_and_counted() -> None:
    with Device(MAT, _frames(MAT, 1000), rate=1000.0) as device, _host(device) as host:
        assert device.over.wait(10.0)
        got = _all(device, host)
    truth = device.counts
    assert truth.overrun > 0
    assert len(got) + truth.overrun == truth.bytes == len(banner(MAT)) + 1000 * 66


def test_a_stall_is_counted_and_loses_nothing() -> None:
    frames = _frames(MAT, 6)
    faults = Faults(stall=Pause(0.02, every=2))
    with Device(MAT, frames, faults, None) as device, _host(device) as host:
        assert _all(device, host) == _sent(MAT, frames)
    assert device.counts.stalls == 3


def test_a_second_host_finds_the_board_as_after_its_start() -> None:
    with Device(MAT, blob(MAT)) as device:
        for opens in (1, 2):
            with _host(device) as host:
                assert host.read(len(banner(MAT))) == banner(MAT)
            while device.counts.closes < opens:
                time.sleep(0.001)
        assert device.counts.opens == 2


def test_a_frame_that_cannot_be_sent_is_reported_when_the_device_closes() -> None:
    def frames() -> Iterator[Cells]:
        yield np.zeros((2, 2), np.int64)

    device = Device(MAT, frames())
    with _host(device):
        assert device.over.wait(5.0)
    with pytest.raises(TableError) as caught:
        device.close()
    assert str(caught.value) == (
        "a frame of 2 x 2 cells does not fit a sensor of 8 x 8"
    )


def test_a_port_is_made_over_a_dead_link_only(tmp_path: Path) -> None:
    link = tmp_path / "board"
    link.symlink_to(tmp_path / "gone")
    with Device(MAT, [], link=link) as device:
        assert device.port == str(link)
        with pytest.raises(WriteError) as caught:
            Device(MAT, [], link=link)
        assert str(caught.value) == (
            f"{link}: cannot be made a port: "
            f"it leads to {link.resolve()}, which is there"
        )
    link.write_text("mine", "utf-8")
    with pytest.raises(WriteError) as caught:
        Device(MAT, [], link=link)
    assert str(caught.value) == (
        f"{link}: cannot be made a port: something else is there"
    )
    with pytest.raises(WriteError) as caught:
        Device(MAT, [], link=tmp_path / "no" / "board")
    assert str(caught.value) == (
        f"{tmp_path}/no/board: cannot be made a port: no such file or directory"
    )
    assert link.read_text("utf-8") == "mine"


def test_what_took_the_place_of_the_link_is_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "board"
    with Device(MAT, [], link=link):
        link.unlink()
        link.write_text("mine", "utf-8")
    assert link.read_text("utf-8") == "mine"


def test_a_fault_that_the_board_cannot_have_is_refused() -> None:
    board = Board("mat", Sensor(4, 4), Text())
    with pytest.raises(ValueError, match="has no marker that cells could hold"):
        FaultyDevice(board, [], ConnectionFaults(marker=0.1))


@pytest.mark.parametrize(
    ("protocol", "pressure", "expected"),
    [
        (Text(), "rises", (0, 200)),
        (Sentinel(), "rises", (0, 200)),
        (Sentinel(end=99), "rises", (0, 98)),
        (Sentinel(end=99, zero=50), "falls", (151, 200)),
    ],
)
def test_a_blob_holds_only_what_the_board_can_send(
    protocol: Protocol, pressure: str, expected: tuple[int, int]
) -> None:
    sensor = Sensor(6, 9, full=200)
    board = Board("mat", sensor, protocol, pressure=pressure)  # type: ignore[arg-type] # the words are those of the type
    assert bounds(board) == expected
    frames = np.array(_frames(board, 50))
    assert (frames.min(), frames.max()) == expected
    assert len({cells.tobytes() for cells in frames}) == 50


def test_the_page_names_every_fault_and_its_example_runs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = (ROOT / "docs" / "how-to" / "device.md").read_text("utf-8")
    for name in Faults.__struct_fields__:
        assert f"| `--{name} " in page
    (script,) = re.findall("```python\n(.*?)```", page, re.DOTALL)
    exec(script, {})
    assert capsys.readouterr().out == "200 True\n"


BOARD = Board("mat", Sensor(4, 6, full=200), Marker("AA 55"), start=Start(frames=3))


@contextlib.contextmanager
def _running(*words: str | Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the command line; give the process and the port that it prints."""
    command = [sys.executable, ROOT / "benchmarks" / "simulated_board.py", *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        yield process, process.stdout.readline().strip()


def _taken(board: Board, port: str, count: int) -> list[Cells]:
    with open_connection(board, port) as line:
        frames = [line.take(120.0) for _ in range(count)]
    return [frame.cells for frame in frames if frame is not None]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_objects_are_fitted_to_the_board_until_a_signal(
    number: int, tmp_path: Path
) -> None:
    (tmp_path / "mat.yaml").write_text(board_text(BOARD), "utf-8")
    words = (tmp_path / "mat.yaml", "--object", "hand-0", "--link", tmp_path / "port")
    with _running(*words) as (process, port):
        assert port == str(tmp_path / "port")
        frames = _taken(BOARD, port, 20)
        process.send_signal(number)
        _, err = process.communicate(timeout=120.0)
    assert [int(cells.max()) for cells in frames[:3]] == [0, 0, 0]
    assert frames[-1].shape == (4, 6)
    assert 20 < max(int(cells.max()) for cells in frames) <= 200
    assert process.returncode == 0
    assert "opens 1" in err
    assert not os.path.lexists(port)


def test_a_recording_goes_through_a_port_again(tmp_path: Path) -> None:
    board = replace(BOARD, sensor=replace(BOARD.sensor, baseline=(7,) * 24))
    with Recorder(tmp_path / "a.ftr", board) as recorder:
        for number in range(6):
            cells = np.full((4, 6), 10 * number)
            recorder.write(Frame(cells, 0.5 * number, number), Counters())
    begin = time.monotonic()
    with _running("--recording", tmp_path / "a.ftr", "--speed", "5") as (process, port):
        frames = _taken(board, port, 3 + 6)
        _, err = process.communicate(timeout=120.0)
    assert time.monotonic() - begin >= 2.5 / 5
    assert [int(cells[0, 0]) for cells in frames] == [7, 7, 7, 0, 10, 20, 30, 40, 50]
    assert (process.returncode, err.split(",")[0]) == (0, "frames 9")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "expected either BOARD.yaml or --recording FILE"),
        (["a.yaml", "--recording", "a.ftr"], "expected either BOARD.yaml or "),
        (["a.yaml", "--object", "foot"], "invalid choice: 'foot' (choose from "),
        (["none.yaml"], "none.yaml: cannot be read: no such file or directory"),
    ],
)
def test_what_cannot_be_simulated_is_one_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert sentence in capsys.readouterr().err + str(caught.value)
