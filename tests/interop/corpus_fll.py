"""Every FLL file that fuzzylite and pyfuzzylite ship."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Sequence
from pathlib import Path

from fuzzytree.formats.fll.fll_reader import read_fll
from tests.interop.corpus_rows import DEBIAN, Case, Corpus, Tools
from tests.interop.fuzzylite_engine import Answers, run_library, run_program

UNKNOWN = "fuzzylite 6 does not know"
"""What the reader says of files that the program cannot run."""


def files() -> list[tuple[str, Path]]:
    """Return the files, by the name that the table gives them."""
    spec = importlib.util.find_spec("fuzzylite")
    folders = {"fuzzylite": DEBIAN}
    if spec and spec.origin:
        folders["pyfuzzylite"] = Path(spec.origin).parent / "examples"
    return sorted(
        (f"{name} {path.relative_to(folder)}", path)
        for name, folder in folders.items()
        for path in folder.rglob("*.fll")
    )


def _run(cases: Sequence[Case], tools: Tools) -> Iterator[dict[str, Answers]]:
    for case in cases:
        found = {"pyfuzzylite 8": run_library(case.content, case.rows)}
        if not any(one.startswith(UNKNOWN) for one in case.reading.remarks):
            found["fuzzylite 6"] = run_program(
                tools.fuzzylite, case.content, case.rows, tools.folder
            )
        yield found


FLL = Corpus("fll", files, read_fll, _run)
