"""A budget of time: who works long asks it between two steps."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator
from typing import Final

from fuzzytree.model.interrupts import watched

GRACE_S: Final = 0.25
"""For who asked the clock to tell what is known."""

Progress = Callable[[str, float], None]


class OutOfTimeError(Exception):
    """The budget is spent; whoever catches it keeps what is proved so far."""


class Clock:
    """Counts down a budget, and tells how far the work is.

    Args:
        budget_s: Seconds from now; infinite unless given.
        tell: Told what is being done and which share of all is done, in [0, 1].
        now: A clock in seconds that never goes back.

    Raises:
        ValueError: If the budget is not above 0.

    Example:
        >>> Clock(60.0).is_over
        False
    """

    def __init__(
        self,
        budget_s: float = float("inf"),
        *,
        tell: Progress | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        if not budget_s > 0.0:
            raise ValueError(f"the budget must be above 0 seconds, not {budget_s!r}")
        self._now = now
        self._end = now() + budget_s
        self._tell = tell

    @property
    def left_s(self) -> float:
        """Seconds that are left; below 0 when the budget is spent."""
        return self._end - self._now()

    @property
    def is_over(self) -> bool:
        """Whether the budget is spent."""
        return self.left_s <= 0.0

    def check(self) -> None:
        """Raise OutOfTimeError if the budget is spent."""
        if self.is_over:
            raise OutOfTimeError

    def share(self, part: float, *, tell: Progress | None = None) -> Clock:
        """Return a clock that ends after a part of what is left; it tells `tell`."""
        return Clock(max(self.left_s * part, 1e-3), tell=tell, now=self._now)

    def tell(self, text: str, share: float) -> None:
        """Tell what is being done."""
        if self._tell is not None:
            self._tell(text, share)


@contextlib.contextmanager
def enforced(clock: Clock) -> Generator[None]:
    """Have every step of the work within ask a clock, a moment after it is over.

    Whoever holds the clock asks it first and can keep what is known; the steps below,
    which know no clock, end what forgets to: curves, roots, cells, boxes.

    Raises:
        OutOfTimeError: From the step that is late.
    """

    def ask() -> None:
        if clock.left_s < -GRACE_S:
            raise OutOfTimeError

    with watched(ask):
        yield
