"""What a stability study found, as frozen values."""

from __future__ import annotations

from typing import ClassVar, Literal

import msgspec

from fuzzytree.model import version

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


class Usable(msgspec.Struct, frozen=True):
    """Powers of two by which all inputs can be multiplied without changing an answer.

    Attributes:
        representation: Which form of the model.
        dtype: In which number type.
        lowest: The smallest exponent at which every number of the model is normal.
        highest: The largest.
    """

    representation: str
    dtype: str
    lowest: int
    highest: int


class OffsetCost(msgspec.Struct, frozen=True):
    """What a distance from zero costs, for one form of the model.

    Attributes:
        representation: Which form.
        ratio: The spread of the narrowest term over the distance, for every input.
        float32: The largest error of a strength in float32; None where float32
            cannot hold the model.
        mixed: The same in mixed numbers.
        float64: The same in double.
        flips: Rows whose class differs from the exact one in float32, of `rows`.
        rows: How many rows were run.
    """

    representation: str
    ratio: float
    float32: float | None
    mixed: float | None
    float64: float | None
    flips: int
    rows: int


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


class CurveFault(msgspec.Struct, frozen=True):
    """A term whose curve is ill-conditioned, leaves [0, 1], or rises.

    Attributes:
        variable: Its variable.
        term: Its name, with the side of it.
        form: In which form of the model it stands.
        condition: How many roundings of the largest degree evaluating it can cost.
        overshoot: By how much the polynomial leaves [0, 1] before it is clipped.
        rise: By how much the clipped degree rises on its way out.
        where: Where it rises most, in the variable's unit; None if it does not.
        fails: Whether a stated limit is exceeded.
        advice: What to do.
    """

    variable: str
    term: str
    form: str
    condition: float
    overshoot: float
    rise: float
    where: tuple[float, float] | None
    fails: bool
    advice: str


class Stability(msgspec.Struct, frozen=True):
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
        curves: Terms with something to know about, worst first.
        usable: By what the inputs can be multiplied.
        offsets: What a distance from zero costs.
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
    curves: tuple[CurveFault, ...] = ()
    usable: tuple[Usable, ...] = ()
    offsets: tuple[OffsetCost, ...] = ()

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
    "N2b": "inputs 20 decades apart in size change no bit",
    "N3": "row order, copies and batch size change no bit",
    "N4": "terms without width and unusual batches work",
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
