"""Sources of frames: a serial port or a recording, each at its pace."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

from fuzzytree.errors import WriteError
from fuzzytree.tactile.sensor import Counters, Frame, Sensor

if TYPE_CHECKING:
    from fuzzytree.tactile.link import Connection
    from fuzzytree.tactile.link.recording import FrameFile, Recorder


class Replayed:
    """Gives the frames of a file out when their times say, the first one at once.

    Args:
        file: What it reads, and does not close.
        speed: How many times as fast as they came; 0 for no waiting at all.

    Raises:
        ValueError: If the speed is below 0.

    Example:
        >>> import numpy as np
        >>> from fuzzytree.tactile.boards import Board, Marker
        >>> from fuzzytree.tactile.link.recording import Recording
        >>> board, cells = Board("tiny", Sensor(1, 2), Marker("AA")), [[[0, 9]]]
        >>> file = Recording(board, *map(np.array, (cells, [0.1], [7])), Counters())
        >>> source = Replayed(file)
        >>> [frame.number for frame in source], source.counters.frames
        ([7], 1)
    """

    def __init__(self, file: FrameFile, speed: float = 1.0) -> None:
        if not speed >= 0.0:
            raise ValueError(f"a speed is 0 or more, not {speed!r}")
        self._file, self._speed = file, speed
        self._is_closed = threading.Event()
        self._last = 0.0, time.monotonic()  # a frame's time, and when it went out
        self.counters = Counters()

    @property
    def sensor(self) -> Sensor | None:
        """What the cells read at rest since a tare, a hot or a dead cell."""
        return self._file.sensor

    @property
    def trouble(self) -> str:
        """A sentence if records were damaged; empty if none was."""
        count = self._file.damaged
        records = "1 record is" if count == 1 else f"{count} records are"
        return f"{records} damaged and left out" if count else ""

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames."""
        for place, (frame, counters) in enumerate(self._file):
            if self._speed and place:
                before, went = self._last
                due = went + (frame.time - before) / self._speed
                rest = max(due - time.monotonic(), 0.0)
                self._is_closed.wait(min(rest, threading.TIMEOUT_MAX))
            if self._is_closed.is_set():
                return
            self._last = frame.time, time.monotonic()
            self.counters = counters
            yield frame

    def now(self) -> float:
        """Return the last frame's time, and what has gone by since."""
        at, went = self._last
        return at + time.monotonic() - went

    def close(self) -> None:
        """Give no more frames."""
        self._is_closed.set()


class Recorded:
    """Gives the frames of a source, each after it was written to a recording.

    A recording that cannot be written ends, and the frames go on.

    Args:
        source: What is recorded.
        recorder: What writes it.
        most: How many frames wait for the reader before the oldest are dropped, while
            a thread reads and writes what comes. With 0 the reader sets the pace.

    Attributes:
        written: How many frames were written.
        failure: A sentence about why the recording ended; empty if it goes on.
    """

    def __init__(
        self, source: Connection | Replayed, recorder: Recorder, most: int = 0
    ) -> None:
        self._source, self._recorder = source, recorder
        self.written, self.failure = 0, ""
        self._writing = threading.Lock()  # frames and rests come from two threads
        self.now = source.now
        self._waiting: deque[Frame] = deque(maxlen=most)
        self._news = threading.Condition()
        self._dropped, self._is_over = 0, False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._read, name="newest", daemon=True)
        if most:
            self._thread.start()

    @property
    def sensor(self) -> Sensor | None:
        """What the source states."""
        return self._source.sensor

    @property
    def counters(self) -> Counters:
        """What the source has counted, with the frames that were dropped here."""
        found = self._source.counters
        return replace(found, dropped=found.dropped + self._dropped)

    @property
    def trouble(self) -> str:
        """Why the recording ended, and why no frame comes."""
        return "; ".join(filter(None, (self.failure, self._source.trouble)))

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames.

        Raises:
            PortError: As the source.
        """
        return self._newest() if self._waiting.maxlen else self._written()

    def rest(self, sensor: Sensor, frame: Frame) -> None:
        """Record what the cells read at rest, as found in a frame."""
        counters = self._source.counters
        self._keep(lambda: self._recorder.write_rest(sensor, frame, counters))

    def close(self) -> None:
        """Close the source, write all that came from it, and end the recording."""
        self._source.close()
        if self._waiting.maxlen:
            self._thread.join()
        try:
            self._recorder.close()
        except WriteError as error:
            self.failure = self.failure or f"the recording ended: {error}"

    def _keep(self, write: Callable[[], None]) -> bool:
        """Write unless the recording has ended; note why it ends now."""
        with self._writing:
            if self.failure:
                return False
            try:
                write()
            except WriteError as error:
                self.failure = f"the recording ended: {error}"
                return False
            return True

    def _written(self) -> Iterator[Frame]:
        for frame in self._source:
            counters = self._source.counters
            if self._keep(lambda: self._recorder.write(frame, counters)):  # noqa: B023
                self.written += 1
            yield frame

    def _read(self) -> None:
        try:
            for frame in self._written():
                with self._news:
                    self._dropped += len(self._waiting) == self._waiting.maxlen
                    self._waiting.append(frame)
                    self._news.notify_all()
        except BaseException as error:  # raised to the reader
            self._error = error
        finally:
            with self._news:
                self._is_over = True
                self._news.notify_all()

    def _newest(self) -> Iterator[Frame]:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting or self._is_over)
                if not self._waiting:
                    break
                frame = self._waiting.popleft()
            yield frame
        if self._error is not None:
            raise self._error


FrameSource: TypeAlias = "Connection | Replayed | Recorded"
"""Where frames come from, in the order of their times, which `now` goes on with."""
