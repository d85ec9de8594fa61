"""The separate re-checker: its reading, its arithmetic and its proofs are its own."""

from __future__ import annotations

import ast
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import msgspec
import pytest

from fuzzytree import rechecking
from fuzzytree.auditing.codes import CODES
from fuzzytree.auditing.limits import LIMITS
from fuzzytree.auditing.records import Answer, Audit
from fuzzytree.errors import LossError
from fuzzytree.exporters import yaml
from fuzzytree.lowering import rules_from_tree
from fuzzytree.numerics.exact import MISSING, exact_answer
from fuzzytree.probing import probes
from fuzzytree.proving import states
from fuzzytree.proving.domain import Domain
from fuzzytree.rechecking import CannotRunError, Grid, Line, read_model, read_yaml
from fuzzytree.rulebase import RuleBase, fingerprint
from fuzzytree.testing import exporter_models, random_tree
from fuzzytree.tree import FuzzyTree
from tests.proving.bases import random_base

HALF = Fraction(1, 2)


def models(seed: int) -> Iterator[RuleBase | FuzzyTree]:
    """Yield models of every kind that can be written."""
    for _, model in exporter_models(seed):
        if isinstance(model, RuleBase | FuzzyTree):
            try:
                yaml.write(model)
            except LossError:
                continue
            yield model


def read(model: RuleBase | FuzzyTree) -> rechecking.Model:
    """Return a model as the re-checker reads it."""
    return read_model(yaml.write(model).content, "model.yaml")


def test_it_imports_nothing_but_the_standard_library() -> None:
    tree = ast.parse(Path(rechecking.__file__).read_text())
    named = {
        name.split(".")[0]
        for node in ast.walk(tree)
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert named <= sys.stdlib_module_names


def test_it_runs_alone_in_an_empty_folder(tmp_path: Path) -> None:
    shutil.copy(rechecking.__file__, tmp_path / "rechecking.py")
    (tmp_path / "audit.json").write_text("{}")
    (tmp_path / "model.yaml").write_bytes(yaml.write(random_tree(1)).content)
    ran = subprocess.run(
        [sys.executable, "-I", "rechecking.py", "audit.json", "model.yaml"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith("audit.json: missing or unknown: accepted, answers,")


def test_its_reading_of_a_file_is_ours() -> None:
    for model in [*models(0), random_tree(5, leaves=40)]:
        found = read(model)
        assert rechecking.compact(found) == msgspec.json.encode(model).decode()
        assert rechecking.fingerprint(found) == fingerprint(model)


@pytest.mark.heavy
def test_its_reading_of_many_files_is_ours() -> None:
    for seed in range(1, 30):
        model: RuleBase | FuzzyTree
        for model in (random_tree(seed, leaves=2 + seed), random_base(seed, odd=0.3)):
            found = read(model)
            assert rechecking.compact(found) == msgspec.json.encode(model).decode()


def test_its_rules_of_a_tree_are_ours() -> None:
    tree = random_tree(3, leaves=9)
    found = read(tree)
    assert isinstance(found, rechecking.Tree)
    for kind in ("relative", "raw"):
        mine = rechecking.compact(rechecking.rules_of(found, kind))
        assert mine == msgspec.json.encode(rules_from_tree(tree, kind)).decode()


def test_its_answers_and_strengths_are_exactly_ours() -> None:
    for model in models(0):
        found = read(model)
        rows = list(probes(model))
        for row in random.Random(0).sample(rows, min(12, len(rows))):
            ours = exact_answer(model, row)
            if ours.status == MISSING:
                continue
            point = {name: Fraction(value) for name, value in row.items()}
            assert rechecking.answer_of(found, point) == ours.label
            if isinstance(found, rechecking.Rules):
                assert tuple(rechecking.strengths(found, point)) == ours.strengths


def wins_of(base: RuleBase) -> tuple[rechecking.Rules, list[bool]]:
    """Return a rule base as read, and which rules win somewhere in the unit box."""
    found = read(base)
    assert isinstance(found, rechecking.Rules)
    line = Line(Fraction(0), Fraction(1), False)
    grid = Grid(found, dict.fromkeys((v.name for v in found.variables), line), [])
    return found, [
        grid.wins(
            grid.of[number],
            [
                of
                for of, r in zip(grid.of, found.rules, strict=True)
                if r.then != rule.then
            ],
        )
        for number, rule in enumerate(found.rules)
    ]


def test_a_rule_that_wins_at_a_random_point_is_never_called_dead() -> None:
    dead = 0
    for seed in (0, 3):
        base = random_base(seed, 5, 2, kind="mixed", odd=0.3, shared=0.5)
        found, wins = wins_of(base)
        dead += wins.count(False)
        chance = random.Random(seed)
        for _ in range(60):
            point = {name: Fraction(chance.random()) for name in base.inputs}
            strengths = rechecking.strengths(found, point)
            best = max(strengths)
            labels = {
                rule.then
                for rule, one in zip(found.rules, strengths, strict=True)
                if one == best
            }
            if best > 0 and len(labels) == 1:
                assert all(
                    won for won, one in zip(wins, strengths, strict=True) if one == best
                )
    assert dead > 0


@pytest.mark.heavy
def test_its_proofs_agree_with_the_engine() -> None:
    from fuzzytree.proving.domain import Side
    from fuzzytree.proving.ground import ground
    from fuzzytree.proving.wins import wins

    for seed in range(16):
        base = random_base(seed, 5, 2, kind="mixed", odd=0.3, shared=0.5)
        given = ground(base, Domain(tuple(Side(n, 0.0, 1.0) for n in base.inputs)))
        for number, mine in enumerate(wins_of(base)[1]):
            rule = base.rules[number]
            rivals = [k for k, r in enumerate(base.rules, 1) if r.then != rule.then]
            found = wins(given, number + 1, rivals)
            assert mine == isinstance(found, states.Witness), (seed, number)


def test_roots_are_isolated_and_told_apart() -> None:
    two = (Fraction(-2), Fraction(0), Fraction(1))  # x**2 - 2
    four = rechecking.times(two, two)
    cubic = rechecking.times(two, (Fraction(-3, 2), Fraction(1)))
    met = rechecking._crossings([two, (), four, cubic], Fraction(1, 2), Fraction(9))  # pyright: ignore[reportPrivateUsage]
    near = [float(root.low + root.high) / 2 for root in met]
    assert near == sorted(set(near))
    zeros = [r for r in met if r.low**2 <= 2 <= r.high**2]
    assert len(zeros) == 1  # one root of three polynomials


def test_the_panel_and_the_codes_are_ours() -> None:
    assert rechecking.LIMITS == LIMITS
    asked = {code for code in CODES if not code.startswith("FT8")}
    assert rechecking.SEVERITIES.keys() == asked
    for code in asked:
        assert CODES[code].severity in rechecking.SEVERITIES[code].split(" ")


def test_the_records_of_an_audit_are_ours() -> None:
    pairs = [
        (rechecking.Audit, Audit),
        (rechecking.Answer, Answer),
        (rechecking.Claim, states.Claim),
        (rechecking.Coordinate, states.Coordinate),
        *((getattr(rechecking, k.__name__), k) for k in states.State.__args__),
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
        ("a: .inf", "x.yaml:1: '.inf' has no place in a model"),
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
            read_model(bytes(damaged), "x.yaml")
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
        rechecking.read_json(text.encode(), "x.json")
    assert str(caught.value).startswith(sentence)
