"""How a check can end, and the report of a re-check."""

from __future__ import annotations

import html
from collections import Counter, defaultdict
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any


class CannotRunError(ValueError):
    """A file cannot be read, or a solver fails: nothing is checked."""


class DoesNotHoldError(Exception):
    """Something that the audit says is not so."""


class UndecidedError(Exception):
    """Something is beyond the limits of what is decided here; the text says which."""


def require(is_so: bool, otherwise: str) -> None:
    """Refuse what the audit says, unless it is so."""
    if not is_so:
        raise DoesNotHoldError(otherwise)


class Report:
    """The results of a re-check.

    Attributes:
        unchecked: What is read and compared with nothing.
        answers: The answers that are checked.
        wrong: What does not hold, a sentence each.
        refuted: By position why an answer does not hold.
        counts: How many answers end in which way.
        undecided: The positions of the answers not decided again, by state and reason.
        confirmed: By position what confirms each answer: a solver, or `recheck`.
        unconfirmed: How many answers PROVED only a solver can confirm, without one.
    """

    def __init__(self, unchecked: str, answers: Sequence[Any]) -> None:
        self.unchecked, self.answers = unchecked, answers
        self.wrong: list[str] = []
        self.refuted: dict[int, str] = {}
        self.counts = Counter[str]()
        self.undecided = defaultdict[tuple[str, str], list[int]](list)
        self.confirmed: dict[int, str] = {}
        self.unconfirmed = 0

    @property
    def exit_code(self) -> int:
        """1 if something is wrong; 2 if a solver is missing; else 0."""
        return 1 if self.wrong else 2 if self.unconfirmed else 0

    def expect(self, is_so: bool, otherwise: str) -> None:
        """Note what does not hold, unless it is so."""
        if not is_so:
            self.wrong.append(otherwise)

    @contextmanager
    def answer(self, place: int) -> Generator[Any]:
        """Yield an answer; note what does not hold of it, or is undecided."""
        answer, why = self.answers[place], ""
        try:
            yield answer
        except CannotRunError:
            raise
        except DoesNotHoldError as error:
            why = str(error)
        except UndecidedError as error:
            kind = type(answer.state).__name__.upper()
            self.undecided[kind, str(error)].append(place)
        except (LookupError, ArithmeticError, ValueError, TypeError, AttributeError):
            why = "it names what there is not"
        if why:
            where = f"answer {place + 1} ({answer.code}, {answer.subject:.60})"
            self.wrong.append(f"{where}: {why}")
            self.refuted.setdefault(place, why)

    def confirm(self, place: int, by: str, *, is_bound: bool = False) -> None:
        """Note that a solver, or reading alone, confirms an answer or bounds of it."""
        kind = "bounds of other answers" if is_bound else "answers PROVED"
        way = "read and evaluated again" if by == "recheck" else f"confirmed by {by}"
        self.counts[f"{kind}, {way}"] += 1
        self.confirmed[place] = by

    def __repr__(self) -> str:
        """Show how many answers there are, and how many points are wrong."""
        return f"Report({len(self.answers)} answers, {len(self.wrong)} wrong)"

    def __str__(self) -> str:
        """Return what the command line prints."""
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        style = "font-family: monospace; line-height: 1.3; white-space: pre"
        return f'<pre style="{style}">{html.escape(str(self))}</pre>'

    def lines(self) -> Iterator[str]:
        """Yield the report, line by line."""
        many = len(self.wrong)
        what = f"{many} {'points are' if many != 1 else 'point is'} wrong"
        if not many:
            what = "the audit is right as far as it was checked again"
        if self.unconfirmed:
            what += f"; {self.unconfirmed} answers PROVED are unconfirmed"
        yield what
        yield from (f"WRONG: {text}" for text in self.wrong)
        counts = Counter(dict(sorted(self.counts.items())))
        for (state, _), places in self.undecided.items():
            counts[f"answers {state}, not decided again"] += len(places)
        width = max(map(len, counts), default=0)
        yield from (f"{name:<{width}}  {number}" for name, number in counts.items())
        if self.undecided:
            yield "not decided again:"
        for (_, why), places in self.undecided.items():
            size = f" ({len(places)} answers)" if len(places) > 1 else ""
            codes = dict.fromkeys(self.answers[place].code for place in places)
            yield f"  {', '.join(codes)}{size}: {why}"
        yield f"read, and compared with nothing: {self.unchecked}"
        if self.unconfirmed:
            yield (
                "no solver is at hand: install fuzzytree-toolkit[proofs], or name a "
                "program with --solver"
            )
