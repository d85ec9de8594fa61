"""The README keeps its promises: its commands, its examples, its tables, its map.

`python tests/test_readme.py` rewrites what the README shows: the output of its
examples, the table of formats and runtimes, the picture. Review the difference.
"""

from __future__ import annotations

import contextlib
import csv
import importlib
import io
import os
import re
import runpy
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from fuzzytree.model.contracts import Runtime

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
FENCE = re.compile(r"^```(\w+)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
TABLE = re.compile(r"<!-- (\w+) -->\n\n(.*?)\n<!-- end -->\n", re.DOTALL)
PROGRAM = f"{sys.executable} -m fuzzytree"
CHANGING = (
    # Times, speeds and hashes depend on the machine and on versions.
    (re.compile(r"\d[\d., ]*(?=\s*(?:ns|us|µs|ms|s)\b)"), "0 "),
    (re.compile(r"\b[0-9a-f]{12,64}\b"), "0"),
    (re.compile(r"[-─ ]{3,}"), "  "),
)


def test_the_first_two_commands_are_the_ones_that_ci_runs() -> None:
    first, second = [text for kind, text in _blocks() if kind == "sh"][:2]
    assert first.count("\n") == second.count("\n") == 1
    shown = subprocess.run(
        [str(ROOT / ".ci" / "run"), "commands"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert shown == first + second
    script = (ROOT / ".ci" / "run").read_text("utf-8")
    assert 'bash -c "$main"' in script
    assert 'bash -c "$tests"' in script


@pytest.mark.heavy
def test_the_first_command_works_in_a_fresh_copy(tmp_path: Path) -> None:
    first = next(text for kind, text in _blocks() if kind == "sh")
    copy = tmp_path / "fuzzytree"
    ignored = shutil.ignore_patterns(
        ".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "*.egg-info",
        "build", "dist", "out",
    )  # fmt: skip
    shutil.copytree(ROOT, copy, symlinks=True, ignore=ignored)
    done = subprocess.run(
        ["bash", "-c", first],
        cwd=copy, capture_output=True, text=True, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert (copy / "out" / "wine-rules.yaml").is_file()
    assert (copy / "out" / "wine-rules.onnx").is_file()
    assert "IF " in done.stdout


@pytest.mark.heavy
def test_every_example_prints_what_the_readme_shows(tmp_path: Path) -> None:
    text = README.read_text("utf-8")
    now = _masked(_rewritten_examples(text, tmp_path))
    assert now == _masked(text), "python tests/test_readme.py rewrites the README"


@pytest.mark.parametrize(
    "name", ["formats", pytest.param("differences", marks=pytest.mark.heavy)]
)
def test_a_table_of_the_readme_is_what_the_code_gives(name: str) -> None:
    shown = dict(TABLE.findall(README.read_text("utf-8")))
    assert shown[name] == TABLES[name]()


@pytest.mark.heavy
def test_the_accuracies_of_the_readme_are_what_the_code_gives() -> None:
    """Other processors add in another order, which may turn a row or two of a table."""
    shown = dict(TABLE.findall(README.read_text("utf-8")))["accuracy"].split()
    found = TABLES["accuracy"]().split()
    assert len(shown) == len(found)
    for one, two in zip(shown, found, strict=True):
        if re.fullmatch(r"\d+\.\d", one):
            assert abs(float(one) - float(two)) <= 1.2, (one, two)
        elif not one.isdigit():
            assert one == two


def test_the_map_names_every_module() -> None:
    map_ = README.read_text("utf-8").split("## Code map", 1)[1].split("\n## ", 1)[0]
    named = re.findall(r"^\s*([\w/]+(?:\.py|/))  ", map_, re.MULTILINE)
    found = [
        path.name if path.is_file() else f"{path.name}/"
        for path in (ROOT / "fuzzytree").iterdir()
        if path.suffix == ".py" or (path.is_dir() and path.name != "__pycache__")
    ]
    hidden = {"__init__.py", "__main__.py"}
    assert sorted(named) == sorted(set(found) - hidden)


def test_every_link_of_the_readme_and_the_docs_leads_to_a_file() -> None:
    pages = [README, *sorted((ROOT / "docs").rglob("*.md"))]
    for page in pages:
        for target in re.findall(
            r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8")
        ):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_example_that_a_page_names_is_there() -> None:
    for page in [README, *sorted((ROOT / "docs").rglob("*.md"))]:
        text = page.read_text("utf-8")
        for path in re.findall(r"\b(?:examples|benchmarks)/[\w./-]*\w", text):
            assert (ROOT / path).exists(), f"{page.name}: {path}"


def test_the_picture_is_the_one_that_its_script_draws() -> None:
    drawn = _script("picture.py")["drawn"]()
    assert (ROOT / "docs" / "wine.svg").read_text("utf-8") == drawn


def test_the_wine_table_holds_the_numbers_of_scikit_learn() -> None:
    from sklearn.datasets import load_wine

    wine = load_wine()
    with (ROOT / "examples" / "wine" / "wine.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    grapes = ["barolo", "grignolino", "barbera"]
    assert len(head) == 14
    assert [[float(cell) for cell in row[:-1]] for row in rows] == wine.data.tolist()
    assert [grapes.index(row[-1]) for row in rows] == wine.target.tolist()


def _blocks() -> list[tuple[str, str]]:
    return FENCE.findall(README.read_text("utf-8"))


def _masked(text: str) -> str:
    for pattern, replacement in CHANGING:
        text = pattern.sub(replacement, text)
    return text


def _rewritten_examples(text: str, folder: Path) -> str:
    """Return the README with its examples run again in a folder, in their order."""
    (folder / "examples").symlink_to(ROOT / "examples")
    (folder / "out").mkdir()
    pieces: list[str] = []
    end = 0
    output: str | None = None
    for match in FENCE.finditer(text):
        kind, body = match.groups()
        if kind == "console":
            body = "".join(_answered(body, folder))
        elif kind == "text" and output is not None:
            body = output
        pieces += [text[end : match.start()], f"```{kind}\n{body}```\n"]
        end = match.end()
        output = _printed(body, folder) if kind == "python" else None
    return "".join([*pieces, text[end:]])


def _answered(session: str, folder: Path) -> Iterator[str]:
    """Run each `$ fuzzytree ...` line of a session and yield it with its answer."""
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        "COLUMNS": "88",
    }
    for line in session.splitlines():
        if not line.startswith("$ "):
            continue
        command = re.sub(r"(?<![\w./-])fuzzytree(?= )", lambda _: PROGRAM, line[2:])
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, check=True, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        yield f"{line}\n{done.stdout}"


def _printed(code: str, folder: Path) -> str:
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        exec(compile(code, str(README), "exec"), {"__name__": "readme"})
    return printed.getvalue()


def _formats() -> str:
    """Return the tables of formats and runtimes."""
    from fuzzytree.exporters import all_formats
    from fuzzytree.runtimes import all_runtimes

    formats = [
        (
            one.name,
            ", ".join(f"`{suffix}`" for suffix in one.suffixes),
            ", ".join(one.carries) if one.read else "",
            ", ".join(one.carries),
            one.extra or "",
        )
        for one in all_formats()
    ]
    runtimes = [
        (
            one.name,
            ", ".join(one.runs),
            one.dtype,
            _promise(one),
            one.extra or "",
            "; ".join(one.cannot),
        )
        for one in all_runtimes()
    ]
    return "\n".join(
        (
            _table("format", "suffix", "reads", "writes", "extra", formats),
            _table(
                "runtime", "runs", "numbers", "strengths", "extra", "cannot", runtimes
            ),
        )
    )


def _promise(runtime: Runtime) -> str:
    """Say how a runtime's strengths compare with others of the table."""
    if runtime.bound is not None or runtime.name == f"native {runtime.dtype}":
        return "within a derived bound"
    if runtime.dtype == "float64":
        return "equal bits"
    return f"equal bits with native {runtime.dtype}"


def _differences() -> str:
    """Return how far the runtimes' strengths lie apart on the wine tree."""
    import fuzzytree as ft
    from fuzzytree.runtimes import all_runtimes

    table = ROOT / "examples" / "wine" / "wine.csv"
    tree = ft.learn(table, target="cultivar", name="wine")
    # A compiler is not there for everyone.
    names = [one.name for one in all_runtimes() if not one.programs]
    rows = [
        (
            one.carrier.split(":")[0],
            one.against,
            str(one.rows),
            f"{one.largest_difference:.2g}",
            f"{one.allowed:.2g}",
        )
        for one in ft.check(tree, data=table, runtimes=names).comparisons
        if one.carrier.endswith(": relative rules") and one.basis == "rows"
    ]
    return _table("runtime", "against", "rows", "largest difference", "allowed", rows)


def _accuracy() -> str:
    """Return the accuracy of both modes beside three classifiers."""
    from sklearn import datasets
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
    from sklearn.model_selection import StratifiedKFold, cross_val_score
    from sklearn.naive_bayes import GaussianNB
    from sklearn.tree import DecisionTreeClassifier

    from fuzzytree.estimator import FuzzyTreeClassifier

    folds = StratifiedKFold(10, shuffle=True, random_state=0)
    learners = {
        "fuzzytree": FuzzyTreeClassifier(),
        "paper mode": FuzzyTreeClassifier(mode="paper"),
        "DecisionTree": DecisionTreeClassifier(random_state=0),
        "GaussianNB": GaussianNB(),
        "LDA": LinearDiscriminantAnalysis(),
    }
    rows: list[tuple[str, ...]] = []
    for name in ("iris", "wine", "breast_cancer", "digits"):
        values, labels = getattr(datasets, f"load_{name}")(return_X_y=True)
        with warnings.catch_warnings():
            # Columns of digits that never vary make LDA warn.
            warnings.simplefilter("ignore")
            shares = [
                cross_val_score(one, values, labels, cv=folds).mean()
                for one in learners.values()
            ]
        leaves = len(FuzzyTreeClassifier().fit(values, labels).tree_.leaves)
        cells = (f"{100 * share:.1f}" for share in shares)
        rows.append((name.replace("_", " "), *cells, str(leaves)))
    return _table("table", *learners, "leaves of fuzzytree", rows)


def _table(*parts: str | Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown; the last part is its rows, the others its head."""
    *head, rows = parts
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


TABLES = {"formats": _formats, "differences": _differences, "accuracy": _accuracy}


def _script(name: str) -> dict[str, Callable[[], str]]:
    return runpy.run_path(str(ROOT / "examples" / name), run_name="readme")


def _rewrite() -> None:
    import tempfile

    (ROOT / "docs" / "wine.svg").write_text(_script("picture.py")["drawn"](), "utf-8")
    text = README.read_text("utf-8")
    with tempfile.TemporaryDirectory() as folder:
        text = _rewritten_examples(text, Path(folder))
    for name, made in TABLES.items():
        marks = f"<!-- {name} -->\n\n", "\n<!-- end -->\n"
        before, rest = text.split(marks[0], 1)
        text = before + marks[0] + made() + marks[1] + rest.split(marks[1], 1)[1]
    README.write_text(text, "utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    importlib.invalidate_caches()
    _rewrite()
