"""Shapes as polynomials on intervals: the definitions of `numerics.exact`, laid out."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import assert_never

from fuzzytree.auditing.engine.polynomials import Polynomial, composed, value_at
from fuzzytree.model.rulebase import LR, Band, Flank, Points, Shape, Side, Value
from fuzzytree.numerics.exact import CAP

ZERO, ONE = Fraction(0), Fraction(1)


class Piece(Value, frozen=True):
    """A degree on `low < x <= high`: `min(max(p(x), 0), cap)`.

    All shapes are continuous from the left, so the pieces' upper ends belong to them.

    Attributes:
        low: The open lower end; None reaches down without end.
        high: The closed upper end; None reaches up without end.
        polynomial: p in x, the constant first.
        cap: The largest degree on this piece: 1, or `CAP` on a flank.
    """

    low: Fraction | None
    high: Fraction | None
    polynomial: Polynomial
    cap: Fraction = ONE

    def degree(self, x: Fraction) -> Fraction:
        """Return the degree at x, as if the piece had no ends."""
        return min(max(value_at(self.polynomial, x), ZERO), self.cap)


@functools.lru_cache(maxsize=1 << 12)
def pieces(shape: Shape) -> tuple[Piece, ...]:
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


def _flat(low: Fraction | None, high: Fraction | None, degree: Fraction) -> Piece:
    return Piece(low, high, (degree,), max(degree, CAP))


def _band(band: Band) -> Iterator[Piece]:
    low = None if band.low is None else Fraction(band.low)
    high = None if band.high is None else Fraction(band.high)
    if low is not None:
        yield from _flank(band.left, None, low)
    yield _flat(low, high, ONE)
    if high is not None:
        yield from _flank(band.right, high, None)


def _flank(
    flank: Flank | None, low: Fraction | None, high: Fraction | None
) -> Iterator[Piece]:
    """Yield a flank's pieces on one side of a plateau."""
    if flank is None:
        yield _flat(low, high, ZERO)
        return
    start, end = Fraction(flank.start), Fraction(flank.end)
    width = start - end
    curve = (ZERO, *map(Fraction, flank.curve))
    inner = composed(curve, -end / width, ONE / width)
    first, last = min(start, end), max(start, end)
    ends = [
        low,
        *(x for x in (first, last) if _is_within(x, low, high)),
        high,
    ]
    level = min(max(sum(curve, ZERO), ZERO), CAP)
    for a, b in itertools.pairwise(ends):
        if a is not None and first <= a and b is not None and b <= last:
            yield Piece(a, b, inner, CAP)
        elif (b is not None and b <= first) is (end < start):
            yield _flat(a, b, ZERO)
        else:
            yield _flat(a, b, level)


def _is_within(x: Fraction, low: Fraction | None, high: Fraction | None) -> bool:
    return (low is None or low < x) and (high is None or x < high)


def _lr(shape: LR) -> Iterator[Piece]:
    mean = Fraction(shape.mean)
    yield from _side(shape.left, mean, -1)
    yield from reversed([*_side(shape.right, mean, 1)])


def _side(side: Side, mean: Fraction, sign: int) -> Iterator[Piece]:
    """Yield a side's pieces, from the outside to the mean."""
    spread, reach = Fraction(side.spread), Fraction(side.reach)
    curve = tuple(map(Fraction, side.curve))
    at_spread = min(max(1 - sum(curve, ZERO), ZERO), ONE)
    far, near = mean + sign * spread * reach, mean + sign * spread
    slope = sign / spread

    def laid(a: Fraction | None, b: Fraction, polynomial: Polynomial) -> Piece:
        low, high = (a, b) if sign < 0 else (b, a)
        return Piece(low, high, polynomial)

    yield laid(None, far, (ZERO,))
    # w = (reach - u) / (reach - 1) with u = slope (x - mean)
    base = (ZERO, ZERO, ZERO, ZERO, at_spread)
    tail = composed(base, (reach + slope * mean) / (reach - 1), -slope / (reach - 1))
    yield laid(far, near, tail if at_spread else (ZERO,))
    inner = composed(curve, -ONE, Fraction(2))  # c(2 t - 1) in t
    body = (ONE, *(-one for one in inner))  # 1 - t c(2 t - 1)
    yield laid(near, mean, composed(body, -slope * mean, slope))


def _points(points: Points) -> Iterator[Piece]:
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
        yield Piece(a, b, (p - slope * a, slope))
    yield _flat(values[-1], None, degrees[-1])


def piece_at(laid: tuple[Piece, ...], x: Fraction) -> Piece:
    """Return the piece that x belongs to."""
    low, high = 0, len(laid) - 1
    while low < high:
        middle = (low + high) // 2
        end = laid[middle].high
        if end is None or x <= end:
            high = middle
        else:
            low = middle + 1
    return laid[low]


def degree_after(laid: tuple[Piece, ...], x: Fraction) -> Fraction:
    """Return the limit of the degree from the right: it differs from it at a step."""
    low, high = 0, len(laid) - 1
    while low < high:
        middle = (low + high) // 2
        end = laid[middle].high
        if end is None or x < end:
            high = middle
        else:
            low = middle + 1
    return laid[low].degree(x)
