"""What a fuzzy system does not need is left out, by its program's steps."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Linear,
    Part,
    Points,
    Proposition,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.model.curves import Formula, Name, Trapezoid
from fuzzytree.model.norms import SNorm
from fuzzytree.semantics.programs.tree_program import program_of
from fuzzytree.semantics.simplification import Pruned, pruned
from fuzzytree.semantics.simplification_proof import proof_faults
from fuzzytree.testing import random_system, random_tree

LOW = Term("low", Points((0.0, 10.0), (1.0, 0.0)))
HIGH = Term("high", Points((0.0, 10.0), (0.0, 1.0)))
TWIN = replace(LOW, name="twin")
SMALL = Term("small", Trapezoid(0.0, 1.0, 1.0, 2.0))
LARGE = Term("large", Trapezoid(1.0, 2.0, 2.0, 3.0))
CENTROID, AVERAGE = Defuzzifier("centroid"), Defuzzifier("weighted average")


def heat(term: str) -> Proposition:
    return Proposition("heat", (term,))


def rule(when: Condition | None, term: str, weight: float = 1.0) -> SystemRule:
    return SystemRule(when, (Conclusion("power", term),), weight)


def system(
    *rules: SystemRule,
    inputs: tuple[Variable, ...] = (Variable("heat", (LOW, HIGH, TWIN)),),
    terms: tuple[Term, ...] = (SMALL, LARGE),
    how: Defuzzifier = CENTROID,
) -> FuzzySystem:
    aggregation: SNorm | None = None if how.is_weighted else "maximum"
    power = SystemOutput("power", terms, 0.0, 3.0, how, aggregation)
    blocks = (RuleBlock(rules, implication="minimum"),)
    return FuzzySystem("fan", inputs, (power,), blocks)


def where(result: Pruned) -> list[str]:
    return [one.where for one in result.removed]


def test_terms_that_no_rule_names_go() -> None:
    result = pruned(system(rule(heat("low"), "small")))
    assert where(result) == [
        "term 'twin' of 'heat'",
        "term 'large' of 'power'",
        "term 'high' of 'heat'",
    ]
    assert result.is_same


def test_a_rule_names_the_term_that_stands_in_for_its_own() -> None:
    whole = system(
        rule(And((heat("twin"), heat("high"))), "small"), rule(heat("low"), "large")
    )
    result = pruned(whole)
    assert where(result) == ["term 'twin' of 'heat'"]
    assert result.model.rules[0].when == And((heat("low"), heat("high")))
    assert program_of(result.model).steps == program_of(whole).steps


def test_terms_of_one_curve_and_two_heights_both_stay() -> None:
    lower = replace(LOW, name="lower", height=0.5)
    inputs = (Variable("heat", (LOW, lower)),)
    whole = system(
        rule(heat("low"), "small"), rule(heat("lower"), "large"), inputs=inputs
    )
    assert where(pruned(whole)) == []


def test_terms_of_outputs_with_one_curve_stay() -> None:
    terms = (SMALL, replace(SMALL, name="other"))
    whole = system(rule(heat("low"), "small"), rule(heat("high"), "other"), terms=terms)
    assert where(pruned(whole)) == ["term 'twin' of 'heat'"]


def test_a_singleton_that_is_a_sample_stays() -> None:
    terms = (SMALL, Term("point", Singleton(0.123)))
    inputs = (Variable("heat", (LOW,)),)
    sampled = system(rule(heat("low"), "small"), inputs=inputs, terms=terms)
    assert where(pruned(sampled)) == []
    less = replace(sampled.outputs[0], terms=(SMALL,))
    faults = list(proof_faults(sampled, replace(sampled, outputs=(less,))))
    assert faults == ["its program has other steps"]
    weighted = system(
        rule(heat("low"), "small"), inputs=inputs, terms=terms, how=AVERAGE
    )
    assert where(pruned(weighted)) == ["term 'point' of 'power'"]


@pytest.mark.parametrize(
    ("term", "is_used"),
    [
        (Linear((1.0, 0.0), 0.0), True),
        (Formula(Name("idle")), True),
        (Formula(Name("heat")), False),
        (Singleton(1.0), False),
    ],
)
def test_an_input_of_a_linear_term_or_formula_is_used(
    term: Linear | Formula | Singleton, is_used: bool
) -> None:
    inputs = (Variable("heat", (LOW,)), Variable("idle"))
    terms = (Term("small", term),)
    whole = system(rule(heat("low"), "small"), inputs=inputs, terms=terms, how=AVERAGE)
    assert where(pruned(whole)) == []
    result = pruned(whole, inputs=True)
    assert where(result) == ([] if is_used else ["input 'idle'"])
    assert result.is_same == is_used
    assert list(proof_faults(whole, result.model)) == []


def test_an_input_behind_the_hedge_any_stays() -> None:
    inputs = (Variable("heat", (LOW,)), Variable("idle"))
    always = Proposition("idle", (), ("any",))
    whole = system(rule(And((heat("low"), always)), "small"), inputs=inputs)
    assert where(pruned(whole, inputs=True)) == ["term 'large' of 'power'"]
    mix = Variable("idle", parts=(Part("heat", 0.25),))
    whole = replace(whole, variables=(inputs[0], mix))
    assert where(pruned(whole)) == ["term 'large' of 'power'"]


def test_a_rule_of_weight_0_goes_on_request_with_its_terms_and_block() -> None:
    whole = system(rule(heat("low"), "small"), rule(heat("high"), "large"))
    never = RuleBlock((rule(heat("high"), "large", 0.0),), implication="minimum")
    first = RuleBlock((rule(heat("low"), "small"),), implication="minimum")
    whole = replace(whole, blocks=(never, first))
    assert where(pruned(whole)) == ["term 'twin' of 'heat'"]
    result = pruned(whole, rules=True)
    assert where(result)[:2] == ["rule 1", "term 'twin' of 'heat'"]
    assert (result.rules, len(result.model.blocks)) == ((2,), 1)
    assert not result.is_same
    assert list(proof_faults(whole, result.model, rules=result.rules)) == []


def test_the_only_rule_stays_whatever_its_weight() -> None:
    result = pruned(system(rule(heat("low"), "small", 0.0)), rules=True)
    assert result.rules == (1,)


def test_a_rule_of_weight_0_stays_where_lines_are_joined() -> None:
    lines = Defuzzifier("centroid", grid="lines")
    rules = (rule(heat("low"), "small"), rule(heat("high"), "large", 0.0))
    assert pruned(system(*rules, how=lines), rules=True).rules == (1, 2)


def test_faults_of_systems_are_found() -> None:
    whole = system(rule(heat("low"), "small"), rule(heat("high"), "large"))
    less = replace(whole, blocks=(replace(whole.blocks[0], rules=whole.rules[:1]),))
    assert list(proof_faults(whole, less, rules=(1,))) == [
        "rule 2 may be activated and is gone"
    ]
    steeper = replace(LOW, function=Points((0.0, 10.000000000000002), (1.0, 0.0)))
    other = replace(whole, variables=(Variable("heat", (steeper, HIGH)),))
    assert list(proof_faults(whole, other)) == ["its program has other steps"]
    least = pruned(whole).model
    zero, minus = (
        replace(least, outputs=(replace(least.outputs[0], default=number),))
        for number in (0.0, -0.0)
    )
    assert zero == minus  # as Python compares numbers
    assert list(proof_faults(zero, minus)) == ["its program has other steps"]
    damp = Variable("damp", (LOW,))
    both = And((heat("low"), Proposition("damp", ("low",))))
    inputs = (*whole.variables, damp)
    more = system(rule(both, "small"), rule(heat("high"), "large"), inputs=inputs)
    (text,) = proof_faults(more, whole)
    assert text.startswith("what is gone is used: rule 1: no variable 'damp'")
    assert "the two are models of other kinds" in proof_faults(whole, random_tree(1))


@pytest.mark.parametrize("seed", range(40))
def test_random_systems_are_proved_and_pruned_once(seed: int) -> None:
    whole = random_system(seed)
    result = pruned(whole, inputs=True, rules=True)
    faults = list(proof_faults(whole, result.model, rules=result.rules))
    assert faults == []
    again = pruned(result.model, inputs=True, rules=True)
    assert again.removed == ()
