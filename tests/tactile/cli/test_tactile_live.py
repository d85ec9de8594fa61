"""`fuzzytree tactile live`: lines, a terminal that is given back, what is refused."""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import json
import os
import pty
import re
import select
import shlex
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import press
import pytest
from serial_faults import ConnectionFaults, FaultyDevice
from simulated_board import Device, Pause

import fuzzytree as ft
from fuzzytree.cli.program import main
from fuzzytree.errors import WriteError
from fuzzytree.tactile.board_file import board_text
from fuzzytree.tactile.boards import Board, Marker, Start
from fuzzytree.tactile.cli.screen import look_of
from fuzzytree.tactile.link.recording import Recorder, RecordingFile, read_recording
from fuzzytree.tactile.sensor import Counters, Frame, Sensor
from fuzzytree.tactile.writers import WRITERS

Call = Callable[..., tuple[int, str, str]]
ROOT = Path(__file__).parents[3]

NOTHING = np.zeros((4, 4), np.int64)
SMALL = np.eye(4, dtype=np.int64) * 9
LARGE = np.full((4, 4), 99)
SHOWN = [NOTHING] * 4 + [SMALL] * 4 + [LARGE] + [SMALL] * 2 + [LARGE] * 3
BOARD = Board(
    "mat", Sensor(4, 4), Marker("AA 55", checksum="sum8"), start=Start(frames=3)
)
LEAVES = b"\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"


@pytest.fixture
def call(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> Call:
    """Return the command line, in a folder with a recording, a board and models."""
    monkeypatch.chdir(tmp_path)
    areas = np.array([[4.0], [5.0], [16.0], [15.0]])
    for name in ("area", "pressure_kpa"):
        tree = ft.learn(
            ft.table(areas, columns=[name]), target=["s", "s", "l", "l"], name="sizes"
        )
        ft.save(tree, f"{name}.yaml")
    Path("mat.yaml").write_text(board_text(BOARD), "utf-8")
    with Recorder("some.ftr", BOARD, started_ns=0) as recorder:
        for number, cells in enumerate(SHOWN):
            frame = Frame(cells, number / 8, number)
            recorder.write(frame, Counters(frames=number + 1, damaged=2))
    long = np.tile(np.array(SHOWN, np.uint8), (300, 4, 4))
    np.savez_compressed("long.npz", frames=long)

    def run(*words: str) -> tuple[int, str, str]:
        code = main(["tactile", "live", *words])
        out, err = capsys.readouterr()
        return code, out, err

    return run


REPLAY = ("some.ftr", "--model", "area.yaml", "--speed", "0")


def test_a_recording_gives_a_line_for_each_object_that_holds(call: Call) -> None:
    code, out, err = call(*REPLAY)
    fields = [line.split("\t") for line in out.splitlines()]
    assert code == 0
    assert [(row[1], row[2], row[3], row[5]) for row in fields] == [
        ("2", "nothing", "", "0"),
        ("6", "object", "s", "0"),
        ("13", "object", "l", "0"),
    ]
    assert [float(row[0]) for row in fields] == [0.25, 0.75, 1.625]
    assert err.splitlines()[:2] == [
        "answered 14 frames l 4, nothing 4, s 6",
        "counted  14 frames, 2 damaged",
    ]


def test_with_a_hold_of_one_frame_every_change_is_a_line(call: Call) -> None:
    _, out, _ = call(*REPLAY, "--hold", "1", "--quiet")
    found = [row[3] or row[2] for row in map(str.split, out.splitlines())]
    assert len(found) == 5


def test_lines_of_json_have_the_fields_of_lines_with_tabs(call: Call) -> None:
    _, tabs, _ = call(*REPLAY, "--quiet")
    _, out, err = call(*REPLAY, "--json", "--quiet")
    assert err == ""
    rows = [json.loads(line) for line in out.splitlines()]
    for row, line in zip(rows, tabs.splitlines(), strict=True):
        if row["box"] is not None:
            row["box"] = ",".join(map(str, row["box"]))
        assert "\t".join("" if v is None else str(v) for v in row.values()) == line
    assert [*rows[0]] == [
        *("time", "frame", "state", "class", "strength", "saturated"),
        *("object", "x", "y", "angle", "area", "force", "box"),
    ]


def test_live_ends_after_the_frames_requested_and_keeps_them(call: Call) -> None:
    code, _, err = call(*REPLAY, "--frames", "5", "--record", "kept.ftr")
    assert code == 0
    assert "answered 5 frames" in err
    assert "wrote    kept.ftr" in err
    kept = read_recording("kept.ftr")
    assert kept.frames.tolist() == [cells.tolist() for cells in SHOWN[:5]]
    assert kept.counters.damaged == 2


def test_a_full_disk_ends_the_recording_and_recognition_goes_on(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest, written = Recorder.write, itertools.count()

    def full(self: Recorder, frame: Frame, counters: Counters) -> None:
        if next(written) == 3:
            raise WriteError("kept.ftr: cannot be written: no space left on device")
        honest(self, frame, counters)

    monkeypatch.setattr(Recorder, "write", full)
    code, _, err = call(*REPLAY, "--record", "kept.ftr")
    assert code == 1
    assert f"answered {len(SHOWN)} frames" in err
    assert "wrote    kept.ftr 3 frames" in err
    assert err.splitlines()[-1] == (
        "the recording ended: kept.ftr: cannot be written: no space left on device"
    )
    assert len(read_recording("kept.ftr").frames) == 3


def test_a_recording_that_is_there_is_not_written_over(call: Call) -> None:
    Path("other.ftr").write_bytes(b"another recording")
    code, _, err = call(*REPLAY, "--record", "other.ftr")
    assert (code, err) == (2, "other.ftr: is there already\n")
    assert Path("other.ftr").read_bytes() == b"another recording"


def test_what_is_far_from_all_that_was_learnt_is_unknown_unless_one_requests(
    call: Call,
) -> None:
    ten = np.arange(16).reshape(1, 4, 4) < 10
    np.savez("ten.npz", frames=ten.repeat(9, axis=0).astype(np.uint8))
    words = ("ten.npz", "--model", "area.yaml", "--speed", "0")
    _, out, err = call(*words, "--reject", "0.001")
    assert {row.split("\t")[2] for row in out.splitlines()} == {"unknown"}
    assert "no rule, or one below 0.001, decides; --reject sets it\n" in err
    _, out, _ = call(*words)  # a class of two rows is too few to reject by
    assert {row.split("\t")[2] for row in out.splitlines()} == {"object"}
    tree = ft.load("area.yaml")
    assert isinstance(tree, ft.FuzzyTree)
    ft.save(ft.rules_from_tree(tree), "relative.yaml")
    code, out, _ = call("some.ftr", "--model", "relative.yaml", "--speed", "0")
    assert code == 0  # relative rules have no floor, and need not be told so
    assert "\tobject\ts\t" in out


def test_a_model_of_other_features_is_refused_by_name(call: Call) -> None:
    code, out, err = call("some.ftr", "--model", "pressure_kpa.yaml")
    assert (code, out) == (2, "")
    assert err.startswith("sizes uses other features: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize("name", ["some.csv", "some.npz"])
def test_frames_of_a_table_or_archive_are_recognised_as_those_of_a_recording(
    call: Call, name: str
) -> None:
    with RecordingFile("some.ftr") as file:
        WRITERS[Path(name).suffix](name, file)
    words = ("--model", "area.yaml", "--speed", "0", "--lines")
    expected = call("some.ftr", *words)[1]
    assert expected.count("object") > 1
    assert call(name, *words)[:2] == (0, expected)
    recorded = call(name, *words, "--board", "mat.yaml", "--record", "b.ftr")
    assert recorded[:2] == (0, expected)
    before, after = read_recording("some.ftr"), read_recording("b.ftr")
    assert after.board == BOARD
    assert after.frames.tolist() == before.frames.tolist()


def test_a_table_of_another_size_than_its_board_is_reported(call: Call) -> None:
    Path("a.csv").write_text("r0c0,r0c1\n1,2\n")
    code, _, err = call("a.csv", "--model", "area.yaml", "--board", "mat.yaml")
    text = "a.csv: a frame of 1 x 2 cells does not fit a sensor of 4 x 4"
    assert (code, err) == (2, f"{text}\n")


def test_a_recording_with_another_board_is_reported(call: Call) -> None:
    code, _, err = call("some.ftr", "--model", "area.yaml", "--board", "mat.yaml")
    text = "some.ftr: a recording has its own board; name no other one"
    assert (code, err) == (2, f"{text}\n")


def test_a_recording_that_is_not_there_is_reported(call: Call) -> None:
    code, _, err = call("none.ftr", "--model", "area.yaml")
    text = "none.ftr is no recording; for a port, name its board"
    hint = "fuzzytree tactile live --help lists the options"
    assert (code, err) == (2, f"{text}\n  {hint}\n")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--speed", "nan"), "a speed is 0 or more, not nan"),
        (("--reject", "nan"), "reject lies in 0 to 1, not nan"),
    ],
)
def test_what_is_no_number_is_no_speed_and_no_share(
    call: Call, words: tuple[str, ...], text: str
) -> None:
    code, _, err = call("some.ftr", "--model", "area.yaml", *words)
    assert (code, err.splitlines()[0]) == (2, text)


def test_a_port_that_is_not_there_is_reported(call: Call) -> None:
    words = ("./gone", "--board", "mat.yaml", "--model", "area.yaml")
    code, _, err = call(*words)
    assert code == 2
    assert err.startswith("there is no port './gone'; there is ")


@pytest.mark.heavy
def test_a_board_is_answered_through_faults_and_a_pulled_plug(call: Call) -> None:
    # Nothing comes back, for a busy computer may miss the first of it.
    cycle = [*[SMALL] * 40, *[LARGE] * 40, *[NOTHING] * 20]
    shown = itertools.chain([NOTHING] * 30, itertools.cycle(cycle))
    faults = ConnectionFaults(flip=0.002, unplug=Pause(0.1, every=150))
    with FaultyDevice(BOARD, shown, faults, rate=2.0, seed=1) as device:
        words = (device.port, "--board", "mat.yaml", "--model", "area.yaml")
        code, out, err = call(*words, "--frames", "250", "--record", "kept.ftr")
    assert code == 0
    found = {row.split("\t")[3] for row in out.splitlines()}
    assert found == {"", "s", "l"}
    assert err.splitlines()[0] == (
        "measures the baseline in 3 frames: nothing may lie on the sensor"
    )
    kept = read_recording("kept.ftr")
    assert kept.counters.reconnects >= 1
    assert kept.counters.damaged >= 1
    assert len(kept.frames) >= 250
    assert kept.counters.dropped == 0
    assert kept.board.sensor.baseline == (0,) * 16


@pytest.mark.heavy
def test_a_board_that_contradicts_the_stream_ends_live_with_a_sentence(
    call: Call,
) -> None:
    other = Board("mat", Sensor(7, 9), Marker("AB CD"), start=Start(frames=3))
    with Device(other, itertools.repeat(np.full((7, 9), 3)), rate=None) as device:
        words = (device.port, "--board", "mat.yaml", "--model", "area.yaml")
        code, out, err = call(*words)
    assert (code, out) == (2, "")
    assert "no frame" in err.splitlines()[-1]


def test_the_terminal_says_which_colours_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def look(**environment: str) -> str | None:
        for name in ("TERM", "COLORTERM", "NO_COLOR"):
            monkeypatch.setenv(name, environment.get(name, ""))
        stream = SimpleNamespace(isatty=lambda: True, encoding="utf-8")
        return look_of(stream)  # type: ignore[arg-type] # all that is read

    assert look(TERM="xterm-256color", COLORTERM="truecolor") == "full"
    assert look(TERM="xterm-256color") == "256"
    assert look(TERM="vt100") == "plain"
    assert look(TERM="xterm", COLORTERM="truecolor", NO_COLOR="1") == "plain"
    assert look(TERM="dumb") is None
    assert look() is None


def started(folder: Path, *words: str, **environment: str) -> tuple[int, int]:
    """Start live in a terminal of its own; return its number and the terminal."""
    number, terminal = pty.fork()
    if not number:
        os.chdir(folder)
        os.environ.update(TERM="xterm-256color", **environment)
        os.execv(
            sys.executable,
            [sys.executable, "-m", "fuzzytree", "tactile", "live", *words],
        )
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    return number, terminal


def until(terminal: int, wanted: bytes, patience_s: float = 120.0) -> bytes:
    """Return what a terminal is sent until some bytes come, or it is closed."""
    found, end = b"", time.monotonic() + patience_s
    while wanted not in found and time.monotonic() < end:
        if select.select([terminal], [], [], 0.1)[0]:
            try:
                piece = os.read(terminal, 1 << 16)
            except OSError:
                break
            found += piece
    return found


def ended(number: int, terminal: int) -> tuple[int, bytes]:
    """Return the exit code and the last that the terminal was sent."""
    rest = until(terminal, b"never")
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1]), rest


FOREVER = ("long.npz", "--model", "area.yaml")


@pytest.mark.heavy
def test_keys_tare_and_change_the_picture(call: Call, tmp_path: Path) -> None:
    number, terminal = started(tmp_path, *FOREVER, COLORTERM="truecolor")
    assert b"3 points a cell" in until(terminal, b"3 points a cell")
    for key, shown in (
        (b"i", b"5 points"),
        (b"s", b"the real cells"),
        (b"t", b"tared"),
    ):
        os.write(terminal, key)
        assert shown in until(terminal, shown)
    os.kill(number, signal.SIGINT)
    code, last = ended(number, terminal)
    assert code == 0
    assert LEAVES in last


@pytest.mark.heavy
def test_ctrl_c_gives_the_terminal_back_and_is_a_normal_end(
    call: Call, tmp_path: Path
) -> None:
    number, terminal = started(tmp_path, *FOREVER, COLORTERM="truecolor")
    first = until(terminal, b"answer after")
    os.write(terminal, b"\x03")
    code, rest = ended(number, terminal)
    assert code == 0
    assert b"\x1b[?1049h\x1b[?25l" in first
    assert b"48;2;" in first
    assert rest.count(LEAVES) == 1
    assert b"answered " in rest.partition(LEAVES)[2]
    assert b"Traceback" not in first + rest


@pytest.mark.heavy
@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_gives_the_terminal_back(
    call: Call, tmp_path: Path, name: str
) -> None:
    number, terminal = started(tmp_path, *FOREVER)
    until(terminal, b"answer after")
    os.kill(number, signal.Signals[name])
    code, rest = ended(number, terminal)
    assert code == 0
    assert LEAVES in rest


@pytest.mark.heavy
def test_an_error_in_the_middle_gives_the_terminal_back(
    call: Call, tmp_path: Path
) -> None:
    board = tmp_path / "link"
    with Device(BOARD, itertools.cycle(SHOWN), link=board):
        words = (str(board), "--board", "mat.yaml", "--model", "area.yaml")
        number, terminal = started(tmp_path, *words, "--record", "/dev/full")
        code, rest = ended(number, terminal)
    assert code == 2
    assert b"/dev/full" in rest


@pytest.mark.heavy
def test_a_stopped_live_gives_the_terminal_back_and_takes_it_again(
    call: Call, tmp_path: Path
) -> None:
    number, terminal = started(tmp_path, *FOREVER)
    until(terminal, b"answer after")
    os.write(terminal, b"\x1a")
    assert LEAVES in until(terminal, LEAVES)
    assert os.waitpid(number, os.WUNTRACED)[1] & 0xFF == 0x7F
    os.kill(number, signal.SIGCONT)
    assert b"\x1b[?1049h" in until(terminal, b"answer after")
    os.write(terminal, b"\x03")
    assert ended(number, terminal)[0] == 0


@pytest.mark.heavy
def test_a_terminal_that_changes_its_size_is_drawn_anew(
    call: Call, tmp_path: Path
) -> None:
    number, terminal = started(tmp_path, *FOREVER)
    until(terminal, b"answer after")
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 160, 0, 0))
    assert b"\x1b[29;1H" in until(terminal, b"\x1b[29;1H")
    os.write(terminal, b"\x03")
    assert ended(number, terminal)[0] == 0


@pytest.mark.heavy
def test_nobody_who_reads_the_lines_ends_live_quietly(
    call: Call, tmp_path: Path
) -> None:
    words = [sys.executable, "-m", "fuzzytree", "tactile", "live", *FOREVER]
    with subprocess.Popen(
        [*words, "--speed", "0", "--hold", "1", "--quiet"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as run:
        assert run.stdout is not None
        assert run.stderr is not None
        assert run.stdout.readline().count("\t") == 12
        run.stdout.close()
        assert run.wait(60) == 141
        assert run.stderr.read() == ""


@pytest.mark.heavy
def test_lines_come_at_once_while_live_goes_on(call: Call, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "fuzzytree", "tactile", "live", *FOREVER]
    with subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        timer = threading.Timer(60, run.kill)
        timer.start()
        line = run.stdout.readline()
        assert run.poll() is None
        run.send_signal(signal.SIGINT)
        assert run.wait(30) == 0
        timer.cancel()
    assert line.count(b"\t") == 12


@pytest.mark.heavy
def test_the_commands_of_the_page_do_what_it_says(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = (ROOT / "docs/how-to/live.md").read_text("utf-8")
    monkeypatch.chdir(tmp_path)
    (board,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    Path("mat.yaml").write_text(board, "utf-8")
    lines = "".join(re.findall(r"```console\n(.*?)```", page, re.DOTALL)).splitlines()
    assert len(lines) == 7
    with contextlib.ExitStack() as stack:
        for line in lines:
            program, *words = shlex.split(line)
            if words[0] == "benchmarks/press.py":
                press.main(words[1:])
                continue
            if program == "python":
                stack.enter_context(simulated(*words))
                continue
            is_live = "live" in words
            assert main([*words, *(("--frames", "130") if is_live else ())]) == 0
            out = capsys.readouterr().out
            assert ("\tobject\trectangle-27\t" in out) == is_live


@contextlib.contextmanager
def simulated(script: str, *words: str) -> Iterator[None]:
    """Run a board until the end of the block."""
    command = [sys.executable, str(ROOT / script), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == b"board\n"
        yield
        run.send_signal(signal.SIGINT)
        assert run.wait(30) == 0
