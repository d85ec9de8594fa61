"""Work that is counted in calls: the same on each machine, however busy it is."""

import contextlib
import sys
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def at_most(calls: int) -> Iterator[None]:
    """Fail as soon as more functions are called, of Python or of C."""
    left = calls

    def count(frame: FrameType, event: str, argument: object) -> None:
        del frame, argument
        nonlocal left
        left -= event in ("call", "c_call")
        if left < 0:
            raise AssertionError(f"more than {calls:,} calls")

    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(None)
