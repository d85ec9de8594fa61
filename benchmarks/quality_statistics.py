"""The arithmetic of the study of quality: ranks, tests and calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from quality_tables import FloatArray, IntArray
from scipy import stats

BINS = 10
LEVEL = 0.05


def resampled_t(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Return the p of the corrected resampled t test of two accuracies by fold.

    The variance is larger than that of independent samples by the share of rows that
    are answered (Nadeau and Bengio 2003).

    Example:
        >>> round(resampled_t([0.9, 0.8, 0.85], [0.8, 0.8, 0.8]), 4)
        0.3876
    """
    apart = np.subtract(ours, theirs)
    if not apart.any():
        return 1.0
    variance = apart.var(ddof=1) * (1 / len(apart) + 1 / (len(apart) - 1))
    if variance == 0.0:
        return 0.0
    return float(
        2 * stats.t.sf(abs(apart.mean()) / math.sqrt(variance), len(apart) - 1)
    )


def verdict(ours: Sequence[float], theirs: Sequence[float]) -> int:
    """Return 1 where we are better beyond noise, -1 where worse, otherwise 0."""
    if resampled_t(ours, theirs) >= LEVEL:
        return 0
    return 1 if np.mean(ours) > np.mean(theirs) else -1


def ranks(accuracies: FloatArray) -> FloatArray:
    """Return the rank of each learner on each table, 1 the best; equals share theirs.

    Args:
        accuracies: Shape (tables, learners); nan, which is last, where there is none.

    Example:
        >>> ranks(np.array([[0.9, 0.8, 0.9], [0.5, np.nan, 0.6]])).tolist()
        [[1.5, 3.0, 1.5], [2.0, 3.0, 1.0]]
    """
    known = np.where(np.isnan(accuracies), -1.0, np.round(accuracies, 9))
    return np.asarray(stats.rankdata(-known, axis=1), np.float64)


def friedman(ranked: FloatArray) -> float:
    """Return the p of Friedman's test that all learners are alike.

    Args:
        ranked: As `ranks` returns them, shape (tables, learners).
    """
    return float(stats.friedmanchisquare(*ranked.T).pvalue)


def critical_difference(learners: int, count: int) -> float:
    """Return how far mean ranks must be apart by Nemenyi's test, p < .05.

    Args:
        learners: How many are ranked.
        count: Of tables.

    Example:
        >>> round(critical_difference(5, 30), 3)
        1.114
    """
    quantile = stats.studentized_range.ppf(1 - LEVEL, learners, math.inf)
    spread = math.sqrt(learners * (learners + 1) / (6 * count))
    return float(quantile / math.sqrt(2) * spread)


def cliques(means: Sequence[float], difference: float) -> list[tuple[int, int]]:
    """Return the first and the last of each longest run that is not told apart.

    Args:
        means: Mean ranks in order.
        difference: As `critical_difference` returns it.

    Example:
        >>> cliques([1.0, 1.5, 2.2, 4.0], 1.0)
        [(0, 1), (1, 2)]
    """
    runs: list[tuple[int, int]] = []
    for first, mean in enumerate(means):
        last = max(k for k, other in enumerate(means) if other - mean <= difference)
        if last > first and (not runs or last > runs[-1][1]):
            runs.append((first, last))
    return runs


def reliability(chances: FloatArray, answers: IntArray) -> list[list[float]]:
    """Return rows, sum of confidences and hits of each tenth of confidence.

    Args:
        chances: Probabilities, shape (rows, classes).
        answers: The right class of each row.

    Returns:
        Three numbers for each of ten bins; a row's confidence is its largest chance.

    Example:
        >>> reliability(np.array([[0.75, 0.25], [0.25, 0.75]]), np.array([0, 0]))[7]
        [2.0, 1.5, 1.0]
    """
    confidence = chances.max(axis=1)
    is_hit = chances.argmax(axis=1) == answers
    bins = np.clip((confidence * BINS).astype(int), 0, BINS - 1)
    sums = [
        np.bincount(bins, weights, BINS)
        for weights in (np.ones(len(answers)), confidence, is_hit)
    ]
    found: list[list[float]] = np.transpose(sums).tolist()
    return found


def calibration_error(bins: Sequence[Sequence[float]]) -> float:
    """Return the expected calibration error of bins as `reliability` makes them.

    Example:
        >>> calibration_error([[2.0, 1.5, 1.0], [2.0, 1.8, 2.0]])
        0.175
    """
    rows, confidence, hits = np.transpose(bins)
    return float(np.abs(confidence - hits).sum() / rows.sum())
