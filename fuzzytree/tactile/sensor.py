"""A matrix of cells, its frames, and the pressure on each cell.

A frame is an array of whole numbers of shape (rows, columns), the first row at the
top, the first column at the left.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from msgspec import Meta, inspect, structs

from fuzzytree.errors import InvalidModelError, TableError
from fuzzytree.model import Mistake, Value

Cells = npt.NDArray[np.integer]
"""Whole numbers of shape (rows, columns) or (frames, rows, columns)."""

LARGEST_SIDE = 256
"""The most rows or columns that a sensor may have."""

FRAMES_A_SECOND = 44
"""What a board of 16 x 16 cells sends at 115200 baud."""

Side = Annotated[int, Meta(ge=1, le=LARGEST_SIDE)]
Full = Annotated[int, Meta(ge=1, le=65535)]


class Sensor(Value, frozen=True):
    """A matrix of cells.

    Attributes:
        rows: From top to bottom.
        columns: From left to right.
        full: What a cell reads that takes no more; the unit of pressure is this.
        threshold: A cell is pressed where it reads more than this over its baseline.
        baseline: What each cell reads when nothing presses, row by row; empty for 0.
        masked: The (row, column), from 0, of cells that are dead or hot: always 0.
        top: The pressure of a cell that reads full, in `unit`; 1 unless calibrated.
        unit: Of pressures; empty for shares of full.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    rows: Side
    columns: Side
    full: Full = 255
    threshold: int = 0
    baseline: tuple[int, ...] = ()
    masked: tuple[tuple[int, int], ...] = ()
    top: float = 1.0
    unit: str = ""

    @property
    def range_text(self) -> str:
        """What full means, for people: a reading, or a pressure with its unit."""
        return f"{self.top:.4g} {self.unit}" if self.unit else str(self.full)

    def __post_init__(self) -> None:
        """Refuse a sensor that contradicts itself."""
        mistakes = [*_mistakes(self)]
        if mistakes:
            raise InvalidModelError(mistakes)

    @property
    def bits(self) -> Literal[8, 16]:
        """How many bits hold what a cell reads."""
        return 8 if self.full <= 255 else 16

    @property
    def dtype(self) -> np.dtype[np.unsignedinteger]:
        """The type of what a cell reads, in a frame and in a recording."""
        return np.dtype(f"<u{self.bits // 8}")

    @property
    def largest(self) -> int:
        """The largest number of that type."""
        return (1 << self.bits) - 1


def limit_mistakes(value: Value) -> Iterator[Mistake]:
    """Yield each field of a record that is outside the limits of its type.

    Example:
        >>> from fuzzytree.tactile.boards import Port
        >>> list(limit_mistakes(Port(baud=0)))
        [(('baud',), 'baud lies in 1 to 100000000, not 0')]
    """
    for name, kind, about in _limits(type(value)):
        found = getattr(value, name)
        if isinstance(kind, inspect.StrType):
            low, high = kind.min_length, kind.max_length
            if kind.pattern and not re.search(kind.pattern, found):
                yield (name,), f"{name} is {about}, not {found[:40]!r}"
            elif high and not (low or 0) <= len(found) <= high:
                text = f"{name} has {low} to {high} characters, not {len(found)}"
                yield (name,), text
        elif kind.ge is not None:
            most = math.inf if kind.le is None else kind.le
            if not kind.ge <= found <= most:
                text = f"{_number(kind.ge)} to {_number(most)}, not {_number(found)}"
                yield (name,), f"{name} lies in {text}"


@cache
def _limits(record: type[Value]) -> list[tuple[str, Any, str]]:
    """Return the name, type and description of each field that may have limits."""
    info = inspect.type_info(record)
    found: list[tuple[str, Any, str]] = []
    for field in info.fields if isinstance(info, inspect.StructType) else ():
        kind, about = field.type, ""
        if isinstance(kind, inspect.Metadata):
            about = str((kind.extra_json_schema or {}).get("description", ""))
            kind = kind.type
        if isinstance(kind, inspect.StrType | inspect.IntType | inspect.FloatType):
            found.append((field.name, kind, about))
    return found


def _number(value: float) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _mistakes(sensor: Sensor) -> Iterator[Mistake]:
    wrong = [*limit_mistakes(sensor)]
    yield from wrong
    if any(path[0] in ("rows", "columns") for path, _ in wrong):
        return
    if not 0 <= sensor.threshold < max(sensor.full, 1):
        text = f"the threshold lies in 0 to full - 1, not {sensor.threshold}"
        yield ("threshold",), text
    count = sensor.rows * sensor.columns
    if sensor.baseline and len(sensor.baseline) != count:
        text = f"a baseline has {count} numbers, not {len(sensor.baseline)}"
        yield ("baseline",), text
    if any(not 0 <= value <= sensor.full for value in sensor.baseline):
        yield ("baseline",), f"a baseline lies in 0 to {sensor.full}"
    for place, (row, column) in enumerate(sensor.masked):
        if not (0 <= row < sensor.rows and 0 <= column < sensor.columns):
            text = f"no cell ({row}, {column}) in {sensor.rows} x {sensor.columns}"
            yield ("masked", place), text


def check_frames(sensor: Sensor, frames: Cells) -> Cells:
    """Return frames as an array of shape (frames, rows, columns).

    Raises:
        TableError: If they are of another size, or no whole numbers.
    """
    found = np.asarray(frames)
    if not np.issubdtype(found.dtype, np.integer):
        raise TableError(f"frames hold whole numbers, not {found.dtype}")
    if found.ndim == 2:
        found = found[np.newaxis]
    if found.ndim != 3 or found.shape[1:] != (sensor.rows, sensor.columns):
        sides = found.shape[1:] if found.ndim == 3 else found.shape
        shape = " x ".join(map(str, sides))
        raise TableError(
            f"a frame of {shape} cells does not fit a sensor of "
            f"{sensor.rows} x {sensor.columns}"
        )
    return found


def pressed(sensor: Sensor, frames: Cells) -> npt.NDArray[np.int64]:
    """Return what presses on each cell: 0 where nothing does.

    That is the value over the baseline where it is above the threshold, and 0
    elsewhere and in masked cells: shape (frames, rows, columns), in 0 to `sensor.full`,
    also for one frame.

    Raises:
        TableError: If they are of another size, or no whole numbers.

    Example:
        >>> sensor = Sensor(1, 3, threshold=4, baseline=(9, 9, 9))
        >>> pressed(sensor, np.array([[[9, 13, 14]]])).tolist()
        [[[0, 0, 5]]]
    """
    # 64 bits without a sign reach beyond those with one: clip first
    values = np.clip(check_frames(sensor, frames), 0, sensor.full).astype(np.int64)
    values -= baseline_of(sensor)
    values[values <= sensor.threshold] = 0
    values[:, is_masked(sensor)] = 0
    return values


def offsets(sensor: Sensor) -> tuple[int, ...]:
    """Return what is taken from each cell, row by row; empty where that is nothing.

    It is the baseline, and of a masked cell `full`, so that nothing is left of it.

    Example:
        >>> offsets(Sensor(1, 2, masked=((0, 1),))), offsets(Sensor(1, 2))
        ((0, 255), ())
    """
    found = np.where(is_masked(sensor), sensor.full, baseline_of(sensor))
    return tuple(found.reshape(-1).tolist()) if found.any() else ()


def saturated(sensor: Sensor, frames: Cells) -> npt.NDArray[np.int64]:
    """Return how many cells of each frame that are not masked read `full` or more."""
    full = (check_frames(sensor, frames) >= sensor.full) & ~is_masked(sensor)
    count: npt.NDArray[np.int64] = full.sum(axis=(1, 2))
    return count


def baseline_of(sensor: Sensor) -> npt.NDArray[np.int64]:
    """Return what cells read when nothing presses: shape (rows, columns)."""
    shape = (sensor.rows, sensor.columns)
    return np.array(sensor.baseline or np.zeros(shape), np.int64).reshape(shape)


def at_rest(
    sensor: Sensor, baseline: npt.NDArray[np.int64], masked: npt.NDArray[np.bool_]
) -> Sensor:
    """Return a sensor with another baseline and other masked cells.

    Both are of shape (rows, columns), the baseline in 0 to `full`.

    Example:
        >>> found = at_rest(Sensor(1, 2), np.array([[3, 0]]), np.array([[False, True]]))
        >>> found.baseline, found.masked
        ((3, 0), ((0, 1),))
    """
    known = tuple(baseline.reshape(-1).tolist()) if baseline.any() else ()
    return structs.replace(sensor, baseline=known, masked=places(masked))


def places(where: npt.NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """Return the (row, column) of each cell of which something is true."""
    return tuple((int(row), int(column)) for row, column in np.argwhere(where))


def is_masked(sensor: Sensor) -> npt.NDArray[np.bool_]:
    """Return which cells are masked: shape (rows, columns)."""
    found = np.zeros((sensor.rows, sensor.columns), np.bool_)
    for row, column in sensor.masked:
        found[row, column] = True
    return found


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
