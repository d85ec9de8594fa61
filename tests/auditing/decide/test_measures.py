"""Heights, areas, overlaps and distances contain what dense exact evaluation says."""

from __future__ import annotations

import functools
import itertools
import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.decide.lines import APART, Between, lines_of
from fuzzytree.auditing.decide.measures import (
    Bounds,
    area,
    curve_distance,
    dips,
    height,
    integral,
    most_overlap,
    overlap,
)
from fuzzytree.model import (
    Arc,
    Bell,
    Binary,
    Concave,
    Cosine,
    Curve,
    Gaussian,
    PiCurve,
    Points,
    SCurve,
    SemiEllipse,
    Shape,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.numerics import degree_between, exact_degree
from tests.auditing.decide.old_bases import random_shape

ZERO, ONE = Fraction(0), Fraction(1)
COARSE = Fraction(1, 100)


def random_curves(seed: int) -> list[Curve]:
    """Return 30 curves about [0, 1], of every kind one at least."""
    chance = random.Random(seed)
    a, b, c, d = sorted(round(chance.uniform(-0.5, 1.5), 3) for _ in range(4))
    wide, slope = chance.uniform(0.05, 2.0), chance.uniform(-9.0, 9.0)
    made: list[Curve] = [
        *(random_shape(chance, "band"), random_shape(chance, "points")),
        *(random_shape(chance, "lr") for _ in range(4)),
        *(Trapezoid(a, b, c, d), Trapezoid(None, b, b, d), Trapezoid(a, a, c, None)),
        *(Gaussian(a, wide), Gaussian(b, 0.1), TwoGaussians(b, wide, a, 0.3)),
        *(Bell(b, wide, abs(slope)), Bell(b, wide, -0.4)),
        *(Sigmoid(b, slope), SCurve(a, c), SCurve(d, b), PiCurve(a, b, c, d)),
        SigmoidProduct(Sigmoid(a, slope), Sigmoid(b, 3.0)),
        SigmoidDifference(Sigmoid(a, slope), Sigmoid(b, 3.0)),
        *(Cosine(b, wide), Concave(a, c), Concave(d, b), Spike(b, wide)),
        *(
            Arc(a, c),
            Arc(d, b),
            SemiEllipse(a, d),
            Binary(b),
            Binary(c, is_above=False),
        ),
        Singleton(c),
    ]
    assert len(made) == 30
    return made


CURVES = random_curves(1)
EVERY = [
    *((n, 60) for n in range(30)),
    *(pytest.param(n, 2000, marks=pytest.mark.heavy) for n in range(30)),
]
"""Which curve, and how many exact evaluations."""


def middles(count: int) -> list[Fraction]:
    return [Fraction(2 * n + 1, 2 * count) for n in range(count)]


@functools.lru_cache(maxsize=30)
def degrees(curve: Curve, count: int) -> list[tuple[Fraction, Fraction]]:
    """Return bounds of the degrees at all middles, far less than 2^-32 apart."""
    known = [degree_between(curve, x) for x in middles(count)]
    return [(one.low, one.high) for one in known if one is not None]


def on_unit(curve: Curve) -> Between:
    return lines_of(curve, ZERO, ONE)


@pytest.mark.parametrize(("n", "count"), EVERY)
def test_bounds_of_a_curve_contain_exact_evaluations(n: int, count: int) -> None:
    curve, off = CURVES[n], COARSE + Fraction(1, count)
    of, exact = on_unit(curve), degrees(curve, count)
    for x, (low, high) in zip(middles(count), exact, strict=True):
        assert of.lower.value(x) <= high
        assert of.upper.value(x) >= low
    (least, most), at = height(of)
    assert max(low for low, _ in exact) <= most
    near = [degree_between(curve, x) for x in (at, at - APART**6, at + APART**6)]
    assert least <= max(one.high for one in near if one is not None) + APART**3
    assert most - least <= (0 if of.is_exact else 2 * APART)
    small, large = area(of)
    mean = sum(low for low, _ in exact) / count
    assert small - off <= mean <= large + off


@pytest.mark.parametrize(("n", "count"), EVERY)
def test_bounds_of_two_curves_contain_exact_evaluations(n: int, count: int) -> None:
    one, other, off = CURVES[n], CURVES[n - 1], COARSE + Fraction(1, count)
    pairs = [*zip(degrees(one, count), degrees(other, count), strict=True)]
    gap = max(max(p[0] - q[1], q[0] - p[1]) for p, q in pairs)
    distance = curve_distance(one, other, ZERO, ONE)
    assert max(gap, distance.low) <= distance.high
    assert distance.low >= gap - 3 * APART
    joined = sum(max(p[1], q[1]) for p, q in pairs)
    result = overlap(on_unit(one), on_unit(other))
    if result is None:
        assert joined < count * off
        return
    if joined > count * Fraction(1, 10):
        jaccard = sum(min(p[0], q[0]) for p, q in pairs) / joined
        low, high = result.jaccard
        assert low - 10 * off <= jaccard <= high + 10 * off
    assert max(min(p[0], q[0]) for p, q in pairs) <= result.possibility.high
    assert not result.is_within or all(p[0] <= q[1] for p, q in pairs)
    assert not result.is_around or all(p[1] >= q[0] for p, q in pairs)


def test_no_two_curves_share_more_than_their_bound() -> None:
    made = [on_unit(curve) for curve in CURVES[::3]]
    most = most_overlap(made)
    for a, b in itertools.combinations(range(len(made)), 2):
        result = overlap(made[a], made[b])
        if result is None:
            assert most[a, b] == 1.0
        else:
            assert result.jaccard.high <= most[a, b] < result.jaccard.high + COARSE


def test_nothing_is_known_of_shares_on_a_point() -> None:
    assert (most_overlap([lines_of(CURVES[0], ONE, ONE)] * 2) == 1.0).all()


def shapes(seed: int) -> list[Shape]:
    chance = random.Random(seed)
    return [random_shape(chance, kind) for kind in ("points", "band") for _ in range(4)]


@pytest.mark.parametrize("seed", range(3))
def test_curves_are_equal_where_they_cross(seed: int) -> None:
    for one, other in itertools.combinations(shapes(seed), 2):
        result = overlap(on_unit(one), on_unit(other))
        if result is None or result.crossing is None:
            continue
        height, at = result.crossing
        ends = [
            sorted((exact_degree(one, x), exact_degree(other, x)))
            for x in (at - APART**4, at + APART**4)
        ]
        tiny = Fraction(1, 10**6)
        assert min(a for a, _ in ends) - tiny <= height <= max(ends)[1] + tiny


def test_areas_of_two_parts_add_up() -> None:
    for curve in CURVES:
        total, *halves = (
            area(lines_of(curve, *ends))
            for ends in ((ZERO, ONE), (ZERO, Fraction(1, 3)), (Fraction(1, 3), ONE))
        )
        assert sum(half.low for half in halves) <= total.high
        assert sum(half.high for half in halves) >= total.low


def test_a_line_of_one_point_has_one_value_and_no_area() -> None:
    made = lines_of(Points((0.0, 2.0), (0.0, 1.0)), ONE, ONE)
    half = Bounds(Fraction(1, 2), Fraction(1, 2))
    assert height(made) == (half, ONE)
    assert integral(made.lower) == 0


def test_a_curve_is_no_farther_from_itself_than_its_bounds() -> None:
    for curve in CURVES:
        distance = curve_distance(curve, curve, ZERO, ONE)
        assert distance.low == 0 <= distance.high <= 2 * APART


def test_every_dip_of_a_zigzag_is_found() -> None:
    zigzag = Points((0.0, 1.0, 2.0, 3.0, 4.0, 5.0), (0.5, 0.0, 1.0, 0.4, 0.7, 0.6))
    lines = lines_of(zigzag, ZERO, Fraction(5))
    places = [
        [[float(at) for at, _ in dip] for dip in dips(lines, least)]
        for least in (Fraction(1, 20), Fraction(1, 5), Fraction(2, 5))
    ]
    both = [[0.0, 1.0, 2.0], [2.0, 3.0, 4.0]]
    assert places == [both, both, both[:1]]


def test_a_dip_at_a_jump_is_as_deep_as_its_limits() -> None:
    steps = Points((0.0, 1.0, 1.0, 2.0, 2.0), (1.0, 1.0, 0.25, 0.5, 0.75))
    ((_, valley, peak),) = dips(lines_of(steps, ZERO, Fraction(3)), Fraction(1, 10))
    assert (valley, peak) == ((ONE, Fraction(1, 4)), (Fraction(2), Fraction(3, 4)))
