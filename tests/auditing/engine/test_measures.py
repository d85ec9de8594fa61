"""Heights, areas and dips of curves against dense exact evaluation."""

from __future__ import annotations

import itertools
import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.measures import (
    Bounds,
    CurveAxis,
    area,
    curve_axis,
    dips,
    excesses,
    heights,
    most_shared,
    overlap,
    walk,
)
from fuzzytree.model.rulebase import LR, Points, Shape
from fuzzytree.model.rulebase import Side as Half
from fuzzytree.numerics.exact import exact_degree
from tests.auditing.engine.bases import random_shape

ZERO, ONE, TINY = Fraction(0), Fraction(1), Fraction(1, 10**9)
_WIDE = Fraction(1, 50)  # between the lines around a curve
GRID = [Fraction(n, 128) for n in range(129)]
SEEDS = [0, *(pytest.param(n, marks=pytest.mark.heavy) for n in range(1, 8))]
"""The first is tried always, the others where there is time."""


def shapes(seed: int, count: int = 6) -> list[Shape]:
    chance = random.Random(seed)
    return [random_shape(chance, "mixed") for _ in range(count)]


@pytest.mark.parametrize("seed", SEEDS)
def test_no_degree_is_above_a_height_and_one_is_near_it(seed: int) -> None:
    for shape in shapes(seed):
        ((height, at),) = heights(curve_axis([shape], ZERO, ONE))
        assert max(exact_degree(shape, x) for x in GRID) <= height.high
        near = [exact_degree(shape, at + step) for step in (0, Fraction(1, 2**60))]
        assert height.low - max(near) < Fraction(1, 10**9)
        assert height.high - height.low < (_WIDE if isinstance(shape, LR) else TINY)


def test_a_curve_that_meets_0_at_the_lower_end_is_0_from_there() -> None:
    rise = Half(0.25, (0.25,), 5.0)
    fall = LR(-0.125, rise, Half(0.25, (2.0, -1.0), 2.0))  # 32 x**2 - 4 x about 0
    ((height, _),) = heights(curve_axis([fall], ZERO, ONE))
    assert height.low == 0 <= height.high < _WIDE


@pytest.mark.parametrize("seed", SEEDS)
def test_areas_equal_dense_sums(seed: int) -> None:
    middles = [Fraction(2 * n + 1, 1024) for n in range(512)]
    for one, other in itertools.pairwise(shapes(seed, 4)):
        p, q = ([exact_degree(s, x) for x in middles] for s in (one, other))
        found = overlap(curve_axis([one, other], ZERO, ONE))
        shared = sum(map(min, p, q)) / 512
        joined = sum(map(max, p, q)) / 512
        assert found.shared.nearest == pytest.approx(float(shared), abs=8e-3)
        assert found.joined.nearest == pytest.approx(float(joined), abs=8e-3)
        assert found.shared.high - found.shared.low < _WIDE
        assert max(map(min, p, q)) <= found.possibility.high
        if any(a > b for a, b in zip(p, q, strict=True)):
            assert not found.is_within
        if any(a < b for a, b in zip(p, q, strict=True)):
            assert not found.is_around


@pytest.mark.parametrize("seed", SEEDS)
def test_curves_are_equal_where_they_cross(seed: int) -> None:
    exact = [shape for shape in shapes(seed, 6) if not isinstance(shape, LR)]
    for one, other in itertools.combinations(exact, 2):
        for at, height in overlap(curve_axis([one, other], ZERO, ONE)).crossings:
            ends = [
                sorted((exact_degree(one, x), exact_degree(other, x)))
                for x in (at - Fraction(1, 2**40), at + Fraction(1, 2**40))
            ]
            low = min(a for a, _ in ends) - Fraction(1, 10**6)
            assert low <= height.low <= max(b for _, b in ends) + Fraction(1, 10**6)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_walk_is_monotone_between_neighbours(seed: int) -> None:
    for shape in shapes(seed):
        if isinstance(shape, LR):
            continue
        walked = [*walk(curve_axis([shape], ZERO, ONE), 0)]
        for (a, start), (b, end) in itertools.pairwise(walked):
            for share in (Fraction(1, 7), Fraction(1, 2), Fraction(6, 7)):
                if start < end:
                    degree = exact_degree(shape, start + (end - start) * share)
                    assert min(a.low, b.low) <= degree <= max(a.high, b.high)


def test_areas_of_two_parts_add_up() -> None:
    for shape in shapes(9):
        total, *halves = (
            _area(curve_axis([shape], *ends))
            for ends in ((ZERO, ONE), (ZERO, Fraction(1, 3)), (Fraction(1, 3), ONE))
        )
        assert sum(half.low for half in halves) <= total.high
        assert sum(half.high for half in halves) >= total.low


def _area(made: CurveAxis) -> Bounds:
    return area(made.curves[0])


def test_the_lower_end_of_an_open_line_is_left_out() -> None:
    spike = Points((0.0, 0.0), (1.0, 0.0))
    tops = [
        heights(curve_axis([spike], ZERO, ONE, is_open=is_open))[0][0].exact
        for is_open in (False, True)
    ]
    assert tops == ["1", "0"]


def test_a_line_of_one_point_has_one_value() -> None:
    ramp = Points((0.0, 2.0), (0.0, 1.0))
    made = curve_axis([ramp], ONE, ONE)
    assert [(bounds.exact, at) for bounds, at in walk(made, 0)] == [("1/2", ONE)]
    assert _area(made).exact == "0"


def test_a_swapped_line_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^no axis from 1 to 0$"):
        curve_axis([], ONE, ZERO)


def test_three_curves_have_no_overlap() -> None:
    made = curve_axis([Points((0.0,), (1.0,))] * 3, ZERO, ONE)
    with pytest.raises(ValueError, match=r"^two curves overlap, not 3$"):
        overlap(made)


def test_every_dip_of_a_zigzag_is_found() -> None:
    zigzag = Points((0.0, 1.0, 2.0, 3.0, 4.0, 5.0), (0.5, 0.0, 1.0, 0.4, 0.7, 0.6))
    walked = [*walk(curve_axis([zigzag], ZERO, Fraction(5)), 0)]
    places = [
        [[float(at) for _, at in dip] for dip in dips(walked, least)]
        for least in (Fraction(1, 20), Fraction(1, 5), Fraction(2, 5))
    ]
    both = [[0.0, 1.0, 2.0], [2.0, 3.0, 4.0]]
    assert places == [both, both, both[:1]]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_polynomial_is_outside_only_where_its_curve_is_clipped(seed: int) -> None:
    for shape in shapes(seed):
        for excess in excesses(shape, ZERO, ONE):
            middle = (excess.low + excess.high) / 2
            degree = exact_degree(shape, middle)
            assert degree > 1 - Fraction(1, 2**52) if excess.is_above else degree == 0
            assert excess.low <= excess.at <= excess.high
            assert excess.depth > 0


@pytest.mark.parametrize("seed", SEEDS)
def test_no_two_curves_share_more_than_their_bound(seed: int) -> None:
    made = shapes(seed)
    most = most_shared(made, 0.0, 1.0)
    for a, b in itertools.combinations(range(len(made)), 2):
        jaccard = overlap(curve_axis([made[a], made[b]], ZERO, ONE)).jaccard
        assert jaccard is None or jaccard.low <= most[a, b]
        assert jaccard is None or most[a, b] < jaccard.high + Fraction(1, 4)


def test_nothing_is_known_of_shares_on_a_point() -> None:
    assert (most_shared(shapes(1), 1.0, 1.0) == 1.0).all()
