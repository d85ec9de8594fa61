"""Every file that fuzzylite, pyfuzzylite and Octave's toolkit ship, in our hands.

`python -m tests.interop.corpus > docs/reference/corpus.md` writes the page.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.interop.corpus_fcl import FCL
from tests.interop.corpus_fis import FIS
from tests.interop.corpus_fll import FLL
from tests.interop.corpus_rows import (
    EXACT,
    OTHERS,
    PRINTED,
    ROWS,
    Row,
    Tools,
    rows_of,
)
from tests.interop.fuzzylite_exact import compiled

ALL = (FCL, FIS, FLL)
ENGINES = ("fuzzylite 6", "pyfuzzylite 8", "Octave")

INTRODUCTION = f"""\
# Third-party files

Every FCL, FIS and FLL file that Debian's packages `fuzzylite` and
`octave-fuzzy-logic-toolkit` and the Python package `pyfuzzylite` ship goes through
our reader, our reference, the engine that it is for, our ONNX file and our writers.
`python -m tests.interop.corpus > docs/reference/corpus.md` writes this page, and
`tests/interop/test_corpus.py` compares it with new results. The files are read where
those packages install them.

- *read as*: the dialect that the reader recognised.
- *rules*: those that were read. The engine loaded as many; a rule of Octave with
  hedges in two conclusions counts as two here.
- *losses*: how many the reader lists.
- *table*: the largest difference of our outputs from the table beside the file, in
  about 100 of its rows. It has nine decimals: half a unit of the last one agrees.
- *fuzzylite 6*, *pyfuzzylite 8*, *Octave*: the largest difference of our outputs from
  those of the engine, in {ROWS} random rows. *onnx*: of onnxruntime's outputs by our
  ONNX file from ours. Up to {EXACT:g} is rounding, and agrees.
- All differences are relative to the largest output, or to 1. `inf`: one of the two
  has no number.
- *{" ".join(OTHERS)}*: written to these formats with the default options of their
  writers. `=`: without a loss. `L`: with losses, which the writer lists. `x`: refused,
  with the reason.
- *why not alike*: the remark of our reader, or the result of an experiment: fuzzylite 6
  is compiled with 1e-16 instead of 1e-6 for the distance of equal numbers, systems get
  as many samples as the FLL file beside them has, and fuzzylite evaluates the rows of
  the table.

"""


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the table."""
    heads = [
        *("file", "format", "read as", "rules", "losses", "table"),
        *ENGINES,
        *("onnx", " ".join(OTHERS), "why not alike"),
    ]
    yield _line(heads)
    yield _line("---" for _ in heads)
    for row in rows:
        differences = (row.table, *map(row.engines.get, ENGINES), row.onnx)
        first = (row.file, row.kind, row.dialect, str(row.rules), str(row.losses))
        signs = f"`{' '.join(row.written)}`"
        yield _line([*first, *map(_cell, differences), signs, row.reason])


def _line(cells: Sequence[str] | Iterator[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(difference: float | None) -> str:
    if difference is None:
        return ""
    return f"{difference:.1e}" if difference else "0"


def counts(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the counts: how many of how many are alike."""
    yield _line(("", "files", "read", "table", *ENGINES, "onnx"))
    yield _line("-" * 8)
    for kind in (*dict.fromkeys(row.kind for row in rows), ""):
        some = [row for row in rows if kind in ("", row.kind)]
        yield _line(
            (
                kind or "all",
                str(len(some)),
                str(sum(row.rules > 0 for row in some)),
                _alike([row.table for row in some], PRINTED),
                *(_alike([row.engines.get(one) for row in some]) for one in ENGINES),
                _alike([row.onnx for row in some]),
            )
        )
    others = [row for row in rows if not row.is_alike]
    reasons = sum(bool(row.reason) for row in others)
    yield ""
    yield (
        f"{len(rows) - len(others)} files agree everywhere; {reasons} of the other "
        f"{len(others)} have a reason."
    )


def _alike(differences: Sequence[float | None], allowed: float = EXACT) -> str:
    known = [one for one in differences if one is not None]
    if not known:
        return ""
    return f"{sum(one <= allowed for one in known)} of {len(known)}"


def all_rows(tools: Tools) -> list[Row]:
    """Return a row for every file."""
    return [row for corpus in ALL for row in rows_of(corpus, tools)]


def page(rows: Sequence[Row]) -> str:
    """Return the page."""
    return INTRODUCTION + "\n".join([*counts(rows), "", *table(rows)]) + "\n"


def main() -> None:
    """Print the page."""
    found = {name: shutil.which(name) for name in ("fuzzylite", "octave", "g++")}
    missing = [name for name, path in found.items() if path is None]
    if missing:
        sys.exit(f"these programs are not installed: {', '.join(missing)}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        exact = compiled(found["g++"] or "", folder)
        tools = Tools(found["fuzzylite"] or "", found["octave"] or "", exact, folder)
        sys.stdout.write(page(all_rows(tools)))


if __name__ == "__main__":
    main()
