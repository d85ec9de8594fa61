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

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

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


class Noise:
    """Arithmetic on numbers with bounds."""

    def __init__(self, make: Maker) -> None:
        self._make = make

    def sum(self, *terms: Noisy) -> Noisy:
        """Return the sum, added from left to right."""
        total = terms[0]
        for term in terms[1:]:
            value = self._make("add", total.value, term.value)
            total = self.rounded(value, [total.error, term.error])
        return total

    def difference(self, one: Noisy, two: Noisy) -> Noisy:
        """Return one - two."""
        value = self._make("subtract", one.value, two.value)
        return self.rounded(value, [one.error, two.error])

    def times(self, factor: float, one: Noisy) -> Noisy:
        """Return a number times a small whole number or power of two."""
        constant = self._make.constant(factor)
        value = self._make("multiply", one.value, constant)
        errors: list[Place | None] = []
        if one.error is not None:
            size = self._make.constant(abs(factor))
            errors.append(self._make("multiply", one.error, size))
        return self.rounded(value, errors)

    def product(self, one: Noisy, two: Noisy) -> Noisy:
        """Return one * two."""
        make = self._make
        value = make("multiply", one.value, two.value)
        errors: list[Place | None] = []
        if two.error is not None:
            size = make("absolute", one.value)
            if one.error is not None:
                size = make("add", size, one.error)
            errors.append(make("multiply", size, two.error))
        if one.error is not None:
            size = make("absolute", two.value)
            errors.append(make("multiply", size, one.error))
        return self.rounded(value, errors)

    def settled(self, one: Noisy) -> Place:
        """Return the value, exactly 0 where it is not beyond its bound."""
        if one.error is None:
            return one.value
        make = self._make
        floor = make("multiply", one.error, make.constant(_SAFETY))
        is_noise = make("at_most", make("absolute", one.value), floor)
        return make("where", is_noise, make.constant(0.0), one.value)

    def rounded(self, value: Place, errors: list[Place | None]) -> Noisy:
        """Return a rounded number, from the errors of what it was made of."""
        make = self._make
        own = make("multiply", make("absolute", value), make.constant(UNIT))
        known = [error for error in errors if error is not None]
        return Noisy(value, make.chain("add", [*known, own]))


_HALVINGS = 2  # of the angle: the tangent is then at most tan(pi / 16), 0.199
_ANGLE_TERMS = 11  # the first that is left out is below 2e-17 of the angle
_ROOTS = 10  # of the logarithm's argument: exp(x / 1024) is then close to 1
_LOG_TERMS = 6


def angle(make: Maker, y: Place, x: Place) -> Place:
    """Return the angle of the point (x, y) in degrees, above -180 and up to 180.

    It is exact on the axes, 0 for (0, 0), and within 6e-14 degrees elsewhere.
    """
    zero, one = make.constant(0.0), make.constant(1.0)
    wide, high = make("absolute", x), make("absolute", y)
    longer = make("maximum", wide, high)
    is_point = make("equal", longer, zero)
    longer = make("where", is_point, one, longer)
    tangent = make("divide", make("minimum", wide, high), longer)
    for _ in range(_HALVINGS):
        root = make("add", one, make("multiply", tangent, tangent))
        root = make("square_root", root)
        tangent = make("divide", tangent, make("add", one, root))
    series = _odd(make, tangent, [(-1.0) ** k for k in range(_ANGLE_TERMS)])
    factor = make.constant(2.0**_HALVINGS * 180.0 / math.pi)
    degrees = make("multiply", series, factor)
    turned = make("subtract", make.constant(90.0), degrees)
    degrees = make("where", make("less", wide, high), turned, degrees)
    turned = make("subtract", make.constant(180.0), degrees)
    degrees = make("where", make("less", x, zero), turned, degrees)
    return make("where", make("less", y, zero), make("negate", degrees), degrees)


def signed_log(make: Maker, x: Place) -> Place:
    """Return sign(x) log(1 + |x|), within 1e-12 up to |x| = 1e60."""
    zero, one = make.constant(0.0), make.constant(1.0)
    root = make("add", one, make("absolute", x))
    for _ in range(_ROOTS):
        root = make("square_root", root)
    ratio = make("divide", make("subtract", root, one), make("add", root, one))
    series = _odd(make, ratio, [1.0] * _LOG_TERMS)
    found = make("multiply", series, make.constant(2.0 ** (_ROOTS + 1)))
    below = make("subtract", zero, found)  # 0 for 0, where a negation has -0
    return make("where", make("less", x, zero), below, found)


def _odd(make: Maker, x: Place, signs: list[float]) -> Place:
    """Return x (s0 + x^2 (s1 / 3 + x^2 (s2 / 5 + ...)))."""
    square = make("multiply", x, x)
    terms = [sign / (2 * k + 1) for k, sign in enumerate(signs)]
    total = make.constant(terms[-1])
    for term in reversed(terms[:-1]):
        total = make("add", make("multiply", total, square), make.constant(term))
    return make("multiply", x, total)


Power = tuple[int, int]
"""p and q of the moment `sum of g x^p y^q`."""

ORDER = 4
"""The highest order p + q that features need."""

_PASCAL = ((1,), (1, 1), (1, 2, 1), (1, 3, 3, 1), (1, 4, 6, 4, 1))


@dataclass
class Centred:
    """Moments about the centre of pressure, from exact sums.

    Attributes:
        make: Where the steps go.
        noise: Arithmetic that ends there.
        total: The sum of the cells, 1 where nothing presses.
        is_pressed: Whether anything presses: a truth.
        near: The exact place of the cell next to the centre, x and y.
        rest: What is left from there to the centre, at most about half a cell.
    """

    make: Maker
    noise: Noise = field(init=False)
    total: Place = field(init=False)
    is_pressed: Place = field(init=False)
    near: tuple[Place, Place] = field(init=False)
    rest: tuple[Place, Place] = field(init=False)

    def __post_init__(self) -> None:
        """Find the centre."""
        make = self.make
        self.noise = Noise(make)
        zero, one = make.constant(0.0), make.constant(1.0)
        force = self._raw(0, 0)
        self.is_pressed = make("less", zero, force)
        self.total = make("where", self.is_pressed, force, one)
        at = [make("divide", self._raw(p, q), self.total) for p, q in ((1, 0), (0, 1))]
        self.near = (make("round", at[0]), make("round", at[1]))
        left = [
            make("divide", self._shifted(p, q, p, q), self.total) for p, q in _FIRST
        ]
        self.rest = (left[0], left[1])

    def centre(self) -> tuple[Place, Place]:
        """Return x and y of the centre, from the cell that the sums are about."""
        x, y = (self.make("add", self.near[k], self.rest[k]) for k in (0, 1))
        return x, y

    def moment(self, p: int, q: int) -> Noisy:
        """Return the moment about the centre; that of order 1 is 0."""
        return self._centred(p, q, p, q)

    def _raw(self, p: int, q: int) -> Place:
        return self.make.input(sum_name(p, q))

    def _shifted(self, p: int, q: int, by_x: int, by_y: int) -> Place:
        """Return a sum after some of its p moves in x and q moves in y.

        After all of them it is about the cell next to the centre. One move takes the
        sum of `u x` to that of `u (x - near)`, exactly.
        """
        if by_y:
            one = self._shifted(p, q, by_x, by_y - 1)
            other = self._shifted(p, q - 1, by_x, by_y - 1)
        elif by_x:
            one = self._shifted(p, q, by_x - 1, 0)
            other = self._shifted(p - 1, q, by_x - 1, 0)
        else:
            return self._raw(p, q)
        by = self.near[1 if by_y else 0]
        return self.make("subtract", one, self.make("multiply", by, other))

    def _centred(self, p: int, q: int, by_x: int, by_y: int) -> Noisy:
        """Return a moment after some of its moves by the rest; of order 1 it is 0."""
        if (p, q, by_x, by_y) in ((1, 0, 1, 0), (0, 1, 0, 1)):
            return Noisy(self.make.constant(0.0))
        if by_y:
            one = self._centred(p, q, by_x, by_y - 1)
            other = self._centred(p, q - 1, by_x, by_y - 1)
        elif by_x:
            one = self._centred(p, q, by_x - 1, 0)
            other = self._centred(p - 1, q, by_x - 1, 0)
        else:
            return Noisy(self._shifted(p, q, p, q))
        return self._settle(one, other, self.rest[1 if by_y else 0])

    def _settle(self, one: Noisy, other: Noisy, rest: Place) -> Noisy:
        """Return one - rest * other; the rest itself is rounded once."""
        make = self.make
        if make.number(other.value) == 0.0 and other.error is None:
            return one
        value = make("subtract", one.value, make("multiply", rest, other.value))
        size = make("multiply", make("absolute", other.value), make.constant(2 * UNIT))
        if other.error is not None:
            size = make("add", size, other.error)
        errors = [make("multiply", make("absolute", rest), size), one.error]
        return self.noise.rounded(value, errors)


def complex_moment(moments: Centred, p: int, q: int) -> tuple[Noisy, Noisy]:
    """Return the real and the imaginary part of C_pq (paper, 2.1)."""
    noise = moments.noise
    parts: tuple[list[Noisy], list[Noisy]] = ([], [])
    for power, weight in _expansion(p, q).items():
        found = moments.moment(*power)
        is_imaginary = power[1] % 2
        parts[is_imaginary].append(
            found if weight == 1.0 else noise.times(weight, found)
        )
    nothing = Noisy(moments.make.constant(0.0))
    real, imaginary = (noise.sum(*found) if found else nothing for found in parts)
    return real, imaginary


_FIRST: tuple[Power, Power] = ((1, 0), (0, 1))


def sum_name(p: int, q: int) -> str:
    """Return the name of the input that is the sum of g x^p y^q."""
    return f"sum {p}{q}"


def _expansion(p: int, q: int) -> Mapping[Power, float]:
    """Return the weights of x^a y^b in (x + iy)^p (x - iy)^q, those of i left out.

    A weight belongs to the real part where b is even, and to the imaginary part where
    it is odd.

    Example:
        >>> dict(_expansion(2, 0))
        {(2, 0): 1.0, (1, 1): 2.0, (0, 2): -1.0}
    """
    weights: dict[Power, float] = {}
    for j, one in enumerate(_PASCAL[p]):
        for k, two in enumerate(_PASCAL[q]):
            power = (p + q - j - k, j + k)
            turn = (1, 1, -1, -1)[(j + 3 * k) % 4]  # of i^j (-i)^k, its sign
            weights[power] = weights.get(power, 0.0) + turn * one * two
    return {power: weight for power, weight in weights.items() if weight}
