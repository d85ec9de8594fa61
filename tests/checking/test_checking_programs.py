"""Programs beside a model: compared as text, run if they are ours, compared by rows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.model.agreement import Agreement, FileContent, Unchecked
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
from fuzzytree.report.text import agreement_lines
from fuzzytree.runtimes import written
from fuzzytree.semantics.lowering import rules_from_tree
from fuzzytree.semantics.samples import all_samples
from fuzzytree.testing import random_tree
from tests.interop.matrix_models import write_model

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
        "fuzzytree.checking.files.ENGINES", dict.fromkeys(written.ENGINES)
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
            "m.st",
            {},
            "no engine for structured-text is known here",
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
    assert agreement.unchecked == (Unchecked(path, why),)
    Path(path).write_bytes(Path(path).read_bytes() + b" ")
    assert about(checked(model, path), path) == [
        ("a freshly written file", "DISAGREES")
    ]


def test_a_file_whose_engine_is_missing_is_not_checked_and_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ft.save(TREE, "m.mjs")
    ft.save(TREE, "m.yaml")
    monkeypatch.setattr("shutil.which", lambda _: None)
    settings = ft.CheckSettings(limit=100)
    agreement = ft.check(
        TREE, "m.mjs", "m.yaml", runtimes=["native"], settings=settings
    )
    reason = "running JavaScript needs node, which is not installed"
    assert agreement.unchecked == (Unchecked("m.mjs", reason),)
    assert f"m.mjs: its answers: {reason}" in agreement.skipped
    assert next(agreement_lines(agreement)).startswith(
        "random 6: none of 10 comparisons disagrees; 1 of 2 files agrees; 1 not "
        "checked: m.mjs (100 generated rows"
    )


SYSTEMS = {
    name: all_samples()[name]
    for name in (
        "Sugeno, linear",
        "Mamdani, centroid",
        "gaussian curves",
        "several outputs",
        "a default answer",
        "inputs clamped to their range",
    )
}
RUN: Sequence[Any] = (
    ("m.c", {}),
    ("m.c", {"activations": True, "name": "other"}),
    ("m.c", {"dtype": "float32"}),
    ("m.mjs", {}),
    ("m.py", {}),
    ("m.sql", {}),
    ("m.sql", {"dialect": "duckdb", "strengths": True}),
    pytest.param("m.pmml", {}, marks=pytest.mark.heavy),
)


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize(("path", "options"), RUN)
def test_a_program_of_a_system_is_run_and_agrees(
    path: str, options: dict[str, Any], name: str
) -> None:
    system = SYSTEMS[name]
    ft.save(system, path, **options)
    agreement = checked(system, path)
    assert about(agreement, path) == [
        ("a freshly written file", "agrees"),
        ("native", "agrees"),
    ]
    assert agreement.unchecked == ()


@pytest.mark.parametrize(
    ("path", "right", "wrong", "fault"),
    [
        ("m.c", "v0 - 0x1p+2 /* 4.0 */", "v0 - 4.0000001", "output 'fan'"),
        ("m.c", "v27 + 0x1p+0", "v27 + 0x1.0000000000001p+0", "output 'fan'"),
        ("m.mjs", "6.0 - v0", "6.0000001 - v0", "output 'fan'"),
        ("m.mjs", "v44, //", "v42, //", "output 'fan'"),
        ("m.mjs", "v48 ? 2.0", "v48 ? 1.0", "status tie where uncovered is right"),
        ("m.mjs", "v46, //", "v45, //", "activation of rule 2"),
        ("m.py", "6.0 - v0", "6.0000001 - v0", "output 'fan'"),
        ("m.sql", "6e0 - x_1", "6.0000001e0 - x_1", "output 'fan'"),
        ("m.sql", "ELSE 3e0 END", "ELSE 2e0 END", "status uncovered where missing"),
        pytest.param(
            "m.pmml", ">0.5<", ">0.50000001<", "output 'fan'", marks=pytest.mark.heavy
        ),
    ],
)
def test_a_wrong_number_in_a_program_of_a_system_is_noticed(
    path: str, right: str, wrong: str, fault: str
) -> None:
    system = SYSTEMS["Sugeno, linear"]
    ft.save(system, path)
    text = Path(path).read_text("utf-8")
    assert right in text
    Path(path).write_text(text.replace(right, wrong), "utf-8")
    agreement = checked(system, path, run_code=True)
    assert about(agreement, path) == [
        ("a freshly written file", "DISAGREES"),
        ("native", "DISAGREES"),
    ]
    (rows,) = (
        c
        for c in agreement.comparisons
        if (c.representation, c.basis) == (path, "rows")
    )
    assert fault in " ".join(rows.detail)


def test_a_slow_program_says_how_many_rows_it_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fuzzytree.checking.files._MOST_ROWS", 150)
    ft.save(TREE, "m.py")
    ft.save(TREE, "m.c")
    settings = ft.CheckSettings(limit=300)
    agreement = ft.check(TREE, "m.py", "m.c", runtimes=["native"], settings=settings)
    assert "m.py: 150 of 300 rows; 150 others were run" in agreement.skipped
    rows = {
        c.representation: c.rows
        for c in agreement.comparisons
        if c.basis == "rows" and c.against == "the model"
    }
    assert rows == {"m.py": 150, "m.c": 300}


def test_a_wrong_number_in_float32_is_noticed_beyond_its_bound() -> None:
    system = SYSTEMS["Sugeno, linear"]
    ft.save(system, "m.c", dtype="float32")
    text = Path("m.c").read_text("utf-8")
    right = "v0 - 0x1p+2f"
    assert right in text
    for wrong, verdict in (("v0 - 4.0000001f", "agrees"), ("v0 - 4.001f", "DISAGREES")):
        Path("m.c").write_text(text.replace(right, wrong), "utf-8")
        agreement = checked(system, "m.c", run_code=True)
        assert about(agreement, "m.c")[1] == ("native", verdict)


def in_fixed_point(system: Document, **options: Any) -> str:
    """Write a system as C in fixed point, and return the bound that it states."""
    ft.save(system, "m.c", selftest=False, **options)
    bound = re.search(r"is within (\S+) of exact", Path("m.c").read_text("utf-8"))
    assert bound is not None
    return bound[1]


@pytest.mark.parametrize("dtype", ["q15", "q31"])
@pytest.mark.parametrize("options", [{}, {"activations": True, "name": "other"}])
def test_fixed_point_is_run_on_its_own_inputs_and_agrees_within_its_bound(
    dtype: str, options: dict[str, Any]
) -> None:
    system = ft.load(write_model("mamdani"))
    bound = in_fixed_point(system, dtype=dtype, **options)
    data = np.array([[np.inf, -9.0, np.nan, 3.3333], [1e308, 7.77777, 1.0, -0.0]])
    agreement = ft.check(system, "m.c", data=data.T, runtimes=["native"])
    rows = next(c for c in agreement.comparisons if (c.basis, c.rows) == ("rows", 2001))
    assert agreement.ok
    assert agreement.unchecked == ()
    assert agreement.files == (FileContent("m.c", "system", dtype),)
    assert (rows.representation, rows.against) == ("m.c", "native")
    assert rows.origin.startswith(
        "the worst error of its whole numbers, for inputs in their ranges; equal bits"
    )
    assert 0.0 < rows.largest_difference <= rows.allowed <= float(bound)
    assert rows.unbounded == rows.flips == 0
    assert "m.c: 3 of 2004 rows; fixed point has no missing values" in agreement.skipped


def test_fixed_point_whose_ranges_begin_away_from_zero_agrees() -> None:
    system = all_samples()["a conclusion without a condition"]
    variables = [
        replace(one, low=-0.3 - place, high=4.1)
        for place, one in enumerate(system.variables)
    ]
    system = replace(system, variables=tuple(variables))
    in_fixed_point(system, dtype="q15")
    agreement = checked(system, "m.c")
    assert about(agreement, "m.c") == [
        ("a freshly written file", "agrees"),
        ("native", "agrees"),
    ]


@pytest.mark.parametrize(
    ("dtype", "right", "wrong", "fault"),
    [
        ("q15", "- (24576)", "- (20000)", "output 'z' "),
        ("q31", "- (1610612736)", "- (1610600000)", "output 'z' "),
        ("q31", "return (int)(", "return 2 + (int)(", "status uncovered where decided"),
    ],
)
def test_a_wrong_number_in_fixed_point_is_noticed(
    dtype: str, right: str, wrong: str, fault: str
) -> None:
    system = ft.load(write_model("mamdani"))
    in_fixed_point(system, dtype=dtype)
    text = Path("m.c").read_text("utf-8")
    assert text.count(right) == 1
    Path("m.c").write_text(text.replace(right, wrong), "utf-8")
    assert not checked(system, "m.c").ok
    agreement = checked(system, "m.c", run_code=True)
    rows = next(
        c
        for c in agreement.comparisons
        if (c.representation, c.basis) == ("m.c", "rows")
    )
    assert (rows.against, rows.verdict) == ("native", "DISAGREES")
    assert fault in " ".join(rows.detail)
