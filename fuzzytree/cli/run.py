"""`fuzzytree run`: predictions for the rows of a table, piece by piece."""

from __future__ import annotations

import contextlib
import csv
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias, cast

import click
import msgspec

from fuzzytree.cli.console import (
    TableOptions,
    allow_loss_option,
    argument,
    flag,
    model_argument,
    option,
    output_option,
    progress_bar,
    quiet_option,
    say_rows,
    table_source,
    takes,
    wrong_options,
)
from fuzzytree.errors import TableError
from fuzzytree.files import open_atomically
from fuzzytree.model import (
    checkpoint,
    printable_json,
)
from fuzzytree.semantics import rules_of

if TYPE_CHECKING:
    import pyarrow as pa

    from fuzzytree.model import Document, RuleBase
    from fuzzytree.runtimes import By, OnnxModel, Outputs, Predictions
    from fuzzytree.tables import Batch

Columns = dict[str, Sequence[object]]
RunPart: TypeAlias = (
    "tuple[Batch, Predictions | Outputs, bytes, bytes | pa.Table]"  # head and rows
)

_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # with which a cell begins
_BINARY = (".parquet", ".pq", ".arrow", ".feather")  # files that are no text
_MOST_NAMED = 20  # classes whose rows are counted in words
_GROUP = 1 << 26  # bytes of rows that a binary file gets at a time


class RunOptions(TableOptions):
    """The arguments and options of the verb."""

    model: str = model_argument()
    table: str = argument("TABLE")
    output: str = output_option(
        "-o --output FILE",
        "File to write: CSV, or Parquet or Arrow if its name ends in .parquet, "
        ".arrow or .feather; `-` is CSV on stdout.",
        default="-",
    )
    strengths: By | None = option(
        "--strengths",
        "Add a column with the firing strength of each class or rule.",
        choices=["class", "rule"],
    )
    probabilities: bool = flag(
        "--probabilities", "Add a column with the probability of each class."
    )
    why: bool = flag(
        "--why",
        "Add the winning rule, with degrees below 1; `fuzzytree why` explains one row.",
    )
    keep: bool = flag("--keep", "Add the columns of TABLE before the others.")
    runtime: str | None = option(
        "--runtime NAME", "Runtime that executes the model; native by default."
    )
    as_json: bool = flag(
        "--json", "Write JSON lines in place of CSV; null for an empty cell."
    )
    safe_csv: bool = flag(
        "--safe-csv",
        "Put an apostrophe before text that a spreadsheet reads as a formula.",
    )
    allow_loss: bool = allow_loss_option
    quiet: bool = quiet_option


@click.command("run", short_help="Predict the rows of a table.")
@takes(RunOptions)
def command(options: RunOptions) -> None:
    """Predict the rows of TABLE: a class, a rule number and a status for each.

    A fuzzy system predicts a number for each output, and a status. MODEL is a readable
    file or ONNX; TABLE is a file, a folder or a pattern of files of CSV, Parquet or
    Arrow, or `-` for standard input. Columns are matched by name. Rule numbers count
    from 1; 0 is no rule.
    """
    from fuzzytree import api
    from fuzzytree.runtimes import OnnxModel
    from fuzzytree.tables import rate_text

    suffix = Path(options.output).suffix.lower()
    is_binary = suffix in _BINARY
    if is_binary and (options.as_json or options.safe_csv):
        flag = "--json" if options.as_json else "--safe-csv"
        raise click.UsageError(
            f"{flag} is about text, and {options.output} is a binary file"
        )
    if options.as_json and options.safe_csv:
        raise click.UsageError("--safe-csv is about CSV, and --json writes none")
    found = api.opened(options.model, allow_loss=options.allow_loss)
    reason = _reasons(options.model, found) if options.why else None
    if options.strengths and not isinstance(found, OnnxModel):
        found = rules_of(found)
    if options.strengths == "class" and not found.classes:
        raise click.UsageError(
            f"--strengths class: {found.name} is a fuzzy system, which decides for no "
            "class; there is --strengths rule"
        )
    is_weighed = options.strengths is not None or (options.why and not found.classes)
    with wrong_options():
        answer = api.prepare_answering(
            found,
            options.runtime,
            with_strengths=is_weighed,
            with_probabilities=options.probabilities,
        )
    source = table_source(options.table, options)
    name = "standard input" if options.table == "-" else options.table
    finish = _part_maker(options, name, reason, is_binary=is_binary)
    has_status = not isinstance(found, OnnxModel) or "status" in found.outputs
    tally, begin = _Tally(has_status), time.monotonic()
    is_mixed = options.output == "-" and sys.stdout.isatty()
    with (
        _opened(options.output) as stream,
        _table_writer(stream, suffix) as write,
        progress_bar(quiet=options.quiet or is_mixed) as show,
        contextlib.closing(
            answer(source, finish, name=name, with_others=options.keep)
        ) as parts,
    ):
        for number, (batch, answers, head, rows) in enumerate(parts):
            checkpoint()
            if isinstance(rows, bytes):
                stream.write(rows if number else head + rows)
            else:
                write(rows, batch.piece.name)
            tally.add(batch, answers)
            show(rate_text(tally.rows, begin), None)
    tally.report(options.output, quiet=options.quiet)


def _part_maker(
    options: RunOptions,
    name: str,
    reason: Callable[[Batch, Predictions | Outputs], list[str]] | None,
    *,
    is_binary: bool,
) -> Callable[[Batch, Predictions | Outputs], RunPart]:
    """Return a function that makes what is written of the rows of a batch."""

    def lines(columns: Columns) -> list[str]:
        if options.as_json:
            return _json_lines(columns)
        return _csv_lines(zip(*columns.values(), strict=True), options.safe_csv)

    def head(columns: Columns) -> bytes:
        names = [] if options.as_json else _csv_lines([[*columns]], options.safe_csv)
        return "".join(names).encode()

    def finish(batch: Batch, answers: Predictions | Outputs) -> RunPart:
        from fuzzytree.runtimes import Predictions

        is_more = options.strengths or options.probabilities
        is_short = not (options.keep or is_more or reason)
        if is_short and not is_binary and isinstance(answers, Predictions):
            columns, text = _few_lines(answers, lines)
            return batch, answers, head(columns), text.encode()
        columns = _kept(batch, as_arrow=is_binary) if options.keep else {}
        _add(columns, _answered(answers, options, as_arrow=is_binary), name)
        if reason:
            _add(columns, {"why": reason(batch, answers)}, name)
        if is_binary:
            import pyarrow as pa

            return batch, answers, b"", pa.table(columns)
        return batch, answers, head(columns), "".join(lines(columns)).encode()

    return finish


def _few_lines(
    answers: Predictions, lines: Callable[[Columns], list[str]]
) -> tuple[Columns, str]:
    """Return the lines of predictions, each different one made once."""
    keys = ((answers.codes << 34) | (answers.rule << 2) | answers.status).tolist()
    rows = {key: row for row, key in enumerate(keys)}
    few = [*rows.values()]
    columns = msgspec.structs.replace(
        answers,
        codes=answers.codes[few],
        rule=answers.rule[few],
        status=answers.status[few],
        strengths=None,
    ).columns()
    line = dict(zip(rows, lines(columns), strict=True))
    return columns, "".join(map(line.__getitem__, keys))


def _answered(
    answers: Predictions | Outputs, options: RunOptions, *, as_arrow: bool
) -> Columns:
    columns: Any = answers.to_arrow if as_arrow else answers.columns
    try:
        result = columns(options.strengths)
    except ValueError as error:
        raise click.UsageError(
            f"--strengths {options.strengths}: {options.model} does not report them; "
            "export it with --outputs label,rule,status,strengths, "
            "or run the YAML file"
        ) from error
    return {name: result[name] for name in result.column_names} if as_arrow else result


def _kept(batch: Batch, *, as_arrow: bool) -> Columns:
    from fuzzytree.cells import plain

    piece = batch.piece
    cells: Sequence[Any] = piece.cells
    if as_arrow and piece.frame is not None:
        frame: Any = piece.frame
        cells = [frame.column(name) for name in piece.written]
    elif not as_arrow:
        cells = [plain(column) for column in cells]
    return dict(zip(piece.columns, cells, strict=True))


def _add(columns: Columns, more: Columns, name: str) -> None:
    twice = [column for column in more if column in columns]
    if twice:
        raise TableError(
            f"{name} has a column {twice[0]!r} of its own; leave out --keep, "
            "or rename the column"
        )
    columns.update(more)


def _reasons(
    path: str, model: Document | OnnxModel
) -> Callable[[Batch, Predictions | Outputs], list[str]]:
    from fuzzytree.report import system_reasons
    from fuzzytree.runtimes import OnnxModel, Outputs, reasons

    if isinstance(model, OnnxModel):
        raise click.UsageError(
            f"--why: {path} does not contain the rules as text; run the YAML file"
        )
    rules = rules_of(model)

    def reason(batch: Batch, found: Predictions | Outputs) -> list[str]:
        if isinstance(found, Outputs):
            return system_reasons(rules, found)
        return reasons(cast("RuleBase", rules), batch.values, found)  # of classes

    return reason


@contextlib.contextmanager
def _opened(output: str) -> Generator[BinaryIO]:
    """Open the output; a file appears only when all rows are answered."""
    if output == "-":
        sys.stdout.flush()
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
        return
    with open_atomically(output) as file:
        yield file


@contextlib.contextmanager
def _table_writer(
    stream: BinaryIO, suffix: str
) -> Generator[Callable[[pa.Table, str], None]]:
    """Give a function that writes some rows, of a table with a name, to a binary file.

    Rows are written in groups of some 64 MB.
    """
    rows: list[pa.Table] = []
    with contextlib.ExitStack() as stack:
        files: list[tuple[Any, pa.Schema]] = []

        def write(table: pa.Table, name: str) -> None:
            if not files:
                import pyarrow as pa
                import pyarrow.parquet as pq

                is_parquet = suffix in _BINARY[:2]
                begin = pq.ParquetWriter if is_parquet else pa.ipc.new_file
                file = begin(stream, table.schema)
                stack.callback(file.close)
                files.append((file, table.schema))
            rows.append(_cast(table, files[0][1], name))
            if sum(one.nbytes for one in rows) >= _GROUP:
                flush()

        def flush() -> None:
            import pyarrow as pa

            files[0][0].write_table(pa.concat_tables(rows))
            rows.clear()

        yield write
        if rows:
            flush()


def _cast(table: pa.Table, schema: pa.Schema, name: str) -> pa.Table:
    import pyarrow as pa

    try:
        return table.cast(schema)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
        raise TableError(
            f"{name}: columns have other types than in the files before it; leave out "
            f"--keep, or convert them: {error}"
        ) from error


class _Lines(list[str]):
    """The lines that a CSV writer writes."""

    def write(self, line: str) -> None:
        """Take a line."""
        self.append(line)


def _csv_lines(rows: Iterable[Sequence[object]], is_safe: bool) -> list[str]:
    lines = _Lines()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerows(map(_spreadsheet_row, rows) if is_safe else rows)
    return lines


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


def _json_lines(columns: Columns) -> list[str]:
    result: list[str] = []
    for row in zip(*columns.values(), strict=True):
        cells = (None if cell == "" else cell for cell in row)
        facts = dict(zip(columns, cells, strict=True))
        result.append(printable_json(json.dumps(facts, ensure_ascii=False)) + "\n")
    return result


class _Tally:
    """Counts what was answered, over all pieces."""

    def __init__(self, has_status: bool) -> None:
        self.has_status = has_status
        self.rows = self.cells = self.extras = 0
        self.is_numeric = False
        self.remarks: list[tuple[str, str]] = []
        self.classes: Counter[str] = Counter()
        self.spans: dict[str, tuple[float, float]] = {}
        self.statuses: Counter[int] = Counter()
        self.unknown: Counter[str] = Counter()

    def add(self, batch: Batch, answers: Predictions | Outputs) -> None:
        """Take the answers to a piece."""
        from fuzzytree.runtimes import Outputs
        from fuzzytree.tables import trimmed

        self.rows += len(answers)
        self.cells += batch.missing
        self.unknown.update(batch.unknown)
        self.extras = batch.extras
        self.remarks = trimmed(batch.piece)
        if isinstance(answers, Outputs):
            self.is_numeric = True
            for name, (low, high) in answers.spans().items():
                known = self.spans.get(name, (low, high))
                self.spans[name] = (min(low, known[0]), max(high, known[1]))
        else:
            self.classes.update(answers.class_counts())
        self.statuses.update({status: answers.count(status) for status in range(4)})

    def _unusual_cells(self) -> Iterator[tuple[str, str, str]]:
        """Yield what was missing or unknown in the inputs."""
        from fuzzytree.report import counted

        if self.cells:
            yield "missing", counted(self.cells, "cell"), "in the inputs"
        for name, count in self.unknown.items():
            why = "no category of the model; answered like a missing one"
            yield "unknown", f"{counted(count, 'cell')} of {name}", why

    def report(self, output: str, *, quiet: bool) -> None:
        """Report on stderr what was predicted and what was unusual."""
        from fuzzytree.report import counted, number

        counts = [f"{name} {count}" for name, count in self.classes.items()]
        if len(counts) > _MOST_NAMED:
            rest = len(counts) - _MOST_NAMED
            counts[_MOST_NAMED:] = [counted(rest, "more class", "more classes")]
        counts += [
            f"{name} {number(low)} to {number(high)}"
            for name, (low, high) in self.spans.items()
        ]
        _, ties, uncovered, missing = (self.statuses[k] for k in range(4))
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
            *self._unusual_cells(),
            *(("remark", name, f"has {text}") for name, text in self.remarks),
            *([("ignored", counted(self.extras, "column"), "")] if self.extras else []),
            *([("wrote", output, "")] if output != "-" else []),
            quiet=quiet,
        )
