"""What a board puts on the line for a frame: the other side of the decoders.

Written from the description in `tactile/boards.py` alone, so that a frame that goes
out here and comes in there is a test of both.
"""

from __future__ import annotations

from functools import cache
from typing import Literal, assert_never

import numpy as np
import numpy.typing as npt

from fuzzytree.errors import TableError
from fuzzytree.tactile.boards import (
    Board,
    ByteOrder,
    Checksum,
    Marker,
    Request,
    Sentinel,
    Text,
)
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
        case Marker():
            sizes = b""
            if protocol.sizes != "none":
                pair = np.array([board.sensor.rows, board.sensor.columns])
                sizes = packed(pair, 16, protocol.byte_order)
            stamp = _stamp(number, protocol.skip)
            body = sizes + stamp + packed(values, protocol.bits, protocol.byte_order)
            check = checksum(protocol.checksum, body)
            head, tail = bytes.fromhex(protocol.marker), bytes.fromhex(protocol.tail)
            return head + body + check + tail
        case Sentinel():
            return _with_runs(protocol, values)
        case Request():
            stamp = _stamp(number, protocol.skip)
            body = stamp + packed(values, protocol.bits, protocol.byte_order)
            return body + checksum(protocol.checksum, body)
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


def packed(
    values: npt.NDArray[np.int64], bits: Literal[8, 16], byte_order: ByteOrder
) -> bytes:
    """Return whole numbers as bytes, 8 or 16 bits each."""
    if bits == 8:
        return bytes(values.astype(np.uint8))
    words = values.astype(np.uint16)
    return bytes(words.astype(words.dtype.newbyteorder(byte_order)).data)


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
    table, crc = _crc_table(), 0xFFFF
    for byte in body:
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFF]
    return crc


@cache
def _crc_table() -> tuple[int, ...]:
    table: list[int] = []
    for value in range(256):
        for _ in range(8):
            value = (value >> 1) ^ (0xA001 if value & 1 else 0)
        table.append(value)
    return tuple(table)


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
