"""How soon a frame is there after its last byte, and how many can be read.

    python benchmarks/line.py

Over a pseudo-terminal, 16 x 16 cells with a marker and a checksum.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import multiprocessing
import os
import statistics
import time
import tty
from multiprocessing.connection import Connection

from simulated_board import blob, encoded

from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link import open_connection
from fuzzytree.tactile.sensor import Sensor

BOARD = Board("mat", Sensor(16, 16), Marker("AA 55", checksum="crc16"))


def delays(count: int) -> list[float]:
    """Return the seconds from the last byte's writing to the frame's taking."""
    board_end, host_end = os.openpty()
    content = encoded(BOARD, next(blob(BOARD)), 0)
    found = []
    with open_connection(BOARD, os.ttyname(host_end)) as line:
        for _ in range(count):
            os.write(board_end, content[:-1])
            time.sleep(0.004)
            begin = time.perf_counter()
            os.write(board_end, content[-1:])
            line.take(1.0)
            found.append(time.perf_counter() - begin)
    os.close(board_end)
    os.close(host_end)
    return found


def flood(there: Connection) -> None:
    """Write frames as fast as they are read, once the port is open."""
    board_end, host_end = os.openpty()
    tty.setraw(host_end)
    there.send(os.ttyname(host_end))
    frames = itertools.islice(blob(BOARD), 100)
    content = b"".join(encoded(BOARD, cells, n) for n, cells in enumerate(frames))
    there.recv()
    with contextlib.suppress(OSError):
        while True:
            os.write(board_end, content)


def most(seconds: float) -> tuple[float, float, float]:
    """Return frames and bytes a second, and the share of a core that this takes."""
    here, there = multiprocessing.Pipe()
    process = multiprocessing.Process(target=flood, args=(there,), daemon=True)
    process.start()
    with open_connection(BOARD, here.recv()) as line:
        here.send("open")
        begin, worked = time.perf_counter(), time.process_time()
        while time.perf_counter() - begin < seconds:
            line.take(1.0)
        passed = time.perf_counter() - begin
        share = (time.process_time() - worked) / passed
        counters = line.counters
    process.kill()
    return counters.frames / passed, counters.bytes / passed, share


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=5.0)
    options = parser.parse_args()
    found = sorted(delays(options.frames))
    late = found[int(0.99 * len(found))]
    print(f"last byte to frame: {1e6 * statistics.median(found):.0f} µs", end="")
    print(f" (99 %: {1e6 * late:.0f} µs)")
    frames, size, share = most(options.seconds)
    print(f"at most: {frames:.0f} frames/s, {size / 1e6:.1f} MB/s", end="")
    print(f" with {share:.0%} of a core")


if __name__ == "__main__":
    main()
