"""Each next step that a verb prints can be taken."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import press
import pytest

from fuzzytree.exporters.table import TABLE
from tests.cli.conftest import Call

EXAMPLES = Path(__file__).resolve().parent.parent.parent / "examples"
SUFFIXES = [suffixes[0] for suffixes in TABLE.values()]
ROWS = [f"{k},{'soft' if k < 6 else 'firm'}\n" for k in range(12)]


@pytest.fixture(autouse=True)
def _here(folder: Path) -> None:
    Path("few.csv").write_text("".join(["a,grip\n", *ROWS]), "utf-8")
    odd = "".join(["a,grip\n", *ROWS]).replace(",", "@")
    Path("odd @.csv").write_text(odd, "utf-8")
    shutil.copy(EXAMPLES / "tipper.fll", "tipper.fll")
    shutil.copy(EXAMPLES / "tipper.fll", "tipper.txt")


def steps(call: Call, *words: str) -> list[list[str]]:
    """Take a step and each that is printed as the next one; return those behind it."""
    code, _, err = call(*words)
    assert code != 2, (words, err)
    return taken(call, err)


def taken(call: Call, printed: str) -> list[list[str]]:
    """Take each step that is printed as the next one, and those behind it."""
    texts = re.findall(
        r"next(?::|    ) fuzzytree (.*?)(?: \(.*\))?$", printed, re.MULTILINE
    )
    found = [shlex.split(text) for text in texts]
    for each in [*found]:
        found += steps(call, *each)
    return found


LEARN = ("learn", "few.csv", "--target", "grip", "--no-test")


@pytest.mark.one_in(6)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_follows_learning_works_with_every_format(call: Call, suffix: str) -> None:
    code, _, err = call(*LEARN, "-o", f"m{suffix}")
    if code == 2:  # the format does not hold the tree
        assert "cannot write few as" in err
        return
    (after,) = taken(call, err)
    model = "m.yaml" if Path("m.yaml").exists() else f"m{suffix}"
    assert after[:2] == ["check", model]
    assert after[-2:] == ["--data", "few.csv"]


def test_a_program_has_its_model_beside_it(call: Call) -> None:
    code, _, err = call(*LEARN, "--as", "rules", "-o", "m.sql")
    assert code == 0
    assert err.endswith(
        "wrote    m.sql\n"
        "wrote    m.yaml   the model; "
        "next: fuzzytree check m.yaml m.sql --data few.csv\n"
    )
    again = call("export", "m.yaml", "-o", "again.sql", "--quiet")
    assert again == (0, "", "")
    assert Path("again.sql").read_bytes() == Path("m.sql").read_bytes()


def test_another_model_beside_a_program_is_kept(call: Call) -> None:
    Path("m.yaml").write_text("mine", "utf-8")
    code, _, err = call(*LEARN, "-o", "m.sql")
    assert code == 0
    assert err.endswith(
        "wrote    m.sql\n"
        "kept     m.yaml   the file exists already, with another model\n"
    )
    assert Path("m.yaml").read_text("utf-8") == "mine"


def test_a_folder_where_the_model_goes_is_refused_before_learning(call: Call) -> None:
    Path("m.yaml").mkdir()
    err = "m.yaml: cannot be written: it is a folder\n"
    assert call(*LEARN, "-o", "m.sql") == (2, "", err)


@pytest.mark.heavy
def test_what_follows_learning_names_the_delimiter(call: Call) -> None:
    words = ("learn", "odd @.csv", "--delimiter", "@", "--target", "grip", "--no-test")
    (after,) = steps(call, *words, "-o", "m m.yaml")
    rest = ["--data", "odd @.csv", "--delimiter", "@"]
    assert after == ["check", "m m.yaml", *rest]


@pytest.mark.one_in(10)
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "begin", ["convert grip.yaml", "convert tipper.fll", "needs grip.yaml -o"]
)
def test_what_follows_writing_works_with_every_format(
    call: Call, begin: str, suffix: str
) -> None:
    words = [*begin.split(), f"new{suffix}"]
    words += ["--allow-loss"] if words[0] == "convert" else []
    code, _, err = call(*words)
    if code == 2:  # the format or the verb does not take the model
        assert "next" not in err
        return
    taken(call, err)


def test_what_a_suffix_does_not_say_is_an_option_or_not_checked(call: Call) -> None:
    as_fll = ("convert", "tipper.txt", "new.yaml", "--from", "fll")
    (after,) = steps(call, *as_fll)
    assert after == ["check", "tipper.txt", "new.yaml", "--from", "fll"]
    assert steps(call, "convert", "grip.yaml", "new.bin", "--to", "onnx") == []
    (after,) = steps(call, "convert", "grip.yaml", "new.onnx")
    assert after == ["check", "grip.yaml", "new.onnx"]


@pytest.mark.heavy
def test_the_steps_from_simulated_presses_lead_to_a_checked_tree(call: Call) -> None:
    press.main(["all", "--count", "4", "-o", "p.npz"])
    words = ("tactile", "features", "p.npz", "--features", "S1, S9")
    following = steps(call, *words, "-o", "t.csv")
    assert [each[0] for each in following] == ["learn", "check"]
