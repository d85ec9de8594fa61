"""The sensor of frames, from the file of a board or from options."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from fuzzytree.cli import ResultOptions, option, say_rows, wrong_options
from fuzzytree.errors import ReadError, TableError

if TYPE_CHECKING:
    from fuzzytree.model import Model
    from fuzzytree.tactile.boards import Board
    from fuzzytree.tactile.sensor import Cells, Sensor

_SIZE = re.compile(r"(\d{1,3})x(\d{1,3})")


data_option = option("--data FRAMES", "Frames to check with, beside generated ones.")


class FramesOptions(ResultOptions):
    """The options that say whose frames a file holds."""

    board: str | None = option("--board FILE", "File of the board.")
    full: int | None = option(
        "--full N",
        "Reading of a saturated cell; default that of a file of frames, or 255.",
        type=int,
    )
    threshold: int | None = option(
        "--threshold N",
        "Reading above which a cell is pressed; default that of a file of "
        "frames, or 0.",
        type=int,
    )


class SensorOptions(FramesOptions):
    """The options that say which sensor it is."""

    size: str | None = option("--sensor 16x16", "Rows and columns of the sensor.")


def sensor_of_options(options: SensorOptions) -> Sensor:
    """Return the sensor that the options describe.

    Raises:
        click.UsageError: If they describe none, or two.
        ReadError: If the board's file is none.
    """
    from fuzzytree.tactile.sensor import Sensor

    if options.board is not None:
        others = (options.size, options.full, options.threshold)
        known = board_of_option(options.board, "--sensor, --full and", others)
        if known.calibration is not None:
            text = "a file from frame to class takes readings; name a board without one"
            raise click.UsageError(f"{options.board} is calibrated, and {text}")
        return known.sensor
    if options.size is None:
        raise click.UsageError(
            "name the board with --board, or its size: --sensor 16x16"
        )
    found = _SIZE.fullmatch(options.size)
    if found is None:
        text = "rows and columns are as in 16x16"
        raise click.UsageError(f"--sensor {options.size}: {text}")
    rows, columns = map(int, found.groups())
    full = 255 if options.full is None else options.full
    with wrong_options():
        return Sensor(rows, columns, full, options.threshold or 0)


def board_of_option(name: str, names: str, others: Sequence[object]) -> Board:
    """Return the board of `--board`; refuse options that contradict it."""
    from fuzzytree.tactile.board_file import load_board

    if any(one is not None for one in others):
        raise click.UsageError(f"--board sets {names} --threshold; choose one of them")
    return load_board(name)


def frames_of_file(
    path: str | None, sensor: Sensor, *, quiet: bool = False
) -> Cells | None:
    """Return the frames of an archive or recording, None if none is named.

    Prints a line where the file states another threshold than the sensor's.

    Raises:
        ReadError: If the file is neither, or its frames do not fit the sensor.
    """
    if path is None:
        return None
    from fuzzytree.tactile.presses import read_frames
    from fuzzytree.tactile.sensor import check_frames

    found = read_frames(path)
    stated = found.sensor.threshold
    if stated not in (0, sensor.threshold):  # 0 where it states none
        text = f"states the threshold {stated}, not {sensor.threshold}"
        say_rows(("differs", path, text), quiet=quiet)
    try:
        return check_frames(sensor, found.frames)
    except TableError as error:
        raise ReadError(f"{path}: {error}") from error


def frames_model(path: str) -> Model:
    """Return the model of a file, which must be a tree or a rule base.

    Raises:
        TableError: If the file holds something else.
    """
    from fuzzytree import api
    from fuzzytree.tactile.recognition.recogniser import checked_model

    return checked_model(api.opened(path), path)
