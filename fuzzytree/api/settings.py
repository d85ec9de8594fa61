"""The settings of verbs as keywords: the fields of their structs, with the types."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TypedDict, TypeVar

import msgspec

from fuzzytree import auditing  # of which nothing is loaded before it is used
from fuzzytree.learning import refuse_unknown
from fuzzytree.model import Kind

S = TypeVar("S", bound=msgspec.Struct)


class DrawArguments(TypedDict, total=False):
    """The fields of `AuditSettings` that say which rows are drawn."""

    rows: int
    seed: int


class AuditArguments(DrawArguments, total=False):
    """The fields of `AuditSettings`, `AuditDomain` and `AuditSelection`."""

    epsilon: float
    margin: float
    lead: float
    level: float
    overlap: float
    budget: float
    within: auditing.Within
    spreads: float | None
    limits: auditing.Limits
    row: Mapping[str, float | str] | None
    select: Sequence[str]
    skip: Sequence[str]
    accepted: Collection[str]


class CheckArguments(TypedDict, total=False):
    """The fields of `CheckSettings`."""

    limit: int | None
    rows_only: bool
    run_code: bool
    terms: Kind
    tolerance: float


class BenchArguments(TypedDict, total=False):
    """The fields of `BenchSettings`."""

    rows: tuple[int, ...]
    threads: tuple[int, ...]
    most: float | None
    budget_s: float
    rounds: int
    seed: int
    peers: str | None


def with_arguments(settings: S, arguments: Mapping[str, object]) -> S:
    """Return settings with the fields that are among the arguments of a verb."""
    names = {*settings.__struct_fields__}
    own = {name: value for name, value in arguments.items() if name in names}
    return msgspec.structs.replace(settings, **own)


def check_arguments(
    verb: Callable[..., object], arguments: Mapping[str, object], kind: type
) -> None:
    """Refuse an argument that is neither in its kind nor a keyword of the verb.

    Raises:
        TypeError: It names the nearest.
    """
    keywords = [
        name
        for name, parameter in inspect.signature(verb).parameters.items()
        if parameter.kind is parameter.KEYWORD_ONLY
    ]
    refuse_unknown(verb.__name__, arguments, [*kind.__annotations__, *keywords])
