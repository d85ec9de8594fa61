"""Ports, recordings and what is in them, by the command line."""

from __future__ import annotations

import dataclasses
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from simulated_board import Device, Faults, Pause, blob, encoded

from fuzzytree.cli.console import say
from fuzzytree.tactile.board_file import board_text, load_board
from fuzzytree.tactile.boards import Board, Marker, Start
from fuzzytree.tactile.link import SerialPort, ports
from fuzzytree.tactile.link import recording as records
from fuzzytree.tactile.link.recording import Recorder, read_recording
from fuzzytree.tactile.presses import read_frames
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor

Call = Callable[..., tuple[int, str, str]]

BOARD = Board(
    "mat",
    Sensor(4, 5, threshold=3),
    Marker("AA 55", checksum="sum8"),
    start=Start(frames=3),
)


def _cells(value: int) -> Cells:
    return np.arange(20).reshape(4, 5) + value


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder, made the current one, with a board and a recording."""
    monkeypatch.chdir(tmp_path)
    Path("mat.yaml").write_text(board_text(BOARD))
    with Recorder("a.ftr", BOARD, started_ns=1_600_000_000_123_456_789) as recorder:
        for number in (4, 5, 6, 9, 10, 15):
            frame = Frame(_cells(number), number / 4, number)
            recorder.write(frame, Counters(bytes=23 * number, frames=number + 1))
    return tmp_path


@pytest.fixture
def resting() -> Iterator[Device]:
    """Return a board on which nothing moves."""
    with Device(BOARD, itertools.repeat(_cells(9)), rate=None) as device:
        yield device


def test_ports_are_listed(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    found = [
        SerialPort("/dev/ttyACM0", "Arduino Uno", "USB VID:PID=2341:0043"),
        SerialPort("/dev/ttyS0", "", ""),
    ]
    monkeypatch.setattr("fuzzytree.tactile.link.ports", lambda: found)
    assert call("tactile", "ports") == (
        0,
        "/dev/ttyACM0  Arduino Uno  USB VID:PID=2341:0043\n/dev/ttyS0\n",
        "",
    )
    code, out, _ = call("tactile", "ports", "--json")
    assert (code, json.loads(out)[0]) == (
        0,
        {
            "device": "/dev/ttyACM0",
            "description": "Arduino Uno",
            "ids": "USB VID:PID=2341:0043",
        },
    )


def test_a_computer_without_ports_says_so(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fuzzytree.tactile.link.ports", list)
    assert call("tactile", "ports") == (0, "", "there is no serial port\n")
    assert call("tactile", "ports", "--json")[1] == "[]\n"


def test_so_many_frames_are_recorded(call: Call, place: Path, resting: Device) -> None:
    code, out, err = call(
        "tactile", "record", "mat.yaml", resting.port, "-o", "b.ftr", "--frames", "7"
    )
    found = read_recording("b.ftr")
    assert (code, out) == (0, "")
    assert len(found.numbers) == 7
    # A busy computer drops some before the first, since the board never rests.
    assert 3 <= found.numbers[0] <= 3 + found.counters.dropped
    assert (np.diff(found.numbers) > 0).all()
    assert (found.frames == _cells(9)).all()
    assert found.board.sensor.baseline == tuple(range(9, 29))
    lines = err.splitlines()
    assert lines[0] == f"opened   {resting.port} mat, 115200 baud"
    assert lines[1] == "measured baseline 9 to 28 from 3 frames"
    assert lines[2].startswith("wrote    b.ftr 7 frames, 0.")
    assert lines[3].startswith("counted  bytes ")
    assert lines[4].startswith("at risk  ")
    assert lines[5:] == ["next     fuzzytree tactile replay b.ftr"]


def test_so_many_seconds_are_recorded(call: Call, place: Path, resting: Device) -> None:
    words = ("mat.yaml", resting.port, "-o", "b.ftr", "--seconds", "1.5", "--json")
    code, out, err = call("tactile", "record", *words, "--quiet")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert found["end"] == "seconds"
    assert found["seconds"] < 1.5
    recording = read_recording("b.ftr")
    assert found["frames"] == len(recording.frames) > 0
    assert recording.times[-1] - recording.times[0] == pytest.approx(found["seconds"])
    assert found["counters"].keys() == dataclasses.asdict(Counters()).keys()
    assert (found["file"], found["board"], found["masked"]) == ("b.ftr", "mat", [])
    assert found["remarks"] == []
    assert found["most_at_risk"] >= 1


def test_a_file_that_is_there_is_replaced_only_by_force(
    call: Call, place: Path, resting: Device
) -> None:
    words = ("tactile", "record", "mat.yaml", resting.port, "-o", "a.ftr")
    before = Path("a.ftr").read_bytes()
    code, _, err = call(*words, "--frames", "1")
    assert (code, err) == (2, "a.ftr: is there already; --force replaces it\n")
    assert Path("a.ftr").read_bytes() == before
    assert call(*words, "--frames", "1", "--force")[0] == 0
    assert len(read_recording("a.ftr").frames) == 1


def test_a_recording_is_a_file(call: Call, place: Path) -> None:
    code, _, err = call("tactile", "record", "mat.yaml", "/dev/nix", "-o", "-")
    message = "a recording is a file, and not standard output"
    assert (code, err.splitlines()[0]) == (2, message)


def test_a_port_that_is_not_there_is_one_sentence(call: Call, place: Path) -> None:
    there = ", ".join(port.device for port in ports()) or "none"
    code, _, err = call("tactile", "record", "mat.yaml", "/dev/nix", "-o", "b.ftr")
    assert (code, err) == (2, f"there is no port '/dev/nix'; there is {there}\n")
    assert not Path("b.ftr").exists()


def test_a_port_that_goes_away_for_good_ends_the_recording(
    call: Call, place: Path
) -> None:
    faults = Faults(unplug=Pause(seconds=60.0, every=100))
    with Device(BOARD, blob(BOARD), faults) as device:
        code, out, err = call(
            "tactile",
            "record",
            *("mat.yaml", device.port, "-o", "b.ftr", "--no-wait", "--json"),
        )
    assert code == 1
    found = json.loads(out)
    assert found["end"] == "port"
    # What the system had not given yet when the plug was pulled is lost.
    assert 1 <= found["frames"] == len(read_recording("b.ftr").frames) < 97
    assert f"{device.port}: went away after {found['counters']['frames']} frames" in err


def test_a_port_that_comes_back_goes_on_in_the_same_recording(
    call: Call, place: Path
) -> None:
    faults = Faults(unplug=Pause(seconds=0.05, every=100))
    with Device(BOARD, blob(BOARD), faults) as device:
        code, out, err = call(
            "tactile",
            "record",
            *("mat.yaml", device.port, "-o", "b.ftr", "--frames", "110", "--json"),
        )
    assert code == 0
    assert json.loads(out)["counters"]["reconnects"] >= 1
    assert f"{device.port}: went away, and is back\n" in err
    assert len(read_recording("b.ftr").frames) == 110


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_ends_a_recording_well(
    call: Call, place: Path, resting: Device, number: signal.Signals
) -> None:
    before = signal.getsignal(number)

    def interrupt() -> None:
        while not Path("b.ftr").exists():
            time.sleep(0.001)
        os.kill(os.getpid(), number)

    thread = threading.Thread(target=interrupt)
    thread.start()
    code, out, _ = call(
        "tactile", "record", "mat.yaml", resting.port, "-o", "b.ftr", "--json"
    )
    thread.join()
    assert signal.getsignal(number) == before
    found = json.loads(out)
    assert (code, found["end"]) == (0, "told")
    assert found["frames"] == len(read_recording("b.ftr").frames)


def test_what_is_in_a_recording_is_reported(call: Call, place: Path) -> None:
    assert call("tactile", "replay", "a.ftr") == (
        0,
        "a.ftr: mat, 4 x 5 cells, full 255, marker, 115200 baud\n"
        "frames    6 frames in 2.8 s, 1.8 a second; "
        "begun 2020-09-13T12:26:40.123+00:00\n"
        "missing   6 frames in 2 gaps\n"
        "pause     1.250 s at most between two frames\n"
        "damaged   0 records, and 0 bytes of one that is cut off at the end\n"
        "counted   bytes 345, frames 16, damaged 0, skipped 0, resyncs 0, dropped 0, "
        "stalls 0, reconnects 0, doubtful 0\n",
        "",
    )


def test_damage_baseline_masks_and_dead_cells_are_reported(
    call: Call, place: Path
) -> None:
    sensor = Sensor(4, 5, baseline=tuple(range(20)), masked=((0, 1), (3, 4)))
    board = Board("mat", sensor, Marker("AA 55"))
    with Recorder("b.ftr", board, started_ns=1_000) as recorder:
        for number in range(5):
            cells = _cells(number)
            cells[2, 2] = 0
            recorder.write(Frame(cells, number / 4, number), Counters())
    content = bytearray(Path("b.ftr").read_bytes())
    content[-300] ^= 1
    Path("b.ftr").write_bytes(content[:-7])
    code, out, _ = call("tactile", "replay", "b.ftr")
    assert code == 0
    assert out.splitlines()[1:-1] == [
        "frames    3 frames in 0.8 s, 2.7 a second; "
        "begun 1970-01-01T00:00:00.000+00:00",
        "baseline  0 to 19",
        "masked    r0 c1, r3 c4",
        "still     r2 c2: never moved though both neighbours did",
        "missing   1 frame in 1 gap",
        "pause     0.500 s at most between two frames",
        "damaged   1 record, and 109 bytes of one that is cut off at the end",
    ]
    found = json.loads(call("tactile", "replay", "b.ftr", "--json")[1])
    assert found["board"]["sensor"]["masked"] == [[0, 1], [3, 4]]
    assert found["still"] == [[2, 2]]
    assert (found["frames"], found["damaged"], found["cut_bytes"]) == (3, 1, 109)


def test_an_empty_recording_is_reported(call: Call, place: Path) -> None:
    Recorder("b.ftr", BOARD, started_ns=2**63 - 1).close()
    code, out, _ = call("tactile", "replay", "b.ftr")
    assert code == 0
    assert "frames    0 frames in 0.0 s; begun 2262-04-11" in out


def test_a_name_that_commands_the_terminal_is_escaped(call: Call, place: Path) -> None:
    board = Board("mat\x1b[2J\n", Sensor(1, 1), Marker("AA 55"))
    Recorder("b.ftr", board).close()
    _, out, _ = call("tactile", "replay", "b.ftr")
    assert out.startswith("b.ftr: mat\\x1b[2J\\n, 1 x 1 cells")


def test_frames_become_a_table(call: Call, place: Path) -> None:
    code, _, err = call("tactile", "replay", "a.ftr", "-o", "a.csv")
    lines = Path("a.csv").read_text().splitlines()
    assert (code, err) == (0, "wrote    a.csv\n")
    assert lines[0].startswith("time,number,r0c0,r0c1,r0c2,r0c3,r0c4,r1c0")
    assert lines[1] == "1.0,4," + ",".join(map(str, range(4, 24)))
    assert len(lines) == 7


def test_frames_become_arrays_that_other_actions_read(call: Call, place: Path) -> None:
    assert call("tactile", "replay", "a.ftr", "-o", "a.npz")[2] == "wrote    a.npz\n"
    before = Path("a.npz").read_bytes()
    assert call("tactile", "replay", "a.ftr", "-o", "a.npz", "--quiet")[2] == ""
    assert Path("a.npz").read_bytes() == before
    found = read_frames("a.npz")
    assert (found.sensor.full, found.sensor.threshold) == (255, BOARD.sensor.threshold)
    assert (found.frames == read_recording("a.ftr").frames).all()
    arrays = np.load("a.npz", allow_pickle=False)
    assert arrays["times"].tolist() == [1.0, 1.25, 1.5, 2.25, 2.5, 3.75]
    assert arrays["numbers"].tolist() == [4, 5, 6, 9, 10, 15]
    label = {"label": [0] * 6, "label_names": ["cup"], "subject": [3] * 6}
    np.savez("s.npz", frames=found.frames, **label)  # type: ignore[arg-type]
    assert call("tactile", "replay", "s.npz", "-o", "t.npz")[0] == 0
    kept = np.load("t.npz", allow_pickle=False)
    assert sorted(kept) == ["frames", "full", *sorted(label), "threshold"]
    assert {name: kept[name].tolist() for name in label} == label
    sensor = Sensor(4, 5, masked=((0, 0),))
    with Recorder("m.ftr", Board("mat", sensor, Marker("AA 55"))) as recorder:
        recorder.write(Frame(_cells(9), 0.0, 0), Counters(frames=1))
    hint = "without baseline and mask: give its board with --board"
    _, _, err = call("tactile", "replay", "m.ftr", "-o", "m.npz")
    assert err == f"wrote    m.npz {hint}\n"


@pytest.mark.parametrize("name", ["a.csv", "a.npz"])
def test_a_table_or_archive_becomes_the_recording_again(
    call: Call, place: Path, name: str
) -> None:
    assert call("tactile", "replay", "a.ftr", "-o", name)[0] == 0
    words = ("tactile", "replay", name, "--board", "mat.yaml", "-o", "b.ftr")
    assert call(*words)[::2] == (0, "wrote    b.ftr\n")
    before, after = read_recording("a.ftr"), read_recording("b.ftr")
    assert (after.board, after.started_ns) == (BOARD, 0)
    for attribute in ("frames", "times", "numbers"):
        assert (getattr(after, attribute) == getattr(before, attribute)).all()
    content = Path("b.ftr").read_bytes()
    code, _, err = call(*words)
    assert (code, err) == (2, "b.ftr: is there already\n")
    assert Path("b.ftr").read_bytes() == content
    found = json.loads(call("tactile", "replay", "b.ftr", "--json")[1])
    assert (found["started"], found["frames"], found["missing"]) == (None, 6, 6)


def test_a_table_without_a_board_gets_a_plain_one(call: Call, place: Path) -> None:
    Path("b.csv").write_text("r0c0,r0c1\n1,300\n3,4\n")
    code, out, _ = call("tactile", "replay", "b.csv", "-o", "b.ftr")
    assert (code, out.splitlines()[:2]) == (
        0,
        [
            "b.csv: frames, 1 x 2 cells, full 65535, marker, 115200 baud",
            "frames    2 frames in 0.0 s, 44.0 a second",
        ],
    )
    board = read_recording("b.ftr").board
    assert board == Board("frames", Sensor(1, 2, 65535), Marker("AA 55", bits=16))


def test_what_is_no_table_or_archive_leaves_no_recording(
    call: Call, place: Path
) -> None:
    Path("b.csv").write_text("time,number,r0c0\n0.0,0,1\n0.5,1,one\n")
    code, out, err = call("tactile", "replay", "b.csv", "-o", "b.ftr")
    text = "b.csv:3: column 'r0c0' holds text where a number is needed: 'one'"
    assert (code, out, err) == (2, "", f"{text}\n")
    assert call("tactile", "replay", "a.ftr", "-o", "a.npz")[0] == 0
    Path("b.npz").write_bytes(Path("a.npz").read_bytes()[:-30])
    code, out, err = call("tactile", "replay", "b.npz", "-o", "b.ftr")
    text = "b.npz: is no numpy archive (.npz): File is not a zip file"
    assert (code, out, err) == (2, "", f"{text}\n")
    assert not Path("b.ftr").exists()


def test_a_recording_becomes_a_picture_that_moves(call: Call, place: Path) -> None:
    assert call("tactile", "replay", "a.ftr", "-o", "a.GIF")[2] == "wrote    a.GIF\n"
    assert Path("a.GIF").read_bytes().startswith(b"GIF89a")


def test_a_frame_becomes_a_picture(call: Call, place: Path) -> None:
    words = ("tactile", "replay", "a.ftr", "--frame", "3", "-o", "a.svg")
    assert call(*words)[2] == "wrote    a.svg\n"
    assert ">a, frame 3</text>" in Path("a.svg").read_text("utf-8")


def test_the_board_of_a_recording_becomes_its_file(call: Call, place: Path) -> None:
    assert call("tactile", "replay", "a.ftr", "-o", "b.yaml")[0] == 0
    assert load_board("b.yaml") == BOARD


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("a.ftr", "-o", "a.txt"),
            "-o writes .ftr, .csv, .npz, .h5, .svg, .png, .gif, .mp4, .yaml, not a.txt",
        ),
        (
            ("a.ftr", "--frame", "2", "-o", "a.gif"),
            "--frame needs a picture of one frame: -o with .svg or .png",
        ),
        (
            ("a.ftr", "--frame", "6", "-o", "a.svg"),
            "--frame 6: a.ftr has 6 frames, numbered from 0",
        ),
        (("a.ftr", "-o", "./a.ftr"), "./a.ftr: cannot be written: it is read as well"),
        (
            ("a.ftr", "--board", "mat.yaml"),
            "a.ftr: a recording has its own board; name no other one",
        ),
        (("mat.yaml",), "mat.yaml: is no recording of a board"),
        (("none",), "none: cannot be read: no such file or directory"),
        (
            ("a.ftr", "-o", "mat.yaml/a.csv"),
            "mat.yaml/a.csv: cannot be written: 'mat.yaml' is not a folder",
        ),
    ],
)
def test_what_cannot_be_replayed_is_one_sentence(
    call: Call, place: Path, words: tuple[str, ...], message: str
) -> None:
    code, out, err = call("tactile", "replay", *words)
    assert (code, out, err.splitlines()[0]) == (2, "", message)


def test_bytes_that_contradict_the_board_end_before_anything_is_written(
    call: Call, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fuzzytree.tactile.link.watching.PATIENCE_S", 0.2)
    end, host = os.openpty()
    other = Board("mat", Sensor(3, 5), Marker("AA 55", checksum="sum8"))
    stop = threading.Event()

    def talk() -> None:
        while not stop.wait(0.002):
            os.write(end, encoded(other, np.full((3, 5), 3), 0))

    thread = threading.Thread(target=talk)
    thread.start()
    name = os.ttyname(host)
    code, _, err = call("tactile", "record", "mat.yaml", name, "-o", "b.ftr")
    stop.set()
    thread.join()
    os.close(end)
    os.close(host)
    assert code == 2
    last = err.splitlines()[-1]
    assert last.startswith(f"{name}: for ")
    assert " s bytes came but no frame of 'mat': the marker AA 55 came " in last
    assert last.endswith("mostly 18 bytes apart, which is 3 x 5 and not 4 x 5")
    assert not Path("b.ftr").exists()


def test_a_board_that_is_silent_is_reported_and_leaves_no_file(
    call: Call, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fuzzytree.tactile.link.watching.PATIENCE_S", 0.05)
    end, host = os.openpty()
    name = os.ttyname(host)

    def said(text: str, *, quiet: bool = False) -> None:
        say(text, quiet=quiet)
        if text == "the board is silent":
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("fuzzytree.tactile.cli.record.say", said)
    found = call("tactile", "record", "mat.yaml", name, "-o", "b.ftr")
    os.close(end)
    os.close(host)
    assert found == (
        0,
        "",
        f"opened   {name} mat, 115200 baud\n"
        "the board is silent\n"
        "ended before the baseline was measured; nothing was written\n",
    )
    assert not Path("b.ftr").exists()


def test_the_seconds_of_a_board_that_is_silent_end(call: Call, place: Path) -> None:
    end, host = os.openpty()
    words = ("mat.yaml", os.ttyname(host), "-o", "b.ftr", "--seconds", "0.1", "--quiet")
    found = call("tactile", "record", *words)
    os.close(end)
    os.close(host)
    assert found == (2, "", "mat: the baseline needs 3 frames, and only 0 came\n")
    assert not Path("b.ftr").exists()


@pytest.mark.heavy
@pytest.mark.parametrize("count", [0, 1, 2, 10, 100, 1_000, 10_000])
def test_a_recording_survives_the_death_of_its_program(place: Path, count: int) -> None:
    sent = list(itertools.islice(blob(BOARD), 100_000))
    words = [sys.executable, "-m", "fuzzytree", "tactile", "record", "mat.yaml"]
    path = Path("b.ftr")
    with Device(BOARD, sent, rate=None) as device:
        words += [device.port, "-o", str(path)]
        with subprocess.Popen(words, stderr=subprocess.PIPE) as process:
            while not path.exists():
                assert process.poll() is None
                time.sleep(0.001)
            before = path.stat().st_size
            while path.stat().st_size < before + count * record_bytes():
                assert process.poll() is None
                time.sleep(0.001)
            process.kill()
    found = read_recording(path)
    assert (found.damaged, found.counters.damaged) == (0, 0)
    assert len(found.frames) >= count
    assert (found.frames == np.array(sent)[found.numbers]).all()
    passed = np.diff(found.numbers, prepend=2)  # a busy computer drops some
    assert (passed > 0).all()
    assert (passed - 1).sum() <= found.counters.dropped


def record_bytes() -> int:
    """Return how many bytes of a recording a frame of the board takes."""
    return records.layout_of(BOARD).itemsize
