"""The re-checker runs without the rest of fuzzytree."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

from fuzzytree import rechecking as rechecking
from fuzzytree.rechecking import recheck_files
from tests.rechecking.audits import small

FOLDER = Path(rechecking.__file__).parent


def imported(path: Path) -> set[str]:
    """Return the names of the modules that a file imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add("." * node.level + (node.module or ""))
    return found


def alone(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Copy the re-checker into an empty folder, and run it there.

    It runs without site-packages and without PYTHONPATH, so nothing else is found.
    """
    copy = folder / "alone"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(FOLDER, copy / "fuzzytree/rechecking", ignore=ignored)
    return subprocess.run(
        [sys.executable, "-E", "-S", "-m", "fuzzytree.rechecking", *arguments],
        cwd=copy,
        capture_output=True,
        text=True,
        check=False,
    )


def test_it_imports_nothing_but_itself_and_the_standard_library() -> None:
    for path in FOLDER.rglob("*"):
        if path.suffix == ".py":
            others = {name.split(".")[0] for name in imported(path)}
            own = {name for name in imported(path) if name.startswith("fuzzytree")}
            assert others <= {*sys.stdlib_module_names, "fuzzytree"}, path
            assert all(f"{n}.".startswith("fuzzytree.rechecking.") for n in own), path


def test_alone_in_an_empty_folder_it_checks_a_real_audit(tmp_path: Path) -> None:
    names = str(tmp_path / "audit.json"), str(tmp_path / "grip.yaml")
    for name, content in zip(names, small(), strict=True):
        Path(name).write_bytes(content)
    ran = alone(tmp_path, *names)
    reported = "\n".join(recheck_files(*names).lines()) + "\n"
    assert (ran.returncode, ran.stderr) == (2, "")
    verdict, *_, advice = ran.stdout.splitlines()
    assert verdict.endswith("checked again; 4 answers PROVED are unconfirmed")
    assert advice.startswith("no solver is at hand: install fuzzytree-toolkit[proofs]")
    assert "answers PROVED, confirmed by z3" in reported


def test_alone_it_reports_what_is_wrong(tmp_path: Path) -> None:
    audit, model = small()
    (tmp_path / "audit.json").write_bytes(audit.replace(b'"minimum"', b'"product"', 1))
    (tmp_path / "grip.yaml").write_bytes(model)
    ran = alone(tmp_path, f"..{os.sep}audit.json", f"..{os.sep}grip.yaml")
    assert (ran.returncode, ran.stderr) == (1, "")
    assert "WRONG: the policy is not the model's\n" in ran.stdout


def test_alone_it_prints_its_usage(tmp_path: Path) -> None:
    ran = alone(tmp_path, "audit.json")
    usage = (
        "usage: python -m fuzzytree.rechecking [--solver PROGRAM] AUDIT.json "
        "MODEL.yaml\n       python -m fuzzytree.rechecking [--solver PROGRAM] "
        "DIFF.json OLD.yaml NEW.yaml\n"
    )
    assert (ran.returncode, ran.stdout, ran.stderr) == (2, "", usage)
