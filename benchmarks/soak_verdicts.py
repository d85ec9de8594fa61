"""Whether bytes explain a frame that came out of them, by other means than decoders'.

The bytes are searched for the frame, whole; nothing is read one after the other.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal, assert_never

from simulated_board import checksum

from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.sensor import Cells

Verdict = Literal["untold", "late", "unexplained"]
"""As the columns of the table of `soak.py`."""


def explained(board: Board, recent: bytes, cells: Cells) -> Verdict:
    """Return how bytes explain a frame that came out and that was never sent."""
    protocol = board.protocol
    match protocol:
        case Marker():
            return _explained_marker(board, protocol, recent, cells)
        case Request():
            return _explained_request(board, protocol, recent, cells)
        case Sentinel():
            values = _in_order(board, cells)
            end = bytes([protocol.end])
            pieces = (unpacked(protocol, piece) for piece in recent.split(end))
            return "untold" if values in pieces else "unexplained"
        case Text():
            return _explained_text(board, protocol, recent, cells)
        case _:
            assert_never(protocol)


def _in_order(board: Board, cells: Cells) -> list[int]:
    turned = cells.T if board.order == "columns" else cells
    return [int(value) for value in turned.ravel()]


def _payload(board: Board, protocol: Marker | Request, cells: Cells) -> bytes:
    size = protocol.bits // 8
    values = _in_order(board, cells)
    return b"".join(value.to_bytes(size, protocol.byte_order) for value in values)


def _explained_marker(
    board: Board, protocol: Marker, recent: bytes, cells: Cells
) -> Verdict:
    marker, tail = bytes.fromhex(protocol.marker), bytes.fromhex(protocol.tail)
    payload = _payload(board, protocol, cells)
    sizes = b""
    if protocol.sizes != "none":
        pair = (board.sensor.rows, board.sensor.columns)
        sizes = b"".join(side.to_bytes(2, protocol.byte_order) for side in pair)
    behind = len(checksum(protocol.checksum, payload)) + len(tail)
    before = len(marker) + len(sizes) + protocol.skip
    verdict: Verdict = "unexplained"
    for found in _places(recent, payload):
        begin, end = found - before, found + len(payload)
        after = end + behind
        if begin < 0 or not recent.startswith(marker + sizes, begin):
            continue
        check = checksum(protocol.checksum, recent[begin + len(marker) : end])
        if recent[end:after] != check + tail:
            continue
        if recent.startswith(marker, after) or len(recent) < after + len(marker):
            return "untold"
        # Only the next frame could tell. Was it expected here: behind the last
        # one, or one frame further?
        size = after - begin
        steps = (begin - size, begin - 2 * size)
        if behind or any(
            step >= 0 and recent.startswith(marker, step) for step in steps
        ):
            verdict = "late"
    return verdict


def _explained_request(
    board: Board, protocol: Request, recent: bytes, cells: Cells
) -> Verdict:
    payload = _payload(board, protocol, cells)
    for found in _places(recent, payload):
        end = found + len(payload)
        body = recent[max(found - protocol.skip, 0) : end]
        check = checksum(protocol.checksum, body)
        if recent[end : end + len(check)] == check:
            return "untold" if end + len(check) == len(recent) else "late"
    return "unexplained"


def _places(recent: bytes, payload: bytes) -> Iterator[int]:
    found = recent.find(payload)
    while found >= 0:
        yield found
        found = recent.find(payload, found + 1)


def unpacked(protocol: Sentinel, piece: bytes) -> list[int] | None:
    """Return the cells of a frame without its end; None if a run is none."""
    values: list[int] = []
    place = 0
    while place < len(piece):
        if piece[place] != protocol.zero:
            values.append(piece[place])
            place += 1
            continue
        if place + 1 == len(piece) or not piece[place + 1]:
            return None
        values += [0] * piece[place + 1]
        place += 2
    return values


def _explained_text(
    board: Board, protocol: Text, recent: bytes, cells: Cells
) -> Verdict:
    values = _in_order(board, cells)
    lines = [numbers(protocol, line) for line in recent.split(b"\n")]
    if protocol.frame == "line":
        return "untold" if values in lines else "unexplained"
    sensor = board.sensor
    width = sensor.columns if board.order == "rows" else sensor.rows
    height = len(values) // width
    block = [values[start : start + width] for start in range(0, len(values), width)]
    verdict: Verdict = "unexplained"
    for place in range(len(lines) - height + 1):
        if lines[place : place + height] == block:
            behind = lines[place + height] if place + height < len(lines) else None
            if behind is None and (place == 0 or lines[place - 1] is None):
                return "untold"
            verdict = "late"
    return verdict


def numbers(protocol: Text, line: bytes) -> list[int] | None:
    """Return the cells of a line; None if it holds none."""
    separator = {"space": rb"[ \t]+", "comma": rb"[ \t]*,[ \t]*"}[protocol.separator]
    words = re.split(separator, line.strip(b" \t\r"))
    if protocol.prefix:
        if words[0] != protocol.prefix.encode():
            return None
        words = words[1:]
    words = words[protocol.skip :]  # whatever they are
    if not words or not all(word.isdigit() for word in words):
        return None
    return [int(word) for word in words]
