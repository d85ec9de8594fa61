"""Every FLL file that fuzzylite and pyfuzzylite ship, through our hands.

`python -m tests.witnesses.corpus_fll` prints the table: what was read, how far our
numbers are from the tables that lie beside the files, from the engines themselves on
random rows, and from the ONNX file that we make of each.
"""

from __future__ import annotations

import importlib.util
import math
import random
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from fuzzytree.errors import FuzzyTreeError
from fuzzytree.exporters.onnx import write as write_onnx
from fuzzytree.exporters.onnx_session import open_session
from fuzzytree.inference import infer
from fuzzytree.readers.fll import read
from fuzzytree.readers.fll_words import SAMPLES
from fuzzytree.system import FuzzySystem
from tests.witnesses.fuzzylite_engine import (
    largest_difference,
    run_library,
    run_program,
)

DEBIAN = Path("/usr/share/doc/fuzzylite/examples")
ROWS = 24
"""Random rows for the engines, and rows taken from each table."""

PRINTED = 6e-10
"""Half a unit of the last of the tables' nine decimals, and a bit."""

NEAR = 1e-4
"""As far as fuzzylite 6 moves answers by taking values within 1e-6 for equal."""


EXACT = 1e-12
"""What rounding may do to answers of the engines and of ONNX."""

REASONS = {
    "Laundry": "fuzzylite 6 takes degrees within 1e-6 of the maximum for maxima",
    "tsukamoto": "fuzzylite 6 finds other values for Concave terms and for degrees "
    "near 0 and 1",
    "juggler": "of terms with one name fuzzylite 6 takes the first one",
    "arc": "fuzzylite 6 does not know Arc",
    "semi_ellipse": "fuzzylite 6 does not know SemiEllipse",
    "terms/discrete": "the file has fewer digits than its table was made with: "
    "pyfuzzylite is as far from it",
}
"""Why some answers of others differ, by a part of the file's name."""

_CLOSE = "fuzzylite 6 takes values within 1e-6 for equal"


class Row(NamedTuple):
    """One file of the corpus.

    Differences are the largest of any output, relative to the largest answer; None
    where there was nothing to compare with.
    """

    file: str
    rules: int
    loaded: tuple[int, ...]
    table: float | None
    program: float | None
    library: float | None
    onnx: float | None
    reason: str

    @property
    def is_alike(self) -> bool:
        """Whether all who know the file give our numbers, as far as they print them."""
        table = 0.0 if self.table is None else self.table
        others = (self.program, self.library, self.onnx)
        known = all(one is not None and one <= EXACT for one in others)
        return known and table <= PRINTED


def corpus() -> list[tuple[str, Path]]:
    """Return the files, by the name that the table gives them."""
    spec = importlib.util.find_spec("fuzzylite")
    library = Path(spec.origin).parent / "examples" if spec and spec.origin else None
    found = [
        (f"Debian {path.relative_to(DEBIAN)}", path) for path in DEBIAN.rglob("*.fll")
    ]
    if library is not None:
        found += [
            (f"pyfuzzylite {path.relative_to(library)}", path)
            for path in library.rglob("*.fll")
        ]
    return sorted(found)


def corpus_table(program: str, folder: Path) -> Iterator[Row]:
    """Yield a row for every file.

    Args:
        program: The path of fuzzylite 6.
        folder: Where files can be written.
    """
    for name, path in corpus():
        yield _row(name, path, program, folder)


def _row(name: str, path: Path, program: str, folder: Path) -> Row:
    content = path.read_bytes()
    try:
        model = read(content, name).model
    except FuzzyTreeError as error:
        return Row(name, 0, (), None, None, None, None, f"not read: {error}")
    assert isinstance(model, FuzzySystem)
    rows = _random_rows(model)
    ours = _answers(model, rows)
    told: list[str] = []
    library = run_library(content, rows)
    loaded = [library.rules]
    difference = None
    try:
        answered = run_program(program, _with_resolution(content), rows, folder)
    except AssertionError:  # it wrote no answers
        pass
    else:
        loaded.append(answered.rules)
        difference = _relative(ours, answered.outputs)
    row = Row(
        name,
        len(model.rules),
        tuple(loaded),
        _table_difference(model, path.with_suffix(".fld")),
        difference,
        _relative(ours, library.outputs),
        _onnx_difference(model, rows, ours, told),
        "; ".join(told),
    )
    return row if row.is_alike else row._replace(reason=_reason(row))


def _reason(row: Row) -> str:
    """Return why a file is not alike everywhere; empty if that is not known."""
    for part, reason in REASONS.items():
        if part in row.file:
            return reason
    others = [one for one in (row.table, row.program) if one is not None]
    return _CLOSE if max(others, default=0.0) <= NEAR else ""


def _with_resolution(content: bytes) -> bytes:
    """Return a file that says the resolution, for fuzzylite 6 has another default."""
    methods = b"Centroid|Bisector|SmallestOfMaximum|LargestOfMaximum|MeanOfMaximum"
    pattern = rb"(?m)^(\s*defuzzifier: (?:" + methods + rb")) *$"
    return re.sub(pattern, rb"\1 %d" % SAMPLES, content)


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


def _table_difference(system: FuzzySystem, table: Path) -> float | None:
    """Return how far our answers are from a table, which has its inputs rounded."""
    if not table.exists():
        return None
    lines = table.read_text().splitlines()
    numbers = [tuple(map(float, line.split())) for line in lines[1:] if line.strip()]
    kept = numbers[:: max(1, len(numbers) // (4 * ROWS))]
    count = len(system.inputs)
    grids = [_grid([row[k] for row in numbers]) for k in range(count)]
    rows = [[grids[k][row[k]] for k in range(count)] for row in kept]
    return _relative(_answers(system, rows), [row[count:] for row in kept])


def _grid(printed: Sequence[float]) -> dict[float, float]:
    """Return the number that each printed one stands for: a step of an even grid."""
    values = sorted(set(printed))
    low, high = values[0], values[-1]
    steps = max(1, len(values) - 1)
    even = [low + k * (high - low) / steps for k in range(len(values))]
    is_even = all(abs(a - b) < 2e-9 for a, b in zip(values, even, strict=True))
    return dict(zip(values, even if is_even else values, strict=True))


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
    yield "file | rules | table | fuzzylite 6 | pyfuzzylite 8 | onnx | reason"
    for row in rows:
        cells = (_cell(x) for x in (row.table, row.program, row.library, row.onnx))
        yield " | ".join([row.file, str(row.rules), *cells, row.reason])
    yield ""
    yield f"{len(rows)} files; {sum(1 for row in rows if row.loaded)} read"
    columns: dict[str, tuple[float, list[float | None]]] = {
        "tables": (PRINTED, [row.table for row in rows]),
        "fuzzylite 6": (EXACT, [row.program for row in rows]),
        "pyfuzzylite 8": (EXACT, [row.library for row in rows]),
        "onnx": (EXACT, [row.onnx for row in rows]),
    }
    for name, (allowed, values) in columns.items():
        known = [one for one in values if one is not None]
        alike = sum(1 for one in known if one <= allowed)
        near = sum(1 for one in known if allowed < one <= NEAR)
        yield f"{name}: {len(known)} compared, {alike} alike, {near} within {NEAR:g}"
    whole = sum(1 for row in rows if row.is_alike)
    yield f"{whole} alike everywhere; a reason for {len(rows) - whole}"


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.1e}"


def main() -> None:
    """Print the table."""
    import shutil

    with tempfile.TemporaryDirectory() as folder:
        program = shutil.which("fuzzylite") or "fuzzylite"
        rows = list(corpus_table(program, Path(folder)))
    sys.stdout.writelines(f"{line}\n" for line in listed(rows))


if __name__ == "__main__":
    main()
