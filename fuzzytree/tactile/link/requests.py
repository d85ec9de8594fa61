"""Frames that the host asks for: answers of a fixed length.

Nothing marks where an answer begins, so the order of events must tell: the line says
when it asked (`asked`) and when it waited long enough (`timed_out`). Without these
calls the bytes are taken for one answer after the other.
"""

from __future__ import annotations

from fuzzytree.tactile.boards import Board, Request
from fuzzytree.tactile.link.decoder import Decoder, banner_bytes
from fuzzytree.tactile.link.fixed import are_whole, blocks_of, cells_of, layout_of
from fuzzytree.tactile.sensor import Cells


class RequestDecoder(Decoder):
    """Cut answers out of the bytes."""

    def __init__(self, board: Board, protocol: Request) -> None:
        """Begin a stream, with the banner if there is one."""
        super().__init__(board)
        self.ask = bytes.fromhex(protocol.ask)
        self._layout = layout_of(board, protocol)
        self._banner = board.banner
        self._is_given = False  # the last bytes were an answer, and it is not proven

    def asked(self) -> None:
        """Note that `ask` was sent: what came before is no part of the answer."""
        if not self._banner:
            # An answer that was too long: a byte of it may have been added.
            self.counters.doubtful += self._is_given and bool(self._buffer)
            self._is_given = False
            self._skip(len(self._buffer))

    def timed_out(self) -> None:
        """Note that an answer did not come whole in time.

        What came of it is damaged; a banner that did not come is awaited no longer.
        """
        self._banner = 0
        self._is_given = False
        self.counters.damaged += bool(self._buffer)
        self._skip(len(self._buffer))

    def _take(self) -> list[Cells]:
        if self._banner:
            taken, self._banner = banner_bytes(bytes(self._buffer), self._banner)
            self._skip(taken)
            if self._banner:
                return []
        count = len(self._buffer) // self._layout.size
        blocks = blocks_of(self._layout, self._buffer, count)
        good = are_whole(self._layout, blocks)
        whole = int(good.sum())
        if whole:
            self._is_given = self._layout.proof_bytes < 2
        self.counters.damaged += count - whole
        self.counters.skipped += (count - whole) * self._layout.size
        self.framed += whole * self._layout.size
        del self._buffer[: count * self._layout.size]
        return self._frames(cells_of(self._layout, blocks[good]))

    def _take_last(self) -> list[Cells]:
        self.counters.damaged += bool(self._buffer)
        self._banner = self._board.banner
        return []
