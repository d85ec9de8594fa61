"""Rows in from anything, with the names of their columns.

A table is a path, an open stream of CSV or Parquet, a pandas, polars or arrow table, a
reader of record batches, or a numpy array. A path is a CSV, Parquet or Arrow file, a
folder or a pattern of such files (`rows/*.csv`), or a place that pyarrow opens
(`s3://place/rows.parquet`); files may be compressed by gzip or zstd, or be of Excel.
Nothing is guessed: columns are found by their names, a number has a decimal point and
no thousands separators unless a `TableFormat` says so. To learn from, a column holds
numbers, truth values, dates or texts, which its type decides, or all its cells where it
has none; a column of several kinds is an error that says where one stands.
`fuzzytree.columns` says more.
"""

from __future__ import annotations

import codecs
import contextlib
import csv
import difflib
import functools
import glob
import io
import itertools
import math
import mmap
import os
import re
import threading
import time
import zipfile
from collections import Counter, deque
from collections.abc import (
    Callable,
    Collection,
    Generator,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeAlias, TypeVar, cast

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.cells import (
    EXACT,
    MISSING,
    NO_WEIGHT,
    REAL,
    checked_weights,
    distinct_values,
    is_missing,
    is_weight,
    number_of,
    numbers_only,
    plain,
    unmasked,
)
from fuzzytree.columns import (
    Contents,
    categories_of,
    coded,
    is_missing_code,
    placer,
    positions,
    text_of,
    text_order,
)
from fuzzytree.csv_rows import BLOCK, CsvRows, blocks, no_text, number_array
from fuzzytree.errors import MissingExtraError, TableError, install_hint
from fuzzytree.files import LIMIT, check_stream, reason
from fuzzytree.model import (
    DATE_UNIT,
    LabelType,
    Variable,
    as_names,
    counted,
    is_label,
    label_type_of,
)
from fuzzytree.table_format import TableFormat, number_hint

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from narwhals.typing import IntoDataFrame, IntoLazyFrame

    from fuzzytree.cells import Cells

FloatArray = npt.NDArray[np.float64]
Weights: TypeAlias = str | Sequence[float] | npt.NDArray[np.generic] | None
"""A column of weights, the weights of all rows, or None where all are 1."""
IntArray = npt.NDArray[np.int64]
Only = frozenset[str] | None
S = TypeVar("S")
T = TypeVar("T")
_Coded: TypeAlias = tuple[IntArray, list[tuple[str, bool]], str]

_CSV = (".csv", ".csv.gz", ".csv.zst")
SUFFIXES = (*_CSV, ".xlsx", ".parquet", ".pq", ".arrow", ".feather")
"""How the names of files end that are tables in a folder."""

PIECE = 1 << 14
"""The most rows of a file that are handed on at a time; fewer of a wide table."""

_MOST_THREADS = 8
_THREAD_NAME = "fuzzytree rows"


def _thread_count() -> int:
    has_mask = hasattr(os, "sched_getaffinity")
    processors = len(os.sched_getaffinity(0)) if has_mask else os.cpu_count() or 1
    limit = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    most = int(limit) if limit.isdecimal() else 0
    return min(processors, most or processors, _MOST_THREADS)


THREADS = _thread_count()
"""How many threads parse files and predict: one for each processor that the process may
use, at most 8 and at most the environment's `OMP_NUM_THREADS`."""

_CELLS = 1 << 18  # of a piece of a wide table
_BUFFER = 1 << 16  # bytes of a column of a Parquet file that are read at a time
_UNRETURNED = 64  # pieces of a mapped file that may stay in memory
_MOST_NAMES = 20
_EMPTY = sorted({way(text) for text in MISSING for way in (str, str.upper, str.title)})
_MISSING = f"(?i)^(?:{'|'.join(sorted(MISSING))})$"
_DELIMITERS = (",", ";", "\t")
_ARROW, _PARQUET = b"ARROW1", b"PAR1"
_KINDS = {
    _ARROW: "arrow",
    _PARQUET: "arrow",
    b"PK\3\4": "excel",
    b"\xd0\xcf\x11\xe0": "excel",  # of old
    b"\x1f\x8b": "gzip",
    b"\x28\xb5\x2f\xfd": "zstd",
}
_CODECS = ("gzip", "zstd")
_ENCODINGS = {
    codecs.BOM_UTF32_LE: "utf-32",  # which begins like the next one
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_WHOLE = re.compile("[+-]?[0-9]{1,400}")
_MOST_EXCEL = 1 << 30  # bytes of the sheets of a file, uncompressed
_NO_DELIMITER = '"\r\n\0'


class TablePiece(msgspec.Struct, frozen=True, eq=False):
    """Some rows of a table, column by column, as they came.

    Attributes:
        name: What messages call the table.
        columns: The names of all columns, without blanks around them; `column 3` for
            a third one that has none.
        cells: One entry for each column, each with one cell for each row; empty for
            a column that is not wanted.
        rows: How many rows these are.
        where: The place of a row of this piece, as messages name it.
        written: The names of all columns, as they came.
        is_named: Whether the names came with the table; if not they are x1, x2, ...
        whole: All cells as one array of shape (columns, rows), where they are one.
        frame: The rows as a table of pyarrow, of a Parquet or Arrow file.
        share: How much of the bytes of all files was read by then; 0 if unknown.
        texts: The columns whose type says that they hold texts or categories, with
            these in their order if it states one.
    """

    name: str
    columns: tuple[str, ...]
    cells: tuple[Cells, ...]
    rows: int
    where: Callable[[int], str]
    written: tuple[str, ...]
    is_named: bool = True
    whole: FloatArray | None = None
    frame: object = None
    share: float = 0.0
    texts: Mapping[str, tuple[str, ...]] = {}


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
        remarks: Columns, and what they have and is left out.
        label_type: What the names of classes stand for, if not text.
        weights: How many rows each row of a sample stands for; None of a whole table.
        row_weights: The weight of each row, above 0; None where rows have none.
        weightless: How many rows were left out because their weight is 0.
        categories: Of columns of text or truth values, by name; their values are
            positions among these.
        dates: The columns of dates; their values are days since 1970-01-01 (UTC).
        is_categorical: Whether the target was said to have categories.
        ordered: The columns whose categories have an order, which is theirs here.
    """

    name: str
    columns: tuple[str, ...]
    values: FloatArray
    classes: tuple[str, ...]
    codes: IntArray
    missing: int = 0
    unlabelled: int = 0
    target: str = ""
    remarks: tuple[tuple[str, str], ...] = ()
    label_type: LabelType | msgspec.UnsetType = msgspec.UNSET
    weights: FloatArray | None = None
    row_weights: FloatArray | None = None
    weightless: int = 0
    categories: Mapping[str, tuple[str, ...]] = {}
    dates: tuple[str, ...] = ()
    is_categorical: bool = False
    ordered: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        """How many rows with a class the table has, or the one that was sampled."""
        total = len(self.codes) if self.weights is None else self.weights.sum()
        return round(float(total))


class Batch(msgspec.Struct, frozen=True, eq=False):
    """Some rows to answer.

    Attributes:
        values: Shape (inputs, rows), in the order of the model's inputs.
        missing: How many cells are missing; infinite ones are.
        unknown: How many cells are no category of the model, by input; they are NaN.
        extras: How many columns the model does not need.
        piece: The rows as they came.
    """

    values: FloatArray
    missing: int
    extras: int
    piece: TablePiece
    unknown: Mapping[str, int] = {}


class TableSource(msgspec.Struct, frozen=True, eq=False):
    """A table, with what cannot be seen from it; `table` makes one."""

    source: object
    columns: Sequence[str] | None = None
    format: TableFormat = TableFormat()
    categorical: tuple[str, ...] = ()


def table(
    source: object,
    *,
    columns: Sequence[str] | None = None,
    format: TableFormat | None = None,
    categorical: Sequence[str] = (),
) -> TableSource:
    """Return a table for the functions that take one, with what it does not say.

    Args:
        source: A path, an open file, a pandas, polars or arrow table, or an array of
            shape (rows, columns).
        columns: The names of an array's columns; x1, x2, ... unless given.
        format: How the table is written.
        categorical: Columns whose cells are categories, numbers too: columns to learn
            from, or the target.

    Example:
        >>> table(np.array([[1.5], [2.5]]), columns=["force"]).columns
        ['force']
    """
    categories = tuple(as_names(categorical))
    return TableSource(source, columns, format or TableFormat(), categories)


def path_of(source: object) -> str | None:
    """Return the path of a table that is a file, None of another.

    Example:
        >>> path_of(table("rows.csv", format=TableFormat(decimal=",")))
        'rows.csv'
    """
    if isinstance(source, TableSource):
        source = source.source
    return os.fspath(source) if isinstance(source, str | os.PathLike) else None


def stem_of(path: str) -> str:
    """Return the name of a table's file without its endings.

    Example:
        >>> stem_of("out/rows.csv.gz"), stem_of("rows.v2.csv")
        ('rows', 'rows.v2')
    """
    return Path(re.sub(r"(?i)\.(?:gz|zst)$", "", path)).stem


def read_table(
    source: object,
    *,
    target: str | Sequence[object] | npt.NDArray[np.generic],
    weights: Weights = None,
    ignore: Sequence[str] = (),
    name: str | None = None,
) -> Table:
    """Read a whole table with a class for each row.

    Texts and truth values become positions among the categories of their column, and
    dates days. Classes keep the text they have; whole numbers lose
    a fraction of zero, so that 1, 1.0 and "1" are one class.

    Args:
        source: The table; see the module.
        target: The column of the classes, or the classes themselves.
        weights: The column of the rows' weights, which is no input then, or the weights
            themselves; all 1 if None.
        ignore: Columns to leave out.
        name: What messages call the table; its path unless given.

    Raises:
        ValueError: If weights that are no column are not one number for each row, or
            cannot be weights.
        TableError: If a column is absent, stands twice or holds cells of several kinds,
            if there is no row, or if rows have different lengths; all such columns are
            named.
        TypeError: If the source is no table.

    Example:
        >>> table = read_table(np.array([[1.5], [2.5]]), target=["soft", "firm"])
        >>> table.columns, table.values.tolist(), table.classes, table.codes.tolist()
        (('x1',), [[1.5, 2.5]], ('firm', 'soft'), [1, 0])
    """
    rows = LearningRows(
        source, target=target, weights=weights, ignore=ignore, name=name
    )
    return rows.table([*rows])


class LearningPiece(msgspec.Struct, frozen=True, eq=False):
    """Some rows to learn from.

    Attributes:
        name: What messages call the table that they are of.
        rows: How many rows were read.
        values: The codes of those that have a class (see `fuzzytree.columns`), of
            shape (columns, rows).
        codes: The number of the class of each.
        weights: Their weights; None where rows have none.
    """

    name: str
    rows: int
    values: FloatArray
    codes: IntArray
    weights: FloatArray | None = None


class LearningRows:
    """The rows of a table to learn from, piece by piece, and what was noticed.

    The arguments are those of `read_table`; attributes count what was read so far.

    Args:
        chosen: The columns to learn from, if other parts of the table have set them.
        variables: Those of a model, if the columns are read for it.
        labels: The classes so far; more are added.
        progress: Called with the number of rows so far, and the share that is read.

    Attributes:
        name: What messages call the table.
        names: The columns to learn from; None before the first piece.
        labels: The classes.
        rows: How many rows were read.
        unlabelled: How many of them were left out because they have no class.
        weightless: How many of the others were left out because their weight is 0.
        missing: How many cells of the others are missing.
        remarks: Columns, and what they have and is left out.
        contents: What the cells of each column hold.
        categorical: The columns whose cells are all categories.
        first: By column and kind, where the first cell of the kind stands, and its
            text.
    """

    def __init__(
        self,
        source: object,
        *,
        target: str | Sequence[object] | npt.NDArray[np.generic],
        weights: Weights = None,
        ignore: Sequence[str] = (),
        name: str | None = None,
        chosen: Sequence[str] | None = None,
        variables: Sequence[Variable] = (),
        labels: ClassLabels | None = None,
        progress: Callable[[str, float], None] | None = None,
    ) -> None:
        shape = (0,) if isinstance(target, str) else getattr(target, "shape", (0,))
        if len(shape) != 1:
            raise TableError(
                f"the target has the shape {tuple(shape)}, and it needs one class for "
                "each row: pass the name of a column, or an array of shape (rows,)"
            )
        self.target = target.strip() if isinstance(target, str) else ""
        self.names = None if chosen is None else tuple(chosen)
        self._variables = variables
        self.labels = labels or ClassLabels()
        self.name = name or path_of(source) or ""
        self.rows = self.unlabelled = self.weightless = self.missing = 0
        self._weight = weights.strip() if isinstance(weights, str) else None
        self._weights: FloatArray | None = None
        if weights is not None and not isinstance(weights, str):
            self._weights = checked_weights(weights, np.size(weights))
        self.remarks: list[tuple[str, str]] = []
        self._ignore = [column.strip() for column in as_names(ignore)]
        self._codes: IntArray | None = None
        if not isinstance(target, str):
            cells = target if isinstance(target, np.ndarray) else plain(target)
            self._codes = self.labels.add(*coded_classes(cells))
        self._counts: dict[int, frozenset[int]] = {}
        self.contents: dict[str, Contents] = {}
        self.categorical = frozenset(c.strip() for c in _categorical_of(source))
        self.first: dict[str, dict[str, tuple[str, str]]] = {}
        self._progress = progress
        self._pieces = pieces(source, name=name)

    def __iter__(self) -> Iterator[LearningPiece]:
        """Yield the rows piece by piece.

        Raises:
            TableError: If a column is absent.
        """
        begin = time.monotonic()
        first = next(self._pieces)
        self.name = self.name or first.name
        chosen = self._chosen(first)
        is_kept = np.array([k not in self._counts for k in chosen], bool)
        names = [first.columns[k] for k in chosen]
        _refuse_absent(first, sorted(self.categorical), "")

        def read(
            piece: TablePiece,
        ) -> tuple[
            TablePiece, FloatArray, list[_Column], FloatArray | None, _Coded | None
        ]:
            texts = {*self.categorical, *piece.texts}
            numbers = (
                (_numbers_of(piece, chosen, self._variables)[0], list[_Column]())
                if self._variables
                else _codes_of(piece, chosen, names, texts)
            )
            weights = (
                None if self._weight is None else _row_weights(piece, self._weight)
            )
            if self._codes is not None:
                return piece, *numbers, weights, None
            cells = piece.cells[piece.columns.index(self.target)]
            return piece, *numbers, weights, coded_classes(cells)

        later = in_order(read, self._pieces)
        for piece, values, columns, weights, labels in itertools.chain(
            [read(first)], later
        ):
            for name, (contents, examples) in zip(names, columns, strict=False):
                known = self.contents.setdefault(name, Contents())
                self.contents[name] = known.merge(contents)
                places = self.first.setdefault(name, {})
                for kind, (row, text) in examples.items():
                    places.setdefault(kind, (piece.where(row), text))
            if labels is not None:
                codes = self.labels.add(*labels)
            else:
                codes = cast("IntArray", self._codes)[self.rows :][: piece.rows]
            if self._weights is not None:
                weights = self._weights[self.rows :][: piece.rows]
            for row in np.flatnonzero(~is_kept).tolist():
                self._count(chosen[row], values[row])
            self.rows += piece.rows
            if self._progress is not None:
                text = f"{piece.name}: {rate_text(self.rows, begin)}"
                self._progress(text, piece.share)
            sizes = {piece.rows, len(codes)}
            if len(sizes if weights is None else sizes | {len(weights)}) > 1:
                continue
            is_used = codes >= 0
            self.unlabelled += piece.rows - int(np.count_nonzero(is_used))
            if not is_kept.all():
                values = values[is_kept]
            if weights is not None:
                self.weightless += int(np.count_nonzero(is_used & (weights == 0)))
                is_used &= weights > 0
                weights = weights[is_used]
            if not is_used.all():
                values, codes = values[:, is_used], codes[is_used]
            self.missing += sum(int(is_missing_code(row).sum()) for row in values)
            yield LearningPiece(piece.name, piece.rows, values, codes, weights)

    def refuse_empty(self) -> None:
        """Check what all rows show.

        Raises:
            TableError: If there is no row, none with a class, or no column; or if a
                column without a name does not count the rows.
        """
        if not self.rows:
            raise TableError(f"{self.name} has no rows")
        if self._codes is not None and len(self._codes) != self.rows:
            raise TableError(
                f"{self.name} has {self.rows} rows, and there are "
                f"{len(self._codes)} classes for them"
            )
        if self._weights is not None and len(self._weights) != self.rows:
            raise TableError(
                f"{self.name} has {self.rows} rows, and there are "
                f"{len(self._weights)} weights for them"
            )
        for column, starts in self._counts.items():
            is_empty = not self.contents[f"column {column + 1}"].cells
            if not starts and not is_empty:
                raise TableError(
                    f"{self.name}: column {column + 1} has no name\n  name it, or "
                    f"leave it out with ignore (--ignore 'column {column + 1}')"
                )
        if not self.names:
            raise TableError(f"{self.name} has no column to learn from")
        if self.unlabelled == self.rows:
            raise TableError(f"{self.name} has no row with a class")
        if self.unlabelled + self.weightless == self.rows:
            raise TableError(f"{self.name}: {NO_WEIGHT}")

    def table(self, parts: Sequence[LearningPiece]) -> Table:
        """Return all pieces as one table.

        Raises:
            TableError: As `refuse_empty`.
        """
        self.refuse_empty()
        codes = np.concatenate([part.codes for part in parts])
        blocks = [part.values for part in parts]
        values = blocks[0] if len(blocks) == 1 else np.hstack(blocks)
        columns = columns_of(
            self.name,
            self.names or (),
            self.contents,
            self.categorical,
            values,
            self.first,
        )
        places, classes = self.labels.ordered()
        codes, weights = places[codes], None
        heavy = [part.weights for part in parts if part.weights is not None]
        if heavy:
            weights = np.concatenate(heavy)
            present, codes = np.unique(codes, return_inverse=True)
            classes = tuple(classes[code] for code in present.tolist())
        return Table(
            self.name,
            columns.names,
            columns.placed(values),
            classes,
            codes,
            self.missing,
            self.unlabelled,
            self.target,
            (*self.remarks, *columns.remarks),
            self.labels.label_type() if self.target else self.labels.kind(),
            row_weights=weights,
            weightless=self.weightless,
            categories=columns.categories,
            dates=columns.dates,
            is_categorical=self.target in self.categorical,
            ordered=columns.ordered,
        )

    def _chosen(self, first: TablePiece) -> list[int]:
        """Return the columns to read, of which those without a name count the rows."""
        if self.target not in first.columns and {"codes", "counts"} <= {*first.columns}:
            raise TableError(
                f"{first.name} is a state that `fuzzytree collect` wrote, and no "
                "table; `fuzzytree learn` takes states"
            )
        if self.names is not None:
            _refuse_absent(first, [self.target], "")
            by = "the model needs" if self._variables else "other parts have"
            _refuse_absent(first, self.names, f", which {by}")
            return [first.columns.index(column) for column in self.names]
        others = [self.target] if self._codes is None else []
        others += [] if self._weight is None else [self._weight]
        left_out = dict.fromkeys([*others, *self._ignore])
        _refuse_absent(first, [*left_out], "")
        chosen = [k for k, name in enumerate(first.columns) if name not in left_out]
        if not chosen:
            raise TableError(f"{first.name} has no column to learn from")
        unnamed = [k for k in chosen if not first.written[k].strip()]
        self._counts = dict.fromkeys(unnamed, frozenset({0, 1}))
        self.names = tuple(first.columns[k] for k in chosen if k not in unnamed)
        text = "no name and counts the rows, or is empty; it is left out"
        self.remarks = [*((first.columns[k], text) for k in unnamed), *trimmed(first)]
        return chosen

    def _count(self, column: int, values: FloatArray) -> None:
        """Note from which of 0 and 1 a column without a name may count the rows."""
        count = np.arange(self.rows, self.rows + len(values))
        starts = self._counts[column]
        fitting = {start for start in starts if np.array_equal(values, count + start)}
        self._counts[column] = frozenset(fitting)


def rate_text(rows: int, begin: float) -> str:
    """Return how many rows were read since a `time.monotonic`, and how fast."""
    rate = rows / max(time.monotonic() - begin, 1e-3)
    return f"{rows:,} rows, {rate:,.0f} rows/s"


def batches(
    source: object,
    inputs: Sequence[str],
    *,
    trained: Sequence[str] = (),
    name: str | None = None,
    with_others: bool = False,
    variables: Iterable[Variable] = (),
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
        name: As in `read_table`.
        with_others: Whether the pieces hold the other columns' cells as well; unless
            they do, a Parquet file's are not read and a frame's not converted.
        variables: Those of the model, which say which inputs have categories, whose
            cells become positions, and which have dates.

    Raises:
        TableError: If a column is absent, stands twice or holds text, or rows have
            different lengths.
        TypeError: If the source is no table.
    """
    inputs, trained = ([c.strip() for c in names] for names in (inputs, trained))
    _refuse_repeated("the model", inputs)
    known = {one.name.strip(): one for one in variables}
    wanted = [known.get(name) or Variable(name) for name in inputs]
    only = None if with_others else frozenset(inputs)
    chosen: list[int] | None = None
    for piece in pieces(source, name=name, only=only):
        if chosen is None:
            chosen = _needed_columns(piece, inputs, trained)
        values, unknown = _numbers_of(piece, chosen, wanted)
        extras = len(piece.columns) - len(chosen)
        missing = int(np.count_nonzero(~np.isfinite(values)))
        yield Batch(values, missing - sum(unknown.values()), extras, piece, unknown)


def in_order(function: Callable[[S], T], items: Iterable[S]) -> Generator[T]:
    """Yield what a function returns for each item, in their order, on all cores.

    Items are taken a few ahead. The first error in the order of the items is raised,
    be it of the function or of the iterator. Within such a function no more threads are
    started.

    Example:
        >>> list(in_order(abs, [-1, 2, -3]))
        [1, 2, 3]
    """
    failures: list[Exception] = []
    rest = _until_failure(items, failures)
    ahead = [*itertools.islice(rest, 2)]
    is_inside = threading.current_thread().name.startswith(_THREAD_NAME)
    if len(ahead) < 2 or THREADS < 2 or is_inside:
        yield from map(function, itertools.chain(ahead, rest))
    else:
        pool = ThreadPoolExecutor(THREADS, _THREAD_NAME)
        running: deque[Future[T]] = deque()
        try:
            for item in itertools.chain(ahead, rest):
                running.append(pool.submit(function, item))
                if len(running) > 2 * THREADS:
                    yield running.popleft().result()
            while running:
                yield running.popleft().result()
        finally:
            pool.shutdown(cancel_futures=True)
    if failures:
        raise failures[0]


def _until_failure(items: Iterable[S], failures: list[Exception]) -> Iterator[S]:
    """Yield items; the error of their iterator is put in a list."""
    try:
        yield from items
    except Exception as error:  # raised in its turn
        failures.append(error)


def _categorical_of(source: object) -> tuple[str, ...]:
    """Return the columns that a table is said to have categories in."""
    result: tuple[str, ...] = ()
    while isinstance(source, TableSource):
        result, source = result + source.categorical, source.source
    return result


def pieces(
    source: object, *, name: str | None = None, only: Only = None
) -> Iterator[TablePiece]:
    """Yield a table in pieces; at least one, of no rows if the table has none.

    Args:
        source: The table; see the module.
        name: As in `read_table`.
        only: The columns whose cells are wanted, as numbers where they all are;
            all columns if None.

    Raises:
        TableError: If columns have no names of their own, or rows no equal length.
        TypeError: If the source is no table.
    """
    columns: Sequence[str] | None = None
    form, whole = TableFormat(), source
    while isinstance(source, TableSource):
        columns = source.columns if columns is None else columns
        form = source.format if form == TableFormat() else form
        source = source.source
    result: Iterator[TablePiece]
    match source:
        case str() | os.PathLike():
            path = cast("str | os.PathLike[str]", source)
            result = _file_pieces(path, form, name, only)
        case io.TextIOBase():
            result = _text_pieces(source, name or "the table", form, only)
        case io.BufferedReader() | io.BytesIO():
            result = _stream_pieces(source, name or "the table", form, only)
        case np.ndarray():
            array = cast("npt.NDArray[np.generic]", source)
            names = None if columns is None else as_names(columns)
            result = iter([_array_piece(array, names, name or "the array")])
        case _ if type(source).__name__ == "RecordBatch":
            batch = cast("pa.RecordBatch", source)
            result = _batch_pieces([batch], name or "the table", only)
        case _ if hasattr(source, "read_next_batch"):
            reader = cast("pa.RecordBatchReader", source)
            parts = itertools.chain([reader.schema.empty_table()], reader)
            result = _batch_pieces(parts, name or "the table", only)
        case _:
            result = iter([_frame_piece(source, name or "the table", only=only)])
    if form.is_plain:
        return result
    texts = frozenset(_categorical_of(whole))
    return (_with_plain_numbers(piece, form, texts) for piece in result)


def _with_plain_numbers(
    piece: TablePiece, form: TableFormat, categorical: Collection[str]
) -> TablePiece:
    """Return a piece whose texts write numbers as usual.

    Raises:
        TableError: If a column that is not categorical has another number.
    """
    cells, typed = [*piece.cells], {**piece.texts}
    for place, (name, column) in enumerate(zip(piece.columns, cells, strict=True)):
        if isinstance(column, np.ndarray) and column.dtype.kind in REAL:
            continue
        indices, values = distinct_values(column)
        texts = [form.plain(one) if isinstance(one, str) else one for one in values]
        others = [k for k, one in enumerate(values) if one is not None is texts[k]]
        if texts == [*values]:
            continue
        if others and name not in categorical:
            row = int(np.isin(indices, others).argmax())
            raise TableError(
                f"{piece.where(row)}: column {name!r} holds {values[indices[row]]!r}, "
                "and decimals stand behind a comma; pass --thousands . if the point "
                f"groups digits, or --categorical {_quoted(name)} if it is a text"
            )
        for k in others:
            texts[k] = values[k]
        cells[place] = [texts[k] for k in indices]
        typed.pop(name, None)
        if hasattr(column, "chunks"):
            import pyarrow as pa

            cells[place] = pa.chunked_array([cells[place]], pa.string())
    return msgspec.structs.replace(piece, cells=(*cells,), texts=typed)


def class_names(cells: Sequence[Cells]) -> list[str | None]:
    """Return the class of each row as text; None where it is missing.

    Text stays as it is, "01" and "no" too; only a cell without any text is missing.
    Whole numbers have no fraction, and other numbers have all their digits.

    Example:
        >>> class_names([[1.0, 2.0, None], ["01", ""]])
        ['1', '2', None, '01', None]
    """
    labels = ClassLabels()
    codes = [code for part in cells for code in labels.add(*coded_classes(part))]
    names = [*labels.names(), None]
    return [names[code] for code in codes]


class ClassLabels:
    """The classes of a table, numbered as they come.

    Attributes:
        keys: The number of each class, by its name and whether it came as a number with
            a fraction, as 1.0 does.
        kinds: What labels came: `csv`, `text`, `boolean` or `number`.
    """

    def __init__(
        self,
        keys: Iterable[tuple[str, bool]] = (),
        kinds: Iterable[str] = (),
    ) -> None:
        self.keys = {key: place for place, key in enumerate(dict.fromkeys(keys))}
        self.kinds = {*kinds}

    def add(
        self, codes: IntArray, keys: Sequence[tuple[str, bool]], kind: str
    ) -> IntArray:
        """Take what `coded_classes` returns, and return the codes in these numbers."""
        if keys:
            self.kinds.add(kind)
        places = [self.keys.setdefault(key, len(self.keys)) for key in keys]
        return np.array([*places, -1], np.int64)[codes]

    def merge(self, other: ClassLabels) -> ClassLabels:
        """Return the classes of both; the first ones keep their numbers."""
        return ClassLabels([*self.keys, *other.keys], self.kinds | other.kinds)

    def ordered(self) -> tuple[IntArray, tuple[str, ...]]:
        """Return the place of each number among the names in their order, and these."""
        names = [*self.names()]
        order = sorted(set(names), key=text_order)
        places = {name: place for place, name in enumerate(order)}
        return np.array([places[name] for name in names], np.int64), tuple(order)

    def names(self) -> Iterator[str]:
        """Yield the name of each class: 1.0 is 1 where no class has a fraction."""
        floats = [float(name) for name, is_float in self.keys if is_float]
        is_whole = all(one.is_integer() for one in floats if math.isfinite(one))
        for name, is_float in self.keys:
            is_short = is_float and is_whole and math.isfinite(float(name))
            yield str(int(float(name))) if is_short else name

    def label_type(self) -> LabelType | msgspec.UnsetType:
        """Return what the names of classes stand for.

        In a CSV file that are numbers or booleans where all names are written so.
        """
        if self.kinds != {"csv"}:
            return self.kind()
        kinds: tuple[LabelType, ...] = ("boolean", "number")
        names = [*self.names()]
        fitting: list[LabelType] = [
            kind for kind in kinds if all(is_label(name, kind) for name in names)
        ]
        return fitting[0] if fitting else msgspec.UNSET

    def kind(self) -> LabelType | msgspec.UnsetType:
        """Return the type that all labels came with, if it is no text."""
        kind = min(self.kinds, default="text")
        is_one = len(self.kinds) == 1 and kind in ("boolean", "number")
        return cast("LabelType", kind) if is_one else msgspec.UNSET


def coded_classes(cells: Cells) -> _Coded:
    """Return the classes of the rows of a part.

    Returns:
        The position of each row's class, -1 where it is missing; the classes by name,
        each with whether it came as a number with a fraction, as 1.0 does; and what the
        labels are: `csv`, `text`, `boolean` or `number`.

    Example:
        >>> coded_classes(["a", "", "b", "a"])
        (array([ 0, -1,  1,  0]), [('a', False), ('b', False)], 'text')
        >>> coded_classes([1.0, 2.0])[1:]
        ([('1.0', True), ('2.0', True)], 'number')
    """
    indices, values = distinct_values(cells)
    keys: dict[tuple[str, bool], int] = {}
    places: list[int] = []
    labels: list[object] = []
    for value in values:
        is_blank = isinstance(value, str) and not value.strip()
        if is_blank or is_missing(value):
            places.append(-1)
            continue
        key = (str(value), False)
        if isinstance(value, float):  # numpy has its own
            key = (repr(float(value)), True)
        if key not in keys:
            labels.append(value.item() if isinstance(value, np.generic) else value)
        places.append(keys.setdefault(key, len(keys)))
    codes = np.array(places, np.int64)[indices] if len(indices) else indices
    is_csv = not isinstance(cells, Sequence | np.ndarray)
    return codes, [*keys], "csv" if is_csv else label_type_of(labels) or "text"


class LearntColumns(msgspec.Struct, frozen=True):
    """What the columns of a whole table are.

    Attributes:
        names: The columns to learn from.
        kept: Their places among the columns that were read.
        categories: Those of columns of text or truth values, by name.
        dates: The columns of dates.
        remarks: Columns that are left out, and why.
        ordered: The columns of categories whose type states their order.
    """

    names: tuple[str, ...]
    kept: tuple[int, ...]
    categories: Mapping[str, tuple[str, ...]]
    dates: tuple[str, ...]
    remarks: tuple[tuple[str, str], ...]
    ordered: tuple[str, ...] = ()

    def placed(self, values: FloatArray) -> FloatArray:
        """Return the values of the columns, with positions in the place of codes.

        `values` has shape (columns, rows), of all columns that were read.
        """
        if len(self.kept) < len(values):
            values = values[[*self.kept]]
        if not self.categories:
            return values
        rows = [
            positions(row, self.categories[name]) if name in self.categories else row
            for name, row in zip(self.names, values, strict=True)
        ]
        return np.array(rows).reshape(values.shape)


def columns_of(
    table: str,
    names: Sequence[str],
    contents: Mapping[str, Contents],
    categorical: Collection[str],
    values: FloatArray,
    first: Mapping[str, Mapping[str, tuple[str, str]]],
) -> LearntColumns:
    """Decide what the columns of a table are, now that all of it was read.

    Args:
        table: What messages call it.
        names: The columns that were read.
        contents: What their cells hold.
        categorical: The columns whose cells are all categories.
        values: The codes of their cells, of shape (columns, rows), or of a sample.
        first: Where the first cell of each kind stands, and its text.

    Raises:
        TableError: If cells of a column do not go together; all such columns are named.
    """
    mixed: dict[str, str] = {}
    kept: list[int] = []
    remarks: list[tuple[str, str]] = []
    categories: dict[str, tuple[str, ...]] = {}
    dates: list[str] = []
    ordered: list[str] = []
    for place, name in enumerate(names):
        held = contents.get(name, Contents())
        is_declared = name in categorical
        kind = held.kind(is_categorical=is_declared)
        if not held.cells and len(values[0]):
            remarks.append((name, "no value in any row; it is left out"))
            continue
        examples = first.get(name, {})
        texts = held.texts or (examples.get("text", ("", ""))[1],)
        is_hinted = kind == "text" and not is_declared
        hint = number_hint(texts) if is_hinted else ""
        if hint:
            where = examples.get("text", (table,))[0]
            mixed[name] = f"{where}: column {name!r} holds {hint}"
        elif kind is None:
            mixed[name] = _mixed_text(table, name, held, examples)
        elif kind == "text" and held.is_identifier(is_categorical=is_declared):
            count = "more than 10,000" if held.texts is None else len(held.texts)
            text = (
                f"{count} different texts in {held.text:,} rows, as an identifier has"
            )
            hint = f"; --categorical {_quoted(name)} keeps it" if held.texts else ""
            if held.texts and all(number_of(one) is not None for one in held.texts):
                hint += ", or convert it to numbers"
            remarks.append((name, f"{text}; it is left out{hint}"))
            continue
        elif kind == "text" and held.is_ordered:
            categories[name] = held.order or ()
            ordered.append(name)
        elif kind in ("text", "boolean"):
            numbers = np.unique(values[place]) if held.number else ()
            categories[name] = categories_of(held, [*map(float, numbers)])
        elif kind == "date":
            dates.append(name)
        kept.append(place)
    if mixed:
        hints = (
            " ".join(f"--{option} {_quoted(k)}" for k in [*mixed][:2])
            + (" ..." if len(mixed) > 2 else "")
            for option in ("ignore", "categorical")
        )
        text = "leave columns out with ignore ({}), or take all their cells as "
        text = text + "categories with categorical ({})"
        raise TableError(f"{_fault_text(mixed.values())}\n  {text.format(*hints)}")
    chosen = tuple(names[place] for place in kept)
    if not chosen:
        lines = [f"\n  {name}: {text}" for name, text in remarks[:_MOST_NAMES]]
        raise TableError(f"{table} has no column to learn from{''.join(lines)}")
    others = tuple(dates), tuple(remarks), tuple(ordered)
    return LearntColumns(chosen, tuple(kept), categories, *others)


def _mixed_text(
    table: str, name: str, held: Contents, first: Mapping[str, tuple[str, str]]
) -> str:
    """Return that the cells of a column do not go together."""
    counts = {
        "number": held.number,
        "truth value": held.boolean,
        "date": held.date,
        "text": held.text,
        "other cell": held.other,
    }
    kinds = sorted((count, kind) for kind, count in counts.items() if count)
    (count, kind), *others = kinds
    example = (held.texts or ("",))[0] if kind == "text" else ""
    where, example = first.get(
        {"truth value": "boolean", "other cell": "other"}.get(kind, kind),
        (table, example),
    )
    among = " and ".join(f"{n:,} {one}{'s' * (n > 1)}" for n, one in others)
    needed = others[-1][1] if others else "number"
    text = f"text where a {needed} is needed" if kind == "text" else f"a {kind}"
    if kind == "other cell":
        text = "no number, text, truth value or date"
    share = f" ({count:,} among {among})" if among else _more(count)
    return f"{where}: column {name!r} holds {text}: {_shortened(example)!r}{share}"


_Column: TypeAlias = tuple[Contents, dict[str, tuple[int, str]]]


def _codes_of(
    piece: TablePiece,
    chosen: Sequence[int],
    names: Sequence[str],
    categorical: Collection[str],
) -> tuple[FloatArray, list[_Column]]:
    """Return the codes of columns, and what each holds, with the first of each kind."""
    columns = [piece.cells[index] for index in chosen]
    values: FloatArray | None = None
    if not categorical:
        values = _all_numbers(piece, chosen)
    if values is not None:
        is_none = np.isnan(values)
        if is_none.any():
            values = np.where(is_none, math.nan, values)
        counts = (piece.rows - is_none.sum(axis=1)).tolist()
        return values, [(Contents(number=count), {}) for count in counts]
    values, found = np.empty((len(columns), piece.rows)), list[_Column]()
    for row, (cells, name) in enumerate(zip(columns, names, strict=True)):
        if isinstance(cells, np.ndarray) and cells.dtype.kind != "M":
            cells = numbers_only(cells, f"{piece.name}: column {name!r}")
        is_csv = len(cells) and not isinstance(cells, np.ndarray | Sequence)
        parsed: FloatArray | None = None
        if is_csv and name not in categorical:
            parsed = _parsed([cast("pa.ChunkedArray", cells)])
        values[row], contents, first = coded(
            cells if parsed is None else parsed, is_categorical=name in categorical
        )
        if name not in categorical:
            column = _quoted(name)
            hint = f"; pass --ignore {column}, or --categorical {column} to learn text"
            _refuse_rounded(piece, name, cells, values[row], hint)
        if order := piece.texts.get(name):
            contents = msgspec.structs.replace(contents, order=order)
        examples = {kind: (place, str(cells[place])) for kind, place in first.items()}
        found.append((contents, examples))
    return values, found


def _all_numbers(piece: TablePiece, chosen: Sequence[int]) -> FloatArray | None:
    """Return columns that are all of numbers at once, None if there is another one."""
    if piece.whole is not None:
        is_all = list(chosen) == list(range(len(piece.columns)))
        values = piece.whole if is_all else piece.whole[list(chosen)]
        return None if np.any(np.abs(values) >= EXACT) else values
    columns = [piece.cells[index] for index in chosen]
    is_csv = not any(isinstance(cells, np.ndarray | Sequence) for cells in columns)
    parsed = _parsed(columns) if columns and piece.rows and is_csv else None
    if parsed is None or np.any(np.abs(parsed) >= EXACT):
        return None
    return parsed.reshape(len(columns), piece.rows)


def _refuse_rounded(
    piece: TablePiece, name: str, cells: Cells, values: FloatArray, hint: str = ""
) -> None:
    """Raise a TableError if a column has a whole number that a double rounds."""
    for row in np.flatnonzero(np.abs(values) >= EXACT).tolist():
        text = str(cells[row]).strip()
        if _WHOLE.fullmatch(text) and int(text) != float(values[row]):
            text = f"column {name!r} holds {text}, which a double rounds{hint}"
            raise TableError(f"{piece.where(row)}: {text}")


def _numbers_of(
    piece: TablePiece, chosen: Sequence[int], variables: Sequence[Variable]
) -> tuple[FloatArray, dict[str, int]]:
    """Return columns of a piece as the variables of a model take them.

    The variable decides, whatever the type of the column: a cell is the position of a
    category, the days of a date, or a number. Also returns how many cells are no
    category, by name; they are NaN.

    Raises:
        TableError: If a column of numbers holds text.
    """
    is_plain = not any(one.categories for one in variables)
    numbers = _all_numbers(piece, chosen) if is_plain else None
    if numbers is not None:
        return numbers, {}
    unknown: dict[str, int] = {}
    values, faults = np.empty((len(chosen), piece.rows)), list[str]()
    for row, (index, variable) in enumerate(zip(chosen, variables, strict=True)):
        cells, name = piece.cells[index], variable.name.strip()
        if variable.categories:
            indices, distinct = distinct_values(cells)
            found = [*map(placer(variable.categories), distinct)]
            is_new = np.array([one is None for one in found], np.bool_)
            places = np.array([math.nan if one is None else one for one in found])
            values[row] = places[indices]
            unknown[name] = int(np.count_nonzero(is_new[indices]))
            continue
        if variable.unit == DATE_UNIT:
            values[row], contents, _ = coded(cells)
            if contents.kind() in ("date", "number"):
                continue
        if isinstance(cells, np.ndarray):
            cells = numbers_only(cells, f"{piece.name}: column {name!r}")
        values[row], bad = _numbers(cells)
        _refuse_rounded(piece, name, cells, values[row])
        if bad:
            text = str(cells[bad[0]])
            fault = f"text where a number is needed: {_shortened(text)!r}"
            fault = number_hint([text]) or f"{fault}{_more(len(bad))}"
            faults.append(f"{piece.where(bad[0])}: column {name!r} holds {fault}")
    if faults:
        raise TableError(_fault_text(faults))
    return values, {name: n for name, n in unknown.items() if n}


def _fault_text(faults: Iterable[str]) -> str:
    """Return the sentences about columns that hold text, and how many more do."""
    shown = [*faults]
    others = len(shown) - _MOST_NAMES
    if others > 0:
        shown[_MOST_NAMES:] = [f"and {counted(others, 'column')} more hold text"]
    return "\n".join(shown)


def _shortened(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."


def _more(count: int) -> str:
    return "" if count == 1 else f" (and {count - 1} more)"


def _quoted(column: str) -> str:
    return column if re.fullmatch(r"[\w.-]+", column) else repr(column)


def _numbers(cells: Cells) -> tuple[FloatArray, list[int]]:
    """Return cells as numbers, NaN where missing, and the positions of the others."""
    if isinstance(cells, np.ndarray) and cells.dtype.kind in REAL:
        return cells.astype(np.float64), []
    if len(cells) and not isinstance(cells, np.ndarray | Sequence):
        parsed = _parsed([cells])
        if parsed is not None:
            return parsed, []
    result = [number_of(cell) for cell in plain(cells)]
    bad = [row for row, value in enumerate(result) if value is None]
    filled = [math.nan if value is None else value for value in result]
    return np.array(filled, np.float64), bad


def _row_weights(piece: TablePiece, column: str) -> FloatArray:
    """Return the weights of some rows.

    Raises:
        TableError: If one is no number, negative, missing or infinite.
    """
    cells = piece.cells[piece.columns.index(column)]
    values, faults = _numbers(cells)
    is_bad = ~is_weight(values)
    is_bad[faults] = True
    if is_bad.any():
        row = int(is_bad.argmax())
        raise TableError(
            f"{piece.where(row)}: the weight in column {column!r} is "
            f"{plain(cells)[row]!r}; a weight is finite and not negative"
        )
    return values


def _parsed(columns: Sequence[pa.ChunkedArray]) -> FloatArray | None:
    """Return columns of text as numbers, one after another; None if not all are.

    What this parses is the same double as `number_of` makes of it. What is rare, such
    as infinity and blanks of other scripts, is left to `number_of`.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    # pa.array, pa.scalar and to_numpy would import pandas where it is installed.
    cells = pa.concat_arrays([part for column in columns for part in column.chunks])
    for has_missing in (False, True):
        missing = 0
        if has_missing:
            cells = pc.call_function("ascii_trim_whitespace", [cells])
            how = pc.ReplaceSubstringOptions(_MISSING, "nan")
            cells = pc.call_function("replace_substring_regex", [cells], how)
            nan = pc.MatchSubstringOptions("^nan$")
            result = pc.call_function("match_substring_regex", [cells], nan)
            missing = pc.call_function("sum", [result]).as_py()
        try:
            values = np.from_dlpack(pc.cast(cells, pa.float64()))
        except pa.ArrowInvalid:
            continue
        if np.count_nonzero(np.isfinite(values)) == len(values) - missing:
            return cast("FloatArray", values)
    return None


def trimmed(piece: TablePiece) -> list[tuple[str, str]]:
    """Return a remark on names that stand between blanks, if there are any."""
    pairs = zip(piece.written, piece.columns, strict=True)
    result = [title for title, name in pairs if title != name and title.strip()]
    text = f"blanks around its name, which are left out{_more(len(result))}"
    return [(repr(title), text) for title in result[:1]]


def _needed_columns(
    piece: TablePiece, inputs: Sequence[str], trained: Sequence[str]
) -> list[int]:
    columns: Sequence[str] = piece.columns
    if not piece.is_named and not set(inputs) <= set(columns):
        wanted = trained or inputs
        if len(columns) != len(wanted):
            verb = "was learnt from" if trained else "needs"
            raise TableError(
                f"{piece.name} has {len(columns)} columns without names, and the "
                f"model {verb} {len(wanted)}: {', '.join(wanted)}"
            )
        columns = wanted
    else:
        _refuse_absent(piece, inputs, ", which the model needs")
    position = {column: k for k, column in enumerate(columns)}
    return [position[name] for name in inputs]


def _refuse_absent(piece: TablePiece, wanted: Sequence[str], why: str) -> None:
    known_names = frozenset(piece.columns)
    absent = [name for name in wanted if name not in known_names]
    if not absent:
        return
    dots = ["..."] * (len(piece.columns) > _MOST_NAMES)
    known = ", ".join([*piece.columns[:_MOST_NAMES], *dots]) or "none"
    close = difflib.get_close_matches(absent[0], piece.columns, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close and len(absent) == 1 else ""
    word = "column" if len(absent) == 1 else "columns"
    names = ", ".join(map(repr, absent))
    hint = _header_hint(piece.columns) or hint
    raise TableError(f"{piece.name} has no {word} {names}{why}; it has {known}{hint}")


def _header_hint(columns: Sequence[str]) -> str:
    """Return what reads a table whose first row is data, if it looks like that."""
    numbers = sum(math.isfinite(number_of(c) or math.nan) for c in columns)
    if not columns or 2 * numbers < len(columns):
        return ""
    text = "its first row looks like data; pass --no-header to name the columns"
    return f"\n  {text} 'column 1', 'column 2', ..."


def _named(name: str, written: Sequence[str]) -> tuple[str, ...]:
    """Return the names of columns without blanks around them, each of them once.

    Raises:
        TableError: If one stands there twice.
    """
    columns = tuple(c.strip() or f"column {k}" for k, c in enumerate(written, 1))
    _refuse_repeated(name, columns)
    return columns


def _refuse_repeated(name: str, columns: Sequence[str]) -> None:
    twice = [c for c, count in Counter(columns).items() if count > 1]
    if twice:
        word = "column" if len(twice) == 1 else "columns"
        verb = "stands" if len(twice) == 1 else "stand"
        names = ", ".join(map(repr, twice))
        text = f"{name}: {word} {names} {verb} there more than once"
        raise TableError(text + _header_hint(columns))


# --- files and streams


def _file_pieces(
    path: str | os.PathLike[str], form: TableFormat, name: str | None, only: Only
) -> Iterator[TablePiece]:
    try:
        files = files_of(os.fspath(path))
    except OSError as error:
        raise TableError(f"{path}: cannot be read: {reason(error)}") from error
    first: TablePiece | None = None
    sizes = [Path(f).stat().st_size if Path(f).is_file() else 0 for f in files]
    before, whole = 0, max(sum(sizes), 1)
    for file, size in zip(files, sizes, strict=True):
        title = name if name and len(files) == 1 else file
        with _opened(file, title) as stream:
            try:
                for piece in _stream_pieces(stream, title, form, only):
                    first = first or piece
                    place = before + (stream.tell() if size else 0)
                    share = min(place / whole, 1.0)
                    yield msgspec.structs.replace(_arranged(piece, first), share=share)
            except OSError as error:
                raise TableError(f"{title}: cannot be read: {reason(error)}") from error
        before += size


def files_of(path: str) -> list[str]:
    """Return the files of a path: one, those of a folder, or those of a pattern.

    Raises:
        TableError: If a folder has no table, or a pattern fits no file.
    """
    if "://" in path or Path(path).is_file() or not Path(path).name:
        return [path]
    if Path(path).is_dir():
        found = sorted(
            str(file)
            for file in Path(path).rglob("*")
            if file.name.lower().endswith(SUFFIXES) and file.name[0] not in "._"
        )
        if not found:
            known = ", ".join(SUFFIXES)
            raise TableError(f"{path}: the folder has no table ({known})")
        return found
    if not glob.has_magic(path) or Path(path).exists():
        return [path]
    start = Path(path).anchor
    files = Path(start).glob(path.removeprefix(start))
    found = sorted(str(file) for file in files if not file.name.startswith("."))
    if not found:
        raise TableError(f"{path}: no file has such a name")
    return found


def _arranged(piece: TablePiece, first: TablePiece) -> TablePiece:
    """Return a piece with its columns in the order of the first one.

    Raises:
        TableError: If it has other columns.
    """
    if piece.columns == first.columns:
        return piece
    if len(piece.columns) != len(first.columns):
        _refuse_absent(first, piece.columns, f", which {piece.name} has")
    _refuse_absent(piece, first.columns, f", which {first.name} has")
    order = [piece.columns.index(column) for column in first.columns]
    return msgspec.structs.replace(
        piece,
        columns=first.columns,
        written=tuple(piece.written[k] for k in order),
        cells=tuple(piece.cells[k] for k in order),
    )


def _opened(path: str, title: str) -> io.BufferedReader:
    if path.lower().startswith(("http://", "https://", "ftp://")):
        raise TableError(f"{title}: a URL is not read; download the table first")
    try:
        if "://" in path:
            from pyarrow import fs

            system, place = fs.FileSystem.from_uri(path)  # such as s3://place/t.csv
            return io.BufferedReader(system.open_input_file(place))
        check_stream(path)
        return Path(path).open("rb")
    except (OSError, ValueError) as error:
        raise TableError(f"{title}: cannot be read: {reason(error)}") from error


def _stream_pieces(
    stream: io.BufferedReader | io.BytesIO, name: str, form: TableFormat, only: Only
) -> Iterator[TablePiece]:
    head = stream.read(BLOCK)
    kind = next((kind for mark, kind in _KINDS.items() if head.startswith(mark)), "")
    if not kind:
        if Path(name).suffix.lower() in (".parquet", ".pq"):
            what = "is no Parquet file: it must begin with PAR1"
            raise TableError(f"{name} {what if head else 'is empty'}")
        yield from _csv_pieces(*_utf8(head, stream.read, form, name), name, form, only)
        return
    raw = type(getattr(stream, "raw", None)).__name__
    if kind in _CODECS and raw == "CompressedInputStream":
        raise TableError(f"{name}: is compressed twice; decompress it first")
    if stream.seekable():
        stream.seek(-len(head), io.SEEK_CUR)
    else:
        content = head + stream.read(LIMIT)
        if len(content) > LIMIT:
            raise TableError(
                f"{name}: a binary table in a pipe is larger than {LIMIT} bytes; "
                "write it to a file and name the file"
            )
        stream = io.BytesIO(content)
    if kind == "arrow":
        yield from _arrow_pieces(stream, name, only)
    elif kind == "excel":
        form = msgspec.structs.replace(form, delimiter=",")
        rows = _excel_text(stream.read(LIMIT), name, form)
        yield from _text_pieces(rows, name, form, only)
    else:
        import pyarrow as pa

        stream = io.BufferedReader(pa.CompressedInputStream(stream, kind))
        try:
            yield from _stream_pieces(stream, name, form, only)
        except OSError as error:
            raise TableError(f"{name}: broken {kind} file: {reason(error)}") from error


def _utf8(
    head: bytes, read: Callable[[int], bytes], form: TableFormat, name: str
) -> tuple[bytes, Callable[[int], bytes]]:
    """Return the first bytes of a text and what reads more, in UTF-8."""
    marks = (one for mark, one in _ENCODINGS.items() if head.startswith(mark))
    encoding = form.encoding or next(marks, "utf-8")
    try:
        "".encode(encoding)  # which refuses what is no encoding of texts
        decoder = codecs.getincrementaldecoder(encoding)()
    except LookupError as error:
        raise TableError(f"{name}: there is no encoding {encoding!r}") from error
    if codecs.lookup(encoding).name == "utf-8":
        return head, read

    def read_on(size: int) -> bytes:
        content = read(size)
        return decoder.decode(content, final=len(content) < size).encode()

    try:
        return decoder.decode(head).encode(), read_on
    except UnicodeDecodeError as error:
        raise no_text(name, encoding) from error


def _excel_text(content: bytes, name: str, form: TableFormat) -> io.StringIO:
    """Return a sheet of an Excel file as CSV, without its empty rows."""
    try:
        import python_calamine as calamine
    except ImportError as error:
        hint = f"reading Excel needs {install_hint('excel')}"
        raise MissingExtraError(f"{name}: {hint}") from error

    try:
        if content.startswith(b"PK"):
            parts = zipfile.ZipFile(io.BytesIO(content)).infolist()
            if sum(part.file_size for part in parts) > _MOST_EXCEL:
                raise TableError(f"{name}: its sheets are too large; save them as CSV")
        book = calamine.load_workbook(io.BytesIO(content))
        names = [one for one in book.sheet_names if form.sheet in ("", one)]
        sheets = {one: book.get_sheet_by_name(one).to_python() for one in names}
    except (calamine.CalamineError, zipfile.BadZipFile) as error:
        raise TableError(f"{name}: is no table of Excel: {error}") from error
    sheets = {sheet: rows for sheet, rows in sheets.items() if rows}
    if len(sheets) > 1 or not names:
        known = ", ".join(map(repr, book.sheet_names))
        raise TableError(f"{name} has the sheets {known}; pass --sheet and one of them")
    text = io.StringIO()
    for row in itertools.chain(*sheets.values()):
        cells = [
            text_of(cell).replace(".", form.decimal if isinstance(cell, float) else ".")
            for cell in row
        ]
        if any(cells):
            csv.writer(text).writerow(cells)
    text.seek(0)
    return text


def _text_pieces(
    text: io.TextIOBase, name: str, form: TableFormat, only: Only
) -> Iterator[TablePiece]:
    def read(size: int) -> bytes:
        return text.read(size).encode(errors="surrogatepass")

    try:
        yield from _csv_pieces(read(BLOCK), read, name, form, only)
    except UnicodeDecodeError as error:
        raise no_text(name, form.encoding or error.encoding) from error


def _arrow_pieces(stream: BinaryIO, name: str, only: Only) -> Iterator[TablePiece]:
    """Yield a Parquet file, or an Arrow file of record batches (also Feather)."""
    import pyarrow as pa

    try:
        schema, result = _record_batches(stream, name, only)
        is_empty = True
        for piece in _batch_pieces(result, name, only, tuple(schema.names)):
            is_empty = False
            yield piece
        if is_empty:
            yield from _batch_pieces([schema.empty_table()], name, only)
    except pa.ArrowMemoryError:
        raise
    except pa.ArrowException as error:
        raise TableError(f"{name}: broken Parquet or Arrow file: {error}") from error


def _batch_pieces(
    parts: Iterable[pa.RecordBatch | pa.Table],
    name: str,
    only: Only,
    written: tuple[str, ...] | None = None,
) -> Iterator[TablePiece]:
    """Yield record batches; `written` are the columns of the file they are part of."""
    import pyarrow as pa

    first = 0
    for part in parts:
        is_batch = isinstance(part, pa.RecordBatch)  # pa.table would import pandas
        table = pa.Table.from_batches([part]) if is_batch else part
        titles = written or tuple(table.column_names)
        columns = _named(name, titles)
        cells: list[Cells] = [()] * len(columns)
        texts: dict[str, tuple[str, ...]] = {}
        places = {title: place for place, title in enumerate(titles)}
        for title, data in zip(table.column_names, table.columns, strict=True):
            place = places[title]
            if only is None or columns[place] in only:
                kind = data.type
                is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
                cells[place] = number_array(data) if is_number else data.to_pylist()
                if str(kind).startswith(("string", "large_string", "dictionary")):
                    facts = table.schema.field(title).metadata or {}
                    is_enum = any(key.startswith(b"_PL_ENUM") for key in facts)
                    texts[columns[place]] = () if is_enum else _order_of(data)
        where, count = _row_names(name, first), table.num_rows
        yield TablePiece(
            name, columns, (*cells,), count, where, titles, frame=table, texts=texts
        )
        first += count


def _order_of(column: object) -> tuple[str, ...]:
    """Return the categories of a column of pandas or pyarrow that orders them."""
    kind: object = getattr(column, "dtype", getattr(column, "type", None))
    if not getattr(kind, "ordered", False):
        return ()
    names: Iterable[object] = getattr(kind, "categories", ())
    for chunk in getattr(column, "chunks", ())[:1]:
        names = chunk.dictionary.to_pylist()
    return tuple(map(text_of, names))


def _record_batches(
    stream: BinaryIO, name: str, only: Only
) -> tuple[pa.Schema, Iterator[pa.RecordBatch]]:
    """Return all columns, and batches of some rows with those that are wanted."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    is_arrow = stream.read(len(_ARROW)) == _ARROW
    stream.seek(-len(_ARROW), io.SEEK_CUR)
    if is_arrow:
        schema = pa.ipc.open_file(stream).schema
        return schema, _slices(stream, schema, _wanted(name, schema, only))
    # A row group may be as large as the file: columns are read bit by bit.
    parquet = pq.ParquetFile(stream, pre_buffer=False, buffer_size=_BUFFER)
    schema = parquet.schema_arrow
    wanted = _wanted(name, schema, only)
    columns, rows = [schema.names[k] for k in wanted], _piece_rows(len(wanted))
    return schema, parquet.iter_batches(batch_size=rows, columns=columns)


def _wanted(name: str, schema: pa.Schema, only: Only) -> list[int]:
    columns = enumerate(_named(name, schema.names))
    return [k for k, column in columns if only is None or column in only]


def _slices(
    stream: BinaryIO, schema: pa.Schema, wanted: list[int]
) -> Iterator[pa.RecordBatch]:
    """Yield some columns of an Arrow file.

    A batch may be as large as the file. Where it is not compressed, it is mapped into
    memory, and the memory of what has been read is given back.
    """
    import pyarrow as pa

    mapped: mmap.mmap | None = None
    file: pa.RecordBatchFileReader | None = None
    with contextlib.suppress(OSError):  # a stream in memory, or of an object store
        mapped = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
        file = _uncopied(pa.py_buffer(mapped))
    if file is None:
        options = pa.ipc.IpcReadOptions(included_fields=wanted or [0])
        mapped, file = None, pa.ipc.open_file(stream, options=options)
    names = [schema.names[k] for k in wanted]
    rows, count = _piece_rows(len(wanted)), 0
    for number in range(file.num_record_batches):
        batch = file.get_batch(number).select(names)
        for first in range(0, batch.num_rows, rows):
            part = batch.slice(first, rows)
            if mapped is not None:  # the stream stands where it would without
                share = number + (first + len(part)) / len(batch)
                stream.seek(int(share / file.num_record_batches * len(mapped)))
            yield part
            count += 1
            if mapped is None or count % _UNRETURNED:
                continue
            if hasattr(mmap, "MADV_DONTNEED"):
                mapped.madvise(mmap.MADV_DONTNEED)


def _uncopied(buffer: pa.Buffer) -> pa.RecordBatchFileReader | None:
    """Return an Arrow file whose cells are read where they lie, None if they are not.

    Options that choose columns, or a compression, would have them copied.
    """
    import pyarrow as pa

    file = pa.ipc.open_file(buffer)
    columns = file.get_batch(0).columns if file.num_record_batches else []
    parts = [part for column in columns for part in column.buffers() if part]
    offsets = [part.address - buffer.address for part in parts]
    return file if all(0 <= offset < buffer.size for offset in offsets) else None


def _piece_rows(columns: int) -> int:
    return max(1, min(PIECE, _CELLS // max(columns, 1)))


def _csv_pieces(
    head: bytes,
    read: Callable[[int], bytes],
    name: str,
    form: TableFormat,
    only: Only,
) -> Iterator[TablePiece]:
    """Yield the rows of a CSV file, of which `head` has been read already."""
    try:
        head = head.removeprefix(codecs.BOM_UTF8)
        first = re.split(rb"[\r\n]", head, maxsplit=1)[0].decode()
        if not first.strip():
            raise TableError(f"{name} is empty: it needs a line with column names")
        mark = form.delimiter or _delimiter(first, name)
        if len(mark) != 1 or mark in _NO_DELIMITER or not mark.isascii():
            raise TableError(
                f"{name}: a delimiter is one character such as ';', "
                f"and not {mark[:20]!r}"
            )
        result = blocks(head, read, mark.encode(), name)
        start = next(result)
        written = start.header()
        if not form.header:
            written = tuple(f"column {k}" for k in range(1, len(written) + 1))
        parse = functools.partial(_rows_pieces, written=written, form=form, only=only)
        for parsed in in_order(parse, itertools.chain([start], result)):
            yield from parsed
    except UnicodeDecodeError as error:
        raise no_text(name, form.encoding or error.encoding) from error


def _rows_pieces(
    rows: CsvRows, written: tuple[str, ...], form: TableFormat, only: Only
) -> list[TablePiece]:
    """Return the rows of a block; at least one piece, if it is the first one."""
    columns = _named(rows.name, written)
    only = only if form.header else None  # whose names are not those of the model
    wanted = [k for k, column in enumerate(columns) if only is None or column in only]
    start = int(rows.line == 1 and form.header)  # the row of the names
    numbers = None
    if only is not None and form.decimal == ".":
        numbers = rows.numbers(len(columns), wanted, start, _EMPTY)
    data: Sequence[Cells] = (
        rows.table(len(columns), wanted).slice(start).columns
        if numbers is None
        else numbers
    )
    count, step = len(data[0]), _piece_rows(len(wanted))
    result: list[TablePiece] = []
    for first in range(0, max(count, start), step):
        cells: list[Cells] = [()] * len(columns)
        for place, column in zip(wanted, data, strict=False):
            cells[place] = column[first : first + step]

        def where(row: int, first: int = first) -> str:
            return f"{rows.name}:{rows.line_of(start + first + row)}"

        part = min(step, count - first)
        result.append(
            TablePiece(rows.name, columns, (*cells,), part, where, written, form.header)
        )
    return result


def _delimiter(line: str, name: str) -> str:
    bare = re.sub(r'"[^"]*"', "", line)
    result = [mark for mark in _DELIMITERS if mark in bare]
    if len(result) > 1:
        shown = " and ".join(repr(mark) for mark in result)
        raise TableError(
            f"{name}:1: both {shown} stand between names; say which one is the "
            "delimiter (--delimiter)"
        )
    return result[0] if result else ","


# --- tables in memory


def _array_piece(
    array: npt.NDArray[np.generic], columns: Sequence[str] | None, name: str
) -> TablePiece:
    where, count = _row_names(name), len(array) if array.ndim else 0
    if array.dtype.names is not None:
        written = array.dtype.names
        fields = cast("npt.NDArray[np.void]", array)
        cells = tuple(unmasked(fields[column]) for column in written)
        return TablePiece(name, _named(name, written), cells, count, where, written)
    if array.ndim != 2:
        raise TableError(f"{name} has shape {array.shape}, not (rows, columns)")
    width = array.shape[1]
    if columns is not None and len(columns) != width:
        raise TableError(f"{name} has {width} columns and {len(columns)} names")
    written = tuple(columns or (f"x{number}" for number in range(1, width + 1)))
    array = unmasked(array)
    cells = tuple(array[:, k] for k in range(width))
    is_named = columns is not None
    whole = array.astype(np.float64, copy=False).T if array.dtype.kind in REAL else None
    named = _named(name, written)
    return TablePiece(name, named, cells, count, where, written, is_named, whole)


def _frame_piece(source: object, name: str, only: Only = None) -> TablePiece:
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
        names = tuple(frame.collect_schema().names())
        pairs = zip(names, _named(name, names), strict=True)
        wanted = [column for column, c in pairs if only is None or c in only]
        written = names
        frame = frame.select(wanted or names).collect()
    else:
        written = tuple(map(str, frame.columns))
    columns = _named(name, written)
    there = dict(zip(map(str, frame.columns), frame.columns, strict=True))
    cells: list[Cells] = []
    texts: dict[str, tuple[str, ...]] = {}
    for title, column in zip(written, columns, strict=True):
        if title not in there or not (only is None or column in only):
            cells.append(())
            continue
        series = frame.get_column(there[title])
        kind = series.dtype
        is_array = kind.is_numeric() or kind == nw.Datetime
        if kind.is_integer() and series.null_count():  # which would be rounded
            is_array = not (series.abs().max() or 0) >= EXACT
        cells.append(series.to_numpy() if is_array else series.to_list())
        is_text = isinstance(kind, nw.String | nw.Categorical | nw.Enum)
        if is_text and str(getattr(series.to_native(), "dtype", "")) != "object":
            texts[column] = _order_of(series.to_native())
    where = _row_names(name)
    return TablePiece(name, columns, (*cells,), len(frame), where, written, texts=texts)


def _row_names(name: str, first: int = 0) -> Callable[[int], str]:
    return lambda row: f"{name}, row {first + row + 1}"


def pandas_frame(columns: Mapping[str, Sequence[object]]) -> pd.DataFrame:
    """Return columns as a frame of pandas, empty cells as what pandas has for them."""
    try:
        import pandas as pd
    except ImportError as error:
        raise MissingExtraError("to_pandas needs pandas: pip install pandas") from error

    return pd.DataFrame(
        {
            name: [one if one != "" else None for one in row]
            for name, row in columns.items()
        }
    )
