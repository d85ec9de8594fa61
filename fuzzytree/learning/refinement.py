"""Cuts and directions move until they no longer help (step 7).

A node of a grown tree is looked at with the rows that really reach it. Rows that are
right on exactly one of its branches say where the cut should be; the others do not
matter. The cut is placed again, on the old axis and on a logistic direction over the
node's own features; it stays where it was unless clearly fewer rows go wrong. No leaf
is added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.combination import axis_of
from fuzzytree.learning.cuts import Sketch, SplitAxis, TreeSplit, smoothed_cuts
from fuzzytree.learning.patterns import Patterns
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray

_MOST_ROWS = 20_000
_NEWTON_STEPS = 8
_LEAST = 0.5
_MANY_NODES = 256
_VERY_MANY_NODES = 2048


def refined(
    sketch: Sketch, patterns: Patterns, *, passes: int = 3, ridge: float = 1.0
) -> Sketch:
    """Return the tree with its splits moved, as long as fewer rows go wrong.

    Args:
        sketch: A grown tree.
        patterns: What it was grown from.
        passes: How often every node is visited at most; once if there are more than
            256 nodes, not at all if there are more than 2048.
        ridge: Penalty on a logistic direction, in rows.
    """
    step = 1 + len(patterns.rows) // _MOST_ROWS
    task = _Task(
        patterns.rows[::step],
        patterns.moved[::step],
        patterns.labels[patterns.owners[::step]],
        patterns.row_weights[::step],
    )
    moved = Sketch(
        list(sketch.splits),
        sketch.children,
        sketch.leaves,
        sketch.leaf_classes,
    )
    nodes = len(moved.splits)
    rounds = passes if nodes <= _MANY_NODES else int(nodes <= _VERY_MANY_NODES)
    for _ in range(rounds):
        if not _visit_all(moved, patterns, task, ridge):
            break
    return moved


@dataclass(frozen=True)
class _Task:
    """Rows as in the table and in the columns' units, what they are and their weights.

    `labels` are the classes of the rows, or whether each belongs to the right branch.
    """

    rows: FloatArray
    moved: FloatArray
    labels: IntArray
    weights: FloatArray

    def at(self, chosen: IntArray, labels: IntArray) -> _Task:
        """Return some of the rows with other labels."""
        return _Task(
            self.rows[chosen], self.moved[chosen], labels, self.weights[chosen]
        )

    def lost(self, split: TreeSplit) -> float:
        """Return the weight of the rows that a split sends to the wrong branch."""
        return float(self.weights[split.branches(self.rows) != self.labels].sum())


def _visit_all(sketch: Sketch, patterns: Patterns, task: _Task, ridge: float) -> bool:
    """Visit the nodes from the deepest on; return whether anything moved."""
    reached = _reaching(sketch, task.rows)
    has_moved = False
    for node in reversed(range(len(sketch.splits))):
        split = sketch.splits[node]
        inside = reached[node]
        if len(split.groups) != 2 or len(inside) == 0:
            continue
        right = [
            sketch.classify(task.rows[inside], child) == task.labels[inside]
            for child in sketch.children[node]
        ]
        cares = right[0] != right[1]
        if np.count_nonzero(cares) < 4:
            continue
        wanted = right[1][cares].astype(np.int64)
        better = _better_split(split, patterns, task.at(inside[cares], wanted), ridge)
        if better is not None:
            sketch.splits[node] = better
            has_moved = True
    return has_moved


def _reaching(sketch: Sketch, rows: FloatArray) -> list[IntArray]:
    """Return the rows that reach each node."""
    reached: list[IntArray] = [np.empty(0, np.int64) for _ in sketch.splits]
    todo: list[tuple[int, IntArray]] = [(0, np.arange(len(rows)))] if reached else []
    while todo:
        node, inside = todo.pop()
        reached[node] = inside
        taken = sketch.splits[node].branches(rows[inside])
        for branch, child in enumerate(sketch.children[node]):
            if child >= 0:
                todo.append((child, inside[taken == branch]))
    return reached


def _better_split(
    split: TreeSplit, patterns: Patterns, task: _Task, ridge: float
) -> TreeSplit | None:
    """Return a split with less error on the rows that care, or None."""
    lowest = task.lost(split)
    is_right = task.labels > 0
    if lowest == 0.0 or is_right.all() or not is_right.any():
        return None
    bar = lowest - _LEAST * float(np.sqrt(lowest * task.weights.mean()))
    best: TreeSplit | None = None
    turned = _logistic_axis(split, patterns, task, ridge)
    for axis in (split.axis, turned):
        if axis is None:
            continue
        found = _cut_again(axis, split, patterns, task)
        error = task.lost(found)
        if error < bar:
            bar, best = error, found
    return best


def _cut_again(
    axis: SplitAxis, split: TreeSplit, patterns: Patterns, task: _Task
) -> TreeSplit:
    """Return the split with new cuts on an axis."""
    places = axis.places(task.rows, task.moved)
    cuts = smoothed_cuts(
        places, task.labels > 0, task.weights, two=len(split.cuts) == 2
    )
    placed = axis.settled(cuts, task.rows, task.moved, patterns.units)
    return TreeSplit(axis, placed.cuts, placed.owners, split.groups)


def _logistic_axis(
    split: TreeSplit, patterns: Patterns, task: _Task, ridge: float
) -> SplitAxis | None:
    """Return the logistic direction over the features of a combination."""
    if not split.axis.is_combined:
        return None
    features = split.axis.features
    points = task.moved[:, features] - patterns.centre[features]
    points /= patterns.scale[features]
    direction = logistic_direction(points, task.labels > 0, task.weights, ridge)
    if direction is None:
        return None
    order = np.argsort(-np.abs(direction * points.std(axis=0)), kind="stable")
    within = np.cov(points[:, order].T, aweights=task.weights)
    places = np.searchsorted(patterns.combinable, features)[order]
    return axis_of(patterns, places, direction[order], within)


def logistic_direction(
    points: FloatArray, is_right: BoolArray, weights: FloatArray, ridge: float
) -> FloatArray | None:
    """Return the penalised logistic direction by Newton steps, or None if they fail.

    Args:
        points: In standard units, shape (rows, features); outliers are drawn in to
            eight spreads.
        is_right: The side of each row.
        weights: Of the rows.
        ridge: Penalty on squared weights.
    """
    unit = points.std(axis=0)
    unit = np.where(unit > 0, unit, 1.0)
    moved = np.clip((points - points.mean(axis=0)) / unit, -8.0, 8.0)
    design = np.hstack([moved, np.ones((len(points), 1))])
    share = weights / weights.mean()
    penalty = np.full(design.shape[1], ridge)
    penalty[-1] = 1e-6
    solution = np.zeros(design.shape[1])
    for _ in range(_NEWTON_STEPS):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ solution, -30.0, 30.0)))
        slope = design.T @ (share * (is_right - chance)) - penalty * solution
        steep = share * np.maximum(chance * (1.0 - chance), 1e-4)
        curvature = (design * steep[:, None]).T @ design + np.diag(penalty)
        try:
            step = np.linalg.solve(curvature, slope)
        except np.linalg.LinAlgError:
            return None
        solution = solution + step
        if np.abs(step).max() < 1e-6:
            break
    direction: FloatArray = solution[:-1] / unit
    return direction if np.isfinite(direction).all() and direction.any() else None
