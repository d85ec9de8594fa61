"""The re-checker reads files with its own code, and reads what we write."""

from __future__ import annotations

import json
import random
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import yaml as pyyaml

import fuzzytree as ft
from fuzzytree.auditing.decide import states
from fuzzytree.auditing.findings.records import LIMITS, Audit, AuditAnswer
from fuzzytree.exporters import yaml
from fuzzytree.numerics import decide
from fuzzytree.rechecking import CannotRunError, recheck, records, sentences
from fuzzytree.rechecking.case import strengths
from fuzzytree.rechecking.curves import bounds, is_straight, turns
from fuzzytree.rechecking.models import Model
from fuzzytree.rechecking.records import decode, read_json
from fuzzytree.rechecking.yaml import read_yaml
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.programs.operations import Doubles
from fuzzytree.testing import random_system, random_tree
from tests.auditing.decide.old_bases import random_base


@pytest.mark.parametrize("seed", range(4))
def test_it_evaluates_rules_of_a_file_as_we_do(seed: int) -> None:
    tree = random_tree(seed, leaves=6)
    bases = [rules_from_tree(tree), rules_from_tree(tree, "raw")]
    bases += [random_base(seed, kind="mixed", odd=0.4, combinations=1)]
    chance = random.Random(seed)
    for base in bases:
        found = Model(yaml.write(base).content, "x.yaml")
        row = [chance.uniform(-1.0, 1.0) for _ in base.inputs]
        point = dict(zip(base.inputs, map(Fraction, row), strict=True))
        mine = [float(low) for low, _ in strengths(found.rules, point)]
        ours = decide(base, np.array(row)[:, None]).strengths
        assert ours is not None
        assert mine == pytest.approx(ours[:, 0].tolist(), abs=1e-12)


def test_its_rules_of_a_tree_are_ours() -> None:
    tree = random_tree(3, leaves=9)
    found = Model(yaml.write(tree).content, "x.yaml")
    for mine, kind in ((found.rules, "relative"), (found.raw, "raw")):
        assert mine is not None
        ours = rules_from_tree(tree, "raw" if kind == "raw" else "relative")
        assert [rule.then for rule in mine.rules] == [rule.then for rule in ours.rules]
        assert [
            [(proposition.variable, proposition.terms) for proposition in rule.when]
            for rule in mine.rules
        ] == [[(one.variable, one.terms) for one in rule.when] for rule in ours.rules]


def test_the_panel_is_ours() -> None:
    assert sentences.LIMITS == LIMITS


def test_the_records_of_an_audit_are_ours() -> None:
    pairs = [
        (records.Audit, Audit),
        (records.Answer, AuditAnswer),
        (records.Claim, states.Claim),
        (records.Coordinate, states.Coordinate),
        *((getattr(records, k.__name__), k) for k in states.State.__args__),
    ]
    for mine, ours in pairs:
        assert {*mine._fields} == {*ours.__struct_fields__}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "x.yaml: the file is empty"),
        ("a: &b 1", "x.yaml:1: '&b 1' is not read; quotes make it a text"),
        ("a: 1\na: 2", "x.yaml:2: the key 'a' stands twice"),
        ("a: {b: 1, b: 2}", "x.yaml:1: the key 'b' stands twice"),
        ("a: [1, 2", "x.yaml:1: ']' or ',' is missing"),
        ("a: null", "x.yaml:1: 'null' has no place in a model"),
        ("a: .nan", "x.yaml:1: '.nan' has no place in a model"),
        ("a: 'b", 'x.yaml:1: a quote that does not end: "\'b"'),
        ("a:\n- [" + "[" * 40, "x.yaml:2: more than 32 levels"),
        ("a:\tb", "x.yaml:1: character U+0009 is not read"),
        ("a: 1\n  b: 2", "x.yaml:1: '1 b: 2' is not read; quotes make it a text"),
        ("a:\nb: 1", "x.yaml:1: the key 'a' has no value"),
        ('a: "\\q"', "x.yaml:1: no escape: '\\\\q'"),
    ],
)
def test_yaml_that_is_not_of_its_subset_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(CannotRunError) as caught:
        read_yaml(text.encode(), "x.yaml")
    assert str(caught.value) == sentence


@pytest.mark.parametrize(
    ("facts", "sentence"),
    [
        ({"state": []}, "it: it cannot be {'state': []}"),
        ({"state": {}}, "it: it cannot be {'state': {}}"),
        (
            {"state": "PROVED", "a\nb": 1},
            "it: missing or unknown: 'a\\nb', confirmed, how, rivals",
        ),
    ],
)
def test_a_state_that_is_none_is_one_sentence(
    facts: dict[str, object], sentence: str
) -> None:
    with pytest.raises(CannotRunError) as caught:
        decode(records.State, facts, "it")
    assert str(caught.value) == sentence


@pytest.mark.parametrize(
    "text", ["kind: [{0}]", "{0}: 1\n{0}: 2", "kind: tree\n{0}: 1", "a: [1] {0}"]
)
def test_a_long_name_does_not_make_a_long_sentence(text: str) -> None:
    with pytest.raises(CannotRunError) as caught:
        Model(text.format("x" * 5000).encode(), "x.yaml")
    assert 20 < len(str(caught.value)) < 300


def test_damaged_files_end_in_one_error() -> None:
    content = yaml.write(random_tree(2, leaves=6)).content
    chance = random.Random(0)
    refused: list[str] = []
    for _ in range(150):
        damaged = bytearray(content)
        for _ in range(chance.randint(1, 3)):
            place = chance.randrange(len(damaged))
            damaged[place : place + chance.randint(0, 2)] = chance.randbytes(1)
        try:
            Model(bytes(damaged), "x.yaml")
        except CannotRunError as error:
            refused.append(str(error))
    assert len(refused) > 50
    assert all(text.startswith("x.yaml") for text in refused)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", "x.json: not JSON: Expecting property name enclosed in double quotes"),
        ('{"a": 1, "a": 2}', "x.json: a key stands twice in one object"),
        ('{"a": NaN}', "x.json: NaN is no number that JSON knows"),
        ('{"a": 1e999}', "x.json: not JSON: Out of range float values are not JSON"),
        ("[" * 100_000, "x.json: not JSON: maximum recursion depth exceeded"),
        ("[]", "x.json: an object is needed"),
    ],
)
def test_json_that_is_none_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(CannotRunError) as caught:
        read_json(text.encode(), "x.json")
    assert str(caught.value).startswith(sentence)


def test_a_file_of_another_format_is_refused_with_the_conversion() -> None:
    with pytest.raises(CannotRunError) as refused:
        Model(b"FUNCTION_BLOCK brake\n", "brake.fcl")
    assert str(refused.value) == (
        "brake.fcl: only YAML is checked again; `fuzzytree convert` makes it"
    )


@pytest.mark.parametrize("seed", range(8))
def test_degrees_lie_in_what_encloses_them(seed: int) -> None:
    system, chance = random_system(seed, formulas="none"), random.Random(seed)
    found = Model(yaml.write(system).content, "x.yaml")
    for variable in system.variables:
        for term in variable.terms:
            curve = found.variables[variable.name].curves[term.name]
            places = [float(x) for x in turns(curve)] or [0.0]
            for _ in range(10):
                ends = min(places) - 1.0, max(places) + 1.0
                a, b = sorted(chance.uniform(*ends) for _ in range(2))
                b = a if is_straight(curve) else b
                low, high = bounds(curve, Fraction(a), Fraction(b))
                for x in (a, b, *(one for one in places if a < one < b)):
                    degree = term.height * term.function.degree(Doubles(), x)
                    assert low - 1e-12 <= degree <= high + 1e-12, (curve, x)


def test_a_key_in_braces_is_any_name_of_a_class() -> None:
    found = read_yaml(b"p: {'a: b': 0.5, hand-0: 0.25, \"q, {\": 1, a:b: 2}\n", "x")
    assert found == {"p": {"a: b": 0.5, "hand-0": 0.25, "q, {": 1, "a:b": 2}}
    for wrong in (b"p: {a: 1, 'a': 2}\n", b"p: {: 1}\n", b"p: {a, b: 1}\n"):
        with pytest.raises(CannotRunError):
            read_yaml(wrong, "x")


FLOW = """format: fuzzytree/1
kind: rule base
name: hand
classes: [no, maybe, yes]
variables:
- {name: heat, range: {from: 0, to: 10}, terms: [{name: low, points: [[2, 1], [4, 0]]},
   {name: mid, points: [[3, 0], [4, 1], [5, 0]]},
   {name: high, points: [[6, 0], [8, 1]]}]}
rules: [
  {if: [heat is low or mid], then: no}, {if: [heat is not high], then: maybe},
{if: [heat is high], then: yes}
]
semantics: {and: minimum, or: maximum, not: 1 - degree, uncovered: no class,
  missing: class maybe, answer: the class of the first of the strongest rules}
"""


def test_an_audit_of_a_file_in_flow_style_is_checked_again(tmp_path: Path) -> None:
    path = tmp_path / "hand.yaml"
    path.write_text(FLOW)
    result = ft.audit(path)
    assert any(answer.places for answer in result.answers)
    report = recheck(result.to_json().encode(), path.read_bytes(), ("a", str(path)))
    assert report.wrong == []
    assert report.confirmed


def test_items_in_brackets_have_places() -> None:
    found = read_yaml(b"a: [x,\n  {b: [1]},\nz]\n", "x.yaml")
    assert found["a"].places == [(1, 5), (2, 3), (3, 1)]


def test_every_way_to_write_a_model_that_users_have_is_read_alike() -> None:
    system = random_system(3, formulas="none")
    facts = json.loads(json.dumps(read_yaml(yaml.write(system).content, "x.yaml")))
    block = pyyaml.safe_dump(facts, default_flow_style=False, sort_keys=False)
    ways = [block, pyyaml.safe_dump(facts, default_flow_style=True, width=1000)]
    ways += [json.dumps(facts), json.dumps(facts, indent=2)]
    ways += [json.dumps(facts, separators=(",", ":"))]
    ways += [f"%YAML 1.2\n--- # a model\n{block}...\n", block.replace(": ", " : ")]
    ways += [re.sub(r"^name: ", "name:\n  ", block, flags=re.MULTILINE)]
    for way in ways:
        assert read_yaml(way.encode(), "x.yaml") == facts


def test_a_key_on_its_line_is_any_name_of_a_class() -> None:
    content = b"p:\n  'a: b': 0.5\n  hand-0 : 0.25\n  \"q, {\": 1\n  'True': 2\n"
    facts = read_yaml(content, "x")
    assert facts == {"p": {"a: b": 0.5, "hand-0": 0.25, "q, {": 1, "True": 2}}


@pytest.mark.parametrize("text", ["a: ['b\n\n  c']", "a: 'b\n  c'", "a: [b:]"])
def test_texts_whose_end_is_not_plain_are_refused(text: str) -> None:
    with pytest.raises(CannotRunError):
        read_yaml(text.encode(), "x.yaml")
