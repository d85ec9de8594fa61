"""Whether two models decide alike, held against grids and points of the domain."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.states import Bracket, Proved, State, Witness, point_of
from fuzzytree.auditing.diff.agreement import OF, Agreement
from fuzzytree.auditing.diff.regions import difference_region
from fuzzytree.model import (
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
from fuzzytree.semantics import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.decide.bases import Kind, random_base


def box(*models: RuleBase, low: float = -3.0, high: float = 3.0) -> Domain:
    names = dict.fromkeys(name for model in models for name in model.inputs)
    return Domain(tuple(DomainSide(name, low, high) for name in names))


def state(old: RuleBase, new: RuleBase, domain: Domain | None = None) -> State:
    return Agreement(old, new, domain or box(old, new)).state(Budget())


def edited(model: RuleBase, seed: int) -> RuleBase:
    """Return a rule base with one small change."""
    chance = random.Random(seed)
    rules = [*model.rules]
    place = chance.randrange(len(rules))
    rule, other = rules[place], chance.choice(rules)
    kind = chance.randrange(6)
    if kind == 0:
        rules[place] = replace(rule, then=chance.choice("abc"))
    elif kind == 1:
        del rules[place]
    elif kind == 2:
        rules.insert(place, replace(rule, when=(*rule.when, other.when[0])))
    elif kind == 3:
        rules.reverse()
    elif kind == 4:
        rules[place] = replace(rule, when=rule.when[1:] or rule.when)
    else:
        rules.append(replace(other, then=rule.then))
    return replace(model, rules=tuple(rules))


def check(both: Agreement, result: State, seed: int, count: int) -> None:
    """Compare a state with exact predictions at some points, knots among them."""
    if isinstance(result, Witness):
        one, other = both.predictions(point_of(result.point))
        assert [one.label, other.label] == [claim.label for claim in result.claims]
        assert one.label != other.label
        return
    chance = random.Random(seed)
    for _ in range(count):
        point = {}
        for name, axis in both.base.inputs.items():
            own = both.base.axes.get(name)
            places = [*axis.values, *axis.extra, *(own.knots if own else ())]
            x = axis.low + (axis.high - axis.low) * Fraction(chance.randint(0, 64), 64)
            if axis.values or (places and chance.random() < 0.5):
                x = chance.choice(places)
            point[name] = x
        if not both.base.contains(point):
            continue
        one, other = both.predictions(point)
        if isinstance(result, Proved):
            assert one.label == other.label, (seed, point)
        elif isinstance(result, Bracket) and result.high == 0.0:
            is_tie = not (one.has_margin and other.has_margin)
            assert one.label == other.label or is_tie, (seed, point)


CASES: list[tuple[Kind, Conjunction, Conjunction, int]] = [
    ("steps", "minimum", "minimum", 8),
    ("steps", "minimum", "product", 4),
    ("steps", "product", "product", 4),
    ("categories", "minimum", "minimum", 4),
]


@pytest.mark.heavy
@pytest.mark.parametrize(("kind", "old_norm", "new_norm", "count"), CASES)
def test_no_point_disagrees_about_two_bases(
    kind: Kind, old_norm: Conjunction, new_norm: Conjunction, count: int
) -> None:
    states = []
    for seed in range(count):
        old, domain = random_base(seed, kind, old_norm)
        new = edited(replace(old, semantics=Semantics(new_norm)), seed)
        both = Agreement(old, new, domain)
        result = both.state(Budget())
        check(both, result, seed, 500)
        states.append(result)
    is_open = [isinstance(one, Bracket) and one.high > 0.0 for one in states]
    assert sum(is_open) <= 1


@pytest.mark.heavy
def test_no_point_disagrees_about_two_trees() -> None:
    kinds = set()
    for seed in range(10):
        tree = random_tree(seed, combinations=seed % 3)
        old = rules_from_tree(tree)
        leaves = [*tree.leaves]
        if seed % 2:
            place = seed % len(leaves)
            label = next(k for k in tree.classes if k != leaves[place].label)
            leaves[place] = replace(leaves[place], label=label)
        new = rules_from_tree(replace(tree, leaves=tuple(leaves)))
        if not seed % 2:
            new = replace(new, rules=new.rules[::-1])
        both = Agreement(old, new, box(old), are_trees=True)
        result = both.state(Budget())
        assert isinstance(result, Proved | Witness)
        check(both, result, seed, 500)
        kinds.add(type(result))
    assert kinds == {Proved, Witness}


@pytest.mark.parametrize("combinations", [0, 2])
@pytest.mark.parametrize("seed", range(2))
def test_relative_rules_agree_in_any_order_and_with_any_and(
    seed: int, combinations: int
) -> None:
    rules = rules_from_tree(random_tree(seed, combinations=combinations))
    turned = replace(rules, rules=rules.rules[::-1])
    for other in (turned, replace(turned, semantics=Semantics("product"))):
        assert isinstance(state(rules, other), Proved)


def crisp(cut: float, *, name: str = "x") -> RuleBase:
    terms = (
        Term("low", Band(high=cut, right=cut + 1.0)),
        Term("high", Band(low=cut, left=cut - 1.0)),
    )
    rules = (
        Rule((Proposition(name, ("low",)),), "a"),
        Rule((Proposition(name, ("high",)),), "b"),
    )
    return RuleBase("cut", ("a", "b"), (Variable(name, terms),), rules)


def test_a_cut_that_moved_by_one_double_differs_there_and_nowhere_else() -> None:
    moved = math.nextafter(0.3, 1.0)
    result = state(crisp(0.3), crisp(moved))
    assert isinstance(result, Witness)
    assert point_of(result.point) == {"x": Fraction(moved)}
    assert [claim.label for claim in result.claims] == ["b", "a"]


def tie(rise: float) -> tuple[RuleBase, RuleBase]:
    """Return two rules that meet at one point, in both orders."""
    falls = Term("falls", Points((0.0, 1.0), (1.0, 0.0)))
    rises = Term("rises", Points((0.0, rise), (0.0, 1.0)))
    rules = (
        Rule((Proposition("x", ("falls",)),), "a"),
        Rule((Proposition("x", ("rises",)),), "b"),
    )
    old = RuleBase("tie", ("a", "b"), (Variable("x", (falls, rises)),), rules)
    return old, replace(old, rules=rules[::-1])


def test_rules_in_another_order_differ_at_their_tie_alone() -> None:
    result = state(*tie(1.0))
    assert isinstance(result, Witness)
    assert point_of(result.point) == {"x": Fraction(1, 2)}


def test_a_tie_that_no_double_reaches_is_no_difference_of_rows() -> None:
    why = "answers differ only where classes tie, and no such row is known"
    assert state(*tie(2.0)) == Bracket(OF, 0.0, 0.0, why)


def test_a_dead_rule_may_go() -> None:
    old = crisp(0.3)
    both = (Proposition("x", ("low",)), Proposition("x", ("high",)))
    new = replace(old, rules=(*old.rules, Rule(both, "a")))
    assert isinstance(state(old, new), Proved)


def test_an_answer_for_no_rule_counts_only_where_none_fires() -> None:
    old = crisp(0.3)
    new = replace(old, semantics=Semantics(uncovered="a"))
    assert isinstance(state(old, new), Proved)
    few, less = (replace(model, rules=model.rules[:1]) for model in (old, new))
    result = state(few, less)
    assert isinstance(result, Witness)
    assert [claim.label for claim in result.claims] == [None, "a"]


def sums(cut: float) -> RuleBase:
    inner = crisp(cut, name="sum")
    parts = (Part("x", 1.0), Part("y", -1.0))
    total = replace(inner.variables[0], parts=parts)
    return replace(inner, variables=(Variable("x"), Variable("y"), total))


def test_a_witness_of_a_combination_is_a_point_of_the_inputs() -> None:
    both = Agreement(sums(0.25), sums(0.5), box(sums(0.5)))
    result = both.state(Budget())
    assert isinstance(result, Witness)
    at = point_of(result.point)
    assert Fraction(1, 4) < at["x"] - at["y"] <= Fraction(1, 2)
    assert [one.label for one in both.predictions(at)] == ["b", "a"]
    assert difference_region(both, at) == ()


def test_what_no_input_reaches_is_no_difference() -> None:
    pytest.importorskip("z3")
    # x - y and x are at most 1 and at least 0, yet not both at once.
    one = sums(0.25)
    low = Variable("x", (Term("low", Points((-1.0, -1.0), (1.0, 0.0))),))
    when = (Proposition("x", ("low",)), Proposition("sum", ("high",)))
    old = replace(one, variables=(low, *one.variables[1:]))
    new = replace(old, rules=(Rule(when, "a"), *old.rules))
    domain = Domain((DomainSide("x", -1.0, 1.0), DomainSide("y", 0.0, 1.0)))
    assert isinstance(state(old, new, domain), Proved)


def test_a_budget_that_is_spent_leaves_a_bracket() -> None:
    result = Agreement(crisp(0.3), crisp(0.4), box(crisp(0.3))).state(Budget(3))
    assert result == Bracket(OF, 0.0, 1.0, "the budget was spent")


def test_a_region_is_a_box_on_which_both_answer_so() -> None:
    idle = Rule((Proposition("y", ("t",)),), "b")
    second = Variable("y", (Term("t", Points((0.0, 1.0), (0.0, 0.01))),))
    old, new = (
        replace(m, variables=(*m.variables, second), rules=(*m.rules, idle))
        for m in (crisp(0.25), crisp(0.75))
    )
    both = Agreement(old, new, box(old))
    result = both.state(Budget())
    assert isinstance(result, Witness)
    (span,) = difference_region(both, point_of(result.point))
    assert span.variable == "x"
    assert span.low == math.nextafter(0.25, 1.0)
    assert span.high == 0.75


def test_a_region_has_values_of_rows_at_its_ends() -> None:
    old, new = crisp(0.25), crisp(2.75)
    side = DomainSide("x", -3.0, 3.0, is_whole=True)
    both = Agreement(old, new, Domain((side,)))
    result = both.state(Budget())
    assert isinstance(result, Witness)
    (span,) = difference_region(both, point_of(result.point))
    assert (span.low, span.high) == (1.0, 2.0)
    codes = DomainSide("x", 0.0, 3.0, values=(0.0, 1.0, 2.0, 3.0))
    both = Agreement(old, new, Domain((codes,)))
    (span,) = difference_region(both, {"x": Fraction(1)})
    assert (span.low, span.high) == (1.0, 2.0)
