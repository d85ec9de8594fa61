"""What a board puts on the line for a frame: the other side of the decoders.

What proves a frame (checksums, runs of zeros, lines) is written from the description in
`tactile/boards.py` alone, so that a frame that goes out here and comes in there is a
test of both.
"""

from __future__ import annotations

from typing import assert_never

import numpy as np
import numpy.typing as npt

from fuzzytree.errors import TableError
from fuzzytree.tactile.boards import (
    Board,
    Checksum,
    Marker,
    Request,
    Sentinel,
    Text,
)
from fuzzytree.tactile.link.fixed import layout_of
from fuzzytree.tactile.sensor import Cells, check_frames

_SEPARATORS = {"space": " ", "comma": ",", "semicolon": ";"}
_NEWLINE = "\r\n"  # what println of an Arduino ends a line with


def encoded(board: Board, cells: Cells, number: int = 0) -> bytes:
    """Return the bytes of one frame, from the first to the last.

    The number of the frame, from 0, stands where boards put a time stamp.

    Raises:
        TableError: If the cells are of another size, or hold what this board cannot
            send.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> protocol = Marker("AA 55", checksum="sum8")
        >>> board = Board("tiny", Sensor(1, 3), protocol)
        >>> encoded(board, np.array([[1, 0, 2]])).hex(" ")
        'aa 55 01 00 02 03'
    """
    values = in_board_order(board, cells)
    protocol = board.protocol
    match protocol:
        case Marker() | Request():
            layout = layout_of(board, protocol)
            stamp = _stamp(number, protocol.skip)
            front = layout.head + stamp + values.astype(layout.dtype).tobytes()
            check = checksum(protocol.checksum, front[layout.checked_from :])
            return front + check + layout.tail
        case Sentinel():
            return _with_runs(protocol, values)
        case Text():
            return _lines(board, protocol, values, number)
        case _:
            assert_never(protocol)


def banner(board: Board) -> bytes:
    r"""Return the lines that the board sends when it starts.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> banner(Board("mat", Sensor(2, 2), Text(), banner=1))
        b'mat: ready\r\n'
    """
    name = "".join(sign for sign in board.name if " " <= sign <= "~") or "board"
    return f"{name}: ready{_NEWLINE}".encode() * board.banner


def in_board_order(board: Board, cells: Cells) -> npt.NDArray[np.int64]:
    """Return a frame's cells in the order in which the board sends them, checked.

    Raises:
        TableError: If there is not one frame, or a cell holds what cannot be sent.
    """
    frames = check_frames(board.sensor, cells)
    if len(frames) != 1:
        raise TableError(f"one frame is sent at a time, not {len(frames)}")
    frame = frames[0].T if board.order == "columns" else frames[0]
    values: npt.NDArray[np.int64] = frame.astype(np.int64).ravel()
    low, high = int(values.min()), int(values.max())
    if low < 0 or high > board.sensor.full:
        wrong = low if low < 0 else high
        raise TableError(f"a cell lies in 0 to {board.sensor.full}, not {wrong}")
    if board.pressure == "falls":
        values = board.sensor.full - values
        high = int(values.max())
    protocol = board.protocol
    if isinstance(protocol, Sentinel):
        for value in {protocol.end, protocol.zero} - {0}:
            if value in values:
                raise TableError(f"the board {board.name!r} has no cells of {value}")
    if not isinstance(protocol, Text):
        bits = 8 if isinstance(protocol, Sentinel) else protocol.bits
        if high >> bits:
            raise TableError(f"a cell of {high} does not fit into {bits} bits")
    return values


def checksum(kind: Checksum, body: bytes) -> bytes:
    """Return the checksum of some bytes: none, one or two bytes.

    `crc16` is that of Modbus (polynomial 0x8005 reflected, start 0xFFFF), low byte
    first.

    Example:
        >>> [checksum(k, b"123456789").hex() for k in ("sum8", "xor8", "crc16")]
        ['dd', '31', '374b']
    """
    match kind:
        case "none":
            return b""
        case "sum8":
            return bytes([sum(body) & 0xFF])
        case "xor8":
            return bytes([int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))])
        case "crc16":
            return _crc16(body).to_bytes(2, "little")
        case _:
            assert_never(kind)


def _crc16(body: bytes) -> int:
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return crc


def _stamp(number: int, size: int) -> bytes:
    return (number % (1 << 8 * size)).to_bytes(size, "little")


def _with_runs(protocol: Sentinel, values: npt.NDArray[np.int64]) -> bytes:
    """Return the cells with runs of zeros packed, and the byte that ends them."""
    sent = bytearray()
    run = 0
    for value in [*values.tolist(), None]:
        if value == 0:
            run += 1
            continue
        while run:
            length = min(run, 255)
            if length == protocol.end:  # would end the frame: two shorter runs
                length -= 1
            if length == 0:
                raise TableError(f"a run of {run} zeros would end the frame")
            sent += bytes((protocol.zero, length))
            run -= length
        if value is not None:
            sent.append(value)
    sent.append(protocol.end)
    return bytes(sent)


def _lines(
    board: Board, protocol: Text, values: npt.NDArray[np.int64], number: int
) -> bytes:
    separator = _SEPARATORS[protocol.separator]
    is_block = protocol.frame == "block"
    by_row = board.order == "rows"
    width = board.sensor.columns if by_row else board.sensor.rows
    stamps = [number] * protocol.skip
    first = [protocol.prefix] if protocol.prefix else []
    lines = [
        separator.join(map(str, [*first, *stamps, *line]))
        for line in values.reshape(-1, width if is_block else len(values)).tolist()
    ]
    text = "".join(f"{line}{_NEWLINE}" for line in lines)
    return f"{text}{_NEWLINE if is_block else ''}".encode()
