"""A runtime's answers held against the exact ones, within a bound for each row.

The bound is `numerics.bounds.strength_bounds`, for the runtime's number type; a runtime
with a bound of its own adds that to the one of double. A class may differ where the
exact margin is at most twice the bound, and nowhere else; the path of a tree only in
rows within rounding of a cut.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.checking.comparing import Answers, labels
from fuzzytree.checking.stability.carriers import Ready, row_text
from fuzzytree.checking.stability.specials import missing_rows
from fuzzytree.model.contracts import Dtype, Outcome
from fuzzytree.model.rulebase import RuleBase
from fuzzytree.numerics.bounds import open_paths, strength_bounds
from fuzzytree.numerics.oracle import Decided, decide, strength_errors

if TYPE_CHECKING:
    from fuzzytree.checking.stability.carriers import BoolArray
    from fuzzytree.model.contracts import FloatArray


class Observed(NamedTuple):
    """How far a runtime was from the exact answers.

    Attributes:
        rows: Rows that were asked.
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


def observed(one: Ready, values: FloatArray, exact: Decided | None = None) -> Observed:
    """Run rows and hold the answers against the exact ones.

    Rows that are missing in the number type and not in double (beyond float32) are
    left to criterion N6.

    Args:
        one: The runtime, with its model.
        values: Shape (inputs, rows).
        exact: The exact answers to these rows, if they are known already.
    """
    truth = decide(one.model, values) if exact is None else exact
    found = one.run(values)
    dtype = one.runtime.dtype
    known = ~missing_rows(one.model, values, dtype)
    allowed = allowed_errors(one, values)
    flips = (labels(Answers(one.title, one.model, found)) != truth.label) & known
    if isinstance(one.model, RuleBase):
        excused = truth.margin <= 2.0 * allowed
    else:
        excused = open_paths(one.model, dtype, values)
    wrong = flips & ~excused
    low = np.zeros(values.shape[1])
    if found.strengths is not None and isinstance(one.model, RuleBase):
        low = strength_errors(one.model, values, found.strengths)[0]
        low[~known] = 0.0
        wrong |= low > allowed
    bounded = np.where(allowed < 1.0, low, 0.0)
    faults = [_fault(one, values, found, wrong, low, allowed)] if wrong.any() else []
    worst = int(np.argmax(bounded)) if low.size else 0
    return Observed(
        values.shape[1],
        float(bounded[worst]) if low.size else 0.0,
        float(allowed[worst]) if low.size else 0.0,
        float(low.max(initial=0.0)),
        int(flips.sum()),
        int((known & (allowed >= 1.0)).sum()),
        tuple(faults),
        found,
    )


def allowed_errors(one: Ready, values: FloatArray) -> FloatArray:
    """Return by how much a strength may differ from the exact one, for each row."""
    if not isinstance(one.model, RuleBase):
        return np.zeros(values.shape[1])
    own = one.runtime.bound
    dtype: Dtype = one.runtime.dtype if own is None else "float64"
    allowed, _ = strength_bounds(one.model, dtype, values)
    if own is not None:
        allowed = np.minimum(allowed + own(one.model)[0], 1.0)
    return allowed


def _fault(
    one: Ready,
    values: FloatArray,
    found: Outcome,
    wrong: BoolArray,
    low: FloatArray,
    allowed: FloatArray,
) -> str:
    row = int(np.flatnonzero(wrong)[np.argmax(low[wrong])])
    text = f"{one.title}: {int(wrong.sum())} of {wrong.size} rows are beyond the bound"
    where = row_text(one.model.inputs, values, row)
    if low[row] > allowed[row]:
        sizes = f"strengths off by {low[row]:.3g}, {allowed[row]:.3g} allowed"
        return f"{text}: {sizes}: {where}"
    return f"{text}: rule {found.rule[row]} wins and another is right: {where}"
