"""What cells read at rest, followed while frames come: tare, drift, hot and dead cells.

A baseline that was measured once holds for minutes: sensors warm up, creep and age.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from fuzzytree.tactile.calibration import STEPS, Calibration
from fuzzytree.tactile.sensor import (
    Cells,
    Sensor,
    at_rest,
    baseline_of,
    check_frames,
    is_masked,
    places,
)

if TYPE_CHECKING:
    import numpy.typing as npt

FOLLOW_S = 30.0
"""Seconds in which the baseline of a free cell follows 63 % of a change."""

HOT_S = 1.0
"""Seconds for which a single cell presses before it is masked."""

LARGEST_SHIFT = 0.1
"""The largest share of full by which all cells may have moved together."""

TARE_FRAMES = 10
"""How many frames a tare takes."""

_RELEASED = 3  # frames below the baseline, one after another, before it goes down
_DEAD = 3  # placements around a cell that does not press
_LONGEST_S = 1.0  # between two frames: a longer pause counts as this


@dataclass(frozen=True, slots=True)
class RestEvent:
    """A change in what cells read at rest, or in what lies apart.

    Attributes:
        kind: `tare`; `interrupted`: a tare that begins anew, for the port went away;
            `hot` or `dead` cells that were found; or `merged` objects that touch now.
        cells: The (row, column) of each cell that is masked from now on.
        objects: The numbers of objects that are one region now.
    """

    kind: Literal["tare", "interrupted", "hot", "dead", "merged"]
    cells: tuple[tuple[int, int], ...] = ()
    objects: tuple[int, ...] = ()

    @property
    def text(self) -> str:
        """The change in words."""
        from fuzzytree.tactile.link.starting import named

        match self.kind:
            case "tare":
                return "tared: what the cells read now is their baseline"
            case "interrupted":
                return "the port went away during the tare, which begins anew"
            case "merged":
                names = " and ".join(map(str, self.objects))
                return f"the objects {names} touch: they are one region, and one object"
            case "hot":
                why = "pressed alone all the time"
            case "dead":
                why = "never pressed"
        return f"{self.kind} cells, masked: {named(self.cells)} ({why})"


class Rest:
    """What each cell reads at rest; called with each frame, it gives what presses.

    1. The baseline is taken off. Where the lowest quarter of the cells lies within
       the threshold, at most a tenth of full away from 0, all cells have moved
       together: its median is taken off as well. (An object that presses on three
       quarters of the cells alike looks the same.)
    2. What is above the threshold presses, except in masked cells.
    3. The baseline of cells that nothing presses follows what they read. Where a cell
       reads less than its baseline by more than the threshold in 3 frames, one after
       another, the baseline goes down at once: what lay there when it was measured
       has left the cell. Cells that it still presses go on to show nothing.
    4. A cell that presses alone for `hot_s` seconds, without having been at rest in
       between, is hot. A cell is dead that never pressed while its neighbours on
       both sides did, in 3 placements. Both are masked.

    Args:
        sensor: With the baseline and the masked cells that are known.
        follow_s: Seconds in which the baseline follows 63 % of a change; 0 for a
            baseline, and masked cells, that stay as they are.
        calibration: What makes pressures of readings; without one they stay.
        hot_s: Seconds for which a single cell presses before it is hot.

    Attributes:
        bare: The sensor of what is given: neither baseline nor threshold.

    Example:
        >>> rest = Rest(Sensor(2, 4, threshold=4, baseline=(9,) * 8))
        >>> rest(np.array([[12, 11, 12, 12], [12, 90, 90, 12]]), 0.0).tolist()
        [[0, 0, 0, 0], [0, 78, 78, 0]]
    """

    def __init__(
        self,
        sensor: Sensor,
        follow_s: float = FOLLOW_S,
        calibration: Calibration | None = None,
        *,
        hot_s: float = HOT_S,
    ) -> None:
        self._sensor, self._follow_s, self._hot_s = sensor, follow_s, hot_s
        shape = (sensor.rows, sensor.columns)
        self.bare = Sensor(*shape, full=sensor.full)
        self._calibration = calibration
        if calibration is not None:
            top = calibration.top(sensor.full)
            self.bare = Sensor(*shape, STEPS, top=top, unit=calibration.unit)
        self._time: float | None = None
        self._has_pressed = np.zeros(shape, np.bool_)
        self._is_around = np.zeros(shape, np.bool_)  # in the placement of now
        self._placements = np.zeros(shape, np.int64)
        self._tare_frames = 0
        self._tared: list[Cells] = []
        self._events: list[RestEvent] = []
        self.restart(sensor)

    @property
    def is_taring(self) -> bool:
        """Whether a tare is going on."""
        return self._tare_frames > 0

    @property
    def sensor(self) -> Sensor:
        """The sensor as of now: its baseline in whole numbers, and all masked cells."""
        rests = np.rint(self._baseline).clip(0, self._sensor.full).astype(np.int64)
        return at_rest(self._sensor, rests, ~self._is_free)

    @property
    def tare_text(self) -> str:
        """How far a tare is that is going on."""
        return f"{len(self._tared)} of {self._tare_frames} frames came"

    def tare(self, frames: int = TARE_FRAMES) -> None:
        """Let the next frames, 1 or more, be the baseline: their median."""
        self._tared, self._tare_frames = [], frames

    def interrupt(self) -> None:
        """Begin a tare anew that is going on: frames before a pause do not count."""
        if self._tare_frames:
            self._tared = []
            self._events.append(RestEvent("interrupted"))

    def restart(self, sensor: Sensor) -> None:
        """Take the baseline and the masked cells of a sensor, as after a tare."""
        self._waiting: Callable[[], None] | None = None
        self._baseline = baseline_of(sensor).astype(np.float64)
        self._is_free = ~is_masked(sensor)
        self._below = np.zeros(self._baseline.shape, np.int64)
        self._alone_s = np.zeros(self._baseline.shape)

    def news(self) -> list[RestEvent]:
        """Return what has changed since the last time."""
        news, self._events = self._events, []
        return news

    def __call__(self, frame: Cells, time: float) -> npt.NDArray[np.int64]:
        """Return what presses on each cell, of shape (rows, columns), for `bare`.

        Args:
            frame: Of shape (rows, columns), as the board sent it.
            time: In seconds; it never goes back.

        Raises:
            TableError: If the frame is of another size, or holds no whole numbers.
        """
        self.follow()
        sensor = self._sensor
        cells = np.clip(check_frames(sensor, frame)[0], 0, sensor.full)
        if self._tare_frames:
            self._take(cells)
        values = cells - self._baseline
        if self._follow_s:
            values -= self._shift(values)
        found: npt.NDArray[np.int64] = np.rint(values).astype(np.int64)
        found[(found <= sensor.threshold) | ~self._is_free] = 0
        before, self._time = self._time, time
        passed_s = 0.0 if before is None else min(max(time - before, 0.0), _LONGEST_S)
        self._waiting = partial(self._follow, cells, values, found > 0, passed_s)
        if self._calibration is not None:
            return self._calibration.steps(found, sensor.full)
        return found

    def follow(self) -> None:
        """Let the baseline follow the last frame; the next call does it otherwise.

        So it takes no time of an answer.
        """
        if self._waiting is not None and self._follow_s:
            self._waiting()
        self._waiting = None

    def saturated(self, frame: Cells) -> int:
        """Return how many cells of a frame that are not masked read full or more."""
        return int(np.count_nonzero((frame >= self._sensor.full) & self._is_free))

    def _take(self, cells: Cells) -> None:
        """Take a frame for the tare; the last one ends it."""
        self._tared.append(cells)
        if len(self._tared) < self._tare_frames:
            return
        self._baseline = np.median(np.array(self._tared), axis=0)
        self._below[:] = 0
        self._alone_s[:] = 0.0
        self._tared, self._tare_frames = [], 0
        self._events.append(RestEvent("tare"))

    def _shift(self, values: npt.NDArray[np.float64]) -> float:
        """Return by how much all cells have moved together; 0 if they have not."""
        free = values[self._is_free]
        count = len(free) // 4
        if not count:
            return 0.0
        lowest = np.sort(free)[:count]
        middle = float(lowest[count // 2])
        is_even = lowest[-1] - lowest[0] <= max(self._sensor.threshold, 1)
        is_small = abs(middle) <= LARGEST_SHIFT * self._sensor.full
        return middle if is_even and is_small else 0.0

    def _follow(
        self,
        cells: Cells,
        values: npt.NDArray[np.float64],
        is_pressed: npt.NDArray[np.bool_],
        passed_s: float,
    ) -> None:
        """Let the baseline follow, and find hot and dead cells."""
        rate = -np.expm1(-passed_s / self._follow_s)
        moved = rate * (cells - self._baseline)
        self._baseline += np.where(is_pressed, 0.0, moved)
        is_below = values < -max(self._sensor.threshold, 1)
        self._below = np.where(is_below, self._below + 1, 0)
        is_lifted = self._below >= _RELEASED
        if is_lifted.any():
            self._baseline = np.where(is_lifted, cells, self._baseline)
        sides = _neighbours(is_pressed)
        is_alone = is_pressed & (sides.sum(axis=0) == 0)
        self._alone_s += np.where(is_alone, passed_s, 0.0)
        self._alone_s[~is_pressed] = 0.0
        self._mask(self._alone_s > self._hot_s, "hot")
        if not is_pressed.any():  # what lay there has been taken away
            self._placements += self._is_around
            self._is_around[:] = False
            self._mask(~self._has_pressed & (self._placements >= _DEAD), "dead")
        self._has_pressed |= is_pressed
        left, right, above, below = sides[:4]
        self._is_around |= (left & right & above & below) & ~is_pressed

    def _mask(self, where: npt.NDArray[np.bool_], kind: Literal["hot", "dead"]) -> None:
        where = where & self._is_free
        if where.any():
            self._is_free = self._is_free & ~where
            self._events.append(RestEvent(kind, places(where)))


def _neighbours(pressed: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return whether each cell's neighbours press: left, right, above, below, others.

    Of shape (8, rows, columns). What lies outside presses nowhere.
    """
    rows, columns = pressed.shape
    wide = np.zeros((rows + 2, columns + 2), np.bool_)
    wide[1:-1, 1:-1] = pressed
    steps = ((1, 0), (1, 2), (0, 1), (2, 1), (0, 0), (0, 2), (2, 0), (2, 2))
    return np.stack([wide[r : r + rows, c : c + columns] for r, c in steps])
