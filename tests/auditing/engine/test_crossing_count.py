"""Rules whose curves cross too often for cells are decided by boxes."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.engine import arrangement as module
from fuzzytree.auditing.engine.arrangement import TooManyCellsError, arrange
from fuzzytree.auditing.engine.cover import below, least_cover, uncovered
from fuzzytree.auditing.engine.duels import wins
from fuzzytree.auditing.engine.pieces import RuleCurve, places
from fuzzytree.auditing.engine.states import Bracket, Proved, Witness
from fuzzytree.auditing.engine.ties import tie
from tests.auditing.engine.bases import random_base, random_shape, unit_domain


def test_the_search_for_places_ends_where_they_are_too_many() -> None:
    chance = random.Random(3)
    curves = [RuleCurve(random_shape(chance, "points"), n % 3 == 0) for n in range(70)]
    assert 300 < len(places(curves, 300)) < len(places(curves))


def test_rules_in_too_many_cells_are_decided_by_boxes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    base = random_base(5, 6, 2, kind="points")
    rivals = [n for n in range(1, 7) if base.rules[n - 1].then != base.rules[0].then]
    given = arrange(base, unit_domain(base))
    known = [wins(given, n, {*range(1, 7)} - {n}) for n in range(1, 7)]
    monkeypatch.setattr(module, "MOST_NUMBERS", 100)
    crowded = arrange(replace(base, name="crowded"), unit_domain(base))
    assert not crowded.is_kept
    with pytest.raises(TooManyCellsError):
        _ = crowded.grids
    for number, state in enumerate(known, 1):
        found = wins(crowded, number, {*range(1, 7)} - {number})
        assert isinstance(found, Witness) == isinstance(state, Witness)
    assert not isinstance(uncovered(crowded), Bracket)
    assert type(uncovered(crowded)) is type(uncovered(given))
    assert type(below(crowded, Fraction(1, 10))) is type(below(given, Fraction(1, 10)))
    assert abs(least_cover(crowded).high - least_cover(given).high) < 1e-5
    found = tie(crowded, 1, rivals[0])
    assert isinstance(found, Bracket)
    assert found.why == "its curves cross more often than can be kept"


def test_curves_that_are_many_and_apart_are_kept() -> None:
    base = random_base(1, 80, 1, kind="points", shared=0.95)
    assert arrange(base, unit_domain(base)).is_kept
    assert isinstance(wins(arrange(base, unit_domain(base)), 1, ()), Witness | Proved)
