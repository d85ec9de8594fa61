"""Roots are isolated by signs in integers."""

import random
from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    Root,
    composed,
    derivative,
    difference,
    magnitude,
    refined,
    roots,
    value_at,
)


def _product(*factors: Polynomial) -> Polynomial:
    found: Polynomial = (Fraction(1),)
    for factor in factors:
        spread = [Fraction(0)] * (len(found) + len(factor) - 1)
        for i, a in enumerate(found):
            for j, b in enumerate(factor):
                spread[i + j] += a * b
        found = tuple(spread)
    return found


def _with_roots(*places: Fraction) -> Polynomial:
    return _product(*((-place, Fraction(1)) for place in places))


@pytest.mark.parametrize("seed", range(20))
def test_every_root_of_a_product_is_in_one_place(seed: int) -> None:
    chance = random.Random(seed)
    places = sorted(
        {Fraction(chance.randint(1, 999), 1000) for _ in range(chance.randint(1, 6))}
    )
    found = roots(_with_roots(*places), Fraction(0), Fraction(1))
    assert len(found) == len(places)
    for place, root in zip(places, found, strict=True):
        assert root.is_sure
        assert root.low <= place <= root.high
        assert root.high - root.low <= Fraction(1, 2**47)


@pytest.mark.parametrize("seed", range(20))
def test_an_irrational_root_lies_between_two_signs(seed: int) -> None:
    chance = random.Random(seed)
    polynomial = tuple(Fraction(chance.uniform(-1, 1)) for _ in range(8))
    for root in roots(polynomial, Fraction(-2), Fraction(3)):
        low, high = (value_at(polynomial, x) for x in (root.low, root.high))
        assert low * high < 0
        fine = refined(polynomial, root, 200)
        assert fine.high - fine.low <= Fraction(1, 2**200)
        assert value_at(polynomial, fine.low) * value_at(polynomial, fine.high) <= 0


def test_a_double_root_stays_one_unsure_place() -> None:
    third = Fraction(1, 3)
    (root,) = roots(_with_roots(third, third), Fraction(0), Fraction(1))
    assert not root.is_sure
    assert root.low <= third <= root.high


def test_a_root_at_an_end_is_not_within() -> None:
    assert roots(_with_roots(Fraction(0), Fraction(1)), Fraction(0), Fraction(1)) == ()


def test_a_root_in_the_middle_is_exact() -> None:
    polynomial = _with_roots(Fraction(1, 2), Fraction(1, 4), Fraction(3, 4))
    found = roots(polynomial, Fraction(0), Fraction(1))
    assert [(r.low, r.high) for r in found][1] == (Fraction(1, 2), Fraction(1, 2))


def test_roots_far_from_zero_are_separated() -> None:
    base = Fraction(10**12)
    polynomial = _with_roots(base + Fraction(1, 10), base + Fraction(2, 10))
    assert len(roots(polynomial, base, base + 1)) == 2


def test_a_polynomial_is_moved_and_differentiated() -> None:
    cubic = tuple(map(Fraction, (1, -2, 0, 4)))
    half, third = Fraction(1, 2), Fraction(1, 3)
    moved = composed(cubic, half, third)
    assert value_at(moved, Fraction(5)) == value_at(cubic, half + third * 5)
    assert derivative(cubic) == tuple(map(Fraction, (-2, 0, 12)))
    assert difference(cubic, cubic) == (Fraction(0),)


def test_no_interval_is_refused() -> None:
    with pytest.raises(ValueError, match="no interval from 1 to 1"):
        roots((Fraction(0), Fraction(1)), Fraction(1), Fraction(1))


def test_a_root_far_above_1_is_refined_to_more_than_1() -> None:
    far = Fraction(10) ** 400
    square = (-2 * far**2, Fraction(0), Fraction(1))
    found = refined(square, Root(far, 2 * far), 64 - magnitude(far))
    assert found.low**2 < 2 * far**2 < found.high**2
    assert found.high - found.low <= far / 2**60
