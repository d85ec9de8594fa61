"""Weights of rows come from a column or an array, and are checked where they stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest

import fuzzytree as ft
from fuzzytree.errors import TableError
from fuzzytree.learning import parts

_RNG = np.random.default_rng(0)
TABLE = pd.DataFrame(
    {
        "size": _RNG.normal(size=80),
        "kind": [*"pqrs"] * 20,
        "w": [0, 1, 2, 3, 1] * 16,
    }
)
is_large = (TABLE["size"] > 0.3) | (TABLE["kind"] == "q")
TABLE["y"] = np.where(is_large, "yes", "no")
TABLE.loc[7, "size"] = np.nan


def repeated() -> pd.DataFrame:
    return TABLE.loc[TABLE.index.repeat(TABLE["w"])].drop(columns="w")


def test_a_column_of_weights_counts_rows_and_is_no_input(tmp_path: Path) -> None:
    file = tmp_path / "rows.csv"
    TABLE.to_csv(file, index=False)
    whole = ft.learn(repeated(), target="y", name="rows")
    values = TABLE.drop(columns=["w", "y"])
    assert ft.learn(TABLE, target="y", weights="w", name="rows") == whole
    assert ft.learn(str(file), target="y", weights=" w ") == whole
    assert whole == ft.learn(
        values, target=[*TABLE["y"]], weights=TABLE["w"], name="rows"
    )


def test_classes_of_rows_without_weight_are_none() -> None:
    heavy = TABLE.assign(w=1, y=[*"abcd"] * 20)
    heavy.loc[heavy["y"] == "d", "w"] = 0
    assert ft.learn(heavy, target="y", weights="w").classes == ("a", "b", "c")


@pytest.mark.parametrize(
    ("weight", "text"),
    [
        (-1.0, "-1.0"),
        (np.nan, "nan"),
        (None, "None"),
        (np.inf, "inf"),
        ("much", "'much'"),
    ],
)
def test_a_weight_that_is_none_is_named_with_its_row(weight: object, text: str) -> None:
    table = TABLE.astype({"w": object})
    table.loc[3, "w"] = weight
    with pytest.raises(TableError) as caught:
        ft.learn(table, target="y", weights="w")
    assert str(caught.value) == (
        f"the table, row 4: the weight in column 'w' is {text}; a weight is finite and "
        "not negative"
    )


@pytest.mark.parametrize(
    ("table", "weights", "message"),
    [
        (
            TABLE.assign(w=0),
            "w",
            "the table: all weights are zero, and a row of weight zero is left out",
        ),
        (TABLE, [1, 2], "the table has 80 rows, and there are 2 weights for them"),
        (TABLE, "v", "the table has no column 'v'; it has size, kind, w, y"),
        (
            TABLE,
            np.ones((80, 1)),
            "weights have the shape (80, 1), and they need (rows,)",
        ),
        (TABLE, 3.0, "weights have the shape (), and they need (rows,)"),
        (
            TABLE.assign(y=["a"] + ["b"] * 79),
            "w",
            "cannot learn from one class: every row is 'b'",
        ),
        (
            pl.from_pandas(TABLE).lazy(),
            "w",
            "a LazyFrame of polars has no weights of rows, as it is not collected: "
            "collect it first",
        ),
    ],
    ids=["zeros", "length", "column", "shape", "number", "one class", "lazy"],
)
def test_weights_that_do_not_fit_are_refused(
    table: object, weights: object, message: str
) -> None:
    with pytest.raises(ValueError, match=r"weight|column|class") as caught:
        ft.learn(table, target="y", weights=weights)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_a_table_that_is_not_read_whole_has_no_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "MOST_CELLS", 100)
    file = tmp_path / "rows.csv"
    large = pd.DataFrame({"x": range(200_000), "w": 1, "y": [*"ab"] * 100_000})
    large.to_csv(file, index=False)
    with pytest.raises(TableError) as caught:
        ft.learn(str(file), target="y", weights="w")
    assert str(caught.value) == (
        f"{file} has more than 100 numbers, and weights of rows need a table that is "
        "read whole; repeat its rows instead, or take fewer"
    )
