"""Interpolated frames: exact where they can be, and never beyond their cells."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from fuzzytree.errors import TableError
from fuzzytree.tactile.interpolation import MOST_POINTS, interpolated, weights

TIMES = (1, 2, 3, 4, 5, 6, 7)
PAPER = np.array([[100, 50], [20, 10]])
LARGEST_DIFFERENCE = 0.10472  # of the range of four cells, from bilinear values

SIDES = st.integers(1, 6)
WHOLE = st.tuples(SIDES, SIDES).flatmap(
    lambda shape: arrays.arrays(np.uint16, shape, elements=st.integers(0, 65535))
)
Turn = Any


def at(cells: npt.NDArray[Any], row: Fraction, column: Fraction) -> Fraction:
    """Return the exact value at a point, in cells from the first one's centre."""
    total = degrees = Fraction(0)
    for down, right in itertools.product((0, 1), repeat=2):
        base_row, base_column = row // 1 + down, column // 1 + right
        degree = 1 - max(abs(row - base_row), abs(column - base_column))
        inner_row = min(max(base_row, 0), cells.shape[0] - 1)
        inner_column = min(max(base_column, 0), cells.shape[1] - 1)
        total += degree * Fraction(cells[inner_row, inner_column].item())
        degrees += degree
    return total / degrees


def exact(cells: npt.NDArray[Any], times: int) -> list[list[Fraction]]:
    """Return every point of a frame, by the definition."""
    rows, columns = (
        [Fraction(2 * point + 1 - times, 2 * times) for point in range(times * side)]
        for side in cells.shape
    )
    return [[at(cells, row, column) for column in columns] for row in rows]


def corners(cells: npt.NDArray[Any], times: int) -> npt.NDArray[Any]:
    """Return the four cells of each point, shape (4, rows, columns)."""
    row, column = (
        np.floor((2 * np.arange(times * side) + 1 - times) / (2 * times)).astype(int)
        for side in cells.shape
    )
    found = [
        cells[
            np.clip(row + down, 0, cells.shape[0] - 1)[:, None],
            np.clip(column + right, 0, cells.shape[1] - 1),
        ]
        for down, right in itertools.product((0, 1), repeat=2)
    ]
    return np.array(found)


def bilinear(cells: npt.NDArray[Any], times: int) -> npt.NDArray[np.float64]:
    """Return the bilinear values at the same points."""
    row, column = (
        (2 * np.arange(times * side) + 1 - times) / (2 * times) % 1.0
        for side in cells.shape
    )
    upper_left, upper_right, lower_left, lower_right = corners(cells, times)
    upper = upper_left * (1 - column) + upper_right * column
    lower = lower_left * (1 - column) + lower_right * column
    found: npt.NDArray[np.float64] = upper * (1 - row)[:, None] + lower * row[:, None]
    return found


@settings(max_examples=30)
@given(cells=WHOLE, times=st.sampled_from(TIMES))
def test_whole_cells_give_the_floats_nearest_to_the_exact_values(
    cells: npt.NDArray[np.uint16], times: int
) -> None:
    wanted = [[float(value) for value in row] for row in exact(cells, times)]
    assert interpolated(cells, times).tolist() == wanted


def test_single_precision_is_rounded_once_as_well() -> None:
    cells = np.random.default_rng(3).integers(0, 4096, (5, 4), dtype=np.uint16)
    rows = exact(cells, 7)
    for (row, column), value in np.ndenumerate(interpolated(cells, 7, dtype="f4")):
        error = abs(Fraction(value.item()) - rows[row][column])
        assert error <= Fraction(np.spacing(value).item()) / 2


@settings(max_examples=30)
@given(cells=WHOLE, times=st.sampled_from(TIMES))
def test_a_value_lies_between_its_four_cells(
    cells: npt.NDArray[np.uint16], times: int
) -> None:
    found = interpolated(cells, times)
    around = corners(cells, times)
    assert (around.min(axis=0) <= found).all()
    assert (found <= around.max(axis=0)).all()


@settings(max_examples=20)
@given(cells=WHOLE, times=st.sampled_from(TIMES[::2]))
def test_the_middle_of_a_cell_has_its_value(
    cells: npt.NDArray[Any], times: int
) -> None:
    found = interpolated(cells, times)[times // 2 :: times, times // 2 :: times]
    assert np.array_equal(found, cells)


@settings(max_examples=20)
@given(value=st.integers(-(2**40), 2**40))
def test_a_frame_of_one_value_has_it_everywhere(value: int) -> None:
    assert (interpolated(np.full((3, 2), value), 6) == value).all()


@settings(max_examples=20)
@given(cells=WHOLE, times=st.sampled_from(TIMES))
@pytest.mark.parametrize(
    "turn", [np.flipud, np.fliplr, np.rot90, np.transpose], ids=lambda f: f.__name__
)
def test_a_turned_frame_gives_turned_values_bit_for_bit(
    turn: Turn, cells: npt.NDArray[Any], times: int
) -> None:
    found = interpolated(turn(cells), times)
    assert np.array_equal(found, turn(interpolated(cells, times)))


@settings(max_examples=20)
@given(cells=WHOLE, times=st.sampled_from(TIMES))
def test_neighbouring_points_differ_by_two_ranges_a_cell_at_most(
    cells: npt.NDArray[np.uint16], times: int
) -> None:
    found = interpolated(cells, times)
    spread = float(cells.max()) - float(cells.min())
    for axis in (0, 1):
        steps = np.abs(np.diff(found, axis=axis))
        assert (steps <= 2.0 * spread / times * (1.0 + 1e-12)).all()


def test_the_bound_of_a_step_is_met_beside_one_cell_among_others() -> None:
    cells = np.array([[0, 1, 0], [0, 0, 0]])
    steps = np.abs(np.diff(interpolated(cells, 201), axis=1)) * 201
    assert 1.9 < steps.max() <= 2.0


@settings(max_examples=30)
@given(cells=WHOLE, times=st.sampled_from(TIMES))
def test_values_differ_from_bilinear_ones_by_a_tenth_of_the_range_at_most(
    cells: npt.NDArray[np.uint16], times: int
) -> None:
    around = corners(cells, times).astype(float)
    spread = around.max(axis=0) - around.min(axis=0)
    difference = np.abs(interpolated(cells, times) - bilinear(cells, times))
    assert (difference <= LARGEST_DIFFERENCE * spread + 1e-9).all()


def test_the_largest_difference_from_bilinear_values_is_the_one_that_was_derived() -> (
    None
):
    root = 2.0 * 0.2328
    assert root * (root + 1.0) ** 2 == pytest.approx(1.0, abs=1e-3)
    t = root / 2.0
    derived = t * (1.0 - t) - 2.0 * t**2 / (1.0 + 2.0 * t)
    single = np.eye(1, 16, 5, dtype=int).reshape(4, 4)
    found = np.abs(interpolated(single, 301) - bilinear(single, 301)).max()
    assert found == pytest.approx(derived, abs=1e-5)
    assert found < LARGEST_DIFFERENCE


def test_along_a_line_through_centres_the_values_are_linear() -> None:
    middle = interpolated(PAPER, 5)[2, 2:8]
    assert middle.tolist() == pytest.approx([100, 90, 80, 70, 60, 50])


def test_the_printed_divisor_gives_no_pressure() -> None:
    at_the_first_centre = np.array([1.0, 0.0, 0.0, 0.0])
    printed = at_the_first_centre @ PAPER.ravel() / PAPER.sum()
    assert round(printed, 2) == 0.56
    assert interpolated(PAPER, 3)[1, 1] == 100.0


def test_behind_the_border_its_cells_are_repeated() -> None:
    found = interpolated(PAPER, 3)
    assert found[0, :2].tolist() == found[1, :2].tolist() == [100.0, 100.0]
    assert found[5, 5] == 10.0


def test_one_time_is_the_frame_itself() -> None:
    assert interpolated(PAPER, 1).tolist() == PAPER.tolist()


def test_degrees_add_up_to_one_on_a_line_of_centres_and_to_two_in_the_middle() -> None:
    assert weights(4)[1][0].tolist() == [10, 10, 10, 10]
    assert weights(3)[1].tolist() == [[6, 6, 6], [6, 10, 10], [6, 10, 10]]
    assert (weights(101)[1] / 202).max() == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("kind", [np.uint8, np.int64, np.int16])
def test_many_frames_give_what_each_gives_alone(dtype: type, kind: type) -> None:
    chance = np.random.default_rng(5)
    frames: npt.NDArray[Any] = chance.integers(0, 256, (2, 40, 9, 7)).astype(kind)
    found = interpolated(frames, 5, dtype=dtype)
    assert found.shape == (2, 40, 45, 35)
    assert found.dtype == dtype
    assert np.array_equal(found[1, 39], interpolated(frames[1, 39], 5, dtype=dtype))


def test_no_frames_are_no_values() -> None:
    assert interpolated(np.empty((0, 2, 3), int), 4).shape == (0, 8, 12)


def test_nothing_given_is_changed() -> None:
    cells = PAPER.copy()
    interpolated(cells, 1)[:] = 7.0
    assert cells.tolist() == PAPER.tolist()


@pytest.mark.parametrize(
    ("cells", "options", "error", "text"),
    [
        (
            PAPER,
            {"times": 0},
            ValueError,
            "times is a whole number of at least 1, not 0",
        ),
        (
            PAPER,
            {"times": 2.5},
            TypeError,
            "'float' object cannot be interpreted as an integer",
        ),
        (
            PAPER,
            {"times": 2, "dtype": np.int64},
            ValueError,
            "interpolated values are float64 or float32, not int64",
        ),
        (PAPER == 10, {"times": 2}, TableError, "frames hold whole numbers, not bool"),
        (
            PAPER[0],
            {"times": 2},
            TableError,
            "an array of shape (2,) holds no frame",
        ),
        (
            np.empty((3, 0, 2), int),
            {"times": 2},
            TableError,
            "an array of shape (3, 0, 2) holds no frame",
        ),
        (
            PAPER * 1.0,
            {"times": 2},
            TableError,
            "frames hold whole numbers, not float64",
        ),
        (
            PAPER * 2**20,
            {"times": 2, "dtype": "float32"},
            TableError,
            "cells lie in -2097152 to 2097152, for 2 times as float32",
        ),
        (
            np.zeros((256, 256), np.uint8),
            {"times": 17},
            TableError,
            "256 x 256 cells, 17 times on each side, are more than "
            f"{MOST_POINTS} points",
        ),
    ],
)
def test_what_cannot_be_interpolated_is_refused(
    cells: npt.NDArray[Any],
    options: dict[str, Any],
    error: type[Exception],
    text: str,
) -> None:
    with pytest.raises(error) as caught:
        interpolated(cells, **options)
    assert str(caught.value) == text
