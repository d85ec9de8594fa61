"""Numbers of two systems: proved alike, shown to differ, and how far apart at most."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide import Budget
from fuzzytree.auditing.decide.states import (
    Bracket,
    Declined,
    Proved,
    Witness,
    point_of,
)
from fuzzytree.auditing.diff.differences import common_domain, difference
from fuzzytree.auditing.diff.keys import Curves, Keys
from fuzzytree.auditing.diff.numbers import most
from fuzzytree.auditing.diff.records import Difference
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.auditing.findings.records import AuditSettings
from fuzzytree.model import (
    Activation,
    And,
    Conclusion,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.model.rulebase import Points
from fuzzytree.semantics.inference import infer
from fuzzytree.testing import random_system

FEW = AuditSettings(rows=100)
AVERAGE = Defuzzifier("weighted average")


def rule(when: Condition, *labels: str, weight: float = 1.0) -> SystemRule:
    then = tuple(Conclusion("tip", label) for label in labels)
    return SystemRule(when, then, weight)


def tipper(
    *,
    inputs: Sequence[Variable] = (),
    outputs: Sequence[SystemOutput] = (),
    numbers: Mapping[str, float] = MappingProxyType({}),
) -> FuzzySystem:
    """Return a system of two inputs and three rules, with some parts changed."""
    bad = Term("bad", Trapezoid(0.0, 0.0, 2.0, 6.0))
    good = Term("good", Trapezoid(2.0, 6.0, 10.0, 10.0))
    values = {"low": 5.0, "middle": 12.5, "high": 25.0, **numbers}
    labels = tuple(Term(name, Singleton(value)) for name, value in values.items())
    rules = (
        rule(Proposition("food", ("bad",)), "low"),
        rule(
            And((Proposition("food", ("good",)), Proposition("service", ("good",)))),
            "high",
        ),
        rule(Proposition("service", ("bad",)), "middle"),
    )
    usual = [
        Variable(name, (bad, good), low=0.0, high=10.0) for name in ("food", "service")
    ]
    tip = SystemOutput("tip", labels, 0.0, 30.0, AVERAGE, default=0.0)
    return FuzzySystem(
        "tipper", tuple(inputs or usual), tuple(outputs or (tip,)), (RuleBlock(rules),)
    )


def results(
    old: FuzzySystem, new: FuzzySystem, budget: Budget | None = None
) -> Difference:
    domain = common_domain(old, new, {})
    return difference(old, new, domain=domain, settings=FEW, budget=budget)


def with_rules(system: FuzzySystem, *rules: SystemRule) -> FuzzySystem:
    block = replace(system.blocks[0], rules=rules)
    return replace(system, blocks=(block,))


ONE, TWO, THREE = tipper().blocks[0].rules


# --- proved alike


def test_what_no_number_depends_on_leaves_the_operations_the_same() -> None:
    system = tipper()
    other = with_rules(system, ONE, replace(TWO, name="second"), THREE)
    never = rule(Proposition("food", ("bad",)), "high", weight=0.0)
    other = with_rules(other, *other.blocks[0].rules, never)
    wide = replace(other.variables[0], unit="points", high=11.0)
    service = replace(other.variables[1], terms=other.variables[1].terms[::-1])
    other = replace(other, name="b", note="new", variables=(service, wide))
    found = results(system, other)
    assert (found.verdict, found.ok) == ("equal", True)
    (answer,) = found.answers
    assert answer.sentence == "both systems compute alike"
    assert answer.state == Proved(
        "both perform the same operations on the same numbers", confirmed="recheck"
    )
    assert all(change.is_proved for change in found.changes)
    assert found.changes


def test_rules_in_another_order_are_alike_but_for_rounding() -> None:
    found = results(tipper(), with_rules(tipper(), THREE, ONE, TWO))
    assert (found.verdict, found.ok) == ("equal", True)
    first = found.answers[0]
    assert first.sentence == (
        "both systems compute alike everywhere on the domain, but for rounding"
    )
    assert first.measures[0].value < 1e-13
    assert not any(answer.is_finding for answer in found.answers)


def test_curves_of_equal_degrees_are_alike_in_any_form() -> None:
    points = Term("bad", Points((2.0, 6.0), (1.0, 0.0)))
    long = Term("bad", Points((2.0, 4.0, 6.0), (1.0, 0.5, 0.0)))
    one = replace(tipper().variables[0], terms=(points, tipper().variables[0].terms[1]))
    other = replace(one, terms=(long, one.terms[1]))
    service = tipper().variables[1]
    old, new = (tipper(inputs=(each, service)) for each in (one, other))
    assert Keys(old).output("tip") != Keys(new).output("tip")
    assert results(old, new).answers[0].state == Proved(
        "both are one function of real numbers: equal curves in equal rules"
    )


def test_a_range_that_holds_the_domain_moves_no_value() -> None:
    food, service = tipper().variables
    bounds = tipper(inputs=(replace(food, clips=True), service))
    found = results(tipper(), bounds)
    assert (found.verdict, found.ok) == ("equal", True)
    assert found.answers[0].sentence == (
        "both systems compute alike everywhere on the domain"
    )
    assert [change.sentence for change in found.changes] == [
        "values of 'food' are now clamped to its range"
    ]
    short = tipper(inputs=(replace(food, high=5.0, clips=True), service))
    assert results(tipper(), short).verdict == "changed"


def test_columns_of_one_model_alone_are_reported() -> None:
    more = (*tipper().variables, Variable("music", (), low=0.0, high=1.0))
    found = results(tipper(), tipper(inputs=more))
    assert found.answers[0].sentence == (
        "both systems compute alike, where no value is missing"
    )
    assert (found.verdict, found.ok) == ("equal", False)  # rows need the column


def test_where_order_decides_it_is_no_rounding() -> None:
    first = RuleBlock((ONE, TWO, THREE), activation=Activation("highest"))
    highest = replace(tipper(), blocks=(first,))
    turned = with_rules(highest, THREE, ONE, TWO)
    assert Keys(highest, curves=Curves()).output("tip") is None
    assert results(highest, turned).verdict == "changed"


def test_systems_without_a_common_output_are_not_called_alike() -> None:
    renamed = replace(tipper().outputs[0], name="money")
    rules = [replace(one, then=(Conclusion("money", "low"),)) for one in (ONE, TWO)]
    new = replace(tipper(), outputs=(renamed,), blocks=(RuleBlock(tuple(rules)),))
    found = results(tipper(), new)
    assert (found.verdict, found.ok, found.answers) == ("open", False, ())


# --- shown to differ


def test_a_constant_that_changed_has_a_witness_and_a_bound() -> None:
    old, new = tipper(), tipper(numbers={"high": 25.5})
    found = results(old, new)
    assert (found.verdict, found.ok) == ("changed", False)
    witness = found.answers[0]
    assert isinstance(witness.state, Witness)
    point = point_of(witness.state.point)
    row = {key: float(value) for key, value in point.items()}
    was, now = (infer(system, row).outputs[0] for system in (old, new))
    assert witness.measures[0].value == now - was == 0.5
    assert witness.sentence == (
        "'tip' is 25.5, and was 25.0, as the reference computes it"
    )
    (bound,) = (a.state for a in found.answers if isinstance(a.state, Bracket))
    assert (bound.low, bound.high) == (0.5, 0.5)
    assert bound.why == (
        "degrees are the same, and no number that rules conclude moves by more"
    )


def test_a_curve_that_changed_is_bounded_by_the_numbers() -> None:
    wide = Term("bad", Trapezoid(0.0, 0.0, 3.0, 7.0))
    food = replace(tipper().variables[0], terms=(wide, tipper().variables[0].terms[1]))
    found = results(tipper(), tipper(inputs=(food, tipper().variables[1])))
    (bound,) = (a.state for a in found.answers if isinstance(a.state, Bracket))
    assert bound.high == 25.0  # from 0, the default, to 25
    assert 0.0 < bound.low < 25.0
    assert bound.why == "both answers lie between the numbers that rules conclude"


def test_a_change_too_small_for_probes_stays_open_with_its_bound() -> None:
    labels = (*tipper().outputs[0].terms, Term("top", Singleton(30.0)))
    output = replace(tipper().outputs[0], terms=labels)
    sliver = Term("sliver", Trapezoid(5.0, 5.0 + 1e-12, 5.0 + 2e-12, 5.0 + 3e-12))
    food = replace(tipper().variables[0], terms=(*tipper().variables[0].terms, sliver))
    old = tipper(inputs=(food, tipper().variables[1]), outputs=(output,))
    new = with_rules(
        old, ONE, TWO, THREE, rule(Proposition("food", ("sliver",)), "top")
    )
    found = results(old, new)
    assert found.verdict in ("open", "changed")
    assert any(
        isinstance(a.state, Bracket) and a.state.high == 30.0 for a in found.answers
    )


def test_an_output_that_stays_is_proved_beside_one_that_differs() -> None:
    output = replace(tipper().outputs[0], name="other")
    both = (tipper().outputs[0], output)
    rules = (ONE, SystemRule(TWO.when, (Conclusion("other", "high"),)), THREE)
    old = with_rules(tipper(outputs=both), *rules)
    moved = replace(output, terms=(*output.terms[:2], Term("high", Singleton(9.0))))
    found = results(old, replace(old, outputs=(both[0], moved)))
    assert found.verdict == "changed"
    states = {answer.subject: answer.state for answer in found.answers}
    assert isinstance(states["tip"], Proved)
    assert isinstance(states["other"], Witness)


def test_the_budget_ends_the_comparison_of_numbers() -> None:
    new = tipper(numbers={"high": 25.5})
    found = results(tipper(), new, Budget(10_000))
    (left,) = (a for a in found.answers if a.subject == "points")
    assert left.sentence == "3888 points were not compared: the budget was spent"
    assert left.state == Declined("FTD03", "the budget was spent")
    assert found.verdict == "changed"
    whole = results(tipper(), new)
    assert all(a.subject != "points" for a in whole.answers)


def test_a_budget_that_is_spent_before_anything_was_compared_is_reported() -> None:
    found = results(tipper(), tipper(numbers={"low": 6.0}), Budget(3))
    (answer,) = found.answers
    assert answer.sentence == (
        "the numbers of the two were not compared: the budget was spent"
    )
    assert found.verdict == "open"


def test_an_unused_singleton_is_a_sample_of_its_output() -> None:
    curves = [Trapezoid(x, x + 1.0, x + 3.0, x + 4.0) for x in (1.0, 9.0, 20.0)]
    output = replace(
        tipper().outputs[0],
        terms=tuple(map(Term, ("low", "middle", "high"), curves)),
        defuzzifier=Defuzzifier("centroid"),
        aggregation="maximum",
    )
    blocks = (replace(tipper().blocks[0], implication="minimum"),)
    old = replace(tipper(), outputs=(output,), blocks=blocks)
    terms = (*output.terms, Term("odd", Singleton(23.0)))
    new = replace(old, outputs=(replace(output, terms=terms),))
    assert results(old, new).verdict == "changed"


def test_a_hedge_lifts_a_degree_above_the_weight_of_its_rule() -> None:
    def system(number: float) -> FuzzySystem:
        labels = tipper(numbers={"low": number}).outputs[0].terms
        how = Defuzzifier("weighted sum")
        output = replace(tipper().outputs[0], terms=labels, defuzzifier=how)
        then = (Conclusion("tip", "low", ("not",)),)
        hedged = SystemRule(Proposition("food", ("bad",)), then, 0.5)
        return with_rules(tipper(outputs=(output,)), hedged)

    found = results(system(5.0), system(6.0))
    (bound,) = (a.state for a in found.answers if isinstance(a.state, Bracket))
    assert 0.5 < bound.low <= bound.high == 1.0


# --- no proof and no bound is wrong


def altered(system: FuzzySystem, chance: random.Random) -> FuzzySystem:
    """Return a system with its rules in another order, one changed, or one number."""
    block, output = system.blocks[0], system.outputs[0]
    rules = [*block.rules]
    kind = chance.randrange(5)
    if kind == 0:
        chance.shuffle(rules)
    elif kind == 1:
        rules[0] = replace(rules[0], weight=0.25)
    elif kind == 2 and output.defuzzifier.is_weighted:
        first = replace(output.terms[0], function=Singleton(3.5))
        moved = replace(output, terms=(first, *output.terms[1:]))
        return replace(system, outputs=(moved, *system.outputs[1:]))
    elif kind == 3:
        queries, *others = system.variables
        labels = tuple(replace(label, height=0.5) for label in queries.terms)
        return replace(system, variables=(replace(queries, terms=labels), *others))
    changed = replace(block, rules=tuple(rules))
    return replace(system, blocks=(changed, *system.blocks[1:]))


def check_pair(seed: int, rows: int) -> None:
    chance = random.Random(seed)
    old = random_system(seed)
    new = altered(old, chance)
    name, curves = old.outputs[0].name, Curves()
    domain = domain_of(old)
    is_same, is_meant = (
        keys[0] is not None and keys[0] == keys[1]
        for keys in (
            [Keys(system, domain, own).output(name) for system in (old, new)]
            for own in (None, curves)
        )
    )
    bound = most(old, new, name, domain)
    for _ in range(rows):
        row = {
            side.variable: chance.uniform(side.low, side.high) for side in domain.sides
        }
        was, now = (infer(system, row).outputs[0] for system in (old, new))
        is_equal = was == now or (math.isnan(was) and math.isnan(now))
        gap = 0.0 if is_equal else abs(was - now)
        rounding = 1e-9 * max(1.0, abs(was))
        assert is_equal or not is_same
        assert gap <= rounding or not is_meant
        if bound is not None and not math.isnan(gap):
            assert gap <= bound[0] + Fraction(rounding)


@pytest.mark.parametrize("seed", range(12))
def test_no_proof_and_no_bound_is_wrong(seed: int) -> None:
    check_pair(seed, 10)


@pytest.mark.heavy
def test_no_proof_and_no_bound_is_wrong_of_many_pairs() -> None:
    for seed in range(100, 400):
        check_pair(seed, 25)
