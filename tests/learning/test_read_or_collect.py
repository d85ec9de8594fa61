"""A table that is too large for memory gives what a table that is read whole gives."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import fuzzytree as ft
from fuzzytree import tables
from fuzzytree.errors import LearningError, TableError
from fuzzytree.learning import Learner, parts
from fuzzytree.model import fingerprint
from fuzzytree.tables import Table, read_table

PIECE = 64


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a table of a few rows have several pieces."""
    monkeypatch.setattr(tables, "PIECE", PIECE)


@pytest.fixture
def low_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every table of more than one piece be too large."""
    monkeypatch.setattr(parts, "MOST_CELLS", 8)


def rows_of(count: int = 2 * PIECE + 50) -> pd.DataFrame:
    """Return a table of three pieces with a missing cell and a row without a class."""
    random = np.random.default_rng(1)
    codes = random.integers(0, 3, count)
    values = random.normal(size=(count, 3)) + codes[:, None] * [2.0, 1.0, 0.0]
    table = pd.DataFrame(values, columns=["a", "b", "c"])
    table["kind"] = codes
    table = table.astype({"kind": object})
    table.loc[7, "b"] = np.nan
    table.loc[11, "kind"] = None
    return table


def written(table: pd.DataFrame, path: Path, *, index: bool = False) -> str:
    """Write a table to a file."""
    if path.suffix == ".csv":
        table.to_csv(path, index=index)
    else:
        table.to_parquet(path, index=index)
    return str(path)


def both(path: str, monkeypatch: pytest.MonkeyPatch) -> tuple[Table, Learner]:
    """Return a table that is read whole, and the same one that is not."""
    settings = ft.LearningSettings()
    whole = parts.read_or_collect(path, target="kind", settings=settings)
    monkeypatch.setattr(parts, "MOST_CELLS", 8)
    result = parts.read_or_collect(path, target="kind", settings=settings)
    assert isinstance(whole, Table)
    assert isinstance(result, Learner)
    return whole, result


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
def test_a_table_read_piece_by_piece_gives_the_same_tree(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = rows_of()
    if name == "t.parquet":  # which has one type in a column
        table = table.astype({"kind": "Int64"})
    path = written(table, tmp_path / name)
    expected = ft.learn(path, target="kind")
    whole, learner = both(path, monkeypatch)
    assert fingerprint(ft.learn(path, target="kind")) == fingerprint(expected)
    sampled = learner.table()
    for field in ("name", "columns", "classes", "missing", "unlabelled", "target"):
        assert getattr(sampled, field) == getattr(whole, field)
    assert sampled.rows == whole.rows
    assert ft.learn(path, target="kind").name == "t"


def test_classes_that_come_by_themselves_are_cut_into_pieces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = rows_of().dropna()
    path = written(table.drop(columns="kind"), tmp_path / "t.csv")
    labels = table["kind"].tolist()
    expected = ft.learn(path, target=labels)
    monkeypatch.setattr(parts, "MOST_CELLS", 8)
    result = ft.learn(path, target=labels)
    assert result.semantics.label_type == expected.semantics.label_type == "number"
    assert fingerprint(result) == fingerprint(expected)
    with pytest.raises(TableError, match=rf"t.csv has {len(labels)} rows, and there "):
        ft.learn(path, target=labels[:-1])


def test_a_column_that_counts_the_rows_and_blanks_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = rows_of().rename(columns={"c": " c "})
    path = written(table, tmp_path / "t.csv", index=True)
    whole, learner = both(path, monkeypatch)
    assert learner.columns == whole.columns == ("a", "b", "c")
    assert learner.table().remarks == whole.remarks
    assert [column for column, _ in whole.remarks] == ["column 1", "' c '"]


@pytest.mark.parametrize("fault", ["text", "unnamed", "class", "unit", "rows"])
def test_the_messages_are_those_of_a_table_that_is_read_whole(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = rows_of().astype(object)
    if fault == "text":
        table.loc[PIECE + 20, "c"] = "heavy"
        table.loc[PIECE + 40, "a"] = "1,5"
        table.loc[[2, PIECE + 50], "b"] = "soft"
    table = table.iloc[::-1] if fault == "unnamed" else table
    path = written(table, tmp_path / "t.csv", index=fault == "unnamed")
    target = "class" if fault == "class" else "kind"
    units = {"z": "N"} if fault == "unit" else None
    if fault == "rows":
        table["kind"] = None
        path = written(table, tmp_path / "t.csv")
    messages: list[str] = []
    for cells in (parts.MOST_CELLS, 8):
        monkeypatch.setattr(parts, "MOST_CELLS", cells)
        with pytest.raises(TableError) as caught:
            ft.learn(path, target=target, units=units)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]
    start = {
        "text": f"{path}:{PIECE + 42}: column 'a' holds text where a number",
        "unnamed": f"{path}: column 1 has no name",
        "class": f"{path} has no column 'class'",
        "unit": "a unit for 'z', which is no column; it has a, b, c",
        "rows": f"{path} has no row with a class",
    }
    assert messages[0].startswith(start[fault])
    if fault == "text":
        assert f"\n{path}:4: column 'b' holds text where" in messages[0]
        assert "'soft' (2 among" in messages[0]
        assert "(--ignore a --ignore b ...), or" in messages[0]


@pytest.mark.usefixtures("low_limit")
def test_measurements_are_refused_before_all_rows_are_read(tmp_path: Path) -> None:
    table = rows_of()
    table["kind"] = table["a"]
    path = written(table, tmp_path / "t.csv")
    with pytest.raises(LearningError, match="the target 'kind' is continuous, with"):
        ft.learn(path, target="kind")


@pytest.mark.usefixtures("low_limit")
def test_missing_values_are_refused_where_they_may_not_be(tmp_path: Path) -> None:
    path = written(rows_of(), tmp_path / "t.csv")
    settings = ft.LearningSettings(missing="refuse")
    with pytest.raises(LearningError, match=r"t\.csv: 1 of \d+ rows hold a missing"):
        ft.learn(path, target="kind", settings=settings)


@pytest.mark.usefixtures("low_limit")
def test_progress_has_the_rows_so_far_and_their_speed(tmp_path: Path) -> None:
    path = written(rows_of(), tmp_path / "t.csv")
    steps: list[tuple[str, float]] = []
    ft.learn(path, target="kind", progress=lambda *step: steps.append(step))
    reading = [step for step in steps if step[0].endswith("rows/s")]
    assert reading[-1][0].startswith(f"{path}: {2 * PIECE + 50:,} rows, ")
    assert reading[-1][1] == 1.0


EVERYDAY = (
    "island,bill,seen,wild,species\n"
    + "Biscoe,39.5,2024-01-01,true,Adelie\n" * 9
    + "Dream,NA,2024-01-02,false,Gentoo\n" * 9
    + ",48,2024-01-03T12:00Z,,Gentoo\n" * 3
)


def test_texts_dates_and_missing_cells_are_learnt_from(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(EVERYDAY, "utf-8")
    tree = ft.learn(tmp_path / "t.csv", target="species")
    table = read_table(tmp_path / "t.csv", target="species")
    assert table.categories == {
        "island": ("Biscoe", "Dream"),
        "wild": ("False", "True"),
    }
    assert table.dates == ("seen",)
    assert table.values[2].max() == 19725.5
    for variable in tree.variables:
        if not variable.parts:
            assert variable.missing is not None
    found = ft.run(tree, tmp_path / "t.csv")
    assert found.classes == ["Adelie"] * 9 + ["Gentoo"] * 12


def test_parts_of_texts_give_the_tree_of_the_whole_table(tmp_path: Path) -> None:
    head, *lines = EVERYDAY.splitlines()
    (tmp_path / "t.csv").write_text(EVERYDAY, "utf-8")
    expected = ft.learn(tmp_path / "t.csv", target="species", name="tree")
    merged: Learner | None = None
    for part in (2, 0, 1):
        path = tmp_path / "p.csv"
        path.write_text("\n".join([head, *lines[::-1][part::3]]), "utf-8")
        learner = Learner("species")
        learner.update(path)
        loaded = Learner.from_bytes(learner.to_bytes())
        merged = loaded.merge(merged, repeated=True) if merged else loaded
    assert merged is not None
    assert fingerprint(merged.learn()) == fingerprint(expected)


def test_columns_that_say_nothing_are_left_out_with_a_remark(tmp_path: Path) -> None:
    rows = [f"{k},name {k},,{'xy'[k % 2]}" for k in range(60)]
    text = "\n".join(["size,name,empty,kind", *rows])
    (tmp_path / "t.csv").write_text(text, "utf-8")
    table = read_table(tmp_path / "t.csv", target="kind")
    assert table.columns == ("size",)
    assert table.remarks == (
        (
            "name",
            "60 different texts in 60 rows, as an identifier has; it is left out; "
            "--categorical name keeps it",
        ),
        ("empty", "no value in any row; it is left out"),
    )
    source = ft.table(tmp_path / "t.csv", categorical=["name"])
    assert len(read_table(source, target="kind").categories["name"]) == 60


def test_a_target_that_identifies_the_rows_is_refused(tmp_path: Path) -> None:
    rows = [f"{k % 7},name {k}" for k in range(60)]
    (tmp_path / "t.csv").write_text("\n".join(["size,name", *rows]), "utf-8")
    with pytest.raises(LearningError, match="has another class in each of 60 rows"):
        ft.learn(tmp_path / "t.csv", target="name")


def test_paper_mode_refuses_texts() -> None:
    settings = ft.LearningSettings(mode="paper")
    with pytest.raises(LearningError, match="numbers alone, and not from 'island'"):
        ft.learn(io.StringIO(EVERYDAY), target="species", settings=settings)
