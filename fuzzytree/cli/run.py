"""`fuzzytree run`: predictions for the rows of a table, piece by piece."""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
import json
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import TYPE_CHECKING, BinaryIO, TextIO

import click

from fuzzytree.cli.console import (
    allow_loss_option,
    argument,
    delimiter_option,
    option,
    quiet_option,
    say_rows,
    table_source,
    takes,
    wrong_options,
)
from fuzzytree.errors import TableError
from fuzzytree.files import open_atomically
from fuzzytree.model import FuzzySystem, FuzzyTree, RuleBase, printable_json
from fuzzytree.semantics import rules_from_tree

if TYPE_CHECKING:
    from fuzzytree.model import Document
    from fuzzytree.runtimes import By, OnnxModel, Outputs, Predictions
    from fuzzytree.tables import Batch

Columns = dict[str, Sequence[object]]

_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # with which a cell begins


class RunOptions:
    """The arguments and options of the verb."""

    model: str = argument(metavar="MODEL")
    table: str = argument(metavar="TABLE")
    output: str = option(
        "-o",
        "--output",
        default="-",
        metavar="FILE",
        help="CSV file to write; stdout by default.",
    )
    strengths: By | None = option(
        "--strengths",
        type=click.Choice(["class", "rule"]),
        help="Add a column with the firing strength of each class or rule.",
    )
    why: bool = option(
        "--why",
        is_flag=True,
        help="Add the winning rule, with its degrees of membership.",
    )
    keep: bool = option(
        "--keep", is_flag=True, help="Add the columns of TABLE before the others."
    )
    runtime: str | None = option(
        "--runtime",
        metavar="NAME",
        help="Runtime that executes the model; native by default.",
    )
    delimiter: str | None = delimiter_option
    as_json: bool = option(
        "--json",
        is_flag=True,
        help="Write JSON lines in place of CSV; null for an empty cell.",
    )
    safe_csv: bool = option(
        "--safe-csv",
        is_flag=True,
        help="Put an apostrophe before text that a spreadsheet reads as a formula.",
    )
    allow_loss: bool = allow_loss_option
    quiet: bool = quiet_option


@click.command("run", short_help="Predict the rows of a table.")
@takes(RunOptions)
def command(options: RunOptions) -> None:
    """Predict the rows of TABLE: a class, a rule number and a status for each.

    A fuzzy system predicts a number for each output, and a status. MODEL is a readable
    file or ONNX; TABLE is CSV or Parquet, or `-` for standard input. Columns are
    matched by name. Rule numbers count from 1; 0 is no rule.
    """
    from fuzzytree import api

    if options.as_json and options.safe_csv:
        raise click.UsageError("--safe-csv is about CSV, and --json writes none")
    found = api.opened(options.model, allow_loss=options.allow_loss)
    reason = _reasons(options.model, found) if options.why else None
    if options.strengths and isinstance(found, FuzzyTree):
        found = rules_from_tree(found)
    if options.strengths == "class" and isinstance(found, FuzzySystem):
        raise click.UsageError(
            f"--strengths class: {found.name} is a fuzzy system, which decides for no "
            "class; there is --strengths rule"
        )
    is_weighed = options.strengths is not None or (
        options.why and isinstance(found, FuzzySystem)
    )
    with wrong_options():
        answer = api.prepare_answering(
            found, options.runtime, with_strengths=is_weighed
        )
    source = table_source(options.table, options.delimiter)
    name = "standard input" if options.table == "-" else options.table
    tally = _Tally(_has_status(found))
    with _opened(options.output) as stream:
        batches = answer(source, name=name, with_others=options.keep)
        write = (
            _json_writer(stream)
            if options.as_json
            else _csv_writer(stream, options.safe_csv)
        )
        for batch, answers in batches:
            columns = _kept(batch) if options.keep else {}
            _add(columns, _answered(answers, options.strengths, options.model), name)
            if reason:
                _add(columns, {"why": reason(batch, answers)}, name)
            write(columns)
            tally.add(batch, answers)
    tally.report(options.output, quiet=options.quiet)


def _answered(
    answers: Predictions | Outputs, strengths: By | None, model: str
) -> Columns:
    from fuzzytree.runtimes import Outputs

    if isinstance(answers, Outputs):
        return answers.columns(with_activations=strengths is not None)
    try:
        return answers.columns(strengths)
    except ValueError as error:
        raise click.UsageError(
            f"--strengths {strengths}: {model} does not report them; "
            "export it with --outputs label,rule,status,strengths, "
            "or run the YAML file"
        ) from error


def _kept(batch: Batch) -> Columns:
    from fuzzytree.tables import plain

    cells = map(plain, batch.piece.cells)
    return dict(zip(batch.piece.columns, cells, strict=True))


def _add(columns: Columns, more: Columns, name: str) -> None:
    twice = [column for column in more if column in columns]
    if twice:
        raise TableError(
            f"{name} has a column {twice[0]!r} of its own; leave out --keep, "
            "or rename the column"
        )
    columns.update(more)


def _has_status(model: Document | OnnxModel) -> bool:
    if isinstance(model, FuzzyTree | RuleBase | FuzzySystem):
        return True
    return "status" in model.outputs


def _reasons(
    path: str, model: Document | OnnxModel
) -> Callable[[Batch, Predictions | Outputs], list[str]]:
    from fuzzytree.report import system_reasons
    from fuzzytree.runtimes import OnnxModel, Outputs, Predictions, reasons

    if isinstance(model, OnnxModel):
        raise click.UsageError(
            f"--why: {path} does not contain the rules as text; run the YAML file"
        )
    rules = rules_from_tree(model) if isinstance(model, FuzzyTree) else model

    def reason(batch: Batch, found: Predictions | Outputs) -> list[str]:
        if isinstance(rules, FuzzySystem):
            assert isinstance(found, Outputs)  # a system answers nothing else
            return system_reasons(rules, found)
        assert isinstance(found, Predictions)
        return reasons(rules, batch.values, found)

    return reason


@contextlib.contextmanager
def _opened(output: str) -> Generator[TextIO]:
    """Open the output as text; a file appears only when all rows are answered."""
    if output == "-":
        sys.stdout.flush()
        with _as_text(sys.stdout.buffer) as text:
            yield text
        return
    with open_atomically(output) as file, _as_text(file) as text:
        yield text


@contextlib.contextmanager
def _as_text(file: BinaryIO) -> Generator[TextIO]:
    text = io.TextIOWrapper(file, "utf-8", newline="")
    try:
        yield text
        text.flush()
    finally:
        text.detach()  # it would close a file that is not ours to close


def _csv_writer(stream: TextIO, is_safe: bool) -> Callable[[Columns], None]:
    writer = csv.writer(stream, lineterminator="\n")
    headed = itertools.count()

    def write(columns: Columns) -> None:
        rows: Iterator[Sequence[object]] = zip(*columns.values(), strict=True)
        if next(headed) == 0:
            rows = itertools.chain([[*columns]], rows)
        writer.writerows(map(_spreadsheet_row, rows) if is_safe else rows)

    return write


def _spreadsheet_row(row: Sequence[object]) -> list[object]:
    """Return cells none of which a spreadsheet takes for a formula.

    Example:
        >>> _spreadsheet_row(["=1+1", "-1.5", -1.5, "a=b"])
        ["'=1+1", '-1.5', -1.5, 'a=b']
    """
    return [
        f"'{cell}"
        if isinstance(cell, str) and cell.startswith(_FORMULA) and not _is_number(cell)
        else cell
        for cell in row
    ]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _json_writer(stream: TextIO) -> Callable[[Columns], None]:
    def write(columns: Columns) -> None:
        for row in zip(*columns.values(), strict=True):
            cells = (None if cell == "" else cell for cell in row)
            facts = dict(zip(columns, cells, strict=True))
            line = printable_json(json.dumps(facts, ensure_ascii=False))
            stream.write(f"{line}\n")

    return write


class _Tally:
    """Counts what was answered, over all pieces."""

    def __init__(self, has_status: bool) -> None:
        self.has_status = has_status
        self.rows = self.cells = self.extras = 0
        self.is_numeric = False
        self.remarks: list[tuple[str, str]] = []
        self.classes: dict[str, int] = {}
        self.spans: dict[str, tuple[float, float]] = {}
        self.statuses: dict[int, int] = {}

    def add(self, batch: Batch, answers: Predictions | Outputs) -> None:
        """Take the answers to a piece."""
        from fuzzytree.runtimes import Outputs
        from fuzzytree.tables import trimmed

        self.rows += len(answers)
        self.cells += batch.missing
        self.extras = batch.extras
        self.remarks = trimmed(batch.piece)
        if isinstance(answers, Outputs):
            self.is_numeric = True
            for name, (low, high) in answers.spans().items():
                known = self.spans.get(name, (low, high))
                self.spans[name] = (min(low, known[0]), max(high, known[1]))
        else:
            for name, count in answers.class_counts().items():
                self.classes[name] = self.classes.get(name, 0) + count
        for status in range(4):
            self.statuses[status] = self.statuses.get(status, 0) + answers.count(status)

    def report(self, output: str, *, quiet: bool) -> None:
        """Report on stderr what was predicted and what was unusual."""
        from fuzzytree.report import counted, number

        counts = [f"{name} {count}" for name, count in self.classes.items()]
        counts += [
            f"{name} {number(low)} to {number(high)}"
            for name, (low, high) in self.spans.items()
        ]
        _, ties, uncovered, missing = (self.statuses.get(k, 0) for k in range(4))
        status = [
            f"{counted(uncovered, 'row')} with no rule fired",
            f"{counted(missing, 'row')} with a missing input",
        ]
        if not self.is_numeric:
            by_order = f"{counted(ties, 'row')} decided by the order of the rules"
            unknown = "ties: not reported by this file"
            status.insert(0, by_order if self.has_status else unknown)
        say_rows(
            ("predicted", counted(self.rows, "row"), ", ".join(counts)),
            ("status", "; ".join(status), ""),
            *(("remark", name, f"has {text}") for name, text in self.remarks),
            *([("ignored", counted(self.extras, "column"), "")] if self.extras else []),
            *([("wrote", output, "")] if output != "-" else []),
            quiet=quiet,
        )
