"""`benchmarks/scale.py`: what a step measures, and the page of the figures."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("psutil")

import scale
import scale_steps

import fuzzytree as ft
from fuzzytree.model import fingerprint


def step(kind: str, engine: str, rows: int, folder: Path) -> scale.Facts:
    command = [sys.executable, str(scale.STEPS), kind, engine, str(rows), str(folder)]
    return scale.measured(command)


def test_states_of_files_and_of_generated_blocks_give_one_tree(tmp_path: Path) -> None:
    rows = 3000
    assert step("write", "parquet", rows, tmp_path)["bytes"] > 8 * 11 * rows / 4
    from_files = step("shares", "parquet", rows, tmp_path)
    generated = step("generated", "numpy", rows, tmp_path)
    table = scale_steps.block(0, rows)
    tree = ft.learn(table, target=scale_steps.KIND)
    assert generated["rows"] == rows
    assert generated["cpu"] > generated["making"] > 0
    assert from_files["peak"] > 1 << 20
    assert from_files["fingerprint"] == generated["fingerprint"] == fingerprint(tree)


def test_a_step_that_fails_is_kept_with_its_reason(tmp_path: Path) -> None:
    facts = step("shares", "parquet", 7, tmp_path)
    assert "parquet-7: cannot be read" in facts["failed"]
    page = scale.page({"learn files-parquet 1000000": facts})
    assert "| files: parquet | " in page
    assert "parquet-7: cannot be read" in page


def test_the_page_states_costs_growth_and_what_is_calculated() -> None:
    cost = {"seconds": 2.0, "peak": 1 << 30, "load": 0.1}
    results: dict[str, scale.Facts] = {
        "learn files-parquet 1000000": {**cost, "cpu": 1.0 + 1e-9, "fingerprint": "a"},
        "learn files-parquet 10000000": {**cost, "cpu": 10.0, "fingerprint": "b"},
        "learn duckdb 1000000": {**cost, "cpu": 3.0, "fingerprint": "a"},
        "learn ibis 1000000": {**cost, "cpu": 0.9, "fingerprint": "a"},
        "shares parquet 10000000": {
            "read and update": 10.0,
            "read and merge a state": 0.5,
            "state bytes": 2_000_000,
            "learn": 1.0,
        },
        "generated numpy 1000000000": {
            **cost,
            "cpu": 1500.0,
            "making": 500.0,
            "bytes": [3_000_000, 2_000_000],
        },
    }
    text = scale.page(results)
    assert "gave 1 fingerprint(s)" in text
    assert "| files: parquet | 2.0, 1.00, 1.00 | 2.0, 1.00, 1.00 | 1.00 |" in text
    assert "| duckdb | 2.0, 3.00, 1.00 | - | - |" in text
    assert "| ibis | busy, 0.90, 1.00 | - | - |" in text
    flowed = " ".join(text.split())
    assert "so taking them took 1.00 us a row" in flowed
    assert "1e+11 x 1.00 us / 200 = 500 s" in flowed
    assert "in 7 rounds of 0.50 s (3.5 s)" in flowed
