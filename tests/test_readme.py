"""The commands of the README and the tutorials print what these pages show.

`python tests/test_readme.py` rewrites the outputs and the pictures; review the diff.
"""

from __future__ import annotations

import contextlib
import csv
import importlib
import io
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
LANDING = ROOT / "docs" / "index.md"
PAGES = [
    README,
    LANDING,
    ROOT / "docs" / "gallery.md",
    *sorted((ROOT / "docs" / "tutorials").glob("*.md")),
    ROOT / "docs" / "how-to" / "draw-a-model.md",
    ROOT / "docs" / "how-to" / "explain-one-decision.md",
    ROOT / "docs" / "how-to" / "require.md",
    ROOT / "docs" / "how-to" / "why-your-converted-tree-differs.md",
]
MOST_LINES, MOST_OUTPUT = 200, 11
LONGER = {"why-your-converted-tree-differs": 19}  # a whole result
FENCE = re.compile(r"^```(\w+)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
PROGRAMS = {"fuzzytree": f"{sys.executable} -m fuzzytree", "python": sys.executable}
CHANGING = (
    # Times, speeds and hashes depend on the machine and on versions.
    (re.compile(r"\d[\d., ]*(?=\s*(?:ns|us|µs|ms|s)\b)"), "0 "),
    (re.compile(r"\b[0-9a-f]{12,64}\b"), "0"),
    (re.compile(r"[-─ ]{3,}"), "  "),
    (re.compile(r"\b(scikit-learn|onnxruntime) [\d.]+\d"), r"\1 0"),
)


def test_the_readme_is_short() -> None:
    assert README.read_text("utf-8").count("\n") <= MOST_LINES


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
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_example_prints_what_the_page_shows(page: Path, tmp_path: Path) -> None:
    text = page.read_text("utf-8")
    now = _masked(_rewritten_examples(text, tmp_path))
    assert now == _masked(text), "python tests/test_readme.py rewrites the page"
    for shown, drawn in _pictures(page, tmp_path):
        assert shown.read_text("utf-8") == drawn.read_text("utf-8"), shown.name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_example_prints_more_than_a_few_lines(page: Path) -> None:
    most = LONGER.get(page.stem, MOST_OUTPUT)
    for kind, body in FENCE.findall(page.read_text("utf-8")):
        if kind == "console":
            for session in re.split(r"^\$ .*\n", body, flags=re.MULTILINE):
                assert session.count("\n") <= most, session


def test_the_wine_table_holds_the_numbers_of_scikit_learn() -> None:
    from sklearn.datasets import load_wine

    wine: Any = load_wine()
    with (ROOT / "examples" / "wine" / "wine.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    grapes = ["barolo", "grignolino", "barbera"]
    assert len(head) == 14
    assert [[float(cell) for cell in row[:-1]] for row in rows] == wine.data.tolist()
    assert [grapes.index(row[-1]) for row in rows] == wine.target.tolist()


def test_the_landing_page_has_the_ten_lines_of_the_readme() -> None:
    (ten,) = [text for kind, text in _blocks() if kind == "python"]
    assert f"```python\n{ten}```" in LANDING.read_text("utf-8")


def _blocks() -> list[tuple[str, str]]:
    return FENCE.findall(README.read_text("utf-8"))


def _masked(text: str) -> str:
    for pattern, replacement in CHANGING:
        text = pattern.sub(replacement, text)
    return text


def _rewritten_examples(text: str, folder: Path) -> str:
    """Return a page with its examples run again in a folder, in their order."""
    for name in ("benchmarks", "examples"):
        (folder / name).symlink_to(ROOT / name)
    pieces: list[str] = []
    end = 0
    output: str | None = None
    names: dict[str, object] = {"__name__": "readme"}
    for match in FENCE.finditer(text):
        kind, body = match.groups()
        if kind == "console":
            body = "".join(_answered(body, folder))
        elif kind == "text" and output is not None:
            body = output
        pieces += [text[end : match.start()], f"```{kind}\n{body}```\n"]
        end = match.end()
        output = _printed(body, folder, names) if kind == "python" else None
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
        pattern = rf"(?<![\w./-])({'|'.join(PROGRAMS)})(?= )"
        command = re.sub(pattern, lambda found: PROGRAMS[found[0]], line[2:])
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, check=True, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        yield f"{line}\n{done.stdout}"


def _pictures(page: Path, folder: Path) -> Iterator[tuple[Path, Path]]:
    """Yield the pictures that a page shows and its commands have drawn in `out/`."""
    for name in re.findall(r"!\[[^]]*\]\(([^)\s]+\.svg)\)", page.read_text("utf-8")):
        shown = page.parent / name
        if (drawn := folder / "out" / shown.name).exists():
            yield shown, drawn


def _printed(code: str, folder: Path, names: dict[str, object]) -> str:
    """Run a Python block, after those before it on its page."""
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        exec(compile(code, str(README), "exec"), names)
    return printed.getvalue()


def _rewrite() -> None:
    import tempfile

    for page in PAGES:
        with tempfile.TemporaryDirectory() as folder:
            text = _rewritten_examples(page.read_text("utf-8"), Path(folder))
            for shown, drawn in _pictures(page, Path(folder)):
                shown.write_text(drawn.read_text("utf-8"), "utf-8")
        page.write_text(text, "utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    importlib.invalidate_caches()
    _rewrite()
