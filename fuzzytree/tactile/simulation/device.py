"""A board of our own behind a pseudo-terminal, with faults on request."""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from fuzzytree.tactile.boards import Board, Port, Request, Sentinel
from fuzzytree.tactile.sensor import Cells
from fuzzytree.tactile.simulation.encoding import banner, encoded
from fuzzytree.tactile.simulation.faults import Faults, damaged, noise, with_marker
from fuzzytree.tactile.simulation.wire import Wire

BOOT_S = 0.05
"""How long the device waits after a host has opened it, as boards do that reset."""

_LOOK_S = 0.01
_HEARD = 64  # bytes of the host's that are kept, as many as an Arduino keeps


@dataclass(slots=True)
class Truth:
    """What the device did, to compare with what a host counts.

    Attributes:
        frames: Frames that were begun.
        touched: Frames of which a byte was turned, lost or doubled, or that were cut.
        bytes: Bytes on the line: of frames, banners and noise.
        flipped: Bytes of which a bit was turned.
        lost: Bytes that were left out.
        doubled: Bytes that went out twice.
        noise: Bytes between frames that belong to none.
        markers: Frames whose cells held the marker on purpose.
        stalls: Silences.
        unplugs: How often the port went away.
        opens: How often a host opened the port.
        closes: How often it closed it again.
        asks: How often a host asked.
        overrun: Bytes for which there was no room, since the host did not read.
        garbled: Bytes that went out at a speed that the host had not set.
        framing_errors: Bytes that the host took of those whose stop bit was wrong.
    """

    frames: int = 0
    touched: int = 0
    bytes: int = 0
    flipped: int = 0
    lost: int = 0
    doubled: int = 0
    noise: int = 0
    markers: int = 0
    stalls: int = 0
    unplugs: int = 0
    opens: int = 0
    closes: int = 0
    asks: int = 0
    overrun: int = 0
    garbled: int = 0
    framing_errors: int = 0

    def facts(self) -> dict[str, int]:
        """Return the counts by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


class Device:
    """A board that sends frames through a port of its own, in a thread.

    It begins when a host opens the port, as boards do that reset then, and time stands
    still while none has it open. A request board answers when it is asked.

    Attributes:
        port: The name of the port, for the host; it stays when the plug is pulled.
        truth: What the device did.
        over: Set when the last frame has gone out.
    """

    def __init__(
        self,
        board: Board,
        frames: Iterable[Cells],
        faults: Faults | None = None,
        rate: float | None = 1.0,
        *,
        link: str | Path | None = None,
        seed: int = 0,
        first: Sequence[Cells] = (),
        frames_a_second: float = 0.0,
    ) -> None:
        """Open the port.

        Args:
            board: What it speaks.
            frames: Each of shape (rows, columns); taken as they are sent.
            faults: What goes wrong; nothing if None.
            rate: How many times as fast as the line of the board would be; None for
                as fast as the host reads.
            link: The name of the port; if None, one in a folder of its own.
            seed: Of all that is random.
            first: Frames that come first, each time that a host opens the port: with
                nothing on the sensor, so that it can measure its baseline.
            frames_a_second: At most, as fast as the board reads its cells; 0 for as
                many as the line carries.

        Raises:
            ValueError: If a fault is asked for that the board cannot have.
            WriteError: If the port cannot be made.
        """
        self._board, self._frames = board, iter(frames)
        self._faults = faults or Faults()
        self._random = np.random.default_rng(seed)
        self._first, self._coming = first, deque(first)
        self._ahead: Cells | None = None  # the next frame, so that the last is known
        self._frame_s = 1.0 / frames_a_second if frames_a_second else 0.0
        self._due = 0.0
        if self._faults.marker:
            with_marker(board, empty(board), np.random.default_rng(0))
        self._stop = threading.Event()
        self._folder = None if link else Path(tempfile.mkdtemp(prefix="fuzzytree-"))
        path = Path(link) if link else Path(self._folder or "") / "board"
        self._wire = Wire(_port(board, self._faults), path, self._stop, rate=rate)
        self._wire.plug_in()
        self._error: BaseException | None = None
        self._asked = b""
        self._truth = Truth()
        self.port = str(path)
        self.over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="device", daemon=True)
        self._thread.start()

    @property
    def truth(self) -> Truth:
        """What the device did until now."""
        for name in ("bytes", "overrun", "garbled", "framing_errors"):
            setattr(self._truth, name, getattr(self._wire, name))
        return self._truth

    @property
    def is_open(self) -> bool:
        """Whether a host has the port open."""
        return self._wire.is_open

    def __enter__(self) -> Device:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the port."""
        self.close()

    def close(self) -> None:
        """Take the port away.

        Raises:
            TableError: If the device ended, since a frame could not be sent.
        """
        self._stop.set()
        self._thread.join()
        self._wire.plug_out()
        if self._folder:
            shutil.rmtree(self._folder, ignore_errors=True)
        if self._error:
            error, self._error = self._error, None
            raise error

    def _run(self) -> None:
        try:
            self._ahead = next(self._frames, None)
            while not self._stop.is_set():
                gone_s = self._served()
                self._wire.plug_out()
                if not self._stop.wait(gone_s):
                    self._wire.plug_in()
        except BaseException as error:  # told by close, in the thread that asks
            self._error = error
            self.over.set()

    def _served(self) -> float:
        """Serve every host until the plug is pulled; return for how many seconds."""
        while not self._stop.wait(_LOOK_S):
            if not self._wire.is_open:
                continue
            self._stop.wait(BOOT_S)
            self._truth.opens += 1
            self._asked, self._coming = b"", deque(self._first)
            self._wire.rest()
            self._wire.send(banner(self._board))
            while self._wire.is_open and not self._stop.is_set():
                if not self._is_asked():
                    continue
                if not self._coming and self._ahead is None:
                    self.over.set()
                    self._stop.wait(_LOOK_S)
                    continue
                if gone_s := self._sent(self._next()):
                    return gone_s
                if not self._coming and self._ahead is None:
                    self.over.set()
            self._truth.closes += not self._wire.is_open
        return 0.0

    def _next(self) -> Cells:
        """Return the frame to send; there is one."""
        if self._coming or self._ahead is None:
            return self._coming.popleft()
        cells, self._ahead = self._ahead, next(self._frames, None)
        return cells

    def _is_asked(self) -> bool:
        """Whether to send a frame now; a board that speaks by itself always does."""
        protocol = self._board.protocol
        if not isinstance(protocol, Request):
            self._wire.heard(0.0)  # and nobody listens
            return True
        ask = bytes.fromhex(protocol.ask)
        if ask not in self._asked:
            self._asked = (self._asked + self._wire.heard())[-_HEARD:]
            self._wire.rest()
        _, found, rest = self._asked.partition(ask)
        if found:
            self._asked = rest
            self._truth.asks += 1
        return bool(found)

    def _sent(self, cells: Cells) -> float:
        """Send a frame; return for how long the plug is then pulled, in seconds."""
        truth, faults, random = self._truth, self._faults, self._random
        if self._frame_s:
            now = time.monotonic()
            self._due = max(self._due + self._frame_s, now)
            if self._stop.wait(self._due - now):
                return 0.0
            self._wire.rest()
        if faults.marker and random.random() < faults.marker:
            cells = with_marker(self._board, cells, random)
            truth.markers += 1
        before = noise(faults, random)
        after = damaged(encoded(self._board, cells, truth.frames), faults, random)
        truth.frames += 1
        truth.noise += len(before)
        truth.flipped += after.flipped
        truth.lost += after.lost
        truth.doubled += after.doubled
        data = before + after.data
        unplug, stall = faults.unplug, faults.stall
        if unplug and truth.frames % unplug.every == 0:
            self._wire.send(data[: len(data) // 2])
            truth.touched += 1
            truth.unplugs += 1
            return unplug.seconds
        is_whole = self._wire.send(data)
        truth.touched += len(after.touched) > 0 or not is_whole
        if stall and truth.frames % stall.every == 0:
            truth.stalls += 1
            self._stop.wait(stall.seconds)
            self._wire.rest()
        return 0.0


def _port(board: Board, faults: Faults) -> Port:
    """Return how the device sets its port."""
    return replace(board.port, baud=faults.baud or board.port.baud)


def bounds(board: Board) -> tuple[int, int]:
    """Return the least and the largest number that a cell can hold and send.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> bounds(Board("mat", Sensor(2, 2, full=255), Sentinel()))
        (0, 254)
    """
    protocol, full = board.protocol, board.sensor.full
    top = full
    if isinstance(protocol, Sentinel):
        named = [value for value in (protocol.end, protocol.zero) if value]
        top = min([full, *(value - 1 for value in named)])
    return (full - top, full) if board.pressure == "falls" else (0, top)


def empty(board: Board) -> Cells:
    """Return a frame with nothing on the sensor, of shape (rows, columns)."""
    shape = (board.sensor.rows, board.sensor.columns)
    return np.full(shape, bounds(board)[0], np.int64)


def blob(board: Board, seed: int = 0) -> Generator[Cells]:
    """Give frames without end: something round that wanders over the sensor.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> frame = next(blob(Board("mat", Sensor(4, 4), Request("41"))))
        >>> frame.shape, int(frame.max()) <= 255
        ((4, 4), True)
    """
    sensor, (low, high) = board.sensor, bounds(board)
    start = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, 2)
    rows, columns = np.mgrid[0 : sensor.rows, 0 : sensor.columns]
    size = max(min(sensor.rows, sensor.columns) / 6, 0.5)
    number = 0
    while True:
        turn = start + 2 * np.pi * number / np.array([97.0, 61.0])
        row, column = (0.5 + 0.3 * np.sin(turn)) * (sensor.rows, sensor.columns) - 0.5
        distance = np.hypot(rows - row, columns - column) / size
        share = np.clip(1.4 - 0.7 * distance, 0.0, 1.0)
        yield low + ((high - low) * share).astype(np.int64)
        number += 1


def fitted(board: Board, cells: Cells, full: int) -> Cells:
    """Return a frame of another sensor as the board could send it.

    Each cell is that of the other sensor which lies under its middle, and 0 to `full`
    becomes what the board can hold, rounded down.

    Args:
        board: The board.
        cells: Shape (rows, columns), in 0 to `full`.
        full: The most that a cell of the other sensor reads.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> board = Board("mat", Sensor(1, 4, full=100), Request("41"))
        >>> fitted(board, np.array([[0, 200]]), full=200).tolist()
        [[0, 0, 100, 100]]
    """
    sensor, (low, high) = board.sensor, bounds(board)
    rows, columns = (
        (2 * np.arange(wanted) + 1) * there // (2 * wanted)
        for wanted, there in zip(
            (sensor.rows, sensor.columns), cells.shape, strict=True
        )
    )
    taken = cells[np.ix_(rows, columns)].astype(np.int64)
    return low + np.clip(taken, 0, full) * (high - low) // full
