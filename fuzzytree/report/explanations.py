"""What each code of an audit means, in the terminal and in `docs/how-to/audit.md`.

`python -m fuzzytree.report.explanations docs/how-to/audit.md` rewrites that page's last
part.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from fuzzytree.auditing.findings.codes import CODES, Code
from fuzzytree.files import write_atomically
from fuzzytree.report.audit import WIDTH
from fuzzytree.report.text import aligned

MARK: Final = "<!-- What follows is made by fuzzytree.report.explanations. -->"


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


def page_lines() -> Iterator[str]:
    """Yield the codes as the last part of a page in Markdown."""
    yield MARK
    yield ""
    yield "| code | severity | a finding says |"
    yield "|---|---|---|"
    for code in CODES.values():
        anchor = code.code.lower()
        yield f"| [{code.code}](#{anchor}) | {code.severity} | {code.title} |"
    for code in CODES.values():
        yield ""
        yield f"### {code.code}"
        yield ""
        asked = ", where the strongest rule decides"
        where = "" if code.decision == "any" else asked
        yield f"**{code.title[0].upper()}{code.title[1:]}** ({code.severity}{where})."
        yield code.what
        yield ""
        yield f"*Why.* {code.why}"
        yield ""
        yield "```text"
        yield code.example
        yield "```"
        yield ""
        yield f"*What to do.* {code.remedy}"


def main(path: str) -> None:
    """Rewrite the last part of a page."""
    text = Path(path).read_text("utf-8")
    head = text.partition(MARK)[0]
    write_atomically(path, (head + "\n".join(page_lines()) + "\n").encode())


if __name__ == "__main__":
    main(sys.argv[1])
