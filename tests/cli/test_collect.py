"""`collect` and `learn` make of parts of a table the model of the whole table."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO

import pytest

import fuzzytree as ft
from fuzzytree.cli.program import main
from fuzzytree.learning import Learner

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
    assert (
        main(["learn", "--no-test", *states[::-1], "--name", "wine", "-o", "a.yaml"])
        == 0
    )
    assert (
        main(["learn", "--no-test", str(WINE), "--target", "cultivar", "-o", "b.yaml"])
        == 0
    )
    assert Path("a.yaml").read_bytes() == Path("b.yaml").read_bytes()
    words = ["collect", *parts, "--target", "cultivar", "-o", "all.state"]
    assert main(words) == 0
    assert (
        main(["learn", "--no-test", "all.state", "--name", "wine", "-o", "c.yaml"]) == 0
    )
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
        (["collect", "part0.csv", "--inputs", "ash,size"], "no column 'size'"),
        (["collect", "part0.csv", "bad.csv"], "bad.csv has no column 'alcohol'"),
        (["collect", "part0.csv", "none.csv"], "none.csv: cannot be read"),
        (["learn", "part0.csv", "part1.csv"], "several tables: collect each of them"),
        (["learn", "part0.state", "part0.state"], "pass --repeated to count its rows"),
        (
            ["learn", "part0.state", "--rows-per-class", "9"],
            "--rows-per-class: states have kept their rows already",
        ),
        (["learn", "part0.state", "cut.state"], "cut.state: is no state that"),
        (["learn", "part0.state", "--target", "ash"], "the states have 'cultivar'"),
        (["learn", "part0.csv"], "name the column of the classes with --target"),
        (
            ["learn", "part0.state", "part1.csv"],
            "part1.csv is none: collect the tables",
        ),
        (
            ["learn", "part0.state", "other.state"],
            "other.state, beside part0.state: the",
        ),
        (["learn", "ab.state", "part0.state"], "part0.state, beside ab.state: a state"),
        (["learn", "empty.state"], "cannot learn from a table without rows"),
        (["learn", "part0.csv", "--for", "m.yaml"], "--for takes states: fuzzytree co"),
        (
            ["learn", "part0.state", "--for", "m.yaml"],
            "part0.state: is a state of `fuz",
        ),
        (["collect", "part0.csv", "part0.state"], "part0.state is a state, and a part"),
        (["collect", "state.arrow"], "state.arrow is a state that `fuzzytree collect`"),
        (["collect", "part0.csv", "class.csv"], "class.csv has no column 'cultivar'"),
        (
            ["collect", "part0.csv", "--for", "m.yaml", "--ignore", "ash"],
            "--ignore: --fo",
        ),
        (
            ["collect", "part0.csv", "--for", "part0.csv"],
            "part0.csv: is a table, and a model stands here",
        ),
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
    Path("class.csv").write_text("\n".join([f"{head}x", *rows]), "utf-8")
    Path("empty.csv").write_text(f"{head}\n", "utf-8")
    Path("folder").mkdir()
    for number in range(20):
        part = "text" if number == 17 else "part0"
        Path(f"folder/{number:02}.csv").write_bytes(Path(f"{part}.csv").read_bytes())
    Path("state.arrow").write_bytes(Path(state).read_bytes())
    collected("empty.csv")
    Learner.load(state).merge(Learner.load(collected(parts[1]))).save("ab.state")
    other = Learner("cultivar", ignore=["ash"])
    other.update(parts[1])
    other.save("other.state")
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


def test_a_folder_gives_the_file_of_the_whole_table(parts: list[str]) -> None:
    head = Path(parts[0]).read_text("utf-8").splitlines()[0]
    Path("rows/more").mkdir(parents=True)
    for number, part in enumerate(parts):
        Path(part).rename(f"rows/{'more/' * (number == 2)}{part}")
    Path("rows/a.csv").write_text(f"{head}\n", "utf-8")
    whole = ["learn", "--no-test", str(WINE), "--target", "cultivar", "--name", "wine"]
    assert main([*whole, "-o", "a.yaml"]) == 0
    for place, output in (("rows", "b.yaml"), ("rows/**/*.csv", "c.yaml")):
        words = ["learn", "--no-test", place, "--target", "cultivar", "--name", "wine"]
        assert main([*words, "-o", output]) == 0
        assert Path(output).read_bytes() == Path("a.yaml").read_bytes()


def test_a_second_pass_gives_the_supports_and_the_accuracy_on_all_rows(
    parts: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--target", "cultivar", "--name", "wine"]
    assert main(["learn", "--no-test", str(WINE), *words, "-o", "a.yaml"]) == 0
    few = ["--rows-per-class", "20", "-o", "first.state"]
    assert main(["collect", *parts, "--target", "cultivar", *few]) == 0
    assert main(["learn", "--no-test", "first.state", "-o", "few.yaml"]) == 0
    estimated = r"estimated supports of leaves .*`collect --for` counts all rows"
    assert re.search(estimated, capsys.readouterr().err)
    for model in ("a", "few"):
        states = [f"{part}.{model}.state" for part in parts]
        for part, state in zip(parts, states, strict=True):
            words = ["collect", part, "--target", "cultivar", "-o", state]
            assert main([*words, "--for", f"{model}.yaml"]) == 0
        capsys.readouterr()
        words = ["learn", "--no-test", *states, "--for", f"{model}.yaml", "--json"]
        assert main([*words, "-o", f"{model}.counted.yaml"]) == 0
        output = capsys.readouterr()
        facts = json.loads(output.out)
        assert facts["rows"] == 178
        assert sum(map(sum, (r.values() for r in facts["confusion"].values()))) == 178
        assert re.search(r"accuracy [01]\.\d{3} +on the rows that", output.err)
    assert Path("a.counted.yaml").read_bytes() == Path("a.yaml").read_bytes()
    counted = ft.load("few.counted.yaml")
    assert isinstance(counted, ft.FuzzyTree)
    assert sum(leaf.support or 0 for leaf in counted.leaves) == 178
    assert (
        main(["learn", "--no-test", states[0], "--for", "a.yaml", "-o", "x.yaml"]) == 2
    )
    assert "counts the leaves of another model" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["collect", "-", "-o", "out.state"],
        ["learn", "-", "-o", "out.yaml"],
        pytest.param(
            ["collect", "-", "--for", "m.yaml", "-o", "out.state"],
            marks=pytest.mark.heavy,
        ),
    ],
    ids=" ".join,
)
def test_an_interrupt_leaves_what_stood_there(words: list[str], tmp_path: Path) -> None:
    assert (
        main(
            ["learn", str(WINE), "--target", "cultivar", "-o", str(tmp_path / "m.yaml")]
        )
        == 0
    )
    output = tmp_path / words[-1]
    output.write_bytes(b"before")
    names = sorted(one.name for one in tmp_path.iterdir())
    program = [sys.executable, "-m", "fuzzytree", *words, "--target", "cultivar"]
    head, *rows = WINE.read_bytes().splitlines(keepends=True)
    was_read = threading.Event()

    def feed(stdin: IO[bytes]) -> None:
        """Write rows without end."""
        with contextlib.suppress(OSError), stdin:
            stdin.write(head)
            while True:
                stdin.write(b"".join(rows) * 400)  # more than a pipe takes
                was_read.set()

    with subprocess.Popen(
        program, stdin=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path
    ) as process:
        assert process.stdin is not None
        feeder = threading.Thread(target=feed, args=[process.stdin])
        feeder.start()
        assert was_read.wait(60)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
        assert process.stderr is not None
        error = process.stderr.read().decode()
        feeder.join()
    assert "Traceback" not in error
    assert output.read_bytes() == b"before"
    assert sorted(one.name for one in tmp_path.iterdir()) == names


def test_a_state_counts_twice_where_that_is_wanted(
    parts: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    state = collected(parts[0])
    words = ["learn", state, state, "--repeated", "-o", "twice.yaml", "--json"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 120
