"""A tree by descent, in numpy, and one row of it in plain Python."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.model.contracts import Dtype, Outcome, Run
from fuzzytree.model.tree import FuzzyTree
from fuzzytree.runtimes.axes import (
    Axes,
    axis_lines,
    axis_row,
    missing_rows,
    plan_axes,
)
from fuzzytree.runtimes.degrees import NUMBERS
from fuzzytree.runtimes.descent import (
    CHUNK,
    AxisSplit,
    Descent,
    Desk,
    descend_row,
    descend_rows,
    plan_descent,
)
from fuzzytree.runtimes.rows import checked

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray


def follow(tree: FuzzyTree, dtype: Dtype = "float64") -> Run:
    """Return a function that follows one path of a tree for every row.

    Args:
        tree: The tree.
        dtype: The number type of values and cuts; `mixed` compares in double.

    Returns:
        A function from values of shape (inputs, rows) to an outcome without strengths.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(0)
        >>> follow(tree)(np.zeros((len(tree.inputs), 2))).status.tolist()
        [0, 0]
    """
    kind = NUMBERS[dtype].axis
    axes = plan_axes(tree.variables, kind)
    return descend_by(axes, plan_descent(_splits(tree, axes), kind), tree.inputs)


def descend_by(axes: Axes, descent: Descent, inputs: tuple[str, ...]) -> Run:
    """Return a function that descends planned splits on planned axes."""
    is_plain = not axes.steps and axes.dtype == np.float64

    def run(values: FloatArray) -> Outcome:
        array = checked(values, inputs)
        count = array.shape[1]
        if count == 1 and axes.dtype == np.float64:
            row = axis_row(axes, array[:, 0].tolist())
            return _one(descent.splits, row)
        rule = np.empty(count, np.int64)
        status = np.zeros(count, np.int64)
        desk = Desk(min(count, CHUNK), axes.dtype)
        with np.errstate(all="ignore"):
            for start in range(0, count, CHUNK):
                part = slice(start, start + CHUNK)
                if is_plain and array.flags.c_contiguous:
                    descend_rows(descent, array, start, rule[part], desk)
                    lines = array[:, part]
                else:
                    lines = np.ascontiguousarray(axis_lines(axes, array[:, part]))
                    descend_rows(descent, lines, 0, rule[part], desk)
                missing = missing_rows(lines)
                if missing is not None:
                    rule[part][missing] = 0
                    status[part][missing] = 3
        return Outcome(rule, status)

    return run


def _one(splits: tuple[AxisSplit, ...], row: list[float]) -> Outcome:
    if math.isfinite(sum(row)) or all(map(math.isfinite, row)):
        return Outcome(np.array([descend_row(splits, row)]), np.array([0]))
    return Outcome(np.array([0]), np.array([3]))


def _splits(tree: FuzzyTree, axes: Axes) -> list[AxisSplit]:
    found: list[AxisSplit] = []
    for node in tree.nodes:
        ends = [
            -branch.leaf if branch.leaf is not None else (branch.node or 0) - 1
            for branch in node.branches
        ]
        targets = tuple(ends[owner] for owner in node.owners)
        found.append(AxisSplit(axes.line[node.variable], node.cuts, targets))
    return found
