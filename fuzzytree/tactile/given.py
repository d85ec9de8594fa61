"""Frames from a file: a numpy archive or a recording, with the sensor they fit."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fuzzytree.errors import InvalidModelError, ReadError
from fuzzytree.files import PathLike, reason
from fuzzytree.tactile.link.recording import read_recording
from fuzzytree.tactile.link.records import MAGIC
from fuzzytree.tactile.presses import Presses, read_presses
from fuzzytree.tactile.sensor import Sensor


@dataclass(frozen=True, slots=True)
class Given:
    """Frames, and the sensor that they come from.

    Attributes:
        presses: The frames and what is known of them.
        sensor: As told, as recorded, or as the size of the frames tells.
    """

    presses: Presses
    sensor: Sensor


def given_frames(
    path: PathLike,
    *,
    sensor: Sensor | None = None,
    full: int | None = None,
    threshold: int | None = None,
    label: str = "label",
) -> Given:
    """Return the frames of a file.

    Args:
        path: A numpy archive (see `fuzzytree.tactile.presses`) or a recording.
        sensor: That of a board, if it is known; else that of the recording, or one of
            the size of the archive's frames.
        full: What a cell takes, instead of what the file says; for archives.
        threshold: Above it a cell is pressed, the same way.
        label: The array of the classes in an archive.

    Raises:
        ReadError: If the file is neither, or holds frames of another size.
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
        found = recording.board.sensor
        none = np.zeros(0, np.int64)
        presses = Presses(recording.frames, found.full, none, (), none, found.threshold)
    else:
        presses = read_presses(path, label=label)
        rows, columns = presses.frames.shape[1:]
        try:
            limit = presses.full if full is None else full
            least = presses.threshold if threshold is None else threshold
            found = Sensor(rows, columns, limit, least)
        except InvalidModelError as error:
            raise ReadError(f"{name}: {error}") from error
    rows, columns = presses.frames.shape[1:]
    if sensor and (sensor.rows, sensor.columns) != (rows, columns):
        raise ReadError(
            f"{name}: holds frames of {rows} x {columns} cells, and the board has "
            f"{sensor.rows} x {sensor.columns}"
        )
    return Given(presses, sensor or found)
