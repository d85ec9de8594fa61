"""Polynomials in fractions, lowest power first; `()` is 0."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from fractions import Fraction

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
