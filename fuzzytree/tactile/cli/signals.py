"""Signals that end an action which runs until it is interrupted."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Generator

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
"""Ctrl-C, a request to end, and a terminal that goes away; some systems lack some."""


@contextlib.contextmanager
def stop_signal() -> Generator[threading.Event]:
    """Give an event that Ctrl-C and its like set; the next one is an interruption.

    A process that `nohup` started outlives its terminal.
    """
    stop = threading.Event()

    def note(_number: int, _frame: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with contextlib.ExitStack() as stack:
        if threading.current_thread() is threading.main_thread():
            for number in [s for s in signal.Signals if s.name in _NAMES]:
                before = signal.getsignal(number)
                if number.name == "SIGHUP" and before is signal.SIG_IGN:
                    continue
                stack.callback(signal.signal, number, before)
                signal.signal(number, note)
        yield stop
