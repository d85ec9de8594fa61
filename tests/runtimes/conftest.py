"""Best-first searches in these tests even where firing all rules would be faster."""

from __future__ import annotations

import pytest

from fuzzytree.runtimes import best_first


@pytest.fixture(autouse=True)
def _searched(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_LEAST_COST", "_CALL_COST"):
        monkeypatch.setattr(best_first, name, 0.0)
    monkeypatch.setattr(best_first, "_CROWD", 1.0)
