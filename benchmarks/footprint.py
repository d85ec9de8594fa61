"""What each verb loads, and what leaving out saves on real tables.

    python benchmarks/footprint.py [--write] [loads] [saved] [timed] [memory]

Prints the tables of docs/how-to/needs.md; `--write` puts them there, all or those
named. Every verb runs in a process of its own, several times in turn, and the median
counts; memory is the most that a process ever had, as Linux counts it. Trees are learnt
from the wine table and from the digits of scikit-learn.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import fuzzytree as ft
from fuzzytree.benchmarking.clock import times_faster
from fuzzytree.benchmarking.savings import (
    ALL_COLUMNS,
    PRUNED,
    Cost,
    File,
    costs,
    sizes,
    stages,
)
from fuzzytree.model.tree import FuzzyTree, Use
from fuzzytree.semantics.lowering import forms
from fuzzytree.semantics.simplification import pruned

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "how-to" / "needs.md"
WINE = ROOT / "examples" / "wine" / "wine.csv"
ROUNDS = 7
MEMORY_ROWS = 1_000_000
TABLE = re.compile(r"(<!-- (\w+) -->\n\n).*?(\n<!-- end -->\n)", re.DOTALL)
LIBRARIES = (
    *("numpy", "yaml", "msgspec", "click", "rich", "narwhals", "onnx", "onnxruntime"),
    *("sklearn", "skfuzzy", "scipy", "pandas", "polars", "pyarrow", "matplotlib"),
)
CHILD = """
import sys, time
before, begin = len(sys.modules), time.perf_counter()
{code}
seconds = time.perf_counter() - begin
with open("/proc/self/status") as status:
    (peak,) = (line.split()[1] for line in status if line.startswith("VmHWM"))
found = [name for name in {libraries} if name in sys.modules]
print("@", len(sys.modules) - before, seconds, peak, *found, file=sys.stderr)
"""
VERBS: Mapping[str, Sequence[str]] = {
    "show": ("show", "wine.yaml"),
    "run": ("run", "wine.yaml", str(WINE), "-o", "answers.csv", "--quiet"),
    "export to yaml": ("export", "wine.yaml", "-o", "other.yaml", "--quiet"),
    "export to onnx": ("export", "wine.yaml", "-o", "wine.onnx", "--quiet"),
    "run, an onnx file": ("run", "made.onnx", str(WINE), "-o", "a.csv", "--quiet"),
    "learn": (
        *("learn", str(WINE), "--target", "cultivar", "--entry", "25"),
        *("-o", "learnt.yaml", "--quiet"),
    ),
    "check, native": ("check", "wine.yaml", "--runtime", "native", "--quiet"),
    "needs": ("needs", "wine.yaml", "--quiet"),
    "formats": ("formats",),
}


def main() -> None:
    """Print the tables, or write them into the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--write", action="store_true", help="into docs/how-to/needs.md"
    )
    parser.add_argument("tables", nargs="*", help=f"some of {', '.join(TABLES)}")
    arguments = parser.parse_args()
    wrong = [name for name in arguments.tables if name not in TABLES]
    if wrong:
        parser.error(f"no table {wrong[0]!r}; there is {', '.join(TABLES)}")
    chosen = arguments.tables or list(TABLES)
    made = {name: "\n".join(TABLES[name]()) + "\n" for name in chosen}
    if not arguments.write:
        print("\n".join(made.values()))
        return
    text = PAGE.read_text("utf-8")
    PAGE.write_text(
        TABLE.sub(lambda m: m[1] + made[m[2]] + m[3] if m[2] in made else m[0], text),
        "utf-8",
    )


def markdown(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield a table of Markdown, the first row its head."""
    head, *body = rows
    yield f"| {' | '.join(head)} |"
    yield f"|{' --- |' * len(head)}"
    yield from (f"| {' | '.join(row)} |" for row in body)


# --- what a verb loads


def loads() -> Iterator[str]:
    """Yield the table of verbs, with what each adds to an idle Python."""
    codes = {"an idle Python": "pass", "import fuzzytree": "import fuzzytree"}
    for name, words in VERBS.items():
        codes[name] = f"from fuzzytree.cli import main; main({list(words)!r})"
    with tempfile.TemporaryDirectory() as folder:
        ft.save(wine(), Path(folder) / "wine.yaml")
        ft.save(wine(), Path(folder) / "made.onnx")
        found: dict[str, list[Sequence[str]]] = {name: [] for name in codes}
        for _ in range(ROUNDS):
            for name, code in codes.items():
                found[name].append(child(code, folder))
    idle = median(found["an idle Python"], 2)
    rows = [("", "modules", "milliseconds", "megabytes", "libraries")]
    for name, runs in found.items():
        modules, *_ = runs[0]
        rows.append(
            (
                name,
                modules,
                f"{1e3 * median(runs, 1):.0f}",
                f"{(median(runs, 2) - idle) / 1024:.0f}",
                ", ".join(runs[0][3:]) or "none",
            )
        )
    yield from markdown(rows)


def median(runs: Sequence[Sequence[str]], position: int) -> float:
    """Return the median of one number of each run."""
    return statistics.median(float(run[position]) for run in runs)


def child(code: str, folder: str) -> list[str]:
    """Run code in a new process; return modules, seconds, peak in kB, libraries."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD.format(code=code, libraries=LIBRARIES)],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    (line,) = (one for one in done.stderr.splitlines() if one.startswith("@ "))
    return line.split()[1:]


# --- what leaving out saves


def wine() -> FuzzyTree:
    """Return the tree of the README."""
    return ft.learn(
        WINE,
        target="cultivar",
        name="wine",
        settings=ft.LearningSettings(columns_per_node=1, leaves=4),
    )


def digits() -> FuzzyTree:
    """Return the paper's tree of 64 grey values."""
    from sklearn.datasets import load_digits

    table = load_digits()
    names = [f"pixel {number}" for number in range(1, 65)]
    labels = [str(label) for label in table.target]
    return ft.learn(
        ft.table(table.data, columns=names),
        target=labels,
        name="digits",
        settings=ft.LearningSettings(mode="paper", columns_per_node=1, l_max=4.0),
    )


def saved() -> Iterator[str]:
    """Yield what two trees and their rules are before and after."""
    rows: list[tuple[str, ...]] = [
        ("tree", "what", "all columns, all sets", "as learnt", "pruned")
    ]
    for tree in (wine(), digits()):
        rows += saved_rows(tree, ("tree", "relative"))
        rows += saved_rows(tree, ("raw",))[3:]
    yield from markdown(rows)


def saved_rows(tree: FuzzyTree, uses: Sequence[Use]) -> list[tuple[str, ...]]:
    """Return the sizes of a tree that serves some uses, stage by stage."""
    made = stages(tree, pruned(tree, uses=uses).model)
    found, _ = sizes(made, uses)
    rows = [
        (tree.name, "columns read", *(str(size.inputs) for size in found)),
        (tree.name, "bytes of a row", *(str(size.row_bytes) for size in found)),
        (tree.name, "terms and sets", *(str(size.terms) for size in found)),
    ]
    for one in zip(*(size.files for size in found), strict=True):
        if one[0].dtype not in ("mixed", "float32"):
            rows.append((tree.name, title(one[0]), *map(size_text, one)))
    return rows


def title(file: File) -> str:
    """Return what people call a file."""
    return f"{file.representation} as {file.format}"


def size_text(file: File) -> str:
    """Return a file's bytes, and a graph's nodes."""
    nodes = "" if file.nodes is None else f", {file.nodes} nodes"
    return f"{file.bytes:,} B{nodes}"


def timed() -> Iterator[str]:
    """Yield how many times faster the pruned models are than those of all columns."""
    rows: list[tuple[str, ...]] = [
        ("tree", "what", "all columns", "pruned", "times faster (95 %)")
    ]
    for tree in (wine(), digits()):
        made = stages(tree, pruned(tree).model)
        chosen = {stage: made[stage] for stage in (ALL_COLUMNS, PRUNED)}
        found, _ = costs(chosen, ("tree", "relative"), seconds=40.0, rounds=31)
        groups: dict[tuple[str, str, str], dict[str, Cost]] = {}
        for cost in found:
            key = (cost.representation, cost.runtime, cost.what)
            groups.setdefault(key, {})[cost.stage] = cost
        for (representation, runtime, what), group in groups.items():
            before, after = (group[stage].timing for stage in chosen)
            ratio = times_faster(before, after)
            if ratio is None:
                continue
            text = f"{ratio.median:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"
            times = [f"{t.median_ns / 1e3:,.1f} us" for t in (before, after)]
            rows.append(
                (tree.name, f"{representation}, {runtime}, {what}", *times, text)
            )
    yield from markdown(rows)


# --- memory


def memory() -> Iterator[str]:
    """Yield the largest memory of a process that answers many rows with a file."""
    rows = [("tree", "file", "columns", "megabytes for a million rows")]
    with tempfile.TemporaryDirectory() as folder:
        for tree in (wine(), digits()):
            made = stages(tree, pruned(tree).model)
            for stage in (ALL_COLUMNS, PRUNED):
                for name, model in forms(made[stage], ("tree", "relative")).items():
                    path = Path(folder) / "model.onnx"
                    ft.save(model, path)
                    peak = answering_peak(path, len(model.inputs), folder)
                    what = f"{name}, {stage}"
                    rows.append((tree.name, what, str(len(model.inputs)), peak))
    yield from markdown(rows)


def answering_peak(path: Path, width: int, folder: str) -> str:
    """Return what answering adds to the memory of a process that has loaded it all."""
    load = (
        "import numpy as np, onnxruntime as ort\n"
        "options = ort.SessionOptions(); options.intra_op_num_threads = 1\n"
        f"session = ort.InferenceSession({str(path)!r}, options)\n"
    )
    run = (
        f"rows = np.zeros(({MEMORY_ROWS}, {width}))\n"
        "rows += 1.0\nsession.run(['rule'], {'inputs': rows})\n"
    )
    idle, busy = (
        statistics.median(float(child(code, folder)[2]) for _ in range(3))
        for code in (load, load + run)
    )
    return f"{(busy - idle) / 1024:.0f}"


TABLES: Mapping[str, Callable[[], Iterator[str]]] = {
    "loads": loads,
    "saved": saved,
    "timed": timed,
    "memory": memory,
}

if __name__ == "__main__":
    main()
