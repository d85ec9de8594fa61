"""Rows in from anything, with the names of their columns.

A table is a path to a CSV or Parquet file, an open stream of either, a pandas, polars
or arrow table, or a numpy array. Nothing is guessed: columns are found by their names,
a number has a decimal point and no thousands separators, and a cell that is neither a
number nor missing is an error that says where it stands.
"""

from __future__ import annotations

import contextlib
import csv
import difflib
import io
import itertools
import math
import operator
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.errors import MissingExtraError, TableError, install_hint
from fuzzytree.files import reason

if TYPE_CHECKING:
    from narwhals.typing import IntoDataFrame, IntoLazyFrame

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Cells = Sequence[object] | npt.NDArray[np.generic]
Only = frozenset[str] | None

MISSING = frozenset({"", "na", "n/a", "nan", "null", "none"})
"""The texts, in small letters, that stand for a missing number."""

PIECE = 4096
"""How many rows of a file are read at a time."""

_REAL = frozenset("biuf")  # numpy's letters for truth values, integers, floats
_DELIMITERS = (",", ";", "\t")
_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|inf|infinity|nan)",
    re.IGNORECASE,
)

_NO_DELIMITER = '"\r\n\0'


class Piece(msgspec.Struct, frozen=True, eq=False):
    """Some rows of a table, column by column, as they came.

    Attributes:
        name: What messages call the table.
        columns: The names of all columns.
        cells: One entry for each column, each with one cell for each row; empty for
            a column that was not asked for.
        rows: How many rows these are.
        where: The place of a row of this piece, as messages name it.
        is_named: Whether the names came with the table; if not they are x1, x2, ...
        whole: All cells as one array of shape (columns, rows), where they are one.
    """

    name: str
    columns: tuple[str, ...]
    cells: tuple[Cells, ...]
    rows: int
    where: Callable[[int], str]
    is_named: bool = True
    whole: FloatArray | None = None


class Table(msgspec.Struct, frozen=True, eq=False):
    """A table to learn from.

    Attributes:
        name: What messages call it.
        columns: The names of the columns of numbers.
        values: Shape (columns, rows); NaN is missing.
        classes: The classes that occur: whole numbers by size, other names by
            alphabet.
        codes: The position of each row's class in `classes`.
        missing: How many cells are missing.
        unlabelled: How many rows were left out because they had no class.
        target: The column of the classes; empty if they came by themselves.
    """

    name: str
    columns: tuple[str, ...]
    values: FloatArray
    classes: tuple[str, ...]
    codes: IntArray
    missing: int = 0
    unlabelled: int = 0
    target: str = ""


class Batch(msgspec.Struct, frozen=True, eq=False):
    """Some rows to answer.

    Attributes:
        values: Shape (inputs, rows), in the order of the model's inputs.
        missing: How many cells are missing.
        extras: How many columns the model does not need.
        piece: The rows as they came.
    """

    values: FloatArray
    missing: int
    extras: int
    piece: Piece


def read_table(
    source: object,
    *,
    target: str | Sequence[object] | npt.NDArray[np.generic],
    ignore: Sequence[str] = (),
    columns: Sequence[str] | None = None,
    delimiter: str | None = None,
    name: str | None = None,
) -> Table:
    """Read a whole table with a class for each row.

    Truth values become 0 and 1. Classes keep the text they have; whole numbers lose
    a fraction of zero, so that 1, 1.0 and "1" are one class.

    Args:
        source: The table; see the module.
        target: The column of the classes, or the classes themselves.
        ignore: Columns to leave out.
        columns: The names of an array's columns; x1, x2, ... unless given.
        delimiter: Of a CSV file; the only one of `,` `;` and tab in its first line
            unless given.
        name: What messages call the table; its path unless given.

    Raises:
        TableError: If a column is absent, stands twice or holds text, if there is no
            row, or if rows have different lengths; all such columns are named.
        MissingExtraError: If the table is Parquet and pyarrow is not installed.
        TypeError: If the source is no table.

    Example:
        >>> table = read_table(np.array([[1.5], [2.5]]), target=["soft", "firm"])
        >>> table.columns, table.values.tolist(), table.classes, table.codes.tolist()
        (('x1',), [[1.5, 2.5]], ('firm', 'soft'), [1, 0])
    """
    found = pieces(source, columns=columns, delimiter=delimiter, name=name)
    first = next(found)
    chosen = _learnt_columns(first, target, ignore)
    numbers = _Numbers(first.name, [first.columns[k] for k in chosen])
    classes: list[Cells] = [] if isinstance(target, str) else [target]
    for piece in itertools.chain([first], found):
        numbers.add(piece, chosen)
        if isinstance(target, str):
            classes.append(piece.cells[piece.columns.index(target)])
    if numbers.faults:
        hint = " ".join(f"--ignore {_quoted(k)}" for k in numbers.faults)
        raise TableError(
            f"{numbers.fault_text()}\n  leave columns out with ignore ({hint})"
        )
    values = numbers.joined()
    if not values.shape[1]:
        raise TableError(f"{first.name} has no rows")
    names = class_names(classes)
    if len(names) != values.shape[1]:
        raise TableError(
            f"{first.name} has {values.shape[1]} rows, and there are "
            f"{len(names)} classes for them"
        )
    made = _labelled(first.name, numbers.names, values, names)
    title = target if isinstance(target, str) else ""
    return msgspec.structs.replace(made, target=title)


def batches(
    source: object,
    inputs: Sequence[str],
    *,
    trained: Sequence[str] = (),
    columns: Sequence[str] | None = None,
    delimiter: str | None = None,
    name: str | None = None,
    with_others: bool = False,
) -> Iterator[Batch]:
    """Yield the rows of a table for a model, files piece by piece.

    Columns are found by name, in any order; columns that the model does not need are
    counted. An array without names that is as wide as the table that the model was
    learnt from has that table's names; for a model that was not learnt, it has the
    names of the inputs.

    Args:
        source: The table; see the module.
        inputs: The names of the columns that the model needs, in its order.
        trained: The names of all columns that it was learnt from.
        columns: The names of an array's columns.
        delimiter: As in `read_table`.
        name: As in `read_table`.
        with_others: Whether the pieces hold the other columns' cells as well; unless
            they do, a Parquet file's are not read and a frame's not converted.

    Raises:
        TableError: If a column is absent, stands twice or holds text, or rows have
            different lengths.
        MissingExtraError: If the table is Parquet and pyarrow is not installed.
        TypeError: If the source is no table.
    """
    chosen: list[int] | None = None
    only = None if with_others else frozenset(inputs)
    for piece in pieces(
        source, columns=columns, delimiter=delimiter, name=name, only=only
    ):
        if chosen is None:
            chosen = _needed_columns(piece, inputs, trained)
        numbers = _Numbers(piece.name, list(inputs))
        numbers.add(piece, chosen)
        if numbers.faults:
            raise TableError(numbers.fault_text())
        extras = len(piece.columns) - len(chosen)
        yield Batch(numbers.joined(), numbers.missing, extras, piece)


def pieces(
    source: object,
    *,
    columns: Sequence[str] | None = None,
    delimiter: str | None = None,
    name: str | None = None,
    only: Only = None,
) -> Iterator[Piece]:
    """Yield a table in pieces; at least one, of no rows if the table has none.

    Args:
        source: The table; see the module.
        columns: The names of an array's columns.
        delimiter: As in `read_table`.
        name: As in `read_table`.
        only: The columns whose cells are wanted; all of them if None.

    Raises:
        TableError: If columns have no names of their own, or rows no equal length.
        MissingExtraError: If the table is Parquet and pyarrow is not installed.
        TypeError: If the source is no table.
    """
    match source:
        case str() | os.PathLike():
            path = cast("str | os.PathLike[str]", source)
            return _file_pieces(path, delimiter, name, only)
        case io.TextIOBase():
            return _csv_pieces(source, name or "the table", delimiter, only)
        case io.BufferedReader() | io.BytesIO():
            return _stream_pieces(source, name or "the table", delimiter, only)
        case np.ndarray():
            array = cast("npt.NDArray[np.generic]", source)
            return iter([_array_piece(array, columns, name or "the array")])
        case _:
            return iter([_frame_piece(source, name or "the table", only=only)])


def class_names(cells: Sequence[Cells]) -> list[str | None]:
    """Return the class of each row as text; None where it is missing.

    Text stays as it is, "01" and "no" too; only a cell without any text is missing.
    Whole numbers have no fraction, and other numbers have all their digits.

    Example:
        >>> class_names([[1.0, 2.0, None], ["01", ""]])
        ['1', '2', None, '01', None]
    """
    values = [
        value
        for part in cells
        for value in (part.tolist() if isinstance(part, np.ndarray) else part)
    ]
    floats = [v for v in values if isinstance(v, float) and math.isfinite(v)]
    is_whole = all(v.is_integer() for v in floats)
    return [_class_name(value, is_whole=is_whole) for value in values]


def _class_name(value: object, *, is_whole: bool) -> str | None:
    if isinstance(value, str):
        return value if value.strip() else None
    if _is_missing(value):
        return None
    if isinstance(value, float):
        is_short = is_whole and math.isfinite(value)
        return str(int(value)) if is_short else repr(float(value))
    return str(value)


def _is_missing(value: object) -> bool:
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return True
    return isinstance(value, float) and math.isnan(value)


def _labelled(
    name: str, columns: Sequence[str], values: FloatArray, names: list[str | None]
) -> Table:
    classes = tuple(sorted({n for n in names if n is not None}, key=_class_order))
    position: dict[str | None, int] = {label: k for k, label in enumerate(classes)}
    codes = np.array([position.get(label, -1) for label in names], np.int64)
    kept = codes >= 0
    unlabelled = int(np.count_nonzero(~kept))
    if unlabelled:
        values, codes = values[:, kept], codes[kept]
    if not len(codes):
        raise TableError(f"{name} has no row with a class")
    missing = _missing_cells(values)
    return Table(name, tuple(columns), values, classes, codes, missing, unlabelled)


def _class_order(label: str) -> tuple[bool, float, str]:
    is_whole = re.fullmatch(r"0|-?[1-9][0-9]{0,14}", label) is not None
    return (not is_whole, float(label) if is_whole else 0.0, label)


class _Numbers:
    """Collects columns of numbers piece by piece, and what is wrong with them."""

    def __init__(self, name: str, names: list[str]) -> None:
        self.name, self.names = name, names
        self.faults: dict[str, tuple[str, str, int]] = {}
        self.missing = 0
        self._parts: list[FloatArray] = []

    def add(self, piece: Piece, chosen: Sequence[int]) -> None:
        """Take the chosen columns of a piece."""
        if piece.whole is not None:
            is_all = list(chosen) == list(range(len(piece.columns)))
            self._take(piece.whole if is_all else piece.whole[list(chosen)])
            return
        values = np.empty((len(chosen), piece.rows))
        for row, index in enumerate(chosen):
            cells = piece.cells[index]
            values[row], bad = _numbers(cells)
            if bad:
                where, text, count = self.faults.get(
                    self.names[row], (piece.where(bad[0]), str(cells[bad[0]]), 0)
                )
                self.faults[self.names[row]] = (where, text, count + len(bad))
        self._take(values)

    def _take(self, values: FloatArray) -> None:
        self.missing += _missing_cells(values)
        self._parts.append(values)

    def fault_text(self) -> str:
        """Return a sentence for each column that holds text."""
        return "\n".join(
            f"{where}: column {column!r} holds text where a number is needed: "
            f"{_shortened(text)!r}{_decimal_hint(text)}{_more(count)}"
            for column, (where, text, count) in self.faults.items()
        )

    def joined(self) -> FloatArray:
        """Return all pieces as one array of shape (columns, rows)."""
        return self._parts[0] if len(self._parts) == 1 else np.hstack(self._parts)


def _missing_cells(values: FloatArray) -> int:
    return sum(int(np.count_nonzero(np.isnan(row))) for row in values)


def _shortened(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."


def _decimal_hint(text: str) -> str:
    is_comma = re.fullmatch(r"[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]+)?", text.strip())
    return " (numbers are written with a decimal point)" if is_comma else ""


def _more(count: int) -> str:
    return "" if count == 1 else f" (and {count - 1} more)"


def _quoted(column: str) -> str:
    return column if re.fullmatch(r"[\w.-]+", column) else repr(column)


def _numbers(cells: Cells) -> tuple[FloatArray, list[int]]:
    """Return cells as numbers, NaN where missing, and the positions of the others."""
    if isinstance(cells, np.ndarray):
        if cells.dtype.kind in _REAL:
            return cells.astype(np.float64), []
        cells = cells.tolist()
    with contextlib.suppress(ValueError, TypeError):
        # Digits of other scripts and 1_000 are numbers to Python, and text to us.
        joined = "".join(cast("Sequence[str]", cells))
        if joined.isascii() and "_" not in joined:
            made = map(float, cast("Sequence[str]", cells))
            return np.fromiter(made, np.float64, len(cells)), []
    found = [_number(cell) for cell in cells]
    bad = [row for row, value in enumerate(found) if value is None]
    filled = [math.nan if value is None else value for value in found]
    return np.array(filled, np.float64), bad


def _number(cell: object) -> float | None:
    """Return a cell as a number, NaN if it is missing, None if it is something else."""
    if isinstance(cell, str):
        text = cell.strip()
        if text.lower() in MISSING:
            return math.nan
        return float(text) if _NUMBER.fullmatch(text) else None
    if _is_missing(cell):
        return math.nan
    is_number = isinstance(cell, bool | int | float) or type(cell).__name__ == "Decimal"
    return float(cast("float", cell)) if is_number else None


def _learnt_columns(
    piece: Piece,
    target: str | Sequence[object] | npt.NDArray[np.generic],
    ignore: Sequence[str],
) -> list[int]:
    wanted = [*([target] if isinstance(target, str) else []), *ignore]
    _refuse_absent(piece, wanted, "")
    left_out = frozenset(wanted)
    chosen = [k for k, column in enumerate(piece.columns) if column not in left_out]
    nameless = [k + 1 for k in chosen if not piece.columns[k].strip()]
    if nameless:
        raise TableError(f"{piece.name}: column {nameless[0]} has no name")
    if not chosen:
        raise TableError(f"{piece.name} has no column to learn from")
    return chosen


def _needed_columns(
    piece: Piece, inputs: Sequence[str], trained: Sequence[str]
) -> list[int]:
    columns: Sequence[str] = piece.columns
    if not piece.is_named and not set(inputs) <= set(columns):
        wanted = trained or inputs
        if len(columns) != len(wanted):
            verb = "was learnt from" if trained else "asks for"
            raise TableError(
                f"{piece.name} has {len(columns)} columns without names, and the "
                f"model {verb} {len(wanted)}: {', '.join(wanted)}"
            )
        columns = wanted
    else:
        _refuse_absent(piece, inputs, ", which the model needs")
    position = {column: k for k, column in enumerate(columns)}
    return [position[name] for name in inputs]


def _refuse_absent(piece: Piece, wanted: Sequence[str], why: str) -> None:
    known_names = frozenset(piece.columns)
    absent = [name for name in wanted if name not in known_names]
    if not absent:
        return
    known = ", ".join(piece.columns[:20]) + (", ..." if len(piece.columns) > 20 else "")
    close = difflib.get_close_matches(absent[0], piece.columns, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close and len(absent) == 1 else ""
    word = "column" if len(absent) == 1 else "columns"
    names = ", ".join(map(repr, absent))
    raise TableError(f"{piece.name} has no {word} {names}{why}; it has {known}{hint}")


def _refuse_repeated(name: str, columns: Sequence[str]) -> None:
    twice = [c for c, count in Counter(columns).items() if c and count > 1]
    if twice:
        word = "column" if len(twice) == 1 else "columns"
        verb = "stands" if len(twice) == 1 else "stand"
        names = ", ".join(map(repr, twice))
        raise TableError(f"{name}: {word} {names} {verb} there more than once")


# --- files and streams


def _file_pieces(
    path: str | os.PathLike[str], delimiter: str | None, name: str | None, only: Only
) -> Iterator[Piece]:
    title = name or os.fspath(path)
    with _opened(path, title) as stream:
        try:
            yield from _stream_pieces(stream, title, delimiter, only)
        except OSError as error:
            raise TableError(f"{title}: cannot be read: {reason(error)}") from error


def _opened(path: str | os.PathLike[str], title: str) -> io.BufferedReader:
    try:
        return Path(path).open("rb")
    except (OSError, ValueError) as error:
        raise TableError(f"{title}: cannot be read: {reason(error)}") from error


def _stream_pieces(
    stream: io.BufferedReader | io.BytesIO,
    name: str,
    delimiter: str | None,
    only: Only,
) -> Iterator[Piece]:
    if isinstance(stream, io.BytesIO):  # which has no peek
        stream = io.BufferedReader(cast("io.RawIOBase", io.BytesIO(stream.read())))
    if stream.peek(4)[:4] == b"PAR1":
        yield from _parquet_pieces(stream, name, only)
        return
    text = io.TextIOWrapper(stream, "utf-8-sig", newline="")
    try:
        yield from _csv_pieces(text, name, delimiter, only)
    finally:
        text.detach()  # the stream belongs to whoever opened it


def _csv_pieces(
    text: io.TextIOBase, name: str, delimiter: str | None, only: Only
) -> Iterator[Piece]:
    reader = None
    try:
        first = text.readline()
        if not first.strip():
            raise TableError(f"{name} is empty: it needs a line with column names")
        mark = delimiter or _delimiter(first, name)
        if len(mark) != 1 or mark in _NO_DELIMITER:
            raise TableError(
                f"{name}: a delimiter is one character such as ';', "
                f"and not {mark[:20]!r}"
            )
        lines = itertools.chain([first], cast("Iterable[str]", text))
        reader = csv.reader(lines, delimiter=mark, strict=True)
        columns = tuple(next(reader))
        _refuse_repeated(name, columns)
        before, count = reader.line_num, 0
        while rows := list(itertools.islice(reader, PIECE)):
            yield _csv_piece(name, columns, rows, before, only)
            before, count = reader.line_num, count + len(rows)
        if not count:
            yield _csv_piece(name, columns, [], before, only)
    except UnicodeDecodeError as error:
        raise TableError(f"{name}: is no UTF-8 text; save it as UTF-8") from error
    except csv.Error as error:
        line = reader.line_num if reader else 1
        raise TableError(f"{name}:{line}: broken CSV: {error}") from error


def _delimiter(line: str, name: str) -> str:
    bare = re.sub(r'"[^"]*"', "", line)
    found = [mark for mark in _DELIMITERS if mark in bare]
    if len(found) > 1:
        shown = " and ".join(repr(mark) for mark in found)
        raise TableError(
            f"{name}:1: both {shown} stand between names; say which one is the "
            "delimiter (--delimiter)"
        )
    return found[0] if found else ","


def _csv_piece(
    name: str,
    columns: tuple[str, ...],
    rows: list[list[str]],
    before: int,
    only: Only,
) -> Piece:
    def where(row: int) -> str:
        return f"{name}:{lines[row] + 1 + sum(_breaks(r) for r in full[:row])}"

    full, lines = rows, range(before, before + len(rows))
    kept: Sequence[int] = lines
    if set(map(len, rows)) - {len(columns)}:
        for row, cells in enumerate(rows):
            if len(cells) not in (0, len(columns)):
                raise TableError(
                    f"{where(row)}: {_counted(len(cells), 'cell')}, and line 1 names "
                    f"{_counted(len(columns), 'column')}"
                )
        kept = [row for row, cells in enumerate(rows) if cells]  # not the empty lines
        rows = [rows[row] for row in kept]
        return _columns_piece(name, columns, rows, lambda row: where(kept[row]), only)
    return _columns_piece(name, columns, rows, where, only)


def _columns_piece(
    name: str,
    columns: tuple[str, ...],
    rows: list[list[str]],
    where: Callable[[int], str],
    only: Only,
) -> Piece:
    cells: tuple[Cells, ...] = ((),) * len(columns)
    if rows and only is None:
        cells = tuple(zip(*rows, strict=True))
    elif rows:
        cells = tuple(
            tuple(map(operator.itemgetter(k), rows)) if column in (only or ()) else ()
            for k, column in enumerate(columns)
        )
    return Piece(name, columns, cells, len(rows), where)


def _breaks(cells: list[str]) -> int:
    """Return how many more lines than one a row has."""
    return sum(len(re.findall(r"\r\n|\r|\n", cell)) for cell in cells)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _parquet_pieces(stream: BinaryIO, name: str, only: Only) -> Iterator[Piece]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise MissingExtraError(
            f"reading parquet needs {install_hint('parquet')}"
        ) from error
    whole = stream if stream.seekable() else io.BytesIO(stream.read())
    try:
        file = pq.ParquetFile(whole)
        names = tuple(file.schema_arrow.names)
        _refuse_repeated(name, names)
        wanted = [column for column in names if only is None or column in only]
        first = 0
        empty = [pa.Table.from_batches([], file.schema_arrow)]
        read = file.iter_batches(PIECE, columns=wanted or None)  # [] has no rows
        groups = (pa.Table.from_batches([part]) for part in read)
        for group in itertools.chain(groups, empty):
            if group.num_rows or not first:
                yield _frame_piece(group, name, first, only, names)
            first += group.num_rows
    except pa.ArrowException as error:
        raise TableError(f"{name}: broken Parquet: {error}") from error


# --- tables in memory


def _array_piece(
    array: npt.NDArray[np.generic], columns: Sequence[str] | None, name: str
) -> Piece:
    if array.dtype.names is not None:
        names = array.dtype.names
        fields = cast("npt.NDArray[np.void]", array)
        cells: tuple[Cells, ...] = tuple(fields[column] for column in names)
        return Piece(name, names, cells, len(array), _row_names(name))
    if array.ndim != 2:
        raise TableError(f"{name} has shape {array.shape}, not (rows, columns)")
    width = array.shape[1]
    if columns is not None and len(columns) != width:
        raise TableError(f"{name} has {width} columns and {len(columns)} names")
    named = tuple(columns or (f"x{number}" for number in range(1, width + 1)))
    _refuse_repeated(name, named)
    cells = tuple(array[:, k] for k in range(width))
    where, is_named = _row_names(name), columns is not None
    whole = (
        array.astype(np.float64, copy=False).T if array.dtype.kind in _REAL else None
    )
    return Piece(name, named, cells, array.shape[0], where, is_named, whole)


def _frame_piece(
    source: object,
    name: str,
    first: int = 0,
    only: Only = None,
    named: tuple[str, ...] | None = None,
) -> Piece:
    """Return a frame's columns; `named` are those of the table that it is part of."""
    import narwhals as nw
    from narwhals.exceptions import DuplicateError

    try:
        frame = nw.from_native(cast("IntoDataFrame | IntoLazyFrame", source))
    except DuplicateError as error:
        _refuse_repeated(name, [str(c) for c in getattr(source, "columns", ())])
        raise TableError(f"{name}: a column stands there more than once") from error
    except TypeError as error:
        raise TypeError(
            f"{type(source).__name__} is no table: pass a path, a pandas, polars or "
            "arrow table, or a numpy array"
        ) from error
    if isinstance(frame, nw.LazyFrame):
        names = frame.collect_schema().names()
        wanted = [column for column in names if only is None or column in only]
        named = tuple(names)
        frame = frame.select(wanted or names).collect()
    columns = named or tuple(map(str, frame.columns))
    _refuse_repeated(name, columns)
    there = dict(zip(map(str, frame.columns), frame.columns, strict=True))
    cells: list[Cells] = []
    for column in columns:
        if column not in there or not (only is None or column in only):
            cells.append(())
            continue
        series = frame.get_column(there[column])
        is_number = series.dtype.is_numeric()
        cells.append(series.to_numpy() if is_number else series.to_list())
    return Piece(name, columns, tuple(cells), len(frame), _row_names(name, first))


def _row_names(name: str, first: int = 0) -> Callable[[int], str]:
    return lambda row: f"{name}, row {first + row + 1}"
