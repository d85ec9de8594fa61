"""Programs of rule bases: their bits are those of the reference."""

import math
from itertools import pairwise

import pytest
from msgspec.structs import replace

from fuzzytree.model.rulebase import (
    Points,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.programs.evaluate import evaluate_program
from fuzzytree.semantics.programs.rule_program import from_rules
from fuzzytree.semantics.reference import evaluate as refer
from fuzzytree.testing import probes, random_tree, with_points


def bases(seed: int) -> list[RuleBase]:
    tree = random_tree(seed, leaves=5 + seed % 7)
    raw = rules_from_tree(tree, "raw", conjunction="product")
    relative = rules_from_tree(tree)
    answers = Semantics("product", uncovered="class 1", missing="class 2")
    pointed = replace(with_points(relative, seed), semantics=answers)
    return [relative, raw, pointed, replace(with_points(raw, seed + 1), name="other")]


def assert_equal(rules: RuleBase, rows: list[dict[str, float]]) -> None:
    program = from_rules(rules)
    for row in rows:
        found, right = evaluate_program(program, row), refer(rules, row)
        pairs = zip(found.of("strength"), right.strengths, strict=True)
        for one, two in pairs:
            assert one == two or (math.isnan(one) and math.isnan(two)), row
        assert found.of("rule") == (right.rule,)
        assert found.of("status") == (right.status,)
        label = -1 if right.label is None else rules.classes.index(right.label)
        assert found.of("class") == (label,)


@pytest.mark.one_in(6)
@pytest.mark.parametrize("seed", range(6))
def test_strengths_rule_status_and_class_are_those_of_the_reference(seed: int) -> None:
    for rules in bases(seed):
        assert_equal(rules, probes(rules, limit=220, seed=seed))


def test_a_rule_without_a_proposition_always_holds() -> None:
    rules = RuleBase("one", ("a",), (), (Rule((), "a"), Rule((), "a")))
    found = evaluate_program(from_rules(rules), {})
    assert found.of("strength") == (1.0, 1.0)
    assert (found.of("rule"), found.of("status")) == ((1.0,), (1.0,))


@pytest.mark.parametrize(
    ("values", "degrees"),
    [
        ((0.1, 0.7), (0.0, 1.0)),
        ((0.1, 0.7), (1.0, 0.0)),
        ((0.1, 0.3, 0.7), (0.0, 1.0, 0.0)),
        ((0.1, 0.3, 0.7, 1.1), (0.0, 1.0, 1.0, 0.0)),
        ((0.1, 0.3, 0.7, 1.1), (0.0, 1.0, 1.0, 0.3)),
        ((0.1, 0.3, 0.7, 1.1), (0.2, 0.2, 0.9, 0.0)),
        ((0.1, 0.1, 0.7), (0.0, 1.0, 0.0)),
        ((0.1, 0.7, 0.7), (0.0, 1.0, 0.0)),
        ((0.0, 5e-324, 1e-310), (0.0, 1.0, 0.0)),
        ((0.1, 0.3), (0.3, 0.9)),
        ((0.5,), (0.7,)),
        (tuple(k * 0.1 for k in range(12)), tuple((k % 4) / 3 for k in range(12))),
    ],
)
def test_points_have_the_bits_of_the_reference(
    values: tuple[float, ...], degrees: tuple[float, ...]
) -> None:
    rules = RuleBase(
        "points",
        ("a",),
        (Variable("x", (Term("in", Points(values, degrees)),)),),
        (Rule((Proposition("x", ("in",)),), "a"),),
    )
    assert_equal(rules, probes(rules, limit=400))
    inner = [a + (b - a) * k / 97 for a, b in pairwise(values) for k in range(98)]
    assert_equal(rules, [{"x": value} for value in inner if math.isfinite(value)])
