"""Written programs, each run by an engine of its language.

A file runs as it is. `fuzzytree.checking.files` compares its text first.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import math
import operator
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, cast

import numpy as np

from fuzzytree.columns import BOOLEANS
from fuzzytree.errors import FuzzyTreeError, MissingExtraError
from fuzzytree.exporters import beginning, fixed_point
from fuzzytree.model import (
    Document,
    FloatArray,
    Option,
    Outcome,
    Variable,
    unlike,
)
from fuzzytree.runtimes import c
from fuzzytree.runtimes.rows import outcome_of
from fuzzytree.semantics import Status

Options = Mapping[str, "Option"]
_LONGEST_WAIT = 600.0  # seconds


class ProgramOutcome(NamedTuple):
    """What a program answered.

    Attributes:
        outcome: Rules or outputs, statuses and strengths.
        labels: The classes; None if the program gives only their places, or numbers.
        has_status: Whether the statuses are the program's own.
    """

    outcome: Outcome
    labels: tuple[str | None, ...] | None
    has_status: bool = True


Engine = Callable[[bytes, Document, Options, "FloatArray"], ProgramOutcome]

_PYTHON = """
import array, json, runpy
answer = runpy.run_path("model.py")["answer"]
facts = json.load(open("facts.json", encoding="utf-8"))
width, classes = facts["width"], facts["classes"]
rows, found = array.array("d"), array.array("d")
rows.frombytes(open("rows.bin", "rb").read())
for row in range(facts["count"]):
    for part in answer(rows[row * width : (row + 1) * width].tolist()):
        if part is None or isinstance(part, str):
            part = -1 if part is None else classes.index(part)
        found.extend(part if isinstance(part, list) else [part])
open("found.bin", "wb").write(found.tobytes())
"""
_NODE = """
import { readFileSync, writeFileSync } from "node:fs";
import { answer } from "./model.mjs";
const { width, count, classes } = JSON.parse(readFileSync("facts.json", "utf-8"));
const kept = (found) => found.outputs === undefined
  ? [classes.indexOf(found.label), found.rule, found.status,
    ...(found.strengths ?? []), ...(found.probabilities ?? [])]
  : [...found.outputs, found.status, ...found.activations];
const bytes = readFileSync("rows.bin");
const rows = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8);
const found = [];
for (let row = 0; row < count; row += 1) {
  found.push(...kept(answer(rows.subarray(row * width, (row + 1) * width))));
}
writeFileSync("found.bin", new Float64Array(found));
"""


def numbers_of(
    content: bytes, language: str, values: FloatArray, classes: Sequence[str]
) -> FloatArray:
    """Run a program of Python or JavaScript in a process of its own.

    Args:
        content: The file.
        language: `python` or `javascript`.
        values: Shape (inputs, rows).
        classes: Of the model; none for a fuzzy system.

    Returns:
        For each row the place of the class, the rule, the status, all strengths, and
        all probabilities if the program has them; of a system its outputs, the status
        and all activations.

    Raises:
        MissingExtraError: If node is not installed.
        FuzzyTreeError: If the program fails.
    """
    is_python = language == "python"
    program = sys.executable if is_python else shutil.which("node")
    if program is None:
        raise MissingExtraError("running JavaScript needs node, which is not installed")
    width, count = values.shape
    facts = {"width": width, "count": count, "classes": list(classes)}
    runner, text = ("run.py", _PYTHON) if is_python else ("run.mjs", _NODE)
    with tempfile.TemporaryDirectory(prefix="fuzzytree-") as place:
        folder = Path(place)
        (folder / f"model.{'py' if is_python else 'mjs'}").write_bytes(content)
        (folder / "facts.json").write_text(json.dumps(facts), "utf-8")
        (folder / "rows.bin").write_bytes(np.ascontiguousarray(values.T).tobytes())
        (folder / runner).write_text(text, "utf-8")
        words = [program, *(("-I",) if is_python else ()), runner]
        try:
            done = subprocess.run(
                words, cwd=folder, capture_output=True, timeout=_LONGEST_WAIT
            )
        except subprocess.TimeoutExpired as error:
            text = f"{language} did not end within {_LONGEST_WAIT:.0f} seconds"
            raise FuzzyTreeError(text) from error
        result = folder / "found.bin"
        if done.returncode or not result.is_file():
            messages = done.stderr.decode("utf-8", "replace").strip().splitlines()
            why = messages[-1] if messages else f"exit code {done.returncode}"
            raise FuzzyTreeError(f"{language} cannot run it: {why}")
        numbers = np.frombuffer(result.read_bytes())
    if not count or numbers.size % count:
        raise FuzzyTreeError(f"{language} does not answer each row")
    return numbers.reshape(count, -1)


def _script(language: str) -> Engine:
    def run(
        content: bytes, model: Document, options: Options, values: FloatArray
    ) -> ProgramOutcome:
        rows = numbers_of(content, language, values, model.classes).tolist()
        if model.outputs:
            return ProgramOutcome(outcome_of(model, rows), None)
        labels = tuple(None if k < 0 else model.classes[int(k)] for k, *_ in rows)
        rows = [row[1:] for row in rows]
        outcome = outcome_of(model, rows, has_probabilities=_is_rated(options))
        return ProgramOutcome(outcome, labels)

    return run


def _is_rated(options: Options) -> bool:
    return options.get("probabilities") is True


def _c(
    content: bytes, model: Document, options: Options, values: FloatArray
) -> ProgramOutcome:
    dtype = options.get("dtype", "float64")
    is_fixed = dtype not in ("float64", "float32")
    run = c.load_content(
        content,
        model,
        cast("c.Dtype", dtype),
        prefix=beginning(model.name, cast("str | None", options.get("name"))),
        with_strengths=not model.outputs or options.get("activations") is True,
        fixed=fixed_point(model, options) if is_fixed else None,
    )
    return ProgramOutcome(run(values), None)


def _sql(
    content: bytes, model: Document, options: Options, values: FloatArray
) -> ProgramOutcome:
    rows = _queried(content, model, options, values)
    if model.outputs:
        return ProgramOutcome(outcome_of(model, rows), None)
    labels = tuple(label for label, *_ in rows)
    rows = [numbers for _, *numbers in rows]
    outcome = outcome_of(model, rows, has_probabilities=_is_rated(options))
    return ProgramOutcome(outcome, labels)


def _queried(
    content: bytes, model: Document, options: Options, values: FloatArray
) -> list[Sequence[Any]]:
    """Return what stands behind the inputs, by sqlite3 or by duckdb, in memory."""
    dialect = options.get("dialect", "sqlite")
    if dialect == "duckdb":
        _need("duckdb", "running SQL of the dialect duckdb")
        duckdb: Any = importlib.import_module("duckdb")
        connection, failure = duckdb.connect(), duckdb.Error
    else:
        connection, failure = sqlite3.connect(":memory:"), sqlite3.Error
    try:
        return _answers(connection, content, model, options, values)
    except failure as error:
        text = f"{dialect} cannot run it: {str(error).splitlines()[0]}"
        raise FuzzyTreeError(text) from error
    finally:
        connection.close()


def _answers(
    connection: Any,
    content: bytes,
    model: Document,
    options: Options,
    values: FloatArray,
) -> list[Sequence[Any]]:
    """Return the answers of a query to a table with rows, categories as their names."""
    inputs = [one for one in model.variables if not one.parts]
    table = _quoted(str(options.get("table", "data")))
    number = _quoted(_row_name(model))
    types = [f"{_quoted(one.name)} {_column_type(one)}" for one in inputs]
    connection.execute(f"CREATE TABLE {table} ({', '.join([*types, number])} INTEGER)")
    marks, width = ", ".join("?" * (len(inputs) + 1)), len(inputs)
    cells = [*map(_cells, inputs, values.tolist()), range(values.shape[1])]
    rows = [*zip(*cells, strict=True)]
    connection.executemany(f"INSERT INTO {table} VALUES ({marks})", rows)
    result = connection.execute(content.decode("utf-8")).fetchall()
    kept = ([_known_cells(row[:width]) for row in some] for some in (rows, result))
    if operator.ne(*kept):
        raise FuzzyTreeError("it does not give each row with its inputs, in order")
    return [row[width:] for row in result]


def _row_name(model: Document) -> str:
    """Return the name of one more column, so that a table has one at least."""
    return unlike("row", set(model.inputs))


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _column_type(variable: Variable) -> str:
    if variable.categories:
        return "BOOLEAN" if variable.categories == BOOLEANS else "VARCHAR"
    return "DOUBLE"


def _cells(variable: Variable, values: Sequence[float]) -> Sequence[object]:
    """Return a column as a table has it: names of categories, or truth values."""
    names = variable.categories
    if not names:
        return values
    cells = (False, True) if names == BOOLEANS else names
    return [None if value != value else cells[int(value)] for value in values]


def _known_cells(row: Sequence[object]) -> tuple[object, ...]:
    """Return the cells of a row, None for NaN."""
    return tuple(None if cell != cell else cell for cell in row)


def _evaluated(content: bytes, model: Document, values: FloatArray) -> Any:
    """Return a table of what JPMML-Evaluator gives for each row."""
    for package in ("jpmml_evaluator", "pandas"):
        _need(package, "running PMML")
    if shutil.which("java") is None:
        raise MissingExtraError("running PMML needs java, which is not installed")
    pandas: Any = importlib.import_module("pandas")
    engine: Any = importlib.import_module("jpmml_evaluator")
    evaluator = engine.make_evaluator(content).verify()
    numbers = {_row_name(model): range(values.shape[1])}
    columns = dict(zip(model.inputs, values, strict=True))
    table = pandas.DataFrame(numbers | columns)
    return evaluator.evaluateAll(table, error_col=None)[0]


def _pmml(
    content: bytes, model: Document, options: Options, values: FloatArray
) -> ProgramOutcome:
    result = _evaluated(content, model, values)
    if model.outputs:
        table = result[[one.name for one in model.outputs]]
        rows = table.to_numpy(dtype=np.float64, na_value=np.nan).tolist()
        outcome = outcome_of(model, [[*row, Status.DECIDED] for row in rows])
        return ProgramOutcome(outcome, None, has_status=False)
    labels = tuple(None if one != one else one for one in result["answer"])
    names = [f"strength of rule {k}" for k in range(1, len(model.rules) + 1)]
    is_rated = _is_rated(options)
    shares = [f"probability of class {c}" for c in model.classes if is_rated]
    inputs = [one for one in model.variables if not one.parts]
    replaced = np.array([one.missing is not None for one in inputs], np.bool_)
    is_known = np.isfinite(values) | replaced.reshape(-1, 1)
    known = np.logical_and.reduce(is_known, axis=0).tolist()
    rows = []
    for place, line in enumerate(result.to_dict("records")):
        identifier = str(line["rule"])  # of a node: no number where no rule decides
        rule = int(identifier) if identifier.isdecimal() else 0
        status = Status.DECIDED if rule else Status.UNCOVERED
        fired = [line[name] if known[place] else math.nan for name in names]
        rated = [line[name] if rule else math.nan for name in shares]
        status = status if known[place] else Status.MISSING
        rows.append([rule, status, *fired, *rated])
    outcome = outcome_of(model, rows, has_probabilities=is_rated)
    return ProgramOutcome(outcome, labels, has_status=False)


def _need(package: str, purpose: str) -> None:
    if importlib.util.find_spec(package) is None:
        text = f"{purpose} needs the package {package!r}, which is not installed"
        raise MissingExtraError(text)


ENGINES: Final[Mapping[str, Engine]] = MappingProxyType(
    {
        "c": _c,
        "python": _script("python"),
        "javascript": _script("javascript"),
        "sql": _sql,
        "pmml": _pmml,
    }
)
"""What runs a program, by the name of its format."""
