"""What learning counted and repaired, and whether a table suits learning."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.errors import LearningError
from fuzzytree.model import Result

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray
    from fuzzytree.tables import Table


class LearningReport(Result, msgspec.Struct, frozen=True, kw_only=True):
    """How a model came about, and how its table departed from the paper's assumptions.

    Attributes:
        mode: `default` or `paper`.
        rows: Rows that were learnt from.
        rows_dropped: Rows left out: the class is missing, or in paper mode a value is
            missing or not finite.
        rows_filled: Rows with a missing value, which a stand-in took the place of.
        rows_sampled: Rows kept for clusters, combinations and window counts.
        sampled: Of each class of which not all rows were kept, how many were, and how
            many there are.
        classes_without_rows: Classes that nothing was learnt about.
        features_ignored: Columns left out: constant, or its range overflows.
        patterns: Patterns by class name.
        patterns_refused: Clusters that were not made, for want of rows.
        single_rows: Patterns of one row.
        zero_spreads: Pairs of pattern and variable whose values are all equal; their
            sets are given a tenth of the spread within the other patterns.
        rules: How many rules were learnt, one for each class, in place of a tree.
        leaves: Leaves of the tree; at most one per pattern.
        features_per_node: How many features each node needs, in node order.
        inseparable: Patterns that share a leaf though their classes differ.
        levels_raised: Levels passed over until the threshold T split a node.
        reversals: Far intervals, where a wide set overtakes again, left out.
        sets: Fitted sets.
        off_peak: Sets in which another window holds more than the middle one.
        empty_centre: Sets whose middle window is empty.
        clipped: Points above 1, set to 1.
        lowered: Points above an inner neighbour, lowered to it.
        overshooting: Sides whose polynomial leaves [0, 1] between its points.
        rising: Sides whose polynomial rises somewhere.
        largest_flank_error: Largest difference of a relative term from its ratio.
        chosen: What inner validation chose, by setting; empty if it chose nothing.
        inner_accuracy: Share of right answers in inner validation, if there was one.
    """

    mode: str
    rows: int
    rows_dropped: int
    rows_sampled: int
    rows_filled: int = 0
    sampled: dict[str, tuple[int, int]] = {}
    classes_without_rows: tuple[str, ...]
    features_ignored: tuple[str, ...]
    patterns: dict[str, int]
    rules: int = 0
    single_rows: int = 0
    zero_spreads: int = 0
    leaves: int = 0
    features_per_node: tuple[int, ...] = ()
    sets: int
    off_peak: int = 0
    empty_centre: int = 0
    clipped: int = 0
    lowered: int = 0
    overshooting: int = 0
    rising: int = 0
    largest_flank_error: float = 0.0
    patterns_refused: int = 0
    inseparable: int = 0
    levels_raised: int = 0
    reversals: int = 0
    chosen: dict[str, float | str] = {}
    inner_accuracy: float | None = None

    @property
    def sampling(self) -> str:
        """Of which classes not all rows were kept, in words; empty if all were."""
        parts = [
            f"{kept:,} of {rows:,} rows of class {name!r}"
            for name, (kept, rows) in self.sampled.items()
        ]
        rest = len(parts) - _SHOWN
        parts[_SHOWN:] = [f"{rest} more class{'es' * (rest > 1)}"] * (rest > 0)
        return ", ".join(parts)

    @property
    def repairs(self) -> tuple[str, ...]:
        """What had to be repaired in the fitted sets, with counts; empty if nothing."""
        lines = (_counted(self, name, text) for name, text in _REPAIRS.items())
        return tuple(line for line in lines if line)

    def __str__(self) -> str:
        """Show the facts that are not zero, one a line."""
        lines = [f"{self.rows} rows, {sum(self.patterns.values())} patterns"]
        nodes = ", ".join(map(str, self.features_per_node)) or "none"
        tree = f"{self.leaves} leaves; features per node: {nodes}"
        lines.append(f"{self.rules} rules, one for each class" if self.rules else tree)
        if self.sampled:
            lines.append(f"learnt from {self.sampling}")
        if self.features_ignored:
            lines.append(f"columns ignored: {', '.join(self.features_ignored)}")
        lines += [_counted(self, name, text) for name, text in _TABLE.items()]
        lines += self.repairs
        lines = [line for line in lines if line]
        if self.largest_flank_error:
            error = f"{self.largest_flank_error:.2g}"
            lines.append(f"relative terms: lines within {error} of the sets' ratio")
        lines.extend(f"chosen {name}: {value}" for name, value in self.chosen.items())
        return "\n".join(lines)


def _counted(report: LearningReport, name: str, text: str) -> str:
    count: int = getattr(report, name)
    return f"{text}: {count}" if count else ""


_TABLE = {
    "rows_dropped": "rows dropped, a value or the class is missing",
    "rows_filled": "rows with a missing value, which a stand-in took the place of",
    "patterns_refused": "patterns refused, too few rows",
    "single_rows": "patterns of one row",
    "inseparable": "patterns of different classes that nothing separates",
    "levels_raised": "levels passed over until the threshold split a node",
}
"""What was left out of the table, or could not be separated."""

_REPAIRS = {
    "zero_spreads": "sets whose values are all equal",
    "reversals": "far reversals left out",
    "off_peak": "sets with a fuller window than the middle one",
    "empty_centre": "sets with an empty middle window",
    "clipped": "points clipped to 1",
    "lowered": "points lowered to an inner neighbour",
    "overshooting": "sides whose polynomial leaves [0, 1]",
    "rising": "sides whose polynomial rises",
}
"""Where the data departed from what the paper assumes of fuzzy sets."""


_SHOWN = 2
"""Classes that are named where a report counts their rows."""

_MANY = 20
"""So many classes are usual, even where their names are numbers with fractions."""

_CODES = 50
"""So many whole numbers may be codes; with more, few rows for each and some left out,
they are measurements."""

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
            some have fractions, more than half of the rows have one to themselves; or
            there are more than 50 with gaps between them and less than 50 rows each.
    """
    if not table.is_categorical:
        refuse_measurements(table.name, table.target, table.classes, table.codes)
    yield from table.remarks
    rows, classes = table.rows, len(table.classes)
    if classes > _MANY and rows < _ROWS_PER_CLASS * classes:
        text = f"{classes} classes in {rows} rows, {rows / classes:.1f} rows for each"
        yield table.target or "the target", text
    for name, values in zip(table.columns, table.values, strict=True):
        if name in table.categories:
            yield from _rare(name, values, table.categories[name])
        elif name not in table.dates and _is_identifier(name, values):
            text = "a different whole number in each row, as an identifier has"
            yield name, f"{text}; {ignoring(name)} leaves it out"


def refuse_measurements(
    name: str, target: str, classes: Sequence[str], codes: IntArray
) -> None:
    """Raise a LearningError if a target holds measurements or identifiers."""
    of = f" {target!r}" if target else ""
    numbers = [*map(_number, classes)]
    if not all(map(math.isfinite, numbers)):
        if len(classes) == len(codes) > _FEW_ROWS:
            text = f"has another class in each of {len(codes)} rows"
            raise LearningError(
                f"{name}: the target{of} {text}, as an identifier has, and nothing can "
                "be learnt about a class of one row; name the column of the classes"
            )
        return
    has_fractions = any(not number.is_integer() for number in numbers)
    single = int(np.count_nonzero(np.bincount(codes) == 1))
    is_spread = 2 * single > len(codes)
    is_many = len(numbers) > _MANY
    is_thin = len(numbers) > _CODES and len(codes) < _CODES * len(numbers)
    has_gaps = max(numbers) - min(numbers) >= len(numbers)
    if has_fractions + is_spread + is_many >= 2 or (target and is_thin and has_gaps):
        column = shlex.quote(target)
        insist = f", or pass --categorical {column} if each is a class" if of else ""
        raise LearningError(
            f"{name}: the target{of} is continuous, with {len(numbers)} "
            f"different numbers in {len(codes)} rows, and a tree predicts "
            f"classes; divide the numbers into ranges and learn these{insist}"
        )


def _rare(
    name: str, values: FloatArray, categories: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Yield a remark on categories that occur once, of which little can be learnt."""
    known = values[np.isfinite(values)].astype(np.int64)
    single = np.flatnonzero(np.bincount(known, minlength=len(categories)) == 1)
    if len(single):
        text = (
            "a category that occurs once"
            if len(single) == 1
            else (f"{len(single)} categories that occur once, such as")
        )
        yield name, f"{text}: {categories[single[0]]}"


def _is_identifier(name: str, values: FloatArray) -> bool:
    """Return whether a column numbers the rows, or has the name of an identifier."""
    if not np.isfinite(values).all():
        return False
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
