"""Fuzzylite 6 (a program) and pyfuzzylite 8 (a library) as judges of files.

Both are engines of others. The program's exit code says nothing, and it drops what it
does not understand: what counts is the numbers, and how many rules were loaded.
"""

from __future__ import annotations

import importlib
import math
import subprocess
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fuzzytree.model.rulebase import RuleBase
from fuzzytree.semantics import as_system, flattened
from fuzzytree.semantics.inference import input_values

DECIMALS = 17
"""With how many decimals the program prints."""

SECONDS = 120.0


class Answers(NamedTuple):
    """What an engine made of a file and of rows.

    `outputs` holds a number for each output of each row; `rules` counts the rules
    that it loaded.
    """

    outputs: list[tuple[float, ...]]
    rules: int


def run_program(
    program: str,
    content: bytes,
    rows: Iterable[Sequence[float]],
    folder: Path,
    *,
    kind: str = "fll",
) -> Answers:
    """Run fuzzylite 6 on a file of `kind` (fll, fcl or fis).

    Args:
        program: The path of `fuzzylite`.
        content: The file.
        rows: Values of the inputs, in the order of the file.
        folder: Where files can be written.
        kind: The format of the file.
    """
    model, table = folder / f"model.{kind}", folder / "rows.txt"
    model.write_bytes(content)
    lines = [" ".join(map(repr, map(float, row))) for row in rows]
    table.write_text("".join(f"{line}\n" for line in lines))
    printed, said = _call(
        program,
        model,
        folder / "answers.fld",
        *("-d", table, "-dheader", "false", "-dinputs", "false"),
    )
    outputs = [tuple(map(float, line.split())) for line in printed.splitlines()]
    if len(outputs) != len(lines):
        raise AssertionError(
            f"{len(lines)} rows, but answers to {len(outputs)}: {said}"
        )
    fis, refused = _call(program, model, folder / "again.fis")
    if "[exporter error]" in refused and kind == "fll":
        return Answers(outputs, content.count(b"\n  rule: ") - said.count(" error]"))
    return Answers(outputs, _loaded(fis))


def _call(
    program: str, model: Path, result: Path, *options: str | Path
) -> tuple[str, str]:
    """Return what the program wrote to a file, and what it said."""
    result.unlink(missing_ok=True)
    kind, other = model.suffix[1:], result.suffix[1:]
    files = ("-i", model, "-if", kind, "-o", result, "-of", other)
    command = [program, *files, "-decimals", str(DECIMALS), *options]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=SECONDS, check=False
    )
    said = done.stdout + done.stderr
    if not result.exists():
        raise AssertionError(f"nothing was written: {said}")
    return result.read_text(), said


def _loaded(fis: str) -> int:
    """Count the rules of a FIS text: the program writes there only those it loaded.

    FIS cannot hold every rule. Of an FLL file that it cannot hold, the lines with rules
    are counted, without those about which the program told a syntax error.
    """
    _, _, rules = fis.partition("[Rules]")
    return sum(1 for line in rules.splitlines() if ":" in line)


def run_library(content: bytes, rows: Iterable[Sequence[float]]) -> Answers:
    """Run pyfuzzylite 8 on an FLL file, row by row."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # numpy's, of overflows
        return _run_library(load_engine(content), rows)


def _run_library(engine: Any, rows: Iterable[Sequence[float]]) -> Answers:
    outputs: list[tuple[float, ...]] = []
    for row in rows:
        engine.restart()
        for variable, value in zip(engine.input_variables, row, strict=True):
            variable.value = value
        engine.process()
        found = (float(_scalar(one.value)) for one in engine.output_variables)
        outputs.append(tuple(found))
    blocks = engine.rule_blocks
    rules = sum(rule.is_loaded() for block in blocks for rule in block.rules)
    return Answers(outputs, rules)


def load_engine(content: bytes) -> Any:
    """Return pyfuzzylite's engine of an FLL file; raises where it finds a mistake."""
    importer = importlib.import_module("fuzzylite").FllImporter()
    return importer.from_string(content.decode("utf-8"))


def _scalar(value: Any) -> float:
    """Return the only number of a value that may be an array."""
    return float(value.item()) if hasattr(value, "item") else float(value)


def largest_difference(
    first: Iterable[Sequence[float]], second: Iterable[Sequence[float]]
) -> float:
    """Return the largest difference of two tables; NaN equals NaN and nothing else."""
    largest = 0.0
    for ours, theirs in zip(first, second, strict=True):
        for one, other in zip(ours, theirs, strict=True):
            if math.isnan(one) and math.isnan(other):
                continue
            difference = abs(one - other) if one != other else 0.0
            largest = max(largest, math.inf if difference != difference else difference)
    return largest


def file_rows(
    rules: RuleBase, rows: Iterable[Mapping[str, float]]
) -> list[list[float]]:
    """Return the values of the inputs of a rule base's file, in their order."""
    system = as_system(rules)
    columns = flattened(system)[0].inputs
    values = (input_values(system.variables, row) for row in rows)
    return [[row[name] for name in columns] for row in values]
