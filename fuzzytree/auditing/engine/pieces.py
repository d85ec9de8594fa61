"""Membership functions as polynomials on intervals, and where something changes.

The definitions are those of `numerics.exact`. A *place* is a point of an axis where the
order or the direction of some curves can change: the end of a piece, a turning point,
where a curve meets 0 or its cap, or where two curves cross.

Between two of a shape's bends (turning points and ends of its pieces, found exactly)
its degree is monotone. So on a cell it lies between its values at both ends and at the
bends inside, each of which is enclosed by two doubles.
"""

from __future__ import annotations

import functools
import itertools
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple, assert_never

import numpy as np

from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    composed,
    derivative,
    roots,
    value_at,
)
from fuzzytree.model import (
    LR,
    Band,
    FloatArray,
    Points,
    Proposition,
    Shape,
    Side,
    Value,
    checkpoint,
)
from fuzzytree.numerics import (
    CAP,
    EnclosedValue,
    Enclosure,
    degree_enclosure,
    outwards,
    proposition_enclosure,
)

ZERO, ONE = Fraction(0), Fraction(1)


class PolynomialPiece(Value, frozen=True):
    """A degree on `low < x <= high`: `min(max(p(x), 0), cap)`.

    All shapes are continuous from the left, so the pieces' upper ends belong to them.
    """

    low: Fraction | None  # the open lower end; None reaches down without end
    high: Fraction | None  # the closed upper end; None reaches up without end
    polynomial: Polynomial  # p in x, the constant first
    cap: Fraction = ONE  # the largest degree on this piece: 1, or `CAP` on a flank

    def degree(self, x: Fraction) -> Fraction:
        """Return the degree at x, as if the piece had no ends."""
        return min(max(value_at(self.polynomial, x), ZERO), self.cap)


@functools.lru_cache(maxsize=1 << 12)
def pieces(shape: Shape) -> tuple[PolynomialPiece, ...]:
    """Return a shape's pieces, from minus to plus infinity without a gap.

    Example:
        >>> [p.polynomial for p in pieces(Points((0.0, 2.0), (0.0, 1.0)))]
        [(Fraction(0, 1),), (Fraction(0, 1), Fraction(1, 2)), (Fraction(1, 1),)]
    """
    match shape:
        case Band():
            return tuple(_band(shape))
        case LR():
            return tuple(_lr(shape))
        case Points():
            return tuple(_points(shape))
    assert_never(shape)


def _flat(
    low: Fraction | None, high: Fraction | None, degree: Fraction
) -> PolynomialPiece:
    return PolynomialPiece(low, high, (degree,), max(degree, CAP))


def _band(band: Band) -> Iterator[PolynomialPiece]:
    low = None if band.low is None else Fraction(band.low)
    high = None if band.high is None else Fraction(band.high)
    if low is not None:
        yield from _flank(band.left, low, None, low)
    yield _flat(low, high, ONE)
    if high is not None:
        yield from _flank(band.right, high, high, None)


def _flank(
    end: float | None, edge: Fraction, low: Fraction | None, high: Fraction | None
) -> Iterator[PolynomialPiece]:
    """Yield a flank's pieces on one side of a plateau."""
    if end is None:
        yield _flat(low, high, ZERO)
        return
    zero = Fraction(end)
    width = edge - zero
    line = (-zero / width, ONE / width)
    if zero < edge:
        yield _flat(None, zero, ZERO)
        yield PolynomialPiece(zero, edge, line, CAP)
    else:
        yield PolynomialPiece(edge, zero, line, CAP)
        yield _flat(zero, None, ZERO)


def _lr(shape: LR) -> Iterator[PolynomialPiece]:
    mean = Fraction(shape.mean)
    yield from _side(shape.left, mean, -1)
    yield from reversed([*_side(shape.right, mean, 1)])


def _side(side: Side, mean: Fraction, sign: int) -> Iterator[PolynomialPiece]:
    """Yield a side's pieces, from the outside to the mean."""
    spread, reach = Fraction(side.spread), Fraction(side.reach)
    curve = tuple(map(Fraction, side.curve))
    at_spread = min(max(1 - sum(curve, ZERO), ZERO), ONE)
    far, near = mean + sign * spread * reach, mean + sign * spread
    slope = sign / spread

    def parts(
        a: Fraction | None, b: Fraction, polynomial: Polynomial
    ) -> PolynomialPiece:
        low, high = (a, b) if sign < 0 else (b, a)
        return PolynomialPiece(low, high, polynomial)

    yield parts(None, far, (ZERO,))
    # w = (reach - u) / (reach - 1) with u = slope (x - mean)
    base = (ZERO, ZERO, ZERO, ZERO, at_spread)
    tail = composed(base, (reach + slope * mean) / (reach - 1), -slope / (reach - 1))
    yield parts(far, near, tail if at_spread else (ZERO,))
    inner = composed(curve, -ONE, Fraction(2))  # c(2 t - 1) in t
    body = (ONE, *(-one for one in inner))  # 1 - t c(2 t - 1)
    yield parts(near, mean, composed(body, -slope * mean, slope))


def _points(points: Points) -> Iterator[PolynomialPiece]:
    values = tuple(map(Fraction, points.values))
    degrees = tuple(map(Fraction, points.degrees))
    yield _flat(None, values[0], degrees[0])
    for (a, p), (b, r) in itertools.pairwise(zip(values, degrees, strict=True)):
        if a == b:
            continue
        if p == r:
            yield _flat(a, b, p)
            continue
        slope = (r - p) / (b - a)
        yield PolynomialPiece(a, b, (p - slope * a, slope))
    yield _flat(values[-1], None, degrees[-1])


def piece_at(
    parts: tuple[PolynomialPiece, ...], x: Fraction, *, is_after: bool = False
) -> PolynomialPiece:
    """Return the piece that x belongs to, or the one just behind x."""
    find = bisect_right if is_after else bisect_left
    return parts[find(parts, x, 0, len(parts) - 1, key=_end)]


def _end(piece: PolynomialPiece) -> Fraction:
    assert piece.high is not None  # only the last one has no end
    return piece.high


# --- the curves of one axis

_ENDS = ((ZERO,), (ONE,))

ALWAYS = Band()
"""The curve of a rule without a proposition on a variable."""


class RuleCurve(NamedTuple):
    """A curve that rules use: a shape, or 1 minus it."""

    shape: Shape
    is_complement: bool = False

    def degree(self, x: Fraction) -> Fraction:
        """Return the exact degree at a value."""
        checkpoint()
        result = piece_at(pieces(self.shape), x).degree(x)
        return 1 - result if self.is_complement else result

    def degree_after(self, x: Fraction) -> Fraction:
        """Return the exact limit of the degree from the right."""
        result = piece_at(pieces(self.shape), x, is_after=True).degree(x)
        return 1 - result if self.is_complement else result


# --- bounds of degrees on whole intervals, by doubles


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


def proposition_ranges(
    proposition: Proposition, shapes: Mapping[tuple[str, str], Shape], edges: FloatArray
) -> tuple[Enclosure, Enclosure]:
    """Return the degrees of a proposition at edges and on cells, as `shape_ranges`."""
    result = [
        shape_ranges(shapes[proposition.variable, t], edges) for t in proposition.terms
    ]
    at, cells = zip(*result, strict=True)
    return proposition_enclosure(proposition, at), proposition_enclosure(
        proposition, cells
    )
