"""What an audit is about, in the form that every family of questions takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final, TypeVar

import msgspec

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError, enforced
from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.states import Declined, counted
from fuzzytree.auditing.findings.codes import note
from fuzzytree.auditing.findings.records import (
    Answer,
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
        given: What other verbs found of the model.
    """

    model: Document
    file: ModelFile | None = None
    rows: AuditRows | None = None
    data: SourceFile | None = None
    given: tuple[LoadedResult, ...] = ()


class Subject(msgspec.Struct, frozen=True, eq=False):
    """A model as it is audited.

    Attributes:
        rules: The rules: of a tree its relative rules, which decide as it does; of a
            system a view of it, whose classes are the texts of conclusions.
        policy: How the rules decide.
        domain: The domain of all questions.
        settings: The thresholds.
        clock: How much time is left.
        tree: The tree that the rules come from.
        raw: The tree's raw rules, if it has fitted sets.
        system: The system that the rules are a view of.
        rows: The user's rows.
        rule_names: Texts such as `rule 2 of block 1` for the rules of a system, one for
            each rule; empty where rules are simply numbered.
        declined: What the view could not take over, as answers.
        is_whole: Whether no rule is left out of the view that may fire. Otherwise what
            no rule of it covers may be covered all the same, and a term that no rule of
            it uses may be used.
        bounds: Lower and upper rules; None if the rules are exact as they stand here.
    """

    rules: RuleBase
    policy: Policy
    domain: Domain
    settings: AuditSettings
    clock: Clock
    tree: FuzzyTree | None = None
    raw: RuleBase | None = None
    system: FuzzySystem | None = None
    rows: AuditRows | None = None
    rule_names: tuple[str, ...] = ()
    declined: tuple[Answer, ...] = ()
    is_whole: bool = True
    bounds: BoundedRules | None = None

    def rule_name(self, number: int) -> str:
        """Return what messages call a rule."""
        return self.rule_names[number - 1] if self.rule_names else f"rule {number}"


_MOST: Final = 0.25  # of the time that is left, for one question
_FAIR: Final = 4.0  # times as much as its own share may one of many take

_Found = TypeVar("_Found")


class TimeSlices:
    """Many questions of one kind that share the remaining time.

    Attributes:
        left_out: How many were not answered; the caller counts them.
    """

    def __init__(self, clock: Clock, part: float) -> None:
        self.clock = clock.share(part)
        self.left_out = 0

    def run(self, left: int, question: Callable[[Clock], _Found]) -> _Found | None:
        """Return the answer to a question, None if the time does not suffice.

        Args:
            left: How many questions are left, this one too; at least 1.
            question: Called with a clock of its own, which its steps check.
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
        """Yield that some questions are open, if there are any."""
        if self.left_out:
            reason = "the budget was spent"
            of = counted(self.left_out, noun)
            sentence = f"{what} is not known for {of}: {reason}"
            yield note(code, f"{of} left open", sentence, Declined("FTD03", reason))
