"""Models that are equal but for names, units and notes have the same canonical form."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fuzzytree.model import (
    Conclusion,
    Defuzzifier,
    Document,
    FuzzySystem,
    Hedge,
    Points,
    Proposition,
    Rule,
    RuleBase,
    RuleBlock,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
)
from fuzzytree.semantics import canonical_form
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.random_systems import random_system
from fuzzytree.testing import random_tree


@pytest.mark.parametrize("seed", range(5))
def test_every_kind_of_model_can_be_made_anonymous_twice(seed: int) -> None:
    tree = random_tree(seed)
    models: list[Document] = [tree, rules_from_tree(tree), random_system(seed)]
    for model in models:
        once = canonical_form(model)
        assert canonical_form(once) == once
        assert type(once) is type(model)


def test_a_rule_base_with_other_names_is_equal_to_it() -> None:
    rules = rules_from_tree(random_tree(2))

    def other(name: str) -> str:
        return f"another {name}"

    renamed = replace(
        rules,
        name="another",
        classes=tuple(map(other, rules.classes)),
        variables=tuple(
            Variable(
                other(v.name),
                tuple(Term(other(t.name), t.shape) for t in v.terms),
                "mm",
                parts=tuple(replace(p, input=other(p.input)) for p in v.parts),
            )
            for v in rules.variables
        ),
        rules=tuple(
            Rule(
                tuple(
                    Proposition(other(c.variable), tuple(map(other, c.terms)), c.hedges)
                    for c in rule.when
                ),
                other(rule.then),
            )
            for rule in rules.rules
        ),
        columns=(),
    )
    assert canonical_form(renamed) == canonical_form(rules)


def test_rules_in_another_order_are_not_equal() -> None:
    rules = rules_from_tree(random_tree(2))
    turned = replace(rules, rules=rules.rules[::-1])
    assert canonical_form(turned) != canonical_form(rules)


def _system(**changes: object) -> FuzzySystem:
    output = SystemOutput(
        "y",
        (Term("one", Singleton(1.0)),),
        0.0,
        2.0,
        Defuzzifier("weighted average"),
    )
    rule = SystemRule(None, (Conclusion("y", "one"),))
    system = FuzzySystem("s", (Variable("x"),), (output,), (RuleBlock((rule,)),))
    return replace(system, outputs=(replace(output, **changes),))


def test_what_no_number_depends_on_is_left_out() -> None:
    plain = canonical_form(_system())
    assert canonical_form(_system(low=-5.0, unit="V")) == plain
    how = Defuzzifier("weighted average", samples=7, grid="ends")
    assert canonical_form(_system(defuzzifier=how)) == plain


@pytest.mark.parametrize(
    "changes",
    [
        {"default": 0.5},
        {"clips": True},
        {"aggregation": "maximum"},
        {"defuzzifier": Defuzzifier("weighted sum")},
        {"terms": (Term("one", Singleton(1.5)),)},
        {"terms": (Term("one", Singleton(1.0), height=0.5),)},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_what_a_number_depends_on_stays(changes: dict[str, object]) -> None:
    assert canonical_form(_system(**changes)) != canonical_form(_system())


def test_the_range_of_an_output_that_is_clipped_stays() -> None:
    assert canonical_form(_system(clips=True, low=0.5)) != canonical_form(
        _system(clips=True)
    )


def test_very_very_is_very_twice() -> None:
    def asking(*hedges: Hedge) -> FuzzySystem:
        ramp = Term("low", Points((0.0, 1.0), (0.0, 1.0)))
        rule = SystemRule(Proposition("x", ("low",), hedges), (Conclusion("y", "one"),))
        return replace(
            _system(), variables=(Variable("x", (ramp,)),), blocks=(RuleBlock((rule,)),)
        )

    assert canonical_form(asking("very very")) == canonical_form(asking("very", "very"))
    assert canonical_form(asking("very very")) != canonical_form(asking("very"))


def test_a_rule_base_is_not_its_tree() -> None:
    tree = random_tree(1)
    assert isinstance(rules_from_tree(tree), RuleBase)
    assert canonical_form(tree) != canonical_form(rules_from_tree(tree))
