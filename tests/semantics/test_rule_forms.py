"""Rules that mix and and or say the same as the rules that they become."""

from __future__ import annotations

import random

import pytest
from msgspec.structs import replace

from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Not,
    Or,
    Proposition,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.semantics.conversion.rule_forms import MOST_RULES, alternatives, split
from fuzzytree.semantics.inference import infer

TERMS = (Term("low", Gaussian(0.0, 0.4)), Term("high", Gaussian(1.0, 0.3)))


def condition(chance: random.Random, level: int = 0) -> Condition:
    if level > 2 or chance.random() < 0.3:
        return Proposition(chance.choice("abc"), (chance.choice(("low", "high")),))
    parts = tuple(condition(chance, level + 1) for _ in range(2))
    return chance.choice((And(parts), Or(parts), Not(parts[0])))


def system(when: Condition) -> FuzzySystem:
    rule = SystemRule(when, (Conclusion("y", "high"),), 0.7)
    other = SystemRule(Proposition("a", ("low",)), (Conclusion("y", "low"),))
    output = SystemOutput("y", TERMS, 0.0, 1.0, Defuzzifier("centroid", 20), "maximum")
    block = RuleBlock((rule, other), "minimum", "maximum", "product")
    inputs = tuple(Variable(name, TERMS) for name in "abc")
    return FuzzySystem("s", inputs, (output,), (block,))


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(60))
def test_split_rules_give_the_same_bits(seed: int) -> None:
    chance = random.Random(seed)
    whole = system(condition(chance))
    (block,) = whole.blocks
    rules = split(block.rules[0], block, whole)
    parts = replace(whole, blocks=(replace(block, rules=(*rules, block.rules[1])),))
    for _ in range(10):
        row = {name: chance.uniform(-0.5, 1.5) for name in "abc"}
        assert infer(parts, row).outputs == infer(whole, row).outputs


@pytest.mark.parametrize(
    "change",
    [
        {"conjunction": "product"},
        {"disjunction": "algebraic sum"},
        {"implication": "einstein product"},
    ],
    ids=str,
)
def test_rules_under_other_norms_stay_whole(change: dict[str, str]) -> None:
    whole = system(
        And(
            (
                Or((Proposition("a", ("low",)), Proposition("b", ("low",)))),
                Proposition("c", ("high",)),
            )
        )
    )
    block = replace(whole.blocks[0], **change)
    assert split(block.rules[0], block, whole) == (block.rules[0],)
    assert len(split(whole.rules[0], whole.blocks[0], whole)) == 2


def test_too_many_alternatives_are_not_made() -> None:
    pair = Or((Proposition("a", ("low",)), Proposition("b", ("low",))))
    many = And((pair,) * 40)
    assert len(alternatives(many)) == MOST_RULES + 1
    whole = system(many)
    assert split(whole.rules[0], whole.blocks[0], whole) == (whole.rules[0],)
