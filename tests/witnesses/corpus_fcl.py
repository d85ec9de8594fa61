"""Every FCL file that fuzzylite ships, through our hands.

`python -m tests.witnesses.corpus_fcl` prints the table: what was read, how far our
numbers are from those of fuzzylite 6 on random rows, and from the ONNX file that we
make of each. The tables that lie beside the files were made from FLL files with other
resolutions; where the file has numbers or a hundred samples they agree too.
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
from fuzzytree.readers.fcl import read
from fuzzytree.system import FuzzySystem
from tests.witnesses.fuzzylite_engine import largest_difference, run_program

DEBIAN = Path("/usr/share/doc/fuzzylite/examples")
ROWS = 60

EXACT = 1e-12
"""What rounding may do to answers, relative to the largest."""

NEAR = 1e-5
"""As far as fuzzylite 6 moves answers by taking values within 1e-6 for equal."""

REASONS = {
    "Laundry": "fuzzylite 6 takes the first stretch of maxima, and degrees within 1e-6 "
    "of the maximum for maxima",
    "tsukamoto": "fuzzylite 6 finds other values where SShape, ZShape and Concave have "
    "a degree",
}
"""Why answers differ, by a part of the file's name; the reader tells it as a loss."""


class Row(NamedTuple):
    """One file: differences relative to the largest answer."""

    file: str
    rules: int
    loaded: int
    program: float
    onnx: float | None
    losses: int
    reason: str


def corpus() -> list[Path]:
    """Return the files."""
    return sorted(DEBIAN.rglob("*.fcl"))


def corpus_table(program: str, folder: Path) -> Iterator[Row]:
    """Yield a row for every file.

    Args:
        program: The path of fuzzylite 6.
        folder: Where files can be written.
    """
    for path in corpus():
        yield _row(path, program, folder)


def _row(path: Path, program: str, folder: Path) -> Row:
    name = str(path.relative_to(DEBIAN))
    content = path.read_bytes()
    reading = read(content, name)
    model = reading.model
    assert isinstance(model, FuzzySystem)
    chance = random.Random(name)
    rows = [
        [chance.uniform(one.low or 0.0, one.high or 1.0) for one in model.inputs]
        for _ in range(ROWS)
    ]
    ours = [
        infer(model, dict(zip(model.columns, row, strict=True))).outputs for row in rows
    ]
    answers = run_program(program, content, rows, folder, kind="fcl")
    reason = next((text for part, text in REASONS.items() if part in name), "")
    onnx, told = _onnx_difference(model, rows, ours)
    difference = _relative(ours, answers.outputs)
    if EXACT < difference <= NEAR:
        reason = "fuzzylite 6 takes values within 1e-6 for equal"
    return Row(
        file=name,
        rules=len(model.rules),
        loaded=answers.rules,
        program=difference,
        onnx=onnx,
        losses=len(reading.losses),
        reason="; ".join(filter(None, (reason, told))),
    )


def _relative(
    ours: Sequence[Sequence[float]], theirs: Sequence[Sequence[float]]
) -> float:
    sizes = [abs(one) for row in ours for one in row if math.isfinite(one)]
    return largest_difference(ours, theirs) / max(1.0, *sizes, 1.0)


def _onnx_difference(
    model: FuzzySystem, rows: Sequence[Sequence[float]], ours: Sequence[Sequence[float]]
) -> tuple[float | None, str]:
    import numpy as np

    try:
        content = write_onnx(model, verify=False).content
    except FuzzyTreeError as error:
        return None, str(error)
    found = open_session(content)(("outputs",), np.array(rows, np.float64))["outputs"]
    return _relative(ours, [tuple(map(float, row)) for row in found]), ""


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        for row in corpus_table("fuzzylite", Path(folder)):
            sys.stdout.write(
                f"{row.file:52} {row.rules:3} {row.loaded:3} {row.program:9.1e} "
                f"{'-' if row.onnx is None else format(row.onnx, '.1e'):>9} "
                f"{row.losses} {row.reason}\n"
            )


if __name__ == "__main__":
    main()
