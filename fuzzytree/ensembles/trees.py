"""Trees of other libraries as one value: cuts, ways of missing values, leaf vectors.

Each library has its own test at a node: `float32(x) <= t`, `x < t` in floats of 32
bits, `x <= t` in doubles, and so on. All are brought to `x <= cut` for a double x, with
the exact cut, so that what is compared later are functions and not spellings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from fuzzytree.errors import ReadError
from fuzzytree.model import BoolArray, FloatArray, IntArray

MOST_NODES = 4_000_000
MOST_SCORES = 10_000
MOST_NUMBERS = 1 << 27  # of leaf vectors

Rows = Literal["float32", "float64"]
"""The number type of rows."""

SINGLE, DOUBLE = 2.0**-24, 2.0**-53
"""How much one rounding can change a number, relative to it."""


@dataclass(frozen=True)
class Tree:
    """A tree whose node 0 is the root; without nodes it is one leaf.

    Attributes:
        columns: The column that each node tests, counted from 0.
        cuts: A double goes left if it is at most this.
        is_missing_left: Whether NaN goes left.
        left, right: The next node, or `~leaf`.
        values: What a leaf adds to each score, shape (leaves, scores).
    """

    columns: IntArray
    cuts: FloatArray
    is_missing_left: BoolArray
    left: IntArray
    right: IntArray
    values: FloatArray

    @staticmethod
    def of(
        columns: Sequence[int] | IntArray,
        cuts: Sequence[float] | FloatArray,
        is_missing_left: Sequence[bool] | BoolArray,
        left: Sequence[int] | IntArray,
        right: Sequence[int] | IntArray,
        values: FloatArray,
        root: int = 0,
        *,
        name: str,
    ) -> Tree:
        """Return a tree with its nodes and leaves in depth-first order.

        A node may have two parents. What no path reaches is left out.

        Raises:
            ReadError: If a number is no cut or value, an index leads nowhere, or a path
                comes back to its start.
        """
        count, leaves = len(columns), len(values)
        if count > MOST_NODES or values.size > MOST_NUMBERS:
            raise ReadError(
                f"{name}: a tree has {count:,} nodes; at most {MOST_NODES:,} are read"
            )
        if not np.isfinite(values).all():
            raise ReadError(f"{name}: a leaf adds a number that is not finite")
        if np.isnan(np.asarray(cuts, np.float64)).any():
            raise ReadError(f"{name}: a cut is NaN")
        if count and np.asarray(columns).min() < 0:
            raise ReadError(f"{name}: a node tests a column before the first")
        lefts = left.tolist() if isinstance(left, np.ndarray) else left
        rights = right.tolist() if isinstance(right, np.ndarray) else right
        order: list[int] = []
        leaf_order: list[int] = []
        place: dict[int, int] = {}
        open_nodes: set[int] = set()
        todo = [root]
        while todo:
            at = todo.pop()
            if at in open_nodes:  # all below it was visited
                open_nodes.discard(at)
                continue
            if at >= count or ~at >= leaves:
                raise ReadError(f"{name}: a child of a node, {at}, is not in the tree")
            if at in place:
                continue
            if at < 0:
                place[at] = ~len(leaf_order)
                leaf_order.append(~at)
                continue
            place[at] = len(order)
            order.append(at)
            open_nodes.add(at)
            children = lefts[at], rights[at]
            if open_nodes.intersection(children):
                raise ReadError(f"{name}: a path of a tree comes back to node {at}")
            todo += [at, children[1], children[0]]
        return Tree(
            np.asarray(columns, np.int64)[order],
            np.asarray(cuts, np.float64)[order],
            np.asarray(is_missing_left, np.bool_)[order],
            np.array([place[lefts[at]] for at in order], np.int64),
            np.array([place[rights[at]] for at in order], np.int64),
            values[leaf_order],
        )

    def leaves_of(self, rows: FloatArray) -> IntArray:
        """Return the leaf that each row arrives at, shape (rows,)."""
        at = np.full(len(rows), 0 if len(self.columns) else -1, np.int64)
        while len(inside := np.flatnonzero(at >= 0)):
            node = at[inside]
            values = rows[inside, self.columns[node]]
            is_left = values <= self.cuts[node]
            is_left |= np.isnan(values) & self.is_missing_left[node]
            at[inside] = np.where(is_left, self.left[node], self.right[node])
        return ~at


@dataclass(frozen=True)
class Ensemble:
    """The sum of trees, and what a library makes of it.

    Attributes:
        name: Of the file or the object.
        kind: What it is, such as `RandomForestClassifier`.
        trees: Their leaves hold what is added, an average its share.
        base: What is added to the sum, for each score.
        link: What makes outputs of scores.
        decides: How scores make a class: the largest, the only one above `bar`, or not
            at all.
        bar: See `decides`.
        classes: Their labels; None where the file has only numbers of classes.
        unit: What one rounding of its sum changes, relative to the result.
        label_slack: How far from a tie the link may round a score onto it.
        takes: The number type to which it rounds rows.
        takes_missing: Whether it accepts NaN.
        takes_infinite: Whether it accepts infinity.
        has_labels_alone: Whether scores say no more than the class.
        width: How many columns it takes; None where the file does not say.
        columns: Their names, where they are known.
        remarks: What the program does that the file does not say.
    """

    name: str
    kind: str
    trees: Sequence[Tree]
    base: FloatArray
    link: Literal["none", "logistic", "softmax"] = "none"
    decides: Literal["largest", "above", "not"] = "not"
    bar: float = 0.0
    classes: Sequence[object] | None = None
    unit: float = DOUBLE
    label_slack: float = 0.0
    takes: Rows = "float64"
    takes_missing: bool = True
    takes_infinite: bool = True
    has_labels_alone: bool = False
    width: int | None = None
    columns: Sequence[str] | None = None
    remarks: Sequence[str] = field(default=())

    def __post_init__(self) -> None:
        nodes = sum(len(tree.columns) for tree in self.trees)
        if nodes > MOST_NODES:
            raise ReadError(
                f"{self.name}: {nodes:,} nodes; at most {MOST_NODES:,} are read"
            )

    @property
    def leaf_count(self) -> int:
        """How many leaves all trees have."""
        return sum(len(tree.values) for tree in self.trees)

    @property
    def highest_column(self) -> int:
        """The last column that a node tests; -1 without nodes."""
        tested = [int(tree.columns.max()) for tree in self.trees if len(tree.columns)]
        return max(tested, default=-1)

    def scores(self, rows: FloatArray) -> FloatArray:
        """Return the sums in doubles, shape (rows, scores)."""
        total = np.zeros((len(rows), len(self.base)))
        for tree in self.trees:
            total += tree.values[tree.leaves_of(rows)]
        return total + self.base

    def sizes(self) -> FloatArray:
        """Return a bound of the sum of all absolute values, for each score."""
        largest = [np.abs(tree.values).max(axis=0) for tree in self.trees]
        total: FloatArray = np.sum(largest, axis=0, initial=0.0) + np.abs(self.base)
        return total

    def is_exact(self) -> bool:
        """Return whether no sum is rounded, whatever its order.

        Multiples of a power of two have exact sums, if the mantissa of the number type
        is wide enough for the largest one.
        """
        bits = 24 if self.unit == SINGLE else 53
        _, exponent = math.frexp(float(np.max(self.sizes())))
        step = 2.0 ** (exponent - bits)
        parts = [self.base, *(tree.values for tree in self.trees)]
        return self.link == "none" and all((part % step == 0).all() for part in parts)

    def rounding(self) -> FloatArray:
        """Return by how much its own sum can be off, for each score.

        A sum of n numbers in any order is off by at most gamma(n) times the sum of
        their absolute values, with gamma(n) = n u / (1 - n u) (Higham, Accuracy and
        Stability of Numerical Algorithms, 2nd edition, section 4.2); n counts the base
        and the factor of an average as well.
        """
        share = (len(self.trees) + 2) * self.unit
        return self.sizes() * (share / (1.0 - share))
