"""Each next step that a verb prints can be taken."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import press
import pytest

import fuzzytree as ft
from fuzzytree.exporters.table import TABLE
from fuzzytree.model import FuzzySystem
from fuzzytree.semantics.samples import all_samples
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


def test_a_system_is_not_checked_on_the_texts_of_a_table(call: Call) -> None:
    Path("mixed.csv").write_text(mixed_table(), "utf-8")
    words = ("learn", "mixed.csv", "--target", "the class", "--as", "system")
    (after,) = steps(call, *words, "--no-test", "-o", "m.yaml")
    assert after == ["check", "m.yaml"]


@pytest.mark.heavy
def test_what_follows_learning_names_the_delimiter(call: Call) -> None:
    words = ("learn", "odd @.csv", "--delimiter", "@", "--target", "grip", "--no-test")
    (after,) = steps(call, *words, "-o", "m m.yaml")
    rest = ["--data", "odd @.csv", "--delimiter", "@"]
    assert after == ["check", "m m.yaml", *rest]


@pytest.mark.one_in(10)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_follows_needs_works_with_every_format(call: Call, suffix: str) -> None:
    code, _, err = call("needs", "grip.yaml", "-o", f"new{suffix}")
    if code == 2:  # the format does not take the model
        assert "next" not in err
        return
    taken(call, err)


WINE = str(EXAMPLES / "wine" / "wine.csv")
LEARNED = {
    "tree of one leaf": (WINE, "cultivar", "--leaves", "1"),
    "tree of single columns": (WINE, "cultivar", "--columns-per-node", "1"),
    "tree of combinations": (WINE, "cultivar"),
    "tree of the paper": (WINE, "cultivar", "--mode", "paper"),
    "tree of categories": ("mixed.csv", "the class"),
    "relative rules": ("mixed.csv", "the class", "--as", "rules"),
    "raw rules": ("mixed.csv", "the class", "--as", "rules", "--terms", "raw"),
    "system": ("mixed.csv", "the class", "--as", "system"),
    "product": (
        *("mixed.csv", "the class", "--as", "rules"),
        *("--conjunction", "product"),
    ),
}
SAMPLES = [
    name
    for name, model in all_samples().items()
    if not isinstance(model, FuzzySystem)
    or name in ("Sugeno, numbers", "Mamdani, centroid", "gaussian curves")
    or name in ("several rule blocks", "inputs clamped to their range")
]
KINDS = [*LEARNED, "grip.yaml", "tipper.fll", *SAMPLES]


def mixed_table() -> str:
    """Return rows with text, missing cells, and names and classes with spaces."""
    rows = ["re gion,q r,z-1,the class\n"]
    for k in range(48):
        region = ("north", "south side", '"x""y"', "")[k % 4]
        q = ("1.5", "2.5", "", "4.25", "7.125")[k % 5]
        is_first = k % 4 in (0, 3) and q in ("1.5", "2.5", "")
        label = "a b" if is_first else "c" if k % 7 < 4 else '"d,d"'
        rows.append(f"{region},{q},{k % 7 / 7:.3f},{label}\n")
    return "".join(rows)


@pytest.fixture(scope="module")
def written_kinds() -> dict[str, bytes]:
    """Return the files that were learned so far, by kind."""
    return {}


def model_of(kind: str, call: Call, written: dict[str, bytes]) -> tuple[str, list[str]]:
    """Write the model of a kind; return its file, and how a check reads its table."""
    if kind in ("grip.yaml", "tipper.fll"):
        shutil.copy(EXAMPLES / kind, f"my {kind}")
        return f"my {kind}", []
    if kind in SAMPLES:
        ft.save(all_samples()[kind], "my model.yaml")
        return "my model.yaml", []
    table, target, *options = LEARNED[kind]
    Path("mixed.csv").write_text(mixed_table(), "utf-8")
    if kind not in written:
        words = ("learn", table, "--target", target, *options, "--no-test", "--quiet")
        assert call(*words, "-o", "my model.yaml")[0] == 0
        written[kind] = Path("my model.yaml").read_bytes()
    Path("my model.yaml").write_bytes(written[kind])
    return "my model.yaml", ["--data", table] if kind != "system" else []


@pytest.mark.one_in(25)
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_without_a_word_or_within_a_bound_is_the_same(
    call: Call, kind: str, suffix: str, written_kinds: dict[str, bytes]
) -> None:
    model, data = model_of(kind, call, written_kinds)
    code, _, err = call("convert", model, f"new{suffix}")
    if code != 0:  # it lists the losses, or why there is no place at all
        assert not Path(f"new{suffix}").exists()
        code, _, err = call("convert", model, f"new{suffix}", "--allow-loss")
        assert ("lost     " in err) == (code == 0)
    following = re.findall(r"^next     fuzzytree (.*?)(?: \(.*\))?$", err, re.MULTILINE)
    is_shown = re.search(r"^differs  fuzzytree ", err, re.MULTILINE) is not None
    assert len(following) == (code == 0 and not is_shown)
    for text in following:
        result = call(*shlex.split(text))
        assert result[0] == 0, (text, *result)
        if data:
            result = call(*shlex.split(text), *data, "--generate", "40")
            assert result[0] == 0, (text, *result)


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
