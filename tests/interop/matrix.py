"""Every verb and every target of fuzzytree on every kind of model.

`python -m tests.interop.matrix > docs/reference/matrix.md` writes the page; with
`--kinds PATTERN` it prints the cells of some kinds instead. The exit code is 1 if a
cell is wrong, or refused without a reason that stands in `REASONS`.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import math
import os
import random
import re
import shlex
import struct
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from fuzzytree.cli.program import main
from tests.interop.matrix_models import KINDS, write_model

ROWS = 60
SLOW = 20.0  # seconds of CPU time for a verb that does not measure time
TARGETS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "yaml": (".yaml", ()),
    "fcl": (".fcl", ()),
    "fcl jfuzzylogic": (".jfl.fcl", ("--dialect", "jfuzzylogic")),
    "fll": (".fll", ()),
    "fis": (".fis", ()),
    "fis matlab": (".mat.fis", ("--dialect", "matlab")),
    "fml": (".fml", ()),
    "onnx": (".onnx", ()),
    "onnx float32": (".32.onnx", ("--set", "dtype=float32")),
    "onnx readable": (".readable.onnx", ("--set", "readable=true")),
    "pmml": (".pmml", ()),
    "c": (".c", ()),
    "c float32": (".32.c", ("--set", "dtype=float32")),
    "c q15": (".q15.c", ("--set", "dtype=q15")),
    "javascript": (".mjs", ()),
    "python": (".py", ()),
    "sql sqlite": (".sql", ()),
    "sql duckdb": (".duckdb.sql", ("--set", "dialect=duckdb")),
    "sql postgresql": (".pg.sql", ("--set", "dialect=postgresql")),
    "sql spark": (".spark.sql", ("--set", "dialect=spark")),
    "structured text": (".st", ()),
    "plcopen": (".xml", ("--to", "structured-text", "--set", "layout=plcopen")),
    "smt-lib": (".smt2", ()),
}
"""What is written: the end of the file's name, and options of `convert`."""

READABLE = (".yaml", ".fcl", ".fll", ".fis", ".fml", ".onnx")
VERBS: Mapping[str, str] = {
    "show": "show M",
    "show --picture": "show M --picture picture.svg",
    "page": "page M --data rows.csv -o model.html",
    "run": "run M rows.csv",
    "run -o parquet": "run M rows.csv -o out.parquet",
    "run --why": "run M rows.csv --why --json --strengths rule",
    "run --probabilities": "run M rows.csv --probabilities",
    "why": "why M --data rows.csv --number 5",
    "check": "check M --data rows.csv --generate 100",
    "audit": "audit M --budget 8 --json -o audit.json --fail-on never",
    "recheck": "recheck audit.json M",
    "audit --data --page": "audit M --data rows.csv --page page.html --budget 4 "
    "--fail-on never",
    "diff": "diff M M --budget 4",
    "bench": "bench M --budget 6 --rows 50 --threads 1 --select native",
    "stability": "stability M --runtime native --runtime reference",
    "needs": "needs M -o needs.yaml --budget 1",
}
LETTERS = {
    ".": "it works",
    "l": "it works with losses that are listed and allowed",
    "n": "it is written, and nothing here runs it",
    "r": "it is refused",
    "W": "wrong: answers differ, or a printed next step fails",
    "X": "a crash",
}
REASONS: tuple[tuple[str, str], ...] = (
    (
        "has no probabilities of classes",
        "controllers, raw rules and rules by hand have no probabilities to give",
    ),
    (
        "dtype: there is float64",
        "ONNX graphs of systems are in double: in float32 their error would have no "
        "derived bound, as C in float32 has",
    ),
    (
        "^fixed point is for fuzzy systems",
        "trees and rules compare their inputs; fixed point is for what computes",
    ),
    (
        "^fixed point (has no|needs the range)|^fixed point: ",
        "fixed point takes a controller whose inputs have ranges, whose terms are "
        "straight lines, whose rules cover every point, and whose output is a "
        "centroid or an average; the sentence names what is in the way",
    ),
    (
        "the dialect [a-z]+ has no .* (there|alike)|[a-z]+ has no such conclusion"
        "|matlab has no way to say '",
        "this dialect has no words for it; the sentence names one that has",
    ),
    (
        "as smt-lib: rule [0-9]+: not a minimum, product or maximum",
        "SMT-LIB is written of minima, products and maxima, which are what is proved",
    ),
    (
        "is a fuzzy system whose outputs are numbers, and is not compared with rules",
        "jFuzzyLogic joins OR by the algebraic sum where AND is the product, so its "
        "scores are no rules with maximum; that loss is listed",
    ),
    (
        "must reference an input, but there is none",
        "these formats need a rule with an input, and a tree of one leaf tests nothing",
    ),
)
"""Why a refusal is no hole: a part of its sentence, and the reason."""


class Cell(NamedTuple):
    """What became of a verb or a target: a letter of `LETTERS`, and a sentence.

    And the command, with the seconds of CPU time that it took.
    """

    letter: str
    sentence: str = ""
    command: str = ""
    took: float = 0.0


Cells = dict[str, Cell]


def call(*words: str) -> tuple[int, str, str]:
    """Run a command in this process: its exit code, stdout and stderr."""
    bodies = io.BytesIO(), io.BytesIO()
    out, err = (io.TextIOWrapper(body, "utf-8") for body in bodies)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(words)
        except SystemExit as end:
            code = int(end.code or 0)
    out.flush()
    err.flush()
    answers, messages = (body.getvalue().decode("utf-8") for body in bodies)
    return code, answers, messages


def cell_of(words: Iterable[str], finding: str = "W") -> tuple[Cell, str]:
    """Run a command, and return its cell and what it prints; 1 is a `finding`."""
    words = [*words]
    command = shlex.join(["fuzzytree", *words])
    start = _cpu_s()
    try:
        code, out, err = call(*words)
    except Exception as error:  # whatever it is, it is a crash
        return Cell("X", f"{type(error).__name__}: {error}", command), ""
    lines = [line for line in err.splitlines() if not line.startswith("remark ")]
    sentence = " ".join(lines[:2])[:240]
    took = _cpu_s() - start
    letter = {0: ".", 1: finding, 2: "r"}.get(code, "X")
    if letter == "r" and "Traceback" in err:
        letter = "X"
    if letter == ".":
        for line in re.findall(r"next:?\s+fuzzytree ([^\n]+)", out + err):
            step = shlex.split(line)
            if step[0] != "check" and call(*step)[0]:
                return Cell("W", f"the next step fails: {line}", command), out
    took = 0.0 if words[0] == "bench" else took
    return Cell(letter, "" if letter == "." else sentence, command, took), out


def _cpu_s() -> float:
    """Return the CPU time of this process and of those that it waited for."""
    return sum(os.times()[:4])


def cells_of(kind: str) -> Cells:
    """Return the cells of a kind of model, in a folder that is gone afterwards."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            return dict(_cells(kind))
        finally:
            os.chdir(before)


def _cells(kind: str) -> Iterator[tuple[str, Cell]]:
    model = write_model(kind)
    facts = json.loads(call("show", model, "--json")[1])
    inputs = [v for v in facts["model"]["variables"] if v["name"] in facts["inputs"]]
    with Path("rows.csv").open("w", newline="", encoding="utf-8") as file:
        names = [variable["name"] for variable in inputs] or ["unused"]
        csv.writer(file).writerows([names, *(row or ["1"] for row in _rows(inputs))])
    for name, verb in VERBS.items():
        yield name, cell_of(model if word == "M" else word for word in verb.split())[0]
    truth = _answers(model, "rows.csv")
    _round_rows()
    rounded = _answers(model, "rounded.csv")
    # All numbers and the status, or classes.
    width = None if facts.get("outputs") else 1
    for name, (suffix, options) in TARGETS.items():
        file_name = "out" + suffix
        words = ["convert", model, file_name, *options]
        cell, _ = cell_of(words, "l")
        if cell.letter == "l":
            again, _ = cell_of([*words, "--allow-loss"], "X")
            cell = cell if again.letter == "." else again
        yield name, cell
        if cell.letter in ".l":
            yield f"{name}: check", _check(model, file_name, allow=cell.letter == "l")
            if cell.letter == "." and file_name.endswith(READABLE):
                truths = [truth, rounded] if "float32" in name else [truth]
                yield f"{name}: run", _compared(file_name, truths, width)


def _check(model: str, name: str, *, allow: bool) -> Cell:
    """Return what `check` says of a file, whose programs it runs."""
    words = ["check", model, name, "--data", "rows.csv", "--generate", "40"]
    words += ["--runtime", "native", "--json", *["--allow-loss"] * allow]
    cell, out = cell_of(words, "l" if allow else "W")
    if cell.letter == "." and json.loads(out).get("unchecked"):
        return cell._replace(letter="n")
    return cell


def _answers(model: str, table: str) -> list[list[str]]:
    return list(csv.reader(call("run", model, table)[1].splitlines()))[1:]


def _round_rows() -> None:
    """Write the rows again, their numbers rounded to float32."""
    with Path("rows.csv").open(newline="", encoding="utf-8") as file:
        rows = [[_single(word) for word in row] for row in csv.reader(file)]
    with Path("rounded.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)


def _single(word: str) -> str:
    try:
        [number] = struct.unpack("f", struct.pack("f", float(word)))
    except ValueError:
        return word
    return repr(number)


def _compared(name: str, truths: Sequence[list[list[str]]], width: int | None) -> Cell:
    """Compare the first so many cells of a file's answers with those of the model.

    A row is right if it is that of any of the tables.
    """
    answers = _answers(name, "rows.csv")
    wrong = [
        row
        for row, *others in zip(answers, *truths, strict=False)
        if not any(all(map(_is_same, row[:width], one[:width])) for one in others)
    ]
    if wrong or len(answers) != len(truths[0]):
        text = f"{len(wrong)} of {len(truths[0])} rows differ"
        return Cell("W", text, f"fuzzytree run {name} rows.csv")
    return Cell(".")


def _is_same(one: str, two: str) -> bool:
    try:
        return math.isclose(float(one), float(two), rel_tol=1e-9, abs_tol=1e-9)
    except ValueError:
        return one == two


def _rows(inputs: list[dict[str, Any]]) -> Iterator[list[str]]:
    """Yield rows at random, some of them on edges or with missing values."""
    pick = random.Random(7)
    for number in range(ROWS):
        row = []
        for variable in inputs:
            points = [*_numbers([term["function"] for term in variable["terms"]])]
            low, high = variable["low"], variable["high"]
            low = min(points, default=0.0) if low is None else low
            high = max(points, default=10.0) if high is None else high
            value = pick.uniform(low, high)
            if number % 3 == 1 and points:
                value = pick.choice(points)
            word = repr(value)
            if variable["categories"]:
                word = pick.choice(variable["categories"])
            elif variable["unit"].startswith("days since"):
                word = f"2024-0{1 + int(value) % 9}-11"
            row.append("" if number >= ROWS - 6 and pick.random() < 0.4 else word)
        yield row


def _numbers(value: object) -> Iterator[float]:
    if isinstance(value, dict):
        value = [*value.values()]
    if isinstance(value, list):
        for part in value:
            yield from _numbers(part)
    elif isinstance(value, float) and math.isfinite(value):
        yield value


# --- the page


HEAD = """\
# What works on which kind of model

Every verb and every target, tried on each kind of model. `python -m
tests.interop.matrix > docs/reference/matrix.md` writes this page, and
`tests/interop/test_matrix.py` compares it with new results. A target has a second line
for `check MODEL FILE`, which runs the programs of other languages and compares all
rows, and a third for the file read back and run.

"""


def all_cells(pattern: str = "") -> dict[str, Cells]:
    """Return the cells of each kind whose name has a pattern."""
    kinds = [kind for kind in KINDS if re.search(pattern, kind)]
    with ProcessPoolExecutor(2) as pool:
        return dict(zip(kinds, pool.map(cells_of, kinds), strict=True))


def reason_of(cell: Cell) -> str | None:
    """Return why a refusal is no hole, if that is known."""
    return next((why for part, why in REASONS if re.search(part, cell.sentence)), None)


def faults(table: Mapping[str, Cells]) -> list[str]:
    """Return the cells that must not be: wrong, or refused without a reason."""
    return [
        f"{cell.letter} {kind}, {name}: {cell.sentence}\n    {cell.command}"
        for kind, cells in table.items()
        for name, cell in cells.items()
        if cell.letter in "WX" or (cell.letter == "r" and reason_of(cell) is None)
    ]


def page(table: Mapping[str, Cells]) -> str:
    """Return the page: the legend, the table, and a reason for each refusal."""
    lines = [HEAD, *(f"- `{letter}`: {text}\n" for letter, text in LETTERS.items())]
    kinds = [*table]
    letters = {kind: chr(ord("a") + place) for place, kind in enumerate(kinds)}
    lines.append("\nKinds: ")
    lines.append(", ".join(f"{letters[kind]} {KINDS[kind].what}" for kind in kinds))
    lines.append(".\n\n| | " + " | ".join(letters.values()) + " |\n")
    lines.append("| --- |" + " --- |" * len(kinds) + "\n")
    names = dict.fromkeys(name for cells in table.values() for name in cells)
    order = [*VERBS, *(n for t in TARGETS for n in (t, f"{t}: check", f"{t}: run"))]
    for name in (name for name in order if name in names):
        row = " | ".join(table[kind].get(name, Cell(" ")).letter for kind in kinds)
        lines.append(f"| {name} | {row} |\n")
    lines.append("\n## What is refused, and why\n\n")
    for part, why in REASONS:
        places = [
            f"{name} ({', '.join(marks)})"
            for name in names
            if (marks := _marks(table, name, part, letters))
        ]
        if places:
            lines.append(f"- {why}: {'; '.join(places)}.\n")
    lines += [*_slow(table)]
    return "".join(lines)


def _slow(table: Mapping[str, Cells]) -> Iterator[str]:
    """Yield what took long, which no test compares."""
    yield "\n## What takes long\n\nMore than 20 seconds of CPU time when this page was "
    yield "written, beside other work:\n\n"
    for kind, cells in table.items():
        for name, cell in cells.items():
            if cell.took > SLOW:
                yield f"- {name}, of {KINDS[kind].what}: {cell.took:.0f} s\n"


def _marks(
    table: Mapping[str, Cells], name: str, part: str, letters: Mapping[str, str]
) -> list[str]:
    """Return the kinds for which a cell is refused for a reason."""
    found: list[str] = []
    for kind, cells in table.items():
        cell = cells.get(name)
        if cell is None or cell.letter != "r":
            continue
        first = next((p for p, _ in REASONS if re.search(p, cell.sentence)), None)
        if first == part:
            found.append(letters[kind])
    return found


def letters_of(text: str, kind: str) -> dict[str, str]:
    """Return the letters that a page has for a kind of model, by cell."""
    place = [*KINDS].index(kind) + 1
    rows = [line.strip("|\n").split("|") for line in text.splitlines() if "|" in line]
    cells = {row[0].strip(): row[place].strip() for row in rows[2:]}
    return {name: letter for name, letter in cells.items() if letter}


def reasons_of(text: str, kind: str) -> dict[str, str]:
    """Return the reasons of refusals that a page has for a kind of model, by cell."""
    letter = chr(ord("a") + [*KINDS].index(kind))
    reasons: dict[str, str] = {}
    for line in text.splitlines():
        for why in (why for _, why in REASONS if line.startswith(f"- {why}: ")):
            for place in line.removeprefix(f"- {why}: ").rstrip(".").split("; "):
                name, _, marks = place.rstrip(")").rpartition(" (")
                if letter in marks.split(", "):
                    reasons[name] = why
    return reasons


def command() -> int:
    """Print the page, or the cells of some kinds; return 1 for faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", default="", help="a pattern; prints cells")
    options = parser.parse_args()
    table = all_cells(options.kinds)
    if options.kinds:
        for kind, cells in table.items():
            for name, cell in cells.items():
                text = f"{cell.letter} {kind:<16} {name:<24} {cell.sentence[:140]}"
                sys.stdout.write(f"{text}\n")
    else:
        sys.stdout.write(page(table))
    found = faults(table)
    sys.stderr.write("".join(f"{line}\n" for line in found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(command())
