"""Silence on a port, late answers, and bytes that are no frames of the board."""

from __future__ import annotations

from collections import Counter
from typing import Final, assert_never

from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.link.fixed import layout_of
from fuzzytree.tactile.link.texts import SEPARATORS

STALL_FRAMES: Final = 10
"""For how many frame times a board may be silent."""
PATIENCE_S: Final = 3.0
"""How long a board may take to begin, and how long bytes may come that are no frame."""

_REST_S = 0.05  # without a byte: a late answer is over
_SHORTEST_STALL_S = 0.25
_KEPT_BYTES = 65536  # of bytes without a frame, to describe them


def described(board: Board, content: bytes, *, requests: int = 0) -> str:
    """Describe bytes without a frame, as a hint at what is wrong in the board's file.

    What stands between frames cuts them into pieces: their usual size says which
    matrix would fit.

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
    protocol = board.protocol
    plain = sum(32 <= byte < 127 or byte in b"\t\r\n" for byte in content)
    is_text = plain > 0.95 * len(content)
    match protocol:
        case Marker():
            marker = bytes.fromhex(protocol.marker)
            what, how = f"the marker {marker.hex(' ').upper()} came", "{} bytes apart"
            pieces = content.split(marker)
            sizes = [len(marker) + len(piece) for piece in pieces[1:-1]]
        case Sentinel():
            what, how = f"the end {protocol.end} came", "behind {} values"
            pieces = content.split(bytes([protocol.end]))
            sizes = [_unpacked_length(piece, protocol.zero) for piece in pieces[1:-1]]
        case Request():
            what, how = "a request was sent", "for {} bytes"
            pieces = [content] * (requests + 1)
            sizes = [round(len(content) / requests)] * requests if requests else []
        case Text():
            if not is_text:
                return "it is no text: is the baud rate right?"
            what = "the end of a line came"
            how = f"behind {{}} numbers with {protocol.separator} between"
            pieces = content.split(b"\n")
            split = SEPARATORS[protocol.separator]
            numbers = [
                sum(word.strip().isdigit() for word in piece.split(split))
                for piece in pieces[1:-1]
            ]
            sizes = [max(count - protocol.skip, 0) for count in numbers]
        case _:
            assert_never(protocol)
    text = "" if isinstance(protocol, Text) or not is_text else "nearly all is text; "
    text += f"{what} {len(pieces) - 1} times"
    if not sizes:
        return f"{text}: is the baud rate right?"
    size, count = Counter(sizes).most_common(1)[0]
    if count == 1 < len(sizes):
        return f"{text}, at no steady distance"
    return f"{text}, mostly {how.format(size)}, {_what_fits(board, size)}"


def _unpacked_length(frame: bytes, zero: int) -> int:
    length, values = 0, iter(frame)
    for value in values:
        length += next(values, 1) if value == zero else 1
    return length


def _what_fits(board: Board, size: int) -> str:
    """Return which matrix a piece is, or what else is wrong if it is the board's."""
    rows, columns, protocol = board.sensor.rows, board.sensor.columns, board.protocol
    cells = size
    if isinstance(protocol, Marker | Request):
        layout, bits = layout_of(board, protocol), protocol.bits
        inner = size - (layout.size - layout.cell_bytes)
        if inner == rows * columns * (24 - bits) // 8:
            return (
                f"which is {rows} x {columns} cells of {24 - bits} bits and not {bits}"
            )
        if inner <= 0 or inner % (bits // 8):
            return f"which is no number of cells of {bits} bits"
        cells = inner // (bits // 8)
    elif isinstance(protocol, Text) and protocol.frame == "block":
        cells *= rows if board.order == "rows" else columns
    if cells == rows * columns:
        parts = ("sizes", "checksum", "tail", "prefix")
        names = [one for one in parts if getattr(protocol, one, "") not in ("none", "")]
        return f"as expected, but the {' or the '.join([*names, 'cells'])} did not fit"
    found = f"{cells} cells"
    if cells and cells % columns == 0:
        found = f"{cells // columns} x {columns}"
    elif cells and cells % rows == 0:
        found = f"{rows} x {cells // rows}"
    return f"which is {found} and not {rows} x {columns}"


def frame_time(board: Board) -> float:
    """Return about how long a frame is on the line, in seconds: text and runs vary.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> round(frame_time(Board("mat", Sensor(16, 16), Marker("AA 55"))), 4)
        0.0224
    """
    cells, protocol = board.sensor.rows * board.sensor.columns, board.protocol
    if isinstance(protocol, Marker | Request):
        count = layout_of(board, protocol).size
    elif isinstance(protocol, Text):
        count = cells * (len(str(board.sensor.full)) + 1)
    else:
        count = cells + 1
    return count * board.port.bits_of_a_byte / board.port.baud


class Watch:
    """Follow what comes in and when to request more, without a clock of its own.

    All times are in seconds, and never go back. A late response must not be taken for
    that to the next request: after a time-out the next one waits until the board is
    silent.

    Example:
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
        self._unread = bytearray()  # since the last frame
        self._unread_since: float | None = None
        self._requests = 0  # since the last frame
        self._sent_at: float | None = None  # a request without response or time-out
        self._due = now  # when the next one may be sent

    @property
    def stall_s(self) -> float:
        """How long the board may be silent now.

        Boards that are USB devices keep to no baud rate: their own pace counts.
        """
        gap_s = self._frame_s if self._gap_s is None else self._gap_s
        shortest_s = _SHORTEST_STALL_S if self._has_frame else PATIENCE_S
        return max(STALL_FRAMES * gap_s, shortest_s)

    def is_due(self, now: float) -> bool:
        """Return whether to send a request now: never, if the board needs none."""
        is_request = isinstance(self._board.protocol, Request)
        return is_request and self._sent_at is None and now >= self._due

    def sent(self, now: float) -> None:
        """Note that a request was sent."""
        self._sent_at = now
        self._requests += 1

    def is_overdue(self, now: float) -> bool:
        """Return True, once for each request, if its response is late."""
        protocol = self._board.protocol
        if self._sent_at is None or not isinstance(protocol, Request):
            return False
        if now - self._sent_at <= protocol.timeout_s:
            return False
        self._sent_at, self._due = None, now + _REST_S
        return True

    def came(self, data: bytes, frames: int, now: float) -> None:
        """Note bytes, and how many frames ended in them."""
        self._last_byte = now
        if self._sent_at is None:
            self._due = now + _REST_S
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
        self._last_frame, self._sent_at = now, None
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
