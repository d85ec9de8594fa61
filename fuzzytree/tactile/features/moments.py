"""Moments of a frame as steps of a program, with bounds of their rounding errors.

Sums `sum of g x^p y^q` of whole numbers below 2^53 are exact in doubles. They are
moved exactly to the cell next to the centre of pressure, and from there by less than
a cell to the centre itself, where rounding begins (see `docs/explanation/moments.md`).

A rounded number has a bound of its error: first-order running error analysis, made
rigorous by a factor for the roundings of the bound. A value within its bound of 0 is
noise and becomes exactly 0 (`settled`). Angles and logarithms are made of operations
that every runtime rounds alike, so a frame has the same features, bit for bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from operator import add
from typing import NamedTuple

from fuzzytree.semantics import Maker, Place

UNIT = 2.0**-53
"""The largest relative error of one rounding."""

_SAFETY = 1.0 + 2.0**-40
"""More than the roundings of a bound of fewer than 4,000 operations can take away."""


@dataclass(frozen=True, slots=True)
class Noisy:
    """A step and the step of its error's bound; without one it is exact."""

    value: Place
    error: Place | None = None

    def __add__(self, other: Noisy) -> Noisy:
        return rounded(self.value + other.value, self.error, other.error)

    def __sub__(self, other: Noisy) -> Noisy:
        return rounded(self.value - other.value, self.error, other.error)

    def __mul__(self, other: Noisy | float) -> Noisy:
        if not isinstance(other, Noisy):  # a small whole number or power of two
            error = None if self.error is None else self.error * abs(other)
            return rounded(self.value * other, error)
        errors: list[Place] = []
        if other.error is not None:
            size = abs(self.value)
            size = size if self.error is None else size + self.error
            errors.append(size * other.error)
        if self.error is not None:
            errors.append(abs(other.value) * self.error)
        return rounded(self.value * other.value, *errors)

    def settled(self) -> Place:
        """Return the value, exactly 0 where it is not beyond its bound."""
        if self.error is None:
            return self.value
        make = self.value.make
        is_noise = make.at_most(abs(self.value), self.error * _SAFETY)
        return make.where(is_noise, 0.0, self.value)


def rounded(value: Place, *errors: Place | None) -> Noisy:
    """Return a rounded number, from the errors of what it was made of."""
    known = [error for error in errors if error is not None]
    return Noisy(value, value.make.chain("add", [*known, abs(value) * UNIT]))


class Complex(NamedTuple):
    """A complex number with bounds."""

    real: Noisy
    imaginary: Noisy

    def times(self, other: Complex) -> Complex:
        """Return the product."""
        real = self.real * other.real - self.imaginary * other.imaginary
        imaginary = self.real * other.imaginary + self.imaginary * other.real
        return Complex(real, imaginary)

    def along(self, other: Complex) -> Noisy:
        """Return the real part of this times the conjugate of the other."""
        return self.real * other.real + self.imaginary * other.imaginary


_HALVINGS = 2  # of the angle: the tangent is then at most tan(pi / 16), 0.199
_ANGLE_TERMS = 11  # the first that is left out is below 2e-17 of the angle
_ROOTS = 10  # of the logarithm's argument: exp(x / 1024) is then close to 1
_LOG_TERMS = 6


def angle(y: Place, x: Place) -> Place:
    """Return the angle of the point (x, y) in degrees, above -180 and up to 180.

    It is exact on the axes, 0 for (0, 0), and within 6e-14 degrees elsewhere.
    """
    make, wide, high = x.make, abs(x), abs(y)
    longer = make.maximum(wide, high)
    longer = make.where(make.equal(longer, 0.0), 1.0, longer)
    tangent = make.minimum(wide, high) / longer
    for _ in range(_HALVINGS):
        tangent = tangent / (1.0 + make.root(1.0 + tangent * tangent))
    series = _odd(tangent, [(-1.0) ** k for k in range(_ANGLE_TERMS)])
    degrees = series * (2.0**_HALVINGS * 180.0 / math.pi)
    degrees = make.where(make.less(wide, high), 90.0 - degrees, degrees)
    degrees = make.where(make.less(x, 0.0), 180.0 - degrees, degrees)
    return make.where(make.less(y, 0.0), -degrees, degrees)


def signed_log(x: Place) -> Place:
    """Return sign(x) log(1 + |x|), within 1e-12 up to |x| = 1e60."""
    make, root = x.make, 1.0 + abs(x)
    for _ in range(_ROOTS):
        root = make.root(root)
    series = _odd((root - 1.0) / (root + 1.0), [1.0] * _LOG_TERMS)
    found = series * 2.0 ** (_ROOTS + 1)
    # 0 for 0, where a negation has -0
    return make.where(make.less(x, 0.0), 0.0 - found, found)


def _odd(x: Place, signs: list[float]) -> Place:
    """Return x (s0 + x^2 (s1 / 3 + x^2 (s2 / 5 + ...)))."""
    square = x * x
    terms = [sign / (2 * k + 1) for k, sign in enumerate(signs)]
    total = x.make.constant(terms[-1])
    for term in reversed(terms[:-1]):
        total = total * square + term
    return x * total


ORDER = 4
"""The highest order p + q that features need."""

_PASCAL = ((1,), (1, 1), (1, 2, 1), (1, 3, 3, 1), (1, 4, 6, 4, 1))


class Centred:
    """Moments about the centre of pressure, from exact sums.

    Attributes:
        make: Where the steps go.
        total: The sum of the cells, 1 where nothing presses.
        is_pressed: Whether anything presses: a truth.
        near: The exact place of the cell next to the centre, x and y.
        rest: What is left from there to the centre, at most about half a cell.
    """

    def __init__(self, make: Maker) -> None:
        self.make = make
        zero, force = make.constant(0.0), self._raw(0, 0)
        self.is_pressed = make.less(zero, force)
        self.total = make.where(self.is_pressed, force, 1.0)
        self.near = [
            make("round", self._raw(p, q) / self.total) for p, q in ((1, 0), (0, 1))
        ]
        self.rest = [
            self._shifted(p, q, p, q) / self.total for p, q in ((1, 0), (0, 1))
        ]

    def centre(self) -> tuple[Place, Place]:
        """Return x and y of the centre, from the cell that the sums are about."""
        return self.near[0] + self.rest[0], self.near[1] + self.rest[1]

    def complex_moment(self, p: int, q: int) -> Complex:
        """Return C_pq (paper, 2.1)."""
        parts: tuple[list[Noisy], list[Noisy]] = ([], [])
        for power, weight in _expansion(p, q).items():
            found = self._centred(*power, *power)
            parts[power[1] % 2].append(found if weight == 1.0 else found * weight)
        nothing = [Noisy(self.make.constant(0.0))]
        return Complex(*(functools.reduce(add, part or nothing) for part in parts))

    def _raw(self, p: int, q: int) -> Place:
        return self.make.input(sum_name(p, q))

    def _shifted(self, p: int, q: int, by_x: int, by_y: int) -> Place:
        """Return a sum after some of its p moves in x and q moves in y.

        After all of them it is about the cell next to the centre. One move takes the
        sum of `u x` to that of `u (x - near)`, exactly.
        """
        if by_y:
            one = self._shifted(p, q, by_x, by_y - 1)
            return one - self.near[1] * self._shifted(p, q - 1, by_x, by_y - 1)
        if by_x:
            one = self._shifted(p, q, by_x - 1, 0)
            return one - self.near[0] * self._shifted(p - 1, q, by_x - 1, 0)
        return self._raw(p, q)

    def _centred(self, p: int, q: int, by_x: int, by_y: int) -> Noisy:
        """Return a moment after some of its moves by the rest; of order 1 it is 0."""
        if (p, q, by_x, by_y) in ((1, 0, 1, 0), (0, 1, 0, 1)):
            return Noisy(self.make.constant(0.0))
        if by_y:
            one = self._centred(p, q, by_x, by_y - 1)
            return self._moved(one, self._centred(p, q - 1, by_x, by_y - 1), 1)
        if by_x:
            one = self._centred(p, q, by_x - 1, 0)
            return self._moved(one, self._centred(p - 1, q, by_x - 1, 0), 0)
        return Noisy(self._shifted(p, q, p, q))

    def _moved(self, one: Noisy, other: Noisy, axis: int) -> Noisy:
        """Return one - rest * other; the rest itself is rounded once."""
        if self.make.number(other.value) == 0.0 and other.error is None:
            return one
        rest = self.rest[axis]
        size = abs(other.value) * (2 * UNIT)
        if other.error is not None:
            size = size + other.error
        return rounded(one.value - rest * other.value, abs(rest) * size, one.error)


def sum_name(p: int, q: int) -> str:
    """Return the name of the input that is the sum of g x^p y^q."""
    return f"sum {p}{q}"


def _expansion(p: int, q: int) -> Mapping[tuple[int, int], float]:
    """Return the weights of x^a y^b in (x + iy)^p (x - iy)^q, those of i left out.

    A weight belongs to the real part where b is even, and to the imaginary part where
    it is odd.

    Example:
        >>> dict(_expansion(2, 0))
        {(2, 0): 1.0, (1, 1): 2.0, (0, 2): -1.0}
    """
    weights: dict[tuple[int, int], float] = {}
    for j, one in enumerate(_PASCAL[p]):
        for k, two in enumerate(_PASCAL[q]):
            power = (p + q - j - k, j + k)
            turn = (1, 1, -1, -1)[(j + 3 * k) % 4]  # of i^j (-i)^k, its sign
            weights[power] = weights.get(power, 0.0) + turn * one * two
    return {power: weight for power, weight in weights.items() if weight}
