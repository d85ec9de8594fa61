"""A matrix of cells, and what presses on it."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.errors import InvalidModelError, TableError
from fuzzytree.tactile.sensor import Sensor, pressed, saturated


def test_a_cell_is_pressed_above_its_threshold_over_its_baseline() -> None:
    sensor = Sensor(1, 4, threshold=3, baseline=(10, 10, 10, 0))
    frame = np.array([[13, 14, 9, 255]], np.uint8)
    assert pressed(sensor, frame).tolist() == [[[0, 4, 0, 255]]]


def test_a_masked_cell_is_never_pressed_nor_saturated() -> None:
    sensor = Sensor(1, 3, masked=((0, 1),))
    frame = np.array([[255, 255, 1]])
    assert pressed(sensor, frame).tolist() == [[[255, 0, 1]]]
    assert saturated(sensor, frame).tolist() == [1]


def test_values_beyond_full_are_full_and_negative_ones_are_nothing() -> None:
    sensor = Sensor(1, 3, full=1000)
    frame = np.array([[-7, 4095, 999]], np.int16)
    assert pressed(sensor, frame).tolist() == [[[0, 1000, 999]]]
    assert saturated(sensor, frame).tolist() == [1]


def test_frames_are_left_as_they_were() -> None:
    frames = np.full((2, 2, 2), 9, np.uint16)
    pressed(Sensor(2, 2, threshold=20), frames)
    assert frames.tolist() == [[[9, 9], [9, 9]]] * 2


@pytest.mark.parametrize(
    ("shape", "text"),
    [
        ((3, 4), "a frame of 3 x 4 cells does not fit a sensor of 2 x 2"),
        ((5, 1, 2), "a frame of 1 x 2 cells does not fit a sensor of 2 x 2"),
    ],
)
def test_a_frame_of_another_size_is_refused(shape: tuple[int, ...], text: str) -> None:
    with pytest.raises(TableError) as caught:
        pressed(Sensor(2, 2), np.zeros(shape, np.uint8))
    assert str(caught.value) == text


def test_frames_of_fractions_are_refused() -> None:
    with pytest.raises(TableError) as caught:
        pressed(Sensor(2, 2), np.zeros((2, 2)))  # type: ignore[arg-type] # on purpose
    assert str(caught.value) == "frames hold whole numbers, not float64"


def test_all_mistakes_of_a_sensor_are_reported_at_once() -> None:
    with pytest.raises(InvalidModelError) as caught:
        Sensor(2, 2, full=0, threshold=9, baseline=(1, 2, 3), masked=((2, 0),))
    assert str(caught.value).splitlines() == [
        "full lies in 1 to 65535, not 0",
        "the threshold lies in 0 to full - 1, not 9",
        "a baseline has 4 numbers, not 3",
        "a baseline lies in 0 to 0",
        "no cell (2, 0) in 2 x 2",
    ]
    with pytest.raises(InvalidModelError) as caught:
        Sensor(0, 300)
    assert str(caught.value).splitlines() == [
        "rows lies in 1 to 256, not 0",
        "columns lies in 1 to 256, not 300",
    ]


def test_a_number_of_any_size_is_clipped_at_full() -> None:
    largest = np.array([[np.iinfo(np.uint64).max]])
    assert pressed(Sensor(1, 1, full=100), largest).tolist() == [[[100]]]
    least = np.array([[np.iinfo(np.int64).min]])
    assert pressed(Sensor(1, 1), least).tolist() == [[[0]]]
