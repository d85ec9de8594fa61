"""Programs beside a model: compared as text, run if they are ours, compared by rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import fuzzytree as ft
from fuzzytree.errors import MissingExtraError
from fuzzytree.model.agreement import Agreement
from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import Band, Proposition, Rule, RuleBase, Term, Variable
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
    agreement = checked(TREE if model is RULES else model, path)
    first, rows, *classes = about(agreement, path)
    assert first == ("a freshly written file", "agrees")
    assert rows == ("the model", "agrees")
    assert classes == ([] if path == "m.c" else [("the model's classes", "agrees")])
    assert agreement.ok


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
