"""Every code is explained in the terminal."""

from __future__ import annotations

from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.report.audit import WIDTH, code_lines, explanation_lines


def test_every_code_is_explained_within_the_width() -> None:
    for code in CODES.values():
        lines = [*explanation_lines(code)]
        assert lines[0].startswith(f"{code.code}  {code.title} (")
        for title in ("what", "why", "example", "what to do"):
            assert lines[lines.index(title) + 1].strip()
        assert max(map(len, lines)) <= WIDTH


def test_the_list_of_codes_has_each_of_them() -> None:
    _, *lines = code_lines([*CODES.values()])
    assert [line.split()[0] for line in lines] == ["code", *CODES]
