"""Features of frames, in numpy: exact sums as one product, then the program.

A single frame runs the program in plain Python, which is faster and gives the same
bits (`one_row.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.runtimes import ProgramPlan, plan_program, row_runner, run_program
from fuzzytree.tactile.features import FrameProgram, frame_program
from fuzzytree.tactile.features.names import names_of
from fuzzytree.tactile.sensor import Cells, Sensor, check_frames, pressed

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray

_CELLS_AT_ONCE = 1 << 15  # blocks of them stay in the cache


@dataclass(frozen=True, slots=True)
class Features:
    """The features of some frames.

    Attributes:
        names: Of the features.
        values: Shape (features, frames); 0 where nothing presses.
        is_pressed: Shape (frames,): whether anything presses.
    """

    names: tuple[str, ...]
    values: FloatArray
    is_pressed: npt.NDArray[np.bool_]


class FramePlan:
    """Computes features of a sensor's frames; what it needs is made once.

    Raises:
        TableError: If a name is no feature's.
        InvalidModelError: As `fuzzytree.tactile.features.frame_program`.

    Example:
        >>> bar = np.zeros((1, 5, 5), np.uint8)
        >>> bar[0, 2, 1:4] = 255
        >>> FramePlan(Sensor(5, 5), ["S1", "angle"])(bar).values.tolist()
        [[2.0], [0.0]]
    """

    def __init__(self, sensor: Sensor, names: Sequence[str]) -> None:
        self.made: FrameProgram = frame_program(sensor, names)
        self._plan: ProgramPlan = plan_program(self.made.program)
        self._run_row = row_runner(self.made.program)
        size = sensor.rows * sensor.columns
        weights = [one.weights or (0,) * size for one in self.made.sums]
        self._weights = np.array(weights, np.float64).T.copy()

    def __call__(self, frames: Cells) -> Features:
        """Return the features of frames of shape (frames, rows, columns), or of one.

        Raises:
            TableError: If the frames are of another size, or no whole numbers.
        """
        sensor = self.made.sensor
        found = check_frames(sensor, frames)
        size = sensor.rows * sensor.columns
        sums = np.empty((len(self.made.sums), len(found)))
        step = max(_CELLS_AT_ONCE // size, 1)
        for start in range(0, len(found), step):
            part = slice(start, start + step)
            cells = pressed(sensor, found[part]).reshape(-1, size)
            self._take(cells, sums[:, part])
        if len(found) == 1 and self._run_row is not None:
            values = np.array([self._run_row(sums[:, 0].tolist())]).T
        else:
            values = run_program(self._plan, sums)
        return Features(self.made.features, values[:-1], values[-1] > 0.0)

    def _take(self, cells: npt.NDArray[np.int64], sums: FloatArray) -> None:
        """Fill in the sums of some frames; whole numbers below 2^53 add up exactly."""
        sums[:] = (cells.astype(np.float64) @ self._weights).T
        for line, one in enumerate(self.made.sums):
            if one.of == "count":
                sums[line] = np.count_nonzero(cells, axis=1)
            elif one.of == "peak":
                sums[line] = cells.max(axis=1)


def features_of(frames: Cells, names: str, sensor: Sensor | None = None) -> FloatArray:
    """Return features of frames as scikit-learn wants them: (frames, features).

    Args:
        frames: Whole numbers of shape (frames, rows, columns), or one frame.
        names: Features and sets of features, with commas between them, such as
            `log orientation / force`.
        sensor: Whose frames they are; if None, one without a baseline, whose cells
            read at most 255 (65535 for numbers of 16 bits).

    Raises:
        TableError: If a name is no feature's, or the frames do not fit.
        InvalidModelError: If sums for a feature are beyond what doubles hold exactly.

    Example:
        >>> features_of(np.full((1, 2, 3), 255, np.uint8), "force, area").tolist()
        [[6.0, 6.0]]
    """
    if sensor is None:
        found = np.asarray(frames)
        full = 255 if found.dtype.itemsize == 1 else 65535
        rows, columns = found.shape[-2:]
        sensor = Sensor(rows, columns, full)
    return FramePlan(sensor, names_of(names))(frames).values.T
