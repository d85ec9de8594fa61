"""How well trees answer rows that they were not learnt from.

Stratified folds, made from a seed; each chooses anew how to split and to prune. Large
tables are sampled, class by class, and with thousands of classes fewer folds are tried.
So the test takes a bounded time, and gives the same shares each time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.errors import TableError
from fuzzytree.learning import (
    ArrayLearner,
    Front,
    LearningReport,
    LearningSettings,
    Learnt,
    class_weights,
    codes_of_positions,
    learn_arrays,
    rows_beyond,
)
from fuzzytree.model import (
    USUAL_FLOOR,
    BoolArray,
    FloatArray,
    FuzzyTree,
    IntArray,
    RuleBase,
)
from fuzzytree.runtimes import baseline
from fuzzytree.semantics import rules_from_tree
from fuzzytree.tables import Table

if TYPE_CHECKING:
    import numpy.typing as npt


FOLDS = 5
ROWS = 20_000
CELLS = 1 << 20
"""The most rows and numbers that the folds are made of; larger tables are sampled."""

_CLASSES = 5000
"""The most classes times folds that are learnt; at least one fold is tried."""

_COLUMNS = 200_000
"""The most columns times folds that are learnt; at least one fold is tried."""

MOST_WEAK = 0.05
"""The largest share of rows, of groups that were left out, below the usual floor."""

_FEWEST = 2 * FOLDS  # rows

_UNSEEN, _TESTED = 1_000, 200_000
"""The fewest rows of each class to test a tree itself on, and the most of all."""


class Accuracy(msgspec.Struct, frozen=True):
    """The share of rows that were predicted right, for each fold.

    Attributes:
        folds: The share in each fold that was tried, by the weights of rows and
            classes. A row that gets no class counts as wrong. One for a tree that was
            tested itself.
        rows: How many rows the folds are made of.
        of: How many rows the table has.
        weak: The share of the rows of groups that were left out for which the raw rule
            that decides is weaker than `USUAL_FLOOR`; None without groups or sets.
        is_of_tree: Whether the tree itself was tested, on rows that it was not learnt
            from, and no folds were made.
    """

    folds: tuple[float, ...]
    rows: int
    of: int
    weak: float | None = None
    is_of_tree: bool = False

    @property
    def mean(self) -> float:
        """The mean over the folds."""
        return sum(self.folds) / len(self.folds)

    @property
    def floor(self) -> float:
        """The floor of strengths: 0 if the usual one rejects more than `MOST_WEAK`."""
        return USUAL_FLOOR if (self.weak or 0.0) <= MOST_WEAK else 0.0


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """What `learn` read, learnt, tested and wrote.

    Attributes:
        file: The file that was written.
        fingerprint: Of the tree.
        rows: Rows of the table that have a class.
        columns: The columns to learn from.
        classes: The classes.
        missing_cells: Cells without a value.
        rows_without_class: Rows that were left out because they have no class.
        rows_without_weight: Rows that were left out because their weight is 0.
        remarks: Columns that look unsuitable, each with the reason.
        inputs: The columns that the tree needs.
        leaves: Leaves of the tree.
        accuracy: The cross-validated accuracy, by the weights of rows and classes, the
            mean over the folds; null without a test.
        majority: The accuracy, by the same weights, of always predicting one class.
        folds: The accuracy of each fold; null without folds.
        rows_tested: How many rows the folds are made of, or without folds, on how many
            that it was not learnt from the tree was tested; null without a test.
        seed: Of the folds.
        report: What learning counted and repaired.
        front: How accurate small trees are; null without a test.
    """

    file: str
    fingerprint: str
    rows: int
    columns: tuple[str, ...]
    classes: tuple[str, ...]
    missing_cells: int
    rows_without_class: int
    rows_without_weight: int
    remarks: dict[str, str]
    inputs: tuple[str, ...]
    leaves: int
    accuracy: float | None
    majority: float
    folds: tuple[float, ...] | None
    rows_tested: int | None
    seed: int
    report: LearningReport
    front: Front | None = None


def majority(table: Table, settings: LearningSettings) -> float:
    """Return the accuracy, by weight, of always predicting the same class.

    Args:
        table: The table.
        settings: How to learn; weights of classes count.
    """
    counts = np.bincount(table.codes, _weights(table, settings))
    return float(counts.max() / counts.sum())


def _weights(table: Table, settings: LearningSettings) -> FloatArray | None:
    """Return the weights of rows times those of their classes; None if all are 1."""
    weights = table.row_weights if table.weights is None else table.weights
    if settings.class_weight is None:
        return weights
    found = np.ones(len(table.codes)) if weights is None else weights
    heavy = class_weights(settings.class_weight, table.classes, table.codes, found)
    whole: FloatArray = found * heavy[table.codes]
    return whole


def accuracy(
    table: Table,
    settings: LearningSettings,
    *,
    seed: int = 0,
    groups: IntArray | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Accuracy | None:
    """Learn without each fold in turn, and count how often the tree answers it right.

    Args:
        table: The table.
        settings: How to learn.
        seed: Of the shuffle.
        groups: A number for each row; rows of the same number are in the same fold.
        progress: Called with what is done and which share of it.

    Returns:
        The accuracies; None if the table has fewer than ten rows, or if some fold
        leaves one class to learn from.
    """
    if settings.learns_rules(len(table.classes)):  # of which a fold may lack some
        settings = msgspec.structs.replace(settings, form="rules")
    width = max(len(table.columns), 1)
    rows = sampled(table.codes, min(ROWS, CELLS // width), seed)
    if len(rows) < _FEWEST:
        return None
    codes = table.codes[rows]
    if groups is None:
        fold = folds_of(codes, FOLDS, seed)
    else:
        _, first, group = np.unique(
            groups[rows], return_index=True, return_inverse=True
        )
        fold = folds_of(codes[first], FOLDS, seed)[group]
    shares: list[float] = []
    weak: list[BoolArray] = []
    weights = _weights(table, settings)
    most = min(_CLASSES // len(table.classes), _COLUMNS // width)
    tried = max(1, min(FOLDS, most))
    for number in range(tried):
        if progress:
            progress(f"testing fold {number + 1} of {tried}", number / tried)
        kept, test = rows[fold != number], rows[fold == number]
        if not len(test):  # there are fewer groups than folds
            continue
        present, known = np.unique(table.codes[kept], return_inverse=True)
        if len(present) < 2:
            return None
        classes = [table.classes[code] for code in present.tolist()]
        learnt = learn_arrays(
            table.values.T[kept],
            known.astype(np.int64),
            columns=table.columns,
            classes=classes,
            settings=_of_fold(settings, classes),
            categories=table.categories,
            ordered=table.ordered,
            weights=None if table.row_weights is None else table.row_weights[kept],
        )
        values, rules, right = _predicted(table, learnt.model, test)
        if groups is not None and learnt.model.sets:
            weak.append(_is_weak(learnt.tree, values, rules))
        weight = None if weights is None else weights[test]
        shares.append(float(np.average(right, weights=weight)))
    if not shares:
        return None
    share = float(np.concatenate(weak).mean()) if weak else None
    return Accuracy(tuple(shares), len(rows), table.rows, share)


def accuracy_of(
    table: Table, learnt: Learnt, settings: LearningSettings
) -> Accuracy | None:
    """Count how often a tree is right about rows that it was not learnt from.

    Args:
        table: The table that it was learnt from.
        learnt: The tree.
        settings: How it was learnt.

    Returns:
        The accuracy, where classes weigh as in the table; None if a class has fewer
        than 1,000 such rows.
    """
    if not learnt.limits or _weights(table, LearningSettings()) is not None:
        return None
    coded = codes_of_positions(table.values.T, table.columns, table.categories)
    rows = np.flatnonzero(rows_beyond(coded, table.codes, learnt.limits))
    counts = np.bincount(table.codes[rows], minlength=len(table.classes))
    if counts.min() < _UNSEEN:
        return None
    rows = rows[sampled(table.codes[rows], _TESTED, settings.seed)]
    counts = np.bincount(table.codes[rows], minlength=len(table.classes))
    whole = np.bincount(table.codes, _weights(table, settings))
    heavy = whole / np.maximum(counts, 1)
    right = _predicted(table, learnt.model, rows)[2]
    share = float(np.average(right, weights=heavy[table.codes[rows]]))
    return Accuracy((share,), len(rows), table.rows, is_of_tree=True)


def _predicted(
    table: Table, tree: FuzzyTree | RuleBase, rows: IntArray
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Return the inputs of rows, their rules, and which have the class of the row."""
    places = np.array([table.columns.index(k) for k in tree.inputs], np.int64)
    values = table.values[np.ix_(places, rows)]
    inputs = [v for v in tree.variables if not v.parts]
    for row, variable in zip(values, inputs, strict=True):
        own = table.categories.get(variable.name, ())
        if own != variable.categories:  # the tree has another order
            moved = np.array([*map(variable.categories.index, own), math.nan])
            row[:] = moved[np.nan_to_num(row, nan=-1.0).astype(np.int64)]
    rules = baseline().load(tree)(values).rule
    ends = [-1, *map(table.classes.index, tree.rule_labels)]
    return values, rules, np.array(ends)[rules] == table.codes[rows]


def grouped(table: Table, column: str) -> tuple[Table, IntArray]:
    """Return a table without a column, and the group of each row that it states.

    Raises:
        TableError: If there is no such column, or a row has no group.

    Example:
        >>> from fuzzytree.tables import read_table, table
        >>> rows = np.array([[1.0, 7.0], [2.0, 7.0], [3.0, 9.0]])
        >>> rows = table(rows, columns=["x", "press"])
        >>> whole = read_table(rows, target=["a", "a", "b"])
        >>> rest, groups = grouped(whole, "press")
        >>> rest.columns, groups.tolist()
        (('x',), [0, 0, 1])
    """
    if column not in table.columns:
        known = ", ".join(table.columns[:20])
        text = f"there is no column {column!r} of groups; there is {known}"
        raise TableError(f"{table.name}: {text}")
    place = table.columns.index(column)
    values = table.values[place]
    if np.isnan(values).any():
        row = int(np.isnan(values).argmax()) + 1
        raise TableError(f"{table.name}: row {row} has no group in {column!r}")
    kept = [k for k in range(len(table.columns)) if k != place]
    rest = msgspec.structs.replace(
        table,
        columns=tuple(table.columns[k] for k in kept),
        values=table.values[kept],
        categories={k: v for k, v in table.categories.items() if k != column},
        dates=tuple(name for name in table.dates if name != column),
    )
    return rest, np.unique(values, return_inverse=True)[1].astype(np.int64)


def front(table: Table, settings: LearningSettings) -> Front | None:
    """Return how accurate small trees are, by columns a node and by leaves.

    Args:
        table: The table.
        settings: How to learn; limits that it has hold here too.

    Returns:
        The accuracies on rows that were held out; None in paper mode, for rules, of a
        sample, or where the rows are too few to hold some out.
    """
    is_other = settings.mode == "paper" or settings.form == "rules"
    if is_other or table.weights is not None:
        return None
    learner = ArrayLearner(
        columns=table.columns,
        classes=table.classes,
        settings=settings,
        categories=table.categories,
        ordered=table.ordered,
    )
    learner.partial_fit(table.values.T, table.codes, weights=table.row_weights)
    return learner.front()


def _of_fold(settings: LearningSettings, classes: Sequence[str]) -> LearningSettings:
    """Return the settings for the classes of a fold."""
    patterns = settings.patterns_per_class
    if isinstance(patterns, Mapping):
        patterns = {name: patterns.get(name, 1) for name in classes}
    heavy = settings.class_weight
    if isinstance(heavy, Mapping):
        heavy = {name: heavy.get(name, 1.0) for name in classes}
    return msgspec.structs.replace(
        settings, patterns_per_class=patterns, class_weight=heavy
    )


def folds_of(codes: IntArray, folds: int, seed: int) -> IntArray:
    """Return a fold for each row, so that each class is spread evenly over them.

    Example:
        >>> folds_of(np.array([0, 0, 1, 1]), 2, 0).tolist()
        [0, 1, 0, 1]
    """
    result = np.empty(len(codes), np.int64)
    result[_by_class(codes, seed)] = np.arange(len(codes)) % folds
    return result


def sampled(codes: IntArray, most: int, seed: int) -> IntArray:
    """Return at most so many rows, in order, each class in its share."""
    if len(codes) <= most:
        return np.arange(len(codes))
    steps = np.arange(most) * len(codes) // most
    return np.sort(_by_class(codes, seed)[steps])


def _by_class(codes: IntArray, seed: int) -> npt.NDArray[np.intp]:
    shuffled = np.random.default_rng(seed).permutation(len(codes))
    return shuffled[np.argsort(codes[shuffled], kind="stable")]


def _is_weak(tree: FuzzyTree, values: FloatArray, rules: IntArray) -> BoolArray:
    """Return for which rows the raw rule that decides is below the usual floor."""
    strengths = baseline().load(rules_from_tree(tree, "raw"))(values).strengths
    assert strengths is not None  # rules that are fired have them
    own = strengths[np.maximum(rules - 1, 0), np.arange(len(rules))]
    weak: BoolArray = (rules == 0) | ~(own >= USUAL_FLOOR)  # NaN, missing, is weak
    return weak
