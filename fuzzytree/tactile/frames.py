"""One frame of a board, and what is counted while frames come in."""

from __future__ import annotations

from dataclasses import dataclass, fields

from fuzzytree.tactile.sensor import Cells


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame as the board sent it.

    Attributes:
        cells: Shape (rows, columns); the first row at the top.
        time: When its last byte came, in seconds since the beginning.
        number: From 0, of the frames that came.
    """

    cells: Cells
    time: float
    number: int


@dataclass(slots=True)
class Counters:
    """What came in, and what was wrong with it.

    Attributes:
        bytes: All bytes that came.
        frames: Frames that were whole.
        damaged: Frames that began and were thrown away: a wrong checksum, length,
            marker or number.
        skipped: Bytes that belong to no whole frame, banner lines included.
        resyncs: How often the beginning of a frame had to be looked for again.
        dropped: Frames that were whole, but came too fast to be taken.
        stalls: How often the board was silent for longer than it may be.
        reconnects: How often the port went away and came back.
        doubtful: Frames that were given out at their last byte, and the next one did
            not begin there: a byte of theirs may have been lost or added.
    """

    bytes: int = 0
    frames: int = 0
    damaged: int = 0
    skipped: int = 0
    resyncs: int = 0
    dropped: int = 0
    stalls: int = 0
    reconnects: int = 0
    doubtful: int = 0

    def facts(self) -> dict[str, int]:
        """Return the counters by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}
