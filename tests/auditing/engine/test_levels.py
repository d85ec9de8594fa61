"""Irrational levels that coincide are one level, and near ones are two."""

from __future__ import annotations

from fractions import Fraction

import pytest

from fuzzytree.auditing.engine.arrangement import arrange
from fuzzytree.auditing.engine.axes import AlgebraicLevel, equal_levels, relation
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.dominance import RulePairs
from fuzzytree.auditing.engine.duels import LevelQuestion, search_level
from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.auditing.engine.polynomials import roots, value_at
from fuzzytree.auditing.engine.states import Proved, Witness
from fuzzytree.model.rulebase import (
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
)

SQUARE = Domain((DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 1.0)))
GOLDEN = (-ONE, ONE, ONE)  # x**2 + x = 1


def _terms(*, is_mirrored: bool, drop: float = 1.0) -> tuple[Term, ...]:
    """Return x**2 and 1 - x, which are equal where x**2 + x = 1; or their mirrors."""
    if is_mirrored:
        square = Band(None, 0.0, None, 1.0)
        return Term("square", square), Term("line", Points((0.0, 1.0), (0.0, drop)))
    square = Band(1.0, None, 0.0)
    return Term("square", square), Term("line", Points((0.0, 1.0), (drop, 0.0)))


def _rules(*, is_mirrored: bool, drop: float = 1.0) -> RuleBase:
    """Return a rule whose peak is where its rival is lowest, on another input."""
    own = _terms(is_mirrored=False)
    other = _terms(is_mirrored=is_mirrored, drop=drop)
    return RuleBase(
        "golden",
        ("a", "b"),
        (Variable("x", own), Variable("y", other)),
        (
            Rule((Proposition("x", ("square",)), Proposition("x", ("line",))), "a"),
            Rule((Proposition("y", ("square", "line")),), "b"),
        ),
    )


def _found(rules: RuleBase) -> object:
    return search_level(
        arrange(rules, SQUARE), LevelQuestion((1,), (2,), None, ""), Clock()
    )


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_a_rule_no_higher_than_the_lowest_of_another_never_wins(
    is_mirrored: bool,
) -> None:
    rules = _rules(is_mirrored=is_mirrored)
    assert isinstance(_found(rules), Proved)
    assert RulePairs(arrange(rules, SQUARE)).never_weaker(2, 1) == "always"


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_it_wins_where_the_other_sinks_by_one_digit(is_mirrored: bool) -> None:
    rules = _rules(is_mirrored=is_mirrored, drop=1.0 - 2.0**-53)
    assert isinstance(_found(rules), Witness)
    assert RulePairs(arrange(rules, SQUARE)).never_weaker(2, 1) == "not"


def test_values_of_two_polynomials_at_two_places_are_one_number() -> None:
    place = roots(GOLDEN, ZERO, ONE)[0]
    mirrored = (ONE, Fraction(-3), ONE)  # that of 1 - x
    beside = roots(mirrored, ZERO, ONE)[0]
    square = AlgebraicLevel((ZERO, ZERO, ONE), GOLDEN, place)
    line = AlgebraicLevel((ZERO, ONE), mirrored, beside)
    near = AlgebraicLevel((Fraction(1, 2**90), ONE), mirrored, beside)
    groups = equal_levels([square, near, line])
    assert groups is not None
    assert list(groups.values()) == [[0, 2], [1]]
    (_, high), (low, _) = groups
    assert high < low


def test_a_value_that_is_rational_at_an_irrational_place_is_that_number() -> None:
    two = (Fraction(-2), ZERO, ONE)
    place = roots(two, ONE, Fraction(2))[0]
    half = Fraction(1, 2)
    sides = AlgebraicLevel((ZERO, ZERO, Fraction(1, 4)), two, place), half
    groups = equal_levels(sides)
    assert groups is not None
    assert list(groups.values()) == [[0, 1]]
    fourth = relation((ZERO, ONE, ZERO, ONE), two)  # x**3 + x is 3 x there
    assert [int(one) for one in fourth] == [-18, 0, 1]
    assert value_at(fourth, Fraction(3)) < 0
