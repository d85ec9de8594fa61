"""How long after the last byte of a frame its answer is out, through a real port.

A board of our own sends the paper's objects from another process, and notes when the
last byte of each frame was written; this process reads the port, answers, and notes
when each answer is out. Run it by hand:

    .venv/bin/python benchmarks/live_latency.py
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import multiprocessing
import os
import pty
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from multiprocessing.sharedctypes import SynchronizedArray
from pathlib import Path

import numpy as np
from press import simulated
from press_physics import press
from press_shapes import OBJECTS
from simulated_board import Wire, encoded

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.tactile.boards import Board, Marker, Port
from fuzzytree.tactile.cli.live import SWITCH_S
from fuzzytree.tactile.cli.screen import Screen
from fuzzytree.tactile.link import open_connection
from fuzzytree.tactile.recognition.live import Live
from fuzzytree.tactile.recognition.sensing import MOST_WAITING
from fuzzytree.tactile.runtimes.frames import FramePlan

FEATURES = (
    *("S1", "S2", "S7", "S8", "S9", "S11"),
    *("angle", "area", "Re C30", "Re C21"),
)
"""What the tree may ask for."""


def main() -> None:
    """Measure each speed, with and without a terminal that is drawn on."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    tree = paper_tree()
    print(f"{len(tree.inputs)} features, {len(tree.leaves)} leaves; load", end=" ")
    print(*(f"{load:.1f}" for load in os.getloadavg()), "on", os.cpu_count(), "cores")
    head = "line         draws  frames  dropped  median ms  99 % ms  largest ms"
    print(f"{head}  below 1 ms")
    sys.setswitchinterval(SWITCH_S)
    for baud, is_paced in ((115200, True), (500000, True), (500000, False)):
        for draws in (False, True):
            count = int(seconds * (baud / 10 / 262 if is_paced else 1500))
            late, dropped = latencies(tree, baud, count, is_paced=is_paced, draws=draws)
            parts = [*np.quantile(late, (0.5, 0.99)), late.max()]
            name = f"{baud} baud" if is_paced else "no limit"
            numbers = "".join(f"{1e3 * part:11.2f}" for part in parts)
            share = f"{(late < 1e-3).mean():11.0%}"
            print(f"{name:12} {draws!s:6} {len(late):6}  {dropped:7}{numbers}{share}")


def paper_tree() -> FuzzyTree:
    """Return a tree of the paper's seven objects."""
    rows: list[np.ndarray] = []
    labels: list[str] = []
    for name in OBJECTS:
        found = press(name, 50, seed=1)
        rows.append(FramePlan(found.sensor, FEATURES)(found.frames).values.T)
        labels += [name] * len(found.frames)
    return learn(table(np.concatenate(rows), columns=FEATURES), target=labels)


def latencies(
    tree: FuzzyTree, baud: int, count: int, *, is_paced: bool, draws: bool
) -> tuple[np.ndarray, int]:
    """Return how long each answer took, in seconds, and how many were dropped."""
    board = Board(
        "paper",
        press("circle", 1).sensor,
        Marker("AA 55", checksum="crc16"),
        port=Port(baud=baud),
    )
    spawn = multiprocessing.get_context("spawn")
    written: SynchronizedArray[float] = spawn.Array("d", count)
    with tempfile.TemporaryDirectory() as folder:
        link = str(Path(folder) / "board")
        over = spawn.Event()
        sender = spawn.Process(target=send, args=(board, link, written, is_paced, over))
        sender.start()
        while not Path(link).exists():
            time.sleep(0.01)
        line = open_connection(board, link, most_waiting=MOST_WAITING)
        live = Live(tree, board.sensor, line, "board")
        late = np.full(count, np.nan)
        with contextlib.ExitStack() as stack:
            stack.callback(line.close)
            if draws:
                stack.enter_context(drawn(live))
            for answer in live.answers():
                out = time.monotonic()
                number = answer.frame.number
                late[number] = out
                if number == count - 1:
                    break
            dropped = line.counters.dropped
        over.set()
        sender.join()
    late -= np.array(written[:])
    return late[np.isfinite(late)], dropped


def send(
    board: Board,
    link: str,
    written: SynchronizedArray[float],
    is_paced: bool,
    over: threading.Event,
) -> None:
    """Send frames, and note when the last byte of each was written."""
    shown = [record.frame.cells for record in itertools.islice(simulated(), 700)]
    frames = [encoded(board, cells, number) for number, cells in enumerate(shown)]
    stop = threading.Event()
    wire = Wire(board.port, Path(link), stop, rate=1.0 if is_paced else None)
    wire.plug_in()
    while not wire.is_open:
        time.sleep(0.01)
    time.sleep(0.2)
    wire.rest()
    for number in range(len(written)):
        wire.send(frames[number % len(frames)])
        written[number] = time.monotonic()
        if over.is_set():
            break
    over.wait()
    wire.plug_out()


@contextlib.contextmanager
def drawn(live: Live) -> Iterator[None]:
    """Draw on a pseudo-terminal that somebody reads."""
    reader, terminal = pty.openpty()

    def read() -> None:
        with contextlib.suppress(OSError):
            while os.read(reader, 1 << 16):
                pass

    threading.Thread(target=read, daemon=True).start()
    with os.fdopen(terminal, "w") as stream, Screen(live, stream, "full", 3):
        yield


if __name__ == "__main__":
    main()
