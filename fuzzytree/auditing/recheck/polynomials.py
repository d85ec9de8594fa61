"""Polynomials in fractions, their roots, and the membership functions made of them.

The lowest power comes first; `()` is 0. Roots are isolated by Descartes' rule.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
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

ZERO, ONE = Fraction(0), Fraction(1)

Poly = tuple[Fraction, ...]  # ascending; () is 0


def at(poly: Poly, x: Fraction) -> Fraction:
    """Return a polynomial's value."""
    total = ZERO
    for coefficient in reversed(poly):
        total = total * x + coefficient
    return total


def times(one: Poly, other: Poly) -> Poly:
    """Return the product of two polynomials."""
    out = [ZERO] * (len(one) + len(other))
    for (i, a), (j, b) in itertools.product(enumerate(one), enumerate(other)):
        out[i + j] += a * b
    return trimmed(out)


def trimmed(poly: Sequence[Fraction]) -> Poly:
    """Return a polynomial without leading zeros."""
    end = len(poly)
    while end and poly[end - 1] == 0:
        end -= 1
    return tuple(poly[:end])


def plus(one: Poly, other: Poly, weight: int = 1) -> Poly:
    """Return `one + weight * other`."""
    pairs = itertools.zip_longest(one, other, fillvalue=ZERO)
    return trimmed([a + weight * b for a, b in pairs])


def within(curve: Iterable[float | Fraction], inner: Poly) -> Poly:
    """Return `c0 + inner * (c1 + inner * ...)`."""
    total: Poly = ()
    for coefficient in reversed([*curve]):
        total = plus(times(total, inner), (Fraction(coefficient),))
    return total


def common(one: Poly, other: Poly) -> Poly:
    """Return the greatest common divisor of two polynomials."""
    while other:
        scale = other[-1]
        other = tuple(c / scale for c in other)
        rest = list(one)
        while len(rest) >= len(other):
            top, shift = rest[-1], len(rest) - len(other)
            for place, c in enumerate(other):
                rest[shift + place] -= top * c
            rest = list(trimmed(rest[:-1]))
        one, other = other, tuple(rest)
    return one


def derivative(poly: Poly) -> Poly:
    """Return the derivative."""
    return tuple(n * c for n, c in enumerate(poly))[1:]


def quotient(poly: Poly, divisor: Poly) -> Poly:
    """Return a polynomial divided by one that divides it."""
    rest, out = list(poly), [ZERO] * (len(poly) - len(divisor) + 1)
    for place in range(len(out) - 1, -1, -1):
        out[place] = rest[place + len(divisor) - 1] / divisor[-1]
        for k, c in enumerate(divisor):
            rest[place + k] -= out[place] * c
    return tuple(out)


# --- roots


class Root:
    """The one root of a polynomial in an open interval, or a fraction (both ends)."""

    def __init__(self, poly: Poly, low: Fraction, high: Fraction) -> None:
        self.poly = poly
        self.low: Fraction = low
        self.high: Fraction = high
        bottom = math.lcm(*(c.denominator for c in poly))
        self.whole = [int(c * bottom) for c in reversed(poly)]
        self.sign = self._sign(low) > 0

    def _sign(self, x: Fraction) -> int:
        """Return a number with the sign of the polynomial's value, in integers."""
        total, power = 0, 1
        for c in self.whole:
            total = total * x.numerator + c * power
            power *= x.denominator
        return total

    def halve(self) -> None:
        """Make the interval half as wide."""
        middle = (self.low + self.high) / 2
        value = self._sign(middle)
        if value == 0:
            self.low = self.high = middle
        elif (value > 0) == self.sign:
            self.low = middle
        else:
            self.high = middle

    def narrow(self, width: Fraction) -> None:
        """Make the interval no wider than this, by a guess in doubles if it is one."""
        if self.high - self.low > 256 * width:
            self._guess(width / 4)
        while self.high - self.low > width:
            self.halve()

    def _guess(self, away: Fraction) -> None:
        try:
            low, high = float(self.low), float(self.high)
            near = [float(c) for c in reversed(self.poly)]
        except OverflowError:
            return
        for _ in range(64):
            middle, value = (low + high) / 2, 0.0
            for c in near:
                value = value * middle + c
            if (value > 0) == self.sign:
                low = middle
            else:
                high = middle
        if not math.isfinite(low):
            return
        ends = Fraction(low) - away, Fraction(low) + away
        while self.low < ends[0] and ends[1] < self.high:
            signs = [self._sign(end) for end in ends]
            if all(signs) and (signs[0] > 0) == self.sign != (signs[1] > 0):
                self.low, self.high = ends
                return
            away *= 2**8
            ends = Fraction(low) - away, Fraction(low) + away

    def value(self, poly: Poly) -> tuple[Fraction, Fraction]:
        """Return between which two numbers another polynomial's value here lies."""
        low = high = ZERO
        for coefficient in reversed(poly):
            ends = [a * b for a in (low, high) for b in (self.low, self.high)]
            low, high = min(ends) + coefficient, max(ends) + coefficient
        return low, high


def roots(poly: Poly, low: Fraction, high: Fraction) -> list[Root]:
    """Return the roots in an open interval, by Descartes' rule on ever smaller parts.

    Example:
        >>> poly = (Fraction(-4), ZERO, Fraction(1))  # x**2 - 4
        >>> [root.low < 2 < root.high for root in roots(poly, ZERO, Fraction(5))]
        [True]
    """
    if len(poly) < 2:
        return []
    if len(poly) == 2:
        x = -poly[0] / poly[1]
        return [Root(poly, x, x)] if low < x < high else []
    heights = _bernstein(poly, low, high)
    if _changes(heights) > 1:
        shared = common(poly, derivative(poly))
        if len(shared) > 1:  # several times the same root: once is enough
            return roots(quotient(poly, shared), low, high)
    result: list[Root] = []
    todo = [(low, high, heights)]
    while todo:
        a, b, heights = todo.pop()
        changes = _changes(heights)
        if changes == 1 and heights[0] and heights[-1]:
            result.append(Root(poly, a, b))
        elif changes:
            middle, size = (a + b) / 2, len(heights) - 1
            left, right = [heights[0] << size], [heights[-1] << size]
            for left_over in range(size - 1, -1, -1):
                heights = [x + y for x, y in itertools.pairwise(heights)]
                left.append(heights[0] << left_over)
                right.append(heights[-1] << left_over)
            if not left[-1]:
                result.append(Root(poly, middle, middle))
            todo += [(a, middle, left), (middle, b, right[::-1])]
    return result


def _changes(heights: Sequence[int]) -> int:
    """Return how often the sign changes: at least as often as there are roots."""
    signs = [height > 0 for height in heights if height]
    return sum(x != y for x, y in itertools.pairwise(signs))


def _bernstein(poly: Poly, low: Fraction, high: Fraction) -> list[int]:
    """Return the heights of the control points on an interval, times a number."""
    n, bottom = len(poly) - 1, math.lcm(*(c.denominator for c in poly))
    q = math.lcm(low.denominator, high.denominator)
    start, width = int(low * q), int((high - low) * q)
    whole, power = [0] * (n + 1), 1
    # Horner in t, with x = (start + width t) / q; every power of q is kept a factor
    for place, c in enumerate(reversed(poly)):
        for k in range(min(place, n), 0, -1):
            whole[k] = whole[k] * start + whole[k - 1] * width
        whole[0] = whole[0] * start + int(c * bottom) * power
        power *= q
    # The k-th weight, binom(j, k) / binom(n, k), times n!
    return [
        sum(whole[k] * math.perm(j, k) * math.factorial(n - k) for k in range(j + 1))
        for j in range(n + 1)
    ]


def is_same(one: Root, other: Root) -> bool:
    """Return whether two roots are one number; if not, part their intervals."""
    shared: Poly | None = None
    while one.low <= other.high and other.low <= one.high:
        if one.low < one.high and other.low < other.high:
            shared = common(one.poly, other.poly) if shared is None else shared
            low, high = max(one.low, other.low), min(one.high, other.high)
            if at(shared, low) * at(shared, high) < 0:
                return True
        else:  # one of them is known as a fraction
            x = one.low if one.low == one.high else other.low
            if at(one.poly, x) == 0 == at(other.poly, x):
                return True
        one.halve()
        other.halve()
    return False


# --- membership functions

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
        result = [Piece(None, values[0], (degrees[0],), ONE)]
        for (a, b), (p, r) in zip(
            itertools.pairwise(values), itertools.pairwise(degrees), strict=True
        ):
            slope = (r - p) / (b - a) if a < b else ZERO
            result += [Piece(a, b, (p - a * slope, slope), ONE)] if a < b else []
        return (*result, Piece(values[-1], None, (degrees[-1],), ONE))
    if isinstance(shape, LR):
        left, right = _side_pieces(shape, -1), _side_pieces(shape, 1)
        return (*left[::-1], *right)
    return _band_pieces(shape)


def _band_pieces(shape: Band) -> tuple[Piece, ...]:
    low, high = (None if e is None else Fraction(e) for e in (shape.low, shape.high))
    result: list[Piece] = []
    for piece in _flank_pieces(shape.left):
        if low is not None and (piece.low is None or piece.low < low):
            end = low if piece.high is None else min(piece.high, low)
            result.append(piece._replace(high=end))
    result.append(Piece(low, high, (ONE,), ONE))
    for piece in _flank_pieces(shape.right):
        if high is not None and (piece.high is None or piece.high > high):
            end = high if piece.low is None else max(piece.low, high)
            result.append(piece._replace(low=end))
    return tuple(result)


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
    data = dict(curve.facts)
    match curve.kind:
        case "trapezoid":
            return _trapezoid(data["a"], data["b"], data["c"], data["d"])
        case "singleton":
            return _trapezoid(*[data["value"]] * 4)
        case "binary":
            start: float = data["start"]
            is_above = bool(data["is_above"])
            ends = (start, None) if is_above else (None, start)
            return _trapezoid(ends[0], start, start, ends[1])
        case "s":
            return tuple(_s(Fraction(data["start"]), Fraction(data["end"])))
        case "pi":
            a, b, c, d = (Fraction(data[name]) for name in "abcd")
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
    result: list[Piece] = []
    low: Fraction | None = None
    if a is not None and a == b:
        below = math.nextafter(b, -math.inf)
        low = start if math.isinf(below) else Fraction(below)
        result.append(Piece(None, low, (), ONE))
    elif a is not None:
        foot, slope = Fraction(a), 1 / (start - Fraction(a))
        result.append(Piece(None, foot, (), ONE))
        result.append(Piece(foot, start, (-foot * slope, slope), ONE))
        low = start
    high = end if d is not None else None
    if low is None or high is None or low < high:
        result.append(Piece(low, high, (ONE,), ONE))
    if d is not None and c < d:
        foot, slope = Fraction(d), 1 / (end - Fraction(d))
        result.append(Piece(end, foot, (-foot * slope, slope), ONE))
        end = foot
    if d is not None:
        result.append(Piece(end, None, (), ONE))
    return tuple(result)


def _s(start: Fraction, end: Fraction, *, is_down: bool = False) -> list[Piece]:
    """Return an S curve, which falls if it ends before it starts, or with `is_down`."""
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
    result = pieces(shape)
    first, last = 0, len(result) - 1
    while first < last:
        middle = (first + last) // 2
        high = result[middle].high
        if high is None or x <= high:
            last = middle
        else:
            first = middle + 1
    return result[first]
