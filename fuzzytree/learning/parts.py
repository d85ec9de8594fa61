"""Learn from a table in parts, which lie where they lie: collect, merge, save, learn.

What learning needs of all rows is a state of bounded size: counts, exact sums, smallest
and largest values, and a sample that depends on the rows alone. States of parts are
merged in any order and grouping, and the tree has the same bits as that of the whole
table.

A state's file is an Arrow file of one row: a list for each array, and a header in JSON
in the schema's metadata. A digest of all of it is part of the header.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import os
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Final, Unpack, cast

import msgspec
import numpy as np

from fuzzytree.columns import Contents
from fuzzytree.errors import LearningError, ReadError, TableError
from fuzzytree.files import read_bounded, write_atomically
from fuzzytree.learning.findings import refuse_measurements
from fuzzytree.learning.learner import ArrayLearner, Learnt, check_rows
from fuzzytree.learning.sampling import usual_rows
from fuzzytree.learning.settings import LearningSettings, SettingArguments, settings_of
from fuzzytree.learning.statistics import Statistics
from fuzzytree.model import DATE_UNIT, FuzzyTree, as_names, with_label_type
from fuzzytree.tables import (
    THREADS,
    ClassLabels,
    LearningPiece,
    LearningRows,
    LearntColumns,
    Table,
    TableSource,
    Weights,
    columns_of,
)

if TYPE_CHECKING:
    import numpy.typing as npt

Progress = Callable[[str, float], None]

MAGIC: Final = "fuzzytree state 3"
"""The kind and the version of a state's file."""

COUNTS_MAGIC: Final = "fuzzytree leaf counts 1"
"""Those of a state of the second pass."""

MOST_CELLS: Final = 1 << 25
"""The most numbers of a table that is read whole."""

_LARGE: Final = 1 << 24
"""The most numbers of a sample for each thread to have its own."""

STATE_LIMIT: Final = 1 << 33
"""The largest file of a state that is read, in bytes."""

STATE_BEGIN: Final = b"ARROW1"
"""How the file of a state begins."""

_WRITERS: Final = {
    MAGIC: "`fuzzytree collect`",
    COUNTS_MAGIC: "`fuzzytree collect --for`",
}


class StateHeader(msgspec.Struct, forbid_unknown_fields=True):
    """What a state says about its table; see `Learner` for the meanings.

    Attributes:
        magic: The kind and the version of the file.
        classes: The names of the classes, as they came.
        floats: Which of them came as numbers with a fraction, as 1.0 does.
        kinds: The kinds of labels that came, see `fuzzytree.tables.coded_classes`.
        unlabelled: Rows that were left out as they have no class.
        parts: The digests of the states that were merged.
        rows_per_class: How many rows of a class the sample keeps; 0 for the usual ones.
        dropped: Rows in which a value is missing.
        missing: Cells without a value.
        contents: What the cells of each column hold.
        categorical: The columns whose cells are all categories.
        model: The fingerprint of the tree whose leaves are counted; empty for none.
        ties: Rows that more than one leaf claims.
        digest: Of everything else.
    """

    magic: str
    target: str
    columns: list[str]
    classes: list[str]
    floats: list[bool]
    kinds: list[str]
    unlabelled: int
    parts: list[str]
    rows_per_class: int = 0
    dropped: int = 0
    missing: int = 0
    contents: list[Contents] = []
    categorical: list[str] = []
    model: str = ""
    ties: int = 0
    digest: str = ""

    def labels(self) -> ClassLabels:
        """Return the classes.

        Raises:
            ValueError: If one of them, or a column, stands twice.
        """
        labels = ClassLabels(zip(self.classes, self.floats, strict=True), self.kinds)
        if len(labels.keys) + len(set(self.columns)) < len(self.classes + self.columns):
            raise ValueError("names a column or a class twice")
        return labels


class Learner:
    """Learns from a table in parts; neither their borders nor their order matter.

    Args:
        target: The column of the classes.
        columns: The columns to learn from, in the order in which the tree has them;
            all columns of the first part, in its order, if None.
        ignore: Columns that are no input.
        categorical: Columns whose cells are categories, numbers too.
        units: The unit of a column, by name.
        name: The name of the tree.
        settings: How to learn.
        options: Settings by name, such as `leaves=4`, which go before `settings`.

    Example:
        >>> import pandas as pd
        >>> soft = pd.DataFrame({"cm": [1.0, 1.5, 2.0], "size": "small"})
        >>> firm = pd.DataFrame({"cm": [7.0, 8.0, 9.0], "size": "big"})
        >>> here, there = Learner("size"), Learner("size")
        >>> here.update(soft)
        >>> there.update(firm)
        >>> len(here.merge(there).learn().leaves)
        2
    """

    def __init__(
        self,
        target: str,
        *,
        columns: Sequence[str] | None = None,
        ignore: Sequence[str] = (),
        categorical: Sequence[str] = (),
        units: Mapping[str, str] | None = None,
        name: str = "tree",
        settings: LearningSettings | None = None,
        **options: Unpack[SettingArguments],
    ) -> None:
        self.target = target.strip()
        self.columns = None if columns is None else tuple(as_names(columns))
        self.ignore = tuple(column.strip() for column in as_names(ignore))
        self.categorical = frozenset(c.strip() for c in as_names(categorical))
        self.units = dict(units or {})
        self.name = name
        others = ("columns", "ignore", "categorical", "units", "name")
        self.settings = settings_of(settings, options, "Learner", others)
        self.unlabelled = self.missing = 0
        self.remarks: tuple[tuple[str, str], ...] = ()
        self._labels = ClassLabels()
        self._contents: dict[str, Contents] = {}
        self._first: dict[str, dict[str, tuple[str, str]]] = {}
        self._parts: frozenset[str] = frozenset()
        self._statistics: Statistics | None = None

    def __repr__(self) -> str:
        """Return what was collected, in a line."""
        rows, columns = f"{self.rows:,} rows", len(self.columns or ())
        of = f"{columns} columns, {len(self._labels.keys)} classes"
        return f"<Learner of {self.target!r}: {rows}, {of}>"

    @property
    def rows(self) -> int:
        """How many rows were collected that have a class."""
        return 0 if self._statistics is None else int(self._statistics.counts().sum())

    @property
    def dropped(self) -> int:
        """In how many rows a value is missing or not finite."""
        return 0 if self._statistics is None else self._statistics.dropped

    def update(
        self,
        table: object,
        *,
        name: str | None = None,
        progress: Progress | None = None,
        threads: int | None = None,
    ) -> None:
        """Take the rows of one more part.

        Args:
            table: What `fuzzytree.table` takes: a path, a frame, an arrow table or
                batch, an open file. Files are read piece by piece.
            name: What messages call the part; its path unless given.
            progress: Called with the number of rows so far, and the share read.
            threads: How many threads count; one for each core unless given. The tree
                has the same bits for any number.

        Raises:
            TableError: If a column is absent, or a file cannot be read; nothing of the
                part is taken then.
            LearningError: If a value is missing, and `missing` is `refuse`.
        """
        begun = self._empty()
        rows = LearningRows(
            TableSource(table, categorical=tuple(self.categorical)),
            target=self.target,
            ignore=self.ignore,
            name=name,
            chosen=self.columns,
            progress=progress,
        )
        begun.collect(rows, rows, threads or THREADS)
        vars(self).update(vars(self.merge(begun)))

    def merge(self, other: Learner, *, repeated: bool = False) -> Learner:
        """Return a learner of the rows of both.

        Args:
            other: A learner of the same table.
            repeated: Whether a saved state that is part of both counts twice.

        Raises:
            ValueError: If they have another target, other columns or another size of
                the sample, or if one saved state is part of both.
        """
        if not repeated:
            refuse_repeated(self._parts, other._parts)
        declared = [sorted(one.categorical) for one in (self, other)]
        if not (self._contents and other._contents):  # an empty one declares nothing
            declared = [max(declared)] * 2
        for what, mine, others in (
            ("target", [self.target], [other.target]),
            ("columns", self.columns or other.columns, other.columns or self.columns),
            (
                "number of rows per class",
                [str(self.settings.rows_per_class or "the usual one")],
                [str(other.settings.rows_per_class or "the usual one")],
            ),
            (
                "set of categorical columns",
                [", ".join(declared[0]) or "none"],
                [", ".join(declared[1]) or "none"],
            ),
        ):
            if mine != others:
                raise ValueError(_difference(what, mine or (), others or ()))
        result = self._empty()
        result.columns = self.columns or other.columns
        result.categorical = frozenset(declared[0])
        result._first = self._first | other._first
        result._contents = {
            name: self._contents.get(name, Contents()).merge(
                other._contents.get(name, Contents())
            )
            for name in result.columns or ()
        }
        result.unlabelled = self.unlabelled + other.unlabelled
        result.missing = self.missing + other.missing
        result.remarks = self.remarks or other.remarks
        result._parts = self._parts | other._parts
        result._labels = self._labels.merge(other._labels)
        places, size = result._labels.keys, len(result._labels.keys)
        parts = [
            part._placed([places[key] for key in part._labels.keys], size)
            for part in (self, other)
        ]
        filled = [part for part in parts if part is not None]
        if filled:
            result._statistics = functools.reduce(Statistics.merge, filled)
        return result

    def learn(self, *, progress: Progress | None = None) -> FuzzyTree:
        """Return the tree of all rows, or rules as `fuzzytree.learn`; more may follow.

        Raises:
            LearningError: If there is no row, one class, or no column that varies.
        """
        return cast("FuzzyTree", self.learnt(progress=progress).model)

    def learnt(self, *, progress: Progress | None = None) -> Learnt:
        """Return the tree or the rules, and what was counted on the way.

        Raises:
            LearningError: As `learn`.
        """
        statistics, order = self._joined()
        if not self.rows:
            check_rows(statistics, order)
        found = self._learnt_columns(statistics)
        for column in self.units:
            if column not in found.names:
                known = ", ".join(found.names)
                raise LearningError(
                    f"a unit for {column!r}, which is no column; it has {known}"
                )
        units = {**self.units, **dict.fromkeys(found.dates, DATE_UNIT)}
        learner = ArrayLearner(
            found.names,
            order,
            units,
            self.name,
            self.settings,
            found.categories,
            found.ordered,
        )
        learner.statistics = statistics.of_columns(found.kept)
        learnt = learner.finish(progress=progress)
        model = with_label_type(learnt.model, self._labels.label_type())
        return msgspec.structs.replace(learnt, model=model)

    def table(self) -> Table:
        """Return the sampled rows as a table, each with the rows that it stands for.

        Of each class at most `rows_per_class` rows are kept; each of them stands for
        as many rows of its class as there are for each that is kept.

        Raises:
            LearningError: If no row was collected.
        """
        statistics, classes = self._joined()
        if not self.rows:
            check_rows(statistics, classes)
        sample, columns = statistics.sample(), self._learnt_columns(statistics)
        kept = np.bincount(sample.codes, minlength=len(classes))
        weights = statistics.counts() / np.maximum(kept, 1)
        return Table(
            self.name,
            columns.names,
            columns.placed(sample.rows.T),
            classes,
            sample.codes,
            self.missing,
            self.unlabelled,
            self.target,
            (*self.remarks, *columns.remarks),
            weights=weights[sample.codes],
            categories=columns.categories,
            dates=columns.dates,
            is_categorical=self.target in self.categorical,
            ordered=columns.ordered,
        )

    def _learnt_columns(self, statistics: Statistics) -> LearntColumns:
        """Return what the columns are, now that all rows were taken."""
        return columns_of(
            self.name,
            self.columns or (),
            self._contents,
            self.categorical,
            statistics.sample().rows.T,
            self._first,
        )

    def facts(self) -> dict[str, int]:
        """Return how many rows, columns and classes were collected."""
        return {
            "rows": self.rows,
            "dropped": self.dropped,
            "rows_without_class": self.unlabelled,
            "missing_cells": self.missing,
            "columns": len(self.columns or ()),
            "classes": len(set(self._labels.names())),
        }

    def save(self, path: str | os.PathLike[str]) -> str:
        """Write the state to a file whole, and return its digest.

        Raises:
            WriteError: If the file cannot be written.
        """
        content, digest = self._content()
        write_atomically(path, content)
        return digest

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        units: Mapping[str, str] | None = None,
        name: str = "tree",
        settings: LearningSettings | None = None,
    ) -> Learner:
        """Return the learner that a file holds, with its `rows_per_class`.

        Raises:
            ReadError: If the file is none, is broken, or is of another version.
        """
        content = read_bounded(path, STATE_LIMIT, STATE_BEGIN)
        return cls.from_bytes(
            content, os.fspath(path), units=units, name=name, settings=settings
        )

    def to_bytes(self) -> bytes:
        """Return what `save` writes.

        Raises:
            LearningError: If no part was taken.
        """
        return self._content()[0]

    @classmethod
    def from_bytes(
        cls,
        content: bytes,
        title: str = "the state",
        *,
        units: Mapping[str, str] | None = None,
        name: str = "tree",
        settings: LearningSettings | None = None,
    ) -> Learner:
        """Return the learner whose `to_bytes` these are; messages call them `title`.

        Raises:
            ReadError: If they are none, are broken, or are of another version.
        """
        try:
            header, arrays = open_state(content, MAGIC)
            learner = cls._of_state(header, arrays)
        except ValueError as error:
            raise ReadError(f"{title}: {error}") from error
        learner.units, learner.name = dict(units or {}), name
        if settings is not None:
            most = learner.settings.rows_per_class
            learner.settings = msgspec.structs.replace(settings, rows_per_class=most)
        return learner

    def _empty(self) -> Learner:
        return Learner(
            self.target,
            columns=self.columns,
            ignore=self.ignore,
            categorical=[*self.categorical],
            units=self.units,
            name=self.name,
            settings=self.settings,
        )

    def collect(
        self, rows: LearningRows, parts: Iterable[LearningPiece], threads: int
    ) -> None:
        """Take pieces of a table in threads; nothing was taken before."""
        most = self.settings.rows_per_class
        lanes = [self._empty() for _ in range(threads)]
        waiting: deque[Future[None]] = deque()
        with ThreadPoolExecutor(threads) as pool:
            for number, piece in enumerate(parts):
                classes = len(rows.labels.keys)
                width = len(piece.values)
                if classes * width * (most or usual_rows(width, 2)) > _LARGE:
                    threads = 1
                while len(waiting) >= threads:
                    waiting.popleft().result()
                lane = lanes[number % threads]
                waiting.append(pool.submit(lane._take, piece, classes))
            for future in waiting:
                future.result()
        size = len(rows.labels.keys)
        counted = [lane._placed(range(size), size) for lane in lanes]
        full = [one for one in counted if one is not None]
        empty = Statistics(size, len(rows.names or ()), most)
        self._statistics = functools.reduce(Statistics.merge, full or [empty])
        self.columns, self._labels = rows.names, rows.labels
        self.unlabelled, self.missing = rows.unlabelled, rows.missing
        self.remarks, self._contents = tuple(rows.remarks), rows.contents
        self.categorical, self._first = rows.categorical, rows.first

    def _take(self, piece: LearningPiece, classes: int) -> None:
        """Take the rows of a piece of a table that has so many classes by now."""
        statistics = self._statistics
        if statistics is None:
            width, most = len(piece.values), self.settings.rows_per_class
            statistics = Statistics(classes, width, most)
        elif classes > statistics.classes:  # by half more, or each piece copies all
            statistics.grow(max(classes, statistics.classes * 3 // 2))
        self._statistics = statistics
        before = statistics.dropped
        statistics.update(piece.values.T, piece.codes)
        dropped = statistics.dropped - before
        if dropped and self.settings.missing == "refuse":
            raise LearningError(
                f"{piece.name}: {dropped} of {piece.rows} rows hold a missing or "
                "infinite value\n  pass missing='drop' to leave them out"
            )

    def _placed(self, places: Sequence[int], size: int) -> Statistics | None:
        """Return the statistics with other numbers of the classes."""
        statistics = self._statistics
        if statistics is None or (
            statistics.classes == size and [*places] == [*range(size)]
        ):
            return statistics
        known = places[: statistics.classes]
        rest = statistics.classes - len(known)  # room for classes, without rows
        return statistics.placed(np.array([*known, *[0] * rest], np.int64), size)

    def _joined(self) -> tuple[Statistics, tuple[str, ...]]:
        """Return the statistics by the final names of classes, in their order."""
        positions, order = self._labels.ordered()
        statistics = self._placed(positions.tolist(), len(order))
        if statistics is None:
            raise LearningError("cannot learn before a part of the table was taken")
        return statistics, order

    @classmethod
    def _of_state(
        cls, header: StateHeader, arrays: Mapping[str, npt.NDArray[np.generic]]
    ) -> Learner:
        labels = header.labels()
        settings = LearningSettings(rows_per_class=header.rows_per_class or None)
        learner = cls(header.target, columns=header.columns, settings=settings)
        learner.unlabelled, learner.missing = header.unlabelled, header.missing
        learner._labels = labels
        learner._contents = dict(zip(header.columns, header.contents, strict=False))
        learner.categorical = frozenset(header.categorical)
        learner._parts = frozenset([*header.parts, header.digest])
        sizes = len(labels.keys), len(header.columns), settings.rows_per_class
        learner._statistics = Statistics(*sizes, header.dropped)
        learner._statistics.fill(arrays)
        return learner

    def _content(self) -> tuple[bytes, str]:
        """Return the state as the content of a file, and its digest."""
        keys = self._labels.keys
        statistics = self._placed([*keys.values()], len(keys))
        if statistics is None or self.columns is None:
            raise LearningError("cannot save a state before a part was taken")
        arrays = statistics.arrays()
        header = StateHeader(
            magic=MAGIC,
            target=self.target,
            columns=[*self.columns],
            classes=[name for name, _ in keys],
            floats=[is_float for _, is_float in keys],
            kinds=sorted(self._labels.kinds),
            rows_per_class=self.settings.rows_per_class or 0,
            dropped=statistics.dropped,
            unlabelled=self.unlabelled,
            missing=self.missing,
            contents=[self._contents.get(name, Contents()) for name in self.columns],
            categorical=sorted(self.categorical),
            parts=sorted(self._parts),
        )
        return state_content(header, arrays)


def read_or_collect(
    source: object,
    *,
    target: str | Sequence[object] | npt.NDArray[np.generic],
    weights: Weights = None,
    ignore: Sequence[str] = (),
    settings: LearningSettings,
    name: str | None = None,
    progress: Progress | None = None,
) -> Table | Learner:
    """Read a table to learn from: whole, or piece by piece into a learner.

    What is read piece by piece are files with more than `MOST_CELLS` numbers. The
    learner has the name of the table.

    Args:
        source: The table, as `read_table` takes it.
        target: The column of the classes, or the classes themselves.
        weights: The column of the rows' weights, the weights themselves, or None.
        ignore: Columns to leave out.
        settings: How to learn.
        name: What messages call the table; its path unless given.
        progress: Called with the number of rows so far, and the share read.

    Raises:
        TableError: As `read_table`; or if a table with weights is too large to be read
            whole.
        LearningError: If the target holds measurements and no classes; or if a value
            is missing, and `missing` is `refuse`.
    """
    rows = LearningRows(
        source,
        target=target,
        weights=weights,
        ignore=ignore,
        name=name,
        progress=progress,
    )
    whole, cells, pieces = list[LearningPiece](), 0, iter(rows)
    for piece in pieces:
        whole.append(piece)
        cells += piece.values.size
        if cells > MOST_CELLS and len(whole) > 1:
            break
    else:
        return rows.table(whole)
    if weights is not None:
        raise TableError(
            f"{rows.name} has more than {MOST_CELLS:,} numbers, and weights of rows "
            "need a table that is read whole; repeat its rows instead, or take fewer"
        )
    positions, classes = rows.labels.ordered()
    codes = np.concatenate([piece.codes for piece in whole])
    if rows.target not in rows.categorical:
        refuse_measurements(rows.name, rows.target, classes, positions[codes])
    learner = Learner(rows.target, name=rows.name, settings=settings)
    taken = (whole.pop(0) for _ in range(len(whole)))  # not kept in memory
    learner.collect(rows, itertools.chain(taken, pieces), THREADS)
    rows.refuse_empty()
    return learner


def _difference(what: str, mine: Sequence[str], others: Sequence[str]) -> str:
    """Return why two states do not merge."""
    if what != "columns":
        return f"the states have another {what}: {mine[0]}, and {others[0]}"
    if set(mine) == set(others):
        return (
            f"the states have the columns in another order: {', '.join(mine)}, and "
            f"{', '.join(others)}; name the columns to have one order (--inputs)"
        )
    only = sorted({*mine} ^ {*others})
    return f"the states have other columns: only one of them has {', '.join(only)}"


def refuse_repeated(parts: frozenset[str], others: frozenset[str]) -> None:
    """Raise a ValueError if two states have one that was saved as a part of both."""
    if twice := parts & others:
        raise ValueError(
            f"a state with the digest {min(twice)[:12]} is part of both; "
            "pass repeated=True to count its rows twice"
        )


def state_content(
    header: StateHeader, arrays: Mapping[str, npt.NDArray[np.generic]]
) -> tuple[bytes, str]:
    """Return a state as the content of a file, and its digest."""
    import pyarrow as pa

    digest = state_digest(header, arrays)
    header = msgspec.structs.replace(header, digest=digest)
    lists = {name: pa.array([array]) for name, array in arrays.items()}
    metadata = {b"fuzzytree": msgspec.json.encode(header)}
    table = pa.table(lists).replace_schema_metadata(metadata)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_file(sink, table.schema) as writer:
        writer.write_table(table)
    return sink.getvalue().to_pybytes(), digest


def state_digest(
    header: StateHeader, arrays: Mapping[str, npt.NDArray[np.generic]]
) -> str:
    """Return the digest of a header without its own, and of arrays."""
    bare = msgspec.structs.replace(header, digest="")
    total = hashlib.sha256(msgspec.json.encode(bare))
    for name in sorted(arrays):
        total.update(f"{name} {arrays[name].dtype} {arrays[name].size};".encode())
        total.update(np.ascontiguousarray(arrays[name]).tobytes())
    return total.hexdigest()


def open_state(
    content: bytes, magic: str
) -> tuple[StateHeader, dict[str, npt.NDArray[np.generic]]]:
    """Return the header and the arrays of a state of a kind.

    Raises:
        ValueError: If it is none, is of another kind or version, or is broken.
    """
    import pyarrow as pa

    try:
        with pa.ipc.open_file(pa.py_buffer(content)) as file:
            if file.num_record_batches != 1:
                raise ValueError("is no state: it must have one batch")
            batch = file.get_batch(0)
        batch.validate(full=True)
        text = (batch.schema.metadata or {}).get(b"fuzzytree", b"")
        found = msgspec.json.decode(text, type=_Magic).magic
        if found != magic:
            what = f"is {found!r}, and {magic!r} is read"
            if writer := _WRITERS.get(found):
                what = f"is a state of {writer}, and one of {_WRITERS[magic]} is needed"
            raise ValueError(what)
        header = msgspec.json.decode(text, type=StateHeader)
        arrays: dict[str, npt.NDArray[np.generic]] = {
            name: np.from_dlpack(column.flatten())
            for name, column in zip(batch.schema.names, batch.columns, strict=True)
        }
    except (
        pa.ArrowException,
        msgspec.MsgspecError,
        OSError,
        TypeError,
        AttributeError,
        UnicodeDecodeError,
    ) as error:
        raise ValueError(
            "is no state that `fuzzytree collect` wrote, or is cut short"
        ) from error
    if state_digest(header, arrays) != header.digest:
        raise ValueError("is broken: its digest is another")
    return header, arrays


class _Magic(msgspec.Struct):
    magic: str
