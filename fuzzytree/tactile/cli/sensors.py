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

    board, size = options.board, options.size
    full, threshold = options.full, options.threshold
    if board is not None:
        if size is not None or full is not None or threshold is not None:
            raise click.UsageError(
                "--board sets --sensor, --full and --threshold; choose one of them"
            )
        from fuzzytree.tactile.board_file import load_board

        return load_board(board).sensor
    if size is None:
        raise click.UsageError(
            "name the board with --board, or its size: --sensor 16x16"
        )
    found = _SIZE.fullmatch(size)
    if found is None:
        raise click.UsageError(f"--sensor {size}: rows and columns are as in 16x16")
    rows, columns = map(int, found.groups())
    with wrong_options():
        return Sensor(rows, columns, 255 if full is None else full, threshold or 0)


def frames_and_sensor(
    path: str, options: FramesOptions, *, label: str = "label"
) -> SensorFrames:
    """Return the frames of an archive or recording, with the sensor they fit.

    Raises:
        click.UsageError: If a board is named with --full or --threshold.
        ReadError: If a file is none, or the frames do not fit the board.
    """
    from fuzzytree.tactile.presses import read_frames

    board, full, threshold = options.board, options.full, options.threshold
    if board is None:
        return read_frames(path, full=full, threshold=threshold, label=label)
    from fuzzytree.tactile.board_file import load_board

    sensor = load_board(board).sensor
    if full is not None or threshold is not None:
        raise click.UsageError(
            "--board sets --full and --threshold; choose one of them"
        )
    return read_frames(path, sensor=sensor, label=label)


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
