"""A table is read as it is written, or refused with the option that reads it."""

from __future__ import annotations

import codecs
import gzip
import io
import sys
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import fuzzytree as ft
from fuzzytree.errors import MissingExtraError, TableError, install_hint
from fuzzytree.table_format import TableFormat, number_hint
from fuzzytree.tables import Table, batches, pieces, read_table

PLAIN = "hue,price,grip\n0.48,1065.5,soft\n-2.5,12000,firm\n"
OWN_CATEGORIES = (
    "\n  leave columns out with ignore (--ignore hue), or take all their cells as "
    "categories with categorical (--categorical hue)"
)


def _read(content: bytes | str, form: TableFormat | None = None) -> Table:
    source = io.BytesIO(content.encode() if isinstance(content, str) else content)
    return read_table(ft.table(source, format=form), target="grip", name="t.csv")


def _error(content: bytes | str, form: TableFormat | None = None) -> str:
    with pytest.raises((TableError, MissingExtraError)) as caught:
        _read(content, form)
    return str(caught.value)


def _workbook(*sheets: list[list[object]]) -> bytes:
    """Return a file of Excel with sheets named s1, s2, ..."""
    kinds = "http://schemas.openxmlformats.org"
    main = f"{kinds}/spreadsheetml/2006/main"
    links = f"{kinds}/package/2006/relationships"
    office = f"{kinds}/officeDocument/2006/relationships"
    numbers = range(1, len(sheets) + 1)
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        file.writestr(
            "_rels/.rels",
            f'<Relationships xmlns="{links}"><Relationship Id="r1" Target='
            f'"xl/workbook.xml" Type="{office}/officeDocument"/></Relationships>',
        )
        names = "".join(
            f'<sheet name="s{k}" sheetId="{k}" r:id="r{k}"/>' for k in numbers
        )
        file.writestr(
            "xl/workbook.xml",
            f'<workbook xmlns="{main}" xmlns:r="{office}">'
            f"<sheets>{names}</sheets></workbook>",
        )
        parts = "".join(
            f'<Relationship Id="r{k}" Type="{office}/worksheet" '
            f'Target="worksheets/sheet{k}.xml"/>'
            for k in numbers
        )
        file.writestr(
            "xl/_rels/workbook.xml.rels",
            f'<Relationships xmlns="{links}">{parts}</Relationships>',
        )
        for number, rows in zip(numbers, sheets, strict=True):
            lines = ""
            for row in rows:
                cells = (
                    f'<c t="inlineStr"><is><t>{cell}</t></is></c>'
                    if isinstance(cell, str)
                    else f"<c><v>{cell}</v></c>"
                    for cell in row
                )
                lines += f"<row>{''.join(cells)}</row>"
            file.writestr(
                f"xl/worksheets/sheet{number}.xml",
                f'<worksheet xmlns="{main}"><sheetData>{lines}</sheetData></worksheet>',
            )
    return content.getvalue()


@pytest.mark.parametrize(
    ("text", "form"),
    [
        (
            "hue;price;grip\r\n0,48;1065,5;soft\r\n-2,5;12000;firm\r\n",
            TableFormat(decimal=","),
        ),
        (
            "hue;price;grip\n0,48;1.065,5;soft\n-2,5;12.000;firm\n",
            TableFormat(decimal=",", thousands="."),
        ),
        (
            'hue,price,grip\n0.48,"1,065.5",soft\n-2.5,"12,000",firm\n',
            TableFormat(thousands=","),
        ),
        (
            "hue\tprice\tgrip\n 0,48\t1\u202f065,5\tsoft\n-2,5\t12\u00a0000\tfirm\n",
            TableFormat(decimal=",", thousands=" "),
        ),
        (
            "hue,price,grip\n48%,1065.5,soft\n-250 %,12000,firm\n",
            TableFormat(percent=True),
        ),
    ],
)
def test_a_table_is_read_as_it_is_written(text: str, form: TableFormat) -> None:
    plain, table = _read(PLAIN), _read(text, form)
    assert table.columns == plain.columns
    assert table.values.tolist() == plain.values.tolist()
    assert table.classes == plain.classes
    source = ft.table(io.BytesIO(text.encode()), format=form)
    values = [batch.values for batch in batches(source, plain.columns)]
    assert np.hstack(values).tolist() == plain.values.tolist()


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("hue;grip\n0,48;soft\n1;firm\n", "'0,48'; pass --decimal ,"),
        (
            "hue;grip\n1.065,0;soft\n2,5;firm\n",
            "'1.065,0'; pass --decimal , --thousands .",
        ),
        (
            'hue,grip\n"1,065",soft\n950,firm\n',
            "'1,065'; pass --thousands , or --decimal ,",
        ),
        ("hue,grip\n104%,soft\n95 %,firm\n", "'104%'; pass --percent"),
        (
            "hue;grip\n1 065 000,5%;soft\n1,5%;firm\n",
            "'1 065 000,5%'; pass --decimal , --thousands ' ' --percent",
        ),
        ("hue,grip\n1'065,soft\n95,firm\n", """"1'065"; pass --thousands ''"'"''"""),
    ],
)
def test_numbers_written_otherwise_are_no_categories(text: str, hint: str) -> None:
    message = f"t.csv:2: column 'hue' holds numbers such as {hint}{OWN_CATEGORIES}"
    assert _error(text) == message
    source = ft.table(io.BytesIO(text.encode()), categorical=["hue"])
    assert len(read_table(source, target="grip").categories["hue"]) == 2
    frame = pd.read_csv(io.StringIO(text), sep=None, engine="python", dtype=str)
    with pytest.raises(TableError) as caught:
        read_table(frame, target="grip", name="t.csv")
    assert hint in str(caught.value)


def test_a_column_of_very_many_numbers_with_a_comma_is_no_identifier() -> None:
    rows = "".join(f"{k},5;{'ab'[k % 2]}\n" for k in range(10_010))
    assert "'0,5'; pass --decimal ," in _error(f"hue;grip\n{rows}")


def test_texts_beside_numbers_are_no_numbers_written_otherwise() -> None:
    assert number_hint(["1,5", "about 2"]) == ""
    assert _read("size,grip\n3+,soft\n2,firm\n").categories == {"size": ("2", "3+")}


def test_a_point_where_decimals_stand_behind_a_comma_is_refused() -> None:
    text = "hue;grip\n0,48;soft\n1.065;firm\n"
    message = (
        "t.csv:3: column 'hue' holds '1.065', and decimals stand behind a comma; pass "
        "--thousands . if the point groups digits, or --categorical hue if it is a text"
    )
    form = TableFormat(decimal=",")
    assert _error(text, form) == message
    source = ft.table(io.BytesIO(text.encode()), format=form, categorical=["hue"])
    assert read_table(source, target="grip").categories["hue"] == ("0.48", "1.065")
    source = ft.table(io.BytesIO(text.encode()), format=form)
    with pytest.raises(TableError) as caught:
        list(batches(source, ["hue"], name="t.csv"))
    assert str(caught.value) == message


def test_a_row_to_predict_names_the_option_that_reads_it() -> None:
    with pytest.raises(TableError) as caught:
        list(batches(io.BytesIO(b"hue;b\n0,48;1\n"), ["hue"], name="t.csv"))
    assert str(caught.value) == (
        "t.csv:2: column 'hue' holds numbers such as '0,48'; pass --decimal ,"
    )


def test_texts_of_a_frame_are_read_as_they_are_written() -> None:
    frame = pd.DataFrame({"hue": ["0,48", None, 3], "grip": ["a", "b", "b"]})
    table = read_table(ft.table(frame, format=TableFormat(decimal=",")), target="grip")
    np.testing.assert_array_equal(table.values, [[0.48, np.nan, 3.0]])
    frame["day"] = pd.Timestamp("2024-01-31")
    source = ft.table(frame, format=TableFormat(decimal=","))
    assert read_table(source, target="grip").dates == ("day",)
    texts = pl.DataFrame({"hue": ["0,48", None, "3"], "grip": ["a", "b", "b"]})
    table = read_table(ft.table(texts, format=TableFormat(decimal=",")), target="grip")
    np.testing.assert_array_equal(table.values, [[0.48, np.nan, 3.0]])


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"decimal": ";"}, "decimal ';': must be '.' or ','"),
        ({"thousands": "x"}, "thousands 'x': must be ',' or \"'\" or ' '"),
        ({"decimal": ",", "thousands": ","}, None),
    ],
)
def test_what_no_number_has_is_refused(
    written: dict[str, str], message: str | None
) -> None:
    with pytest.raises(ValueError, match="must be") as caught:
        TableFormat(**written)  # type: ignore[arg-type]  # both of them are texts
    assert message is None or str(caught.value) == message


@pytest.mark.parametrize(
    "content",
    [
        PLAIN.encode("utf-16"),
        codecs.BOM_UTF16_BE + PLAIN.encode("utf-16-be"),
        PLAIN.encode("utf-32"),
        PLAIN.encode("utf-8-sig"),
        gzip.compress(PLAIN.encode(), mtime=0),
        gzip.compress(PLAIN.encode("utf-16"), mtime=0),
        pa.compress(PLAIN.encode(), "zstd", asbytes=True),
        PLAIN.replace("\n", "\r\n").encode(),
    ],
)
def test_what_the_first_bytes_say_is_read(content: bytes, tmp_path: Path) -> None:
    plain = _read(PLAIN)
    assert _read(content).values.tolist() == plain.values.tolist()
    path = tmp_path / "t.csv.gz"
    path.write_bytes(content)
    assert read_table(str(path), target="grip").values.tolist() == plain.values.tolist()


def test_an_encoding_is_read_and_an_unknown_one_refused() -> None:
    content = "größe,grip\n1,a\n2,b\n".encode("cp1252")
    assert _read(content, TableFormat(encoding="cp1252")).columns == ("größe",)
    for name in ("nonsense", "rot13"):
        message = f"t.csv: there is no encoding {name!r}"
        assert _error(content, TableFormat(encoding=name)) == message
    assert _error(content, TableFormat(encoding="ascii")) == (
        "t.csv: is no ASCII text; save it as UTF-8, or pass its encoding, such as "
        "--encoding cp1252"
    )
    assert "no UTF-16-LE text" in _error(PLAIN.encode("utf-16")[:-1])


def test_broken_compression_is_one_sentence() -> None:
    assert _error(gzip.compress(PLAIN.encode())[:30]) == (
        "t.csv: broken gzip file: truncated compressed stream"
    )
    assert _error(gzip.compress(gzip.compress(PLAIN.encode()))) == (
        "t.csv: is compressed twice; decompress it first"
    )


def test_a_large_compressed_file_is_read_in_pieces(tmp_path: Path) -> None:
    path = tmp_path / "t.csv.gz"
    path.write_bytes(gzip.compress(b"a\n" + b"1.5\n" * 600_000))
    counts = [piece.rows for piece in pieces(str(path), only=frozenset({"a"}))]
    assert sum(counts) == 600_000
    assert max(counts) < 600_000


def test_a_url_is_refused() -> None:
    with pytest.raises(TableError) as caught:
        read_table("https://example.org/t.csv", target="grip")
    assert str(caught.value) == (
        "https://example.org/t.csv: a URL is not read; download the table first"
    )


def test_a_first_row_of_data_is_recognized() -> None:
    hint = (
        "\n  its first row looks like data; pass --no-header to name the columns "
        "'column 1', 'column 2', ..."
    )
    assert _error("14.23,1.71,a\n13.2,1.78,b\n") == (
        f"t.csv has no column 'grip'; it has 14.23, 1.71, a{hint}"
    )
    assert _error("1,1,a\n2,3,b\n") == (
        f"t.csv: column '1' stands there more than once{hint}"
    )


def test_columns_without_names_are_numbered() -> None:
    form = TableFormat(header=False)
    source = ft.table(io.BytesIO(b"1,a\n2,b\n"), format=form)
    table = read_table(source, target="column 2")
    assert (table.columns, table.rows) == (("column 1",), 2)
    source = ft.table(io.BytesIO(b"1\n2\n"), format=form)
    [batch] = batches(source, ["force"], trained=["force"])
    assert batch.values.tolist() == [[1.0, 2.0]]


def test_a_sheet_of_excel_is_read() -> None:
    rows: list[list[object]] = [["hue", "grip"], [0.5, "a"], ["", ""], [2, "b"]]
    for form in (TableFormat(), TableFormat(decimal=",")):
        table = _read(_workbook(rows), form)
        assert (table.columns, table.values.tolist()) == (("hue",), [[0.5, 2.0]])
    assert _read(_workbook([["x"], ["y"]], rows), TableFormat(sheet="s2")).rows == 2
    assert _read(_workbook([], rows)).columns == ("hue",)
    for form in (TableFormat(), TableFormat(sheet="x")):
        assert _error(_workbook(rows, rows), form) == (
            "t.csv has the sheets 's1', 's2'; pass --sheet and one of them"
        )
    assert _error(_workbook([])) == "t.csv is empty: it needs a line with column names"
    wrong: list[list[object]] = [*rows[:1], [0.5, "a"], *[[1.5, "b"]] * 20, ["x", "b"]]
    assert _error(_workbook(wrong)).startswith(
        "t.csv:23: column 'hue' holds text where a number is needed: 'x'"
    )


def test_few_texts_beside_numbers_are_not_taken_for_numbers() -> None:
    rows = "1.5;a\n" * 30
    assert _error(f"hue;grip\n{rows}1,5;b\n").startswith(
        "t.csv:32: column 'hue' holds text where a number is needed: '1,5' (1 among 30"
    )


def test_a_zip_file_is_no_table() -> None:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        file.writestr("a.txt", "a")
    assert _error(content.getvalue()).startswith("t.csv: is no table of Excel: ")


def test_excel_without_its_library_names_the_package(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "python_calamine", None)
    assert _error(b"PK\3\4") == f"t.csv: reading Excel needs {install_hint('excel')}"


@pytest.mark.parametrize(
    "source",
    [
        io.BytesIO(b"id,grip\n5,a\n9007199254740993,b\n"),
        pd.DataFrame({"id": [5, 9007199254740993], "grip": ["a", "b"]}),
        pa.table({"id": [None, 9007199254740993], "grip": ["a", "b"]}),
        pa.record_batch({"id": [None, 9007199254740993], "grip": ["a", "b"]}),
    ],
    ids=["csv", "pandas", "arrow", "batch"],
)
def test_a_whole_number_that_a_double_rounds_is_refused(source: object) -> None:
    place = "t.csv:3" if isinstance(source, io.BytesIO) else "t.csv, row 2"
    message = f"{place}: column 'id' holds 9007199254740993, which a double rounds"
    hint = "; pass --ignore id, or --categorical id to learn text"
    with pytest.raises(TableError) as caught:
        read_table(source, target="grip", name="t.csv")
    assert str(caught.value) == message + hint
    if isinstance(source, io.BytesIO):
        source.seek(0)
    with pytest.raises(TableError) as caught:
        list(batches(source, ["id"], name="t.csv"))
    assert str(caught.value) == message


def test_whole_numbers_that_doubles_round_are_different_categories() -> None:
    frame = pd.DataFrame({"id": [2**53, 2**53 + 1], "grip": ["a", "b"]})
    table = read_table(ft.table(frame, categorical=["id"]), target="grip")
    assert table.categories["id"] == ("9007199254740992", "9007199254740993")
    assert _read("id,grip\n1e300,a\n9007199254740992,b\n").values.tolist() == [
        [1e300, 2.0**53]
    ]


def test_an_infinity_to_predict_is_counted_as_missing() -> None:
    [batch] = batches(io.BytesIO(b"a,b\ninf,1\n2,\n"), ["a", "b"])
    assert batch.missing == 2
