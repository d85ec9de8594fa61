"""Two learners on the same units."""

from __future__ import annotations

import math

import pytest
from experiment_pairing import paired, sign_test


def test_units_are_counted_by_who_is_better() -> None:
    found = paired([3, 2, 1, 1], [1, 1, 2, 1])
    assert (found.better, found.worse, found.equal) == (2, 1, 1)


def test_a_clean_sweep_of_thirteen_is_two_in_8192() -> None:
    assert sign_test(13, 0) == 2 / 2**13


def test_the_sign_test_is_that_of_a_fair_coin() -> None:
    for better in range(12):
        ways = [math.comb(11, k) for k in range(12)]
        as_rare = sum(
            way for k, way in enumerate(ways) if abs(k - 5.5) >= abs(better - 5.5)
        )
        assert sign_test(better, 11 - better) == as_rare / 2**11


def test_equal_learners_differ_by_chance() -> None:
    assert paired([1, 2], [1, 2]).chance == 1.0


def test_many_units_have_a_chance_that_is_a_number() -> None:
    assert 0.0 <= sign_test(3000, 900) < 1e-200


def test_units_must_be_as_many() -> None:
    with pytest.raises(ValueError, match="argument 2 is longer"):
        paired([1], [1, 2])
