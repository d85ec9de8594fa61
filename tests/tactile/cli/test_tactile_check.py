"""`fuzzytree tactile check`: a shipped file held against its model."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fuzzytree import export, learn, save, table
from fuzzytree.cli.program import main
from fuzzytree.model.tree import FuzzyTree


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, values in (("one", [1.0, 2.0, 8.0, 9.0]), ("two", [1.0, 6.0, 8.0, 9.0])):
        areas = np.array(values)[:, np.newaxis]
        tree = learn(
            table(areas, columns=["area"]), target=["s", "s", "l", "l"], name=name
        )
        save(tree, f"{name}.yaml")
    words = ["tactile", "export", "one.yaml", "one.onnx", "--sensor", "4x4", "--quiet"]
    assert main(words) == 0
    return tmp_path


def test_a_shipped_file_agrees_with_its_model(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(["tactile", "check", "one.yaml", "one.onnx", "--json"]) == 0
    stated = json.loads(capsys.readouterr().out)
    assert stated["ok"]
    assert [one["verdict"] for one in stated["check"]["comparisons"]] == ["agrees"] * 5


def test_a_file_of_another_model_ends_with_1(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(["tactile", "check", "two.yaml", "one.onnx"]) == 1
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("two: 3 of 5 comparisons disagree (")


def test_what_is_no_file_of_frames_ends_with_2(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("rows.onnx").write_bytes(export(learn_area(), "onnx").content)
    capsys.readouterr()
    assert main(["tactile", "check", "one.yaml", "rows.onnx"]) == 2
    assert capsys.readouterr().err == (
        "rows.onnx: the file takes rows, and not frames of a sensor; "
        "`fuzzytree check` checks it\n"
    )
    assert main(["tactile", "check", "one.yaml", "none.onnx"]) == 2
    assert capsys.readouterr().err == (
        "none.onnx: cannot be read: no such file or directory\n"
    )


def learn_area() -> FuzzyTree:
    areas = np.array([[1.0], [9.0]])
    return learn(table(areas, columns=["area"]), target=["s", "l"])
