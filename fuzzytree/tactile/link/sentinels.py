"""Frames that a byte of its own ends, with runs of zeros packed.

The byte that ends a frame is nowhere else, so the next beginning is known after any
damage. What proves a frame is the number of its cells alone: a value that changed is
not seen, nor a lost byte that another error makes up for.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fuzzytree.tactile.boards import Board, Sentinel
from fuzzytree.tactile.link.decoder import Decoder, largest_cell
from fuzzytree.tactile.link.fixed import Truths
from fuzzytree.tactile.sensor import Cells


class SentinelDecoder(Decoder):
    """Find frames before the bytes that end them."""

    def __init__(self, board: Board, protocol: Sentinel, *, is_joined: bool) -> None:
        """Begin a stream; a joined one first ends a frame that is not looked at."""
        super().__init__(board)
        self._protocol = protocol
        self._end = bytes([protocol.end])
        self._cells = board.sensor.rows * board.sensor.columns
        self._is_astray = is_joined  # inside a frame that is longer than any, or cut

    def _take(self) -> list[Cells]:
        if self._banner:
            self._is_astray &= not self._pass_banner()
            if self._banner:
                return []
        stop = self._buffer.rfind(self._end) + 1
        if self._is_astray:
            start = self._buffer.find(self._end) + 1
            if start:
                self._skip(start)
                stop -= start
                self._is_astray = False
        frames: list[Cells] = []
        if stop:
            data = bytes(self._buffer[:stop])
            del self._buffer[:stop]
            frames = self._decoded(np.frombuffer(data, np.uint8))
        if len(self._buffer) > 2 * self._cells:  # longer than any frame
            self.counters.damaged += not self._is_astray
            self._is_astray = True
            self._skip(len(self._buffer))
        return frames

    def _decoded(self, data: npt.NDArray[np.uint8]) -> list[Cells]:
        """Return the whole frames of bytes that end with the end of a frame."""
        is_end = data == self._protocol.end
        ends = is_end.nonzero()[0]
        starts = np.concatenate(([0], ends[:-1] + 1))
        marks = _every_other(data == self._protocol.zero)
        lengths = data[marks + 1]
        is_run = (lengths > 0) & ~is_end[marks + 1]
        counts = (~is_end).astype(np.int64)
        values = data.copy()
        values[marks] = 0
        counts[marks[is_run] + 1] = 0
        counts[marks[is_run]] = lengths[is_run]
        is_wrong = values > largest_cell(self._board)
        is_wrong &= counts > 0  # neither the end nor a length
        is_wrong[marks[~is_run]] = True
        totals = np.add.reduceat(counts, starts)
        good = totals == self._cells
        good &= ~np.logical_or.reduceat(is_wrong, starts)
        sizes = ends + 1 - starts
        self.framed += int(sizes[good].sum())
        self.counters.skipped += int(sizes[~good].sum())
        # An end behind an end is a stray byte, no frame.
        self.counters.damaged += int((~good & (sizes > 1)).sum())
        counts[~np.repeat(good, sizes)] = 0
        return self._frames(np.repeat(values, counts))

    def _take_last(self) -> list[Cells]:
        self.counters.damaged += bool(self._buffer) and not self._is_astray
        self._banner = self._board.banner
        self._is_astray = False
        return []


def _every_other(found: Truths) -> npt.NDArray[np.intp]:
    """Return the first, third, ... place of each row of places that touch.

    Behind the mark of a run stands its length, which may look like a mark itself.

    Example:
        >>> _every_other(np.array([1, 1, 1, 0, 1], bool)).tolist()
        [0, 2, 4]
    """
    places = found.nonzero()[0]
    index = np.arange(len(places))
    is_first = np.ones(len(places), np.bool_)
    is_first[1:] = np.diff(places) > 1
    first = np.maximum.accumulate(np.where(is_first, index, 0))
    marks: npt.NDArray[np.intp] = places[(index - first) % 2 == 0]
    return marks
