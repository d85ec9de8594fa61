"""The questions of an audit and the reasons for declining, each with a stable code.

What `explain` says of each stands in `codes.toml`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from types import MappingProxyType
from typing import Final, Literal, TypedDict, Unpack, cast

import msgspec

from fuzzytree.auditing.decide.states import Declined, Span, State
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    FactValue,
    Measure,
    Severity,
    TermName,
)
from fuzzytree.model import Value
from fuzzytree.rechecking import MESSAGES, names_in, sentence_of


class Code(Value, frozen=True):
    """A kind of question.

    Attributes:
        code: Its name in every output, which never changes its meaning.
        title: What a finding says, in a few words.
        severity: Of a finding, unless it says otherwise.
        decision: `strongest` if it applies only where the strongest rule decides.
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


def _codes() -> Mapping[str, Code]:
    """Return the codes of the file beside this module, in its order."""
    folder = resources.files("fuzzytree.auditing.findings")
    entries = tomllib.loads(folder.joinpath("codes.toml").read_text("utf-8")).items()
    return {name: msgspec.convert({"code": name, **one}, Code) for name, one in entries}


CODES: Final = MappingProxyType(_codes())


class Details(TypedDict, total=False):
    """What an answer is about, and its numbers; see `AuditAnswer`."""

    rules: tuple[int, ...]
    terms: tuple[TermName, ...]
    region: tuple[Span, ...]
    measures: tuple[Measure, ...]


def audit_answer(
    message: str,
    subject: str,
    state: State,
    *,
    facts: Mapping[str, FactValue] = MappingProxyType({}),
    is_finding: bool = True,
    **details: Unpack[Details],
) -> AuditAnswer:
    """Return an answer with the sentence of a message.

    Args:
        message: Its name; see `fuzzytree.rechecking.sentences`. It says of which
            code and severity the answer is, and whether it is a finding.
        subject: The subject of the question.
        state: How the answer is known; of messages `FTD` a `Declined` with the code.
        facts: Those that the message says are kept.
        is_finding: Where the message leaves it open whether it is one.
        details: See `AuditAnswer`.

    Raises:
        KeyError: If there is no such message, or it needs another fact.

    Example:
        >>> state = Declined("FTD06", "rows are needed")
        >>> audit_answer("FT701.needs-rows", "rows", state).sentence
        'what rows say about the rules is not known: rows are needed'
    """
    code, grade = message.partition(".")[0], MESSAGES[message].grade
    if code == "FTD":
        assert isinstance(state, Declined)
        code = state.code
    is_finding = is_finding and grade != "note"
    severity = cast("Severity", grade.rstrip("?") if is_finding else "info")
    said = names_in(message)
    result = AuditAnswer(
        *(code, subject, "", state, is_finding, severity),
        message=message,
        facts={name: fact for name, fact in facts.items() if name in said},
        **details,
    )
    return msgspec.structs.replace(result, sentence=sentence_of(result))


class Family(Value, frozen=True):
    """Codes that one function of this package answers.

    Attributes:
        function: The function, as `module:name`; it yields the answers for a subject.
        codes: The codes.
        part: The share of the remaining time that it may use; what it leaves goes to
            the families after it.
    """

    function: str
    codes: tuple[str, ...]
    part: float = 0.5


FAMILIES: Final = (
    Family("terms:answers", ("FT401", "FT404"), 0.2),
    Family("support:answers", ("FT701",), 0.2),
    Family("gaps:answers", ("FT301",), 0.2),
    Family("deciding:answers", ("FT101", "FT102", "FT103", "FT202")),
    Family("leaves:answers", ("FT101", "FT205")),
    Family("pairs:answers", ("FT104", "FT105", "FT106", "FT107", "FT201")),
    Family("disagreement:answers", ("FT203",)),
    Family("terms:shape_answers", ("FT402",), 0.2),
    Family("terms:overlap_answers", ("FT403",), 0.2),
    Family("complexity:answers", ("FT501",), 0.2),
    Family("robustness:answers", ("FT204",)),
    Family("representations:answers", ("FT601", "FT602"), 1.0),
)
"""In the order of the audit: quick and severe questions first, so that a spent budget
costs as little as it can."""

ANSWERED_BY_CONSTRUCTION: Final = frozenset({"FT107", "FT201"})
"""Of relative rules: beside each cut both sides reach nearly 1, and a rule shortened by
a proposition ties with those before it."""

AUDITED: Final = frozenset(code for family in FAMILIES for code in family.codes)
"""The codes that an audit answers; the others belong to `diff`, or are reasons for
declining."""
