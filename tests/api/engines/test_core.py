"""What the adapters of all engines share: states, predictions and their limits."""

from __future__ import annotations

import json
import pickle
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import fuzzytree as ft
from fuzzytree.api.engines.core import Fold, Predictor, merge_states
from fuzzytree.errors import ReadError, TableError
from fuzzytree.learning import Learner
from fuzzytree.model import fingerprint

WINE = "examples/wine/wine.csv"


def wine() -> pd.DataFrame:
    """Return the wine table."""
    return pd.read_csv(WINE)


def batches_of(table: pd.DataFrame) -> Any:
    """Return a table as record batches of ten rows."""
    return pa.Table.from_pandas(table, preserve_index=False).to_batches(10)


@pytest.mark.parametrize("count", [1, 7, 64])
def test_merged_states_of_partitions_give_the_tree_of_the_whole_table(
    count: int,
) -> None:
    table = wine()
    fold = pickle.loads(pickle.dumps(Fold([*table.columns], "cultivar")))
    parts = [batches_of(table.iloc[number::count]) for number in range(count)]
    states = [fold(part, f"partition {k}") for k, part in enumerate(parts)]
    pairs = [merge_states(states[k : k + 2]) for k in range(0, len(states), 2)]
    merged = Learner.from_bytes(merge_states(reversed([*pairs, b""])))
    expected = fingerprint(ft.learn(table, target="cultivar"))
    assert fingerprint(merged.learn()) == expected


def test_partitions_of_equal_rows_all_count() -> None:
    fold = Fold([*wine().columns], "cultivar")
    state = fold(batches_of(wine()), "partition 0")
    assert Learner.from_bytes(merge_states([state] * 3)).rows == 3 * len(wine())


def test_a_partition_without_rows_has_an_empty_state() -> None:
    fold = Fold([*wine().columns], "cultivar")
    empty = pa.RecordBatch.from_pandas(wine().head(0), preserve_index=False)
    assert fold([], "partition 0") == fold([empty], "partition 1") == b""
    assert merge_states([b"", b""]) == b""


def test_an_error_of_a_partition_comes_back_as_its_state() -> None:
    fold = Fold(["cm", "size"], "size")
    good = pa.record_batch({"cm": [1.0], "size": ["small"]})
    bad = pa.record_batch({"size": ["big"]})
    states = [fold([good], "partition 3"), fold([bad], "partition 17")]
    kind, text = json.loads(merge_states(states))
    assert kind == "TableError"
    assert text.splitlines()[0] == (
        "partition 17 has no column 'cm', which other parts have; it has size"
    )


def test_a_column_without_a_name_is_refused() -> None:
    with pytest.raises(TableError) as caught:
        Fold(["cm", " ", "size"], "size")
    assert str(caught.value) == (
        "the table: column 2 has no name; name it, or leave it out with "
        "ignore=['column 2']"
    )
    assert Fold(["cm", " ", "size"], "size", ignore=["column 2"]).columns == ("cm",)


@pytest.mark.parametrize("form", ["pandas", "polars", "arrow"])
def test_a_frame_comes_back_with_the_predictions_of_run(form: str) -> None:
    table = wine()
    table.index = table.index[::-1]
    tree = ft.learn(table, target="cultivar")
    frame: Any = table
    if form != "pandas":
        arrow = pa.Table.from_pandas(table, preserve_index=False)
        frame = arrow if form == "arrow" else pl.from_arrow(arrow)
    got = ft.predict(frame, tree)
    assert type(got) is type(frame)
    rows = (
        got.to_dict("list")
        if isinstance(got, pd.DataFrame)
        else got.to_pydict()
        if isinstance(got, pa.Table)
        else got.to_dict(as_series=False)
    )
    assert [*rows] == [*table.columns, "class", "rule", "status", "strength"]
    fired = ft.run(ft.rules_from_tree(tree), table)
    columns = ft.run(tree, table).columns()
    assert {name: [*rows[name]] for name in columns} == columns
    assert fired.strengths is not None
    strengths = fired.strengths[fired.rule - 1, np.arange(len(table))]
    assert np.array_equal(strengths, rows["strength"])


def test_rows_without_a_rule_have_no_strength() -> None:
    settings = ft.LearningSettings(missing="drop")
    tree = ft.learn(wine(), target="cultivar", settings=settings)
    table = wine().head(2).astype({"proline": float})
    table.loc[1, [*tree.inputs]] = np.nan
    batch = pa.RecordBatch.from_pandas(table, preserve_index=False)
    predictor = pickle.loads(pickle.dumps(Predictor(tree)))
    last = predictor(batch).to_pylist()[1]
    named = {name: last[name] for name in predictor.schema.names}
    assert named == {"class": None, "rule": 0, "status": "missing", "strength": None}


@pytest.mark.parametrize(
    ("labels", "kind"),
    [([1, 2], pa.int64()), ([0.5, 1.5], pa.float64()), ([True, False], pa.bool_())],
)
def test_the_classes_have_the_type_of_the_labels(
    labels: list[object], kind: pa.DataType
) -> None:
    table = pd.DataFrame({"cm": [1.0, 7.0] * 3, "size": labels * 3})
    predictor = Predictor(ft.learn(table, target="size"))
    got = predictor(pa.RecordBatch.from_pandas(table, preserve_index=False))
    assert got.schema.field("class").type == kind
    assert got.column("class").to_pylist() == labels * 3


def test_a_column_named_as_one_that_is_added_is_refused() -> None:
    tree = ft.learn(wine(), target="cultivar")
    with pytest.raises(TableError) as caught:
        ft.predict(wine().rename(columns={"cultivar": "class"}), tree)
    assert str(caught.value) == (
        "the table has a column 'class' of its own, and predict adds one of this name; "
        "rename the column"
    )


def test_an_absent_column_is_reported_before_anything_runs() -> None:
    tree = ft.learn(wine(), target="cultivar")
    name = tree.inputs[0]
    with pytest.raises(TableError, match=f"no column {name!r}, which the model needs"):
        ft.predict(wine().drop(columns=name), tree)


@pytest.mark.parametrize("table", [WINE, np.ones((2, 13))], ids=["path", "array"])
def test_what_is_no_frame_is_refused(table: object) -> None:
    tree = ft.learn(wine(), target="cultivar")
    name = type(table).__name__
    with pytest.raises(TypeError) as caught:
        ft.predict(table, tree)
    assert str(caught.value) == f"{name} is no frame; `run` takes paths and arrays"


def test_a_fuzzy_system_predicts_no_class() -> None:
    with pytest.raises(ReadError, match="predict takes a tree or a rule base"):
        ft.predict(wine(), "examples/tipper.fll")


def test_integer_names_of_columns_are_those_of_run() -> None:
    table = pd.DataFrame({0: [1.0, 1.5, 7.0, 7.5], 1: ["s", "s", "b", "b"]})
    tree = ft.learn(table, target="1")
    assert ft.predict(table, tree)["class"].tolist() == ["s", "s", "b", "b"]
