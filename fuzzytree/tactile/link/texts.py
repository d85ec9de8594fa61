"""Frames as numbers in lines of text: a line each, or a block of lines.

A line is whole when it has as many numbers as it must, each of digits alone and not
too large. Nothing else proves it: a digit that changed is not seen.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fuzzytree.tactile.boards import Board, Text
from fuzzytree.tactile.link.decoder import Decoder, largest_cell
from fuzzytree.tactile.sensor import Cells

_BYTES_OF_A_NUMBER: Final = 32  # with what separates it; what is longer is no line
_BYTES_BESIDE: Final = 256
_LONGEST_NUMBER: Final = 9
_ODD_BLANKS: Final = bytes.maketrans(b"\v\f\r", b"???")  # blanks, but no separators
SEPARATORS: Final = {"space": None, "comma": b",", "semicolon": b";"}
"""As `bytes.split` takes them."""


class TextDecoder(Decoder):
    """Find frames in lines."""

    def __init__(self, board: Board, protocol: Text, *, is_joined: bool) -> None:
        """Begin a stream; of a joined one the first line is not looked at."""
        super().__init__(board)
        sensor = board.sensor
        sides = (sensor.rows, sensor.columns)
        self._lines, self._width = sides if board.order == "rows" else sides[::-1]
        self._is_block = protocol.frame == "block"
        if not self._is_block:
            self._lines, self._width = 1, sensor.rows * sensor.columns
        self._separator = SEPARATORS[protocol.separator]
        self._prefix = protocol.prefix.encode()
        self._stamps = protocol.skip
        self._largest = largest_cell(board)
        count = self._width + protocol.skip + 1
        self._longest = count * _BYTES_OF_A_NUMBER + _BYTES_BESIDE
        self._is_joined = is_joined
        self._restart()

    def _restart(self) -> None:
        self._banner = self._board.banner
        self._is_endless = False  # inside a line that is longer than any
        self._block: list[list[int]] = []
        self._held = 0  # bytes of the lines in the block, and of the one looked at
        self._is_waiting = self._is_joined and self._is_block  # for the next block
        self._is_given = False  # the last line ended a frame

    @property
    def pending(self) -> int:
        """How many bytes wait for others."""
        return len(self._buffer) + self._held

    def _take(self) -> list[Cells]:
        frames: list[Cells] = []
        stop = self._buffer.rfind(b"\n") + 1
        lines = bytes(self._buffer[:stop]).split(b"\n")[:-1]
        del self._buffer[:stop]
        for line in lines:
            frames += self._line(line)
        if len(self._buffer) > self._longest:
            if not self._is_endless:
                self._line_damaged()
                self._is_endless = True
            self._skip(len(self._buffer))
        return frames

    def _take_last(self) -> list[Cells]:
        is_begun = bool(self._block) or self._is_attempt(bytes(self._buffer))
        self.counters.damaged += is_begun and not self._is_waiting
        self._drop()
        self._is_joined = False
        self._restart()
        return []

    def _line(self, line: bytes) -> list[Cells]:
        """Take a line without its line feed; return the frame that it ends."""
        self._held += len(line) + 1
        numbers = self._numbers(line)
        if self._is_endless:
            self._is_endless = False
        elif self._is_joined:
            # Its beginning may have gone by; if it is a banner, it has not.
            self._is_joined = False
            self._is_waiting &= numbers is not None or not self._banner
            self._banner = max(0, self._banner - 1) if numbers is None else 0
        elif numbers is not None:
            self._banner = 0
            if self._is_given and self._is_block:  # one line too many
                self._line_damaged()
            elif not self._is_waiting:
                return self._added(numbers)
        elif self._banner:
            self._banner -= 1
        elif self._is_attempt(line):
            self._line_damaged()
        else:  # an empty line or a title
            self.counters.damaged += bool(self._block)
            if self._is_block and self._is_given:
                self.framed += self._held
                self._held = 0
            self._is_given = self._is_waiting = False
        self._drop()
        return []

    def _added(self, numbers: list[int]) -> list[Cells]:
        """Add the cells of a line to the block; return the frame that it ends."""
        self._block.append(numbers)
        if len(self._block) < self._lines:
            return []
        values = np.array(self._block)
        self.framed += self._held
        self._block, self._held = [], 0
        self._is_given = True
        return self._frames(values)

    def _line_damaged(self) -> None:
        """Take a line that was meant to hold cells of a frame, and does not.

        In a block the rest of it is skipped; behind a whole one it is in doubt where
        that began.
        """
        if not self._is_block:
            self.counters.damaged += 1
        elif not self._is_waiting:
            self.counters.damaged += not self._is_given
            self.counters.doubtful += self._is_given
            self.counters.resyncs += 1
            self._is_given, self._is_waiting = False, True
        self._drop()

    def _drop(self) -> None:
        """Skip the lines that wait."""
        self.counters.skipped += self._held
        self._block, self._held = [], 0

    def _numbers(self, line: bytes) -> list[int] | None:
        """Return the cells of a line, None if it does not hold them."""
        if len(line) > self._longest:
            return None
        words = self._words(line)
        if self._prefix:
            if not words or words[0] != self._prefix:
                return None
            del words[0]
        del words[: self._stamps]
        if len(words) != self._width or not all(map(bytes.isdigit, words)):
            return None
        if max(map(len, words)) > _LONGEST_NUMBER:
            return None
        numbers = [*map(int, words)]
        return numbers if max(numbers) <= self._largest else None

    def _words(self, line: bytes) -> list[bytes]:
        line = line.rstrip(b"\r").translate(_ODD_BLANKS)
        if self._separator is None:
            return line.split()
        words = [word.strip() for word in line.split(self._separator)]
        if len(words) > 1 and not words[-1]:
            del words[-1]  # boards that write a separator behind each number
        return words

    def _is_attempt(self, line: bytes) -> bool:
        """Return whether a line that is no frame was meant as one, and not as a title.

        It is if it begins like one, or is mostly numbers, and half as many.
        """
        if len(line) > self._longest:
            return True
        words = self._words(line)
        if not words or words == [b""]:
            return False
        if self._prefix:
            begins = words[0] == self._prefix
        else:
            begins = words[0][:1] in (b"+", b"-", b".") or words[0][:1].isdigit()
        numbers = sum(map(bytes.isdigit, words))
        return begins or (2 * numbers > len(words) and 2 * numbers >= self._width)
