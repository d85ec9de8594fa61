"""Columns of numbers, truth values, dates and texts, all as numbers.

While a table is read, piece by piece and in any order, it is not known what a column
is: its whole decides. So each cell has a code that depends on the cell alone. A number
is its own code, a truth value is 0 or 1, a date is the days since 1970-01-01 (UTC), and
a text is a NaN whose payload is a hash of it; a missing cell is a NaN without payload.
`Contents` counts the cells of each kind and keeps the different texts; two of them are
merged by adding the counts and joining the texts. When all is read the texts become
categories, sorted unless the column states their order, and codes become positions.
"""

from __future__ import annotations

import datetime
import hashlib
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, cast

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.cells import (
    MISSING,
    REAL,
    distinct_values,
    is_missing,
    number_of,
)

if TYPE_CHECKING:
    from fuzzytree.cells import Cells

Kind = Literal["number", "boolean", "date", "text"]
FloatArray = npt.NDArray[np.float64]
Bits = npt.NDArray[np.uint64]

MOST_CATEGORIES = 10_000
"""The most categories of a column; with more it is left out, like an identifier."""

BOOLEANS = ("False", "True")
"""The categories of a column of truth values; their positions are 0 and 1."""

_LEAST_SHARE = 0.1  # of texts among the cells of a column of text
_FEW = 20  # cells, of which each may have a text of its own
_NAN, _PAYLOAD = 0x7FF8 << 48, (1 << 51) - 1
_DATE = re.compile(
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}"
    r"(?:[T ][0-9]{2}:[0-9]{2}(?::[0-9]{2}(?:\.[0-9]{1,9})?)?"
    r"(?:Z|[+-][0-9]{2}:?[0-9]{2})?)?"
)
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_MICROSECOND = datetime.timedelta(microseconds=1)
_DAY = 86_400_000_000  # microseconds


class Contents(msgspec.Struct, frozen=True):
    """What the cells of a column hold that are not missing.

    Attributes:
        number: How many are numbers.
        boolean: How many are truth values.
        date: How many are dates.
        text: How many are texts.
        other: How many are nothing of the kind.
        texts: The different texts, sorted; None if they are more than
            `MOST_CATEGORIES`.
        order: All categories in the order that the type of the column states; empty
            if parts of the column differ in it.
    """

    number: int = 0
    boolean: int = 0
    date: int = 0
    text: int = 0
    other: int = 0
    texts: tuple[str, ...] | None = ()
    order: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET

    @property
    def is_ordered(self) -> bool:
        """Whether the type of the column states an order of all its texts."""
        return bool(self.order) and {*(self.texts or ())} <= {*(self.order or ())}

    @property
    def cells(self) -> int:
        """How many cells are not missing."""
        return self.number + self.boolean + self.date + self.text + self.other

    def merge(self, other: Contents) -> Contents:
        """Return what two parts of a column hold."""
        texts = self.texts
        if texts is None or other.texts is None:
            texts = None
        elif not {*other.texts} <= {*texts}:
            texts = _bounded({*texts, *other.texts})
        order = self.order if self.cells else other.order
        if self.cells and other.cells and self.order != other.order:
            order = ()
        return Contents(
            self.number + other.number,
            self.boolean + other.boolean,
            self.date + other.date,
            self.text + other.text,
            self.other + other.other,
            texts,
            order,
        )

    def kind(self, *, is_categorical: bool = False) -> Kind | None:
        """Return what the column is; None if its cells do not go together.

        `is_categorical` says that all its cells were read as texts. If not, numbers
        among texts are categories if a tenth of the cells are texts, and truth values
        among numbers are 0 and 1.

        Example:
            >>> Contents(number=90, text=10, texts=("3+",)).kind()
            'text'
            >>> Contents(number=1000, text=3, texts=("?",)).kind() is None
            True
        """
        is_mixed = self.boolean and {"0", "1"} & {*(self.texts or ())}
        if self.other or is_mixed:
            return None
        if is_categorical:
            return "text" if self.text else "boolean"
        if self.text:
            is_alone = not (self.date or (self.boolean and self.number))
            is_much = self.text >= _LEAST_SHARE * self.cells
            return "text" if is_alone and is_much else None
        if self.date:
            return None if self.number or self.boolean else "date"
        return "boolean" if self.boolean and not self.number else "number"

    def is_identifier(self, *, is_categorical: bool = False) -> bool:
        """Return whether there are too many texts, or one for every second cell.

        The latter is no reason if all cells were read as texts because somebody said
        so.
        """
        if self.texts is None:
            return True
        return not is_categorical and 2 * len(self.texts) > self.text >= _FEW


def _bounded(texts: set[str]) -> tuple[str, ...] | None:
    return tuple(sorted(texts)) if len(texts) <= MOST_CATEGORIES else None


def coded(
    cells: Cells, *, is_categorical: bool = False
) -> tuple[FloatArray, Contents, dict[str, int]]:
    """Return the codes of cells, what they hold, and the first row of each kind.

    Args:
        cells: The cells of a column.
        is_categorical: Whether numbers, dates and truth values are texts as well.

    Example:
        >>> codes, contents, first = coded(["1", "", "x"])
        >>> codes.tolist(), contents.number, contents.texts, first
        ([1.0, nan, nan], 1, ('x',), {'number': 0, 'text': 2})
    """
    if isinstance(cells, np.ndarray) and not is_categorical:
        kind = cells.dtype.kind
        if kind in REAL:
            return _plain(cells.astype(np.float64), "boolean" if kind == "b" else "")
        if kind == "M":
            return _plain(_days_of(cells), "date")
    indices, values = distinct_values(cells)
    read = [_read(value, is_categorical=is_categorical) for value in values]
    kinds = [kind for kind, _ in read]
    numbers = np.array([one if isinstance(one, float) else math.nan for _, one in read])
    texts = {k: one for k, (_, one) in enumerate(read) if isinstance(one, str)}
    numbers[[*texts]] = text_codes([*texts.values()])
    counts: dict[str, int] = {}
    first: dict[str, int] = {}
    of_value = np.bincount(indices, minlength=len(values)).tolist()
    for kind in filter(None, dict.fromkeys(kinds)):
        chosen = [k for k, one in enumerate(kinds) if one == kind]
        counts[kind] = sum(of_value[k] for k in chosen)
        if counts[kind]:
            first[kind] = int(np.isin(indices, chosen).argmax())
    contents = Contents(
        **counts, texts=_bounded({*texts.values()}), order=msgspec.UNSET
    )
    return numbers[indices], contents, first


def _plain(
    values: FloatArray, kind: str
) -> tuple[FloatArray, Contents, dict[str, int]]:
    """Return numbers of one kind, with all missing ones alike."""
    is_none = np.isnan(values)
    count, kind = len(values) - int(np.count_nonzero(is_none)), kind or "number"
    if count < len(values):
        values = np.where(is_none, math.nan, values)
    first = {kind: int((~is_none).argmax())} if count else {}
    return values, Contents(**{kind: count}, texts=(), order=msgspec.UNSET), first


def _read(value: object, *, is_categorical: bool) -> tuple[str, float | str]:
    """Return the kind of a cell, empty if it is missing, and its number or text."""
    if is_missing(value) or (
        isinstance(value, str) and value.strip().lower() in MISSING
    ):
        return "", math.nan
    text = text_of(value)
    if text in BOOLEANS:
        return "boolean", float(BOOLEANS.index(text))
    if is_categorical:
        return "text", text
    number = number_of(value)
    if number is not None:
        return "number", number
    days = days_of(value)
    if days is not None:
        return "date", days
    return ("text", text) if isinstance(value, str) else ("other", math.nan)


def text_of(value: object) -> str:
    """Return a cell as the text of a category; truth values are `False` and `True`.

    Example:
        >>> [text_of(value) for value in (" a ", 1.0, 0.5, "true", "017")]
        ['a', '1', '0.5', 'True', '017']
    """
    if isinstance(value, str):
        text = value.strip()
        return text.title() if text.lower() in ("true", "false") else text
    if isinstance(value, float | np.floating):
        return number_text(float(value))
    return str(value)


def number_text(number: float) -> str:
    """Return a number as the text of a category: a whole one without a fraction."""
    is_whole = number.is_integer() and abs(number) < 1e15
    return str(int(number)) if is_whole else repr(number)


def days_of(value: object) -> float | None:
    """Return a date as days since 1970-01-01 (UTC), None if it is none.

    Example:
        >>> days_of("1970-01-03T12:00"), days_of("1970-13-01")
        (2.5, None)
    """
    if isinstance(value, str):
        text = value.strip()
        if not _DATE.fullmatch(text):
            return None
        try:
            value = datetime.datetime.fromisoformat(text)
        except ValueError:
            return None
    if isinstance(value, np.datetime64):
        return float(_days_of(np.array([value]))[0])
    if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
        value = datetime.datetime(value.year, value.month, value.day)
    if not isinstance(value, datetime.datetime):
        return None
    if value.tzinfo is None:
        value = value.replace(tzinfo=datetime.UTC)
    return ((value - _EPOCH) // _MICROSECOND) / _DAY


def _days_of(times: npt.NDArray[np.generic]) -> FloatArray:
    micros = times.astype("datetime64[us]")
    days: FloatArray = micros.astype(np.int64) / np.float64(_DAY)
    days[np.isnat(micros)] = math.nan
    return days


def text_codes(texts: Sequence[str]) -> FloatArray:
    """Return the code of each text: a number's own, or a NaN with a hash of the text.

    The truth values `False` and `True` are 0 and 1, as in a column of truth values.

    Example:
        >>> text_codes(["2", "02"]).tolist()
        [2.0, nan]
    """
    codes = np.empty(len(texts))
    bits: Bits = codes.view(np.uint64)
    for place, text in enumerate(texts):
        is_truth = text in BOOLEANS
        number = float(BOOLEANS.index(text)) if is_truth else number_of(text)
        is_own = number is not None and math.isfinite(number)
        if is_truth or (is_own and number_text(cast("float", number)) == text):
            codes[place] = cast("float", number)
            continue
        digest = hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=8)
        bits[place] = _NAN | (int.from_bytes(digest.digest()) & _PAYLOAD or 1)
    return codes


def is_missing_code(values: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which cells are missing or infinite, and no text."""
    bits: Bits = np.ascontiguousarray(values).view(np.uint64)
    is_text = np.isnan(values) & ((bits & np.uint64(_PAYLOAD)) != 0)
    missing: npt.NDArray[np.bool_] = ~(np.isfinite(values) | is_text)
    return missing


def categories_of(contents: Contents, numbers: Iterable[float] = ()) -> tuple[str, ...]:
    """Return the categories of a column of text or truth values, sorted.

    Whole numbers stand first, by their size.

    Args:
        contents: What the column holds.
        numbers: The numbers that occur in it.

    Example:
        >>> categories_of(Contents(number=2, text=1, texts=("3+",)), [2.0, 10.0])
        ('2', '10', '3+')
    """
    texts = {*(contents.texts or ()), *(BOOLEANS if contents.boolean else ())}
    texts |= {number_text(one + 0.0) for one in numbers if math.isfinite(one)}
    return tuple(sorted(texts, key=text_order))


def text_order(text: str) -> tuple[bool, float, str]:
    """Return a key that sorts texts: whole numbers by size, then others by alphabet."""
    is_whole = re.fullmatch(r"0|-?[1-9][0-9]{0,14}", text) is not None
    return (not is_whole, float(text) if is_whole else 0.0, text)


def positions(codes: FloatArray, categories: Sequence[str]) -> FloatArray:
    """Return the position of each code's category; NaN where it has none.

    Example:
        >>> positions(text_codes(["b", "x", "a"]), ("a", "b")).tolist()
        [1.0, nan, 0.0]
    """
    plus = np.where(np.isnan(codes), codes, codes + 0.0)
    bits: Bits = np.ascontiguousarray(plus).view(np.uint64)
    known: Bits = text_codes(categories).view(np.uint64)
    order = np.argsort(known)
    place = np.searchsorted(known[order], bits).clip(max=len(known) - 1)
    is_known = known[order][place] == bits
    return np.where(is_known, order[place], math.nan)


def placer(categories: Sequence[str]) -> Callable[[object], float | None]:
    """Return a function from a cell to the position of its category.

    A missing cell has NaN, an unknown category None. Numbers, truth values and their
    texts are one: 1, 1.0 and "1", True and "true".

    Example:
        >>> place = placer(("1", "b"))
        >>> place(1.0), place(" b"), place(""), place("c")
        (0.0, 1.0, nan, None)
    """
    place: Mapping[str, float] = {name: float(k) for k, name in enumerate(categories)}
    is_boolean = tuple(categories) == BOOLEANS

    def placed(value: object) -> float | None:
        if not _read(value, is_categorical=True)[0]:
            return math.nan
        text = text_of(value)
        found = place.get(text)
        number = number_of(text) if found is None else None
        if number is not None and is_boolean:
            return number if number in (0.0, 1.0) else None
        if number is not None:
            return place.get(number_text(number))
        return found

    return placed
