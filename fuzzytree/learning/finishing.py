"""From splits in two to the nodes of a tree: several cuts in one, cuts between rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fuzzytree.learning.binary import BinaryTree
from fuzzytree.learning.cuts import Sketch, SplitCuts, TreeSplit
from fuzzytree.learning.nodes import between
from fuzzytree.learning.patterns import Patterns, leaf_patterns
from fuzzytree.learning.rows import TrainingRows
from fuzzytree.learning.sampling import Sample
from fuzzytree.learning.statistics import Moments
from fuzzytree.learning.units import IntArray


@dataclass(frozen=True)
class FinishedTree:
    """A tree over the patterns that its leaves hold.

    Attributes:
        sketch: The tree.
        patterns: One for each leaf.
        leaves: The leaf that each row reaches.
    """

    sketch: Sketch
    patterns: Patterns
    leaves: IntArray


def finished_tree(
    tree: BinaryTree, rows: TrainingRows, sample: Sample, moments: Moments
) -> FinishedTree:
    """Return the nodes of a tree, and the patterns of its leaves.

    Splits by the same column that follow each other become one node.

    Args:
        tree: Of splits in two.
        rows: What it was grown from.
        sample: The same rows.
        moments: Of the classes.
    """
    sketch = Sketch()
    inside: list[IntArray] = []  # the rows of each node
    leaves = np.zeros(rows.size, np.int64)
    todo = [(0, np.arange(rows.size), -1, 0)]
    while todo:
        node, at, parent, branch = todo.pop()
        split = tree.splits[node]
        if split is None:
            place = ~len(sketch.leaf_classes)
            leaves[at] = ~place
            sketch.leaf_classes.append(tree.labels[node])
        else:
            place = len(sketch.splits)
            joined, below = _joined(tree, node, rows)
            placed = _placed(joined, rows, at)
            sketch.splits.append(placed)
            sketch.children.append([0] * len(below))
            inside.append(at)
            taken = placed.branches(rows.values[at])
            for k in reversed(range(len(below))):
                todo.append((below[k], at[taken == k], place, k))
        if parent >= 0:
            sketch.children[parent][branch] = place
    labels = np.array(sketch.leaf_classes, np.int64)
    patterns, held = leaf_patterns(moments, sample, leaves, labels)
    sketch.leaves.extend(held[[k]] for k in range(len(labels)))
    for node, split in enumerate(sketch.splits):
        groups = [_below(sketch, child) for child in sketch.children[node]]
        found = tuple(np.sort(held[np.array(group)]) for group in groups)
        sketch.splits[node] = replace(split, groups=found)
    return FinishedTree(sketch, patterns, leaves)


def _joined(
    tree: BinaryTree, node: int, rows: TrainingRows
) -> tuple[TreeSplit, list[int]]:
    """Return a split with those below it on the same column, and the nodes it leads to.

    Combinations and categories stay as they are.
    """
    split = tree.splits[node]
    assert split is not None
    axis = split.axis
    if axis.is_combined or rows.categories[axis.features[0]] > 2:
        return split, [*tree.children[node]]
    column = axis.features[0]
    cuts: list[float] = []
    flanks: list[float] = []
    below: list[int] = []
    todo = [node]
    while todo:  # in the order of the intervals
        one = todo.pop()
        found = tree.splits[one] if one >= 0 else None
        if one < 0:
            split = tree.splits[~one]
            assert split is not None  # its node is split
            cuts.append(float(split.cuts[0]))
            flanks += [] if split.flanks is None else split.flanks.tolist()
        elif (
            found is None or found.axis.is_combined or found.axis.features[0] != column
        ):
            below.append(one)
        else:
            left, right = tree.children[one]
            todo += [right, ~one, left]
    owners = np.arange(len(cuts) + 1)
    ends = np.array(flanks) if len(flanks) == len(cuts) else None
    return TreeSplit(axis, np.array(cuts), owners, (), ends), below


def _placed(split: TreeSplit, rows: TrainingRows, at: IntArray) -> TreeSplit:
    """Return a split with cuts of few digits in the middle between the node's rows."""
    axis = split.axis
    if not axis.is_combined and rows.categories[axis.features[0]] > 2:
        return split
    values, moved = rows.values[at], rows.moved[at]
    along, places = axis.values(values), axis.places(values, moved)
    middle = [
        between(float(places[along <= cut].max()), float(places[along > cut].min()))
        for cut in split.cuts.tolist()
    ]
    cuts = SplitCuts(np.array(middle), split.owners)
    found = axis.settled(cuts, values, moved, rows.units)
    flanks = split.flanks if len(found.cuts) == len(split.cuts) else None
    return TreeSplit(axis, found.cuts, found.owners, (), flanks)


def _below(sketch: Sketch, child: int) -> list[int]:
    """Return the leaves below a child."""
    found: list[int] = []
    todo = [child]
    while todo:
        one = todo.pop()
        if one < 0:
            found.append(~one)
        else:
            todo += sketch.children[one]
    return found
