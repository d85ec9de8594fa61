"""Do all representations of a fuzzy system give its numbers?

The inference is the meaning; the native runtime is compared with it, every other
runtime with the native one, and shipped files with both. Bits are compared first. Where
they differ, two runners may be as far apart as the functions of their libraries make
them (`fuzzytree.semantics.programs.bounds`), and no further.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fuzzytree.checking.comparing import RowSet, counted, judged, same_bits
from fuzzytree.checking.equivalence import is_equivalent
from fuzzytree.checking.models import first_difference
from fuzzytree.checking.programs import ProgramFile, check_program
from fuzzytree.errors import FuzzyTreeError, LossError
from fuzzytree.model import (
    Agreement,
    Comparison,
    Count,
    Coverage,
    FuzzySystem,
    Progress,
    Runtime,
    SystemOutcome,
    SystemRun,
    fingerprint,
)
from fuzzytree.runtimes import (
    baseline,
    chosen_runtimes,
    infer_rows,
    is_installed,
    needed_by,
    run_system,
)
from fuzzytree.semantics import (
    ORIGIN,
    Aim,
    Row,
    Status,
    error_bounds,
    from_system,
    range_rows,
    system_probes,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, IntArray
    from fuzzytree.runtimes import OnnxModel
    from fuzzytree.semantics import Program

_SLOW_STEPS = 2_000_000  # operations that a slow runtime computes
_EDGE = 1e-6  # share of a range; a wider bound says little
_FEW = 200  # probes of a coverage alone
_AT_ONCE = 256  # rules that probes are aimed at, before it is seen which others fire
_DRAWN = 1_000  # rows drawn from the ranges
_SHOWN = 5  # differing rows listed for each comparison

Finding = Comparison | str
"""A comparison, or a sentence about what was skipped."""


class _Bounds:
    """How far runners may be apart in each row, computed once, where it is needed."""

    def __init__(self, program: Program, values: FloatArray) -> None:
        self._program, self._values = program, values
        self._known = np.zeros(values.shape[1], np.bool_)
        self._bounds = np.empty((len(program.results), 0))

    def of(self, rows: IntArray) -> FloatArray:
        """Return the bounds of some rows, of shape (results, rows)."""
        missing = rows[~self._known[rows]]
        if missing.size:
            if not self._bounds.size:
                shape = len(self._program.results), self._values.shape[1]
                self._bounds = np.empty(shape)
            found = error_bounds(self._program, self._values[:, missing])
            self._bounds[:, missing] = found
            self._known[missing] = True
        if not rows.size:
            return np.empty((len(self._program.results), 0))
        return self._bounds[:, rows]


class _Subject(msgspec.Struct, frozen=True):
    """What is checked, and on which rows.

    Attributes:
        system: The system.
        program: Its program, with activations.
        rows: The rows.
        native: The native runtime's numbers for all of them.
        bounds: How far other runtimes' numbers may be from these.
    """

    system: FuzzySystem
    program: Program
    rows: RowSet
    native: SystemOutcome
    bounds: _Bounds


def check_system(
    system: FuzzySystem,
    *others: FuzzySystem | OnnxModel | ProgramFile,
    data: FloatArray | None = None,
    names: Sequence[str] = (),
    runtimes: Sequence[str] | None = None,
    limit: int = 2_000,
    rows_only: bool = False,
    progress: Progress | None = None,
) -> Agreement:
    """Compare every representation of a fuzzy system with the system itself.

    Args:
        system: The system.
        others: Files that were made of it: systems, opened ONNX files, programs.
        data: Rows of one's own, shape (columns, rows), in the order of
            `system.columns`.
        names: What to call each of the others; `file 1`, `file 2` unless given.
        runtimes: The names of the runtimes to run; all that are installed if None.
        limit: The most probes.
        rows_only: Whether files whose rows agree are accepted with other content.
        progress: Called with what is compared next and the share that is done.

    Returns:
        What was compared, on what, and with which result. A row `flips` where its
        status differs.

    Raises:
        ValueError: If `data` is not of shape (columns, rows), or a runtime is unknown.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> check_system(random_system(2), runtimes=["native"], limit=50).ok
        True
    """
    run = run_system(system, activations=True)
    probes, coverage = _probes(system, run, limit)
    rows = _rows(system, probes, data)
    chosen = chosen_runtimes(runtimes)
    native = run(rows.values)
    program = from_system(system, activations=True)
    bounds = _Bounds(program, rows.values)
    subject = _Subject(system, program, rows, native, bounds)
    findings = [*_inference(subject)]
    parts = len(chosen) + len(others)
    for number, runtime in enumerate(chosen):
        if progress:
            progress(f"comparing {runtime.name}", number / parts)
        findings += _runtime(subject, runtime)
    for number, other in enumerate(others):
        title = names[number] if number < len(names) else f"file {number + 1}"
        if progress:
            progress(f"comparing {title}", (len(chosen) + number) / parts)
        findings += _shipped(title, other, subject)
    return Agreement(
        system.name,
        fingerprint(system),
        tuple(one for one in findings if isinstance(one, Comparison)),
        (_count("system", native),),
        tuple(dict.fromkeys(one for one in findings if isinstance(one, str))),
        None,
        rows.probes,
        rows_only=rows_only,
        coverage=coverage,
    )


def coverage_of(system: FuzzySystem) -> Coverage:
    """Return which rules of a system fire in probes, and how much is uncovered.

    Example:
        >>> from fuzzytree.semantics.samples import all_samples
        >>> coverage_of(all_samples()["Mamdani, singletons"]).unfired
        ()
    """
    return _probes(system, run_system(system, activations=True), _FEW)[1]


def _probes(
    system: FuzzySystem, run: SystemRun, limit: int
) -> tuple[FloatArray, Coverage]:
    """Return probes, with more of them aimed at the rules that do not fire in these."""
    tables = [_values(system, system_probes(system, limit=limit))]
    fired = np.asarray(_fired(run, tables[0]).any(axis=1))
    aim = Aim(system)
    missed = np.flatnonzero(~fired).tolist()
    for start in range(0, len(missed), _AT_ONCE):
        numbers = [one for one in missed[start : start + _AT_ONCE] if not fired[one]]
        if not numbers:
            continue
        table = _values(system, [aim.row(system.rules[one]) for one in numbers])
        fires = _fired(run, table)
        tables.append(table[:, fires[~fired].any(axis=0)])
        fired |= fires.any(axis=1)
    drawn = run(_values(system, range_rows(system, _DRAWN)))
    coverage = Coverage(
        len(system.rules),
        tuple(one + 1 for one in np.flatnonzero(~fired).tolist()),
        _DRAWN,
        int((drawn.status == Status.UNCOVERED).sum()),
    )
    return np.concatenate(tables, axis=1), coverage


def _fired(run: SystemRun, values: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which rules fire in which rows, of shape (rules, rows)."""
    degrees = run(values).activations
    assert degrees is not None  # it was prepared with activations
    fires: npt.NDArray[np.bool_] = degrees > 0.0
    return fires


def _values(system: FuzzySystem, rows: Sequence[Row]) -> FloatArray:
    """Return rows as an array of shape (columns, rows)."""
    names = system.columns
    table = np.array([[row[name] for row in rows] for name in names], np.float64)
    return table.reshape(len(names), len(rows))


def _rows(system: FuzzySystem, probes: FloatArray, data: FloatArray | None) -> RowSet:
    names, values = system.columns, probes
    if data is not None:
        if data.ndim != 2 or data.shape[0] != len(names):
            raise ValueError(
                f"data must have shape ({len(names)}, rows), not {data.shape}"
            )
        values = np.concatenate([values, data], axis=1)
    values = np.ascontiguousarray(values)
    return RowSet(names, values, np.arange(values.shape[1]), probes.shape[1])


def _inference(subject: _Subject) -> Iterator[Finding]:
    """Compare the native runtime with the inference, on a share of the rows."""
    share = _share(subject)
    some = subject.rows.part(share)
    right = infer_rows(subject.system, activations=True)(some.values)
    found = subject.native.part(share)
    yield from _compared(baseline().name, "the inference", found, right, subject, some)


def _share(subject: _Subject) -> slice:
    """Return which rows a slow runtime gets, so that it ends in seconds."""
    step = len(subject.rows.numbers) * subject.program.size // _SLOW_STEPS
    return slice(None, None, max(step, 1))


def _runtime(subject: _Subject, runtime: Runtime) -> Iterator[Finding]:
    if "system" not in runtime.runs or runtime.load_system is None:
        return
    if not is_installed(runtime):
        yield f"{runtime.name} is not installed ({needed_by(runtime)})"
        return
    try:
        run = runtime.load_system(subject.system, activations=True)
    except LossError as error:
        yield f"{runtime.name}: {error}"
        return
    share = _share(subject) if runtime.is_slow else slice(None)
    some = subject.rows.part(share)
    if not (runtime.is_baseline or runtime.is_definition):
        found, right = run(some.values), subject.native.part(share)
        yield from _compared(runtime.name, baseline().name, found, right, subject, some)
    yield _calls(runtime.name, run, some, subject)


class _Gaps(msgspec.Struct, frozen=True):
    """Where two tables of numbers differ.

    Attributes:
        apart: The rows in which a bit differs.
        gap: The differences in these rows, of shape (numbers, rows).
        allowed: How large they may be.
    """

    apart: IntArray
    gap: FloatArray
    allowed: FloatArray

    @property
    def wrong(self) -> list[int]:
        """The places among `apart` where more differs than may, worst first."""
        found = np.flatnonzero((self.gap > self.allowed).any(axis=0)).tolist()
        return sorted(found, key=lambda place: -float(self.gap[:, place].max()))


def _gaps(one: FloatArray, two: FloatArray, subject: _Subject, rows: RowSet) -> _Gaps:
    is_same = same_bits(one, two)
    apart = np.flatnonzero(~is_same.all(axis=0))
    allowed = subject.bounds.of(rows.numbers[apart])
    if len(one) < len(allowed):  # without activations
        allowed = allowed[[*range(len(one) - 1), len(allowed) - 1]]
    with np.errstate(invalid="ignore"):
        gap = np.abs(one[:, apart] - two[:, apart])
    gap = np.where(is_same[:, apart], 0.0, np.where(np.isnan(gap), np.inf, gap))
    return _Gaps(apart, gap, allowed)


def _faults(
    one: FloatArray, two: FloatArray, subject: _Subject, rows: RowSet
) -> Iterator[str]:
    """Yield what is wrong in each row, worst first."""
    gaps = _gaps(one, two, subject, rows)
    for place in gaps.wrong:
        row = int(gaps.apart[place])
        yield _fault(
            subject, one[:, row], two[:, row], gaps.allowed[:, place], row, rows
        )


def _compared(
    representation: str,
    against: str,
    found: SystemOutcome,
    right: SystemOutcome,
    subject: _Subject,
    rows: RowSet,
) -> Iterator[Finding]:
    """Compare bits, then what the bounds of the rows that differ allow.

    Rows whose bound says little are counted apart: the table shows the others.
    """
    one, two = _table(found, right), _table(right, found)
    gaps = _gaps(one, two, subject, rows)
    is_edge = _is_edge(gaps, subject)
    faults = list(itertools.islice(_faults(one, two, subject, rows), _SHOWN))
    total = len(rows.numbers)
    yield Comparison(
        representation,
        against,
        "rows",
        total,
        "DISAGREES" if faults else "agrees",
        differing=len(gaps.wrong),
        largest_difference=_largest(gaps.gap, ~is_edge | (gaps.gap > gaps.allowed)),
        allowed=_largest(gaps.allowed, ~is_edge),
        origin=_origin(gaps, total),
        flips=int((found.status != right.status).sum()),
        detail=tuple(faults),
    )
    edges = int(is_edge.any(axis=0).sum())
    if edges:
        yield (
            f"{representation} against {against}: in {edges} of {total} rows last bits "
            "decide, so near is an edge or a division by 0; the two may be "
            f"{_largest(gaps.allowed, is_edge):.2g} apart there, and are "
            f"{_largest(gaps.gap, is_edge):.2g}"
        )


def _is_edge(gaps: _Gaps, subject: _Subject) -> npt.NDArray[np.bool_]:
    """Return which numbers have a bound above a millionth of their range."""
    spans = np.ones((len(gaps.allowed), 1))
    for line, output in enumerate(subject.system.outputs):
        if output.low is not None and output.high is not None:
            spans[line] = output.high - output.low
        else:
            numbers = subject.native.outputs[line]
            numbers = np.abs(numbers[np.isfinite(numbers)])
            spans[line] = max(float(numbers.max(initial=0.0)), 1.0)
    return gaps.allowed > _EDGE * spans


def _table(outcome: SystemOutcome, other: SystemOutcome) -> FloatArray:
    """Return all numbers that two outcomes have, a line each, the status last."""
    lines = [outcome.outputs]
    if outcome.activations is not None and other.activations is not None:
        lines.append(outcome.activations)
    return np.vstack([*lines, outcome.status.astype(np.float64)])


def _largest(numbers: FloatArray, which: npt.NDArray[np.bool_]) -> float:
    return float(numbers[which].max(initial=0.0))


def _origin(gaps: _Gaps, rows: int) -> str:
    if not len(gaps.apart):
        return "equal bits"
    return f"{ORIGIN}; equal bits in {rows - len(gaps.apart)} rows"


def _names(system: FuzzySystem) -> list[str]:
    return [
        *(f"output {one.name!r}" for one in system.outputs),
        *(f"rule {number}" for number in range(1, len(system.rules) + 1)),
        "status",
    ]


def _fault(
    subject: _Subject,
    one: FloatArray,
    two: FloatArray,
    allowed: FloatArray,
    row: int,
    rows: RowSet,
) -> str:
    """Say which number of a row is wrong first, and the values that lead to it."""
    names = _names(subject.system)
    names = [*names[: len(one) - 1], names[-1]]
    with np.errstate(invalid="ignore"):
        is_right = (np.abs(one - two) <= allowed) | (one == two)
    first = int(np.argmin(is_right | (np.isnan(one) & np.isnan(two))))
    bound = float(allowed[first])
    values = zip(rows.inputs, rows.values[:, row].tolist(), strict=True)
    where = ", ".join(f"{column} {value!r}" for column, value in values)
    numbers = f"{float(one[first])!r} where {float(two[first])!r} is right"
    more = "" if bound == 0.0 else f", which may differ by {bound:.2g}"
    return f"{rows.name(row)}: {where}: {names[first]} {numbers}{more}"


def _calls(title: str, run: SystemRun, rows: RowSet, subject: _Subject) -> Comparison:
    """Call a runtime in the ways that break: no row, one, other order, wrong width.

    A library may compute a function of one number otherwise than of many, so that the
    answers to a row may be apart as far as those of two runners.
    """
    width, total = rows.values.shape
    some = slice(None, None, max(total // 24, 1))
    sample = np.ascontiguousarray(rows.values[:, some])
    whole = run(sample)
    singles = [run(sample[:, row : row + 1]) for row in range(sample.shape[1])]
    alone = np.hstack([_table(one, whole) for one in singles])
    faults = [
        f"a row answered alone differs from the same row in a batch, {text}"
        for text in _faults(alone, _table(whole, whole), subject, rows.part(some))
    ]
    turned = _table(run(np.asfortranarray(sample)), whole)
    if any(_faults(turned, _table(whole, whole), subject, rows.part(some))):
        faults.append("another memory order changes the answers")
    empty = run(np.empty((width, 0)))
    if empty.outputs.shape[1:] != (0,) or empty.status.shape != (0,):
        faults.append("no rows do not give empty answers")
    try:
        run(np.zeros((width + 1, 3)))
        faults.append(f"{width + 1} inputs are accepted where {width} are right")
    except (ValueError, FuzzyTreeError):
        pass
    return counted("calls", title, "itself", sample.shape[1] + 3, faults)


def _shipped(
    title: str, other: FuzzySystem | OnnxModel | ProgramFile, subject: _Subject
) -> Iterator[Finding]:
    """Compare a file that was shipped beside a system: content, then answers."""
    if isinstance(other, ProgramFile):
        yield from check_program(title, other, subject.system, subject.rows)
        return
    if isinstance(other, FuzzySystem):
        yield from _shipped_system(title, other, subject)
        return
    system = subject.system
    outputs = tuple(one.name for one in system.outputs)
    if (
        other.run_system is None
        or other.inputs != system.columns
        or other.names != outputs
    ):
        fault = (
            f"it computes {', '.join(other.names) or 'a class'} from "
            f"{', '.join(other.inputs)}, which are not the system's"
        )
        yield counted("file", title, "the system's facts", 1, (fault,))
        return
    from fuzzytree.exporters import differences

    apart = differences(other.content, system)
    yield counted("file", title, "the system's metadata", 1, apart.metadata)
    rows = subject.rows
    try:
        found = other.run_system(rows.values)
    except LossError as error:  # the file loads, but onnxruntime cannot run it
        faults = (str(error),)
        answers = [counted("rows", title, baseline().name, len(rows.numbers), faults)]
        yield judged(title, "a freshly written graph", apart.graph, answers)
        yield from answers
        return
    right = subject.native
    if "status" not in other.outputs:
        found, right = (_without_status(one) for one in (found, right))
    results = [*_compared(title, baseline().name, found, right, subject, rows)]
    yield _content(title, "a freshly written graph", apart.graph, results)
    yield from results


def _content(
    title: str, against: str, faults: Sequence[str], results: Sequence[Finding]
) -> Comparison:
    rows = [one for one in results if isinstance(one, Comparison)]
    return judged(title, against, faults, rows)


def _without_status(outcome: SystemOutcome) -> SystemOutcome:
    """Return an outcome whose status marks missing rows alone."""
    is_missing = outcome.status == Status.MISSING
    return msgspec.structs.replace(
        outcome, status=np.where(is_missing, Status.MISSING, Status.DECIDED)
    )


def _shipped_system(
    title: str, other: FuzzySystem, subject: _Subject
) -> Iterator[Finding]:
    """Compare content, names apart, then rows. Names are taken in order."""
    system = subject.system
    fault = first_difference(system, other)
    if fault is None:
        yield counted("file", title, "the system", 1, ())
        return
    counts = [(len(one.columns), len(one.outputs)) for one in (system, other)]
    if counts[0] != counts[1]:
        fault = (
            f"it computes {counts[1][1]} outputs from {counts[1][0]} inputs, and the "
            f"system {counts[0][1]} from {counts[0][0]}"
        )
        yield counted("file", title, "the system's inputs and outputs", 1, (fault,))
        return
    has_all = len(other.rules) == len(system.rules)
    found = run_system(other, activations=has_all)(subject.rows.values)
    rows = subject.rows
    results = [*_compared(title, baseline().name, found, subject.native, subject, rows)]
    if is_equivalent(system, other):
        yield counted("file", title, "the system but for names", 1, ())
    else:
        yield _content(title, "the system", (fault,), results)
    yield from results


def _count(representation: str, outcome: SystemOutcome) -> Count:
    status = outcome.status
    return Count(
        representation,
        int(status.size),
        0,
        int((status == Status.UNCOVERED).sum()),
        int((status == Status.MISSING).sum()),
    )
