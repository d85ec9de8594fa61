"""Columns in units of their own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzzytree.learning.units import ColumnUnits, FloatArray, units_of

STEPS = st.lists(st.integers(-1000, 1000), min_size=2, max_size=20, unique=True)


def own_units(rows: FloatArray) -> ColumnUnits:
    return units_of(rows, rows.min(axis=0), rows.max(axis=0))


@given(STEPS, st.integers(-900, 900), st.integers(-(2**40), 2**40))
def test_a_moved_column_is_the_same_in_its_unit(
    steps: list[int], exponent: int, offset: int
) -> None:
    rows = np.array(steps, np.float64)[:, None]
    base = own_units(rows).moved(rows)
    moved = np.ldexp(rows + offset, exponent)
    assert (own_units(moved).moved(moved) == base).all()
    assert np.abs(base).max() <= 1.0


@given(STEPS)
def test_the_origin_is_a_value_and_does_not_depend_on_the_order(
    steps: list[int],
) -> None:
    rows = np.array(steps, np.float64)[:, None]
    shuffled = rows[np.random.default_rng(len(steps)).permutation(len(rows))]
    assert own_units(rows).origins == own_units(shuffled).origins
    assert own_units(rows).origins[0] in steps


@pytest.mark.parametrize("value", [0.0, 0.1, -1e300])
def test_a_constant_column_is_not_sound_and_is_0(value: float) -> None:
    rows = np.full((3, 1), value)
    units = own_units(rows)
    assert not units.is_sound[0]
    assert units.moved(rows).tolist() == [[0.0]] * 3


def test_a_range_that_overflows_is_not_sound() -> None:
    rows = np.array([[-1e308, -8e307], [1e308, 8e307]])
    units = own_units(rows)
    assert units.is_sound.tolist() == [False, True]
    assert units.is_combinable.tolist() == [False, False]
    assert np.abs(units.moved(rows)).max() <= 1.0


def test_the_smallest_floats_keep_all_their_digits() -> None:
    rows = np.array([[0.0], [5e-324], [1.5e-323]])
    units = own_units(rows)
    assert units.moved(rows).tolist() == [[-0.25], [0.0], [0.5]]
    assert not units.is_combinable[0]
