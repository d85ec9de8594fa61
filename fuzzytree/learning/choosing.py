"""Rows set aside choose: what splits the nodes, how many leaves, how firmly to tune.

Trees are grown without a part of the rows, pruned by falling costs of a leaf, tuned,
and rated by the rows left out: each adds 1 if it is answered right, less half its
log-loss. Of each way to split the smallest trees count that are as good as the best, up
to half a standard error; the way with the best score is taken. The same rows say what
accuracy costs, by how many columns a node looks at and by leaves (`front_of`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from fuzzytree.learning.binary import BinaryTree, GrowingTree, limited, pruned
from fuzzytree.learning.rows import SplitRules, TrainingRows
from fuzzytree.learning.sampling import hashed
from fuzzytree.learning.settings import LearningSettings
from fuzzytree.learning.splitting import Style
from fuzzytree.learning.tuning import SoftTree
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray, tallied
from fuzzytree.model import Result

_COSTS = (*(512.0 / 2**k for k in range(11)), 0.0)  # of a leaf, in rows
_FOLDS = 5
_FEWEST = 20
_ROWS = 4_000
_CELLS = 250_000
_MANY_CLASSES = 100
_ONE_STYLE = 30  # classes; of more a node tests where their centres part
_FOLDS_OF_MANY = 2  # of the five, that are held out
_COST_OF_MANY = 2.0  # of a leaf, where there are too many classes to hold rows out
_SLACK = 0.5  # in standard errors
_PATIENCE = 2
_LOOSE = 3.0  # penalties on moving a gate
_FIRM = 30.0
_UNLIKELY = 1e-3
_DIGITS = 6
_FURTHER_ROWS = 2.0 ** np.arange(-1, 9)
_COINCIDENCES = 0.02  # equal pairs for each distinct row, from which on they are many

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class ChosenTree:
    """The tree that was chosen.

    Attributes:
        tree: Pruned and tuned.
        style: What splits its nodes.
        accuracy: Share of right answers among the rows held out; None without such.
        further_rows: How many rows that belong to all classes evenly are added to the
            leaves, for the frequencies of classes to make the rows left out likeliest.
    """

    tree: BinaryTree
    style: Style
    accuracy: float | None
    further_rows: float = 2.0


def chosen_tree(
    rows: TrainingRows,
    rules: SplitRules,
    settings: LearningSettings,
    progress: Progress,
) -> ChosenTree:
    """Return the tree for the settings, chosen by held-out rows."""
    styles, folds = _styles(rows, rules), folds_of_rows(rows, settings.seed)
    depth = settings.depth or rows.size
    trials: list[_Trial] = []
    for number, style in enumerate(styles if folds else ()):
        progress("choosing", number / len(styles))
        trees = [GrowingTree(rows, fold.learnt, rules, style, depth) for fold in folds]
        trials.append(_best_size(rows, settings, folds, style, trees, rules.min_rows))
    best = max(trials, key=lambda trial: trial.score) if trials else None
    if best is not None and best.style != "columns":
        further = _tried(
            rows, folds, best.style, best.cost, best.trees, _FIRM, rules.min_rows
        )
        if further.score > best.score:
            best = further
    progress("growing", 0.0)
    at = np.arange(rows.size)
    style, cost = styles[0], 0.0
    if best is not None:
        style, cost = best.style, best.cost
    elif len(np.unique(rows.codes)) > _MANY_CLASSES:
        cost = _COST_OF_MANY
    tree = GrowingTree(rows, at, rules, style, depth).grown(
        cost, lambda share: progress("growing", share)
    )
    tree = _pruned(tree, settings, cost)
    if best is None:
        return ChosenTree(tree, style, None)
    soft = SoftTree.of(tree, rows, at)
    tree = soft.tuned(best.penalty).crisp(rules.min_rows)
    return ChosenTree(tree, style, best.accuracy, best.further_rows(rows, folds))


def _styles(rows: TrainingRows, rules: SplitRules) -> list[Style]:
    """Return the ways to split that are tried, the simplest first."""
    has_combinations = rules.columns > 1 and len(rows.combinable) > 1
    classes = len(np.unique(rows.codes))
    if not has_combinations:
        return ["columns"]
    if classes > _ONE_STYLE:
        return ["centres"]
    return ["columns", "mixed"] if classes < 3 else ["columns", "mixed", "centres"]


@dataclass(frozen=True)
class Fold:
    """Rows to learn from, and rows that are held out."""

    learnt: IntArray
    left_out: IntArray


def folds_of_rows(rows: TrainingRows, seed: int) -> list[Fold]:
    """Return folds of a bounded part of the rows, with all classes in each part.

    Copies of a row share a fold, or a tree would be tested on what it has seen.

    Args:
        rows: To learn from.
        seed: Moves the folds.
    """
    classes = len(np.unique(rows.codes))
    if classes > _MANY_CLASSES or rows.size < _FEWEST:
        return []
    width = max(1, len(rows.searched))
    most = max(400, 4 * classes, min(_ROWS, _CELLS // width))
    owners = _copies(rows)
    order = np.argsort(hashed(owners + 1_000_003 * (seed + 1)), kind="stable")[:most]
    order = order[np.argsort(rows.codes[order], kind="stable")]
    turn = np.cumsum(np.diff(owners[order], prepend=owners[order[0]]) != 0) % _FOLDS
    learnt = [np.sort(order[turn != k]) for k in range(_FOLDS)]
    count = _FOLDS if classes <= _ONE_STYLE else _FOLDS_OF_MANY
    return [Fold(learnt[k], order[turn == k]) for k in range(count)]


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
    """Trees of one way to split and one cost of a leaf, rated by rows held out.

    Attributes:
        style: What splits the nodes.
        cost: Of a leaf, in rows.
        penalty: On moving a gate when the trees are tuned.
        trees: One for each fold, pruned and not yet tuned.
        crisp: The same, tuned.
        is_right: Of the rows held out, fold by fold: whether they are answered right.
        likely: The logarithms of the chances that their own classes are given.
        weights: Their weights.
    """

    style: Style
    cost: float
    penalty: float
    trees: list[BinaryTree]
    crisp: list[BinaryTree]
    is_right: BoolArray
    likely: FloatArray
    weights: FloatArray

    @property
    def accuracy(self) -> float:
        """The share of right answers, by weight."""
        return float(self.weights @ self.is_right / self.weights.sum())

    @property
    def scores(self) -> FloatArray:
        """What each row adds to the score: 1 if it is right, less half its log-loss."""
        return self.weights * (self.is_right + self.likely / 2)

    @property
    def score(self) -> float:
        """The whole score, rounded so that it is the same on every machine."""
        return round(float(self.scores.sum()), _DIGITS)

    def is_as_good_as(self, other: _Trial) -> bool:
        """Return whether the score is lower by no more than chance explains."""
        lost = other.scores - self.scores
        error = _SLACK * float(np.sqrt((lost**2).sum()))
        return round(float(lost.sum()) - error, _DIGITS) <= 0.0

    def further_rows(self, rows: TrainingRows, folds: list[Fold]) -> float:
        """Return `ChosenTree.further_rows`."""
        losses = np.zeros(len(_FURTHER_ROWS))
        for tree, fold in zip(self.crisp, folds, strict=True):
            losses += _log_losses(tree, rows, fold)
        return float(_FURTHER_ROWS[int(np.round(losses, 6).argmin())])


def _best_size(
    rows: TrainingRows,
    settings: LearningSettings,
    folds: list[Fold],
    style: Style,
    trees: list[GrowingTree],
    min_rows: int,
) -> _Trial:
    """Return the smallest trees that are as good as the best.

    Costs of a leaf fall until the trees have grown several times for nothing.
    """
    trials: list[_Trial] = []
    leaves: list[int] = []
    best = 0
    for cost in _COSTS:
        smaller = [_pruned(tree.grown(cost), settings, cost) for tree in trees]
        sizes = [tree.leaves for tree in smaller]
        if sizes == leaves:
            continue
        leaves = sizes
        last = trials[-1] if trials else None
        trial = _tried(rows, folds, style, cost, smaller, _LOOSE, min_rows, last)
        trials.append(trial)
        if trial.score > trials[best].score:
            best = len(trials) - 1
        elif len(trials) > best + _PATIENCE:
            break
    return next(trial for trial in trials if trial.is_as_good_as(trials[best]))


def _tried(
    rows: TrainingRows,
    folds: list[Fold],
    style: Style,
    cost: float,
    trees: list[BinaryTree],
    penalty: float,
    min_rows: int,
    last: _Trial | None = None,
) -> _Trial:
    """Tune the tree of each fold and let it answer the rows held out.

    A tree that the last trial has tuned, as firmly, is taken from there.
    """
    ends = np.cumsum([len(fold.left_out) for fold in folds])[:-1]
    crisp: list[BinaryTree] = [] if last is None else [*last.crisp]
    right = [] if last is None else np.split(last.is_right, ends)
    likely = [] if last is None else np.split(last.likely, ends)
    for number, (tree, fold) in enumerate(zip(trees, folds, strict=True)):
        if last is not None and tree.is_alike(last.trees[number]):
            continue
        soft = SoftTree.of(tree, rows, fold.learnt).tuned(penalty)
        at = slice(number, number + 1)
        crisp[at] = [soft.crisp(min_rows)]
        codes = rows.codes[fold.left_out]
        right[at] = [crisp[number].answers(rows, fold.left_out) == codes]
        own = soft.chances(fold.left_out)[np.arange(len(codes)), codes]
        likely[at] = [np.log(np.maximum(own, _UNLIKELY))]
    weights = rows.weights[np.concatenate([fold.left_out for fold in folds])]
    joined = np.concatenate(right), np.concatenate(likely)
    return _Trial(style, cost, penalty, trees, crisp, *joined, weights)


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


def _pruned(tree: BinaryTree, settings: LearningSettings, cost: float) -> BinaryTree:
    """Return a tree pruned by the cost of a leaf and by the most leaves."""
    tree = pruned(tree, cost)
    if settings.leaves is not None and tree.leaves > settings.leaves:
        tree = tree.kept(limited(tree, settings.leaves)[-1])
    return tree


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
