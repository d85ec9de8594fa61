"""A simulated board behind a pseudo-terminal, for trying hosts without hardware.

    python benchmarks/simulated_board.py mat.yaml --object all --link ./board
    python benchmarks/simulated_board.py --recording a.ftr

It prints its port and goes on until Ctrl-C, or until the recording ends. The port takes
the time of a serial connection. On request the board pauses (`stall`) or goes away and
comes back (`unplug`). What proves a frame (checksums, runs of zeros, lines) is written
from the description in `fuzzytree/tactile/boards.py` alone, so that a frame that goes
out here and comes in there is a test of both.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import select
import shutil
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import assert_never

import numpy as np
import numpy.typing as npt
from press import simulated
from press_physics import FULL
from press_shapes import OBJECTS

from fuzzytree.errors import FuzzyTreeError, TableError, WriteError
from fuzzytree.files import reason
from fuzzytree.model import Value
from fuzzytree.tactile.board_file import load_board
from fuzzytree.tactile.boards import (
    Board,
    Checksum,
    Marker,
    Port,
    Request,
    Sentinel,
    Text,
)
from fuzzytree.tactile.cli.signals import stop_signal
from fuzzytree.tactile.link.fixed import layout_of
from fuzzytree.tactile.presses import open_frames
from fuzzytree.tactile.recognition.frame_sources import Replayed
from fuzzytree.tactile.sensor import FRAMES_A_SECOND, Cells, check_frames

if sys.platform != "win32":
    import termios
    import tty

BOOT_S = 0.05
"""Pause after a host has opened the port, as of boards that reset then."""

UNSET = 50
"""Speed of a terminal whose own baud rate has no name."""

_SEPARATORS = {"space": " ", "comma": ",", "semicolon": ";"}
_NEWLINE = "\r\n"  # what println of an Arduino ends a line with
_POLL_S = 0.01
_WIRE_POLL_S = 0.02
_PIECE_S = 0.002  # duration of the bytes that are written at once
_SLACK_S = 0.02  # by how much a late piece may hurry the next ones
_INPUT_BYTES = 64  # size of the input buffer, as on an Arduino
_LOOK_S = 0.05
_LAST_S = 0.2  # for the host to take the last bytes


class Pause(Value, frozen=True):
    """A pause in the stream of frames.

    Attributes:
        seconds: Its duration.
        every: Number of frames between two pauses.
    """

    seconds: float
    every: int = 100


class Faults(Value, frozen=True):
    """What goes wrong with a simulated board.

    Attributes:
        stall: The board is silent for a while.
        unplug: The port goes away, and comes back.
    """

    stall: Pause | None = None
    unplug: Pause | None = None


@dataclass(slots=True)
class BoardCounts:
    """What a simulated board did, to compare with the counters of a host.

    Attributes:
        frames: Frames that were begun.
        touched: Frames that were cut off.
        bytes: Bytes that were sent, banners included.
        stalls: Pauses.
        unplugs: How often the port went away.
        opens: How often a host opened the port.
        closes: How often a host closed the port.
        asks: Requests of the host.
        overrun: Bytes that were lost because the host did not read in time.
    """

    frames: int = 0
    touched: int = 0
    bytes: int = 0
    stalls: int = 0
    unplugs: int = 0
    opens: int = 0
    closes: int = 0
    asks: int = 0
    overrun: int = 0


class Wire:
    """The board's end of a connection; the host's end is a pseudo-terminal.

    Attributes:
        bytes: Number of bytes sent.
        overrun: Bytes that were lost because the host did not read in time.
    """

    def __init__(
        self, port: Port, link: Path, stop: threading.Event, *, rate: float | None
    ) -> None:
        """Prepare a connection; it exists from `plug_in` on.

        Args:
            port: The settings of the board's port.
            link: Path of the host's end.
            stop: Ends every wait when it is set.
            rate: Factor on the speed of the connection; None for as fast as the host
                reads.
        """
        self.bytes = self.overrun = 0
        self._port, self._link, self._stop = port, link, stop
        self._byte_s = port.bits_of_a_byte / port.baud / rate if rate else 0.0
        self._master: int | None = None
        self._due = 0.0
        self._terminal = ""

    def plug_in(self) -> None:
        """Make the pseudo-terminal and its link.

        Raises:
            WriteError: If it cannot be made.
        """
        if self._link.exists():
            what = f"it leads to {self._link.resolve()}, which is there"
            if not self._link.is_symlink():
                what = "something else is there"
            raise WriteError(f"{self._link}: cannot be made a port: {what}")
        try:
            self._master, slave = os.openpty()
            os.set_blocking(self._master, False)
            tty.setraw(slave)
            settings = termios.tcgetattr(slave)
            settings[4:6] = [bauds().get(self._port.baud, bauds()[UNSET])] * 2
            termios.tcsetattr(slave, termios.TCSANOW, settings)
            self._terminal = os.ttyname(slave)
            new = self._link.with_name(f".{self._link.name}.{os.getpid()}")
            new.symlink_to(self._terminal)
            new.replace(self._link)
            os.close(slave)  # `is_open` then depends on the host alone
        except OSError as error:
            text = f"{self._link}: cannot be made a port: {reason(error)}"
            raise WriteError(text) from error

    def plug_out(self) -> None:
        """Remove the pseudo-terminal and its link, as pulling the plug does."""
        if self._master is not None:
            if self._link.is_symlink() and str(self._link.readlink()) == self._terminal:
                self._link.unlink()  # unless it was replaced
            os.close(self._master)
            self._master = None

    @property
    def is_open(self) -> bool:
        """Whether a host has the port open."""
        return self._master is not None and not self._poll(0) & select.POLLHUP

    def _poll(self, wait_s: float, wanted: int = select.POLLIN) -> int:
        """Wait for something to happen on the board's end; return what did."""
        assert self._master is not None
        poll = select.poll()
        poll.register(self._master, wanted)
        return next((event for _, event in poll.poll(1000 * wait_s)), 0)

    def rest(self) -> None:
        """Note that the connection was idle until now."""
        self._due = time.monotonic()

    def send(self, data: bytes) -> bool:
        """Send bytes in the time that they take; return False if no host reads."""
        size = max(int(_PIECE_S / self._byte_s), 1) if self._byte_s else len(data)
        for start in range(0, len(data), max(size, 1)):
            piece = data[start : start + size]
            self._due += len(piece) * self._byte_s
            now = time.monotonic()
            if self._due > now:
                self._stop.wait(self._due - now)
            self._due = max(self._due, now - _SLACK_S)
            self.bytes += len(piece)  # before a host can count them
            if self._stop.is_set() or not self._write(piece):
                self.bytes -= len(piece)
                return False
        return True

    def _write(self, data: bytes) -> bool:
        """Write bytes; without room they are lost, or wait if no time is kept."""
        assert self._master is not None
        wait_s = 0 if self._byte_s else _WIRE_POLL_S
        while data:
            event = self._poll(wait_s, select.POLLOUT)
            if self._stop.is_set() or event & select.POLLHUP:
                return False
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                if self._byte_s:
                    self.overrun += len(data)
                    return True
        return True

    def received(self, patience_s: float = _WIRE_POLL_S) -> bytes:
        """Return the bytes from the host, after waiting for some time at most."""
        assert self._master is not None
        if self._poll(patience_s) & select.POLLIN:
            with contextlib.suppress(OSError):  # closed by the host meanwhile
                return os.read(self._master, 4096)
        return b""


@cache
def bauds() -> dict[int, int]:
    """Return the constant of `termios` for each speed that has a name."""
    names = [name for name in dir(termios) if re.fullmatch(r"B[1-9][0-9]*", name)]
    return {int(name[1:]): getattr(termios, name) for name in names}


class Device(contextlib.AbstractContextManager["Device"]):
    """A board that sends frames through a port of its own, in a thread.

    It begins when a host opens the port, as boards do that reset then, and time stands
    still while no host has it open. A request board sends a frame for each request.

    Attributes:
        port: Path of the port for the host; it stays the same after `unplug`.
        over: Set after the last frame.
    """

    def __init__(
        self,
        board: Board,
        frames: Iterable[Cells],
        faults: Faults | None = None,
        rate: float | None = 1.0,
        *,
        link: str | Path | None = None,
        first: Sequence[Cells] = (),
        frames_a_second: float = 0.0,
    ) -> None:
        """Open the port.

        Args:
            board: Its protocol, sensor and port settings.
            frames: Each of shape (rows, columns); taken as they are sent.
            faults: What goes wrong; nothing if None.
            rate: Factor on the speed of the board's connection; None for as fast as
                the host reads.
            link: Path of the port; if None, one in a folder of its own.
            first: Frames that are sent first, each time that a host opens the port:
                with nothing on the sensor, so that the host can measure its baseline.
            frames_a_second: The most frames per second; 0 for no limit.

        Raises:
            WriteError: If the port cannot be created.
        """
        self._board, self._frames = board, iter(frames)
        self._faults = faults or Faults()
        self._first, self._coming = first, deque[Cells]()
        self._frame_s = 1.0 / frames_a_second if frames_a_second else 0.0
        self._due = 0.0
        self._stop = threading.Event()
        self._folder = None if link else Path(tempfile.mkdtemp(prefix="fuzzytree-"))
        path = Path(link) if link else Path(self._folder or "") / "board"
        self._wire = self._wire_of(path, rate)
        self._wire.plug_in()
        self._error: BaseException | None = None
        self._input = b""
        self._counts = self._no_counts()
        self.port = str(path)
        self.over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="device", daemon=True)
        self._thread.start()

    @property
    def counts(self) -> BoardCounts:
        """What the device has done so far."""
        self._counts.bytes, self._counts.overrun = self._wire.bytes, self._wire.overrun
        return self._counts

    @property
    def is_open(self) -> bool:
        """Whether a host has the port open."""
        return self._wire.is_open

    def __exit__(self, *_: object) -> None:
        """Close the port."""
        self.close()

    def close(self) -> None:
        """Remove the port.

        Raises:
            TableError: If the device ended because a frame could not be sent.
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
            while not self._stop.is_set():
                gone_s = self._served()
                self._wire.plug_out()
                if not self._stop.wait(gone_s):
                    self._wire.plug_in()
        except BaseException as error:  # raised by `close`
            self._error = error
            self.over.set()

    def _served(self) -> float:
        """Serve every host until an `unplug`; return its duration in seconds."""
        while not self._stop.wait(_POLL_S):
            self._look_ahead()
            if not self._wire.is_open:
                continue
            self._stop.wait(BOOT_S)
            self._counts.opens += 1
            self._input = b""
            self._coming.extendleft(reversed(self._first))
            self._wire.rest()
            self._wire.send(banner(self._board))
            while self._wire.is_open and not self._stop.is_set():
                if not self._look_ahead():
                    self._stop.wait(_POLL_S)
                elif self._is_due() and (gone_s := self._sent(self._coming.popleft())):
                    return gone_s
            self._counts.closes += not self._wire.is_open
        return 0.0

    def _look_ahead(self) -> bool:
        """Take the next frame, and return whether there is one."""
        if not self._coming:
            self._coming.extend(islice(self._frames, 1))
        if not self._coming:
            self.over.set()
        return bool(self._coming)

    def _is_due(self) -> bool:
        """Return whether to send a frame now; without requests always True."""
        protocol = self._board.protocol
        if not isinstance(protocol, Request):
            self._wire.received(0.0)  # and ignores it
            return True
        ask = bytes.fromhex(protocol.ask)
        if ask not in self._input:
            self._input = (self._input + self._wire.received())[-_INPUT_BYTES:]
            self._wire.rest()
        _, found, rest = self._input.partition(ask)
        if found:
            self._input = rest
            self._counts.asks += 1
        return bool(found)

    def _wire_of(self, path: Path, rate: float | None) -> Wire:
        return Wire(self._board.port, path, self._stop, rate=rate)

    def _no_counts(self) -> BoardCounts:
        return BoardCounts()

    def _encoded(self, cells: Cells) -> tuple[bytes, bool]:
        """Return the bytes of a frame, and whether any of them is damaged."""
        return encoded(self._board, cells, self._counts.frames), False

    def _sent(self, cells: Cells) -> float:
        """Send a frame; return the duration of the `unplug` that follows, or 0."""
        counts, faults = self._counts, self._faults
        if self._frame_s:
            now = time.monotonic()
            self._due = max(self._due + self._frame_s, now)
            if self._stop.wait(self._due - now):
                return 0.0
            self._wire.rest()
        data, is_damaged = self._encoded(cells)
        counts.frames += 1
        unplug, stall = faults.unplug, faults.stall
        if unplug and counts.frames % unplug.every == 0:
            self._wire.send(data[: len(data) // 2])
            counts.touched += 1
            counts.unplugs += 1
            return unplug.seconds
        is_whole = self._wire.send(data)
        counts.touched += is_damaged or not is_whole
        if stall and counts.frames % stall.every == 0:
            counts.stalls += 1
            self._stop.wait(stall.seconds)
            self._wire.rest()
        return 0.0


def bounds(board: Board) -> tuple[int, int]:
    """Return the smallest and the largest number that a cell can send.

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
    """Yield frames without end: a disc that wanders over the sensor.

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
    """Return a frame of another sensor, resampled to the board's cells and range.

    Each cell takes the nearest cell of the other sensor, and 0 to `full`, the most that
    such a cell reads, becomes the range of the board, rounded down.

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


def encoded(board: Board, cells: Cells, number: int = 0) -> bytes:
    """Return the bytes of one frame, from the first to the last.

    The number of the frame, from 0, stands where boards put a time stamp.

    Raises:
        TableError: If the cells are of another size, or hold what this board cannot
            send.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> protocol = Marker("AA 55", checksum="sum8")
        >>> board = Board("tiny", Sensor(1, 3), protocol)
        >>> encoded(board, np.array([[1, 0, 2]])).hex(" ")
        'aa 55 01 00 02 03'
    """
    values = in_board_order(board, cells)
    protocol = board.protocol
    match protocol:
        case Marker() | Request():
            layout = layout_of(board, protocol)
            stamp = _stamp(number, protocol.skip)
            front = layout.head + stamp + values.astype(layout.dtype).tobytes()
            check = checksum(protocol.checksum, front[layout.checked_from :])
            return front + check + layout.tail
        case Sentinel():
            return _with_runs(protocol, values)
        case Text():
            return _lines(board, protocol, values, number)
        case _:
            assert_never(protocol)


def banner(board: Board) -> bytes:
    r"""Return the lines that the board sends when it starts.

    Example:
        >>> from fuzzytree.tactile.sensor import Sensor
        >>> banner(Board("mat", Sensor(2, 2), Text(), banner=1))
        b'mat: ready\r\n'
    """
    name = "".join(sign for sign in board.name if " " <= sign <= "~") or "board"
    return f"{name}: ready{_NEWLINE}".encode() * board.banner


def in_board_order(board: Board, cells: Cells) -> npt.NDArray[np.int64]:
    """Return a frame's cells in the order in which the board sends them, checked.

    Raises:
        TableError: If there is not one frame, or a cell holds what cannot be sent.
    """
    frames = check_frames(board.sensor, cells)
    if len(frames) != 1:
        raise TableError(f"one frame is sent at a time, not {len(frames)}")
    frame = frames[0].T if board.order == "columns" else frames[0]
    values: npt.NDArray[np.int64] = frame.astype(np.int64).ravel()
    low, high = int(values.min()), int(values.max())
    if low < 0 or high > board.sensor.full:
        wrong = low if low < 0 else high
        raise TableError(f"a cell lies in 0 to {board.sensor.full}, not {wrong}")
    if board.pressure == "falls":
        values = board.sensor.full - values
        high = int(values.max())
    protocol = board.protocol
    if isinstance(protocol, Sentinel):
        for value in {protocol.end, protocol.zero} - {0}:
            if value in values:
                raise TableError(f"the board {board.name!r} has no cells of {value}")
    if not isinstance(protocol, Text):
        bits = 8 if isinstance(protocol, Sentinel) else protocol.bits
        if high >> bits:
            raise TableError(f"a cell of {high} does not fit into {bits} bits")
    return values


def checksum(kind: Checksum, body: bytes) -> bytes:
    """Return the checksum of some bytes: none, one or two bytes.

    `crc16` is that of Modbus (polynomial 0x8005 reflected, start 0xFFFF), low byte
    first.

    Example:
        >>> [checksum(k, b"123456789").hex() for k in ("sum8", "xor8", "crc16")]
        ['dd', '31', '374b']
    """
    match kind:
        case "none":
            return b""
        case "sum8":
            return bytes([sum(body) & 0xFF])
        case "xor8":
            return bytes([int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))])
        case "crc16":
            return _crc16(body).to_bytes(2, "little")
        case _:
            assert_never(kind)


def _crc16(body: bytes) -> int:
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return crc


def _stamp(number: int, size: int) -> bytes:
    return (number % (1 << 8 * size)).to_bytes(size, "little")


def _with_runs(protocol: Sentinel, values: npt.NDArray[np.int64]) -> bytes:
    """Return the cells with runs of zeros packed, and the byte that ends them."""
    sent = bytearray()
    run = 0
    for value in [*values.tolist(), None]:
        if value == 0:
            run += 1
            continue
        while run:
            length = min(run, 255)
            if length == protocol.end:  # would end the frame: two shorter runs
                length -= 1
            if length == 0:
                raise TableError(f"a run of {run} zeros would end the frame")
            sent += bytes((protocol.zero, length))
            run -= length
        if value is not None:
            sent.append(value)
    sent.append(protocol.end)
    return bytes(sent)


def _lines(
    board: Board, protocol: Text, values: npt.NDArray[np.int64], number: int
) -> bytes:
    separator = _SEPARATORS[protocol.separator]
    is_block = protocol.frame == "block"
    by_row = board.order == "rows"
    width = board.sensor.columns if by_row else board.sensor.rows
    stamps = [number] * protocol.skip
    first = [protocol.prefix] if protocol.prefix else []
    lines = [
        separator.join(map(str, [*first, *stamps, *line]))
        for line in values.reshape(-1, width if is_block else len(values)).tolist()
    ]
    text = "".join(f"{line}{_NEWLINE}" for line in lines)
    return f"{text}{_NEWLINE if is_block else ''}".encode()


def main(words: Sequence[str] | None = None) -> None:
    """Simulate a board until Ctrl-C, or play a recording until it ends."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    add = parser.add_argument
    add("board", metavar="BOARD.yaml", nargs="?", help="the board that is simulated")
    add("--object", choices=[*OBJECTS, "all"], help="what lies there; a disc if none")
    add("--recording", metavar="FILE", help="play its frames, as its board sent them")
    add("--speed", type=float, default=1.0, help="of a recording; default 1")
    add("--link", metavar="PATH", help="the port; in a folder of its own if none")
    for name in Faults.__struct_fields__:
        add(f"--{name}", type=float, metavar="SECONDS", help="after every 100 frames")
    options = parser.parse_args(words)
    if (options.board is None) == (options.recording is None):
        parser.error("expected either BOARD.yaml or --recording FILE")
    pauses = (options.stall, options.unplug)
    faults = Faults(*(Pause(seconds) if seconds else None for seconds in pauses))
    try:
        if options.recording:
            _play(options.recording, options.speed, faults, options.link)
        else:
            _simulate(load_board(options.board), options.object, faults, options.link)
    except (FuzzyTreeError, ValueError) as error:
        sys.exit(str(error))


def _simulate(board: Board, name: str | None, faults: Faults, link: str | None) -> None:
    """Show an object, all in turn, or a disc, until Ctrl-C."""
    names = tuple(OBJECTS) if name == "all" else (name or "",)
    pressed = (fitted(board, one.frame.cells, FULL) for one in simulated(names=names))
    device = Device(
        board,
        pressed if name else blob(board),
        faults,
        link=link,
        first=[empty(board)] * board.start.frames,
        frames_a_second=FRAMES_A_SECOND,
    )
    with device, stop_signal() as stop:
        print(device.port, flush=True)
        stop.wait()
    _report(device)


def _play(path: str, speed: float, faults: Faults, link: str | None) -> None:
    """Send the frames of a recording at their times, after some of its baseline."""
    file = open_frames(path)
    source, board, sensor = Replayed(file, speed), file.board, file.board.sensor
    rest = empty(board)
    if sensor.baseline:
        rest = np.array(sensor.baseline).reshape(rest.shape)
    device = Device(
        board,
        (frame.cells for frame in source),
        faults,
        max(speed, 1.0) if speed else None,
        link=link,
        first=[rest] * board.start.frames,
    )
    # The source first: it ends the wait for the next frame.
    with file, device, contextlib.closing(source), stop_signal() as stop:
        print(device.port, flush=True)
        while not (device.over.wait(_LOOK_S) or stop.is_set()):
            pass
        stop.wait(_LAST_S)
    _report(device)


def _report(device: Device) -> None:
    counts = asdict(device.counts).items()
    print(", ".join(f"{name} {count}" for name, count in counts), file=sys.stderr)


if __name__ == "__main__":
    main()
