"""The examples of docs/fuzzy-libraries.md run and print what the page shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "fuzzy-libraries.md"


@pytest.mark.filterwarnings("ignore::DeprecationWarning:skfuzzy")
def test_each_example_prints_what_stands_below_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for module in ("skfuzzy", "simpful"):
        pytest.importorskip(module)
    blocks = re.findall(
        r"```python\n(.*?)```\n\n```text\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL
    )
    names: dict[str, object] = {}
    for code, shown in blocks:
        exec(code, names)  # the page's own examples
        assert capsys.readouterr().out == shown
    assert len(blocks) == 2
