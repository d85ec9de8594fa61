"""What converters make of trees: cases, rows at cuts, and the tables of the page."""

from __future__ import annotations

import doctest
import json
from functools import partial
from pathlib import Path
from typing import Any

import conversions as module
import numpy as np
import pytest

ANSWERS = {
    "routes": ["PROVED", "PROVED"],
    "scores": ["PROVED", "PROVED"],
    "labels": ["PROVED", "open"],
    "missing values": ["DIFFER", "DIFFER"],
}


def test_the_examples_hold() -> None:
    assert not doctest.testmod(module).failed


def test_rows_are_at_and_beside_the_cuts() -> None:
    cuts = [np.array([0.5, 2.0]), np.array([])]
    table = module.at_cuts(cuts, np.float32)
    assert table.dtype == np.float32
    below, above = (np.nextafter(np.float32(0.5), np.float32(end)) for end in (0, 1))
    assert {below, np.float32(0.5), above} <= {*table[:, 0].tolist()}


def test_each_kind_has_a_case() -> None:
    kinds = {kind for case in module.CASES for kind in case.kind.split(", ")}
    assert kinds == {*module.KINDS, ""}


def test_a_case_without_its_package_is_not_run() -> None:
    case = module.Case("D9", "a forest", "nothing", "no-such-package", _fail)
    line = module.judged(case)
    assert line["remark"] == "not run: no-such-package is not installed"
    assert line["remark"] in module.cells(line)


def _fail(_folder: Path) -> module.Figures:
    raise AssertionError("it ran")


def test_a_wrong_answer_among_the_right_conversions_is_an_error() -> None:
    def judge(answers: dict[str, list[str]], _folder: Path) -> module.Figures:
        return {"answers": answers, "leaves": 2, "differing": {}}

    wrong = {**ANSWERS, "scores": ["PROVED", "DIFFER"]}
    for answers, is_right in ((ANSWERS, True), (wrong, False)):
        case = module.Case("", "a tree", "c", "numpy", partial(judge, answers))
        if is_right:
            assert module.cells(module.judged(case))[2:5] == ["2", "PROVED", "PROVED"]
        else:
            with pytest.raises(AssertionError):
                module.judged(case)


def test_the_page_has_what_its_figures_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: Any = json.loads(module.FIGURES.read_bytes())
    page = tmp_path / "page.md"
    page.write_text(module.PAGE.read_text("utf-8"), "utf-8")
    monkeypatch.setattr(module, "PAGE", page)
    monkeypatch.setattr(module, "FIGURES", tmp_path / "figures.json")
    shown = page.read_text("utf-8")
    module.write(figures)
    assert page.read_text("utf-8") == shown
    assert json.loads((tmp_path / "figures.json").read_bytes()) == figures


@pytest.mark.heavy
def test_three_kinds_are_found_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for package in ("skl2onnx", "onnxmltools", "lightgbm", "treelite"):
        pytest.importorskip(package)
    monkeypatch.setattr("sys.argv", ["conversions.py", "--only", "D1,D2,D5"])
    module.main()
    lines = [line.split(" | ") for line in capsys.readouterr().out.splitlines()]
    proved = {
        (line[0], line[2]): line[3]
        for line in lines
        if line[2] in ("skl2onnx", "onnxmltools")
    }
    assert proved == {
        ("D1", "skl2onnx"): "routes, scores, labels",
        ("D1, D2", "skl2onnx"): "routes, scores",
        ("D5", "onnxmltools"): "nothing",
    }
