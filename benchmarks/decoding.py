"""How fast the decoders are, in pieces of 4096 bytes.

    python benchmarks/decoding.py

A blob wanders over 16 x 16 cells. The last rows are streams without any frame: bytes
of a marker alone, and bytes at random.
"""

from __future__ import annotations

import time
from typing import Final

import numpy as np
from simulated_board import encoded

from fuzzytree.tactile.boards import Board, Marker, Protocol, Request, Sentinel, Text
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.sensor import Cells, Sensor

PIECE: Final = 4096
FRAMES: Final = 500
REPEATS: Final = 5

PROTOCOLS: Final[dict[str, tuple[Protocol, int]]] = {
    "marker, 8 bits": (Marker("AA 55"), 255),
    "marker, 16 bits": (Marker("AA 55", 16), 1023),
    "marker, sum8": (Marker("AA 55", checksum="sum8"), 255),
    "marker, crc16": (Marker("AA 55", checksum="crc16"), 255),
    "sentinel": (Sentinel(), 254),
    "request, 16 bits": (Request("10", 16, skip=8), 4095),
    "text, lines": (Text(), 1023),
    "text, blocks": (Text("block"), 1023),
}


def frames_of_file(full: int) -> Cells:
    """Return frames of a blob that wanders about."""
    draw = np.random.default_rng(1)
    y, x = np.mgrid[:16, :16]
    step = np.arange(FRAMES)[:, np.newaxis, np.newaxis]
    away = (y - 8 - 5 * np.sin(step / 9)) ** 2 + (x - 8 - 5 * np.cos(step / 7)) ** 2
    values = np.exp(-away / 8) * full * 1.1 + draw.normal(0, full / 100, away.shape)
    frames: Cells = np.clip(values, 0, full).astype(np.int64)
    return frames


def best(board: Board, data: bytes) -> tuple[float, int]:
    """Return the shortest time to decode some bytes, in seconds, and the frames."""
    times: list[float] = []
    frames = 0
    for _ in range(REPEATS):
        decoder = decoder_of(board)
        start = time.perf_counter()
        for place in range(0, len(data), PIECE):
            decoder.feed(data[place : place + PIECE])
        times.append(time.perf_counter() - start)
        frames = decoder.counters.frames
    return min(times), frames


def main() -> None:
    """Print a table."""
    print("| bytes | MB/s | frames a second |")
    print("| --- | ---: | ---: |")
    for name, (protocol, full) in PROTOCOLS.items():
        board = Board("b", Sensor(16, 16, full=full), protocol)
        parts = [encoded(board, one, n) for n, one in enumerate(frames_of_file(full))]
        data = b"".join(parts)
        seconds, frames = best(board, data)
        print(f"| {name} | {len(data) / seconds / 1e6:.0f} | {frames / seconds:,.0f} |")
    noise = np.random.default_rng(1).integers(0, 256, 200_000).astype(np.uint8)
    for name, data in {"AA": b"\xaa" * 200_000, "noise": noise.tobytes()}.items():
        protocol = Marker("AA", checksum="crc16")
        seconds, _ = best(Board("b", Sensor(16, 16), protocol), data)
        print(f"| {name}, marker AA, crc16 | {len(data) / seconds / 1e6:.1f} | none |")


if __name__ == "__main__":
    main()
