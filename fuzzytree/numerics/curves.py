"""Stretches of shapes as polynomials, and how far another curve can be from them.

A shape that is not points is made of *stretches*: between two values its degree is
`clip(p(z), 0, top)` with a polynomial p of `z = (x - origin) / unit`. Outside of its
stretches it is 0, 1 or as at their ends.

`distance` bounds the largest difference between such a stretch and another polynomial
r, clipped in the same way, by halving until nothing can lie above what it has found.
On a piece of width h, with d = r - p:

- Clipping never moves two numbers apart, so the difference is at most |d|.
- By the error formula of linear interpolation d lies above its chord by at most
  `max(-d'', 0) h**2 / 8` and below by at most `max(d'', 0) h**2 / 8`; and d'' lies
  within `h / 2 max |d'''|` of its value in the middle.
- Where p and r are both above `top` all over the piece, or both below 0, by the same
  formula, the difference is 0; where only one is, it is the other's distance.

All is computed in doubles, and `_slack` covers their rounding: a Horner scheme of n
coefficients at |z| <= R costs at most `2 n u sum |c_k| R**k`, with u = 2**-53, and the
rounding of coefficients and of z at most `2 n u sum |c_k| R**k` more. So the bound
holds for the real functions over the stored doubles.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.model import FloatArray, Side

BELOW_ONE = 1.0 - 2.0**-53
"""The largest double below 1: the highest degree off a plateau."""

_ROUNDS = 80  # of halving; each at least quarters what is left to gain
_ENOUGH = 1.0 + 2.0**-7  # how much above the largest difference a bound may stay
_UNIT = 2.0**-53
_TINY = 2.0**-1000  # more than what underflow can make
_REACH = 1.125  # R: how large z may be


class DegreePiece(NamedTuple):
    """A part of a shape: `clip(p(z), 0, top)` with `z = (x - origin) / unit`.

    Attributes:
        coefficients: c0, c1, ... of p, the nearest doubles to the exact ones.
        top: The highest degree: 1, or the largest double below 1.
        origin: Where z is 0, exactly.
        unit: By how much x changes where z changes by 1, exactly; of either sign.
        first: The z at which it starts.
        last: The z at which it ends; both within [0, 1], in either order.
    """

    coefficients: tuple[float, ...]
    top: float
    origin: Fraction
    unit: Fraction
    first: Fraction
    last: Fraction


def side_stretches(
    side: Side, mean: float, sign: int
) -> tuple[DegreePiece, DegreePiece]:
    """Return the tail of one side of an LR set and its body, from outside to the mean.

    Args:
        side: The side.
        mean: The set's mean.
        sign: 1 for the side above the mean, -1 for the one below.
    """
    one, spread = Fraction(1), sign * Fraction(side.spread)
    curve = body_coefficients(side.curve)
    level = float(min(max(sum(curve), Fraction(0)), one))
    length = Fraction(side.reach) - 1
    end = Fraction(mean) + spread * Fraction(side.reach)
    tail = DegreePiece(
        (0.0, 0.0, 0.0, 0.0, level), 1.0, end, -spread * length, Fraction(0), one
    )
    body = DegreePiece(
        tuple(map(float, curve)), 1.0, Fraction(mean), spread, one, Fraction(0)
    )
    return tail, body


def body_coefficients(curve: Sequence[float]) -> tuple[Fraction, ...]:
    """Return `1 - t (c0 + v (c1 + ...))`, v = 2 t - 1, as a polynomial of t, exactly.

    Example:
        >>> [str(c) for c in body_coefficients((0.5, 0.25))]
        ['1', '-1/4', '-1/2']
    """
    total = [Fraction(0)]
    for coefficient in reversed(curve):
        doubled = [Fraction(0), *(2 * c for c in total)]
        total = [a - b for a, b in zip(doubled, [*total, Fraction(0)], strict=True)]
        total[0] += Fraction(coefficient)
    return (Fraction(1), *(-c for c in total[: len(curve)]))


def distance(
    first: FloatArray,
    last: FloatArray,
    p: FloatArray,
    r: FloatArray,
    top: float,
) -> float:
    """Return a bound of |clip(r, 0, top) - clip(p, 0, top)| over some pieces.

    Args:
        first: Where each piece starts; of shape (pieces,), within [-1/8, 9/8].
        last: Where it ends.
        p: Coefficients c0, c1, ... of shape (coefficients, 1).
        r: As p, or with a column for each piece: its own polynomial.
        top: The upper limit of both.

    Returns:
        The bound: at most a hundredth above the largest difference, and rounding.

    Example:
        >>> zero, one = np.zeros(1), np.ones(1)
        >>> p, r = np.array([[0.0], [0.0], [1.0]]), np.array([[0.0], [1.0]])
        >>> 0.25 <= distance(zero, one, p, r, 1.0) <= 0.2525
        True
    """
    size = max(len(p), len(r))
    p, r = _padded(p, size), np.broadcast_to(_padded(r, size), (size, len(first)))
    slack = _slack(p) + _slack(r) + _TINY
    a, b = np.minimum(first, last), np.maximum(first, last)
    found = worst = 0.0
    for _ in range(_ROUNDS):
        bounds, seen = _piece_bounds(a, b, p, r, top, slack)
        found = max(found, float(seen.max(initial=0.0)))
        open_ = bounds > found * _ENOUGH + 2.0 * slack
        worst = max(worst, float(bounds[~open_].max(initial=0.0)))
        if not open_.any():
            return worst
        a, b, r, slack = a[open_], b[open_], r[:, open_], slack[open_]
        middle = a + (b - a) / 2
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        r, slack = np.tile(r, 2), np.tile(slack, 2)
    return max(worst, float(_piece_bounds(a, b, p, r, top, slack)[0].max()))


def _piece_bounds(
    a: FloatArray,
    b: FloatArray,
    p: FloatArray,
    r: FloatArray,
    top: float,
    slack: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return a bound of the difference on each piece, and one that occurs there."""
    ends = np.stack([a, b])
    at_p, at_r = values_at(p, ends), values_at(r, ends)
    seen = np.abs(np.clip(at_r, 0.0, top) - np.clip(at_p, 0.0, top)).max(axis=0)
    low_p, high_p = _enclosure(p, at_p, a, b)
    low_r, high_r = _enclosure(r, at_r, a, b)
    low, high = _enclosure(r - p, at_r - at_p, a, b)
    apart = np.maximum(np.abs(low), np.abs(high))
    # Each stays within its own enclosure, clipped.
    above = np.clip(high_r, 0.0, top) - np.clip(low_p, 0.0, top)
    below = np.clip(high_p, 0.0, top) - np.clip(low_r, 0.0, top)
    return np.minimum(apart, np.maximum(above, below)) + slack, seen - slack


def _enclosure(
    c: FloatArray, ends: FloatArray, a: FloatArray, b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return between which numbers a polynomial lies on each piece."""
    width = b - a
    second, third = derivative(derivative(c)), derivative(c, 3)
    bend = values_at(second, a + width / 2)
    spread = width / 2 * size_of(third)
    rounding = _slack(second)
    share = width * width / 8.0 * (1.0 + 2.0**-40)
    low = ends.min(axis=0) - np.maximum(bend + spread + rounding, 0.0) * share
    high = ends.max(axis=0) + np.maximum(spread - bend + rounding, 0.0) * share
    return low, high


def lowest(c: FloatArray, last: float, *, first: float = 0.0) -> float:
    """Return a lower bound of a polynomial on [first, last], close to its least value.

    Example:
        >>> bound = lowest(np.array([[1.0], [-4.0], [4.0]]), 1.0)  # (1 - 2 z)**2
        >>> -1e-9 < bound <= 0.0
        True
    """
    a, b = np.array([first]), np.array([last])
    c = np.broadcast_to(c, (len(c), 1))
    slack = float(_slack(c)[0])
    found = sure = np.inf
    low = np.full(1, -np.inf)
    for _ in range(_ROUNDS):
        ends = values_at(c, np.stack([a, b]))
        low, _high = _enclosure(c, ends, a, b)
        found = min(found, float(ends.min()))
        is_open = low < found - 2.0**-32 * float(size_of(c)[0])
        sure = min(sure, float(low[~is_open].min(initial=np.inf)))
        if not is_open.any():
            return sure - slack
        middle = a[is_open] + (b - a)[is_open] / 2
        a, b = np.append(a[is_open], middle), np.append(middle, b[is_open])
    return min(sure, float(low.min())) - slack


def _padded(c: FloatArray, size: int) -> FloatArray:
    found = np.zeros((size, c.shape[1]))
    found[: len(c)] = c
    return found


def values_at(c: FloatArray, z: FloatArray) -> FloatArray:
    """Return polynomials at places, by Horner's scheme; columns belong to pieces."""
    total = np.zeros(np.broadcast_shapes(c.shape[1:], z.shape))
    for coefficient in c[::-1]:
        total = total * z + coefficient
    return total


def derivative(c: FloatArray, order: int = 1) -> FloatArray:
    """Return the coefficients of a derivative, as many columns as there were."""
    for _ in range(order):
        c = c[1:] * np.arange(1, len(c)).reshape(-1, 1) if len(c) > 1 else 0.0 * c
    return c


def size_of(c: FloatArray) -> FloatArray:
    """Return what a polynomial is at most in size, by its coefficients."""
    powers = _REACH ** np.arange(len(c)).reshape(-1, 1)
    found: FloatArray = np.sum(np.abs(c) * powers, axis=0)
    return found


def _slack(c: FloatArray) -> FloatArray:
    return 4.0 * _UNIT * (len(c) + 1) * size_of(c)
