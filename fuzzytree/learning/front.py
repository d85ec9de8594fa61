"""What accuracy costs: by how many columns a node looks at, and by leaves."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from fuzzytree.learning.binary import GrowingTree, limited
from fuzzytree.learning.choosing import Fold, folds_of_rows
from fuzzytree.learning.nodes import SplitRules
from fuzzytree.learning.rows import TrainingRows
from fuzzytree.learning.settings import LearningSettings
from fuzzytree.learning.splitting import Style
from fuzzytree.learning.units import FloatArray
from fuzzytree.model import Result

LEAVES = (2, 3, 4, 5, 6, 8, 10, 12, 16, 20)
"""Numbers of leaves that are shown."""

_COLUMNS = (1, 2, 3)
_COST = 1.0  # nodes with so few wrong rows are not split


class Front(Result, msgspec.Struct, frozen=True):
    """The share of rows that small trees answer right, rows that were held out.

    Attributes:
        columns: How many columns a node looks at, at most; None for all.
        leaves: How many leaves a tree has, at most.
        accuracy: The share of right answers, for each of `columns` by `leaves`.
        majority: The share of the most common class.
        rows: How many rows were held out, each once.
    """

    columns: tuple[int | None, ...]
    leaves: tuple[int, ...]
    accuracy: tuple[tuple[float, ...], ...]
    majority: float
    rows: int

    def __str__(self) -> str:
        """Show a table: a line for each number of leaves."""
        heads = ["all" if k is None else str(k) for k in self.columns]
        lines = ["leaves " + " ".join(f"{head:>5}" for head in heads)]
        for place, leaves in enumerate(self.leaves):
            shares = [f"{row[place]:.3f}" for row in self.accuracy]
            lines.append(f"{leaves:6} " + " ".join(shares))
        return "\n".join(lines)


def front_of(
    rows: TrainingRows, rules: SplitRules, settings: LearningSettings
) -> Front | None:
    """Return the accuracies of small trees; None where rows are too few to hold out.

    Args:
        rows: To learn from.
        rules: What a split must keep to.
        settings: How to learn; its `leaves` and `depth` are limits here too.
    """
    folds = folds_of_rows(rows, settings.seed)
    if not folds:
        return None
    wide = min(rules.columns, max(len(rows.combinable), 1))
    columns: list[int | None] = [k for k in _COLUMNS if k < wide]
    columns.append(None)
    most = settings.leaves or LEAVES[-1]
    leaves = tuple(k for k in LEAVES if k <= most) or (most,)
    held_out = np.concatenate([fold.left_out for fold in folds])
    total = float(rows.weights[held_out].sum())
    accuracy: list[tuple[float, ...]] = []
    for number in columns:
        limit = replace(rules, columns=rules.columns if number is None else number)
        style: Style = "columns" if limit.columns == 1 else "mixed"
        right = np.zeros(len(leaves))
        for fold in folds:
            right += _right(rows, limit, settings, fold, style, leaves)
        accuracy.append(tuple((right / total).tolist()))
    counts = np.bincount(rows.codes[held_out], rows.weights[held_out])
    share = float(counts.max() / total)
    return Front(tuple(columns), leaves, tuple(accuracy), share, len(held_out))


def _right(
    rows: TrainingRows,
    rules: SplitRules,
    settings: LearningSettings,
    fold: Fold,
    style: Style,
    leaves: tuple[int, ...],
) -> FloatArray:
    """Return the weight of right answers in a fold, by the number of leaves."""
    depth = settings.depth or rows.size
    tree = GrowingTree(rows, fold.learnt, rules, style, depth).grown(_COST)
    ends = limited(tree, leaves[-1])
    found = np.zeros(len(leaves))
    for place, most in enumerate(leaves):
        answers = tree.kept(ends[most - 1]).answers(rows, fold.left_out)
        is_right = answers == rows.codes[fold.left_out]
        found[place] = rows.weights[fold.left_out][is_right].sum()
    return found
