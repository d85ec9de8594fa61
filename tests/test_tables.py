"""Rows come in from anything, and nothing about them is guessed."""

from __future__ import annotations

import io
import math
import os
import random
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import csv

import fuzzytree as ft
from fuzzytree import csv_rows, tables
from fuzzytree.cells import plain
from fuzzytree.errors import TableError
from fuzzytree.table_format import TableFormat
from fuzzytree.tables import (
    Table,
    TableSource,
    batches,
    class_names,
    pieces,
    read_table,
)

GRASPS = "force,slip,grip\n1.5,0,soft\n2.5,1,firm\n3.5,0,firm\n"
COLUMNS = {
    "force": [1.5, 2.5, 3.5],
    "slip": [0, 1, 0],
    "grip": ["soft", "firm", "firm"],
}
STRUCTURED = np.array(
    [(1.5, 0, "soft"), (2.5, 1, "firm"), (3.5, 0, "firm")],
    dtype=[("force", "f8"), ("slip", "i4"), ("grip", "U8")],
)


def _csv(text: str) -> io.BytesIO:
    return io.BytesIO(text.encode())


def _read(text: str, target: str = "grip", ignore: tuple[str, ...] = ()) -> Table:
    return read_table(_csv(text), target=target, ignore=ignore, name="grasps.csv")


def _error(text: str, target: str = "grip") -> str:
    with pytest.raises(TableError) as caught:
        _read(text, target)
    return str(caught.value)


def _values(
    source: object,
    inputs: list[str],
    *,
    columns: list[str] | None = None,
    trained: tuple[str, ...] = (),
) -> list[list[float]]:
    source = TableSource(source, columns=columns)
    found = batches(source, inputs, name="grasps.csv", trained=trained)
    values: list[list[float]] = np.hstack([batch.values for batch in found]).tolist()
    return values


def _batch_error(
    source: object,
    inputs: list[str],
    *,
    columns: list[str] | None = None,
    trained: tuple[str, ...] = (),
) -> str:
    with pytest.raises(TableError) as caught:
        _values(source, inputs, columns=columns, trained=trained)
    return str(caught.value)


@pytest.mark.parametrize(
    "source",
    [
        _csv(GRASPS),
        io.BufferedReader(io.BytesIO(GRASPS.encode())),
        io.StringIO(GRASPS),
        pd.DataFrame(COLUMNS),
        pl.DataFrame(COLUMNS),
        pl.DataFrame(COLUMNS).lazy(),
        pa.table(COLUMNS),
        STRUCTURED,
    ],
    ids=lambda source: type(source).__name__,
)
def test_every_kind_of_table_gives_the_same_rows(source: object) -> None:
    table = read_table(source, target="grip")
    assert table.columns == ("force", "slip")
    assert table.values.tolist() == [[1.5, 2.5, 3.5], [0.0, 1.0, 0.0]]
    assert table.classes == ("firm", "soft")
    assert table.codes.tolist() == [1, 0, 0]


def test_a_parquet_file_and_stream_give_the_rows_of_the_table(tmp_path: Path) -> None:
    path = tmp_path / "grasps.parquet"
    pq.write_table(pa.table(COLUMNS), path)
    for source in (path, str(path), io.BytesIO(path.read_bytes())):
        table = read_table(source, target="grip")
        assert table.values.tolist() == [[1.5, 2.5, 3.5], [0.0, 1.0, 0.0]]


def test_a_parquet_file_without_rows_has_columns(tmp_path: Path) -> None:
    path = tmp_path / "grasps.parquet"
    pq.write_table(pa.table({"force": pa.array([], pa.float64())}), path)
    assert _values(path, ["force"]) == [[]]


def test_a_broken_parquet_file_is_one_sentence(tmp_path: Path) -> None:
    assert _batch_error(io.BytesIO(b"PAR1 and no more"), ["a"]).startswith(
        "grasps.csv: broken Parquet or Arrow file: "
    )


def test_an_array_is_taken_without_a_copy() -> None:
    array = np.array([[1.0, 2.0], [3.0, 4.0]])
    table = read_table(array, target=[0, 1])
    assert np.shares_memory(table.values, array)
    assert table.columns == ("x1", "x2")


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_view_of_an_array_keeps_its_own_order(order: str) -> None:
    array = np.array([[1.0, 2.0], [3.0, 4.0]], order=order)[::-1, ::-1]  # type: ignore[call-overload]
    assert _values(array, ["x2", "x1"]) == [[3.0, 1.0], [4.0, 2.0]]


def test_an_array_can_be_given_names() -> None:
    array = np.array([[1, 2], [3, 4]])
    assert _values(array, ["b"], columns=["a", "b"]) == [[2.0, 4.0]]


def test_an_array_with_too_few_names_is_refused() -> None:
    message = _batch_error(np.zeros((2, 3)), ["a"], columns=["a", "b"])
    assert message == "grasps.csv has 3 columns and 2 names"


def test_an_array_of_one_dimension_is_refused() -> None:
    message = _batch_error(np.zeros(3), ["x1"])
    assert message == "grasps.csv has shape (3,), not (rows, columns)"


def test_an_unnamed_array_as_wide_as_the_training_table_has_its_names() -> None:
    array = np.array([[1.0, 2.0]])
    assert _values(array, ["slip"], trained=("force", "slip")) == [[2.0]]


def test_an_unnamed_array_of_another_width_is_refused() -> None:
    message = _batch_error(np.zeros((2, 3)), ["slip"], trained=("force", "slip"))
    assert message == (
        "grasps.csv has 3 columns without names, and the model was learnt from 2: "
        "force, slip"
    )


def test_what_is_no_table_is_refused() -> None:
    with pytest.raises(TypeError) as caught:
        read_table(3, target="grip")
    assert str(caught.value) == (
        "int is no table: pass a path, a pandas, polars or arrow table, "
        "or a numpy array"
    )


def test_columns_are_found_by_name_in_any_order_and_others_are_counted() -> None:
    [batch] = batches(_csv("c,b,a\n3,2,1\n"), ["a", "c"])
    assert batch.values.tolist() == [[1.0], [3.0]]
    assert batch.extras == 1


def test_all_missing_columns_are_named_at_once() -> None:
    assert _batch_error(_csv("force,slipp\n1,2\n"), ["force", "slip"]) == (
        "grasps.csv has no column 'slip', which the model needs; "
        "it has force, slipp (did you mean 'slipp'?)"
    )
    assert _batch_error(_csv("a\n1\n"), ["force", "a", "slip"]) == (
        "grasps.csv has no columns 'force', 'slip', which the model needs; it has a"
    )


def test_a_file_is_read_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "PIECE", 2)
    found = list(batches(_csv("a\n1\n2\n3\n4\n5\n"), ["a"]))
    assert [batch.values.tolist() for batch in found] == [[[1, 2]], [[3, 4]], [[5]]]


def test_a_file_without_rows_gives_one_empty_piece() -> None:
    assert _values(_csv("a,b\n"), ["b"]) == [[]]


def test_names_may_be_quoted_and_a_byte_order_mark_is_no_name() -> None:
    table = _read('\ufeff"force, N","sl""ip",grip\n1,2,soft\n')
    assert table.columns == ("force, N", 'sl"ip')


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_the_delimiter_is_found_in_the_first_line(mark: str) -> None:
    table = _read(GRASPS.replace(",", mark))
    assert table.columns == ("force", "slip")


def test_a_quoted_delimiter_does_not_count() -> None:
    assert _read('"a;b",grip\n1,soft\n').columns == ("a;b",)


def test_two_possible_delimiters_are_refused_unless_one_is_given() -> None:
    assert _error("a;b,grip\n1,soft\n") == (
        "grasps.csv:1: both ',' and ';' stand between names; say which one is the "
        "delimiter (--delimiter)"
    )
    source = tables.table(_csv("a;b,grip\n1,soft\n"), format=TableFormat(delimiter=","))
    table = read_table(source, target="grip")
    assert table.columns == ("a;b",)


def test_every_column_with_text_is_named_with_its_first_row() -> None:
    rows = "".join(f"{k},{k},soft\n" for k in range(30))
    text = f"force,load type,grip\n{rows}?,1,firm\n?,big,firm\n"
    assert _error(text) == (
        "grasps.csv:32: column 'force' holds text where a number is needed: "
        "'?' (2 among 30 numbers)\n"
        "grasps.csv:33: column 'load type' holds text where a number is needed: "
        "'big' (1 among 31 numbers)\n"
        "  leave columns out with ignore (--ignore force --ignore 'load type'), or "
        "take all their cells as categories with categorical "
        "(--categorical force --categorical 'load type')"
    )


def test_lines_are_counted_as_an_editor_counts_them() -> None:
    rows = 10 * '1,"two\nlines",soft\n'
    text = f"force,note,grip\n{rows}\n\nx,a,soft\n"
    with pytest.raises(TableError, match=r"^grasps\.csv:24: column 'force'"):
        _read(text, ignore=("note",))


def test_text_in_a_table_in_memory_is_named_by_its_row() -> None:
    message = _batch_error(pd.DataFrame({"a": [1.0, "x"]}), ["a"])
    assert message == (
        "grasps.csv, row 2: column 'a' holds text where a number is needed: 'x'"
    )


@pytest.mark.parametrize("cell", ["1_000", "١٢", "0x10", "1e", "1 000", "--1", "True"])
def test_what_only_looks_like_a_number_is_text(cell: str) -> None:
    assert f"'{cell}'" in _batch_error(_csv(f"a,b\n{cell},1\n"), ["a"])


@pytest.mark.parametrize("cell", ["", "NA", "nan", "NaN", "N/A", "null", "None", "  "])
def test_missing_cells_become_nan_and_are_counted(cell: str) -> None:
    [batch] = batches(_csv(f"a,b\n{cell},1\n2,3\n"), ["a", "b"])
    assert math.isnan(batch.values[0, 0])
    assert batch.missing == 1


def test_a_cell_means_the_same_whatever_stands_beside_it() -> None:
    for cell in ("-nan", "+NaN", " 1.5", "1.", ".5", "+1e-3", "-Infinity", "1E5"):
        [alone] = _values(_csv(f"a,b\n{cell},1\n"), ["a"])
        [beside] = _values(_csv(f"a,b\n{cell},1\n,2\n"), ["a"])
        assert repr(alone[0]) == repr(beside[0])


def test_bytes_at_random_give_a_table_or_one_sentence() -> None:
    chance = random.Random(0)
    alphabet = [b"a", b"1", b".", b",", b";", b'"', b"\n", b"\r", b"\0", b"\xe9", b" "]
    found = [
        _outcome(start + b"".join(chance.choices(alphabet, k=chance.randint(0, 20))))
        for _ in range(300)
        for start in (b"", b"a,grip\n1,x\n")
    ]
    assert {text.split(":")[0].split(" ")[0] for text in found} == {"t.csv", "rows"}
    assert found.count("rows") > 15


def _outcome(content: bytes) -> str:
    try:
        read_table(io.BytesIO(content), target="grip", name="t.csv")
    except TableError as error:
        return str(error)
    return "rows"


def test_missing_values_of_tables_in_memory_are_nan() -> None:
    for frame in (
        pd.DataFrame({"a": pd.array([1, None], dtype="Int64")}),
        pd.DataFrame({"a": pd.array([True, None], dtype="boolean")}),
        pl.DataFrame({"a": [1, None]}),
        pl.DataFrame({"a": [True, None]}),
    ):
        [batch] = batches(frame, ["a"])
        assert batch.values[0, 0] == 1.0
        assert batch.missing == 1


def test_infinity_is_read_as_it_is_and_counted_as_missing() -> None:
    text = "a\ninf\n-inf\nInfinity\n"
    assert _values(_csv(text), ["a"]) == [[math.inf, -math.inf, math.inf]]
    [batch] = batches(_csv(text), ["a"])
    assert batch.missing == 3
    assert read_table(_csv(text + "1\n"), target=[*"xyxy"]).missing == 3


def test_numbers_are_read_to_the_last_digit() -> None:
    numbers = [0.1, 1e-308, 5e-324, 1.7976931348623157e308, 2 / 3]
    text = _csv("a\n" + "\n".join(map(repr, numbers)))
    assert _values(text, ["a"]) == [numbers]


def test_truth_values_become_zero_and_one() -> None:
    frame = pl.DataFrame({"a": [True, False], "grip": ["x", "y"]})
    assert read_table(frame, target="grip").values.tolist() == [[1.0, 0.0]]


def test_classes_that_look_like_words_or_numbers_stay_the_text_they_are() -> None:
    names = ["01", "1", "1.0", "no", "off", "null", "NA", "1e-05", "~", " x", "12:30"]
    table = _read("a,grip\n" + "".join(f"{k},{n}\n" for k, n in enumerate(names)))
    assert sorted(table.classes) == sorted(names)


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        ([1, 2, 10], ["1", "2", "10"]),
        ([1.0, 2.0, math.nan], ["1", "2", None]),
        ([1.5, 2.0], ["1.5", "2.0"]),
        ([True, False], ["True", "False"]),
        (["a", None, ""], ["a", None, None]),
        (pd.Series(["x", None], dtype="category").tolist(), ["x", None]),
        (np.array([3, 1], np.int8), ["3", "1"]),
        (np.array(["b", "a"]), ["b", "a"]),
        ([math.inf, 1.0], ["inf", "1"]),
    ],
)
def test_classes_of_every_type_become_text(
    labels: list[object], expected: list[str | None]
) -> None:
    assert class_names([labels]) == expected


def test_categories_with_gaps_are_missing_classes() -> None:
    column = pa.array(["x", None]).dictionary_encode()
    table = read_table(pa.table({"a": [1, 2], "grip": column}), target="grip")
    assert table.classes == ("x",)
    assert table.unlabelled == 1


def test_whole_numbers_are_classes_in_the_order_of_size() -> None:
    table = _read("a,grip\n1,10\n2,9\n3,x\n4,-1\n")
    assert table.classes == ("-1", "9", "10", "x")


def test_rows_without_a_class_are_left_out_and_counted() -> None:
    table = _read("a,grip\n1,\n2,soft\nNA,soft\n")
    assert table.unlabelled == 1
    assert table.missing == 1
    assert table.codes.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "grasps.csv is empty: it needs a line with column names"),
        ("a,grip\n", "grasps.csv has no rows"),
        ("a,grip\n1,\n", "grasps.csv has no row with a class"),
        ("grip\nsoft\n", "grasps.csv has no column to learn from"),
        (
            "a,,grip\n1,2,x\n",
            "grasps.csv: column 2 has no name\n"
            "  name it, or leave it out with ignore (--ignore 'column 2')",
        ),
        (
            "a,b,a,grip\n1,2,3,x\n",
            "grasps.csv: column 'a' stands there more than once",
        ),
        (
            "a,b\n1,2\n",
            "grasps.csv has no column 'grip'; it has a, b",
        ),
        (
            "a,grip\n1,x\n1,2,3\n",
            "grasps.csv:3: 3 cells, and line 1 names 2 columns",
        ),
        (
            'a,grip\n1,"x\n',
            "grasps.csv:2: broken CSV: a quote is not closed",
        ),
    ],
)
def test_a_table_that_does_not_fit_is_one_sentence(text: str, message: str) -> None:
    assert _error(text) == message


def test_a_file_that_is_not_utf8_is_one_sentence() -> None:
    with pytest.raises(TableError) as caught:
        read_table(io.BytesIO(b"a,grip\n1,\xe9\n"), target="grip", name="grasps.csv")
    assert str(caught.value) == (
        "grasps.csv: is no UTF-8 text; save it as UTF-8, or pass its encoding, "
        "such as --encoding cp1252"
    )


def test_repeated_columns_of_tables_in_memory_are_refused() -> None:
    frame = pd.DataFrame([[1, 2]], columns=["a", "a"])
    message = _batch_error(frame, ["a"])
    assert message == "grasps.csv: column 'a' stands there more than once"


def test_an_absent_file_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "absent.csv"
    with pytest.raises(TableError) as caught:
        read_table(path, target="grip")
    message = f"{path}: cannot be read: no such file or directory"
    assert str(caught.value) == message


def test_classes_beside_the_table_must_be_as_many_as_its_rows() -> None:
    with pytest.raises(TableError) as caught:
        read_table(np.zeros((3, 1)), target=[1, 2])
    message = "the array has 3 rows, and there are 2 classes for them"
    assert str(caught.value) == message


def test_texts_of_numpy_become_names_of_classes() -> None:
    names = class_names([[np.str_("soft"), np.str_(" "), "firm"]])
    assert [type(name) for name in names] == [str, type(None), str]
    assert names == ["soft", None, "firm"]


@pytest.mark.parametrize("kind", [np.asarray, pd.DataFrame, pl.DataFrame])
def test_a_target_has_one_class_for_each_row(kind: Callable[[object], object]) -> None:
    with pytest.raises(TableError) as caught:
        read_table(np.zeros((2, 1)), target=kind([[1, 2], [3, 4]]))  # type: ignore[arg-type]  # what is refused
    assert str(caught.value) == (
        "the target has the shape (2, 2), and it needs one class for each row: "
        "pass the name of a column, or an array of shape (rows,)"
    )


def test_an_ignored_column_must_be_there() -> None:
    with pytest.raises(TableError) as caught:
        _read(GRASPS, ignore=("colour",))
    message = "grasps.csv has no column 'colour'; it has force, slip, grip"
    assert str(caught.value) == message


def test_a_stream_stays_open() -> None:
    stream = io.BufferedReader(io.BytesIO(GRASPS.encode()))
    read_table(stream, target="grip")
    assert not stream.closed


def _three_columns(kind: str, folder: Path) -> object:
    frame = pd.DataFrame({"note": ["a", "b"], "slip": [1.0, 2.0], "force": [3, 4]})
    if kind == "lazy":
        return pl.from_pandas(frame).lazy()
    if kind == "pandas":
        return frame
    path = folder / f"rows.{kind}"
    if kind == "csv":
        frame.to_csv(path, index=False)
    else:
        frame.to_parquet(path, index=False)
    return path


@pytest.mark.parametrize("kind", ["csv", "parquet", "pandas", "lazy"])
def test_only_the_needed_columns_are_read(kind: str, tmp_path: Path) -> None:
    source = _three_columns(kind, tmp_path)
    (batch,) = batches(source, ["force"])
    assert batch.values.tolist() == [[3.0, 4.0]]
    assert batch.piece.columns == ("note", "slip", "force")
    assert batch.extras == 2
    assert [len(cells) for cells in batch.piece.cells] == [0, 0, 2]


@pytest.mark.parametrize("kind", ["csv", "parquet", "pandas", "lazy"])
def test_all_columns_are_read_where_they_are_wanted(kind: str, tmp_path: Path) -> None:
    source = _three_columns(kind, tmp_path)
    (batch,) = batches(source, ["force"], with_others=True)
    assert [plain(cells) for cells in batch.piece.cells[:1]] == [["a", "b"]]
    assert [len(cells) for cells in batch.piece.cells] == [2, 2, 2]


@pytest.mark.parametrize("kind", ["csv", "parquet", "pandas", "lazy"])
def test_a_model_that_needs_no_column_answers_every_row(
    kind: str, tmp_path: Path
) -> None:
    (batch,) = batches(_three_columns(kind, tmp_path), [])
    assert batch.values.shape == (0, 2)
    assert batch.extras == 3


@pytest.mark.parametrize("mark", [";;", '"', "\n", "\\t"])
def test_a_delimiter_that_is_none_is_refused(mark: str) -> None:
    form = TableFormat(delimiter=mark)
    source = tables.table(io.StringIO("a;b\n1;x\n"), format=form)
    with pytest.raises(TableError) as caught:
        read_table(source, target="b")
    assert str(caught.value) == (
        f"the table: a delimiter is one character such as ';', and not {mark!r}"
    )


class _Name(str):
    """A name that counts how often it is compared."""

    __hash__ = str.__hash__
    compared = 0

    def __eq__(self, other: object) -> bool:
        _Name.compared += 1
        return str.__eq__(self, other)


def test_the_names_of_many_columns_are_looked_up_and_not_searched() -> None:
    names: list[str] = [_Name(f"c{k}") for k in range(1_000)]
    array = np.ones((2, 1_000))
    read_table(TableSource(array, columns=names), target=["soft", "firm"])
    assert len(_values(array, ["c999", "c3"], columns=names)) == 2
    assert _Name.compared < 10 * len(names)


def test_of_many_columns_with_text_the_first_are_named() -> None:
    names = ",".join(f"c{k}" for k in range(30))
    numbers = 10 * f"{','.join('1' * 30)},soft\n"
    message = _error(f"{names},grip\n{numbers}{','.join('x' * 30)},soft\n")
    lines = message.split("\n")
    assert lines[19:21] == [
        "grasps.csv:12: column 'c19' holds text where a number is needed: 'x' "
        "(1 among 10 numbers)",
        "and 10 columns more hold text",
    ]
    assert "(--ignore c0 --ignore c1 ...)" in lines[21]


def test_masked_cells_are_missing() -> None:
    mask = [[False, True], [False, False]]
    whole = np.ma.MaskedArray([[1, 2], [3, 4]], mask)
    for array in (whole, whole.astype(np.float32), whole.astype(object)):
        assert str(_values(array, ["x1", "x2"])) == "[[1.0, 3.0], [nan, 4.0]]"
    fields = np.ma.MaskedArray(
        [(1.0, "soft"), (2.0, "firm")],
        mask=[(True, False), (False, True)],
        dtype=[("a", "f8"), ("grip", "U4")],
    )
    assert str(_values(fields, ["a"])) == "[[nan, 2.0]]"
    table = read_table(fields, target="grip")
    assert (table.classes, table.unlabelled, table.missing) == (("soft",), 1, 1)
    with_mask = np.ma.MaskedArray(["soft", "firm"], [False, True])
    assert class_names([with_mask]) == ["soft", None]


def test_chunks_with_nulls_are_missing_cells() -> None:
    column = pa.chunked_array([[1, None], [3]], pa.int32())
    assert str(_values(pa.table({"a": column}), ["a"])) == "[[1.0, nan, 3.0]]"
    frame = pd.DataFrame({"a": pd.array([1.5, None], dtype="double[pyarrow]")})
    assert str(_values(frame, ["a"])) == "[[1.5, nan]]"


_ZIPS = [k % 40 for k in range(160)]


@pytest.mark.parametrize(
    "column",
    [
        pd.Categorical(_ZIPS),
        pd.Categorical(_ZIPS, ordered=True),
        pd.array([*map(str, _ZIPS)], "string"),
        pl.Series([*map(str, _ZIPS)], dtype=pl.Categorical),
        pl.Series([*map(str, _ZIPS)], dtype=pl.Enum([*map(str, range(40))])),
        pl.Series([*map(str, _ZIPS)]),
        pa.array(_ZIPS).dictionary_encode(),
        pa.array([*map(str, _ZIPS)], pa.large_string()),
    ],
    ids=lambda column: str(getattr(column, "dtype", getattr(column, "type", "")))[:30],
)
def test_a_column_of_texts_or_categories_stays_one_whatever_it_looks_like(
    column: Any,
) -> None:
    make = {"pandas": pd.DataFrame, "polars": pl.DataFrame}.get(
        type(column).__module__.split(".")[0], pa.table
    )
    tree = ft.learn(make({"z": column}), target=[k % 2 for k in _ZIPS])
    assert tree.variables[0].categories == tuple(map(str, range(40)))
    is_ordered = getattr(getattr(column, "dtype", None), "ordered", False)
    assert len(tree.leaves) == (40 if is_ordered else 2)


def test_digits_of_an_identifier_are_refused_with_what_makes_them_numbers() -> None:
    frame = pl.DataFrame({"z": [*map(str, range(40))]})
    with pytest.raises(TableError) as caught:
        read_table(frame, target=_ZIPS[:40])
    assert str(caught.value) == (
        "the table has no column to learn from\n"
        "  z: 40 different texts in 40 rows, as an identifier has; it is left out; "
        "--categorical z keeps it, or convert it to numbers"
    )


def test_objects_of_pandas_are_what_their_cells_look_like() -> None:
    cells = pd.Series([*map(str, _ZIPS)], dtype=object)
    table = read_table(pd.DataFrame({"z": cells}), target=_ZIPS)
    assert (table.categories, table.values.tolist()) == ({}, [_ZIPS])


def test_nullable_numbers_and_truth_values_keep_their_kind() -> None:
    frame = pd.DataFrame(
        {
            "a": pd.array([1, None, 3], "Int64"),
            "b": pd.array([True, None, False], "boolean"),
        }
    )
    table = read_table(frame, target=[*"xyx"])
    assert str(table.values.tolist()) == "[[1.0, nan, 3.0], [1.0, nan, 0.0]]"
    assert (table.categories, table.missing) == ({"b": ("False", "True")}, 2)


@pytest.mark.parametrize(
    "dtype", ["datetime64[ns]", "timedelta64[s]", "complex128", "S4"]
)
def test_times_complex_numbers_and_bytes_are_no_numbers(dtype: str) -> None:
    array = np.zeros((2, 1), dtype)
    for source in (array, np.ma.MaskedArray(array, [[True], [False]])):
        message = _batch_error(source, ["x1"])
        text = f"grasps.csv: column 'x1' holds {array.dtype}, and no numbers"
        assert message == text
    fields = np.zeros(2, [("when", dtype), ("a", "f8")])
    assert _values(fields, ["a"]) == [[0.0, 0.0]]
    assert "column 'when' holds" in _batch_error(fields, ["when"])


def test_objects_are_numbers_by_their_own_type() -> None:
    numbers = np.array([[np.float32(0.5)], [np.int8(3)], [True]], object)
    assert _values(numbers, ["x1"]) == [[0.5, 3.0, 1.0]]
    for cell in (np.timedelta64(1, "s"), np.datetime64("2020-01-01"), 1j, b"1"):
        message = _batch_error(np.array([[cell]], object), ["x1"])
        assert "column 'x1' holds text where a number is needed" in message


def test_times_are_classes_by_their_text() -> None:
    days = np.array(["2020-01-01", "NaT"], "datetime64[ns]")
    assert class_names([days]) == ["2020-01-01T00:00:00.000000000", None]


def test_a_text_is_one_name_and_no_letters() -> None:
    table = read_table(_csv("a,bc,grip\n1,2,x\n"), target="grip", ignore="bc")
    assert table.columns == ("a",)
    named = read_table(TableSource(np.zeros((2, 1)), columns="force"), target=[0, 1])
    assert named.columns == ("force",)


@pytest.mark.parametrize("first", [0, 1])
def test_a_column_without_a_name_that_counts_the_rows_is_left_out(first: int) -> None:
    table = _read(f",a,grip\n{first},5,x\n{first + 1},6,y\n")
    assert table.columns == ("a",)
    assert table.values.tolist() == [[5.0, 6.0]]
    assert table.remarks == (
        ("column 1", "no name and counts the rows, or is empty; it is left out"),
    )
    assert _read("a,grip,\n1,x,\n2,y,\n").columns == ("a",)


def test_a_column_without_a_name_can_be_ignored() -> None:
    table = _read(",a,grip\n7,5,x\n7,6,y\n", ignore=("column 1",))
    assert (table.columns, table.remarks) == (("a",), ())


def test_blanks_around_names_are_left_out_with_a_remark(tmp_path: Path) -> None:
    path = tmp_path / "blanks.parquet"
    pq.write_table(pa.table({" a": [1.0], "grip ": ["x"]}), path)
    frame = pd.DataFrame({" a": [1.0], "grip ": ["x"]})
    for source in (_csv(" a,grip \n1,x\n"), path, frame, pl.from_pandas(frame).lazy()):
        table = read_table(source, target="grip")
        assert table.columns == ("a",)
        assert table.remarks == (
            ("' a'", "blanks around its name, which are left out (and 1 more)"),
        )
    for source in (_csv(" a,b\n1,x\n"), path, frame, pl.from_pandas(frame).lazy()):
        assert _values(source, ["a "]) == [[1.0]]


def test_names_that_differ_by_blanks_alone_are_refused() -> None:
    assert _error("a, a,grip\n1,2,x\n") == (
        "grasps.csv: column 'a' stands there more than once"
    )


@pytest.mark.parametrize(
    ("content", "what"),
    [(b"", "is empty"), (b"a,b\n1,2\n", "is no Parquet file: it must begin with PAR1")],
)
def test_a_file_named_parquet_is_no_csv(
    tmp_path: Path, content: bytes, what: str
) -> None:
    path = tmp_path / "rows.parquet"
    path.write_bytes(content)
    with pytest.raises(TableError) as caught:
        list(batches(path, ["a"]))
    assert str(caught.value) == f"{path} {what}"


def test_an_arrow_file_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "rows.arrow"
    with pa.ipc.new_file(path, pa.table(COLUMNS).schema) as file:
        file.write_table(pa.table(COLUMNS), max_chunksize=2)
    assert _values(path, ["slip"]) == [[0.0, 1.0, 0.0]]


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no such device")
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_device_is_no_table(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"endless.{suffix}"
    path.symlink_to("/dev/zero")
    with pytest.raises(TableError) as caught:
        read_table(path, target="grip")
    text = f"{path}: cannot be read: it is neither a file nor a pipe"
    assert str(caught.value) == text


def test_a_pipe_is_read_like_its_file(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_bytes, args=(GRASPS.encode(),))
    writer.start()
    assert read_table(path, target="grip").values.shape == (2, 3)
    writer.join()


@pytest.mark.parametrize("suffix", ["csv", "parquet", "arrow"])
def test_the_share_that_is_read_grows_up_to_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    for module in (csv_rows, tables):
        monkeypatch.setattr(module, "BLOCK", 1 << 17)
    data = pa.table({"x": np.arange(120_000.0), "y": np.arange(120_000.0) / 7})
    path = tmp_path / f"t.{suffix}"
    if suffix == "csv":
        csv.write_csv(data, path)
    elif suffix == "parquet":
        pq.write_table(data, path, row_group_size=20_000)
    else:
        with pa.ipc.new_file(str(path), data.schema) as file:
            file.write_table(data, max_chunksize=20_000)
    shares = [piece.share for piece in pieces(path)]
    assert shares == sorted(shares)
    assert len({*shares}) > 3
    assert 0.0 < shares[0] < 0.9 < shares[-1] <= 1.0


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a table in three files of three formats."""
    (tmp_path / "t" / "more").mkdir(parents=True)
    (tmp_path / "t" / "a.csv").write_text("x,y,kind\n1,2,soft\n3,4,firm\n", "utf-8")
    (tmp_path / "t" / ".hidden.csv").write_text("nothing", "utf-8")
    (tmp_path / "t" / "notes.txt").write_text("nothing", "utf-8")
    part = {"kind": ["firm"], "y": [6.0], "x": [5.0]}
    pq.write_table(pa.table(part), tmp_path / "t" / "b.parquet")
    part = {"y": [8.0], "x": [7.0], "kind": ["soft"]}
    with pa.ipc.new_file(
        str(tmp_path / "t" / "more" / "c.arrow"), pa.table(part).schema
    ) as w:
        w.write_table(pa.table(part))
    return tmp_path / "t"


def test_the_files_of_a_folder_are_one_table(folder: Path) -> None:
    table = read_table(folder, target="kind")
    assert table.name == str(folder)
    assert table.columns == ("x", "y")
    assert table.values.tolist() == [[1.0, 3.0, 5.0, 7.0], [2.0, 4.0, 6.0, 8.0]]
    assert table.codes.tolist() == [1, 0, 0, 1]
    assert len(read_table(f"{folder}/*.csv", target="kind").codes) == 2
    assert len(read_table(f"{folder}/**/*.[ac]*", target="kind").codes) == 3
    assert len(read_table(f"file://{folder}/a.csv", target="kind").codes) == 2


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ("t/*.pq", "{}/t/*.pq: no file has such a name"),
        (
            "empty",
            "{}/empty: the folder has no table (.csv, .csv.gz, .csv.zst, ",
        ),
        ("other", "{0}/other/b.csv has no column 'y', which {0}/other/a.csv has"),
        ("wider", "{0}/wider/a.csv has no column 'z', which {0}/wider/b.csv has"),
        ("text", "{0}/text/b.csv:2: column 'x' holds text where a number is needed"),
        ("x" * 5000, "cannot be read: file name too long"),
    ],
)
def test_a_fault_in_one_of_many_files_is_one_sentence_with_its_name(
    place: str, message: str, tmp_path: Path
) -> None:
    for name, second in (("other", "x,w"), ("wider", "x,y,z"), ("text", "x,y")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.csv").write_text("x,y\n" + 10 * "1,2\n", "utf-8")
        row = ",".join("q" for _ in second.split(","))
        (tmp_path / name / "b.csv").write_text(f"{second}\n{row}\n", "utf-8")
    (tmp_path / "empty").mkdir()
    with pytest.raises(TableError) as caught:
        read_table(f"{tmp_path}/{place}", target="y" if place == "text" else "x")
    assert message.format(tmp_path) in str(caught.value)


def test_a_file_whose_name_looks_like_a_pattern_is_read(tmp_path: Path) -> None:
    (tmp_path / "a[1].csv").write_text("x,kind\n1,soft\n2,firm\n", "utf-8")
    assert len(read_table(tmp_path / "a[1].csv", target="kind").codes) == 2
