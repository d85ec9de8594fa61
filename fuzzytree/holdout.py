"""How well trees answer rows that they were not learnt from.

Stratified folds, made from a seed. Large tables are sampled, class by class, and with
thousands of classes fewer folds are tried, so that the test takes a bounded time and
gives the same shares each time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.learning import Settings, learn_arrays
from fuzzytree.runtimes import find_runtime
from fuzzytree.tables import Table
from fuzzytree.tree import FuzzyTree

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import FloatArray, IntArray

FOLDS = 5
CELLS = 1 << 20
"""The most numbers that the folds are made of; a larger table is sampled."""

_CLASSES = 5000
"""The most classes times folds that are learnt; at least one fold is tried."""

_FEWEST = 2 * FOLDS  # rows


class Accuracy(msgspec.Struct, frozen=True):
    """The share of rows that were answered right, for each fold.

    Attributes:
        folds: The share in each fold that was tried. A row that gets no class counts
            as wrong.
        rows: How many rows the folds are made of.
        of: How many rows the table has.
    """

    folds: tuple[float, ...]
    rows: int
    of: int

    @property
    def mean(self) -> float:
        """The mean over the folds."""
        return sum(self.folds) / len(self.folds)


def accuracy(
    table: Table,
    settings: Settings,
    *,
    folds: int = FOLDS,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> Accuracy | None:
    """Learn without each fold in turn, and count how often the tree answers it right.

    Args:
        table: The table.
        settings: How to learn.
        folds: How many folds.
        seed: Of the shuffle.
        progress: Told what is done and which share of it.

    Returns:
        The accuracies; None if the table has fewer than ten rows, or if some fold
        leaves one class to learn from.
    """
    rows = sampled(table.codes, CELLS // max(len(table.columns), 1), seed)
    if len(rows) < _FEWEST:
        return None
    codes = table.codes[rows]
    fold = folds_of(codes, folds, seed)
    shares: list[float] = []
    tried = max(1, min(folds, _CLASSES // len(table.classes)))
    for number in range(tried):
        if progress:
            progress(f"testing fold {number + 1} of {tried}", number / tried)
        kept, held = rows[fold != number], rows[fold == number]
        present, known = np.unique(table.codes[kept], return_inverse=True)
        if len(present) < 2:
            return None
        learnt = learn_arrays(
            table.values.T[kept],
            known.astype(np.int64),
            columns=table.columns,
            classes=[table.classes[code] for code in present.tolist()],
            settings=settings,
        )
        answered = _answered(learnt.tree, table, held)
        right = answered == table.codes[held]
        shares.append(float(np.count_nonzero(right)) / len(held))
    return Accuracy(tuple(shares), len(rows), len(table.codes))


def folds_of(codes: IntArray, folds: int, seed: int) -> IntArray:
    """Return a fold for each row, so that each class is spread evenly over them.

    Example:
        >>> folds_of(np.array([0, 0, 1, 1]), 2, 0).tolist()
        [0, 1, 0, 1]
    """
    found = np.empty(len(codes), np.int64)
    found[_by_class(codes, seed)] = np.arange(len(codes)) % folds
    return found


def sampled(codes: IntArray, most: int, seed: int) -> IntArray:
    """Return at most so many rows, in order, each class in its share."""
    if len(codes) <= most:
        return np.arange(len(codes))
    steps = np.arange(most) * len(codes) // most
    return np.sort(_by_class(codes, seed)[steps])


def _by_class(codes: IntArray, seed: int) -> npt.NDArray[np.intp]:
    shuffled = np.random.default_rng(seed).permutation(len(codes))
    return shuffled[np.argsort(codes[shuffled], kind="stable")]


def _answered(tree: FuzzyTree, table: Table, rows: IntArray) -> IntArray:
    """Return the code of the class of each row; -1 for none."""
    position = {name: k for k, name in enumerate(table.columns)}
    chosen = [position[name] for name in tree.inputs]
    values: FloatArray = table.values[chosen][:, rows]
    code = {label: k for k, label in enumerate(table.classes)}
    ends = np.array([-1, *(code[leaf.label] for leaf in tree.leaves)], np.int64)
    return ends[find_runtime("native").load(tree)(values).rule]
