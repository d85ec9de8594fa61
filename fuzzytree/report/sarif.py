"""An audit as SARIF 2.1.0, the format of static analysis that code hosts read."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Final
from urllib.parse import quote

import msgspec

from fuzzytree.auditing import (
    CODES,
    Audit,
    AuditAnswer,
    Code,
    Declined,
    FileLocation,
    Severity,
    obsolete_ids,
)
from fuzzytree.model import printable
from fuzzytree.report.audit_states import SEVERITIES, as_in_file, state_text, state_word

SCHEMA: Final = "https://json.schemastore.org/sarif-2.1.0.json"

_Json = dict[str, object]


def sarif_text(audit: Audit, baseline: Mapping[str, str] | None = None) -> str:
    """Return an audit as SARIF.

    Each code is a rule, each finding a result with its id as a fingerprint. With a
    baseline a result is `unchanged` if it is accepted (and suppressed for that),
    otherwise `new`; what is accepted and no longer found is `absent`.
    """
    audit = as_in_file(audit)
    codes = [*CODES]
    results = [_result(one, audit, baseline, codes) for one in audit.findings]
    results += _absent(audit, baseline or {}, codes)
    run: _Json = {
        "tool": {
            "driver": {
                "name": "fuzzytree",
                "version": audit.version,
                "rules": [_rule(code) for code in CODES.values()],
            }
        },
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                "executionSuccessful": audit.is_complete,
                "toolExecutionNotifications": [
                    {"level": "note", "message": {"text": text}}
                    for text in audit.unasked
                ],
            }
        ],
        "artifacts": [
            {
                "location": {"uri": uri(source.name)},
                "hashes": {"sha-256": source.sha256},
            }
            for source in (audit.file, audit.data)
            if source is not None
        ],
        "results": results,
        "properties": {
            "model": audit.model,
            "form": audit.form,
            "fingerprint": audit.fingerprint,
            "digest": audit.digest,
            "domain": msgspec.to_builtins(audit.domain),
            "settings": msgspec.to_builtins(audit.settings),
            "notEstablished": [*audit.limits],
        },
    }
    whole = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return json.dumps(whole, indent=2, ensure_ascii=False)


def _rule(code: Code) -> _Json:
    words = "".join(c if c.isalnum() else " " for c in code.title).split()
    return {
        "id": code.code,
        "name": "".join(map(str.capitalize, words)),
        "shortDescription": {"text": code.title},
        "fullDescription": {"text": code.what or code.title},
        "help": {"text": f"{code.why}\n\n{code.remedy}".strip() or code.title},
        "defaultConfiguration": {"level": SEVERITIES[code.severity]},
    }


def _result(
    answer: AuditAnswer,
    audit: Audit,
    baseline: Mapping[str, str] | None,
    codes: list[str],
) -> _Json:
    said = f"{answer.sentence} ({state_word(answer.state)}: {state_text(answer.state)})"
    result: _Json = {
        "ruleId": answer.code,
        "ruleIndex": codes.index(answer.code),
        "level": SEVERITIES[answer.severity],
        "message": {"text": said},
        "locations": [*_locations(answer.places[:1], audit)],
        "partialFingerprints": {"fuzzytree/v1": answer.id},
        "properties": {
            "subject": answer.subject,
            "state": msgspec.to_builtins(answer.state),
            "region": msgspec.to_builtins(answer.region),
            "measures": msgspec.to_builtins(answer.measures),
            "repeat": answer.repeat,
        },
    }
    others = [*_locations(answer.places[1:], None)]
    if others:
        result["relatedLocations"] = others
    if baseline is not None:
        is_known = answer.id in audit.accepted
        result["baselineState"] = "unchanged" if is_known else "new"
        result["suppressions"] = (
            [{"kind": "external", "status": "accepted"}] if is_known else []
        )
    return result


def _absent(
    audit: Audit, baseline: Mapping[str, str], codes: list[str]
) -> Iterator[_Json]:
    """Yield accepted findings that are no longer there."""
    for name in obsolete_ids(baseline, audit):
        code = name.partition("-")[0]
        if code in codes:
            yield {
                "ruleId": code,
                "ruleIndex": codes.index(code),
                "level": "none",
                "kind": "pass",
                "message": {"text": baseline[name] or code},
                "partialFingerprints": {"fuzzytree/v1": name},
                "baselineState": "absent",
            }


def _locations(
    places: tuple[FileLocation, ...], audit: Audit | None
) -> Iterator[_Json]:
    """Yield places; without one, the file that was audited."""
    for place in places:
        spot = {"startLine": place.line, "startColumn": place.column}
        where = {"artifactLocation": {"uri": uri(place.file)}, "region": spot}
        yield {"physicalLocation": where}
    if not places and audit is not None and audit.file is not None:
        yield {"physicalLocation": {"artifactLocation": {"uri": uri(audit.file.name)}}}


def uri(path: str) -> str:
    """Return a path as the reference that it is in a repository."""
    return quote(path, safe="/")


_COMMANDS: Mapping[Severity, str] = {
    "error": "error",
    "warning": "warning",
    "info": "notice",
}
_IN_TEXT = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_IN_PROPERTIES = {**_IN_TEXT, ":": "%3A", ",": "%2C"}


def annotation_lines(audit: Audit) -> Iterator[str]:
    """Yield a workflow command for each finding that no baseline accepts.

    A last one reports that an audit is incomplete, or that all was declined.
    """
    for answer in audit.open_findings:
        yield _annotation(answer, audit)
    if not audit.is_complete:
        cut = [text for text in audit.unasked if ": cut short" in text]
        cut += [text for text in audit.unasked if ": not run: " in text]
        yield f"::notice title=audit not complete::{_escaped('; '.join(cut), _IN_TEXT)}"
    declined = [one for one in audit.answers if isinstance(one.state, Declined)]
    if declined and len(declined) == len(audit.answers):
        said = _escaped(declined[0].sentence, _IN_TEXT)
        yield f"::notice title=audit declined::nothing is known: first, {said}"


def _annotation(answer: AuditAnswer, audit: Audit) -> str:
    properties: dict[str, object] = {}
    if answer.places:
        place = answer.places[0]
        properties = {"file": place.file, "line": place.line, "col": place.column}
    elif audit.file is not None:
        properties = {"file": audit.file.name}
    title = CODES[answer.code].title if answer.code in CODES else ""
    properties["title"] = f"{answer.code} {title}".strip()
    said = f"{answer.sentence} ({state_word(answer.state)}, {answer.id})"
    return workflow_command(_COMMANDS[answer.severity], properties, said)


def workflow_command(command: str, properties: Mapping[str, object], text: str) -> str:
    """Return a command of GitHub Actions that annotates a line of a file."""
    shown = ",".join(
        f"{name}={_escaped(str(value), _IN_PROPERTIES)}"
        for name, value in properties.items()
    )
    return f"::{command} {shown}::{_escaped(text, _IN_TEXT)}"


def _escaped(text: str, escapes: Mapping[str, str]) -> str:
    return "".join(escapes.get(one) or printable(one) for one in text)
