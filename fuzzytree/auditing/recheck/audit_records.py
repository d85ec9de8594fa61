"""The fields of an audit."""

# ruff: noqa: D101 - docs/how-to/recheck.md says what the records hold

from __future__ import annotations

import re
from fractions import Fraction
from typing import Literal, NamedTuple

from fuzzytree.auditing.recheck.outcomes import DoesNotHoldError, require


class Coordinate(NamedTuple):
    input: str
    exact: str
    decimal: str
    hex: str | None


class Claim(NamedTuple):
    kind: Literal[
        "strength", "beats", "ties", "below", "reaches", "decides", "degree", "covered"
    ]
    of: Literal["rules", "tree", "raw rules", "old", "new"]
    rules: tuple[int, ...]
    rivals: tuple[int, ...]
    level: str | None
    label: str | None
    variable: str | None
    term: str | None


class Span(NamedTuple):
    variable: str
    low: float | None
    high: float | None


class Proved(NamedTuple):
    how: str


class Computed(NamedTuple):
    how: str


class Witness(NamedTuple):
    point: tuple[Coordinate, ...]
    claims: tuple[Claim, ...]
    region: tuple[Span, ...]


class Bracket(NamedTuple):
    of: str
    low: float
    high: float
    why: str
    point: tuple[Coordinate, ...]
    claims: tuple[Claim, ...]


class Sampled(NamedTuple):
    of: str
    hits: int
    rows: int
    low: float
    high: float
    confidence: float
    how: str


class Declined(NamedTuple):
    code: str
    reason: str


State = Proved | Computed | Witness | Bracket | Sampled | Declined


class Label(NamedTuple):
    variable: str
    term: str


class Measure(NamedTuple):
    name: str
    value: float
    exact: str | None
    unit: str


class Place(NamedTuple):
    file: str
    line: int
    column: int


class Answer(NamedTuple):
    code: str
    subject: str
    sentence: str
    state: State
    is_finding: bool
    severity: Literal["error", "warning", "info"]
    rules: tuple[int, ...]
    terms: tuple[Label, ...]
    region: tuple[Span, ...]
    measures: tuple[Measure, ...]
    places: tuple[Place, ...]
    repeat: str
    id: str
    message: str
    facts: dict[str, object]


class DomainSide(NamedTuple):
    variable: str
    low: float
    high: float
    origin: Literal["model", "data", "spreads", "curves", "unused", "limits"]
    is_open: bool


class Domain(NamedTuple):
    sides: tuple[DomainSide, ...]


class Policy(NamedTuple):
    conjunction: str
    decision: Literal["strongest", "all"]
    uncovered: str | None
    missing: str | None


class Settings(NamedTuple):
    epsilon: float
    margin: float
    lead: float
    level: float
    overlap: float
    rows: int
    seed: int
    budget_s: float


class Source(NamedTuple):
    name: str
    sha256: str


class Result(NamedTuple):
    verb: Literal["check", "stability"]
    file: Source
    parts: int
    wrong: int


class Audit(NamedTuple):
    version: str
    model: str
    form: Literal["tree", "relative rules", "raw rules", "rules", "system"]
    fingerprint: str
    file: Source | None
    data: Source | None
    rows: int
    policy: Policy
    domain: Domain
    settings: Settings
    answers: tuple[Answer, ...]
    unasked: tuple[str, ...]
    limits: tuple[str, ...]
    is_complete: bool
    accepted: tuple[str, ...]
    results: tuple[Result, ...]
    numbers: tuple[int, ...]
    digest: str
    format: Literal["fuzzytree-audit/1"]


def fraction(text: str) -> Fraction:
    """Return a number that is written as `p/q` in lowest terms, or as `p`."""
    if not re.fullmatch("-?[0-9]{1,4000}(/[0-9]{1,4000})?", text):
        raise DoesNotHoldError(f"{text:.60} is no fraction")
    try:
        is_plain = str(Fraction(text)) == text and abs(Fraction(text)) < 2**1023
    except (ValueError, ZeroDivisionError):
        is_plain = False
    require(is_plain, f"{text:.60} is no fraction in lowest terms")
    return Fraction(text)
