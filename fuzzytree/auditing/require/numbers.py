"""Claims about the outputs of a fuzzy system: gaps, levels and slopes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fuzzytree.auditing.decide import Answer, Boxes, Open, Point, Proved
from fuzzytree.auditing.require.claims import LevelClaim, SlopeClaim
from fuzzytree.auditing.require.outputs import ROUNDING, OutputBounds, scale_of
from fuzzytree.auditing.require.search import Outcome, Rows, Search
from fuzzytree.auditing.require.slopes import Slopes
from fuzzytree.model import BoolArray, FloatArray, FuzzySystem
from fuzzytree.runtimes import run_system
from fuzzytree.semantics import Status

_WEAKER = tuple(2.0**k for k in (-10, -7, -5, -3, -1, 1, 4, 8))
"""The shares of an output's scale by which an open claim is weakened, in this order."""


def covered_outcome(search: Search) -> Outcome:
    """Return whether every output of a system has a number that rules conclude."""
    system = search.model
    assert isinstance(system, FuzzySystem)
    run = run_system(system)

    def loss(rows: Rows) -> FloatArray:
        return np.where(run(rows).status == Status.UNCOVERED, 1.0, -1.0)

    refuted = Outcome("REFUTED", "no rule fires", search.worst(loss))
    if refuted.rows is not None:
        return refuted
    for output in system.outputs:
        gap = search.ask_gap(OutputBounds(search.base, system, output.name).rules)
        if isinstance(gap, Point) and loss(search.row(gap.values))[0] > 0.0:
            return refuted._replace(rows=search.row(gap.values))
        if not isinstance(gap, Proved):
            return Outcome("OPEN", f"{output.name!r}: {_gap_text(gap)}")
    return Outcome("PROVED", "some rule fires everywhere")


def level_outcome(search: Search, claim: LevelClaim) -> Outcome:
    """Return whether an output lies between two numbers, and has one everywhere."""
    system, place, allowed = _output(search, claim.output)
    low = -math.inf if claim.low is None else claim.low - allowed
    high = math.inf if claim.high is None else claim.high + allowed

    def loss(rows: Rows) -> FloatArray:
        number = search.predict(rows)[place]
        lost = np.maximum(low - number, number - high)
        return np.where(np.isnan(number), np.inf, lost)

    def refuted(rows: Rows) -> Outcome:
        number = float(search.predict(rows)[place, 0])
        shown = f"it is {number:.6g}" if math.isfinite(number) else "no rule fires"
        return Outcome("REFUTED", shown, rows)

    rows = search.worst(loss)
    if rows is not None:
        return refuted(rows)
    output = system.outputs[place]
    bounds = OutputBounds(search.base.fine, system, output.name)
    if output.default is None or output.clips or not low <= output.default <= high:
        gap = search.ask_gap(bounds.rules)
        if isinstance(gap, Point) and loss(search.row(gap.values))[0] > 0.0:
            return refuted(search.row(gap.values))
        if not isinstance(gap, Proved):
            return Outcome("OPEN", _gap_text(gap))

    def prove(slack: float, steps: int) -> Answer:
        def is_excluded(boxes: Boxes) -> BoolArray:
            number = bounds.numbers(boxes)
            return (number.low >= low - slack) & (number.high <= high + slack)

        return search.ask_boxes(is_excluded, loss, steps // bounds.work)

    answer = prove(0.0, search.steps)
    if isinstance(answer, Point):
        return refuted(search.row(answer.values))
    if isinstance(answer, Proved):
        return Outcome("PROVED", f"bounds of it on {_boxes(answer)}")
    slack = _slack(search, prove, scale_of(system, output))
    bound = None
    if slack is not None and (claim.low is None or claim.high is None):
        bound = (
            claim.low - slack if claim.low is not None else (claim.high or 0.0) + slack
        )
    return Outcome("OPEN", answer.why, bound=bound)


def slope_outcome(search: Search, claim: SlopeClaim) -> Outcome:
    """Return whether the slope of an output with an input lies between two numbers."""
    system, place, allowed = _output(search, claim.output)
    line = search.model.inputs.index(claim.input)
    width = search.axes[line][-1] - search.axes[line][0]
    ends = [(s, e) for s, e in ((1.0, claim.low), (-1.0, claim.high)) if e is not None]
    for sign, end in ends:

        def height(rows: Rows, sign: float = sign, end: float = end) -> FloatArray:
            return np.array(sign * (search.predict(rows)[place] - end * rows[line]))

        rows = search.fall(claim.input, height, allowed)
        if rows is not None:
            first, second = search.predict(rows)[place].tolist()
            far = rows[line, 1] - rows[line, 0]
            text = f"as {claim.input} rises by {far:.6g}, it changes by "
            text += f"{second - first:.6g}"
            return Outcome("REFUTED", text, rows)
    bounds = OutputBounds(search.base.fine, system, claim.output)
    slopes = Slopes(search.base.fine, claim.input)
    gap = search.ask_gap(bounds.rules)
    if not isinstance(gap, Proved):
        return Outcome("OPEN", _gap_text(gap))
    how: list[str] = []
    for sign, end in ends:

        def prove(
            slack: float, steps: int, sign: float = sign, end: float = end
        ) -> Answer:
            least = sign * end - allowed / width - slack

            def is_excluded(boxes: Boxes) -> BoolArray:
                slope = bounds.slopes(boxes, slopes)
                return (slope.low if sign > 0.0 else -slope.high) >= least

            return search.ask_boxes(is_excluded, no_loss, steps // bounds.work)

        answer = prove(0.0, search.steps)
        if isinstance(answer, Open):
            slack = _slack(
                search, prove, scale_of(system, system.outputs[place]) / width
            )
            bound = None if slack is None else end - sign * slack
            return Outcome("OPEN", answer.why, bound=bound)
        how.append(f"bounds of its slope on {_boxes(answer)}")
    return Outcome("PROVED", " and ".join(dict.fromkeys(how)))


def no_loss(rows: Rows) -> FloatArray:
    """Return that no row refutes: a slope needs two."""
    return np.zeros(rows.shape[1])


def _slack(
    search: Search, prove: Callable[[float, int], Answer], scale: float
) -> float | None:
    """Return by how much a claim is to be weakened to be proved with less work."""
    for share in _WEAKER:
        if isinstance(prove(share * scale, search.steps // 8), Proved):
            return share * scale
    return None


def _gap_text(gap: Answer) -> str:
    if isinstance(gap, Open):
        return f"perhaps no rule fires for some rows: {gap.why}"
    return "no rule fires for some rows, which `where` may leave out"


def _boxes(answer: Answer) -> str:
    how = "" if isinstance(answer, Open) else answer.how
    return "the whole domain" if how == "1 boxes" else how


def _output(search: Search, name: str) -> tuple[FuzzySystem, int, float]:
    """Return the system, the position of an output, and what rounding may change."""
    system = search.model
    assert isinstance(system, FuzzySystem)
    place = [output.name for output in system.outputs].index(name)
    return system, place, ROUNDING * scale_of(system, system.outputs[place])
