"""Ties on sets with an interior are found where rules share the weakest proposition."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import arrange, strengths_at
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.questions import decides_by_order, may_tie, tie
from fuzzytree.auditing.engine.states import (
    Bracket,
    Declined,
    Proved,
    Witness,
    point_of,
)
from fuzzytree.model.rulebase import (
    Band,
    Conjunction,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.numerics.oracle import TIE, decide
from tests.auditing.engine.bases import random_base, unit_domain

UP = Term("up", Points((0.0, 1.0), (0.0, 1.0)))
DOWN = Term("down", Points((0.0, 1.0), (1.0, 0.0)))
HALF = Term("half", Points((0.0,), (0.5,)))


def _rules(*rules: tuple[str, str, str], conjunction: str = "minimum") -> RuleBase:
    variables = (Variable("x", (UP, DOWN, HALF)), Variable("y", (UP, DOWN, HALF)))
    made = tuple(
        Rule((Proposition("x", (a,)), Proposition("y", (b,))), label)
        for a, b, label in rules
    )
    classes = tuple(dict.fromkeys(label for _, _, label in rules))
    semantics = Semantics(conjunction)  # type: ignore[arg-type]
    return RuleBase("ties", classes, variables, made, semantics)


SQUARE = Domain((DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 1.0)))


def test_rules_that_share_their_weakest_proposition_tie() -> None:
    given = arrange(_rules(("up", "up", "a"), ("up", "down", "b")), SQUARE)
    found = tie(given, 1, 2)
    assert isinstance(found, Witness)
    one, two = strengths_at(given, point_of(found.point))
    assert one == two > 0


def test_rules_that_share_nothing_tie_on_a_line_only() -> None:
    given = arrange(_rules(("up", "up", "a"), ("down", "down", "b")), SQUARE)
    assert isinstance(tie(given, 1, 2), Proved)


def test_a_third_rule_that_is_stronger_ends_the_tie() -> None:
    rules = (("up", "up", "a"), ("up", "down", "b"))
    above = ("half", "half", "c")
    given = arrange(_rules(*rules, above), SQUARE)
    found = tie(given, 1, 2)
    assert isinstance(found, Proved)  # where they tie, x is below 1/2


def test_constant_curves_tie_at_their_level() -> None:
    given = arrange(_rules(("half", "up", "a"), ("half", "down", "b")), SQUARE)
    assert isinstance(tie(given, 1, 2), Proved)  # up and down are both 1/2 on a line
    wide = _rules(("half", "half", "a"), ("half", "half", "b"))
    assert isinstance(tie(arrange(wide, SQUARE), 1, 2), Witness)


def test_the_first_of_two_equal_rules_decides_and_the_second_does_not() -> None:
    given = arrange(_rules(("up", "up", "a"), ("up", "up", "b")), SQUARE)
    assert isinstance(decides_by_order(given, 1, (), (2,)), Witness)
    assert isinstance(decides_by_order(given, 2, (1,), ()), Proved)


def _products(*rules: tuple[str, str, str]) -> RuleBase:
    return _rules(*rules, conjunction="product")


def test_products_of_the_same_curves_tie_and_those_of_others_do_not() -> None:
    given = arrange(_products(("up", "down", "a"), ("up", "down", "b")), SQUARE)
    found = tie(given, 1, 2)
    assert isinstance(found, Witness)
    one, two = strengths_at(given, point_of(found.point))
    assert one == two > 0
    assert isinstance(decides_by_order(given, 1, (), (2,)), Witness)
    assert isinstance(decides_by_order(given, 2, (1,), ()), Proved)
    shared = arrange(_products(("up", "up", "a"), ("up", "down", "b")), SQUARE)
    assert isinstance(tie(shared, 1, 2), Proved)  # where y is 1/2, a line


def test_products_tie_where_what_they_do_not_share_multiplies_to_the_same() -> None:
    low, high = (
        Term("low", Points((0.0,), (0.25,))),
        Term("high", Points((0.0,), (0.5,))),
    )
    rise = Term("rise", Points((0.0, 1.0), (0.0, 0.5)))

    def found(other: Term) -> object:
        rules = RuleBase(
            "multiples",
            ("a", "b"),
            (Variable("x", (UP, rise)), Variable("y", (low, high))),
            (
                Rule((Proposition("x", ("up",)), Proposition("y", ("low",))), "a"),
                Rule(
                    (Proposition("x", ("rise",)), Proposition("y", (other.name,))), "b"
                ),
            ),
            Semantics("product"),
        )
        return tie(arrange(rules, SQUARE), 1, 2)

    assert isinstance(found(high), Witness)  # x / 4 is x / 2 * 1 / 2
    assert isinstance(found(low), Proved)


def test_products_tie_on_the_part_that_no_other_rule_exceeds() -> None:
    rules = (("up", "down", "a"), ("up", "down", "b"))
    above = _products(*rules, ("half", "down", "c"))
    given = arrange(above, SQUARE)
    found = tie(given, 1, 2)
    assert isinstance(found, Witness)
    assert point_of(found.point)["x"] > Fraction(1, 2)
    left = Domain((DomainSide("x", 0.0, 0.5), DomainSide("y", 0.0, 1.0)))
    assert isinstance(tie(arrange(above, left), 1, 2), Proved)
    # A third that is the same function ends no tie.
    assert isinstance(tie(arrange(_products(*rules, rules[0]), SQUARE), 1, 2), Witness)


def test_products_of_combinations_of_one_direction_are_declined() -> None:
    twice = Variable("twice", (UP, HALF), parts=(Part("x", 2.0),))
    rules = RuleBase(
        "parallel",
        ("a", "b"),
        (Variable("x", (UP, HALF)), twice),
        (
            Rule((Proposition("x", ("up",)),), "a"),
            Rule((Proposition("twice", ("up",)), Proposition("x", ("half",))), "b"),
        ),
        Semantics("product"),
    )
    found = tie(arrange(rules, Domain((DomainSide("x", 0.0, 0.5),))), 1, 2)
    assert isinstance(found, Declined)  # both are x
    assert found.code == "FTD04"


@pytest.mark.one_in(5)
@pytest.mark.parametrize("conjunction", ["minimum", "product"])
@pytest.mark.parametrize("seed", range(8))
def test_no_row_ties_where_a_tie_is_excluded(
    seed: int, conjunction: Conjunction
) -> None:
    rules = random_base(seed, 5, 2, conjunction, kind="mixed", shared=0.6)
    given = arrange(rules, unit_domain(rules))
    values = np.random.default_rng(seed).random((2, 3000))
    answers = decide(rules, values)
    assert answers.strengths is not None
    best = answers.strengths.max(axis=0)
    declined = 0
    for one in range(1, 6):
        for other in range(one + 1, 6):
            found = tie(given, one, other)
            pair = answers.strengths[[one - 1, other - 1]]
            rows = (pair == best).all(axis=0) & (best > 0) & (answers.status == TIE)
            if isinstance(found, Proved):
                assert not rows.any(), (one, other)
            elif isinstance(found, Declined | Bracket):
                declined += 1
            else:
                assert isinstance(found, Witness)
                strengths = strengths_at(given, point_of(found.point))
                assert strengths[one - 1] == strengths[other - 1] == max(strengths)
                assert max(strengths) > Fraction(0)
    assert declined <= (9 if conjunction == "product" else 3)


def test_constants_of_one_level_on_different_axes_tie() -> None:
    def rules(level: float) -> RuleBase:
        other = Term("other", Points((0.0,), (level,)))
        return RuleBase(
            "flat",
            ("a", "b", "c"),
            (Variable("x", (HALF, DOWN)), Variable("y", (other,))),
            (
                Rule((Proposition("x", ("half",)),), "a"),
                Rule((Proposition("y", ("other",)),), "b"),
                Rule((Proposition("x", ("down",)),), "c"),
            ),
        )

    given = arrange(rules(0.5), SQUARE)
    found = tie(given, 1, 2)
    assert isinstance(found, Witness)
    assert point_of(found.point)["x"] > Fraction(1, 2)  # above, the third is weaker
    assert isinstance(tie(arrange(rules(0.4), SQUARE), 1, 2), Proved)


def test_rules_that_meet_at_an_end_of_the_domain_alone_do_not_tie() -> None:
    first = Term("first", Band(-1.0, 0.0))
    rules = RuleBase(
        "end",
        ("a", "b"),
        (Variable("x", (first,)), Variable("y", (UP, DOWN))),
        (
            Rule((Proposition("x", ("first",)), Proposition("y", ("up",))), "a"),
            Rule((Proposition("x", ("first",)), Proposition("y", ("up",))), "b"),
        ),
    )
    given = arrange(rules, SQUARE)
    assert isinstance(tie(given, 1, 2), Proved)
    apart = replace(
        rules, rules=(rules.rules[0], Rule((Proposition("y", ("up",)),), "b"))
    )
    assert isinstance(tie(arrange(apart, SQUARE), 1, 2), Proved)


def test_on_a_domain_of_one_value_rules_tie_along_the_other_inputs() -> None:
    rules = _rules(("half", "up", "a"), ("half", "up", "b"))
    line = Domain((DomainSide("x", 0.25, 0.25), DomainSide("y", 0.0, 1.0)))
    assert isinstance(tie(arrange(rules, line), 1, 2), Witness)
    point = Domain((DomainSide("x", 0.25, 0.25), DomainSide("y", 0.75, 0.75)))
    assert isinstance(tie(arrange(rules, point), 1, 2), Witness)
    assert isinstance(decides_by_order(arrange(rules, point), 1, (), (2,)), Witness)
    assert isinstance(decides_by_order(arrange(rules, point), 2, (1,), ()), Proved)


def test_ties_on_axes_that_share_inputs_are_decided_where_inputs_have_the_values() -> (
    None
):
    # x and mix = x + y - 1 / 2 share x, on [0, 1] each; the rules tie where x is below
    # both: y is above 1 / 2 and x below 1 / 2, or so.
    mix = Variable("mix", (UP, DOWN), parts=(Part("x", 1.0), Part("y", 1.0, 0.5)))
    rules = RuleBase(
        "mixed",
        ("a", "b"),
        (Variable("x", (UP,)), Variable("y", (UP,)), mix),
        (
            Rule((Proposition("x", ("up",)), Proposition("mix", ("up",))), "a"),
            Rule((Proposition("x", ("up",)), Proposition("mix", ("down",))), "b"),
        ),
    )
    found = tie(arrange(rules, SQUARE), 1, 2)
    assert isinstance(found, Witness)
    low = Domain(
        (DomainSide("x", 0.0, 1.0), DomainSide("y", 0.0, 0.25))
    )  # mix is below x
    assert isinstance(tie(arrange(rules, low), 1, 2), Proved)


def test_rivals_that_stay_at_a_level_are_seen_where_levels_are_near() -> None:
    level = Term("level", Points((0.5,), (0.5,)))
    rise = Term("rise", Points((2.0, 3.5), (0.5, 0.75)))
    dip = Term("dip", Points((1.0, 2.0, 3.0), (1.0, 0.25, 0.5)))
    never = Term("never", Points((0.0, 1.5, 2.0), (0.0, 0.0, 0.75)))
    on_x, on_y = Proposition("x", ("level",)), Proposition("y", ("rise",))
    rules = RuleBase(
        "flat",
        ("a", "b", "c"),
        (Variable("x", (never, level)), Variable("y", (rise, dip))),
        (
            Rule((on_x, on_y), "a"),
            Rule((on_x,), "b"),
            Rule((on_y,), "c"),
            Rule((Proposition("y", ("dip",)),), "c"),
            Rule((Proposition("x", ("level",), hedges=("not",)),), "a"),
        ),
    )
    box = Domain((DomainSide("x", 0.0, 2.0), DomainSide("y", 0.25, 3.75)))
    found = decides_by_order(arrange(rules, box), 1, (), (2, 3, 4))
    assert isinstance(found, Witness)  # all but the dip are 1/2 where y is up to 2


def test_a_tie_between_any_two_levels_is_seen_where_axes_share_inputs() -> None:
    # Rules 1 and 2 are (1 - x / 2) / 2, which exceeds rule 3 from 1/4 to 1/2 alone.
    falls = Term("falls", Points((-1.0, 1.0), (0.0, 0.5)))
    dent = Term("dent", Points((0.0, 0.5, 0.75, 1.0), (1.0, 0.75, 0.0, 1.0)))
    bump = Term("bump", Points((1.0, 1.5, 2.0), (0.0, 0.25, 0.0)))
    most = Term("most", Points((0.0,), (1.0,)))
    mixed = Variable("mixed", (falls,), parts=(Part("x", -1.0, 1.0),))
    one = Proposition("mixed", ("falls",))
    rules = RuleBase(
        "mixed",
        ("a", "b", "c"),
        (Variable("x", (dent, bump, most)), mixed),
        (
            Rule((one,), "a"),
            Rule((one, Proposition("x", ("most",))), "b"),
            Rule((Proposition("x", ("dent",)),), "c"),
            Rule((Proposition("x", ("bump",)),), "c"),
        ),
    )
    found = tie(arrange(rules, Domain((DomainSide("x", 0.0, 2.0),))), 1, 2)
    assert isinstance(found, Witness)
    assert Fraction(1, 2) < point_of(found.point)["x"] < 1


def test_curves_on_axes_of_one_direction_may_be_one_function_of_the_inputs() -> None:
    twice = Variable(
        "twice",
        (Term("late", Points((0.0, 2.0), (0.0, 1.0))),),
        parts=(Part("x", 2.0),),
    )
    rules = RuleBase(
        "parallel",
        ("a", "b"),
        (Variable("x", (UP,)), twice),
        (
            Rule((Proposition("x", ("up",)),), "a"),
            Rule((Proposition("twice", ("late",)),), "b"),
        ),
    )
    given = arrange(rules, Domain((DomainSide("x", 0.0, 1.0),)))
    found = tie(given, 1, 2)
    assert isinstance(found, Declined)  # both are x
    assert found.code == "FTD04"
    assert may_tie(given).all()
