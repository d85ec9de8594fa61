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
    from fuzzytree.model import FloatArray, IntArray

_ZERO = Fraction(0)

_Bend = tuple[float, float, float, float]


class Bends(NamedTuple):
    """The places where a shape may stop rising or falling, from left to right.

    A cell `a < x <= b` holds a place if `low < b` and `high > a`.
    """

    low: FloatArray  # where each place begins
    high: FloatArray  # where it ends
    depths: FloatArray  # above minus the degree, for 2**k neighbours: shape (k, places)
    heights: FloatArray  # above the degree, the same
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
    low, high, least, most = np.array(sorted(result)).reshape(-1, 4).T
    steps, after_low, after_high = np.array(jumps).reshape(-1, 3).T
    return Bends(
        np.minimum.accumulate(low[::-1])[::-1],
        np.maximum.accumulate(high),
        _windows(-least),
        _windows(most),
        steps,
        Enclosure(after_low, after_high),
    )


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


def _windows(values: FloatArray) -> FloatArray:
    """Return the largest of 2**k neighbours from each place on, for each k."""
    rows = [values]
    width = 1
    while 2 * width <= len(values):
        row = rows[-1].copy()
        row[:-width] = np.maximum(rows[-1][:-width], rows[-1][width:])
        rows.append(row)
        width *= 2
    return np.array(rows)


def _largest(windows: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Return the largest of places first to last - 1; minus infinity of none."""
    count = last - first
    level = np.frexp(np.maximum(count, 1))[1] - 1
    start = np.minimum(first, windows.shape[1] - 1)
    end = np.maximum(last - (1 << level), 0)
    result = np.maximum(windows[level, start], windows[level, end])
    return np.where(count > 0, result, -np.inf)


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
    if len(turning.low):
        first = np.searchsorted(turning.high, a, side="right")
        last = np.searchsorted(turning.low, b, side="left")
        low = np.minimum(low, -_largest(turning.depths, first, last))
        high = np.maximum(high, _largest(turning.heights, first, last))
    return at, Enclosure(low, high)


def clause_ranges(
    clause: Clause, shapes: Mapping[tuple[str, str], Shape], edges: FloatArray
) -> tuple[Enclosure, Enclosure]:
    """Return which degrees a clause has at edges and on cells, as `shape_ranges`."""
    result = [shape_ranges(shapes[clause.variable, t], edges) for t in clause.terms]
    at, cells = zip(*result, strict=True)
    return clause_enclosure(clause, at), clause_enclosure(clause, cells)
