"""A board with faults behind a port, read by a line at top speed.

    python benchmarks/soak_line.py --seconds 60

The seconds are shared by the protocols. The board takes no time for its bytes, so the
line reads as fast as it can. A frame that comes is right if it is one of those that
the board sends; only frames that faults touched may come wrong, or not at all.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from msgspec.structs import replace
from serial_faults import ConnectionFaults, FaultyDevice
from simulated_board import BoardCounts, Device, Pause
from soak import CASES, FAULTS, Pool, frame_key, pool_of

from fuzzytree.tactile.boards import Board, Request
from fuzzytree.tactile.link import Connection, open_connection
from fuzzytree.tactile.sensor import Cells, Counters

# The cells of some frames hold the marker anyway.
LINE_FAULTS = replace(FAULTS, marker=0.0, unplug=Pause(0.2, every=20_000))
NAMES = (
    "marker",
    "marker, sizes, crc16",
    "sentinel",
    "request, xor8",
    "text, lines",
)
_TIMEOUT_S = 0.02  # of an answer: a damaged one costs no more
_QUIET_S = 1.0  # after this silence nothing more comes


@dataclass
class Heard:
    """What a line heard, and what the board did.

    Attributes:
        seconds: It took.
        right: Frames as the board sent them.
        wrong: Others.
        counters: Of the line.
        truth: Of the board.
    """

    seconds: float = 0.0
    right: int = 0
    wrong: int = 0
    counters: Counters = field(default_factory=Counters)
    truth: BoardCounts = field(default_factory=BoardCounts)


def soak_line(
    board: Board,
    seconds: float,
    *,
    least: int = 0,
    faults: ConnectionFaults = LINE_FAULTS,
    seed: int = 0,
) -> Heard:
    """Let a line read a board with faults for some seconds; hold it to the laws.

    It takes longer where so many frames (`least`) have not been offered by then.
    """
    if isinstance(board.protocol, Request):
        quick = replace(board.protocol, timeout_s=_TIMEOUT_S)
        board = replace(board, protocol=quick)
    pool = pool_of(board, FAULTS, np.random.default_rng(seed))
    heard, begin = Heard(), time.monotonic()
    frames = _frames(pool, begin + seconds, least)
    with FaultyDevice(board, frames, faults, None, seed=seed) as device:
        with open_connection(board, device.port, most_waiting=10_000) as line:
            _listen(line, device, pool, heard)
            heard.counters = line.counters
        heard.truth = device.counts
    heard.seconds = time.monotonic() - begin - _QUIET_S
    _check(heard)
    return heard


def _frames(pool: Pool, until: float, least: int) -> Iterator[Cells]:
    for count, cells in enumerate(itertools.cycle(pool.cells)):
        if count >= least and time.monotonic() > until:
            return
        yield cells


def _listen(line: Connection, device: Device, pool: Pool, heard: Heard) -> None:
    while True:
        frame = line.take(_QUIET_S)
        if frame is None and device.over.is_set():
            return
        if frame is not None:
            is_right = frame_key(frame.cells) in pool.found
            heard.right += is_right
            heard.wrong += not is_right


def _check(heard: Heard) -> None:
    """Raise if the counters and the truth contradict each other."""
    counters, truth = heard.counters, heard.truth
    given = heard.right + heard.wrong
    assert given == counters.frames - counters.dropped, counters
    assert heard.wrong <= truth.touched, (heard.wrong, truth)
    assert counters.bytes <= truth.bytes, (counters, truth)
    assert counters.reconnects == truth.unplugs, (counters, truth)
    if not truth.unplugs:
        assert counters.bytes == truth.bytes, (counters, truth)


def _row(name: str, heard: Heard) -> str:
    counters, truth = heard.counters, heard.truth
    values = [
        truth.frames,
        truth.touched,
        heard.right,
        heard.wrong,
        counters.damaged,
        counters.skipped,
        counters.dropped,
        f"{truth.unplugs} / {counters.reconnects}",
        truth.bytes - counters.bytes,
        f"{truth.frames / heard.seconds:.0f}",
        f"{counters.bytes / 1e6 / heard.seconds:.2f}",
    ]
    return f"| {name} | " + " | ".join(map(str, values)) + " |"


def main() -> int:
    """Soak every protocol and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="In all.")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    titles = ["frames", "touched", "right", "wrong", "damaged", "skipped", "dropped"]
    titles += ["unplugged / back", "bytes lost with the port", "frames/s", "MB/s"]
    print("| protocol | " + " | ".join(titles) + " |")
    print("| --- |" + " ---: |" * len(titles))
    for name in NAMES:
        share_s = given.seconds / len(NAMES)
        print(_row(name, soak_line(CASES[name], share_s, seed=given.seed)), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
