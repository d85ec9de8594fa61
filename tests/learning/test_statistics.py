"""Moments, samples and window counts."""

from __future__ import annotations

import functools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.columns import text_codes
from fuzzytree.learning import statistics as module
from fuzzytree.learning.statistics import Statistics, rows_beyond
from fuzzytree.learning.units import FloatArray, IntArray

Bits = tuple[bytes, ...]


def table(rows: int, *, offset: float = 0.0) -> tuple[FloatArray, IntArray]:
    rng = np.random.default_rng(3)
    return rng.normal(size=(rows, 3)) + offset, rng.integers(0, 4, rows)


def bits(statistics: Statistics) -> Bits:
    moments, sample = statistics.moments(), statistics.sample()
    return (
        moments.counts.tobytes(),
        moments.means.tobytes(),
        moments.spreads.tobytes(),
        moments.lows.tobytes(),
        moments.highs.tobytes(),
        sample.rows.tobytes(),
        sample.codes.tobytes(),
    )


@given(st.lists(st.integers(1, 400), max_size=8))
@settings(max_examples=25, deadline=None)
def test_the_bits_do_not_depend_on_the_chunks(sizes: list[int]) -> None:
    block, module.BLOCK_VALUES = module.BLOCK_VALUES, 300
    try:
        values, codes = table(1000)
        values[::13, 1] = np.nan
        whole = Statistics(4, 3, rows_per_class=50)
        whole.update(values, codes)
        parts = Statistics(4, 3, rows_per_class=50)
        for piece, labels in zip(
            np.split(values, np.minimum(np.cumsum(sizes), 1000)),
            np.split(codes, np.minimum(np.cumsum(sizes), 1000)),
            strict=True,
        ):
            parts.update(np.asfortranarray(piece), labels)
        assert bits(parts) == bits(whole)
        assert parts.dropped == whole.dropped == 77
    finally:
        module.BLOCK_VALUES = block


def test_asking_in_between_changes_nothing() -> None:
    values, codes = table(500)
    read, silent = Statistics(4, 3), Statistics(4, 3)
    for k in range(0, 500, 100):
        read.update(values[k : k + 100], codes[k : k + 100])
        read.moments()
        read.sample()
    silent.update(values, codes)
    assert bits(read) == bits(silent)


@pytest.mark.parametrize("offset", [0.0, 1e6, 1e12])
def test_spreads_keep_their_digits_at_any_offset(offset: float) -> None:
    values, codes = table(400, offset=offset)
    statistics = Statistics(4, 3)
    statistics.update(values, codes)
    found = statistics.moments()
    for label in range(4):
        column = [Fraction(v) for v in values[codes == label, 0].tolist()]
        mean = sum(column) / len(column)
        variance = sum((v - mean) ** 2 for v in column) / (len(column) - 1)
        assert found.spreads[label, 0] == math.sqrt(variance)
        assert found.means[label, 0] == pytest.approx(float(mean), rel=1e-15, abs=1e-14)


@pytest.mark.parametrize("constant", [0.1, 1e12 + 0.1, 1e-300, 7.0])
def test_a_constant_column_has_its_value_as_mean_and_no_spread(constant: float) -> None:
    statistics = Statistics(1, 1)
    statistics.update(np.full((777, 1), constant), np.zeros(777, np.int64))
    found = statistics.moments()
    assert found.means[0, 0] == constant
    assert found.spreads[0, 0] == 0.0


def test_a_spread_whose_square_underflows_is_not_zero() -> None:
    statistics = Statistics(1, 1)
    statistics.update(np.array([[0.0], [1e-200]]), np.zeros(2, np.int64))
    assert statistics.moments().spreads[0, 0] > 0.0


def test_merged_statistics_have_the_bits_of_one_pass() -> None:
    values, codes = table(900, offset=1e6)
    parts = [Statistics(4, 3, rows_per_class=50) for _ in range(3)]
    whole = Statistics(4, 3, rows_per_class=50)
    whole.update(values, codes)
    for part, rows, labels in zip(
        parts, np.array_split(values, 3), np.array_split(codes, 3), strict=True
    ):
        part.update(rows, labels)
    assert bits(parts[2].merge(parts[0].merge(parts[1]))) == bits(whole)


def test_the_sample_holds_whole_rows_and_no_more_than_wanted() -> None:
    values, codes = table(5000)
    statistics = Statistics(4, 3, rows_per_class=100)
    statistics.update(values, codes)
    sample = statistics.sample()
    assert np.bincount(sample.codes).tolist() == [100] * 4
    known = {row.tobytes() for row in values}
    assert all(row.tobytes() in known for row in sample.rows)


@pytest.mark.parametrize(
    ("classes", "columns", "most"), [(2, 1, 20_000), (4, 30, 8738)]
)
def test_without_a_number_fewer_rows_of_many_classes_are_learned_from(
    classes: int, columns: int, most: int
) -> None:
    rng = np.random.default_rng(0)
    codes = rng.integers(0, classes, classes * most * 3 // 2)
    values = rng.normal(size=(len(codes), columns))
    whole = Statistics(classes + 1, columns)  # a class without rows changes nothing
    whole.update(values, codes)
    assert np.bincount(whole.sample().codes).tolist() == [most] * classes
    parts = [Statistics(classes, columns) for _ in range(classes)]
    for code, part in enumerate(parts):  # that see a class each, from the end
        part.update(values[::-1][codes[::-1] == code], np.full(len(codes), code))
    joined = functools.reduce(Statistics.merge, reversed(parts))
    loaded = Statistics(classes, columns)
    loaded.fill(joined.arrays())
    assert bits(loaded)[-2:] == bits(joined)[-2:] == bits(whole)[-2:]


def test_rows_that_are_not_kept_are_named() -> None:
    rng = np.random.default_rng(0)
    values = rng.integers(-20, 21, (3_000, 3)) / 4.0
    values[rng.random(values.shape) < 0.1] = -0.0
    values[rng.random(values.shape) < 0.05] = np.nan
    values[::7, 2] = text_codes(["a"])
    codes = rng.integers(-1, 4, len(values))
    statistics = Statistics(4, 3, rows_per_class=100)
    statistics.update(values, codes)
    is_out = rows_beyond(values, codes, statistics.limits()) & (codes >= 0)
    kept = statistics.sample()

    def keys(rows: FloatArray, labels: IntArray) -> set[tuple[bytes, int]]:
        plain = np.where(rows == 0, 0.0, rows)
        return {(k.tobytes(), c) for k, c in zip(plain, labels.tolist(), strict=True)}

    known = keys(kept.rows, kept.codes)
    assert not known & keys(values[is_out], codes[is_out])
    is_in = ~is_out & (codes >= 0)
    assert keys(values[is_in], codes[is_in]) == known
    assert np.count_nonzero(is_out) > 1_000


def test_the_table_is_not_changed() -> None:
    values, codes = table(100)
    for width in (1, 3):
        before = values[:, :width].copy()
        chunk = before.copy()
        statistics = Statistics(4, width)
        statistics.update(chunk, codes)
        statistics.moments()
        assert (chunk == before).all()
