"""Inner validation: how many patterns each class has, and settings on request."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.arrays import FloatArray, IntArray
from fuzzytree.learning.growing import Grown, GrowthRules, grow
from fuzzytree.learning.patterns import (
    Patterns,
    clusters_of,
    make_patterns,
    standard_units,
    usable_features,
)
from fuzzytree.learning.refinement import refined
from fuzzytree.learning.settings import Settings
from fuzzytree.learning.statistics import Moments, Sample


@dataclass(frozen=True)
class Choice:
    """The tree that was chosen."""

    patterns: Patterns
    grown: Grown
    refused: int
    chosen: dict[str, float | str]
    accuracy: float | None


def chosen_tree(
    moments: Moments,
    sample: Sample,
    settings: Settings,
    classes: Sequence[str],
    costs: FloatArray,
    progress: Callable[[str, float], None] | None,
) -> Choice:
    """Return the tree for the settings, chosen by inner validation where asked."""
    rules = GrowthRules(
        settings.mode == "paper",
        settings.alpha,
        settings.effective_l_max,
        settings.shrinkage,
        settings.entry,
        costs,
        settings.keep_reversals,
    )
    numbers = {}
    per = settings.patterns_per_class
    if isinstance(per, int):
        numbers = {k: per for k in range(len(classes))}
    elif isinstance(per, Mapping):
        numbers = {list(classes).index(k): v for k, v in per.items()}
    patterns, refused = build(moments, sample, numbers)
    grown = grow(patterns, rules)
    if not rules.is_literal:
        grown.sketch = refined(grown.sketch, patterns)
    return Choice(patterns, grown, refused, {}, None)


def build(
    moments: Moments, sample: Sample, numbers: Mapping[int, int]
) -> tuple[Patterns, int]:
    usable = usable_features(moments)
    centre, scale = standard_units(moments, usable)
    borders = np.searchsorted(sample.codes, np.arange(len(moments.counts) + 1))
    clusters: dict[int, IntArray] = {}
    refused = 0
    for code, number in numbers.items():
        rows = sample.rows[borders[code] : borders[code + 1]]
        if number > 1 and len(rows):
            found = clusters_of(((rows - centre) / scale)[:, usable], number)
            clusters[code] = found
            refused += number - 1 - int(found.max(initial=0))
    return make_patterns(moments, sample, clusters), refused
