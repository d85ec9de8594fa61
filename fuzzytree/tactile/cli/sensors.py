"""The sensor of frames, from the file of a board or from options."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

from fuzzytree.cli import option, say_rows, wrong_options

if TYPE_CHECKING:
    from fuzzytree.model import Model
    from fuzzytree.tactile.presses import SensorFrames
    from fuzzytree.tactile.sensor import Cells, Sensor

_SIZE = re.compile(r"(\d{1,3})x(\d{1,3})")


data_option = option(
    "--data", metavar="FRAMES", help="Frames to check with, beside generated ones."
)


class SensorOptions:
    """The options that say which sensor it is."""

    board: str | None = option("--board", metavar="FILE", help="File of the board.")
    size: str | None = option(
        "--sensor", metavar="16x16", help="Rows and columns of the sensor."
    )
    full: int | None = option(
        "--full",
        metavar="N",
        type=int,
        help="Reading of a saturated cell; default 255.",
    )
    threshold: int | None = option(
        "--threshold",
        metavar="N",
        type=int,
        help="Reading above which a cell is pressed; default 0.",
    )


class FramesOptions:
    """The options that say more of a file of frames than it does itself."""

    board: str | None = option(
        "--board", metavar="FILE", help="File of the board of the frames."
    )
    full: int | None = option("--full", type=int, help="Reading of a saturated cell.")
    threshold: int | None = option(
        "--threshold", type=int, help="Reading above which a cell is pressed."
    )


def sensor_of_options(options: SensorOptions) -> Sensor:
    """Return the sensor that the options describe.

    Raises:
        click.UsageError: If they describe none, or two.
        ReadError: If the board's file is none.
    """
    from fuzzytree.tactile.sensor import Sensor

    if options.board is not None:
        return _sensor_of_board(options, "--sensor, --full and --threshold")
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


def _sensor_of_board(options: SensorOptions | FramesOptions, others: str) -> Sensor:
    """Return the sensor of `--board`; refuse options that contradict it."""
    from fuzzytree.tactile.board_file import load_board

    size = options.size if isinstance(options, SensorOptions) else None
    if any(one is not None for one in (size, options.full, options.threshold)):
        raise click.UsageError(f"--board sets {others}; choose one of them")
    return load_board(options.board or "").sensor


def frames_and_sensor(
    path: str, options: FramesOptions, *, label: str = "label", word: str = ""
) -> SensorFrames:
    """Return the frames of an archive or recording, with the sensor they fit.

    All of them are of the class `word`, if it is not empty.

    Raises:
        click.UsageError: If a board is named with --full or --threshold.
        ReadError: If a file is none, or the frames do not fit the board.
    """
    from fuzzytree.tactile.presses import read_frames

    sensor = None
    if options.board is not None:
        sensor = _sensor_of_board(options, "--full and --threshold")
    full, threshold = options.full, options.threshold
    found = read_frames(
        path, sensor=sensor, full=full, threshold=threshold, label=label
    )
    return found.of_class(word) if word else found


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

    presses = read_frames(path, sensor=sensor).presses
    if presses.threshold not in (0, sensor.threshold):  # 0 where it states none
        text = f"states the threshold {presses.threshold}, not {sensor.threshold}"
        say_rows(("differs", path, text), quiet=quiet)
    return presses.frames


def frames_model(path: str) -> Model:
    """Return the model of a file, which must be a tree or a rule base.

    Raises:
        TableError: If the file holds something else.
    """
    from fuzzytree import api
    from fuzzytree.errors import TableError
    from fuzzytree.model import FuzzyTree, RuleBase

    found = api.opened(path)
    if not isinstance(found, FuzzyTree | RuleBase):
        raise TableError(f"{path}: a model of frames is a tree or a rule base")
    return found
