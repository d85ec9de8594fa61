"""The page on adding a format is followed, word by word."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "how-to" / "add-a-format.md").read_text("utf-8")
SHOWN = dict(re.findall(r"<!-- (.+?) -->\n\n```\w+\n(.*?)```\n", PAGE, re.DOTALL))
TRY = """
import fuzzytree as ft
from fuzzytree.cli import main
from fuzzytree.testing import check_exporter, random_tree
check_exporter("turtle")
ft.save(ft.rules_from_tree(random_tree(1)), "a.yaml")
assert main(["convert", "a.yaml", "b.turtle", "--set", "indent=2"]) == 0
assert main(["convert", "b.turtle", "c.yaml"]) == 0
assert ft.load("c.yaml") == ft.load("a.yaml") == ft.load("b.turtle")
assert main(["formats", "--format", "turtle"]) == 0
"""


def _run(*words: str, folder: Path, path: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(path)}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment,
        text=True, capture_output=True, check=False,
    )  # fmt: skip


@pytest.mark.heavy
def test_a_format_is_added_to_this_repository(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("fuzzytree", "exporters", "schemas"):
        shutil.copytree(ROOT / name, copy / name, symlinks=True, ignore=ignored)
    (copy / "exporters" / "turtle.py").write_text(SHOWN["file: turtle.py"], "utf-8")
    table = copy / "exporters" / "table.py"
    text = table.read_text("utf-8")
    line = SHOWN["line: exporters/table.py"]
    assert "    }\n)\n" in text
    table.write_text(text.replace("    }\n)\n", f"{line}    }}\n)\n", 1), "utf-8")
    done = _run("-c", TRY, folder=tmp_path, path=copy)
    assert done.returncode == 0, done.stderr
    assert "default classes" in done.stdout


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return the folder of a package, made of what the page shows."""
    folder = tmp_path / "turtle"
    (folder / "turtle_rules").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(SHOWN["file: pyproject.toml"], "utf-8")
    module = folder / "turtle_rules" / "__init__.py"
    module.write_text(SHOWN["file: turtle.py"], "utf-8")
    (folder / "test_turtle.py").write_text(SHOWN["file: test_turtle.py"], "utf-8")
    return folder


@pytest.mark.heavy
def test_a_format_is_added_by_a_package(package: Path) -> None:
    _declare(package)
    done = _run("-c", TRY, folder=package, path=_paths(package))
    assert done.returncode == 0, done.stderr
    assert "default classes" in done.stdout
    words = ("-m", "pytest", "-q", "test_turtle.py")
    assert _run(*words, folder=package, path=_paths(package)).returncode == 0


@pytest.mark.heavy
def test_the_package_installs_as_the_page_says(package: Path) -> None:
    target = package / "installed"
    words = (
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--target",
        str(target),
        ".",
    )
    done = _run(*words, folder=package, path=ROOT)
    assert done.returncode == 0, done.stderr
    done = _run("-c", TRY, folder=package, path=_paths(target))
    assert done.returncode == 0, done.stderr


@pytest.mark.heavy
def test_a_package_that_cannot_be_imported_breaks_nothing_else(package: Path) -> None:
    _declare(package)
    (package / "turtle_rules" / "__init__.py").write_text("import no_such_module\n")
    code = (
        "import fuzzytree as ft\n"
        "from fuzzytree.cli import main\n"
        "from fuzzytree.testing import random_tree\n"
        "ft.save(random_tree(1), 'a.yaml')\n"
        "assert main(['convert', 'a.yaml', 'b.py']) == 0\n"
        "assert main(['formats']) == 0\n"
        "assert main(['convert', 'a.yaml', 'b.turtle', '--to', 'turtle']) == 2\n"
        "assert main(['convert', 'a.yaml', 'b.turtle']) == 2\n"
    )
    done = _run("-c", code, folder=package, path=_paths(package))
    assert done.returncode == 0, done.stderr
    fault = (
        "turtle-rules 1.0: turtle_rules:FORMAT raises ModuleNotFoundError: "
        "No module named 'no_such_module'"
    )
    assert f"  turtle: {fault}\n" in done.stdout
    assert f"the format 'turtle' cannot be used: {fault}\n" in done.stderr


def test_a_package_is_not_imported_for_formats_of_ours(package: Path) -> None:
    _declare(package)
    (package / "turtle_rules" / "__init__.py").write_text("raise SystemExit(7)\n")
    code = (
        "import fuzzytree as ft\n"
        "from fuzzytree.cli import main\n"
        "from fuzzytree.testing import random_tree\n"
        "ft.save(random_tree(1), 'a.yaml')\n"
        "assert main(['convert', 'a.yaml', 'b.py']) == 0\n"
        "assert main(['show', 'a.yaml']) == 0\n"
    )
    done = _run("-c", code, folder=package, path=_paths(package))
    assert done.returncode == 0, done.stderr


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("name", "module", "fault"),
    [
        ("yaml", "", "'yaml' is the name of a format of fuzzytree"),
        ("tortoise", "", "turtle_rules:FORMAT calls itself 'turtle'"),
        (
            "turtle",
            "FORMAT = 7\n",
            "turtle_rules:FORMAT is no fuzzytree.model.contracts.Format",
        ),
    ],
)
def test_a_format_that_cannot_be_taken_is_a_sentence(
    package: Path, name: str, module: str, fault: str
) -> None:
    _declare(package, name=name)
    if module:
        (package / "turtle_rules" / "__init__.py").write_text(module, "utf-8")
    code = "from fuzzytree.cli import main\nassert main(['formats']) == 0\n"
    done = _run("-c", code, folder=package, path=_paths(package))
    assert done.returncode == 0, done.stderr
    assert f"  {name}: turtle-rules 1.0: {fault}\n" in done.stdout


def _declare(folder: Path, name: str = "turtle") -> None:
    """Leave beside a package what its installation would leave."""
    info = folder / "turtle_rules-1.0.dist-info"
    info.mkdir()
    head = "Metadata-Version: 2.1\nName: turtle-rules\nVersion: 1.0\n"
    (info / "METADATA").write_text(head, "utf-8")
    points = f"[fuzzytree.formats]\n{name} = turtle_rules:FORMAT\n"
    (info / "entry_points.txt").write_text(points, "utf-8")


def _paths(folder: Path) -> Path:
    return Path(f"{folder}{os.pathsep}{ROOT}")
