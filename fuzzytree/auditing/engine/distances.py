"""How far two curves are apart at most: exactly, but where a turning point is not."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.engine.curves import ZERO
from fuzzytree.auditing.engine.measures import Bounds, apart, local, sizes
from fuzzytree.auditing.engine.polynomials import difference
from fuzzytree.model.rulebase import Shape


class Distance(NamedTuple):
    """The largest difference of two curves on an interval.

    Attributes:
        low: It is at least this; reached, or approached from above, at `at`.
        high: It is at most this.
        at: Where.
    """

    low: Fraction
    high: Fraction
    at: Fraction


def distance(one: Shape, other: Shape, low: Fraction, high: Fraction) -> Distance:
    """Return how far two curves are apart at most on a closed interval.

    The interval is cut where a curve changes; in each cell both are polynomials, whose
    difference is largest at an end or where it turns.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> steep = Points((0.0, 1.0), (0.0, 1.0))
        >>> slow = Points((0.0, 2.0), (0.0, 1.0))
        >>> found = distance(steep, slow, Fraction(0), Fraction(4))
        >>> str(found.low), str(found.high), str(found.at)
        ('1/2', '1/2', '1')
    """
    found = [*_gaps(one, other, low, high)]
    least, at = max(((gap.low, at) for at, gap in found), key=lambda best: best[0])
    return Distance(least, max(gap.high for _, gap in found), at)


def _gaps(
    one: Shape, other: Shape, low: Fraction, high: Fraction
) -> Iterator[tuple[Fraction, Bounds]]:
    """Yield places with how far two curves are apart there; the largest is among them.

    What is reached only from above is told of the place that it is approached at.
    """
    laid = apart([one, other], low, high)
    first, second = laid.elements
    start = abs(first.degree(low) - second.degree(low))
    yield low, Bounds(start, start)
    for a, b in laid.cells.between:
        middle = (a + b) / 2
        gap = difference(local(first, middle), local(second, middle))
        yield from sizes(gap, a, b)
    # Where a curve changes at an irrational place, that is known as a narrow interval.
    lows, highs = laid.cells.left
    for number, (a, b) in enumerate(laid.cells.zones):
        if a < b:
            sides = (0, 1), (1, 0)
            most = max(
                Fraction(highs[p, number]) - Fraction(lows[q, number]) for p, q in sides
            )
            yield (a + b) / 2, Bounds(ZERO, max(most, ZERO))
