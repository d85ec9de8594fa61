"""Rules and terms are found in files, and ids say what they are about."""

from __future__ import annotations

from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.auditing.decide.states import Proved, Span
from fuzzytree.auditing.findings.audit import audit
from fuzzytree.auditing.findings.locations import (
    ModelFile,
    locations_of,
    model_file,
    term_path,
    with_ids,
)
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSelection,
    FileLocation,
    TermName,
)
from fuzzytree.auditing.findings.subject import Material
from fuzzytree.checking.converting import format_of, read_content
from fuzzytree.model import FuzzySystem
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.report.audit import audit_lines
from fuzzytree.testing import random_system, random_tree


def written(model: Document) -> ModelFile:
    """Return a model's YAML file."""
    return model_file("model.yaml", ft.export(model, "yaml").content)


def text_at(file: ModelFile, place: FileLocation | None) -> str:
    """Return what begins at a place."""
    assert place is not None
    line = file.content.decode().split("\n")[place.line - 1]
    return line[place.column - 1 :]


@pytest.mark.parametrize("seed", range(5))
def test_each_rule_and_term_of_a_rule_base_is_found(seed: int) -> None:
    rules = ft.rules_from_tree(random_tree(seed))
    file = written(rules)
    for number in range(1, len(rules.rules) + 1):
        found = text_at(file, file.place(rules.rule_path(number)))
        assert found.lstrip("{").startswith("if:")
    check_terms(rules, file)


@pytest.mark.parametrize("seed", range(5))
def test_each_leaf_and_term_of_a_tree_is_found(seed: int) -> None:
    tree = random_tree(seed)
    file = written(tree)
    for number in range(1, len(tree.leaves) + 1):
        found = text_at(file, file.place(tree.rule_path(number)))
        assert found.lstrip("{").startswith(f"leaf: {number}")
    check_terms(tree, file)
    for group in tree.sets:
        for term in group.terms:
            path = term_path(tree, TermName(group.variable, term.name))
            assert path[0] == "sets"
            assert "name:" in text_at(file, file.place(path))


def check_terms(model: RuleBase | FuzzyTree, file: ModelFile) -> None:
    """Find every term's name where it is said to be."""
    for variable in model.variables:
        for term in variable.terms:
            path = term_path(model, TermName(variable.name, term.name))
            assert path[:1] == ("variables",)
            assert "name:" in text_at(file, file.place(path))


@pytest.mark.parametrize("seed", range(5))
def test_each_rule_of_a_system_is_found_over_all_blocks(seed: int) -> None:
    system: FuzzySystem = random_system(seed)
    file = written(system)
    lines = set[int]()
    for number in range(1, len(system.rules) + 1):
        place = file.place(system.rule_path(number))
        assert place is not None
        lines.add(place.line)
        assert text_at(file, place).lstrip("{").startswith(("name:", "if:"))
    assert len(lines) == len(system.rules)


@pytest.mark.parametrize("seed", range(5))
def test_each_label_of_a_system_is_found(seed: int) -> None:
    system: FuzzySystem = random_system(seed)
    file = written(system)
    for one in system.all_variables:
        for label in one.terms:
            path = term_path(system, TermName(one.name, label.name))
            assert "name:" in text_at(file, file.place(path))


def test_a_rule_of_another_format_has_its_place() -> None:
    rules = ft.rules_from_tree(random_tree(1))
    file = model_file("rules.fll", ft.export(rules, "fll", allow_loss=True).content)
    for number in range(1, len(rules.rules) + 1):
        assert text_at(file, file.place(rules.rule_path(number))).startswith("if ")


def test_a_file_that_is_written_for_others_has_no_places() -> None:
    content = ft.export(random_tree(1), "onnx", allow_loss=True).content
    assert model_file("tree.onnx", content).place(("rules", 0)) is None


def test_a_damaged_yaml_file_has_no_places() -> None:
    assert model_file("x.yaml", b"a: [").place(("rules", 0)) is None


def test_places_are_reported_once_each_rules_first() -> None:
    rules = ft.rules_from_tree(random_tree(1))
    file = written(rules)
    first = rules.variables[0]
    label = TermName(first.name, first.terms[0].name)
    answer = found("FT401", rules=(2,), terms=(label, label))
    places = locations_of(answer, rules, file, (2,))
    assert places == (
        file.place(("rules", 1)),
        file.place(("variables", 0, "terms", 0)),
    )
    assert locations_of(answer, rules, None, (2,)) == ()


# --- ids


def found(
    code: str,
    *,
    subject: str = "it",
    rules: tuple[int, ...] = (),
    terms: tuple[TermName, ...] = (),
    region: tuple[Span, ...] = (),
) -> AuditAnswer:
    """Return an answer about some rules and terms."""
    state = Proved("read off")
    return AuditAnswer(code, subject, "so", state, True, "info", rules, terms, region)


def base(**changed: float) -> RuleBase:
    """Return two rules, whose cut can be moved."""
    cut = changed.get("cut", 1.0)
    terms = (Term("low", Band(high=cut)), Term("high", Band(low=cut)))
    one, other = Proposition("x", ("low",)), Proposition("y", ("high",))
    propositions = (other, one) if changed.get("turned") else (one, other)
    rules = (
        Rule(propositions, "a", support=int(changed.get("rows", 1))),
        Rule((one,), "b"),
    )
    return RuleBase(
        "base", ("a", "b"), (Variable("x", terms), Variable("y", terms)), rules
    )


def ids(rules: RuleBase, *answers: AuditAnswer) -> list[str]:
    """Return the ids of answers about rules."""
    return [one.id for one in with_ids(answers, [rules])]


def test_an_id_stays_when_propositions_are_turned_and_supports_change() -> None:
    about = found("FT101", rules=(1,))
    assert ids(base(), about) == ids(base(turned=1), about) == ids(base(rows=9), about)


def test_an_id_changes_with_a_curve_a_rule_or_a_code() -> None:
    about = found("FT101", rules=(1,))
    known = {
        *ids(base(), about),
        *ids(base(cut=2.0), about),
        *ids(base(), found("FT101", rules=(2,))),
        *ids(base(), found("FT102", rules=(1,))),
    }
    assert len(known) == 4


def test_equal_ids_are_numbered_in_order() -> None:
    about = found("FT201", rules=(1, 2))
    first, second, third = ids(base(), about, about, about)
    assert second == f"{first}-2"
    assert third == f"{first}-3"


def test_without_rules_and_terms_an_id_is_of_the_subject_and_the_region() -> None:
    one = found("FT301", region=(Span("x", 0.0, 1.0),))
    other = found("FT301", region=(Span("x", 0.0, 2.0),))
    (first,), (second,), (third,) = (ids(base(), about) for about in (one, other, one))
    assert first == third != second


def test_an_id_is_the_same_in_every_version() -> None:
    assert ids(base(), found("FT101", rules=(1,))) == ["FT101-5d4fb4a9"]


# --- several ways of one rule

WAYS = """\
Engine: tip
InputVariable: food
  range: 0 10
  term: bad Ramp 5 0
  term: good Ramp 5 10
InputVariable: service
  range: 0 10
  term: good Ramp 5 10
OutputVariable: tip
  defuzzifier: WeightedAverage TakagiSugeno
  default: 0
  term: little Constant 5
  term: much Constant 25
RuleBlock:
  conjunction: Minimum
  disjunction: Maximum
  activation: General
  rule: if food is good or service is good then tip is much
  rule: if service is good then tip is little
"""


def test_both_ways_of_a_rule_stand_where_it_does_and_have_its_number(
    tmp_path: Path,
) -> None:
    path = tmp_path / "tip.fll"
    path.write_text(WAYS)
    audit = ft.audit(path, selection=ft.AuditSelection(select=["FT201"]))
    assert audit.numbers == (1, 1, 2)
    for answer in audit.answers:
        lines = {17 + audit.numbers[number - 1] for number in answer.rules}
        assert {place.line for place in answer.places} == lines
    shown = "\n".join(audit_lines(audit, is_whole=True))
    assert "rules 1, 2 fire with strength 1 or more" in shown
    assert "rules 2, 3" not in shown
    plain = WAYS.replace("food is good or service is good", "food is good")
    path.write_text(plain)
    assert ft.audit(path, selection=ft.AuditSelection(select=["FT201"])).numbers == ()


def test_a_rule_that_is_left_out_has_its_line() -> None:
    text = b"""FUNCTION_BLOCK brake
VAR_INPUT speed : REAL; END_VAR
VAR_OUTPUT force : REAL; END_VAR
FUZZIFY speed
  RANGE := (0 .. 100);
  TERM low := (0, 1) (60, 0);
  TERM high := (40, 0) (100, 1);
END_FUZZIFY
DEFUZZIFY force
  RANGE := (0 .. 1);
  TERM soft := (0, 1) (0.5, 0);
  TERM hard := (0.5, 0) (1, 1);
  METHOD : COG;
END_DEFUZZIFY
RULEBLOCK rules
  AND : MIN; ACT : MIN; ACCU : MAX;
  RULE 1 : IF speed IS high THEN force IS hard;
  RULE 2 : IF speed IS low THEN force IS soft WITH 0;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
    model = read_content(text, format_of("brake.fcl"), name="brake.fcl").model
    assert isinstance(model, FuzzySystem)
    for file, place in [
        (model_file("brake.fcl", text), FileLocation("brake.fcl", 18, 3)),
        (written(model), None),
    ]:
        found = audit(
            Material(model, file=file), selection=AuditSelection(select=["FT101"])
        )
        dead = next(one for one in found.answers if one.is_finding)
        assert dead.sentence == "rule 2 never fires: its weight is 0"
        assert len(dead.places) == 1
        assert place is None or dead.places == (place,)
        if place is None:
            assert text_at(file, dead.places[0]).startswith("if: [speed is low]")
