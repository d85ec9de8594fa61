"""Cuts and directions move until they no longer help (step 7, "until it no longer moves").

A node of a grown tree is looked at with the rows that really reach it. Rows that are right
on exactly one of its branches say where the cut should be; the others do not matter. The
direction is then a logistic one over the node's own features, started at Fisher's; it
replaces the old split only if fewer rows go wrong. No leaf is added.
"""

from __future__ import annotations

import numpy as np

from fuzzytree.learning.arrays import BoolArray, FloatArray, IntArray
from fuzzytree.learning.combination import axis_of
from fuzzytree.learning.cuts import settled_cuts, smoothed_cuts
from fuzzytree.learning.patterns import Patterns
from fuzzytree.learning.sketch import Axis, Sketch, Split, single

_MOST_ROWS = 20_000
_NEWTON_STEPS = 8
_LEAST = 0.5


def refined(
    sketch: Sketch, patterns: Patterns, *, passes: int = 3, ridge: float = 1.0
) -> Sketch:
    """Return the tree with its splits moved, as long as fewer rows go wrong.

    Args:
        sketch: A grown tree.
        patterns: What it was grown from.
        passes: How often every node is visited at most.
        ridge: Penalty on a logistic direction, in rows.
    """
    step = 1 + len(patterns.rows) // _MOST_ROWS
    rows = patterns.rows[::step]
    labels = patterns.labels[patterns.owners[::step]]
    weights = patterns.row_weights[::step]
    moved = Sketch(
        list(sketch.splits),
        sketch.children,
        sketch.leaves,
        sketch.leaf_classes,
    )
    for _ in range(passes):
        if not _visit_all(moved, patterns, rows, labels, weights, ridge):
            break
    return moved


def _visit_all(
    sketch: Sketch,
    patterns: Patterns,
    rows: FloatArray,
    labels: IntArray,
    weights: FloatArray,
    ridge: float,
) -> bool:
    """Visit the nodes from the deepest on; return whether anything moved."""
    reached = _reaching(sketch, rows)
    has_moved = False
    for node in reversed(range(len(sketch.splits))):
        split = sketch.splits[node]
        inside = reached[node]
        if len(split.groups) != 2 or len(inside) == 0:
            continue
        right = [
            sketch.classify(rows[inside], child) == labels[inside]
            for child in sketch.children[node]
        ]
        cares = right[0] != right[1]
        if np.count_nonzero(cares) < 4:
            continue
        chosen = inside[cares]
        better = _better_split(
            split, patterns, rows[chosen], right[1][cares], weights[chosen], ridge
        )
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
    split: Split,
    patterns: Patterns,
    rows: FloatArray,
    is_right: BoolArray,
    weights: FloatArray,
    ridge: float,
) -> Split | None:
    """Return a split with less error on the rows that care, or None."""
    lowest = float(weights[split.branches(rows) != is_right].sum())
    if lowest == 0.0 or is_right.all() or not is_right.any():
        return None
    bar = lowest - _LEAST * float(np.sqrt(lowest * weights.mean()))
    best: Split | None = None
    for axis in (
        split.axis,
        _logistic_axis(split, patterns, rows, is_right, weights, ridge),
    ):
        if axis is None:
            continue
        values = axis.values(rows)
        for cuts in _candidates(values, is_right, weights, len(split.cuts) == 2):
            found = Split(axis, settled_cuts(cuts[0], values), cuts[1], split.groups)
            if (np.diff(found.cuts) <= 0).any() or not np.isfinite(found.cuts).all():
                continue
            error = float(weights[found.branches(rows) != is_right].sum())
            if error < bar:
                bar, best = error, found
    return best


def _candidates(
    values: FloatArray, is_right: BoolArray, weights: FloatArray, two: bool
) -> list[tuple[FloatArray, IntArray]]:
    """Return the smoothed cuts on an axis."""
    cuts = smoothed_cuts(values, is_right, weights, two=two)
    return [(cuts.cuts, cuts.owners)]


def _logistic_axis(
    split: Split,
    patterns: Patterns,
    rows: FloatArray,
    is_right: BoolArray,
    weights: FloatArray,
    ridge: float,
) -> Axis | None:
    """Return the logistic direction over the features of a combination."""
    if not split.axis.is_combined:
        return None
    features = split.axis.features
    scale, centre = patterns.scale[features], patterns.centre[features]
    points = (rows[:, features] - centre) / scale
    sign = 1.0 if split.owners[-1] == 1 else -1.0
    start = sign * split.axis.weights * scale
    direction = logistic_direction(points, is_right, weights, start, ridge)
    places = np.searchsorted(patterns.combinable, features)
    if direction is None:
        return None
    within = np.cov(points.T, aweights=weights)
    order = np.argsort(-np.abs(direction * points.std(axis=0)), kind="stable")
    return axis_of(
        patterns, places[order], direction[order], within[np.ix_(order, order)]
    )


def logistic_direction(
    points: FloatArray,
    is_right: BoolArray,
    weights: FloatArray,
    start: FloatArray,
    ridge: float,
) -> FloatArray | None:
    """Return the penalised logistic direction, by Newton steps from zero.

    Args:
        points: In standard units, shape (rows, features).
        is_right: The side of each row.
        weights: Of the rows; scaled to mean 1.
        start: What is returned if the steps do not converge to anything.
        ridge: Penalty on squared weights.
    """
    middle = points.mean(axis=0)
    unit = points.std(axis=0)
    unit = np.where(unit > 0, unit, 1.0)
    design = np.hstack(
        [np.clip((points - middle) / unit, -8, 8), np.ones((len(points), 1))]
    )
    share = weights / weights.mean()
    target = is_right.astype(np.float64)
    penalty = np.full(design.shape[1], ridge)
    penalty[-1] = 1e-6
    solution = np.zeros(design.shape[1])
    for _ in range(_NEWTON_STEPS):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ solution, -30, 30)))
        slope = design.T @ (share * (target - chance)) - penalty * solution
        curvature = (
            design * (share * np.maximum(chance * (1 - chance), 1e-4))[:, None]
        ).T @ design
        np.einsum("ii->i", curvature)[:] += penalty
        try:
            step = np.linalg.solve(curvature, slope)
        except np.linalg.LinAlgError:
            return None
        solution = solution + step
        if np.abs(step).max() < 1e-6:
            break
    direction: FloatArray = solution[:-1] / unit
    return direction if np.isfinite(direction).all() and direction.any() else start


def single_axis(feature: int) -> Axis:
    """Return the axis of one feature."""
    return single(feature)
