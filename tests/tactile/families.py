"""Boards of every family, small, and what they send."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from simulated_board import banner, encoded

from fuzzytree.tactile.boards import (
    Board,
    Marker,
    Order,
    Pressure,
    Protocol,
    Request,
    Sentinel,
    Text,
)
from fuzzytree.tactile.link import Decoder
from fuzzytree.tactile.sensor import Cells, Sensor


def _board(
    protocol: Protocol,
    full: int = 255,
    *,
    order: Order = "rows",
    pressure: Pressure = "rises",
    lines: int = 0,
) -> Board:
    sensor = Sensor(3, 4, full=full)
    return Board("b", sensor, protocol, order=order, pressure=pressure, banner=lines)


FAMILIES: Final = {
    "marker": _board(Marker("AA 55")),
    "marker of a byte": _board(Marker("07"), order="columns", lines=1),
    "marker, little": _board(Marker("AA 55", 16), 1023),
    "marker, big, few": _board(Marker("AA 55", 16, "big", skip=3), 200),
    "marker, sum8": _board(Marker("AA", checksum="sum8"), pressure="falls"),
    "marker, xor8, sizes": _board(
        Marker("AA 55", sizes="rows and columns", checksum="xor8")
    ),
    "marker, crc16": _board(
        Marker("AA 55", 16, "big", "rows and columns", 2, "crc16"), 4095
    ),
    "marker, tail": _board(Marker("02", tail="0D 0A"), 200, pressure="falls"),
    "sentinel": _board(Sentinel(), 254),
    "sentinel, odd": _board(Sentinel(end=250, zero=2), order="columns", lines=2),
    "request": _board(Request("41"), lines=1),
    "request, crc16": _board(Request("10", 16, skip=8, checksum="crc16"), 4095),
    "lines": _board(Text(), 1023),
    "lines, stamps": _board(Text("line", "comma", "F", 1), 4095, lines=1),
    "blocks": _board(Text("block"), 255, order="columns"),
    "blocks, prefix": _board(
        Text("block", "semicolon", "R", 1), 65535, pressure="falls"
    ),
}


def frames_of_file(board: Board, count: int, seed: int = 1) -> list[Cells]:
    """Return different frames, with zeros in runs, that the board can send."""
    draw = np.random.default_rng(seed)
    sensor = board.sensor
    shape = (count, sensor.rows, sensor.columns)
    frames = draw.integers(0, sensor.full + 1, shape)
    frames[draw.random(shape) < 0.4] = 0
    if isinstance(board.protocol, Sentinel):
        for value in {board.protocol.end, board.protocol.zero} - {0}:
            frames[frames == value] = 3
    frames[:, 0, 0] = 20 + np.arange(count)
    return [*frames]


def stream_of(board: Board, frames: Sequence[Cells]) -> bytes:
    """Return what the board sends from its start on."""
    parts = [encoded(board, frame, number) for number, frame in enumerate(frames)]
    return banner(board) + b"".join(parts)


def check_account(decoder: Decoder) -> None:
    """Check that every byte belongs to a frame, is skipped or waits."""
    counters = decoder.counters
    assert counters.bytes == decoder.framed + counters.skipped + decoder.pending
