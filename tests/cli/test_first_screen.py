"""What each verb prints by default fits a screen, and begins with its conclusion."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.cli.program import VERBS, main

WINE = Path(__file__).resolve().parents[2] / "examples" / "wine" / "wine.csv"
SCREEN = 30
"""Lines that a verb prints at most by default."""

HEAVY = pytest.mark.heavy  # seconds to half a minute
SLOW = ("audit", "stability")

FIRST_LINES = {
    "learn t.csv --target cultivar --columns-per-node 1 --leaves 4 -o t.yaml": (
        "accuracy 0.8"
    ),
    "collect t.csv --target cultivar -o t.state": "collected 178 rows 13 columns, 3 ",
    "show wine.yaml": "wine: fuzzy tree, 3 nodes, 4 leaves, depth 2",
    "page wine.yaml --data t.csv -o wine.html": "wrote wine.html 178 rows, ",
    "export wine.yaml -o wine.c": "wrote wine.c c, ",
    "convert wine.yaml wine.onnx": "wrote wine.onnx onnx, ",
    "convert wine.yaml wine.fcl": "wrote wine.fcl fcl, ",
    "convert wine.yaml wine.fll --allow-loss": "wrote wine.fll fll, ",
    "run wine.yaml t.csv -o p.csv": "predicted 178 rows barbera 49, barolo 62,",
    "run wine.yaml t.csv --why -o p.csv": "predicted 178 rows barbera 49, barolo",
    "why wine.yaml --data t.csv --number 66": "wine: grignolino by rule 3, probab",
    "check wine.yaml": "wine: none of 81 comparisons disagrees (238 ",
    "check wine.yaml bad.yaml": "wine: 2 of 83 comparisons disagree (238 ",
    "audit wine.yaml": "nothing found; 30 questions, ",
    "audit wine.yaml --data t.csv --target cultivar": "1 finding: 1 note; ",
    "require wine.yaml --that every__input__gets__a__class": (
        "wine.yaml: 1 requirement: 1 proved"
    ),
    "diff wine.yaml bad.yaml": "decisions have changed; ",
    "explain": "32 codes; `fuzzytree explain CODE` explains one",
    "explain FT203": "FT203 tree and raw rules differ (warning",
    "recheck audit.json wine.yaml": "the audit is right as far as it was checked",
    "bench wine.yaml --budget 6 --rows 1 --threads 1 --select native": "",
    "needs wine.yaml": "wine: needs 3 of 13 columns; 3 parts can be left out",
    "stability wine.yaml": "wine: 9 of 10 stability checks pass, none fails (",
    "formats": "13 formats, 16 runtimes; no extra is missing",
    "formats --format fcl": "fcl: .fcl, read and written, computes in float64",
    "doctor": "self-test passed: learning, writing, reading and running agree",
    "tactile": "",
}
"""How the output of each command begins; a time is part of the others' first lines."""


@pytest.fixture(scope="module")
def wine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the wine table, its tree, an audit and a damaged tree."""
    folder = tmp_path_factory.mktemp("wine")
    tree = ft.learn(
        str(WINE),
        target="cultivar",
        settings=ft.LearningSettings(columns_per_node=1, leaves=4),
    )
    shutil.copy(WINE, folder / "t.csv")
    ft.save(tree, folder / "wine.yaml")
    text = (folder / "wine.yaml").read_text("utf-8")
    (folder / "bad.yaml").write_text(text.replace("1.57421875", "1.25"), "utf-8")
    audit = ft.audit(str(folder / "wine.yaml"))
    (folder / "audit.json").write_text(audit.to_json(), "utf-8")
    return folder


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(one, marks=[HEAVY] * one.startswith("stability"))
        for one in FIRST_LINES
    ],
)
def test_a_verb_prints_its_conclusion_first_and_at_most_a_screen(
    command: str,
    wine: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(wine)
    main([word.replace("__", " ") for word in command.split()])
    out, err = capsys.readouterr()
    lines = [*out.splitlines(), *err.splitlines()]
    assert len(lines) <= SCREEN, "\n".join(lines)
    assert " ".join(lines[0].split()).startswith(FIRST_LINES[command])


def test_every_verb_has_a_command_here() -> None:
    assert {command.split()[0] for command in FIRST_LINES} == set(VERBS)


@pytest.mark.parametrize(
    "verb",
    ["check", "diff", "needs"] + [pytest.param(v, marks=HEAVY) for v in SLOW],
)
def test_verbose_adds_lines_and_changes_no_fact(
    verb: str,
    wine: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(wine)
    words = [verb, "wine.yaml", *(["bad.yaml"] if verb == "diff" else [])]
    words += ["--runtime", "native"] * (verb in ("check", "stability"))
    printed: list[str] = []
    for more in ([], ["--verbose"]):
        main([*words, *more])
        printed.append(capsys.readouterr().out)
    short, full = (text.splitlines() for text in printed)
    assert short[0] == full[0]
    assert len(full) > len(short)
    main([*words, "--json", "--quiet"])
    assert json.loads(capsys.readouterr().out)
