"""Why a model answers one row as it does, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

import msgspec

from fuzzytree.model import Result, Value

FORMAT: Final = "fuzzytree-why/1"


class Reason(Value, frozen=True):
    """What a rule says of one variable, and how true it is for the row.

    Attributes:
        proposition: Such as `proline is low`.
        value: The value of the variable.
        text: The same as a table has it.
        degree: How far the proposition is true, in [0, 1].
        cut: The nearest value at which the degree leaves 1; None of a category, or if
            there is none.
        cut_text: The same as a table has it.
        unit: Of the value; `days` of a date.
        parts: Of a combination what each input adds, the largest first.
    """

    proposition: str
    value: float
    text: str
    degree: float
    cut: float | None = None
    cut_text: str = ""
    unit: str = ""
    parts: Mapping[str, float] = {}


class RunnerUp(Value, frozen=True):
    """A rule of another class, and its proposition with the lowest degree, if any."""

    rule: int
    label: str
    reason: Reason | None


class Move(Value, frozen=True):
    """The change of an input to a value, from a text to a text, and what it costs."""

    input: str
    old: str
    new: str
    value: float
    cost: float


class RowChange(Value, frozen=True):
    """The smallest change of the inputs that gives another class.

    Attributes:
        verdict: `PROVED`: no other change costs less, but for five thousandths.
            `BOUNDED`: none costs less than `low`. `NONE`: it is proved that no change
            gives such a class. `OPEN`: no change is known, and none is ruled out.
        label: The class that it gives, as `run` confirms; None for no class.
        moves: The inputs that change, the costliest first.
        cost: What the costliest of the moves costs.
        low: No change that gives such a class costs less.
        why: Why it is not proved.
    """

    verdict: Literal["PROVED", "BOUNDED", "NONE", "OPEN"]
    label: str | None = None
    moves: tuple[Move, ...] = ()
    cost: float = 0.0
    low: float = 0.0
    why: str = ""


class FiredRule(Value, frozen=True):
    """A rule of a system that fires, its number from 1 over all blocks.

    `shares` has its degree of activation over the sum of all, by output.
    """

    rule: int
    sentence: str
    degree: float
    shares: Mapping[str, float]


class Explanation(Result, Value, frozen=True, kw_only=True):
    """Why a model answers one row as it does.

    Attributes:
        model: What the model calls itself.
        fingerprint: The SHA-256 of its content.
        row: The value of each input, as a table has it.
        filled: What stands for missing values, by input.
        status: How the answer came about, as `run` has it.
        rule: The number of the winning rule or leaf, from 1; 0 for none.
        label: The class; None for no class, and of a fuzzy system.
        probabilities: By class; empty if the model has none.
        strengths: Of the strongest rule of each class.
        counts: The training rows of the winning rule by class; empty if unknown.
        because: What the winning rule says of each variable.
        runner_up: The strongest rule of another class; where none fires, the one to
            which the change leads.
        wanted: The class that a change shall give; None for any other.
        unit: What changes cost: a share of each input's range, or costs.
        change: The smallest change; None where the row has the wanted class, and of a
            fuzzy system.
        alone: The smallest change of one input, where the smallest of all has more.
        outputs: The outputs of a fuzzy system.
        fired: Its rules that fire, the strongest first.
        slopes: By output, how much it rises when each input rises by 1, near the row.
    """

    version: str
    model: str
    fingerprint: str
    row: Mapping[str, str]
    filled: Mapping[str, str] = {}
    status: str = "decided"
    rule: int = 0
    label: str | None = None
    probabilities: Mapping[str, float] = {}
    strengths: Mapping[str, float] = {}
    counts: Mapping[str, int] = {}
    because: tuple[Reason, ...] = ()
    runner_up: RunnerUp | None = None
    wanted: str | None = None
    unit: Literal["range", "cost"] = "range"
    change: RowChange | None = None
    alone: RowChange | None = None
    outputs: Mapping[str, float] = {}
    fired: tuple[FiredRule, ...] = ()
    slopes: Mapping[str, Mapping[str, float]] = {}
    format: Literal["fuzzytree-why/1"] = FORMAT

    def __repr__(self) -> str:
        """Show what is answered; `str` shows why."""
        return f"Explanation({dict(self.outputs) or self.label!r})"

    def to_json(self) -> str:
        """Return everything as JSON; see `schemas/why.schema.json`."""
        return msgspec.json.format(msgspec.json.encode(self), indent=2).decode()
