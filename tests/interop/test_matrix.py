"""Every verb works on every kind of model, or the page says why it does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.interop import matrix
from tests.interop.matrix_models import KINDS

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "matrix.md"

Need = Callable[[str], str]


@pytest.mark.heavy
@pytest.mark.parametrize("kind", KINDS)
def test_the_page_says_what_works_on_a_kind_of_model(
    program: Need, library: Need, kind: str
) -> None:
    for name in ("gcc", "node", "java"):
        program(name)
    for package in ("duckdb", "jpmml_evaluator", "onnxruntime", "z3"):
        library(package)
    cells = matrix.cells_of(kind)
    assert matrix.faults({kind: cells}) == []
    page = PAGE.read_text("utf-8")
    letters = {name: cell.letter for name, cell in cells.items()}
    assert letters == matrix.letters_of(page, kind)
    reasons = {
        name: matrix.reason_of(cell)
        for name, cell in cells.items()
        if cell.letter == "r"
    }
    assert reasons == matrix.reasons_of(page, kind)


def test_a_refusal_without_a_reason_is_a_fault() -> None:
    cells = {"run": matrix.Cell("r", "no such thing", "fuzzytree run m.yaml")}
    assert matrix.faults({"mamdani": cells}) == [
        "r mamdani, run: no such thing\n    fuzzytree run m.yaml"
    ]


def test_every_reason_is_one_that_the_page_needs() -> None:
    page = PAGE.read_text("utf-8")
    assert [why for _, why in matrix.REASONS if f"- {why}: " not in page] == []
