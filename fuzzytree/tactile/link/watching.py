"""Whether frames come as they should: silence, and bytes that are no frames."""

from __future__ import annotations

from typing import Final

from fuzzytree.tactile.boards import Board, Request
from fuzzytree.tactile.link.seen import line_bytes, seen

STALL_FRAMES: Final = 10
"""For how many frame times a board may be silent."""
PATIENCE_S: Final = 3.0
"""How long a board may take to begin, and how long bytes may come that are no frame."""

_REST_S = 0.05  # without a byte: a late answer is over
_SHORTEST_STALL_S = 0.25
_KEPT_BYTES = 65536  # of those that are no frame, to tell what they look like


class Watch:
    """Follow what comes in, without a clock of its own.

    All times are in seconds, and never go back.

    Args:
        board: What is expected.
        now: When the port was opened.

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
        self._asked = 0  # since the last frame
        self._unread = bytearray()  # since the last frame
        self._unread_since: float | None = None

    @property
    def stall_s(self) -> float:
        """How long the board may be silent now.

        Boards that are USB devices keep to no baud rate: their own pace tells.
        """
        gap_s = self._frame_s if self._gap_s is None else self._gap_s
        shortest_s = _SHORTEST_STALL_S if self._has_frame else PATIENCE_S
        return max(STALL_FRAMES * gap_s, shortest_s)

    def asked(self) -> None:
        """Note that the board was asked for a frame."""
        self._asked += 1

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
        """Tell whether no byte came for as long as the board may be silent."""
        return now - self._last_byte > self.stall_s

    def is_silent(self, now: float) -> bool:
        """Tell, once for each silence, that no frame came for too long."""
        if self._is_silent or now - self._last_frame <= self.stall_s:
            return False
        self._is_silent = True
        return True

    def contradiction(self, now: float) -> str | None:
        """Tell, after each time of patience, what bytes came that are no frame.

        Returns:
            A sentence, or None if there is nothing to tell.
        """
        since = self._unread_since
        patience_s = max(PATIENCE_S, 2 * STALL_FRAMES * self._frame_s)
        if since is None or now - since <= patience_s:
            return None
        found = None
        if now - self._last_byte < patience_s / 2:
            what = seen(self._board, bytes(self._unread), asked=self._asked)
            text = f"for {now - since:.0f} s bytes came but no frame of"
            found = f"{text} {self._board.name!r}: {what}"
        self._forget()
        return found

    def _forget(self) -> None:
        self._unread.clear()
        self._unread_since, self._asked = None, 0


class Questions:
    """When to ask a board for its next frame: never, if it speaks by itself.

    A late answer must not be taken for that to the next question: after a time-out
    the board is asked again once it is silent.
    """

    def __init__(self, board: Board) -> None:
        request = board.protocol if isinstance(board.protocol, Request) else None
        self._timeout_s = request.timeout_s if request else 0.0
        self._is_needed = request is not None
        self._is_open = False  # asked, and neither answered nor given up
        self._asked_at = self._due = 0.0

    def is_overdue(self, now: float) -> bool:
        """Tell, once for each question, that its answer did not come in time."""
        if not self._is_open or now - self._asked_at <= self._timeout_s:
            return False
        self._is_open, self._due = False, now + _REST_S
        return True

    def is_due(self, now: float) -> bool:
        """Tell whether to ask now."""
        return self._is_needed and not self._is_open and now >= self._due

    def asked(self, now: float) -> None:
        """Note that the board was asked."""
        self._is_open, self._asked_at = True, now

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
    return line_bytes(board) * board.port.bits_of_a_byte / board.port.baud
