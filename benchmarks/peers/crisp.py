"""A tree as other libraries hold one: questions `value <= cut` with two ways on."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fuzzytree.benchmarking.records import CandidateOutput
from fuzzytree.errors import LossError
from fuzzytree.runtimes.rows import Axes, axis_lines, axis_row, checked

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model.contracts import FloatArray, IntArray
    from fuzzytree.model.tree import FuzzyTree

    Reals = npt.NDArray[np.floating[Any]]

_MOST = 200_000

NOWHERE = -1


class NodeTable(NamedTuple):
    """A binary tree in flat arrays; position 0 is its root, and parents come first.

    Attributes:
        line: The line of the axis that is tested; -1 in a leaf.
        cut: On to the left for values up to it; 0 in a leaf.
        left: The position of the way on to the left; -1 in a leaf.
        right: The same to the right.
        leaf: The number of the leaf; 0 in a question.
        label: The class number of the leaf; 0 in a question.
    """

    line: IntArray
    cut: FloatArray
    left: IntArray
    right: IntArray
    leaf: IntArray
    label: IntArray

    @property
    def is_leaf(self) -> npt.NDArray[np.bool_]:
        """Where the leaves are."""
        return self.leaf > 0


def nodes_of(tree: FuzzyTree, axes: Axes) -> NodeTable:
    """Return a tree as questions with two ways on, the same answers and cuts.

    A node of several cuts becomes a balanced cascade of them. A branch that owns
    several intervals stands there once for each.

    Raises:
        LossError: If so many copies of branches would stand in it that it explodes.

    Example:
        >>> from fuzzytree.runtimes.rows import plan_axes
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, leaves=3)
        >>> nodes = nodes_of(tree, plan_axes(tree.variables))
        >>> nodes.leaf[nodes.is_leaf].tolist()
        [1, 2, 3]
    """
    code = {label: number for number, label in enumerate(tree.classes)}
    found: list[list[float]] = []
    todo: list[tuple[tuple[int, int, int], int, int]] = [(_entry(tree, 1), -1, 0)]
    while todo:
        way, parent, side = todo.pop()
        if parent >= 0:
            found[parent][side] = len(found)
        number, low, high = way
        if low == high:
            leaf = tree.leaves[number - 1]
            found.append([-1, 0.0, NOWHERE, NOWHERE, number, code[leaf.label]])
            continue
        middle = (low + high) // 2
        node = tree.nodes[number - 1]
        here = len(found)
        found.append([axes.line[node.variable], node.cuts[middle], 0, 0, 0, 0])
        todo.append((_way(tree, number, middle + 1, high), here, 3))
        todo.append((_way(tree, number, low, middle), here, 2))
        if here > _MOST:
            raise LossError(
                f"{tree.name} has more than {_MOST} questions when written without "
                "shared branches"
            )
    columns = np.array(found).T
    line, left, right, leaf_number, label = (
        columns[i].astype(np.int64) for i in (0, 2, 3, 4, 5)
    )
    return NodeTable(line, columns[1], left, right, leaf_number, label)


def _entry(tree: FuzzyTree, number: int) -> tuple[int, int, int]:
    """Return the whole span of a node's cuts; the first leaf if there is no node."""
    return (number, 0, len(tree.nodes[number - 1].cuts)) if tree.nodes else (1, 0, 0)


def _way(tree: FuzzyTree, number: int, low: int, high: int) -> tuple[int, int, int]:
    """Return (node, first cut, end of the cuts) of what lies there, or (leaf, 0, 0)."""
    if low < high:
        return number, low, high
    node = tree.nodes[number - 1]
    branch = node.branches[node.owners[low]]
    if branch.node is None:
        return branch.leaf or 0, 0, 0
    return _entry(tree, branch.node)


def lines_of(axes: Axes, values: FloatArray) -> Reals:
    """Return the value of every variable, shape (variables, rows), as fast as ours.

    Args:
        axes: How to compute them.
        values: Shape (inputs, rows).
    """
    if values.shape[1] == 1 and axes.steps:
        return np.array([axis_row(axes, values[:, 0].tolist())]).T
    with np.errstate(all="ignore"):
        return axis_lines(axes, values)


def tables(
    axes: Axes, dtype: type[np.floating[Any]], values: FloatArray
) -> Callable[[], Reals]:
    """Lay out values as a table with a line for each row; return what gives it.

    Inputs are laid out now. Combinations are computed in every call, as our own
    runtimes do, and put beside them.

    Args:
        axes: How to compute the variables; their lines are the table's columns.
        dtype: In what the table is.
        values: Shape (inputs, rows).
    """
    table: Reals = np.zeros((values.shape[1], axes.count), dtype)
    with np.errstate(over="ignore"):
        table[:, : axes.inputs] = values.T

    def filled() -> Reals:
        table[:, axes.inputs :] = lines_of(axes, values)[axes.inputs :].T
        return table

    return filled if axes.steps else lambda: table


def guarded(
    tree: FuzzyTree,
    axes: Axes,
    dtype: type[np.floating[Any]],
    ask: Callable[[FloatArray], IntArray],
) -> Callable[[FloatArray], CandidateOutput]:
    """Return what answers rows: those with a missing value without asking the peer.

    Args:
        tree: The model, whose answer for missing values is given.
        axes: Its variables.
        dtype: What the peer computes in; a value beyond it is missing.
        ask: The class numbers of rows without missing values.
    """
    missing_label = _number(tree, tree.semantics.missing)

    def answer(values: FloatArray) -> CandidateOutput:
        array = checked(values, tree.inputs)
        with np.errstate(all="ignore"):
            lines = lines_of(axes, array).astype(dtype)
        known = np.isfinite(lines).all(axis=0)
        labels = np.full(array.shape[1], missing_label)
        if known.any():
            labels[known] = ask(np.ascontiguousarray(array[:, known]))
        return CandidateOutput(labels)

    return answer


def _number(tree: FuzzyTree, label: str | None) -> int:
    return -1 if label is None else tree.classes.index(label)
