"""The layout: every package is in the map, and every kind of installation works."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
import yaml

import fuzzytree as ft

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
EXPRESSION = r"\$\{\{ ([\w.-]+) \}\}"  # of a workflow
HOMES = {
    "fuzzytree": "fuzzytree",
    "exporters": "fuzzytree.exporters",
    "schemas": "fuzzytree.schemas",
}
GROW_A_MODEL = """
import sys
import fuzzytree
from importlib.resources import files
heavy = {"numpy", "onnx", "onnxruntime", "sklearn", "yaml", "pandas"} & set(sys.modules)
assert not heavy, heavy
assert "site-packages" in fuzzytree.__file__ or EDITABLE, fuzzytree.__file__
assert (files("fuzzytree") / "py.typed").is_file()
for name in ("tree.schema.json", "rulebase.schema.json"):
    assert (files("fuzzytree.schemas") / name).is_file(), name
for name in ("page.html", "parts.html"):
    assert (files("fuzzytree.report") / "templates" / name).is_file(), name
import numpy as np
values = np.array([[1.0], [1.5], [2.0], [2.5], [7.0], [7.5], [8.0], [8.5]])
table = fuzzytree.table(values, columns=["size"])
tree = fuzzytree.learn(table, target=list("aaaabbbb"))
rules = fuzzytree.rules_from_tree(tree)
fuzzytree.save(rules, "model.yaml")
assert fuzzytree.load("model.yaml") == rules
print(len(tree.leaves), "leaves")
"""

USE_THE_TYPES = """\
import fuzzytree as ft
from fuzzytree.exporters import find_format

tree = ft.learn("table.csv", target="y", leaves=4)
reveal_type(ft.learn)
reveal_type(find_format)
ft.learn("table.csv", target="y", leafs=4)
"""


def test_every_package_is_in_the_map() -> None:
    found: set[str] = set()
    for folder, name in HOMES.items():
        for init in (ROOT / folder).rglob("__init__.py"):
            inner = init.parent.relative_to(ROOT / folder).parts
            if not (inner and (ROOT / folder / inner[0]).is_symlink()):
                found.add(".".join([name, *inner]))
    assert found == set(_project()["tool"]["setuptools"]["packages"])


@pytest.mark.parametrize("folder", ["exporters", "schemas"])
def test_a_link_in_the_package_leads_to_the_folder_at_the_top(folder: str) -> None:
    link = ROOT / "fuzzytree" / folder
    assert link.is_symlink()
    assert link.readlink() == Path("..") / folder
    assert link.resolve() == ROOT / folder


def test_every_file_that_is_no_code_is_package_data() -> None:
    data = _project()["tool"]["setuptools"]["package-data"]
    for folder, name in HOMES.items():
        for path in sorted((ROOT / folder).rglob("*")):
            is_code = path.suffix in {".py", ".pyc"} or path.is_dir()
            if is_code or (folder == "fuzzytree" and _is_linked(path)):
                continue
            parts = path.relative_to(ROOT / folder).parent.parts
            packages = [".".join([name, *parts[:end]]) for end in range(len(parts) + 1)]
            patterns = [one for key in (*packages, "*") for one in data.get(key, [])]
            assert any(map(path.match, patterns)), path


def test_the_version_of_the_package_is_that_of_the_changelog() -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    newest = re.search(r"^## (\d+\.\d+\.\d+)", text, re.MULTILINE)
    assert newest is not None
    assert newest.group(1) == _project()["project"]["version"]


@pytest.mark.heavy
@pytest.mark.parametrize("how", ["editable", "wheel from sdist"])
def test_an_installation_without_extras_learns_and_names_a_missing_one(
    how: str, tmp_path: Path
) -> None:
    source = _copy_of_the_project(tmp_path / "source")
    if how == "editable":
        what = ["--editable", str(source)]
    else:
        what = [str(_wheel(source, tmp_path, from_sdist=how == "wheel from sdist"))]
    python = _fresh_environment(tmp_path, *what)
    script = GROW_A_MODEL.replace("EDITABLE", str(how == "editable"))
    grown = _run([str(python), "-c", script], tmp_path)
    assert grown.stdout == "2 leaves\n"
    (tmp_path / "rows.csv").write_text("size\n1.2\n8.1\n", "utf-8")
    program = str(python.parent / "fuzzytree")
    shown = _run([program, "show", "model.yaml"], tmp_path)
    assert "size" in shown.stdout
    answered = _run([program, "run", "model.yaml", "rows.csv"], tmp_path)
    classes = [line.split(",")[0] for line in answered.stdout.split()]
    assert classes == ["class", "a", "b"]
    refused = _run(
        [program, "export", "model.yaml", "-o", "model.onnx"], tmp_path, expected=2
    )
    assert "pip install 'onnx>=1.16' 'onnxruntime>=1.18'" in refused.stderr
    assert "Traceback" not in refused.stderr


@pytest.mark.heavy
def test_pyright_resolves_an_editable_installation(tmp_path: Path) -> None:
    source = _copy_of_the_project(tmp_path / "source")
    python = _fresh_environment(tmp_path, "--no-deps", "--editable", str(source))
    script = tmp_path / "elsewhere" / "script.py"
    script.parent.mkdir()
    script.write_text(USE_THE_TYPES, "utf-8")
    pyright = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath"]
    done = _run([*pyright, str(python), str(script)], script.parent, expected=1)
    found = json.loads(done.stdout)["generalDiagnostics"]
    messages = [(one["range"]["start"]["line"], one["message"]) for one in found]
    assert [line for line, _ in messages] == [4, 5, 6]
    assert messages[0][1].endswith('**options: **SettingArguments) -> FuzzyTree"')
    assert messages[1][1] == 'Type of "find_format" is "(name: str) -> Format"'
    assert messages[2][1] == 'No parameter named "leafs"'
    assert "could not be resolved" not in done.stdout


@pytest.mark.heavy
def test_wheel_and_source_archive_hold_every_module_and_every_data_file(
    tmp_path: Path,
) -> None:
    source = _copy_of_the_project(tmp_path / "source")
    wheel = _wheel(source, tmp_path, from_sdist=False)
    rebuilt = _wheel(source, tmp_path / "again", from_sdist=True)
    expected = {
        "/".join([*name.split("."), *path.relative_to(source / folder).parts])
        for folder, name in HOMES.items()
        for path in (source / folder).rglob("*")
        if path.is_file()
        and path.suffix != ".pyc"
        and not (folder == "fuzzytree" and _is_linked(path, source))
    }
    for built in (wheel, rebuilt):
        inside = {n for n in zipfile.ZipFile(built).namelist() if ".dist-info" not in n}
        assert inside == expected
    archive = next((tmp_path / "again").glob("*.tar.gz"))
    with tarfile.open(archive) as packed:
        names = {name.split("/", 1)[-1] for name in packed.getnames()}
    assert {"LICENSE", "README.md", "exporters/__init__.py"} <= names


@pytest.mark.heavy
def test_the_hook_for_pre_commit_fails_for_the_file_with_a_finding(
    tmp_path: Path,
) -> None:
    project, home = tmp_path / "project", tmp_path / "home"
    project.mkdir()
    for name in ("grip file.fcl", "tipper.fll", "grip.yaml"):
        model = "tipper.fll" if "tipper" in name else "grip.yaml"
        ft.save(ft.load(EXAMPLES / model), project / name)
    for words in (["init", "--quiet"], ["add", "."]):
        _run(["git", *words], project)
    hook = ["env", f"PRE_COMMIT_HOME={home}", sys.executable, "-m", "pre_commit"]
    words = ["try-repo", str(ROOT), "fuzzytree-audit", "--all-files"]
    done = _run([*hook, *words], project, expected=1)
    assert ": FT101 error: rule 4 never wins" in done.stdout
    assert "tipper: audited as system" in done.stdout  # though another one failed
    assert "grip.yaml" not in done.stdout


@pytest.mark.heavy
def test_the_action_audits_and_compares_as_sarif(tmp_path: Path) -> None:
    (tmp_path / "fuzzytree").symlink_to(sys.prefix)
    old, new = EXAMPLES / "grip.yaml", tmp_path / "new grip.yaml"
    text = old.read_text("utf-8")
    new.write_text(text.replace("[1.0, 0.0], [1.2, 1.0]", "[0.5, 0.0], [0.8, 1.0]"))
    assert text != new.read_text("utf-8")
    done = _action(tmp_path, {"model": str(old), "fail-on": "never"})
    assert "\n11 findings: 1 error, " in done.stderr
    assert not (tmp_path / "fuzzytree-sarif" / "diff.sarif").exists()
    more = {"fail-on": "never", "old": str(old), "sarif": "to/sarif"}
    _action(tmp_path, {"model": str(new), **more}, expected=1)
    must = tmp_path / "must.yaml"
    must.write_text("requirements:\n- that: class is never open\n")
    _action(
        tmp_path, {"model": str(new), **more, "requirements": str(must)}, expected=1
    )
    wrong = _action(tmp_path, {"model": "none.yaml"}, expected=2)
    assert wrong.stderr == "none.yaml: cannot be read: no such file or directory\n"
    for name, codes in (
        ("audit", {"FT101"}),
        ("diff", {"FT801", "FT802"}),
        ("require", {"requirement"}),
    ):
        path = tmp_path / "to" / "sarif" / f"{name}.sarif"
        [run] = json.loads(path.read_text("utf-8"))["runs"]
        assert codes <= {result["ruleId"] for result in run["results"]}
        for result in run["results"]:
            [location] = result["locations"]
            assert location["physicalLocation"]["artifactLocation"]["uri"]


@pytest.mark.heavy
def test_the_action_installs_what_it_runs(tmp_path: Path) -> None:
    source = _copy_of_the_project(tmp_path / "source")
    _action(tmp_path, {"model": str(EXAMPLES / "tipper.fll")}, source, steps=2)
    assert (tmp_path / "fuzzytree-sarif" / "audit.sarif").is_file()


def test_the_citation_has_what_the_format_requires() -> None:
    facts = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= {*facts}
    assert all(author["name"] for author in facts["authors"])
    project = _project()["project"]
    assert (facts["version"], facts["license"]) == (
        project["version"],
        project["license"],
    )


def _action(
    folder: Path,
    inputs: dict[str, str],
    source: Path = ROOT,
    *,
    steps: int = 1,
    expected: int = 0,
) -> subprocess.CompletedProcess[str]:
    """Run the last steps of the GitHub Action as a runner does."""
    action = yaml.safe_load((ROOT / "action.yml").read_text("utf-8"))
    values = {f"inputs.{k}": v.get("default", "") for k, v in action["inputs"].items()}
    values |= {f"inputs.{name}": value for name, value in inputs.items()}
    values["github.action_path"] = str(source)
    for step in action["runs"]["steps"][-steps:]:
        words = [
            f"{name}={re.sub(EXPRESSION, lambda match: values[match[1]], text)}"
            for name, text in step["env"].items()
        ]
        shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
        done = _run(
            ["env", f"RUNNER_TEMP={folder}", *words, *shell], folder, expected=expected
        )
    return done


def _project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def _is_linked(path: Path, root: Path = ROOT) -> bool:
    return path.relative_to(root / "fuzzytree").parts[0] in {"exporters", "schemas"}


def _copy_of_the_project(target: Path) -> Path:
    """Copy what belongs to the project and nothing that was built or installed."""
    ignored = shutil.ignore_patterns(
        ".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "*.egg-info",
        "build", "dist", "out",
    )  # fmt: skip
    shutil.copytree(ROOT, target, symlinks=True, ignore=ignored)
    return target


def _wheel(source: Path, folder: Path, *, from_sdist: bool) -> Path:
    """Build a wheel, and first a source archive to build it from if requested."""
    kinds = ["--sdist"] if from_sdist else ["--wheel"]
    command = [sys.executable, "-m", "build", *kinds, "--outdir", str(folder)]
    if from_sdist:
        _run([*command, str(source)], source)
        archive = next(folder.glob("*.tar.gz"))
        pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
        _run([*pip, "--wheel-dir", str(folder), str(archive)], source)
    else:
        _run([*command, str(source)], source)
    return next(folder.glob("*.whl"))


def _fresh_environment(folder: Path, *what: str) -> Path:
    """Make an environment, install what is given, and return its Python."""
    _run([sys.executable, "-m", "venv", "--without-pip", str(folder / "env")], folder)
    python = folder / "env" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python)]
    _run([*pip, "install", "--quiet", "--no-compile", *what], folder)
    return python


def _run(
    command: list[str], folder: Path, *, expected: int = 0
) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=500, check=False
    )
    assert done.returncode == expected, done.stdout + done.stderr
    return done
