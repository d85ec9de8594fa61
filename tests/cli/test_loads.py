"""Each verb loads what it needs and nothing else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = (
    *("onnx", "onnxruntime", "sklearn", "skfuzzy", "scipy", "pandas", "polars"),
    *("pyarrow", "matplotlib", "rich", "narwhals", "serial"),
)
ASK = """
import sys
from fuzzytree.cli import main
code = main({words!r})
found = {names!r}
print(code, *(name for name in found if name in sys.modules), file=sys.stderr)
"""
WIDE = ("--limit", "50", "--quiet")
LEARN = (
    *("learn", "grasps.csv", "--target", "grip", "--ignore", "note", "--quiet"),
    *("-o", "learnt.yaml"),
)


@pytest.mark.parametrize(
    ("words", "libraries"),
    [
        (("show", "grip.yaml"), ""),
        (("run", "grip.yaml", "grasps.csv", "--quiet"), ""),
        (("export", "grip.yaml", "-o", "other.yaml", "--quiet"), ""),
        (("export", "grip.yaml", "-o", "other.py", "--quiet"), ""),
        (LEARN, ""),
        (("check", "grip.yaml", "--runtime", "native", *WIDE), ""),
        (("formats",), "onnx onnxruntime"),
        (("needs", "grip.yaml", "--quiet"), "onnx"),
        (("export", "grip.yaml", "-o", "other.onnx", "--quiet"), "onnx onnxruntime"),
        (("run", "grip.onnx", "grasps.csv", "--quiet"), "onnx onnxruntime"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, tuple) else value,
)
def test_a_verb_loads_no_library_that_it_does_not_need(
    folder: Path, words: tuple[str, ...], libraries: str
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", ASK.format(words=words, names=HEAVY)],
        cwd=folder, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stderr.split() == ["0", *libraries.split()]


@pytest.mark.parametrize("verb", ["show", "run"])
def test_verbs_that_read_a_model_load_neither_learner_nor_check(
    folder: Path, verb: str
) -> None:
    words = [verb, "grip.yaml", *(["grasps.csv", "--quiet"] if verb == "run" else [])]
    names = ("fuzzytree.learning", "fuzzytree.checking", "fuzzytree.timing")
    done = subprocess.run(
        [sys.executable, "-c", ASK.format(words=words, names=names)],
        cwd=folder, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stderr == "0\n"
