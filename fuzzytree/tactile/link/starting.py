"""What a sensor reads while nothing lies on it: baseline, hot cells, dead cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.errors import TableError
from fuzzytree.tactile.boards import Board
from fuzzytree.tactile.sensor import Cells, check_frames, is_masked, places

Places = npt.NDArray[np.bool_]

_MOST_NAMED = 8  # cells in a sentence


class Started(NamedTuple):
    """A board as it is at rest, and what is odd about it, in sentences."""

    board: Board
    remarks: list[str]


def measured(board: Board, frames: Cells) -> Started:
    """Return a board with the baseline that frames show, and its hot cells masked.

    The baseline of a cell is the median of what it reads (the mean of the middle two,
    rounded down, if their number is even). A cell whose baseline is above the share
    `start.hot` of full is masked, beside those that are masked already.

    Nothing should lie on the sensor. Odd are hot cells, something that lies on it or
    touches it, and cells that never move though both neighbours do: these may be dead,
    and are not masked.

    Raises:
        TableError: If there is no frame, or they are of another size.

    Example:
        >>> from fuzzytree.tactile.boards import Marker
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> frames = np.array([[[3, 200]], [[4, 201]]])
        >>> found, remarks = measured(Board("mat", Sensor(1, 2), Marker("AA")), frames)
        >>> found.sensor.baseline, found.sensor.masked, remarks
        ((3, 200), ((0, 1),), ['at rest above 50% of full, masked: r0 c1'])
    """
    sensor, found = board.sensor, check_frames(board.sensor, frames)
    if not len(found):
        raise TableError("a baseline needs 1 frame or more, not 0")
    cells = found.clip(0, sensor.full).astype(np.int64)
    baseline = np.median(cells, axis=0).astype(np.int64)
    known = is_masked(sensor)
    is_hot = (baseline > board.start.hot * sensor.full) & ~known
    is_touched = (np.ptp(found.astype(np.int64), axis=0) > sensor.full // 4) & ~known
    says: list[str] = []
    if is_hot.any():
        share = f"{board.start.hot:.0%} of full"
        says.append(f"at rest above {share}, masked: {named(places(is_hot))}")
    if (is_hot[:, 1:] & is_hot[:, :-1]).any() or (is_hot[1:] & is_hot[:-1]).any():
        says.append("some of these lie side by side: does something lie on the sensor?")
    if is_touched.any():
        text = "moved by more than a quarter of full (was the sensor touched?)"
        says.append(f"{text}: {named(places(is_touched))}")
    is_still = still(board, found)
    if is_still.any():
        text = "never moved though both neighbours did (dead?), not masked"
        says.append(f"{text}: {named(places(is_still))}")
    changes = {
        "baseline": tuple(baseline.reshape(-1).tolist()),
        "masked": (*sensor.masked, *places(is_hot)),
    }
    sensor = msgspec.structs.replace(sensor, **changes)
    return Started(msgspec.structs.replace(board, sensor=sensor), says)


def still(board: Board, frames: Cells) -> Places:
    """Return which cells never move though both neighbours in a line do.

    The line is a row or a column, so a dead row is found, and a dead column. Cells
    that are masked are left out. There must be 1 frame or more.
    """
    found = check_frames(board.sensor, frames)
    is_moved: Places = found.max(axis=0) > found.min(axis=0)
    is_between = np.zeros_like(is_moved)
    is_between[1:-1] |= is_moved[2:] & is_moved[:-2]
    is_between[:, 1:-1] |= is_moved[:, 2:] & is_moved[:, :-2]
    return is_between & ~is_moved & ~is_masked(board.sensor)


def named(places: Sequence[tuple[int, int]]) -> str:
    """Return places by name, as features call them, the first ones only.

    Example:
        >>> named([(0, 3), (1, 4)])
        'r0 c3, r1 c4'
    """
    names = [f"r{row} c{column}" for row, column in places[:_MOST_NAMED]]
    more = len(places) - len(names)
    return f"{', '.join(names)}{f' and {more} more' if more else ''}"
