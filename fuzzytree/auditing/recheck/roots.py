"""Where polynomials are 0, by Descartes' rule."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

from fuzzytree.auditing.recheck.polynomials import (
    ZERO,
    Poly,
    at,
    common,
    derivative,
    quotient,
)


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
    found: list[Root] = []
    todo = [(low, high, heights)]
    while todo:
        a, b, heights = todo.pop()
        changes = _changes(heights)
        if changes == 1 and heights[0] and heights[-1]:
            found.append(Root(poly, a, b))
        elif changes:
            middle, size = (a + b) / 2, len(heights) - 1
            left, right = [heights[0] << size], [heights[-1] << size]
            for left_over in range(size - 1, -1, -1):
                heights = [x + y for x, y in itertools.pairwise(heights)]
                left.append(heights[0] << left_over)
                right.append(heights[-1] << left_over)
            if not left[-1]:
                found.append(Root(poly, middle, middle))
            todo += [(a, middle, left), (middle, b, right[::-1])]
    return found


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
