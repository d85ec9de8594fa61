"""Patterns and clusters."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.learning.patterns import clusters_of, make_patterns, usable_features
from fuzzytree.learning.statistics import Statistics


def test_clusters_find_blobs_without_chance() -> None:
    rng = np.random.default_rng(0)
    centres = np.array([[0, 0], [9, 0], [0, 9], [9, 9]])
    truth = np.repeat(np.arange(4), 50)
    rows = centres[truth] + rng.normal(size=(200, 2))
    found = clusters_of(rows, 4)
    assert (found == clusters_of(rows, 4)).all()
    assert len({(a, b) for a, b in zip(truth, found, strict=True)}) == 4


def test_equal_rows_are_one_cluster() -> None:
    assert clusters_of(np.ones((20, 3)), 5).tolist() == [0] * 20


def test_a_class_keeps_the_moments_of_the_whole_table() -> None:
    rng = np.random.default_rng(0)
    values, codes = rng.normal(size=(1000, 2)), np.repeat([0, 1], 500)
    statistics = Statistics(2, 2, rows_per_class=60)
    statistics.update(values, codes)
    sample = statistics.sample()
    moments = statistics.moments(sample.units)
    halves = (sample.moved[sample.codes == 1][:, 0] > 0).astype(np.int64)
    patterns = make_patterns(moments, sample, {1: halves})
    assert patterns.labels.tolist() == [0, 1, 1]
    assert patterns.numbers.tolist() == [1, 1, 2]
    assert (patterns.moments.means[0] == moments.means[0]).all()
    assert patterns.moments.highs[1, 0] <= 0 < patterns.moments.lows[2, 0]
    assert patterns.weights.sum() == pytest.approx(1000)
    assert (np.diff(patterns.owners) >= 0).all()


def test_columns_that_are_constant_or_whose_range_overflows_are_not_usable() -> None:
    statistics = Statistics(2, 4)
    rows = np.array([[1.0, 5.0, 1e308, 1e307], [2.0, 5.0, -1e308, -1e307]])
    statistics.update(rows, np.array([0, 1]))
    moments = statistics.moments(statistics.sample().units)
    assert usable_features(moments).tolist() == [0, 3]
