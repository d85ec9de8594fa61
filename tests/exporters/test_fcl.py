"""Rule bases and systems as FCL files."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Iterator
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.exporters.fcl import check_list, write
from fuzzytree.exporters.fcl_dialects import WORDS, Dialect
from fuzzytree.formats.fcl.fcl_reader import read_fcl
from fuzzytree.model import (
    And,
    Condition,
    Defuzzifier,
    FuzzySystem,
    Not,
    Or,
    Proposition,
    RuleBlock,
)
from fuzzytree.model.rulebase import Points, RuleBase
from fuzzytree.semantics import as_system, flattened
from fuzzytree.semantics.conversion.scores import winner
from fuzzytree.semantics.inference import infer, input_values
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.random_systems import random_rows, random_system
from fuzzytree.semantics.reference import evaluate
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_tree, with_points
from tests.exporters.fcl_systems import tamed

DIALECTS: tuple[Dialect, ...] = get_args(Dialect)
SAMPLES = {
    name: model
    for name, model in all_samples().items()
    if isinstance(model, FuzzySystem)
}


def _sample(name: str) -> FuzzySystem:
    return SAMPLES[name]


def _with_default(system: FuzzySystem) -> FuzzySystem:
    outputs = tuple(replace(one, default=0.25) for one in system.outputs)
    return replace(system, outputs=outputs)


def _text(model: RuleBase | FuzzySystem, dialect: Dialect = "portable") -> str:
    return write(model, dialect=dialect).content.decode()


def test_a_portable_file_has_one_statement_per_line_and_one_conclusion_per_rule() -> (
    None
):
    assert (
        _text(_with_default(_sample("Sugeno, numbers")))
        == """\
// FCL, dialect portable
// Written by fuzzytree.
FUNCTION_BLOCK fan_2
VAR_INPUT
  heat : REAL;
  damp : REAL;
END_VAR
VAR_OUTPUT
  fan : REAL;
END_VAR
FUZZIFY heat
  TERM low := (2.0, 1.0) (6.0, 0.0);
  TERM high := (4.0, 0.0) (8.0, 1.0);
END_FUZZIFY
FUZZIFY damp
  TERM dry := (2.0, 1.0) (6.0, 0.0);
  TERM wet := (4.0, 0.0) (8.0, 1.0);
END_FUZZIFY
DEFUZZIFY fan
  TERM slow := 1.0;
  TERM fast := 3.5;
  METHOD : COGS;
  DEFAULT := 0.25;
  RANGE := (0.0 .. 5.0);
END_DEFUZZIFY
RULEBLOCK block_1
  AND : MIN;
  RULE 1 : if heat is low and damp is dry then fan is slow;
  RULE 2 : if heat is high then fan is fast;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
    )


@pytest.mark.heavy
@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.sampled_from(DIALECTS))
def test_reading_gives_the_equal_rule_base(seed: int, dialect: Dialect) -> None:
    tree = random_tree(seed, leaves=5, combinations=0.0)
    rules = with_points(rules_from_tree(tree), seed, share=1.0)
    written = write(rules, dialect=dialect, allow_loss=True)
    assert read_fcl(written.content, "x.fcl").model == rules


@pytest.mark.one_in(6)
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("kind", ["relative", "raw"])
def test_the_scores_of_a_file_decide_as_the_rules_do(
    dialect: Dialect, kind: str
) -> None:
    for seed in range(3):
        tree = random_tree(seed, leaves=5)
        rules = rules_from_tree(tree, "relative" if kind == "relative" else "raw")
        content = write(rules, dialect=dialect, allow_loss=True, tolerance=1e-3).content
        plain = re.sub(rb"(//|\(\*) facts [^\n]*\n", b"", content)
        system = read_fcl(plain, "x.fcl").model
        assert isinstance(system, FuzzySystem)
        chance = random.Random(seed)
        for _ in range(40):
            row = {name: chance.uniform(-3.0, 3.0) for name in rules.inputs}
            expected = evaluate(rules, row)
            values = input_values(as_system(rules).variables, row)
            flat = flattened(as_system(rules))[0]
            given = [values[name] for name in flat.inputs]
            named = dict(zip(system.inputs, given, strict=True))
            answer = winner(rules, infer(system, named).outputs)
            if kind == "relative":
                assert answer == expected.label
            else:
                best = sorted(expected.strengths)[-2:]
                assert answer == expected.label or best[1] - best[0] < 2e-3 * len(
                    rules.variables
                )


def _plain(system: FuzzySystem) -> FuzzySystem:
    """Return a system without what no answer depends on and FCL has no place for."""
    blocks = tuple(_plain_block(one) for one in system.blocks)
    inputs = tuple(replace(one, unit="") for one in system.variables)
    outputs = tuple(replace(one, unit="") for one in system.outputs)
    return replace(system, variables=inputs, outputs=outputs, blocks=blocks, note="")


def _plain_block(block: RuleBlock) -> RuleBlock:
    kinds = {kind for rule in block.rules for kind in _kinds(rule.when)}
    return replace(
        block,
        name="",
        conjunction=block.conjunction if And in kinds else None,
        disjunction=block.disjunction if Or in kinds else None,
        implication=None,
        rules=tuple(replace(rule, name="") for rule in block.rules),
    )


def _kinds(condition: Condition | None) -> Iterator[type]:
    match condition:
        case And(parts=parts) | Or(parts=parts):
            yield type(condition)
            for part in parts:
                yield from _kinds(part)
        case Not(part=part):
            yield from _kinds(part)
        case _:
            return


@pytest.mark.one_in(8)
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", SAMPLES)
def test_a_file_without_losses_reads_as_a_system_of_equal_answers(
    name: str, dialect: Dialect
) -> None:
    system = SAMPLES[name]
    try:
        written = write(system, dialect=dialect)
    except LossError:
        return  # what it says is tested below
    again = read_fcl(written.content, "x.fcl").model
    assert isinstance(again, FuzzySystem)
    for row in random_rows(system, 1, 30):
        ours = infer(system, row).outputs
        named = dict(zip(again.inputs, row.values(), strict=True))
        theirs = infer(again, named).outputs
        assert all(
            a == b or (math.isnan(a) and math.isnan(b))
            for a, b in zip(ours, theirs, strict=True)
        )


@pytest.mark.one_in(4)
@pytest.mark.parametrize("dialect", DIALECTS)
def test_random_systems_are_written_alike_or_refused_with_reasons(
    dialect: Dialect,
) -> None:
    exact = 0
    for seed in range(100 if dialect == "fuzzylite" else 25):
        system = tamed(random_system(seed, formulas="none"), dialect)
        content = _content(system, dialect)
        if content is None:
            continue
        exact += 1
        again = read_fcl(content, "x.fcl").model
        assert isinstance(again, FuzzySystem)
        for row in random_rows(system, seed, 5):
            named = dict(zip(again.inputs, row.values(), strict=True))
            ours, theirs = infer(system, row).outputs, infer(again, named).outputs
            for a, b in zip(ours, theirs, strict=True):
                assert a == pytest.approx(b, rel=1e-12, nan_ok=True)
    assert exact >= (10 if dialect == "fuzzylite" else 0)


def _content(system: FuzzySystem, dialect: Dialect) -> bytes | None:
    """Return a file; None if something would be lost."""
    try:
        return write(system, dialect=dialect, tolerance=0.2).content
    except LossError:
        return None


def test_a_system_that_the_dialect_can_hold_reads_equal() -> None:
    for name in ("Sugeno, numbers", "OR", "weights of rules", "several outputs"):
        system = _sample(name)
        again = read_fcl(write(system, dialect="fuzzylite").content, "x.fcl").model
        assert isinstance(again, FuzzySystem)
        assert _plain(replace(again, name=system.name)) == _plain(system)


def test_the_same_model_gives_the_same_bytes() -> None:
    rules = rules_from_tree(random_tree(3))
    one, two = (write(rules, allow_loss=True).content for _ in range(2))
    assert one == two


@pytest.mark.parametrize("dialect", DIALECTS)
def test_numbers_have_digits_on_both_sides_of_the_point(dialect: Dialect) -> None:
    rules = rules_from_tree(random_tree(5))
    text = write(rules, dialect=dialect, allow_loss=True).content.decode()
    lines = [line for line in text.splitlines() if "facts" not in line]
    body = "\n".join(lines)
    assert not re.search(r"(?<![\d.])\.\d|\d\.(?![\d.])|inf|nan(?!;)", body)


def test_a_portable_file_refuses_curves_of_outputs_with_the_reason() -> None:
    with pytest.raises(LossError, match="read no file with curves of outputs alike"):
        write(_sample("Mamdani, centroid"), allow_loss=True)


def test_another_number_of_samples_is_a_loss() -> None:
    with pytest.raises(LossError) as caught:
        write(_sample("number of samples"), dialect="fuzzylite")
    assert str(caught.value) == (
        "cannot write fan as fcl (fuzzylite) without loss:\n"
        "  output 'fan': its curve is sampled at 777 values (middle), and FCL does not "
        "say so; fuzzylite takes 100 (middle)\n"
        "  pass allow_loss=True to write it as stated"
    )


def test_low_ends_of_pieces_are_jfuzzylogics_and_stay_so() -> None:
    system = _sample("samples at low ends")
    assert isinstance(system, FuzzySystem)
    system = replace(system, outputs=(replace(system.outputs[0], default=0.0),))
    content = write(system, dialect="jfuzzylogic").content
    again = read_fcl(content, "x.fcl").model
    assert isinstance(again, FuzzySystem)
    assert again.outputs == system.outputs
    middle = Defuzzifier("centroid", 1000)
    system = replace(system, outputs=(replace(system.outputs[0], defuzzifier=middle),))
    with pytest.raises(LossError) as caught:
        write(system, dialect="jfuzzylogic")
    assert str(caught.value) == (
        "cannot write fan as fcl (jfuzzylogic) without loss:\n"
        "  output 'fan': its curve is sampled at 1000 values (middle), and FCL does "
        "not say so; jfuzzylogic takes 1000 (low ends), each half a piece (0.0025) "
        "lower\n  pass allow_loss=True to write it as stated"
    )


def test_the_strongest_rule_alone_is_refused() -> None:
    rules = rules_from_tree(random_tree(1))
    with pytest.raises(LossError, match="pass scores=rule"):
        write(rules, scores="winner", allow_loss=True)
    with pytest.raises(LossError, match="FCL activates all rules"):
        write(_sample("the highest rule alone"), allow_loss=True)


@pytest.mark.parametrize("dialect", ["fuzzylite", "jfuzzylogic"])
def test_scores_of_classes_join_rules_by_or(dialect: Dialect) -> None:
    rules = rules_from_tree(random_tree(2, leaves=6, combinations=0.0))
    rules = with_points(rules, 0, share=1.0)
    written = write(rules, dialect=dialect, scores="class", allow_loss=True)
    assert read_fcl(written.content, "x.fcl").model == rules


@pytest.mark.parametrize("dialect", ["portable", "iec", "jfuzzylogic"])
def test_an_and_within_an_or_has_parentheses_for_those_who_read_from_the_left(
    dialect: Dialect,
) -> None:
    text = _text(_with_default(_sample("OR")), dialect).upper()
    assert "IF (HEAT IS LOW AND DAMP IS DRY) OR HEAT IS HIGH THEN" in text


def test_a_question_for_any_has_no_place_but_in_fuzzylite() -> None:
    system = _with_default(_sample("Sugeno, numbers"))
    (block,) = system.blocks
    rules = tuple(
        replace(one, when=Proposition("heat", (), ("any",))) for one in block.rules
    )
    made = replace(system, blocks=(replace(block, rules=rules),))
    assert "if heat is any then" in _text(made, "fuzzylite")
    with pytest.raises(LossError, match="the dialect jfuzzylogic has no 'any'"):
        write(made, dialect="jfuzzylogic", allow_loss=True)


def test_rules_of_one_number_are_one_only_if_they_ask_the_same() -> None:
    text = _text(_with_default(_sample("Sugeno, numbers")))
    again = read_fcl(text.replace("RULE 2 :", "RULE 1 :").encode(), "x.fcl").model
    assert isinstance(again, FuzzySystem)
    assert len(again.rules) == 2


def test_several_accus_in_one_block_are_a_loss() -> None:
    system = _with_default(_sample("several outputs"))
    first, second = system.outputs
    how = Defuzzifier("centroid", 1000)
    labels = tuple(
        replace(label, function=Points((0.0, 1.0), (0.0, 1.0))) for label in first.terms
    )
    outputs = replace(
        first, defuzzifier=how, terms=labels, aggregation="maximum", low=0.0
    )
    outputs = replace(outputs, high=9.0)
    others = replace(
        second,
        defuzzifier=how,
        aggregation="bounded sum",
        low=0.0,
        high=9.0,
        terms=tuple(
            replace(one, function=Points((0.0, 1.0), (0.0, 1.0)))
            for one in second.terms
        ),
    )
    blocks = tuple(replace(one, implication="minimum") for one in system.blocks)
    made = replace(system, outputs=(outputs, others), blocks=blocks)
    with pytest.raises(
        LossError, match=r"joined by .maximum., and not by .bounded sum"
    ):
        write(made, dialect="jfuzzylogic")


def test_numbers_that_an_accu_of_others_would_join_are_a_loss() -> None:
    system = _with_default(_sample("several outputs"))
    first, second = system.outputs
    outputs = (replace(first, aggregation="maximum"), second)
    (block,) = system.blocks
    twice = replace(block, rules=(*block.rules, *block.rules))
    made = replace(system, outputs=outputs, blocks=(twice,))
    with pytest.raises(LossError, match=r"joined by .maximum', and not one by one"):
        write(made, dialect="jfuzzylogic")


def test_names_avoid_the_words_of_every_dialect() -> None:
    system = _with_default(_sample("Sugeno, numbers"))
    first, second = system.variables
    renamed = (replace(first, name="sum"), replace(second, name="Größe (mm)"))

    def changed(condition: Condition | None) -> Condition | None:
        names = {first.name: "sum", second.name: "Größe (mm)"}
        match condition:
            case Proposition(variable=variable):
                return replace(condition, variable=names[variable])
            case And(parts=parts):
                found = [changed(part) for part in parts]
                return And(tuple(one for one in found if one is not None))
            case _:
                return condition

    blocks = tuple(
        replace(
            block,
            rules=tuple(replace(one, when=changed(one.when)) for one in block.rules),
        )
        for block in system.blocks
    )
    written = write(replace(system, variables=renamed, blocks=blocks))
    again = read_fcl(written.content, "x.fcl").model
    assert isinstance(again, FuzzySystem)
    assert again.inputs == ("sum_", "Grosse_mm")
    assert any("'sum' is sum_" in one for one in written.remarks)


def test_facts_that_belong_to_other_rules_change_nothing() -> None:
    rules = with_points(
        rules_from_tree(random_tree(1, leaves=3, combinations=0.0)), 0, share=1.0
    )
    text = write(rules).content.decode()
    with_number = re.sub(r"TERM present := 1.0", "TERM present := 2.0", text, count=1)
    reading = read_fcl(with_number.encode(), "x.fcl")
    assert isinstance(reading.model, FuzzySystem)
    assert any("belong to other rules" in one for one in reading.remarks)


def test_the_check_list_reports_the_class_of_conformance() -> None:
    basic = _with_default(_sample("Sugeno, numbers"))
    outputs = tuple(replace(one, aggregation="maximum") for one in basic.outputs)
    edge = Points((0.0, 1.0), (0.0, 1.0))
    inputs = tuple(
        replace(one, terms=tuple(replace(label, function=edge) for label in one.terms))
        for one in basic.variables
    )
    basic = replace(basic, variables=inputs, outputs=outputs)
    assert check_list(basic).splitlines()[0] == "data check list (IEC 61131-7)"
    assert "class: Basic" in check_list(basic)
    assert "operators: AND minimum, ACCU maximum\n" in check_list(basic)
    rules = with_points(rules_from_tree(random_tree(1)), 0, share=1.0)
    assert "points of degrees between 0 and 1" in check_list(rules)
    mamdani = _sample("Mamdani, centroid")
    assert re.search("class: (Extension|Open), for ", check_list(mamdani))


def test_the_check_list_stands_in_a_comment_on_request() -> None:
    system = _with_default(_sample("Sugeno, numbers"))
    text = write(system, checklist=True).content.decode()
    assert "// data check list (IEC 61131-7)\n// inputs: 2\n" in text
    plain = write(system).content.decode()
    assert read_fcl(text.encode(), "x").model == read_fcl(plain.encode(), "x").model


def test_every_dialect_has_its_words() -> None:
    assert set(WORDS) == set(DIALECTS)
    assert all(words.name == name for name, words in WORDS.items())


@pytest.mark.heavy
def test_a_system_with_terms_that_no_points_stand_for_is_refused_with_each() -> None:
    with pytest.raises(LossError, match="term 'medium' of 'y2': it is a formula"):
        write(random_system(0), allow_loss=True)
