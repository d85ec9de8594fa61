"""The page of witnesses names the tests that there are."""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = Path(__file__).parent
PAGE = FOLDER.parents[1] / "docs" / "reference" / "interop.md"


def test_every_test_that_the_page_names_exists_and_none_is_forgotten() -> None:
    named = set(
        re.findall(r"`((?:\.\./)*[a-z/]*test_\w+\.py)`", PAGE.read_text("utf-8"))
    )
    assert all((FOLDER / name).is_file() for name in named)
    here = {path.name for path in FOLDER.glob("test_*.py")} - {Path(__file__).name}
    assert here <= named
