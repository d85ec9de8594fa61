"""Rows to learn from, as the search for splits needs them, and those of a node.

A bin holds neighbouring values of one column, as many rows as another one; a column of
few different values has one for each. The bins of all columns are numbered through.
The best cut of a node's rows on an axis is scored by the entropy of their classes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.sampling import Sample
from fuzzytree.learning.units import (
    BoolArray,
    ColumnUnits,
    FloatArray,
    IntArray,
    tallied,
)

MOST_SEARCHED = 4_096
"""Splits by one column look at no more columns than this, the most powerful ones."""

MOST_COMBINABLE = 512
"""Combinations look at no more columns than this."""

_BINS = 128
_FAR = 8.0


@dataclass(frozen=True)
class TrainingRows:
    """Rows with their classes and weights.

    Attributes:
        values: As in the table, shape (rows, columns).
        moved: The same in the columns' units.
        codes: The class of each row.
        weights: How many rows of the table each stands for, times its own weight.
        classes: How many classes there are.
        units: The columns' units.
        categories: By column, how many categories without an order it has; 0 for
            numbers.
        searched: The columns that splits look at.
        bins: The number of each row's bin, shape (rows, searched).
        owners: The searched column (its place in `searched`) of each bin.
        starts: The first bin of each searched column, and their number.
        combinable: The columns that combinations may use.
        centres: Of the combinable columns, the origin of standard units.
        spreads: Their units: standard deviations.
        standard: The combinable columns in standard units, outliers drawn in.
    """

    values: FloatArray
    moved: FloatArray
    codes: IntArray
    weights: FloatArray
    classes: int
    units: ColumnUnits
    categories: IntArray
    searched: IntArray
    bins: IntArray
    owners: IntArray
    starts: IntArray
    combinable: IntArray
    centres: FloatArray
    spreads: FloatArray
    standard: FloatArray

    @staticmethod
    def of(
        sample: Sample,
        weights: FloatArray,
        classes: int,
        categories: IntArray,
        combinable: BoolArray,
    ) -> TrainingRows:
        """Prepare a sample.

        Args:
            sample: The rows.
            weights: Of the rows.
            classes: How many classes there are.
            categories: By column, how many categories without an order it has.
            combinable: Which columns combinations may use, as far as they vary.
        """
        moved, units = sample.moved, sample.units
        searched = _varying(sample, weights, MOST_SEARCHED)
        bins, starts = _binned(moved, searched)
        combined = searched[(combinable & units.is_combinable)[searched]]
        if len(combined) > MOST_COMBINABLE:
            leading = _power(sample, weights, combined)
            order = np.argsort(-leading, kind="stable")[:MOST_COMBINABLE]
            combined = np.sort(combined[order])
        chosen = moved[:, combined]
        centres, spreads = chosen.mean(axis=0), chosen.std(axis=0)
        spreads = np.where(spreads > 0, spreads, 1.0)
        standard = np.clip((chosen - centres) / spreads, -_FAR, _FAR)
        return TrainingRows(
            sample.rows,
            moved,
            sample.codes,
            weights / weights.mean(),
            classes,
            units,
            categories,
            searched,
            bins,
            np.repeat(np.arange(len(searched)), np.diff(starts)),
            starts,
            combined,
            centres,
            spreads,
            standard,
        )

    @property
    def size(self) -> int:
        """How many rows there are."""
        return len(self.codes)


def _varying(sample: Sample, weights: FloatArray, most: int) -> IntArray:
    """Return the columns that vary, the most powerful ones if they are too many."""
    lows, highs = sample.moved.min(axis=0), sample.moved.max(axis=0)
    found = np.flatnonzero(sample.units.is_sound & (lows < highs)).astype(np.int64)
    if len(found) <= most:
        return found
    order = np.argsort(-_power(sample, weights, found), kind="stable")[:most]
    return np.sort(found[order])


def _power(sample: Sample, weights: FloatArray, columns: IntArray) -> FloatArray:
    """Return how much of each column's variance lies between the classes."""
    values = sample.moved[:, columns]
    starts = np.flatnonzero(np.diff(sample.codes, prepend=-1))
    sizes = np.add.reduceat(weights, starts)[:, None]
    sums = np.add.reduceat(values * weights[:, None], starts, axis=0)
    middle = sums.sum(axis=0) / sizes.sum()
    between = (sizes * (sums / sizes - middle) ** 2).sum(axis=0) / sizes.sum()
    total = values.var(axis=0)
    return np.where(total > 0, between / np.where(total > 0, total, 1.0), 0.0)


def _binned(values: FloatArray, searched: IntArray) -> tuple[IntArray, IntArray]:
    bins = np.empty((len(values), len(searched)), np.int64)
    starts = np.zeros(len(searched) + 1, np.int64)
    for place, column in enumerate(searched.tolist()):
        ordered = np.sort(values[:, column])
        is_last = np.ones(len(ordered), bool)
        is_last[:-1] = ordered[1:] > ordered[:-1]
        ends = ordered[is_last]
        if len(ends) > _BINS:
            ends = np.unique(
                ordered[np.arange(1, _BINS + 1) * len(ordered) // _BINS - 1]
            )
        bins[:, place] = starts[place] + np.searchsorted(ends, values[:, column])
        starts[place + 1] = starts[place] + len(ends)
    return bins, starts


DIGITS = 9
"""Scores are rounded to so many, so that equal ones are equal on every machine."""

_FEW_CLASSES = 7
_PLACES = 512
_CELLS = 1 << 18


@dataclass(frozen=True)
class SplitRules:
    """What a split must keep to.

    Attributes:
        min_rows: How many rows a branch needs at least.
        columns: How many columns a node looks at, at most.
        entry: The smallest partial F of a further column.
        shrinkage: Of the scatter's off-diagonals.
        costs: Per column.
    """

    min_rows: int
    columns: int
    entry: float
    shrinkage: float
    costs: FloatArray


@dataclass(frozen=True)
class Clouds:
    """What all rows of a tree say of its classes.

    Attributes:
        scatter: Within the classes, in standard units, shape (columns, columns).
        sizes: The weight of each class.
    """

    scatter: FloatArray
    sizes: FloatArray


@dataclass(frozen=True)
class Chosen:
    """The rows of a node, with its classes numbered from 0."""

    rows: TrainingRows
    at: IntArray
    codes: IntArray
    weights: FloatArray
    classes: int

    @staticmethod
    def of(rows: TrainingRows, at: IntArray) -> Chosen:
        """Return the node of some rows."""
        present, codes = np.unique(rows.codes[at], return_inverse=True)
        return Chosen(rows, at, codes, rows.weights[at], len(present))


def information(counts: FloatArray) -> FloatArray:
    """Return minus the entropy of groups, in nats times their size.

    Args:
        counts: The weight of each class in each group, shape (..., classes).
    """
    sizes = _over_classes(counts)
    found: FloatArray = _over_classes(_own(counts)) - _own(sizes)
    return found


def _over_classes(numbers: FloatArray) -> FloatArray:
    """Return the sum over the last axis, of few classes one after another: faster."""
    if numbers.shape[-1] > _FEW_CLASSES:
        return np.asarray(numbers.sum(axis=-1), np.float64)
    total = numbers[..., 0].copy()
    for code in range(1, numbers.shape[-1]):
        total += numbers[..., code]
    return np.asarray(total, np.float64)


def _own(numbers: FloatArray) -> FloatArray:
    found: FloatArray = numbers * np.log(np.maximum(numbers, 1e-300))
    return found


def best_cut(
    node: Chosen, values: FloatArray, min_rows: int
) -> tuple[float, float] | None:
    """Return the best score of a cut on an axis, and the cut.

    Args:
        node: The rows.
        values: Of the rows on the axis.
        min_rows: How many rows must lie on either side.
    """
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    ends = np.flatnonzero(ordered[1:] > ordered[:-1])
    size = len(values)
    ends = ends[(ends + 1 >= min_rows) & (size - ends - 1 >= min_rows)]
    if not len(ends):
        return None
    cells, weights = node.codes[order], node.weights[order]
    few = max(16, min(_PLACES, _CELLS // node.classes))
    while len(ends) > few:
        coarse = ends[np.linspace(0, len(ends) - 1, few).astype(np.int64)]
        best = int(_cut_scores(coarse, cells, weights, node.classes).argmax())
        low, high = coarse[max(best - 1, 0)], coarse[min(best + 1, few - 1)]
        ends = ends[(ends >= low) & (ends <= high)]
        if len(ends) >= 2 * size // few:
            break
    scores = _cut_scores(ends, cells, weights, node.classes)
    best = int(scores.argmax())
    low, high = float(ordered[ends[best]]), float(ordered[ends[best] + 1])
    return float(scores[best]), between(low, high)


def between(low: float, high: float) -> float:
    """Return a cut between two values: not below the first, below the second."""
    middle = low / 2 + high / 2
    return middle if low <= middle < high else low


def _cut_scores(
    ends: IntArray, codes: IntArray, weights: FloatArray, classes: int
) -> FloatArray:
    """Return the scores of cuts behind some places of ordered rows."""
    pieces = np.searchsorted(ends, np.arange(len(codes)))
    cells = pieces * classes + codes
    counts = tallied(cells, weights, (len(ends) + 1) * classes)
    below = np.cumsum(counts.reshape(-1, classes), axis=0)
    above = np.maximum(below[-1] - below[:-1], 0.0)
    return np.round(information(below[:-1]) + information(above), DIGITS)
