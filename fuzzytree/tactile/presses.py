"""Labelled frames in numpy archives (`.npz`), and frames of any file with their sensor.

`docs/reference/recordings.md` has the arrays of an archive and the columns of a table.
`label` is the index of each frame's class in `label_names`, and `subject` a number for
each person or object that pressed.
"""

from __future__ import annotations

import io
import lzma
import math
import os
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import structs

from fuzzytree.errors import InvalidModelError, ReadError, TableError
from fuzzytree.files import PathLike, check_stream, read_bounded, reason
from fuzzytree.tables import batches, pieces
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.link.recording import FrameFile, Recording, RecordingFile
from fuzzytree.tactile.sensor import (
    FRAMES_A_SECOND,
    LARGEST_SIDE,
    Cells,
    Counters,
    Sensor,
    check_frames,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray

    Numbers = Sequence[int] | npt.NDArray[np.int64 | np.float64]

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
_USED = {"frames", "full", "threshold", "subject", "times", "numbers"}
_TABLE = ".csv"
_CELL = re.compile("r(0|[1-9][0-9]{0,2})c(0|[1-9][0-9]{0,2})")
_MOST = {"time": 2**33, "number": 2**53 - 1}
"""Seconds that fit a recording's nanoseconds, and whole numbers that a float keeps."""


def labelled(
    frames: Cells,
    sensor: Sensor,
    label: Numbers = (),
    label_names: tuple[str, ...] = (),
    subject: Numbers = (),
    *,
    times: Numbers = (),
    numbers: Numbers = (),
    is_stream: bool = False,
) -> Recording:
    """Return frames of a plain board; what is empty is not known.

    Without times there are 44 frames a second, and without numbers they are 0, 1, ...
    """
    count = len(frames)
    seconds = times if len(times) else np.arange(count) / FRAMES_A_SECOND
    return Recording(
        _plain(sensor),
        frames,
        np.array(seconds, np.float64),
        np.array(numbers if len(numbers) else range(count), np.int64),
        Counters(frames=count),
        label=np.array(label, np.int64),
        label_names=label_names,
        subject=np.array(subject, np.int64),
        is_stream=is_stream,
    )


def _plain(sensor: Sensor) -> Board:
    return Board("frames", sensor, Marker("AA 55", bits=sensor.bits))


def _read_archive(path: PathLike, label: str) -> Recording:
    """Return the frames of an archive, whose classes are in the array of that name."""
    name = os.fspath(path)
    arrays = _arrays(read_bounded(path, LIMIT, b"PK"), name, label)
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
    count, (rows, columns) = len(frames), frames.shape[1:]

    def numbers(
        title: str, count: int, low: int, high: int, what: str = "whole numbers"
    ) -> npt.NDArray[Any]:
        found = np.atleast_1d(arrays.get(title, np.zeros(0, np.int64)))
        is_fit = found.shape == (count,) and found.dtype.kind != "U"
        if title in arrays and not (
            is_fit and ((found >= low) & (found <= high)).all()
        ):
            text = f"must hold {what} from {low} to {high}, {count} in all"
            raise ReadError(f"{name}: {title!r} {text}")
        return found

    full = int([*numbers("full", 1, 1, 65535), _usual_full(frames)][0])
    threshold = int([*numbers("threshold", 1, 0, full - 1), 0][0])
    places = f"places in '{label}_names'"
    return labelled(
        frames,
        Sensor(rows, columns, full, threshold),
        numbers(label, count, 0, len(names) - 1, places),
        names,
        numbers("subject", count, -(2**63), 2**63 - 1),
        times=numbers("times", count, 0, _MOST["time"], "seconds"),
        numbers=numbers("numbers", count, 0, _MOST["number"]),
        is_stream="times" in arrays,
    )


def _usual_full(frames: Cells) -> int:
    return 255 if frames.dtype.itemsize == 1 else 65535


def _check_sides(sides: Sequence[int], name: str) -> None:
    if not all(1 <= side <= LARGEST_SIDE for side in sides):
        raise ReadError(
            f"{name}: a frame has 1 to {LARGEST_SIDE} rows and columns, "
            f"not {sides[0]} x {sides[1]}"
        )


def presses_content(found: Recording) -> bytes:
    """Return an archive; the same frames give the same bytes."""
    arrays: dict[str, npt.NDArray[Any]] = {
        "frames": found.frames,
        "full": np.array(found.sensor.full),
        "threshold": np.array(found.sensor.threshold),
    }
    if len(found.label):
        arrays["label"] = found.label
        arrays["label_names"] = np.array(found.label_names, np.str_)
    if len(found.subject):
        arrays["subject"] = found.subject
    if found.is_stream:
        arrays |= {"times": found.times, "numbers": found.numbers}
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
    wanted = _USED | {label, f"{label}_names"}
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
    return flat.reshape([*map(int, shape)], order="F" if is_turned else "C")


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


def open_frames(
    path: PathLike,
    board: Board | None = None,
    *,
    full: int | None = None,
    threshold: int | None = None,
    label: str = "label",
    is_strict: bool = True,
) -> FrameFile:
    """Return the frames of a file, one by one, and what sent them.

    Where an archive or a table has no times there are 44 frames a second, and where it
    has no numbers they are 0, 1, ...

    Args:
        path: A recording, an archive (.npz) or a table (.csv).
        board: What sent the frames of an archive or table; a plain one if None.
        full: What a cell of a plain board takes, instead of what the file says.
        threshold: Above it a cell is pressed, the same way.
        label: The array of the classes in an archive.
        is_strict: Whether each cell must be what the board can send.

    Raises:
        ReadError: If the file is none of them, does not fit the board, or is a
            recording, which has its own.
    """
    name, suffix = os.fspath(path), Path(path).suffix.lower()
    if suffix not in (_TABLE, ".npz"):
        if board is not None:
            raise ReadError(f"{name}: a recording has its own board; name no other one")
        return RecordingFile(path)
    if suffix == _TABLE:
        most = full if board is None else board.sensor.full
        found = _read_table(path, 255 if most and most <= 255 else 65535)
    else:
        found = _read_archive(path, label)
    try:
        if board is None:
            given = {"full": full, "threshold": threshold}
            stated = {key: one for key, one in given.items() if one is not None}
            board = _plain(structs.replace(found.sensor, **stated))
        check_frames(board.sensor, found.frames)
    except (InvalidModelError, TableError) as error:
        raise ReadError(f"{name}: {error}") from error
    frames, most = found.frames, board.sensor.largest
    if is_strict and (frames.min() < 0 or frames.max() > most):
        place, row, column = np.argwhere((frames < 0) | (frames > most))[0].tolist()
        wrong = frames[place, row, column]
        raise ReadError(
            f"{name}: r{row}c{column} of frame {place} is {wrong}, and no whole number "
            f"from 0 to {most}"
        )
    if is_strict:
        frames = frames.astype(board.sensor.dtype, copy=False)
    return replace(found, board=board, frames=frames)


def read_frames(path: PathLike, *, label: str = "label") -> Recording:
    """Return all frames of a file, which may hold any whole numbers.

    Raises:
        ReadError: As `open_frames`, or if they are too many for memory.
    """
    with open_frames(path, label=label, is_strict=False) as file:
        return file.whole()


def _read_table(path: PathLike, most: int) -> Recording:
    """Return the frames of a table, whose cells are at most so much."""
    name = os.fspath(path)
    cells: list[npt.NDArray[np.uint16]] = []
    others: list[FloatArray] = []
    try:
        check_stream(path)
        if Path(path).stat().st_size > LIMIT:
            raise ReadError(f"{name}: is larger than {LIMIT} bytes, too large to read")
        first = next(pieces(path, only=frozenset()), None)  # its names alone
        if first is None:
            raise ReadError(f"{name}: holds no frame")
        titles, sides = _cell_titles(first.columns, name)
        titles += [title for title in _MOST if title in first.columns]
        limits = np.array([[_MOST.get(title, most)] for title in titles])
        is_time = np.array([[title == "time"] for title in titles])
        count = math.prod(sides)
        for batch in batches(path, titles):
            values = batch.values
            is_fit = (values >= 0.0) & (values <= limits)
            is_fit &= (values == np.floor(values)) | is_time
            if not is_fit.all():
                row, column = np.argwhere(~is_fit.T)[0].tolist()
                value = float(values[column, row])
                text = "a missing cell" if math.isnan(value) else f"{value:.16g}"
                kind = "number" if is_time[column] else "whole number"
                raise ReadError(
                    f"{batch.piece.where(row)}: {titles[column]}: {text} is no {kind} "
                    f"from 0 to {limits[column, 0]}"
                )
            cells.append(values[:count].T.astype(np.uint16).reshape(-1, *sides))
            others.append(values[count:])
    except TableError as error:
        raise ReadError(str(error)) from error
    except ReadError:
        raise
    except OSError as error:
        raise ReadError(f"{name}: cannot be read: {reason(error)}") from error
    if not sum(map(len, cells)):
        raise ReadError(f"{name}: holds no frame")
    frames: Cells = np.concatenate(cells)
    if frames.max() <= 255:
        frames = frames.astype(np.uint8)
    known = dict(zip(titles[count:], np.concatenate(others, axis=1), strict=True))
    times, numbers = (known.get(title, ()) for title in _MOST)
    sensor = Sensor(*sides, _usual_full(frames))
    return labelled(frames, sensor, times=times, numbers=numbers, is_stream=True)


def _cell_titles(titles: Sequence[str], name: str) -> tuple[list[str], tuple[int, int]]:
    """Return the columns that hold the cells, row by row, and the sides of a frame."""
    rows = columns = 0
    for title in titles:
        cell = _CELL.fullmatch(title)
        if cell:
            rows, columns = max(rows, int(cell[1]) + 1), max(columns, int(cell[2]) + 1)
        elif title not in _MOST:
            raise ReadError(
                f"{name}: the column {title[:40]!r} is neither time, number nor a "
                f"cell such as r0c0"
            )
    if not rows:
        raise ReadError(f"{name}: has no column of a cell such as r0c0")
    _check_sides((rows, columns), name)
    cells = [f"r{row}c{column}" for row in range(rows) for column in range(columns)]
    for title in cells:
        if title not in titles:
            raise ReadError(
                f"{name}: has no column {title!r}, and frames of {rows} x {columns} "
                f"cells"
            )
    return cells, (rows, columns)
