"""N2 and N8: every runtime stays within its bound, near zero and far from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import get_args

import numpy as np

from fuzzytree.checking.stability.results import Criterion, Trial
from fuzzytree.checking.stability.runs import (
    ExactCheck,
    FirstOutcomes,
    Truth,
    exact_check,
    first_line,
    forms_of,
    loaded_form,
    loaded_forms,
    other_bits,
    truth,
)
from fuzzytree.checking.stability.sensitivity import input_scales
from fuzzytree.checking.stability.transforms import moved
from fuzzytree.errors import InvalidModelError
from fuzzytree.model import Document, Dtype, FloatArray, Runtime
from fuzzytree.semantics import probe_values

_ADVICE = (
    "the runtime computes something else, or in another number type than it says; "
    "do not use it for this model"
)


def exactness(
    model: Document, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Hold every runtime against the right answers, within its bound (N8).

    Runtimes of one number type that claim no bound of their own promise the same
    operations: they are compared with each other as well, bit for bit.

    Values are each breakpoint with its neighbouring floats, in float32 and float64, and
    rows of data, of shape (inputs, rows).
    """
    trial = Trial("N8", _ADVICE)
    right: dict[tuple[str, int], Truth] = {}
    checks: dict[str, list[ExactCheck]] = {}
    first: FirstOutcomes = {}
    for one in loaded_forms(model, runtimes, trial.skipped):
        rows = one.some(values)
        key = (one.representation, rows.shape[1])
        if key not in right:
            right[key] = truth(one.model, rows)
        check = exact_check(one, rows, right[key])
        trial.add(check.rows, *check.faults, worst=check.worst)
        trial.faults += other_bits(one, rows, check.outcome, first)
        own = f" in {one.runtime.name}" if one.runtime.bound is not None else ""
        checks.setdefault(f"{one.runtime.dtype}{own}", []).append(check)
    nouns = ("numbers", "statuses") if model.outputs else ("strengths", "classes")
    return trial.result(*(_fact(name, check, *nouns) for name, check in checks.items()))


def _fact(name: str, checks: Sequence[ExactCheck], numbers: str, answers: str) -> str:
    worst = max(checks, key=lambda one: one.worst)
    flips = max(one.flips for one in checks)
    text = f"{name}: {numbers} off by at most {worst.worst:.2g}"
    text += f" where {worst.allowed:.2g} is allowed, {answers} changed: {flips}"
    unbounded = max(one.unbounded for one in checks)
    if unbounded:
        text += f"; no bound in {unbounded}, beyond the type or near a step"
    return text


RATIOS = tuple(10.0**-k for k in range(1, 13))
"""Spread over distance from zero, the same for every input."""

_PROBES = 150
_DATA = 300
_REPORTED: tuple[float, ...] = tuple(10.0**-k for k in (1, 3, 5, 7, 9, 11))
_ADVICE_OFFSETS = (
    "take differences before anything is divided or raised to a power: polynomials in "
    "the raw value lose every digit far from zero"
)


def offsets(
    model: Document, runtimes: Sequence[Runtime], data: FloatArray
) -> Criterion:
    """Move every input until its narrowest term is 1e-1 to 1e-12 of its distance (N2).

    The moved model is a model of its own, whose numbers are rounded once. A runtime is
    compared with its right predictions, on probes of its edges and on moved data.

    There may be no rows of data. Slow runtimes get a share of the rows; those with a
    bound of their own promise nothing far from zero and are left out.
    """
    trial = Trial("N2", _ADVICE_OFFSETS, worst=0.0)
    facts: list[str] = []
    scales = input_scales(model, data)
    rows = data[:, :: max(-(-data.shape[1] // _DATA), 1)]
    chosen = [runtime for runtime in runtimes if runtime.bound is None]
    refused: set[str] = set()  # the first distance at which a type gives up is enough
    for representation, form in forms_of(model).items():
        for ratio in RATIOS:
            steps = {
                name: one.spread / ratio - (0.5 * one.low + 0.5 * one.high)
                if np.isfinite(one.spread)
                else 0.0
                for name, one in scales.items()
            }
            try:
                far = moved(form, steps)
            except InvalidModelError as error:
                why = f"{representation} at {ratio:.0e}: {first_line(error)}"
                trial.skipped.append(why)
                continue
            away = rows + np.array([*steps.values()]).reshape(-1, 1)
            values = np.concatenate([probe_values(far, _PROBES), away], axis=1)
            right = truth(far, values)
            checks: list[tuple[ExactCheck, Dtype]] = []
            for runtime in chosen:
                lost: list[str] = []
                one = loaded_form(representation, far, runtime, lost)
                for text in (
                    lost if runtime.name + representation not in refused else ()
                ):
                    refused.add(runtime.name + representation)
                    head, _, why = text.rpartition(": ")
                    trial.skipped.append(
                        f"{head}: spread over distance {ratio:.0e}: {why}"
                    )
                if one is None:
                    continue
                some = one.some(values)
                known = right if some.shape == values.shape else None
                check = exact_check(one, some, known)
                where = f"spread over distance {ratio:.0e}"
                faults = (f"{where}: {fault}" for fault in check.faults)
                trial.add(check.rows, *faults, worst=check.worst)
                checks.append((check, runtime.dtype))
            if ratio in _REPORTED and representation != "tree":
                where = f"{representation}, spread over distance {ratio:.0e}"
                facts += (f"{where}: {cost}" for cost in _costs(checks))
    return trial.result(*facts)


def _costs(checks: Sequence[tuple[ExactCheck, Dtype]]) -> Iterator[str]:
    """Yield what a distance costs in each number type."""
    for dtype in get_args(Dtype):
        every = [check for check, kind in checks if kind == dtype]
        if every:
            error = max(one.largest for one in every)
            flips = max(one.flips for one in every)
            text = f"{dtype} is off by {error:.1e}"
            yield f"{text}, and {flips} of {every[0].rows} answers change"
