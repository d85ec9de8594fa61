"""Every FCL file that fuzzylite ships."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from fuzzytree.formats.fcl.fcl_reader import read_fcl
from tests.interop.corpus_rows import DEBIAN, Case, Corpus, Tools
from tests.interop.fuzzylite_engine import Answers, run_program


def files() -> list[tuple[str, Path]]:
    """Return the files, by the name that the table gives them."""
    found = DEBIAN.rglob("*.fcl")
    return sorted((f"fuzzylite {one.relative_to(DEBIAN)}", one) for one in found)


def _run(cases: Sequence[Case], tools: Tools) -> Iterator[dict[str, Answers]]:
    for case in cases:
        found = run_program(
            tools.fuzzylite, case.content, case.rows, tools.folder, kind="fcl"
        )
        yield {"fuzzylite 6": found}


FCL = Corpus("fcl", files, read_fcl, _run)
