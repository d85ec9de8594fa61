"""Gaps are found to the point, and full cover is proved."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.auditing.engine.arrangement import arrange, strengths_at
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.questions import below, least_cover, uncovered
from fuzzytree.auditing.engine.states import Bracket, Proved, Witness, point_of
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
)
from fuzzytree.model.rulebase import Side as Half
from fuzzytree.numerics.oracle import UNCOVERED, decide
from tests.auditing.engine.bases import random_base, unit_domain


def _partition(*peaks: float, width: float = 1.0) -> RuleBase:
    terms = tuple(
        Term(f"t{n}", Points((p - width, p, p + width), (0.0, 1.0, 0.0)))
        for n, p in enumerate(peaks)
    )
    rules = tuple(
        Rule((Proposition("x", (t.name,)),), f"c{n}") for n, t in enumerate(terms)
    )
    classes = tuple(rule.then for rule in rules)
    return RuleBase("p", classes, (Variable("x", terms),), rules)


def _box(low: float, high: float) -> Domain:
    return Domain((DomainSide("x", low, high),))


def test_a_partition_covers_all_and_least_at_its_crossings() -> None:
    given = arrange(_partition(0.0, 1.0, 2.0), _box(0.0, 2.0))
    assert isinstance(uncovered(given), Proved)
    assert isinstance(below(given, Fraction(1, 2)), Proved)
    found = least_cover(given)
    assert (found.low, found.high) == (0.5, 0.5)


def test_one_point_between_two_triangles_is_uncovered() -> None:
    given = arrange(_partition(0.0, 2.0), _box(-0.5, 2.5))
    found = uncovered(given)
    assert isinstance(found, Witness)
    assert point_of(found.point) == {"x": 1}
    assert (found.region[0].low, found.region[0].high) == (1.0, 1.0)


def test_the_region_of_a_gap_reaches_from_end_to_end() -> None:
    found = uncovered(arrange(_partition(0.0, 4.0), _box(0.0, 4.0)))
    assert isinstance(found, Witness)
    assert (found.region[0].low, found.region[0].high) == (1.0, 3.0)


def test_below_a_level_is_found_just_above_the_least_cover() -> None:
    given = arrange(_partition(0.0, 1.0), _box(0.0, 1.0))
    found = below(given, Fraction(1, 2) + Fraction(1, 2**40))
    assert isinstance(found, Witness)
    assert max(strengths_at(given, point_of(found.point))) < Fraction(1, 2) + Fraction(
        1, 2**40
    )


def test_an_open_end_is_no_point_of_the_domain() -> None:
    rules = _partition(0.0, 2.0)
    inner = Domain((DomainSide("x", 1.0, 2.5, is_open=True),))
    assert isinstance(uncovered(arrange(rules, inner)), Proved)
    assert isinstance(uncovered(arrange(rules, _box(1.0, 2.5))), Witness)


@pytest.mark.one_in(5)
@pytest.mark.parametrize("kind", ["lr", "points", "band", "mixed"])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_proved_covered_has_no_uncovered_row(seed: int, kind: str) -> None:
    rules = random_base(seed, 6, 2, kind=kind, odd=0.4, shared=0.3)  # type: ignore[arg-type]
    given = arrange(rules, unit_domain(rules))
    found, least = uncovered(given), least_cover(given)
    values = np.random.default_rng(seed).random((2, 4000))
    answers = decide(rules, values)
    if isinstance(found, Proved):
        assert not (answers.status == UNCOVERED).any()
    else:
        assert isinstance(found, Witness)
        assert not any(strengths_at(given, point_of(found.point)))
    assert isinstance(least, Bracket)
    assert answers.strengths is not None
    assert answers.strengths.max(axis=0).min() >= least.low - 1e-15
    level = Fraction(least.high) + Fraction(1, 10**6)
    hit = below(given, level)
    if level <= 1:
        assert isinstance(hit, Witness)
        assert max(strengths_at(given, point_of(hit.point))) < level
    if least.low > 0:
        assert isinstance(below(given, Fraction(least.low)), Proved)


def test_a_side_that_falls_as_a_line_covers_the_inputs_before_its_zero() -> None:
    steep = LR(0.75, Half(0.25, (40.0,)), Half(0.125, (1.0,)))  # 0 from 0.74375 down
    rule = Rule((Proposition("x", ("steep",)),), "a")
    rules = RuleBase("p", ("a",), (Variable("x", (Term("steep", steep),)),), (rule,))
    zero = 0.75 - 0.25 / 40.0
    assert isinstance(uncovered(arrange(rules, _box(zero + 1e-9, 0.75))), Proved)
    found = uncovered(arrange(rules, _box(0.0, 0.75)))
    assert isinstance(found, Witness)
    assert zero - 0.01 < (found.region[0].high or 0.0) <= zero  # it is enclosed


def test_a_gap_behind_a_step_begins_after_it() -> None:
    step = Term("step", Band(5.0, 9.0))
    rule = Rule((Proposition("x", ("step",)),), "a")
    rules = RuleBase("p", ("a",), (Variable("x", (step,)),), (rule,))
    for start in (5.5, 9.0):  # 9 itself is covered
        found = uncovered(arrange(rules, _box(start, 10.0)))
        assert isinstance(found, Witness)
        (span,) = found.region
        assert (span.low, span.high) == (math.nextafter(9.0, 10.0), 10.0)


def test_a_gap_between_two_places_has_its_witness_between_them() -> None:
    # In this base a cell lies between two doubles; a curve is 0 at the nearer of them.
    rules = random_base(1, 5, 3, kind="mixed", shared=0.5, odd=0.3)
    given = arrange(rules, unit_domain(rules))
    found = uncovered(given)
    assert isinstance(found, Witness)
    assert not any(strengths_at(given, point_of(found.point)))


@pytest.mark.parametrize("seed", [34])
def test_gaps_on_axes_that_share_inputs_are_decided(seed: int) -> None:
    rules = random_base(seed, 4, 2, kind="mixed", shared=0.5, odd=0.2, combinations=1)
    given = arrange(rules, unit_domain(rules))
    found = uncovered(given)
    if isinstance(found, Witness):
        assert not any(strengths_at(given, point_of(found.point)))
        return
    assert isinstance(found, Proved)
    steps = [Fraction(n, 12) for n in range(13)]
    for x in steps:
        for y in steps:
            point = dict(zip(rules.inputs, (x, y), strict=True))
            assert any(strengths_at(given, point))
