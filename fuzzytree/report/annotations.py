"""Findings as GitHub shows them beside the lines of a change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fuzzytree.auditing.engine.states import Declined
from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.auditing.findings.records import Answer, Audit, Severity
from fuzzytree.model.naming import printable
from fuzzytree.report.audit_states import state_word

_COMMANDS: Mapping[Severity, str] = {
    "error": "error",
    "warning": "warning",
    "info": "notice",
}
_IN_TEXT = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_IN_PROPERTIES = {**_IN_TEXT, ":": "%3A", ",": "%2C"}


def annotation_lines(audit: Audit) -> Iterator[str]:
    """Yield a workflow command for each finding that no baseline accepts.

    A last one tells that an audit is not complete, or that it knows nothing.
    """
    for answer in audit.open_findings:
        yield _annotation(answer, audit)
    if not audit.is_complete:
        cut = [text for text in audit.unasked if ": cut short" in text]
        cut += [text for text in audit.unasked if ": not asked: " in text]
        yield f"::notice title=audit not complete::{_escaped('; '.join(cut), _IN_TEXT)}"
    declined = [one for one in audit.answers if isinstance(one.state, Declined)]
    if declined and len(declined) == len(audit.answers):
        said = _escaped(declined[0].sentence, _IN_TEXT)
        yield f"::notice title=audit declined::nothing is known: first, {said}"


def _annotation(answer: Answer, audit: Audit) -> str:
    properties: dict[str, object] = {}
    if answer.places:
        place = answer.places[0]
        properties = {"file": place.file, "line": place.line, "col": place.column}
    elif audit.file is not None:
        properties = {"file": audit.file.name}
    title = CODES[answer.code].title if answer.code in CODES else ""
    properties["title"] = f"{answer.code} {title}".strip()
    shown = ",".join(
        f"{name}={_escaped(str(value), _IN_PROPERTIES)}"
        for name, value in properties.items()
    )
    said = f"{answer.sentence} ({state_word(answer.state)}, {answer.id})"
    return f"::{_COMMANDS[answer.severity]} {shown}::{_escaped(said, _IN_TEXT)}"


def _escaped(text: str, escapes: Mapping[str, str]) -> str:
    return "".join(escapes.get(one) or printable(one) for one in text)
