"""Work that is ended from outside: by a Ctrl-C, or between its steps by its caller."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Generator
from contextvars import ContextVar
from types import FrameType
from typing import Final

_CHECK: Final[ContextVar[Callable[[], None] | None]] = ContextVar("check", default=None)


@contextlib.contextmanager
def watched(check: Callable[[], None]) -> Generator[None]:
    """Have `checkpoint` call a function, in this thread, until the block ends.

    A generator must not yield within the block.

    Example:
        >>> def stop() -> None:
        ...     raise TimeoutError
        >>> with contextlib.suppress(TimeoutError), watched(stop):
        ...     checkpoint()
        ...     print("not reached")
        >>> checkpoint()
    """
    token = _CHECK.set(check)
    try:
        yield
    finally:
        _CHECK.reset(token)


def checkpoint() -> None:
    """Call the function of `watched`, if there is one, between two steps of long work.

    The function may raise, so nothing may be half done here.
    """
    check = _CHECK.get()
    if check is not None:
        check()


@contextlib.contextmanager
def noticed() -> Generator[Callable[[], None]]:
    """Give a function that raises KeyboardInterrupt if there was a Ctrl-C before.

    A library with a bare `except:` swallows the KeyboardInterrupt of a Ctrl-C; a call
    of the function between two steps raises it again. Outside the main thread nothing
    is changed; a handler of the program's own decides what a Ctrl-C is.
    """
    signals: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def check() -> None:
        if signals:
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
            signals.append(number)
            raise

    signal.signal(signal.SIGINT, note)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)
