"""Rules of systems as a rule base, and what is left out."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from fractions import Fraction

import pytest
from msgspec.structs import replace

from fuzzytree.auditing.decide.domain import Domain, DomainSide
from fuzzytree.auditing.decide.rules import MOST_QUESTIONS, MOST_WAYS
from fuzzytree.auditing.findings.domains import domain_of
from fuzzytree.auditing.findings.records import AuditSettings
from fuzzytree.auditing.findings.subject import AuditView, subject_of, view
from fuzzytree.model import (
    Activation,
    And,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    Formula,
    FuzzySystem,
    Gaussian,
    Name,
    Not,
    Or,
    Points,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.model.rulebase import sentence
from fuzzytree.semantics import as_system
from fuzzytree.semantics.inference import infer
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree

BOX_INPUTS: Sequence[str] = ("a", "b")
BOX = Domain((DomainSide("a", 0.0, 4.0), DomainSide("b", 0.0, 4.0)))
LOW: Curve = Trapezoid(None, 0.0, 1.0, 3.0)
HIGH: Curve = Trapezoid(1.0, 3.0, 4.0, None)
ROUNDING = Fraction(1, 2**48)  # of a few products and sums of degrees
THEN = (Conclusion("power", "big"),)
A_LOW, A_HIGH = Proposition("a", ("low",)), Proposition("a", ("high",))
B_LOW, B_HIGH = Proposition("b", ("low",)), Proposition("b", ("high",))


def block_of(*conditions: Condition | None, **others: object) -> RuleBlock:
    rules = tuple(SystemRule(one, THEN) for one in conditions)
    return replace(RuleBlock(rules), **others)


def system_of(*blocks: RuleBlock, low: Curve = LOW, clips: bool = False) -> FuzzySystem:
    labels = (Term("low", low), Term("high", HIGH))
    inputs = tuple(
        Variable(n, labels, low=0.0, high=4.0, clips=clips) for n in ("a", "b")
    )
    output = SystemOutput(
        "power",
        (Term("big", Singleton(1.0)),),
        None,
        None,
        Defuzzifier("weighted average"),
    )
    return FuzzySystem("pump", inputs, (output,), blocks)


def rules_of(found: AuditView) -> list[str]:
    return [sentence(one) for one in found.rules.rules] if found.rules else []


def reasons(found: AuditView) -> list[str]:
    return [one.sentence for one in found.declined]


def activations(system: FuzzySystem, values: Sequence[float]) -> list[float]:
    return list(infer(system, dict(zip(BOX_INPUTS, values, strict=True))).strengths)


def strengths(found: AuditView, values: Sequence[float]) -> list[Fraction]:
    """Return the strength of each rule in the model: of its strongest way."""
    row = dict(zip(BOX_INPUTS, values, strict=True))
    low, high = both_strengths(found, row)
    assert low == high
    return [low.get(n, Fraction(0)) for n in range(1, max(found.numbers) + 1)]


CONDITIONS: tuple[Condition | None, ...] = (
    None,
    A_LOW,
    And((A_LOW, Or((B_LOW, A_HIGH)))),
    Or((A_LOW, A_HIGH)),
    Or((And((A_LOW, B_LOW)), And((A_HIGH, B_HIGH)))),
    Proposition("a", ("low",), ("not",)),
    And((Proposition("a", (), ("any",)), Proposition("b", ("low",), ("not", "not")))),
    Not(Or((A_LOW, A_HIGH))),
)
UNDER_MINIMUM = (
    Not(And((A_LOW, Or((B_LOW, Not(B_HIGH)))))),
    Not(Or((A_LOW, And((B_LOW, B_HIGH))))),
)


@pytest.mark.parametrize("norm", ["minimum", "product"])
def test_rules_of_a_view_are_as_strong_as_those_of_the_system(norm: str) -> None:
    more = UNDER_MINIMUM if norm == "minimum" else ()
    system = system_of(block_of(*CONDITIONS, *more, conjunction=norm))
    found = view(system, BOX)
    assert found.is_whole
    assert not found.declined
    assert found.policy.decision == "all"
    chance = random.Random(0)
    for _ in range(200):
        # quarters: products of two and sums are exact in doubles
        values = [chance.randrange(-4, 21) / 4.0 for _ in range(2)]
        right = [Fraction(one) for one in activations(system, values)]
        assert strengths(found, values) == right


def test_a_rule_with_an_or_of_two_inputs_becomes_one_for_each_way() -> None:
    both = And((A_LOW, Or((B_LOW, A_HIGH))))
    found = view(system_of(block_of(A_LOW), block_of(both)), BOX)
    assert rules_of(found) == [
        "IF a is low THEN power is big",
        "IF a is low AND b is low THEN power is big",
        "IF a is low AND a is high THEN power is big",
    ]
    assert found.rule_names == (
        "rule 1 of block 1",
        "way 1 of rule 1 of block 2",
        "way 2 of rule 1 of block 2",
    )
    assert found.numbers == (1, 2, 2)


def test_an_or_of_one_input_stays_one_proposition() -> None:
    found = view(system_of(block_of(Or((A_LOW, A_HIGH)))), BOX)
    assert rules_of(found) == ["IF a is low or high THEN power is big"]


DECLINING = {
    "rule 1 is left out: its 'and' is the einstein product, which has no exact "
    "method": block_of(And((A_LOW, B_LOW)), conjunction="einstein product"),
    "rule 1 is left out: its 'or' is the algebraic sum, which has no exact "
    "method": block_of(Or((A_LOW, B_LOW)), disjunction="algebraic sum"),
    "rule 1 is left out: the hedge 'very' of 'any' has no exact method": block_of(
        Proposition("a", (), ("not", "very", "any"))
    ),
    "rule 1 is left out: it uses the output 'power'": block_of(
        Proposition("power", ("big",))
    ),
    "rule 1 is left out: it negates a product, which has no exact method": block_of(
        Not(And((A_LOW, B_LOW))), And((A_LOW, B_LOW)), conjunction="product"
    ),
    "rule 1 is left out: it negates an 'or' within rules that multiply": block_of(
        Not(Or((A_LOW, B_LOW))), And((A_LOW, B_LOW)), conjunction="product"
    ),
    f"rule 1 is left out: it can hold in more than {MOST_WAYS} ways": block_of(
        And(tuple(Or((A_LOW, B_LOW, Not(A_LOW), Not(B_LOW))) for _ in range(4))),
        conjunction="product",
    ),
}


@pytest.mark.parametrize("text", DECLINING)
def test_a_rule_without_an_exact_method_is_left_out_and_told(text: str) -> None:
    block = DECLINING[text]
    kept = replace(block, rules=(*block.rules, SystemRule(B_HIGH, THEN)))
    found = view(system_of(kept), BOX)
    assert reasons(found) == [text]
    assert found.declined[0].state.__struct_config__.tag == "DECLINED"
    assert not found.is_whole
    assert rules_of(found)[-1] == "IF b is high THEN power is big"
    assert found.numbers[-1] == len(kept.rules)


def test_deep_and_long_conditions_end_soon() -> None:
    deep: Condition = Or((A_LOW, A_HIGH))
    for _ in range(90):
        deep = Or((deep, A_LOW))
    found = view(system_of(block_of(deep)), BOX)
    assert rules_of(found) == ["IF a is low or high THEN power is big"]
    long = And((A_LOW,) * (MOST_QUESTIONS + 1))
    assert reasons(view(system_of(block_of(long)), BOX)) == [
        f"rule 1 is left out: it has more than {MOST_QUESTIONS} propositions"
    ]


def test_rules_of_another_norm_than_most_are_left_out() -> None:
    both = And((A_LOW, B_LOW))
    system = system_of(block_of(both, both), block_of(both, conjunction="product"))
    found = view(system, BOX)
    assert found.policy.conjunction == "minimum"
    assert reasons(found) == [
        "rule 1 of block 2 is left out: its 'and' is the product, and that of "
        "most rules is another"
    ]


def test_a_curve_without_an_exact_method_is_reported_with_its_rules() -> None:
    system = system_of(block_of(A_LOW, A_HIGH), low=Gaussian(0.0, 1.0))
    found = view(system, BOX)
    assert len(rules_of(found)) == 2
    assert reasons(found) == [
        "term 'low' of 'a' is bounded by two lines 0.00087 apart at most: its curve "
        "(gaussian) has no exact method; its shape and its overlaps are not checked; "
        "1 rule uses it",
        "term 'low' of 'b' is bounded by two lines 0.00087 apart at most: its curve "
        "(gaussian) has no exact method; its shape and its overlaps are not checked; "
        "no rule uses it",
    ]


def test_a_formula_is_not_taken_over_and_leaves_its_rules_out() -> None:
    system = system_of(block_of(A_LOW, A_HIGH), low=Formula(Name("x")))
    found = view(system, BOX)
    assert rules_of(found) == ["IF a is high THEN power is big"]
    assert reasons(found)[::2] == [
        "term 'low' of 'a' is left out: its curve (formula) has no exact "
        "method; 1 rule uses it",
        "rule 1 is left out: the curve of 'low' of 'a' has no exact method",
    ]


def test_a_height_is_carried_where_no_degree_is_rounded() -> None:
    lines = Points((0.0, 1.0, 2.0), (0.0, 1.0, 0.3))
    for curve, height, expected in (
        (LOW, 0.7, ((1.0, 3.0), (0.7, 0.0))),
        (lines, 0.5, ((0.0, 1.0, 2.0), (0.0, 0.5, 0.15))),
        (lines, 0.7, None),
    ):
        system = system_of(block_of(A_LOW))
        one = replace(system.variables[0], terms=(Term("low", curve, height),))
        found = view(replace(system, variables=(one, system.variables[1])), BOX)
        assert found.rules is not None
        assert (("a", "low") in found.inexact) is (expected is None)
        if expected is not None:
            assert found.rules.variables[0].terms[0].shape == Points(*expected)


def test_a_rule_that_cannot_fire_is_a_finding_and_leaves_nothing_open() -> None:
    never = block_of(Proposition("a", (), ("not", "any")), A_LOW)
    off = RuleBlock((SystemRule(A_LOW, THEN, 0.0), SystemRule(A_HIGH, THEN)))
    for block, why in (
        (never, "its condition is never true"),
        (off, "its weight is 0"),
    ):
        found = view(system_of(block), BOX)
        assert [(one.code, one.sentence) for one in found.declined] == [
            ("FT101", f"rule 1 never fires: {why}")
        ]
        assert found.is_whole
        assert found.numbers == (2,)


def test_the_domain_ends_at_the_range_of_a_clipped_input() -> None:
    wide = Domain((DomainSide("a", -9.0, 4.0), DomainSide("b", 0.0, 9.0)))
    found = view(system_of(block_of(A_LOW), clips=True), wide)
    assert [(side.low, side.high) for side in found.domain.sides] == [(0.0, 4.0)] * 2
    assert reasons(found)[0] == (
        "input 'a' is left out: values outside its range are moved to its ends, "
        "so its domain is from 0.0 to 4.0"
    )
    assert view(system_of(block_of(A_LOW)), wide).domain == wide


def test_an_activation_of_only_some_rules_is_reported() -> None:
    found = view(system_of(block_of(A_LOW, activation=Activation("lowest"))), BOX)
    assert reasons(found) == [
        "the activation of block 1 is left out: it is 'lowest'; only conditions "
        "are audited"
    ]


def test_without_one_exact_rule_there_are_no_rules() -> None:
    found = view(system_of(block_of(Proposition("power", ("big",)))), BOX)
    assert found.rules is None
    assert found.numbers == ()


def test_trees_rules_and_systems_that_stand_for_rules_decide_by_the_strongest() -> None:
    tree = random_tree(0)
    rules = rules_from_tree(tree)
    of_tree, of_rules = view(tree, BOX), view(rules, BOX)
    assert of_tree.rules == of_rules.rules == rules
    assert of_tree.raw == rules_from_tree(tree, "raw")
    of_system = view(as_system(rules, "winner"), BOX)
    assert of_system.policy.decision == "strongest"
    assert of_system.rules is not None
    assert len(of_system.rules.rules) == len(rules.rules)


@pytest.mark.heavy
def test_random_systems_are_as_strong_as_their_views_within_rounding() -> None:
    compared = apart = 0
    for seed in (*range(12), 110):
        system = random_system(seed)
        found = view(system, domain_of(system))
        if found.rules is None:
            continue
        chance = random.Random(seed)
        names = {one.name for one in system.variables if not one.parts}
        row = {
            side.variable: chance.uniform(side.low, side.high)
            for side in found.domain.sides
            if side.variable in names
        }
        right = infer(system, row).strengths
        low, high = both_strengths(found, row)
        ways = [b.activation.method for b in system.blocks for _ in b.rules]
        for number in low:
            if ways[number - 1] == "general":
                compared += 1
                apart += low[number] < high[number]
                exact = Fraction(right[number - 1])
                assert low[number] - ROUNDING <= exact <= high[number] + ROUNDING
    assert compared > 20
    assert apart > 5


def both_strengths(
    found: AuditView, row: Mapping[str, float]
) -> tuple[dict[int, Fraction], dict[int, Fraction]]:
    """Return each rule's strength from below and from above, by its number."""
    base = subject_of(found, AuditSettings()).base
    point = {name: Fraction(value) for name, value in row.items()}
    made: list[dict[int, Fraction]] = []
    for side in base.strengths(point):
        best = dict.fromkeys(found.numbers, Fraction(0))
        for number, strength in zip(found.numbers, side, strict=True):
            best[number] = max(best[number], strength)
        made.append(best)
    return made[0], made[1]
