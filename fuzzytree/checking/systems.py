"""What a check compares of a fuzzy system: its numbers, within the bounds of functions.

The inference is the meaning; the native runtime is compared with it, every other
runtime with the native one, and shipped files with both. Bits are compared first. Where
they differ, two runners may be as far apart as the functions of their libraries make
them (`fuzzytree.semantics.programs.bounds`), and no further.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from fuzzytree.checking.comparing import (
    Finding,
    RowSet,
    counted,
    judged,
    row_set,
    same_bits,
)
from fuzzytree.checking.equivalence import is_equivalent
from fuzzytree.checking.models import first_difference
from fuzzytree.model import (
    BoolArray,
    Certified,
    Comparison,
    Coverage,
    FloatArray,
    FuzzySystem,
    Outcome,
    Run,
    Runtime,
)
from fuzzytree.runtimes import baseline, definition, run_system
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
    from fuzzytree.runtimes import OnnxModel

_SLOW_STEPS = 2_000_000  # operations that a slow runtime computes
_EDGE = 1e-6  # share of a range; a wider bound says little
_FEW = 200  # probes of a coverage alone
_AT_ONCE = 256  # rules that probes are aimed at, before it is seen which others fire
_DRAWN = 1_000  # rows drawn from the ranges
_SHOWN = 5  # differing rows listed for each comparison


class CheckedSystem:
    """A fuzzy system in a check, with the native numbers for all rows."""

    noun, base = "the system", baseline().name
    cells = None

    def __init__(self, model: FuzzySystem, data: FloatArray | None, limit: int) -> None:
        self.model = model
        run = run_system(model)
        probes, self.coverage = _probes(model, run, limit)
        self.rows = row_set(model.inputs, probes, data)
        self.program = from_system(model, activations=True)
        self.native = run(self.rows.values)
        self.forms, self.outcomes = {"system": model}, {"system": self.native}

    def title(self, form: str, runtime: Runtime) -> str:
        """Return what to call the system in a runtime."""
        return runtime.name

    def load(self, form: str, runtime: Runtime) -> Run:
        """Return the system in a runtime."""
        return runtime.load(self.model)

    def share(self, form: str) -> slice:
        """Return the rows that a slow runtime gets, so that it ends in seconds."""
        step = len(self.rows.numbers) * self.program.size // _SLOW_STEPS
        return slice(None, None, max(step, 1))

    def own(self) -> Iterator[Finding]:
        """Compare the native runtime with the inference, on a share of the rows."""
        some = self.rows.part(self.share("system"))
        right = definition().load(self.model)(some.values)
        actual = self.native.part(self.share("system"))
        yield from self._compared((self.base, "the inference"), actual, right, some)

    def compared(
        self, form: str, runtime: Runtime, run: Run, share: slice
    ) -> Iterator[Finding]:
        """Compare the numbers of a runtime with the native ones."""
        if not (runtime.is_baseline or runtime.is_definition):
            some, right = self.rows.part(share), self.native.part(share)
            names = (runtime.name, self.base)
            yield from self._compared(names, run(some.values), right, some)

    def faults(self, actual: Any, expected: Any, rows: RowSet) -> list[str]:
        """Return what is wrong in each row, worst first.

        A library may compute a function of one number otherwise than of many, so that
        the answers to a row may be apart as far as those of two runners.
        """
        return [*_Gaps(self, actual, expected, rows).faults()]

    def certificates(self, runtimes: Sequence[Runtime]) -> Iterator[Certified]:
        """Yield nothing: bounds of functions are no proof for all inputs."""
        yield from ()

    def _compared(
        self,
        names: tuple[str, str],
        actual: Outcome,
        right: Outcome,
        rows: RowSet,
    ) -> Iterator[Finding]:
        """Compare bits, then what the bounds of the rows that differ allow.

        Rows whose bound says little are counted apart: the table shows the others.
        """
        gaps = _Gaps(self, actual, right, rows)
        is_edge, gap, allowed = gaps.is_edge(), gaps.gap, gaps.allowed
        faults = tuple(itertools.islice(gaps.faults(), _SHOWN))
        total = len(rows.numbers)
        same = total - len(gaps.apart)
        yield Comparison(
            *names,
            "rows",
            total,
            "DISAGREES" if faults else "agrees",
            differing=len(gaps.wrong),
            largest_difference=_largest(gap, ~is_edge | (gap > allowed)),
            allowed=_largest(allowed, ~is_edge),
            origin="equal bits"
            if same == total
            else f"{ORIGIN}; equal bits in {same} rows",
            flips=int((actual.status != right.status).sum()),
            detail=faults,
        )
        edges = int(is_edge.any(axis=0).sum())
        if edges:
            yield (
                f"{' against '.join(names)}: in {edges} of {total} rows last bits "
                "decide, so near is an edge or a division by 0; the two may be "
                f"{_largest(allowed, is_edge):.2g} apart there, and are "
                f"{_largest(gap, is_edge):.2g}"
            )

    def shipped(self, title: str, other: Any) -> Iterator[Finding]:
        """Compare a file's content, names apart, then rows. Names are in order."""
        system = self.model
        fault = first_difference(system, other)
        if fault is None:
            yield counted("file", title, "the system", 1, ())
            return
        counts = [(len(one.inputs), len(one.outputs)) for one in (system, other)]
        if counts[0] != counts[1]:
            fault = (
                f"it computes {counts[1][1]} outputs from {counts[1][0]} inputs, and "
                f"the system {counts[0][1]} from {counts[0][0]}"
            )
            against = "the system's inputs and outputs"
            yield counted("file", title, against, 1, (fault,))
            return
        has_all = len(other.rules) == len(system.rules)
        actual = run_system(other, with_strengths=has_all)(self.rows.values)
        names = (title, self.base)
        results = [*self._compared(names, actual, self.native, self.rows)]
        if is_equivalent(system, other):
            yield counted("file", title, "the system but for names", 1, ())
        else:
            yield judged(title, "the system", (fault,), results)
        yield from results

    def foreign(self, file: OnnxModel) -> str | None:
        """Return why an ONNX file cannot be one of this system; None if it can be."""
        outputs = tuple(one.name for one in self.model.outputs)
        if (
            file.representation == "system"
            and file.inputs == self.model.inputs
            and file.names == outputs
        ):
            return None
        return (
            f"it computes {', '.join(file.names) or 'a class'} from "
            f"{', '.join(file.inputs)}, which are not the system's"
        )

    def counterpart(self, file: OnnxModel) -> FuzzySystem | str:
        """Return what an ONNX file should hold: the system."""
        return self.model

    def file_rows(self, title: str, file: OnnxModel) -> Iterator[Finding]:
        """Compare the numbers of an ONNX file with the native ones.

        Raises:
            LossError: If onnxruntime cannot run it.
        """
        actual, right = file.run(self.rows.values), self.native
        if "status" not in file.outputs:
            actual, right = (_without_status(one) for one in (actual, right))
        yield from self._compared((title, self.base), actual, right, self.rows)


class _Gaps:
    """Where the numbers of two outcomes differ, of those that both have.

    Attributes:
        apart: The rows in which a bit differs.
        gap: The differences in these rows, of shape (numbers, rows).
        allowed: How large they may be.
        wrong: The places among `apart` where more differs than may, worst first.
    """

    def __init__(
        self,
        subject: CheckedSystem,
        actual: Outcome,
        right: Outcome,
        rows: RowSet,
    ) -> None:
        self.subject, self.rows = subject, rows
        self.one, self.two = _table(actual, right), _table(right, actual)
        is_same = same_bits(self.one, self.two)
        self.apart = np.flatnonzero(~is_same.all(axis=0))
        allowed = error_bounds(subject.program, rows.values[:, self.apart])
        if len(self.one) < len(allowed):  # without activations
            allowed = allowed[[*range(len(self.one) - 1), len(allowed) - 1]]
        with np.errstate(invalid="ignore"):
            gap = np.abs(self.one - self.two)[:, self.apart]
        gap[np.isnan(gap)] = np.inf
        gap[is_same[:, self.apart]] = 0.0
        self.gap, self.allowed = gap, allowed
        wrong = np.flatnonzero((gap > allowed).any(axis=0)).tolist()
        self.wrong = sorted(wrong, key=lambda place: -float(gap[:, place].max()))

    def faults(self) -> Iterator[str]:
        """Yield the first wrong number of each row, and the row's values."""
        system = self.subject.model
        names = [
            *(f"output {one.name!r}" for one in system.outputs),
            *(f"rule {number}" for number in range(1, len(system.rules) + 1)),
        ]
        names[len(self.one) - 1 :] = ["status"]
        for place in self.wrong:
            row = int(self.apart[place])
            first = int(np.argmax(self.gap[:, place] > self.allowed[:, place]))
            bound = float(self.allowed[first, place])
            one, two = (float(part[first, row]) for part in (self.one, self.two))
            more = "" if bound == 0.0 else f", which may differ by {bound:.2g}"
            where = f"{self.rows.text(row)}: {names[first]}"
            yield f"{where} {one!r} where {two!r} is right{more}"

    def is_edge(self) -> BoolArray:
        """Return which numbers have a bound above a millionth of their range."""
        spans = np.ones((len(self.allowed), 1))
        for line, output in enumerate(self.subject.model.outputs):
            if output.low is not None and output.high is not None:
                spans[line] = output.high - output.low
            else:
                numbers = self.two[line]
                numbers = np.abs(numbers[np.isfinite(numbers)])
                spans[line] = max(float(numbers.max(initial=0.0)), 1.0)
        return self.allowed > _EDGE * spans


def _table(outcome: Outcome, other: Outcome) -> FloatArray:
    """Return all numbers that two outcomes have, a line each, the status last."""
    assert outcome.outputs is not None  # it is of a system
    lines = [outcome.outputs]
    if outcome.strengths is not None and other.strengths is not None:
        lines.append(outcome.strengths)
    return np.vstack([*lines, outcome.status.astype(np.float64)])


def _largest(numbers: FloatArray, which: BoolArray) -> float:
    return float(numbers[which].max(initial=0.0))


def _without_status(outcome: Outcome) -> Outcome:
    """Return an outcome whose status marks missing rows alone."""
    is_missing = outcome.status == Status.MISSING
    return msgspec.structs.replace(
        outcome, status=np.where(is_missing, Status.MISSING, Status.DECIDED)
    )


def coverage_of(system: FuzzySystem) -> Coverage:
    """Return which rules of a system fire in probes, and how much is uncovered.

    Example:
        >>> from fuzzytree.semantics.samples import all_samples
        >>> coverage_of(all_samples()["Mamdani, singletons"]).unfired
        ()
    """
    return _probes(system, run_system(system), _FEW)[1]


def _probes(system: FuzzySystem, run: Run, limit: int) -> tuple[FloatArray, Coverage]:
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


def _fired(run: Run, values: FloatArray) -> BoolArray:
    """Return which rules fire in which rows, of shape (rules, rows)."""
    degrees = run(values).strengths
    assert degrees is not None  # systems give them
    fires: BoolArray = degrees > 0.0
    return fires


def _values(system: FuzzySystem, rows: Sequence[Row]) -> FloatArray:
    """Return rows as an array of shape (columns, rows)."""
    names = system.inputs
    table = np.array([[row[name] for row in rows] for name in names], np.float64)
    return table.reshape(len(names), len(rows))
