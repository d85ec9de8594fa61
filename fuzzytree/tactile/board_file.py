"""The YAML file of a board, read and written; see `docs/reference/boards.md`."""

from __future__ import annotations

import os
from typing import Annotated, Any, ClassVar, Final, Literal

from msgspec import Meta, structs

from fuzzytree.errors import InvalidModelError
from fuzzytree.exporters import Entry, Noted, Short, joined
from fuzzytree.files import PathLike, read_bounded
from fuzzytree.formats import (
    FileRecord,
    KeyForm,
    Name,
    entries,
    located,
    mapping_of_format,
    record,
    report,
)
from fuzzytree.model import Mistake, Value
from fuzzytree.tactile.boards import (
    Board,
    Byte,
    Marker,
    Port,
    Request,
    Sentinel,
    Settings,
    Text,
)
from fuzzytree.tactile.sensor import LARGEST_SIDE, Full, Sensor, Side

BOARD_FORMAT: Final = "fuzzytree-board/1"

Reading = Annotated[int, Meta(ge=0, le=65535)]


class SensorOfBoard(FileRecord, frozen=True, kw_only=True):
    """The matrix: its size, and what its cells read.

    `full` is what a cell reads that takes no more. A cell is pressed where it reads
    more than `threshold` over its `baseline`, which has a number for each cell, row
    by row. Cells that are `masked`, each as [row, column] from 0, always read 0.
    """

    noun: ClassVar[str] = "a sensor"
    rows: Side
    columns: Side
    full: Full = 255
    threshold: Annotated[int, Meta(ge=0, le=65534)] = 0
    baseline: Annotated[tuple[Reading, ...], Meta(max_length=LARGEST_SIDE**2)] = ()
    masked: Annotated[
        tuple[Annotated[tuple[Byte, ...], Meta(min_length=2, max_length=2)], ...],
        Meta(max_length=LARGEST_SIDE**2),
    ] = ()


_FAMILIES: Final = ("marker", "sentinel", "request", "text")
_ALWAYS: Final[dict[type, str]] = {
    Sensor: "rows columns full",
    Marker: "marker",
    Sentinel: "end zero",
    Request: "ask",
    Text: "frame",
    Port: "baud",
}
"""The fields of a record that are always written."""


class BoardFile(FileRecord, Settings, frozen=True):
    """A board with a tactile sensor: what it sends, and how it is connected.

    One of `marker`, `sentinel`, `request` and `text` says how a frame lies in the
    bytes.
    """

    noun: ClassVar[str] = "a board"
    forms: ClassVar[tuple[KeyForm, ...]] = tuple(KeyForm((key,)) for key in _FAMILIES)
    format: Literal["fuzzytree-board/1"]
    name: Name
    sensor: SensorOfBoard
    marker: Marker | None = None
    sentinel: Sentinel | None = None
    request: Request | None = None
    text: Text | None = None


MOST_BYTES: Final = 4 * 2**20
"""The largest file of a board; one of 65536 cells with a baseline is a tenth of it."""


def load_board(path: PathLike) -> Board:
    """Return the board of a file.

    Raises:
        ReadError: If the file cannot be read or is no board; it lists all mistakes
            with their places.
    """
    return read_board(read_bounded(path, MOST_BYTES), os.fspath(path))


def read_board(content: bytes, name: str) -> Board:
    """Return the board of a file's content.

    Raises:
        ReadError: If it is no board; it lists all mistakes with their places.

    Example:
        >>> text = '''
        ... format: fuzzytree-board/1
        ... name: mat
        ... sensor: {rows: 16, columns: 16}
        ... marker: {bytes: AA 55}
        ... port: {baud: 2000000}
        ... '''
        >>> read_board(text.encode(), "mat.yaml").protocol
        Marker(marker='AA 55', bits=8, byte_order='little', sizes='none', skip=0, \
checksum='none', tail='')
    """
    root, found = mapping_of_format(content, name, BOARD_FORMAT, "board")
    file = record(entries(root, BoardFile, found), BoardFile, found)
    if file is None or found:
        raise report(name, found)
    family = next(key for key in _FAMILIES if getattr(file, key) is not None)
    mistakes: list[Mistake] = []
    try:
        sensor = Sensor(**structs.asdict(file.sensor))
    except InvalidModelError as error:
        mistakes += ((("sensor", *path), text) for path, text in error.mistakes)
        sensor = Sensor(file.sensor.rows, file.sensor.columns, file.sensor.full)
    try:
        settings = {key: getattr(file, key) for key in Settings.__struct_fields__}
        board = Board(file.name, sensor, getattr(file, family), **settings)
    except InvalidModelError as error:
        mistakes += error.mistakes
    else:
        if not mistakes:
            return board
    # Limits were checked with the form of the file: the keys of all that is left differ
    # only by the family and by blanks.
    keys = {"protocol": family, "data_bits": "data bits"}
    named = [(tuple(keys.get(str(k), k) for k in path), t) for path, t in mistakes]
    raise report(name, [*located(root, named)])


_TITLE: Final = "# A board of fuzzytree: what it sends, and how it is connected."


def board_text(board: Board) -> str:
    """Return a board as YAML; what is as usual is left out.

    Reading it gives an equal board.

    Raises:
        LossError: If the file is too large to be read again.

    Example:
        >>> board = Board("mat", Sensor(16, 16), Marker("AA 55"))
        >>> print(board_text(board), end="")
        # A board of fuzzytree: what it sends, and how it is connected.
        format: fuzzytree-board/1
        name: mat
        sensor: {rows: 16, columns: 16, full: 255}
        marker: {bytes: AA 55}
        order: rows
        port: {baud: 115200}
    """
    family = type(board.protocol).__name__.lower()
    entries: dict[str, Entry] = {
        "format": BOARD_FORMAT,
        "name": board.name,
        "sensor": _entry(board.sensor),
        family: _entry(board.protocol),
    }
    usual = Settings()
    for key in Settings.__struct_fields__:
        value = getattr(board, key)
        if key in ("order", "port") or value != getattr(usual, key):
            entries[key] = Noted(value, "lines") if key == "banner" else _entry(value)
    return joined(board.name, _TITLE, entries).decode()


def _entry(value: Any) -> Entry:
    """Return a part of a board; of a record the fields that are not as usual."""
    if isinstance(value, tuple):
        return Short([_entry(one) for one in value], is_run_on=True)
    if not isinstance(value, Value):
        found: Entry = value
        return found
    always = _ALWAYS.get(type(value), "").split()
    parts = {
        one.encode_name: _entry(part)
        for one in structs.fields(value)
        if (part := getattr(value, one.name)) != one.default or one.name in always
    }
    has_lists = any(isinstance(part, Short) for part in parts.values())
    return parts if has_lists else Short(parts)
