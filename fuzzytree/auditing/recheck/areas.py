"""How high the curve of a term is, and what area two share."""

from __future__ import annotations

from fractions import Fraction

from fuzzytree.auditing.recheck.cells import (
    FINE,
    Levels,
    Line,
    between,
    cells,
    stretches,
)
from fuzzytree.auditing.recheck.model_records import Shape
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.auditing.recheck.polynomials import ONE, ZERO, at
from fuzzytree.auditing.recheck.roots import Root


def height(shape: Shape, line: Line, level: Fraction) -> Fraction:
    """Return the largest degree on a line, from below; exactly at or below a level."""
    levels = Levels()
    mark = levels.add((level,), ZERO)
    found = cells([((shape,), False, ONE)], line, levels)
    levels.sort()
    most = max(levels.band[end] for cell in found for end in (*cell.left, *cell.right))
    bounds = levels.bands[most]
    if most == levels.band[mark] and bounds[0] < bounds[1]:
        raise UndecidedError("a height is too near to the level to tell")
    return bounds[0] if most <= levels.band[mark] else max(bounds[0], level)


def shared(one: Shape, other: Shape, line: Line) -> tuple[Fraction, Fraction] | None:
    """Return between which numbers the integral of min by that of max lies."""
    least = most = slack = ZERO
    if line.low == line.high:
        return None
    both = [((one,), False, ONE), ((other,), False, ONE)]
    for left, right, curves in stretches(both, line):
        inside = between(left, right)
        for root in (end for end in (left, right) if isinstance(end, Root)):
            root.narrow(FINE * (line.high - line.low))
            slack += root.high - root.low
        a = left.high if isinstance(left, Root) else left
        b = right.low if isinstance(right, Root) else right
        order = sorted(curves, key=lambda poly: at(poly, inside))
        wholes = [(ZERO, *(c / n for n, c in enumerate(p, 1))) for p in order]
        areas = [at(whole, b) - at(whole, a) for whole in wholes]
        least, most = least + areas[0], most + areas[1]
    return (least / (most + slack), (least + slack) / most) if most else None
