"""Every FIS file that Debian's Octave toolkit and fuzzylite ship, through our hands.

`python -m tests.witnesses.corpus_fis` prints the table: what was read, how far our
numbers are from those of the engine that the file was written for, and from the ONNX
file that we make of each.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from fuzzytree.errors import FuzzyTreeError
from fuzzytree.exporters.onnx import write as write_onnx
from fuzzytree.exporters.onnx_session import open_session
from fuzzytree.inference import infer
from fuzzytree.readers.fis import reading
from fuzzytree.system import FuzzySystem
from tests.witnesses.fuzzylite_engine import largest_difference, run_program
from tests.witnesses.octave_engine import answers

TOOLKIT = Path("/usr/share/octave/packages")
FUZZYLITE = Path("/usr/share/doc/fuzzylite/examples")
ROWS = 40
EXACT = 1e-12
"""What rounding may do, relative to the largest answer."""

NEAR = 1e-6
"""As far as fuzzylite 6 moves answers by taking values within 1e-6 for equal."""

REASONS = {
    "Laundry": "of several plateaus of the maximum fuzzylite 6 takes the first",
    "tsukamoto": "fuzzylite 6 finds other values for falling Concave and S terms and "
    "for degrees near 0 and 1",
}
_CLOSE = "fuzzylite 6 takes values within 1e-6 for equal"


class Row(NamedTuple):
    """One file; differences are relative to the largest answer, or to 1."""

    file: str
    engine: str
    rules: int
    loaded: int
    difference: float
    onnx: float | None
    reason: str

    @property
    def is_alike(self) -> bool:
        """Whether engine and ONNX give our numbers."""
        return self.difference <= EXACT and self.onnx is not None and self.onnx <= EXACT


def corpus() -> list[tuple[str, Path]]:
    """Return the files, by the name that the table gives them."""
    found = [(f"Octave {path.name}", path) for path in TOOLKIT.glob("fuzzy*/*.fis")]
    found += [
        (f"fuzzylite {path.relative_to(FUZZYLITE)}", path)
        for path in FUZZYLITE.rglob("*.fis")
    ]
    return sorted(found)


def corpus_table(octave: str, fuzzylite: str, folder: Path) -> Iterator[Row]:
    """Yield a row for every file.

    Args:
        octave: The path of Octave.
        fuzzylite: The path of fuzzylite 6.
        folder: Where files can be written.
    """
    read: dict[str, tuple[bytes, str, FuzzySystem, list[list[float]]]] = {}
    for name, path in corpus():
        content = path.read_bytes()
        found = reading(content, path.name)
        assert isinstance(found.model, FuzzySystem)
        engine = found.remarks[0].split("'")[0].removeprefix("read as ")
        read[name] = content, engine, found.model, _random_rows(found.model)
    batch = {
        f"f{number}": (content, rows)
        for number, (content, engine, _, rows) in enumerate(read.values())
        if engine == "octave"
    }
    told = answers(octave, folder, batch)
    for number, (name, (content, engine, model, rows)) in enumerate(read.items()):
        if engine == "octave":
            theirs, loaded = told[f"f{number}"].rows, told[f"f{number}"].rules
        else:
            run = run_program(fuzzylite, content, rows, folder, kind="fis")
            theirs, loaded = tuple(run.outputs), run.rules
        ours = _answers(model, rows)
        reason: list[str] = []
        onnx = _onnx_difference(model, rows, ours, reason)
        difference = _relative(ours, theirs)
        row = Row(name, engine, len(model.rules), loaded, difference, onnx, "")
        if not row.is_alike:
            reason += [text for part, text in REASONS.items() if part in name]
            if not reason and difference <= NEAR:
                reason.append(_CLOSE)
        yield row._replace(reason="; ".join(reason))


def _random_rows(system: FuzzySystem) -> list[list[float]]:
    chance = random.Random(system.name)
    return [
        [chance.uniform(one.low or 0.0, one.high or 1.0) for one in system.inputs]
        for _ in range(ROWS)
    ]


def _answers(
    system: FuzzySystem, rows: Sequence[Sequence[float]]
) -> list[tuple[float, ...]]:
    return [
        infer(system, dict(zip(system.columns, row, strict=True))).outputs
        for row in rows
    ]


def _relative(
    ours: Sequence[Sequence[float]], theirs: Sequence[Sequence[float]]
) -> float:
    sizes = [abs(one) for row in ours for one in row if math.isfinite(one)]
    return largest_difference(ours, theirs) / max(1.0, *sizes, 1.0)


def _onnx_difference(
    system: FuzzySystem,
    rows: Sequence[Sequence[float]],
    ours: Sequence[Sequence[float]],
    told: list[str],
) -> float | None:
    import numpy as np

    try:
        content = write_onnx(system, verify=False).content
    except FuzzyTreeError as error:
        told.append(str(error))
        return None
    found = open_session(content)(("outputs",), np.array(rows, np.float64))["outputs"]
    return _relative(ours, [tuple(map(float, row)) for row in found])


def listed(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the table, and the counts."""
    yield "file | read as | rules | engine | onnx | reason"
    for row in rows:
        onnx = "-" if row.onnx is None else f"{row.onnx:.1e}"
        cells = (row.file, row.engine, str(row.rules), f"{row.difference:.1e}", onnx)
        yield " | ".join([*cells, row.reason])
    alike = sum(1 for row in rows if row.difference <= EXACT)
    onnx_alike = sum(1 for row in rows if row.onnx is not None and row.onnx <= EXACT)
    yield ""
    yield (
        f"{len(rows)} files read; {alike} evaluated alike, {len(rows) - alike} with a "
        f"reason; {onnx_alike} as ONNX alike"
    )


def main() -> None:
    """Print the table."""
    import shutil

    octave = shutil.which("octave") or "octave"
    fuzzylite = shutil.which("fuzzylite") or "fuzzylite"
    with tempfile.TemporaryDirectory() as folder:
        rows = list(corpus_table(octave, fuzzylite, Path(folder)))
    sys.stdout.writelines(f"{line}\n" for line in listed(rows))


if __name__ == "__main__":
    main()
