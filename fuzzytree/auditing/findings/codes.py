"""The questions of an audit and the reasons for declining, each with a stable code.

What `explain` says of each stands in `codes.toml`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from types import MappingProxyType
from typing import Final, Literal, NamedTuple, cast

import msgspec

from fuzzytree.auditing.decide.states import Declined, Span, State
from fuzzytree.auditing.findings.records import (
    AuditAnswer,
    FactValue,
    Measure,
    Severity,
    TermName,
)
from fuzzytree.model import Result, Value
from fuzzytree.rechecking import MESSAGES, names_in, sentence_of


class Code(Result, Value, frozen=True):
    """A kind of question, and what `explain` says of it.

    `severity` is that of a finding unless it says otherwise; `decision` is `strongest`
    if the question applies only where the strongest rule decides.
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
    return {name: msgspec.convert({"code": name, **of}, Code) for name, of in entries}


CODES: Final = MappingProxyType(_codes())


def audit_answer(
    message: str,
    subject: str,
    state: State,
    *measures: Measure,
    facts: Mapping[str, FactValue] = MappingProxyType({}),
    is_finding: bool = True,
    rules: tuple[int, ...] = (),
    terms: tuple[TermName, ...] = (),
    region: tuple[Span, ...] = (),
) -> AuditAnswer:
    """Return an answer with the sentence of a message.

    The message says of which code and severity the answer is, and whether it is a
    finding; where it leaves that open, `is_finding` does. Of messages `FTD` the state
    has the code. Of the facts those are kept that the message shows.
    """
    code, grade = message.partition(".")[0], MESSAGES[message].grade
    if code == "FTD":
        assert isinstance(state, Declined)
        code = state.code
    is_finding = is_finding and grade != "note"
    severity = cast("Severity", grade.rstrip("?") if is_finding else "info")
    names = names_in(message)
    facts = {name: fact for name, fact in facts.items() if name in names}
    result = AuditAnswer(
        *(code, subject, "", state, is_finding, severity),
        *(rules, terms, region, measures),
        message=message,
        facts=facts,
    )
    return msgspec.structs.replace(result, sentence=sentence_of(result))


class Family(NamedTuple):
    """Codes that one function of this package answers.

    `function` is `module:name`; `part` is the share of the remaining budget that it may
    use, and what it leaves goes to the families after it.
    """

    function: str
    codes: tuple[str, ...]
    part: float = 0.5


FAMILIES: Final = (
    Family("robustness:row_answers", ("FT204",)),
    Family("terms:use_answers", ("FT404",), 0.2),
    Family("terms:height_answers", ("FT401",), 0.2),
    Family("support:answers", ("FT701",), 0.2),
    Family("deciding:cover_answers", ("FT301",), 0.2),
    Family("deciding:answers", ("FT101", "FT102", "FT103", "FT202")),
    Family("leaves:answers", ("FT101", "FT205")),
    Family("pairs:answers", ("FT104", "FT105", "FT106", "FT107", "FT201")),
    Family("leaves:raw_answers", ("FT203",)),
    Family("terms:shape_answers", ("FT402",), 0.2),
    Family("terms:overlap_answers", ("FT403",), 0.2),
    Family("terms:size_answers", ("FT501",), 0.2),
    Family("robustness:answers", ("FT204",)),
    Family("representations:answers", ("FT601", "FT602")),
)
"""In the order of the audit: quick and severe questions first, for a small budget."""

ANSWERED_BY_CONSTRUCTION: Final = frozenset({"FT107", "FT201"})
"""Of relative rules: beside each cut both sides reach nearly 1, and a rule shortened by
a proposition ties with those before it."""

AUDITED: Final = frozenset(code for family in FAMILIES for code in family.codes)
"""The codes that an audit answers; the others belong to `diff`, or are reasons for
declining."""
