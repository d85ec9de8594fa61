"""Signals that end an action which runs until it is interrupted."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Generator, Mapping
from types import FrameType

Handler = Callable[[int, FrameType | None], None]


@contextlib.contextmanager
def handled(handlers: Mapping[str, Handler]) -> Generator[None]:
    """Handle signals by name, as far as the system has them, in the main thread.

    A process that `nohup` started outlives its terminal.
    """
    with contextlib.ExitStack() as stack:
        is_main = threading.current_thread() is threading.main_thread()
        for number in signal.Signals if is_main else ():
            before = signal.getsignal(number)
            is_kept = number.name == "SIGHUP" and before is signal.SIG_IGN
            if number.name in handlers and not is_kept:
                stack.callback(signal.signal, number, before)
                signal.signal(number, handlers[number.name])
        yield


@contextlib.contextmanager
def stop_signal() -> Generator[threading.Event]:
    """Give an event that Ctrl-C and its like set; the next one is an interruption."""
    stop = threading.Event()

    def note(_number: int, _frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with handled(dict.fromkeys(("SIGINT", "SIGTERM", "SIGHUP"), note)):
        yield stop
