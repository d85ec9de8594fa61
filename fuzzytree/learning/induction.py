"""Steps 4 and 5 of the paper (2.3): the most powerful feature splits a node.

Patterns i and j are `d = alpha |M_i - M_j| + beta |SD_i - SD_j|` apart on a feature.
Those closer than `T = M_SD (L_MAX - L) / 2` belong together, and so does what they are
close to (connected components); M_SD is the mean spread of the node's own patterns and
T is never below 0. The most powerful feature makes the most groups.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.units import FloatArray, IntArray


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
) -> Grouping | None:
    """Return the feature that makes the most groups (step 4), or None.

    Ties go to the cheaper feature, then to the first.

    Args:
        means: M of the node's patterns, shape (patterns, features).
        spreads: SD, same shape.
        limits: T per feature.
        alpha: Weight of the means; beta is 1 - alpha.
        costs: Per feature.
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
    chosen = int(tied[costs[tied].argmin()])
    groups = _groups(means[:, chosen], spreads[:, chosen], limits[chosen], alpha)
    return Grouping(chosen, groups)


def components(
    means: FloatArray, spreads: FloatArray, limit: float, alpha: float
) -> IntArray:
    """Return the connected component of each pattern on one feature.

    Patterns are compared with those behind them in the order of `alpha M`, as far as
    that alone does not part them.

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
        found = _connected(first[piece], second[piece], limit)
        labels[piece] = found + total
        total += int(found.max()) + 1
    lowest = np.full(total, np.inf)
    np.minimum.at(lowest, labels, first)
    rank = np.argsort(np.argsort(lowest, kind="stable"), kind="stable")
    return rank[labels].astype(np.int64)


def _connected(first: FloatArray, second: FloatArray, limit: float) -> IntArray:
    """Return the component of each pattern of a piece, which is ordered by `first`.

    No two neighbours of a piece are further apart than the limit in `first`.
    """
    labels = np.zeros(len(first), np.int64)
    if (second == second[0]).all():
        return labels
    labels[:] = np.arange(len(first))
    ends = np.searchsorted(
        first, first + limit + 4.0 * np.spacing(np.abs(first) + limit)
    )
    for k, end in enumerate(ends.tolist()):
        behind = slice(k, max(end, k + 1))
        apart = np.abs(first[behind] - first[k]) + np.abs(second[behind] - second[k])
        joined = np.unique(labels[behind][apart <= limit])
        if len(joined) > 1:
            labels[np.isin(labels, joined)] = joined[0]
    return np.unique(labels, return_inverse=True)[1].astype(np.int64)


def _groups(
    means: FloatArray, spreads: FloatArray, limit: float, alpha: float
) -> tuple[IntArray, ...]:
    labels = components(means, spreads, limit, alpha)
    order = np.lexsort((means, labels))
    return tuple(np.split(order, np.flatnonzero(np.diff(labels[order])) + 1))
