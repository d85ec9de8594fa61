"""A budget that is kept even where nobody asks the clock.

Whoever works long asks the clock between two steps. Where a step is longer than that,
an alarm of the system ends it as Ctrl-C would, some time after the clock is over.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Generator
from types import FrameType

from fuzzytree.proving.clock import Clock, OutOfTimeError

_GRACE_S = 0.5  # beside a twentieth of what is left, for who asks the clock
_AGAIN_S = 1.0  # for who goes on all the same


@contextlib.contextmanager
def enforced(clock: Clock) -> Generator[None]:
    """Raise OutOfTimeError in what goes on for long after a clock is over.

    Outside the main thread, on a system without alarms, and where a program has its
    own use for them, nothing is changed.
    """
    alarm = getattr(signal, "SIGALRM", None)
    is_main = threading.current_thread() is threading.main_thread()
    if alarm is None or not is_main or signal.getsignal(alarm) is not signal.SIG_DFL:
        yield
        return
    is_on = True

    def ring(_number: int, _frame: FrameType | None) -> None:
        if is_on:
            raise OutOfTimeError

    delay = max(clock.left_s, 0.0) * 1.05 + _GRACE_S
    signal.signal(alarm, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, delay, _AGAIN_S)
        yield
    finally:
        is_on = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(alarm, signal.SIG_DFL)
