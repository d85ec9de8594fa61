"""N8: rows on every edge, and the user's own, against the exact answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fuzzytree.contracts import Model, Runtime
from fuzzytree.criteria.carriers import ready
from fuzzytree.criteria.judging import observed
from fuzzytree.criteria.results import Criterion, judged
from fuzzytree.numerics.oracle import Decided, decide

if TYPE_CHECKING:
    from fuzzytree.contracts import FloatArray

_ADVICE = (
    "the runtime computes something else, or in another number type than it says; "
    "do not use it for this model"
)


def exactness(
    model: Model, runtimes: Sequence[Runtime], values: FloatArray
) -> Criterion:
    """Hold every runtime against the exact answers, within its bound (N8).

    Args:
        model: A tree or a rule base.
        runtimes: What to run.
        values: Shape (inputs, rows): each breakpoint with its neighbouring floats, in
            float32 and float64, and rows of data.
    """
    faults: list[str] = []
    skipped: list[str] = []
    exact: dict[tuple[str, int], Decided] = {}
    worst: dict[str, tuple[float, float, int]] = {}
    cases = 0
    for one in ready(model, runtimes, skipped):
        rows = one.some(values)
        key = (one.carrier, rows.shape[1])
        if key not in exact:
            exact[key] = decide(one.model, rows)
        seen = observed(one, rows, exact[key])
        cases += seen.rows
        faults += seen.faults
        before = worst.get(one.runtime.dtype, (0.0, 0.0, 0))
        flips = before[2] + seen.flips
        if one.runtime.bound is None and seen.worst >= before[0]:
            worst[one.runtime.dtype] = (seen.worst, seen.allowed, flips)
        else:
            worst[one.runtime.dtype] = (*before[:2], flips)
        if seen.unbounded:
            skipped.append(f"{one.title}: no bound in {seen.unbounded} rows")
    facts = [
        f"{dtype}: strengths off by at most {error:.2g}, {allowed:.2g} allowed there; "
        f"{flips} classes flip, all within the band"
        for dtype, (error, allowed, flips) in worst.items()
        if not faults
    ]
    return judged(
        "N8",
        cases,
        faults,
        worst=max((error for error, _, _ in worst.values()), default=None),
        facts=facts,
        advice=_ADVICE,
        skipped=skipped,
    )
