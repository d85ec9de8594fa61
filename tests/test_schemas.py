"""The JSON Schemas are the ones of the code, and agree with reader and writer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import pytest
import yaml

from fuzzytree.exporters.yaml import write
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase, Term, Variable
from fuzzytree.schemas.generation import FILES, generate, write_all
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.testing import random_system, random_tree

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "tests" / "example-files"
BEYOND_A_SCHEMA = {
    # Names that nothing declares, numbers that contradict each other, and what a
    # YAML reader resolves before a schema sees it.
    "alias", "no-such-sentence", "cut-within-a-list", "deep", "duplicate-key",
    "empty", "impossible-values", "not-a-mapping", "not-utf-8", "nul-byte",
    "system-that-contradicts-itself", "tag",
    "tree-that-contradicts-itself", "tree-with-an-unknown-input", "two-documents",
    "unfinished-quote", "unknown-names", "yaml-1.1",
}  # fmt: skip


def validator(kind: str) -> Any:
    name = f"{kind.replace(' ', '')}.schema.json"
    schema = json.loads((ROOT / "schemas" / name).read_text("utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def models() -> list[Document]:
    found: list[Document] = [
        random_system(seed, formulas="wild", has_odd_names=seed > 9)
        for seed in range(20)
    ]
    for seed in range(6):
        tree = random_tree(seed, leaves=1 + 3 * seed)
        found += [tree, rules_from_tree(tree), rules_from_tree(tree, "raw")]
    terms = (Term("b", Band()), Term("not b", Band(low=1.0)))
    trap = Rule(
        (Proposition("a", ("b",), hedges=("not",)), Proposition("a", ("b", "not b"))),
        "no",
    )
    found.append(RuleBase("12:30", ("no",), (Variable("a", terms),), (trap,)))
    return found


@pytest.mark.parametrize("name", FILES)
def test_a_schema_is_the_one_that_the_code_generates(name: str) -> None:
    content = (ROOT / "schemas" / name).read_bytes()
    assert content == generate(name)
    jsonschema.Draft202012Validator.check_schema(json.loads(content))


def test_every_schema_has_a_record_in_the_table() -> None:
    assert {path.name for path in (ROOT / "schemas").glob("*.json")} == {*FILES}


def test_schemas_are_written_to_a_folder(tmp_path: Path) -> None:
    write_all(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(FILES)


@pytest.mark.one_in(6)
@pytest.mark.parametrize(
    "model", models(), ids=lambda m: f"{type(m).__name__} {m.name}"
)
def test_every_written_file_fits_its_schema(model: Document) -> None:
    data = yaml.safe_load(write(model).content)
    validator(data["kind"]).validate(data)


@pytest.mark.parametrize(
    "path",
    sorted(
        path
        for pattern in ("iris-*", "system-*")
        for path in (EXAMPLES / "positive").glob(pattern)
    ),
    ids=lambda path: path.stem,
)
def test_an_example_to_accept_fits_its_schema(path: Path) -> None:
    data = yaml.safe_load(path.read_bytes())
    validator(data["kind"]).validate(data)


@pytest.mark.parametrize(
    "path",
    [
        path
        for path in sorted((EXAMPLES / "negative").glob("*.yaml"))
        if path.stem not in BEYOND_A_SCHEMA
    ],
    ids=lambda path: path.stem,
)
def test_a_schema_refuses_what_the_reader_refuses_for_its_form(path: Path) -> None:
    data = yaml.safe_load(path.read_bytes())
    kind = path.stem.split("-")[0]
    kind = kind if kind in ("tree", "system") else "rule base"
    assert not validator(kind).is_valid(data)


def test_every_exception_of_the_schemas_is_an_example() -> None:
    stems = {path.stem for path in (EXAMPLES / "negative").glob("*.yaml")}
    assert stems >= BEYOND_A_SCHEMA


@pytest.mark.parametrize(
    ("schema", "name"),
    [("rulebase", "iris-rules"), ("tree", "iris-tree"), ("system", "system-curves")],
)
def test_check_jsonschema_accepts_an_example(
    schema: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from check_jsonschema import main  # type: ignore[import-untyped]  # as above

    path = EXAMPLES / "positive" / f"{name}.yaml"
    whole = ROOT / "schemas" / f"{schema}.schema.json"
    arguments = ["--schemafile", str(whole), str(path)]
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 0, capsys.readouterr().out
