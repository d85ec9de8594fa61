"""Why a model decides one row as it does, as frozen values."""

from __future__ import annotations

from typing import Final, Literal

import msgspec

from fuzzytree.model import Result, Value, summary

FORMAT: Final = "fuzzytree-why/1"

ChangeVerdict = Literal["PROVED", "BOUNDED", "NONE", "OPEN"]


class Cell(Value, frozen=True):
    """A value of an input.

    Attributes:
        input: The input.
        value: The number that the model computes with; None if it is missing.
        text: The value as a table has it: a category, a date, or a number.
    """

    input: str
    value: float | None
    text: str


class Contribution(Value, frozen=True):
    """What an input adds to a combination: its weight times its distance to a centre.

    `text` is the value as a table has it.
    """

    input: str
    text: str
    amount: float


class Reason(Value, frozen=True):
    """What a rule says of one variable, and how true it is for the row.

    Attributes:
        proposition: Such as `proline is low`.
        text: The value of the variable, as a table has it.
        value: The same as a number.
        degree: How far the proposition is true, in [0, 1].
        cut: The nearest value at which the degree leaves 1, or comes to it; None where
            it has none, and of categories.
        distance: The value minus the cut, in the unit of the variable.
        cut_text: The cut, as a table has it.
        unit: Of the value, the cut and the distance; `days` of dates.
        parts: Of a combination, what each input adds, the largest first.
    """

    proposition: str
    text: str
    value: float
    degree: float
    cut: float | None = None
    distance: float | None = None
    cut_text: str = ""
    unit: str = ""
    parts: tuple[Contribution, ...] = ()


class ClassShare(Value, frozen=True):
    """A class at the row.

    Attributes:
        label: The class.
        probability: Its probability; None if the model has none.
        strength: The strength of its strongest rule, 0 without one.
        rows: How many training rows of it the winning rule has; None if unknown.
    """

    label: str
    probability: float | None
    strength: float
    rows: int | None


class RunnerUp(Value, frozen=True):
    """The strongest rule of another class.

    Attributes:
        rule: Its number, from 1.
        label: Its class.
        strength: Its strength, not above that of the winning rule.
        reason: Its proposition with the lowest degree; None of a rule without any.
    """

    rule: int
    label: str
    strength: float
    reason: Reason | None


class Move(Value, frozen=True):
    """The change of one input, from `old` to `new`, and what it costs."""

    old: Cell
    new: Cell
    cost: float


class RowChange(Value, frozen=True):
    """The smallest change of the inputs that gives another class.

    Attributes:
        verdict: `PROVED`: no other change costs less, but for a few thousandths.
            `BOUNDED`: none costs less than `low`. `NONE`: it is proved that no change
            gives such a class. `OPEN`: no change is known, and none is ruled out.
        label: The class that it gives, as `run` confirms; None for no class.
        moves: The inputs that change, the costliest first; empty if none is known.
        cost: What the costliest of the moves costs.
        low: No change that gives such a class costs less.
        why: Why the cost is not proved, or why there is no change.
    """

    verdict: ChangeVerdict
    label: str | None = None
    moves: tuple[Move, ...] = ()
    cost: float | None = None
    low: float = 0.0
    why: str = ""


class Share(Value, frozen=True):
    """A number of one output: a share, or the output itself."""

    output: str
    value: float


class FiredRule(Value, frozen=True):
    """A rule of a system that fires.

    Attributes:
        rule: Its number, from 1 over all blocks.
        sentence: The rule in words.
        degree: Its degree of activation, in [0, 1].
        shares: For each output that it concludes, its degree over the sum of the
            degrees of all rules that conclude it.
    """

    rule: int
    sentence: str
    degree: float
    shares: tuple[Share, ...]


class Slope(Value, frozen=True):
    """How much an output rises when an input rises by 1, near the row.

    It is the quotient of differences over 1/65,536 of the range of the input to both
    sides, or to the one side that lies in the range.
    """

    output: str
    input: str
    slope: float


class Explanation(Result, Value, frozen=True, kw_only=True):
    """Why a model decides one row as it does.

    Attributes:
        model: What the model calls itself.
        fingerprint: The SHA-256 of its content.
        row: The value of each input, as the row has it.
        filled: What stands for each value that is missing.
        status: How the answer came about, as `run` has it.
        rule: The number of the winning rule or leaf, from 1; 0 for none.
        label: The class; None for no class, and of a fuzzy system.
        unit: What changes cost: a share of each input's range, or the costs that were
            given.
        wanted: The class that a change shall give; None for any other.
        classes: The classes, the predicted one first.
        because: What the winning rule says of each variable; empty without one.
        runner_up: The strongest rule of another class; where none of them fires, the
            one that the change leads to.
        change: The smallest change that gives another class; None of a fuzzy system,
            and where the row has the wanted class already.
        alone: The smallest change of one input alone, where the smallest of all changes
            more than one.
        outputs: The outputs of a fuzzy system.
        fired: Its rules that fire, the strongest first.
        slopes: How its outputs change near the row.
    """

    version: str
    model: str
    fingerprint: str
    row: tuple[Cell, ...]
    filled: tuple[Cell, ...] = ()
    status: str = "decided"
    rule: int = 0
    label: str | None = None
    unit: Literal["range", "cost"] = "range"
    wanted: str | None = None
    classes: tuple[ClassShare, ...] = ()
    because: tuple[Reason, ...] = ()
    runner_up: RunnerUp | None = None
    change: RowChange | None = None
    alone: RowChange | None = None
    outputs: tuple[Share, ...] = ()
    fired: tuple[FiredRule, ...] = ()
    slopes: tuple[Slope, ...] = ()
    format: Literal["fuzzytree-why/1"] = FORMAT

    def __repr__(self) -> str:
        """Show what is decided; `str` shows why."""
        if self.outputs:
            return summary("Explanation", outputs=len(self.outputs))
        return f"Explanation({self.label!r}, rule {self.rule})"

    def to_json(self) -> str:
        """Return everything as JSON; see `schemas/why.schema.json`."""
        return msgspec.json.format(msgspec.json.encode(self), indent=2).decode()
