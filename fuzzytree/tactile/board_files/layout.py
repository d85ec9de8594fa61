"""The layout of the YAML file of a board, as records; see `layout`."""

from __future__ import annotations

from typing import Annotated, ClassVar, Final, Literal

from msgspec import Meta, field

from fuzzytree.formats.yaml.layout import Form, Name, Record
from fuzzytree.tactile.boards import (
    HEXADECIMAL,
    LARGEST_BAUD,
    LONGEST_TIMEOUT_S,
    MOST_BANNER_LINES,
    MOST_SKIPPED,
    MOST_START_FRAMES,
    PREFIX,
    ByteOrder,
    Checksum,
    Order,
    Pressure,
)
from fuzzytree.tactile.sensor import LARGEST_SIDE

BOARD_FORMAT: Final = "fuzzytree-board/1"

Side = Annotated[int, Meta(ge=1, le=LARGEST_SIDE)]
Reading = Annotated[int, Meta(ge=0, le=65535)]
Byte = Annotated[int, Meta(ge=0, le=255)]
Skip = Annotated[int, Meta(ge=0, le=MOST_SKIPPED)]
Hexadecimal = Annotated[
    str,
    Meta(
        pattern=rf"^{HEXADECIMAL}$(?!\n)",
        description="1 to 64 bytes in hexadecimal, such as 'AA 55'",
        examples=["AA 55", "0D 0A"],
    ),
]


class SensorOfBoard(Record, frozen=True, kw_only=True):
    """The matrix: its size, and what its cells read.

    `full` is what a cell reads that takes no more. A cell is pressed where it reads
    more than `threshold` over its `baseline`, which has a number for each cell, row
    by row. Cells that are `masked`, each as [row, column] from 0, always read 0.
    """

    noun: ClassVar[str] = "a sensor"
    rows: Side
    columns: Side
    full: Annotated[int, Meta(ge=1, le=65535)] = 255
    threshold: Annotated[int, Meta(ge=0, le=65534)] = 0
    baseline: Annotated[tuple[Reading, ...], Meta(max_length=LARGEST_SIDE**2)] = ()
    masked: Annotated[
        tuple[Annotated[tuple[Byte, ...], Meta(min_length=2, max_length=2)], ...],
        Meta(max_length=LARGEST_SIDE**2),
    ] = ()


class MarkerOfBoard(Record, frozen=True, kw_only=True):
    """Frames that begin with a marker, and have a fixed length.

    Behind the marker come the `sizes` (16 bits each), `skip` bytes that are ignored,
    the cells, the checksum of all of these, and the tail.
    """

    noun: ClassVar[str] = "a marker"
    bytes: Hexadecimal
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = field(name="byte order", default="little")
    sizes: Literal["none", "rows and columns"] = "none"
    skip: Skip = 0
    checksum: Checksum = "none"
    tail: Hexadecimal | None = None


class SentinelOfBoard(Record, frozen=True, kw_only=True):
    """Frames that the byte `end` ends, a byte a cell.

    The byte `zero` begins a run of zeros, and the next byte is its length.
    """

    noun: ClassVar[str] = "a sentinel"
    end: Byte = 255
    zero: Byte = 0


class RequestOfBoard(Record, frozen=True, kw_only=True):
    """Frames that are asked for, and have a fixed length.

    `skip` bytes that are ignored, the cells, and the checksum of both. The `timeout`
    is in seconds.
    """

    noun: ClassVar[str] = "a request"
    ask: Hexadecimal
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = field(name="byte order", default="little")
    skip: Skip = 0
    checksum: Checksum = "none"
    timeout: Annotated[float, Meta(ge=0.001, le=LONGEST_TIMEOUT_S)] = 0.5


class TextOfBoard(Record, frozen=True, kw_only=True):
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
                description="a word of 1 to 32 signs of ASCII, without , and ;, that "
                "begins with no digit, sign or point",
                examples=["F"],
            ),
        ]
        | None
    ) = None
    skip: Skip = 0


class PortOfBoard(Record, frozen=True, kw_only=True):
    """How the serial port is set."""

    noun: ClassVar[str] = "a port"
    baud: Annotated[int, Meta(ge=1, le=LARGEST_BAUD)] = 115200
    data_bits: Literal[7, 8] = field(name="data bits", default=8)
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = field(name="stop bits", default=1)


class StartOfBoard(Record, frozen=True, kw_only=True):
    """What is measured before the first frame counts.

    The baseline is the median of so many `frames`, cell by cell. A cell whose
    baseline is above the share `hot` of full is masked.
    """

    noun: ClassVar[str] = "a start"
    frames: Annotated[int, Meta(ge=0, le=MOST_START_FRAMES)] = 30
    hot: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.5


class BoardFile(Record, frozen=True, kw_only=True):
    """A board with a tactile sensor: what it sends, and how it is connected.

    One of `marker`, `sentinel`, `request` and `text` says how a frame lies in the
    bytes.
    """

    noun: ClassVar[str] = "a board"
    forms: ClassVar[tuple[Form, ...]] = (
        Form(("marker",)),
        Form(("sentinel",)),
        Form(("request",)),
        Form(("text",)),
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
    banner: Annotated[int, Meta(ge=0, le=MOST_BANNER_LINES)] = 0
