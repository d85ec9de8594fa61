"""Frames of a fixed number of bytes: layout, checks, and frames on request."""

from __future__ import annotations

import functools
from typing import Final, assert_never

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.tactile.boards import Board, Checksum, Marker, Request
from fuzzytree.tactile.link.decoder import Decoder, largest_cell
from fuzzytree.tactile.sensor import Cells

Blocks = npt.NDArray[np.uint8]
"""Bytes of shape (frames, bytes of a frame)."""
Truths = npt.NDArray[np.bool_]

_CHECKSUM_BYTES: Final = {"none": 0, "sum8": 1, "xor8": 1, "crc16": 2}
_CRC_PERIOD: Final = 32767  # bytes of zeros that change no CRC-16: x has that order


class Layout(msgspec.Struct, frozen=True):
    """How a frame of fixed length lies in its bytes.

    Attributes:
        head: The bytes that every frame begins with: marker and sizes.
        skip: Bytes behind the head that are ignored.
        cell_bytes: Of all cells.
        dtype: Of a cell.
        checksum: Of everything between marker and checksum.
        checked_from: Where that begins.
        tail: The bytes that every frame ends with.
        largest: The most that a cell can hold.
    """

    head: bytes
    skip: int
    cell_bytes: int
    dtype: str
    checksum: Checksum
    checked_from: int
    tail: bytes
    largest: int

    @property
    def cells_from(self) -> int:
        """Where the cells begin."""
        return len(self.head) + self.skip

    @property
    def proof_bytes(self) -> int:
        """Number of bytes at the end that prove a whole frame."""
        return _CHECKSUM_BYTES[self.checksum] + len(self.tail)

    @property
    def size(self) -> int:
        """The bytes of a frame."""
        return self.cells_from + self.cell_bytes + self.proof_bytes


def layout_of(board: Board, protocol: Marker | Request) -> Layout:
    """Return how the frames of a board lie in their bytes.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> protocol = Marker("AA 55", bits=16, checksum="crc16")
        >>> board = Board("mat", Sensor(16, 16, full=1023), protocol)
        >>> layout_of(board, protocol).size
        516
    """
    sign = "<" if protocol.byte_order == "little" else ">"
    sensor = board.sensor
    marker = bytes.fromhex(getattr(protocol, "marker", ""))
    sizes = b""
    if getattr(protocol, "sizes", "none") != "none":
        sizes = np.array([sensor.rows, sensor.columns], f"{sign}u2").tobytes()
    return Layout(
        head=marker + sizes,
        skip=protocol.skip,
        cell_bytes=sensor.rows * sensor.columns * protocol.bits // 8,
        dtype="u1" if protocol.bits == 8 else f"{sign}u2",
        checksum=protocol.checksum,
        checked_from=len(marker),
        tail=bytes.fromhex(getattr(protocol, "tail", "")),
        largest=largest_cell(board),
    )


def cells_of(layout: Layout, blocks: Blocks) -> Cells:
    """Return the cells of frames in the order of the board: (frames, cells)."""
    inner = blocks[:, layout.cells_from : layout.cells_from + layout.cell_bytes]
    return np.ascontiguousarray(inner).view(layout.dtype)


def whole_blocks(layout: Layout, content: bytes) -> tuple[Blocks, Truths]:
    """Return the frames of some bytes, (frames, size), and which of them are whole."""
    count = len(content) // layout.size
    data = np.frombuffer(content, np.uint8, count * layout.size)
    good = are_whole(layout, data, np.arange(count) * layout.size)
    return data.reshape(count, layout.size), good


def are_whole(layout: Layout, data: Blocks, places: npt.NDArray[np.int64]) -> Truths:
    """Return at which places a frame has its head, tail, checksum and possible cells.

    The time grows with the bytes plus the places, not with their product: what a
    frame sums up to is the difference of two running totals.

    Args:
        layout: How a frame lies in its bytes.
        data: Bytes of shape (bytes,), in which a frame's length fits at each place.
        places: Where frames may begin, of shape (places,).
    """
    good: Truths = np.ones(len(places), np.bool_)
    begin = places + layout.cells_from
    end = begin + layout.cell_bytes
    tail_from = layout.size - len(layout.tail)
    for part, start in ((layout.head, 0), (layout.tail, tail_from)):
        for place, byte in enumerate(part, start):
            good &= data[places + place] == byte
    if layout.largest < (255 if layout.dtype == "u1" else 65535):
        large = _large_cells(layout, data)
        good &= large[end] == large[begin]
    begin = places + layout.checked_from
    match layout.checksum:
        case "none":
            pass
        case "sum8":
            sums = np.concatenate([[np.uint8(0)], data.cumsum(dtype=np.uint8)])
            good &= sums[end] - sums[begin] == data[end]
        case "xor8":
            parts = _running_xor(data)
            good &= parts[end] ^ parts[begin] == data[end]
        case "crc16":
            # With its CRC behind it, a message that begins with two bytes inverted
            # gives 0 from a start of 0; zeros behind it change nothing of that.
            parts = _running_xor(_crc_parts(data, np.arange(len(data))))
            ones = np.full((2, len(places)), 255, np.uint8)
            start = np.bitwise_xor.reduce(_crc_parts(ones, [begin, begin + 1]))
            good &= parts[end + 2] ^ parts[begin] ^ start == 0
        case _:
            assert_never(layout.checksum)
    return good


def _crc_parts(data: Blocks, at: npt.ArrayLike) -> npt.NDArray[np.uint16]:
    """Return what bytes at places give to a CRC that a number of zeros ends.

    The CRC-16 is that of Modbus: the polynomial is 0x8005, reflected, and the start
    0xFFFF. A CRC is linear over GF(2): that of a message is the XOR of what each half
    of each byte gives by itself at its place, and of what the start gives.
    """
    table = _crc_table()
    places = np.asarray(at) % _CRC_PERIOD * 32
    low, high = table.take(places + (data & 15)), table.take(places + 16 + (data >> 4))
    found: npt.NDArray[np.uint16] = low ^ high
    return found


@functools.cache
def _crc_table() -> npt.NDArray[np.uint16]:
    """Return what half bytes (0-15) at each place give, low and high one."""
    bits = np.arange(256)
    for _ in range(8):
        bits = (bits >> 1) ^ (bits & 1) * 0xA001
    low, high = bits.astype(np.uint16), np.arange(256, dtype=np.uint16)
    rows = low[np.newaxis, [*range(16), *range(0, 256, 16)]]
    while len(rows) < _CRC_PERIOD:  # behind them stand zeros: `low` and `high` halves
        rows = np.concatenate([low[rows & 255] ^ high[rows >> 8], rows])
        low, high = (low[half & 255] ^ high[half >> 8] for half in (low, high))
    return rows[len(rows) - _CRC_PERIOD :].ravel()


def _running_xor(
    values: npt.NDArray[np.unsignedinteger],
) -> npt.NDArray[np.unsignedinteger]:
    """Return the XOR of all values before each, and of all of them at the end."""
    before = np.zeros(len(values) + 1, values.dtype)
    np.bitwise_xor.accumulate(values, out=before[1:])
    return before


def _large_cells(layout: Layout, data: Blocks) -> npt.NDArray[np.int64]:
    """Return how many cells too large begin a whole number of cells before a place."""
    step = np.dtype(layout.dtype).itemsize
    counts = np.zeros(len(data) + 1, np.int64)
    for phase in range(step):
        count = (len(data) - phase) // step
        cells = data[phase : phase + count * step].view(layout.dtype)
        (cells > layout.largest).cumsum(out=counts[phase + step :: step][:count])
    return counts


class RequestDecoder(Decoder):
    """Cut answers out of the bytes."""

    def __init__(self, board: Board, protocol: Request) -> None:
        """Begin a stream, with the banner if there is one."""
        super().__init__(board)
        self.ask = bytes.fromhex(protocol.ask)
        self._layout = layout_of(board, protocol)
        self._is_given = False  # the last bytes were an answer, and it is not proven

    def requested(self) -> None:
        """Note that `ask` was sent: what came before is no part of the answer."""
        if not self._banner:
            # An answer that was too long: a byte of it may have been added.
            self.counters.doubtful += self._is_given and bool(self._buffer)
            self._is_given = False
            self._skip(len(self._buffer))

    def timed_out(self) -> None:
        """Note that an answer did not come whole in time.

        What came of it is damaged; a banner that did not come is awaited no longer.
        """
        self._banner = 0
        self._is_given = False
        self.counters.damaged += bool(self._buffer)
        self._skip(len(self._buffer))

    def _take(self) -> list[Cells]:
        if self._banner:
            self._pass_banner()
            if self._banner:
                return []
        blocks, good = whole_blocks(self._layout, bytes(self._buffer))
        count, whole = len(good), int(good.sum())
        if whole:
            self._is_given = self._layout.proof_bytes < 2
        self.counters.damaged += count - whole
        self.counters.skipped += (count - whole) * self._layout.size
        self.framed += whole * self._layout.size
        del self._buffer[: count * self._layout.size]
        return self._frames(cells_of(self._layout, blocks[good]))

    def _take_last(self) -> list[Cells]:
        self.counters.damaged += bool(self._buffer)
        self._banner = self._board.banner
        return []
