"""Is a rule nowhere weaker than another? Against the exact engine, and on grids."""

from __future__ import annotations

import itertools
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import arrange, strengths_at
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.compared import RulePairs
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.pieces import ONE
from fuzzytree.auditing.engine.questions import wins
from fuzzytree.auditing.engine.states import Bracket, Proved, Witness, point_of
from fuzzytree.model.rulebase import (
    LR,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.model.rulebase import Side as Half
from fuzzytree.numerics.exact import exact_answer
from tests.auditing.engine.bases import Kind, random_base, unit_domain

KINDS: tuple[Kind, ...] = ("points", "band", "lr")
GRID = [n / 8 for n in range(9)]
SEEDS = [0, *(pytest.param(n, marks=pytest.mark.heavy) for n in range(1, 8))]
"""The first is tried always, the others where there is time."""


def compared(rules: RuleBase) -> RulePairs:
    return RulePairs(arrange(rules, unit_domain(rules)))


def strengths(rules: RuleBase) -> list[tuple[Fraction, ...]]:
    points = itertools.product(GRID, repeat=len(rules.inputs))
    return [
        exact_answer(rules, dict(zip(rules.inputs, p, strict=True))).strengths
        for p in points
    ]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_rule_is_nowhere_weaker_iff_the_other_never_wins(
    kind: Kind, seed: int
) -> None:
    rules = random_base(seed, 5, 2, kind=kind, shared=0.5, odd=0.2)
    both = compared(rules)
    for strong, weak in itertools.permutations(range(1, 6), 2):
        state = wins(both.base, weak, {strong}, Clock())
        verdict = both.never_weaker(strong, weak)
        if not isinstance(state, Bracket) and verdict != "open":
            assert (verdict == "always") is isinstance(state, Proved)
        assert kind == "lr" or verdict != "open"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "kind", ["points", "band", pytest.param("lr", marks=pytest.mark.heavy)]
)
def test_under_the_product_no_point_of_a_grid_speaks_against_it(
    kind: Kind, seed: int
) -> None:
    rules = random_base(seed, 5, 2, "product", kind, shared=0.6, odd=0.2)
    both, rows = compared(rules), strengths(rules)
    for strong, weak in itertools.permutations(range(1, 6), 2):
        pairs = [(row[strong - 1], row[weak - 1]) for row in rows]
        if both.never_weaker(strong, weak) == "always":
            assert all(a >= b for a, b in pairs)
        if both.above(strong, weak) == "always":
            assert all(a > b or not b for a, b in pairs)


@pytest.mark.parametrize("seed", SEEDS)
def test_under_min_a_rule_that_is_above_is_stronger_wherever_the_other_fires(
    seed: int,
) -> None:
    rules = random_base(seed, 6, 2, kind="points", shared=0.8)
    half = Term("half", Points((0.0, 0.3, 0.6), (0.0, 0.5, 0.0)))
    tall = Term("tall", Points((-0.1, 0.3, 0.7), (0.0, 1.0, 0.0)))
    variables = tuple(replace(v, terms=(*v.terms, half, tall)) for v in rules.variables)
    more = tuple(
        Rule((Proposition("x1", (name,)),), "class 1") for name in ("half", "tall")
    )
    rules = replace(rules, variables=variables, rules=(*rules.rules, *more))
    both, rows = compared(rules), strengths(rules)
    assert both.above(8, 7) == "always"
    for strong, weak in itertools.permutations(range(1, 9), 2):
        if both.above(strong, weak) == "always":
            pairs = [(row[strong - 1], row[weak - 1]) for row in rows]
            assert all(a > b or not b for a, b in pairs)


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_the_strengths_of_a_ground_are_those_of_the_definition(
    conjunction: str,
) -> None:
    rules = random_base(3, 6, 2, kind="mixed", odd=0.7, combinations=1)
    meant = Semantics("product" if conjunction == "product" else "minimum")
    rules = replace(rules, semantics=meant)
    given = arrange(rules, unit_domain(rules))
    for a, b in itertools.product(GRID[1::2], repeat=2):
        found = strengths_at(given, {"x1": Fraction(a), "x2": Fraction(b)})
        assert tuple(found) == exact_answer(rules, {"x1": a, "x2": b}).strengths


def test_rules_that_ask_nothing_are_equal() -> None:
    rules = RuleBase("all", ("a", "b"), (), (Rule((), "a"), Rule((), "b")))
    for meant in (Semantics("minimum"), Semantics("product")):
        both = RulePairs(arrange(replace(rules, semantics=meant), Domain(())))
        assert both.never_weaker(1, 2) == "always"
        assert both.above(1, 2) != "always"
        assert both.fires.all()


@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_an_open_lower_end_does_not_count(conjunction: str) -> None:
    # At 0 itself the second is stronger, above it never.
    terms = (
        Term("low", Points((0.0, 1.0), (0.5, 0.0))),
        Term("spike", Points((0.0, 0.0), (1.0, 0.0))),
    )
    rules = RuleBase(
        "open",
        ("a",),
        (Variable("x", terms),),
        tuple(Rule((Proposition("x", (term.name,)),), "a") for term in terms),
        Semantics("product" if conjunction == "product" else "minimum"),
    )
    verdicts = [
        RulePairs(
            arrange(rules, Domain((DomainSide("x", 0.0, 1.0, is_open=is_open),)))
        ).never_weaker(1, 2)
        for is_open in (False, True)
    ]
    assert verdicts == ["not", "always"]


@pytest.mark.parametrize("seed", SEEDS)
def test_no_point_of_a_grid_is_farther_than_a_distance(seed: int) -> None:
    rules = random_base(seed, 4, 2, kind="lr", shared=0.7)
    both, rows = compared(rules), strengths(rules)
    for one, other in itertools.combinations(range(4), 2):
        found = both.distance(one + 1, other + 1, ONE)
        assert found is not None
        assert all(abs(row[one] - row[other]) <= found.whole for row in rows)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
def test_no_point_of_a_grid_reaches_more_than_where_rules_meet(
    conjunction: str, seed: int
) -> None:
    rules = random_base(seed, 4, 2, kind="mixed", shared=0.3)
    meant = Semantics("product" if conjunction == "product" else "minimum")
    rules = replace(rules, semantics=meant)
    both, rows, level = compared(rules), strengths(rules), Fraction(1, 10)
    for one, other in itertools.combinations(range(1, 5), 2):
        found = both.joint_maximum(one, other, level)
        most = max(min(row[one - 1], row[other - 1]) for row in rows)
        assert most <= found.level.high + Fraction(1, 10**12)
        assert most <= both.joint_bounds(one)[other - 1]
        if isinstance(found.state, Witness):
            assert Fraction(found.state.claims[0].level or 0) >= level
        if conjunction == "minimum" and both.levels.is_exact:
            assert found.level.high - found.level.low < Fraction(1, 10**9)


def test_a_rule_that_is_0_on_both_sides_of_an_irrational_place_never_fires() -> None:
    terms = (
        Term("far", Points((2.0, 3.0), (0.0, 1.0))),
        Term("bell", LR(0.5, Half(0.3, (3.0, 1.0), 2.0), Half(0.5, (3.0,), 1.5))),
    )
    variable = Variable("x", terms, low=0.0, high=1.0)
    whens = (
        (Proposition("x", ("bell",)), Proposition("x", ("far",))),
        (Proposition("x", ("bell",)),),
    )
    rules = RuleBase("r", ("a",), (variable,), tuple(Rule(when, "a") for when in whens))
    assert compared(rules).fires.tolist() == [False, True]


@pytest.mark.parametrize("seed", [5, 18])
def test_where_rules_on_shared_inputs_meet_is_decided(seed: int) -> None:
    rules = random_base(seed, 4, 2, kind="mixed", shared=0.5, odd=0.2, combinations=1)
    both = RulePairs(arrange(rules, unit_domain(rules)))
    level = Fraction(1, 2)
    found = both.joint_maximum(1, 3, level)
    if isinstance(found.state, Witness):
        strengths = strengths_at(both.base, point_of(found.state.point))
        assert min(strengths[0], strengths[2]) >= level
        return
    assert found.level.high < level or isinstance(found.state, Proved)
    steps = [Fraction(n, 12) for n in range(13)]
    for x in steps:
        for y in steps:
            point = dict(zip(rules.inputs, (x, y), strict=True))
            strengths = strengths_at(both.base, point)
            assert min(strengths[0], strengths[2]) < level


def test_rules_that_come_as_near_to_a_level_as_one_likes_do_not_reach_it() -> None:
    falls = Term("falls", Points((0.0, 2.0), (0.5, 0.25)))
    mixed = Variable("mixed", (falls,), parts=(Part("x", -1.0, 1.0), Part("y", 1.0)))
    rules = RuleBase(
        "near",
        ("a", "b"),
        (Variable("x"), Variable("y", (falls,)), mixed),
        (
            Rule((Proposition("y", ("falls",)),), "a"),
            Rule((Proposition("mixed", ("falls",)),), "b"),
        ),
    )
    box = Domain((DomainSide("x", 0.0, 2.0), DomainSide("y", 0.0, 4.0, is_open=True)))
    found = RulePairs(arrange(rules, box)).joint_maximum(1, 2, Fraction(1, 2))
    assert isinstance(found.state, Proved)
    assert found.level.high == Fraction(1, 2)  # nothing below it bounds them
