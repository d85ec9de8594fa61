"""Labelled frames in numpy archives (`.npz`), and frames of any file with their sensor.

The arrays: `frames`, whole numbers of shape (frames, rows, columns); `full`, the
reading of a saturated cell; `threshold`, above which a cell is pressed, default 0; and,
where known, `label`, the index of each frame's class in `label_names`, and `subject`,
a number for each person or object that pressed.
"""

from __future__ import annotations

import io
import lzma
import math
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.errors import InvalidModelError, ReadError
from fuzzytree.files import PathLike, read_bounded, reason
from fuzzytree.tactile.link.recording import MAGIC, read_recording
from fuzzytree.tactile.sensor import LARGEST_SIDE, Cells, Sensor

if TYPE_CHECKING:
    import numpy.typing as npt


LIMIT = 2**30
"""The most bytes of an archive, packed or not."""

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
_USED = ("frames", "full", "threshold", "label", "label_names", "subject")


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
    """

    frames: Cells
    sensor: Sensor
    label: npt.NDArray[np.int64] = field(default_factory=_unknown)
    label_names: tuple[str, ...] = ()
    subject: npt.NDArray[np.int64] = field(default_factory=_unknown)
    is_stream: bool = False

    def placements(self, is_pressed: npt.NDArray[np.bool_]) -> dict[str, int]:
        """Return how often something was put down, for each class that is known.

        In a stream that is once from one empty frame to the next, else once a frame.

        Args:
            is_pressed: Shape (frames,): whether anything presses.

        Example:
            >>> cells = np.ones((4, 1, 1), np.uint8)
            >>> cup = Presses(cells, Sensor(1, 1), is_stream=True).of_class("cup")
            >>> cup.placements(np.array([True, True, False, True]))
            {'cup': 2}
        """
        is_begun = is_pressed.copy()
        if self.is_stream:
            is_begun[1:] &= ~is_pressed[:-1]
        codes = self.label[is_begun] if len(self.label) else self.label
        counts = np.bincount(codes, minlength=len(self.label_names)).tolist()
        return dict(zip(self.label_names, counts, strict=True))

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
    if not all(1 <= side <= LARGEST_SIDE for side in frames.shape[1:]):
        raise ReadError(
            f"{name}: a frame has 1 to {LARGEST_SIDE} rows and columns, "
            f"not {frames.shape[1]} x {frames.shape[2]}"
        )
    names = _texts(arrays.get(f"{label}_names"), name, f"{label}_names")
    labels = _codes(arrays.get(label), len(frames), name, label)
    if len(labels) and not (labels.min() >= 0 and labels.max() < len(names)):
        raise ReadError(
            f"{name}: {label!r} holds places in {label + '_names'!r}, from 0 to "
            f"{len(names) - 1}, not {labels.min()} to {labels.max()}"
        )
    subject = _codes(arrays.get("subject"), len(frames), name, "subject")
    usual = 255 if frames.dtype.itemsize == 1 else 65535
    full = _number(arrays.get("full"), usual, 1, 65535, f"{name}: 'full'")
    least = _number(arrays.get("threshold"), 0, 0, full - 1, f"{name}: 'threshold'")
    rows, columns = frames.shape[1:]
    return Presses(frames, Sensor(rows, columns, full, least), labels, names, subject)


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
    if dtype.kind not in "iuU" or not dtype.itemsize:
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
        path: A numpy archive (see `fuzzytree.tactile.presses`) or a recording.
        full: What a cell takes, instead of what the file says; for archives.
        threshold: Above it a cell is pressed, the same way.
        label: The array of the classes in an archive.

    Raises:
        ReadError: If the file is neither.
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
    presses = read_presses(path, label=label)
    own = presses.sensor
    try:
        limit = own.full if full is None else full
        least = own.threshold if threshold is None else threshold
        return replace(presses, sensor=Sensor(own.rows, own.columns, limit, least))
    except InvalidModelError as error:
        raise ReadError(f"{name}: {error}") from error
