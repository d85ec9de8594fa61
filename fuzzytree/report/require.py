"""Which requirements a model meets, as text, SARIF or annotations."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator

from fuzzytree.auditing import Compliance, RequirementAnswer
from fuzzytree.model import printable
from fuzzytree.report.audit import WIDTH
from fuzzytree.report.sarif import SCHEMA, uri, workflow_command
from fuzzytree.report.text import counted, number, wrapped

_LEVELS = {"PROVED": "none", "REFUTED": "error", "OPEN": "warning"}
_INDENT = " " * 9


def compliance_lines(compliance: Compliance) -> Iterator[str]:
    """Yield the verdict on a model, then each requirement, its reason and its rows."""
    yield compliance_verdict(compliance)
    for answer in compliance.answers:
        name = f"{answer.name}: " if answer.name else ""
        text = f"{name}{answer.requirement} ({_reason(answer)})"
        yield from wrapped(text, WIDTH, f"{answer.verdict:8} ", _INDENT)
        if answer.rows:
            rows = answer.rows.rstrip("\n").split("\n")
            yield f"{_INDENT}{printable(rows[0])}"
            for row, prediction in zip(rows[1:], answer.predictions, strict=True):
                yield f"{_INDENT}{printable(row)}  -> {printable(prediction)}"
            table = shlex.quote(answer.rows.replace("%", "%%").replace("\n", "\\n"))
            command = (
                f"printf {table} | fuzzytree run {shlex.quote(compliance.model)} -"
            )
            yield f"{_INDENT}{printable(command)}"


def compliance_verdict(compliance: Compliance) -> str:
    """Return how many requirements are proved, refuted and open."""
    count = counted(len(compliance.answers), "requirement")
    parts = [f"{compliance.count('PROVED')} proved"]
    for verdict in ("REFUTED", "OPEN"):
        if some := compliance.count(verdict):
            parts.append(f"{some} {verdict}")
    return f"{printable(compliance.model)}: {count}: {', '.join(parts)}"


def _reason(answer: RequirementAnswer) -> str:
    if answer.bound is None:
        return answer.sentence
    return f"{answer.sentence}; with {number(answer.bound)} in its place it is proved"


def compliance_sarif(compliance: Compliance) -> str:
    """Return the requirements of a model as SARIF; one that is met has passed."""
    results: list[dict[str, object]] = []
    for answer in compliance.answers:
        place: dict[str, object] = {"artifactLocation": {"uri": uri(_file(compliance))}}
        if answer.line:
            place["region"] = {"startLine": answer.line, "startColumn": answer.column}
        results.append(
            {
                "ruleId": "requirement",
                "kind": "pass" if answer.verdict == "PROVED" else "fail",
                "level": _LEVELS[answer.verdict],
                "message": {"text": _message(answer)},
                "locations": [{"physicalLocation": place}],
                "properties": {"name": answer.name, "rows": answer.rows},
            }
        )
    rule = {"id": "requirement", "shortDescription": {"text": "a requirement is met"}}
    driver = {"name": "fuzzytree", "version": compliance.version, "rules": [rule]}
    run = {"tool": {"driver": driver}, "results": results}
    whole = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return json.dumps(whole, indent=2, ensure_ascii=False)


def compliance_annotations(compliance: Compliance) -> Iterator[str]:
    """Yield a command of GitHub Actions for each requirement that is not proved."""
    for answer in compliance.answers:
        if answer.verdict != "PROVED":
            properties: dict[str, object] = {"file": _file(compliance)}
            if answer.line:
                properties |= {"line": answer.line, "col": answer.column}
            yield workflow_command(
                _LEVELS[answer.verdict], properties, _message(answer)
            )


def _file(compliance: Compliance) -> str:
    return compliance.source or compliance.model


def _message(answer: RequirementAnswer) -> str:
    return f"{answer.requirement} ({answer.verdict}: {_reason(answer)})"
