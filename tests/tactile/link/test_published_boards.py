"""The boards of others: bytes as their makers describe them become frames.

The bytes are put together here from the descriptions, without the encoder.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fuzzytree.tactile.board_file import load_board
from fuzzytree.tactile.link import decoder_of
from fuzzytree.tactile.sensor import Cells

BOARDS = Path(__file__).parents[3] / "examples" / "tactile" / "boards"


def sensitronics(cells: Cells) -> bytes:
    sent: list[int] = []
    zeros = 0
    for value in [*cells.ravel().tolist(), -1]:
        if value == 0 and zeros < 254:
            zeros += 1
            continue
        if zeros:
            sent += [0, zeros]
        zeros = int(value == 0)
        sent += [value] if value > 0 else []
    return bytes([*sent, 0xFF])


def fsrray(cells: Cells) -> bytes:
    return struct.pack("<II", 12345, 67890) + struct.pack("<256H", *cells.ravel())


def fsrray_without_stamps(cells: Cells) -> bytes:
    return struct.pack("<256H", *cells.ravel())


def flexitac(cells: Cells) -> bytes:
    return b"\xaa\x55" + bytes(cells.ravel().tolist())


def rows_and_an_empty_line(cells: Cells) -> bytes:
    lines = (" ".join(map(str, row)) for row in cells.tolist())
    return ("\r\n".join(lines) + "\r\n\r\n").encode()


def kobakant(cells: Cells) -> bytes:
    # The rows are pulled up: a cell that nothing presses reads 1023.
    pulled_up = (1023 - cells).T.ravel()
    return (" ".join(map(str, pulled_up)) + "\r\n").encode()


def velostat(cells: Cells) -> bytes:
    return bytes(cells.T.ravel().tolist())


def op_amp(cells: Cells) -> bytes:
    return ("F,81234567," + ",".join(map(str, cells.ravel())) + "\n").encode()


def dots(cells: Cells) -> bytes:
    return b"DOTS" + struct.pack(">HH", 16, 16) + bytes(cells.ravel().tolist())


def fsr16x16(cells: Cells) -> bytes:
    lines = ("\t".join(map(str, row)) for row in cells.tolist())
    titles = "Center point (8,8) value: 77\r\nFull matrix:\r\n"
    return (titles + "\r\n".join(lines) + "\r\n").encode()


PUBLISHED: dict[str, tuple[Callable[[Cells], bytes], bytes]] = {
    "sensitronics-16x16": (sensitronics, b""),
    "fsrray-16x16": (fsrray, b""),
    "fsrray-16x16-without-stamps": (fsrray_without_stamps, b""),
    "flexitac-12x32": (flexitac, b""),
    "3d-vitac-16x16": (rows_and_an_empty_line, b""),
    "kobakant-15x14": (kobakant, b""),
    "velostat-16x16": (velostat, b"Velostat 16x16 Streaming Ready\r\n"),
    "op-amp-10x10": (op_amp, b"CFG,10,10\n"),
    "dots-16x16": (dots, b""),
    "fsr16x16-bnl": (
        fsr16x16,
        b"FSR16x16_BNL Direct-to-Direct Example Starting...\r\n",
    ),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_what_a_board_sends_becomes_its_frames(name: str) -> None:
    send, start = PUBLISHED[name]
    board = load_board(BOARDS / f"{name}.yaml")
    sensor = board.sensor
    draw = np.random.default_rng(1)
    shape = (5, sensor.rows, sensor.columns)
    least = 1 if name == "velostat-16x16" else 0
    frames = draw.integers(least, sensor.full + 1, shape)
    frames[draw.random(shape) < 0.7] = least
    decoder = decoder_of(board)
    data = start + b"".join(map(send, frames))
    got = [*decoder.feed(data), *decoder.flush()]
    assert [frame.tolist() for frame in got] == frames.tolist()
    assert decoder.counters.damaged == 0


def test_every_published_board_is_tested() -> None:
    assert {path.stem for path in BOARDS.glob("*.yaml")} == set(PUBLISHED)
