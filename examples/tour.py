"""From a table to a proved model, in one run on the wine table.

Learn a fuzzy tree, print it and its rules, write YAML and ONNX files, run them, check
that all of them are one model, and compare speeds. Files go to the folder `out/`.
"""

from __future__ import annotations

import sys

if sys.version_info < (3, 11):  # noqa: UP036 - someone will try an older one
    sys.exit(
        "fuzzytree needs Python 3.11 or newer, and this is "
        f"{sys.version_info[0]}.{sys.version_info[1]}"
    )

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import fuzzytree as ft
from fuzzytree.report.models import tree_lines
from fuzzytree.runtimes.table import find_runtime
from fuzzytree.tables import batches, read_table

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, Model, Run

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "examples" / "wine" / "wine.csv"
OUT = ROOT / "out"
BATCH = 10_000
RUNTIMES = ("reference", "native", "onnxruntime float64")


def main() -> None:
    """Take the tour."""
    wine = read_table(TABLE, target="cultivar")
    rows = wine.values.shape[1]

    head(f"Learn: {rows} wines, {len(wine.columns)} measurements, three grapes")
    tree = ft.learn(TABLE, target="cultivar", name="wine")
    rules = ft.rules_from_tree(tree)
    print("\n".join(tree_lines(tree)))
    print(f"\nThe same as rules:\n{rules}")

    head("Write: YAML to read, ONNX to run")
    for model, stem in ((tree, "wine-tree"), (rules, "wine-rules")):
        for suffix in (".yaml", ".onnx"):
            path = OUT / f"{stem}{suffix}"
            ft.save(model, path)
            print(f"out/{path.name:<16}{path.stat().st_size:>7} bytes")

    head("Run: the rules from their file, on the wines they were learnt from")
    answers = ft.run(OUT / "wine-rules.yaml", TABLE)
    assert isinstance(answers, ft.Predictions)  # a fuzzy system would answer numbers
    right = int((answers.codes == wine.codes).sum())
    print(f"{answers}\n{right} of {rows} are the grape that stands in the table")

    head("Check: are tree, rules, files and runtimes one model?")
    files = [OUT / f"{stem}.onnx" for stem in ("wine-tree", "wine-rules")]
    agreement = ft.check(tree, OUT / "wine-rules.yaml", *files, data=TABLE)
    for line in verdicts(agreement):
        print(line)
    agreement.raise_if_not_ok()

    head(f"Compare: microseconds for one row, and for each of {BATCH} at once")
    values = next(batches(TABLE, tree.inputs)).values
    for line in speeds(tree, rules, values):
        print(line)

    head("What this says")
    print(
        f"The tree asks {len(tree.inputs)} of {len(wine.columns)} measurements and "
        f"has {len(tree.leaves)} rules. They answer like the tree on every\n"
        "input, and the files answer like the rules, bit by bit. So read "
        "out/wine-rules.yaml,\nrun out/wine-rules.onnx, and it is the same model. "
        "Following one path of the tree is\nquicker than firing all rules; the "
        "rules also say how close a decision was."
    )


def head(text: str) -> None:
    """Print a heading."""
    print(f"\n{text}\n{'-' * len(text)}")


def verdicts(agreement: ft.Agreement) -> Iterator[str]:
    """Yield what a check says of rules and files, and the sum of the runtimes."""
    runtimes = [one for one in agreement.comparisons if ": " in one.representation]
    for one in agreement.comparisons:
        if one not in runtimes:
            representation = Path(one.representation).name
            yield f"{representation:<16}{one.against:<25}{one.basis:<11}{one.verdict}"
    agreeing = sum(one.verdict == "agrees" for one in runtimes)
    names = {one.representation.split(": ")[0] for one in runtimes}
    equal = sum(one.allowed == one.flips == 0 for one in runtimes)
    yield (
        f"\n{len(names)} runtimes: {agreeing} of {len(runtimes)} comparisons agree, "
        f"{equal} bit by bit and the others within their bounds\n"
        "(fuzzytree check out/wine-tree.yaml --data examples/wine/wine.csv shows each)"
    )


def speeds(tree: Model, rules: Model, values: FloatArray) -> Iterator[str]:
    """Yield a small table of run times; the best of several rounds each."""
    many = np.tile(values, -(-BATCH // values.shape[1]))[:, :BATCH]
    yield f"{'runtime':<22}{'tree: one':>11}{'each':>9}{'rules: one':>13}{'each':>9}"
    for name in RUNTIMES:
        shown = f"{name:<22}"
        for model, width in ((tree, 11), (rules, 13)):
            run = find_runtime(name).load(model)
            batch = values if name == "reference" else many
            one = fastest(run, values[:, :1])
            each = fastest(run, batch) / batch.shape[1]
            shown += f"{one:>{width}.1f}{each:>9.3f}"
        yield shown


def fastest(run: Run, values: FloatArray) -> float:
    """Return the microseconds of the fastest run within a fifth of a second."""
    best = float("inf")
    end = time.perf_counter() + 0.2
    while time.perf_counter() < end:
        start = time.perf_counter()
        run(values)
        best = min(best, time.perf_counter() - start)
    return best * 1e6


if __name__ == "__main__":
    main()
