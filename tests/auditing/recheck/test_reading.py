"""The re-checker reads files with its own code, and reads what we write."""

from __future__ import annotations

import random

import msgspec
import numpy as np
import pytest

from fuzzytree.api.verbs import learn
from fuzzytree.auditing.engine import states
from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.auditing.findings.records import LIMITS, Audit, AuditAnswer
from fuzzytree.auditing.recheck import (
    CannotRunError,
    audit_records,
    head,
    model_records,
)
from fuzzytree.auditing.recheck.head import compact
from fuzzytree.auditing.recheck.meaning import rules_of
from fuzzytree.auditing.recheck.models import built, read_file, read_json
from fuzzytree.auditing.recheck.yaml import read_yaml
from fuzzytree.exporters import yaml
from fuzzytree.model.rulebase import RuleBase, fingerprint
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_tree
from tests.auditing.engine.bases import random_base
from tests.auditing.recheck.reading import models, read


def test_its_reading_of_a_file_is_ours() -> None:
    numbers = learn(np.arange(8.0)[:, None], target=[0] * 4 + [1] * 4)
    for model in [*models(0), random_tree(5, leaves=40), numbers]:
        found = read(model)
        assert compact(found) == msgspec.json.encode(model).decode()
        assert head.fingerprint(found) == fingerprint(model)


@pytest.mark.heavy
def test_its_reading_of_many_files_is_ours() -> None:
    for seed in range(1, 30):
        model: RuleBase | FuzzyTree
        for model in (random_tree(seed, leaves=2 + seed), random_base(seed, odd=0.3)):
            found = read(model)
            assert compact(found) == msgspec.json.encode(model).decode()


def test_its_rules_of_a_tree_are_ours() -> None:
    tree = random_tree(3, leaves=9)
    found = read(tree)
    assert isinstance(found, model_records.Tree)
    for kind in ("relative", "raw"):
        mine = compact(rules_of(found, kind))
        assert mine == msgspec.json.encode(rules_from_tree(tree, kind)).decode()


def test_the_panel_and_the_codes_are_ours() -> None:
    assert head.LIMITS == LIMITS
    asked = {code for code in CODES if not code.startswith("FT8")}
    assert head.SEVERITIES.keys() == asked
    for code in asked:
        assert CODES[code].severity in head.SEVERITIES[code].split(" ")


def test_the_records_of_an_audit_are_ours() -> None:
    pairs = [
        (audit_records.Audit, Audit),
        (audit_records.Answer, AuditAnswer),
        (audit_records.Claim, states.Claim),
        (audit_records.Coordinate, states.Coordinate),
        *((getattr(audit_records, k.__name__), k) for k in states.State.__args__),
    ]
    for mine, ours in pairs:
        assert set(mine._fields) == {f.name for f in msgspec.structs.fields(ours)}


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
        ({"state": "PROVED", "a\nb": 1}, "it: missing or unknown: 'a\\nb', how"),
    ],
)
def test_a_state_that_is_none_is_one_sentence(
    facts: dict[str, object], sentence: str
) -> None:
    with pytest.raises(CannotRunError) as caught:
        built(audit_records.State, facts, "it")
    assert str(caught.value) == sentence


@pytest.mark.parametrize(
    "text", ["kind: [{0}]", "{0}: 1\n{0}: 2", "kind: tree\n{0}: 1", "a: [1] {0}"]
)
def test_a_long_name_does_not_make_a_long_sentence(text: str) -> None:
    with pytest.raises(CannotRunError) as caught:
        read_file(text.format("x" * 5000).encode(), "x.yaml")
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
            read_file(bytes(damaged), "x.yaml")
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
        read_file(b"FUNCTION_BLOCK brake\n", "brake.fcl")
    assert str(refused.value) == (
        "brake.fcl:1: no key and no list: 'FUNCTION_BLOCK brake'; only YAML is read "
        "here: convert it (fuzzytree convert), and audit that"
    )
