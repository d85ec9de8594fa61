"""Inner validation: how many patterns each class has, and settings on request.

Trees are grown on parts of the sample and answer the rows left out. First every class
gets the same number of patterns, more and more of them; then, class by class, one class
more or fewer. A richer tree is chosen only if it is right on more of the rows on which
two trees differ than chance explains, so a table of simple classes keeps one pattern
each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fuzzytree.learning.growing import GrownTree, GrowthRules, grow
from fuzzytree.learning.patterns import (
    Patterns,
    clusters_of,
    make_patterns,
    standard_units,
    usable_features,
)
from fuzzytree.learning.refinement import refined
from fuzzytree.learning.sampling import Sample, hashed
from fuzzytree.learning.settings import LearningSettings
from fuzzytree.learning.statistics import Moments, grouped_moments
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray

LADDER = (1, 2, 3, 5, 8, 12, 16)
"""Numbers of patterns that are tried for a class."""

_FOLDS = 4
_ROWS = 2_000
_ROWS_PER_PATTERN = 6
_MOST_PATTERNS = 64
_CLASSES_APART = 8
_VALUES = 100_000
_GOOD_ENOUGH = 0.01
_SURE = 1.3
_PATIENCE = 3
_BUDGET = 1_200.0
_BUDGET_LARGE = 220.0
_LARGE = 4_000_000

Progress = Callable[[str, float], None]
Numbers = tuple[int, ...]


@dataclass(frozen=True)
class ChosenTree:
    """The tree that was chosen.

    Attributes:
        patterns: Of the tree.
        grown: The tree over them.
        refused: Patterns that were wanted and not made, for want of rows.
        chosen: What inner validation chose, by setting.
        accuracy: Share of right answers in inner validation; None without it.
    """

    patterns: Patterns
    grown: GrownTree
    refused: int
    chosen: dict[str, float | str]
    accuracy: float | None


def chosen_tree(
    moments: Moments,
    sample: Sample,
    settings: LearningSettings,
    classes: Sequence[str],
    costs: FloatArray,
    progress: Progress | None,
) -> ChosenTree:
    """Return the tree for the settings, chosen by inner validation if they say so."""
    progress = progress or _silent
    rules = _rules(settings, costs)
    numbers = _wanted_numbers(settings, classes)
    is_open = _is_open(settings, moments)
    accuracy: float | None = None
    chosen: dict[str, float | str] = {}
    has_choice = is_open or bool(settings.choices)
    folds = _folds(moments, sample, settings.seed) if has_choice else []
    if folds:
        is_large = moments.counts.sum() * sample.rows.shape[1] > _LARGE
        budget = _BUDGET_LARGE if is_large else _BUDGET
        trials = _Trials(folds, progress, budget)
        if is_open:
            numbers = _best_numbers(trials, rules, moments)
            shown = zip(classes, numbers, strict=True)
            several = [f"{c} {n}" for c, n in shown if n > 1]
            chosen["patterns_per_class"] = ", ".join(several) or "1 each"
        for name in settings.choices:
            rules, value = _best_rule(trials, rules, numbers, name)
            chosen[name] = value
        accuracy = float(trials.right(numbers, rules).mean())
    progress("growing", 0.0)
    patterns, refused = patterns_of(moments, sample, numbers)
    grown = grown_tree(patterns, rules, lambda share: progress("growing", share))
    return ChosenTree(patterns, grown, refused, chosen, accuracy)


def _silent(_: str, __: float) -> None:
    """Report nothing."""


def _rules(settings: LearningSettings, costs: FloatArray) -> GrowthRules:
    return GrowthRules(
        is_literal=settings.mode == "paper",
        alpha=settings.alpha,
        l_max=settings.effective_l_max,
        shrinkage=settings.shrinkage,
        entry=settings.entry,
        costs=costs,
        keep_reversals=settings.keep_reversals,
    )


def _wanted_numbers(settings: LearningSettings, classes: Sequence[str]) -> Numbers:
    """Return how many patterns each class is to have; 1 where that is open."""
    wanted = settings.patterns_per_class
    if isinstance(wanted, int):
        return (wanted,) * len(classes)
    if isinstance(wanted, Mapping):
        return tuple(wanted.get(name, 1) for name in classes)
    return (1,) * len(classes)


def _is_open(settings: LearningSettings, moments: Moments) -> bool:
    """Return whether the numbers of patterns are to be chosen, and can be."""
    is_auto = settings.patterns_per_class == "auto" or (
        settings.patterns_per_class is None and settings.mode == "default"
    )
    classes = int(np.count_nonzero(moments.counts))
    return is_auto and 2 * classes <= _MOST_PATTERNS


Clusters = dict[tuple[int, int], IntArray]
"""The cluster of each row of a class, by class and number of clusters wanted."""


def patterns_of(
    moments: Moments,
    sample: Sample,
    numbers: Sequence[int],
    known: Clusters | None = None,
) -> tuple[Patterns, int]:
    """Return patterns with so many clusters a class, and how many were refused.

    Args:
        moments: Of the classes.
        sample: Their rows.
        numbers: Patterns wanted, per class.
        known: Clusters found before; new ones are added.
    """
    usable = usable_features(moments)
    centre, scale = standard_units(moments, usable)
    borders = np.searchsorted(sample.codes, np.arange(len(moments.counts) + 1))
    found: Clusters = {} if known is None else known
    clusters: dict[int, IntArray] = {}
    refused = 0
    for code, number in enumerate(numbers):
        rows = sample.moved[borders[code] : borders[code + 1]]
        if number < 2 or len(rows) == 0:
            continue
        if (code, number) not in found:
            points = (rows[:, usable] - centre[usable]) / scale[usable]
            found[code, number] = clusters_of(points, number)
        clusters[code] = found[code, number]
        refused += number - 1 - int(clusters[code].max(initial=0))
    return make_patterns(moments, sample, clusters), refused


def grown_tree(
    patterns: Patterns,
    rules: GrowthRules,
    progress: Callable[[float], None] | None = None,
) -> GrownTree:
    """Return a grown tree, refined unless the paper is taken to the letter."""
    grown = grow(patterns, rules, progress)
    if not rules.is_literal:
        grown.sketch = refined(grown.sketch, patterns)
    return grown


@dataclass(frozen=True)
class _Fold:
    """Rows to learn from and rows to answer."""

    moments: Moments
    sample: Sample
    rows: FloatArray
    codes: IntArray
    clusters: Clusters


def _folds(moments: Moments, sample: Sample, seed: int) -> list[_Fold]:
    """Return folds of a bounded part of the sample, with all classes in each part."""
    kept = _thinned(moments, sample)
    order = np.lexsort((hashed(kept + 1_000_003 * (seed + 1)), sample.codes[kept]))
    kept = kept[order]
    codes = sample.codes[kept]
    starts = np.searchsorted(codes, codes, side="left")
    turn = (np.arange(len(codes)) - starts + codes) % _FOLDS
    folds: list[_Fold] = []
    for fold in range(_FOLDS):
        learnt, left_out = sample.at(kept[turn != fold]), kept[turn == fold]
        found = grouped_moments(learnt.moved, learnt.codes, len(moments.counts))
        if len(usable_features(found)) and len(left_out):
            rows, answers = sample.rows[left_out], sample.codes[left_out]
            folds.append(_Fold(found, learnt, rows, answers, {}))
    return folds


def _thinned(moments: Moments, sample: Sample) -> IntArray:
    """Return sample rows in the table's proportions, few enough to learn often."""
    width = max(1, sample.rows.shape[1])
    most = int(min(_ROWS, max(400, _VALUES // width)))
    kept: list[IntArray] = []
    borders = np.searchsorted(sample.codes, np.arange(len(moments.counts) + 1))
    total = int(moments.counts.sum())
    for code, count in enumerate(moments.counts.tolist()):
        inside = np.arange(borders[code], borders[code + 1])
        wanted = max(min(len(inside), 20), round(most * count / total))
        if len(inside) > wanted:
            order = np.argsort(hashed(inside), kind="stable")
            inside = np.sort(inside[order[:wanted]])
        kept.append(inside)
    return np.concatenate(kept)


_Key = tuple[Numbers, float, float, float, float]


@dataclass
class _Trials:
    """Answers of the trees tried so far, fold by fold.

    Attributes:
        folds: Rows to learn from and to answer.
        progress: Called with the progress.
        budget: How much work may be done: patterns of the trees grown, more for
            larger folds; a millisecond or a few each.
        spent: How much was done.
    """

    folds: list[_Fold]
    progress: Progress
    budget: float
    spent: float = 0.0
    known: dict[tuple[_Key, int], BoolArray] = field(
        default_factory=dict[tuple[_Key, int], BoolArray]
    )

    def right(
        self, numbers: Numbers, rules: GrowthRules, folds: int = _FOLDS
    ) -> BoolArray:
        """Return which rows left out are answered rightly, in the first folds."""
        parts = [np.zeros(0, bool)]
        key = (numbers, rules.alpha, rules.l_max, rules.shrinkage, rules.entry)
        for place, fold in enumerate(self.folds[:folds]):
            if (key, place) not in self.known:
                self.known[key, place] = _answered(fold, numbers, rules)
                self.spent += _work(fold, numbers)
                self.progress("choosing", min(1.0, self.spent / self.budget))
            parts.append(self.known[key, place])
        return np.concatenate(parts)

    def affords(self, numbers: Numbers) -> bool:
        """Return whether trees with so many patterns may still be tried."""
        work = sum(_work(fold, numbers) for fold in self.folds)
        return self.spent + work <= self.budget

    def prefers(
        self, richer: tuple[Numbers, GrowthRules], simpler: tuple[Numbers, GrowthRules]
    ) -> bool:
        """Return whether the rows on which two trees differ favour the first one.

        Half of the folds are tried first; a tree that is no better there is dropped.
        """
        for folds, least in ((_FOLDS // 2, 0.0), (_FOLDS, _SURE)):
            new, old = self.right(*richer, folds), self.right(*simpler, folds)
            won = int(np.count_nonzero(new & ~old))
            lost = int(np.count_nonzero(old & ~new))
            if won - lost <= least * np.sqrt(won + lost):
                return False
        return True


def _work(fold: _Fold, numbers: Numbers) -> float:
    return sum(numbers) * (1.0 + fold.sample.rows.size / 20_000)


def _answered(fold: _Fold, numbers: Numbers, rules: GrowthRules) -> BoolArray:
    patterns, _ = patterns_of(fold.moments, fold.sample, numbers, fold.clusters)
    sketch = grown_tree(patterns, rules).sketch
    is_right: BoolArray = sketch.classify(fold.rows) == fold.codes
    return is_right


def _best_numbers(trials: _Trials, rules: GrowthRules, moments: Moments) -> Numbers:
    """Return how many patterns each class should have."""
    counts = moments.counts
    limits = np.maximum(1, counts // _ROWS_PER_PATTERN)
    present = int(np.count_nonzero(counts))
    best: Numbers = (1,) * len(counts)
    failures = 0
    for number in LADDER[1:]:
        is_good = trials.right(best, rules).mean() >= 1.0 - _GOOD_ENOUGH
        if number * present > _MOST_PATTERNS or failures == _PATIENCE:
            break
        numbers = tuple(int(min(number, limit)) for limit in limits)
        if is_good or not trials.affords(numbers):
            return best
        is_better = trials.prefers((numbers, rules), (best, rules))
        best, failures = (numbers, 0) if is_better else (best, failures + 1)
    if present <= _CLASSES_APART:
        best = _class_by_class(trials, rules, best, limits)
    return best


def _class_by_class(
    trials: _Trials, rules: GrowthRules, best: Numbers, limits: IntArray
) -> Numbers:
    """Change one class at a time: fewer patterns if not worse, more if better."""
    for code in range(len(best)):
        if limits[code] < 2:
            continue
        place = int(np.searchsorted(LADDER, best[code]))
        for step in (-1, 1):
            other = min(max(place + step, 0), len(LADDER) - 1)
            number = int(min(LADDER[other], limits[code]))
            numbers = (*best[:code], number, *best[code + 1 :])
            if number == best[code] or not trials.affords(numbers):
                continue
            if step > 0:
                is_better = trials.prefers((numbers, rules), (best, rules))
            else:
                right = trials.right(numbers, rules).sum()
                is_better = right >= trials.right(best, rules).sum()
            if is_better:
                best = numbers
                break
    return best


def _best_rule(
    trials: _Trials, rules: GrowthRules, numbers: Numbers, name: str
) -> tuple[GrowthRules, float]:
    """Return the rules with the best value of one setting, and the value."""
    tried: dict[str, tuple[float, ...]] = {
        "alpha": (0.9, 1.0, 0.7, 0.5),
        "l_max": (4.0, 6.0, 10.0, 16.0, 24.0),
        "shrinkage": (1e-3, 1e-2, 1e-1, 0.5),
        "entry": (0.0, 2.0, 4.0, 10.0),
    }
    best = rules
    for value in tried[name]:
        change: dict[str, Any] = {name: value}
        other = replace(rules, **change)
        if trials.prefers((numbers, other), (numbers, best)):
            best = other
    return best, float(getattr(best, name))
