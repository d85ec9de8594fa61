"""Recordings: each frame is written at once, and damage costs the damaged frames only.

`docs/reference/recordings.md` describes the layout, byte by byte.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import stat
import threading
import time
import zlib
from array import array
from collections.abc import Iterator
from dataclasses import astuple, dataclass, field, fields, replace
from pathlib import Path
from typing import Final, NamedTuple, Self

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.errors import ReadError, TableError, WriteError
from fuzzytree.files import PathLike, open_atomically, reason, write_atomically
from fuzzytree.tactile.boards import Board
from fuzzytree.tactile.link.starting import still
from fuzzytree.tactile.sensor import (
    Cells,
    Counters,
    Frame,
    Sensor,
    at_rest,
    baseline_of,
    check_frames,
    is_masked,
    places,
)

MAGIC: Final = b"\x89FTR\r\n\x1a\n"
MARK: Final = b"\xf5fr\n"
REST: Final = b"\xf5rs\n"
"""What a record begins with that says what the cells read at rest from then on."""
_BEGIN = re.compile(MARK + b"|" + REST)
VERSIONS: Final = (1, 2)
"""The layouts that are read; the last one is written. The first has no such records."""
LARGEST_BOARD: Final = 4 * 2**20
"""The most bytes that the text of a board may have."""

FIXED: Final = np.dtype(
    [
        ("magic", "S8"),
        ("version", "<u2"),
        ("rows", "<u2"),
        ("columns", "<u2"),
        ("cell_bytes", "u1"),
        ("counters", "u1"),
        ("record_bytes", "<u4"),
        ("board_bytes", "<u4"),
        ("started_ns", "<i8"),
    ]
)
"""What stands at the beginning, before the text of the board."""

LARGEST_ARRAY: Final = 2**31
"""The most bytes of cells that `read_recording` holds at once."""

_NS = 1_000_000_000
_PATIENCE = 8  # how often each byte may be looked at,
_TRIES_BYTES = 2**24  # beside these
_CHUNK = 2**20


class FrameRecord(NamedTuple):
    """A frame, and what the line had counted when it came."""

    frame: Frame
    counters: Counters


def header(board: Board, started_ns: int) -> bytes:
    """Return the beginning of a recording: sizes, time, and the board as text.

    Raises:
        WriteError: If the board is too large.
    """
    text = msgspec.json.format(msgspec.json.encode(board), indent=1) + b"\n"
    if len(text) > LARGEST_BOARD:
        raise WriteError(f"a board of {len(text)} bytes is too large for a recording")
    content = fixed_part(board, len(text), started_ns) + text
    return content + crc(content)


def fixed_part(
    board: Board, board_bytes: int, started_ns: int, version: int = VERSIONS[-1]
) -> bytes:
    """Return the part of the header that is of the same length in every file."""
    sensor, record = board.sensor, layout_of(board)
    sizes = (sensor.rows, sensor.columns, sensor.dtype.itemsize, len(fields(Counters)))
    rest = (record.itemsize, board_bytes, started_ns)
    return np.array((MAGIC, version, *sizes, *rest), FIXED).tobytes()


def layout_of(board: Board) -> np.dtype[np.void]:
    """Return how the fields of a record lie in its bytes."""
    shape = (board.sensor.rows, board.sensor.columns)
    return np.dtype(
        [
            ("mark", "S4"),
            ("number", "<i8"),
            ("time_ns", "<i8"),
            ("counters", "<i8", (len(fields(Counters)),)),
            ("cells", board.sensor.dtype, shape),
            ("crc", "<u4"),
        ]
    )


def _packed(
    board: Board, frame: Frame, counters: Counters, mark: bytes = MARK
) -> bytes:
    """Return a record as bytes."""
    cells, largest = check_frames(board.sensor, frame.cells)[0], board.sensor.largest
    if cells.min() < 0 or cells.max() > largest:
        wrong = cells.min() if cells.min() < 0 else cells.max()
        raise TableError(f"a cell lies in 0 to {largest}, not {wrong}")
    time_ns = round(frame.time * _NS)
    values = (mark, frame.number, time_ns, astuple(counters), cells, 0)
    content = np.array(values, layout_of(board)).tobytes()[:-4]
    return content + crc(content)


def _packed_rest(
    board: Board, sensor: Sensor, frame: Frame, counters: Counters
) -> bytes:
    """Return a record of what cells read at rest; masked cells read the largest."""
    cells = np.where(is_masked(sensor), sensor.largest, baseline_of(sensor))
    return _packed(board, replace(frame, cells=cells), counters, REST)


def _unpacked(content: bytes, layout: np.dtype[np.void]) -> FrameRecord | None:
    """Return a record, or None if the bytes are none, or a damaged one."""
    if not content.startswith((MARK, REST)) or content[-4:] != crc(content[:-4]):
        return None
    _mark, number, time_ns, counters, cells, _crc = np.frombuffer(content, layout)[0]
    if min(number, time_ns, *counters) < 0:
        return None
    frame = Frame(cells, int(time_ns) / _NS, int(number))
    return FrameRecord(frame, Counters(*counters.tolist()))


def crc(content: bytes) -> bytes:
    """Return the CRC-32 (that of zip and PNG), low byte first."""
    return zlib.crc32(content).to_bytes(4, "little")


def _unknown() -> npt.NDArray[np.int64]:
    return np.zeros(0, np.int64)


class _Closing:
    """What `with` closes at its end."""

    def close(self) -> None:
        """Do nothing: all is in memory."""

    def __enter__(self) -> Self:
        """Give itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


@dataclass(frozen=True, slots=True)
class Recording(_Closing):
    """All frames of a file that are whole; they are read as a `RecordingFile`.

    Attributes:
        board: What sent them, with the baseline that was measured.
        frames: As the board sent them: shape (frames, rows, columns).
        times: When the last byte of each came, in seconds since the line was opened.
        numbers: Of each frame; a number that is missing was dropped or damaged.
        counters: Of the line, at the last frame.
        damaged: Records in the file that were damaged and are left out.
        cut_bytes: Bytes at the end that are less than a record.
        started_ns: When the recording began, in nanoseconds since 1970 (UTC); 0 if
            that is not known.
        label: The place of each frame's class in `label_names`; empty if not known.
        label_names: The names of the classes.
        subject: Who was pressing in each frame; empty if not known.
        is_stream: Whether the frames follow each other; times and numbers are made up
            otherwise.
    """

    board: Board
    frames: Cells
    times: npt.NDArray[np.float64]
    numbers: npt.NDArray[np.int64]
    counters: Counters
    damaged: int = 0
    cut_bytes: int = 0
    started_ns: int = 0
    label: npt.NDArray[np.int64] = field(default_factory=_unknown)
    label_names: tuple[str, ...] = ()
    subject: npt.NDArray[np.int64] = field(default_factory=_unknown)
    is_stream: bool = True

    @property
    def sensor(self) -> Sensor:
        """That of the board."""
        return self.board.sensor

    def __iter__(self) -> Iterator[FrameRecord]:
        """Give the frames, and how many they are so far."""
        times, numbers = self.times.tolist(), self.numbers.tolist()
        rows = zip(self.frames, times, numbers, strict=True)
        for count, (cells, time_s, number) in enumerate(rows, 1):
            yield FrameRecord(Frame(cells, time_s, number), Counters(frames=count))

    def whole(self) -> Recording:
        """Return itself."""
        return self


class Recorder(_Closing):
    """Write frames to a file, so that at most the last one can be lost.

    Each frame goes to the system in one piece. A thread syncs the file to the disk: if
    the power fails, the frames since the last answer of the disk are lost
    (`most_at_risk` is the largest number so far).

    Args:
        path: A file that is not there yet, unless `replace` gives up its content.
        board: What sends the frames.
        started_ns: When it began, in nanoseconds since 1970 (UTC); now, if None.
        replace: Whether the file may be there.

    Raises:
        WriteError: If the file is there or cannot be written.

    Example:
        >>> import tempfile
        >>> from fuzzytree.tactile.boards import Marker
        >>> board = Board("mat", Sensor(1, 2), Marker("AA 55"))
        >>> path = Path(tempfile.mkdtemp()) / "a.ftr"
        >>> with Recorder(path, board) as recorder:
        ...     recorder.write(Frame(np.array([[3, 4]]), 0.5, 0), Counters(frames=1))
        >>> read_recording(path).frames.tolist()
        [[[3, 4]]]
    """

    def __init__(
        self,
        path: PathLike,
        board: Board,
        *,
        started_ns: int | None = None,
        replace: bool = False,
    ) -> None:
        self._name = os.fspath(path)
        self._board = board
        self._wake = threading.Condition()
        self._written = self._kept = self.most_at_risk = 0
        self._failure: OSError | None = None
        self._is_closed = False
        started = time.time_ns() if started_ns is None else started_ns
        begin = header(board, started)  # before a file is made
        write_atomically(path, begin, replace=replace)
        try:
            _keep_name(Path(path))
            flags = os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0)
            self._file = os.open(path, flags)
        except OSError as error:
            raise self._error(error) from error
        self._syncing = threading.Thread(target=self._sync, daemon=True)
        self._syncing.start()

    def write(self, frame: Frame, counters: Counters) -> None:
        """Append a frame, and what the line has counted so far.

        Raises:
            TableError: If the frame is of another size, or a cell has no place.
            WriteError: If it cannot be written; all frames before it are kept.
        """
        self._append(_packed(self._board, frame, counters))

    def write_rest(self, sensor: Sensor, frame: Frame, counters: Counters) -> None:
        """Append what the cells read at rest, from the frame after this one on.

        Raises:
            WriteError: If it cannot be written; all frames before it are kept.
        """
        self._append(_packed_rest(self._board, sensor, frame, counters))

    def _append(self, content: bytes) -> None:
        self._raise_failure()
        rest = memoryview(content)
        try:
            while rest:
                rest = rest[os.write(self._file, rest) :]
        except OSError as error:
            raise self._error(error) from error
        with self._wake:
            self._written += 1
            self.most_at_risk = max(self.most_at_risk, self._written - self._kept)
            self._wake.notify()

    def close(self) -> None:
        """Wait until the disk has all of it, and close the file.

        Raises:
            WriteError: If the disk could not keep it.
        """
        if self._is_closed:
            return
        with self._wake:
            self._is_closed = True
            self._wake.notify()
        self._syncing.join()
        os.close(self._file)
        self._raise_failure()

    def _sync(self) -> None:
        """Ask the disk to keep the file whenever there are new frames."""
        while True:
            with self._wake:
                while self._written == self._kept and not self._is_closed:
                    self._wake.wait()
                written = self._written
                if written == self._kept or self._failure is not None:
                    return
            try:
                _to_disk(self._file)
            except OSError as error:
                self._failure = error
                return
            with self._wake:
                self._kept = written

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._error(self._failure) from self._failure

    def _error(self, error: OSError | ValueError) -> WriteError:
        return WriteError(f"{self._name}: cannot be written: {reason(error)}")


class RecordingFile(_Closing):
    """Read a recording frame by frame, however long it is.

    Iterating begins at the first record. What is damaged is left out and counted.

    Attributes:
        board: What sent the frames.
        sensor: That of the board; while frames are given, with what the cells read at
            rest since the last tare, hot or dead cell.
        started_ns: When the recording began, in nanoseconds since 1970 (UTC).
        damaged: Records that were damaged, of those that were passed.
        cut_bytes: Bytes at the end that are less than a record, once it was reached.

    Raises:
        ReadError: If it is no recording, or its header is damaged.
    """

    def __init__(self, path: PathLike) -> None:
        self._name = os.fspath(path)
        self.damaged = self.cut_bytes = 0
        self._file = _open(path)
        try:
            self._read_header()
            self._end = os.fstat(self._file.fileno()).st_size
        except BaseException:
            self._file.close()
            raise

    def __iter__(self) -> Iterator[FrameRecord]:
        """Give the records that are whole, from the first on.

        Raises:
            ReadError: If it cannot be read, or nearly all of it is damaged.
        """
        self.damaged = self.cut_bytes = lost = passed = tried = 0
        length, place, window = self._layout.itemsize, self._begin, b""
        self.sensor = self.board.sensor
        while chunk := self._read(place, min(_CHUNK, self._end - place)):
            place += len(chunk)
            window += chunk
            at = 0
            while at + length <= len(window):
                if record := _unpacked(window[at : at + length], self._layout):
                    self.damaged += -(-lost // length)  # rounded up
                    lost = 0
                    is_rest = window.startswith(REST, at)
                    at += length
                    if is_rest:
                        self._rest(record.frame.cells)
                    else:
                        yield record
                    continue
                # A file made to be slow has a mark everywhere, and each is tried.
                tried += length if window.startswith((MARK, REST), at) else 0
                if tried > _PATIENCE * (passed + at) + _TRIES_BYTES:
                    raise ReadError(f"{self._name}: is damaged all over")
                found = _BEGIN.search(window, at + 1)
                end = max(len(window) - len(MARK) + 1, at + 1)
                after = found.start() if found else end
                lost += after - at
                at = after
            window, passed = window[at:], passed + at
        lost += len(window)
        self.damaged += lost // length
        self.cut_bytes = lost % length

    def _rest(self, cells: Cells) -> None:
        """Take what the cells read at rest from now on; hot and dead ones the largest.

        They stay within what a sensor may have.
        """
        known = self.board.sensor
        is_masked = cells >= known.largest
        rests = np.where(is_masked, 0, np.minimum(cells, known.full)).astype(np.int64)
        self.sensor = at_rest(known, rests, is_masked)

    def whole(self) -> Recording:
        """Return all frames.

        Raises:
            ReadError: As iterating, or if they are too many for memory.
        """
        most = (self._end - self._begin) // self._layout.itemsize
        sensor, last, count = self.board.sensor, Counters(), 0
        shape, kind = (most, sensor.rows, sensor.columns), sensor.dtype
        if math.prod(shape) * kind.itemsize > LARGEST_ARRAY:
            raise ReadError(
                f"{self._name}: its {most} frames are more than "
                f"{LARGEST_ARRAY} bytes, too many for memory"
            )
        frames = np.empty(shape, kind)
        times, numbers = np.empty(most, np.float64), np.empty(most, np.int64)
        for count, (frame, last) in enumerate(self, 1):  # noqa: B007  # both are kept
            frames[count - 1], times[count - 1] = frame.cells, frame.time
            numbers[count - 1] = frame.number
        return Recording(
            self.board,
            frames[:count],
            times[:count],
            numbers[:count],
            last,
            self.damaged,
            self.cut_bytes,
            self.started_ns,
        )

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read(self, place: int, size: int) -> bytes:
        try:
            self._file.seek(place)
            return self._file.read(size)
        except OSError as error:
            text = f"{self._name}: cannot be read: {reason(error)}"
            raise ReadError(text) from error

    def _read_header(self) -> None:
        size, name = FIXED.itemsize, self._name
        fixed = self._read(0, size)
        if not fixed.startswith(MAGIC) or len(fixed) < size:
            raise ReadError(f"{name}: is no recording of a board")
        head = np.frombuffer(fixed, FIXED)[0]
        if head["version"] not in VERSIONS:
            raise ReadError(
                f"{name}: is a recording of version {head['version']}; "
                f"this program reads versions {', '.join(map(str, VERSIONS))}"
            )
        length = int(head["board_bytes"])
        self.started_ns = int(head["started_ns"])
        rest = self._read(size, min(length, LARGEST_BOARD) + 4)
        text = rest[:-4]
        if len(text) != length or crc(fixed + text) != rest[-4:]:
            raise ReadError(f"{name}: its header is damaged")
        try:
            self.board = msgspec.json.decode(text, type=Board)
        except (msgspec.MsgspecError, UnicodeDecodeError) as error:
            raise ReadError(f"{name}: its board cannot be read: {error}") from error
        version = int(head["version"])
        if fixed != fixed_part(self.board, length, self.started_ns, version):
            raise ReadError(f"{name}: its header contradicts its board")
        self._begin = size + len(rest)
        self._layout = layout_of(self.board)
        self.sensor = self.board.sensor


FrameFile = RecordingFile | Recording
"""Frames that are read one by one, as often as one likes."""


def read_recording(path: PathLike) -> Recording:
    """Return all of a recording; one that is still being written gives what is there.

    Raises:
        ReadError: As `RecordingFile`, or if it is too large for memory.
    """
    with RecordingFile(path) as file:
        return file.whole()


def write_recording(path: PathLike, file: FrameFile) -> None:
    """Write frames as a recording; it is there whole, or not at all.

    Raises:
        WriteError: If there is a file, or it cannot be written.
        TableError: If a cell has no place.
    """
    with open_atomically(path, replace=False) as output:
        output.write(header(file.board, file.started_ns))
        stated, before = file.sensor, None
        for record in file:
            if file.sensor is not stated and before is not None:
                stated = file.sensor
                output.write(_packed_rest(file.board, stated, *before))
            output.write(_packed(file.board, *record))
            before = record


def _to_disk(file: int) -> None:
    """Wait until the disk has what was written to a file."""
    getattr(os, "fdatasync", os.fsync)(file)


def _keep_name(path: Path) -> None:
    """Sync the name of a file to the disk, where folders can be synced."""
    if os.name != "posix":
        return
    with contextlib.suppress(OSError):  # some file systems cannot
        handle = os.open(path.absolute().parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _open(path: PathLike) -> io.FileIO:
    """Open a file; a pipe or a device is none, and would keep us waiting."""
    name = os.fspath(path)
    try:
        if stat.S_ISREG(Path(path).stat().st_mode):
            return io.FileIO(path)
    except (OSError, ValueError) as error:
        raise ReadError(f"{name}: cannot be read: {reason(error)}") from error
    raise ReadError(f"{name}: is no file")


@dataclass(frozen=True, slots=True)
class Review:
    """What is in a recording.

    Attributes:
        frames: How many are whole.
        seconds: From the first to the last.
        longest_s: Between two frames, at most.
        gaps: How often numbers of frames are missing.
        missing: How many numbers these are: dropped, or damaged in the file.
        damaged: Records of the file that are damaged.
        cut_bytes: Bytes at the end that are less than a record.
        still: The (row, column) of cells that never move though both neighbours do.
        counters: Of the line, at the last frame.
    """

    frames: int
    seconds: float
    longest_s: float
    gaps: int
    missing: int
    damaged: int
    cut_bytes: int
    still: tuple[tuple[int, int], ...]
    counters: Counters


def review(file: FrameFile) -> Review:
    """Return what is in a recording, read frame by frame.

    Raises:
        ReadError: If it cannot be read.
    """
    times, numbers, counters = array("d"), array("q"), Counters()
    extremes = np.zeros((2, 0, 0), np.int64)  # the least and the most of each cell
    for frame, counters in file:  # noqa: B007  # the last ones are kept
        if not times:
            extremes = np.array([frame.cells, frame.cells])
        np.minimum(extremes[0], frame.cells, out=extremes[0])
        np.maximum(extremes[1], frame.cells, out=extremes[1])
        times.append(frame.time)
        numbers.append(frame.number)
    left_out = [count - 1 for count in np.diff(numbers).tolist() if count > 1]
    return Review(
        len(times),
        times[-1] - times[0] if times else 0.0,
        float(np.diff(times).max(initial=0.0)),
        len(left_out),
        sum(left_out),
        file.damaged,
        file.cut_bytes,
        places(still(file.board, extremes)) if len(times) > 1 else (),
        counters,
    )
