"""Whether a rule wins is decided on all of a domain, and every witness holds."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest

from fuzzytree.auditing.engine.arrangement import (
    Arrangement,
    arrange,
    restricted,
    strengths_at,
)
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.questions import least_cover, tie, uncovered, wins
from fuzzytree.auditing.engine.states import Bracket, Proved, Witness, point_of
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Variable,
)
from fuzzytree.model.rulebase import Side as Half
from fuzzytree.numerics.oracle import DECIDED, decide
from tests.auditing.engine.bases import random_base, unit_domain


def _rivals(rules: RuleBase, rule: int) -> tuple[int, ...]:
    label = rules.rules[rule - 1].then
    return tuple(n for n, one in enumerate(rules.rules, 1) if one.then != label)


def _holds(
    given: Arrangement, found: Witness, rule: int, rivals: tuple[int, ...]
) -> bool:
    strengths = strengths_at(given, point_of(found.point))
    return all(strengths[rule - 1] > strengths[n - 1] for n in rivals)


KINDS = ["lr", "points", "band", "mixed"]


@pytest.mark.one_in(10)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shared", [0.0, 0.8])
@pytest.mark.parametrize("seed", range(2))
def test_no_sampled_row_contradicts_a_proof_and_witnesses_hold(
    seed: int, shared: float, kind: str
) -> None:
    rules = random_base(seed, 6, 3, kind=kind, shared=shared, odd=0.3)  # type: ignore[arg-type]
    given = arrange(rules, unit_domain(rules))
    values = np.random.default_rng(seed).random((3, 3000))
    answers = decide(rules, values, with_strengths=False)
    for rule in range(1, 7):
        rivals = _rivals(rules, rule)
        found = wins(given, rule, rivals)
        if isinstance(found, Proved):
            won = (answers.rule == rule) & (answers.status == DECIDED)
            assert not won.any()
        elif isinstance(found, Witness):
            assert _holds(given, found, rule, rivals)
        else:
            assert isinstance(found, Bracket)
            assert found.high < 1e-60


@pytest.mark.parametrize("kind", KINDS)
def test_it_holds_on_all_of_the_region(kind: str) -> None:
    chance = random.Random(7)
    rules = random_base(3, 6, 3, kind=kind)  # type: ignore[arg-type]
    given = arrange(rules, unit_domain(rules))
    for rule in range(1, 7):
        rivals = _rivals(rules, rule)
        found = wins(given, rule, rivals)
        if not isinstance(found, Witness) or not found.region:
            continue
        for _ in range(10):
            point = {name: Fraction(chance.random()) for name in rules.inputs}
            for span in found.region:
                assert span.low is not None
                assert span.high is not None
                low, high = Fraction(span.low), Fraction(span.high)
                point[span.variable] = low + (high - low) * chance.randint(0, 4) / 4
            strengths = strengths_at(given, point)
            assert all(strengths[rule - 1] > strengths[n - 1] for n in rivals)


def _union_base(sliver: float) -> RuleBase:
    """Two rules that together hide a third one but for a sliver in the middle."""
    left = Term("left", Points((0.0, 0.5, 0.5 + sliver), (1.0, 1.0, 0.0)))
    right = Term("right", Points((0.5 - sliver, 0.5, 1.0), (0.0, 1.0, 1.0)))
    middle = Term("middle", Points((0.25, 0.5, 0.75), (0.0, 1.0, 0.0)))
    variable = Variable("x", (left, right, middle))
    rules = tuple(
        Rule((Proposition("x", (name,)),), label)
        for name, label in (("left", "a"), ("right", "b"), ("middle", "c"))
    )
    return RuleBase("union", ("a", "b", "c"), (variable,), rules)


def test_a_rule_that_only_two_others_together_hide_never_wins() -> None:
    rules = _union_base(0.1)
    given = arrange(rules, Domain((DomainSide("x", 0.0, 1.0),)))
    found = wins(given, 3, (1, 2))
    assert isinstance(found, Proved)
    assert isinstance(wins(given, 3, (1,)), Witness)
    assert isinstance(wins(given, 3, (2,)), Witness)


def test_a_sliver_that_samples_miss_is_found() -> None:
    peak = 0.123456789
    wide = LR(0.5, Half(1.0, (1.0,), 5.0), Half(1.0, (1.0,), 5.0))
    at = 1.0 - (0.5 - peak)
    thin = Points((peak - 1e-6, peak, peak + 1e-6), (0.0, at + 1e-3, 0.0))
    variable = Variable("x", (Term("wide", wide), Term("thin", thin)))
    rules = RuleBase(
        "sliver",
        ("a", "b"),
        (variable,),
        (
            Rule((Proposition("x", ("wide",)),), "a"),
            Rule((Proposition("x", ("thin",)),), "b"),
        ),
    )
    given = arrange(rules, Domain((DomainSide("x", 0.0, 1.0),)))
    found = wins(given, 2, (1,))
    assert isinstance(found, Witness)
    values = np.random.default_rng(0).random((1, 100_000))
    assert not (decide(rules, values).rule == 2).any()
    (span,) = found.region
    assert span.low is not None
    assert span.high is not None
    assert span.high - span.low < 1e-8


def _mixed(rule_of_sum: str) -> RuleBase:
    low = Term("low", Points((0.25, 0.5), (1.0, 0.0)))
    high = Term("high", Points((1.25, 1.75), (0.0, 1.0)))
    far = Term("far", Points((2.0, 3.0), (0.0, 1.0)))
    total = Variable("sum", (high, far), parts=(Part("x", 1.0), Part("y", 1.0)))
    rules = (
        Rule((Proposition("x", ("low",)), Proposition("sum", (rule_of_sum,))), "a"),
        Rule((Proposition("y", ("low",)),), "b"),
    )
    inputs = (Variable("x", (low,)), Variable("y", (low,)))
    return RuleBase("mixed", ("a", "b"), (*inputs, total), rules)


def test_a_sum_that_its_inputs_cannot_reach_makes_a_rule_dead() -> None:
    box = Domain((DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 1.0)))
    found = wins(arrange(_mixed("far"), box), 1, (2,))
    assert isinstance(found, Proved)


def test_inputs_that_depend_on_each_other_are_solved_for() -> None:
    square = Domain((DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 1.0)))
    given = arrange(_mixed("high"), square)
    found = wins(given, 1, (2,))
    assert isinstance(found, Witness)
    assert _holds(given, found, 1, (2,))
    # With x below 1/2 the sum reaches 5/4 only where y is above 3/4.
    narrow = Domain((DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 0.7)))
    assert isinstance(wins(restricted(given, narrow), 1, (2,)), Proved)


def test_a_point_is_a_domain_too() -> None:
    rules = _union_base(0.1)
    given = arrange(rules, Domain((DomainSide("x", 0.3, 0.3),)))
    assert isinstance(wins(given, 1, (2, 3)), Witness)
    assert isinstance(wins(given, 3, (1, 2)), Proved)


@pytest.mark.heavy
def test_a_spent_budget_leaves_a_bracket() -> None:
    rules = random_base(0, 7, 4)
    ticks = iter(range(10**6))
    clock = Clock(2.0, now=lambda: float(next(ticks)))
    found = wins(arrange(rules, unit_domain(rules)), 1, _rivals(rules, 1), clock)
    assert isinstance(found, Bracket)
    assert "the budget was spent" in found.why


def test_rules_that_ask_nothing_are_all_equal() -> None:
    both = (Rule((), "a"), Rule((), "b"))
    given = arrange(RuleBase("always", ("a", "b"), (), both), Domain(()))
    assert isinstance(wins(given, 1, (2,)), Proved)
    assert isinstance(wins(given, 1, ()), Witness)
    assert isinstance(tie(given, 1, 2), Witness)
    assert isinstance(uncovered(given), Proved)
    assert least_cover(given).low == 1.0


def test_an_end_of_the_domain_at_which_a_rule_does_not_fire_is_no_part() -> None:
    terms = (Term("first", Band(0.0, 5.0)), Term("second", Band(5.0, 9.0)))
    rules = RuleBase(
        "steps",
        ("a", "b"),
        (Variable("x", terms),),
        tuple(
            Rule((Proposition("x", (term.name,)),), then)
            for term, then in zip(terms, "ab", strict=True)
        ),
    )
    given = arrange(rules, Domain((DomainSide("x", 0.0, 10.0),)))
    found = wins(given, 1, (2,))
    assert isinstance(found, Witness)
    assert 0.0 < found.region[0].low < 1e-300  # type: ignore[operator]
