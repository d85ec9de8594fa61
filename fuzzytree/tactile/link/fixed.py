"""Frames of a fixed number of bytes: layout, checks, and frames on request."""

from __future__ import annotations

import functools
from typing import Final, assert_never

import msgspec
import numpy as np
import numpy.typing as npt

from fuzzytree.tactile.boards import Board, Checksum, Marker, Request
from fuzzytree.tactile.link.decoder import Decoder, banner_bytes, largest_cell
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
    def size(self) -> int:
        """The bytes of a frame."""
        check = _CHECKSUM_BYTES[self.checksum]
        return self.cells_from + self.cell_bytes + check + len(self.tail)

    @property
    def cells_from(self) -> int:
        """Where the cells begin."""
        return len(self.head) + self.skip

    @property
    def proof_bytes(self) -> int:
        """Number of bytes at the end that prove a whole frame."""
        return _CHECKSUM_BYTES[self.checksum] + len(self.tail)


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
    head, checked_from, tail = b"", 0, b""
    if isinstance(protocol, Marker):
        head = bytes.fromhex(protocol.marker)
        checked_from = len(head)
        if protocol.sizes:
            sizes = np.array([sensor.rows, sensor.columns], f"{sign}u2")
            head += sizes.tobytes()
        tail = bytes.fromhex(protocol.tail)
    return Layout(
        head=head,
        skip=protocol.skip,
        cell_bytes=sensor.rows * sensor.columns * protocol.bits // 8,
        dtype="u1" if protocol.bits == 8 else f"{sign}u2",
        checksum=protocol.checksum,
        checked_from=checked_from,
        tail=tail,
        largest=largest_cell(board),
    )


def blocks_of(layout: Layout, data: bytearray, count: int) -> Blocks:
    """Return the first frames' bytes, a copy of shape (count, size)."""
    copy = bytes(data[: count * layout.size])
    return np.frombuffer(copy, np.uint8).reshape(count, layout.size)


def cells_of(layout: Layout, blocks: Blocks) -> Cells:
    """Return the cells of frames in the order of the board: (frames, cells)."""
    inner = blocks[:, layout.cells_from : layout.cells_from + layout.cell_bytes]
    return np.ascontiguousarray(inner).view(layout.dtype)


def are_whole(layout: Layout, blocks: Blocks) -> Truths:
    """Return which frames have their head, tail, checksum and possible cells."""
    head = np.frombuffer(layout.head, np.uint8)
    good: Truths = (blocks[:, : len(head)] == head).all(axis=1)
    if layout.tail:
        tail = np.frombuffer(layout.tail, np.uint8)
        good &= (blocks[:, -len(tail) :] == tail).all(axis=1)
    if layout.largest < (255 if layout.dtype == "u1" else 65535):
        good &= (cells_of(layout, blocks) <= layout.largest).all(axis=1)
    end = layout.cells_from + layout.cell_bytes
    checked = blocks[:, layout.checked_from : end]
    match layout.checksum:
        case "none":
            pass
        case "sum8":
            good &= checked.sum(axis=1, dtype=np.uint8) == blocks[:, end]
        case "xor8":
            good &= np.bitwise_xor.reduce(checked, axis=1) == blocks[:, end]
        case "crc16":
            given = np.ascontiguousarray(blocks[:, end : end + 2]).view("<u2")[:, 0]
            good &= crc16(checked) == given
        case _:
            assert_never(layout.checksum)
    return good


def are_whole_at(
    layout: Layout, data: npt.NDArray[np.uint8], places: npt.NDArray[np.int64]
) -> Truths:
    """Return at which places a whole frame stands, with the result of `are_whole`.

    The time grows with the bytes plus the places, not with their product: what a
    frame sums up to is the difference of two running totals.

    Args:
        layout: How a frame lies in its bytes.
        data: Bytes of shape (bytes,), in which a frame's length fits at each place.
        places: Where heads stand, of shape (places,); heads are not looked at again.
    """
    good: Truths = np.ones(len(places), np.bool_)
    begin = places + layout.cells_from
    end = begin + layout.cell_bytes
    tail_from = places + (layout.size - len(layout.tail))
    for place, byte in enumerate(layout.tail):
        good &= data[tail_from + place] == byte
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


def crc16(rows: Blocks) -> npt.NDArray[np.uint16]:
    """Return the CRC-16 of Modbus of each row.

    The polynomial is 0x8005, reflected, and the start 0xFFFF. A CRC is linear over
    GF(2): that of a row is the XOR of what each half of each byte gives by itself at
    its place, and of what the start gives.

    Example:
        >>> message = np.frombuffer(b"123456789", np.uint8)
        >>> hex(crc16(message[np.newaxis])[0])
        '0x4b37'
    """
    start, table = _crc_table(rows.shape[1])
    places = np.arange(rows.shape[1]) * 32
    low = table.take(places + (rows & 15))
    high = table.take(places + 16 + (rows >> 4))
    found: npt.NDArray[np.uint16] = np.bitwise_xor.reduce(low ^ high, axis=1) ^ start
    return found


def _crc_parts(data: Blocks, at: npt.ArrayLike) -> npt.NDArray[np.uint16]:
    """Return what bytes at places give to a CRC that a number of zeros ends."""
    _, table = _crc_table(_CRC_PERIOD)
    places = np.asarray(at) % _CRC_PERIOD * 32
    low, high = table.take(places + (data & 15)), table.take(places + 16 + (data >> 4))
    found: npt.NDArray[np.uint16] = low ^ high
    return found


@functools.lru_cache(maxsize=8)
def _crc_table(length: int) -> tuple[np.uint16, npt.NDArray[np.uint16]]:
    """Return what 0xFFFF at the start gives, and half bytes (0-15) at each place."""
    bits = np.arange(256)
    for _ in range(8):
        bits = (bits >> 1) ^ (bits & 1) * 0xA001
    low, high = bits.astype(np.uint16), np.arange(256, dtype=np.uint16)
    rows = low[np.newaxis, [*range(16), *range(0, 256, 16)]]
    start, zeros = np.uint16(0xFFFF), 1
    while zeros <= length:  # behind a value, which `low` and `high` give half by half
        if length & zeros:
            start = low[start & 255] ^ high[start >> 8]
        if len(rows) < length:
            rows = np.concatenate([low[rows & 255] ^ high[rows >> 8], rows])
        low, high = (low[half & 255] ^ high[half >> 8] for half in (low, high))
        zeros *= 2
    return start, rows[len(rows) - length :].ravel()


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
        self._banner = board.banner
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
            taken, self._banner = banner_bytes(bytes(self._buffer), self._banner)
            self._skip(taken)
            if self._banner:
                return []
        count = len(self._buffer) // self._layout.size
        blocks = blocks_of(self._layout, self._buffer, count)
        good = are_whole(self._layout, blocks)
        whole = int(good.sum())
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
