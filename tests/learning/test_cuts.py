"""Where a decision changes on an axis."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzzytree.learning.cuts import (
    SplitCuts,
    crossing_cuts,
    settled_cuts,
    without_empty,
)

ORDER = np.array([0, 1])


def crossings(
    means: list[float], spreads: list[float], *, keep: bool = False
) -> tuple[list[float], list[int], int]:
    found = crossing_cuts(
        np.array(means),
        np.array(spreads),
        np.arange(len(means)),
        keep_reversals=keep,
    )
    return found.cuts.tolist(), found.owners.tolist(), found.reversals


def test_equal_spreads_cross_in_the_middle() -> None:
    assert crossings([0.0, 4.0], [1.0, 1.0]) == ([2.0], [0, 1], 0)


def test_a_far_reversal_is_counted_and_left_out() -> None:
    cuts, owners, reversals = crossings([0.0, 10.0], [1.0, 2.0])
    assert (len(cuts), owners, reversals) == (1, [0, 1], 1)
    assert 3.0 < cuts[0] < 4.0


def test_a_far_reversal_stays_on_request() -> None:
    cuts, owners, reversals = crossings([0.0, 10.0], [1.0, 2.0], keep=True)
    assert (len(cuts), owners, reversals) == (2, [1, 0, 1], 0)


def test_a_narrow_class_within_a_wide_one_takes_two_cuts() -> None:
    cuts, owners, _ = crossings([0.0, 0.0], [1.0, 4.0])
    root = math.sqrt(2 * math.log(4) / (1 - 1 / 16))
    assert cuts == pytest.approx([-root, root])
    assert owners == [1, 0, 1]


def test_equal_patterns_still_get_an_interval_each() -> None:
    cuts, owners, _ = crossings([5.0, 5.0], [1.0, 1.0])
    assert len(cuts) == 1
    assert sorted(owners) == [0, 1]


def test_patterns_without_spread_are_cut_between() -> None:
    cuts, owners, _ = crossings([0.0, 1.0], [0.0, 0.0])
    assert cuts == pytest.approx([0.5])
    assert owners == [0, 1]


@pytest.mark.parametrize("scale", [1e-300, 1e-12, 1e12, 1e150])
def test_crossings_scale_with_the_axis(scale: float) -> None:
    cuts, owners, _ = crossings([0.0, 4.0 * scale], [scale, scale])
    assert cuts == pytest.approx([2.0 * scale], rel=1e-6)
    assert owners == [0, 1]


@given(
    st.lists(st.floats(-1e12, 1e12), min_size=2, max_size=30, unique=True),
    st.floats(-1e12, 1e12),
)
def test_a_settled_cut_keeps_its_rows_on_their_sides(
    values: list[float], cut: float
) -> None:
    rows = np.array(values)
    settled = settled_cuts(np.array([cut]), rows)
    assert ((rows <= settled[0]) == (rows <= cut)).all()


def test_a_cut_stays_away_from_whole_numbers_and_is_short() -> None:
    rows = np.array([1.0, 2.0, 3.0, 4.0])
    assert settled_cuts(np.array([2.0]), rows).tolist() == [2.25]
    assert settled_cuts(np.array([2.51]), rows).tolist() == [2.5]


def test_neighbouring_doubles_can_be_cut_apart() -> None:
    low = 1.0
    high = math.nextafter(low, 2.0)
    assert settled_cuts(np.array([low]), np.array([low, high])).tolist() == [low]


DYADIC = st.integers(-(2**20), 2**20).map(lambda steps: steps / 2.0**10)


@given(
    st.lists(DYADIC, min_size=2, max_size=12, unique=True),
    DYADIC,
    st.integers(-300, 300),
    st.sampled_from([0.0, 2.0**12, -(2.0**33), 2.0**40]),
)
def test_a_cut_settles_alike_in_every_unit(
    values: list[float], cut: float, exponent: int, offset: float
) -> None:
    rows = np.array(values)
    base = settled_cuts(np.array([cut]), rows)[0]
    moved = np.ldexp(rows + offset, exponent)
    found = settled_cuts(
        np.array([cut]), moved, rows, origin=offset * 2.0**exponent, exponent=exponent
    )
    # At 2^40 floats are 2^-12 apart: what is finer is rounded to the lower row.
    allowed = math.ldexp(math.ulp(offset), exponent)
    assert abs(found[0] - np.ldexp(base + offset, exponent)) <= allowed
    assert ((moved <= found[0]) == (rows <= base)).all()


def test_a_cut_between_rows_that_share_a_place_keeps_one_side_for_both() -> None:
    rows = np.array([1.0, 1.0 + 2.0**-52, 2.0])  # at -2^60 all of them are one place
    places = rows + 2.0**60
    (cut,) = settled_cuts(places[:1] - 2.0**10, rows, places, origin=-(2.0**60))
    assert not (rows <= cut).any()


@pytest.mark.parametrize(
    ("cut", "low", "high", "expected"),
    [
        (0.1, -1.0, 1.0, 0.0),
        (1.8, 1.0, 3.0, 2.0),
        (0.3, 0.0, 0.4, 0.25),
        (1e308, -1.7e308, 1.7e308, 0.0),
        (1.5e308, 1.0e308, 1.7e308, 2.0**1023 + 2.0**1022),
        (5e-324, 0.0, 1e-323, 5e-324),
        (1e-310, 0.0, 1.0, 0.25),
        (0.0, 0.0, 5e-324, 0.0),
    ],
)
def test_a_cut_is_a_round_number(
    cut: float, low: float, high: float, expected: float
) -> None:
    found = settled_cuts(np.array([cut]), np.array([low, high]))
    assert found.tolist() == [expected]


@pytest.mark.parametrize(
    ("points", "owners", "left", "of"),
    [
        ([1.0, 1.0], [0, 1, 0], [1.0, 1.0], [0, 1, 0]),  # all that branch 1 has
        ([1.0, 1.0, 4.0], [0, 1, 0, 1], [4.0], [0, 1]),
        ([1.0, 1.0, 1.0], [0, 1, 2, 1], [1.0, 1.0], [0, 2, 1]),
        ([1.0, 3.0], [0, 1, 0], [1.0, 3.0], [0, 1, 0]),
    ],
)
def test_an_interval_without_a_row_goes_to_its_neighbours(
    points: list[float], owners: list[int], left: list[float], of: list[int]
) -> None:
    found = without_empty(SplitCuts(np.array(points), np.array(owners)))
    assert (found.cuts.tolist(), found.owners.tolist()) == (left, of)
