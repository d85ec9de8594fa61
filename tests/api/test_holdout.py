"""Folds are stratified, the same each time, and of bounded size."""

from __future__ import annotations

import numpy as np
import pytest

from fuzzytree.api import holdout, learn_table, run
from fuzzytree.api.holdout import (
    Accuracy,
    accuracy,
    accuracy_of,
    folds_of,
    grouped,
    majority,
    sampled,
)
from fuzzytree.errors import TableError
from fuzzytree.learning import LearningSettings, rows_beyond
from fuzzytree.model import USUAL_FLOOR
from fuzzytree.tables import Table, read_table, table


def _table(rows: int, *, classes: int = 2) -> Table:
    chance = np.random.default_rng(0)
    codes = np.arange(rows) % classes
    values = chance.normal(size=(rows, 2)) + 10.0 * codes[:, None]
    return read_table(values, target=codes)


def _accuracy(
    table: Table, settings: LearningSettings | None = None
) -> Accuracy | None:
    return accuracy(table, settings or LearningSettings())


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


def test_classes_far_apart_are_predicted_without_error() -> None:
    result = _accuracy(_table(60))
    assert result is not None
    assert result.mean == 1.0
    assert (result.rows, result.of) == (60, 60)


def test_a_large_table_is_sampled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(holdout, "CELLS", 80)
    result = _accuracy(_table(1000))
    assert result is not None
    assert (result.rows, result.of) == (40, 1000)


def test_at_most_20_000_rows_are_tested() -> None:
    result = _accuracy(_table(50_000), LearningSettings(mode="paper"))
    assert result is not None
    assert (result.rows, result.of) == (20_000, 50_000)


def test_patterns_of_a_class_that_a_fold_lacks_are_no_error() -> None:
    table = read_table(np.arange(21.0)[:, None], target=["a"] * 10 + ["b"] * 10 + ["c"])
    result = _accuracy(
        table, LearningSettings(mode="paper", patterns_per_class={"a": 2, "c": 1})
    )
    assert result is not None


def test_the_majority_is_the_share_of_the_most_common_class() -> None:
    table = read_table(np.arange(8.0)[:, None], target=[*"aabbbbcb"])
    assert majority(table, LearningSettings()) == 5 / 8


def test_too_few_rows_are_not_tested() -> None:
    assert _accuracy(_table(8)) is None


def test_a_class_of_one_row_is_answered_wrong_and_not_an_error() -> None:
    table = read_table(np.arange(21.0)[:, None], target=["a"] * 10 + ["b"] * 10 + ["c"])
    result = _accuracy(table)
    assert result is not None
    assert result.mean < 1.0


def test_a_tree_is_tested_on_rows_that_it_was_not_learnt_from() -> None:
    chance = np.random.default_rng(0)
    codes = np.repeat([0, 1], [6_000, 3_000])
    values = chance.normal(size=(9_000, 2)) + codes[:, None]
    settings = LearningSettings(rows_per_class=2_000, leaves=2)
    whole = read_table(values, target=codes)
    learnt = learn_table(whole, name="t", units={}, settings=settings)
    result = accuracy_of(whole, learnt, settings)
    assert result is not None
    assert (result.rows, result.of, result.is_of_tree) == (5_000, 9_000, True)
    others = np.flatnonzero(rows_beyond(values, codes, learnt.limits))
    predicted = run(learnt.tree, values[others]).classes
    is_right = np.asarray(predicted, np.int64) == codes[others]
    shares = [is_right[codes[others] == code].mean() for code in (0, 1)]
    assert result.mean == pytest.approx(2 / 3 * shares[0] + 1 / 3 * shares[1])
    balanced = LearningSettings(class_weight="balanced")
    half = accuracy_of(whole, learnt, balanced)
    assert half is not None
    assert half.mean == pytest.approx(sum(shares) / 2)


@pytest.mark.parametrize(
    "settings",
    [
        LearningSettings(),  # from all rows
        LearningSettings(rows_per_class=500, mode="paper"),  # whose means are of all
        LearningSettings(rows_per_class=1_100),  # a class has fewer than 1,000 others
    ],
)
def test_a_tree_is_not_tested_without_such_rows(settings: LearningSettings) -> None:
    whole = _table(4_000)
    learnt = learn_table(whole, name="t", units={}, settings=settings)
    assert accuracy_of(whole, learnt, settings) is None


def test_progress_is_reported_fold_by_fold() -> None:
    steps: list[str] = []
    table = _table(20)
    accuracy(table, LearningSettings(), progress=lambda text, _: steps.append(text))
    assert steps == [f"testing fold {k} of 5" for k in range(1, 6)]


def test_with_many_classes_fewer_folds_are_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(holdout, "_CLASSES", 4)
    result = _accuracy(_table(60))
    assert result is not None
    assert len(result.folds) == 2


@pytest.mark.heavy
def test_a_table_of_100_000_columns_is_tested_in_two_folds() -> None:
    values = np.zeros((100_000, 20))
    values[0, 10:] = 1.0
    columns = tuple(f"x{number}" for number in range(100_000))
    codes = np.repeat([0, 1], 10)
    table = Table("wide", columns, values, ("a", "b"), codes)
    result = accuracy(table, LearningSettings())
    assert result is not None
    assert result.folds == (1.0, 1.0)


def test_folds_of_whole_groups_do_not_learn_from_what_they_test_on() -> None:
    random = np.random.default_rng(0)
    places = random.normal(size=(60, 3))  # of groups, each of 10 rows that are alike
    labels = np.arange(60) % 2  # which say nothing of the places
    values = np.repeat(places, 10, axis=0) + random.normal(0.0, 1e-3, (600, 3))
    rows = np.column_stack([values, np.repeat(np.arange(60.0), 10)])
    source = table(rows, columns=["a", "b", "c", "group"])
    whole = read_table(source, target=np.repeat(labels, 10).tolist())
    rest, groups = grouped(whole, "group")
    assert rest.columns == ("a", "b", "c")
    alone = accuracy(rest, LearningSettings())
    together = accuracy(rest, LearningSettings(), groups=groups)
    assert alone is not None
    assert together is not None
    assert alone.mean > 0.9  # a row of the same group was learnt
    assert together.mean < 0.75


@pytest.mark.parametrize(("spread", "floor"), [(1.0, 0.0), (0.01, USUAL_FLOOR)])
def test_groups_unlike_the_others_lower_the_floor_of_strengths(
    spread: float, floor: float
) -> None:
    random = np.random.default_rng(0)
    places = 5.0 * (np.arange(8) % 2) + random.normal(0.0, spread, 8)  # of groups
    values = np.repeat(places, 20) + random.normal(0.0, 0.02, 160)
    codes = np.repeat(np.arange(8) % 2, 20)
    found = Table("groups", ("x",), values[np.newaxis], ("a", "b"), codes)
    tested = accuracy(found, LearningSettings(), groups=np.repeat(np.arange(8), 20))
    assert tested is not None
    assert tested.mean == 1.0
    assert tested.weak is not None
    assert (tested.weak > 0.05) == (floor == 0.0)
    assert tested.floor == floor
    alone = accuracy(found, LearningSettings())
    assert alone is not None
    assert (alone.weak, alone.floor) == (None, USUAL_FLOOR)


def test_a_column_of_groups_must_be_there_for_every_row() -> None:
    rows = np.array([[1.0, np.nan], [2.0, 1.0]])
    found = read_table(table(rows, columns=["x", "who"]), target=["a", "b"])
    with pytest.raises(TableError, match="row 1 has no group in 'who'"):
        grouped(found, "who")
    with pytest.raises(
        TableError, match="no column 'press' of groups; there is x, who"
    ):
        grouped(found, "press")
