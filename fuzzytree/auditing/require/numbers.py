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
from fuzzytree.auditing.require.search import Outcome, Rows, Search
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
    rules = [
        OutputBounds(search.base, system, one.name).rules for one in system.outputs
    ]
    proof = "some rule fires everywhere"
    return search.rule_out([*map(gap, rules)], "no rule fires", proof, loss)


def number_outcome(search: Search, system: FuzzySystem, claim: NumberClaim) -> Outcome:
    """Return whether an output has a number everywhere, and it or its slope is right.

    Both ends of a claim are moved outwards by what rounding may change.
    """
    place = [output.name for output in system.outputs].index(claim.output)
    output, scale = system.outputs[place], scale_of(system, claim.output)
    line, unit, of = 0, scale, "it"
    if claim.input:
        axis = search.base.inputs[claim.input]
        unit = scale / (float(axis.high - axis.low) or 1.0)
        line, of = search.model.inputs.index(claim.input), "its slope"

    def loss(rows: Rows) -> FloatArray:
        y = search.predict(rows)[place]
        far = np.ones(y.shape[1])
        if claim.input:
            y, far = y[1:] - y[:1], rows[line, 1] - rows[line, 0]
        with np.errstate(invalid="ignore"):  # infinite ends of rows that are equal
            lost = np.maximum(claim.low * far - y[0], y[0] - claim.high * far)
        lost -= ROUNDING * scale
        if claim.input:
            return np.where((far > 0.0) & np.isfinite(y[0]), lost, -1.0)
        return np.where(np.isnan(y[0]), np.inf, lost)

    def refuted(rows: Rows) -> Outcome:
        first, *more = search.predict(rows)[place, :, 0].tolist()
        text = f"it is {first:.6g}" if math.isfinite(first) else "no rule fires"
        for second in more:
            far = rows[line, 1, 0] - rows[line, 0, 0]
            text = f"as {claim.input} rises by {far:.6g}, it changes by "
            text += f"{second - first:.6g}"
        return Outcome("REFUTED", text, rows)

    rows = search.worst(loss, [claim.input] if claim.input else ())
    if rows is not None:
        return refuted(rows)
    bounds = OutputBounds(search.base.fine, system, output.name)
    default = math.nan if output.clips or output.default is None else output.default
    if claim.input or not claim.low <= default <= claim.high:
        row_loss = None if claim.input else loss
        outcome = search.rule_out([gap(bounds.rules)], "no rule fires", "", row_loss)
        if outcome.verdict != "PROVED":
            return outcome

    def accepts(point: Mapping[str, Fraction]) -> bool:
        return not claim.input and loss(search.row(point))[0] > 0.0

    def prove(slack: float, steps: int) -> Answer:
        slack += ROUNDING * unit

        def is_excluded(boxes: Boxes) -> BoolArray:
            ends = (
                bounds.slopes(boxes, claim.input)
                if claim.input
                else bounds.numbers(boxes)
            )
            is_high = ends.low >= claim.low - slack
            return np.array(is_high & (ends.high <= claim.high + slack))

        steps //= bounds.work
        with np.errstate(all="ignore"):
            return search_boxes(
                search.base.fine, is_excluded, accepts, Budget(2 * steps), steps
            )

    answer = prove(0.0, search.steps)
    if isinstance(answer, Point):
        return refuted(search.row(answer.values))
    if isinstance(answer, Proved):
        where = "the whole domain" if answer.how == "1 boxes" else answer.how
        return Outcome("PROVED", f"bounds of {of} on {where}")
    bound = None
    if math.isinf(claim.low) or math.isinf(claim.high) or claim.low == -claim.high:
        for share in _WEAKER:
            if isinstance(prove(share * unit, search.steps // 8), Proved):
                slack = share * unit
                is_low = math.isinf(claim.high)
                bound = claim.low - slack if is_low else claim.high + slack
                break
    return Outcome("OPEN", answer.why, bound=bound)
