"""The sensor of frames, from the file of a board or from options."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

from fuzzytree.cli import ResultOptions, option, say_rows, wrong_options
from fuzzytree.errors import ReadError, TableError

if TYPE_CHECKING:
    from fuzzytree.tactile.boards import Board
    from fuzzytree.tactile.sensor import Cells, Sensor

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

    sensor: str | None = option("--sensor 16x16", "Rows and columns of the sensor.")


def board_of_options(options: FramesOptions) -> Board | None:
    """Return the board of `--board`, if there is one; refuse what contradicts it."""
    from fuzzytree.tactile.board_file import load_board

    if options.board is None:
        return None
    for name in ("sensor", "full", "threshold"):
        if getattr(options, name, None) is not None:
            raise click.UsageError(f"--board sets --{name}; choose one of them")
    return load_board(options.board)


def sensor_of_options(options: SensorOptions) -> Sensor:
    """Return the sensor that the options describe.

    Raises:
        click.UsageError: If they describe none, or two.
        ReadError: If the board's file is none.
    """
    from fuzzytree.tactile.sensor import Sensor

    if board := board_of_options(options):
        if board.calibration is not None:
            text = "a file from frame to class takes readings; name a board without one"
            raise click.UsageError(f"{options.board} is calibrated, and {text}")
        return board.sensor
    if options.sensor is None:
        raise click.UsageError(
            "name the board with --board, or its size: --sensor 16x16"
        )
    found = re.fullmatch(r"(\d{1,3})x(\d{1,3})", options.sensor)
    if found is None:
        text = "rows and columns are as in 16x16"
        raise click.UsageError(f"--sensor {options.sensor}: {text}")
    full = 255 if options.full is None else options.full
    with wrong_options():
        return Sensor(int(found[1]), int(found[2]), full, options.threshold or 0)


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
