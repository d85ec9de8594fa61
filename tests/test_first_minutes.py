"""The README and the tutorials as a reader follows them, in a clone and a new shell.

Nothing is prepared: no environment, no folder `out`, no variable. What the pages print
is compared in test_readme.py; here every command has to end well.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TUTORIALS = ("first-model", "audit", "tactile")
PAGES = ("README.md", *(f"docs/tutorials/{name}.md" for name in TUTORIALS))
FENCE = re.compile(r"^```(\w+)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
NEXT = re.compile(r"^(?:next |wrote .* next:) +(fuzzytree .*)$", re.MULTILINE)
STEP = r"""
step() {
    printf '\n== %s\n%s\n' "$1" "$2"
    eval "$2" || { echo "$1 ended with $?"; exit 1; }
}
"""
OWN = re.compile(r"\bmy\.(csv|yaml)")  # the files of the reader
HEAD = 'Opening hour,"Grade, old",Größe in m²,visited,note,kind'
ROW = "{hour},{grade},{size},2024-{month:02}-11,{note},{kind}"


@pytest.mark.heavy
@pytest.mark.timeout(1800)
def test_a_reader_gets_from_a_clone_to_an_own_model(tmp_path: Path) -> None:
    clone, own = tmp_path / "clone", tmp_path / "my own folder"
    _in_a_new_shell(f"git clone --quiet {shlex.quote(str(ROOT))} clone", tmp_path)
    own.mkdir()
    (own / "my.csv").write_text("\n".join([HEAD, *_own_rows(), ""]), "utf-8")
    talk = _in_a_new_shell("\n".join(_followed(clone, own)), tmp_path)
    steps = {step for step in NEXT.findall(talk) if OWN.search(step)}
    assert "fuzzytree check out/my.yaml --data my.csv" in steps
    steps |= {
        "fuzzytree export out/my.yaml -o made/here/my.onnx",
        "fuzzytree audit out/my.yaml --data my.csv --target kind",
    }
    earlier: set[str] = set()
    while new := steps - earlier:  # the next step that one prints is one, too
        earlier |= new
        script = [f". {shlex.quote(str(clone))}/.venv/bin/activate", STEP]
        script += [shlex.join(["step", "own table", step]) for step in sorted(new)]
        steps |= {*NEXT.findall(_in_a_new_shell("\n".join(script), own))}
    assert "fuzzytree check out/my.yaml made/here/my.onnx" in steps


def _followed(clone: Path, own: Path) -> Iterator[str]:
    """Yield the lines of a shell that follows all pages, nothing being prepared."""
    yield STEP
    for page in PAGES:
        yield f"cd {shlex.quote(str(clone))} && rm -rf out"
        for place, command in _steps(page):
            words = shlex.join(["step", place, command])
            folder = own if OWN.search(command) else clone
            yield f"cd {shlex.quote(str(folder))}"
            yield words


def _own_rows() -> Iterator[str]:
    """Yield rows as people have them: missing cells, a date, quotes, odd names."""
    for k in range(90):
        yield ROW.format(
            hour=k % 24,
            grade=("good", "so so", "", "bad")[k % 4],
            size="" if k % 11 == 0 else k * 1.5,
            month=1 + k % 12,
            note='"say ""no"", please"' if k % 3 else "",
            kind=("Nord-Ost", "süd west")[k % 24 > 11],
        )


def _steps(page: str) -> Iterator[tuple[str, str]]:
    """Yield the commands of a page with their places, as a shell takes them."""
    text = (ROOT / page).read_text("utf-8")
    for match in FENCE.finditer(text):
        kind, body = match.groups()
        place = f"{page}:{text.count(chr(10), 0, match.start()) + 2}"
        file = re.search(r"Save this as `(\S+)`:\s*\Z", text[: match.start()])
        if kind == "console":
            for line in re.findall(r"^\$ (.*)$", body, re.MULTILINE):
                yield place, line
        elif kind == "python":
            yield place, f"python - <<'EOF'\n{body}EOF"
        elif file:
            yield place, f"cat > {file[1]} <<'EOF'\n{body}EOF"
        elif kind == "sh" and "pytest" not in body:  # the tests are run elsewhere
            for line in body.splitlines():
                yield place, line


def _in_a_new_shell(script: str, folder: Path) -> str:
    """Run a script as in a new terminal, and return what it prints."""
    base = Path(sys.base_prefix) / "bin"
    names = folder / "bin"
    names.mkdir(exist_ok=True)
    if not (names / "python3").exists():
        (names / "python3").symlink_to(base / f"python3.{sys.version_info.minor}")
    paths = os.environ["PATH"].split(os.pathsep)
    paths = [path for path in paths if not (Path(path).parent / "pyvenv.cfg").exists()]
    ours = ("VIRTUAL_ENV", "PYTHON", "FUZZYTREE", "PYTEST", "COLUMNS")
    variables = {k: v for k, v in os.environ.items() if not k.startswith(ours)}
    done = subprocess.run(
        ["bash", "-c", script], cwd=folder, check=False, text=True,
        env={**variables, "PATH": os.pathsep.join([str(names), *paths])},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-4000:]
    return done.stdout
