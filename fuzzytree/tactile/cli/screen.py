"""A terminal that shows what is recognised, and is as it was before afterwards."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import threading
from collections.abc import Generator
from itertools import zip_longest
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO

from fuzzytree.tactile.cli.signals import Handler, handled
from fuzzytree.tactile.report.live import Look, screen

if TYPE_CHECKING:
    from fuzzytree.tactile.recognition.live import Live

if sys.platform != "win32":
    import termios
    import tty

COUNTS = (3, 5, 7)
"""Points of the picture for a cell on each side, as a key switches them."""

_REFRESHES = 30  # a second, at most
_ALIVE_S = 0.5  # between two refreshes where no frames come
_JOIN_S = 1.0  # for a terminal that takes nothing
_ENTER = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J"  # other screen, no cursor, no wrapping
_LEAVE = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"
_MANY = ("xterm", "screen", "tmux", "rxvt", "linux", "256color")


def look_of(stream: TextIO) -> Look | None:
    """Return how a stream shows pictures; None if it is no terminal that does."""
    term = os.environ.get("TERM", "")
    if not stream.isatty() or term in ("", "dumb"):
        return None
    encoding = (stream.encoding or "").lower().replace("-", "")
    if os.environ.get("NO_COLOR") or encoding != "utf8":
        return "plain"
    if os.environ.get("COLORTERM") in ("truecolor", "24bit"):
        return "full"
    return "256" if any(name in term for name in _MANY) else "plain"


class Screen:
    """Draws in a thread, at most 30 times a second, each time by one write.

    On a keyboard `t` tares, `s` shows the real cells, and `i` changes the points.
    """

    def __init__(self, live: Live, stream: TextIO, look: Look, times: int) -> None:
        self._live, self._file = live, stream.fileno()
        self._look: Look = look
        self._times, self._is_smooth = times, True
        self._keyboard: int | None = None
        self._settings: list[Any] = []
        self._stop = threading.Event()
        self._drawing = threading.Lock()
        self._shown: list[str] = []
        self._size = os.terminal_size((0, 0))
        self._thread = threading.Thread(target=self._run, name="screen", daemon=True)

    def __enter__(self) -> Screen:
        """Take the terminal."""
        self._take()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give the terminal back, with its cursor."""
        self._stop.set()
        self._thread.join(_JOIN_S)
        self._give_back()

    @contextlib.contextmanager
    def given_back(self) -> Generator[None]:
        """Give the terminal back for a while, and take it again."""
        with self._drawing:
            self._give_back()
            yield
            self._take()

    def _take(self) -> None:
        """Take the screen, and keys as they are pressed, without showing them."""
        if sys.platform != "win32" and sys.stdin.isatty():
            keyboard = sys.stdin.fileno()
            self._settings = termios.tcgetattr(keyboard)
            tty.setcbreak(keyboard, termios.TCSANOW)
            self._keyboard = keyboard
        self._write(_ENTER)
        self._shown = []

    def _give_back(self) -> None:
        with contextlib.suppress(OSError):  # the terminal may be gone
            self._write(_LEAVE)
        if sys.platform != "win32" and self._keyboard is not None:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._keyboard, termios.TCSANOW, self._settings)

    def _take_keys(self) -> None:
        if self._keyboard is None or not select.select([self._keyboard], [], [], 0)[0]:
            return
        for key in os.read(self._keyboard, 64):
            match chr(key):
                case "t":
                    self._live.tare()
                case "s":
                    self._is_smooth = not self._is_smooth
                case "i":
                    later = [count for count in COUNTS if count > self._times]
                    self._times = min(later, default=COUNTS[0])
                case _:
                    pass

    def _run(self) -> None:
        seen = 0
        with contextlib.suppress(OSError):  # the terminal may be gone
            while not self._stop.is_set():
                with self._drawing:
                    self._take_keys()
                    self._draw()
                self._stop.wait(1 / _REFRESHES)
                seen = self._live.wait(seen, _ALIVE_S)

    def _draw(self) -> None:
        """Write the lines that have changed."""
        size = os.get_terminal_size(self._file)
        columns, lines = max(size.columns, 1), max(size.lines, 1)
        view = self._live.view()
        times = self._times if self._is_smooth else 1
        shown = f"{self._times} points a cell" if self._is_smooth else "the real cells"
        keys = f"t tares, s and i change the picture ({shown}), "
        keys = "" if self._keyboard is None else keys
        text = screen(view, columns, lines, look=self._look, times=times, keys=keys)
        new, parts = text.split("\n"), []
        if size != self._size:
            self._shown, parts = [], ["\x1b[2J"]
        pairs = zip_longest(new, self._shown, fillvalue="")
        for number, (line, before) in enumerate(pairs, 1):
            if line != before:
                parts.append(f"\x1b[{number};1H{line}\x1b[K")
        if parts:
            self._write("".join(parts))
        self._shown, self._size = new, size

    def _write(self, text: str) -> None:
        rest = memoryview(text.encode())
        while rest:
            rest = rest[os.write(self._file, rest) :]


@contextlib.contextmanager
def ended_by_signals(shown: Screen | None) -> Generator[None]:
    """End on SIGTERM, or when the terminal goes away, as on Ctrl-C.

    When it is stopped (Ctrl-Z), the terminal is given back until it goes on.
    """

    def stop(number: int, frame: FrameType | None) -> None:
        if shown is not None:
            with shown.given_back():
                os.kill(os.getpid(), signal.SIGSTOP)

    end = signal.default_int_handler  # raises KeyboardInterrupt
    wanted: dict[str, Handler] = {"SIGTERM": end, "SIGHUP": end}
    if shown is not None:
        wanted["SIGTSTP"] = stop
    with handled(wanted):
        yield
