"""Weights of rows: how often a row counts, and the rest of its weight.

A row of the whole weight k counts as k equal rows, and learning sees no difference. Of
weights that are no whole numbers, or add up to more rows than can be counted, only
their ratios matter: they are divided by their mean. Such a row counts as often as its
weight says when rounded, once at least, and each time with an equal share of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.settings import ClassWeight
from fuzzytree.learning.units import FloatArray, IntArray, tallied

MOST_COPIES = 1 << 24
"""Whole weights that add up to more count by their ratios."""

_SMALLEST = 1e-9
_PIECE = 1 << 16


@dataclass(frozen=True)
class RowWeights:
    """Weights of the rows of a table.

    Attributes:
        copies: How often each row counts; 0 leaves it out.
        shares: The weight of each copy; None where it is 1, as of whole weights.
    """

    copies: IntArray
    shares: FloatArray | None

    def pieces(self) -> Iterator[IntArray]:
        """Yield the positions of the rows, as often as they count, piece by piece."""
        ends = np.cumsum(self.copies)
        total = int(ends[-1]) if len(ends) else 0
        for first in range(0, total, _PIECE):
            places = np.arange(first, min(total, first + _PIECE))
            yield np.searchsorted(ends, places, side="right")


def row_weights(values: FloatArray) -> RowWeights:
    """Return how often each row counts, and with which share each time.

    Args:
        values: Finite, not negative, and not all 0.

    Example:
        >>> row_weights(np.array([2.0, 0.0, 1.0])).copies.tolist()
        [2, 0, 1]
        >>> found = row_weights(np.array([0.5, 1.5, 4.0]))  # their mean is 2
        >>> found.copies.tolist(), found.shares.tolist()
        ([1, 1, 2], [0.25, 0.75, 1.0])
    """
    largest = values.max()
    is_whole = largest <= MOST_COPIES and (values == np.floor(values)).all()
    if is_whole and values.sum() <= MOST_COPIES:
        return RowWeights(values.astype(np.int64), None)
    is_kept = values > 0
    scaled = values / largest  # no sum overflows then
    mean = math.fsum(scaled) / int(np.count_nonzero(is_kept))
    relative = np.where(is_kept, np.maximum(scaled / mean, _SMALLEST), 0.0)
    copies = np.where(is_kept, np.maximum(np.rint(relative), 1.0), 0.0)
    return RowWeights(copies.astype(np.int64), relative / np.maximum(copies, 1.0))


def class_weights(
    wanted: ClassWeight, classes: Sequence[str], codes: IntArray, weights: FloatArray
) -> FloatArray:
    """Return by what the weights of each class are multiplied.

    Args:
        wanted: As in `fuzzytree.learning.LearningSettings`.
        classes: Their names.
        codes: The class of each row.
        weights: Of the rows.

    Example:
        >>> codes = np.array([0, 0, 0, 1])
        >>> class_weights("balanced", ["a", "b"], codes, np.ones(4)).round(2).tolist()
        [0.67, 2.0]
        >>> class_weights({"b": 3.0}, ["a", "b"], codes, np.ones(4)).tolist()
        [1.0, 3.0]
    """
    if wanted == "balanced":
        totals = tallied(codes, weights, len(classes))
        shares = np.where(totals > 0, totals, np.inf) / totals.sum()
        balanced: FloatArray = 1.0 / (np.count_nonzero(totals) * shares)
        return balanced
    return np.array([(wanted or {}).get(name, 1.0) for name in classes], np.float64)
