"""What can go wrong on a serial line, on request and by a seed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from msgspec.structs import fields, replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.model.rulebase import Mistake, Value
from fuzzytree.tactile.boards import Board, Marker
from fuzzytree.tactile.sensor import Cells
from fuzzytree.tactile.simulation.encoding import in_board_order, packed

EVERY = 100
"""After how many frames a stall or an unplugging comes, if it is not told."""

_NOISE = 16  # the most bytes of noise between two frames
_CHANCES = ("flip", "lose", "double", "noise", "marker")
_PAUSE = re.compile(r"([0-9.e+-]+)s?(?:/([0-9]{1,9}))?", re.ASCII)


class Pause(Value, frozen=True):
    """A silence.

    Attributes:
        seconds: How long it is.
        every: After how many frames it comes, again and again.
    """

    seconds: float
    every: int = EVERY


class Faults(Value, frozen=True):
    """What goes wrong, and how often.

    Attributes:
        flip: The chance of each byte that one of its bits is turned.
        lose: The chance of each byte that it never comes.
        double: The chance of each byte that it comes twice.
        noise: The chance before each frame of 1 to 16 random bytes.
        marker: The chance of each frame that its cells hold the marker.
        stall: The board is silent for a while.
        unplug: The board goes away, and comes back.
        baud: Bits a second at which the board sends; 0 for what it should be.

    Raises:
        InvalidModelError: If a chance is none; it lists everything.
    """

    flip: float = 0.0
    lose: float = 0.0
    double: float = 0.0
    noise: float = 0.0
    marker: float = 0.0
    stall: Pause | None = None
    unplug: Pause | None = None
    baud: int = 0

    def __post_init__(self) -> None:
        """Refuse chances that are none."""
        mistakes: list[Mistake] = []
        for name in _CHANCES:
            if not 0.0 <= getattr(self, name) <= 1.0:
                text = f"{name} is a chance in 0 to 1, not {getattr(self, name)!r}"
                mistakes.append(((name,), text))
        if not mistakes and self.flip + self.lose + self.double > 1.0:
            text = "the chances of flip, lose and double together are above 1"
            mistakes.append((("flip",), text))
        for name, pause in (("stall", self.stall), ("unplug", self.unplug)):
            if pause and not 0.0 < pause.seconds <= 86400.0:
                text = f"{name} takes 0 to 86400 seconds, not {pause.seconds!r}"
                mistakes.append(((name,), text))
            if pause and pause.every < 1:
                text = f"{name} comes every so many frames, not {pause.every}"
                mistakes.append(((name,), text))
        if self.baud < 0:
            mistakes.append((("baud",), f"a baud is above 0, not {self.baud}"))
        if mistakes:
            raise InvalidModelError(mistakes)


def faults_of(texts: Sequence[str]) -> Faults:
    """Return the faults that are written as `NAME=VALUE`.

    Args:
        texts: Such as `flip=1e-4` (a chance), `baud=9600`, `stall=2s` (every 100
            frames) or `unplug=3s/500` (every 500 frames).

    Raises:
        ValueError: If one is not of this form, or given twice.
        InvalidModelError: If a number is out of its range.

    Example:
        >>> faults_of(["flip=1e-4", "unplug=3s/500"]).unplug
        Pause(seconds=3.0, every=500)
    """
    names = [field.name for field in fields(Faults)]
    found: dict[str, float | int | Pause] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in names:
            raise ValueError(f"no fault {name!r}; there is {', '.join(names)}")
        if name in found:
            raise ValueError(f"the fault {name!r} is given twice")
        found[name] = _value_of(name, value)
    return replace(Faults(), **found)


def _value_of(name: str, text: str) -> float | int | Pause:
    try:
        if name in _CHANCES:
            value = float(text)
            return value if math.isfinite(value) else -1.0
        if name == "baud":
            return int(text)
        parts = _PAUSE.fullmatch(text)
        if parts is None:
            raise ValueError
        return Pause(float(parts[1]), int(parts[2] or EVERY))
    except ValueError:
        right = {"baud": "a whole number"}.get(name, "seconds, such as 2s or 2s/500")
        right = "a chance, such as 1e-4" if name in _CHANCES else right
        raise ValueError(f"{name}={text}: must be {right}") from None


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


def damaged(data: bytes, faults: Faults, random: np.random.Generator) -> Damaged:
    """Return what comes of some bytes; each suffers one fault at the most.

    Example:
        >>> faults = Faults(double=1.0)
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


def noise(faults: Faults, random: np.random.Generator) -> bytes:
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
    sent = np.frombuffer(packed(values, protocol.bits, protocol.byte_order), np.uint8)
    places = random.permutation(max(len(sent) - len(marker) + 1, 0))
    for place in places[: 8 * size].tolist():
        changed = sent.copy()
        changed[place : place + len(marker)] = marker
        kind = np.dtype(f"u{size}").newbyteorder(protocol.byte_order)
        found = changed.view(kind).astype(np.int64)
        if int(found.max()) <= board.sensor.full:
            sensor = board.sensor
            if board.pressure == "falls":
                found = sensor.full - found
            if board.order == "rows":
                return found.reshape(sensor.rows, sensor.columns)
            return found.reshape(sensor.columns, sensor.rows).T
    raise ValueError(f"the cells of {board.name!r} can never hold {protocol.marker}")
