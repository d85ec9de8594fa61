"""Steps 3 to 6 of the paper (2.3): the most powerful feature splits a node.

Patterns i and j are `d = alpha |M_i - M_j| + beta |SD_i - SD_j|` apart on a feature.
Those closer than `T = M_SD (L_MAX - L) / 2` belong together, and so does what they are
close to (connected components); M_SD is the mean spread of the node's own patterns and
T is never below 0. The most powerful feature makes the most groups.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.units import FloatArray, IntArray

_BRUTE = 512


@dataclass(frozen=True)
class Grouping:
    """A feature and the groups it makes.

    Attributes:
        feature: The column number.
        groups: Positions within the node's patterns, ordered by mean.
    """

    feature: int
    groups: tuple[IntArray, ...]


def threshold(spreads: FloatArray, l_max: float, level: int) -> FloatArray:
    """Return T of each feature: M_SD (L_MAX - L) / 2, never below 0.

    Args:
        spreads: SD of the node's patterns, shape (patterns, features).
        l_max: The paper's L_MAX.
        level: The node's level; 0 is the root.
    """
    result: FloatArray = spreads.mean(axis=0) * max(0.0, (l_max - level) / 2.0)
    return result


def most_powerful(
    means: FloatArray,
    spreads: FloatArray,
    limits: FloatArray,
    *,
    alpha: float,
    costs: FloatArray,
    by_margin: bool,
) -> Grouping | None:
    """Return the feature that makes the most groups (step 4), or None.

    Ties go to the cheaper feature, then (if wanted) to the wider margin between
    groups in units of M_SD, then to the first.

    Args:
        means: M of the node's patterns, shape (patterns, features).
        spreads: SD, same shape.
        limits: T per feature.
        alpha: Weight of the means; beta is 1 - alpha.
        costs: Per feature.
        by_margin: Whether the margin breaks ties before the order.
    """
    order = np.argsort(means, axis=0, kind="stable")
    sorted_means = np.take_along_axis(means, order, axis=0)
    sorted_spreads = np.take_along_axis(spreads, order, axis=0)
    near = alpha * np.diff(sorted_means, axis=0)
    most = near + (1.0 - alpha) * np.abs(np.diff(sorted_spreads, axis=0))
    at_most = 1 + np.count_nonzero(most > limits, axis=0)
    at_least = 1 + np.count_nonzero(near > limits, axis=0)
    if at_most.max(initial=1) < 2:
        return None
    power = at_least.copy()
    for feature in np.flatnonzero((at_most > at_least) & (at_most >= at_least.max())):
        labels = components(
            means[:, feature], spreads[:, feature], limits[feature], alpha
        )
        power[feature] = int(labels.max()) + 1
    best = int(power.max())
    if best < 2:
        return None
    tied = np.flatnonzero(power == best)
    tied = tied[costs[tied] == costs[tied].min()]
    groups = [
        _groups(means[:, f], spreads[:, f], float(limits[f]), alpha) for f in tied
    ]
    chosen = 0
    if by_margin and len(tied) > 1:
        margins = [
            _margin(means[:, f], spreads[:, f], found, alpha)
            for f, found in zip(tied, groups, strict=True)
        ]
        chosen = int(np.argmax(margins))
    return Grouping(int(tied[chosen]), groups[chosen])


def components(
    means: FloatArray, spreads: FloatArray, limit: float, alpha: float
) -> IntArray:
    """Return the connected component of each pattern on one feature.

    In the coordinates `alpha M + beta SD` and `alpha M - beta SD` the distance is the
    larger of two differences, so squares of side T hold connected patterns only, and
    only neighbouring squares need to be compared: nothing is quadratic.

    Args:
        means: M, shape (patterns,).
        spreads: SD, shape (patterns,).
        limit: T.
        alpha: Weight of the means.

    Returns:
        Numbers from 0, in the order of the smallest mean of each component.
    """
    first = alpha * means
    second = (1.0 - alpha) * spreads
    order = np.argsort(first, kind="stable")
    breaks = np.diff(first[order], prepend=first[order[0]]) > limit
    labels = np.empty(len(means), np.int64)
    total = 0
    for piece in np.split(order, np.flatnonzero(breaks)):
        if len(piece) <= _BRUTE:
            found = _brute_components(first[piece], second[piece], limit)
        else:
            found = _square_components(first[piece], second[piece], limit)
        labels[piece] = found + total
        total += int(found.max()) + 1
    return _ranked(labels, first)


def _ranked(labels: IntArray, values: FloatArray) -> IntArray:
    lowest = np.full(int(labels.max()) + 1, np.inf)
    np.minimum.at(lowest, labels, values)
    rank = np.argsort(np.argsort(lowest, kind="stable"), kind="stable")
    return rank[labels].astype(np.int64)


def _brute_components(first: FloatArray, second: FloatArray, limit: float) -> IntArray:
    apart = np.abs(first[:, None] - first) + np.abs(second[:, None] - second)
    linked = apart <= limit
    labels = np.arange(len(first))
    while True:
        lowest = np.where(linked, labels, len(first)).min(axis=1)
        lowest = lowest[lowest]
        if (lowest == labels).all():
            break
        labels = lowest
    return np.unique(labels, return_inverse=True)[1].astype(np.int64)


def _square_components(first: FloatArray, second: FloatArray, limit: float) -> IntArray:
    if limit <= 0:
        pairs = np.stack([first, second], axis=1)
        return np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
    u, v = first + second, first - second
    cells = np.stack([np.floor(u / limit), np.floor(v / limit)], axis=1)
    kinds, square = np.unique(cells, axis=0, return_inverse=True)
    square = square.ravel()
    order = np.argsort(square, kind="stable")
    pieces = np.split(order, np.flatnonzero(np.diff(square[order])) + 1)
    place = {(int(a), int(b)): k for k, (a, b) in enumerate(kinds)}
    root = list(range(len(kinds)))

    def find(k: int) -> int:
        while root[k] != k:
            root[k] = root[root[k]]
            k = root[k]
        return k

    for (a, b), k in place.items():
        for across, up in ((1, -1), (1, 0), (1, 1), (0, 1)):
            other = place.get((a + across, b + up))
            if other is None or find(k) == find(other):
                continue
            left, right = pieces[k], pieces[other]
            ahead = across * u, (up or 1) * v
            if _touch(*ahead, left, right, limit):
                root[find(other)] = find(k)
    return np.array([find(k) for k in range(len(root))], np.int64)[square]


def _touch(
    u: FloatArray, v: FloatArray, left: IntArray, right: IntArray, limit: float
) -> bool:
    """Return whether a pattern of the right square is near one of the left square.

    The right square is ahead in u and in v, or level in one of them, where two
    patterns are never further apart than the limit.
    """
    order = left[np.argsort(-u[left], kind="stable")]
    furthest = np.maximum.accumulate(v[order])
    count = np.searchsorted(-u[order], limit - u[right], side="right")
    best = furthest[np.maximum(count, 1) - 1]
    return bool(((count > 0) & (v[right] - best <= limit)).any())


def _groups(
    means: FloatArray, spreads: FloatArray, limit: float, alpha: float
) -> tuple[IntArray, ...]:
    labels = components(means, spreads, limit, alpha)
    order = np.lexsort((means, labels))
    return tuple(np.split(order, np.flatnonzero(np.diff(labels[order])) + 1))


def _margin(
    means: FloatArray, spreads: FloatArray, groups: Sequence[IntArray], alpha: float
) -> float:
    """Return the smallest distance between neighbouring groups, in units of M_SD."""
    unit = float(spreads.mean())
    smallest = np.inf
    for left, right in itertools.pairwise(groups):
        i, j = left[-1], right[0]
        gap = alpha * abs(means[i] - means[j])
        gap += (1.0 - alpha) * abs(spreads[i] - spreads[j])
        smallest = min(smallest, gap)
    return float(smallest / unit) if unit > 0 else np.inf
