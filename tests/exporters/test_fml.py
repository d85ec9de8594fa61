"""FML: written files are read back alike, and every loss is reported."""

from __future__ import annotations

import random
from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.fml import write
from fuzzytree.exporters.table import find_format
from fuzzytree.formats.fml.fml_reader import read_fml
from fuzzytree.formats.fml.fml_words import FML_FAR, MODIFIERS, USUAL
from fuzzytree.model import (
    And,
    Conclusion,
    Condition,
    Curve,
    Defuzzifier,
    FuzzySystem,
    Gaussian,
    Hedge,
    Kind,
    Linear,
    Not,
    Or,
    Points,
    Proposition,
    Rule,
    RuleBlock,
    SCurve,
    Singleton,
    SystemOutput,
    SystemRule,
    Term,
    TNorm,
    Trapezoid,
    TwoGaussians,
    Variable,
)
from fuzzytree.semantics import canonical_form, pointed
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree


def random_curve(chance: random.Random) -> Curve:
    a, b, c, d = sorted(chance.uniform(-5.0, 5.0) for _ in range(4))
    curves: Sequence[Curve] = (
        Trapezoid(a, b, c, d),
        Trapezoid(a, b, b, d),
        Trapezoid(b, b, c, c),
        Trapezoid(None, b, b, c),
        Trapezoid(a, b, b, None),
        Points((a, b, b, d), (0.0, 0.25, 1.0, 0.5)),
        Points((a, b), (0.0, 1.0)),
        Gaussian(a, d - a),
        TwoGaussians(a, 1.5, FML_FAR, 1.0),
        TwoGaussians(-FML_FAR, 1.0, c, 0.25),
        SCurve(a, b),
        SCurve(d, c),
        Singleton(c),
    )
    return chance.choice(curves)


def random_fml(seed: int) -> FuzzySystem:
    """Return a system that FML can hold."""
    chance = random.Random(seed)
    kind = chance.choice(("mamdani", "tsk", "tsukamoto"))
    inputs = tuple(
        Variable(
            f"x{k}",
            tuple(Term(f"t{n}", random_curve(chance)) for n in range(3)),
            low=-5.0,
            high=5.0,
            unit="mm & <",
        )
        for k in range(3)
    )
    numbers: dict[str, tuple[Curve, ...]] = {
        "mamdani": tuple(random_curve(chance) for _ in range(3)),
        "tsk": (Singleton(0.1), Linear((1.0, -2.0, 0.3), 1e-9), Singleton(1e-300)),
        "tsukamoto": (
            Points((0.0, 2.0), (0.0, 1.0)),
            SCurve(0.0, 4.0),
            SCurve(4.0, 1.0),
        ),
    }
    is_mamdani = kind == "mamdani"
    output = SystemOutput(
        "y",
        tuple(Term(f"t{n}", curve) for n, curve in enumerate(numbers[kind])),
        -5.0,
        5.0,
        USUAL if is_mamdani else Defuzzifier("weighted average"),
        "maximum" if is_mamdani else None,
        chance.choice((None, 0.25, 0.0)),
    )
    norms: tuple[TNorm, TNorm] = ("minimum", "product")
    block = RuleBlock(
        tuple(_random_rule(chance) for _ in range(6)),
        chance.choice(norms),
        "maximum",
        chance.choice(norms) if is_mamdani else None,
    )
    return FuzzySystem("s", inputs, (output,), (block,))


def _random_rule(chance: random.Random) -> SystemRule:
    known: Sequence[tuple[Hedge, ...]] = (
        (),
        (),
        *((hedge,) for hedge in MODIFIERS.values() if hedge != "any"),
    )

    def part(variable: str) -> Condition:
        if chance.random() < 0.3:
            kind = chance.choice((And, Or))
            several = kind(tuple(Proposition(variable, (f"t{n}",)) for n in range(3)))
            return several if chance.random() < 0.5 else Not(several)
        return Proposition(variable, (f"t{chance.randrange(3)}",), chance.choice(known))

    parts = [part(f"x{k}") for k in range(3) if chance.random() < 0.7]
    parts = parts or [Proposition("x0", (), ("any",))]
    when = parts[0] if len(parts) == 1 else chance.choice((And, Or))(tuple(parts))
    then = (Conclusion("y", f"t{chance.randrange(3)}"),)
    return SystemRule(when, then, chance.choice((1.0, 0.3)))


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(60))
def test_a_system_is_read_back_alike(seed: int) -> None:
    system = random_fml(seed)
    written = write(system)
    assert written.losses == ()
    found = read_fml(written.content, "s.fml")
    assert found.losses == ()
    assert canonical_form(found.model) == canonical_form(system)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_rules_of_points_are_read_back_equal(seed: int, kind: Kind) -> None:
    tree = random_tree(seed, combinations=0.0)
    rules, _ = pointed(rules_from_tree(tree, kind), 1e-3)
    written = write(rules)
    assert written.losses == ()
    assert read_fml(written.content, "r.fml").model == rules


def test_product_and_negated_clauses_are_read_back_equal() -> None:
    rules, _ = pointed(rules_from_tree(random_tree(3, combinations=0.0)), 1e-2)
    terms = tuple(term.name for term in rules.variables[0].terms)
    clause = Proposition(rules.variables[0].name, terms, hedges=("not",))
    other = replace(
        rules,
        semantics=replace(rules.semantics, conjunction="product"),
        rules=(*rules.rules, Rule((clause,), rules.classes[0])),
    )
    assert read_fml(write(other).content, "r.fml").model == other


def test_every_line_of_a_small_file() -> None:
    low = Term("low", Trapezoid(0.0, 1.0, 1.0, 2.5))
    system = FuzzySystem(
        "tip",
        (Variable("food", (low,), low=0.0, high=10.0),),
        (
            SystemOutput(
                "tip %",
                (Term("small", Singleton(0.1)),),
                None,
                None,
                Defuzzifier("weighted average"),
            ),
        ),
        (
            RuleBlock(
                (
                    SystemRule(
                        Proposition("food", ("low",), ("very",)),
                        (Conclusion("tip %", "small"),),
                    ),
                )
            ),
        ),
    )
    written = write(system)
    assert written.remarks[1:] == (
        "names were changed: 'tip %' is tip, 'tip' is tip_2",
    )
    assert "6e-8" in written.remarks[0]
    assert written.content.decode().splitlines() == [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<fuzzySystem xmlns="http://www.ieee1855.org" name="tip_2">',
        "  <knowledgeBase>",
        '    <fuzzyVariable name="food" domainleft="0.0" domainright="10.0" '
        'type="input">',
        '      <fuzzyTerm name="food.low">',
        '        <triangularShape param1="0.0" param2="1.0" param3="2.5"/>',
        "      </fuzzyTerm>",
        "    </fuzzyVariable>",
        '    <tskVariable name="tip" type="output" combination="WA" '
        'defaultValue="NaN">',
        '      <tskTerm name="tip.small" order="0">',
        "        <tskValue>0.1</tskValue>",
        "      </tskTerm>",
        "    </tskVariable>",
        "  </knowledgeBase>",
        '  <tskRuleBase name="rules.1." andMethod="MIN" orMethod="MAX">',
        '    <tskRule name="rule.1." andMethod="MIN" orMethod="MAX" connector="and" '
        'weight="1.0">',
        "      <antecedent>",
        '        <clause modifier="very">',
        "          <variable>food</variable>",
        "          <term>food.low</term>",
        "        </clause>",
        "      </antecedent>",
        "      <tskConsequent>",
        "        <tskThen>",
        "          <tskClause>",
        "            <variable>tip</variable>",
        "            <term>tip.small</term>",
        "          </tskClause>",
        "        </tskThen>",
        "      </tskConsequent>",
        "    </tskRule>",
        "  </tskRuleBase>",
        "</fuzzySystem>",
    ]


@pytest.mark.parametrize(
    ("rule", "reason"),
    [
        (
            SystemRule(None, (Conclusion("y", "t0"),)),
            "rule 1: it has no condition, and a rule of FML must have one",
        ),
        (
            SystemRule(
                Proposition("x0", ("t0",), ("very", "very")), (Conclusion("y", "t0"),)
            ),
            "rule 1: FML has no way to say 'very very'",
        ),
        (
            SystemRule(
                Or(
                    (
                        And((Proposition("x0", ("t0",)), Proposition("x1", ("t0",)))),
                        Proposition("x2", ("t0",)),
                    )
                ),
                (Conclusion("y", "t0"),),
            ),
            "rule 1: it mixes and, or and not over several inputs",
        ),
        (
            SystemRule(Proposition("x0", ("t0",)), (Conclusion("y", "t0", ("very",)),)),
            "rule 1: FML has no hedges of conclusions",
        ),
    ],
)
def test_a_rule_without_a_place_in_fml_is_refused(
    rule: SystemRule, reason: str
) -> None:
    system = random_fml(1)
    system = replace(system, blocks=(replace(system.blocks[0], rules=(rule,)),))
    with pytest.raises(LossError) as caught:
        write(system, allow_loss=True)
    assert str(caught.value) == f"cannot write s as fml:\n  {reason}"


@pytest.mark.heavy
def test_curves_that_fml_lacks_become_points_with_a_bound() -> None:
    rules = rules_from_tree(random_tree(0, combinations=0.0), "raw")
    with pytest.raises(LossError, match="cannot write random 7 as fml without loss"):
        write(rules)
    written = write(rules, allow_loss=True, tolerance=1e-3)
    assert all(loss.bound is not None and loss.bound <= 1e-3 for loss in written.losses)


def test_the_same_model_gives_the_same_bytes() -> None:
    assert write(random_fml(2)) == write(random_fml(2))


def test_fml_is_in_the_table_of_formats() -> None:
    assert find_format(".fml").read is not None


@pytest.mark.parametrize("seed", range(6))
def test_rules_with_combinations_are_read_back_equal_where_facts_are_there(
    seed: int,
) -> None:
    rules, _ = pointed(rules_from_tree(random_tree(seed, combinations=1.0)), 1e-3)
    assert any(variable.parts for variable in rules.variables)
    written = write(rules, allow_loss=True)
    assert all(loss.where.startswith("combination ") for loss in written.losses)
    assert read_fml(written.content, "r.fml").model == rules


def test_a_rule_that_mixes_and_and_or_becomes_several_under_maximum() -> None:
    system = next(
        one
        for one in map(random_fml, range(20))
        if one.blocks[0].implication and one.blocks[0].conjunction == "minimum"
    )
    mixed = And(
        (
            Or((Proposition("x0", ("t0",)), Proposition("x1", ("t0",)))),
            Proposition("x2", ("t0",)),
        )
    )
    rule = SystemRule(mixed, (Conclusion("y", "t0"),))
    system = replace(system, blocks=(replace(system.blocks[0], rules=(rule,)),))
    with pytest.raises(LossError, match="rule 1: it is 2 rules, joined by maximum"):
        write(system)
    again = read_fml(write(system, allow_loss=True).content, "s.fml").model
    assert isinstance(again, FuzzySystem)
    assert [one.when for one in again.rules] == [
        And((Proposition("x0", ("t0",)), Proposition("x2", ("t0",)))),
        And((Proposition("x1", ("t0",)), Proposition("x2", ("t0",)))),
    ]
