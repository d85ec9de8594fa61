"""How a check can end, and the report of a re-check."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator

MOST_BYTES = 64 * 2**20


class CannotRunError(ValueError):
    """A file cannot be read: nothing is checked."""


class DoesNotHoldError(Exception):
    """Something that the audit says is not so."""


class UndecidedError(Exception):
    """Something cannot be decided again here; the text says why."""


def require(is_so: bool, otherwise: str) -> None:
    """Refuse what the audit says, unless it is so.

    Raises:
        DoesNotHoldError: If it is not.
    """
    if not is_so:
        raise DoesNotHoldError(otherwise)


# --- the report

UNCHECKED = (
    "the version, the table, how many rows and how long, how proofs were made, why "
    "something is open or left out, the commands"
)
"""What of an audit is read and cannot be compared with anything."""


OTHERS = {
    "SENTENCE": "sentences, not checked",
    "ID": "ids of findings, not checked",
    "FACT": "facts about the model, not checked",
}
"""What of an audit is not checked beside answers."""


class Report:
    """The results of a re-check.

    Attributes:
        wrong: What does not hold, a sentence each.
        counts: How often each kind of check was made.
        undecided: The codes of the answers not decided again, by state and reason.
    """

    def __init__(self) -> None:
        self.wrong: list[str] = []
        self.counts = Counter[str]()
        self.undecided = defaultdict[tuple[str, str], list[str]](list)

    def expect(self, is_so: bool, otherwise: str) -> None:
        """Note what does not hold, unless it is so."""
        if not is_so:
            self.wrong.append(otherwise)

    def lines(self) -> Iterator[str]:
        """Yield the report, line by line."""
        many = len(self.wrong)
        what = f"{many} {'points are' if many != 1 else 'point is'} wrong"
        yield what if many else "the audit is right as far as it was checked again"
        yield from (f"WRONG: {text}" for text in self.wrong)
        counts = dict(sorted(self.counts.items()))
        for (state, _), codes in self.undecided.items():
            name = OTHERS.get(state, f"answers {state}, not decided again")
            counts[name] = counts.get(name, 0) + len(codes)
        width = max(map(len, counts), default=0)
        yield from (f"{what:<{width}}  {number}" for what, number in counts.items())
        if self.undecided:
            yield "not decided again:"
        for (_, why), codes in self.undecided.items():
            size = f" ({len(codes)} answers)" if len(codes) > 1 else ""
            yield f"  {', '.join(dict.fromkeys(codes))}{size}: {why}"
        yield f"read, and compared with nothing: {UNCHECKED}"
