"""`fuzzytree page`: what it writes and says, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

import fuzzytree as ft
from fuzzytree.cli.program import main
from fuzzytree.testing import random_tree


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the file of a tree in the current folder."""
    monkeypatch.chdir(tmp_path)
    ft.save(random_tree(1, inputs=1, combinations=0), "tree.yaml")
    return "tree.yaml"


def test_a_page_is_written_and_its_size_is_reported(
    model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["page", model, "-o", "tree.html"]) == 0
    content = Path("tree.html").read_text("utf-8")
    assert '"command":"fuzzytree why tree.yaml"' in content
    size = f"{len(content.encode()) / 1000:.0f} kB"
    message = f"wrote    tree.html {size}; open it in a browser\n"
    assert capsys.readouterr().err == message


def test_the_first_rows_of_a_long_table_are_said_to_be_so(
    model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    [name] = ft.load(model).inputs
    Path("rows.csv").write_text(f"{name}\n" + "1\n" * 500)
    assert main(["page", model, "--data", "rows.csv", "-o", "tree.html"]) == 0
    assert "the first 300 of 500 rows, " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-o", "tree.txt"], "-o tree.txt: a page's name ends in .html\n"),
        (["-o", "tree.html", "--data", "no.csv"], "no.csv: cannot be read: no such"),
        (["-o", "tree.html", "--data", "other.csv"], "other.csv has no column"),
        ([], "Missing option '-o'"),
    ],
)
def test_what_cannot_be_written_is_refused_and_no_file_is_there(
    model: str, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("other.csv").write_text("other\n1\n")
    assert main(["page", model, *words]) == 2
    assert message.lower() in capsys.readouterr().err.lower()
    assert not Path("tree.html").exists()
    assert not Path("tree.txt").exists()
