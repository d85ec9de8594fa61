"""An audit as frozen values: the questions, the answers, and how they are known."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Final, Literal

import msgspec

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.decide.states import Span, State
from fuzzytree.model import Result, Value, summary
from fuzzytree.rechecking import LIMITS as LIMITS
from fuzzytree.rechecking import digest_of as digest_of_facts

FORMAT: Final = "fuzzytree-audit/1"
INTERRUPTED: Final = "interrupted"
"""How a sentence of `Audit.unasked` ends where Ctrl-C is the reason."""

Severity = Literal["error", "warning", "info"]
Scalar = str | int | float | None
FactValue = Scalar | tuple[tuple[Scalar, ...], ...]
"""A text, a number, None for no class, or rows of these."""


class FileLocation(Value, frozen=True):
    """Where something stands in the model's file."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        """Return it as compilers do."""
        return f"{self.file}:{self.line}:{self.column}"


class TermName(Value, frozen=True):
    """A term of a variable."""

    variable: str
    term: str


class Measure(Value, frozen=True):
    """A number that belongs to an answer; `exact` is `p/q`, where it is known."""

    name: str
    value: float
    exact: str | None = None
    unit: str = ""


class AuditAnswer(Value, frozen=True):
    """One question about a model, and what is known.

    Attributes:
        code: The kind of question, such as `FT101`.
        subject: The subject of the question, such as `rule 3`.
        sentence: The answer as one sentence without its code.
        state: How it is known.
        is_finding: Whether it is something that a reader should see; the others show
            that it was checked.
        severity: Of the finding.
        rules: The numbers of the rules concerned, from 1, the most concerned first.
        terms: The terms concerned.
        region: Where it holds, as a box of only the variables that matter.
        measures: Numbers that belong to it.
        places: Where the rules and terms stand in the file, in that order.
        repeat: The command that finds it again.
        id: Names the finding across releases: the code and a hash of what the rules
            and terms concerned say, whatever their order in the file is.
        message: The kind of sentence; see `fuzzytree.rechecking.sentences`.
        facts: What the sentence says besides.
    """

    code: str
    subject: str
    sentence: str
    state: State
    is_finding: bool
    severity: Severity = "info"
    rules: tuple[int, ...] = ()
    terms: tuple[TermName, ...] = ()
    region: tuple[Span, ...] = ()
    measures: tuple[Measure, ...] = ()
    places: tuple[FileLocation, ...] = ()
    repeat: str = ""
    id: str = ""
    message: str = ""
    facts: Mapping[str, FactValue] = {}


class AuditSelection(msgspec.Struct, frozen=True, kw_only=True):
    """Which findings an audit looks for.

    Attributes:
        select: Beginnings of the codes to examine, such as `FT1`; all if empty.
        skip: Beginnings of the codes to leave out.
        accepted: Ids of findings that a baseline accepts.
    """

    select: Sequence[str] = ()
    skip: Sequence[str] = ()
    accepted: Collection[str] = ()


class AuditSettings(Value, frozen=True):
    """The thresholds of an audit, and its budget.

    Attributes:
        epsilon: An input is covered if some rule is at least as strong as this.
        margin: Two classes are close if their strengths differ by at most this.
        lead: A rule that never leads by this much is marginal.
        level: Two rules of different classes conflict where both reach this.
        overlap: Two terms of a variable are hard to distinguish from this share on.
        rows: How many rows a sampled share looks at.
        seed: Of what is drawn.
        budget: How many million steps the proofs may take; above 0. A million is about
            a second of work, and the same answers on any machine.
    """

    epsilon: float = 0.1
    margin: float = 0.01
    lead: float = 0.01
    level: float = 0.5
    overlap: float = 0.75
    rows: int = 20_000
    seed: int = 0
    budget: float = 60.0


class SourceFile(Value, frozen=True):
    """A file: its name, and the SHA-256 of its bytes."""

    name: str
    sha256: str


class VerbResult(Value, frozen=True):
    """What another verb found of the same model, as the user gave it.

    Of `parts` comparisons and bounds, or criteria, `wrong` disagree, or fail.
    """

    verb: Literal["check", "stability"]
    file: SourceFile
    parts: int
    wrong: int


class Policy(Value, frozen=True):
    """How the audited rules decide, which says which questions apply.

    The class is that of the first of the `strongest` rules, or `all` that fire take
    part in the answer. Where none fires it is `uncovered`, without a value `missing`.
    """

    conjunction: str
    decision: Literal["strongest", "all"]
    uncovered: str | None = None
    missing: str | None = None


class Audit(Result, Value, frozen=True):
    """The result of an audit.

    Attributes:
        form: What was audited: `tree`, `relative rules`, `raw rules`, `rules` or
            `system`.
        fingerprint: The SHA-256 of the model's content.
        file: Where it was read from, None if from memory.
        data: The table that was given, if one was; `rows` is how many it has.
        answers: All answers, findings and others, in order of their codes.
        unasked: Questions without an answer and why, in sentences: left out by the
            user, the budget or an interruption.
        limits: What this audit does not establish: fixed sentences.
        is_complete: Whether nothing was cut short.
        accepted: The ids of findings that the user's baseline accepts.
        results: What other verbs found of the same model, if that was given.
        numbers: Of a fuzzy system the number in the file, over all blocks, of each rule
            that answers and claims count; empty where the two are the same.
        digest: The SHA-256 of all else, as canonical JSON; see `digest_of`.
    """

    version: str
    model: str
    form: str
    fingerprint: str
    file: SourceFile | None
    data: SourceFile | None
    rows: int
    policy: Policy
    domain: Domain
    settings: AuditSettings
    answers: tuple[AuditAnswer, ...]
    unasked: tuple[str, ...]
    limits: tuple[str, ...]
    is_complete: bool
    accepted: tuple[str, ...] = ()
    results: tuple[VerbResult, ...] = ()
    numbers: tuple[int, ...] = ()
    digest: str = ""
    format: Literal["fuzzytree-audit/1"] = FORMAT

    @property
    def findings(self) -> tuple[AuditAnswer, ...]:
        """The answers that a reader should see."""
        return tuple(answer for answer in self.answers if answer.is_finding)

    @property
    def open_findings(self) -> tuple[AuditAnswer, ...]:
        """The findings that no baseline accepts."""
        accepted = set(self.accepted)
        return tuple(answer for answer in self.findings if answer.id not in accepted)

    def __repr__(self) -> str:
        """Show how many answers there are, and how many of them are findings."""
        findings = len(self.open_findings)
        return summary("Audit", answers=len(self.answers), findings=findings)

    def to_json(self) -> str:
        """Return the audit for programs, and for `recheck`, as indented JSON."""
        return msgspec.json.format(msgspec.json.encode(self), indent=2).decode()

    @property
    def was_interrupted(self) -> bool:
        """Whether Ctrl-C cut it short."""
        return any(text.endswith(INTERRUPTED) for text in self.unasked)


def digest_of(audit: Audit) -> str:
    """Return the SHA-256 of an audit's canonical JSON, as 64 hexadecimal digits.

    The canonical JSON has sorted keys, no spaces, every character as it is, and an
    empty digest: `json.dumps(facts, sort_keys=True, separators=(",", ":"),
    ensure_ascii=False)` of what the file holds, as UTF-8.
    """
    return digest_of_facts(json.loads(msgspec.json.encode(audit)))
