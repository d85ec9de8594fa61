"""Boards as YAML: written, read again, and refused with all that is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped]  # it has no types of its own
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzytree.errors import ReadError
from fuzzytree.tactile.board_file import MOST_BYTES, board_text, load_board, read_board
from fuzzytree.tactile.boards import (
    Board,
    Marker,
    Port,
    Protocol,
    Request,
    Sentinel,
    Start,
    Text,
)
from fuzzytree.tactile.sensor import Sensor
from tests.tactile.families import FAMILIES

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples" / "tactile" / "boards").glob("*.yaml"))
SCHEMA = json.loads((ROOT / "schemas" / "board.schema.json").read_text("utf-8"))
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
GOOD = """format: fuzzytree-board/1
name: mat
sensor: {rows: 2, columns: 3}
marker: {bytes: AA 55}
"""


@st.composite
def boards(draw: st.DrawFn) -> Board:
    """Draw boards of every family, with every field."""
    rows, columns = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    full = draw(st.sampled_from([1, 254, 255, 256, 1023, 65535]))
    values = st.integers(0, full)
    count = rows * columns
    cell = st.tuples(st.integers(0, rows - 1), st.integers(0, columns - 1))
    sensor = Sensor(
        rows,
        columns,
        full,
        threshold=draw(st.integers(0, full - 1)),
        baseline=tuple(draw(st.one_of(st.just([]), st.lists(values, min_size=count,
                                                            max_size=count)))),
        masked=tuple(draw(st.lists(cell, max_size=3))),
    )  # fmt: skip
    code = st.binary(min_size=1, max_size=64).map(lambda b: b.hex(" "))
    skip, checksum = st.integers(0, 1024), st.sampled_from(["none", "sum8", "crc16"])
    order = st.sampled_from(["little", "big"])
    bits = st.just(16) if full > 255 else st.sampled_from([8, 16])
    prefix = st.text(st.sampled_from("Fr!~:#"), max_size=32)
    sizes = st.sampled_from(("none", "rows and columns"))
    protocols: list[st.SearchStrategy[Protocol]] = [
        st.builds(
            Marker, code, bits, order, sizes, skip, checksum,
            st.one_of(st.just(""), code.map(str.upper)),
        ),
        st.builds(Request, code, bits, order, skip, checksum, st.floats(0.001, 3600)),
        st.builds(
            Text, st.sampled_from(["line", "block"]),
            st.sampled_from(["space", "comma", "semicolon"]), prefix, skip,
        ),
    ]  # fmt: skip
    if full <= 255:
        ends = st.tuples(st.integers(0, 255), st.integers(0, 255))
        protocols.append(
            ends.filter(lambda e: e[0] != e[1]).map(lambda e: Sentinel(*e))
        )
    ports = st.builds(
        Port, st.integers(1, 10**8), st.just(8),
        st.sampled_from(["none", "even", "odd"]), st.sampled_from([1, 2]),
    )  # fmt: skip
    texts = st.text(min_size=1, max_size=30).filter(
        lambda t: t == t.encode("utf-8", "ignore").decode()
    )
    return Board(
        name=draw(texts),
        sensor=sensor,
        protocol=draw(st.one_of(protocols)),
        order=draw(st.sampled_from(["rows", "columns"])),
        pressure=draw(st.sampled_from(["rises", "falls"])),
        port=draw(ports),
        start=Start(draw(st.integers(0, 10_000)), draw(st.floats(0, 1))),
        banner=draw(st.integers(0, 1000)),
    )


@pytest.mark.heavy
@settings(max_examples=30, deadline=None)
@given(boards())
def test_a_board_that_was_written_is_read_again_and_fits_the_schema(
    board: Board,
) -> None:
    text = board_text(board)
    assert read_board(text.encode(), "x.yaml") == board
    VALIDATOR.validate(yaml.safe_load(text))


@pytest.mark.parametrize("name", FAMILIES)
def test_boards_of_every_family_are_read_again(name: str) -> None:
    text = board_text(FAMILIES[name])
    assert read_board(text.encode(), "x.yaml") == FAMILIES[name]
    assert board_text(read_board(text.encode(), "x.yaml")) == text


SCALARS = st.one_of(
    st.integers(-2, 300),
    st.sampled_from([8, 16, 1024, 1025, 65535, 65536, 2000000, 10**8 + 1, None, True]),
    st.sampled_from([0.5, 1.5, -0.25, 3600.5, 0.0005]),
    st.sampled_from(
        ["", "AA", "AA 55", "aa55", "AA 5", "AA\n", "AA 55\n", "AA  55", "F", "F\n",
         "1F", "a b", "none", "crc16", "big", "line", "block", "comma", "columns",
         "falls", "rows and columns", "even", "mat", "fuzzytree-board/1", "8"]
    ),
    st.just([]),
    st.just([[0, 1]]),
    st.just([1, 2]),
    st.just({}),
)  # fmt: skip
KEYS = sorted(
    {key for part in SCHEMA["$defs"].values() for key in part["properties"]}
    | set(SCHEMA["properties"])
    | {"colums"}
)


@settings(max_examples=80, deadline=None)
@given(
    st.sampled_from(EXAMPLES),
    st.lists(
        st.tuples(
            st.sampled_from(["", "sensor", "marker", "request", "text", "sentinel",
                             "port", "start"]),
            st.sampled_from(KEYS),
            SCALARS,
        ),
        max_size=2,
    ),
    st.sampled_from([None, "name", "sensor", "format", "port"]),
)  # fmt: skip
def test_the_schema_accepts_what_the_reader_accepts(
    path: Path, changes: list[tuple[str, str, object]], dropped: str | None
) -> None:
    data: dict[str, Any] = yaml.safe_load(path.read_bytes())
    for where, key, value in changes:
        part = data.setdefault(where, {}) if where else data
        if isinstance(part, dict):
            part[key] = value
    data.pop(dropped or "", None)
    found = mistakes(yaml.safe_dump(data, allow_unicode=True).encode())
    # What the parts are together no schema tells: these sentences are the records'.
    own = ("never reads", "cannot both", "the threshold lies", "a baseline has",
           "a baseline lies", "no cell (", "with 7 data bits")  # fmt: skip
    of_form = [line for line in found if not any(text in line for text in own)]
    assert VALIDATOR.is_valid(data) is not bool(of_form), found


def mistakes(content: bytes) -> list[str]:
    try:
        read_board(content, "x.yaml")
    except ReadError as error:
        return str(error).splitlines()
    return []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "format: fuzzytree-board/1\nname: ''\n"
            "sensor: {rows: 16, colums: 0, full: 1023}\n"
            "marker: {bytes: 10, bits: 12, tail: xx}\ntext: {}\nstart: {hot: 2}\n",
            [
                "1:1: a board cannot be made of marker, text; it is made of marker; or "
                "sentinel; or request; or text",
                "2:7: 'name' must not be empty",
                "3:9: a sensor needs 'columns'",
                "3:20: a sensor has no key 'colums'; there is rows, columns, full, "
                "threshold, baseline, masked (did you mean 'columns'?)",
                "4:17: 'bytes' must be text, not an integer; in quotes it is text: "
                "'10'",
                "4:27: 'bits' must be '8' or '16', not an integer",
                "4:37: 'tail' cannot be 'xx'; it is 1 to 64 bytes in hexadecimal, such "
                "as 'AA 55'",
                "6:14: 'hot' must be at most 1, not 2",
            ],
        ),
        (
            "format: fuzzytree-board/1\nname: a\n"
            "sensor: {rows: 16, columns: 2, full: 1023, threshold: 2000, "
            "baseline: [1], masked: [[1, 2]]}\n"
            "marker: {bytes: AA}\nport: {data bits: 7}\n",
            [
                "3:55: the threshold lies in 0 to full - 1, not 2000",
                "3:71: a baseline has 32 numbers, not 1",
                "3:85: no cell (1, 2) in 16 x 2",
                "4:9: a cell of 8 bits never reads the sensor's full, 1023",
                "5:19: with 7 data bits only text comes through, no bytes above 127",
            ],
        ),
        (
            "format: fuzzytree/1\n",
            ["1:9: this is a model, and no board; 'format' must be "
             "'fuzzytree-board/1'"],
        ),
        (
            "format: fuzzytree-board/2\n",
            ["1:9: a file of format 'fuzzytree-board/2' needs a newer fuzzytree, one "
             "that reads 'fuzzytree-board/2'; this one reads 'fuzzytree-board/1'"],
        ),
        ("format: []\n", ["1:9: 'format' must be 'fuzzytree-board/1'"]),
        ("name: a\n", ["1:1: no 'format: fuzzytree-board/1' says what this file is"]),
        (
            "- a\n",
            ["1:1: a board must be a mapping that begins with 'format: "
             "fuzzytree-board/1'"],
        ),
        (
            GOOD.replace("marker: {bytes: AA 55}", "sentinel: {end: 3, zero: 3}"),
            ["4:26: 3 cannot both end a frame and begin a run"],
        ),
        (
            GOOD.replace("marker: {bytes: AA 55}", "request: {ask: A, timeout: .nan}"),
            [
                "4:16: 'ask' cannot be 'A'; it is 1 to 64 bytes in hexadecimal, such "
                "as 'AA 55'",
                "4:28: 'timeout' must be at least 0.001, not nan",
            ],
        ),
        (GOOD + "sensor: {}\n", ["5:1: key 'sensor' stands twice"]),
    ],
)  # fmt: skip
def test_all_mistakes_have_their_places(text: str, expected: list[str]) -> None:
    with pytest.raises(ReadError) as caught:
        read_board(text.encode(), "mat.yaml")
    assert str(caught.value).splitlines() == [f"mat.yaml:{line}" for line in expected]


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=40), st.integers(0, len(GOOD)), st.integers(0, 20))
def test_any_bytes_are_a_board_or_an_error(new: bytes, place: int, cut: int) -> None:
    content = GOOD.encode()
    try:
        found = read_board(content[:place] + new + content[place + cut :], "x.yaml")
    except ReadError:
        return
    assert isinstance(found, Board)


def test_a_file_that_is_too_large_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mat.yaml"
    path.write_bytes(bytes(MOST_BYTES + 1))
    with pytest.raises(ReadError, match="is larger than 4194304 bytes"):
        load_board(path)
    with pytest.raises(ReadError) as caught:
        load_board(tmp_path / "no.yaml")
    expected = f"{tmp_path}/no.yaml: cannot be read: no such file or directory"
    assert str(caught.value) == expected


@pytest.mark.heavy
def test_the_largest_board_can_be_written_and_read() -> None:
    sensor = Sensor(256, 256, 65535, baseline=(65534,) * 65536)
    board = Board("large", sensor, Marker("AA", 16))
    assert read_board(board_text(board).encode(), "large.yaml") == board


def test_what_is_as_usual_is_left_out() -> None:
    board = Board("mat", Sensor(2, 2), Text(), start=Start(hot=0.25), banner=1)
    assert board_text(board).splitlines()[2:] == [
        "name: mat",
        "sensor: {rows: 2, columns: 2, full: 255}",
        "text: {frame: line}",
        "order: rows",
        "port: {baud: 115200}",
        "start: {hot: 0.25}",
        "banner: 1  # lines",
    ]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_is_a_board_and_fits_the_schema(path: Path) -> None:
    board = load_board(path)
    assert read_board(board_text(board).encode(), "x.yaml") == board
    VALIDATOR.validate(yaml.safe_load(path.read_bytes()))


def test_check_jsonschema_accepts_the_examples(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from check_jsonschema import main  # type: ignore[import-untyped]  # as above

    schema = ROOT / "schemas" / "board.schema.json"
    with pytest.raises(SystemExit) as caught:
        main(["--schemafile", str(schema), *map(str, EXAMPLES)])
    assert caught.value.code == 0, capsys.readouterr().out
