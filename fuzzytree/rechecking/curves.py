"""The curves of terms as polynomials, and degrees."""

from __future__ import annotations

import itertools
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from fuzzytree.rechecking.model_records import LR, Flank, Points, Shape
from fuzzytree.rechecking.polynomials import (
    ONE,
    ZERO,
    Poly,
    at,
    plus,
    times,
    trimmed,
    within,
)

CAP = 1 - Fraction(1, 2**53)  # the largest degree off a plateau


class Piece(NamedTuple):
    """On `low < x <= high` a degree is `min(max(poly(x), 0), cap)`."""

    low: Fraction | None
    high: Fraction | None
    poly: Poly
    cap: Fraction


@lru_cache(maxsize=1 << 14)
def pieces(shape: Shape) -> tuple[Piece, ...]:
    """Return a shape as polynomials in x, from left to right."""
    if isinstance(shape, Points):
        values, degrees = (
            [*map(Fraction, shape.values)],
            [*map(Fraction, shape.degrees)],
        )
        found = [Piece(None, values[0], (degrees[0],), ONE)]
        for (a, b), (p, r) in zip(
            itertools.pairwise(values), itertools.pairwise(degrees), strict=True
        ):
            slope = (r - p) / (b - a) if a < b else ZERO
            found += [Piece(a, b, (p - a * slope, slope), ONE)] if a < b else []
        return (*found, Piece(values[-1], None, (degrees[-1],), ONE))
    if isinstance(shape, LR):
        left, right = _side_pieces(shape, -1), _side_pieces(shape, 1)
        return (*left[::-1], *right)
    low, high = (None if e is None else Fraction(e) for e in (shape.low, shape.high))
    found = []
    for piece in _flank_pieces(shape.left):
        if low is not None and (piece.low is None or piece.low < low):
            end = low if piece.high is None else min(piece.high, low)
            found.append(piece._replace(high=end))
    found.append(Piece(low, high, (ONE,), ONE))
    for piece in _flank_pieces(shape.right):
        if high is not None and (piece.high is None or piece.high > high):
            end = high if piece.low is None else max(piece.low, high)
            found.append(piece._replace(low=end))
    return tuple(found)


def _flank_pieces(flank: Flank | None) -> list[Piece]:
    if flank is None:
        return [Piece(None, None, (), ONE)]
    start, end = Fraction(flank.start), Fraction(flank.end)
    q = (-end / (start - end), 1 / (start - end))
    fall = times(q, within(flank.curve, q))
    top, bottom = (at(fall, start),), ()
    ends = [bottom, top] if end < start else [top, bottom]
    a, b = min(start, end), max(start, end)
    three = [(None, a, ends[0]), (a, b, fall), (b, None, ends[1])]
    return [Piece(low, high, trimmed(poly), CAP) for low, high, poly in three]


def _side_pieces(shape: LR, sign: int) -> list[Piece]:
    """Return one side's pieces, from the mean outwards."""
    side = shape.right if sign > 0 else shape.left
    mean, spread, reach = map(Fraction, (shape.mean, side.spread, side.reach))
    u = (-sign * mean / spread, sign / spread)
    body = plus((ONE,), times(u, within(side.curve, (2 * u[0] - 1, 2 * u[1]))), -1)
    one, end = mean + sign * spread, mean + sign * spread * reach
    height = min(max(at(body, one), ZERO), ONE)
    w = (((reach - u[0]) / (reach - 1)), -u[1] / (reach - 1))
    tail = times((height,), times(times(w, w), times(w, w)))
    three = [(mean, one, body), (one, end, tail), (end, None, ())]
    if sign > 0:
        return [Piece(a, b, poly, ONE) for a, b, poly in three]
    return [Piece(b, a, poly, ONE) for a, b, poly in three]


def degree(shape: Shape, x: Fraction) -> Fraction:
    """Return how far x belongs to a shape.

    Example:
        >>> degree(Points((0.0, 2.0), (0.0, 1.0)), Fraction(1, 2))
        Fraction(1, 4)
    """
    piece = piece_at(shape, x)
    return min(max(at(piece.poly, x), ZERO), piece.cap)


def piece_at(shape: Shape, x: Fraction) -> Piece:
    """Return the first piece that ends at x or above it."""
    found = pieces(shape)
    first, last = 0, len(found) - 1
    while first < last:
        middle = (first + last) // 2
        high = found[middle].high
        if high is None or x <= high:
            last = middle
        else:
            first = middle + 1
    return found[first]
