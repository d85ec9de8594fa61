"""What becomes of a file of others in our hands: the same for each format."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import FuzzyTreeError
from fuzzytree.exporters.onnx import write_onnx as write_onnx
from fuzzytree.exporters.onnx_session import open_bare
from fuzzytree.exporters.table import find_format
from fuzzytree.formats.fll.fll_reader import read_fll as read_fll
from fuzzytree.formats.fll.fll_words import SAMPLES as SAMPLED
from fuzzytree.model import FuzzySystem, SystemOutput
from fuzzytree.model.contracts import Reading, Written
from fuzzytree.model.options import options_of
from fuzzytree.semantics.inference import infer
from tests.interop.fuzzylite_engine import Answers, largest_difference
from tests.interop.fuzzylite_exact import USUAL, exact_answers

DEBIAN = Path("/usr/share/doc/fuzzylite/examples")
ROWS = 40
"""Random rows within the ranges of a file's inputs."""

EXACT = 1e-12
"""What rounding may do to answers, relative to the largest, or to 1."""

PRINTED = 6e-10
"""Half a unit of the last of the tables' nine decimals, and a bit."""

OTHERS = ("fcl", "fll", "fis", "fml", "c", "pmml")
"""The formats that each file is written to, as their writers are unless told more."""

CLOSE = "fuzzylite 6 takes values within 1e-6 for equal; with 1e-16 it is alike"
OTHER_TABLE = (
    "fuzzylite answers the table's rows as we do: the table is of another file"
)
SAMPLES = "the table was made with more samples; with as many it is alike"

TOLERANCE = 1e-2
"""Of points: whether there is a loss does not depend on it, and few are soon found."""

Outputs = Sequence[Sequence[float]]


class Case(NamedTuple):
    """A file that was read, and rows to answer."""

    file: str
    path: Path
    content: bytes
    reading: Reading
    model: FuzzySystem
    rows: list[list[float]]


class Tools(NamedTuple):
    """Programs of others, and a folder for files."""

    fuzzylite: str
    octave: str
    exact: Path
    folder: Path


class Corpus(NamedTuple):
    """The files of a format: how they are found, read, and run by others."""

    kind: str
    files: Callable[[], list[tuple[str, Path]]]
    read: Callable[[bytes, str], Reading]
    run: Callable[[Sequence[Case], Tools], Iterator[Mapping[str, Answers]]]


class Row(NamedTuple):
    """One file.

    Differences are the largest of any output, relative to the largest answer or 1; None
    where there was nothing to compare with. `written` has a sign for each of `OTHERS`.
    """

    file: str
    kind: str
    dialect: str
    rules: int
    loaded: tuple[int, ...]
    losses: int
    table: float | None
    engines: Mapping[str, float]
    onnx: float | None
    written: tuple[str, ...]
    reason: str

    @property
    def is_alike(self) -> bool:
        """Whether all who know the file give our numbers, as far as they print them."""
        known = [*self.engines.values(), math.inf if self.onnx is None else self.onnx]
        is_near = self.table is None or self.table <= PRINTED
        return is_near and max(known) <= EXACT


def cases(corpus: Corpus) -> list[Case]:
    """Return all files of a format, read, each with random rows."""
    return [_case(corpus, name, path) for name, path in corpus.files()]


def _case(corpus: Corpus, name: str, path: Path) -> Case:
    content = _with_resolution(path.read_bytes())
    reading = corpus.read(content, path.name)
    model = reading.model
    assert isinstance(model, FuzzySystem)
    chance = random.Random(name)
    ranges = [(one.low or 0.0, one.high or 1.0) for one in model.variables]
    rows = [[chance.uniform(*ends) for ends in ranges] for _ in range(ROWS)]
    return Case(name, path, content, reading, model, rows)


def _with_resolution(content: bytes) -> bytes:
    """Return a file of FLL that says the resolution, for engines have other defaults.

    Nothing else is changed, and nothing in the other formats.
    """
    methods = b"Centroid|Bisector|SmallestOfMaximum|LargestOfMaximum|MeanOfMaximum"
    pattern = rb"(?m)^(\s*defuzzifier: (?:" + methods + rb")) *$"
    return re.sub(pattern, rb"\1 %d" % SAMPLED, content)


def rows_of(corpus: Corpus, tools: Tools) -> Iterator[Row]:
    """Yield a row for every file of a format."""
    found = cases(corpus)
    for case, answers in zip(found, corpus.run(found, tools), strict=True):
        yield _row(corpus, case, answers, tools)


def _row(
    corpus: Corpus, case: Case, answers: Mapping[str, Answers], tools: Tools
) -> Row:
    ours = answers_of(case.model, case.rows)
    engines = {name: relative(ours, found.outputs) for name, found in answers.items()}
    table = printed_table(case)
    told = _told(case.reading)
    reasons: list[str] = []
    if not engines or max(engines.values()) > EXACT:
        is_close = not told and _is_exact(case, corpus.kind, case.rows, tools)
        reasons += [CLOSE] if is_close else told
    difference = None
    if table is not None:
        difference = _from_table(case.model, table)
        if difference > PRINTED:
            reasons += _table_reasons(case, corpus.kind, table, told, tools)
    onnx, refused = _onnx_difference(case, ours)
    return Row(
        file=case.file,
        kind=corpus.kind,
        dialect=_dialect(case.reading),
        rules=len(case.model.rules),
        loaded=tuple(found.rules for found in answers.values()),
        losses=len(case.reading.losses),
        table=difference,
        engines=engines,
        onnx=onnx,
        written=tuple(_written(case.model, name) for name in OTHERS),
        reason="; ".join(dict.fromkeys([*reasons, *refused])),
    )


def _dialect(reading: Reading) -> str:
    found = re.search(r"(?:the dialect is|read as) (\w+)", " ".join(reading.remarks))
    return found[1] if found else "-"


def _told(reading: Reading) -> list[str]:
    """Return where fuzzylite 6 answers otherwise, in the words of our reader.

    The number of samples is none of it: the engines are given that of the reader.
    """
    losses = [f"{loss.where}: {loss.what}" for loss in reading.losses]
    found = [
        re.sub(r"^(output '[^']*'|line \d+): ", "", text)
        for text in [*losses, *reading.remarks]
        if re.search(r"(^|; )fuzzylite 6 ", text) and "resolution" not in text
    ]
    return list(dict.fromkeys(found))[:1]


class Table(NamedTuple):
    """A table of answers: rows of inputs, and of outputs with nine decimals."""

    rows: list[list[float]]
    outputs: list[tuple[float, ...]]


def printed_table(case: Case) -> Table | None:
    """Return some rows of the table beside a file, with its inputs as they were.

    They are printed with nine decimals too; but they are steps of an even grid.
    """
    path = case.path.with_suffix(".fld")
    if not path.exists():
        return None
    lines = path.read_text().splitlines()
    numbers = [tuple(map(float, line.split())) for line in lines[1:] if line.strip()]
    kept = numbers[:: max(1, len(numbers) // 100)]
    count = len(case.model.variables)
    grids = [_grid([row[k] for row in numbers]) for k in range(count)]
    rows = [[grids[k][row[k]] for k in range(count)] for row in kept]
    return Table(rows, [row[count:] for row in kept])


def _grid(printed: Sequence[float]) -> dict[float, float]:
    """Return the number that each printed one stands for: a step of an even grid."""
    values = sorted(set(printed))
    low, high = values[0], values[-1]
    steps = max(1, len(values) - 1)
    even = [low + k * (high - low) / steps for k in range(len(values))]
    is_even = all(abs(a - b) < 2e-9 for a, b in zip(values, even, strict=True))
    return dict(zip(values, even if is_even else values, strict=True))


def _from_table(model: FuzzySystem, table: Table) -> float:
    return relative(answers_of(model, table.rows), table.outputs)


def _table_reasons(
    case: Case, kind: str, table: Table, told: list[str], tools: Tools
) -> list[str]:
    """Return why a table has other numbers, each found by trying."""
    if kind != "fll":
        beside = case.path.with_suffix(".fll")
        fine = case._replace(
            model=_as_fine(case.model, beside), content=beside.read_bytes()
        )
        if _from_table(fine.model, table) <= PRINTED:
            return [SAMPLES]
        if _is_close(fine, "fll", table, tools):
            return [SAMPLES, CLOSE] if fine.model != case.model else [CLOSE]
    if _is_close(case, kind, table, tools):
        return [CLOSE]
    return [OTHER_TABLE] if _is_exact(case, kind, table.rows, tools) else told


def _is_close(case: Case, kind: str, table: Table, tools: Tools) -> bool:
    """Return whether fuzzylite as it is made the table, and without its bound is us."""
    theirs = exact_answers(tools.exact, case.content, table.rows, kind, bound=USUAL)
    is_maker = relative(theirs, table.outputs) <= PRINTED
    return is_maker and _is_exact(case, kind, table.rows, tools)


def _is_exact(case: Case, kind: str, rows: Outputs, tools: Tools) -> bool:
    """Return whether fuzzylite 6 without its bound gives our numbers."""
    found = exact_answers(tools.exact, case.content, rows, kind)
    return relative(answers_of(case.model, rows), found) <= EXACT


def _as_fine(model: FuzzySystem, beside: Path) -> FuzzySystem:
    """Return a system that takes as many samples as the FLL file beside its own."""
    other = read_fll(beside.read_bytes(), beside.name).model
    assert isinstance(other, FuzzySystem)
    outputs = tuple(
        _with_samples(one, same.defuzzifier.samples)
        for one, same in zip(model.outputs, other.outputs, strict=True)
    )
    return replace(model, outputs=outputs)


def _with_samples(output: SystemOutput, samples: int) -> SystemOutput:
    how = output.defuzzifier
    if how.is_weighted:
        return output
    return replace(output, defuzzifier=replace(how, samples=samples))


def answers_of(model: FuzzySystem, rows: Outputs) -> list[tuple[float, ...]]:
    """Return our answers to rows."""
    names = model.inputs
    return [infer(model, dict(zip(names, row, strict=True))).outputs for row in rows]


def relative(ours: Outputs, theirs: Outputs) -> float:
    """Return the largest difference, relative to our largest number or to 1."""
    sizes = [abs(one) for row in ours for one in row if math.isfinite(one)]
    return largest_difference(ours, theirs) / max(1.0, *sizes, 1.0)


def _onnx_difference(case: Case, ours: Outputs) -> tuple[float | None, list[str]]:
    try:
        content = write_onnx(case.model, verify=False).content
    except FuzzyTreeError as error:
        return None, [str(error)]
    rows = np.array(case.rows, np.float64)
    (found,) = open_bare(content)(["outputs"], {"inputs": rows})
    return relative(ours, [tuple(map(float, row)) for row in np.asarray(found)]), []


def _written(model: FuzzySystem, name: str) -> str:
    form = find_format(name)
    # Each writer checks its own options; the protocol knows the common one alone.
    write = cast("Callable[..., Written]", form.write)
    has_points = any(o.name == "tolerance" and o.default for o in options_of(form))
    options = {"tolerance": TOLERANCE} if has_points else {}
    try:
        losses = write(model, allow_loss=True, **options).losses
    except FuzzyTreeError:
        return "x"
    return "L" if losses else "="
