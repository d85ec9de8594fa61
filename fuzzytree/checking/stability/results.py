"""What a stability study found, as frozen values."""

from __future__ import annotations

from typing import ClassVar, Literal

import msgspec

from fuzzytree.model import Result, summary, version

Verdict = Literal["holds", "FAILS", "not applicable"]

_SHOWN = 5  # faults listed for each check; the others are counted


class Criterion(msgspec.Struct, frozen=True):
    """One criterion, applied to one model.

    Attributes:
        code: N1 to N10.
        title: What is demanded, in a few words.
        verdict: The result; `not applicable` where nothing could be tried.
        cases: How many predictions were compared with what they must be.
        worst: The largest difference found, of a degree or strength; None where the
            criterion measures none.
        detail: What failed, worst first; or what was measured, in sentences.
        advice: What to do about it; empty if there is nothing to do.
        skipped: What was not tried and why.
    """

    code: str
    title: str
    verdict: Verdict
    cases: int = 0
    worst: float | None = None
    detail: tuple[str, ...] = ()
    advice: str = ""
    skipped: tuple[str, ...] = ()


class Move(msgspec.Struct, frozen=True):
    """How far the answers of a model move when one input does.

    Attributes:
        step: By how much the input moves.
        largest: The most that a strength moved, or an output, as a share of its range.
        changed: Rows whose class changed, or an output by more than 1e-4 of its range.
        output: The output that moved most; empty without one.
        row: The row in which that was, if any changed.
    """

    step: str
    largest: float
    changed: int
    output: str
    row: str


class Stiff(msgspec.Struct, frozen=True):
    """How stiff an input is, and what giving it in float32 would cost.

    Attributes:
        input: Its name.
        spread: The shortest distance over which a degree changes fully, in its unit;
            None where degrees only step.
        location: The largest absolute value in its range.
        ratio: spread / location: small is stiff. None where one of them is missing.
        predicted: The largest error of a degree that rounding this input alone to
            float32 can cause, from the slopes of the terms; at most 1.
        observed: The largest change of a strength that it did cause, on the rows, or
            of an output, as a share of its range.
        flips: Rows whose class changes with it, or an output by more than 1e-4.
        rows: How many rows were tried.
        offset: A value to subtract before rounding that would help, if one would.
        advice: `float32 is safe`, `use mixed`, `use double`, and what to subtract.
        moves: How far answers move for the least and a small move of the input.
    """

    input: str
    spread: float | None
    location: float
    ratio: float | None
    predicted: float
    observed: float
    flips: int
    rows: int
    offset: float | None
    advice: str
    moves: tuple[Move, ...] = ()


class Stability(Result, msgspec.Struct, frozen=True):
    """Is a model numerically stable: the result of all criteria.

    Attributes:
        model: The model's name.
        fingerprint: The SHA-256 of its content.
        probes: How many rows were made for it.
        rows: How many rows of data were given beside them.
        tried: How many of those were tried, evenly drawn; the others are too many.
        runtimes: What was run.
        criteria: In the order of their codes.
        stiff: Every input, the costliest in float32 first.
    """

    FORMAT: ClassVar[str] = "fuzzytree-stability/1"

    model: str
    fingerprint: str
    probes: int
    rows: int
    tried: int
    runtimes: tuple[str, ...]
    criteria: tuple[Criterion, ...]
    stiff: tuple[Stiff, ...] = ()

    def __repr__(self) -> str:
        """Show how many criteria were applied, and how they end."""
        verdict = "holds" if self.ok else "FAILS"
        return f"{summary('Stability', criteria=len(self.criteria))[:-1]}, {verdict})"

    @property
    def ok(self) -> bool:
        """Whether no criterion fails."""
        return all(one.verdict != "FAILS" for one in self.criteria)

    def to_json(self) -> str:
        """Return the same facts for programs, as indented JSON."""
        head = {"format": self.FORMAT, "version": version(), "ok": self.ok}
        raw = msgspec.json.encode({**head, **msgspec.to_builtins(self)})
        return msgspec.json.format(raw, indent=2).decode()


TITLES = {
    "N1": "scaling inputs by powers of two changes no bit",
    "N2": "shifting inputs stays within the error bound",
    "N3": "row order, copies and batch size change no bit",
    "N4": "terms without width keep their degrees",
    "N5": "values on the edges of terms are exact",
    "N6": "missing and infinite values are answered as declared",
    "N7": "fitted curves are well conditioned and monotone",
    "N8": "errors stay within the certified bound",
    "N9": "saving and reading returns the same bits",
    "N10": "error against run time",
}
"""What each criterion demands."""


class Trial(msgspec.Struct):
    """What a criterion has tried so far.

    Attributes:
        code: A key of `TITLES`.
        advice: What to do about faults.
        faults: What failed, worst first.
        skipped: What was not tried; each sentence is kept once.
        cases: How many answers were examined; none makes it `not applicable`.
        worst: The largest difference; None where the criterion measures none.
    """

    code: str
    advice: str = ""
    faults: list[str] = []
    skipped: list[str] = []
    cases: int = 0
    worst: float | None = None

    def add(self, cases: int, *faults: str | None, worst: float | None = None) -> None:
        """Count answers that were examined, with what failed among them."""
        self.cases += cases
        self.faults += filter(None, faults)
        if worst is not None:
            self.worst = max(self.worst or 0.0, worst)

    def result(self, *facts: str) -> Criterion:
        """Return the criterion with the verdict of its faults, then what was measured.

        Example:
            >>> Trial("N3", cases=12).result().verdict
            'holds'
        """
        shown = self.faults[:_SHOWN]
        if len(self.faults) > _SHOWN:
            shown.append(f"and {len(self.faults) - _SHOWN} more")
        verdict: Verdict = "holds" if self.cases else "not applicable"
        return Criterion(
            self.code,
            TITLES[self.code],
            "FAILS" if shown else verdict,
            self.cases,
            self.worst,
            (*shown, *facts),
            self.advice if shown else "",
            tuple(dict.fromkeys(self.skipped)),
        )
