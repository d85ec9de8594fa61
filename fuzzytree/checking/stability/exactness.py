"""N8: rows on every edge, and the user's own, against the exact answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fuzzytree.checking.stability.carriers import ready, unequal
from fuzzytree.checking.stability.judging import Observed, observed
from fuzzytree.checking.stability.results import Criterion, judged
from fuzzytree.model.contracts import Dtype, Model, Outcome, Runtime
from fuzzytree.numerics.oracle import Decided, decide

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_ADVICE = (
    "the runtime computes something else, or in another number type than it says; "
    "do not use it for this model"
)


def exactness(
    model: Model, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Hold every runtime against the exact answers, within its bound (N8).

    Runtimes of one number type that claim no bound of their own promise the same
    operations: they are held against each other as well, bit for bit.

    Args:
        model: A tree or a rule base.
        runtimes: What to run.
        values: Shape (inputs, rows): each breakpoint with its neighbouring floats, in
            float32 and float64, and rows of data.
    """
    faults: list[str] = []
    skipped: list[str] = []
    exact: dict[tuple[str, int], Decided] = {}
    seen: dict[str, list[Observed]] = {}
    first: dict[tuple[str, Dtype, bool], tuple[str, Outcome]] = {}
    cases = 0
    for one in ready(model, runtimes, skipped):
        rows = one.some(values)
        key = (one.representation, rows.shape[1])
        if key not in exact:
            exact[key] = decide(one.model, rows)
        found = observed(one, rows, exact[key])
        cases += found.rows
        faults += found.faults
        if one.runtime.bound is None:
            same = (one.representation, one.runtime.dtype, one.runtime.is_slow)
            title, other = first.setdefault(same, (one.title, found.outcome))
            wrong = int(unequal(found.outcome, other).sum())
            if wrong:
                faults.append(f"{one.title}: other bits than {title} in {wrong} rows")
        own = f" in {one.runtime.name}" if one.runtime.bound is not None else ""
        seen.setdefault(f"{one.runtime.dtype}{own}", []).append(found)
    errors = [one.worst for found in seen.values() for one in found]
    facts = [_fact(name, found) for name, found in seen.items()]
    return judged(
        "N8",
        cases,
        faults,
        worst=max(errors, default=None),
        facts=facts,
        advice=_ADVICE,
        skipped=skipped,
    )


def _fact(name: str, found: Sequence[Observed]) -> str:
    worst = max(found, key=lambda one: one.worst)
    flips = max(one.flips for one in found)
    text = f"{name}: strengths off by at most {worst.worst:.2g}"
    text += f" where {worst.allowed:.2g} is allowed, flips: {flips}"
    unbounded = max(one.unbounded for one in found)
    if unbounded:
        text += f"; no bound in {unbounded}, beyond the type or near a step"
    return text
