"""What an audit is about, in the form that every family of questions takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Final, TypeVar

import msgspec

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError, enforced
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.states import Declined, counted
from fuzzytree.auditing.findings.codes import audit_answer
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSettings,
    Policy,
    SourceFile,
)
from fuzzytree.auditing.findings.rule_bounds import BoundedRules
from fuzzytree.model import Document, FuzzySystem, FuzzyTree, RuleBase

if TYPE_CHECKING:
    from fuzzytree.auditing.findings.locations import ModelFile
    from fuzzytree.auditing.findings.results import LoadedResult
    from fuzzytree.model import FloatArray, IntArray


class AuditRows(msgspec.Struct, frozen=True, eq=False):
    """Rows of a table.

    Attributes:
        name: What messages call the table.
        values: Shape (inputs, rows), in the order of the model's inputs.
        codes: The number of each row's class, -1 if it has none of the model's; None
            if the table has no column of classes.
    """

    name: str
    values: FloatArray
    codes: IntArray | None = None


class Material(msgspec.Struct, frozen=True, eq=False):
    """What an audit is about, each file of it read once: it may change meanwhile.

    Attributes:
        model: The model.
        file: Where it was read from; None if from memory.
        rows: The user's rows.
        data: The table that they come from, if it is a file.
        results: What other verbs found of the model.
    """

    model: Document
    file: ModelFile | None = None
    rows: AuditRows | None = None
    data: SourceFile | None = None
    results: tuple[LoadedResult, ...] = ()


class AuditView(msgspec.Struct, frozen=True, eq=False):
    """A model's rules as they are audited.

    Attributes:
        rules: The rules as people read them, without weights, each inexact curve
            as its lower bound; None if not one rule of a system could be
            taken over.
        policy: How they decide.
        domain: The domain: where inputs are moved into their range, not
            beyond it.
        tree: The tree they come from.
        raw: Its raw rules, if it has fitted sets.
        system: The system they come from.
        rule_names: Such as `rule 2 of block 1` for each rule; empty where rules
            are simply numbered.
        numbers: The number in the model of each rule, from 1, over all blocks.
        declined: What was left out, and why; and rules that can never fire.
        left_out: The number in the model of each rule that is named there.
        is_whole: Whether no rule is left out that may fire. Otherwise where no rule of
            the view fires another one may.
        bounds: The rules from below and from above; None if they are plain.
    """

    rules: RuleBase | None
    policy: Policy
    domain: Domain
    tree: FuzzyTree | None = None
    raw: RuleBase | None = None
    system: FuzzySystem | None = None
    rule_names: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()
    declined: tuple[AuditAnswer, ...] = ()
    is_whole: bool = True
    bounds: BoundedRules | None = None
    left_out: Mapping[str, int] = {}

    def rule_name(self, number: int) -> str:
        """Return what messages call a rule."""
        return self.rule_names[number - 1] if self.rule_names else f"rule {number}"


class Subject(AuditView, frozen=True, eq=False, kw_only=True):
    """A model as the families of questions receive it.

    Attributes:
        rules: As in a view, at least one.
        settings: The thresholds.
        clock: How much time is left.
        rows: The user's rows.
    """

    rules: RuleBase
    settings: AuditSettings
    clock: Clock
    rows: AuditRows | None = None


_MOST: Final = 0.25  # of the time that is left, for one question
_FAIR: Final = 4.0  # times as much as its own share may one of many take

_Result = TypeVar("_Result")


class TimeSlices:
    """Many questions of one kind that share the remaining time.

    Attributes:
        left_out: How many were not answered; the caller counts them.
    """

    def __init__(self, clock: Clock, part: float) -> None:
        self.clock = clock.share(part)
        self.left_out = 0

    def run(self, left: int, question: Callable[[Clock], _Result]) -> _Result | None:
        """Return the answer to the first of `left` questions, None without time."""
        if self.clock.is_over:
            return None
        own = self.clock.share(min(_MOST, _FAIR / left))
        try:
            with enforced(own):
                return question(own)
        except OutOfTimeError:
            return None

    def rest(self, code: str, noun: str) -> Iterator[AuditAnswer]:
        """Yield that some questions are open, if there are any."""
        if self.left_out:
            yield audit_answer(
                f"{code}.left-open",
                f"{counted(self.left_out, noun)} left open",
                Declined("FTD03", "the budget was spent"),
                facts={"count": self.left_out},
            )
