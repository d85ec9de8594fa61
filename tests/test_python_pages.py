"""The examples of pages about Python run and print what the page shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
API = ("learn", "models", "run", "export", "check", "audit", "results", "errors")
NEEDED: dict[str, tuple[str, ...]] = {
    **{f"api/{name}.md": () for name in API},
    "duckdb.md": ("duckdb",),
    "fuzzy-libraries.md": ("skfuzzy", "simpful"),
    "ibis.md": ("ibis",),
    "large-tables.md": ("pandas",),
    "parts.md": ("pandas",),
    "polars.md": ("polars",),
    "use-results-in-python.md": ("pandas", "sklearn"),
}


@pytest.mark.filterwarnings("ignore::DeprecationWarning:skfuzzy")
@pytest.mark.filterwarnings("ignore:fetch_arrow_table:DeprecationWarning")
@pytest.mark.parametrize("page", NEEDED)
def test_each_example_prints_what_stands_below_it(
    page: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in NEEDED[page]:
        pytest.importorskip(module)
    monkeypatch.chdir(ROOT)
    run_page(page, capsys)


def run_page(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Run the examples of a page and compare what they print."""
    text = next((ROOT / "docs").rglob(page)).read_text("utf-8")
    blocks = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, re.DOTALL)
    names: dict[str, object] = {}
    for code, shown in blocks:
        exec(code, names)  # the page's own examples
        assert capsys.readouterr().out == shown
    assert len(blocks) == text.count("```python")
