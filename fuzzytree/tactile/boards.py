"""What a board sends: how a frame lies in its bytes, and the port it comes through."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Final, Literal

from msgspec import Meta, field

from fuzzytree.errors import InvalidModelError
from fuzzytree.formats import FileRecord
from fuzzytree.model import Mistake, Value
from fuzzytree.tactile.calibration import Calibration
from fuzzytree.tactile.rest import FOLLOW_S
from fuzzytree.tactile.sensor import Sensor, limit_mistakes

_HEXADECIMAL: Final = "[0-9A-Fa-f]{2}( ?[0-9A-Fa-f]{2}){0,63}"
_ABOUT_HEXADECIMAL: Final = "1 to 64 bytes in hexadecimal, such as 'AA 55'"
_PREFIX: Final = r"[!-*/:<-~][!-+\--:<-~]{0,31}"  # no number begins like it
_ABOUT_PREFIX: Final = (
    "a word of 1 to 32 signs of ASCII, without , and ;, that begins with no digit, "
    "sign or point"
)

Byte = Annotated[int, Meta(ge=0, le=255)]
Skip = Annotated[int, Meta(ge=0, le=1024)]
Hexadecimal = Annotated[
    str,
    Meta(
        pattern=rf"^{_HEXADECIMAL}$(?!\n)",
        description=_ABOUT_HEXADECIMAL,
        examples=["AA 55", "0D 0A"],
    ),
]
Tail = Annotated[
    str, Meta(pattern=rf"^({_HEXADECIMAL})?$(?!\n)", description=_ABOUT_HEXADECIMAL)
]
Prefix = Annotated[
    str, Meta(pattern=rf"^({_PREFIX})?$(?!\n)", description=_ABOUT_PREFIX)
]
Seconds = Annotated[float, Meta(ge=0.001, le=3600.0)]
Baud = Annotated[int, Meta(ge=1, le=100_000_000)]
StartFrames = Annotated[int, Meta(ge=0, le=10_000)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Lines = Annotated[int, Meta(ge=0, le=1000)]

Checksum = Literal["none", "sum8", "xor8", "crc16"]
Order = Literal["rows", "columns"]
Pressure = Literal["rises", "falls"]
ByteOrder = Literal["little", "big"]


class Marker(Value, FileRecord, frozen=True, tag="marker"):
    """A marker, then a fixed number of bytes.

    The marker can occur among the cells, so a beginning is believed only where the
    next frame begins with it too, or a checksum or tail confirms it.

    Attributes:
        marker: The bytes at the beginning, in hexadecimal, such as `AA 55`.
        bits: 8 or 16 for each cell.
        byte_order: Of 16 bits.
        sizes: Whether two numbers of 16 bits, rows and columns, in the same byte
            order, follow the marker, or none.
        skip: Bytes between these and the cells that are ignored (time stamps).
        checksum: Of sizes, skipped bytes and cells, behind the cells; `crc16` is that
            of Modbus, low byte first.
        tail: Bytes at the end, in hexadecimal.
    """

    noun: ClassVar[str] = "a marker"
    marker: Hexadecimal = field(name="bytes")
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = field(name="byte order", default="little")
    sizes: Literal["none", "rows and columns"] = "none"
    skip: Skip = 0
    checksum: Checksum = "none"
    tail: Tail = ""


class Sentinel(Value, FileRecord, frozen=True, tag="sentinel"):
    """One byte a cell; runs of zeros are packed; a byte of its own ends a frame.

    Attributes:
        end: The value that ends a frame and is no cell.
        zero: The value before a run of zeros; the next byte is its length, from 1.
            No cell has this value, unless it is 0.
    """

    noun: ClassVar[str] = "a sentinel"
    end: Byte = 255
    zero: Byte = 0


class Request(Value, FileRecord, frozen=True, tag="request"):
    """The host sends a request, the board responds with a fixed number of bytes.

    Attributes:
        ask: The bytes that the host sends for each frame, in hexadecimal.
        bits: 8 or 16 for each cell.
        byte_order: Of 16 bits.
        skip: Bytes before the cells that are ignored (time stamps).
        checksum: As in `Marker`.
        timeout_s: Seconds before the host repeats a request without a response.
    """

    noun: ClassVar[str] = "a request"
    ask: Hexadecimal
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = field(name="byte order", default="little")
    skip: Skip = 0
    checksum: Checksum = "none"
    timeout_s: Seconds = field(name="timeout", default=0.5)


class Text(Value, FileRecord, frozen=True, tag="text"):
    """Numbers in lines of text.

    Attributes:
        frame: Whether a `line` is a frame, or a `block`: a line for each row, and an
            empty line or a title between frames. With the order `columns` a line
            of a block is a column.
        separator: Between numbers: `space` (any spaces and tabs), `comma` or
            `semicolon`.
        prefix: The first word of a line that holds cells, such as `F`; other lines
            are banners. Empty if there is none.
        skip: Numbers before the cells of each line that are ignored (time stamps).
    """

    noun: ClassVar[str] = "text"
    frame: Literal["line", "block"] = "line"
    separator: Literal["space", "comma", "semicolon"] = "space"
    prefix: Prefix = ""
    skip: Skip = 0


Protocol = Marker | Sentinel | Request | Text


class Port(Value, FileRecord, frozen=True):
    """How the serial port is set.

    Attributes:
        baud: Bits a second.
        data_bits: 7 or 8.
        parity: Of each byte.
        stop_bits: 1 or 2.
    """

    noun: ClassVar[str] = "a port"
    baud: Baud = 115200
    data_bits: Literal[7, 8] = field(name="data bits", default=8)
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = field(name="stop bits", default=1)

    @property
    def bits_of_a_byte(self) -> int:
        """How many bits are on the line for each byte.

        Example:
            >>> Port().bits_of_a_byte
            10
        """
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits


class Start(Value, FileRecord, frozen=True):
    """What is measured before the first frame counts.

    Attributes:
        frames: How many frames make the baseline (their median, cell by cell); 0 for
            none.
        hot: A cell whose baseline is above this share of full is masked.
        follow_s: Seconds in which the baseline of a free cell follows 63 % of a
            change; 0 for a baseline that stays as it was measured.
    """

    noun: ClassVar[str] = "a start"
    frames: StartFrames = 30
    hot: Share = 0.5
    follow_s: Annotated[float, Meta(ge=0.0, le=86400.0)] = field(
        name="follow", default=FOLLOW_S
    )


class Settings(Value, frozen=True, kw_only=True):
    """What a board and its file say alike.

    Attributes:
        order: Whether cells come row by row, or column by column.
        pressure: Whether a cell reads more or less when it is pressed. If less, a
            frame holds `full` minus what the board sends, and a board that sends
            more than `full` sent a damaged frame.
        port: How the serial port is set.
        start: What is measured at the beginning.
        banner: Lines of text at the beginning, ended by a line feed, that are no
            frames.
        calibration: What makes pressures of readings; readings stay without one.
    """

    order: Order = "rows"
    pressure: Pressure = "rises"
    port: Port = Port()
    start: Start = Start()
    banner: Lines = 0
    calibration: Calibration | None = None


class Board(Settings, frozen=True):
    """A board: its sensor, its protocol and its port.

    Attributes:
        name: For people.
        sensor: The matrix.
        protocol: How a frame lies in the bytes.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    name: Annotated[str, Meta(min_length=1, max_length=1000)]
    sensor: Sensor
    protocol: Protocol

    def __post_init__(self) -> None:
        """Refuse a board that contradicts itself."""
        mistakes = [*_mistakes(self)]
        if mistakes:
            raise InvalidModelError(mistakes)


def _mistakes(board: Board) -> Iterator[Mistake]:
    yield from limit_mistakes(board)
    if board.name != board.name.encode("utf-8", "ignore").decode():
        text = f"the name {board.name[:40]!r} cannot be written as UTF-8"
        yield ("name",), text
    parts = {"protocol": board.protocol, "port": board.port, "start": board.start}
    for name, part in parts.items():
        yield from (((name, *path), text) for path, text in limit_mistakes(part))
    protocol, full = board.protocol, board.sensor.full
    cells = board.sensor.rows * board.sensor.columns
    if board.calibration and len(board.calibration.gains) not in (0, cells):
        text = f"a calibration has {cells} gains, not {len(board.calibration.gains)}"
        yield ("calibration", "gains"), text
    if isinstance(protocol, Sentinel) and protocol.end == protocol.zero:
        text = f"{protocol.end} cannot both end a frame and begin a run"
        yield ("protocol", "zero"), text
    is_wide = isinstance(protocol, Text) or getattr(protocol, "bits", 8) == 16
    if full > 255 and not is_wide:
        text = f"a cell of 8 bits never reads the sensor's full, {full}"
        yield ("protocol", "bits"), text
    if board.port.data_bits == 7 and not isinstance(protocol, Text):
        text = "with 7 data bits only text comes through, no bytes above 127"
        yield ("port", "data_bits"), text
