"""What a lab meets after the start: gain, offset, drift, hot and dead cells."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt
import pytest
from press_physics import press
from press_shapes import OBJECTS

from fuzzytree.tactile.link.recording import FrameRecord
from fuzzytree.tactile.recognition.live import Live
from fuzzytree.tactile.recognition.recogniser import usual_floor
from fuzzytree.tactile.sensor import Counters, Frame
from tests.tactile.frame_models import pressed_tree
from tests.tactile.replays import first_label, replayed

Reading = npt.NDArray[np.float64]
Change = Callable[[Reading, float], Reading]

FRAMES_A_SECOND = 44
RISE, STAY, REST = 4, 12, 8
EMPTY = 30  # frames at the start


def placements(count: int, change: Change) -> Iterator[tuple[FrameRecord, int]]:
    """Give frames of objects that are put down and taken away, each with its number.

    The number is -1 where an object is not yet, or no longer, pressed as a whole. The
    sensor changes after its start.
    """
    random = np.random.default_rng(5)
    shares = [*np.linspace(0, 1, RISE), *[1.0] * STAY, *np.linspace(1, 0, RISE)]
    fresh = [press(name, count, 99).frames for name in OBJECTS]
    shown = [(np.zeros((16, 16)), -1)] * EMPTY
    for turn in range(count):
        for code, frames in enumerate(fresh):
            number = turn * len(OBJECTS) + code
            for share in [*shares, *[0.0] * REST]:
                shown.append((share * frames[turn], number if share == 1.0 else -1))
    for place, (cells, number) in enumerate(shown):
        time = place / FRAMES_A_SECOND
        seen = cells + random.normal(0.0, 0.5, cells.shape)
        if place >= EMPTY:
            seen = change(seen, time)
        whole = np.rint(seen).clip(0, 255).astype(np.uint8)
        counters = Counters(frames=place + 1)
        yield FrameRecord(Frame(whole, time, place), counters), number


def share_right(count: int, change: Change, presses: int = 60) -> float:
    """Return of how many placements most frames are recognised, of 7 times `count`."""
    tree, sensor = pressed_tree(presses), press("circle", 1).sensor
    pairs = [*placements(count, change)]
    source = replayed((record for record, _ in pairs), 0.0)
    live = Live(tree, sensor, source, "lab", reject=usual_floor(tree))
    names, right = list(OBJECTS), np.zeros(count * len(OBJECTS))
    for (_, number), answer in zip(pairs, live.answers(), strict=True):
        if number >= 0:
            right[number] += first_label(answer) == names[number % len(names)]
    return float(np.mean(right > (STAY + 2) / 2))


def _cell(row: int, column: int) -> Reading:
    cells = np.zeros((16, 16))
    cells[row, column] = 1.0
    return cells


def nothing(cells: Reading, _: float) -> Reading:
    return cells


CHANGES: dict[str, tuple[Change, float]] = {
    "none": (nothing, 0.98),
    "gain 0.8": (lambda cells, _: 0.8 * cells, 0.98),
    "gain 1.3": (lambda cells, _: 1.3 * cells, 0.98),
    "offset 8": (lambda cells, _: cells + 8, 0.95),
    "offset 20": (lambda cells, _: cells + 20, 0.95),
    "drift of 0.2 a second": (lambda cells, time: cells + min(0.2 * time, 40), 0.95),
    "hot cell in the middle": (lambda cells, _: cells + 60 * _cell(7, 8), 0.95),
    "hot cell at the edge": (lambda cells, _: cells + 60 * _cell(0, 3), 0.95),
    "dead cell": (lambda cells, _: cells * (1 - _cell(7, 7)), 0.95),
}


@pytest.mark.heavy
@pytest.mark.parametrize("name", CHANGES)
def test_what_changes_after_the_start_costs_few_placements(name: str) -> None:
    change, floor = CHANGES[name]
    assert share_right(30, change) >= floor  # of 210


def test_a_few_placements_after_a_change_are_right() -> None:
    assert share_right(2, CHANGES["offset 8"][0]) >= 0.9  # of 14
