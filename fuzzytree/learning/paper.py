"""The paper's tree (2.3): it grows from its root over fuzzy patterns.

Patterns i and j are `d = alpha |M_i - M_j| + beta |SD_i - SD_j|` apart on a feature.
Those closer than `T = M_SD (L_MAX - L) / 2` belong together, and so does what they are
close to (connected components); M_SD is the mean spread of the node's own patterns and
T is never below 0. The most powerful feature makes the most groups, and a node tests
it (steps 4 and 5). Where no feature splits it, the most powerful ones are combined
(step 7): Fisher's direction over the widest 2, 3, ... of them, and what it gives is a
feature as any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.cuts import (
    Sketch,
    SplitAxis,
    SplitCuts,
    TreeSplit,
    crossing_cuts,
    single,
)
from fuzzytree.learning.directions import (
    MOST_COLUMNS,
    rounded_axis,
    shrunk,
    solved,
)
from fuzzytree.learning.patterns import Patterns
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
        numbers = _connected(first[piece], second[piece], limit)
        labels[piece] = numbers + total
        total += int(numbers.max()) + 1
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


_NODE_ROWS = 20_000
_ROWS_PER_COLUMN = 3
_CELLS = 1 << 22  # of the scatters of all patterns of a node
_POWER = 32  # of the matrix that turns a direction towards Fisher's


@dataclass(frozen=True)
class GrowthRules:
    """What decides how a tree grows; fields as in `Settings`.

    Attributes:
        alpha: Weight of the means in the distance.
        l_max: L_MAX.
        costs: Per column.
        keep_reversals: Whether far reversals keep their cut.
        columns: How many columns a node may combine.
        shrinkage: Of the scatter within patterns.
    """

    alpha: float
    l_max: float
    costs: FloatArray
    keep_reversals: bool
    columns: int
    shrinkage: float


@dataclass
class GrownTree:
    """A grown tree and what happened on the way.

    Attributes:
        sketch: The tree.
        reversals: Far reversals left out.
        inseparable: Patterns of different classes that share a leaf.
        levels_raised: How often a level had to be passed over until T fell enough.
    """

    sketch: Sketch
    reversals: int = 0
    inseparable: int = 0
    levels_raised: int = 0


def grow(
    patterns: Patterns,
    rules: GrowthRules,
    progress: Callable[[float], None] | None = None,
) -> GrownTree:
    """Return a tree with at most one leaf per pattern (steps 3 to 7)."""
    grown = GrownTree(Sketch())
    sketch = grown.sketch
    everything = np.flatnonzero(patterns.weights > 0).astype(np.int64)
    todo: list[tuple[IntArray, int, int, int]] = [(everything, 0, -1, 0)]
    settled = 0
    while todo:
        chosen, level, parent, branch = todo.pop()
        best = _split_at(patterns, chosen, level, rules, grown)
        if best is None:
            place = ~len(sketch.leaves)
            sketch.leaves.append(chosen)
            labels = patterns.labels[chosen]
            if len(np.unique(labels)) > 1:
                grown.inseparable += len(chosen)
            totals = np.bincount(labels, weights=patterns.weights[chosen])
            sketch.leaf_classes.append(int(totals.argmax()))
            settled += len(chosen)
            if progress is not None:
                progress(settled / len(everything))
        else:
            split, level = best
            place = len(sketch.splits)
            sketch.splits.append(split)
            sketch.children.append([0] * len(split.groups))
            for k in reversed(range(len(split.groups))):
                todo.append((split.groups[k], level + 1, place, k))
        if parent >= 0:
            sketch.children[parent][branch] = place
    return grown


@dataclass(frozen=True)
class _Features:
    """What a node can test: columns, or combinations of them.

    Attributes:
        axes: One for each feature, made where it is needed.
        means: M of the node's patterns, shape (patterns, features).
        spreads: SD, same shape.
        costs: Per feature.
    """

    axes: Callable[[int], SplitAxis]
    means: FloatArray
    spreads: FloatArray
    costs: FloatArray


def _split_at(
    patterns: Patterns,
    chosen: IntArray,
    level: int,
    rules: GrowthRules,
    grown: GrownTree,
) -> tuple[TreeSplit, int] | None:
    """Split by one feature, or else by a combination of features.

    While neither splits, the level rises and T falls to 0; single features come last.
    """
    if len(chosen) < 2:
        return None
    usable, moments = patterns.usable, patterns.moments
    place = np.ix_(chosen, usable)
    columns = _Features(
        lambda k: single(int(usable[k])),
        moments.means[place],
        moments.spreads[place],
        rules.costs[usable],
    )
    split = _best_split(patterns, chosen, columns, level, rules, grown)
    if split is not None:
        return split, level
    combinations = _combinations(patterns, chosen, columns, rules)
    for features in (combinations, columns):
        for higher in _levels(level, rules.l_max):
            split = _best_split(patterns, chosen, features, higher, rules, grown)
            if split is not None:
                grown.levels_raised += higher - level
                return split, higher
    return None


def _levels(level: int, l_max: float) -> Iterable[int]:
    """Return the levels from a node's own to the first at which T is 0."""
    return range(level, max(level, math.ceil(l_max)) + 1)


def _best_split(
    patterns: Patterns,
    chosen: IntArray,
    features: _Features,
    level: int,
    rules: GrowthRules,
    grown: GrownTree,
) -> TreeSplit | None:
    """Return the split by the most powerful feature at a level, or None."""
    limits = threshold(features.spreads, rules.l_max, level)
    grouping = most_powerful(
        features.means,
        features.spreads,
        limits,
        alpha=rules.alpha,
        costs=features.costs,
    )
    if grouping is None:
        return None
    group_of = np.zeros(len(chosen), np.int64)
    for number, group in enumerate(grouping.groups):
        group_of[group] = number
    cuts = crossing_cuts(
        features.means[:, grouping.feature],
        features.spreads[:, grouping.feature],
        group_of,
        keep_reversals=rules.keep_reversals,
    )
    grown.reversals += cuts.reversals
    groups = tuple(chosen[group] for group in grouping.groups)
    return finished_split(patterns, features.axes(grouping.feature), cuts, groups)


def _combinations(
    patterns: Patterns, chosen: IntArray, columns: _Features, rules: GrowthRules
) -> _Features:
    """Return Fisher's directions over the widest 2, 3, ... columns of a node (step 7).

    The widest column has the largest range of M in units of M_SD; of equally wide ones
    the cheaper comes first. M and SD of a combination are those of the rows kept, and
    its cost is that of its columns.
    """
    usable = patterns.usable
    with np.errstate(divide="ignore", invalid="ignore"):
        widths = np.ptp(columns.means, axis=0) / columns.spreads.mean(axis=0)
    order = np.lexsort((columns.costs, -widths))
    order = order[(widths[order] > 0) & patterns.units.is_combinable[usable[order]]]
    most = min(
        rules.columns,
        MOST_COLUMNS,
        len(patterns.members(chosen)) // _ROWS_PER_COLUMN,
        math.isqrt(_CELLS // len(chosen)),
    )
    widest = usable[order[:most]]
    scale = patterns.scale[widest]
    means, scatters = _scatters(patterns, chosen, widest)
    within = scatters.mean(axis=0)
    axes: list[SplitAxis] = []
    weights: list[FloatArray] = []
    for size in range(2, len(widest) + 1):
        scatter = shrunk(within[:size, :size], rules.shrinkage)
        direction = _fishers_direction(means[:, :size], scatter)
        if not direction.any():
            continue
        variances = direction @ scatters[:, :size, :size] @ direction
        spread = float(np.sqrt(np.maximum(variances, 0.0)).mean())
        axis = rounded_axis(
            widest[:size], direction, spread, scale[:size], patterns.units
        )
        if axis is not None:
            at = np.isin(widest, axis.features)
            weight = np.ldexp(axis.weights, patterns.units.exponents[axis.features])
            weights.append(np.zeros(len(widest)))
            weights[-1][at] = weight * scale[at]
            axes.append(axis)
    every = np.array(weights).reshape(len(weights), len(widest))
    variances = np.einsum("kv,pvw,kw->pk", every, scatters, every, optimize=True)
    spreads = np.sqrt(np.maximum(variances, 0.0))
    costs = (every != 0) @ rules.costs[widest]
    return _Features(lambda k: axes[k], means @ every.T, spreads, costs)


def _scatters(
    patterns: Patterns, chosen: IntArray, columns: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the mean and the scatter of the rows of each pattern, in standard units.

    Shapes (patterns, columns) and (patterns, columns, columns).
    """
    scale = patterns.scale[columns]
    means = np.empty((len(chosen), len(columns)))
    scatters = np.empty((*means.shape, len(columns)))
    for k, pattern in enumerate(chosen.tolist()):
        rows = patterns.moved[patterns.starts[pattern] : patterns.starts[pattern + 1]]
        points = rows[:, columns] / scale
        means[k] = points.mean(axis=0)
        points -= means[k]
        scatters[k] = points.T @ points / max(len(points) - 1, 1)
    return means, scatters


def _fishers_direction(means: FloatArray, scatter: FloatArray) -> FloatArray:
    """Return the direction in which patterns differ most for the scatter within them.

    Of two patterns it is Fisher's. Of more it is the leading eigenvector of the scatter
    between them over that within, towards which the direction of the farthest pattern
    is turned; where two eigenvalues are equal, rounding does not decide.
    """
    moved = means - means.mean(axis=0)
    directions = solved(scatter, moved.T)
    ratio = directions @ moved
    total = float(np.trace(ratio))
    if not total > 0.0:
        return np.zeros(len(scatter))
    distances = np.einsum("pv,vp->p", moved, directions) / total
    farthest = directions[:, int(np.round(distances, 9).argmax())]
    turned: FloatArray = np.linalg.matrix_power(ratio / total, _POWER) @ farthest
    return turned


def finished_split(
    patterns: Patterns, axis: SplitAxis, cuts: SplitCuts, groups: tuple[IntArray, ...]
) -> TreeSplit:
    """Return a split whose cuts lie between the rows.

    Args:
        patterns: Of the tree.
        axis: Of the split.
        cuts: In the axis' own unit.
        groups: The patterns of each branch.
    """
    members = patterns.members(np.concatenate(groups))
    members = members[:: 1 + len(members) // _NODE_ROWS]  # if they are very many
    rows, moved = patterns.rows[members], patterns.moved[members]
    placed = axis.settled(cuts, rows, moved, patterns.units)
    return TreeSplit(axis, placed.cuts, placed.owners, groups)
