"""Whether two rule bases decide alike, held against every point of a fine grid."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import numpy as np
import pytest
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import prediction_at
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.contenders import AxisPart, common_axes, spread
from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.equivalence import difference_region, equivalence
from fuzzytree.auditing.engine.states import Bracket, Proved, State, Witness, point_of
from fuzzytree.model.rulebase import (
    Band,
    Part,
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.numerics.exact import exact_answer
from fuzzytree.numerics.oracle import decide
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree


def box(*models: RuleBase, low: float = -3.0, high: float = 3.0) -> Domain:
    names = dict.fromkeys(name for model in models for name in model.inputs)
    return Domain(tuple(DomainSide(name, low, high) for name in names))


def pair(seed: int) -> tuple[RuleBase, RuleBase]:
    """Return a small rule base of polylines and the same with one change."""
    chance = random.Random(seed)

    def line() -> Points:
        values = sorted({round(chance.uniform(-4, 4), 1) for _ in range(3)})
        return Points(
            tuple(values), tuple(chance.choice([0.0, 0.25, 0.5, 1.0]) for _ in values)
        )

    variables = tuple(
        Variable(name, tuple(Term(f"t{k}", line()) for k in range(3)))
        for name in ("x", "y")
    )

    def rule() -> Rule:
        when = [
            Proposition(
                name,
                tuple(chance.sample(["t0", "t1", "t2"], 2)),
                ("not",) if chance.random() < 0.2 else (),
            )
            for name in ("x", "y")
            if chance.random() < 0.8
        ]
        return Rule(tuple(when), chance.choice("abc"))

    rules = tuple(rule() for _ in range(chance.randint(2, 5)))
    semantics = Semantics(
        chance.choice(["minimum", "product"]), chance.choice([None, "a"])
    )
    old = RuleBase("a", ("a", "b", "c"), variables, rules, semantics)
    terms = (Term("t0", line()), *variables[0].terms[1:])
    changed = [
        replace(old, rules=rules[1:]),
        replace(old, rules=rules[::-1]),
        replace(old, rules=(*rules, rule())),
        replace(old, variables=(replace(variables[0], terms=terms), variables[1])),
        replace(old, semantics=replace(semantics, conjunction="product")),
        replace(old, semantics=replace(semantics, uncovered="b")),
    ]
    return old, chance.choice(changed)


def differing(old: RuleBase, new: RuleBase) -> list[float]:
    """Return the smaller margin at each point of a grid with different classes."""
    steps = np.arange(-3.0, 3.01, 0.1).round(1)
    grid = np.array(np.meshgrid(steps, steps)).reshape(2, -1)
    one, other = (decide(m, grid, with_strengths=False) for m in (old, new))
    margins: list[float] = np.minimum(one.margin, other.margin)[
        one.label != other.label
    ].tolist()
    return margins


def assert_true(old: RuleBase, new: RuleBase, found: State) -> None:
    """A state is what the grid and the point say."""
    if isinstance(found, Witness):
        point = {name: float(value) for name, value in point_of(found.point).items()}
        labels = [exact_answer(model, point).label for model in (old, new)]
        assert labels == [claim.label for claim in found.claims]
        assert labels[0] != labels[1]
    elif isinstance(found, Bracket):
        assert all(margin <= found.high for margin in differing(old, new))
    else:
        assert isinstance(found, Proved)
        assert not differing(old, new)


@pytest.mark.one_in(10)
@pytest.mark.parametrize("seed", range(16))
def test_a_verdict_about_two_bases_is_what_a_grid_says(seed: int) -> None:
    old, new = pair(seed)
    assert_true(old, new, equivalence(old, new, box(old), Clock(), most=200))


@pytest.mark.heavy
@pytest.mark.parametrize("seed", range(100, 250))
def test_more_verdicts_are_what_a_grid_says(seed: int) -> None:
    old, new = pair(seed)
    assert_true(old, new, equivalence(old, new, box(old), Clock()))


@pytest.mark.parametrize("combinations", [0, 2])
@pytest.mark.parametrize("seed", range(2))
def test_relative_rules_agree_in_any_order_and_with_any_and(
    seed: int, combinations: int
) -> None:
    rules = rules_from_tree(random_tree(seed, combinations=combinations))
    reversed_rules = replace(rules, rules=rules.rules[::-1])
    times = replace(rules, semantics=Semantics("product"))
    for other in (reversed_rules, times):
        assert isinstance(equivalence(rules, other, box(rules), Clock()), Proved)


def crisp(cut: float, *, name: str = "x") -> RuleBase:
    flank = cut + 1.0
    terms = (
        Term("low", Band(high=cut, right=flank)),
        Term("high", Band(low=cut, left=cut - 1.0)),
    )
    rules = (
        Rule((Proposition(name, ("low",)),), "a"),
        Rule((Proposition(name, ("high",)),), "b"),
    )
    return RuleBase("cut", ("a", "b"), (Variable(name, terms),), rules)


def test_a_cut_that_moved_by_one_double_is_found_there_and_nowhere_else() -> None:
    moved = math.nextafter(0.3, 1.0)
    found = equivalence(crisp(0.3), crisp(moved), box(crisp(0.3)), Clock())
    assert isinstance(found, Witness)
    assert point_of(found.point) == {"x": Fraction(moved)}
    assert [claim.label for claim in found.claims] == ["b", "a"]


def test_a_curve_that_changed_outside_of_the_domain_changes_nothing() -> None:
    found = equivalence(crisp(5.0), crisp(6.0), box(crisp(5.0)), Clock())
    assert found == Proved("both answer alike in every box: 1 box settled")


def test_rules_in_another_order_differ_at_their_tie_alone() -> None:
    falls = Term("falls", Points((0.0, 1.0), (1.0, 0.0)))
    rises = Term("rises", Points((0.0, 1.0), (0.0, 1.0)))
    rules = (
        Rule((Proposition("x", ("falls",)),), "a"),
        Rule((Proposition("x", ("rises",)),), "b"),
    )
    old = RuleBase("tie", ("a", "b"), (Variable("x", (falls, rises)),), rules)
    new = replace(old, rules=rules[::-1])
    found = equivalence(old, new, box(old), Clock())
    assert isinstance(found, Witness)
    assert point_of(found.point) == {"x": Fraction(1, 2)}


def test_a_tie_that_no_double_reaches_stays_a_bracket_of_nearly_nothing() -> None:
    falls = Term("falls", Points((0.0, 1.0), (1.0, 0.0)))
    rises = Term("rises", Points((0.0, 2.0), (0.0, 1.0)))
    rules = (
        Rule((Proposition("x", ("falls",)),), "a"),
        Rule((Proposition("x", ("rises",)),), "b"),
    )
    old = RuleBase("tie", ("a", "b"), (Variable("x", (falls, rises)),), rules)
    found = equivalence(old, replace(old, rules=rules[::-1]), box(old), Clock())
    assert isinstance(found, Bracket)
    assert found.high < 1e-12
    assert found.of == "the smaller of both margins where the two answer otherwise"


def test_a_dead_rule_may_go() -> None:
    old = crisp(0.3)
    both = (Proposition("x", ("low",)), Proposition("x", ("high",)))
    new = replace(old, rules=(*old.rules, Rule(both, "a")))
    assert isinstance(equivalence(old, new, box(old), Clock()), Proved)


def test_an_answer_for_no_rule_counts_only_where_none_fires() -> None:
    old = crisp(0.3)
    new = replace(old, semantics=Semantics(uncovered="a"))
    assert isinstance(equivalence(old, new, box(old), Clock()), Proved)
    few, less = (replace(model, rules=model.rules[:1]) for model in (old, new))
    found = equivalence(few, less, box(old), Clock())
    assert isinstance(found, Witness)
    assert [claim.label for claim in found.claims] == [None, "a"]


def sums(cut: float) -> RuleBase:
    inner = crisp(cut, name="sum")
    parts = (Part("x", 1.0), Part("y", -1.0))
    total = replace(inner.variables[0], parts=parts)
    return replace(inner, variables=(Variable("x"), Variable("y"), total))


def test_a_witness_of_a_combination_is_a_point_of_the_inputs() -> None:
    found = equivalence(sums(0.25), sums(0.5), box(sums(0.5)), Clock())
    assert isinstance(found, Witness)
    at = point_of(found.point)
    assert Fraction(1, 4) < at["x"] - at["y"] <= Fraction(1, 2)
    assert prediction_at(sums(0.25), at).label == "b"


def test_what_no_input_reaches_is_no_difference() -> None:
    # x - y and x are at most 1 and at least 0, yet not both at once.
    one = sums(0.25)
    proposition = Proposition("x", ("low",))
    low = Variable("x", (Term("low", Points((-1.0, -1.0), (1.0, 0.0))),))
    both = Rule((proposition, Proposition("sum", ("high",))), "a")
    old = replace(one, variables=(low, *one.variables[1:]))
    new = replace(old, rules=(both, *old.rules))
    domain = Domain((DomainSide("x", -1.0, 1.0), DomainSide("y", 0.0, 1.0)))
    assert isinstance(equivalence(old, new, domain, Clock()), Proved)


def test_a_budget_that_is_spent_leaves_a_bracket() -> None:
    old = crisp(0.3)
    found = equivalence(old, crisp(0.4), box(old), Clock(), most=0)
    assert isinstance(found, Bracket)
    assert found.why.startswith("enough boxes were halved: ")


def test_a_proposition_has_one_form_where_its_curves_are_one() -> None:
    near, far = crisp(0.0), crisp(2.0)
    (axis,), (one, other) = common_axes(
        (near, far), [("x", AxisPart(Fraction(-3), Fraction(3), True))]
    )
    whole = axis.bounds_on(axis.whole)
    assert whole[one[0][0][1]].form != whole[other[0][0][1]].form
    below = axis.bounds_on(AxisPart(Fraction(-3), Fraction(-1)))
    assert below[one[0][0][1]].form == below[other[0][0][1]].form


def test_bounds_hold_a_polynomial() -> None:
    chance = random.Random(5)
    for _ in range(20):
        curve = tuple(Fraction(chance.randint(-9, 9), 4) for _ in range(5))
        low, high = spread(curve, Fraction(-1), Fraction(2))
        for k in range(13):
            x = Fraction(k, 4) - 1
            assert low <= sum(c * x**n for n, c in enumerate(curve)) <= high


def test_a_region_is_a_box_on_which_both_answer_so() -> None:
    old, new = crisp(0.25), crisp(0.75)
    idle = Rule((Proposition("y", ("t",)),), "b")
    second = Variable("y", (Term("t", Points((0.0, 1.0), (0.0, 0.01))),))
    old, new = (
        replace(m, variables=(*m.variables, second), rules=(*m.rules, idle))
        for m in (old, new)
    )
    found = equivalence(old, new, box(old), Clock())
    assert isinstance(found, Witness)
    (span,) = difference_region(old, new, box(old), point_of(found.point))
    assert span.variable == "x"
    assert span.low == math.nextafter(0.25, 1.0)
    assert span.high == 0.75
