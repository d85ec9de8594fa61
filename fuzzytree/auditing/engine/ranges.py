"""Which degrees a shape or clause has on whole intervals: never too few.

Between two of a shape's bends (turning points and ends of its pieces, found exactly)
its degree is monotone. So on a cell it lies between its values at both ends and at the
bends inside, each of which is enclosed by two doubles.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.pieces import PolynomialPiece, pieces
from fuzzytree.auditing.engine.polynomials import composed, derivative, roots
from fuzzytree.model import Clause, Shape
from fuzzytree.numerics import (
    EnclosedValue,
    Enclosure,
    clause_enclosure,
    degree_enclosure,
    outwards,
)

if TYPE_CHECKING:
    from fuzzytree.model import FloatArray

_ZERO = Fraction(0)

_Bend = tuple[float, float, float, float]


class Bends(NamedTuple):
    """The places where a shape may stop rising or falling, from left to right.

    A cell `a < x <= b` holds a place if its first end is below b and its last above a.
    """

    places: tuple[_Bend, ...]  # the ends of each, and the least and the largest degree
    steps: FloatArray  # where the degree jumps
    after: Enclosure  # the degrees just behind each step


@functools.lru_cache(maxsize=1 << 12)
def bends(shape: Shape) -> Bends:
    """Return where a shape turns or jumps."""
    result: list[_Bend] = []
    jumps: list[tuple[float, float, float]] = []
    parts = pieces(shape)
    for piece, behind in zip(parts, (*parts[1:], None), strict=True):
        result += _turns(piece)
        if behind is None or piece.high is None:
            continue
        at = outwards(piece.high)
        here, after = piece.degree(piece.high), behind.degree(piece.high)
        result.append((*at, *_pair(here, here)))
        if here != after:
            jumps.append((at[0], *_pair(after, after)))
            result.append((at[0], np.nextafter(at[1], np.inf), *_pair(after, after)))
    steps, after_low, after_high = np.array(jumps).reshape(-1, 3).T
    return Bends(tuple(sorted(result)), steps, Enclosure(after_low, after_high))


def _turns(piece: PolynomialPiece) -> Iterator[_Bend]:
    """Yield where a piece's derivative is 0."""
    if piece.low is None or piece.high is None or len(piece.polynomial) < 3:
        return
    for root in roots(derivative(piece.polynomial), piece.low, piece.high):
        # p(low + width t) for t in [0, 1] is within its coefficients' sums by sign.
        first, *rest = composed(piece.polynomial, root.low, root.high - root.low)
        down = first + sum((c for c in rest if c < 0), _ZERO)
        up = first + sum((c for c in rest if c > 0), _ZERO)
        ends = _pair(*(min(max(end, _ZERO), piece.cap) for end in (down, up)))
        yield outwards(root.low)[0], outwards(root.high)[1], *ends


def _pair(low: Fraction, high: Fraction) -> tuple[float, float]:
    return outwards(low)[0], outwards(high)[1]


def shape_ranges(shape: Shape, edges: FloatArray) -> tuple[Enclosure, Enclosure]:
    """Return which degrees a shape has at edges, and on the cells between them.

    `edges`: shape (..., cells + 1), finite, not falling along the last axis. A cell is
    `a < x <= b`; the point itself if both ends are equal.

    Returns:
        Enclosures at the edges, and on the cells.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> triangle = Points((0.0, 1.0, 2.0), (0.0, 1.0, 0.0))
        >>> _, cells = shape_ranges(triangle, np.array([0.5, 1.5, 3.0]))
        >>> cells.low.round(9).tolist(), cells.high.round(9).tolist()
        ([0.5, 0.0], [1.0, 0.5])
    """
    at = degree_enclosure(shape, EnclosedValue(edges, None))
    a, b = edges[..., :-1], edges[..., 1:]
    low, high = at.low[..., :-1], at.high[..., :-1]
    turning = bends(shape)
    if len(turning.steps):
        place = np.searchsorted(turning.steps, a).clip(max=len(turning.steps) - 1)
        is_behind = (turning.steps[place] == a) & (a < b)
        low = np.where(is_behind, turning.after.low[place], low)
        high = np.where(is_behind, turning.after.high[place], high)
    low, high = np.minimum(low, at.low[..., 1:]), np.maximum(high, at.high[..., 1:])
    for first, last, least, most in turning.places:
        is_inside = (first < b) & (last > a)
        low = np.where(is_inside, np.minimum(low, least), low)
        high = np.where(is_inside, np.maximum(high, most), high)
    return at, Enclosure(low, high)


def clause_ranges(
    clause: Clause, shapes: Mapping[tuple[str, str], Shape], edges: FloatArray
) -> tuple[Enclosure, Enclosure]:
    """Return which degrees a clause has at edges and on cells, as `shape_ranges`."""
    result = [shape_ranges(shapes[clause.variable, t], edges) for t in clause.terms]
    at, cells = zip(*result, strict=True)
    return clause_enclosure(clause, at), clause_enclosure(clause, cells)
