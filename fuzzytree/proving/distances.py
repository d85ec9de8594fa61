"""How far two curves are apart at most: exactly for lines, else between two numbers."""

from __future__ import annotations

import heapq
import itertools
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.proving.curves import (
    ZERO,
    Piece,
    degree_after,
    piece_at,
    pieces,
)
from fuzzytree.proving.polynomials import difference
from fuzzytree.proving.stretches import Stretch, overlaps, spread
from fuzzytree.rulebase import Shape

_STEPS = 80
_FINE = Fraction(1, 10**9)


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

    The ends of all pieces are looked at, from both sides; between them the difference
    is enclosed and intervals are halved, until the two numbers are 1e-9 apart.

    Example:
        >>> from fuzzytree.rulebase import Points
        >>> steep = Points((0.0, 1.0), (0.0, 1.0))
        >>> slow = Points((0.0, 2.0), (0.0, 1.0))
        >>> found = distance(steep, slow, Fraction(0), Fraction(4))
        >>> str(found.low), str(found.high), str(found.at)
        ('1/2', '1/2', '1')
    """
    first = piece_at(pieces(one), low).degree(low)
    best = (abs(first - piece_at(pieces(other), low).degree(low)), low)
    numbers = itertools.count()
    todo: list[tuple[Fraction, int, Fraction, Fraction, Piece, Piece]] = []
    for a, b, start, end in overlaps(one, other, Stretch(low, high)):
        best = max(best, _ends(a, b, start, end), key=lambda found: found[0])
        todo.append((-_most(a, b, start, end), next(numbers), start, end, a, b))
    after = abs(degree_after(pieces(one), low) - degree_after(pieces(other), low))
    if low < high and after > best[0]:
        best = (after, low)
    heapq.heapify(todo)
    for _ in range(_STEPS):
        if not todo or -todo[0][0] <= best[0] + _FINE:
            break
        _, _, start, end, a, b = heapq.heappop(todo)
        middle = Fraction(float((start + end) / 2))
        if not start < middle < end:
            middle = (start + end) / 2
        for x, y in ((start, middle), (middle, end)):
            best = max(best, _ends(a, b, x, y), key=lambda found: found[0])
            heapq.heappush(todo, (-_most(a, b, x, y), next(numbers), x, y, a, b))
    high_end = max(best[0], -todo[0][0]) if todo else best[0]
    return Distance(best[0], high_end, best[1])


def _ends(
    one: Piece, other: Piece, low: Fraction, high: Fraction
) -> tuple[Fraction, Fraction]:
    """Return the larger of the differences at both ends, and where it is."""
    return max(
        ((abs(one.degree(x) - other.degree(x)), x) for x in (high, low)),
        key=lambda found: found[0],
    )


def _most(one: Piece, other: Piece, low: Fraction, high: Fraction) -> Fraction:
    """Return at least the largest difference of two pieces on a closed interval.

    Clipping brings no two numbers further apart; a cap that only one of them has adds
    what it takes from 1.
    """
    gap = difference(one.polynomial, other.polynomial)
    bounds = [abs(end) for end in spread(gap, low, high)]
    ranges = [
        [min(max(end, ZERO), p.cap) for end in spread(p.polynomial, low, high)]
        for p in (one, other)
    ]
    (a, b), (c, d) = ranges
    return min(max(bounds) + abs(one.cap - other.cap), max(b - c, d - a))
