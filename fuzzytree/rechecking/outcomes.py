"""How a check can end, and the report of a re-check."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from typing import Any


class CannotRunError(ValueError):
    """A file cannot be read: nothing is checked."""


class DoesNotHoldError(Exception):
    """Something that the audit says is not so."""


class UndecidedError(Exception):
    """Something is beyond the limits of what is decided here; the text says which."""


def require(is_so: bool, otherwise: str) -> None:
    """Refuse what the audit says, unless it is so.

    Raises:
        DoesNotHoldError: If it is not.
    """
    if not is_so:
        raise DoesNotHoldError(otherwise)


MOST_STEPS = 2_000_000
STEPS_IN_ALL = 2 * MOST_STEPS
"""For an answer, and for all answers of an audit that is not yet done."""


class Limit:
    """How much work an answer may take, and all of them.

    Attributes:
        left: The steps that are left for an answer.
        whole: Those left for all answers.
        is_late: Whether nothing more shall be begun.
    """

    def __init__(
        self, whole: float = math.inf, is_late: Callable[[], bool] = lambda: False
    ) -> None:
        self.left, self.whole, self.is_late = MOST_STEPS, whole, is_late

    def spend(self, steps: int) -> None:
        """Count some steps.

        Raises:
            UndecidedError: If there are too many, or nothing more shall be begun.
        """
        self.left -= steps
        self.whole -= steps
        if self.left < 0:
            raise UndecidedError(f"more than {MOST_STEPS:,} steps")
        if self.whole < 0 or self.is_late():
            raise UndecidedError("the budget is spent")


class Report:
    """The results of a re-check.

    Attributes:
        unchecked: What is read and compared with nothing.
        wrong: What does not hold, a sentence each.
        counts: How often each kind of check was made.
        undecided: The positions of the answers not decided again, by state and reason.
        codes: The code of each answer.
    """

    def __init__(self, unchecked: str = "") -> None:
        self.unchecked = unchecked
        self.wrong: list[str] = []
        self.counts = Counter[str]()
        self.undecided = defaultdict[tuple[str, str], list[int]](list)
        self.codes: list[str] = []

    def expect(self, is_so: bool, otherwise: str) -> None:
        """Note what does not hold, unless it is so."""
        if not is_so:
            self.wrong.append(otherwise)

    @property
    def first(self) -> str:
        """What is wrong first, without its place; empty if nothing is."""
        return self.wrong[0].partition("): ")[2] if self.wrong else ""

    @contextmanager
    def answer(self, number: int, answer: Any, limit: Limit) -> Generator[None]:
        """Note what does not hold of an answer, or is undecided, with its place."""
        where = f"answer {number} ({answer.code}, {answer.subject:.60})"
        limit.left = MOST_STEPS
        try:
            yield
        except DoesNotHoldError as error:
            self.wrong.append(f"{where}: {error}")
        except UndecidedError as error:
            kind = type(answer.state).__name__.upper()
            self.undecided[kind, str(error)].append(number - 1)
        except (
            LookupError,
            ArithmeticError,
            ValueError,
            TypeError,
            AttributeError,
            AssertionError,
        ):
            self.wrong.append(f"{where}: it names what there is not")

    def lines(self) -> Iterator[str]:
        """Yield the report, line by line."""
        many = len(self.wrong)
        what = f"{many} {'points are' if many != 1 else 'point is'} wrong"
        yield what if many else "the audit is right as far as it was checked again"
        yield from (f"WRONG: {text}" for text in self.wrong)
        counts = dict(sorted(self.counts.items()))
        for (state, _), numbers in self.undecided.items():
            name = f"answers {state}, not decided again"
            counts[name] = counts.get(name, 0) + len(numbers)
        width = max(map(len, counts), default=0)
        yield from (f"{name:<{width}}  {number}" for name, number in counts.items())
        if self.undecided:
            yield "not decided again:"
        for (_, why), numbers in self.undecided.items():
            size = f" ({len(numbers)} answers)" if len(numbers) > 1 else ""
            codes = dict.fromkeys(self.codes[number] for number in numbers)
            yield f"  {', '.join(codes)}{size}: {why}"
        yield f"read, and compared with nothing: {self.unchecked}"
