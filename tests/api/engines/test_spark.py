"""Spark with a driver and two workers, and Spark Connect, give the bits of pandas."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pytest

import fuzzytree as ft
from fuzzytree.errors import LearningError, TableError
from tests.api.engines import rows
from tests.api.engines.clusters import needs, spark_cluster, spark_server

pytestmark = [
    pytest.mark.heavy,
    pytest.mark.filterwarnings("ignore:PySpark does not yet fully support pandas"),
]
needs("pyspark", "java")

classic = pytest.mark.parametrize("session", ["classic"], indirect=True)
"""What needs no second run with Spark Connect."""


@pytest.fixture(scope="module", params=["classic", "connect"])
def session(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Any]:
    """Return a session of a cluster, or of a server of Spark Connect."""
    start = spark_cluster if request.param == "classic" else spark_server
    with start(tmp_path_factory.mktemp("spark")) as session:
        yield session


@pytest.fixture(scope="module")
def frame(session: Any) -> Any:
    """Return the random rows."""
    return session.createDataFrame(rows.arrow_of(rows.random_rows()))


def test_partitions_give_the_tree_of_pandas(frame: Any) -> None:
    learnt = ft.learn(frame.repartition(7), target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())


@classic
@pytest.mark.parametrize("count", [1, 64])
def test_the_number_of_partitions_and_their_order_do_not_matter(
    count: int, session: Any
) -> None:
    shuffled = rows.random_rows().sample(frac=1.0, random_state=count)
    frame = session.createDataFrame(rows.arrow_of(shuffled)).repartition(count)
    learnt = ft.learn(frame, target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())


def test_a_class_may_be_in_one_partition_and_partitions_may_be_empty(
    frame: Any,
) -> None:
    learnt = ft.learn(frame.repartition(9, "kind"), target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())


@classic
def test_equal_partitions_all_count(frame: Any) -> None:
    one = frame.coalesce(1)
    learnt = ft.learn(one.union(one), target="kind", ignore=["row"])
    twice = pd.concat([rows.random_rows()] * 2)
    assert rows.same_tree(learnt, ft.learn(twice, target="kind", ignore=["row"]))


@classic
def test_the_driver_receives_at_most_eight_states(frame: Any) -> None:
    from fuzzytree.api.engines import spark
    from fuzzytree.api.engines.core import Fold

    fold = Fold(frame.columns, "kind", ignore=["row"])
    states = spark.states(frame.repartition(20), fold)
    assert 0 < len(states) <= 8
    assert len(spark.states(frame.limit(0), fold)) <= 8


def test_predictions_are_lazy_and_have_the_bits_of_run(
    frame: Any, tmp_path: Path
) -> None:
    path = str(tmp_path / "ran")

    def mark(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        Path(path).touch()
        yield from batches

    frame = frame.repartition(7).mapInArrow(mark, frame.schema)
    result = ft.predict(frame, rows.random_tree())
    assert not Path(path).exists()
    predictions = result.toArrow().sort_by("row").to_pylist()
    assert predictions == rows.arrow_of(rows.random_predictions()).to_pylist()


@classic
@pytest.mark.parametrize("labels", [[1, 2, 3], [True, False], ["1", "2"], [0.5, 1.0]])
def test_types_of_columns_and_labels_are_those_of_pandas(
    labels: list[object], session: Any
) -> None:
    table = rows.typed_rows(labels)
    tree = ft.learn(table, target="size")
    frame = session.createDataFrame(rows.arrow_of(table)).repartition(3)
    assert rows.same_tree(ft.learn(frame, target="size"), tree)
    predictions = ft.predict(frame, tree).toArrow()
    names = [*table.columns]
    expected = rows.arrow_of(ft.predict(table, tree)).sort_by(
        [(n, "ascending") for n in names]
    )
    predictions = predictions.sort_by([(n, "ascending") for n in names])
    assert predictions.to_pylist() == expected.to_pylist()


@classic
@pytest.mark.filterwarnings("ignore:the table. ' c ' has blanks around its name")
def test_columns_are_named_as_people_name_them(session: Any) -> None:
    names = {"a": "a.b", "b": "b`c", "c": " c ", "d": "select"}
    table = rows.random_rows().head(500).rename(columns=names)
    frame = session.createDataFrame(rows.arrow_of(table)).repartition(3)
    tree = ft.learn(table, target="kind", ignore=["row"])
    assert rows.same_tree(ft.learn(frame, target="kind", ignore=["row"]), tree)
    predictions = ft.predict(frame, tree).toArrow().sort_by("row").to_pylist()
    assert predictions == rows.arrow_of(ft.predict(table, tree)).to_pylist()


def test_a_column_of_bytes_is_reported(
    session: Any,
) -> None:
    text = "cast('x' as binary) as weight"
    frame = session.range(0, 80, 1, 20).selectExpr(text, "id % 2 as kind")
    with pytest.raises(TableError) as caught:
        ft.learn(frame, target="kind")
    assert str(caught.value).splitlines()[0] == (
        "the table: column 'weight' holds no number, text, truth value or date: "
        "'' (and 79 more)"
    )


@classic
def test_times_are_days(session: Any) -> None:
    day = "date_add(date '2026-01-01', cast(id as int)) as day"
    frame = session.range(40).selectExpr(day, "id < 20 as kind")
    tree = ft.learn(frame, target="kind")
    assert tree.variables[0].unit == "days since 1970-01-01"


@classic
def test_missing_values_are_refused_where_they_may_not_be(frame: Any) -> None:
    settings = ft.LearningSettings(missing="refuse")
    with pytest.raises(LearningError, match=r"partition \d: 1 of \d+ rows hold a miss"):
        ft.learn(frame.repartition(7), target="kind", ignore=["row"], settings=settings)


@classic
def test_a_table_without_rows_is_refused(frame: Any) -> None:
    with pytest.raises(TableError, match="the table has no rows"):
        ft.learn(frame.limit(0), target="kind")


@classic
def test_an_executor_that_is_killed_changes_nothing(frame: Any, tmp_path: Path) -> None:
    path = tmp_path / "killed"

    def kill(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        """Kill the executor of this Python process in the middle of a partition."""
        from pyspark import TaskContext

        context: Any = TaskContext.get()
        for batch in batches:
            yield batch
            if context.partitionId() == 3 and not path.exists():
                daemon = os.getppid()
                status = Path(f"/proc/{daemon}/status").read_text()
                executor = int(status.partition("PPid:")[2].split()[0])
                path.write_text(str(executor))
                os.kill(executor, signal.SIGKILL)

    spoilt = frame.repartition(7).mapInArrow(kill, frame.schema)
    learnt = ft.learn(spoilt, target="kind", ignore=["row"])
    assert rows.same_tree(learnt, rows.random_tree())
    executor = Path("/proc", path.read_text(), "cmdline")
    assert not executor.exists() or not executor.read_bytes()
