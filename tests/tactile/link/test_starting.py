"""The baseline of a sensor, and what is said about its cells."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.errors import TableError
from fuzzytree.tactile.boards import Board, Marker, Start
from fuzzytree.tactile.link import start
from fuzzytree.tactile.link.starting import measured, still
from fuzzytree.tactile.sensor import Cells, Frame, Sensor, pressed

BOARD = Board("mat", Sensor(3, 4), Marker("AA 55"))


def _resting(count: int = 9) -> Cells:
    """Return frames in which each cell wavers around a value of its own."""
    waver = np.arange(count)[:, None, None] % 3
    return 10 + np.arange(12).reshape(3, 4) + waver


def test_a_baseline_is_the_median_of_each_cell() -> None:
    found = measured(BOARD, _resting()).board
    assert found.sensor.baseline == tuple(range(11, 23))
    assert found.sensor.masked == ()
    assert measured(BOARD, _resting()).remarks == []
    assert not pressed(found.sensor, _resting()[1]).any()


@pytest.mark.parametrize(
    ("values", "median"),
    [([5], 5), ([5, 8], 6), ([9, 1, 4], 4), ([1, 2, 2, 9], 2), ([300, 300], 255)],
)
def test_a_median_is_rounded_down_and_lies_within_full(
    values: list[int], median: int
) -> None:
    board = Board("mat", Sensor(1, 1), Marker("AA 55"), start=Start(hot=1.0))
    frames = np.array(values).reshape(-1, 1, 1)
    assert measured(board, frames).board.sensor.baseline == (median,)


def test_a_hot_cell_is_masked_once_and_reported() -> None:
    frames = _resting()
    frames[:, 1, 2] = 200
    board = measured(BOARD, frames).board
    assert board.sensor.masked == ((1, 2),)
    assert measured(board, frames).board.sensor.masked == ((1, 2),)
    assert measured(BOARD, frames).remarks == [
        "at rest above 50% of full, masked: r1 c2",
        "never moved though both neighbours did (dead?), not masked: r1 c2",
    ]
    assert measured(board, frames).remarks == []


def test_something_that_lies_on_the_sensor_is_reported() -> None:
    frames = _resting()
    frames[:, :, 1:] += 150
    assert measured(BOARD, frames).remarks == [
        "at rest above 50% of full, masked: r0 c1, r0 c2, r0 c3, r1 c1, r1 c2, r1 c3, "
        "r2 c1, r2 c2 and 1 more",
        "some of these lie side by side: does something lie on the sensor?",
    ]


def test_a_touch_while_the_baseline_is_taken_is_reported() -> None:
    frames = _resting()
    frames[3, 0, 0] = 100
    assert measured(BOARD, frames).remarks == [
        "moved by more than a quarter of full (was the sensor touched?): r0 c0"
    ]
    assert measured(BOARD, frames).board.sensor.baseline[0] == 11


def test_a_dead_cell_is_reported_and_not_masked() -> None:
    frames = _resting()
    frames[:, 2, 2] = 0
    assert measured(BOARD, frames).remarks == [
        "never moved though both neighbours did (dead?), not masked: r2 c2"
    ]
    assert measured(BOARD, frames).board.sensor.masked == ()


@pytest.mark.parametrize("place", [np.s_[1], np.s_[:, 2]])
def test_a_dead_row_or_column_is_found(place: tuple[slice, int] | int) -> None:
    frames = _resting()
    index = (slice(None), *(place if isinstance(place, tuple) else (place,)))
    frames[index] = 7
    expected = np.zeros((3, 4), np.bool_)
    expected[place] = True
    assert (still(BOARD, frames) == expected).all()


def test_nothing_is_dead_beside_what_moves() -> None:
    frames = np.zeros((9, 3, 4), int)
    frames[1, :2, :2] = 1
    assert not still(BOARD, frames).any()


def test_bytes_as_a_board_sends_them_do_not_wrap_around() -> None:
    frames = np.full((2, 3, 4), 255, np.uint8)
    frames[1] = 254
    board = Board("mat", Sensor(3, 4), Marker("AA 55"), start=Start(hot=1.0))
    assert set(measured(board, frames).board.sensor.baseline) == {254}
    assert measured(board, frames).remarks == []


def test_a_baseline_of_nothing_is_refused() -> None:
    with pytest.raises(TableError, match="a baseline needs 1 frame or more, not 0"):
        measured(BOARD, np.zeros((0, 3, 4), int))


def test_without_frames_to_measure_an_object_at_the_start_is_seen() -> None:
    lying = np.full((4, 4), 90, np.uint8)
    frames = (Frame(lying, number / 10, number) for number in range(40))
    sensor = Sensor(4, 4, threshold=3)
    seen = Board("mat", sensor, Marker("AA"), start=Start(frames=0))
    assert pressed(start(seen, frames).board.sensor, lying).all()
    assert next(frames).number == 0
    measured_away = Board("mat", sensor, Marker("AA"))
    assert not pressed(start(measured_away, frames).board.sensor, lying).any()
