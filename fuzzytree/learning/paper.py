"""The paper's tree: it grows from its root over fuzzy patterns, one feature a node."""

from __future__ import annotations

from collections.abc import Callable
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
from fuzzytree.learning.induction import Grouping, most_powerful, threshold
from fuzzytree.learning.patterns import Patterns
from fuzzytree.learning.units import FloatArray, IntArray

_NODE_ROWS = 20_000


@dataclass(frozen=True)
class GrowthRules:
    """What decides how a tree grows; fields as in `Settings`.

    Attributes:
        alpha: Weight of the means in the distance.
        l_max: L_MAX.
        costs: Per column.
        keep_reversals: Whether far reversals keep their cut.
    """

    alpha: float
    l_max: float
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
    """Return a tree with at most one leaf per pattern (steps 3 to 6)."""
    grown = GrownTree(Sketch())
    sketch = grown.sketch
    everything = np.flatnonzero(patterns.weights > 0).astype(np.int64)
    todo: list[tuple[IntArray, int, int, int]] = [(everything, 0, -1, 0)]
    settled = 0
    while todo:
        chosen, level, parent, branch = todo.pop()
        found = _split_at(patterns, chosen, level, rules, grown)
        if found is None:
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
            split, level = found
            place = len(sketch.splits)
            sketch.splits.append(split)
            sketch.children.append([0] * len(split.groups))
            for k in reversed(range(len(split.groups))):
                todo.append((split.groups[k], level + 1, place, k))
        if parent >= 0:
            sketch.children[parent][branch] = place
    return grown


def _split_at(
    patterns: Patterns,
    chosen: IntArray,
    level: int,
    rules: GrowthRules,
    grown: GrownTree,
) -> tuple[TreeSplit, int] | None:
    """Split by one feature; while none splits, the level rises and T falls to 0."""
    if len(chosen) < 2:
        return None
    place, moments = np.ix_(chosen, patterns.usable), patterns.moments
    means, spreads = moments.means[place], moments.spreads[place]
    costs = rules.costs[patterns.usable]
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
    members = patterns.members(np.concatenate(groups))
    members = members[:: 1 + len(members) // _NODE_ROWS]  # if they are very many
    rows, moved = patterns.rows[members], patterns.moved[members]
    placed = axis.settled(cuts, rows, moved, patterns.units)
    return TreeSplit(axis, placed.cuts, placed.owners, groups)
