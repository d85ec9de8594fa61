"""Every code is explained, in the terminal and on its page."""

from __future__ import annotations

from pathlib import Path

from fuzzytree.auditing.findings.codes import CODES
from fuzzytree.auditing.findings.limits import LIMITS
from fuzzytree.report.audit import WIDTH
from fuzzytree.report.explanations import (
    MARK,
    code_lines,
    explanation_lines,
    main,
    page_lines,
)

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "audit.md"


def test_every_code_is_explained_within_the_width() -> None:
    for code in CODES.values():
        lines = [*explanation_lines(code)]
        assert lines[0].startswith(f"{code.code}  {code.title} (")
        for title in ("what", "why", "example", "what to do"):
            assert lines[lines.index(title) + 1].strip()
        assert max(map(len, lines)) <= WIDTH


def test_the_list_of_codes_has_each_of_them() -> None:
    assert [line.split()[0] for line in code_lines(CODES.values())] == ["code", *CODES]


def test_the_page_explains_each_code_as_the_command_does() -> None:
    head, mark, rest = PAGE.read_text("utf-8").partition(MARK)
    assert head
    assert mark + rest == "\n".join(page_lines()) + "\n"


def test_the_page_tells_the_limits_of_every_audit() -> None:
    lines = PAGE.read_text("utf-8").splitlines()
    first = lines.index(f"- {LIMITS[0]}")
    assert lines[first : first + len(LIMITS)] == [f"- {text}" for text in LIMITS]


def test_rewriting_the_page_changes_its_last_part_alone(tmp_path: Path) -> None:
    page = tmp_path / "audit.md"
    page.write_text(f"# Head\n\n{MARK}\nold\n", "utf-8")
    main(str(page))
    assert page.read_text("utf-8") == "# Head\n\n" + "\n".join(page_lines()) + "\n"
