"""The order of the layers, kept by import-linter with the project's contracts."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

ROOT = Path(__file__).resolve().parent.parent


def test_no_layer_imports_a_higher_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    status = lint_imports(no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def test_every_module_of_the_package_has_its_layer() -> None:
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    contracts = tomllib.loads(text)["tool"]["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["type"] == "layers")
    placed = {name.strip() for layer in layers for name in re.split(r"[|:]", layer)}
    modules = {
        f"fuzzytree.{path.stem}"
        for path in (ROOT / "fuzzytree").iterdir()
        if path.name != "py.typed" and not path.name.startswith("__")
    }
    assert modules == placed


@pytest.mark.parametrize("package", ["decide", "diff", "findings"])
def test_the_map_of_a_package_names_each_of_its_modules(package: str) -> None:
    folder = ROOT / "fuzzytree" / "auditing" / package
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    text = (folder / "__init__.py").read_text("utf-8")
    assert set(re.findall(r"`(\w+)`", text)) == modules
