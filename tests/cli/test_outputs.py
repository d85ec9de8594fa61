"""No file that is read is written, and a file is written before anything is said."""

from __future__ import annotations

import importlib
import os
import shutil
from pathlib import Path

import click
import pytest

from fuzzytree.cli.console import OUTPUT
from fuzzytree.cli.program import VERBS
from fuzzytree.tactile.cli import command as tactile
from tests.cli.conftest import Call

TRAIN = "force,slip,class\n" + "1,0,soft\n2,0,soft\n3,1,firm\n4,1,firm\n" * 6
LEARN = ("learn", "train.csv", "--target", "class", "--no-test", "-o", "m.yaml")


def _commands() -> list[click.Command]:
    context = click.Context(tactile)
    actions = [tactile.get_command(context, name) for name in tactile.modules]
    verbs = [importlib.import_module(place).command for place in VERBS.values()]
    return [*verbs, *(action for action in actions if action is not None)]


def test_every_file_to_write_is_compared_with_the_files_to_read() -> None:
    names = {"output", "page", "picture", "front", "plots", "write_baseline", "record"}
    names.add("smt")
    for command in _commands():
        for option in command.params:
            is_file = option.name in names and option.type.name != "integer range"
            assert (option.type is OUTPUT) is is_file, (command.name, option.name)


@pytest.mark.parametrize(
    "words",
    [
        ("run", "grip.yaml", "grasps.csv", "-o", "grasps.csv"),
        ("run", "grip.yaml", "grasps.csv", "-o", "hard.csv"),
        ("run", "grip.yaml", "grasps.csv", "-o", "soft.csv"),
        ("run", "grip.yaml", "soft.csv", "-o", "grasps.csv"),
        ("run", "grip.yaml", "g*.csv", "-o", "grasps.csv"),
        ("run", "grip.yaml", "rows", "-o", "rows/a.csv"),
        ("run", "grip.yaml", "grasps.csv", "-o", "grip.yaml"),
        ("convert", "grip.yaml", "grip.yaml"),
        ("export", "grip.yaml", "-o", "grip.yaml"),
        ("needs", "grip.yaml", "-o", "grip.yaml"),
        ("bench", "grip.yaml", "--data", "grasps.csv", "-o", "grasps.csv"),
        ("audit", "grip.yaml", "--data", "grasps.csv", "--page", "grasps.csv"),
        ("show", "grip.yaml", "--picture", "grip.yaml"),
        ("tactile", "features", "cup=grasps.csv", "-o", "grasps.csv"),
        ("tactile", "calibrate", "grip.yaml", "10=a.ftr", "-o", "grip.yaml"),
        ("tactile", "record", "grip.yaml", "PORT", "-o", "grip.yaml", "--force"),
        ("tactile", "export", "grip.yaml", "grip.yaml"),
    ],
    ids=" ".join,
)
def test_a_file_that_is_read_is_not_written(
    call: Call, folder: Path, words: tuple[str, ...]
) -> None:
    os.link("grasps.csv", "hard.csv")
    Path("soft.csv").symlink_to("grasps.csv")
    Path("rows").mkdir()
    shutil.copyfile("grasps.csv", "rows/a.csv")
    before = {path: path.read_bytes() for path in folder.rglob("*.*") if path.is_file()}
    code, out, err = call(*words)
    output = words[-2] if words[-1] == "--force" else words[-1]
    message = f"{output}: cannot be written: it is read as well\n"
    assert (code, out, err) == (2, "", message)
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.usefixtures("folder")
def test_a_new_file_in_a_folder_that_is_read_is_written(call: Call) -> None:
    Path("rows").mkdir()
    Path("rows/a.csv").write_text(TRAIN, "utf-8")
    words = ("learn", "rows", "--target", "class", "--no-test", "-o", "rows/m.yaml")
    assert call(*words)[0] == call(*words)[0] == 0


@pytest.mark.usefixtures("folder")
def test_a_model_does_not_replace_its_table(call: Call) -> None:
    shutil.copyfile("grasps.csv", "t.yaml")
    words = ("learn", "t.yaml", "--target", "slip", "-o", "t.yaml")
    message = "t.yaml: cannot be written: it is read as well\n"
    assert call(*words) == (2, "", message)


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (LEARN, "m.yaml"),
        ((*LEARN[:-1], "m.c"), "m.yaml"),
        (("needs", "grip.yaml", "-o", "new.yaml"), "new.yaml"),
        (("convert", "grip.yaml", "new.c"), "new.c"),
        (("show", "grip.yaml", "--picture", "new.svg"), "new.svg"),
        (("audit", "grip.yaml", "--page", "new.html"), "new.html"),
        (
            ("collect", "train.csv", "--target", "class", "-o", "new.state"),
            "new.state",
        ),
    ],
    ids=lambda words: words[0] if isinstance(words, tuple) else words,
)
@pytest.mark.usefixtures("folder")
def test_a_reader_who_leaves_costs_no_file(
    call: Call, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], file: str
) -> None:
    Path("train.csv").write_text(TRAIN, "utf-8")

    def fail(*_: object, **__: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("click.echo", fail)
    assert call(*words)[0] == 141
    assert Path(file).stat().st_size
