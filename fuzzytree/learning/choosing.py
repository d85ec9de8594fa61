"""Held-out rows choose: what splits the nodes, and how far the tree is pruned.

Trees are grown without a part of the rows and answer these. The cost of a leaf that
loses the fewest of them prunes the tree of all rows; among costs that are as good up to
half a standard error, half the largest is taken. A richer way to split is chosen only
if it is right on more of the rows on which two trees differ than chance explains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.binary import COSTS, BinaryTree, grown, limited, pruning
from fuzzytree.learning.nodes import SplitRules
from fuzzytree.learning.refinement import refined
from fuzzytree.learning.rows import TrainingRows
from fuzzytree.learning.sampling import hashed
from fuzzytree.learning.settings import LearningSettings
from fuzzytree.learning.splitting import Style
from fuzzytree.learning.units import FloatArray, IntArray, tallied

_FOLDS = 5
_REPEATS = 2
_FEW_ROWS = 1_000
_FEW_CELLS = 20_000
_FEWEST = 20
_ROWS = 4_000
_CELLS = 250_000
_MANY_CLASSES = 100
_COST_OF_MANY = 2.0  # of a leaf, where there are too many classes to hold rows out
_SLACK = 0.5
_STEPS_BACK = 3  # from the largest cost that is good enough: to half of it
_SURE = 0.5
_FURTHER_ROWS = 2.0 ** np.arange(-1, 9)
_COINCIDENCES = 0.02  # equal pairs for each distinct row, from which on they are many

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class ChosenTree:
    """The tree that was chosen.

    Attributes:
        tree: Pruned and refined.
        style: What splits its nodes.
        accuracy: Share of right answers among the rows held out; None without such.
        further_rows: See `_Trial`.
    """

    tree: BinaryTree
    style: Style
    accuracy: float | None
    further_rows: float


def chosen_tree(
    rows: TrainingRows,
    rules: SplitRules,
    settings: LearningSettings,
    progress: Progress,
) -> ChosenTree:
    """Return the tree for the settings, chosen by held-out rows."""
    styles = _styles(rows, rules)
    folds = folds_of_rows(rows, settings.seed, repeats=_REPEATS)
    best: _Trial | None = None
    for number, style in enumerate(styles):
        share = number / len(styles)
        progress("choosing", share)
        for trial in _tried(rows, rules, settings, folds, style):
            if best is None or trial.beats(best):
                best = trial
    assert best is not None
    progress("growing", 0.0)
    at = np.arange(rows.size)
    depth = settings.depth or rows.size
    tree = grown(
        rows, at, rules, best.style, depth, lambda share: progress("growing", share)
    )
    tree = _pruned(tree, settings, best.cost)
    if best.refines:
        tree = refined(tree, rows, at)
    return ChosenTree(tree, best.style, best.accuracy, best.further_rows)


def _styles(rows: TrainingRows, rules: SplitRules) -> list[Style]:
    """Return the ways to split that are tried, the simplest first."""
    has_combinations = rules.columns > 1 and len(rows.combinable) > 1
    classes = len(np.unique(rows.codes))
    if not has_combinations:
        return ["columns"]
    if classes > _MANY_CLASSES:
        return ["centres"]
    return ["columns", "mixed"] if classes < 3 else ["columns", "mixed", "centres"]


@dataclass(frozen=True)
class Fold:
    """Rows to learn from, and rows that are held out."""

    learnt: IntArray
    left_out: IntArray


def folds_of_rows(rows: TrainingRows, seed: int, *, repeats: int) -> list[Fold]:
    """Return folds of a bounded part of the rows, with all classes in each part.

    Copies of a row share a fold, or a tree would be tested on what it has seen.

    Args:
        rows: To learn from.
        seed: Moves the folds.
        repeats: How often few rows are divided, each time in another way.
    """
    classes = len(np.unique(rows.codes))
    if classes > _MANY_CLASSES or rows.size < _FEWEST:
        return []
    width = max(1, len(rows.searched))
    most = max(400, 4 * classes, min(_ROWS, _CELLS // width))
    few = min(_FEW_ROWS // rows.size, _FEW_CELLS // (rows.size * width))
    repeats = max(1, min(repeats, few))
    folds: list[Fold] = []
    owners = _copies(rows)
    kept = np.zeros(0, np.int64)
    for repeat in range(repeats):
        shuffled = hashed(owners + 1_000_003 * (seed + 1) + repeat)
        order = np.argsort(shuffled, kind="stable")
        if repeat == 0:
            kept = np.sort(order[:most])
        order = order[np.isin(order, kept)]
        order = order[np.argsort(rows.codes[order], kind="stable")]
        turn = np.cumsum(np.diff(owners[order], prepend=owners[order[0]]) != 0) % _FOLDS
        folds += [Fold(order[turn != k], order[turn == k]) for k in range(_FOLDS)]
    return folds


def _copies(rows: TrainingRows) -> IntArray:
    """Return a number for each row, the same for copies of one; they follow each other.

    Equal rows are copies, and no coincidence, if few of the distinct rows would be
    equal with columns that do not depend on each other.
    """
    is_new = np.ones(rows.size, bool)
    is_new[1:] = np.diff(rows.codes) != 0
    is_new[1:] |= (rows.values[1:] != rows.values[:-1]).any(axis=1)
    if is_new.all():
        return np.arange(rows.size)
    size = int(np.count_nonzero(is_new))
    chance = 1.0  # that two distinct rows have the same class and values
    for column in (rows.codes[is_new], *rows.values[is_new].T):
        _, counts = np.unique(column, return_counts=True)
        chance *= float((counts / size) @ (counts / size))
    is_coincidence = (size - 1) / 2 * chance > _COINCIDENCES
    return np.arange(rows.size) if is_coincidence else np.cumsum(is_new) - 1


@dataclass(frozen=True)
class _Trial:
    """A way to split with its best cost of a leaf.

    Attributes:
        style: What splits the nodes.
        refines: Whether the splits move afterwards.
        cost: Of a leaf, in rows.
        right: How often each row is answered rightly when it is left out.
        weights: Of the rows; 0 for those that never are.
        further_rows: How many rows that belong to all classes evenly are added to the
            leaves, for the frequencies of classes to make the rows left out likeliest.
    """

    style: Style
    refines: bool
    cost: float
    right: FloatArray
    weights: FloatArray
    further_rows: float = 2.0

    @property
    def accuracy(self) -> float | None:
        """The share of right answers, by weight."""
        if not len(self.right):
            return None
        return float(self.weights @ self.right / self.weights.sum())

    def beats(self, other: _Trial) -> bool:
        """Return whether the rows on which two trees differ favour this one."""
        won = self.weights * (self.right - other.right)
        return float(won.sum()) > _SURE * float(np.sqrt((won**2).sum()))


def _tried(
    rows: TrainingRows,
    rules: SplitRules,
    settings: LearningSettings,
    folds: list[Fold],
    style: Style,
) -> list[_Trial]:
    """Grow a tree for each fold, and find the cost that prunes them best."""
    if not folds:
        cost = _COST_OF_MANY if len(np.unique(rows.codes)) > _MANY_CLASSES else 0.0
        return [_Trial(style, False, cost, np.zeros(0), np.zeros(0))]
    right, total = np.zeros(len(COSTS)), 0.0
    trees: list[BinaryTree] = []
    for fold in folds:
        tree = grown(rows, fold.learnt, rules, style, settings.depth or rows.size)
        trees.append(tree)
        right += _right_by_cost(tree, rows, fold.left_out)
        total += float(rows.weights[fold.left_out].sum())
    lost = 1.0 - right / total
    best = max(0.0, float(lost.min()))
    held_out = len(np.unique(np.concatenate([fold.left_out for fold in folds])))
    error = _SLACK * np.sqrt(best * (1.0 - best) / held_out)
    good = np.flatnonzero(lost <= best + error + 1e-12)
    place = max(int(good.max()) - _STEPS_BACK, int(good.min()))
    cost = float(COSTS[place])
    ready = [_pruned(tree, settings, cost) for tree in trees]
    found: list[_Trial] = []
    for refines in (False, True) if style != "columns" else (False,):
        if refines:
            ready = [
                refined(tree, rows, fold.learnt)
                for tree, fold in zip(ready, folds, strict=True)
            ]
        right, weights = np.zeros(rows.size), np.zeros(rows.size)
        losses = np.zeros(len(_FURTHER_ROWS))
        for tree, fold in zip(ready, folds, strict=True):
            given = tree.answers(rows, fold.left_out)
            right[fold.left_out] += given == rows.codes[fold.left_out]
            weights[fold.left_out] += 1.0
            losses += _log_losses(tree, rows, fold)
        right /= np.maximum(weights, 1.0)
        weights = np.where(weights > 0, rows.weights, 0.0)
        further_rows = float(_FURTHER_ROWS[int(np.round(losses, 6).argmin())])
        found.append(_Trial(style, refines, cost, right, weights, further_rows))
    return found


def _log_losses(tree: BinaryTree, rows: TrainingRows, fold: Fold) -> FloatArray:
    """Return the log-loss of the rows left out, by the number of further rows.

    The chances of a row are the frequencies of the classes in its leaf.
    """
    learnt = tree.reaching(rows, fold.learnt)
    losses = np.zeros(len(_FURTHER_ROWS))
    for node, inside in tree.reaching(rows, fold.left_out).items():
        if tree.splits[node] is None:
            own = learnt[node]
            counts = tallied(rows.codes[own], rows.weights[own], rows.classes)
            of_class = (
                counts[rows.codes[inside]][:, None] + _FURTHER_ROWS / rows.classes
            )
            chances = of_class / (counts.sum() + _FURTHER_ROWS)
            losses -= rows.weights[inside] @ np.log(chances)
    return losses


def _right_by_cost(tree: BinaryTree, rows: TrainingRows, at: IntArray) -> FloatArray:
    """Return the weight of right answers for each cost of a leaf."""
    reached = tree.reaching(rows, at)
    own = np.zeros(len(tree.splits))
    for node, inside in reached.items():
        is_right = rows.codes[inside] == tree.labels[node]
        own[node] = rows.weights[inside][is_right].sum()
    ends = pruning(tree, COSTS).ends
    total = np.zeros((len(own), len(COSTS)))
    for node in reversed(range(len(own))):
        left, right = tree.children[node]
        below = total[left] + total[right] if left else 0.0
        total[node] = np.where(ends[node], own[node], below)
    whole: FloatArray = total[0]
    return whole


def _pruned(tree: BinaryTree, settings: LearningSettings, cost: float) -> BinaryTree:
    """Return a tree pruned by the cost of a leaf and by the most leaves.

    The split at the root stays, so that there is a question at all.
    """
    ends = pruning(tree, np.array([cost])).ends[:, 0]
    ends[0] = False
    tree = tree.kept(ends)
    if settings.leaves is not None and tree.leaves > settings.leaves:
        tree = tree.kept(limited(tree, settings.leaves)[-1])
    return tree
