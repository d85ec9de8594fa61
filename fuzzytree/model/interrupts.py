"""Work that is ended from outside: by a Ctrl-C, or between its steps by its caller."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Generator
from contextvars import ContextVar
from types import FrameType
from typing import Final

_ASKED: Final[ContextVar[Callable[[], None] | None]] = ContextVar("asked", default=None)


@contextlib.contextmanager
def watched(ask: Callable[[], None]) -> Generator[None]:
    """Have `checkpoint` ask a function, in this thread and what it calls.

    It holds until the block ends: a generator must not yield within it.

    Example:
        >>> def stop() -> None:
        ...     raise TimeoutError
        >>> with contextlib.suppress(TimeoutError), watched(stop):
        ...     checkpoint()
        ...     print("not reached")
        >>> checkpoint()
    """
    token = _ASKED.set(ask)
    try:
        yield
    finally:
        _ASKED.reset(token)


def checkpoint() -> None:
    """Ask whether to go on; who works long does so between two steps.

    Nothing happens unless someone watches: it takes no time to speak of. What `watched`
    was given may raise, so nothing may be left half done here.
    """
    ask = _ASKED.get()
    if ask is not None:
        ask()


@contextlib.contextmanager
def noticed() -> Generator[Callable[[], None]]:
    """Give a function that raises KeyboardInterrupt if there was a Ctrl-C before.

    A Ctrl-C raises where it arrives, as always; but where that is in a library with an
    `except:` of its own, nothing comes of it. Whoever calls the function between its
    steps hears of it all the same. Outside the main thread nothing is changed; a
    handler of the program's own decides what a Ctrl-C is.
    """
    seen: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def check() -> None:
        if seen:
            raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or not callable(before):
        yield check
        return
    raising = before

    def note(number: int, frame: FrameType | None) -> None:
        try:
            raising(number, frame)
        except KeyboardInterrupt:
            seen.append(number)
            raise

    signal.signal(signal.SIGINT, note)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
