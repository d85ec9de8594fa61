"""Whether a table suits learning: a target of classes, and columns that describe."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.errors import LearningError

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray
    from fuzzytree.tables import Table

_MANY = 20
"""So many classes are usual, even where their names are numbers with fractions."""

_ROWS_PER_CLASS = 5
"""With fewer rows for each of many classes there is little to learn from."""

_FEW_ROWS = 20
"""In a table with fewer rows, consecutive numbers may be measurements."""

_ID = re.compile(r"(?:.*[^A-Za-z])?(?i:id|idx|index|uuid|guid)|.*[a-z]I[Dd]", re.DOTALL)


def remarks(table: Table, ignoring: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    """Yield a column and a remark on it, for each that looks unsuitable.

    Args:
        table: The table.
        ignoring: Returns how to leave a column out, such as `--ignore id`.

    Raises:
        LearningError: If the target holds measurements and no classes: its values are
            numbers, and two of these are true: there are more than 20 different ones,
            some have fractions, more than half of the rows have one to themselves.
    """
    _refuse_measurements(table)
    yield from table.remarks
    rows, classes = len(table.codes), len(table.classes)
    if classes > _MANY and rows < _ROWS_PER_CLASS * classes:
        text = f"{classes} classes in {rows} rows, {rows / classes:.1f} rows for each"
        yield table.target or "the target", text
    for name, values in zip(table.columns, table.values, strict=True):
        if _is_identifier(name, values):
            text = "a different whole number in each row, as an identifier has"
            yield name, f"{text}; {ignoring(name)} leaves it out"


def _refuse_measurements(table: Table) -> None:
    numbers = [*map(_number, table.classes)]
    if not all(map(math.isfinite, numbers)):
        return
    has_fractions = any(not number.is_integer() for number in numbers)
    single = int(np.count_nonzero(np.bincount(table.codes) == 1))
    is_spread = 2 * single > len(table.codes)
    is_many = len(numbers) > _MANY
    if has_fractions + is_spread + is_many >= 2:
        of = f" {table.target!r}" if table.target else ""
        raise LearningError(
            f"{table.name}: the target{of} is continuous, with {len(numbers)} "
            f"different numbers in {len(table.codes)} rows, and a tree predicts "
            "classes; divide the numbers into ranges and learn these"
        )


def _is_identifier(name: str, values: FloatArray) -> bool:
    """Return whether a column numbers the rows, or has the name of an identifier."""
    low, high = float(values.min()), float(values.max())
    is_run = high - low == len(values) - 1 and len(values) >= _FEW_ROWS
    if not (is_run or _ID.fullmatch(name)) or not math.isfinite(high - low):
        return False
    is_whole = bool((values == np.floor(values)).all())
    return is_whole and len(np.unique(values)) == len(values)


def _number(text: str) -> float:
    """Return a class's name as a number, with a decimal point or comma, or NaN."""
    if not re.fullmatch(r"[-+.,0-9eE]+", text):
        return math.nan
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return math.nan
