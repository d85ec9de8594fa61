"""Folds are stratified, the same each time, and of bounded size."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree import holdout
from fuzzytree.holdout import accuracy, folds_of, sampled
from fuzzytree.learning import Settings
from fuzzytree.tables import Table, read_table


def _table(rows: int, *, classes: int = 2) -> Table:
    chance = np.random.default_rng(0)
    codes = np.arange(rows) % classes
    values = chance.normal(size=(rows, 2)) + 10.0 * codes[:, None]
    return read_table(values, target=codes)


def test_each_fold_holds_each_class_in_its_share() -> None:
    codes = np.array([0] * 50 + [1] * 10)
    folds = folds_of(codes, 5, seed=1)
    for fold in range(5):
        assert np.bincount(codes[folds == fold]).tolist() == [10, 2]


def test_the_folds_depend_on_the_seed_alone() -> None:
    codes = np.arange(100) % 3
    assert folds_of(codes, 5, 1).tolist() == folds_of(codes, 5, 1).tolist()
    assert folds_of(codes, 5, 1).tolist() != folds_of(codes, 5, 2).tolist()


def test_a_sample_keeps_the_shares_of_the_classes() -> None:
    codes = np.array([0] * 900 + [1] * 100)
    rows = sampled(codes, 100, seed=0)
    assert np.bincount(codes[rows]).tolist() == [90, 10]
    assert len(set(rows.tolist())) == 100


def test_classes_far_apart_are_told_apart() -> None:
    found = accuracy(_table(60), Settings())
    assert found is not None
    assert found.mean == 1.0
    assert (found.rows, found.of) == (60, 60)


def test_a_large_table_is_sampled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(holdout, "CELLS", 80)
    found = accuracy(_table(1000), Settings())
    assert found is not None
    assert (found.rows, found.of) == (40, 1000)


def test_too_few_rows_are_not_tested() -> None:
    assert accuracy(_table(8), Settings()) is None


def test_a_class_of_one_row_is_answered_wrong_and_not_an_error() -> None:
    table = read_table(np.arange(21.0)[:, None], target=["a"] * 10 + ["b"] * 10 + ["c"])
    found = accuracy(table, Settings())
    assert found is not None
    assert found.mean < 1.0


def test_progress_is_told_fold_by_fold() -> None:
    told: list[str] = []
    accuracy(_table(20), Settings(), progress=lambda text, _: told.append(text))
    assert told == [f"testing fold {k} of 5" for k in range(1, 6)]


def test_with_many_classes_fewer_folds_are_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(holdout, "_CLASSES", 4)
    found = accuracy(_table(60), Settings())
    assert found is not None
    assert len(found.folds) == 2
