"""N1 and N2b: other units, by powers of two, change no bit of any answer."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.checking.stability.carriers import Ready, made_ready, ready, unequal
from fuzzytree.checking.stability.results import Criterion, Usable, judged
from fuzzytree.checking.stability.transforms import NORMAL, exponent_range, scaled
from fuzzytree.errors import InvalidModelError, LossError
from fuzzytree.model.contracts import Dtype, Model, Runtime

if TYPE_CHECKING:
    from fuzzytree.checking.stability.carriers import BoolArray
    from fuzzytree.model.contracts import FloatArray

_STEPS = (-300, -40, -7, 7, 40, 300)  # and the ends of the range
_DECADES = 20.0
_BINARY_DECADES = int(np.ceil(_DECADES * np.log2(10.0)))  # 67 doublings
_ADVICE = (
    "the runtime compares with a fixed number somewhere, or leaves the number range "
    "in between; use one whose steps are differences, quotients and comparisons"
)
_NO_INPUT = "the model has no input"


def scaling(
    model: Model, runtimes: Sequence[Runtime], values: FloatArray
) -> tuple[Criterion, tuple[Usable, ...]]:
    """Multiply the inputs of a model and of rows by 2**k; demand equal bits (N1).

    k runs over a ladder up to both ends of the range in which every number of the
    model stays normal; last, every input has a k of its own.

    Args:
        model: A tree or a rule base.
        runtimes: What to run.
        values: Shape (inputs, rows).

    Returns:
        The criterion, and the range of k for each form and number type.
    """
    if not model.inputs:
        return judged("N1", 0, (), skipped=(_NO_INPUT,)), ()
    faults: list[str] = []
    skipped: list[str] = []
    usable: dict[tuple[str, Dtype], Usable] = {}
    cases = 0
    for one in ready(model, runtimes, skipped):
        low, high = exponent_range(one.model, one.runtime.dtype)
        if low > high:
            skipped.append(f"{one.title}: its numbers span more than the type does")
            continue
        key = (one.representation, one.runtime.dtype)
        usable[key] = Usable(one.representation, one.runtime.dtype, low, high)
        ks = [k for k in _STEPS if low < k < high]
        # An engine of others divides and multiplies in between as it likes.
        ks += [] if one.runtime.bound is not None else [low, high]
        plans = [dict.fromkeys(model.inputs, k) for k in ks]
        middle = min(max(0, low), high)
        least, most = max(low, middle - 60), min(high, middle + 60)
        plans.append(_apart(model.inputs, least, most, seed=0))
        for plan in plans:
            count, fault = _tried(one, plan, values, skipped)
            cases += count
            faults += [fault] if fault else []
    facts = [
        f"{name}: inputs times 2**{low} to 2**{high} change nothing"
        for name, low, high in _together(tuple(usable.values()))
    ]
    criterion = judged(
        "N1", cases, faults, facts=facts, advice=_ADVICE, skipped=skipped
    )
    return criterion, tuple(usable.values())


def decades(model: Model, runtimes: Sequence[Runtime], values: FloatArray) -> Criterion:
    """Spread the units of a model's inputs over 20 decades; demand equal bits (N2b).

    The inputs of one combination are spread as well.
    """
    faults: list[str] = []
    skipped: list[str] = []
    cases = 0
    if len(model.inputs) < 2:
        skipped.append("a model of one input has no features apart")
        return judged("N2b", 0, (), skipped=skipped)
    places = np.linspace(0, _BINARY_DECADES, len(model.inputs))
    order = random.Random(0).sample(range(len(places)), len(places))
    for one in ready(model, runtimes, skipped):
        low, high = exponent_range(one.model, one.runtime.dtype)
        start = min(max(-_BINARY_DECADES // 2, low), high - _BINARY_DECADES)
        if start < low:
            skipped.append(f"{one.title}: its own numbers leave no room for 20 decades")
            continue
        ks = [start + int(places[k]) for k in order]
        plan = dict(zip(model.inputs, ks, strict=True))
        count, fault = _tried(one, plan, values, skipped)
        cases += count
        faults += [fault] if fault else []
    return judged("N2b", cases, faults, advice=_ADVICE, skipped=skipped)


def _together(usable: Sequence[Usable]) -> Iterator[tuple[str, int, int]]:
    """Yield the range that all forms share, for double axes and for float32."""
    for name, kinds in (("double", ("float64", "mixed")), ("float32", ("float32",))):
        found = [one for one in usable if one.dtype in kinds]
        if found:
            lowest, highest = (one.lowest for one in found), (u.highest for u in found)
            yield name, max(lowest), min(highest)


def _apart(inputs: Sequence[str], low: int, high: int, seed: int) -> dict[str, int]:
    chance = random.Random(seed)
    return {name: chance.randint(low, high) for name in inputs}


def _tried(
    one: Ready, plan: Mapping[str, int], values: FloatArray, skipped: list[str]
) -> tuple[int, str | None]:
    """Return how many rows were compared, and what was wrong."""
    ks = [plan[name] for name in one.model.inputs]
    said = (
        f"2**{ks[0]}" if len(set(ks)) == 1 else f"2**k, k from {min(ks)} to {max(ks)}"
    )
    try:
        other = scaled(one.model, plan)
    except (LossError, InvalidModelError) as error:
        return 1, f"{one.title}, inputs times {said}: {error}"
    lost: list[str] = []
    after = made_ready(one.representation, other, one.runtime, lost)
    if after is None:
        return 1, f"inputs times {said}: {lost[0]}"
    some = one.some(values)
    rows = some[:, _is_normal(some, ks, one.runtime.dtype)]
    if not rows.shape[1]:
        skipped.append(f"{one.title}, inputs times {said}: no row stays in range")
        return 0, None
    factors = np.array(ks, np.int64)[:, np.newaxis]
    wrong = unequal(one.run(rows), after.run(np.ldexp(rows, factors)))
    if not wrong.any():
        return int(wrong.size), None
    fault = (
        f"{one.title}, inputs times {said}: {int(wrong.sum())} of {wrong.size} rows "
        "are answered differently"
    )
    return int(wrong.size), fault


def _is_normal(values: FloatArray, ks: Sequence[int], dtype: Dtype) -> BoolArray:
    """Return the rows whose numbers are normal or 0, before and after; NaN may be."""
    low, high = NORMAL[dtype]
    exponents = np.frexp(values)[1]
    free = (values == 0.0) | ~np.isfinite(values)
    fits = np.ones(values.shape[1], np.bool_)
    for line, k in enumerate(ks):
        here = exponents[line]
        inside = (here >= low) & (here <= high)
        inside &= (here + k >= low) & (here + k <= high)
        fits &= inside | free[line]
    return fits
