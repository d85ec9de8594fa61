"""The forms of a model loaded in runtimes, and their distance from the exact degrees.

A strength may differ from the exact one by `numerics.bounds.strength_bounds`, for the
runtime's number type; a runtime with a bound of its own adds that to the one of double.
A class may differ where the exact margin is at most twice the bound, and nowhere else;
the path of a tree only in rows within rounding of a cut.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from fuzzytree.checking.comparing import ModelRun, exact_errors, unequal
from fuzzytree.errors import LossError
from fuzzytree.model import (
    BoolArray,
    Dtype,
    FloatArray,
    Model,
    Outcome,
    RuleBase,
    Run,
    Runtime,
    kind_of,
)
from fuzzytree.numerics import Decisions, decide, filled_values, strength_bounds
from fuzzytree.runtimes import is_installed, needed_by
from fuzzytree.semantics import forms

_SLOW_ROWS = 60  # rows that a slow runtime is given, whatever the others get


class LoadedForm(msgspec.Struct, frozen=True):
    """A form of a model in a runtime, ready to answer.

    Attributes:
        title: What to call it, such as `onnxruntime float32: raw rules`.
        representation: What to call the form.
        runtime: The runtime.
        model: The form.
        loud: Its answers, with the warnings that it lets out.
    """

    title: str
    representation: str
    runtime: Runtime
    model: Model
    loud: Run

    def run(self, values: FloatArray) -> Outcome:
        """Answer rows, and keep warnings in; check N4 examines them."""
        return run_with_warning(self, values)[0]

    def some(self, values: FloatArray) -> FloatArray:
        """Return the rows to run: a share of them if the runtime is slow."""
        rows = values.shape[1]
        if not self.runtime.is_slow or rows <= _SLOW_ROWS:
            return values
        return values[:, :: -(-rows // _SLOW_ROWS)]


def loaded_forms(
    model: Model, runtimes: Sequence[Runtime], skipped: list[str]
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
    representation: str, form: Model, runtime: Runtime, skipped: list[str]
) -> LoadedForm | None:
    """Return one form in one runtime; None if that cannot be, with a reason kept."""
    kind = kind_of(form)
    if kind not in runtime.runs:
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
    if one.runtime.bound is None:
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
    """How far a runtime was from the exact answers.

    Attributes:
        rows: Rows that were run.
        worst: The largest error of a strength that is certain, in rows with a bound; 0
            for a tree.
        allowed: The bound in the row of that error.
        largest: The same in all rows.
        flips: Rows whose class differs from the exact one.
        unbounded: Rows in which the bound is 1 and proves nothing.
        faults: What is beyond the bound, in sentences.
        outcome: What the runtime answered.
    """

    rows: int
    worst: float
    allowed: float
    largest: float
    flips: int
    unbounded: int
    faults: tuple[str, ...]
    outcome: Outcome


def exact_check(
    one: LoadedForm, values: FloatArray, exact: Decisions | None = None
) -> ExactCheck:
    """Run rows and compare the predictions with the exact ones.

    Rows that are missing in the number type and not in double (beyond float32) are
    left to criterion N6.

    `exact` has the exact answers to these rows, if they are known already.
    """
    truth = decide(one.model, values) if exact is None else exact
    outcome = one.run(values)
    dtype = one.runtime.dtype
    known = ~missing_rows(one.model, values, dtype)
    allowed = allowed_errors(one, values)
    run = ModelRun(one.title, one.model, outcome)
    errors = exact_errors(run, truth, values, dtype, allowed)
    flips = errors.flips & known
    low = np.where(known, 0.0 if errors.low is None else errors.low, 0.0)
    wrong = flips & ~errors.close | (low > allowed)
    bounded = np.where(allowed < 1.0, low, 0.0)
    faults: list[str] = []
    if wrong.any():
        row = int(np.flatnonzero(wrong)[np.argmax(low[wrong])])
        fault = f"rule {outcome.rule[row]} wins and another is right"
        if low[row] > allowed[row]:
            fault = f"strengths off by {low[row]:.3g}, {allowed[row]:.3g} allowed"
        count = f"{int(wrong.sum())} of {wrong.size} rows are beyond the bound"
        where = row_text(one.model.inputs, values, row)
        faults.append(f"{one.title}: {count}: {fault}: {where}")
    worst = int(np.argmax(bounded)) if low.size else 0
    return ExactCheck(
        values.shape[1],
        float(bounded[worst]) if low.size else 0.0,
        float(allowed[worst]) if low.size else 0.0,
        float(low.max(initial=0.0)),
        int(flips.sum()),
        int((known & (allowed >= 1.0)).sum()),
        tuple(faults),
        outcome,
    )


def allowed_errors(one: LoadedForm, values: FloatArray) -> FloatArray:
    """Return by how much a strength may differ from the exact one, for each row."""
    if not isinstance(one.model, RuleBase):
        return np.zeros(values.shape[1])
    own = one.runtime.bound
    dtype: Dtype = one.runtime.dtype if own is None else "float64"
    allowed, _ = strength_bounds(one.model, dtype, values)
    if own is not None:
        allowed = np.minimum(allowed + own(one.model)[0], 1.0)
    return allowed


def missing_rows(model: Model, values: FloatArray, dtype: Dtype) -> BoolArray:
    """Return which rows count as missing, by the declared policy.

    A row is missing if the value of any variable is not finite in the type of axes:
    inputs rounded to it, combinations added up in their order, each step rounded.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1, inputs=1, leaves=2)
        >>> missing_rows(tree, np.array([[1.0, np.nan, 1e39]]), "float32").tolist()
        [False, True, True]
    """
    kind = np.dtype(np.float32 if dtype == "float32" else np.float64)
    with np.errstate(all="ignore"):
        rounded = values.astype(kind).astype(np.float64)  # what overflows is missing
        rounded = filled_values(model.variables, rounded)
        axes = dict(zip(model.inputs, rounded.astype(kind), strict=True))
        known = np.ones(values.shape[1], np.bool_)
        for variable in model.variables:
            total = axes.get(variable.name)
            for part in variable.parts:
                weight, centre = (kind.type(n) for n in (part.weight, part.centre))
                step = weight * (axes[part.input] - centre)
                total = step if total is None else total + step
            if total is not None:
                known &= np.isfinite(total)
    missing: BoolArray = ~known
    return missing
