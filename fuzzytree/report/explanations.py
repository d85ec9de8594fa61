"""What each code of an audit means, as text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator

from fuzzytree.auditing.findings.codes import Code
from fuzzytree.report.audit import WIDTH
from fuzzytree.report.text import aligned


def explanation_lines(code: Code) -> Iterator[str]:
    """Yield what a code means, why it matters, a case, and what to do."""
    asked = "" if code.decision == "any" else ", asked where the strongest rule decides"
    yield f"{code.code}  {code.title} ({code.severity}{asked})"
    for title, text in (
        ("what", code.what),
        ("why", code.why),
        ("example", code.example),
        ("what to do", code.remedy),
    ):
        yield ""
        yield title
        for line in text.splitlines():
            yield from textwrap.wrap(
                line, WIDTH - 4, initial_indent="  ", subsequent_indent="  "
            ) or [""]


def code_lines(codes: Iterable[Code]) -> Iterator[str]:
    """Yield codes with their severities and titles."""
    rows = [("code", "severity", "a finding says")]
    yield from aligned([*rows, *((c.code, c.severity, c.title) for c in codes)])
