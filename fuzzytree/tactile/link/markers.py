"""Frames that begin with a marker and have a fixed length.

`docs/reference/boards.md` says where a beginning is believed: the marker can occur
among the cells. Once a frame is found, the next ones are given out at their last byte.
If no marker stands where the next one must begin, a byte of the last frame may have
been lost or added, unless two bytes of tail or checksum prove it: the next beginning is
looked for from its second byte on, for it may lie inside. If that is not a whole number
of frames further, the last frame is counted as doubtful.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link.decoder import Decoder
from fuzzytree.tactile.link.fixed import (
    Truths,
    are_whole,
    cells_of,
    layout_of,
    whole_blocks,
)
from fuzzytree.tactile.sensor import Cells

_SURE: Final = 2  # bytes of proof; one of them fits by chance once in 256 times
_MOST_AT_ONCE: Final = 1024  # markers that are looked at together
_MOST_PERIODS: Final = 8  # frames that are awaited to choose between beginnings


class MarkerDecoder(Decoder):
    """Find frames behind their markers."""

    def __init__(self, board: Board, protocol: Marker) -> None:
        """Begin a stream, anywhere in a frame."""
        super().__init__(board)
        self._layout = layout_of(board, protocol)
        self._size = self._layout.size
        self._is_proven = self._layout.proof_bytes >= _SURE
        self._is_confirmed = self._is_proven or protocol.sizes != "none"
        self._restart()

    def _restart(self) -> None:
        self._need = self._size
        self._is_locked = False
        self._last = b""  # the frame given out last, unless it is proven
        self._is_doubted = False  # the frame given out last, for its end was no end
        self._given = 0  # bytes at the front of the buffer that were given out in it
        self._expected: int | None = None  # where a frame had to begin in the buffer

    @property
    def pending(self) -> int:
        """How many bytes wait for others."""
        return len(self._buffer) - self._given

    def _take(self) -> list[Cells]:
        return self._taken(is_final=False)

    def _take_last(self) -> list[Cells]:
        frames = self._taken(is_final=True)
        expected = 0 if self._is_locked else self._expected
        if expected is not None:
            self._count_damaged(len(self._buffer) - expected)
        self.counters.doubtful += self._is_doubted
        self._drop(len(self._buffer))
        self._restart()
        return frames

    def _taken(self, *, is_final: bool) -> list[Cells]:
        frames: list[Cells] = []
        while is_final or len(self._buffer) >= self._need:
            if not self._is_locked and not self._is_found(is_final=is_final):
                break
            frames += self._run(is_final=is_final)
            if self._is_locked:
                break
        return frames

    def _run(self, *, is_final: bool) -> list[Cells]:
        """Give out the frames at the front; lose the lock where there is none."""
        blocks, good = whole_blocks(self._layout, bytes(self._buffer))
        count = len(good)
        whole = count if good.all() else int(good.argmin())
        frames = self._frames(cells_of(self._layout, blocks[:whole]))
        self.framed += whole * self._size
        del self._buffer[: whole * self._size]
        if whole and not self._is_proven:
            self._last = blocks[whole - 1].tobytes()
        self._need = self._size
        head = self._layout.head
        rest = bytes(self._buffer[: len(head)])
        if whole < count or (is_final and not head.startswith(rest)):
            self._lose()
        return frames

    def _lose(self) -> None:
        """Look for the next beginning, in the last frame too if it is not proven."""
        self.counters.resyncs += 1
        self._is_locked = False
        self._need = 0
        self._expected = 0
        if self._last:
            self._is_doubted = True
            self._buffer[:0] = self._last
            self._given = self._expected = self._size
            self._last = b""
        self._drop(1)

    def _is_found(self, *, is_final: bool) -> bool:
        """Bring the next beginning to the front; return whether there is one so far."""
        head, many = self._layout.head, 1
        while True:
            place = self._buffer.find(head)
            if place < 0:
                self._drop(max(len(self._buffer) - len(head) + 1, 0))
                self._need = len(self._buffer) + 1
                return False
            self._drop(place)
            if len(self._buffer) < self._size:
                self._need = self._size
                return False
            if not self._is_whole_soon(many):
                many = min(4 * many, _MOST_AT_ONCE)
                continue
            chosen = self._chosen(is_final=is_final)
            if chosen is None:
                return False
            if chosen >= 0:
                break
            self._drop(1)
        self._drop(chosen)
        self.framed -= self._given  # these bytes belong to this frame, not to the last
        self._given = 0
        if self._expected is not None:
            self._count_damaged(-self._expected)
            self.counters.doubtful += (
                self._is_doubted and self._expected % self._size != 0
            )
        self._expected = None
        self._is_doubted = False
        self._is_locked = True
        self._need = self._size
        return True

    def _is_whole_soon(self, many: int) -> bool:
        """Bring the next whole frame to the front; return whether one came soon.

        Markers at which none stands are skipped, so many at once: they may be frequent.
        """
        places: list[int] = []
        place = 0
        last = len(self._buffer) - self._size
        while 0 <= place <= last and len(places) < many:
            places.append(place)
            place = self._buffer.find(self._layout.head, place + 1)
        data = np.frombuffer(bytes(self._buffer[: places[-1] + self._size]), np.uint8)
        good = are_whole(self._layout, data, np.array(places))
        found = bool(good.any())
        self._drop(places[int(good.argmax())] if found else places[-1] + 1)
        return found

    def _chosen(self, *, is_final: bool) -> int | None:
        """Judge the marker at the front, at which a whole frame stands.

        Returns:
            Where a frame begins that is believed; -1 if none begins at the front;
            None if more bytes are needed.
        """
        if self._is_confirmed or self._expected in (0, -self._size):
            return 0
        size, head = self._size, self._layout.head
        if not head.startswith(self._buffer[size : size + len(head)]):
            return -1  # as most are; what follows looks at many more bytes
        alive = self._marks(0)
        if self._expected is not None and 0 < self._expected < size:
            # The marker there is damaged; the ones behind it may not be.
            alive[self._expected] = True
        for period in range(1, _MOST_PERIODS + 1):
            last = int(alive.nonzero()[0][-1]) if period > 1 else 0
            need = period * size + last + len(head)
            if len(self._buffer) < need and not is_final:
                self._need = need
                return None
            alive &= self._marks(period * size)
            if not alive[0]:
                return -1
            if not alive[1:].any():
                return 0
        if self._expected is None:
            return 0
        places = alive.nonzero()[0]
        away = (places - self._expected) % size
        order = np.minimum(away, size - away).argsort(kind="stable")
        nearest: list[int] = places[order].tolist()
        begins = (begin for place in nearest for begin in (place, place + size))
        return next(begin for begin in begins if self._is_whole(begin))  # at last 0

    def _is_whole(self, place: int) -> bool:
        block = bytes(self._buffer[place : place + self._size])
        return bool(whole_blocks(self._layout, block)[1].any())

    def _marks(self, start: int) -> Truths:
        """Return where the marker stands within a frame's length, or may stand."""
        head = self._layout.head
        inside = bytes(self._buffer[start : start + self._size + len(head) - 1])
        data = np.frombuffer(inside, np.uint8)
        found = np.ones(self._size, np.bool_)
        for place, byte in enumerate(head):
            seen = data[place : place + self._size]
            found[: len(seen)] &= seen == byte
        return found

    def _drop(self, count: int) -> None:
        """Skip bytes at the front, but those that were given out before."""
        given = min(count, self._given)
        self._given -= given
        del self._buffer[:given]
        self._skip(count - given)
        if self._expected is not None:
            self._expected -= count

    def _count_damaged(self, skipped: int) -> None:
        """Count the frames that fit into skipped bytes, rounded."""
        self.counters.damaged += max(0, (2 * skipped + self._size) // (2 * self._size))
