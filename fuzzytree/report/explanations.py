"""What each code of an audit means, as text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from fuzzytree.auditing import Code
from fuzzytree.report.audit import WIDTH
from fuzzytree.report.text import aligned, counted


def explanation_lines(code: Code) -> Iterator[str]:
    """Yield what a code means, why it matters, a case, and what to do."""
    where = "" if code.decision == "any" else ", where the strongest rule decides"
    yield f"{code.code}  {code.title} ({code.severity}{where})"
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


def code_lines(codes: Sequence[Code], *, is_whole: bool = True) -> Iterator[str]:
    """Yield codes with their severities and titles, after their number.

    Args:
        codes: The codes.
        is_whole: Whether to list the codes of declined questions, and not only count.
    """
    declined = [one for one in codes if one.code.startswith("FTD")]
    shown = codes if is_whole else [one for one in codes if one not in declined]
    yield f"{counted(len(codes), 'code')}; `fuzzytree explain CODE` explains one"
    rows = [("code", "severity", "finding")]
    yield from aligned([*rows, *((c.code, c.severity, c.title) for c in shown)])
    if len(shown) < len(codes):
        count = counted(len(declined), "code")
        yield f"FTD..  {count} of declined questions: `fuzzytree explain FTD`"
