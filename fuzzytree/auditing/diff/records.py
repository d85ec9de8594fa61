"""How one model differs from another, as frozen values; changes and their grades."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import msgspec

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import (
    Bracket,
    Computed,
    Declined,
    Proved,
    Witness,
)
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    AuditSettings,
    FileLocation,
    Measure,
    SourceFile,
)
from fuzzytree.model import Result, Value

FORMAT: Final = "fuzzytree-diff/1"

Grade = Literal["breaking", "non-breaking", "cosmetic"]
Verdict = Literal["equal", "changed", "open"]


class Change(Value, frozen=True):
    """One change from the old model to the new one.

    Attributes:
        grade: `breaking`: a decision is known to change by it, or callers of the
            model must change. `non-breaking`: none is known to, although strengths
            may. `cosmetic`: it is for people only.
        is_proved: Whether the grade is certain; it is not for a non-breaking change
            while decisions are not proved equal.
        part: What has changed: `class`, `input`, `combination`, `term`, `rule`,
            `order`, `answer`, `range`, `unit`, `name`, `columns` or `support`; of a
            system also `output` or `block`.
        sentence: The change, as one sentence.
        old_rules: The numbers of the old rules concerned, from 1.
        new_rules: The numbers of the new rules concerned.
        measures: Numbers that belong to it, such as how far two curves are apart.
        old: Where it stands in the old file.
        new: Where it stands in the new file.
        code: The kind of finding.
    """

    grade: Grade
    is_proved: bool
    part: str
    sentence: str
    old_rules: tuple[int, ...] = ()
    new_rules: tuple[int, ...] = ()
    measures: tuple[Measure, ...] = ()
    old: FileLocation | None = None
    new: FileLocation | None = None
    code: Literal["FT802"] = "FT802"


class ComparedModel(Value, frozen=True):
    """One of the two models.

    Attributes:
        name: What it calls itself.
        form: What it is: `tree`, `rules` or `system`.
        fingerprint: The SHA-256 of its content.
        file: Where it was read from, None if from memory.
    """

    name: str
    form: str
    fingerprint: str
    file: SourceFile | None = None


class Difference(Result, Value, frozen=True):
    """What has changed from one model to another, and which decisions do.

    Attributes:
        version: Of fuzzytree.
        old: The first model.
        new: The second one.
        data: The table that was given, if one was.
        rows: How many rows it has.
        domain: Where decisions were compared.
        settings: The rows that were drawn, their seed and the budget; of no other
            meaning here.
        changes: What is said otherwise, breaking ones first.
        answers: What is known of decisions: where they differ, or that they do not.
    """

    version: str
    old: ComparedModel
    new: ComparedModel
    data: SourceFile | None
    rows: int
    domain: Domain
    settings: AuditSettings
    changes: tuple[Change, ...]
    answers: tuple[AuditAnswer, ...]
    format: Literal["fuzzytree-diff/1"] = FORMAT

    def __repr__(self) -> str:
        """Show how many changes there are, and what is known of the decisions."""
        count = len(self.changes)
        noun = "change" if count == 1 else "changes"
        return f"Difference({count} {noun}, decisions {self.verdict})"

    @property
    def verdict(self) -> Verdict:
        """Whether decisions are shown to be equal, known to change, or neither."""
        if any(answer.is_finding for answer in self.answers):
            return "changed"
        equal = any(
            isinstance(answer.state, Proved | Computed)
            for answer in self.answers
            if answer.subject == "decisions"
        )
        is_open = any(isinstance(a.state, Bracket | Declined) for a in self.answers)
        return "equal" if equal and not is_open else "open"

    @property
    def ok(self) -> bool:
        """Whether nothing breaks: no decision is known to change, and no caller must.

        What is not proved equal is `ok` too; see `verdict`.
        """
        breaks = any(change.grade == "breaking" for change in self.changes)
        return self.verdict != "changed" and not breaks

    @property
    def witnesses(self) -> tuple[Witness, ...]:
        """The points at which the two are shown to answer otherwise."""
        return tuple(a.state for a in self.answers if isinstance(a.state, Witness))

    def to_json(self) -> str:
        """Return everything as JSON; see `schemas/diff.schema.json`."""
        facts = {"ok": self.ok, "verdict": self.verdict, **msgspec.to_builtins(self)}
        return msgspec.json.format(msgspec.json.encode(facts), indent=2).decode()


class Evidence(NamedTuple):
    """How decisions or numbers that differ come about.

    Attributes:
        old_rules: The old rules that win there.
        new_rules: The new rules that win there.
        has_tie: Whether two rules are equally strong in one of them.
        has_none: Whether no rule fires in one of them.
        is_equal: Whether decisions, or numbers, are proved equal.
        has_number: Whether a number of two systems differs.
    """

    old_rules: frozenset[int] = frozenset()
    new_rules: frozenset[int] = frozenset()
    has_tie: bool = False
    has_none: bool = False
    is_equal: bool = False
    has_number: bool = False

    @property
    def has_any(self) -> bool:
        """Whether some decision, or some number, differs."""
        rules = self.old_rules or self.new_rules
        return bool(rules or self.has_none or self.has_number)
