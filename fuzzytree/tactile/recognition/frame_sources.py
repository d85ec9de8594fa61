"""Sources of frames: a serial port or a recording, each at its pace."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from fuzzytree.errors import WriteError
from fuzzytree.files import PathLike
from fuzzytree.tactile.boards import Board
from fuzzytree.tactile.link.recording import FrameRecord, Recorder
from fuzzytree.tactile.presses import open_frames
from fuzzytree.tactile.recognition.live import FrameSource
from fuzzytree.tactile.sensor import Counters, Frame, Sensor


class Paced:
    """Gives frames out when their times say.

    Args:
        records: In the order of their times.
        speed: How many times as fast as they came; 0 for no waiting at all.

    Raises:
        ValueError: If the speed is below 0.

    Example:
        >>> import numpy as np
        >>> frame = Frame(np.zeros((2, 2), np.uint8), 0.01, 0)
        >>> source = Paced([FrameRecord(frame, Counters(frames=1))])
        >>> [seen.number for seen in source], source.counters.frames
        ([0], 1)
    """

    def __init__(self, records: Iterable[FrameRecord], speed: float = 1.0) -> None:
        if not speed >= 0.0:
            raise ValueError(f"a speed is 0 or more, not {speed!r}")
        self._records: Iterable[FrameRecord] = records
        self._speed = speed
        self._is_closed = threading.Event()
        self._last = 0.0, time.monotonic()  # a frame's time, and when it went out
        self.counters = Counters()

    @property
    def sensor(self) -> Sensor | None:
        """None: what is known beforehand is stated once."""
        return None

    @property
    def trouble(self) -> str:
        """Empty: what is known beforehand comes."""
        return ""

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames: the first one at once, each other one at its time."""
        for place, (frame, counters) in enumerate(self._records):
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


class Replayed(Paced):
    """Gives the frames of a file out, as `Paced`.

    Args:
        path: A recording, which is open until this is closed, or what else
            `open_frames` takes.
        speed: How many times as fast as they came; 0 for no waiting at all.
        board: What sent the frames of an archive or a table.

    Attributes:
        board: What sent the frames.

    Raises:
        ValueError: If the speed is below 0.
        ReadError: As `open_frames`.
    """

    def __init__(
        self, path: PathLike, speed: float = 1.0, board: Board | None = None
    ) -> None:
        super().__init__((), speed)
        self._records = self._file = open_frames(path, board)
        self.board = self._file.board

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

    def close(self) -> None:
        """Give no more frames, and close the file."""
        super().close()
        self._file.close()


class Recorded:
    """Gives the frames of a source, each after it was written to a recording.

    A recording that cannot be written ends, and the frames go on.

    Attributes:
        written: How many frames were written.
        failure: A sentence about why the recording ended; empty if it goes on.
    """

    def __init__(self, source: FrameSource, recorder: Recorder) -> None:
        self._source, self._recorder = source, recorder
        self.written, self.failure = 0, ""
        self._writing = threading.Lock()  # frames and rests come from two threads
        self.now, self.close = source.now, source.close

    @property
    def sensor(self) -> Sensor | None:
        """What the source states."""
        return self._source.sensor

    @property
    def counters(self) -> Counters:
        """What the source has counted."""
        return self._source.counters

    @property
    def trouble(self) -> str:
        """Why the recording ended, and why no frame comes."""
        return "; ".join(filter(None, (self.failure, self._source.trouble)))

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames."""
        for frame in self._source:
            counters = self._source.counters
            if self._keep(lambda: self._recorder.write(frame, counters)):  # noqa: B023
                self.written += 1
            yield frame

    def rest(self, sensor: Sensor, frame: Frame) -> None:
        """Record what the cells read at rest, as found in a frame."""
        counters = self._source.counters
        self._keep(lambda: self._recorder.write_rest(sensor, frame, counters))

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

    def end(self) -> None:
        """End the recording, once no more frames come."""
        try:
            self._recorder.close()
        except WriteError as error:
            self.failure = self.failure or f"the recording ended: {error}"


class Newest:
    """Reads a source in a thread of its own, and gives its newest frames.

    Args:
        source: What is read, however slow the reader of this is.
        most: How many frames wait before the oldest are dropped.
    """

    def __init__(self, source: FrameSource, most: int) -> None:
        self._source = source
        self._waiting: deque[Frame] = deque(maxlen=most)
        self._news = threading.Condition()
        self._dropped, self._is_over = 0, False
        self._error: BaseException | None = None
        self.now = source.now
        self._thread = threading.Thread(target=self._read, name="newest", daemon=True)
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
        """What the source says."""
        return self._source.trouble

    def __iter__(self) -> Iterator[Frame]:
        """Give frames until the source ends.

        Raises:
            PortError: As the source.
        """
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting or self._is_over)
                if not self._waiting:
                    break
                frame = self._waiting.popleft()
            yield frame
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Close the source, and wait until all that came from it was read."""
        self._source.close()
        self._thread.join()

    def _read(self) -> None:
        try:
            for frame in self._source:
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
