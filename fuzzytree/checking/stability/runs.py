"""The forms of a model loaded in runtimes, and their distance from what is right.

A strength may differ from the exact one by `numerics.bounds.strength_bounds`, for the
runtime's number type; a runtime with a bound of its own adds that to the one of double.
A class may differ where the exact margin is at most twice the bound, and nowhere else;
the path of a tree only in rows within rounding of a cut. The numbers of a system are
right as its definition computes them; a runtime may be as far from them as the
functions of two libraries can take two runners (`semantics.programs.bounds`).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, cast

import msgspec
import numpy as np

from fuzzytree.checking.certificates import exact_errors, missing_rows
from fuzzytree.checking.comparing import (
    Allow,
    Allowance,
    ModelRun,
    Results,
    RowSet,
    by_libraries,
    compare,
    differences,
    row_set,
    unequal,
)
from fuzzytree.errors import LossError
from fuzzytree.model import (
    Document,
    Dtype,
    FloatArray,
    Model,
    Outcome,
    Run,
    Runtime,
    kind_of,
)
from fuzzytree.numerics import Decisions, decide, strength_bounds
from fuzzytree.runtimes import (
    baseline,
    definition,
    is_installed,
    needed_by,
)
from fuzzytree.semantics import forms, program_of

_EDGE = 1e-6  # share of an output's range; a wider bound says little
_SLOW_ROWS = 60  # rows that a slow runtime is given, whatever the others get

Truth = Decisions | Outcome
"""What is right for some rows: exact decisions, or the numbers of a system."""


def share(values: FloatArray) -> slice:
    """Return which rows to run where each costs much: evenly drawn ones."""
    return slice(None, None, max(-(-values.shape[1] // _SLOW_ROWS), 1))


class LoadedForm(msgspec.Struct, frozen=True):
    """A form of a model in a runtime, ready to answer."""

    title: str  # such as `onnxruntime float32: raw rules`
    representation: str
    runtime: Runtime
    model: Document
    loud: Run  # its answers, with the warnings that it lets out

    def run(self, values: FloatArray) -> Outcome:
        """Answer rows, and keep warnings in."""
        return self.run_with_warning(values)[0]

    def run_with_warning(self, values: FloatArray) -> tuple[Outcome, str | None]:
        """Answer rows, and return the first warning that was let out, if any."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            outcome = self.loud(values)
        return outcome, str(caught[0].message) if caught else None

    def some(self, values: FloatArray) -> FloatArray:
        """Return the rows to run: a share of them if the runtime is slow."""
        return values[:, share(values)] if self.runtime.is_slow else values

    def fault(
        self, what: str, values: FloatArray, one: Outcome, two: Outcome
    ) -> tuple[int, str | None]:
        """Return how many rows two outcomes answer, and what is wrong if they differ.

        Bits must be equal, but for what a library's functions change in a system.
        """
        size, answers = values.shape[1], one.status.size
        if answers != size:
            return 1, f"{self.title}{what.format(f'{size} rows get {answers} answers')}"
        count = int(unequal(one, two).sum()) if size else 0
        if count and self.model.outputs:
            apart = differences(*self.compared(one, two, values))
            count = apart.wrong.size
        if not count:
            return size, None
        text = f"{count} of {size} rows are answered differently"
        return size, f"{self.title}{what.format(text)}"

    def compared(
        self, one: Outcome, two: Outcome, values: FloatArray
    ) -> tuple[ModelRun, ModelRun, RowSet, Allow]:
        """Return two outcomes of rows as they are compared: within last bits.

        A bound that is wide beside an output's range is counted apart.
        """
        first, second = (ModelRun(self.title, self.model, each) for each in (one, two))
        rows = row_set(self.model.inputs, values[:, :0], values)
        names = [output.name for output in self.model.outputs]
        spans = dict(zip(names, output_spans(self.model, two)[:, 0], strict=True))

        def allow(results: Results, values: FloatArray) -> Allowance:
            bounds = by_libraries(lambda: program_of(self.model))(results, values)
            widths = [
                [spans[name] if kind == "output" else 1.0]
                for kind, name in results.keys
            ]
            is_loose = bounds.amounts > _EDGE * np.array(widths)
            return bounds._replace(is_loose=is_loose)

        return first, second, rows, allow


def loaded_forms(
    model: Document, runtimes: Sequence[Runtime], skipped: list[str]
) -> Iterator[LoadedForm]:
    """Yield each form of a model in each runtime that can run it.

    `skipped` gets a sentence for each that is not installed or cannot.
    """
    for representation, form in forms(model).items():
        for runtime in runtimes:
            loaded = loaded_form(representation, form, runtime, skipped)
            if loaded is not None:
                yield loaded


def loaded_form(
    representation: str, form: Document, runtime: Runtime, skipped: list[str]
) -> LoadedForm | None:
    """Return one form in one runtime; None if that cannot be, with a reason kept."""
    if kind_of(form) not in runtime.runs:
        return None
    if not is_installed(runtime):
        skipped.append(f"{runtime.name} is not installed ({needed_by(runtime)})")
        return None
    title = f"{runtime.name}: {representation}"
    try:
        run = runtime.load(form)
    except LossError as error:
        skipped.append(f"{title}: {first_line(error)}")
        return None
    return LoadedForm(title, representation, runtime, form, run)


FirstOutcomes = dict[tuple[str, Dtype, bool], tuple[str, Outcome]]
"""The first runtime of each form and number type that promises equal bits."""


def other_bits(
    one: LoadedForm, rows: FloatArray, outcome: Outcome, first: FirstOutcomes
) -> Iterator[str]:
    """Yield where a runtime has other bits than the first one that promises them."""
    if one.runtime.bound is None and not one.model.outputs:
        key = (one.representation, one.runtime.dtype, one.runtime.is_slow)
        title, other = first.setdefault(key, (one.title, outcome))
        wrong = np.flatnonzero(unequal(outcome, other))
        if wrong.size:
            yield (
                f"{one.title}: other bits than {title} in {wrong.size} rows, first "
                f"{row_text(one.model.inputs, rows, int(wrong[0]))}"
            )


def first_line(error: Exception) -> str:
    """Return what went wrong, without the advice that follows it."""
    return str(error).partition("\n")[0]


def row_text(inputs: Sequence[str], values: FloatArray, row: int) -> str:
    """Return a row as people read it, each number with all its digits."""
    numbers = values[:, row].tolist()
    shown = [f"{n} {v!r}" for n, v in zip(inputs, numbers, strict=True)][:8]
    return ", ".join(shown) + (", ..." if len(inputs) > 8 else "")


class ExactCheck(NamedTuple):
    """How far a runtime was from the right answers."""

    rows: int
    worst: float  # error of a strength or output, where the bound proves something
    allowed: float  # the bound in the row of that error
    largest: float  # error in any row
    flips: int  # rows whose class, or whose status, differs from the right one
    unbounded: int  # rows in which the bound proves nothing
    faults: tuple[str, ...]
    outcome: Outcome


def truth(model: Document, values: FloatArray) -> Truth:
    """Return what is right for rows.

    The numbers of a system are those of its definition on a share of the rows, and
    the native ones, which are compared with it there, on the others.
    """
    if not model.outputs:
        return decide(cast("Model", model), values)
    right, some = baseline().load(model)(values), share(values)
    inferred = definition().load(model)(values[:, some])
    for name in ("status", "strengths", "outputs"):
        getattr(right, name)[..., some] = getattr(inferred, name)
    return right


def exact_check(
    one: LoadedForm, values: FloatArray, known: dict[tuple[str, int], Truth]
) -> ExactCheck:
    """Run rows and compare the predictions with the right ones.

    These are kept in `known`, by form and number of rows, for one table or its share.
    Rows that are missing in the number type and not in double (beyond float32) are
    left to criterion N6.
    """
    key = one.representation, values.shape[1]
    if key not in known:
        known[key] = truth(one.model, values)
    right = known[key]
    outcome = one.run(values)
    if isinstance(right, Outcome):
        compared = compare(*one.compared(outcome, right, values))
        count = f"{compared.differing} of {compared.rows} rows are beyond the bound"
        texts = [text.partition(": ")[2] for text in compared.detail[:1]]  # no number
        return ExactCheck(
            compared.rows,
            compared.largest_difference,
            compared.allowed,
            compared.largest_difference,
            compared.flips,
            compared.unbounded,
            tuple(f"{one.title}: {count}: {text}" for text in texts),
            outcome,
        )
    return _strength_check(one, values, outcome, right)


def _strength_check(
    one: LoadedForm, values: FloatArray, outcome: Outcome, right: Decisions
) -> ExactCheck:
    """Compare strengths and classes with exact decisions."""
    model: Any = one.model
    known = ~missing_rows(model, values, one.runtime.dtype)
    allowed = np.zeros(values.shape[1])  # of a path, which has no strength
    if model.rules:
        own = one.runtime.bound
        dtype: Dtype = one.runtime.dtype if own is None else "float64"
        allowed, _ = strength_bounds(model, dtype, values)
        allowed = np.minimum(allowed + (0.0 if own is None else own(model)[0]), 1.0)
    run = ModelRun(one.title, model, outcome)
    errors = exact_errors(run, right, values, one.runtime.dtype, allowed)
    flips = errors.flips & known
    low = np.where(known, 0.0 if errors.low is None else errors.low, 0.0)
    wrong = flips & ~errors.close | (low > allowed)
    faults: tuple[str, ...] = ()
    if wrong.any():
        row = int(np.flatnonzero(wrong)[np.argmax(low[wrong])])
        text = f"rule {outcome.rule[row]} wins and another is right"
        if low[row] > allowed[row]:
            text = f"strengths off by {low[row]:.3g}, {allowed[row]:.3g} allowed"
        count = f"{int(wrong.sum())} of {wrong.size} rows are beyond the bound"
        where = row_text(model.inputs, values, row)
        faults = (f"{one.title}: {count}: {text}: {where}",)
    is_open = known & (allowed >= 1.0)
    bounded = np.where(is_open, 0.0, low)
    worst = int(np.argmax(bounded)) if low.size else 0
    return ExactCheck(
        int(wrong.size),
        float(bounded[worst]) if low.size else 0.0,
        float(allowed[worst]) if low.size else 0.0,
        float(low.max(initial=0.0)),
        int(flips.sum()),
        int(is_open.sum()),
        faults,
        outcome,
    )


def output_spans(model: Document, outcome: Outcome) -> FloatArray:
    """Return the width of each output's range, or its largest size, as a column."""
    numbers = np.abs(np.empty((0, 1)) if outcome.outputs is None else outcome.outputs)
    numbers[~np.isfinite(numbers)] = 0.0
    spans = np.maximum(numbers.max(axis=1, initial=0.0, keepdims=True), 1.0)
    for line, output in enumerate(model.outputs):
        if output.low is not None and output.high is not None:
            spans[line] = output.high - output.low
    return np.asarray(spans)
