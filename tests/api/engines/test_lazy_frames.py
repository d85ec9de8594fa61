"""Lazy frames of engines in this process learn and predict as tables in memory do."""

from __future__ import annotations

import decimal
import importlib
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import fuzzytree as ft
from fuzzytree.api.engines import engine_of
from fuzzytree.errors import FuzzyTreeError, MissingExtraError, TableError
from fuzzytree.model import FuzzyTree, RuleBase, fingerprint
from fuzzytree.testing import probe_values, random_tree

ENGINES = ("polars", "duckdb", "ibis")
ADDED = ["class", "rule", "status", "strength"]
NAMES = ['kPa "mean"', "a.b", "select", "Größe", " slip ", "it's", "back`tick", "50 %"]
Frame = Callable[..., Any]

HEAVY = pytest.mark.heavy
pytestmark = pytest.mark.filterwarnings("ignore:fetch_arrow_table:DeprecationWarning")


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Return the name of an engine that is installed."""
    name = str(request.param)
    if importlib.util.find_spec(name) is None:
        text = f"the Python module {name} is not installed"
        if os.environ.get("FUZZYTREE_WITNESSES") == "all":
            pytest.fail(text)
        pytest.skip(text)
    return name


@pytest.fixture
def frame_of(engine: str, tmp_path: Path) -> Frame:
    """Return a function from the parts of a table to a lazy frame of their files."""
    connections: list[Any] = []  # DuckDB 1 closes one that nothing refers to

    def frame(*parts: pa.Table) -> Any:
        files = [tmp_path / f"{number}.parquet" for number in range(len(parts))]
        for file, part in zip(files, parts, strict=True):
            pq.write_table(part, file)
        paths = [*map(str, files)]
        if engine == "polars":
            polars = importlib.import_module("polars")
            return polars.concat([*map(polars.scan_parquet, paths)])
        if engine == "ibis":
            return importlib.import_module("ibis").duckdb.connect().read_parquet(paths)
        connections.append(importlib.import_module("duckdb").connect())
        return connections[-1].read_parquet(paths)

    return frame


def collected(frame: Any) -> pa.Table:
    """Return a lazy frame as a table in memory."""
    if hasattr(frame, "collect"):
        return frame.collect(engine="streaming").to_arrow()
    name = "to_pyarrow" if hasattr(frame, "to_pyarrow") else "to_arrow_table"
    return getattr(frame, name)()


def rows_of(count: int = 2_000, labels: tuple[object, ...] = ("a", "b", "c")) -> Any:
    """Return a table of all types of numbers, with missing values and odd names.

    The first label has one row.
    """
    random = np.random.default_rng(0)
    codes = random.integers(1, len(labels), count)
    codes[count // 2] = 0
    normal = random.normal(size=(len(NAMES), count)) + codes
    whole = (normal[1] * 1e3).astype(np.int64)
    tenth = decimal.Decimal("0.1")
    columns: list[Any] = [
        pa.array(normal[0] * 1e-9),
        pa.array(whole + 2**50 * codes),
        pa.array(whole, mask=codes == 9),
        pa.array([tenth * int(n) if n % 17 else None for n in whole]),
        pa.array(normal[4].astype(np.float32)),
        pa.array([None if n % 50 == 9 else bool(n % 3) for n in whole]),
        pa.array(np.where(whole % 97, normal[6] * 1e12, np.nan)),
        pa.array(whole, mask=whole % 31 == 0),
    ]
    classes = [labels[code] for code in codes]
    classes[7] = None
    table = dict(zip(NAMES, columns, strict=True))
    return pa.table({**table, "note": ["x"] * count, "kind": pa.array(classes)})


def quietly_learnt(table: Any, **options: Any) -> FuzzyTree:
    """Return a tree without its remarks."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return ft.learn(table, target="kind", **options)


@pytest.mark.parametrize("count", [1, pytest.param(7, marks=HEAVY), 64])
def test_partitions_in_any_order_give_the_tree_of_pandas(
    frame_of: Frame, count: int
) -> None:
    table = rows_of()
    expected = quietly_learnt(table.to_pandas(), ignore=["note"])
    order = np.random.default_rng(count).permutation(count)
    parts = [table.take(np.arange(k, table.num_rows, count)) for k in order]
    empty = table.slice(0, 0)
    tree = quietly_learnt(frame_of(empty, *parts, empty), ignore=["note"])
    assert fingerprint(tree) == fingerprint(expected)


@pytest.mark.parametrize(
    "labels",
    [
        ("10", "9", "x"),
        (True, False),
        pytest.param((1, 2, 3), marks=HEAVY),
        pytest.param((1.0, 2.0, 2.5), marks=HEAVY),
        pytest.param((1.0, 2.0, 3.0), marks=HEAVY),
    ],
    ids=str,
)
def test_labels_of_any_type_are_learnt_and_predicted_as_in_memory(
    frame_of: Frame, labels: tuple[object, ...]
) -> None:
    table = rows_of(200, labels).drop(["note"])
    frame = frame_of(table.slice(0, 90), table.slice(90))
    tree = quietly_learnt(frame)
    assert fingerprint(tree) == fingerprint(quietly_learnt(table.to_pandas()))
    classes = collected(ft.predict(frame, tree))["class"].to_pylist()
    assert [*map(repr, classes)] == [*map(repr, ft.run(tree, table).classes)]


def models() -> dict[str, FuzzyTree | RuleBase]:
    """Return trees and rule bases, by what they are."""
    result: dict[str, FuzzyTree | RuleBase] = {}
    for seed in range(3):
        tree = random_tree(seed, leaves=[1, 7, 20][seed])
        result |= {f"tree {seed}": tree, f"rules {seed}": ft.rules_from_tree(tree)}
        if tree.sets:
            raw = ft.rules_from_tree(tree, "raw", conjunction="product")
            result[f"raw rules {seed}"] = raw
    return result


MODELS = models()


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=HEAVY if n[-1] == "2" else ()) for n in MODELS]
)
def test_predictions_have_the_bits_of_run(frame_of: Frame, name: str) -> None:
    model = MODELS[name]
    values = probe_values(model, 1_000)
    columns = dict(zip(model.inputs, map(pa.array, values), strict=True))
    table = pa.table({"row": np.arange(values.shape[1]), **columns})
    frame = frame_of(table.slice(0, 300), table.slice(300))
    got = collected(ft.predict(frame, model))
    assert got.column_names == [*table.column_names, *ADDED]
    assert got["row"].to_pylist() == table["row"].to_pylist()
    ran = ft.run(model, table)
    assert [cell or "" for cell in got["class"].to_pylist()] == ran.columns()["class"]
    assert got["rule"].type == pa.int32()
    assert got["rule"].to_pylist() == ran.columns()["rule"]
    assert got["status"].to_pylist() == ran.columns()["status"]
    rules = model if isinstance(model, RuleBase) else ft.rules_from_tree(model)
    fired = ft.run(rules, table)
    assert fired.strengths is not None
    strengths = fired.strengths[fired.rule - 1, np.arange(table.num_rows)]
    expected = [s if r else None for s, r in zip(strengths, fired.rule, strict=True)]
    assert got["strength"].to_pylist() == expected


def test_columns_of_all_types_are_predicted_as_in_memory(frame_of: Frame) -> None:
    table = rows_of()
    tree = quietly_learnt(table, ignore=["note"])
    frame = frame_of(table)
    kept = collected(frame)
    got = collected(ft.predict(frame, tree))
    as_before = got.select(kept.column_names).to_pandas()
    pd.testing.assert_frame_equal(as_before, kept.to_pandas())
    expected = ft.predict(table, tree).select(ADDED)
    assert got.select(ADDED).to_pylist() == expected.to_pylist()


def test_numbers_with_more_digits_than_a_double_are_rounded_to_the_nearest(
    frame_of: Frame,
) -> None:
    near = decimal.Decimal("1234567890123456.785")
    cells = [near + decimal.Decimal(k) / 1000 for k in range(-400, 400)]
    table = pa.table({"m": cells, "kind": [str(c < near) for c in cells]})
    tree = quietly_learnt(table)
    got = collected(ft.predict(frame_of(table), tree))
    assert got["class"].to_pylist() == ft.run(tree, table).classes


def test_the_remarks_are_those_of_a_table_in_memory(frame_of: Frame) -> None:
    table = rows_of().drop(["note"]).append_column("id", pa.array(range(2_000)))
    with pytest.warns(UserWarning, match="the table: id has a different whole number"):
        ft.learn(frame_of(table), target="kind")


def test_a_filter_on_a_prediction_keeps_its_rows(frame_of: Frame, engine: str) -> None:
    table = rows_of()
    tree = quietly_learnt(table, ignore=["note"])
    got = ft.predict(frame_of(table), tree)
    if engine == "polars":
        polars = importlib.import_module("polars")
        got = got.filter(polars.col("class") == "b").select("class", "note")
    elif engine == "ibis":
        got = got.filter(got["class"] == "b").select("class", "note")
    else:
        got = got.filter("class = 'b'").project("class, note")
    count = ft.run(tree, table).classes.count("b")
    assert collected(got).num_rows == count > 0


def refused(action: Callable[[], object]) -> str:
    """Return the sentence with which something is refused."""
    with pytest.raises(FuzzyTreeError) as caught:
        action()
    return str(caught.value).splitlines()[0]


def test_an_unknown_target_is_refused_with_a_hint(frame_of: Frame) -> None:
    frame = frame_of(pa.table({"cm": [1.0, 2.0], "size": ["s", "b"]}))
    assert refused(lambda: ft.learn(frame, target="sise")) == (
        "the table has no column 'sise'; it has cm, size (did you mean 'size'?)"
    )
    assert refused(lambda: ft.learn(frame, target=["s", "b"])).endswith(
        "is one of its columns: pass the name of the column"
    )


def test_bytes_are_refused(frame_of: Frame) -> None:
    table = pa.table({"cm": [b"wide"] * 9, "size": ["s"] * 9})
    assert refused(lambda: ft.learn(frame_of(table, table), target="size")) == (
        "the table: column 'cm' holds no number, text, truth value or date: "
        "'' (and 17 more)"
    )


def test_a_table_without_rows_is_refused(frame_of: Frame) -> None:
    table = rows_of().slice(0, 0)
    frame = frame_of(table)
    assert refused(lambda: ft.learn(frame, target="kind")) == "the table has no rows"
    got = collected(ft.predict(frame, random_tree(0, leaves=1)))
    assert got.column_names == [*table.column_names, *ADDED]


def test_a_missing_value_is_refused_on_request(frame_of: Frame) -> None:
    settings = ft.LearningSettings(missing="refuse")
    frame = frame_of(rows_of().drop(["note"]))
    text = refused(lambda: ft.learn(frame, target="kind", settings=settings))
    assert text.endswith("hold a missing or infinite value")


def test_an_input_of_text_is_refused_before_or_in_the_engine(
    frame_of: Frame, engine: str
) -> None:
    tree = ft.learn("examples/wine/wine.csv", target="cultivar")
    table = pa.table({name: ["wide"] for name in tree.inputs})
    with pytest.raises(Exception, match=r"column .alcohol. (is no|holds)") as e:
        collected(ft.predict(frame_of(table), tree))
    assert engine == "polars" or isinstance(e.value, TableError)


def test_many_rules_are_one_query(frame_of: Frame) -> None:
    rules = ft.rules_from_tree(random_tree(0))
    rules = msgspec.structs.replace(rules, rules=rules.rules * 72)
    frame = frame_of(pa.table({name: [1.0] for name in rules.inputs}))
    assert collected(ft.predict(frame, rules)).num_rows == 1


def test_a_name_that_differs_in_case_alone_is_a_clash_where_case_is_ignored(
    frame_of: Frame, engine: str
) -> None:
    tree = random_tree(1)
    columns = {name: [1.0] for name in tree.inputs}
    frame = frame_of(pa.table({**columns, "Class": ["x"]}))
    if engine == "polars":
        assert "Class" in collected(ft.predict(frame, tree)).column_names
    else:
        assert refused(lambda: ft.predict(frame, tree)) == (
            "the table has a column 'Class' of its own, and predict adds one of this "
            "name; rename the column"
        )


def test_a_package_that_is_missing_is_named_with_its_command(
    frame_of: Frame, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = frame_of(pa.table({"cm": [1.0, 7.0], "kind": ["s", "b"]}))
    monkeypatch.delitem(sys.modules, f"fuzzytree.api.engines.{engine}", raising=False)
    monkeypatch.setitem(sys.modules, "polars", None)
    monkeypatch.setitem(sys.modules, "sqlglot", None)
    if engine == "duckdb":
        ft.learn(frame, target="kind")  # its adapter needs the frame alone
        return
    with pytest.raises(MissingExtraError, match=f"of {engine} needs .*pip install"):
        ft.learn(frame, target="kind")


def test_nothing_runs_before_a_frame_is_collected(engine: str) -> None:
    tree = random_tree(1)
    calls: list[int] = []
    columns = {name: np.ones(10) for name in tree.inputs}
    if engine == "polars":
        polars = importlib.import_module("polars")

        def count(rows: Any) -> Any:
            calls.append(len(rows))
            return rows

        frame = polars.LazyFrame(columns).map_batches(count)
    else:
        duckdb = importlib.import_module("duckdb")
        connection = duckdb.connect()

        def count_row(row: int) -> float:
            calls.append(row)
            return 1.0

        connection.create_function("count_row", count_row, ["BIGINT"], "DOUBLE")
        names = ", ".join(f"count_row(range) AS {name}" for name in columns)
        query = f"SELECT {names} FROM range(10)"
        frame = connection.sql(query)
        if engine == "ibis":
            ibis = importlib.import_module("ibis")
            backend = ibis.duckdb.from_connection(connection)
            connection.sql(f"CREATE VIEW counting AS {query}")
            frame = backend.table("counting")
    got = ft.predict(frame, tree)
    assert type(got) is type(frame)
    assert not calls
    assert collected(got).num_rows == 10
    assert calls


def test_other_tables_have_no_engine() -> None:
    assert engine_of(pd.DataFrame()) is engine_of("rows.csv") is None
    assert engine_of(pa.table({})) is None


def test_predictions_of_two_models_stand_in_one_query(
    frame_of: Frame, engine: str
) -> None:
    table = rows_of().drop(["note"])
    tree = quietly_learnt(table)
    rules = ft.rules_from_tree(tree, "raw")
    first = ft.predict(frame_of(table), tree)
    titles = {name: f"tree {name}" for name in ADDED}
    if engine == "duckdb":
        pairs = ", ".join(f'"{a}" AS "{b}"' for a, b in titles.items())
        first = first.project(f"* RENAME ({pairs})")
    elif engine == "ibis":
        first = first.rename({b: a for a, b in titles.items()})
    else:
        first = first.rename(titles)
    got = collected(ft.predict(first, rules))
    assert got["tree rule"].to_pylist() == ft.run(tree, table).rule.tolist()
    assert got["rule"].to_pylist() == ft.run(rules, table).rule.tolist()
