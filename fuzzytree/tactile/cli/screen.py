"""A terminal that shows what is recognised, and is as it was before afterwards."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Generator, Mapping
from types import FrameType
from typing import TYPE_CHECKING, TextIO

from fuzzytree.tactile.cli.signals import Handler, handled
from fuzzytree.tactile.report.live import Look, screen

if TYPE_CHECKING:
    from fuzzytree.tactile.recognition.live import Live

_REFRESHES = 30  # a second, at most
_ALIVE_S = 0.5  # between two refreshes where no frames come
_JOIN_S = 1.0  # for a terminal that takes nothing
_ENTER = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J"  # other screen, no cursor, no wrapping
_LEAVE = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"
_MANY = ("xterm", "screen", "tmux", "rxvt", "linux", "256color")


def look_of(
    stream: TextIO, environment: Mapping[str, str] | None = None
) -> Look | None:
    """Return how a stream shows pictures; None if it is no terminal that does.

    Args:
        stream: Where the picture would go.
        environment: Its TERM, COLORTERM and NO_COLOR; those of the process if None.
    """
    known = os.environ if environment is None else environment
    term = known.get("TERM", "")
    if not stream.isatty() or term in ("", "dumb"):
        return None
    encoding = (stream.encoding or "").lower().replace("-", "")
    if known.get("NO_COLOR") or encoding != "utf8":
        return "plain"
    if known.get("COLORTERM") in ("truecolor", "24bit"):
        return "full"
    return "256" if any(name in term for name in _MANY) else "plain"


class Screen:
    """Draws in a thread, at most 30 times a second, each time by one write."""

    def __init__(self, live: Live, stream: TextIO, look: Look, times: int) -> None:
        self._live, self._file = live, stream.fileno()
        self._look: Look = look
        self._times = times
        self._stop = threading.Event()
        self._drawing = threading.Lock()
        self._shown: list[str] = []
        self._size = os.terminal_size((0, 0))
        self._thread = threading.Thread(target=self._run, name="screen", daemon=True)

    def __enter__(self) -> Screen:
        """Take the terminal."""
        self._write(_ENTER)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give the terminal back, with its cursor."""
        self._stop.set()
        self._thread.join(_JOIN_S)
        with contextlib.suppress(OSError):  # the terminal may be gone
            self._write(_LEAVE)

    @contextlib.contextmanager
    def given_back(self) -> Generator[None]:
        """Give the terminal back for a while, and take it again."""
        with self._drawing:
            self._write(_LEAVE)
            yield
            self._write(_ENTER)
            self._shown = []

    def _run(self) -> None:
        seen = 0
        with contextlib.suppress(OSError):  # the terminal may be gone
            while not self._stop.is_set():
                with self._drawing:
                    self._draw()
                self._stop.wait(1 / _REFRESHES)
                seen = self._live.wait(seen, _ALIVE_S)

    def _draw(self) -> None:
        """Write the lines that have changed."""
        size = os.get_terminal_size(self._file)
        columns, lines = max(size.columns, 1), max(size.lines, 1)
        view = self._live.view()
        text = screen(view, columns, lines, look=self._look, times=self._times)
        new = text.split("\n")
        parts = ["\x1b[2J"] if size != self._size else []
        before = [] if size != self._size else self._shown
        for place in range(max(len(new), len(before))):
            line = new[place] if place < len(new) else ""
            if place >= len(before) or before[place] != line:
                parts.append(f"\x1b[{place + 1};1H{line}\x1b[K")
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

    def end(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    def stop(number: int, frame: FrameType | None) -> None:
        if shown is not None:
            with shown.given_back():
                os.kill(os.getpid(), signal.SIGSTOP)

    wanted: dict[str, Handler] = {"SIGTERM": end, "SIGHUP": end}
    if shown is not None:
        wanted["SIGTSTP"] = stop
    with handled(wanted):
        yield
