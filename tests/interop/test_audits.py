"""Audits of real rule bases say what the page says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.interop import audits

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "audits.md"

Need = Callable[[str], str]


@pytest.mark.heavy
def test_every_real_rule_base_is_audited_and_the_page_says_what_was_found(
    program: Need, library: Need
) -> None:
    program("fuzzylite")
    program("octave")
    library("fuzzylite")
    ours, files = [*audits.wines()], [*audits.others()]
    assert len(files) == 145
    assert all(case.audit.is_complete for case in [*ours, *files])
    assert audits.page(ours, files) == PAGE.read_text("utf-8")
