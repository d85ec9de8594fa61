"""The probabilities of classes, mixed from strengths of rules in numpy.

`fuzzytree.model.probabilities` defines them. All counts are whole numbers that a double
holds, so a matrix product gives the same bits in any order of its sums.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.model import WEIGHT_OF_ONE, Model, parts_of, remember, squarings

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray, IntArray

_CHUNK = 1 << 14  # rows


def class_probabilities(
    rules: Model, strengths: FloatArray, winner: IntArray
) -> FloatArray | None:
    """Return the probability of each class for each row.

    Args:
        rules: The rule base.
        strengths: Of each rule, shape (rules, rows).
        winner: The number of the winning rule of each row, from 1; 0 for none.

    Returns:
        Shape (classes, rows), NaN in rows without a rule; None if the rule base has
        no probabilities.
    """
    if rules.semantics.sharpness is msgspec.UNSET:
        return None
    parts = np.array([parts_of(r.probabilities) for r in rules.rules], np.float64).T
    result = np.full((len(rules.classes), strengths.shape[1]), np.nan)
    for start in range(0, len(winner), _CHUNK):
        rows = start + np.flatnonzero(winner[start : start + _CHUNK])
        weights = weights_of(strengths[:, rows], rules.semantics.sharpness)
        counts = parts @ weights
        place = rule_codes(rules)[winner[rows]], np.arange(len(rows))
        mine = counts[place]
        counts[place] = -1.0
        counts[place] = np.maximum(mine, counts.max(axis=0, initial=0.0) + 1.0)
        result[:, rows] = counts / counts.sum(axis=0)
    return result


def rule_codes(model: Model) -> IntArray:
    """Return the position of each rule's class among the classes; -1 for rule 0."""

    def codes() -> IntArray:
        position = {name: code for code, name in enumerate(model.classes)}
        return np.array([-1, *map(position.__getitem__, model.rule_labels)], np.int64)

    return remember(model, "rule codes", codes)


def weights_of(strengths: FloatArray, sharpness: int) -> FloatArray:
    """Return the weights of rules, whole numbers, given their strengths."""
    powers = strengths
    for _ in range(squarings(sharpness)):
        powers = powers * powers
    return np.floor(WEIGHT_OF_ONE * powers)
