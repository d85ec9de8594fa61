"""What the rows of a table say about a model: where they lie, and how they go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fuzzytree.auditing import AuditRows
from fuzzytree.model import (
    Document,
    FloatArray,
    IntArray,
)
from fuzzytree.runtimes import axis_lines, plan_axes

Counts = tuple[int, ...]
"""Rows of each class, in the order of the classes; rows of no class come last."""


class Data(NamedTuple):
    """The rows on every axis of a model, and the number of each row's class.

    No class has the number of the classes; there are none if no row's is known.
    """

    axes: dict[str, FloatArray]
    codes: IntArray
    classes: tuple[str, ...]

    @property
    def groups(self) -> int:
        """How many classes are counted, no class among them."""
        return len(self.classes) + 1


class Passing(NamedTuple):
    """How many rows of each class pass every node and reach every leaf."""

    nodes: tuple[Counts, ...]
    leaves: tuple[Counts, ...]
    missing: int


def data_of(model: Document, rows: AuditRows) -> Data:
    """Return the rows on every axis of a model."""
    classes = () if rows.codes is None else model.classes
    plan = plan_axes(model.variables)
    with np.errstate(over="ignore", invalid="ignore"):  # no finite number is drawn
        lines = np.asarray(axis_lines(plan, rows.values), np.float64)
    axes = {name: lines[line] for name, line in plan.line.items()}
    codes = np.zeros(rows.values.shape[1], np.int64)
    if classes and rows.codes is not None:
        codes = np.where(rows.codes < 0, len(classes), rows.codes).astype(np.int64)
    return Data(axes, codes, classes)


def passing(tree: Document, data: Data) -> Passing:
    """Return how the rows go through a tree; those with a missing value are counted."""
    known = np.isfinite(np.array([*data.axes.values()])).all(axis=0)
    nodes: list[Counts] = []
    leaves: list[Counts] = []
    todo = [(1 if tree.nodes else None, np.flatnonzero(known))]
    while todo:
        node, rows = todo.pop()
        counts = tuple(np.bincount(data.codes[rows], minlength=data.groups).tolist())
        if node is None:
            leaves.append(counts)
            continue
        nodes.append(counts)
        tested = tree.nodes[node - 1]
        interval = np.searchsorted(tested.cuts, data.axes[tested.variable][rows])
        owner = np.array(tested.owners)[interval]
        for place in reversed(range(len(tested.branches))):
            todo.append((tested.branches[place].node, rows[owner == place]))
    return Passing(tuple(nodes), tuple(leaves), int((~known).sum()))


def histogram(
    data: Data, axis: str, low: float, high: float, bins: int
) -> list[Counts]:
    """Return how many rows of each class lie in each of equally wide bins."""
    values = data.axes[axis]
    inside = (values >= low) & (values <= high)
    width = high / bins - low / bins
    if not width > 0.0:
        return []
    place = np.clip(
        ((values[inside] / 2 - low / 2) / (width / 2)).astype(np.int64), 0, bins - 1
    )
    flat = place * data.groups + data.codes[inside]
    counts = np.bincount(flat, minlength=bins * data.groups)
    return [tuple(one) for one in counts.reshape(bins, data.groups).tolist()]
