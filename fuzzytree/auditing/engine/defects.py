"""Defects of a curve's shape: where it dips, and where it would leave [0, 1]."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.engine.curves import ONE, ZERO, pieces
from fuzzytree.auditing.engine.measures import Seen, extremes
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    difference,
    roots,
    value_at,
)
from fuzzytree.model.rulebase import Shape


def dips(values: Sequence[Seen], least: Fraction) -> Iterator[tuple[Seen, Seen, Seen]]:
    """Yield where a walk falls and rises again by at least some amount.

    Args:
        values: A walk.
        least: The least depth that counts, above 0.

    Yields:
        The peak before, the valley, and the peak behind it.

    Example:
        >>> from fuzzytree.auditing.engine.measures import Bounds
        >>> walked = [(Bounds(Fraction(v), Fraction(v)), Fraction(k))
        ...           for k, v in enumerate((0, 3, 1, 2, 0))]
        >>> [[int(at) for _, at in dip] for dip in dips(walked, Fraction(1, 2))]
        [[1, 2, 3]]
    """
    before: Seen | None = None
    peak = valley = bottom = values[0]
    is_rising = True
    for value in values:
        height = value[0].low
        if is_rising:
            if height > peak[0].low:
                peak = value
            elif peak[0].low - height >= least:
                if before is not None:
                    yield before, bottom, peak
                before, valley, is_rising = peak, value, False
        elif height < valley[0].low:
            valley = value
        elif height - valley[0].low >= least:
            bottom, peak, is_rising = valley, value, True
    if is_rising and before is not None:
        yield before, bottom, peak


def outside(shape: Shape, low: Fraction, high: Fraction) -> Iterator[Excess]:
    """Yield where a shape's polynomials leave [0, 1] before they are clipped.

    Example:
        >>> from fuzzytree.model.rulebase import Band, Flank
        >>> bulge = Band(0.0, 1.0, right=Flank(1.0, 2.0, (4.0, -3.0)))
        >>> [(round(float(e.depth), 3), e.is_above)
        ...  for e in outside(bulge, Fraction(0), Fraction(3))]
        [(0.333, True)]
    """
    for piece in pieces(shape):
        if piece.low is None or piece.high is None or len(piece.polynomial) < 2:
            continue
        a, b = max(piece.low, low), min(piece.high, high)
        if a >= b or _is_inside(piece.polynomial, a, b):
            continue
        for goal, sign in ((ONE, 1), (ZERO, -1)):
            over = difference(piece.polynomial, (goal,))
            ends = [a, *((r.low + r.high) / 2 for r in roots(over, a, b)), b]
            for start, end in itertools.pairwise(ends):
                if sign * value_at(over, (start + end) / 2) <= 0:
                    continue
                found = [*extremes(over, start, end)]
                at, depth = max(
                    ((at, sign * (v.low + v.high) / 2) for at, v in found),
                    key=lambda one: one[1],
                )
                yield Excess(start, end, at, depth, sign > 0)


def _is_inside(polynomial: Polynomial, low: Fraction, high: Fraction) -> bool:
    """Return whether a polynomial is a line within [0, 1]."""
    ends = value_at(polynomial, low), value_at(polynomial, high)
    return len(polynomial) == 2 and all(ZERO <= end <= ONE for end in ends)


class Excess(NamedTuple):
    """A stretch on which a polynomial leaves [0, 1].

    Attributes:
        low: From where.
        high: To where.
        at: Where it is farthest outside.
        depth: How far.
        is_above: Whether it is above 1, otherwise below 0.
    """

    low: Fraction
    high: Fraction
    at: Fraction
    depth: Fraction
    is_above: bool
