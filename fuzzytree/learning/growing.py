"""The tree grows from its root: single features, then combinations, one axis a node."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.combination import (
    NodeView,
    best_bipartition,
    combined_axis,
    node_view,
    selected_features,
)
from fuzzytree.learning.cuts import (
    Sketch,
    SplitAxis,
    SplitCuts,
    TreeSplit,
    crossing_cuts,
    single,
    smoothed_cuts,
)
from fuzzytree.learning.induction import Grouping, most_powerful, threshold
from fuzzytree.learning.patterns import Patterns
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray

_CLEAN = 0.005
_CLEAN_FACTOR = 8.0
_NODE_ROWS = 20_000
_SINGLES = 6
_POOR = 0.1
_FINE = 1e-5


@dataclass(frozen=True)
class GrowthRules:
    """What decides how a tree grows; fields as in `Settings`.

    Attributes:
        is_literal: Paper mode.
        alpha: Weight of the means in the distance.
        l_max: L_MAX.
        shrinkage: Of the scatter's off-diagonals.
        entry: Smallest partial F of a further feature.
        costs: Per column.
        keep_reversals: Whether far reversals keep their cut.
    """

    is_literal: bool
    alpha: float
    l_max: float
    shrinkage: float
    entry: float
    costs: FloatArray
    keep_reversals: bool


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
        found = _divided(patterns, chosen, level, rules, grown)
        if found is None:
            place = ~len(sketch.leaves)
            sketch.leaves.append(chosen)
            sketch.leaf_classes.append(_leaf_class(patterns, chosen, grown))
            settled += len(chosen)
            if progress is not None:
                progress(settled / len(everything))
        else:
            split, level = found
            place = len(sketch.splits)
            sketch.splits.append(split)
            sketch.children.append([0] * len(split.groups))
            for k in reversed(range(len(split.groups))):
                todo.append((split.groups[k], level + 1, place, k))
        if parent >= 0:
            sketch.children[parent][branch] = place
    return grown


def _leaf_class(patterns: Patterns, chosen: IntArray, grown: GrownTree) -> int:
    labels = patterns.labels[chosen]
    if len(np.unique(labels)) > 1:
        grown.inseparable += len(chosen)
    totals = np.bincount(labels, weights=patterns.weights[chosen])
    return int(totals.argmax())


def _divided(
    patterns: Patterns,
    chosen: IntArray,
    level: int,
    rules: GrowthRules,
    grown: GrownTree,
) -> tuple[TreeSplit, int] | None:
    """Return the split of a node and the level at which it was found, or None."""
    if len(chosen) < 2:
        return None
    if rules.is_literal:
        return _literal_split(patterns, chosen, level, rules, grown)
    labels = patterns.labels[chosen]
    if (labels == labels[0]).all():
        return None
    clean = _clean_split(patterns, chosen, level, rules, grown)
    if clean is not None:
        return clean, level
    split = _combined_split(patterns, chosen, rules)
    return None if split is None else (split, level)


def _literal_split(
    patterns: Patterns,
    chosen: IntArray,
    level: int,
    rules: GrowthRules,
    grown: GrownTree,
) -> tuple[TreeSplit, int] | None:
    """Split by one feature; while none splits, the level rises and T falls to 0."""
    means, spreads, costs = _single_features(patterns, chosen, rules)
    while True:
        limits = threshold(spreads, rules.l_max, level)
        found = most_powerful(
            means, spreads, limits, alpha=rules.alpha, costs=costs, by_margin=False
        )
        if found is not None:
            return _grouped_split(patterns, chosen, found, rules, grown), level
        if level >= rules.l_max:
            return None
        level += 1
        grown.levels_raised += 1


def _clean_split(
    patterns: Patterns,
    chosen: IntArray,
    level: int,
    rules: GrowthRules,
    grown: GrownTree,
) -> TreeSplit | None:
    """Split by one feature whose groups are so far apart that next to no row strays."""
    if len(chosen) < 3:
        return None
    means, spreads, costs = _single_features(patterns, chosen, rules)
    limits = threshold(spreads, max(rules.l_max, level + _CLEAN_FACTOR), level)
    found = most_powerful(
        means, spreads, limits, alpha=1.0, costs=costs, by_margin=True
    )
    if found is None:
        return None
    split = _grouped_split(patterns, chosen, found, rules, grown)
    members = _members(patterns, chosen)
    branch = np.zeros(patterns.size, np.int64)
    for number, group in enumerate(split.groups):
        branch[group] = number
    strays = split.branches(patterns.rows[members]) != branch[patterns.owners[members]]
    weights = patterns.row_weights[members]
    return split if weights[strays].sum() <= _CLEAN * weights.sum() else None


def _single_features(
    patterns: Patterns, chosen: IntArray, rules: GrowthRules
) -> tuple[FloatArray, FloatArray, FloatArray]:
    place = np.ix_(chosen, patterns.usable)
    moments = patterns.moments
    return moments.means[place], moments.spreads[place], rules.costs[patterns.usable]


def _grouped_split(
    patterns: Patterns,
    chosen: IntArray,
    found: Grouping,
    rules: GrowthRules,
    grown: GrownTree,
) -> TreeSplit:
    feature = int(patterns.usable[found.feature])
    group_of = np.zeros(len(chosen), np.int64)
    for number, group in enumerate(found.groups):
        group_of[group] = number
    cuts = crossing_cuts(
        patterns.moments.means[chosen, feature],
        patterns.moments.spreads[chosen, feature],
        group_of,
        keep_reversals=rules.keep_reversals,
    )
    grown.reversals += cuts.reversals
    groups = tuple(chosen[group] for group in found.groups)
    return finished_split(patterns, single(feature), cuts, groups)


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
    members = _members(patterns, np.concatenate(groups))
    rows, moved = patterns.rows[members], patterns.moved[members]
    placed = axis.settled(cuts, rows, moved, patterns.units)
    return TreeSplit(axis, placed.cuts, placed.owners, groups)


def _members(patterns: Patterns, chosen: IntArray) -> IntArray:
    """Return sample rows of some patterns, thinned evenly if they are very many."""
    members = patterns.members(chosen)
    return members[:: 1 + len(members) // _NODE_ROWS]


def _combined_split(
    patterns: Patterns, chosen: IntArray, rules: GrowthRules
) -> TreeSplit | None:
    """Split in two by a combination; where it errs much, look further.

    Then the scatter is shrunk next to nothing, for features that are equal up to a
    small difference, and single features are tried, for groups that differ in spread.
    """
    view = node_view(patterns, chosen, rules.shrinkage)
    is_right = best_bipartition(view)
    if is_right.all() or not is_right.any():
        return None
    members = _members(patterns, chosen)
    side = np.zeros(patterns.size, bool)
    side[chosen] = is_right
    task = _Task(
        patterns.rows[members],
        patterns.moved[members],
        side[patterns.owners[members]],
        patterns.row_weights[members],
    )
    axis = _fisher_axis(patterns, view, is_right, len(members), rules)
    cuts, error = _placed(axis, task)
    if error > _POOR * task.smaller:
        view = node_view(patterns, chosen, rules.shrinkage * _FINE)
        other = _fisher_axis(patterns, view, is_right, len(members), rules)
        found, lower = _placed(other, task)
        if lower < error - 0.02 * task.smaller:
            axis, cuts, error = other, found, lower
    for feature in _alternatives(patterns, view, is_right, error, task):
        other = single(feature)
        found, lower = _placed(other, task)
        if lower < error - 0.02 * task.smaller:
            axis, cuts, error = other, found, lower
    groups = (chosen[~is_right], chosen[is_right])
    return finished_split(patterns, axis, cuts, groups)


def _fisher_axis(
    patterns: Patterns,
    view: NodeView,
    is_right: BoolArray,
    rows: int,
    rules: GrowthRules,
) -> SplitAxis:
    selected = selected_features(
        view,
        is_right,
        rows=float(rows),
        entry=rules.entry,
        costs=rules.costs[patterns.combinable],
    )
    return combined_axis(patterns, view, is_right, selected)


@dataclass(frozen=True)
class _Task:
    """Rows to be separated, as in the table and in the columns' units."""

    rows: FloatArray
    moved: FloatArray
    is_right: BoolArray
    weights: FloatArray

    @property
    def smaller(self) -> float:
        """Return the weight of the smaller side."""
        right = float(self.weights[self.is_right].sum())
        return min(right, float(self.weights.sum()) - right)


def _placed(axis: SplitAxis, task: _Task) -> tuple[SplitCuts, float]:
    values = axis.places(task.rows, task.moved)
    cuts = smoothed_cuts(values, task.is_right, task.weights, two=True)
    taken = cuts.owners[np.searchsorted(cuts.cuts, values, side="left")]
    return cuts, float(task.weights[taken != task.is_right].sum())


def _alternatives(
    patterns: Patterns,
    view: NodeView,
    is_right: BoolArray,
    error: float,
    task: _Task,
) -> list[int]:
    """Return single features worth a look where a combination errs much."""
    if error <= _POOR * task.smaller:
        return []
    apart = _apart(view, is_right)
    best = np.argsort(-apart, kind="stable")[:_SINGLES]
    return [int(feature) for feature in patterns.combinable[best]]


def _apart(view: NodeView, is_right: BoolArray) -> FloatArray:
    """Return how much two sides differ on each feature, in mean and in spread."""
    variances = np.einsum("pii->pi", view.scatter)
    second = view.means**2 + variances
    means: list[FloatArray] = []
    spreads: list[FloatArray] = []
    for side in (~is_right, is_right):
        share = view.weights[side] / view.weights[side].sum()
        middle = share @ view.means[side]
        square = share @ second[side] - middle**2
        means.append(middle)
        spreads.append(np.sqrt(np.maximum(square, 1e-6)))
    by_mean = np.abs(means[1] - means[0]) / (spreads[0] + spreads[1])
    return by_mean + np.abs(np.log(spreads[1] / spreads[0]))
