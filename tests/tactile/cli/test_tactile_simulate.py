"""`fuzzytree tactile simulate` is a board that a host can open, and tells the truth."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import serial

from fuzzytree.tactile.board_file import board_text
from fuzzytree.tactile.boards import Board, Marker, Start
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.link.recording import Recorder
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor
from tests.cli.conftest import Call

HELP = "\n  fuzzytree tactile simulate --help lists the options\n"
SIMULATE = ("tactile", "simulate", "mat.yaml")
MAT = Board("mat", Sensor(4, 6, full=200), Marker("AA 55"), start=Start(frames=3))


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    (folder / "mat.yaml").write_text(board_text(MAT), "utf-8")


def _heard(port: str, count: int) -> list[Cells]:
    """Return frames from a port, as soon as it is there."""
    while not Path(port).exists():
        time.sleep(0.005)
    decoder = decoder_of(MAT)
    frames: list[Cells] = []
    with serial.Serial(port, 115200, timeout=5.0) as host:
        while len(frames) < count and (data := host.read(host.in_waiting or 1)):
            frames += decoder.feed(data)
    return frames


def _while_heard(call: Call, words: list[str], count: int) -> tuple[str, list[Cells]]:
    """Run the action while a host takes some frames; return its JSON and these."""
    found: list[Cells] = []
    host = threading.Thread(target=lambda: found.extend(_heard("port", count)))
    host.start()
    options = ["--link", "port", "--fast", "--json", "--quiet"]
    code, out, err = call(*SIMULATE, *words, *options)
    host.join()
    assert (code, err) == (0, "")
    return out, found


def test_a_host_gets_frames_at_rest_and_then_what_lies_there(call: Call) -> None:
    out, frames = _while_heard(call, ["--frames", "10"], 13)
    assert [int(cells.max()) for cells in frames[:3]] == [0, 0, 0]
    assert min(int(cells.max()) for cells in frames[3:]) > 0
    facts = json.loads(out)
    assert (facts["port"], facts["board"]) == ("port", "mat")
    assert facts["truth"]["frames"] == 13
    assert facts["truth"]["bytes"] == 13 * (2 + 24)
    assert not Path("port").exists()


def test_an_object_is_fitted_to_the_board(call: Call) -> None:
    words = ["--object", "hand-0", "--frames", "40"]
    _, frames = _while_heard(call, words, 43)
    assert frames[-1].shape == (4, 6)
    assert 20 < max(int(cells.max()) for cells in frames) <= 200


def test_a_recording_is_sent_over_and_over_with_its_baseline_first(call: Call) -> None:
    sensor = Sensor(4, 6, full=200, baseline=(7,) * 24)
    board = Board("mat", sensor, Marker("AA 55"))
    cells = [np.full((4, 6), value, np.uint8) for value in (10, 20)]
    with Recorder("a.ftr", board) as recorder:
        for number, one in enumerate(cells):
            recorder.write(Frame(one, float(number), number), Counters())
    words = ["--recording", "a.ftr", "--frames", "4"]
    _, frames = _while_heard(call, words, 7)
    assert [int(one[0, 0]) for one in frames] == [7, 7, 7, 10, 20, 10, 20]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--fault", "flop=1"], "no fault 'flop'; there is stall, unplug"),
        (["--object", "foot"], "no object 'foot'; there is rectangle-0, "),
        (
            ["--object", "circle", "--recording", "a.ftr"],
            "--object and --recording exclude each other",
        ),
    ],
)
def test_what_cannot_be_is_a_mistake_in_the_command(
    call: Call, words: list[str], sentence: str
) -> None:
    code, out, err = call(*SIMULATE, *words)
    assert (code, out) == (2, "")
    last = err[err.index(sentence) :]
    assert last.endswith(HELP)


def test_a_port_that_is_there_is_left_alone(call: Call) -> None:
    Path("port").write_text("mine", "utf-8")
    code, out, err = call(*SIMULATE, "--link", "port")
    assert (code, out) == (2, "")
    assert err == "port: cannot be made a port: something else is there\n"


@pytest.mark.one_in(2)
@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_it_ends_when_it_is_reported_to_and_leaves_no_port(number: int) -> None:
    words = [sys.executable, "-m", "fuzzytree", *SIMULATE, "--object", "all"]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        port = process.stdout.readline().strip()
        assert os.path.realpath(port).startswith("/dev/")
        process.send_signal(number)
        out, err = process.communicate(timeout=20.0)
    assert (process.returncode, out) == (0, "")
    assert err == (
        "fitted   16 x 16 cells to 4 x 6\n"
        "fitted   0 to 255 to 0 to 200\n"
        f"opened   {port} mat, 115200 baud, 44 frames a second at most\n"
        "counted  nothing\n"
    )
    assert not Path(port).exists()
