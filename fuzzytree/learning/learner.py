"""From a table to a tree: all at once, or chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import msgspec
import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from fuzzytree.cells import checked_weights, numbers_only, unmasked
from fuzzytree.errors import LearningError
from fuzzytree.learning.assembly import TermNames, assembled
from fuzzytree.learning.binary import finished_tree
from fuzzytree.learning.choosing import Front, chosen_tree, front_of
from fuzzytree.learning.class_rules import class_rules
from fuzzytree.learning.cuts import Sketch
from fuzzytree.learning.filling import (
    FilledStatistics,
    codes_of_positions,
    described,
    filled,
)
from fuzzytree.learning.findings import LearningReport
from fuzzytree.learning.paper import GrowthRules, grow
from fuzzytree.learning.patterns import Patterns, usable_features, wanted_patterns
from fuzzytree.learning.probabilities import with_probabilities
from fuzzytree.learning.rows import SplitRules, TrainingRows
from fuzzytree.learning.sampling import (
    MOST_COPIES,
    RowWeights,
    Sample,
    class_weights,
    row_weights,
)
from fuzzytree.learning.settings import LearningSettings
from fuzzytree.learning.statistics import Moments, Statistics
from fuzzytree.learning.tuning import SHARPNESS
from fuzzytree.learning.units import FloatArray, IntArray, tallied
from fuzzytree.model import FuzzyTree, RuleBase, text_fault

Progress = Callable[[str, float], None]

_INCOMPLETE = (
    "cannot learn from a table without complete rows: all {} hold a missing or "
    "infinite value or no class"
)


class Learnt(msgspec.Struct, frozen=True):
    """What learning gives: a tree or rules, and what was counted on the way.

    Attributes:
        model: The tree, or the rules.
        report: What was counted.
        limits: The largest hash of a row of each class that the model may have been
            learnt from (`rows_beyond`); empty where others than these count.
    """

    model: FuzzyTree | RuleBase
    report: LearningReport
    limits: tuple[int, ...] = ()

    @property
    def tree(self) -> FuzzyTree:
        """The tree.

        Raises:
            TypeError: If rules were learnt.
        """
        if not self.model.leaves:
            classes = len(self.model.classes)
            text = f"rules of {classes} classes were learnt, and no tree"
            raise TypeError(f"{text}; form='tree' learns one")
        return cast("FuzzyTree", self.model)  # nothing else has leaves


def learn_arrays(
    values: npt.NDArray[np.generic],
    labels: Sequence[str] | npt.NDArray[np.generic],
    *,
    columns: Sequence[str],
    classes: Sequence[str],
    units: Mapping[str, str] | None = None,
    name: str = "tree",
    settings: LearningSettings | None = None,
    categories: Mapping[str, tuple[str, ...]] | None = None,
    ordered: Collection[str] = (),
    weights: Sequence[float] | npt.NDArray[np.generic] | None = None,
    progress: Progress | None = None,
) -> Learnt:
    """Learn a fuzzy decision tree from a table of numbers.

    Args:
        values: Shape (rows, columns), any real type and memory order; read in blocks.
            NaN and infinity are missing.
        labels: The class of each row: names out of `classes`, or their positions.
            None, NaN, an empty name or a negative position drops the row.
        columns: Names of the columns.
        classes: Names of the classes, in the order of their numbers.
        units: By column, for people.
        name: Of the tree.
        settings: How to learn.
        categories: Of columns of text, by name; their values are positions. The tree
            may have them in another order.
        ordered: The columns whose categories keep their order.
        weights: Of the rows (see `fuzzytree.learning.sampling`); all 1 unless given.
        progress: Called with what is being done and its share done, 0 to 1.

    Raises:
        ValueError: If shapes, names and labels do not fit together.
        LearningError: If nothing can be learnt from the table.

    Example:
        >>> sizes = np.array([[1.0], [1.5], [2.0], [7.0], [7.5], [8.0]])
        >>> kinds = ["small"] * 3 + ["big"] * 3
        >>> found = learn_arrays(sizes, kinds, columns=["cm"], classes=["small", "big"])
        >>> len(found.tree.leaves)
        2
    """
    learner = ArrayLearner(
        columns=columns,
        classes=classes,
        units=units or {},
        name=name,
        settings=settings or LearningSettings(),
        categories=categories or {},
        ordered=ordered,
    )
    learner.partial_fit(values, labels, weights=weights, progress=progress)
    return learner.finish(progress=progress)


@dataclass
class ArrayLearner:
    """Learns from chunks; neither their borders nor the rows' order change the tree.

    Attributes:
        columns: Names of the columns.
        classes: Names of the classes.
        units: By column.
        name: Of the tree.
        settings: How to learn.
        categories: By column; none of a column of numbers. The tree may have them in
            another order.
        ordered: The columns whose categories keep their order.

    Example:
        >>> learner = ArrayLearner(columns=["cm"], classes=["small", "big"])
        >>> learner.partial_fit(np.array([[1.0], [1.5], [2.0]]), np.array([0, 0, 0]))
        >>> learner.partial_fit(np.array([[7.0], [8.0]]), ["big", "big"])
        >>> len(learner.finish().tree.leaves)
        2
    """

    columns: Sequence[str]
    classes: Sequence[str]
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    name: str = "tree"
    settings: LearningSettings = field(default_factory=LearningSettings)
    categories: Mapping[str, tuple[str, ...]] = field(
        default_factory=dict[str, tuple[str, ...]]
    )
    ordered: Collection[str] = ()
    statistics: Statistics = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the names and start with an empty table."""
        _check_names(self.columns, self.classes, self.settings)
        for text in (self.name, *self.units.values()):
            if fault := text_fault(text):
                raise ValueError(f"the name or unit {text!r} {fault}")
        self.statistics = Statistics(
            len(self.classes), len(self.columns), self.settings.rows_per_class
        )

    def partial_fit(
        self,
        values: npt.NDArray[np.generic],
        labels: Sequence[str] | npt.NDArray[np.generic],
        *,
        weights: Sequence[float] | npt.NDArray[np.generic] | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Take more rows; arguments as in `learn_arrays`.

        Raises:
            ValueError: If shapes, labels and weights do not fit, or if weights that are
                no whole numbers come in chunks or in paper mode.
            LearningError: If `missing` is `refuse` and a value is missing.
        """
        codes = _codes(labels, self.classes)
        values = numbers_only(values, "the array")
        _check_shape(values, codes, len(self.columns))
        if progress is not None:
            progress("counting", 0.0)
        if self.categories:
            values = codes_of_positions(
                values.astype(np.float64), self.columns, self.categories
            )
        found = None
        if weights is not None:
            found = row_weights(checked_weights(weights, len(values)))
        self._refuse_shares(found)
        before = self.statistics.dropped
        if found is None:
            self.statistics.update(values, codes)
        else:
            for rows in found.pieces():
                piece = values[rows]
                if found.shares is not None:
                    piece = np.column_stack([piece, found.shares[rows]])
                self.statistics.update(piece, codes[rows])
        dropped = self.statistics.dropped - before
        if dropped and self.settings.missing == "refuse":
            raise LearningError(
                f"{dropped} of {len(values)} rows hold a missing or infinite value "
                "or no class\n  pass missing='drop' to leave them out"
            )
        if progress is not None:
            progress("counting", 1.0)

    def _refuse_shares(self, weights: RowWeights | None) -> None:
        """Make room for weights that are no whole numbers, a column behind the others.

        Raises:
            ValueError: If they do not come with all rows at once, or in paper mode.
        """
        has_shares = weights is not None and weights.shares is not None
        if has_shares and self.settings.mode == "paper":
            raise ValueError(
                "the paper's algorithm counts rows: its weights are whole numbers, and "
                f"add up to {MOST_COPIES:,} at most"
            )
        if self._is_weighted or (has_shares and self.statistics.counts().any()):
            raise ValueError(
                "weights that are no whole numbers need all rows at once, not in chunks"
            )
        if has_shares:
            self.statistics = Statistics(
                len(self.classes), len(self.columns) + 1, self.settings.rows_per_class
            )

    @property
    def _is_weighted(self) -> bool:
        return self.statistics.features > len(self.columns)

    def finish(self, *, progress: Progress | None = None) -> Learnt:
        """Return the tree or the rules of all rows taken so far; more may follow.

        Raises:
            LearningError: If there is no row, one class, or no column that varies.
        """
        ready = self._prepared()
        whole = [
            name
            for place, name in enumerate(self.columns)
            if not self.categories.get(name) and self.statistics.is_whole(place)
        ]
        names = TermNames(self.name, self.columns, self.classes, self.units, whole)
        learn = self._rules_of_classes if self._learns_rules else self._tree
        model, facts = learn(ready, names, progress or (lambda _text, _share: None))
        is_alone = self.settings.mode == "default" and not self._is_weighted
        limits = self.statistics.limits() if is_alone else ()
        return Learnt(model, self._report(ready, facts), limits)

    @property
    def _learns_rules(self) -> bool:
        return self.settings.learns_rules(len(np.flatnonzero(self.statistics.counts())))

    def _rules_of_classes(
        self, ready: _Ready, names: TermNames, progress: Progress
    ) -> tuple[FuzzyTree | RuleBase, dict[str, Any]]:
        """Return a rule for each class, and what to report."""
        progress("fitting sets", 0.0)
        supports = tallied(ready.sample.codes, ready.supports, len(self.classes))
        table, weights = ready.table, ready.weights
        model = class_rules(names, table, self.statistics, weights, supports)
        progress("fitting sets", 1.0)
        labels = model.rule_labels
        sets = len(labels) * len(model.variables)
        patterns = dict.fromkeys(labels, 1)
        return model, {"patterns": patterns, "rules": len(labels), "sets": sets}

    def _tree(
        self, ready: _Ready, names: TermNames, progress: Progress
    ) -> tuple[FuzzyTree | RuleBase, dict[str, Any]]:
        """Return a tree, and what to report."""
        grow = self._paper if self.settings.mode == "paper" else self._default
        grown = grow(ready, progress)
        progress("fitting sets", 0.0)
        made = assembled(
            grown.sketch,
            grown.patterns,
            ready.table.statistics,
            names,
            points=self.settings.points,
            separate_sides=self.settings.separate_sides,
            keeps_flaws=self.settings.mode == "paper",
            supports=grown.supports,
        )
        progress("fitting sets", 1.0)
        places = {name: place for place, name in enumerate(self.columns)}
        tree = with_probabilities(
            made.tree,
            ready.sample,
            ready.weights,
            places,
            further_rows=grown.further_rows,
            sharpness=SHARPNESS if grown.sketch.is_tuned else None,
        )
        if self.settings.mode != "paper":
            tree = described(tree, self.columns, ready.table, self.statistics)
        patterns = grown.patterns
        per_class = np.bincount(patterns.labels, minlength=len(self.classes))
        return tree, {
            "patterns": {
                c: int(n) for c, n in zip(self.classes, per_class, strict=True) if n
            },
            "single_rows": int(np.count_nonzero(patterns.moments.counts == 1)),
            "zero_spreads": made.zero_spreads,
            "leaves": len(made.tree.leaves),
            "features_per_node": tuple(
                len(split.axis.features) for split in grown.sketch.splits
            ),
            "sets": made.sets,
            **vars(made.repairs),
            "largest_flank_error": made.largest_flank_error,
            **grown.facts,
        }

    def front(self) -> Front | None:
        """Return how accurate small trees are, by columns a node and by leaves.

        None where rows are too few to hold some out, or of too many classes.

        Raises:
            LearningError: As `finish`.
        """
        rows, rules = self._rules(self._prepared())
        every = replace(rules, columns=len(self.columns))
        with threadpool_limits(1, "blas"):
            return front_of(rows, every, self.settings)

    def _prepared(self) -> _Ready:
        """Return what a tree is grown from."""
        drops, width = self.settings.drops_missing, len(self.columns)
        check_rows(self.statistics, self.classes, self.statistics.dropped)
        if self.settings.mode == "paper" and self.categories:
            names = ", ".join(map(repr, self.categories))
            raise LearningError(
                f"the paper's algorithm learns from numbers alone, and not from {names}"
                "\n  leave these columns out with ignore, or learn in default mode"
            )
        categories = [self.categories.get(name, ()) for name in self.columns]
        is_ordered = [name in self.ordered for name in self.columns]
        if self._is_weighted:
            categories.append(())
            is_ordered.append(False)
        table = filled(
            self.statistics,
            categories,
            is_ordered=is_ordered,
            drops=drops,
            is_apart=self._learns_rules,
        )
        dropped = self.statistics.dropped
        if dropped and not (drops or np.isfinite(table.stand_ins[:width]).any()):
            raise LearningError(_INCOMPLETE.format(dropped))
        check_rows(table.statistics, self.classes, dropped)
        shares = np.ones(1)
        if self._is_weighted:
            table, shares = table.without_last_column()
        sample = table.sample
        moments = table.statistics.moments(sample.units)
        if not len(usable_features(moments)):
            raise LearningError(
                "cannot learn without a column that varies: every column is constant, "
                "or so wide that its range overflows"
            )
        costs = np.array([self.settings.costs.get(c, 1.0) for c in self.columns])
        counts = moments.counts if drops else self.statistics.counts()
        kept = np.bincount(sample.codes, minlength=len(self.classes))
        supports = (counts / np.maximum(kept, 1))[sample.codes] * shares
        wanted = self.settings.class_weight
        heavy = class_weights(wanted, self.classes, sample.codes, supports)
        weights = supports * heavy[sample.codes]
        return _Ready(table, sample, moments, supports, weights, costs)

    def _rules(self, ready: _Ready) -> tuple[TrainingRows, SplitRules]:
        """Return the rows as the search for splits needs them, and its rules."""
        settings, sample = self.settings, ready.sample
        kept = np.bincount(sample.codes, minlength=len(self.classes))
        rows = TrainingRows.of(
            sample,
            ready.weights,
            len(self.classes),
            ready.table.sizes,
            ready.table.combinable,
        )
        rules = SplitRules(
            min_rows=settings.min_rows or min(_MIN_ROWS, int(kept[kept > 0].min())),
            columns=settings.columns_per_node or len(self.columns),
            entry=settings.entry,
            shrinkage=settings.shrinkage,
            costs=ready.costs,
        )
        return rows, rules

    def _paper(self, ready: _Ready, progress: Progress) -> _Grown:
        """Grow the paper's tree, over patterns of the classes."""
        settings = self.settings
        wanted = settings.patterns_per_class or 1
        numbers = [
            wanted if isinstance(wanted, int) else wanted.get(name, 1)
            for name in self.classes
        ]
        patterns, refused = wanted_patterns(ready.moments, ready.sample, numbers)
        rules = GrowthRules(
            alpha=0.9 if settings.alpha is None else settings.alpha,
            l_max=settings.l_max or 8.0,
            costs=ready.costs,
            keep_reversals=settings.keep_reversals,
            columns=settings.columns_per_node or len(self.columns),
            shrinkage=settings.shrinkage,
        )
        grown = grow(patterns, rules, lambda share: progress("growing", share))
        leaves = grown.sketch.descend(patterns.rows)
        codes = np.repeat(patterns.labels, np.diff(patterns.starts))
        supports = self._rows_by_class(
            grown.sketch, leaves, codes, patterns.row_weights
        )
        facts: dict[str, Any] = {
            "patterns_refused": refused,
            "inseparable": grown.inseparable,
            "levels_raised": grown.levels_raised,
            "reversals": grown.reversals,
        }
        return _Grown(grown.sketch, patterns, supports, facts)

    def _default(self, ready: _Ready, progress: Progress) -> _Grown:
        """Grow a tree from the rows' own classes."""
        rows, rules = self._rules(ready)
        with threadpool_limits(1, "blas"):  # the tables are small: threads would wait
            choice = chosen_tree(rows, rules, self.settings, progress)
        found = finished_tree(choice.tree, rows, ready.sample, ready.moments)
        codes = ready.sample.codes
        supports = self._rows_by_class(
            found.sketch, found.leaves, codes, ready.supports
        )
        together = ", tuned together" if found.sketch.is_tuned else ""
        facts: dict[str, Any] = {
            "chosen": {"splits": _STYLES[choice.style] + together},
            "inner_accuracy": choice.accuracy,
        }
        return _Grown(
            found.sketch, found.patterns, supports, facts, choice.further_rows
        )

    def _rows_by_class(
        self, sketch: Sketch, leaves: IntArray, codes: IntArray, weights: FloatArray
    ) -> FloatArray:
        """Return the weight of rows, shape (leaves, classes)."""
        shape = len(sketch.leaves), len(self.classes)
        cells = leaves * shape[1] + codes
        return tallied(cells, weights, shape[0] * shape[1]).reshape(shape)

    def _report(self, ready: _Ready, facts: Mapping[str, Any]) -> LearningReport:
        moments, sample = ready.moments, ready.sample
        usable = set(usable_features(moments).tolist())
        drops, dropped = self.settings.drops_missing, self.statistics.dropped
        rows = self.statistics.counts().sum() - (dropped if drops else 0)
        rows += self.statistics.unlabelled if drops else 0
        counts = moments.counts if drops else self.statistics.counts()
        kept = np.bincount(sample.codes, minlength=len(self.classes))
        sizes = zip(self.classes, kept.tolist(), counts.tolist(), strict=True)
        return LearningReport(
            mode=self.settings.mode,
            rows=int(rows),
            rows_dropped=dropped if drops else self.statistics.unlabelled,
            rows_filled=0 if drops else dropped - self.statistics.unlabelled,
            rows_sampled=len(sample.rows),
            sampled={name: (few, all_) for name, few, all_ in sizes if few < all_},
            classes_without_rows=tuple(
                c for c, n in zip(self.classes, moments.counts, strict=True) if n == 0
            ),
            features_ignored=tuple(
                c for k, c in enumerate(self.columns) if k not in usable
            ),
            **facts,
        )


@dataclass(frozen=True)
class _Ready:
    """A table without missing cells, and what a tree is grown from.

    Attributes:
        table: The table.
        sample: Its rows.
        moments: Of the classes.
        supports: How many rows of the table each row of the sample stands for.
        weights: The same, times the weights of the classes.
        costs: Of the columns.
    """

    table: FilledStatistics
    sample: Sample
    moments: Moments
    supports: FloatArray
    weights: FloatArray
    costs: FloatArray


@dataclass(frozen=True)
class _Grown:
    """A tree over patterns, the rows that each leaf stands for, and what to report.

    `further_rows` is what `with_probabilities` needs to know.
    """

    sketch: Sketch
    patterns: Patterns
    supports: FloatArray
    facts: dict[str, Any]
    further_rows: float = 2.0


_MIN_ROWS = 3

_STYLES = {
    "columns": "single columns",
    "mixed": "columns and combinations",
    "centres": "combinations between the classes",
}


def _check_names(
    columns: Sequence[str], classes: Sequence[str], settings: LearningSettings
) -> None:
    for kind, found in (("column", columns), ("class", classes)):
        seen: set[str] = set()
        for name in found:
            if name in seen:
                raise ValueError(f"the {kind} {name!r} is named twice")
            if fault := text_fault(name):
                raise ValueError(f"the {kind} {name!r} {fault}; rename it")
            seen.add(name)
    for name in settings.costs:
        if name not in columns:
            raise ValueError(f"costs: there is no column {name!r}")
    for setting in ("patterns_per_class", "class_weight"):
        by_class = getattr(settings, setting)
        for name in by_class if isinstance(by_class, Mapping) else ():
            if name not in classes:
                raise ValueError(f"{setting}: there is no class {name!r}")


def _check_shape(values: npt.NDArray[np.generic], codes: IntArray, width: int) -> None:
    if values.ndim != 2:
        raise ValueError(f"values need two dimensions, not {values.ndim}")
    if values.shape[1] != width:
        raise ValueError(
            f"values have {values.shape[1]} columns, but {width} are named"
        )
    if len(values) != len(codes):
        raise ValueError(f"{len(values)} rows, but {len(codes)} labels")


def _codes(
    labels: Sequence[str] | npt.NDArray[np.generic], classes: Sequence[str]
) -> IntArray:
    """Return class positions; -1 where a label is missing."""
    found = unmasked(np.asanyarray(labels))
    if found.dtype.kind in "iub":
        codes = found.astype(np.int64)
        if len(codes) and codes.max() >= len(classes):
            raise ValueError(f"label {codes.max()} has no name among the classes")
        return np.maximum(codes, -1)
    if found.dtype.kind == "f":
        whole: FloatArray = np.where(np.isfinite(found.astype(np.float64)), found, -1.0)
        if (whole != np.floor(whole)).any() or whole.max(initial=-1) >= len(classes):
            raise ValueError("labels in numbers are positions of classes, from 0")
        return np.maximum(whole, -1).astype(np.int64)
    place = {name: k for k, name in enumerate(classes)}
    codes = np.empty(len(found), np.int64)
    for row, label in enumerate(found.tolist()):
        if label is None or label == "" or label != label:
            codes[row] = -1
        elif label in place:
            codes[row] = place[label]
        else:
            raise ValueError(f"row {row + 1}: {label!r} is not among the classes")
    return codes


def check_rows(
    statistics: Statistics, classes: Sequence[str], dropped: int = 0
) -> None:
    """Raise a LearningError if there are too few rows to learn from.

    `dropped` says how many are incomplete or have no class.
    """
    counts = statistics.counts()
    rows = int(counts.sum())
    if rows == 0 and dropped:
        raise LearningError(_INCOMPLETE.format(dropped))
    if rows == 0:
        raise LearningError("cannot learn from a table without rows")
    if rows == 1:
        raise LearningError("cannot learn from one row; two classes need two at least")
    present = np.flatnonzero(counts)
    if len(present) == 1:
        raise LearningError(
            f"cannot learn from one class: every row is {classes[present[0]]!r}"
        )
