"""The objects that lie on a sensor: connected regions, followed from frame to frame."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fuzzytree.tactile.rest import Rest

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.tactile.link.recording import FrameFile
    from fuzzytree.tactile.sensor import Sensor

LEAST_AREA = 2
"""The fewest cells of an object; what is smaller is counted and left out."""

MOST_OBJECTS = 16
"""The most objects in a frame: those with the largest forces."""

HYSTERESIS = 0.6
"""The share of the votes that another answer needs to replace the one that stands."""

_TOUCHING = np.ones((3, 3), np.bool_)  # at sides and corners
_FORGOTTEN_S = 0.5


@dataclass(frozen=True, slots=True)
class Region:
    """Cells that press and touch each other, at sides or corners.

    Attributes:
        cells: What presses, of shape (rows, columns) of the sensor; 0 outside.
        box: The first row and column, and those behind the last ones.
        area: How many cells press.
        force: The sum of what presses.
    """

    cells: npt.NDArray[np.int64]
    box: tuple[int, int, int, int]
    area: int
    force: int


def regions(
    pressed: npt.NDArray[np.int64], least: int = LEAST_AREA
) -> tuple[list[Region], int]:
    """Return the regions of a frame, largest force first, and how many are left out.

    Those of fewer than `least` cells are left out, and those beyond `MOST_OBJECTS`.

    Args:
        pressed: What presses on each cell, of shape (rows, columns).
        least: The fewest cells of a region, 1 or more.

    Example:
        >>> cells = np.array([[9, 0, 0, 5], [9, 0, 0, 5], [0, 0, 0, 5], [7, 0, 0, 0]])
        >>> found, left_out = regions(cells)
        >>> [(one.box, one.area, one.force) for one in found], left_out
        ([((0, 0, 2, 1), 2, 18), ((0, 3, 3, 4), 3, 15)], 1)
    """
    from scipy import ndimage

    labelled: Any = ndimage.label(pressed, _TOUCHING)  # scipy states a union
    numbers, count = labelled
    if not count:
        return [], 0
    areas = np.bincount(numbers.reshape(-1), minlength=count + 1)
    found: list[Region] = []
    for number, (high, wide) in enumerate(ndimage.find_objects(numbers), start=1):
        area = int(areas[number])
        if area < least:
            continue
        own = pressed if count == 1 else np.where(numbers == number, pressed, 0)
        box = (high.start, wide.start, high.stop, wide.stop)
        found.append(Region(own, box, area, int(own.sum())))
    found.sort(key=lambda one: (-one.force, one.box))
    return found[:MOST_OBJECTS], count - min(len(found), MOST_OBJECTS)


@dataclass(slots=True)
class _Track:
    """An object, as it is followed."""

    number: int
    began: float  # the time when it came
    seen: float = 0.0  # the time when it was seen last,
    middle: tuple[float, float] = (0.0, 0.0)  # and where
    votes: deque[tuple[float, int]] = field(default_factory=deque)  # times, answers
    counts: Counter[int] = field(default_factory=Counter)  # of the votes, by answer
    answer: int | None = None  # the one that stands


class Tracker:
    """Follows objects from frame to frame, and lets their answers vote.

    The region that lies nearest to where an object was is that object, if it is not
    farther than half of its box and two cells. An answer stands once the object has
    been there for `seconds`, and is -1 before; another one replaces it with
    `HYSTERESIS` of the votes.

    Args:
        seconds: How long votes count; 0 for the answer to each frame.

    Attributes:
        merged: The numbers of objects of the frame before that are one region in the
            last one; empty as a rule.

    Example:
        >>> tracker, (one,) = Tracker(1.0), regions(np.ones((2, 2), np.int64))[0]
        >>> votes = [(0.0, 5), (0.5, 5), (1.0, 5), (1.2, 3), (1.4, 5)]
        >>> [tracker(time, [one], [code])[0] for time, code in votes]
        [(1, -1), (1, -1), (1, 5), (1, 5), (1, 5)]
    """

    def __init__(self, seconds: float = 0.0) -> None:
        self._seconds = seconds
        self._tracks: list[_Track] = []
        self._last = 0
        self._seen: set[int] = set()  # in the frame before
        self.merged: tuple[int, ...] = ()

    def __call__(
        self, time: float, found: Sequence[Region], codes: Sequence[int]
    ) -> list[tuple[int, int]]:
        """Return the number and the answer of each region.

        Args:
            time: In seconds; it never goes back.
            found: The regions of a frame.
            codes: The answer to each: a class, or a number below 0 for none.
        """
        keep_s = max(self._seconds, _FORGOTTEN_S)
        known = [one for one in self._tracks if time - one.seen <= keep_s]
        pairs = sorted(  # the nearest ones first
            (distance, place, number)
            for place, region in enumerate(found)
            for number, track in enumerate(known)
            if (distance := math.dist(_middle(region), track.middle)) <= _reach(region)
        )
        owner: dict[int, int] = {}
        for _, place, number in pairs:
            if place not in owner and number not in owner.values():
                owner[place] = number
        answers: list[tuple[int, int]] = []
        for place, (region, code) in enumerate(zip(found, codes, strict=True)):
            if place not in owner:
                self._last += 1
                owner[place] = len(known)
                known.append(_Track(self._last, time))
            track = known[owner[place]]
            track.middle, track.seen = _middle(region), time
            answers.append((track.number, self._voted(track, time, code)))
        seen = {number for number, _ in answers}
        gone = [one for one in known if one.number in self._seen - seen]
        self.merged = ()
        for region, (number, _) in zip(found, answers, strict=True):
            places = [(one.number, *map(round, one.middle)) for one in gone]
            inside = [one for one, *at in places if region.cells[*at] > 0]
            if inside:
                self.merged = (*sorted({number, *inside}),)
        self._tracks, self._seen = known, seen
        return answers

    def _voted(self, track: _Track, time: float, code: int) -> int:
        if not self._seconds:
            return code
        track.votes.append((time, code))
        track.counts[code] += 1
        while time - track.votes[0][0] > self._seconds:
            track.counts[track.votes.popleft()[1]] -= 1
        if time - track.began < self._seconds:
            return -1
        leader, count = max(track.counts.items(), key=lambda pair: (pair[1], -pair[0]))
        if track.answer is None or count >= HYSTERESIS * len(track.votes):
            track.answer = leader
        return track.answer


def _middle(region: Region) -> tuple[float, float]:
    top, left, bottom, right = region.box
    return (top + bottom - 1) / 2, (left + right - 1) / 2


def _reach(region: Region) -> float:
    top, left, bottom, right = region.box
    return 2.0 + max(bottom - top, right - left) / 2


@dataclass(frozen=True, slots=True)
class Followed:
    """A stream of frames as live recognition sees it: the object of largest force.

    Attributes:
        frames: What presses of that object, of shape (frames, rows, columns).
        sensor: That fits them: no baseline, no threshold.
        saturated: In how many frames a cell takes no more.
        several: In how many frames there were other objects, which are left out.
        placements: Shape (frames,): how often the sensor had been free before, plus 1.
    """

    frames: npt.NDArray[np.uint16]
    sensor: Sensor
    saturated: int
    several: int
    placements: npt.NDArray[np.int64]


def followed(file: FrameFile) -> Followed:
    """Return the frames of a file as live recognition would see them.

    Args:
        file: A recording, an archive or a table.

    Raises:
        ReadError: If the file cannot be read.
    """
    board = file.board
    rest = Rest(board.sensor, board.start.follow_s, board.calibration)
    stated = file.sensor
    frames: list[npt.NDArray[np.uint16]] = []
    placements: list[int] = []
    saturated = several = count = 0
    is_free = True
    nothing = np.zeros((rest.bare.rows, rest.bare.columns), np.uint16)
    for frame, _ in file:
        if file.sensor is not stated:
            stated = file.sensor
            rest.restart(stated)
        found, _ = regions(rest(frame.cells, frame.time), LEAST_AREA)
        saturated += rest.saturated(frame.cells) > 0
        several += len(found) > 1
        count += is_free and bool(found)
        is_free = not found
        frames.append(found[0].cells.astype(np.uint16) if found else nothing)
        placements.append(count)
    return Followed(
        np.array(frames).reshape(-1, *nothing.shape),
        rest.bare,
        saturated,
        several,
        np.array(placements, np.int64),
    )
