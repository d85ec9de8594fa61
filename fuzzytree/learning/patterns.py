"""Fuzzy pattern vectors (paper, 2.3 step 2): what stands for a class.

A class has one pattern, or several if it has several shapes: clusters of its rows,
found by bisecting k-means in units of the features' spreads within classes. No step is
random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fuzzytree.learning.sampling import Sample
from fuzzytree.learning.statistics import Moments, grouped_moments
from fuzzytree.learning.units import ColumnUnits, FloatArray, IntArray

_ROUNDS = 25


@dataclass(frozen=True)
class Patterns:
    """Every pattern, with the sample rows that it is made of.

    All numbers but `rows` are in the columns' units (`units`).

    Attributes:
        labels: The class of each pattern, shape (patterns,).
        numbers: Which pattern of its class it is, from 1.
        weights: How many rows of the table each stands for.
        moments: Means, spreads, lows and highs, shape (patterns, features).
        rows: The sample as in the table, ordered by pattern; shape (rows, features).
        moved: The same rows in the columns' units.
        owners: The pattern of each sample row.
        row_weights: How many rows of the table each sample row stands for.
        starts: Where each pattern's rows begin, and their end; shape (patterns + 1,).
        units: The columns' units.
        scale: The pooled spread within the classes, per feature.
        usable: The features that are not constant and do not overflow.
    """

    labels: IntArray
    numbers: IntArray
    weights: FloatArray
    moments: Moments
    rows: FloatArray
    moved: FloatArray
    owners: IntArray
    row_weights: FloatArray
    starts: IntArray
    units: ColumnUnits
    scale: FloatArray
    usable: IntArray

    @property
    def size(self) -> int:
        """How many patterns there are."""
        return len(self.labels)

    def members(self, patterns: IntArray) -> IntArray:
        """Return the numbers of the sample rows of some patterns, in pattern order."""
        first = self.starts[patterns]
        counts = self.starts[patterns + 1] - first
        before = np.cumsum(counts) - counts
        members: IntArray = np.repeat(first - before, counts)
        members += np.arange(len(members))
        return members


def usable_features(moments: Moments) -> IntArray:
    """Return the features that vary, of moments in the columns' units."""
    filled = moments.counts > 0
    lows = moments.lows[filled].min(axis=0, initial=np.inf)
    highs = moments.highs[filled].max(axis=0, initial=-np.inf)
    return np.flatnonzero(lows < highs).astype(np.int64)


def standard_units(moments: Moments, usable: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the origin and the unit of each feature: pooled spread within classes.

    A feature that does not vary within any class takes a thousandth of its range.
    """
    filled = moments.counts > 0
    counts = moments.counts[filled].astype(np.float64)[:, None]
    means, spreads = moments.means[filled], moments.spreads[filled]
    centre = np.zeros(means.shape[1])
    scale = np.ones(means.shape[1])
    chosen = means[:, usable]
    first = chosen[0]
    centre[usable] = first + (counts * (chosen - first)).sum(axis=0) / counts.sum()
    within = np.sqrt((counts * spreads[:, usable] ** 2).sum(axis=0) / counts.sum())
    extent = (
        moments.highs[filled].max(axis=0) / 2 - moments.lows[filled].min(axis=0) / 2
    )
    scale[usable] = np.maximum(within, 1e-3 * extent[usable])
    return centre, scale


def make_patterns(
    moments: Moments, sample: Sample, clusters: dict[int, IntArray]
) -> Patterns:
    """Gather patterns from the classes and, where given, their clusters.

    Args:
        moments: Of the classes, over all rows of the table.
        sample: Rows kept, ordered by class.
        clusters: For a class with several patterns, the cluster (from 0) of each of
            its sample rows. A class that is not named has one pattern.
    """
    classes = len(moments.counts)
    inner = np.zeros(len(sample.codes), np.int64)
    sizes = np.zeros(classes, np.int64)
    sizes[moments.counts > 0] = 1
    borders = np.searchsorted(sample.codes, np.arange(classes + 1))
    for code, found in clusters.items():
        inner[borders[code] : borders[code + 1]] = found
        sizes[code] = int(found.max(initial=0)) + 1
    first = np.concatenate([[0], np.cumsum(sizes)])
    owners = first[sample.codes] + inner
    order = np.argsort(owners, kind="stable")
    return _finished(moments, sample, sizes, owners, order)


def _finished(
    moments: Moments,
    sample: Sample,
    sizes: IntArray,
    owners: IntArray,
    order: IntArray,
) -> Patterns:
    size = int(sizes.sum())
    labels = np.repeat(np.arange(len(sizes)), sizes)
    firsts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    numbers = np.arange(size) - np.repeat(firsts, sizes) + 1
    untouched = order[0] == 0 and bool((np.diff(order) == 1).all())
    rows = sample.rows if untouched else sample.rows[order]
    moved = sample.moved if untouched else sample.moved[order]
    owners = owners[order]
    own = grouped_moments(moved, owners, size)
    whole = np.flatnonzero(sizes[labels] == 1)
    kept_of_class = np.bincount(sample.codes, minlength=len(sizes))
    row_weights = moments.counts / np.maximum(kept_of_class, 1)
    weights = own.counts * row_weights[labels]
    for target, source in (
        (own.means, moments.means),
        (own.spreads, moments.spreads),
        (own.lows, moments.lows),
        (own.highs, moments.highs),
    ):
        target[whole] = source[labels[whole]]
    usable = usable_features(moments)
    _, scale = standard_units(moments, usable)
    starts = np.searchsorted(owners, np.arange(size + 1)).astype(np.int64)
    return Patterns(
        labels,
        numbers,
        weights,
        own,
        rows,
        moved,
        owners,
        row_weights[labels[owners]],
        starts,
        sample.units,
        scale,
        usable,
    )


def wanted_patterns(
    moments: Moments, sample: Sample, numbers: Sequence[int]
) -> tuple[Patterns, int]:
    """Return patterns with so many clusters a class, and how many were refused.

    Args:
        moments: Of the classes.
        sample: Their rows.
        numbers: Patterns wanted, per class.
    """
    usable = usable_features(moments)
    centre, scale = standard_units(moments, usable)
    borders = np.searchsorted(sample.codes, np.arange(len(moments.counts) + 1))
    clusters: dict[int, IntArray] = {}
    refused = 0
    for code, number in enumerate(numbers):
        rows = sample.moved[borders[code] : borders[code + 1]]
        if number < 2 or len(rows) == 0:
            continue
        points = (rows[:, usable] - centre[usable]) / scale[usable]
        clusters[code] = clusters_of(points, number)
        refused += number - 1 - int(clusters[code].max(initial=0))
    return make_patterns(moments, sample, clusters), refused


def leaf_patterns(
    moments: Moments, sample: Sample, leaves: IntArray, labels: IntArray
) -> tuple[Patterns, IntArray]:
    """Return the patterns that the leaves of a tree hold, and that of each leaf.

    A class with one leaf is its pattern whole. Of a class with several, each leaf is a
    pattern of the rows of the class that reach it; those that reach leaves of other
    classes belong to none.

    Args:
        moments: Of the classes.
        sample: Rows kept, ordered by class.
        leaves: The leaf that each of them reaches.
        labels: The class of each leaf.
    """
    classes = len(moments.counts)
    sizes = np.bincount(labels, minlength=classes)
    order = np.argsort(labels, kind="stable")
    rank = np.empty(len(labels), np.int64)
    rank[order] = np.arange(len(labels)) - np.searchsorted(labels[order], labels[order])
    counts = np.where(sizes > 0, moments.counts, 0)
    labelled = replace(moments, counts=counts)
    is_own = (sizes[sample.codes] == 1) | (labels[leaves] == sample.codes)
    kept = np.flatnonzero(is_own & (sizes[sample.codes] > 0))
    mine = sample.at(kept)
    clusters = {
        int(code): rank[leaves[kept]][mine.codes == code]
        for code in np.flatnonzero(sizes > 1)
    }
    firsts = np.cumsum(sizes) - sizes
    return make_patterns(labelled, mine, clusters), firsts[labels] + rank


def clusters_of(rows: FloatArray, count: int) -> IntArray:
    """Return a cluster number for each row, by bisecting k-means without chance.

    The widest cluster is cut at its mean along its longest axis until there are
    `count`; then all centres move together until no row changes its cluster.

    Args:
        rows: In standard units, shape (rows, features).
        count: How many clusters; fewer come back if rows are too few or equal.
    """
    owners = np.zeros(len(rows), np.int64)
    for new in range(1, min(count, len(rows))):
        squares = ((rows - _centres(rows, owners, new)[owners]) ** 2).sum(axis=1)
        totals = np.bincount(owners, squares, new)
        widest = int(totals.argmax())
        if totals[widest] <= 0:
            break
        inside = np.flatnonzero(owners == widest)
        owners[inside[_upper_half(rows[inside])]] = new
        owners = _settled(rows, owners, new + 1, rounds=5)
    owners = _settled(rows, owners, int(owners.max(initial=0)) + 1)
    _, first, inverse = np.unique(owners, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))  # in the order in which rows meet them
    return rank[inverse].astype(np.int64)


def _upper_half(rows: FloatArray) -> IntArray:
    """Return the rows above the mean along the longest axis of a cluster."""
    moved = rows - rows.mean(axis=0)
    axis = moved[np.argmax((moved * moved).sum(axis=1))]
    for _ in range(10):
        axis = moved.T @ (moved @ axis)
        length = float(np.sqrt(axis @ axis))
        if length == 0.0:
            return np.arange(0)
        axis = axis / length
    return np.flatnonzero(moved @ axis > 0)


def _centres(rows: FloatArray, owners: IntArray, size: int) -> FloatArray:
    members = (owners == np.arange(size)[:, None]).astype(np.float64)
    counts = members.sum(axis=1, keepdims=True)
    centres: FloatArray = (members @ rows) / np.maximum(counts, 1.0)
    return centres


def _settled(
    rows: FloatArray, owners: IntArray, size: int, rounds: int = _ROUNDS
) -> IntArray:
    """Move rows to the nearest centre and centres to their rows, until they stay."""
    for _ in range(rounds):
        centres = _centres(rows, owners, size)
        squares = (centres * centres).sum(axis=1)
        nearest = np.argmin(squares - 2.0 * (rows @ centres.T), axis=1)
        if (nearest == owners).all():
            break
        owners = nearest.astype(np.int64)
    return owners
