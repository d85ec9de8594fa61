"""Labelled frames in numpy archives (`.npz`), and frames of any file with their sensor.

The arrays: `frames`, whole numbers of shape (frames, rows, columns); `full`, the
reading of a saturated cell; `threshold`, above which a cell is pressed, default 0; and,
where known, `label`, the index of each frame's class in `label_names`, `subject`,
a number for each person or object that pressed, and `times`, in seconds, and `numbers`
of frames that follow each other.

A table (`.csv`) has a line for each frame, with the columns `time`, `number`, `r0c0`,
`r0c1` and so on; the first two may be missing.
"""

from __future__ import annotations

import codecs
import io
import itertools
import lzma
import math
import os
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.csv_rows import BLOCK, CsvRows, blocks
from fuzzytree.errors import InvalidModelError, ReadError, TableError
from fuzzytree.files import PathLike, check_stream, read_bounded, reason
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link.recording import (
    MAGIC,
    FrameFile,
    Recording,
    RecordingFile,
    read_recording,
)
from fuzzytree.tactile.sensor import (
    FRAMES_A_SECOND,
    LARGEST_SIDE,
    Cells,
    Counters,
    Sensor,
)

if TYPE_CHECKING:
    import numpy.typing as npt


LIMIT = 2**30
"""The most bytes of an archive, packed or not, or of a table."""

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the first that a zip file can hold
_MOST_MEMBERS = 64
_LONGEST_HEADER = 4096
_HEADERS: Mapping[tuple[int, int], Any] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_BROKEN_HEADER = (
    *(ValueError, KeyError, TypeError, SyntaxError, tokenize.TokenError),
    *(MemoryError, RecursionError),
)
_USED = (
    *("frames", "full", "threshold", "label", "label_names", "subject"),
    *("times", "numbers"),
)
_TABLE = ".csv"
_CELL = re.compile("r(0|[1-9][0-9]{0,2})c(0|[1-9][0-9]{0,2})")
_MOST = {"time": 2**33, "number": 2**53 - 1}
"""Seconds that fit a recording's nanoseconds, and whole numbers that a float keeps."""


def _no_times() -> npt.NDArray[np.float64]:
    return np.zeros(0, np.float64)


def _unknown() -> npt.NDArray[np.int64]:
    return np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True)
class Presses:
    """Frames, and what is known of them.

    Attributes:
        frames: Shape (frames, rows, columns), whole numbers.
        sensor: Whose frames they are.
        label: Shape (frames,): the place of the class in `label_names`; empty if it
            is not known.
        label_names: The names of the classes.
        subject: Shape (frames,): who was pressing; empty if it is not known.
        is_stream: Whether the frames follow each other, as in a recording.
        times: Shape (frames,): in seconds; empty if they are not known.
        numbers: Shape (frames,): of each frame; empty if they are not known.
        placement: Shape (frames,): when something was put down, from 1; empty if each
            frame is a placement of its own.
    """

    frames: Cells
    sensor: Sensor
    label: npt.NDArray[np.int64] = field(default_factory=_unknown)
    label_names: tuple[str, ...] = ()
    subject: npt.NDArray[np.int64] = field(default_factory=_unknown)
    is_stream: bool = False
    times: npt.NDArray[np.float64] = field(default_factory=_no_times)
    numbers: npt.NDArray[np.int64] = field(default_factory=_unknown)
    placement: npt.NDArray[np.int64] = field(default_factory=_unknown)

    def of_class(self, name: str) -> Presses:
        """Return the same frames, all of one class."""
        code = np.zeros(len(self.frames), np.int64)
        return replace(self, label=code, label_names=(name,))

    def on(self, sensor: Sensor, name: str) -> Presses:
        """Return the same frames as those of a board's sensor.

        Raises:
            ReadError: If they are of another size; it begins with the name.
        """
        rows, columns = self.frames.shape[1:]
        if (sensor.rows, sensor.columns) != (rows, columns):
            raise ReadError(
                f"{name}: holds frames of {rows} x {columns} cells, and the board has "
                f"{sensor.rows} x {sensor.columns}"
            )
        return replace(self, sensor=sensor)


def read_presses(path: PathLike, *, label: str = "label") -> Presses:
    """Return the frames of an archive.

    The classes are in the array `label`, and their names in that of `LABEL_names`.

    Raises:
        ReadError: If it is no such archive, or larger than 1 GiB.
    """
    name = os.fspath(path)
    arrays = _arrays(read_bounded(path, LIMIT), name, label)
    frames = arrays.get("frames")
    if frames is None:
        raise ReadError(f"{name}: has no array 'frames'")
    if frames.ndim != 3 or not np.issubdtype(frames.dtype, np.integer):
        raise ReadError(
            f"{name}: 'frames' must hold whole numbers of shape (frames, rows, "
            f"columns), not {frames.dtype} of shape {frames.shape}"
        )
    if not len(frames):
        raise ReadError(f"{name}: holds no frame")
    _check_sides(frames.shape[1:], name)
    names = _texts(arrays.get(f"{label}_names"), name, f"{label}_names")
    labels = _codes(arrays.get(label), len(frames), name, label)
    if len(labels) and not (labels.min() >= 0 and labels.max() < len(names)):
        raise ReadError(
            f"{name}: {label!r} holds places in {label + '_names'!r}, from 0 to "
            f"{len(names) - 1}, not {labels.min()} to {labels.max()}"
        )
    subject = _codes(arrays.get("subject"), len(frames), name, "subject")
    numbers = _codes(arrays.get("numbers"), len(frames), name, "numbers")
    if (numbers < 0).any():
        raise ReadError(f"{name}: 'numbers' must be 0 or more, not {numbers.min()}")
    times = _times(arrays.get("times"), len(frames), name)
    usual = _usual_full(frames)
    full = _number(arrays.get("full"), usual, 1, 65535, f"{name}: 'full'")
    least = _number(arrays.get("threshold"), 0, 0, full - 1, f"{name}: 'threshold'")
    rows, columns = frames.shape[1:]
    sensor = Sensor(rows, columns, full, least)
    is_stream = len(times) > 0
    return Presses(frames, sensor, labels, names, subject, is_stream, times, numbers)


def _usual_full(frames: Cells) -> int:
    return 255 if frames.dtype.itemsize == 1 else 65535


def _check_sides(sides: Sequence[int], name: str) -> None:
    if not all(1 <= side <= LARGEST_SIDE for side in sides):
        raise ReadError(
            f"{name}: a frame has 1 to {LARGEST_SIDE} rows and columns, "
            f"not {sides[0]} x {sides[1]}"
        )


def presses_content(presses: Presses) -> bytes:
    """Return an archive; the same frames give the same bytes."""
    arrays: dict[str, npt.NDArray[Any]] = {
        "frames": presses.frames,
        "full": np.array(presses.sensor.full, np.int64),
    }
    if presses.sensor.threshold:
        arrays["threshold"] = np.array(presses.sensor.threshold, np.int64)
    if len(presses.label):
        arrays["label"] = presses.label
        arrays["label_names"] = np.array(presses.label_names, np.str_)
    if len(presses.subject):
        arrays["subject"] = presses.subject
    return packed_arrays(arrays)


def packed_arrays(arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Return a numpy archive; the same arrays give the same bytes."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            member.compress_type = zipfile.ZIP_DEFLATED
            member.create_system, member.external_attr = 3, 0o644 << 16
            packed = io.BytesIO()
            np.lib.format.write_array(packed, values, (1, 0), allow_pickle=False)
            archive.writestr(member, packed.getvalue())
    return file.getvalue()


def _arrays(content: bytes, name: str, label: str) -> Mapping[str, npt.NDArray[Any]]:
    """Return the arrays that are used, unpacked within the limit."""
    wanted = {*_USED, label, f"{label}_names"}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            if len(members) > _MOST_MEMBERS:
                raise ReadError(f"{name}: has more than {_MOST_MEMBERS} arrays")
            if sum(member.file_size for member in members) > LIMIT:
                raise ReadError(f"{name}: unpacks to more than {LIMIT} bytes")
            found: dict[str, npt.NDArray[Any]] = {}
            for member in members:
                title = member.filename.removesuffix(".npy")
                if title in wanted:
                    with archive.open(member) as file:
                        found[title] = _array(file.read(LIMIT), name, title)
            return found
    except ReadError:
        raise
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        raise ReadError(f"{name}: is no numpy archive (.npz): {error}") from error
    except (zlib.error, lzma.LZMAError, struct.error, OSError, ValueError) as error:
        # What is packed is damaged, or places that lie outside the file.
        raise ReadError(f"{name}: is damaged: {error}") from error


def _array(content: bytes, name: str, title: str) -> npt.NDArray[Any]:
    """Return an array of whole numbers or text; anything else is refused unread."""
    file = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(file)
        read = _HEADERS[version]
        shape, is_turned, dtype = read(file, max_header_size=_LONGEST_HEADER)
    except _BROKEN_HEADER as error:
        raise ReadError(f"{name}: {title!r} is no numpy array: {error}") from error
    if dtype.kind not in ("iuf" if title == "times" else "iuU") or not dtype.itemsize:
        raise ReadError(f"{name}: {title!r} holds {dtype}, not whole numbers or text")
    rest = len(content) - file.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != rest:
        raise ReadError(
            f"{name}: {title!r} is cut or damaged: {rest} bytes do not make {shape}"
        )
    flat = np.frombuffer(content, dtype, offset=file.tell())
    if is_turned:
        return flat.reshape(shape[::-1]).T
    return flat.reshape(shape)


def _texts(found: npt.NDArray[Any] | None, name: str, title: str) -> tuple[str, ...]:
    if found is None:
        return ()
    if found.ndim != 1 or found.dtype.kind != "U":
        raise ReadError(f"{name}: {title!r} must be a list of texts")
    # Numpy takes any number for a sign: those beyond Unicode, and halves of pairs, too.
    signs = np.ascontiguousarray(found).view(f"{found.dtype.byteorder}u4")
    if ((signs > 0x10FFFF) | ((signs >= 0xD800) & (signs < 0xE000))).any():
        raise ReadError(f"{name}: {title!r} holds signs that are none")
    texts = tuple(str(text) for text in found)
    if len(set(texts)) != len(texts) or "" in texts:
        raise ReadError(f"{name}: {title!r} must be different names, none empty")
    return texts


def _codes(
    found: npt.NDArray[Any] | None, count: int, name: str, title: str
) -> npt.NDArray[np.int64]:
    if found is None:
        return np.zeros(0, np.int64)
    if found.shape != (count,) or found.dtype.kind not in "iu":
        raise ReadError(
            f"{name}: {title!r} must hold a whole number for each of {count} frames"
        )
    return found.astype(np.int64)


def _times(
    found: npt.NDArray[Any] | None, count: int, name: str
) -> npt.NDArray[np.float64]:
    if found is None:
        return _no_times()
    times = found.astype(np.float64)
    most = _MOST["time"]
    if times.shape != (count,) or not ((times >= 0.0) & (times <= most)).all():
        raise ReadError(
            f"{name}: 'times' must hold a number of seconds from 0 to {most} for each "
            f"of {count} frames"
        )
    return times


def _number(
    found: npt.NDArray[Any] | None, usual: int, low: int, high: int, where: str
) -> int:
    """Return a whole number of an archive, or the usual one where it has none."""
    if found is None:
        return usual
    is_one = found.size == 1 and found.dtype.kind in "iu"
    if not is_one or not low <= found.item() <= high:
        raise ReadError(f"{where} must be a whole number from {low} to {high}")
    return int(found.item())


def read_frames(
    path: PathLike,
    *,
    full: int | None = None,
    threshold: int | None = None,
    label: str = "label",
) -> Presses:
    """Return the frames of a file.

    Args:
        path: A recording, a table whose name ends in .csv, or a numpy archive (see
            `fuzzytree.tactile.presses`).
        full: What a cell takes, instead of what the file says; not for recordings.
        threshold: Above it a cell is pressed, the same way.
        label: The array of the classes in an archive.

    Raises:
        ReadError: If the file is none of them.
    """
    name = os.fspath(path)
    if Path(path).is_fifo():  # it is read twice, and can keep us waiting
        raise ReadError(f"{name}: is a pipe, and no file")
    try:
        with Path(path).open("rb") as file:
            is_recording = file.read(len(MAGIC)) == MAGIC
    except (OSError, ValueError) as error:
        raise ReadError(f"{name}: cannot be read: {reason(error)}") from error
    if is_recording:
        recording = read_recording(path)
        return Presses(recording.frames, recording.board.sensor, is_stream=True)
    if Path(path).suffix.lower() == _TABLE:
        presses = _read_table(path, 255 if full and full <= 255 else 65535)
    else:
        presses = read_presses(path, label=label)
    own = presses.sensor
    try:
        limit = own.full if full is None else full
        least = own.threshold if threshold is None else threshold
        return replace(presses, sensor=Sensor(own.rows, own.columns, limit, least))
    except InvalidModelError as error:
        raise ReadError(f"{name}: {error}") from error


def open_frames(path: PathLike, board: Board | None = None) -> FrameFile:
    """Return the frames of a file, one by one, and what sent them.

    Where an archive or a table has no times there are 44 frames a second, and where it
    has no numbers they are 0, 1, ...

    Args:
        path: A recording, an archive (.npz) or a table (.csv).
        board: What sent the frames of an archive or table; a plain one if None.

    Raises:
        ReadError: If the file is none of them, does not fit the board, or is a
            recording, which has its own.
    """
    name = os.fspath(path)
    if Path(path).suffix.lower() not in (_TABLE, ".npz"):
        if board is not None:
            raise ReadError(f"{name}: a recording has its own board; name no other one")
        return RecordingFile(path)
    if board is None:
        found = read_frames(path)
        sensor = found.sensor
        board = Board("frames", sensor, Marker("AA 55", bits=sensor.bits))
    else:
        sensor = board.sensor
        found = read_frames(path, full=sensor.full, threshold=sensor.threshold)
        found = found.on(sensor, name)
    frames, count, most = found.frames, len(found.frames), sensor.largest
    if frames.min() < 0 or frames.max() > most:
        place, row, column = np.argwhere((frames < 0) | (frames > most))[0].tolist()
        wrong = frames[place, row, column]
        raise ReadError(
            f"{name}: r{row}c{column} of frame {place} is {wrong}, and no whole number "
            f"from 0 to {most}"
        )
    return Recording(
        board,
        frames.astype(sensor.dtype, copy=False),
        found.times if len(found.times) else np.arange(count) / FRAMES_A_SECOND,
        found.numbers if len(found.numbers) else np.arange(count),
        Counters(frames=count),
        damaged=0,
        cut_bytes=0,
        started_ns=0,
    )


def _read_table(path: PathLike, most: int) -> Presses:
    """Return the frames of a table, whose cells are at most so much."""
    name = os.fspath(path)
    titles: list[str] = []
    places: list[int] = []
    sides = (0, 0)
    cells: list[npt.NDArray[np.uint16]] = []
    others: dict[str, list[npt.NDArray[np.float64]]] = {title: [] for title in _MOST}
    try:
        check_stream(path)
        if Path(path).stat().st_size > LIMIT:
            raise ReadError(f"{name}: is larger than {LIMIT} bytes, too large to read")
        with Path(path).open("rb") as file:
            head = file.read(BLOCK).removeprefix(codecs.BOM_UTF8)
            for rows in blocks(head, file.read, b",", name):
                skipped = 0 if titles else 1
                if skipped:
                    titles = [title.strip() for title in rows.header()]
                    places, sides = _cell_places(titles, f"{name}:{rows.line}")
                values = _values(rows, titles, most, skipped)
                cells.append(values[places].T.astype(np.uint16).reshape(-1, *sides))
                for title in others:
                    if title in titles:
                        others[title].append(values[titles.index(title)])
    except UnicodeDecodeError as error:
        raise ReadError(f"{name}: is no UTF-8 text; save it as UTF-8") from error
    except TableError as error:
        raise ReadError(str(error)) from error
    except OSError as error:
        raise ReadError(f"{name}: cannot be read: {reason(error)}") from error
    if not sum(map(len, cells)):
        raise ReadError(f"{name}: holds no frame")
    frames: Cells = np.concatenate(cells)
    if frames.max() <= 255:
        frames = frames.astype(np.uint8)
    times, numbers = (np.concatenate(part or [_no_times()]) for part in others.values())
    return Presses(
        frames,
        Sensor(*sides, _usual_full(frames)),
        is_stream=True,
        times=times,
        numbers=numbers.astype(np.int64),
    )


def _cell_places(
    titles: Sequence[str], where: str
) -> tuple[list[int], tuple[int, int]]:
    """Return which columns hold the cells, row by row, and the sides of a frame."""
    found = {title: place for place, title in enumerate(titles)}
    if len(found) < len(titles):
        twice = next(one for place, one in enumerate(titles) if found[one] != place)
        raise ReadError(f"{where}: names the column {twice[:40]!r} twice")
    rows = columns = 0
    for title in titles:
        cell = _CELL.fullmatch(title)
        if cell:
            rows, columns = max(rows, int(cell[1]) + 1), max(columns, int(cell[2]) + 1)
        elif title not in _MOST:
            raise ReadError(
                f"{where}: the column {title[:40]!r} is neither time, number nor a "
                f"cell such as r0c0"
            )
    if not rows:
        raise ReadError(f"{where}: has no column of a cell such as r0c0")
    _check_sides((rows, columns), where)
    cells = [f"r{row}c{column}" for row in range(rows) for column in range(columns)]
    for title in cells:
        if title not in found:
            raise ReadError(
                f"{where}: has no column {title!r}, and frames of {rows} x {columns} "
                f"cells"
            )
    return [found[title] for title in cells], (rows, columns)


def _values(
    rows: CsvRows, titles: Sequence[str], most: int, skipped: int
) -> npt.NDArray[np.float64]:
    """Return the numbers of some rows, column by column."""
    found = rows.numbers(len(titles), range(len(titles)), skipped, ())
    if found is not None:
        values = np.array(found, np.float64)
        limits = np.array([[_MOST.get(title, most)] for title in titles])
        is_time = np.array([[title == "time"] for title in titles])
        is_fit = (values == np.floor(values)) | is_time
        if (is_fit & (values >= 0.0) & (values <= limits)).all():
            return values
    table = rows.table(len(titles), range(len(titles)))
    if table.num_rows <= skipped:
        return np.empty((len(titles), 0))
    lines = zip(*(column.to_pylist() for column in table.columns), strict=True)
    for row, texts in itertools.islice(enumerate(lines), skipped, None):
        for title, text in zip(titles, texts, strict=True):
            limit, is_whole = _MOST.get(title, most), title != "time"
            if not _fits(text, limit, is_whole=is_whole):
                kind = "whole number" if is_whole else "number"
                raise ReadError(
                    f"{rows.name}:{rows.line_of(row)}: {title}: {text[:40]!r} is no "
                    f"{kind} from 0 to {limit}"
                )
    raise ReadError(f"{rows.name}:{rows.line}: a cell from here on is no number")


def _fits(text: str, most: int, *, is_whole: bool) -> bool:
    try:
        value = float(text)
    except ValueError:
        return False
    is_plain = text.isascii() and "_" not in text
    return is_plain and 0.0 <= value <= most and not (is_whole and value % 1)
