"""Whether a box is decided alike is answered exactly, with ties and gaps."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import get_args

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import (
    Arrangement,
    arrange,
    restricted,
    strengths_at,
)
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.decisions import decision_at, other_decision
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.questions import decides_by_order, tie, wins
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    point_of,
)
from fuzzytree.model.rulebase import (
    Band,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.numerics.exact import exact_answer
from tests.auditing.engine.bases import Kind, random_base

UNIT = (0.0, 1.0)


def _box(rules: RuleBase, **ends: tuple[float, float]) -> Domain:
    return Domain(
        tuple(DomainSide(name, *ends.get(name, UNIT)) for name in rules.inputs)
    )


def _shared(after: Points, *, is_swapped: bool = False) -> RuleBase:
    """Return two rules with a common proposition on x that differ on y."""
    shared = Term("shared", Points((0.0, 1.0), (0.0, 1.0)))
    ours, other = Term("ours", Points((0.0, 1.0), (1.0, 0.75))), Term("other", after)
    rules = [
        Rule((Proposition("x", ("shared",)), Proposition("y", ("ours",))), "a"),
        Rule((Proposition("x", ("shared",)), Proposition("y", ("other",))), "b"),
    ]
    return RuleBase(
        "shared",
        ("a", "b"),
        (Variable("x", (shared,)), Variable("y", (ours, other))),
        tuple(reversed(rules)) if is_swapped else tuple(rules),
        Semantics(uncovered="a"),
    )


HIGHER = Points((0.0, 1.0), (1.0, 0.875))
"""Above the sets of rule `a` everywhere but at 0."""


def test_a_class_that_decides_by_its_place_alone_is_found() -> None:
    rules = _shared(HIGHER)
    given = arrange(rules, _box(rules, x=(0.25, 1.0)))  # without what none covers
    assert isinstance(wins(given, 1, [2]), Proved)  # it is never stronger
    state = other_decision(given, "b")
    assert isinstance(state, Witness)
    assert state.claims == (Claim("decides", label="a"),)
    strengths = strengths_at(given, point_of(state.point))
    assert strengths[0] == strengths[1] > 0


def test_the_same_rules_in_the_other_order_decide_for_the_other_class() -> None:
    rules = _shared(HIGHER, is_swapped=True)
    inner = _box(rules, x=(0.25, 1.0))  # where x is 0 none fires, and that is `a`
    assert isinstance(other_decision(arrange(rules, inner), "b"), Proved)


def test_a_tie_on_a_plateau_is_found() -> None:
    full = Term("full", Band(0.25, 0.75))
    rules = RuleBase(
        "plateaus",
        ("a", "b"),
        (Variable("x", (full,)), Variable("y", (full,))),
        (
            Rule((Proposition("x", ("full",)),), "a"),
            Rule((Proposition("y", ("full",)),), "b"),
        ),
    )
    inside = arrange(rules, _box(rules, x=(0.3, 0.7), y=(0.3, 0.7)))
    assert isinstance(wins(inside, 1, [2]), Proved)
    state = other_decision(inside, "b")
    assert isinstance(state, Witness)
    assert isinstance(other_decision(inside, "a"), Proved)


def test_a_tie_at_a_constant_degree_is_found() -> None:
    level = Term("level", Points((0.0,), (0.3,)))
    rules = RuleBase(
        "constant",
        ("a", "b"),
        (Variable("x", (level,)), Variable("y", (level,))),
        (
            Rule((Proposition("x", ("level",)),), "a"),
            Rule((Proposition("y", ("level",)),), "b"),
        ),
    )
    given = arrange(rules, _box(rules))
    assert isinstance(decides_by_order(given, 1, [], [2]), Witness)
    assert isinstance(other_decision(given, "a"), Proved)


def test_an_input_that_no_rule_covers_is_another_decision_only_if_it_is() -> None:
    narrow = Term("narrow", Points((0.25, 0.5, 0.75), (0.0, 1.0, 0.0)))
    rules = RuleBase(
        "narrow",
        ("a", "b"),
        (Variable("x", (narrow,)),),
        (Rule((Proposition("x", ("narrow",)),), "a"),),
    )
    for answer, kind in ((None, Witness), ("b", Witness), ("a", Proved)):
        semantics = Semantics(uncovered=answer)
        changed = RuleBase("n", rules.classes, rules.variables, rules.rules, semantics)
        state = other_decision(arrange(changed, _box(changed)), "a")
        assert isinstance(state, kind)
        if isinstance(state, Witness):
            assert state.claims == (Claim("decides", label=answer),)


def test_where_no_rule_fires_the_first_that_does_is_another_decision() -> None:
    narrow = Term("narrow", Points((0.25, 0.5, 0.75), (0.0, 1.0, 0.0)))
    rules = RuleBase(
        "narrow",
        ("a",),
        (Variable("x", (narrow,)),),
        (Rule((Proposition("x", ("narrow",)),), "a"),),
    )
    assert isinstance(other_decision(arrange(rules, _box(rules)), None), Witness)
    outside = arrange(rules, _box(rules, x=(0.8, 1.0)))
    assert isinstance(other_decision(outside, None), Proved)


def _as_product(rules: RuleBase) -> RuleBase:
    return replace(rules, semantics=replace(rules.semantics, conjunction="product"))


@pytest.mark.parametrize(
    ("other", "ties"),
    [
        (Points((0.0, 1.0), (1.0, 0.875)), False),
        (Points((0.0, 1.0), (0.5, 0.375)), False),  # half of the other one
        (Points((0.0, 0.5, 1.0), (1.0, 0.875, 0.0)), True),  # up to 1/2 the same
        (Points((0.0, 1.0), (0.0, 0.5)), False),
    ],
)
def test_rules_tie_under_the_product_where_they_are_one_function(
    other: Points, ties: bool
) -> None:
    rules = _as_product(_shared(other))
    found = tie(arrange(rules, _box(rules)), 1, 2)
    assert isinstance(found, Witness if ties else Proved)


def test_a_tie_on_a_plateau_under_the_product_is_not_taken_for_none() -> None:
    full = Term("full", Band(0.25, 0.75))
    rules = RuleBase(
        "plateaus",
        ("a", "b"),
        (Variable("x", (full,)), Variable("y", (full,))),
        (
            Rule((Proposition("x", ("full",)),), "a"),
            Rule((Proposition("y", ("full",)),), "b"),
        ),
        Semantics("product"),
    )
    inside = arrange(rules, _box(rules, x=(0.3, 0.7), y=(0.3, 0.7)))
    assert isinstance(other_decision(inside, "b"), Witness)
    assert isinstance(tie(inside, 1, 2), Witness)
    assert isinstance(other_decision(inside, "a"), Proved)  # the first one decides


def test_a_spent_budget_leaves_it_open() -> None:
    times = iter([0.0] + [9.0] * 10_000)
    clock = Clock(1.0, now=lambda: next(times))
    rules = _shared(HIGHER)
    state = decides_by_order(arrange(rules, _box(rules)), 1, [], [2], clock)
    assert isinstance(state, Bracket)
    assert state.why == "the budget was spent"


def _sampled(
    given: Arrangement, label: str | None, draw: random.Random, count: int
) -> int:
    """Return how many of some points are decided otherwise."""
    found = 0
    for _ in range(count):
        point = {
            side.variable: Fraction(draw.uniform(side.low, side.high))
            for side in given.domain.sides
        }
        found += decision_at(given, point) != label
    return found


def _checked(given: Arrangement, label: str | None, state: State) -> None:
    """Check that a witness is one, by the reference in fractions too."""
    if isinstance(state, Witness):
        point = point_of(state.point)
        assert decision_at(given, point) != label
        if all(one.hex is not None for one in state.point):
            row = {name: float(value) for name, value in point.items()}
            assert exact_answer(given.rules, row).label == state.claims[0].label


def _compare(kind: Kind, seed: int, points: int) -> None:
    rules = random_base(seed, 7, 3, kind=kind, shared=0.6)
    whole = arrange(rules, _box(rules))
    draw = random.Random(seed)
    for reach in (0.02, 0.1, 0.3):
        at = {name: draw.random() for name in rules.inputs}
        box = Domain(
            tuple(
                DomainSide(name, max(0.0, x - reach), min(1.0, x + reach))
                for name, x in at.items()
            )
        )
        given = restricted(whole, box)
        label = decision_at(given, {name: Fraction(x) for name, x in at.items()})
        state = other_decision(given, label)
        _checked(given, label, state)
        if _sampled(given, label, draw, points):
            assert not isinstance(state, Proved)


@pytest.mark.parametrize("kind", get_args(Kind))
def test_no_sampled_point_contradicts_the_answer(kind: Kind) -> None:
    for seed in range(2):
        _compare(kind, seed, points=30)


@pytest.mark.heavy
@pytest.mark.parametrize("kind", get_args(Kind))
def test_no_sampled_point_of_many_contradicts_the_answer(kind: Kind) -> None:
    for seed in range(2, 14):
        _compare(kind, seed, points=300)
