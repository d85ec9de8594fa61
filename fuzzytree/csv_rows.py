"""CSV text in blocks of whole rows; pyarrow parses each into columns of text."""

from __future__ import annotations

import codecs
import csv
import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.cells import EXACT
from fuzzytree.errors import TableError
from fuzzytree.model import counted

if TYPE_CHECKING:
    import pyarrow as pa

IntArray = npt.NDArray[np.int64]

BLOCK = 1 << 20
"""How many bytes are read at a time; more where rows are wide."""

LONGEST = 1 << 26
"""The most bytes that a row may have."""

_ROWS = 64  # of the width of the first one, in a block of wide rows
_NEW_LINE, _RETURN, _QUOTE = b'\n\r"'


class CsvRows(msgspec.Struct, frozen=True, eq=False):
    """Some whole rows of a CSV file.

    Attributes:
        name: What messages call the file.
        content: The text of the rows.
        line: The number of the first line.
        mark: The delimiter.
    """

    name: str
    content: bytes
    line: int
    mark: bytes

    def header(self) -> tuple[str, ...]:
        """Return the cells of the first row.

        Raises:
            TableError: If they are broken CSV.
        """
        ends = self.ends()
        text = self.content[: ends[0] if len(ends) else None].decode()
        try:
            [names] = csv.reader([text], delimiter=self.mark.decode(), strict=True)
        except csv.Error as error:
            raise self._error(0, f"broken CSV: {error}") from error
        return tuple(names)

    def table(self, width: int, wanted: Sequence[int]) -> pa.Table:
        """Return some columns, each cell as the text that it is.

        Empty lines are left out. Without wanted columns the first one is read.

        Raises:
            TableError: If a row has another length, or the text is no UTF-8.
        """
        import pyarrow as pa

        try:
            return self._columns(width, wanted or [0], pa.string())
        except pa.ArrowInvalid as error:
            raise self._refusal(width, error) from error

    def numbers(
        self, width: int, wanted: Sequence[int], skipped: int, missing: Sequence[str]
    ) -> list[npt.NDArray[np.generic]] | None:
        """Return some columns as doubles; None if there is none, or another cell.

        Every cell must be missing or a number below `EXACT`.

        Args:
            width: How many cells a row has.
            wanted: The positions of the columns.
            skipped: How many rows to leave out at the start.
            missing: The texts that stand for NaN.
        """
        import pyarrow as pa

        if not wanted:
            return None
        try:
            table = self._columns(width, wanted, pa.float64(), skipped, missing)
        except pa.ArrowInvalid:
            return None
        result = [number_array(column) for column in table.columns]
        finite = sum(int(np.count_nonzero(np.abs(row) < EXACT)) for row in result)
        known = sum(len(column) - column.null_count for column in table.columns)
        return result if finite == known else None

    def _columns(
        self,
        width: int,
        wanted: Sequence[int],
        kind: pa.DataType,
        skipped: int = 0,
        missing: Sequence[str] = (),
    ) -> pa.Table:
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

        names = list(map(str, range(width)))
        chosen = [names[k] for k in wanted]
        content = self.content
        if content.startswith(codecs.BOM_UTF8):
            content = b"\n" + content  # inside a file it is text, which would be lost
        return arrow_csv.read_csv(
            pa.BufferReader(content),
            arrow_csv.ReadOptions(
                column_names=names,
                block_size=len(content) + 1,
                skip_rows_after_names=skipped,
                use_threads=False,
            ),
            arrow_csv.ParseOptions(
                delimiter=self.mark.decode(), newlines_in_values=True
            ),
            arrow_csv.ConvertOptions(
                column_types=dict.fromkeys(chosen, kind),
                include_columns=chosen,
                null_values=missing,
            ),
        )

    def _refusal(self, width: int, error: Exception) -> TableError:
        """Return which row has another length than the first one, or what it is."""
        starts, stops = self._rows()
        outside = self._outside(np.flatnonzero(self._bytes() == self.mark[0]))
        cells = 1 + np.searchsorted(outside, stops) - np.searchsorted(outside, starts)
        for row in np.flatnonzero(cells != width)[:1].tolist():
            text = (
                f"{counted(int(cells[row]), 'cell')}, and line 1 names "
                f"{counted(width, 'column')}"
            )
            return self._error(int(starts[row]), text)
        if "UTF8" in str(error):
            return no_text(self.name)
        return TableError(f"{self.name}: broken CSV: {error}")

    def line_of(self, row: int) -> int:
        """Return the number of the line in which a row begins."""
        return self._line_at(int(self._rows()[0][row]))

    def ends(self) -> IntArray:
        """Return where rows end: the line breaks that no quotes enclose."""
        text = self._bytes()
        breaks = np.flatnonzero((text == _NEW_LINE) | (text == _RETURN))
        return self._outside(breaks)

    def refuse_open_quote(self) -> None:
        """Raise a TableError if a quote is not closed."""
        quotes = self._quotes()
        if len(quotes) % 2:
            raise self._error(int(quotes[-1]), "broken CSV: a quote is not closed")

    def _rows(self) -> tuple[IntArray, IntArray]:
        """Return where the rows begin and end, without the empty ones."""
        ends = self.ends()
        starts = np.concatenate([[0], ends + 1])
        stops = np.concatenate([ends, [len(self.content)]])
        is_row = stops > starts
        return starts[is_row], stops[is_row]

    def _bytes(self) -> npt.NDArray[np.uint8]:
        return np.frombuffer(self.content, np.uint8)

    def _outside(self, places: IntArray) -> IntArray:
        """Return the places that no quotes enclose."""
        is_outside = np.searchsorted(self._quotes(), places) % 2 == 0
        outside: IntArray = places[is_outside]
        return outside

    def _quotes(self) -> IntArray:
        """Return where quotes open and close, by turns; a doubled one does both.

        Where every quote stands at the end of a cell, or beside another one, their
        order decides which is which. Elsewhere each is examined.

        Raises:
            TableError: If text follows a closing quote.
        """
        text = self._bytes()
        places = np.flatnonzero(text == _QUOTE)
        is_beside = np.diff(places) == 1
        ends = np.zeros(256, np.bool_)
        ends[[_NEW_LINE, _RETURN, self.mark[0]]] = True
        opens, closes = places[0::2], places[1::2]
        is_start = ends[text[opens - 1]] | (opens == 0)
        is_start[1:] |= is_beside[1::2]
        is_stop = ends[text[np.minimum(closes + 1, len(text) - 1)]]
        is_stop |= closes == len(text) - 1
        is_stop[: len(opens) - 1] |= is_beside[1::2]
        if is_start.all() and is_stop.all():
            return places
        return np.array(list(self._quotes_one_by_one(places.tolist())), np.int64)

    def _quotes_one_by_one(self, places: list[int]) -> Iterator[int]:
        ends = (b"", b"\n", b"\r", self.mark)
        is_inside, known = False, frozenset(places)
        result = iter(places)
        for place in result:
            before = self.content[max(place - 1, 0) : place]
            if not is_inside and before not in ends:
                continue  # inside a cell that is not quoted, a quote is text
            if is_inside and place + 1 in known:
                next(result)
                continue
            after = self.content[place + 1 : place + 2]
            if is_inside and after not in ends:
                raise self._error(place, "broken CSV: text follows a closing quote")
            is_inside = not is_inside
            yield place

    def _line_at(self, place: int) -> int:
        return self.line + count_breaks(self.content[:place])

    def _error(self, place: int, text: str) -> TableError:
        return TableError(f"{self.name}:{self._line_at(place)}: {text}")


def no_text(name: str, encoding: str = "") -> TableError:
    """Return that a file is no text of an encoding."""
    text = f"{name}: is no {encoding.upper() or 'UTF-8'} text; save it as UTF-8, or"
    return TableError(f"{text} pass its encoding, such as --encoding cp1252")


def blocks(
    head: bytes, read: Callable[[int], bytes], mark: bytes, name: str
) -> Iterator[CsvRows]:
    """Yield a file in blocks of whole rows; the first one holds the names.

    `head` has been read already; `read` reads so many bytes more, and fewer only at the
    end.

    Raises:
        TableError: If a row is longer than `LONGEST`, or a quote is not closed.
    """
    size = max(BLOCK, min(_ROWS * len(head.split(b"\n", 1)[0]), LONGEST))
    rest, line = head + read(max(size - len(head), 0)), 1
    while True:
        whole = _whole(CsvRows(name, rest, line, mark))
        if whole and not _is_blank(rest[:whole]):
            yield CsvRows(name, rest[:whole], line, mark)
        if whole:
            line += count_breaks(rest[:whole])
            rest = rest[whole:]
        elif len(rest) > LONGEST:
            text = f"a row is longer than {LONGEST} bytes; is a quote not closed?"
            raise TableError(f"{name}:{line}: {text}")
        more = read(max(size, len(rest)))
        if not more:
            break
        rest += more
    if rest and not _is_blank(rest):
        last = CsvRows(name, rest, line, mark)
        last.refuse_open_quote()
        yield last


def _is_blank(text: bytes) -> bool:
    """Return whether all lines are empty; one of blanks is a row."""
    return text.isspace() and not text.strip(b"\r\n")


def _whole(rows: CsvRows) -> int:
    """Return how many bytes of a text are whole rows for sure."""
    text = rows.content
    if b'"' not in text:
        return max(text.rfind(b"\n"), text.rfind(b"\r", 0, -1)) + 1
    ends = rows.ends()
    if len(ends) and text[ends[-1]] == _RETURN and ends[-1] == len(text) - 1:
        ends = ends[:-1]  # what comes next may belong to it
    return int(ends[-1]) + 1 if len(ends) else 0


def count_breaks(text: bytes) -> int:
    r"""Return how many lines end in a text.

    Example:
        >>> count_breaks(b"a\r\nb\rc\n")
        3
    """
    pairs = text.count(b"\r\n") if b"\r" in text else 0
    return text.count(b"\n") + text.count(b"\r") - pairs


def number_array(column: pa.ChunkedArray) -> npt.NDArray[np.generic]:
    """Return a column of integers or floats, NaN where it is null."""
    # pyarrow's to_numpy and pa.scalar would import pandas where it is installed.
    if column.null_count:
        import pyarrow as pa
        import pyarrow.compute as pc

        is_short = column.type == pa.float32()
        try:
            column = column.cast(pa.float32() if is_short else pa.float64())
        except pa.ArrowInvalid:  # doubles would round
            return np.array(column.to_pylist(), np.object_)
        buffer = pa.py_buffer(np.array([math.nan]))
        nan = pa.Array.from_buffers(pa.float64(), 1, [None, buffer])[0]
        column = pc.call_function("coalesce", [column, nan.cast(column.type)])
    parts = [np.from_dlpack(chunk) for chunk in column.chunks]
    return parts[0] if len(parts) == 1 else np.concatenate(parts or [np.empty(0)])
