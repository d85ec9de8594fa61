"""The bytes of a recording: its header, its records, and what lies between them.

`docs/reference/recordings.md` has the layout, byte by byte.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import astuple, fields
from typing import Final, NamedTuple

import msgspec
import numpy as np

from fuzzytree.errors import ReadError, TableError, WriteError
from fuzzytree.tactile.boards import Board
from fuzzytree.tactile.frames import Counters, Frame
from fuzzytree.tactile.sensor import check_frames

MAGIC: Final = b"\x89FTR\r\n\x1a\n"
MARK: Final = b"\xf5fr\n"
VERSION: Final = 1
LARGEST_BOARD: Final = 4 * 2**20
"""The most bytes that the text of a board may have."""

FIXED: Final = np.dtype(
    [
        ("magic", "S8"),
        ("version", "<u2"),
        ("rows", "<u2"),
        ("columns", "<u2"),
        ("cell_bytes", "u1"),
        ("counters", "u1"),
        ("record_bytes", "<u4"),
        ("board_bytes", "<u4"),
        ("started_ns", "<i8"),
    ]
)
"""What stands at the beginning, before the text of the board."""

_NS = 1_000_000_000
_COUNTERS = len(fields(Counters))
_PATIENCE = 8  # how often each byte may be looked at,
_TRIES_BYTES = 2**24  # beside these


class Record(NamedTuple):
    """A frame, and what the line had counted when it came."""

    frame: Frame
    counters: Counters


def header(board: Board, started_ns: int) -> bytes:
    """Return the beginning of a recording: sizes, time and the board as text.

    Args:
        board: Its fields as JSON, which is YAML too.
        started_ns: Since 1970 (UTC).

    Raises:
        WriteError: If the board is too large.
    """
    text = msgspec.json.format(msgspec.json.encode(board), indent=1) + b"\n"
    if len(text) > LARGEST_BOARD:
        raise WriteError(f"a board of {len(text)} bytes is too large for a recording")
    content = fixed_part(board, len(text), started_ns) + text
    return content + crc(content)


def fixed_part(
    board: Board, board_bytes: int, started_ns: int, *, counters: int = _COUNTERS
) -> bytes:
    """Return the part of the header that is of the same length in every file."""
    fields = (
        MAGIC,
        VERSION,
        board.sensor.rows,
        board.sensor.columns,
        cell_type(board).itemsize,
        counters,
        layout_of(board, counters=counters).itemsize,
        board_bytes,
        started_ns,
    )
    return np.array(fields, FIXED).tobytes()


def cell_type(board: Board) -> np.dtype[np.unsignedinteger]:
    """Return the type of a cell, as a decoder gives it."""
    return np.dtype("u1" if board.sensor.bits == 8 else "<u2")


def layout_of(board: Board, *, counters: int = _COUNTERS) -> np.dtype[np.void]:
    """Return how the fields of a record lie in its bytes.

    Args:
        board: What sends the frames.
        counters: How many a record has; there may be more in a later version.
    """
    shape = (board.sensor.rows, board.sensor.columns)
    return np.dtype(
        [
            ("mark", "S4"),
            ("number", "<i8"),
            ("time_ns", "<i8"),
            ("counters", "<i8", (counters,)),
            ("cells", cell_type(board), shape),
            ("crc", "<u4"),
        ]
    )


def packed(record: Record, board: Board) -> bytes:
    """Return a record as bytes.

    Raises:
        TableError: If the frame is of another size, or a cell has no place.
    """
    frame, counters = record
    fields = np.zeros((), layout_of(board))
    cells = check_frames(board.sensor, frame.cells)[0]
    largest = np.iinfo(cell_type(board)).max
    if cells.min() < 0 or cells.max() > largest:
        wrong = cells.min() if cells.min() < 0 else cells.max()
        raise TableError(f"a cell lies in 0 to {largest}, not {wrong}")
    fields["mark"] = MARK
    fields["number"] = frame.number
    fields["time_ns"] = round(frame.time * _NS)
    fields["counters"] = astuple(counters)
    fields["cells"] = cells
    content = fields.tobytes()[:-4]
    return content + crc(content)


def unpacked_sizes(fixed: bytes, name: str) -> int:
    """Return how long the text of the board is that follows the fixed part.

    Raises:
        ReadError: If it is no beginning of a recording.
    """
    if not fixed.startswith(MAGIC) or len(fixed) < FIXED.itemsize:
        raise ReadError(f"{name}: is no recording of a board")
    head = np.frombuffer(fixed, FIXED, 1)[0]
    if head["version"] != VERSION:
        raise ReadError(
            f"{name}: is a recording of version {head['version']}; "
            f"this program reads version {VERSION}"
        )
    return int(head["board_bytes"])


def unpacked_board(content: bytes, name: str) -> tuple[Board, int, int]:
    """Return a header's board, when it began, and how many counters a record has.

    Raises:
        ReadError: If the header is damaged, or contradicts itself.
    """
    fixed, text = content[: FIXED.itemsize], content[FIXED.itemsize : -4]
    is_whole = len(text) == unpacked_sizes(fixed, name)
    if not is_whole or crc(content[:-4]) != content[-4:]:
        raise ReadError(f"{name}: its header is damaged")
    head = np.frombuffer(fixed, FIXED)[0]
    started_ns, counters = int(head["started_ns"]), int(head["counters"])
    try:
        board = msgspec.json.decode(text, type=Board)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise ReadError(f"{name}: its board cannot be read: {error}") from error
    if fixed_part(board, len(text), started_ns, counters=counters) != fixed:
        raise ReadError(f"{name}: its header contradicts its board")
    return board, started_ns, counters


def pieces(
    chunks: Iterable[bytes], layout: np.dtype[np.void], name: str
) -> Iterator[Record | int]:
    """Give records, and between them how many bytes belong to none."""
    length = layout.itemsize
    window, passed, tried = b"", 0, 0
    for chunk in chunks:
        window += chunk
        at = 0
        while at + length <= len(window):
            if (record := unpacked(window[at : at + length], layout)) is not None:
                at += length
                yield record
                continue
            # A file made to be slow has a mark everywhere, and each is tried.
            tried += length if window.startswith(MARK, at) else 0
            if tried > _PATIENCE * (passed + at) + _TRIES_BYTES:
                raise ReadError(f"{name}: is damaged all over")
            found = window.find(MARK, at + 1)
            after = found if found >= 0 else max(len(window) - len(MARK) + 1, at + 1)
            yield after - at
            at = after
        window, passed = window[at:], passed + at
    if window:
        yield len(window)


def unpacked(content: bytes, layout: np.dtype[np.void]) -> Record | None:
    """Return a record, or None if the bytes are none, or a damaged one."""
    if not content.startswith(MARK) or content[-4:] != crc(content[:-4]):
        return None
    fields = np.frombuffer(content, layout)[0]
    counters, time_ns = fields["counters"].tolist(), int(fields["time_ns"])
    number = int(fields["number"])
    if min(number, time_ns, *counters) < 0:
        return None
    return Record(
        Frame(fields["cells"], time_ns / _NS, number), Counters(*counters[:_COUNTERS])
    )


def crc(content: bytes) -> bytes:
    """Return the CRC-32 (that of zip and PNG), low byte first."""
    return zlib.crc32(content).to_bytes(4, "little")
