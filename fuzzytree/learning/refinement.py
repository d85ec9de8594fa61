"""Splits move until fewer rows go wrong; no leaf is added.

A node is looked at with the rows that really reach it. Rows that are right on exactly
one of its branches say where its cut should be; the others do not matter. The cut is
placed again, on the old combination of columns and on a logistic direction over its
columns; it stays where it was unless clearly fewer rows go wrong.
"""

from __future__ import annotations

import numpy as np

from fuzzytree.learning.binary import BinaryTree
from fuzzytree.learning.cuts import TreeSplit
from fuzzytree.learning.directions import turned
from fuzzytree.learning.nodes import between
from fuzzytree.learning.rows import TrainingRows
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray

_PASSES = 3
_LEAST = 0.5
_FEWEST = 4
_MANY_NODES = 256
_VERY_MANY_NODES = 2048


def refined(tree: BinaryTree, rows: TrainingRows, at: IntArray) -> BinaryTree:
    """Return the tree with its splits moved, as long as fewer rows go wrong.

    Args:
        tree: A tree; every node is visited three times at most, once if there are more
            than 256 nodes, not at all if there are more than 2048.
        rows: To learn from.
        at: Which of them.
    """
    nodes = len(tree.splits)
    passes = _PASSES if nodes <= _MANY_NODES else int(nodes <= _VERY_MANY_NODES)
    for _ in range(passes):
        if not _visit_all(tree, rows, at):
            break
        tree = _labelled(tree, rows, at)
    return tree


def _visit_all(tree: BinaryTree, rows: TrainingRows, at: IntArray) -> bool:
    """Visit the nodes from the last on; return whether anything moved."""
    reached = tree.reaching(rows, at)
    has_moved = False
    for node in reversed(range(len(tree.splits))):
        split, inside = tree.splits[node], reached.get(node)
        if split is None or inside is None:
            continue
        right = [
            tree.answers(rows, inside, child) == rows.codes[inside]
            for child in tree.children[node]
        ]
        cares = right[0] != right[1]
        if np.count_nonzero(cares) < _FEWEST:
            continue
        found = _better_split(split, rows, inside[cares], right[1][cares])
        if found is not None:
            tree.splits[node] = found
            has_moved = True
    return has_moved


def _labelled(tree: BinaryTree, rows: TrainingRows, at: IntArray) -> BinaryTree:
    """Return the tree with the classes of the rows that reach it now.

    A node with a branch that no row reaches is replaced by its other branch.
    """
    result = BinaryTree()
    todo: list[tuple[int, IntArray, int, int]] = [(0, at, -1, 0)]
    while todo:
        node, inside, parent, branch = todo.pop()
        split = tree.splits[node]
        taken = np.zeros(0, np.int64)
        while split is not None:
            taken = split.branches(rows.values[inside])
            if taken.any() and not taken.all():
                break
            node = tree.children[node][int(taken[0])]
            split = tree.splits[node]
        place = result.add(rows, inside)
        result.attach(parent, branch, place)
        if split is not None:
            result.splits[place] = split
            for k in (1, 0):
                todo.append((tree.children[node][k], inside[taken == k], place, k))
    return result


def _better_split(
    split: TreeSplit,
    rows: TrainingRows,
    at: IntArray,
    is_right: BoolArray,
) -> TreeSplit | None:
    """Return a split with less error on the rows that care, or None."""
    if is_right.all() or not is_right.any() or not split.axis.is_combined:
        return None
    values, weights = rows.values[at], rows.weights[at]
    lost = float(weights[split.branches(values) != is_right].sum())
    bar = lost - _LEAST * float(np.sqrt(lost * weights.mean()))
    if bar <= 0:
        return None
    best: TreeSplit | None = None
    axes = [split.axis, turned(split.axis, rows, at, is_right)]
    for axis in axes:
        if axis is None:
            continue
        places = axis.values(values)
        found = _least_error(places, is_right, weights)
        if found is not None and found[0] < bar:
            bar, cut = found
            best = TreeSplit(axis, np.array([cut]), np.array([0, 1]), ())
    return best


def _least_error(
    places: FloatArray, is_right: BoolArray, weights: FloatArray
) -> tuple[float, float] | None:
    """Return the least error of a cut with the right group above it, and the cut."""
    if not np.isfinite(places).all():
        return None
    order = np.argsort(places, kind="stable")
    ordered = places[order]
    signed = np.where(is_right, weights, -weights)[order]
    ends = np.flatnonzero(ordered[1:] > ordered[:-1])
    if not len(ends):
        return None
    lost = float(weights[~is_right].sum()) + np.cumsum(signed)[ends]
    best = int(np.round(lost, 9).argmin())
    low, high = float(ordered[ends[best]]), float(ordered[ends[best] + 1])
    return float(lost[best]), between(low, high)
