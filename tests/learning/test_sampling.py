"""Which rows are kept of a table that is too long."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.learning import sampling
from fuzzytree.learning.sampling import (
    DistinctRows,
    Sample,
    hashed_digits,
    hashed_rows,
)
from fuzzytree.learning.units import FloatArray, IntArray

TABLES = {
    "different": lambda rng, rows: rng.normal(size=(rows, 3)),
    "whole": lambda rng, rows: rng.integers(-4, 5, (rows, 3)).astype(np.float64),
    "powers": lambda rng, rows: 2.0 ** rng.integers(0, 3, (rows, 5)),
    "few": lambda rng, rows: rng.integers(0, 2, (rows, 3)).astype(np.float64),
}


def table(name: str, rows: int = 900, seed: int = 0) -> tuple[FloatArray, IntArray]:
    rng = np.random.default_rng(seed)
    return TABLES[name](rng, rows), rng.integers(0, 3, rows)


def offered(
    values: FloatArray, codes: IntArray, most: int, borders: list[int]
) -> DistinctRows:
    rows = DistinctRows(3, values.shape[1], most)
    for piece, own in zip(
        np.split(values, borders), np.split(codes, borders), strict=True
    ):
        rows.offer(piece, own)
    return rows


def sample_of(rows: DistinctRows, values: FloatArray) -> Sample:
    return rows.sample(values.min(axis=0), values.max(axis=0))


def bits(sample: Sample) -> tuple[bytes, bytes]:
    return sample.rows.tobytes(), sample.codes.tobytes()


@pytest.fixture
def _no_buffer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let rows be left out as early as they can be."""
    monkeypatch.setattr(sampling, "_BUFFER", 0)


@pytest.mark.one_in(4)
@pytest.mark.usefixtures("_no_buffer")
@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("most", [1, 2, 7, 40, 150, 2000])
def test_the_sample_depends_neither_on_order_nor_chunks_nor_merging(
    name: str, most: int
) -> None:
    values, codes = table(name)
    base = bits(sample_of(offered(values, codes, most, []), values))
    for seed in range(6):
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(codes))
        borders = np.sort(rng.integers(0, len(codes), 12)).tolist()
        chunked = offered(values[order], codes[order], most, borders)
        assert bits(sample_of(chunked, values)) == base
        left = offered(values[order[:300]], codes[order[:300]], most, [9, 50])
        right = offered(values[order[300:]], codes[order[300:]], most, [99])
        right.take(left, np.arange(right.classes))
        assert bits(sample_of(right, values)) == base


@pytest.mark.usefixtures("_no_buffer")
@pytest.mark.parametrize("name", ["different", "whole", "few"])
@pytest.mark.parametrize("most", [1, 7, 40, 150, 2000])
def test_columns_times_powers_of_two_keep_the_same_rows(name: str, most: int) -> None:
    values, codes = table(name)
    exponents = [-200, 7, 131]
    base = sample_of(offered(values, codes, most, [100, 500]), values)
    moved = np.ldexp(values, exponents)
    found = sample_of(offered(moved, codes, most, [4, 71]), moved)
    if name == "whole" and most == 1:
        return  # 8 rows differ in powers of two alone, and half of 1 may not be kept
    assert (np.ldexp(base.rows, exponents) == found.rows).all()
    assert (base.moved == found.moved).all()


@pytest.mark.parametrize("name", TABLES)
def test_with_room_for_all_every_row_is_kept_as_often_as_it_occurs(name: str) -> None:
    values, codes = table(name)
    sample = sample_of(offered(values, codes, 900, [33]), values)
    found = np.column_stack([sample.codes, sample.rows])
    expected = np.column_stack([codes, values])
    for one, other in zip(
        np.unique(found, axis=0, return_counts=True),
        np.unique(expected, axis=0, return_counts=True),
        strict=True,
    ):
        assert (one == other).all()


def test_copies_are_in_proportion() -> None:
    values = np.repeat([[1.0], [2.0], [3.0]], [600, 300, 100], axis=0)
    rows = offered(values, np.zeros(1000, np.int64), 10, [])
    sample = sample_of(rows, values)
    assert np.sort(sample.rows[:, 0]).tolist() == [1.0] * 6 + [2.0] * 3 + [3.0]


def test_a_kept_row_is_counted_from_the_first_time_on() -> None:
    rng = np.random.default_rng(0)
    values, codes = np.round(rng.normal(size=(4000, 2)), 1), np.zeros(4000, np.int64)
    rows = offered(values, codes, 60, list(range(50, 4000, 50)))
    kept = rows.settle()
    assert kept is not None
    for row, copies in zip(kept.values, kept.copies.tolist(), strict=True):
        assert copies == np.count_nonzero((values == row).all(axis=1))


def test_all_rows_are_as_likely_to_be_kept() -> None:
    values, codes = table("different", rows=30_000)
    kept = sample_of(offered(values, codes, 2000, []), values).rows
    # 6,000 rows: the mean of a column has a spread of 1 / sqrt(6000) = 0.013.
    assert np.abs(kept.mean(axis=0)).max() < 4 * 0.013
    assert np.abs(kept.std(axis=0) - 1.0).max() < 4 * 0.013


def test_rows_of_powers_of_two_alone_are_sampled_without_favour() -> None:
    rng = np.random.default_rng(0)
    values = np.exp2(rng.integers(0, 2, (30_000, 20)).astype(np.float64))
    rows = offered(values, np.zeros(30_000, np.int64), 2000, [])
    kept = sample_of(rows, values).rows
    assert len(kept) == 2000
    # Half of each column is 1; the share has a spread of 0.5 / sqrt(2000) = 0.011.
    assert np.abs((kept == 1.0).mean(axis=0) - 0.5).max() < 4 * 0.012


def test_rows_that_agree_in_all_digits_are_kept_together() -> None:
    every = np.array(list(itertools.product([1.0, 2.0, 3.0, 4.0], repeat=5)))
    rows = offered(every, np.zeros(len(every), np.int64), 400, [])
    kept = np.unique(sample_of(rows, every).rows, axis=0)
    assert 200 <= len(kept) <= 400
    chosen = np.isin(hashed_digits(every), hashed_digits(kept))
    assert (every[chosen] == kept).all()


@given(
    st.lists(st.floats(-1e9, 1e9, width=32), min_size=1, max_size=6),
    st.integers(-300, 300),
)
@settings(deadline=None)
def test_the_hash_of_digits_ignores_powers_of_two(
    row: list[float], exponent: int
) -> None:
    values = np.array([row]) + 0.0
    assert hashed_digits(values) == hashed_digits(np.ldexp(values, exponent))


@pytest.mark.parametrize("step", [1.0, 0.1, 2.0**-20])
def test_hashes_of_small_numbers_do_not_collide(step: float) -> None:
    odd = step * np.arange(1, 2001, 2)
    values = np.array([[a, b] for a in odd[:60] for b in odd])
    assert len(np.unique(hashed_digits(values))) == len(values)
    assert len(np.unique(hashed_rows(values))) == len(values)
    assert hashed_digits(np.array([[0.0]])) != hashed_digits(np.array([[1.0]]))
    assert hashed_digits(np.array([[-1.0]])) != hashed_digits(np.array([[1.0]]))
