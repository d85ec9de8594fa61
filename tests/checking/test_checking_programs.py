"""Programs beside a model: compared as text, run if they are ours, compared by rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.errors import MissingExtraError
from fuzzytree.model.agreement import Agreement, FileContent
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import (
    Band,
    Proposition,
    Rule,
    RuleBase,
    Semantics,
    Term,
    Variable,
)
from fuzzytree.runtimes import written
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_tree

TREE = random_tree(3, leaves=6, inputs=3)
RULES = rules_from_tree(TREE, "raw", conjunction="product")
ENDS = RuleBase(
    "ends",
    ("x", "y"),
    (Variable("v", (Term("falls", Band(high=1.0, right=3.0)),)),),
    (Rule((Proposition("v", ("falls",)),), "x"), Rule((), "y")),
)


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def checked(model: Document, path: str, **options: Any) -> Agreement:
    settings = ft.CheckSettings(limit=300, **options)
    return ft.check(model, path, runtimes=["native"], settings=settings)


def about(agreement: Agreement, path: str) -> list[tuple[str, str]]:
    return [
        (c.against, c.verdict)
        for c in agreement.comparisons
        if c.representation == path
    ]


WRITTEN: Sequence[Any] = (
    ("m.c", {}),
    ("m.c", {"dtype": "float32"}),
    ("m.py", {}),
    ("m.mjs", {}),
    ("m.sql", {}),
    ("m.sql", {"dialect": "duckdb"}),
    pytest.param("m.pmml", {}, marks=pytest.mark.heavy),
)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("model", [TREE, RULES, ENDS], ids=["tree", "rules", "ends"])
@pytest.mark.parametrize(("path", "options"), WRITTEN)
def test_a_program_of_ours_is_run_and_agrees(
    path: str, options: dict[str, Any], model: Document
) -> None:
    if path == "m.sql" and isinstance(model, RuleBase):
        options = {**options, "strengths": True}
    ft.save(model, path, allow_loss=True, **options)
    agreement = checked(TREE if model is RULES else model, path, terms="raw")
    first, rows, *classes = about(agreement, path)
    assert first == ("a freshly written file", "agrees")
    assert rows == ("the model", "agrees")
    assert classes == ([] if path == "m.c" else [("the model's classes", "agrees")])
    assert agreement.ok


@pytest.mark.parametrize(
    ("path", "options"),
    [
        ("m.c", {"name": "other", "selftest": False}),
        ("m.sql", {"table": "my rows; --"}),
        ("m.sql", {"dialect": "duckdb", "table": "t"}),
        ("m.sql", {"keep": ["x1"]}),
        ("m.st", {"name": "fb", "dtype": "float32"}),
        ("m.xml", {"to": "structured-text", "layout": "plcopen"}),
        ("m.js", {"module": "script"}),
    ],
)
def test_a_program_agrees_whatever_options_it_was_written_with(
    path: str, options: dict[str, Any]
) -> None:
    ft.save(TREE, path, allow_loss=True, **options)
    agreement = checked(TREE, path)
    assert agreement.ok
    assert {verdict for _, verdict in about(agreement, path)} == {"agrees"}
    assert agreement.files == (
        FileContent(path, "tree", options.get("dtype", "float64")),
    )


def test_options_that_a_file_cannot_have_are_a_disagreement() -> None:
    ft.save(TREE, "m.sql", table="t")
    text = Path("m.sql").read_text("utf-8")
    Path("m.sql").write_text(text.replace("table=t", "dialect=klingon"), "utf-8")
    (one,) = (c for c in checked(TREE, "m.sql").comparisons if c.basis == "file")
    assert one.detail == (
        "the model cannot be written as sql: dialect: must be sqlite, duckdb, "
        "postgresql, spark, bigquery, snowflake, tsql, clickhouse, trino, not "
        "'klingon'",
    )


@pytest.mark.parametrize("path", ["m.yaml", "m.py", "m.sql"])
def test_raw_rules_of_a_tree_are_a_difference_unless_wanted(path: str) -> None:
    ft.save(rules_from_tree(TREE, "raw"), path)
    agreement = checked(TREE, path)
    assert agreement.files == (FileContent(path, "raw rules", "float64"),)
    (one,) = (
        c
        for c in agreement.comparisons
        if c.basis == "file"
        if c.representation == path
    )
    assert (one.verdict, one.detail[0]) == (
        "DISAGREES",
        "it holds raw rules, another function than the tree; --terms raw compares it "
        "with the tree's own raw rules",
    )
    assert not checked(TREE, path, run_code=True, rows_only=True).ok
    assert checked(TREE, path, terms="raw").ok


CATEGORIES = RuleBase(
    "places",
    ("a", "b"),
    (
        Variable(
            "region", (Term("far", Band(low=2.0)),), categories=("north", "o'er", "x;")
        ),
        Variable("is new", (Term("yes", Band(low=1.0)),), categories=("False", "True")),
    ),
    (
        Rule((Proposition("region", ("far",)),), "a"),
        Rule((Proposition("is new", ("yes",)),), "b"),
    ),
)


@pytest.mark.parametrize(
    ("path", "options"), [("m.sql", {}), ("m.sql", {"dialect": "duckdb"}), ("m.py", {})]
)
def test_a_program_is_run_on_the_names_of_categories(
    path: str, options: dict[str, Any]
) -> None:
    ft.save(CATEGORIES, path, **options)
    agreement = checked(CATEGORIES, path)
    assert agreement.ok
    assert ("the model", "agrees") in about(agreement, path)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "semantics",
    [Semantics(missing="x"), Semantics(uncovered="x"), Semantics()],
    ids=["missing", "uncovered", "stand-in"],
)
def test_pmml_with_an_answer_to_missing_values_agrees(semantics: Semantics) -> None:
    stand_in = None if semantics.missing or semantics.uncovered else 0.5
    variable = replace(ENDS.variables[0], missing=stand_in)
    rules = replace(
        ENDS, variables=(variable,), rules=ENDS.rules[:1], semantics=semantics
    )
    ft.save(rules, "m.pmml")
    assert checked(rules, "m.pmml").ok


@pytest.mark.one_in(2)
@pytest.mark.parametrize("path", ["m.c", "m.py", "m.mjs", "m.sql"])
def test_a_changed_program_is_not_run(
    path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ft.save(TREE, path)
    text = Path(path).read_text("utf-8")
    Path(path).write_text(text.replace("class 1", "class 2"), "utf-8")
    monkeypatch.setattr(
        "fuzzytree.checking.programs.ENGINES", dict.fromkeys(written.ENGINES)
    )
    agreement = checked(TREE, path)
    assert about(agreement, path) == [("a freshly written file", "DISAGREES")]
    assert agreement.skipped[-1] == (
        f"{path}: its answers: only --run-code runs a file with another text"
    )


def test_the_first_line_that_differs_is_shown() -> None:
    ft.save(TREE, "m.py")
    text = Path("m.py").read_text("utf-8")
    Path("m.py").write_text(f"import os\n{text}", "utf-8")
    (one,) = (
        c for c in checked(TREE, "m.py").comparisons if c.representation == "m.py"
    )
    assert one.detail == (
        "line 1: 'import os' where '# -*- coding: utf-8 -*-' is right",
    )
    Path("m.py").write_text(text[: text.rindex("if __name__")], "utf-8")
    (one,) = (
        c for c in checked(TREE, "m.py").comparisons if c.representation == "m.py"
    )
    number = text[: text.rindex("if __name__")].count("\n") + 1
    shown = "'if __name__ == \"__main__\":'"
    assert one.detail == (f"line {number}: '' where {shown} is right",)


def backdoor(path: str) -> None:
    """Write a Python file that decides for class 1 where an input is 13.123456."""
    ft.save(TREE, path)
    text = Path(path).read_text("utf-8")
    head = "def answer(values):\n"
    assert text.count(head) == 1
    trap = "    if values[0] == 13.123456:\n        return 'class 1', 1, 0\n"
    Path(path).write_text(text.replace(head, f"{head}{trap}"), "utf-8")


def test_a_changed_program_that_is_run_all_the_same_agrees_by_its_rows_only() -> None:
    backdoor("m.py")
    agreement = checked(TREE, "m.py", run_code=True)
    assert about(agreement, "m.py") == [
        ("a freshly written file", "rows only"),
        ("the model", "agrees"),
        ("the model's classes", "agrees"),
    ]
    assert not agreement.ok
    assert checked(TREE, "m.py", run_code=True, rows_only=True).ok


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("path", "change", "fault"),
    [
        (
            "m.py",
            ("# Classes", "raise SystemExit(3) #"),
            "python cannot run it: exit code 3",
        ),
        ("m.sql", ("SELECT", "SELEKT"), 'sqlite cannot run it: near "SELEKT"'),
        ("m.mjs", ("export", "throw 1; export"), "javascript cannot run it: "),
        ("m.c", ("int label;", "int labels;"), "cannot compile the model: "),
    ],
)
def test_a_program_that_fails_is_a_disagreement(
    path: str, change: tuple[str, str], fault: str
) -> None:
    ft.save(TREE, path)
    text = Path(path).read_text("utf-8")
    assert change[0] in text
    Path(path).write_text(text.replace(*change), "utf-8")
    agreement = checked(TREE, path, run_code=True)
    assert about(agreement, path) == [
        ("a freshly written file", "DISAGREES"),
        ("the model", "DISAGREES"),
    ]
    rows = next(
        c
        for c in agreement.comparisons
        if c.basis == "rows" and c.representation == path
    )
    assert fault in rows.detail[0]


@pytest.mark.one_in(4)
@pytest.mark.parametrize(
    ("model", "path", "options", "why"),
    [
        (TREE, "m.st", {}, "no engine for structured-text is known here"),
        (
            TREE,
            "m.sql",
            {"dialect": "spark"},
            "no engine for SQL of the dialect spark is known here",
        ),
        (TREE, "m.js", {"module": "script"}, "only JavaScript modules are run"),
        (
            all_samples()["Mamdani, centroid"],
            "m.c",
            {},
            "programs of fuzzy systems in c are compared by their text",
        ),
    ],
)
def test_a_program_without_an_engine_is_compared_by_its_text(
    model: Document, path: str, options: dict[str, Any], why: str
) -> None:
    ft.save(model, path, **options)
    agreement = checked(model, path)
    assert about(agreement, path) == [("a freshly written file", "agrees")]
    assert f"{path}: its answers: {why}" in agreement.skipped
    Path(path).write_bytes(Path(path).read_bytes() + b" ")
    assert about(checked(model, path), path) == [
        ("a freshly written file", "DISAGREES")
    ]


def test_a_missing_engine_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    ft.save(TREE, "m.mjs")
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(MissingExtraError) as caught:
        checked(TREE, "m.mjs")
    assert str(caught.value) == (
        "m.mjs: running JavaScript needs node, which is not installed"
    )
