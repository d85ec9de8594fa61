"""What a board sends: how a frame lies in its bytes, and the port it comes through."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Final, Literal

from fuzzytree.errors import InvalidModelError
from fuzzytree.model import Mistake, Value
from fuzzytree.tactile.sensor import Sensor

LONGEST_NAME: Final = 1000
MOST_BYTES: Final = 64
"""The longest marker, tail or question."""
MOST_SKIPPED: Final = 1024
"""The most bytes or numbers that are ignored before the cells."""
MOST_BANNER_LINES: Final = 1000
LARGEST_BAUD: Final = 100_000_000
LONGEST_TIMEOUT_S: Final = 3600.0
MOST_START_FRAMES: Final = 10_000
HEXADECIMAL: Final = "[0-9A-Fa-f]{2}( ?[0-9A-Fa-f]{2}){0,63}"
"""The pattern of a marker, tail or question: two digits a byte, blanks allowed."""
PREFIX: Final = r"[!-*/:<-~][!-+\--:<-~]{0,31}"
"""The pattern of a prefix: a word of ASCII that no number begins like."""

Checksum = Literal["none", "sum8", "xor8", "crc16"]
Order = Literal["rows", "columns"]
Pressure = Literal["rises", "falls"]
ByteOrder = Literal["little", "big"]


class Marker(Value, frozen=True, tag="marker"):
    """A marker, then a fixed number of bytes.

    The marker can occur among the cells, so a beginning is believed only where the
    next frame begins with it too, or a checksum or tail confirms it.

    Attributes:
        marker: The bytes at the beginning, in hexadecimal, such as `AA 55`.
        bits: 8 or 16 for each cell.
        byte_order: Of 16 bits.
        sizes: Whether two numbers of 16 bits, rows and columns, in the same byte
            order, follow the marker.
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
        zero: The value before a run of zeros; the next byte is its length, from 1.
            No cell has this value, unless it is 0.
    """

    end: int = 255
    zero: int = 0


class Request(Value, frozen=True, tag="request"):
    """The host sends a request, the board responds with a fixed number of bytes.

    Attributes:
        ask: The bytes that the host sends for each frame, in hexadecimal.
        bits: 8 or 16 for each cell.
        byte_order: Of 16 bits.
        skip: Bytes before the cells that are ignored (time stamps).
        checksum: As in `Marker`.
        timeout_s: Seconds before the host repeats a request without a response.
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
            empty line or a title between frames. With the order `columns` a line
            of a block is a column.
        separator: Between numbers: `space` (any spaces and tabs), `comma` or
            `semicolon`.
        prefix: The first word of a line that holds cells, such as `F`; other lines
            are banners. Empty if there is none.
        skip: Numbers before the cells of each line that are ignored (time stamps).
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

    @property
    def bits_of_a_byte(self) -> int:
        """How many bits are on the line for each byte.

        Example:
            >>> Port().bits_of_a_byte
            10
        """
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits


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
        pressure: Whether a cell reads more or less when it is pressed. If less, a
            frame holds `full` minus what the board sends, and a board that sends
            more than `full` sent a damaged frame.
        port: How the serial port is set.
        start: What is measured at the beginning.
        banner: Lines of text at the beginning, ended by a line feed, that are no
            frames.

    Raises:
        InvalidModelError: If the parts contradict each other; it lists everything.
    """

    name: str
    sensor: Sensor
    protocol: Protocol
    order: Order = "rows"
    pressure: Pressure = "rises"
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
    if len(board.name) > LONGEST_NAME:
        yield ("name",), f"a name has at most {LONGEST_NAME} characters"
    if board.name != board.name.encode("utf-8", "ignore").decode():
        text = f"the name {board.name[:40]!r} cannot be written as UTF-8"
        yield ("name",), text
    if not 0 <= board.banner <= MOST_BANNER_LINES:
        text = f"a banner has 0 to {MOST_BANNER_LINES} lines, not {board.banner}"
        yield ("banner",), text
    for field, text in _protocol_mistakes(board):
        yield ("protocol", *field), text
    port, start = board.port, board.start
    if not 1 <= port.baud <= LARGEST_BAUD:
        text = f"baud lies in 1 to {LARGEST_BAUD}, not {port.baud}"
        yield ("port", "baud"), text
    if port.data_bits == 7 and not isinstance(board.protocol, Text):
        text = "with 7 data bits only text comes through, no bytes above 127"
        yield ("port", "data_bits"), text
    if not 0 <= start.frames <= MOST_START_FRAMES:
        text = f"a baseline is made of 0 to {MOST_START_FRAMES} frames"
        yield ("start", "frames"), f"{text}, not {start.frames}"
    if not 0 <= start.hot <= 1:
        yield ("start", "hot"), f"hot is a share, in 0 to 1, not {start.hot!r}"


def _protocol_mistakes(board: Board) -> Iterator[Mistake]:
    protocol, full = board.protocol, board.sensor.full
    match protocol:
        case Marker():
            yield from _hexadecimal_mistakes("marker", protocol.marker)
            if protocol.tail:
                yield from _hexadecimal_mistakes("tail", protocol.tail)
        case Sentinel():
            for field, value in (("end", protocol.end), ("zero", protocol.zero)):
                if not 0 <= value <= 255:
                    yield (field,), f"{field} is a byte, in 0 to 255, not {value}"
            if protocol.end == protocol.zero:
                text = f"{protocol.end} cannot both end a frame and begin a run"
                yield ("zero",), text
        case Request():
            yield from _hexadecimal_mistakes("ask", protocol.ask)
            seconds = protocol.timeout_s
            if not (math.isfinite(seconds) and 0.001 <= seconds <= LONGEST_TIMEOUT_S):
                text = f"a time-out lies in 0.001 to {LONGEST_TIMEOUT_S:g} seconds"
                yield ("timeout_s",), f"{text}, not {seconds!r}"
        case Text():
            if protocol.prefix and not re.fullmatch(PREFIX, protocol.prefix):
                text = "a prefix is a word of 1 to 32 signs of ASCII, without , and ;"
                text = f"{text}, and begins with no digit, sign or point"
                yield ("prefix",), f"{text}; not {protocol.prefix[:40]!r}"
    if isinstance(protocol, Sentinel):
        if full > 255:
            yield (), f"a cell of one byte never reads the sensor's full, {full}"
    elif not 0 <= protocol.skip <= MOST_SKIPPED:
        text = f"skip lies in 0 to {MOST_SKIPPED}, not {protocol.skip}"
        yield ("skip",), text
    if isinstance(protocol, Marker | Request) and protocol.bits == 8 and full > 255:
        text = f"a cell of 8 bits never reads the sensor's full, {full}"
        yield ("bits",), text


def _hexadecimal_mistakes(field: str, text: str) -> Iterator[Mistake]:
    if not re.fullmatch(HEXADECIMAL, text):
        what = f"1 to {MOST_BYTES} bytes in hexadecimal, such as 'AA 55'"
        yield (field,), f"{field} is {what}, not {text[:40]!r}"
