"""The YAML file of a board, read and written; see `docs/reference/boards.md`."""

from __future__ import annotations

import os
from typing import Annotated, Any, ClassVar, Final, Literal

from msgspec import Meta, field, structs

from fuzzytree.errors import InvalidModelError, ReadError
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
    ABOUT_PREFIX,
    PREFIX,
    Baud,
    Board,
    Byte,
    ByteOrder,
    Checksum,
    Hexadecimal,
    Lines,
    Marker,
    Order,
    Port,
    Pressure,
    Protocol,
    Request,
    Seconds,
    Sentinel,
    Share,
    Skip,
    Start,
    StartFrames,
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


class MarkerOfBoard(FileRecord, frozen=True, kw_only=True):
    """Frames that begin with a marker, and have a fixed length.

    Behind the marker come the `sizes` (16 bits each), `skip` bytes that are ignored,
    the cells, the checksum of all of these, and the tail.
    """

    noun: ClassVar[str] = "a marker"
    marker: Hexadecimal = field(name="bytes")
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = field(name="byte order", default="little")
    sizes: Literal["none", "rows and columns"] = "none"
    skip: Skip = 0
    checksum: Checksum = "none"
    tail: Hexadecimal | None = None


class SentinelOfBoard(FileRecord, frozen=True, kw_only=True):
    """Frames that the byte `end` ends, a byte a cell.

    The byte `zero` begins a run of zeros, and the next byte is its length.
    """

    noun: ClassVar[str] = "a sentinel"
    end: Byte = 255
    zero: Byte = 0


class RequestOfBoard(FileRecord, frozen=True, kw_only=True):
    """Frames on request, of a fixed length.

    `skip` bytes that are ignored, the cells, and the checksum of both. The `timeout`
    is in seconds.
    """

    noun: ClassVar[str] = "a request"
    ask: Hexadecimal
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = field(name="byte order", default="little")
    skip: Skip = 0
    checksum: Checksum = "none"
    timeout_s: Seconds = field(name="timeout", default=0.5)


class TextOfBoard(FileRecord, frozen=True, kw_only=True):
    """Frames as numbers in lines of text.

    A frame is a line, or a block of lines, one for each row (column), with an empty
    line or a title between blocks. A line of cells begins with the `prefix`, if there
    is one, and with `skip` numbers that are ignored.
    """

    noun: ClassVar[str] = "text"
    frame: Literal["line", "block"] = "line"
    separator: Literal["space", "comma", "semicolon"] = "space"
    prefix: (
        Annotated[
            str,
            Meta(
                pattern=rf"^{PREFIX}$(?!\n)",
                description=ABOUT_PREFIX,
                examples=["F"],
            ),
        ]
        | None
    ) = None
    skip: Skip = 0


class PortOfBoard(FileRecord, frozen=True, kw_only=True):
    """How the serial port is set."""

    noun: ClassVar[str] = "a port"
    baud: Baud = 115200
    data_bits: Literal[7, 8] = field(name="data bits", default=8)
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = field(name="stop bits", default=1)


class StartOfBoard(FileRecord, frozen=True, kw_only=True):
    """What is measured before the first frame counts.

    The baseline is the median of so many `frames`, cell by cell. A cell whose
    baseline is above the share `hot` of full is masked.
    """

    noun: ClassVar[str] = "a start"
    frames: StartFrames = 30
    hot: Share = 0.5


class BoardFile(FileRecord, frozen=True, kw_only=True):
    """A board with a tactile sensor: what it sends, and how it is connected.

    One of `marker`, `sentinel`, `request` and `text` says how a frame lies in the
    bytes.
    """

    noun: ClassVar[str] = "a board"
    forms: ClassVar[tuple[KeyForm, ...]] = tuple(
        KeyForm((key,)) for key in ("marker", "sentinel", "request", "text")
    )
    format: Literal["fuzzytree-board/1"]
    name: Name
    sensor: SensorOfBoard
    marker: MarkerOfBoard | None = None
    sentinel: SentinelOfBoard | None = None
    request: RequestOfBoard | None = None
    text: TextOfBoard | None = None
    order: Order = "rows"
    pressure: Pressure = "rises"
    port: PortOfBoard = PortOfBoard()
    start: StartOfBoard = StartOfBoard()
    banner: Lines = 0


MOST_BYTES: Final = 4 * 2**20
"""The largest file of a board; one of 65536 cells with a baseline is a tenth of it."""

_FAMILIES: Final[dict[str, tuple[type[Protocol], type[FileRecord], str]]] = {
    "marker": (Marker, MarkerOfBoard, "marker"),
    "sentinel": (Sentinel, SentinelOfBoard, "end zero"),
    "request": (Request, RequestOfBoard, "ask"),
    "text": (Text, TextOfBoard, "frame"),
}
"""Of each family: the record, its layout in the file, and what is always written."""


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
        Marker(marker='AA 55', bits=8, byte_order='little', sizes=False, skip=0, \
checksum='none', tail='')
    """
    if len(content) > MOST_BYTES:
        text = f"{len(content):,} bytes are more than the {MOST_BYTES:,} of a board"
        raise ReadError(f"{name}: {text}")
    root, found = mapping_of_format(content, name, BOARD_FORMAT, "board")
    file = record(entries(root, BoardFile, found), BoardFile, found)
    if file is None or found:
        raise report(name, found)
    family = next(key for key in _FAMILIES if getattr(file, key) is not None)
    mistakes: list[Mistake] = []
    try:
        sensor = Sensor(**_fields(file.sensor))
    except InvalidModelError as error:
        mistakes += ((("sensor", *path), text) for path, text in error.mistakes)
        sensor = Sensor(file.sensor.rows, file.sensor.columns, file.sensor.full)
    try:
        board = Board(
            name=file.name,
            sensor=sensor,
            protocol=_FAMILIES[family][0](**_fields(getattr(file, family))),
            order=file.order,
            pressure=file.pressure,
            port=Port(**_fields(file.port)),
            start=Start(**_fields(file.start)),
            banner=file.banner,
        )
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


def _fields(part: FileRecord) -> dict[str, Any]:
    """Return a part of the file as the fields of the record that it stands for."""
    found = {name: getattr(part, name) for name in part.__struct_fields__}
    if "sizes" in found:
        found["sizes"] = found["sizes"] != "none"
    return {name: "" if one is None else one for name, one in found.items()}


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
    family, kind, always = next(
        (key, kind, always)
        for key, (own, kind, always) in _FAMILIES.items()
        if isinstance(board.protocol, own)
    )
    entries: dict[str, Entry] = {
        "format": BOARD_FORMAT,
        "name": board.name,
        "sensor": _sensor_entry(board.sensor),
        family: Short(_changed(kind, board.protocol, always)),
        "order": board.order,
    }
    if board.pressure != "rises":
        entries["pressure"] = board.pressure
    entries["port"] = Short(_changed(PortOfBoard, board.port, "baud"))
    if board.start != Start():
        entries["start"] = Short(_changed(StartOfBoard, board.start))
    if board.banner:
        entries["banner"] = Noted(board.banner, "lines")
    return joined(board.name, _TITLE, entries).decode()


def _sensor_entry(sensor: Sensor) -> Entry:
    entries = _changed(SensorOfBoard, sensor, "rows columns full")
    if not (sensor.baseline or sensor.masked):
        return Short(entries)
    if sensor.baseline:
        entries["baseline"] = Short([*sensor.baseline], is_run_on=True)
    if sensor.masked:
        cells: list[Entry] = [Short([*cell]) for cell in sensor.masked]
        entries["masked"] = Short(cells, is_run_on=True)
    return entries


def _changed(
    kind: type[FileRecord], value: Value, always: str = ""
) -> dict[str, Entry]:
    """Return the fields that are not as usual, by their keys."""
    entries: dict[str, Entry] = {}
    for one in structs.fields(kind):
        own = getattr(value, one.name)
        is_usual = own == one.default or own is False or own == ""
        if not is_usual or one.name in always.split():
            entries[one.encode_name] = "rows and columns" if own is True else own
    return entries
