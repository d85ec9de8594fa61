"""Each verb loads what it needs and nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

HEAVY = (
    *("onnx", "onnxruntime", "sklearn", "skfuzzy", "scipy", "pandas", "polars"),
    *("pyarrow", "matplotlib", "rich", "narwhals", "serial"),
)
ASK = """
import json, os, sys
import fuzzytree.cli, numpy
assert not [name for name in {names!r} if name in sys.modules]
for words in {lines!r}:
    kept, pipe = os.pipe()
    if not os.fork():
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        code = fuzzytree.cli.main(words)
        found = [name for name in {names!r} if name in sys.modules]
        os.write(pipe, json.dumps([code, *found]).encode())
        os._exit(0)
    os.close(pipe)
    os.wait()
    print(os.read(kept, 4096).decode())
    os.close(kept)
"""
WIDE = ("--generate", "50", "--quiet")
LEARN = (
    *("learn", "grasps.csv", "--target", "grip", "--ignore", "note", "--quiet"),
    *("-o", "learnt.yaml"),
)


LOADED = {
    ("show", "grip.yaml"): "",
    ("run", "grip.yaml", "grasps.csv", "--quiet"): "pyarrow",
    ("export", "grip.yaml", "-o", "other.yaml", "--quiet"): "",
    ("export", "grip.yaml", "-o", "other.py", "--quiet"): "",
    LEARN: "pyarrow",
    ("check", "grip.yaml", "--runtime", "native", *WIDE): "",
    ("formats", "--format", "onnx"): "onnx onnxruntime",
    ("needs", "grip.yaml", "--quiet"): "onnx",
    ("export", "grip.yaml", "-o", "other.onnx", "--quiet"): "onnx onnxruntime",
    ("run", "grip.onnx", "grasps.csv", "--quiet"): "onnx onnxruntime pyarrow",
}


def loaded(
    folder: Path, lines: Sequence[tuple[str, ...]], names: tuple[str, ...]
) -> list[list[int | str]]:
    """Return, for each line, its exit code and which names a process then has.

    Each line has a process of its own, a copy of one that knows the verbs alone.
    """
    done = subprocess.run(
        [sys.executable, "-c", ASK.format(lines=lines, names=names)],
        cwd=folder, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stderr == ""
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_a_verb_loads_no_library_that_it_does_not_need(folder: Path) -> None:
    found = loaded(folder, [*LOADED], HEAVY)
    assert dict(zip(LOADED, found, strict=True)) == {
        words: [0, *libraries.split()] for words, libraries in LOADED.items()
    }


def test_learning_and_predicting_do_not_load_the_decider_of_audits(
    folder: Path,
) -> None:
    lines = [
        LEARN,
        ("run", "grip.yaml", "grasps.csv", "--quiet"),
        ("show", "grip.yaml"),
    ]
    assert loaded(folder, lines, ("fuzzytree.auditing.decide",)) == [[0]] * 3


@pytest.mark.heavy
def test_verbs_that_read_a_model_load_neither_learner_nor_check(folder: Path) -> None:
    lines = [("show", "grip.yaml"), ("run", "grip.yaml", "grasps.csv", "--quiet")]
    names = (
        "fuzzytree.learning.learner",
        "fuzzytree.checking.representations",
        "fuzzytree.benchmarking.study",
    )
    assert loaded(folder, lines, names) == [[0]] * 2
