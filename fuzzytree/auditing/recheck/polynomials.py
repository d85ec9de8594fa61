"""Polynomials in fractions, their roots, and the membership functions made of them.

The lowest power comes first; `()` is 0. Where the slope keeps its sign is one root, or
none.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

from fuzzytree.auditing.recheck.model_records import (
    LR,
    Band,
    Curve,
    Points,
    Scaled,
    Shape,
    Side,
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


def divided(poly: Poly, divisor: Poly) -> tuple[Poly, Poly]:
    """Return the quotient of two polynomials, and the remainder."""
    rest, out = list(poly), [ZERO] * max(len(poly) - len(divisor) + 1, 0)
    for place in range(len(out) - 1, -1, -1):
        out[place] = rest[place + len(divisor) - 1] / divisor[-1]
        for k, c in enumerate(divisor):
            rest[place + k] -= out[place] * c
    return tuple(out), trimmed(rest)


Number = TypeVar("Number", int, Fraction)


def shifted(poly: Sequence[Number], x: Number) -> list[Number]:
    """Return a polynomial of the distance from x."""
    result: list[Number] = list(poly)
    for start in range(len(poly)):
        for place in range(len(poly) - 2, start - 1, -1):
            result[place] += x * result[place + 1]
    return result


def common(one: Poly, other: Poly) -> Poly:
    """Return the greatest common divisor of two polynomials."""
    while other:
        other = tuple(c / other[-1] for c in other)
        one, other = other, divided(one, other)[1]
    return one


def derivative(poly: Poly) -> Poly:
    """Return the derivative."""
    return tuple(n * c for n, c in enumerate(poly))[1:]


def enclosed(poly: Poly, low: Fraction, high: Fraction) -> tuple[Fraction, Fraction]:
    """Return between which two numbers a polynomial's values on an interval lie."""
    least = most = ZERO
    for coefficient in reversed(poly):
        ends = [a * b for a in (least, most) for b in (low, high)]
        least, most = min(ends) + coefficient, max(ends) + coefficient
    return least, most


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
        """Make the interval no wider than this."""
        while self.high - self.low > width:
            self.halve()


def roots(poly: Poly, low: Fraction, high: Fraction) -> list[Root]:
    """Return the roots in an open interval, on ever smaller parts with one or none.

    Example:
        >>> poly = (Fraction(-4), ZERO, Fraction(1))  # x**2 - 4
        >>> [root.low < 2 < root.high for root in roots(poly, ZERO, Fraction(5))]
        [True]
    """
    if len(poly) == 2:
        x = -poly[0] / poly[1]
        return [Root(poly, x, x)] if low < x < high else []
    result: list[Root] = []
    middle, half = (low + high) / 2, (high - low) / 2
    near = [c * half**place for place, c in enumerate(shifted(poly, middle))]
    bottom = math.lcm(*(c.denominator for c in near))
    # Of each part, the polynomial in u from -1 to 1, times a number.
    todo = [(low, high, [int(c * bottom) for c in near])] if len(poly) > 2 else []
    least = half / 2**16
    while todo:
        a, b, whole = todo.pop()
        most = [*map(abs, whole)]
        if 2 * most[0] > sum(most):  # it keeps its sign
            continue
        if 2 * most[1] > sum(place * one for place, one in enumerate(most)):
            # it rises, or falls
            if sum(whole) * (sum(whole[::2]) - sum(whole[1::2])) < 0:
                result.append(Root(poly, a, b))
            continue
        if b - a < least:
            shared, least = common(poly, derivative(poly)), ZERO
            if len(shared) > 1:  # several times the same root: once is enough
                return roots(divided(poly, shared)[0], low, high)
        middle = (a + b) / 2
        if whole[0] == 0:
            result.append(Root(poly, middle, middle))
        twice = [c << (len(whole) - place) for place, c in enumerate(whole, 1)]
        todo += [(a, middle, shifted(twice, -1)), (middle, b, shifted(twice, 1))]
    return result


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
    match shape:
        case Scaled(inner, height, ()):
            scale = Fraction(height)
            return tuple(
                one._replace(poly=times(one.poly, (scale,)), cap=one.cap * scale)
                for one in pieces(inner)
            )
        case Points(values, degrees):
            corners = [*zip(map(Fraction, values), map(Fraction, degrees), strict=True)]
            lines = [_line(*ends) for ends in itertools.pairwise(corners)]
            ends = [(degree,) for _, degree in (corners[0], corners[-1])]
            cuts = [x for x, _ in corners]
            return _between(cuts, [ends[0], *lines, ends[1]])
        case LR(mean, left, right):
            cuts, polys = _side(mean, left, -1)
            more = _side(mean, right, 1)
            every = [*polys[::-1], *more[1]]
            return _between([*cuts[::-1], Fraction(mean), *more[0]], every)
        case Band(low, high, left, right):
            below, above = _flank(low, left, min), _flank(high, right, max)
            return (*below, Piece(_end(low), _end(high), (ONE,), ONE), *above)
        case Curve(kind, facts):
            return _between(*_curve(kind, dict(facts)))
        case Scaled():
            raise UndecidedError("a hedged curve is not cut into pieces here")


def _between(
    cuts: Sequence[Fraction], polys: Sequence[Poly], cap: Fraction = ONE
) -> tuple[Piece, ...]:
    """Return a polynomial below the first cut, between two and above the last one."""
    ends = zip((None, *cuts), (*cuts, None), polys, strict=True)
    return tuple(
        Piece(low, high, trimmed(poly), cap)
        for low, high, poly in ends
        if low is None or high is None or low < high
    )


def _line(one: tuple[Fraction, Fraction], other: tuple[Fraction, Fraction]) -> Poly:
    """Return the line through two points; 0 if they stand above each other."""
    (a, p), (b, r) = one, other
    slope = (r - p) / (b - a) if a != b else ZERO
    return p - a * slope, slope


def _end(value: float | None) -> Fraction | None:
    return None if value is None else Fraction(value)


def _flank(
    cut: float | None, flank: float | None, outer: Callable[..., Fraction]
) -> tuple[Piece, ...]:
    """Return the pieces outside of an end of a band: below it, or above."""
    if cut is None:
        return ()
    side, cuts, polys, cap = Fraction(cut), [Fraction(cut)], [Poly()], ONE
    if flank is not None:
        end = Fraction(flank)
        fall = _line((end, ZERO), (side, ONE))
        cap = CAP
        polys = [(), fall, (ONE,)][:: 1 if end < side else -1]
        cuts = sorted([side, side, outer(end, side)])
    result = _between(cuts, [*polys, ()] if outer is min else [(), *polys], cap)
    return result[:-1] if outer is min else result[1:]


def _side(mean: float, side: Side, sign: int) -> tuple[list[Fraction], list[Poly]]:
    """Return one side's cuts and polynomials, from the mean outwards."""
    start, spread, reach = map(Fraction, (mean, side.spread, side.reach))
    one, end = start + sign * spread, start + sign * spread * reach
    u, rest = _line((start, ZERO), (one, ONE)), _line((end, ZERO), (one, ONE))
    body = plus((ONE,), times(u, within(side.curve, (2 * u[0] - 1, 2 * u[1]))), -1)
    height = min(max(at(body, one), ZERO), ONE)
    square = times(rest, rest)
    return [one, end], [body, times((height,), times(square, square)), ()]


def _curve(kind: str, data: dict[str, Any]) -> tuple[list[Fraction], list[Poly]]:
    """Return the cuts and polynomials of a system's curve."""
    match kind:
        case "trapezoid":
            return _trapezoid(data["a"], data["b"], data["c"], data["d"])
        case "singleton":
            return _trapezoid(*[data["value"]] * 4)
        case "binary":
            start, is_above = data["start"], data["is_above"]
            ends = (start, None) if is_above else (None, start)
            return _trapezoid(ends[0], start, start, ends[1])
        case "s":
            return _s(data["start"], data["end"])
        case "pi":
            rise = _s(data["a"], data["b"])
            fall = _s(data["d"], data["c"], is_down=True)
            return rise[0] + fall[0], rise[1] + fall[1][1:]
        case _:
            raise UndecidedError(f"a curve ({kind}) has no pieces")


def _trapezoid(
    a: float | None, b: float, c: float, d: float | None
) -> tuple[list[Fraction], list[Poly]]:
    """Return a trapezoid; ends that are None are open, a step up is one double below.

    So a value equal to the start of a step has degree 1.
    """
    cuts: list[Fraction] = []
    polys: list[Poly] = [(ONE,)]
    if a is not None:
        below = math.nextafter(b, -math.inf)
        start = Fraction(a if a < b else b if math.isinf(below) else below)
        cuts, polys = [start, Fraction(b)], [(), (ONE,), (ONE,)]
        if a < b:
            polys[1] = _line((start, ZERO), (cuts[1], ONE))
    if d is not None:
        top, end = Fraction(c), Fraction(d)
        cuts += [top, end]
        polys += [_line((top, ONE), (end, ZERO)), ()]
    return cuts, polys


def _s(
    low: float, high: float, *, is_down: bool = False
) -> tuple[list[Fraction], list[Poly]]:
    """Return an S curve, which falls if it ends before it starts, or with `is_down`."""
    start, end = Fraction(low), Fraction(high)
    if start == end:
        return [start], [(ONE,), ()] if is_down else [(), (ONE,)]
    t, rest = _line((start, ZERO), (end, ONE)), _line((end, ZERO), (start, ONE))
    first = times((Fraction(2),), times(t, t))
    second = plus((ONE,), times((Fraction(2),), times(rest, rest)), -1)
    polys: list[Poly] = [(), first, second, (ONE,)]
    cuts = [start, (start + end) / 2, end]
    return (cuts, polys) if start < end else (cuts[::-1], polys[::-1])


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
