"""Combinations that repeat an input are as exact as any other."""

from __future__ import annotations

from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.arrangement import arrange, strengths_at
from fuzzytree.auditing.engine.domain import Domain, DomainSide, linear_form, span
from fuzzytree.auditing.engine.questions import least_cover, uncovered, wins
from fuzzytree.auditing.engine.states import Proved, Witness, point_of
from fuzzytree.model.rulebase import (
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
)

BOX = Domain((DomainSide("x", 0.0, 1.0),))
RAMP = Term("much", Points((0.0, 1.0), (0.0, 1.0)))


def _rules(*parts: Part) -> RuleBase:
    mix = Variable("mix", (RAMP,), parts=parts)
    rule = Rule((Proposition("mix", ("much",)),), "a")
    return RuleBase("p", ("a",), (Variable("x"), mix), (rule,))


@pytest.mark.parametrize(
    ("parts", "ends"),
    [
        ((Part("x", 2.0), Part("x", -1.0)), (0, 1)),
        ((Part("x", 2.0), Part("x", -2.0)), (0, 0)),
        ((Part("x", 2.0, 0.5), Part("x", -1.0), Part("x", 1.0)), (-1, 1)),
    ],
)
def test_an_input_that_is_taken_twice_counts_with_its_whole_weight(
    parts: tuple[Part, ...], ends: tuple[int, int]
) -> None:
    mix = _rules(*parts).variables[1]
    assert span(mix, BOX) == tuple(map(Fraction, ends))
    weights, _ = linear_form(mix, {"x": 0})
    assert 0 not in weights.values()


def test_a_rule_fires_where_a_multiple_of_an_input_is_limited() -> None:
    rules = _rules(Part("x", 2.0, 0.5))
    box = Domain((*BOX.sides, DomainSide("mix", 0.25, 0.625)))
    found = wins(arrange(rules, box), 1, ())
    assert isinstance(found, Witness)
    assert 0.25 <= 2 * point_of(found.point)["x"] - 1 <= 0.625


def test_the_bounds_of_a_negative_multiple_are_swapped() -> None:
    rules = _rules(Part("x", -4.0, 1.0))  # 4 - 4 x
    given = arrange(rules, Domain((*BOX.sides, DomainSide("mix", 1.0, 3.0))))
    found = wins(given, 1, ())
    assert isinstance(found, Witness)
    assert strengths_at(given, point_of(found.point)) == [1]
    assert isinstance(uncovered(given), Proved)


def test_summands_that_cancel_leave_a_constant() -> None:
    given = arrange(_rules(Part("x", 2.0), Part("x", -2.0, 0.125)), BOX)  # 1/4
    assert isinstance(uncovered(given), Proved)
    assert least_cover(given).high == 0.25
    beyond = Domain((*BOX.sides, DomainSide("mix", 0.5, 1.0)))
    assert arrange(given.rules, beyond).is_empty
