"""Hand-worked values: each expected number was derived on paper from the equations."""

import math

import pytest

from fuzzytree.model.rulebase import (
    LR,
    Band,
    Part,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Side,
    Term,
    Variable,
)
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node
from fuzzytree.semantics.reference import (
    BELOW_ONE,
    Status,
    axis_values,
    degree,
    descend,
    evaluate,
)

RAMP = Band(high=1.0, right=3.0)
# One spread is 2. The side falls linearly by 0.4 within a spread, so that the degree
# is 1 - 0.4 u there, and 0.6 w**4 beyond, with w = (5 - u) / 4.
LINEAR = LR(10.0, Side(2.0, (0.4,)), Side(2.0, (0.4,)))


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (-1e300, 1.0),
        (1.0, 1.0),
        (math.nextafter(1.0, 2.0), BELOW_ONE),
        (1.5, 0.75),
        (2.0, 0.5),
        (3.0, 0.0),
        (1e300, 0.0),
    ],
)
def test_a_linear_flank_falls_from_one_to_zero(value: float, expected: float) -> None:
    assert degree(RAMP, value) == expected


def test_a_plateau_is_open_below_and_closed_above() -> None:
    band = Band(0.0, 1.0, -1.0, 2.0)
    assert [degree(band, x) for x in (0.0, 5e-324, 1.0)] == [BELOW_ONE, 1.0, 1.0]


def test_a_side_without_a_flank_is_a_step() -> None:
    step = Band(0.0, 1.0)
    assert [degree(step, x) for x in (0.0, 0.5, 1.0, 1.5)] == [0.0, 1.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (10.0, 1.0),
        (11.0, 0.8),  # u = 1/2
        (12.0, 0.6),  # u = 1
        (8.0, 0.6),
        (14.0, 0.6 * 0.31640625),  # u = 2: w = 3/4, w**4 = 81/256
        (20.0, 0.0),  # u = 5, the reach
        (-1e308, 0.0),
    ],
)
def test_an_lr_set_follows_its_polynomial_and_then_its_tail(
    value: float, expected: float
) -> None:
    assert degree(LINEAR, value) == expected


def test_the_sides_of_an_lr_set_may_differ() -> None:
    # left: t = 1/2, v = 0: 1 - 1/2 (0.5 + 0.1 * 0) = 0.75; right: 1 - 1/2 * 0.4 = 0.8
    uneven = LR(0.0, Side(1.0, (0.5, 0.1)), Side(4.0, (0.4,)))
    assert (degree(uneven, -0.5), degree(uneven, 2.0)) == (0.75, 0.8)


def test_a_combination_adds_weighted_distances_in_order() -> None:
    mix = Variable("mix", parts=(Part("a", 2.0, 1.0), Part("b", -1.0, 0.5)))
    variables = (Variable("a"), Variable("b"), mix)
    # 2 (4 - 1) - (3 - 0.5) = 3.5
    assert axis_values(variables, {"a": 4.0, "b": 3.0})["mix"] == 3.5


def rules(
    *propositions: tuple[Proposition, ...],
    product: bool = False,
    uncovered: str | None = None,
    missing: str | None = None,
) -> RuleBase:
    x = Variable("x", (Term("low", RAMP), Term("ten", LINEAR)))
    y = Variable("y", (Term("low", RAMP),))
    semantics = Semantics("product" if product else "minimum", uncovered, missing)
    made = tuple(
        Rule(when, label)
        for when, label in zip(propositions, ("a", "b", "c"), strict=False)
    )
    return RuleBase("r", ("a", "b", "c"), (x, y), made, semantics)


LOW_X, LOW_Y = Proposition("x", ("low",)), Proposition("y", ("low",))


def test_and_is_the_minimum_or_the_product() -> None:
    row = {"x": 2.0, "y": 1.5}
    assert evaluate(rules((LOW_X, LOW_Y)), row).strengths == (0.5,)
    assert evaluate(rules((LOW_X, LOW_Y), product=True), row).strengths == (0.375,)


def test_or_is_the_maximum_and_not_is_one_minus() -> None:
    either = Proposition("x", ("low", "ten"))
    neither = Proposition("x", ("low", "ten"), hedges=("not",))
    answer = evaluate(rules((either,), (neither,)), {"x": 11.0, "y": 0.0})
    assert answer.strengths == (0.8, 1.0 - 0.8)


def test_the_first_of_equally_strong_rules_wins_and_the_tie_is_reported() -> None:
    answer = evaluate(rules((LOW_X,), (LOW_Y,)), {"x": 2.0, "y": 2.0})
    assert (answer.rule, answer.label, answer.status) == (1, "a", Status.TIE)


def test_a_row_that_fires_no_rule_is_uncovered() -> None:
    row = {"x": 3.0, "y": 0.0}
    answer = evaluate(rules((LOW_X, LOW_Y)), row)
    assert (answer.rule, answer.label, answer.status) == (0, None, Status.UNCOVERED)
    assert evaluate(rules((LOW_X,), uncovered="c"), row).label == "c"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_is_missing(value: float) -> None:
    answer = evaluate(rules((LOW_X,), missing="b"), {"x": value, "y": 0.0})
    assert (answer.rule, answer.label, answer.status) == (0, "b", Status.MISSING)
    assert all(map(math.isnan, answer.strengths))


def test_a_missing_value_counts_even_where_no_rule_asks_it() -> None:
    answer = evaluate(rules((LOW_X,)), {"x": 0.0, "y": math.nan})
    assert answer.status == Status.MISSING


def test_a_rule_without_propositions_has_strength_one() -> None:
    assert evaluate(rules(()), {"x": 0.0, "y": 0.0}).strengths == (1.0,)


def two_leaves() -> FuzzyTree:
    x = Variable(
        "x",
        (
            Term("low", Band(high=1.0, right=2.0)),
            Term("medium", Band(1.0, 2.0, 0.0, 3.0)),
            Term("high", Band(low=2.0, left=1.0)),
        ),
    )
    branches = (Branch(("low", "high"), leaf=1), Branch(("medium",), leaf=2))
    node = Node("x", (1.0, 2.0), (0, 1, 0), branches)
    return FuzzyTree("t", ("out", "in"), (x,), (node,), (Leaf("out"), Leaf("in")))


@pytest.mark.parametrize(
    ("value", "leaf"),
    [
        (0.0, 1),
        (1.0, 1),
        (math.nextafter(1.0, 2.0), 2),
        (2.0, 2),
        (math.nextafter(2.0, 3.0), 1),
    ],
)
def test_a_value_on_a_cut_goes_left(value: float, leaf: int) -> None:
    assert descend(two_leaves(), {"x": value}).rule == leaf


def test_descent_answers_missing_like_the_rules() -> None:
    answer = descend(two_leaves(), {"x": math.nan})
    assert (answer.rule, answer.label, answer.status) == (0, None, Status.MISSING)


def test_a_missing_column_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        descend(two_leaves(), {})
