"""A serial port as a stream of frames, with pauses, unplugging and slow readers.

The only module that imports pyserial.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import operator
import os
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, assert_never

import numpy as np

from fuzzytree.errors import MissingExtraError, PortError, install_hint
from fuzzytree.tactile.boards import Board, Marker, Request, Sentinel, Text
from fuzzytree.tactile.link.decoder import Decoder
from fuzzytree.tactile.link.fixed import RequestDecoder
from fuzzytree.tactile.link.markers import MarkerDecoder
from fuzzytree.tactile.link.sentinels import SentinelDecoder
from fuzzytree.tactile.link.starting import Started, measured
from fuzzytree.tactile.link.texts import TextDecoder
from fuzzytree.tactile.link.watching import PATIENCE_S, Watch
from fuzzytree.tactile.sensor import Cells, Counters, Frame, Sensor

if TYPE_CHECKING:
    from serial import Serial


__all__ = ["Decoder", "Started", "decoder_of"]


def decoder_of(board: Board, *, is_joined: bool = False) -> Decoder:
    """Return what finds the frames of a board in its bytes.

    A decoder is for one stream, without a clock. That of a board that sent before is
    joined: its first line of text, or its first bytes up to one that ends a frame, are
    skipped, for they may be cut. Where the banner comes, nothing else is skipped.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> decoder = decoder_of(Board("tiny", Sensor(1, 3), Sentinel()))
        >>> decoder.feed(bytes([7, 0])), decoder.feed(bytes([2, 255]))
        ([], [array([[7, 0, 0]], dtype=uint8)])
        >>> decoder.counters.bytes, decoder.counters.frames, decoder.framed
        (4, 1, 4)
    """
    protocol = board.protocol
    match protocol:
        case Marker():
            return MarkerDecoder(board, protocol)
        case Sentinel():
            return SentinelDecoder(board, protocol, is_joined=is_joined)
        case Request():
            return RequestDecoder(board, protocol)
        case Text():
            return TextDecoder(board, protocol, is_joined=is_joined)
        case _:
            assert_never(protocol)


State = Literal["open", "silent", "away", "ended"]
"""Frames come; none came for too long; the port went away; no more will come."""

MOST_WAITING: Final = 64
"""How many frames wait for a slow reader before the oldest are dropped."""
_WAITING_BYTES = 2**24  # of frames, while a disk is busy
_LOOK_S = 0.02  # how often the thread looks up while nothing comes
_MOST_AT_ONCE = 65536  # bytes
_PAUSES = (0.002, 0.02)  # seconds, before a port that fails is taken for gone
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.05, 1.0  # before a port is tried again


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port of this computer.

    Attributes:
        device: Its name, such as `/dev/ttyUSB0`.
        description: What the system says of it, or "".
        ids: Vendor, product and serial number of a USB device, or "".
    """

    device: str
    description: str
    ids: str


def ports() -> list[SerialPort]:
    """Return the serial ports that are there, by name.

    Raises:
        MissingExtraError: If pyserial is not installed.
    """
    try:
        from serial.tools import list_ports
    except ImportError as error:
        raise _missing() from error
    found: list[SerialPort] = []
    for port in list_ports.comports():
        texts = (port.description, port.hwid)
        known = ("" if text in (None, "n/a") else str(text) for text in texts)
        found.append(SerialPort(port.device, *known))
    return sorted(found, key=lambda port: port.device)


def open_connection(
    board: Board, port: str, *, wait: bool = True, most_waiting: int = MOST_WAITING
) -> Connection:
    """Open a serial port, and begin to read its frames.

    Args:
        board: What is connected to it.
        port: A device, such as `/dev/ttyUSB0` or `COM3`.
        wait: Whether to wait for a port that went away until it is back.
        most_waiting: How many frames wait for a slow reader before the oldest are
            dropped.

    Raises:
        PortError: If there is no such port, or it cannot be used.
        MissingExtraError: If pyserial is not installed.
        ValueError: If no frame may wait.
    """
    if most_waiting < 1:
        raise ValueError(f"at least 1 frame waits, not {most_waiting}")
    return Connection(
        board, port, opened(board, port), wait=wait, most_waiting=most_waiting
    )


def room(board: Board) -> int:
    """Return how many frames may wait for a disk that is busy."""
    size = board.sensor.rows * board.sensor.columns * board.sensor.bits // 8
    return min(max(_WAITING_BYTES // size, MOST_WAITING), 4096)


def start(board: Board, frames: Iterable[Frame]) -> Started:
    """Measure what a sensor reads at rest, from the first frames that come.

    The board says how many (`start.frames`); with 0 it stays as it is.

    Raises:
        PortError: If the line ended before.
    """
    count = board.start.frames
    if not count:
        return Started(board, [])
    found = [frame.cells for frame in itertools.islice(frames, count)]
    if len(found) < count:
        text = f"the baseline needs {count} frames, and only {len(found)} came"
        raise PortError(f"{board.name}: {text}")
    return measured(board, np.array(found))


class Connection(contextlib.AbstractContextManager["Connection"]):
    """The frames of a board, read in a thread of their own.

    Iterating waits for each frame and ends with the line. `take` waits no longer than
    `timeout_s`. A slow reader gets the newest frames: the oldest are dropped, counted,
    and missing in the frames' numbers.

    Attributes:
        board: What sends them.
        port: The device.
        state: Whether frames come.
        opened_at: When it was opened, by the monotonic clock; frames count from here.
    """

    def __init__(
        self, board: Board, port: str, serial: Serial, *, wait: bool, most_waiting: int
    ) -> None:
        self.board, self.port = board, port
        self.state: State = "open"
        self._serial: Serial = serial
        self._wait = wait
        self._stop = threading.Event()
        self._news = threading.Condition()
        self._waiting: deque[Frame] = deque()
        self._most_waiting = most_waiting
        self._error: BaseException | None = None
        self._contradiction = ""
        self._decoder = decoder_of(board, is_joined=True)
        self._before = Counters()  # what earlier decoders counted, and the line itself
        self._counted = Counters()
        self._number = 0
        self.opened_at = time.monotonic()
        self._watch = Watch(board, self.opened_at)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def counters(self) -> Counters:
        """What has been counted up to now: a copy."""
        with self._news:
            return Counters(*astuple(self._counted))

    @property
    def sensor(self) -> Sensor | None:
        """None: a line states nothing anew."""
        return None

    @property
    def trouble(self) -> str:
        """A sentence about a line that gives no frames; empty if frames come."""
        match self.state:
            case "open":
                return self._contradiction
            case "silent":
                return self._contradiction or "the board is silent"
            case "away":
                return f"{self.port} went away; waiting until it is back"
            case "ended":
                return f"{self.port} gives no more frames"

    def now(self) -> float:
        """Return the time since the line was opened, in seconds."""
        return time.monotonic() - self.opened_at

    def take(self, timeout_s: float | None = None) -> Frame | None:
        """Return the next frame, or None if none came in time, or none will come.

        Args:
            timeout_s: How long to wait; without end if None.

        Raises:
            PortError: If the port went away and is not waited for, and if bytes come
                that are no frames of the board, and no frame has come before; later
                that is a trouble.
        """
        with self._news:
            self._news.wait_for(
                lambda: self._waiting or self._error or self.state == "ended", timeout_s
            )
            if self._waiting:
                return self._waiting.popleft()
            if self._error is not None:
                error, self._error = self._error, None
                raise error
            return None

    def close(self) -> None:
        """Close the port. Frames that came before can still be taken."""
        self._stop.set()
        self._thread.join()

    def __iter__(self) -> Iterator[Frame]:
        """Give frames until the line ends."""
        while (frame := self.take()) is not None:
            yield frame

    def __exit__(self, *_: object) -> None:
        """Close the port."""
        self.close()

    def _run(self) -> None:
        """Read until `close`, whatever happens to the port."""
        try:
            while not self._stop.is_set():
                try:
                    self._listen()
                except OSError:  # pyserial's error is one
                    self._shut()
                    if not self._is_back():
                        return
        except BaseException as error:  # raised by `take`
            self._error = error
        finally:
            self._shut()
            with self._news:
                self.state = "ended"
                self._news.notify_all()

    def _shut(self) -> None:
        with contextlib.suppress(OSError):  # of a port that is away
            self._serial.close()

    def _listen(self) -> None:
        """Read and send requests until `close`, or until the port fails."""
        port, watch = self._serial, self._watch
        while not self._stop.is_set():
            now = time.monotonic()
            if watch.is_overdue(now):
                self._decoder.timed_out()
            if watch.is_due(now):
                port.write(self._decoder.ask)
                self._decoder.requested()
                watch.sent(time.monotonic())
            data = self._read()
            now = time.monotonic()
            if data:
                found = self._decoder.feed(data)
                watch.came(data, len(found), now)
                self._pass_on(found, now)
            self._look(now)

    def _read(self) -> bytes:
        """Return what has come, after a short wait if nothing has.

        A port that is busy is sometimes said to have bytes when it has none, which
        pyserial takes for a port that is gone: so it is read again before.
        """
        port = self._serial
        for pause in _PAUSES:
            try:
                return bytes(port.read(max(min(port.in_waiting, _MOST_AT_ONCE), 1)))
            except OSError:  # pyserial's error is one
                if self._stop.wait(pause):
                    return b""
        return bytes(port.read(1))

    def _pass_on(self, found: list[Cells], now: float) -> None:
        """Pass frames and counters on to the reader."""
        with self._news:
            for cells in found:
                if len(self._waiting) == self._most_waiting:
                    self._waiting.popleft()
                    self._before.dropped += 1
                self._waiting.append(Frame(cells, now - self.opened_at, self._number))
                self._number += 1
            if found:
                self.state, self._contradiction = "open", ""
            self._counted = _sum(self._before, self._decoder.counters)
            self._news.notify_all()

    def _look(self, now: float) -> None:
        """Notice silence, and bytes that are no frames."""
        if self._watch.is_silent(now):
            self.state = "silent"
            self._before.stalls += 1
            is_quiet = self._watch.is_quiet(now)
            self._pass_on(self._decoder.flush() if is_quiet else [], now)
        if text := self._watch.contradiction(now):
            if self._number:
                self._contradiction = f"{self.port}: {text}"
            else:
                self._fail(text)

    def _fail(self, text: str) -> None:
        with self._news:
            self._error = PortError(f"{self.port}: {text}")
            self._news.notify_all()

    def _is_back(self) -> bool:
        """Wait for the port and open it again; False if that is not wanted."""
        self._pass_on(self._decoder.flush(), time.monotonic())
        if not self._wait:
            self._fail(f"went away after {self._number} frames")
            return False
        self.state = "away"
        pause_s = _FIRST_PAUSE_S
        while not self._stop.wait(pause_s):
            pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
            try:
                self._serial = opened(self.board, self.port)
            except PortError:
                continue
            self._before = _sum(self._before, self._decoder.counters)
            self._before.reconnects += 1
            self._decoder = decoder_of(self.board, is_joined=True)
            self._watch = Watch(self.board, time.monotonic())
            self._pass_on([], time.monotonic())
            self.state = "open"
            return True
        return False


def opened(board: Board, port: str) -> Serial:
    """Return an open port, that no other program has.

    Raises:
        PortError: If that cannot be.
        MissingExtraError: If pyserial is not installed.
    """
    try:
        import serial
    except ImportError as error:
        raise _missing() from error
    if "://" in port:
        text = "a port is a device, such as /dev/ttyUSB0 or COM3, and no address"
        raise PortError(f"{port}: {text}")
    settings = board.port
    try:
        return serial.Serial(
            port,
            baudrate=settings.baud,
            bytesize=settings.data_bits,
            parity=settings.parity[0].upper(),
            stopbits=settings.stop_bits,
            timeout=_LOOK_S,
            write_timeout=PATIENCE_S,
            exclusive=True,
        )
    except (OSError, ValueError) as error:  # pyserial's error is an OSError
        raise PortError(_why(port, settings.baud, error)) from error


def _why(port: str, baud: int, error: OSError | ValueError) -> str:
    """Return why a port could not be opened, and what to do."""
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        names = ", ".join(found.device for found in ports()) or "none"
        return f"there is no port {port!r}; there is {names}"
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{port}: another program has it open"
    if number in (errno.EACCES, errno.EPERM):
        return f"{port}: you may not open it{_group_hint(port)}"
    is_other = Path(port).exists() and "Could not configure port" in str(error)
    if is_other or number == errno.EISDIR:
        return f"{port}: is not a serial port"
    if "baud" in str(error):
        return f"{port}: cannot be set to {baud} baud"
    return f"{port!r} cannot be opened: {error}"


def _group_hint(port: str) -> str:
    """Return which group may open a port."""
    try:
        import grp

        group = grp.getgrgid(Path(port).stat().st_gid).gr_name
    except (ImportError, KeyError, OSError):
        return ""
    command = f"sudo usermod -aG {group} {os.environ.get('USER', 'YOU')}"
    return f"; it belongs to the group {group!r}: `{command}`, then log in again"


def _sum(first: Counters, second: Counters) -> Counters:
    return Counters(*map(operator.add, astuple(first), astuple(second)))


def _missing() -> MissingExtraError:
    return MissingExtraError(f"reading a serial port needs {install_hint('serial')}")
