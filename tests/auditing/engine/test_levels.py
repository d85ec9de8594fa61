"""Levels that coincide are one level, near ones are two, and none is missed."""

from __future__ import annotations

import pytest

from fuzzytree.auditing.engine.arrangement import arrange
from fuzzytree.auditing.engine.compared import RulePairs
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.pieces import ONE
from fuzzytree.auditing.engine.questions import wins
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


def test_a_rule_wins_between_the_values_of_a_slope_where_its_rival_jumps() -> None:
    slope, step = Points((0.2, 1.0), (1.0, 0.0)), Band(low=0.3)
    x = Variable("x", (Term("slope", slope), Term("step", step)))
    y = Variable("y", (Term("line", Points((0.0, 1.0), (0.0, 1.0))),))
    asked = (("x", "slope", "a"), ("x", "step", "c"), ("y", "line", "b"))
    made = (Rule((Proposition(name, (term,)),), then) for name, term, then in asked)
    rules = RuleBase("jump", ("a", "b", "c"), (x, y), tuple(made))
    # At x = 0.3 the slope has 0.875, and the step is still 0.
    assert isinstance(wins(arrange(rules, SQUARE), 3, (1, 2)), Witness)


def _found(rules: RuleBase) -> object:
    return wins(arrange(rules, SQUARE), 1, (2,))


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
