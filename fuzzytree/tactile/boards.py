"""What a board sends: how a frame lies in its bytes, and the port it comes through."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from fuzzytree.errors import InvalidModelError
from fuzzytree.rulebase import Mistake, Value
from fuzzytree.tactile.sensor import Sensor

Checksum = Literal["none", "sum8", "xor8", "crc16"]
Order = Literal["rows", "columns"]
ByteOrder = Literal["little", "big"]


class Marker(Value, frozen=True, tag="marker"):
    """A marker, then a fixed number of bytes.

    The marker can occur among the cells, so a beginning is believed only where the
    next frame begins with it too, or a checksum or tail confirms it.

    Attributes:
        marker: The bytes at the beginning, in hexadecimal, such as `AA 55`.
        bits: 8 or 16 for each cell.
        byte_order: Of 16 bits.
        sizes: Whether two numbers of 16 bits, rows and columns, follow the marker.
        skip: Bytes between these and the cells that are ignored (time stamps).
        checksum: Of sizes, skipped bytes and cells, behind the cells; `crc16` is that
            of Modbus, low byte first.
        tail: Bytes at the end, in hexadecimal.
    """

    marker: str
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = "little"
    sizes: bool = False
    skip: int = 0
    checksum: Checksum = "none"
    tail: str = ""


class Sentinel(Value, frozen=True, tag="sentinel"):
    """One byte a cell; runs of zeros are packed; a byte of its own ends a frame.

    Attributes:
        end: The value that ends a frame and is no cell.
        zero: The value before a run of zeros; the next byte is its length.
    """

    end: int = 255
    zero: int = 0


class Request(Value, frozen=True, tag="request"):
    """The host asks, the board answers with a fixed number of bytes.

    Attributes:
        ask: The bytes that the host sends for each frame, in hexadecimal.
        bits: 8 or 16 for each cell.
        byte_order: Of 16 bits.
        skip: Bytes before the cells that are ignored (time stamps).
        checksum: As in `Marker`.
        timeout_s: How long an answer may take before the host asks again.
    """

    ask: str
    bits: Literal[8, 16] = 8
    byte_order: ByteOrder = "little"
    skip: int = 0
    checksum: Checksum = "none"
    timeout_s: float = 0.5


class Text(Value, frozen=True, tag="text"):
    """Numbers in lines of text.

    Attributes:
        frame: Whether a `line` is a frame, or a `block`: a line for each row, and an
            empty line or a title between frames.
        separator: Between numbers: `space` (any spaces and tabs), `comma` or
            `semicolon`.
        prefix: The first word of a line that holds cells, such as `F`; other lines
            are banners. Empty if there is none.
        skip: Numbers before the cells that are ignored (time stamps).
    """

    frame: Literal["line", "block"] = "line"
    separator: Literal["space", "comma", "semicolon"] = "space"
    prefix: str = ""
    skip: int = 0


Protocol = Marker | Sentinel | Request | Text


class Port(Value, frozen=True):
    """How the serial port is set.

    Attributes:
        baud: Bits a second.
        data_bits: 7 or 8.
        parity: Of each byte.
        stop_bits: 1 or 2.
    """

    baud: int = 115200
    data_bits: Literal[7, 8] = 8
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = 1


class Start(Value, frozen=True):
    """What is measured before the first frame counts.

    Attributes:
        frames: How many frames make the baseline (their median, cell by cell); 0 for
            none.
        hot: A cell whose baseline is above this share of full is masked.
    """

    frames: int = 30
    hot: float = 0.5


class Board(Value, frozen=True):
    """A board: its sensor, its protocol and its port.

    Attributes:
        name: For people.
        sensor: The matrix.
        protocol: How a frame lies in the bytes.
        order: Whether cells come row by row, or column by column.
        port: How the serial port is set.
        start: What is measured at the beginning.
        banner: Lines at the beginning, ended by a line feed, that are no frames.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    name: str
    sensor: Sensor
    protocol: Protocol
    order: Order = "rows"
    port: Port = Port()
    start: Start = Start()
    banner: int = 0

    def __post_init__(self) -> None:
        """Refuse a board that contradicts itself."""
        mistakes = [*_mistakes(self)]
        if mistakes:
            raise InvalidModelError(mistakes)


def _mistakes(board: Board) -> Iterator[Mistake]:
    if not board.name:
        yield ("name",), "a board needs a name"
