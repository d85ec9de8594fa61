"""Files of others: all are read, run alike or with a reason, and the page says it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from fuzzytree.exporters.fll import write
from fuzzytree.formats.fll.fll_reader import read_fll
from fuzzytree.model import FuzzySystem
from tests.interop import corpus
from tests.interop.corpus_fll import FLL
from tests.interop.corpus_rows import EXACT, Row, Tools
from tests.interop.fuzzylite_exact import compiled

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "corpus.md"
COUNTS = {
    "fcl": {"fuzzylite": 18},
    "fis": {"fuzzylite": 29, "Octave": 6},
    "fll": {"fuzzylite": 31, "pyfuzzylite": 61},
}
"""The files that each of them ships."""

Need = Callable[[str], str]


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split(" | ")]


def is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def is_same(one: str, other: str) -> bool:
    """Return whether two cells say the same; rounding and libraries differ a bit."""
    if not (is_number(one) and is_number(other)):
        return one == other
    first, second = sorted((float(one), float(other)))
    return first == second or second <= EXACT or second <= 10.0 * first


def assert_is_the_page(found: str) -> None:
    pairs = zip(found.splitlines(), PAGE.read_text("utf-8").splitlines(), strict=True)
    for ours, line in pairs:
        is_row = line.count("|") > 12
        for one, other in zip(cells(ours), cells(line), strict=True):
            assert is_same(one, other) if is_row else one == other, line


def assert_is_told(row: Row) -> None:
    """Compare what was read and loaded, and that what differs has a reason."""
    assert row.rules > 0
    assert row.loaded
    for loaded in row.loaded:
        # Octave's hedges act on each conclusion alone: a rule can become several.
        assert loaded == row.rules or (row.dialect == "octave" and loaded < row.rules)
    assert row.engines
    assert row.onnx is not None
    assert row.onnx <= EXACT
    assert row.engines.get("pyfuzzylite 8", 0.0) <= EXACT
    assert row.engines.get("Octave", 0.0) <= EXACT
    assert row.is_alike != bool(row.reason)


@pytest.mark.heavy
def test_every_file_that_others_ship_is_read_and_run_alike_or_the_page_says_why(
    program: Need, library: Need, tmp_path: Path
) -> None:
    library("fuzzylite")
    exact = compiled(program("g++"), tmp_path)
    tools = Tools(program("fuzzylite"), program("octave"), exact, tmp_path)
    rows = corpus.all_rows(tools)
    counted: dict[str, dict[str, int]] = {}
    for row in rows:
        assert_is_told(row)
        owners = counted.setdefault(row.kind, {})
        owner = row.file.split()[0]
        owners[owner] = owners.get(owner, 0) + 1
    assert counted == COUNTS
    assert_is_the_page(corpus.page(rows))


def test_every_fll_file_is_written_and_comes_back_equal(library: Need) -> None:
    library("fuzzylite")
    for name, path in FLL.files():
        model = read_fll(path.read_bytes(), name).model
        assert isinstance(model, FuzzySystem)
        assert read_fll(write(model).content, name).model == model, name


def test_a_number_of_the_page_that_is_not_near_is_told() -> None:
    assert is_same("2.2e-16", "0")
    assert is_same("1.5e-06", "2.2e-06")
    assert is_same("inf", "inf")
    assert not is_same("1.5e-06", "0")
    assert not is_same("1.5e-06", "2.0e-01")
    assert not is_same("inf", "2.0e-01")
    assert not is_same("", "0")
    assert not is_same("=", "L")
