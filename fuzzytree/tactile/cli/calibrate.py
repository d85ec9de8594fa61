"""`fuzzytree tactile calibrate`: from known loads to the pressure on each cell."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING

import click
import msgspec

from fuzzytree.cli import (
    ResultOptions,
    answer_json,
    argument,
    flag,
    option,
    output_option,
    say_rows,
    takes,
)
from fuzzytree.errors import ReadError
from fuzzytree.files import write_atomically

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray
    from fuzzytree.tactile.boards import Board


class TactileCalibrateOptions(ResultOptions):
    """The arguments and options of the verb."""

    board: str = argument("BOARD.yaml")
    loads: tuple[str, ...] = argument("LOAD=FILE...", nargs=-1, required=True)
    unit: str = option("--unit UNIT", "Unit of the loads.", default="kPa")
    total: bool = flag(
        "--total", "The loads are forces of a whole object, not pressures on each cell."
    )
    output: str = output_option("-o --output FILE", "Board to write.", required=True)


@click.command("calibrate", short_help="Fit what readings mean to known loads.")
@takes(TactileCalibrateOptions)
def command(options: TactileCalibrateOptions) -> None:
    """Write BOARD.yaml with a calibration: a curve, and a gain for each cell.

    Each LOAD=FILE is a load and a recording that begins with an empty sensor and
    ends under that load: 10=ten.ftr 20=twenty.ftr. Press all cells evenly (a bladder
    of air), or give weights that lie on some of them with --total --unit N.
    """
    from fuzzytree.tactile.board_file import board_text, load_board
    from fuzzytree.tactile.calibration import fit_forces, fit_pressures

    board = load_board(options.board)
    loads: list[float] = []
    readings: list[FloatArray] = []
    for text in options.loads:
        word, sign, path = text.partition("=")
        try:
            loads.append(float(word))
        except ValueError:
            sign = ""
        if not sign or not path:
            wanted = "write LOAD=FILE, such as 10=ten.ftr"
            raise click.UsageError(f"{text!r}: {wanted}")
        readings.append(_readings(path, board))
    fit = fit_forces if options.total else fit_pressures
    law = fit(loads, readings, options.unit)
    calibrated = msgspec.structs.replace(board, calibration=law)
    write_atomically(options.output, board_text(calibrated).encode())
    top = law.top(board.sensor.full)
    gains = f"{min(law.gains):.3g} to {max(law.gains):.3g}" if law.gains else "all 1"
    say_rows(
        *[
            ("at", f"{r:.4g}", f"{p:.4g} {law.unit}")  # the points of the curve
            for r, p in law.points
        ],
        ("gains", gains, ""),
        ("wrote", options.output, f"full is {top:.4g} {law.unit}"),
        quiet=options.quiet,
    )
    if options.as_json:
        answer_json({"file": options.output, "top": top, "calibration": law})


def _readings(path: str, board: Board) -> FloatArray:
    """Return what the cells read under a load: medians of the frames that press.

    Raises:
        ReadError: If there is no such frame, or the recording is another board's.
    """
    import numpy as np

    from fuzzytree.tactile.link.recording import read_recording
    from fuzzytree.tactile.sensor import pressed

    found = read_recording(path)
    other = found.board.sensor
    size = attrgetter("rows", "columns", "full")
    if size(other) != size(board.sensor) or found.board.protocol != board.protocol:
        raise ReadError(f"{path}: is a recording of another board, {found.board.name}")
    if not len(found.frames):
        raise ReadError(f"{path}: holds no frame, so the load has nothing to show")
    cells = pressed(other, found.frames)
    force = cells.sum(axis=(1, 2))
    is_loaded = force >= 0.9 * force.max()  # laid down, and not yet lifted
    if not force.max():
        raise ReadError(f"{path}: nothing presses in it, so it shows no load")
    middle: FloatArray = np.median(cells[is_loaded], axis=0)
    return middle
