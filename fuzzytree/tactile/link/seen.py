"""What bytes look like that a board's file cannot explain."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import assert_never

from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.link.fixed import layout_of
from fuzzytree.tactile.link.texts import SEPARATORS


def line_bytes(board: Board) -> int:
    """Return about how many bytes a frame has on the line: text and runs vary."""
    cells = board.sensor.rows * board.sensor.columns
    match board.protocol:
        case Sentinel():
            return cells + 1
        case Text():
            return cells * (len(str(board.sensor.full)) + 1)
        case Marker() | Request() as protocol:
            return layout_of(board, protocol).size
        case _:
            assert_never(board.protocol)


def seen(board: Board, content: bytes, *, asked: int = 0) -> str:
    """Return what stands in bytes that held no frame, for the one who described it.

    Args:
        board: What was expected.
        content: What came; not empty.
        asked: How often the board was asked for a frame meanwhile.

    Returns:
        A clause, in one line.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> board = Board("mat", Sensor(2, 2), Marker("AA"))
        >>> print(seen(board, bytes.fromhex("AA 01 02 03 04 05 06") * 9))
        the marker AA came 9 times, mostly 7 bytes apart, which is 3 x 2 and not 2 x 2
    """
    match board.protocol:
        case Marker() as protocol:
            found = _seen_markers(board, protocol, content)
        case Sentinel() as protocol:
            found = _seen_ends(board, protocol, content)
        case Request() as protocol:
            found = _seen_answers(board, protocol, content, asked)
        case Text() as protocol:
            found = _seen_lines(board, protocol, content)
        case _:
            assert_never(board.protocol)
    if not isinstance(board.protocol, Text) and _is_text(content):
        return f"nearly all of it is text; {found}"
    return found


def _seen_markers(board: Board, protocol: Marker, content: bytes) -> str:
    marker = bytes.fromhex(protocol.marker)
    shown = marker.hex(" ").upper()
    places = [found.start() for found in re.finditer(re.escape(marker), content)]
    if len(places) < 2:
        how_often = ("never came", "came only once")[len(places)]
        return f"the marker {shown} {how_often}: is the baud rate right?"
    text = f"the marker {shown} came {len(places)} times"
    apart = _usual([after - before for before, after in pairwise(places)])
    if apart is None:
        return f"{text}, at no steady distance"
    wrong = _wrong_bytes(board, apart - _around(board, protocol), protocol.bits)
    return f"{text}, mostly {apart} bytes apart{wrong or _wrong_around(protocol)}"


def _seen_ends(board: Board, protocol: Sentinel, content: bytes) -> str:
    end = bytes([protocol.end])
    frames = content.split(end)[1:-1]
    text = f"the end {protocol.end} came {content.count(end)} times"
    size = _usual([_unpacked_length(frame, protocol.zero) for frame in frames])
    if size is None:
        return f"{text}: is the baud rate right?" if len(frames) < 2 else text
    return f"{text}, mostly behind {size} values{_wrong_cells(board, size)}"


def _seen_answers(board: Board, protocol: Request, content: bytes, asked: int) -> str:
    text = f"the board was asked {asked} times"
    if not asked:
        return text
    size = round(len(content) / asked)
    wrong = _wrong_bytes(board, size - _around(board, protocol), protocol.bits)
    return f"{text} and gave about {size} bytes each time{wrong}"


def _seen_lines(board: Board, protocol: Text, content: bytes) -> str:
    lines = [line.strip() for line in content.split(b"\n")[1:-1]]
    if not _is_text(content):
        return "it is no text: is the baud rate right?"
    split = SEPARATORS[protocol.separator]
    counts = [
        len(words) - protocol.skip
        for line in lines
        if (words := _numbers(line, protocol.prefix.encode(), split))
    ]
    text = f"{len(lines)} lines came"
    if not counts:
        return f"{text}, none of them only numbers with {protocol.separator} between"
    count = _usual(counts)
    if count is None:
        return f"{text}, not two of them with as many numbers"
    if protocol.frame == "line":
        wrong = _wrong_cells(board, count)
    else:
        rows, columns = board.sensor.rows, board.sensor.columns
        wanted = columns if board.order == "rows" else rows
        wrong = f" and not {wanted}" if wanted != count else ""
    return f"{text}, mostly of {count} numbers{wrong}"


def _numbers(line: bytes, prefix: bytes, split: bytes | None) -> list[bytes]:
    """Return the numbers of a line, or nothing if it holds anything else."""
    words = [word.strip() for word in line.split(split)]
    if prefix:
        if not words or words[0] != prefix:
            return []
        words = words[1:]
    return words if all(word.isdigit() for word in words) else []


def _wrong_bytes(board: Board, size: int, bits: int) -> str:
    """Return which matrix so many bytes are, or "" if it is the board's."""
    own, other = bits // 8, 3 - bits // 8
    if size == board.sensor.rows * board.sensor.columns * other:
        shape = f"{board.sensor.rows} x {board.sensor.columns}"
        return f", which is {shape} cells of {8 * other} bits and not {bits}"
    if size <= 0 or size % own:
        return f", which is no number of cells of {bits} bits"
    return _wrong_cells(board, size // own)


def _wrong_cells(board: Board, cells: int) -> str:
    """Return which matrix so many cells are, or "" if it is the board's."""
    rows, columns = board.sensor.rows, board.sensor.columns
    if cells == rows * columns:
        return ""
    if cells and cells % columns == 0:
        return f", which is {cells // columns} x {columns} and not {rows} x {columns}"
    if cells and cells % rows == 0:
        return f", which is {rows} x {cells // rows} and not {rows} x {columns}"
    return f", which is {cells} cells and not {rows} x {columns}"


def _wrong_around(protocol: Marker) -> str:
    """Return what remains to be wrong where the length is right."""
    parts = [
        *(["the sizes"] if protocol.sizes else []),
        *(["the checksum"] if protocol.checksum != "none" else []),
        *(["the tail"] if protocol.tail else []),
    ]
    return f", as expected, but {' or '.join(parts)} did not fit" if parts else ""


def _around(board: Board, protocol: Marker | Request) -> int:
    """Return how many bytes of a frame are no cells."""
    layout = layout_of(board, protocol)
    return layout.size - layout.cell_bytes


def _unpacked_length(frame: bytes, zero: int) -> int:
    length = place = 0
    while place < len(frame):
        if frame[place] == zero and place + 1 < len(frame):
            length += frame[place + 1]
            place += 2
        else:
            length += 1
            place += 1
    return length


def _usual(numbers: Sequence[int]) -> int | None:
    """Return the most frequent number, if it comes more than once."""
    if not numbers:
        return None
    number, count = Counter(numbers).most_common(1)[0]
    return number if count > 1 else None


def _is_text(content: bytes) -> bool:
    plain = sum(32 <= byte < 127 or byte in b"\t\r\n" for byte in content)
    return plain > 0.95 * len(content)
