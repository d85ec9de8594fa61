"""Every FIS file that Debian's Octave toolkit and fuzzylite ship."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from fuzzytree.formats.fis.fis_reader import read_fis
from tests.interop.corpus_rows import DEBIAN, Case, Corpus, Tools
from tests.interop.fuzzylite_engine import Answers, run_program
from tests.interop.octave_engine import answers

TOOLKIT = Path("/usr/share/octave/packages")


def files() -> list[tuple[str, Path]]:
    """Return the files, by the name that the table gives them."""
    found = [(f"Octave {path.name}", path) for path in TOOLKIT.glob("fuzzy*/*.fis")]
    ours = DEBIAN.rglob("*.fis")
    found += [(f"fuzzylite {path.relative_to(DEBIAN)}", path) for path in ours]
    return sorted(found)


def _is_octaves(case: Case) -> bool:
    return case.reading.remarks[0].startswith("read as octave's")


def _run(cases: Sequence[Case], tools: Tools) -> Iterator[dict[str, Answers]]:
    """Yield what the engine says for which a file was written; Octave starts once."""
    batch = {
        f"f{number}": (case.content, case.rows)
        for number, case in enumerate(cases)
        if _is_octaves(case)
    }
    told = answers(tools.octave, tools.folder, batch)
    for number, case in enumerate(cases):
        if _is_octaves(case):
            found = told[f"f{number}"]
            yield {"Octave": Answers(list(found.rows), found.rules)}
        else:
            content, rows = case.content, case.rows
            run = run_program(tools.fuzzylite, content, rows, tools.folder, kind="fis")
            yield {"fuzzylite 6": run}


FIS = Corpus("fis", files, read_fis, _run)
