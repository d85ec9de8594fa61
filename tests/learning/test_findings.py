"""Continuous targets are refused, and columns that identify rows are remarked on."""

from __future__ import annotations

import numpy as np
import pytest

import fuzzytree as ft
from fuzzytree.errors import LearningError
from fuzzytree.learning.findings import remarks
from fuzzytree.tables import TableSource, read_table

CHANCE = np.random.default_rng(0)
MEASURED = CHANCE.normal(size=60).round(2).tolist()
COUNTS = (CHANCE.permutation(60) * 31).tolist()


def _remarks(
    values: dict[str, list[float]], target: list[object] | None = None
) -> dict[str, str]:
    columns = list(values)
    rows = np.array([values[name] for name in columns]).T
    classes = target or [k % 2 for k in range(len(rows))]
    table = read_table(TableSource(rows, columns=columns), target=classes)
    return dict(remarks(table, lambda column: f"--ignore {column}"))


@pytest.mark.parametrize(
    ("target", "number"),
    [
        (MEASURED, len({*MEASURED})),
        (COUNTS, 60),
        ([0.5 + k % 21 for k in range(60)], 21),
        ([f"{k},5" for k in range(60)], 60),
        ([0.25, 0.5, 0.75], 3),
    ],
    ids=["measurements", "counts", "many fractions", "decimal commas", "three rows"],
)
def test_a_continuous_target_is_refused(target: list[object], number: int) -> None:
    values = np.arange(float(len(target)))[:, None]
    with pytest.raises(LearningError) as caught:
        ft.learn(values, target=target)
    assert str(caught.value) == (
        f"the array: the target is continuous, with {number} different numbers in "
        f"{len(target)} rows, and a tree predicts classes; divide the numbers into "
        "ranges and learn these"
    )


@pytest.mark.parametrize(
    "target",
    [
        [k % 20 + 0.5 for k in range(60)],
        [k // 5 for k in range(300)],
        [f"v{k // 2}.5" for k in range(60)],
        ["3.9", "3.10", "3.11", "3.10"],
        [0.0, 1.0, 2.0, 2.0],
        [1, 2, 3],
    ],
    ids=["half steps", "60 numbers", "names", "versions", "whole floats", "3 rows"],
)
def test_classes_are_not_taken_for_measurements(target: list[object]) -> None:
    table = read_table(np.arange(float(len(target)))[:, None] * 1.5, target=target)
    dict(remarks(table, str))


def test_many_classes_with_few_rows_each_are_remarked_on() -> None:
    names: list[object] = [f"p{k // 2}" for k in range(60)]
    found = _remarks({"a": CHANCE.normal(size=60).tolist()}, names)
    assert found == {"the target": "30 classes in 60 rows, 2.0 rows for each"}


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("a", [*range(40)]),
        ("a", [*reversed(range(1001, 1041))]),
        ("sample id", [7 * k for k in range(40)]),
        ("passengerId", [k * k for k in range(10)]),
        ("ID", [3 * k for k in range(10)]),
    ],
)
def test_a_column_that_identifies_rows_is_remarked_on(
    name: str, values: list[float]
) -> None:
    assert _remarks({name: values}) == {
        name: "a different whole number in each row, as an identifier has; "
        f"--ignore {name} leaves it out"
    }


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("a", CHANCE.normal(size=40).tolist()),
        ("a", CHANCE.permutation(2000)[:40].tolist()),
        ("a", [*range(19)]),
        ("a", [*range(39), 38]),
        ("a", [0.5 + k for k in range(40)]),
        ("a", [*range(39), np.nan]),
        ("id", [*range(39), np.inf]),
        ("id", [k % 20 for k in range(40)]),
        ("acid", [7 * k for k in range(40)]),
    ],
)
def test_a_measured_column_is_not_remarked_on(name: str, values: list[float]) -> None:
    assert _remarks({name: values}) == {}


def test_learn_warns_of_an_identifier_and_uses_it() -> None:
    values = np.arange(40.0)[:, None]
    with pytest.warns(UserWarning, match="identifier") as caught:
        tree = ft.learn(
            ft.table(values, columns=["row"]), target=["a"] * 20 + ["b"] * 20
        )
    assert [str(one.message) for one in caught] == [
        "the array: row has a different whole number in each row, as an identifier "
        "has; ignore=['row'] leaves it out"
    ]
    assert tree.inputs == ("row",)
