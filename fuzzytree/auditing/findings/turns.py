"""Many questions of one kind share what is left of the time, none takes it all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, TypeVar

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError, enforced
from fuzzytree.auditing.engine.states import Declined, counted
from fuzzytree.auditing.findings.records import Answer

_MOST: Final = 0.25  # of the time that is left, for one question
_FAIR: Final = 4.0  # times as much as its own share may one of many take

_Found = TypeVar("_Found")


class Turns:
    """Questions that are asked one after another.

    Args:
        clock: How much time there is for all that is asked with it.
        part: How much of it these questions may take together.

    Attributes:
        left_out: How many were not answered; whoever asks counts them.
    """

    def __init__(self, clock: Clock, part: float) -> None:
        self.clock = clock.share(part)
        self.left_out = 0

    def ask(self, left: int, question: Callable[[Clock], _Found]) -> _Found | None:
        """Return the answer to a question, None if the time does not suffice.

        Args:
            left: How many questions are left, this one too; at least 1.
            question: Is given its own clock, which its steps are made to ask.
        """
        if self.clock.is_over:
            return None
        own = self.clock.share(min(_MOST, _FAIR / left))
        try:
            with enforced(own):
                return question(own)
        except OutOfTimeError:
            return None

    def rest(self, code: str, noun: str, what: str) -> Iterator[Answer]:
        """Yield that some questions are open, if there are any.

        Args:
            code: Of the questions.
            noun: What each is about, such as `rule`.
            what: What is not known of them, such as `whether they ever win`.
        """
        if self.left_out:
            reason = "the budget was spent"
            of = counted(self.left_out, noun)
            sentence = f"{what} is not known of {of}: {reason}"
            yield Answer(
                code, f"{of} left open", sentence, Declined("FTD03", reason), False
            )
