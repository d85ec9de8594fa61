"""A Dask cluster of two processes gives the bits of pandas."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import fuzzytree as ft
from fuzzytree.errors import LearningError, TableError
from tests.api.engines import rows
from tests.api.engines.clusters import dask_cluster, needs

pytestmark = pytest.mark.heavy
needs("dask")
needs("distributed")


@pytest.fixture(scope="module", autouse=True)
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Return a client of a cluster, where all frames are computed."""
    with dask_cluster(tmp_path_factory.mktemp("dask")) as client:
        yield client


def parts_of(table: pd.DataFrame, count: int) -> Any:
    """Return a frame with a number of partitions, rows in turn."""
    import dask.dataframe as dd
    from dask.delayed import delayed

    parts = [delayed(table.iloc[k::count]) for k in range(count)]
    return dd.from_delayed(parts, meta=table.head(0))


@pytest.mark.parametrize("count", [1, 7, 64])
def test_the_number_of_partitions_and_their_order_do_not_matter(count: int) -> None:
    frame = parts_of(rows.random_rows().sample(frac=1.0, random_state=count), count)
    learnt = ft.learn(frame, target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())


def test_a_class_may_be_in_one_partition_and_partitions_may_be_empty() -> None:
    import dask.dataframe as dd

    table = rows.random_rows().dropna(subset="kind")
    parts = [part for _, part in table.groupby("kind")]
    frame = dd.concat([parts_of(one, 1) for one in [table.head(0), *parts]])
    learnt = ft.learn(frame, target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())


def test_frames_of_arrow_types_are_taken() -> None:
    table = rows.random_rows().convert_dtypes(dtype_backend="pyarrow")
    frame = parts_of(table, 3)
    learnt = ft.learn(frame, target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())
    predictions = ft.predict(frame, rows.random_tree()).compute().sort_values("row")
    expected = rows.random_predictions()
    assert rows.arrow_of(predictions).to_pylist() == rows.arrow_of(expected).to_pylist()


def test_the_client_receives_at_most_eight_states() -> None:
    from fuzzytree.api.engines import dask
    from fuzzytree.api.engines.core import Fold

    fold = Fold([*rows.random_rows().columns], "kind", ignore=["row"])
    states = dask.states(parts_of(rows.random_rows(), 65), fold)
    assert [bool(state) for state in states] == [True] * 2


def test_predictions_are_lazy_and_have_the_bits_of_run(tmp_path: Path) -> None:
    path = tmp_path / "ran"

    def mark(part: pd.DataFrame) -> pd.DataFrame:
        path.touch()
        return part

    table = rows.random_rows()
    frame = parts_of(table, 7).map_partitions(mark, meta=table.head(0))
    result = ft.predict(frame, rows.random_tree())
    assert not path.exists()
    predictions = result.compute()
    assert path.exists()
    assert [*predictions.dtypes] == [*result.dtypes]
    assert predictions.index.equals(parts_of(table, 7).compute().index)
    expected = rows.arrow_of(rows.random_predictions()).to_pylist()
    assert rows.arrow_of(predictions.sort_values("row")).to_pylist() == expected


@pytest.mark.parametrize("labels", [[1, 2, 3], [True, False], ["1", "2"], [0.5, 1.0]])
def test_types_of_columns_and_labels_are_those_of_pandas(labels: list[object]) -> None:
    table = rows.typed_rows(labels)
    tree = ft.learn(table, target="size")
    frame = parts_of(table, 3)
    assert rows.same_tree(ft.learn(frame, target="size"), tree)
    result = ft.predict(frame, tree)
    predictions = result.compute().sort_index()
    assert [*predictions.dtypes] == [*result.dtypes]
    expected = rows.arrow_of(ft.predict(table, tree))
    assert rows.arrow_of(predictions).to_pylist() == expected.to_pylist()


def test_columns_may_have_numbers_for_names() -> None:
    table = rows.random_rows().head(500).drop(columns="row")
    table.columns = pd.Index([0, 1, 2, 3, "kind"], dtype=object)
    tree = ft.learn(table, target="kind")
    assert rows.same_tree(ft.learn(parts_of(table, 3), target="kind"), tree)
    predictions = ft.predict(parts_of(table, 3), tree).compute().sort_index()
    expected = ft.predict(table, tree)
    assert predictions["class"].to_list() == expected["class"].to_list()


def test_a_column_of_durations_is_reported() -> None:
    table = pd.DataFrame({"weight": pd.to_timedelta(range(80), "D")})
    table["kind"] = [k % 2 for k in range(80)]
    with pytest.raises(TableError) as caught:
        ft.learn(parts_of(table, 20), target="kind")
    assert str(caught.value).splitlines()[0] == (
        "the table: column 'weight' holds no number, text, truth value or date: "
        "'' (and 79 more)"
    )


def test_times_are_days() -> None:
    days = pd.date_range("2026-01-01", periods=40)
    table = pd.DataFrame({"day": days, "kind": [0] * 20 + [1] * 20})
    tree = ft.learn(parts_of(table, 2), target="kind")
    assert tree.variables[0].unit == "days since 1970-01-01"
    assert tree.variables[0].low == 20454.0


def test_missing_values_are_refused_where_they_may_not_be() -> None:
    settings = ft.LearningSettings(missing="refuse")
    frame = parts_of(rows.random_rows(), 7)
    with pytest.raises(LearningError, match="partition 0: 1 of 2858 rows hold a miss"):
        ft.learn(frame, target="kind", ignore=["row"], settings=settings)


def test_a_table_without_rows_is_refused() -> None:
    with pytest.raises(TableError, match="the table has no rows"):
        ft.learn(parts_of(rows.random_rows().head(0), 3), target="kind")


def test_a_worker_that_is_killed_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "killed"
    table = rows.random_rows()

    def kill(part: pd.DataFrame) -> pd.DataFrame:
        """Kill the worker that has the fourth of the partitions, once."""
        if np.isin(3, part["row"]) and not path.exists():
            path.write_text(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGKILL)
        return part

    frame = parts_of(table, 7).map_partitions(kill, meta=table.head(0))
    learnt = ft.learn(frame, target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())
    assert not Path("/proc", path.read_text()).exists()
