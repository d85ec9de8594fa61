"""The questions of an audit and the reasons for declining, each with a stable code."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final, Literal

from fuzzytree.auditing.records import Severity
from fuzzytree.rulebase import Value


class Code(Value, frozen=True):
    """A kind of question.

    Attributes:
        code: Its name in every output, which never changes its meaning.
        title: What a finding says, in a few words.
        severity: Of a finding, unless it says otherwise.
        decision: `strongest` if it is asked only where the strongest rule decides.
        what: What a finding means, exactly.
        why: Why a reader should care.
        example: A small case.
        remedy: What to do about it.
    """

    code: str
    title: str
    severity: Severity
    decision: Literal["strongest", "any"] = "any"
    what: str = ""
    why: str = ""
    example: str = ""
    remedy: str = ""


_CODES = (
    Code("FT101", "dead rule", "error", "any"),
    Code("FT102", "marginal rule", "warning", "strongest"),
    Code("FT103", "redundant rule", "info", "strongest"),
    Code("FT104", "subsumed rule", "warning", "any"),
    Code("FT105", "rule masked by another class", "error", "strongest"),
    Code("FT106", "duplicate antecedent", "warning", "any"),
    Code("FT107", "irrelevant clause", "info", "strongest"),
    Code("FT201", "conflict", "info", "any"),
    Code("FT202", "ambiguity", "warning", "strongest"),
    Code("FT203", "tree and raw rules differ", "warning", "strongest"),
    Code("FT204", "nearest other decision of a row", "info", "strongest"),
    Code("FT301", "coverage gap", "warning", "any"),
    Code("FT401", "empty term", "error", "any"),
    Code("FT402", "shape defect", "warning", "any"),
    Code("FT403", "terms hard to tell apart", "info", "any"),
    Code("FT404", "unused term or variable", "info", "any"),
    Code("FT501", "complexity", "info", "any"),
    Code("FT601", "carriers disagree", "error", "any"),
    Code("FT602", "convention broken", "error", "any"),
    Code("FT701", "data support", "info", "any"),
    Code("FT801", "decisions changed", "error", "strongest"),
    Code("FT802", "structure changed", "info", "any"),
    Code("FTD01", "declined: a norm without an exact method", "info"),
    Code("FTD02", "declined: a curve without an exact method", "info"),
    Code("FTD03", "declined: the budget was spent", "info"),
    Code("FTD04", "declined: inputs that depend on each other", "info"),
    Code("FTD05", "declined: a model too large", "info"),
    Code("FTD06", "declined: needs rows", "info"),
    Code("FTD07", "declined: a condition without an exact method", "info"),
)

CODES: Final = MappingProxyType({code.code: code for code in _CODES})
