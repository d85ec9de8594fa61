"""Silence on a port, and bytes that are no frames of the expected board."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, assert_never

from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.link.fixed import layout_of
from fuzzytree.tactile.link.texts import SEPARATORS


def frame_bytes(board: Board) -> int:
    """Return about how many bytes a frame has on the line: text and runs vary."""
    cells, protocol = board.sensor.rows * board.sensor.columns, board.protocol
    if isinstance(protocol, Marker | Request):
        return layout_of(board, protocol).size
    width = len(str(board.sensor.full)) + 1
    return cells * width if isinstance(protocol, Text) else cells + 1


def described(board: Board, content: bytes, *, requests: int = 0) -> str:
    """Describe bytes without a frame, as a hint at what is wrong in the board's file.

    Args:
        board: What was expected.
        content: What came; not empty.
        requests: Number of requests that were sent meanwhile.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> board = Board("mat", Sensor(2, 2), Marker("AA"))
        >>> print(described(board, bytes.fromhex("AA 01 02 03 04 05 06") * 9))
        the marker AA came 9 times, mostly 7 bytes apart, which is 3 x 2 and not 2 x 2
    """
    match board.protocol:
        case Marker() as protocol:
            found = _described_markers(board, protocol, content)
        case Sentinel() as protocol:
            found = _described_ends(board, protocol, content)
        case Request() as protocol:
            found = _described_answers(board, protocol, content, requests)
        case Text() as protocol:
            found = _described_lines(board, protocol, content)
        case _:
            assert_never(board.protocol)
    if not isinstance(board.protocol, Text) and _is_text(content):
        return f"nearly all of it is text; {found}"
    return found


def _described_markers(board: Board, protocol: Marker, content: bytes) -> str:
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


def _described_ends(board: Board, protocol: Sentinel, content: bytes) -> str:
    end = bytes([protocol.end])
    frames = content.split(end)[1:-1]
    text = f"the end {protocol.end} came {content.count(end)} times"
    size = _usual([_unpacked_length(frame, protocol.zero) for frame in frames])
    if size is None:
        return f"{text}: is the baud rate right?" if len(frames) < 2 else text
    return f"{text}, mostly behind {size} values{_wrong_cells(board, size)}"


def _described_answers(
    board: Board, protocol: Request, content: bytes, requests: int
) -> str:
    text = f"the host sent {requests} requests"
    if not requests:
        return text
    size = round(len(content) / requests)
    wrong = _wrong_bytes(board, size - _around(board, protocol), protocol.bits)
    return f"{text} and received about {size} bytes for each{wrong}"


def _described_lines(board: Board, protocol: Text, content: bytes) -> str:
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
    parts = ("sizes", "checksum", "tail")
    names = [
        f"the {one}" for one in parts if getattr(protocol, one) not in ("none", "")
    ]
    return f", as expected, but {' or '.join(names)} did not fit" if names else ""


def _around(board: Board, protocol: Marker | Request) -> int:
    """Return how many bytes of a frame are no cells."""
    layout = layout_of(board, protocol)
    return layout.size - layout.cell_bytes


def _unpacked_length(frame: bytes, zero: int) -> int:
    length, values = 0, iter(frame)
    for value in values:
        length += next(values, 1) if value == zero else 1
    return length


def _usual(numbers: Sequence[int]) -> int | None:
    """Return the most frequent number, if it comes more than once."""
    number, count = Counter(numbers or [0]).most_common(1)[0]
    return number if count > 1 else None


def _is_text(content: bytes) -> bool:
    plain = sum(32 <= byte < 127 or byte in b"\t\r\n" for byte in content)
    return plain > 0.95 * len(content)


STALL_FRAMES: Final = 10
"""For how many frame times a board may be silent."""
PATIENCE_S: Final = 3.0
"""How long a board may take to begin, and how long bytes may come that are no frame."""

_REST_S = 0.05  # without a byte: a late answer is over
_SHORTEST_STALL_S = 0.25
_KEPT_BYTES = 65536  # of bytes without a frame, to describe them


class Watch:
    """Follow what comes in, without a clock of its own.

    All times are in seconds, and never go back.

    Example:
        >>> from fuzzytree.tactile.boards import Marker
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> watch = Watch(Board("mat", Sensor(2, 2), Marker("AA 55")), 0.0)
        >>> watch.came(b"0123", 1, 0.1)
        >>> watch.is_silent(0.2), watch.is_silent(9.0), watch.is_silent(9.1)
        (False, True, False)
    """

    def __init__(self, board: Board, now: float) -> None:
        self._board = board
        self._frame_s = frame_time(board)
        self._has_frame = self._is_silent = False
        self._gap_s: float | None = None  # between frames, smoothed
        self._last_frame = self._last_byte = now
        self._requests = 0  # since the last frame
        self._unread = bytearray()  # since the last frame
        self._unread_since: float | None = None

    @property
    def stall_s(self) -> float:
        """How long the board may be silent now.

        Boards that are USB devices keep to no baud rate: their own pace counts.
        """
        gap_s = self._frame_s if self._gap_s is None else self._gap_s
        shortest_s = _SHORTEST_STALL_S if self._has_frame else PATIENCE_S
        return max(STALL_FRAMES * gap_s, shortest_s)

    def requested(self) -> None:
        """Note that a request was sent."""
        self._requests += 1

    def came(self, data: bytes, frames: int, now: float) -> None:
        """Note bytes, and how many frames ended in them."""
        self._last_byte = now
        if not frames:
            self._unread += data
            del self._unread[:-_KEPT_BYTES]
            if self._unread_since is None:
                self._unread_since = now
            return
        if self._has_frame and not self._is_silent:
            gap_s = (now - self._last_frame) / frames
            known_s = gap_s if self._gap_s is None else self._gap_s
            self._gap_s = known_s + (gap_s - known_s) / 8  # they come in bursts
        self._has_frame, self._is_silent = True, False
        self._last_frame = now
        self._forget()

    def is_quiet(self, now: float) -> bool:
        """Return whether no byte came for as long as the board may be silent."""
        return now - self._last_byte > self.stall_s

    def is_silent(self, now: float) -> bool:
        """Return True, once for each silence, if no frame came for too long."""
        if self._is_silent or now - self._last_frame <= self.stall_s:
            return False
        self._is_silent = True
        return True

    def contradiction(self, now: float) -> str | None:
        """Describe bytes without a frame in a sentence, after each time of patience."""
        since = self._unread_since
        patience_s = max(PATIENCE_S, 2 * STALL_FRAMES * self._frame_s)
        if since is None or now - since <= patience_s:
            return None
        found = None
        if now - self._last_byte < patience_s / 2:
            what = described(self._board, bytes(self._unread), requests=self._requests)
            text = f"for {now - since:.0f} s bytes came but no frame of"
            found = f"{text} {self._board.name!r}: {what}"
        self._forget()
        return found

    def _forget(self) -> None:
        self._unread.clear()
        self._unread_since, self._requests = None, 0


class RequestTimer:
    """When to request the next frame: never, if the board sends by itself.

    A late response must not be taken for that to the next request: after a time-out
    the next request waits until the board is silent.
    """

    def __init__(self, board: Board) -> None:
        request = board.protocol if isinstance(board.protocol, Request) else None
        self._timeout_s = request.timeout_s if request else 0.0
        self._is_needed = request is not None
        self._is_open = False  # sent, without a response or a time-out
        self._sent_at = self._due = 0.0

    def is_overdue(self, now: float) -> bool:
        """Return True, once for each request, if its response is late."""
        if not self._is_open or now - self._sent_at <= self._timeout_s:
            return False
        self._is_open, self._due = False, now + _REST_S
        return True

    def is_due(self, now: float) -> bool:
        """Return whether to send a request now."""
        return self._is_needed and not self._is_open and now >= self._due

    def sent(self, now: float) -> None:
        """Note that a request was sent."""
        self._is_open, self._sent_at = True, now

    def came(self, frames: int, now: float) -> None:
        """Note that bytes came, and how many frames ended in them."""
        if not self._is_open:
            self._due = now + _REST_S
        self._is_open = self._is_open and not frames


def frame_time(board: Board) -> float:
    """Return about how long a frame is on the line, in seconds.

    Example:
        >>> from fuzzytree.tactile.boards import Marker
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> round(frame_time(Board("mat", Sensor(16, 16), Marker("AA 55"))), 4)
        0.0224
    """
    return frame_bytes(board) * board.port.bits_of_a_byte / board.port.baud
