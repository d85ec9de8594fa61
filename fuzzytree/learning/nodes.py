"""A node in the making: its rows, and the best cut on an axis by their classes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.rows import TrainingRows
from fuzzytree.learning.units import FloatArray, IntArray, tallied

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
