"""Faults of a serial connection for tests: damaged bytes, noise and wrong baud rates.

`FaultyDevice` is the board of `simulated_board.py` with these faults.
"""

from __future__ import annotations

import struct
import sys
import termios
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace
from simulated_board import (
    UNSET,
    BoardCounts,
    Device,
    Faults,
    Wire,
    bauds,
    empty,
    encoded,
    in_board_order,
)

from fuzzytree.errors import InvalidModelError
from fuzzytree.tactile.boards import Board, Marker, Port
from fuzzytree.tactile.sensor import Cells

_NOISE = 16  # the most bytes of noise between two frames
_CHANCES = ("flip", "lose", "double", "noise", "marker")
_OTHER = 0o10000  # Linux: a speed that has no name
_TCGETS2 = 0x802C542A  # Linux: how such a speed is read


class ConnectionFaults(Faults, frozen=True):
    """Faults of the connection, and how often they occur.

    Attributes:
        flip: Probability that one bit of a byte is inverted.
        lose: Probability that a byte is lost.
        double: Probability that a byte arrives twice.
        noise: Probability of 1 to 16 random bytes before a frame.
        marker: Probability that the cells of a frame contain the marker.
        baud: Baud rate of the sender; 0 for that of the board.

    Raises:
        InvalidModelError: If a probability is out of range.
    """

    flip: float = 0.0
    lose: float = 0.0
    double: float = 0.0
    noise: float = 0.0
    marker: float = 0.0
    baud: int = 0

    def __post_init__(self) -> None:
        """Refuse probabilities that are out of range."""
        total = self.flip + self.lose + self.double
        if not all(0.0 <= getattr(self, name) <= 1.0 for name in _CHANCES):
            raise InvalidModelError([((), "a probability lies in 0 to 1")])
        if total > 1.0 or self.baud < 0:
            text = "flip, lose and double sum up to at most 1, and a baud is above 0"
            raise InvalidModelError([((), text)])


class Damaged(NamedTuple):
    """Bytes after the faults of the line.

    Attributes:
        data: What comes.
        touched: Of what was sent: the places of the bytes that were turned, lost or
            doubled.
        flipped: How many were turned.
        lost: How many never come.
        doubled: How many come twice.
    """

    data: bytes
    touched: npt.NDArray[np.int64]
    flipped: int
    lost: int
    doubled: int


def damaged(
    data: bytes, faults: ConnectionFaults, random: np.random.Generator
) -> Damaged:
    """Return what comes of some bytes; each suffers one fault at the most.

    Example:
        >>> faults = ConnectionFaults(double=1.0)
        >>> damaged(b"abc", faults, np.random.default_rng(0)).data
        b'aabbcc'
    """
    first, second = faults.flip, faults.flip + faults.lose
    third = second + faults.double
    if not third:
        return Damaged(data, np.empty(0, np.int64), 0, 0, 0)
    dice = random.random(len(data))
    touched = np.flatnonzero(dice < third)
    if not len(touched):
        return Damaged(data, touched, 0, 0, 0)
    hit = dice[touched]
    flips = touched[hit < first]
    losses = touched[(hit >= first) & (hit < second)]
    doubles = touched[hit >= second]
    values = np.frombuffer(data, np.uint8).copy()
    values[flips] ^= (1 << random.integers(0, 8, len(flips))).astype(np.uint8)
    times = np.ones(len(data), np.int64)
    times[losses] = 0
    times[doubles] = 2
    after = np.repeat(values, times).tobytes()
    return Damaged(after, touched, len(flips), len(losses), len(doubles))


def noise(faults: ConnectionFaults, random: np.random.Generator) -> bytes:
    """Return the bytes that come before a frame and belong to none; mostly none."""
    if not faults.noise or random.random() >= faults.noise:
        return b""
    return random.bytes(int(random.integers(1, _NOISE + 1)))


def with_marker(board: Board, cells: Cells, random: np.random.Generator) -> Cells:
    """Return a frame whose cells, as they are sent, hold the marker somewhere.

    Args:
        board: The board.
        cells: Shape (rows, columns).
        random: Chooses the place.

    Raises:
        ValueError: If the cells of this board can never hold its marker.
    """
    protocol = board.protocol
    if not isinstance(protocol, Marker):
        raise ValueError(
            f"the board {board.name!r} has no marker that cells could hold"
        )
    marker = np.frombuffer(bytes.fromhex(protocol.marker), np.uint8)
    size = protocol.bits // 8
    values = in_board_order(board, cells)
    kind = np.dtype(f"u{size}").newbyteorder(protocol.byte_order)
    sent = np.frombuffer(values.astype(kind).tobytes(), np.uint8)
    places = random.permutation(max(len(sent) - len(marker) + 1, 0))
    for place in places[: 8 * size].tolist():
        changed = sent.copy()
        changed[place : place + len(marker)] = marker
        found = changed.view(kind).astype(np.int64)
        if int(found.max()) <= board.sensor.full:
            sensor = board.sensor
            if board.pressure == "falls":
                found = sensor.full - found
            if board.order == "rows":
                return found.reshape(sensor.rows, sensor.columns)
            return found.reshape(sensor.columns, sensor.rows).T
    raise ValueError(f"the cells of {board.name!r} can never hold {protocol.marker}")


class Receiver:
    """Samples what a sender puts on the line, at a rate of its own.

    Attributes:
        framing_errors: How many bytes had a stop bit of 0.
        parity_errors: How many bytes had the wrong parity.

    Example:
        >>> Receiver(Port(baud=9600), 9600).heard(b"same")
        b'same'
        >>> twice = Receiver(Port(baud=9600), 19200)
        >>> (twice.heard(b"A") + twice.idle()).hex(" "), twice.framing_errors
        ('06 fe', 1)
    """

    def __init__(self, port: Port, baud: int) -> None:
        self.framing_errors = 0
        self.parity_errors = 0
        self._port = port
        self._baud = baud
        self._line = np.ones(1, np.int64)  # one number for each bit of the sender
        self._place = 0  # a fall is looked for behind this bit

    def heard(self, data: bytes) -> bytes:
        """Return the bytes that end within what is now on the line."""
        self._line = np.concatenate([self._line, _levels(self._port, data)])
        return self._sampled()

    def idle(self) -> bytes:
        """Return what still comes when the line then rests at 1."""
        ticks = self._port.bits_of_a_byte * self._port.baud // self._baud + 2
        self._line = np.concatenate([self._line, np.ones(ticks, np.int64)])
        return self._sampled()

    def _sampled(self) -> bytes:
        """Take every byte whose last bit can be seen."""
        line, port = self._line, self._port
        falls = (np.flatnonzero((line[:-1] == 1) & (line[1:] == 0)) + 1).tolist()
        # A bit of the sender takes `baud` of the receiver's ticks, and one of the
        # receiver's takes the sender's: whole numbers, so that nothing drifts.
        wide, own = 2 * self._baud, port.baud
        count = 1 + port.data_bits + (port.parity != "none") + 1
        middles = (2 * np.arange(count) + 1) * own
        found = bytearray()
        place = self._place
        while (at := bisect_right(falls, place)) < len(falls):
            samples = (falls[at] * wide + middles) // wide
            if samples[-1] >= len(line):
                break
            bits = line[samples]
            if bits[0]:  # too short for a start bit
                place = int(samples[0])
                continue
            found.append(self._byte(bits))
            place = int(samples[-1])
        else:
            place = max(place, len(line) - 1)
        keep = max(min(place, len(line) - 1), 0)
        self._line, self._place = line[keep:], place - keep
        return bytes(found)

    def _byte(self, bits: npt.NDArray[np.int64]) -> int:
        port = self._port
        data = bits[1 : 1 + port.data_bits]
        self.framing_errors += not bits[-1]
        if port.parity != "none":
            is_odd = bool((data.sum() + bits[1 + port.data_bits]) % 2)
            self.parity_errors += is_odd != (port.parity == "odd")
        return int(data @ (1 << np.arange(port.data_bits)))


def _levels(port: Port, data: bytes) -> npt.NDArray[np.int64]:
    """Return the line for some bytes, a 0 or 1 for each bit, without a pause."""
    values = np.frombuffer(data, np.uint8).astype(np.int64)
    bits = (values[:, np.newaxis] >> np.arange(port.data_bits)) & 1
    count = len(values)
    parts = [np.zeros((count, 1), np.int64), bits]
    if port.parity != "none":
        odd = bits.sum(axis=1, keepdims=True) % 2
        parts.append(odd if port.parity == "even" else 1 - odd)
    parts.append(np.ones((count, port.stop_bits), np.int64))
    return np.concatenate(parts, axis=1).ravel()


@dataclass(slots=True)
class FaultyCounts(BoardCounts):
    """What the device did, with the damage of the connection.

    Attributes:
        flipped: Bytes of which a bit was inverted.
        lost: Bytes that were left out.
        doubled: Bytes that were sent twice.
        noise: Bytes between frames that belong to no frame.
        markers: Frames whose cells contained the marker on purpose.
        garbled: Bytes sent at a baud rate that the host had not set.
        framing_errors: Bytes received by the host with a wrong stop bit.
    """

    flipped: int = 0
    lost: int = 0
    doubled: int = 0
    noise: int = 0
    markers: int = 0
    garbled: int = 0
    framing_errors: int = 0


class GarblingWire(Wire):
    """A connection whose bytes are sampled at the baud rate that the host has set."""

    garbled = framing_errors = 0
    _receiver: tuple[int, Receiver] | None = None

    def _write(self, data: bytes) -> bool:
        assert self._master is not None
        speed = _speed_of(self._master)
        if speed in (self._port.baud, UNSET):
            self._receiver = None
            return super()._write(data)
        if self._receiver is None or self._receiver[0] != speed:
            self._receiver = speed, Receiver(self._port, speed)
        self.garbled += len(data)
        receiver = self._receiver[1]
        before = receiver.framing_errors
        found = receiver.heard(data)
        self.framing_errors += receiver.framing_errors - before
        return super()._write(found)


def _speed_of(terminal: int) -> int:
    """Return the baud rate that the host has set."""
    speed = termios.tcgetattr(terminal)[5]
    for baud, constant in bauds().items():
        if constant == speed:
            return baud
    if speed != _OTHER or sys.platform != "linux":
        return UNSET
    import fcntl

    answer = fcntl.ioctl(terminal, _TCGETS2, bytes(44))
    (baud,) = struct.unpack("=I", answer[40:44])
    return int(baud)


class FaultyDevice(Device):
    """A simulated board whose connection damages bytes; see `Device`."""

    def __init__(
        self,
        board: Board,
        frames: Iterable[Cells],
        faults: ConnectionFaults | None = None,
        rate: float | None = 1.0,
        *,
        seed: int = 0,
    ) -> None:
        self._connection = faults or ConnectionFaults()
        self._random = np.random.default_rng(seed)
        if self._connection.marker:
            with_marker(board, empty(board), np.random.default_rng(0))
        super().__init__(board, frames, self._connection, rate)

    def _no_counts(self) -> FaultyCounts:
        return FaultyCounts()

    @property
    def counts(self) -> FaultyCounts:
        """What the device has done so far."""
        found, wire = super().counts, self._wire
        assert isinstance(found, FaultyCounts)
        assert isinstance(wire, GarblingWire)
        found.garbled, found.framing_errors = wire.garbled, wire.framing_errors
        return found

    def _wire_of(self, path: Path, rate: float | None) -> Wire:
        port = self._board.port
        port = replace(port, baud=self._connection.baud or port.baud)
        return GarblingWire(port, path, self._stop, rate=rate)

    def _encoded(self, cells: Cells) -> tuple[bytes, bool]:
        faults, random, counts = self._connection, self._random, self._counts
        assert isinstance(counts, FaultyCounts)
        if faults.marker and random.random() < faults.marker:
            cells = with_marker(self._board, cells, random)
            counts.markers += 1
        before = noise(faults, random)
        after = damaged(encoded(self._board, cells, counts.frames), faults, random)
        counts.noise += len(before)
        counts.flipped += after.flipped
        counts.lost += after.lost
        counts.doubled += after.doubled
        return before + after.data, len(after.touched) > 0
