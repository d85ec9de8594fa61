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
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import msgspec
import numpy as np

from fuzzytree.checking.certificates import exact_errors
from fuzzytree.checking.comparing import ModelRun, same_bits, unequal
from fuzzytree.errors import LossError
from fuzzytree.model import (
    BoolArray,
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
    axis_lines,
    baseline,
    definition,
    is_installed,
    needed_by,
    plan_axes,
)
from fuzzytree.semantics import error_bounds, forms, program_of

_SLOW_ROWS = 60  # rows that a slow runtime is given, whatever the others get
_EDGE = 1e-6  # share of an output's range; a wider bound says little

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
        """Answer rows, and keep warnings in; check N4 examines them."""
        return run_with_warning(self, values)[0]

    def some(self, values: FloatArray) -> FloatArray:
        """Return the rows to run: a share of them if the runtime is slow."""
        return values[:, share(values)] if self.runtime.is_slow else values

    def fault(
        self, what: str, values: FloatArray, one: Outcome, two: Outcome
    ) -> tuple[int, str | None]:
        """Return how many rows two outcomes answer, and what is wrong if they differ.

        Bits must be equal, but for what a library's functions change in a system.
        """
        wrong = unequal(one, two)
        if wrong.any() and self.model.outputs:
            gap, allowed = number_gaps(self.model, values, one, two)
            wrong = np.asarray((gap > allowed).any(axis=0))
        if not wrong.any():
            return int(wrong.size), None
        count = f"{int(wrong.sum())} of {wrong.size} rows are answered differently"
        return int(wrong.size), f"{self.title}{what.format(count)}"


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


def run_with_warning(one: LoadedForm, values: FloatArray) -> tuple[Outcome, str | None]:
    """Return a runtime's answers, and the first warning that it let out, if any."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        outcome = one.loud(values)
    return outcome, str(caught[0].message) if caught else None


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
    arrays = msgspec.structs.asdict(right)
    for name in ("status", "strengths", "outputs"):
        arrays[name] = np.array(arrays[name])
        arrays[name][..., some] = getattr(inferred, name)
    return Outcome(**arrays)


def exact_check(
    one: LoadedForm, values: FloatArray, right: Truth | None = None
) -> ExactCheck:
    """Run rows and compare the predictions with the right ones, if known already.

    Rows that are missing in the number type and not in double (beyond float32) are
    left to criterion N6.
    """
    right = truth(one.model, values) if right is None else right
    outcome = one.run(values)
    compare = _numbers_off if isinstance(right, Outcome) else _strengths_off
    low, allowed, is_open, wrong, flips, text = compare(one, values, outcome, right)
    faults: tuple[str, ...] = ()
    if wrong.any():
        row = int(np.flatnonzero(wrong)[np.argmax(low[wrong])])
        count = f"{int(wrong.sum())} of {wrong.size} rows are beyond the bound"
        where = row_text(one.model.inputs, values, row)
        faults = (f"{one.title}: {count}: {text(row)}: {where}",)
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


Errors = tuple[
    FloatArray, FloatArray, BoolArray, BoolArray, BoolArray, Callable[[int], str]
]
"""Of each row: the error, its bound, whether that proves nothing, whether the row is
wrong and has another answer; and what is wrong with a row, in words."""


def _strengths_off(
    one: LoadedForm, values: FloatArray, outcome: Outcome, right: Any
) -> Errors:
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

    def text(row: int) -> str:
        if low[row] > allowed[row]:
            return f"strengths off by {low[row]:.3g}, {allowed[row]:.3g} allowed"
        return f"rule {outcome.rule[row]} wins and another is right"

    return low, allowed, known & (allowed >= 1.0), wrong, flips, text


def _numbers_off(
    one: LoadedForm, values: FloatArray, outcome: Outcome, right: Any
) -> Errors:
    """Compare all numbers of a system with the right ones."""
    gap, allowed = number_gaps(one.model, values, outcome, right)
    spans = np.ones((len(gap), 1))
    spans[: len(one.model.outputs)] = output_spans(one.model, right)
    is_open, is_wrong = allowed > _EDGE * spans, gap > allowed
    low = np.where(is_open & ~is_wrong, 0.0, gap)
    worst = np.argmax(np.where(is_wrong.any(axis=0) & ~is_wrong, -1.0, low), axis=0)
    cells = worst, np.arange(gap.shape[1])

    def text(row: int) -> str:
        line, names = int(worst[row]), [output.name for output in one.model.outputs]
        rules = [f"rule {k + 1}" for k in range(len(gap) - len(names) - 1)]
        names = [*(f"output {name!r}" for name in names), *rules, "status"]
        has_strengths = bool(rules)
        tables = [_numbers(o, has_strengths=has_strengths) for o in (outcome, right)]
        number, other = (float(table[line, row]) for table in tables)
        limit = f"{allowed[line, row]:.3g} allowed"
        return f"{names[line]} {number!r} where {other!r} is right, {limit}"

    flips = outcome.status != right.status
    wrong = np.asarray(is_wrong.any(axis=0))
    is_edge = np.asarray(is_open.any(axis=0))
    return low[cells], allowed[cells], is_edge, wrong, flips, text


def number_gaps(
    model: Document, values: FloatArray, one: Outcome, two: Outcome
) -> tuple[FloatArray, FloatArray]:
    """Return how far the numbers of a system are apart, and how far they may be.

    Returns:
        Two arrays of shape (numbers, rows): outputs, activations if both have them,
        and the status. A number is infinitely far from NaN.
    """
    has_strengths = one.strengths is not None and two.strengths is not None
    first, second = (_numbers(some, has_strengths=has_strengths) for some in (one, two))
    is_same = same_bits(first, second)
    with np.errstate(invalid="ignore"):
        gap = np.abs(first - second)
    gap[np.isnan(gap)] = np.inf
    gap[is_same] = 0.0
    rows = np.flatnonzero(~is_same.all(axis=0))
    allowed = np.zeros(gap.shape)
    if rows.size:
        program = program_of(model, with_strengths=has_strengths)
        allowed[:, rows] = error_bounds(program, values[:, rows])
    return gap, allowed


def _numbers(outcome: Outcome, *, has_strengths: bool) -> FloatArray:
    """Return all numbers of a system in the order of its program's results."""
    strengths = outcome.strengths if has_strengths else None
    status = outcome.status[np.newaxis].astype(np.float64)
    parts = (outcome.outputs, strengths, status)
    return np.vstack([part for part in parts if part is not None])


def output_spans(model: Document, outcome: Outcome) -> FloatArray:
    """Return the width of each output's range, or its largest size, as a column."""
    numbers = np.abs(np.empty((0, 1)) if outcome.outputs is None else outcome.outputs)
    numbers[~np.isfinite(numbers)] = 0.0
    spans = np.maximum(numbers.max(axis=1, initial=0.0, keepdims=True), 1.0)
    for line, output in enumerate(model.outputs):
        if output.low is not None and output.high is not None:
            spans[line] = output.high - output.low
    return np.asarray(spans)


def missing_rows(model: Document, values: FloatArray, dtype: Dtype) -> BoolArray:
    """Return which rows count as missing, by the declared policy.

    A row is missing if the value of any variable is not finite in the type of axes:
    inputs rounded to it, combinations added up in their order, each step rounded.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, inputs=1, leaves=2)
        >>> missing_rows(tree, np.array([[1.0, np.nan, 1e39]]), "float32").tolist()
        [False, True, True]
    """
    kind = np.dtype(np.float32) if dtype == "float32" else np.dtype(np.float64)
    with np.errstate(all="ignore"):
        lines = axis_lines(plan_axes(model.variables, kind), values)
    return np.asarray(~np.isfinite(lines).all(axis=0))
