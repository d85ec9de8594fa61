"""What requirements claim of a model, and the record of how it turns out."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import msgspec

from fuzzytree.model import Result, Value, summary

FORMAT: Final = "fuzzytree-require/1"

Verdict = Literal["PROVED", "REFUTED", "OPEN"]
Box = dict[str, tuple[float, float]]
"""The least and the largest value of the inputs that conditions limit."""


class ClassClaim(NamedTuple):
    """The class is one of some; None among them allows that no rule fires."""

    labels: tuple[str | None, ...]


class OrderClaim(NamedTuple):
    """As an input rises, no class follows one that stands behind it in `labels`."""

    input: str
    labels: tuple[str, ...]


class ConstancyClaim(NamedTuple):
    """No prediction depends on some inputs."""

    columns: tuple[str, ...]


class CoverageClaim(NamedTuple):
    """Every output of a system has a number that rules conclude."""


class NumberClaim(NamedTuple):
    """An output, or its change per unit of an input, lies between two numbers."""

    output: str
    low: float = -math.inf
    high: float = math.inf
    input: str = ""


Claim = ClassClaim | OrderClaim | ConstancyClaim | CoverageClaim | NumberClaim


class Requirement(NamedTuple):
    """A sentence, as a claim about all rows in some boxes of inputs.

    `line` and `column` say where it stands in its file, and are 0 without one.
    """

    text: str
    claim: Claim
    boxes: tuple[Box, ...]
    name: str = ""
    why: str = ""
    line: int = 0
    column: int = 0


class RequirementAnswer(Value, frozen=True):
    """What is known of one requirement.

    Attributes:
        line: Where it stands in its file, from 1; 0 without one.
        verdict: `PROVED`: true for every row. `REFUTED`: not for the rows below.
        sentence: How it is proved, what the rows show, or why it is open.
        bound: Of an open one, the nearest number that is proved in place of its own.
        rows: A table that `fuzzytree run` reads: the rows that refute it.
        predictions: What the model gives for each of them.
    """

    requirement: str
    name: str
    why: str
    line: int
    column: int
    verdict: Verdict
    sentence: str
    bound: float | None = None
    rows: str = ""
    predictions: tuple[str, ...] = ()


class Compliance(Result, Value, frozen=True):
    """Which requirements a model meets.

    Attributes:
        model: The file of the model, or what the model calls itself.
        fingerprint: The SHA-256 of its content.
        source: The file of the requirements; "" without one.
        steps: The budget of each question.
        answers: One for each requirement, in order.
    """

    version: str
    model: str
    fingerprint: str
    source: str
    steps: int
    answers: tuple[RequirementAnswer, ...]
    format: Literal["fuzzytree-require/1"] = FORMAT

    def __repr__(self) -> str:
        """Show how many requirements there are, and how many of them are proved."""
        count, proved = len(self.answers), self.count("PROVED")
        return summary("Compliance", requirements=count, proved=proved)

    @property
    def ok(self) -> bool:
        """Whether every requirement is proved."""
        return self.count("PROVED") == len(self.answers)

    def count(self, verdict: Verdict) -> int:
        """Return how many requirements have a verdict."""
        return sum(answer.verdict == verdict for answer in self.answers)

    def to_json(self) -> str:
        """Return everything as JSON; see `schemas/require.schema.json`."""
        facts = {"ok": self.ok, **msgspec.to_builtins(self)}
        return msgspec.json.format(msgspec.json.encode(facts), indent=2).decode()
