"""What cells read at rest, followed: tare, drift, hot and dead cells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest

from fuzzytree.errors import TableError
from fuzzytree.tactile.rest import Rest, RestEvent
from fuzzytree.tactile.sensor import Sensor, pressed

Pressed = npt.NDArray[np.int64]

SIDE = 8
SENSOR = Sensor(SIDE, SIDE, threshold=4, baseline=(20,) * SIDE**2)
BAR = np.zeros((SIDE, SIDE), np.int64)
BAR[2:6, 3:5] = 90
FREE = np.zeros((SIDE, SIDE), np.int64)
STEP_S = 0.02


def noisy(cells: Pressed, number: int) -> Pressed:
    random = np.random.default_rng(number)
    return 20 + cells + random.integers(-1, 2, cells.shape)


def shown(rest: Rest, frames: Sequence[Pressed], start_s: float = 0.0) -> list[Pressed]:
    return [rest(one, start_s + STEP_S * place) for place, one in enumerate(frames)]


def test_without_drift_it_is_what_a_fixed_baseline_gives() -> None:
    rest, random = Rest(SENSOR, 0.0), np.random.default_rng(3)
    for number in range(50):
        frame = random.integers(0, 256, (SIDE, SIDE))
        assert np.array_equal(rest(frame, number), pressed(SENSOR, frame)[0])
    assert rest.sensor == SENSOR


@pytest.mark.parametrize("shift", [-8, 5, 8, 20])
def test_a_shift_of_all_cells_changes_nothing(shift: int) -> None:
    rest = Rest(SENSOR)
    rest(20 + FREE, 0.0)
    found = rest(20 + shift + BAR, 0.02)
    assert np.array_equal(found, BAR)


def test_a_shift_of_more_than_a_tenth_of_full_is_pressure() -> None:
    assert Rest(SENSOR)(20 + 40 + FREE, 0.0).tolist() == (FREE + 40).tolist()


@pytest.mark.heavy
def test_slow_drift_of_single_cells_is_followed() -> None:
    rest, drift = Rest(SENSOR), np.zeros((SIDE, SIDE))
    drift[::2] = 0.002  # a row in two: no common shift; 36 counts in 6 minutes
    for number in range(18_000):
        frame = np.rint(20 + drift * number).astype(np.int64)
        assert not rest(frame, STEP_S * number).any()
    found = rest(np.rint(20 + drift * 18_000).astype(np.int64) + BAR, 360.0)
    assert np.abs(found - BAR).max() <= 4  # it lags by 30 s, 3 counts
    assert np.array_equal(found > 0, BAR > 0)


def test_what_lies_there_does_not_sink_into_the_baseline() -> None:
    rest = Rest(SENSOR)
    *_, last = shown(rest, [20 + BAR] * 5_000)  # 100 s
    assert np.array_equal(last, BAR)


def test_an_object_that_lay_there_at_the_beginning_is_seen_once_it_moves() -> None:
    under = Sensor(SIDE, SIDE, threshold=4, baseline=tuple((20 + BAR).reshape(-1)))
    rest = Rest(under)
    assert not rest(20 + BAR, 0.0).any()
    moved = np.roll(BAR, 2, axis=1)
    *_, last = shown(rest, [20 + moved] * 5, 0.02)
    assert np.array_equal(last, moved)
    *_, last = shown(rest, [20 + BAR] * 5, 0.2)
    assert np.array_equal(last, BAR)


def test_an_object_from_the_beginning_shows_new_cells_alone_until_it_has_left() -> None:
    under = Sensor(SIDE, SIDE, threshold=4, baseline=tuple((20 + BAR).reshape(-1)))
    rest = Rest(under)
    shown(rest, [20 + BAR])
    *_, near = shown(rest, [20 + np.roll(BAR, 1, axis=1)] * 50, 0.02)
    assert np.array_equal(near, np.roll(BAR, 1, axis=1) * (BAR == 0))
    *_, far = shown(rest, [20 + np.roll(BAR, 2, axis=1)] * 5, 1.02)
    assert np.array_equal(far, np.roll(BAR, 2, axis=1))


def test_a_tare_takes_the_median_of_the_next_frames() -> None:
    rest = Rest(SENSOR)
    rest.tare(5)
    assert rest.is_taring
    shown(rest, [noisy(BAR, number) for number in range(5)])
    assert not rest.is_taring
    assert rest.news() == [RestEvent("tare")]
    assert rest.news() == []
    assert not rest(20 + BAR, 0.2).any()
    again = np.array(rest.sensor.baseline).reshape(SIDE, SIDE)
    assert np.abs(again - 20 - BAR).max() <= 1


def test_a_hot_cell_is_masked_after_a_second_and_reported_once() -> None:
    rest, hot = Rest(SENSOR), np.zeros((SIDE, SIDE), np.int64)
    hot[1, 6] = 60
    frames = [noisy(hot + (BAR if k % 40 < 20 else 0), k) for k in range(200)]
    *_, last = shown(rest, frames)
    assert rest.news() == [RestEvent("hot", ((1, 6),))]
    assert not last.any()
    assert rest.sensor.masked == ((1, 6),)
    shown(rest, frames, 4.0)
    assert rest.news() == []


def test_an_object_of_two_cells_is_not_hot() -> None:
    rest, small = Rest(SENSOR), np.zeros((SIDE, SIDE), np.int64)
    small[1, 6:] = 60
    *_, last = shown(rest, [20 + small] * 500)
    assert np.array_equal(last, small)
    assert rest.news() == []


def test_a_dead_cell_is_found_in_three_placements() -> None:
    rest, broken = Rest(SENSOR), BAR.copy()
    broken[2:6, 2:6] = 90
    broken[3, 4] = 0
    for placement in range(3):
        assert rest.news() == []
        shown(rest, [20 + broken] * 20 + [20 + FREE] * 20, 0.8 * placement)
    rest.follow()
    assert rest.news() == [RestEvent("dead", ((3, 4),))]


def test_a_ring_has_no_dead_cells_where_anything_ever_pressed() -> None:
    rest, ring = Rest(SENSOR), BAR.copy()
    ring[2:5, 2:5] = 90
    ring[3, 3] = 0
    shown(rest, [20 + BAR * 0 + (np.arange(SIDE) == 3) * 50] * 5)
    for placement in range(5):
        shown(rest, [20 + ring] * 20 + [20 + FREE] * 20, 1 + 0.8 * placement)
    rest.follow()
    assert rest.news() == []


def test_masked_cells_that_read_full_are_not_saturated() -> None:
    rest = Rest(Sensor(1, 3, masked=((0, 0),)))
    assert rest.saturated(np.array([[255, 255, 254]])) == 1


def test_a_frame_of_another_size_changes_nothing() -> None:
    rest = Rest(SENSOR)
    with pytest.raises(TableError, match="does not fit a sensor of 8 x 8"):
        rest(np.zeros((2, 2), np.int64), 0.0)
    assert rest.sensor == SENSOR
