"""A small tree that answers grasps, its files, and the command line to call."""

from __future__ import annotations

import io
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

import fuzzytree as ft
from fuzzytree.cli.program import main
from fuzzytree.model.rulebase import Band, Term, Variable
from fuzzytree.model.tree import Branch, FuzzyTree, Leaf, Node

GRASPS = "slip,force,note,grip\n0,1.5,a,soft\n1,2.5,b,firm\n0,3,c,loose\n1,,d,firm\n"

Call = Callable[..., tuple[int, str, str]]


def grip() -> FuzzyTree:
    """Return a tree of two nodes and three leaves."""
    low = Term("low", Band(high=2.0, right=4.0))
    high = Term("high", Band(low=2.0, left=0.0))
    none = Term("none", Band(high=0.5, right=1.5))
    much = Term("much", Band(low=0.5, left=-0.5))
    return FuzzyTree(
        "grip",
        ("firm", "loose", "soft"),
        (
            Variable("force", (low, high), unit="N", low=0.0, high=5.0),
            Variable("slip", (none, much)),
        ),
        (
            Node(
                "force",
                (2.0,),
                (0, 1),
                (Branch(("low",), leaf=1), Branch(("high",), node=2)),
            ),
            Node(
                "slip",
                (0.5,),
                (0, 1),
                (Branch(("none",), leaf=2), Branch(("much",), leaf=3)),
            ),
        ),
        (Leaf("soft", support=4), Leaf("loose", support=1), Leaf("firm", support=2)),
        columns=("slip", "force", "weight"),
    )


@pytest.fixture(scope="session")
def originals(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a tree, its rules and its ONNX graph, to be copied."""
    path = tmp_path_factory.mktemp("originals")
    ft.save(grip(), path / "grip.yaml")
    ft.save(ft.rules_from_tree(grip()), path / "rules.yaml")
    ft.save(grip(), path / "grip.onnx")
    return path


@pytest.fixture
def folder(originals: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder, made the current one, with a tree, rules, ONNX and a table."""
    monkeypatch.chdir(tmp_path)
    for path in originals.iterdir():
        shutil.copyfile(path, tmp_path / path.name)
    (tmp_path / "grasps.csv").write_text(GRASPS, "utf-8")
    return tmp_path


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Call:
    """Return a function that runs the command line: exit code, stdout, stderr."""

    def run(*words: str, stdin: bytes = b"") -> tuple[int, str, str]:
        stream = io.BufferedReader(io.BytesIO(stdin))
        monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=stream))
        code = main(words)
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def heard() -> Iterator[None]:
    """Let a hang-up be heard, which `nohup` has all that it starts ignore."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)
