"""What every decoder of a board does: take bytes, give frames, count both."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Final

import numpy as np

from fuzzytree.tactile.boards import Board
from fuzzytree.tactile.sensor import Cells, Counters

_SLICE: Final = 2**16  # bytes that are looked at together: it bounds the memory
_LONGEST_BANNER_LINE: Final = 1000
_TEXT: Final = bytes([9, 13, *range(32, 127)])


class Decoder(ABC):
    """Find frames in the bytes of a board, however these are cut into pieces.

    Every byte is accounted for: `counters.bytes` is `framed` plus `counters.skipped`
    plus `pending`.

    Attributes:
        ask: What to send for each frame; empty for boards that speak by themselves.
        counters: What came in.
        framed: How many bytes belong to frames that were given out.
    """

    ask: bytes = b""

    def __init__(self, board: Board) -> None:
        """Begin a stream."""
        self.counters = Counters()
        self.framed = 0
        self._buffer = bytearray()
        self._need = 1  # the fewest bytes in the buffer that can decide anything
        self._board = board
        self._banner = board.banner  # lines of it that may still come

    @property
    def pending(self) -> int:
        """How many bytes wait for others."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Cells]:
        """Return the frames that end in some bytes, in their order.

        Args:
            data: The next bytes of the stream, any number of them.

        Returns:
            Arrays of shape (rows, columns), uint8 if the sensor's `full` is at most
            255, else uint16.
        """
        frames: list[Cells] = []
        for start in range(0, len(data), _SLICE):
            piece = data[start : start + _SLICE]
            self.counters.bytes += len(piece)
            self._buffer += piece
            if len(self._buffer) >= self._need:
                frames += self._take()
        return frames

    def flush(self) -> list[Cells]:
        """Return the frames that only waited for confirmation: nothing more comes.

        What cannot become a frame any more is skipped, and a new stream begins.
        """
        frames = self._take_last()
        self._skip(len(self._buffer))
        self._need = 1
        return frames

    def requested(self) -> None:  # noqa: B027  # most boards need no request
        """Note that `ask` was sent: bytes that came before are no part of the answer.

        Without effect for boards that speak by themselves.
        """

    def timed_out(self) -> None:  # noqa: B027  # as above
        """Note that an answer did not come whole in time; what came of it is damaged.

        A late rest would be taken for the next answer: ask again only when the board
        has been silent. Without effect for boards that speak by themselves.
        """

    @abstractmethod
    def _take(self) -> list[Cells]:
        """Return the frames that the buffer holds, and take them out."""

    @abstractmethod
    def _take_last(self) -> list[Cells]:
        """Return the frames that only waited for more, and begin again."""

    def _pass_banner(self) -> int:
        """Skip what there is of the banner; return how many bytes that was.

        Bytes that are no text end the banner, also in the middle of a line, and so
        does a line of more than 1000 bytes.
        """
        data, taken = bytes(self._buffer), 0
        while self._banner:
            end = data.find(b"\n", taken)
            line = data[taken:] if end < 0 else data[taken:end]
            if line.translate(None, _TEXT) or len(line) > _LONGEST_BANNER_LINE:
                self._banner = 0
            elif end < 0:
                break
            else:
                taken, self._banner = end + 1, self._banner - 1
        self._skip(taken)
        return taken

    def _skip(self, count: int) -> None:
        """Drop bytes that belong to no frame."""
        self.counters.skipped += count
        del self._buffer[:count]

    def _frames(self, values: Cells) -> list[Cells]:
        """Return cells in the order of the board, a frame in each row, as frames."""
        rows, columns = self._board.sensor.rows, self._board.sensor.columns
        if self._board.order == "columns":
            whole = values.reshape(-1, columns, rows).transpose(0, 2, 1)
        else:
            whole = values.reshape(-1, rows, columns)
        if self._board.pressure == "falls":
            # Nothing is below 0: what reads above full was refused.
            whole = self._board.sensor.full - whole.astype(np.int64)
        self.counters.frames += len(whole)
        return list(np.ascontiguousarray(whole, self._board.sensor.dtype))


def largest_cell(board: Board) -> int:
    """Return the most that a cell of a whole frame can hold, as it was sent."""
    sensor = board.sensor
    return sensor.full if board.pressure == "falls" else sensor.largest
