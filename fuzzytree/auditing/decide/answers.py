"""The question of the decider, its three answers, and its budget."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

_LOOK = 1_000  # steps between two looks at a budget

ZERO, ONE = Fraction(0), Fraction(1)

Progress = Callable[[str, float], None]

STEPS = 60_000_000
"""The budget of a whole audit, unless the user gives another one."""


class Proved(NamedTuple):
    """There is no such point.

    Attributes:
        how: What was looked at, in a sentence.
        rivals: The positions of a few rivals and weak ones that suffice for the proof.
    """

    how: str
    rivals: tuple[int, ...] = ()


class Point(NamedTuple):
    """A point at which all holds that was asked, evaluated in fractions."""

    values: Mapping[str, Fraction]
    how: str = ""


class Open(NamedTuple):
    """It is not known.

    Attributes:
        why: What was tried.
        code: The reason, as a code of the audit.
    """

    why: str
    code: str = "FTD05"


Answer = Proved | Point | Open


class Question(NamedTuple):
    """Is there a point, and a level t > 0, at which rules reach t and others do not?

    Attributes:
        reach: The positions of the rules with a strength of at least t.
        rivals: Those with a strength below t.
        weak: Those with a strength of at most t.
        level: The level, if it is a given one, which may be 0.
    """

    reach: tuple[int, ...] = ()
    rivals: tuple[int, ...] = ()
    weak: tuple[int, ...] = ()
    level: Fraction | None = None

    def holds(self, low: Sequence[Fraction], high: Sequence[Fraction]) -> bool:
        """Return whether it is so where strengths are within some bounds."""
        top = self.level
        if top is None:
            top = min((low[i] for i in self.reach), default=ONE)
        return (
            (top > 0 or self.level is not None)
            and all(low[i] >= top for i in self.reach)
            and all(high[i] < top for i in self.rivals)
            and all(high[i] <= top for i in self.weak)
        )

    @property
    def rules(self) -> tuple[int, ...]:
        """All rules that it is about."""
        return self.reach + self.rivals + self.weak


class OutOfStepsError(Exception):
    """The budget is spent; what was decided before remains valid."""


class Budget:
    """How many steps may still be taken: the same answers on any machine and load.

    A step is about a microsecond of work.

    Args:
        steps: How many.
        whole: The budget that it is a part of.
        report: Called with what is done now, and with the share of all work that is
            done, in [0, 1].

    Example:
        >>> budget = Budget(100)
        >>> budget.share(0.5).left
        50
    """

    def __init__(
        self,
        steps: int = STEPS,
        whole: Budget | None = None,
        report: Progress | None = None,
    ) -> None:
        self.left, self.whole = steps, whole
        self._report = report

    def spend(self, steps: int) -> None:
        """Take some steps.

        Raises:
            OutOfStepsError: If they were more than are left.
        """
        self.left -= steps
        if self.whole is not None:
            self.whole.spend(steps)
        if self.left < 0:
            raise OutOfStepsError

    def share(self, part: float, *, report: Progress | None = None) -> Budget:
        """Return a budget of a part of the steps that are left, which spends both."""
        return Budget(max(int(self.left * part), 0), self, report)

    def report(self, text: str, share: float) -> None:
        """Report what is done now, and the share of the work that is done."""
        if self._report is not None:
            self._report(text, share)

    def check(self) -> None:
        """Spend the steps of a part of some work."""
        self.spend(_LOOK)

    @property
    def is_spent(self) -> bool:
        """Whether no step is left."""
        return self.left <= 0 or (self.whole is not None and self.whole.is_spent)
