"""A serial line of our own: a pseudo-terminal that takes the time a line takes."""

from __future__ import annotations

import contextlib
import os
import re
import select
import struct
import sys
import threading
import time
from functools import cache
from pathlib import Path

from fuzzytree.errors import WriteError
from fuzzytree.files import reason
from fuzzytree.tactile.boards import Port
from fuzzytree.tactile.simulation.uart import Receiver

if sys.platform != "win32":
    import fcntl
    import termios
    import tty

_PIECE_S = 0.002  # how much of the line's time is written at once
_SLACK_S = 0.02  # by how much a late piece may hurry the next ones
_LOOK_S = 0.02  # how often to look whether to end

_OTHER = 0o10000  # Linux: a speed that has no name
_TCGETS2 = 0x802C542A  # Linux: how such a speed is read
_UNSET = 50  # what a line is set to whose own speed has no name


class Wire:
    """The board's end of a line; the host's end is a link to a pseudo-terminal.

    Attributes:
        bytes: How many were put on the line.
        overrun: How many of them found no room, since the host did not read.
        garbled: How many went out at a speed that the host had not set.
        framing_errors: How many bytes the host took of them that end wrongly.
    """

    def __init__(
        self, port: Port, link: Path, stop: threading.Event, *, rate: float | None
    ) -> None:
        """Keep what is needed; nothing is there before `plug_in`.

        Args:
            port: How the board sets its port.
            link: The host's end.
            stop: Whatever waits here ends when it is set.
            rate: How many times as fast as the line would be; None for as fast as
                the host reads.
        """
        self.bytes = self.overrun = self.garbled = self.framing_errors = 0
        self._port, self._link, self._stop = port, link, stop
        self._byte_s = port.bits_of_a_byte / port.baud / rate if rate else 0.0
        self._master: int | None = None
        self._due = 0.0
        self._receiver: tuple[int, Receiver] | None = None
        self._terminal = ""

    def _check_link(self) -> None:
        if not hasattr(os, "openpty"):
            raise WriteError("this system has no pseudo-terminals")
        if self._link.exists():
            what = f"it leads to {self._link.resolve()}, which is there"
            if not self._link.is_symlink():
                what = "something else is there"
            raise WriteError(f"{self._link}: cannot be made a port: {what}")

    def plug_in(self) -> None:
        """Make the pseudo-terminal and its link.

        Raises:
            WriteError: If it cannot be made.
        """
        self._check_link()
        try:
            self._master, slave = os.openpty()
            os.set_blocking(self._master, False)
            tty.setraw(slave)
            self._set_speed(slave)
            self._terminal = os.ttyname(slave)
            new = self._link.with_name(f".{self._link.name}.{os.getpid()}")
            new.symlink_to(self._terminal)
            new.replace(self._link)
            os.close(slave)  # so that it can be seen whether a host has it open
        except OSError as error:
            text = f"{self._link}: cannot be made a port: {reason(error)}"
            raise WriteError(text) from error

    def plug_out(self) -> None:
        """Take the pseudo-terminal and its link away, as a pulled plug does."""
        if self._master is not None:
            if self._link.is_symlink() and str(self._link.readlink()) == self._terminal:
                self._link.unlink()  # unless it is not ours any more
            os.close(self._master)
            self._master = None

    def _set_speed(self, terminal: int) -> None:
        speed = _speeds().get(self._port.baud, _speeds()[_UNSET])
        settings = termios.tcgetattr(terminal)
        settings[4] = settings[5] = speed
        termios.tcsetattr(terminal, termios.TCSANOW, settings)

    @property
    def is_open(self) -> bool:
        """Whether a host has the port open."""
        if self._master is None:
            return False
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    def rest(self) -> None:
        """Say that the line was silent until now: what comes next takes its time."""
        self._due = time.monotonic()

    def send(self, data: bytes) -> bool:
        """Put bytes on the line, in the time that they take; False if nobody hears."""
        size = max(int(_PIECE_S / self._byte_s), 1) if self._byte_s else len(data)
        for start in range(0, len(data), max(size, 1)):
            piece = data[start : start + size]
            self._due += len(piece) * self._byte_s
            now = time.monotonic()
            if self._due > now:
                self._stop.wait(self._due - now)
            self._due = max(self._due, now - _SLACK_S)
            self.bytes += len(piece)  # before a host can have them, and count
            if self._stop.is_set() or not self._given(self._as_heard(piece)):
                self.bytes -= len(piece)
                return False
        return True

    def _given(self, data: bytes) -> bool:
        """Write bytes; what finds no room is lost, or waits if no time is kept."""
        assert self._master is not None
        poll = select.poll()
        poll.register(self._master, select.POLLOUT)
        while data:
            events = poll.poll(0 if self._byte_s else 1000 * _LOOK_S)
            if self._stop.is_set() or any(e & select.POLLHUP for _, e in events):
                return False
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                if self._byte_s:
                    self.overrun += len(data)
                    return True
        return True

    def heard(self, patience_s: float = _LOOK_S) -> bytes:
        """Return what the host has sent, once there is something or time is over."""
        assert self._master is not None
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        if any(event & select.POLLIN for _, event in poll.poll(1000 * patience_s)):
            with contextlib.suppress(OSError):  # closed by the host meanwhile
                return os.read(self._master, 4096)
        return b""

    def _as_heard(self, piece: bytes) -> bytes:
        """Return the bytes that a host takes at the speed that it has set."""
        assert self._master is not None
        speed = _speed_of(self._master)
        if speed in (self._port.baud, _UNSET):
            self._receiver = None
            return piece
        if self._receiver is None or self._receiver[0] != speed:
            self._receiver = speed, Receiver(self._port, speed)
        self.garbled += len(piece)
        receiver = self._receiver[1]
        before = receiver.framing_errors
        found = receiver.heard(piece)
        self.framing_errors += receiver.framing_errors - before
        return found


@cache
def _speeds() -> dict[int, int]:
    """Return the constant of `termios` for each speed that has a name."""
    names = [name for name in dir(termios) if re.fullmatch(r"B[1-9][0-9]*", name)]
    return {int(name[1:]): getattr(termios, name) for name in names}


def _speed_of(terminal: int) -> int:
    """Return the speed that the host has set, in bits a second."""
    speed = termios.tcgetattr(terminal)[5]
    for baud, constant in _speeds().items():
        if constant == speed:
            return baud
    if speed != _OTHER or sys.platform != "linux":
        return _UNSET
    answer = fcntl.ioctl(terminal, _TCGETS2, bytes(44))
    (baud,) = struct.unpack("=I", answer[40:44])
    return int(baud)
