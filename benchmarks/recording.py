"""What it costs to keep frames: the time of a frame, and what is at risk.

Run it where recordings shall lie: `python benchmarks/recording.py --folder .`
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link.recording import Recorder, layout_of, read_recording
from fuzzytree.tactile.sensor import Counters, Frame, Sensor

SIDES = (16, 64)
RATES = (10, 100, 1000)


def measured(path: Path, side: int, rate: int, seconds: float) -> str:
    """Return a line of the table: one size of frame at one rate."""
    board = Board("mat", Sensor(side, side), Marker("AA 55"))
    cells = np.random.default_rng(0).integers(0, 256, (side, side))
    spent = []
    begin = time.perf_counter()
    with Recorder(path, board, replace=True) as recorder:
        for number in range(int(rate * seconds)):
            time.sleep(max(begin + number / rate - time.perf_counter(), 0.0))
            before = time.perf_counter()
            recorder.write(Frame(cells, number / rate, number), Counters())
            spent.append(time.perf_counter() - before)
    last = sorted(spent)[int(0.99 * len(spent))]
    before = time.perf_counter()
    count = len(read_recording(path).frames)
    reading = (time.perf_counter() - before) / count
    return (
        f"| {side} x {side} | {rate} | {layout_of(board).itemsize} | "
        f"{1e6 * statistics.median(spent):.0f} | {1e6 * last:.0f} | "
        f"{recorder.most_at_risk} | {1e6 * reading:.0f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path())
    parser.add_argument("--seconds", type=float, default=3.0)
    options = parser.parse_args()
    print("| cells | frames/s | bytes | write µs | 99 % µs | at risk | read µs |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        for side in SIDES:
            for rate in RATES:
                path = Path(folder) / "a.ftr"
                print(measured(path, side, rate, options.seconds))


if __name__ == "__main__":
    main()
