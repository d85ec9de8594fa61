"""CSV is cut into whole rows, and each cell is the text that stands there."""

from __future__ import annotations

import csv
import io
import random
import struct

import pytest

from fuzzytree import csv_rows, tables
from fuzzytree.cells import plain
from fuzzytree.csv_rows import count_breaks
from fuzzytree.errors import TableError
from fuzzytree.tables import batches, pieces, read_table

CELLS = (
    *("1", '""', '"a""b"', '"x\ny"', '"x\r\ny"', "", 'c"d', ' "q"', " 2", '"1,5"'),
    *("\ufeffz", "é", "NA", "\0"),
)


def _rows(text: str) -> list[list[object]]:
    found: list[list[object]] = []
    for piece in pieces(io.BytesIO(text.encode()), name="t.csv"):
        cells = [plain(column) for column in piece.cells]
        found += [list(row) for row in zip(*cells, strict=True)]
    return found


def _lines(text: str) -> list[str]:
    found = pieces(io.BytesIO(text.encode()), name="t.csv")
    return [piece.where(row) for piece in found for row in range(piece.rows)]


def _error(content: bytes) -> str:
    with pytest.raises(TableError) as caught:
        list(pieces(io.BytesIO(content), name="t.csv"))
    return str(caught.value)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("block", [1, 7, 64, csv_rows.BLOCK])
def test_rows_are_those_of_the_csv_module_whatever_the_blocks(
    block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (csv_rows, tables):
        monkeypatch.setattr(module, "BLOCK", block)
    monkeypatch.setattr(tables, "PIECE", 3)
    chance = random.Random(block)
    for _ in range(200):
        width = chance.randint(1, 4)
        text = ",".join("abcd"[:width]) + chance.choice(["\n", "\r\n", "\r"])
        for _ in range(chance.randint(0, 9)):
            text += ",".join(chance.choices(CELLS, k=width))
            text += chance.choice(["\n", "\r\n", "\n\n", "\r"])
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        expected, lines, before = [], [], 0
        for row in reader:
            if row:
                expected.append(row)
                lines.append(f"t.csv:{before + 1}")
            before = reader.line_num
        assert _rows(text) == expected[1:]
        assert _lines(text) == lines[1:]


def test_numbers_are_the_doubles_of_python_to_the_last_bit() -> None:
    chance = random.Random(0)
    numbers: list[str] = []
    for _ in range(3000):
        (value,) = struct.unpack("d", struct.pack("Q", chance.getrandbits(64)))
        numbers += [repr(value), f"{value:.17e}", f"{value:.40e}"]
    numbers += ["1e-400", "4.9e-324", "2.4703282292062328e-324", "1.", ".5", "-0", "+1"]
    numbers += [
        "9007199254740993.0",
        "9007199254740992.9999999999999999999",
        "1e23",
    ]
    text = "\n".join(["a", *numbers]).encode()
    found = b"".join(b.values.tobytes() for b in batches(io.BytesIO(text), ["a"]))
    expected = struct.pack(f"{len(numbers)}d", *map(float, numbers))
    for place, number in enumerate(numbers):
        if "nan" not in number:
            span = slice(8 * place, 8 * place + 8)
            assert found[span] == expected[span], number


@pytest.mark.parametrize(
    "cell", ["nan(1)", "nan(ind)", "0x1p3", "1_0", "1d5", "1f", "1e", "NAN()", "٣"]
)
@pytest.mark.parametrize("beside", ["1", "", "inf", "+1", " 1"])
def test_a_cell_is_refused_whatever_stands_in_other_rows(
    cell: str, beside: str
) -> None:
    content = f"a,b\n{beside},1\n{cell},1\n".encode()
    with pytest.raises(TableError) as caught:
        list(batches(io.BytesIO(content), ["a"], name="t.csv"))
    assert str(caught.value) == (
        f"t.csv:3: column 'a' holds text where a number is needed: {cell!r}"
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b'a,b\n1,2\n1,"x"y\n', "t.csv:3: broken CSV: text follows a closing quote"),
        (b'a,b\n1,2\n"1\n\n,2\n', "t.csv:3: broken CSV: a quote is not closed"),
        (b"a,b\n1,2\n\n1,2,3\n", "t.csv:4: 3 cells, and line 1 names 2 columns"),
        (b'a,b\n1,"2\n"\n1\n', "t.csv:4: 1 cell, and line 1 names 2 columns"),
        (
            b"a\xe9\n1\n",
            "t.csv: is no UTF-8 text; save it as UTF-8, or pass its encoding, "
            "such as --encoding cp1252",
        ),
    ],
)
def test_broken_rows_are_named_by_their_line(content: bytes, message: str) -> None:
    assert _error(content) == message


def test_a_line_that_never_ends_is_refused() -> None:
    class Zeros(io.BytesIO):
        def read(self, size: int | None = -1, /) -> bytes:
            return bytes(size or 0)

    with pytest.raises(TableError) as caught:
        list(pieces(Zeros(), name="zeros"))
    assert str(caught.value) == (
        "zeros:1: a row is longer than 67108864 bytes; is a quote not closed?"
    )


def test_a_column_that_is_not_needed_may_have_another_encoding() -> None:
    (batch,) = batches(io.BytesIO(b"a,b\n1,\xe9\n"), ["a"])
    assert batch.values.tolist() == [[1.0]]


def test_a_quote_inside_a_cell_without_quotes_is_text() -> None:
    table = read_table(io.BytesIO(b'a,b\n1,5" pipe\n2,6" pipe\n'), target="b")
    assert table.classes == ('5" pipe', '6" pipe')


def test_lines_end_as_in_an_editor() -> None:
    assert count_breaks(b"a\r\nb\rc\n\n") == 4
