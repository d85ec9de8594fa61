"""Claims about the outputs of a fuzzy system: gaps, levels and slopes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from fuzzytree.auditing.decide import (
    Answer,
    Boxes,
    Budget,
    OutputBounds,
    Point,
    Proved,
    scale_of,
    search_boxes,
)
from fuzzytree.auditing.require.claims import NumberClaim
from fuzzytree.auditing.require.classes import gap
from fuzzytree.auditing.require.search import Loss, Outcome, Rows, Search
from fuzzytree.model import BoolArray, FloatArray, FuzzySystem
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import Status

ROUNDING = 1e-9
"""The share of an output's scale by which rounding may change what is claimed of it."""

_WEAKER = tuple(2.0**k for k in (-10, -7, -5, -3, -1, 1, 4, 8))
"""The shares of an output's scale by which an open claim is weakened, in this order."""


def covered_outcome(search: Search, system: FuzzySystem) -> Outcome:
    """Return whether every output of a system has a number that rules conclude."""
    run = run_system(system)

    def loss(rows: Rows) -> FloatArray:
        return np.where(run(rows[:, 0]).status == Status.UNCOVERED, 1.0, -1.0)

    rows = search.worst(loss)
    if rows is not None:
        return Outcome("REFUTED", "no rule fires", rows)
    questions = [
        gap(OutputBounds(search.base, system, output.name).rules)
        for output in system.outputs
    ]
    proof = "some rule fires everywhere"
    return search.rule_out(questions, "no rule fires", proof, loss)


def number_outcome(search: Search, system: FuzzySystem, claim: NumberClaim) -> Outcome:
    """Return whether an output has a number everywhere, and it or its slope is right.

    Both ends of a claim are moved outwards by what rounding may change.
    """
    place = [output.name for output in system.outputs].index(claim.output)
    line = search.model.inputs.index(claim.input) if claim.input else None
    allowed = ROUNDING * scale_of(system, claim.output)

    def loss(rows: Rows) -> FloatArray:
        y = search.predict(rows)[place]
        if line is None:
            lost = np.maximum(claim.low - y[0], y[0] - claim.high) - allowed
            return np.where(np.isnan(y[0]), np.inf, lost)
        rise, far = y[1] - y[0], rows[line, 1] - rows[line, 0]
        with np.errstate(invalid="ignore"):  # infinite ends of rows that are equal
            lost = np.maximum(claim.low * far - rise, rise - claim.high * far)
        return np.where((far > 0.0) & np.isfinite(rise), lost - allowed, -1.0)

    rows = search.worst(loss, [claim.input] if claim.input else ())
    outcome = Outcome("REFUTED", "", rows)
    if rows is None:
        outcome = _proof(search, system, claim, loss)
        rows = outcome.rows
    if rows is None:
        return outcome
    first, *more = search.predict(rows)[place, :, 0].tolist()
    text = f"it is {first:.6g}" if math.isfinite(first) else "no rule fires"
    for second in more:
        far = float(np.ptp(rows[line]))
        text = f"as {claim.input} rises by {far:.6g}, it changes by "
        text += f"{second - first:.6g}"
    return outcome._replace(sentence=text)


def _proof(
    search: Search, system: FuzzySystem, claim: NumberClaim, loss: Loss
) -> Outcome:
    """Return what bounds on boxes prove, or the row of a box that refutes it."""
    base, unit, of = search.base.fine, scale_of(system, claim.output), "it"
    if claim.input:
        axis = base.inputs[claim.input]
        unit, of = unit / (float(axis.high - axis.low) or 1.0), "its slope"
    bounds = OutputBounds(base, system, claim.output)
    default = bounds.output.default
    is_default = default is not None and claim.low <= default <= claim.high
    if claim.input or bounds.output.clips or not is_default:
        row_loss = None if claim.input else loss
        outcome = search.rule_out([gap(bounds.rules)], "no rule fires", "", row_loss)
        if outcome.verdict != "PROVED":
            return outcome

    def accepts(point: Mapping[str, Fraction]) -> bool:
        return not claim.input and loss(search.row(point))[0] > 0.0

    def prove(slack: float, steps: int) -> Answer:
        low, high = (
            end + sign * (slack + ROUNDING * unit)
            for end, sign in ((claim.low, -1), (claim.high, 1))
        )

        def is_excluded(boxes: Boxes) -> BoolArray:
            name = claim.input
            ends = bounds.slopes(boxes, name) if name else bounds.numbers(boxes)
            return np.array((ends.low >= low) & (ends.high <= high))

        steps //= bounds.work
        with np.errstate(all="ignore"):
            return search_boxes(base, is_excluded, accepts, Budget(2 * steps), steps)

    answer = prove(0.0, search.steps)
    if isinstance(answer, Point):
        return Outcome("REFUTED", "", search.row(answer.values))
    if isinstance(answer, Proved):
        where = "the whole domain" if answer.how == "1 boxes" else answer.how
        return Outcome("PROVED", f"bounds of {of} on {where}")
    open_ends = [math.isinf(claim.low), math.isinf(claim.high)]
    for share in _WEAKER if any(open_ends) or claim.low == -claim.high else ():
        slack = share * unit
        if isinstance(prove(slack, search.steps // 8), Proved):
            bound = claim.low - slack if open_ends[1] else claim.high + slack
            return Outcome("OPEN", answer.why, bound=bound)
    return Outcome("OPEN", answer.why)
