"""`collect` and `learn` make of parts of a table the model of the whole table."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fuzzytree.cli.program import main

WINE = Path(__file__).resolve().parents[2] / "examples" / "wine" / "wine.csv"


@pytest.fixture
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return three files that have the rows of a table between them."""
    monkeypatch.chdir(tmp_path)
    head, *rows = WINE.read_text("utf-8").splitlines()
    names: list[str] = []
    for number in range(3):
        names.append(f"part{number}.csv")
        Path(names[-1]).write_text("\n".join([head, *rows[number::3]]) + "\n", "utf-8")
    return names


def collected(part: str) -> str:
    """Return the name of the state that was collected of a part."""
    state = part.replace(".csv", ".state")
    assert main(["collect", part, "--target", "cultivar", "-o", state]) == 0
    return state


def test_states_of_parts_give_the_file_of_the_whole_table(parts: list[str]) -> None:
    states = [collected(part) for part in parts]
    assert main(["learn", *states[::-1], "--name", "wine", "-o", "a.yaml"]) == 0
    assert main(["learn", str(WINE), "--target", "cultivar", "-o", "b.yaml"]) == 0
    assert Path("a.yaml").read_bytes() == Path("b.yaml").read_bytes()
    words = ["collect", *parts, "--target", "cultivar", "-o", "all.state"]
    assert main(words) == 0
    assert main(["learn", "all.state", "--name", "wine", "-o", "c.yaml"]) == 0
    assert Path("c.yaml").read_bytes() == Path("b.yaml").read_bytes()


def test_facts_are_printed_as_json(
    parts: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["collect", parts[0], "--target", "cultivar", "-o", "a.state", "--json"]
    assert main(words) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["rows"], facts["columns"], facts["classes"]) == (60, 13, 3)
    assert len(facts["digest"]) == 64


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["collect", "part0.csv", "part0.csv"], "part0.csv is named more than once"),
        (["collect", "part0.csv", "--columns", "ash,size"], "no column 'size'"),
        (["collect", "part0.csv", "bad.csv"], "bad.csv has no column 'alcohol'"),
        (["collect", "part0.csv", "text.csv"], "text.csv:3: column 'alcohol' holds"),
        (["collect", "part0.csv", "none.csv"], "none.csv: cannot be read"),
        (["learn", "part0.csv", "part1.csv"], "several tables: collect each of them"),
        (["learn", "part0.state", "part0.state"], "pass --repeated to count its rows"),
        (["learn", "part0.state", "cut.state"], "cut.state: is no state that"),
        (["learn", "part0.state", "--target", "ash"], "the states have 'cultivar'"),
        (["learn", "part0.csv"], "name the column of the classes with --target"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_is_wrong_with_a_part_is_one_sentence_and_writes_nothing(
    words: list[str],
    message: str,
    parts: list[str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    state = collected(parts[0])
    Path("cut.state").write_bytes(Path(state).read_bytes()[:900])
    head, *rows = Path(parts[1]).read_text("utf-8").splitlines()
    Path("bad.csv").write_text("\n".join([f"x{head}", *rows]), "utf-8")
    rows[1] = "strong" + rows[1][rows[1].index(",") :]
    Path("text.csv").write_text("\n".join([head, *rows]), "utf-8")
    capsys.readouterr()
    if words[0] == "collect":
        words = [*words, "--target", "cultivar", "-o", "out.state"]
    else:
        words = [*words, "-o", "out.yaml"]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert not Path("out.state").exists()
    assert not Path("out.yaml").exists()


def test_a_state_counts_twice_where_that_is_wanted(
    parts: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    state = collected(parts[0])
    words = ["learn", state, state, "--repeated", "-o", "twice.yaml", "--json"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 120
