"""An audit from its JSON: strict records."""

# ruff: noqa: D101 - docs/reference/audits.md says what the records hold

from __future__ import annotations

import json
import re
import sys
import types
from fractions import Fraction
from functools import lru_cache
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from fuzzytree.rechecking.outcomes import (
    CannotRunError,
    DoesNotHoldError,
    require,
)
from fuzzytree.rechecking.words import stretch
from fuzzytree.rechecking.yaml import MOST_BYTES


class Coordinate(NamedTuple):
    input: str
    exact: str
    decimal: str
    hex: str | None
    word: str


class Claim(NamedTuple):
    kind: Literal["strength", "beats", "ties", "below", "reaches", "decides"]
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
    word: str


class Proved(NamedTuple):
    how: str
    rivals: tuple[int, ...]
    confirmed: str


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
STATES: dict[object, Any] = {kind.__name__.upper(): kind for kind in get_args(State)}


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
    facts: dict[str, Any]

    def measure(self, name: str) -> float:
        """Return the value of a measure."""
        values = [m.value for m in self.measures if m.name == name]
        require(len(values) == 1, f"no single measure {name!r}")
        return values[0]

    @property
    def witness(self) -> Witness:
        """The state, which must be a witness."""
        if not isinstance(self.state, Witness):
            raise DoesNotHoldError("it needs a witness")
        return self.state


class DomainSide(NamedTuple):
    variable: str
    low: float
    high: float
    origin: Literal["model", "data", "spreads", "curves", "unused", "limits"]
    is_open: bool
    values: tuple[float, ...]
    is_whole: bool
    missing: float | None
    word: str

    @property
    def points(self) -> list[Fraction]:
        """The codes of categories, and the stand-in of a missing value."""
        stand_in = () if self.missing is None else (self.missing,)
        return [*map(Fraction, (*self.values, *stand_in))]

    def has(self, value: Fraction) -> bool:
        """Return whether a row can have a value."""
        return stretch(self, value, value).ends(self) is not None


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
    budget: float


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


class ComparedModel(NamedTuple):
    name: str
    form: str
    fingerprint: str
    file: Source | None


class Change(NamedTuple):
    grade: Literal["breaking", "non-breaking", "cosmetic"]
    is_proved: bool
    part: str
    sentence: str
    old_rules: tuple[int, ...]
    new_rules: tuple[int, ...]
    measures: tuple[Measure, ...]
    old: Place | None
    new: Place | None
    code: Literal["FT802"]


class Difference(NamedTuple):
    ok: bool
    verdict: Literal["equal", "changed", "open"]
    version: str
    old: ComparedModel
    new: ComparedModel
    data: Source | None
    rows: int
    domain: Domain
    settings: Settings
    changes: tuple[Change, ...]
    answers: tuple[Answer, ...]
    format: Literal["fuzzytree-diff/1"]


def fraction(text: str | None) -> Fraction:
    """Return a number that is written as `p/q` in lowest terms, or as `p`."""
    if text is None or not re.fullmatch("-?[0-9]{1,4000}(/[0-9]{1,4000})?", text):
        raise DoesNotHoldError(f"{text!s:.60} is no fraction")
    try:
        is_plain = str(Fraction(text)) == text and abs(Fraction(text)) < 2**1023
    except (ValueError, ZeroDivisionError):
        is_plain = False
    require(is_plain, f"{text:.60} is no fraction in lowest terms")
    return Fraction(text)


_hints = lru_cache(get_type_hints)
_LARGEST = sys.float_info.max


def decode(kind: Any, value: Any, where: str) -> Any:
    """Return facts as a record: every field must be there, and no other."""
    origin, choices = get_origin(kind), get_args(kind)
    if kind == State and isinstance(value, dict) and str(value.get("state")) in STATES:
        rest = {key: item for key, item in value.items() if key != "state"}
        return decode(STATES[value["state"]], rest, where)
    if origin is types.UnionType and type(None) in choices:
        return None if value is None else decode(choices[0], value, where)
    if origin is tuple and isinstance(value, list):
        every = enumerate(value, 1)
        return tuple(decode(choices[0], item, f"{where} {n}") for n, item in every)
    if origin is Literal and isinstance(value, str) and value in choices:
        return value
    if hasattr(kind, "_fields") and isinstance(value, dict):
        wrong = sorted(value.keys() ^ {*kind._fields})
        if wrong:
            shown = ", ".join(n if n.isidentifier() else repr(n) for n in wrong)
            raise CannotRunError(f"{where}: missing or unknown: {shown:.200}")
        of = _hints(kind)
        return kind(**{n: decode(of[n], v, f"{where}, {n}") for n, v in value.items()})
    number: Any = value
    if kind is float and type(value) in (int, float) and abs(number) <= _LARGEST:
        return float(number)
    if kind in (str, int, bool, dict[str, Any]) and type(value) is (origin or kind):
        return value
    raise CannotRunError(f"{where}: it cannot be {value!r:.60}")


def read_json(content: bytes, name: str) -> dict[str, Any]:
    """Return the facts of a file of JSON, whose keys are unique and numbers finite."""

    def refuse(why: str) -> Any:
        raise CannotRunError(f"{name}: {why}")

    def once(pairs: list[tuple[str, Any]]) -> Any:
        facts = dict(pairs)
        is_once = len(facts) == len(pairs)
        return facts if is_once else refuse("a key stands twice in one object")

    def constant(text: str) -> Any:
        return refuse(f"{text} is no number that JSON knows")

    if len(content) > MOST_BYTES:
        refuse(f"more than {MOST_BYTES:,} bytes")
    try:
        facts = json.loads(content, object_pairs_hook=once, parse_constant=constant)
        json.dumps(facts, ensure_ascii=False, allow_nan=False).encode()
    except CannotRunError:
        raise
    except (ValueError, RecursionError) as error:
        raise CannotRunError(f"{name}: not JSON: {error!s:.100}") from error
    return facts if isinstance(facts, dict) else refuse("an object is needed")
