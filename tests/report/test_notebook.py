"""What `str` and a notebook show of models and results, with every name escaped."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import fuzzytree as ft
from fuzzytree.cli import main
from fuzzytree.report import model_lines, study_lines
from fuzzytree.testing import random_system, random_tree

HOSTILE = "<script>alert(1)</script>"
TREE = random_tree(3, inputs=3)
NAMED = replace(TREE, name=HOSTILE)
ROOT = Path(__file__).parents[2]
GRIP = str(ROOT / "examples" / "grip.yaml")
TIPPER = str(ROOT / "examples" / "tipper.fll")
SELECT = ft.AuditSelection(select=["FT1", "FT3"])
NEVER = "class is never soft where force < 2"

COMMANDS: list[tuple[list[str], Callable[[], object]]] = [
    (["audit", GRIP, "--select", "FT1,FT3"], lambda: ft.audit(GRIP, selection=SELECT)),
    (
        ["check", GRIP, "--runtime", "native", "--generate", "99"],
        lambda: ft.check(
            GRIP, runtimes=["native"], settings=ft.CheckSettings(limit=99)
        ),
    ),
    (["diff", GRIP, GRIP], lambda: ft.diff(GRIP, GRIP)),
    (["explain", "FT101"], lambda: ft.explain("FT101")),
    (["needs", GRIP], lambda: ft.needs(GRIP)),
    (["require", GRIP, "--that", NEVER], lambda: ft.require(GRIP, that=[NEVER])),
    (["show", TIPPER], lambda: ft.load(TIPPER)),
    (
        ["stability", GRIP, "--select", "N3", "--runtime", "native"],
        lambda: ft.stability(GRIP, select=["N3"], runtimes=["native"]),
    ),
]


@pytest.mark.parametrize(
    ("words", "call"), COMMANDS, ids=[words[0] for words, _ in COMMANDS]
)
def test_a_result_prints_what_its_command_prints(
    words: list[str],
    call: Callable[[], Any],
    capsys: pytest.CaptureFixture[str],
) -> None:
    result = call()
    main(words)
    assert str(result) + "\n" == capsys.readouterr().out
    assert len(repr(result)) < 100 or words[0] == "explain"
    assert result._repr_html_()


def test_a_recheck_prints_what_its_command_prints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "audit.json"
    path.write_text(ft.audit(GRIP, selection=SELECT).to_json(), "utf-8")
    report = ft.recheck(path, GRIP)
    main(["recheck", str(path), GRIP])
    assert str(report) + "\n" == capsys.readouterr().out
    assert html.unescape(_words(report._repr_html_())) == str(report)
    assert repr(report) == f"Report({len(report.answers)} answers, 0 wrong)"


def test_a_study_prints_its_lines() -> None:
    settings = ft.BenchSettings(rows=(9,), threads=(1,), budget_s=9)
    study = ft.bench(GRIP, select=["native"], settings=settings)
    assert str(study).splitlines() == [*study_lines(study)]
    assert html.unescape(_words(study._repr_html_())) == str(study)
    assert re.fullmatch(r"Study\(\d+ points?, \d+ omissions?\)", repr(study))


def test_a_certificate_prints_its_sentence_and_its_origin() -> None:
    certificate = ft.certify(GRIP)
    assert repr(certificate).startswith("Certificate(float64, rules, delta=")
    assert str(certificate) == f"{certificate.sentence}\n{certificate.origin}"


@pytest.mark.parametrize(
    "value",
    [
        NAMED,
        ft.rules_from_tree(NAMED),
        replace(random_system(3), name=HOSTILE),
        ft.check(NAMED, runtimes=["native"], settings=ft.CheckSettings(limit=99)),
        ft.audit(NAMED, selection=ft.AuditSelection(select=["FT501"])),
        ft.diff(NAMED, NAMED),
        ft.needs(NAMED),
    ],
    ids=lambda value: type(value).__name__,
)
def test_no_name_becomes_markup(value: Any) -> None:
    shown = value._repr_html_()
    assert "<script" not in shown
    assert _words(shown).strip()


def test_what_learning_found_is_shown_as_it_prints() -> None:
    values = np.array([[1.0], [2.0], [7.0], [8.0]])
    report = ft.FuzzyTreeClassifier().fit(values, [0, 0, 1, 1]).report_
    assert html.unescape(_words(report._repr_html_())) == str(report)
    assert str(report).startswith("4 rows, 2 patterns\n2 leaves")


def test_no_class_and_no_output_becomes_markup() -> None:
    values = np.array([[1.0], [1.5], [7.0], [7.5]])
    tree = ft.learn(values, target=[HOSTILE, HOSTILE, "b", "b"])
    shown = ft.run(tree, values)._repr_html_()
    assert "<script" not in shown
    assert shown.count("&lt;script") >= 2


def test_lines_align_whatever_the_style_of_the_notebook() -> None:
    for value in (TREE, ft.explain("FT101"), ft.needs(TREE)):
        style = "font-family: monospace; line-height: 1.3; white-space: pre"
        assert value._repr_html_().startswith(f'<pre style="{style}')


def test_a_tree_shows_its_outline_and_its_terms() -> None:
    shown = html.unescape(_words(TREE._repr_html_()))
    assert shown.splitlines() == [*model_lines(TREE)]


def test_rules_and_comparisons_are_tables() -> None:
    rules = ft.rules_from_tree(TREE)
    found = ft.check(
        TREE, rules, runtimes=["native"], settings=ft.CheckSettings(limit=99)
    )
    assert rules._repr_html_().count("<tr>") == 1 + len(rules.rules)
    assert "<table" in found._repr_html_()
    for shown in (rules._repr_html_(), found._repr_html_()):
        assert shown.startswith("<style>div.fuzzytree .scrolls table")


@pytest.mark.parametrize("rows", [3, 25])
def test_predictions_are_a_table_of_the_first_rows(rows: int) -> None:
    values = np.zeros((rows, len(TREE.inputs)))
    shown = ft.run(TREE, values)._repr_html_()
    assert shown.count("<tr>") == 1 + min(rows, 10)
    assert ("the first 10 rows" in shown) == (rows == 25)
    assert f"<caption>{rows} rows: " in shown


def _words(shown: str) -> str:
    return re.sub(r"<style>.*?</style>|<[^>]*>", "", shown)
