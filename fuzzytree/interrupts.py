"""Ctrl-C is noticed even where a library swallows it."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Generator
from types import FrameType


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
