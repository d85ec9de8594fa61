"""The curves of terms as polynomials, and degrees."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from fuzzytree.auditing.recheck.model_records import (
    LR,
    Band,
    Curve,
    Flank,
    Points,
    Scaled,
    Shape,
)
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.auditing.recheck.polynomials import (
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
    """Return a shape as polynomials in x, from left to right.

    Raises:
        UndecidedError: If it is none.
    """
    if isinstance(shape, Scaled):
        if shape.hedges:
            raise UndecidedError("a hedged curve is not cut into pieces here")
        height = Fraction(shape.height)
        return tuple(
            one._replace(poly=times(one.poly, (height,)), cap=one.cap * height)
            for one in pieces(shape.shape)
        )
    if isinstance(shape, Curve):
        return _curve_pieces(shape)
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
    return _band_pieces(shape)


def _band_pieces(shape: Band) -> tuple[Piece, ...]:
    low, high = (None if e is None else Fraction(e) for e in (shape.low, shape.high))
    found: list[Piece] = []
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


def is_exact(shape: Shape) -> bool:
    """Return whether a shape is made of polynomials."""
    if isinstance(shape, Scaled):
        return not shape.hedges and is_exact(shape.shape)
    exact = ("trapezoid", "singleton", "binary", "s", "pi")
    return not isinstance(shape, Curve) or shape.kind in exact


def _curve_pieces(curve: Curve) -> tuple[Piece, ...]:
    """Return the pieces of a system's curve; a step up stands one double below."""
    given = dict(curve.facts)
    match curve.kind:
        case "trapezoid":
            return _trapezoid(given["a"], given["b"], given["c"], given["d"])
        case "singleton":
            return _trapezoid(*[given["value"]] * 4)
        case "binary":
            start: float = given["start"]
            is_above = bool(given["is_above"])
            ends = (start, None) if is_above else (None, start)
            return _trapezoid(ends[0], start, start, ends[1])
        case "s":
            return tuple(_s(Fraction(given["start"]), Fraction(given["end"])))
        case "pi":
            a, b, c, d = (Fraction(given[name]) for name in "abcd")
            rise = [p for p in _s(a, b) if p.high is not None]
            fall = [
                p._replace(high=c) if p.high == c else p for p in _s(d, c, is_down=True)
            ]
            top = [Piece(b, c, (ONE,), ONE)] if b < c else []
            return (*rise, *top, *(p for p in fall if p.low is not None))
        case _:
            raise UndecidedError(f"a curve ({curve.kind}) has no pieces")


def _trapezoid(
    a: float | None, b: float, c: float, d: float | None
) -> tuple[Piece, ...]:
    """Return the pieces of a trapezoid; ends that are None are open."""
    start, end = Fraction(b), Fraction(c)
    found: list[Piece] = []
    low: Fraction | None = None
    if a is not None and a == b:
        below = math.nextafter(b, -math.inf)
        low = start if math.isinf(below) else Fraction(below)
        found.append(Piece(None, low, (), ONE))
    elif a is not None:
        foot, slope = Fraction(a), 1 / (start - Fraction(a))
        found.append(Piece(None, foot, (), ONE))
        found.append(Piece(foot, start, (-foot * slope, slope), ONE))
        low = start
    high = end if d is not None else None
    if low is None or high is None or low < high:
        found.append(Piece(low, high, (ONE,), ONE))
    if d is not None and c < d:
        foot, slope = Fraction(d), 1 / (end - Fraction(d))
        found.append(Piece(end, foot, (-foot * slope, slope), ONE))
        end = foot
    if d is not None:
        found.append(Piece(end, None, (), ONE))
    return tuple(found)


def _s(start: Fraction, end: Fraction, *, is_down: bool = False) -> list[Piece]:
    """Return an S curve, which falls if it ends before it starts, or is told to."""
    if start == end:
        steps = [(ONE,), ()] if is_down else [(), (ONE,)]
        return [
            Piece(None, start, steps[0], ONE), Piece(start, None, steps[1], ONE)
        ]  # fmt: skip
    middle, width = (start + end) / 2, end - start
    t, rest = (-start / width, 1 / width), (-end / width, 1 / width)
    first = times((Fraction(2),), times(t, t))
    second = plus((ONE,), times((Fraction(2),), times(rest, rest)), -1)
    if start < end:
        cuts = [(None, start, ()), (start, middle, first), (middle, end, second)]
        return [*(Piece(*cut, ONE) for cut in cuts), Piece(end, None, (ONE,), ONE)]
    cuts = [(None, end, (ONE,)), (end, middle, second), (middle, start, first)]
    return [*(Piece(*cut, ONE) for cut in cuts), Piece(start, None, (), ONE)]


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
