"""Values of inputs in the words of a table: categories, truth values, dates."""

from __future__ import annotations

import datetime
import math
from fractions import Fraction
from typing import Any, NamedTuple

DATE_UNIT = "days since 1970-01-01"
MISSING = "missing"  # the word for the stand-in of a missing value
MOST_LISTED = 4096  # beyond, shares are those of lengths, and not of counts
_EPOCH = datetime.datetime(1970, 1, 1)
_DAY = 86_400_000_000  # microseconds
_MOST_DAYS = 4e6  # beyond, years have more than four digits

Column = Any
"""What a model says about an input: its `categories` and `unit`."""

Side = Any
"""The values that rows can have, as a `DomainSide` of an audit or of its file."""


class Stretch(NamedTuple):
    """The values of rows in an interval: from low to high, and perhaps the stand-in."""

    low: Fraction | None  # None if the stand-in is all
    high: Fraction | None
    has_missing: bool  # as one more value

    def ends(self, side: Side) -> tuple[Fraction, Fraction] | None:
        """Return the least and the largest value; None if there is none."""
        ends = [end for end in (self.low, self.high) if end is not None]
        if self.has_missing and side.missing is not None:
            ends.append(Fraction(side.missing))
        return (min(ends), max(ends)) if ends else None


def is_plain(side: Side | None) -> bool:
    """Return whether rows can have every number of a side and no other."""
    return side is None or not (
        side.values or side.is_whole or side.missing is not None
    )


def side_values(side: Side | None) -> list[Fraction]:
    """Return the values of a side one by one, ascending; none of numbers or of many."""
    if side is None or not (side.values or side.is_whole):
        return []
    values = {*map(Fraction, side.values)}
    if side.is_whole and side.high - side.low < MOST_LISTED:
        values = {*map(Fraction, range(int(side.low), int(side.high) + 1))}
    if values and side.missing is not None:
        values.add(Fraction(side.missing))
    return sorted(values)


def stretch(side: Side, low: float | Fraction, high: float | Fraction) -> Stretch:
    """Return the values of rows from low to high."""
    first = max(Fraction(side.low), Fraction(low))
    last = min(Fraction(side.high), Fraction(high))
    inside = [first, last]
    if side.values:
        inside = [v for v in map(Fraction, side.values) if first <= v <= last]
    elif side.is_whole:
        inside = [Fraction(math.ceil(first)), Fraction(math.floor(last))]
    if inside and inside[0] > inside[-1]:
        inside = []
    stand_in = side.missing
    has_missing = stand_in is not None and low <= stand_in <= high
    if has_missing and stand_in is not None and inside:
        is_listed = not side.values or stand_in in side.values
        is_listed &= not side.is_whole or stand_in.is_integer()
        has_missing = not (inside[0] <= stand_in <= inside[-1] and is_listed)
    if not inside:
        return Stretch(None, None, has_missing)
    return Stretch(inside[0], inside[-1], has_missing)


def value_word(column: Column, side: Side | None, value: Fraction) -> str:
    """Return a value as the table has it; empty of a number with a fraction."""
    if side is None or (column.unit != DATE_UNIT and is_plain(side)):
        return ""
    if value == side.missing and stretch(side, value, value).has_missing:
        return MISSING
    if column.categories or column.unit == DATE_UNIT:
        return table_word(column, value)
    return f"{value} {column.unit}".rstrip() if side.is_whole else ""


def table_word(column: Column, value: Fraction | float) -> str:
    """Return the category or the date that a value is; empty of a number."""
    if column.categories:
        is_one = value in range(len(column.categories))
        return column.categories[int(value)] if is_one else ""
    is_date = column.unit == DATE_UNIT and math.isfinite(value)
    return _date(Fraction(value)) if is_date else ""


def minute_word(column: Column, value: float) -> str:
    """Return a category or date for people: the day of whole ones, else the minute."""
    if column.unit == DATE_UNIT and abs(value) < _MOST_DAYS:
        value = math.floor(value) if column.is_whole else round(value * 1440) / 1440
    return table_word(column, value).removesuffix(":00")


def interval_word(
    column: Column, low: float | None, high: float | None, most: str = "<="
) -> str:
    """Return the categories or dates above low and up to high; empty of numbers.

    An end is None where there is none; `most` is the sign for "up to".
    """
    if column.categories:
        first, last = (math.inf if end is None else end for end in (low, high))
        first = -first if low is None else first
        inside = [k for k in range(len(column.categories)) if first < k <= last]
        words = [MISSING] if column.missing == -1.0 and first < -1.0 else []
        return " or ".join([*words, *(column.categories[k] for k in inside)])
    ends = [end for end in (low, high) if end is not None]
    words = [minute_word(column, end) for end in ends]
    if not words or not all(words):
        return ""
    if low is None:
        return f"{most} {words[0]}"
    return f"> {' to '.join(words)}"


def _date(days: Fraction) -> str:
    """Return a date, with its time unless it is midnight; empty if it has no year."""
    try:
        moment = _EPOCH + datetime.timedelta(microseconds=round(days * _DAY))
    except OverflowError:
        return ""
    return moment.date().isoformat() if days.denominator == 1 else moment.isoformat()


def stretch_word(
    column: Column, side: Side | None, low: float | Fraction, high: float | Fraction
) -> str:
    """Return the values of rows from low to high in words; empty of plain numbers."""
    if side is None or (column.unit != DATE_UNIT and is_plain(side)):
        return ""
    part = stretch(side, low, high)
    words: list[str] = []
    if part.low is not None and part.high is not None:
        ends = [value_word(column, side, end) for end in (part.low, part.high)]
        if column.categories:
            codes = [
                v for v in map(Fraction, side.values) if part.low <= v <= part.high
            ]
            words = [value_word(column, side, code) for code in codes]
        elif all(ends):
            words = [" to ".join(dict.fromkeys(ends))]
        elif not part.has_missing:
            return ""
        else:
            words = [f"{float(part.low):.6g} to {float(part.high):.6g}"]
    words += [MISSING] * part.has_missing
    return " or ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)
