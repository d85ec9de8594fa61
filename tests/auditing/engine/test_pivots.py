"""Pairs that cannot tie are excluded at once, and no pair that ties is."""

from __future__ import annotations

import itertools

import pytest

from fuzzytree.auditing.engine.arrangement import arrange
from fuzzytree.auditing.engine.questions import may_tie, tie
from fuzzytree.auditing.engine.states import Witness
from tests.auditing.engine.bases import Kind, random_base, unit_domain


@pytest.mark.one_in(3)
@pytest.mark.parametrize("kind", ["points", "band", "mixed"])
def test_no_pair_that_ties_is_left_out(kind: Kind) -> None:
    ties = apart = 0
    for seed in range(4):
        base = random_base(seed, 7, 2, kind=kind, shared=0.5, odd=0.2)
        given = arrange(base, unit_domain(base))
        found = may_tie(given)
        assert (found == found.T).all()
        for one, other in itertools.combinations(range(7), 2):
            if not found[one, other]:
                apart += 1
            does = isinstance(tie(given, one + 1, other + 1), Witness)
            ties += does
            assert found[one, other] or not does
    assert ties > 1
    assert apart > 5


@pytest.mark.heavy
def test_rules_with_curves_of_their_own_are_apart() -> None:
    base = random_base(1, 12, 3, kind="lr")
    found = may_tie(arrange(base, unit_domain(base)))
    assert not found.any()
