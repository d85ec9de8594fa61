"""A budget of time, checked between the steps of long work."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator
from typing import Final

from fuzzytree.model import watched

GRACE_S: Final = 0.25
"""Seconds beyond the budget in which a caller can return what is known."""

Progress = Callable[[str, float], None]


class OutOfTimeError(Exception):
    """The budget is spent; what was proved before it remains valid."""


class Clock:
    """Counts down a budget, and reports progress.

    Args:
        budget_s: Seconds from now; infinite unless given.
        report: Called with the current step and the share of all work, in [0, 1].
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
        report: Progress | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        if not budget_s > 0.0:
            raise ValueError(f"the budget must be above 0 seconds, not {budget_s!r}")
        self._now = now
        self._end = now() + budget_s
        self._report = report

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

    def share(self, part: float, *, report: Progress | None = None) -> Clock:
        """Return a clock that ends after a part of the remaining time."""
        return Clock(max(self.left_s * part, 1e-3), report=report, now=self._now)

    def report(self, text: str, share: float) -> None:
        """Report the current step, and the share of the work that is done."""
        if self._report is not None:
            self._report(text, share)


@contextlib.contextmanager
def enforced(clock: Clock) -> Generator[None]:
    """Stop the steps of the work within that run on after a clock is over.

    Code with the clock checks it first and can return what is known. `GRACE_S` later,
    the checkpoints of all steps without it raise: curves, roots, cells, boxes.

    Raises:
        OutOfTimeError: From the step that is late.
    """

    def check() -> None:
        if clock.left_s < -GRACE_S:
            raise OutOfTimeError

    with watched(check):
        yield
