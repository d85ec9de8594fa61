"""All of tactile can be taken out: a folder, and one line in each table."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TABLES = {
    "fuzzytree/cli/program.py": 1,
    "fuzzytree/runtimes/onnxruntime.py": 1,
    "schemas/generation.py": 1,
}
"""Files of the core with a table, and how many lines of it name tactile."""

IMPORT_ALL = """
import importlib, pkgutil, fuzzytree
engines = "fuzzytree.api.engines."  # whose packages need not be installed
for found in pkgutil.walk_packages(fuzzytree.__path__, "fuzzytree."):
    if not found.name.endswith("__main__") and not found.name.startswith(engines):
        importlib.import_module(found.name)
assert not any("tactile" in name for name in __import__("sys").modules)
"""


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy the project without the room and without its lines in the tables."""
    folder = tmp_path_factory.mktemp("core")
    left_out = shutil.ignore_patterns("tactile", "__pycache__", "board.schema.json")
    for name in ("fuzzytree", "exporters", "schemas", "tests", "examples"):
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=left_out)
    shutil.copy(ROOT / "pyproject.toml", folder)
    shutil.copy(ROOT / "README.md", folder)
    for name in (*TABLES, "fuzzytree/__init__.pyi", "pyproject.toml"):
        path = folder / name
        lines = path.read_text("utf-8").splitlines(keepends=True)
        path.write_text("".join(one for one in lines if "tactile" not in one), "utf-8")
    return folder


def _python(core: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words],
        cwd=core,
        env={**os.environ, "PYTHONPATH": str(core)},
        text=True,
        capture_output=True,
        check=False,
    )


def test_the_core_names_tactile_in_its_tables_alone() -> None:
    found: dict[str, int] = {}
    for folder in ("fuzzytree", "exporters", "schemas"):
        for path in (ROOT / folder).rglob("*.py"):
            name = str(path.relative_to(ROOT))
            if not name.startswith("fuzzytree/tactile/"):
                text = path.read_text("utf-8")
                found[name] = len(re.findall("^.*(?:tactile|recognition)", text, re.M))
    assert {name: count for name, count in found.items() if count} == TABLES


@pytest.mark.heavy
def test_every_module_of_the_core_can_be_imported_without_tactile(core: Path) -> None:
    done = _python(core, "-c", IMPORT_ALL)
    assert done.returncode == 0, done.stderr


@pytest.mark.heavy
def test_the_command_line_works_without_tactile(core: Path) -> None:
    table = core / "examples" / "wine" / "wine.csv"
    for words in (
        ["learn", str(table), "--target", "cultivar", "-o", "wine.yaml", "--no-test"],
        ["show", "wine.yaml"],
        ["export", "wine.yaml", "-o", "wine.c"],
        ["run", "wine.yaml", str(table)],
        ["check", "wine.yaml"],
    ):
        done = _python(core, "-m", "fuzzytree", *words)
        assert done.returncode == 0, done.stderr
    done = _python(core, "-m", "fuzzytree", "tactile")
    assert done.returncode == 2
    assert "no verb 'tactile'" in done.stderr


@pytest.mark.heavy
@pytest.mark.parametrize("room", ["model", "numerics", "semantics"])
def test_the_tests_of_a_room_pass_without_tactile(room: str, core: Path) -> None:
    words = ["-m", "pytest", f"tests/{room}", "-q", "-x", "-p", "no:cacheprovider"]
    done = _python(core, *words)
    assert done.returncode == 0, done.stdout
