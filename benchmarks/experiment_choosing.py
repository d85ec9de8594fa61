"""Settings chosen by the people that are learnt from, without those tested.

Frames of one person are nearly alike, so that folds of single frames would always
choose what remembers most. Here a fold is a group of whole subjects.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from experiment_splits import in_groups

from fuzzytree.learning import LearningSettings, learn_arrays
from fuzzytree.model.rulebase import Value
from fuzzytree.runtimes.native import load

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

GROUPS = 4
"""Into how many groups the subjects that are learnt from are divided."""


class Candidate(Value, frozen=True):
    """LearningSettings that may be chosen.

    Attributes:
        shrinkage: Of the off-diagonal of a scatter.
        entry: What a further feature must gain.
    """

    shrinkage: float
    entry: float

    @property
    def text(self) -> str:
        """The settings, in words."""
        return f"shrinkage {self.shrinkage:g}, entry {self.entry:g}"

    def applied(self, settings: LearningSettings) -> LearningSettings:
        """Return settings with these in them."""
        return msgspec.structs.replace(
            settings,
            shrinkage=self.shrinkage,
            entry=self.entry,
        )


CANDIDATES: tuple[Candidate, ...] = tuple(
    itertools.starmap(Candidate, itertools.product((0.01, 0.1, 0.5, 0.9), (2.0, 0.0)))
)
"""What may be chosen, the smallest tree first."""


def chosen(
    values: FloatArray,
    codes: IntArray,
    subject: IntArray,
    settings: LearningSettings,
    candidates: Sequence[Candidate] = CANDIDATES,
) -> Candidate:
    """Return the settings that answer the most frames of subjects left out.

    Args:
        values: The features, shape (features, frames).
        codes: The classes, shape (frames,).
        subject: Whose each frame is, shape (frames,).
        settings: All other settings.
        candidates: What may be chosen; the first of the best is.

    Raises:
        TableError: If there is one subject only.
        LearningError: If nothing can be learnt without one group of them.
    """
    splits = in_groups(subject, GROUPS)
    right = [
        sum(
            _right(values, codes, split.train, split.test, one.applied(settings))
            for split in splits
        )
        for one in candidates
    ]
    return candidates[int(np.argmax(right))]


def _right(
    values: FloatArray,
    codes: IntArray,
    train: IntArray,
    test: IntArray,
    how: LearningSettings,
) -> int:
    known, learnt = np.unique(codes[train], return_inverse=True)
    columns = [str(k) for k in range(len(values))]
    columns_costs = {str(k): cost for k, cost in enumerate(how.costs.values())}
    tree = learn_arrays(
        values[:, train].T,
        learnt.astype(np.int64),
        columns=columns,
        classes=[str(code) for code in known.tolist()],
        settings=msgspec.structs.replace(how, costs=columns_costs),
    ).tree
    ends = np.array([-1, *(int(leaf.label) for leaf in tree.leaves)], np.int64)
    asked = values[[int(name) for name in tree.inputs]][:, test]
    return int(np.count_nonzero(ends[load(tree)(asked).rule] == codes[test]))
