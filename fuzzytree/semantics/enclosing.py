"""Certain bounds of membership functions and of their first two derivatives.

The one meaning of a function (`MembershipFunction.degree`) is computed with *jets*: the
value, the slope and the bend (the second derivative) at all values between two numbers,
each enclosed by two doubles. Every operation rounds outwards, so the bounds hold for
the function over the real numbers; `exp`, `log`, `cos` and powers are taken to be good
to two units in the last place, which a test compares with 50 digits.

Between two neighbouring knots of a function the bounds shrink with the distance of the
two numbers. Where a choice between two formulas is not decided, nothing is known of
slope and bend.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from fuzzytree.model import MembershipFunction, Numbers
from fuzzytree.semantics.programs.operations import NOTHING, power

_INF = math.inf
_LEAST = 2.0**-1022  # numbers below have fewer digits


class Interval(NamedTuple):
    """Two numbers between which one lies, or that it is equal to."""

    low: float
    high: float

    def plus(self, other: Interval) -> Interval:
        """Return bounds of the sum."""
        return Interval(
            _sum(self.low, other.low, -_INF), _sum(self.high, other.high, _INF)
        )

    def minus(self, other: Interval) -> Interval:
        """Return bounds of the difference."""
        return self.plus(Interval(-other.high, -other.low))

    def times(self, other: Interval) -> Interval:
        """Return bounds of the product."""
        a, b = self
        c, d = other
        if not a and not b:
            return self
        if not c and not d:
            return other
        if a < 0.0 and c >= 0.0:
            (a, b), (c, d) = other, self
        if a >= 0.0:  # of the other one each end needs one product
            low = _product(a if c >= 0.0 else b, c, -_INF)
            return Interval(low, _product(b if d >= 0.0 else a, d, _INF))
        return Interval(
            min(_product(x, y, -_INF) for x in (a, b) for y in (c, d)),
            max(_product(x, y, _INF) for x in (a, b) for y in (c, d)),
        )

    def inverse(self) -> Interval:
        """Return bounds of 1 divided by it; all numbers if it may be 0."""
        if self.low <= 0.0 <= self.high:
            if self.low == 0.0 < self.high:
                return Interval(_quotient(self.high, -_INF), _INF)
            return EVERYTHING
        return Interval(_quotient(self.high, -_INF), _quotient(self.low, _INF))

    def hull(self, other: Interval) -> Interval:
        """Return bounds of either of two."""
        return Interval(min(self.low, other.low), max(self.high, other.high))

    def within(self, other: Interval) -> Interval:
        """Return bounds of what both enclose."""
        return Interval(max(self.low, other.low), min(self.high, other.high))

    @property
    def size(self) -> float:
        """The largest distance from 0."""
        return max(-self.low, self.high)

    @property
    def width(self) -> float:
        """How far its ends are apart, rounded up."""
        return _sum(self.high, -self.low, _INF)


def _sum(a: float, b: float, to: float) -> float:
    if not b:
        return a
    total = a + b
    if math.isnan(total) or math.isinf(total):
        return (
            to if math.isnan(total) or not (math.isinf(a) or math.isinf(b)) else total
        )
    part = total - a
    rest = (a - (total - part)) + (b - part)
    return total if rest == 0.0 else math.nextafter(total, to)


def _product(a: float, b: float, to: float) -> float:
    if a == 0.0 or b == 0.0:
        return 0.0
    product = a * b
    is_exact = abs(product) >= _LEAST and (_halves(a) or _halves(b))
    return product if is_exact else math.nextafter(product, to)


def _quotient(b: float, to: float) -> float:
    """Return 1 / b, rounded to one side."""
    if not b or math.isinf(b):
        return math.copysign(_INF, to) if not b else 0.0
    quotient = 1.0 / b
    is_exact = _halves(b) and abs(quotient) >= _LEAST
    return quotient if is_exact else math.nextafter(quotient, to)


def _halves(number: float) -> bool:
    """Return whether a number is a power of two, or minus one."""
    return abs(math.frexp(number)[0]) == 0.5


EVERYTHING: Final = Interval(-_INF, _INF)
_ZERO, _ONE, _TWO = Interval(0.0, 0.0), Interval(1.0, 1.0), Interval(2.0, 2.0)
_MAYBE = Interval(0.0, 1.0)


class Jet(NamedTuple):
    """Bounds of a function between two values.

    Attributes:
        value: Of its values.
        slope: Of its first derivative, wherever it has one.
        bend: Of its second derivative, wherever it has one; of everything if the slope
            may jump.
    """

    value: Interval
    slope: Interval = _ZERO
    bend: Interval = _ZERO

    def __neg__(self) -> Jet:
        return Jet(*(Interval(-one.high, -one.low) for one in self))

    def __add__(self, other: Jet | float, /) -> Jet:  # type: ignore[override] # no tuple
        return Jet(*(a.plus(b) for a, b in zip(self, _jet(other), strict=True)))

    def __radd__(self, other: float, /) -> Jet:
        return self + other

    def __sub__(self, other: Jet | float, /) -> Jet:
        return self + -_jet(other)

    def __rsub__(self, other: float, /) -> Jet:
        return _jet(other) + -self

    def __mul__(self, other: Jet | float, /) -> Jet:  # type: ignore[override] # no tuple
        b = _jet(other)
        slope = self.slope.times(b.value).plus(self.value.times(b.slope))
        both = self.slope.times(b.slope)
        if self is other:  # a square is never below 0
            both = both.within(Interval(0.0, _INF))
        bend = self.bend.times(b.value).plus(self.value.times(b.bend))
        value = self.value.times(b.value)
        if self is other:
            value = value.within(Interval(0.0, _INF))
        return Jet(value, slope, bend.plus(_TWO.times(both)))

    def __rmul__(self, other: float, /) -> Jet:  # type: ignore[override] # no tuple
        return self * other

    def __truediv__(self, other: Jet | float, /) -> Jet:
        return self * _jet(other).inverse()

    def __rtruediv__(self, other: float, /) -> Jet:
        return self.inverse() * other

    def inverse(self) -> Jet:
        """Return 1 divided by it."""
        r = self.value.inverse()
        square = r.times(r).within(Interval(0.0, _INF))
        minus = Interval(-square.high, -square.low)
        return self.through(r, minus, _TWO.times(square).times(r))

    def through(self, value: Interval, slope: Interval, bend: Interval) -> Jet:
        """Return a function of it, by bounds of that function's own jet."""
        both = self.slope.times(self.slope).within(Interval(0.0, _INF))
        second = bend.times(both).plus(slope.times(self.bend))
        return Jet(value, slope.times(self.slope), second)


def _jet(number: Jet | float) -> Jet:
    if isinstance(number, Jet):
        return number
    if number == math.tau:  # stands for 2 pi, which is a little more
        return Jet(Interval(number, math.nextafter(number, 7.0)))
    return Jet(Interval(number, number))


def _jet_between(low: float, high: float) -> Jet:
    """Return bounds of a number that jumps from one value to another, or stays."""
    if low == high:
        return _jet(float(low))
    return Jet(Interval(float(low), float(high)), EVERYTHING, EVERYTHING)


def _rising(function: Callable[[float], float], of: Interval) -> Interval:
    """Return bounds of a rising function that is good to two units."""
    low, high = function(of.low), function(of.high)
    for _ in range(2):
        low, high = math.nextafter(low, -_INF), math.nextafter(high, _INF)
    return Interval(low, high)


def _exp(a: float) -> float:
    try:
        return math.exp(a)
    except OverflowError:
        return _INF


def _exponential(a: Jet) -> Jet:
    e = _rising(_exp, a.value).within(Interval(0.0, _INF))
    return a.through(e, e, e)


def _root(a: Jet) -> Jet:
    low, high = max(a.value.low, 0.0), max(a.value.high, 0.0)
    value = _rising(math.sqrt, Interval(low, high))
    if low in (0.0, 1.0) or high in (0.0, 1.0):  # exact
        ends = (
            (low if low in (0.0, 1.0) else value.low),
            (high if high in (0.0, 1.0) else value.high),
        )
        value = Interval(*ends)
    inverse = value.within(Interval(0.0, _INF)).inverse()
    half = Interval(0.5, 0.5).times(inverse)
    cubed = Interval(-0.25, -0.25).times(inverse).times(inverse).times(inverse)
    return a.through(value, half, cubed)


def _raised(u: Interval, p: float) -> Interval:
    """Return bounds of u to the power p, for u from 0 on."""
    ends = sorted(power(max(end, 0.0), p) for end in u)
    if p == 0.0 or (u.low == u.high and u.low in (0.0, 1.0)):
        return Interval(ends[0], ends[1])
    low, high = ends
    for _ in range(2):
        low, high = math.nextafter(low, -_INF), math.nextafter(high, _INF)
    return Interval(max(low, 0.0), high)


def _power(a: Jet, exponent: Jet) -> Jet:
    p = exponent.value.low
    if exponent != _jet(p) or a.value.low < 0.0:
        return Jet(EVERYTHING, EVERYTHING, EVERYTHING)
    first, second = Interval(p, p), Interval(p, p).times(_jet(p - 1.0).value)
    if p == 0.0:
        return _jet(1.0)
    slope = _raised(a.value, p - 1.0)
    bend = _raised(a.value, p - 2.0)
    return a.through(_raised(a.value, p), first.times(slope), second.times(bend))


def _cosine(a: Jet) -> Jet:
    shifted = Interval(*(end - math.pi / 2.0 for end in a.value))
    cosine, sine = _wave(a.value), _wave(shifted)
    minus = Interval(-sine.high, -sine.low), Interval(-cosine.high, -cosine.low)
    return a.through(cosine, *minus)


def _wave(of: Interval) -> Interval:
    """Return bounds of the cosine, good to a few units of the angle."""
    low, high = of
    off = 4.0 * math.ulp(max(of.size, 1.0))
    if not math.isfinite(of.width) or of.width >= 2.0 * math.pi:
        return Interval(-1.0, 1.0)
    values = [math.cos(low), math.cos(high)]
    first, last = math.ceil(low / math.pi - off), math.floor(high / math.pi + off)
    values += [math.cos(k * math.pi) for k in range(first, last + 1)]
    return Interval(max(min(values) - off, -1.0), min(max(values) + off, 1.0))


def _logarithm(a: Jet) -> Jet:
    if a.value.low <= 0.0:
        return Jet(EVERYTHING, EVERYTHING, EVERYTHING)
    r = a.value.inverse()
    square = r.times(r)
    minus = Interval(-square.high, -square.low)
    return a.through(_rising(math.log, a.value), r, minus)


def _absolute(a: Jet) -> Jet:
    if a.value.low >= 0.0:
        return a
    if a.value.high <= 0.0:
        return -a
    size = a.slope.size
    return Jet(Interval(0.0, a.value.size), Interval(-size, size), EVERYTHING)


def _minimum(a: Jet, b: Jet) -> Jet:
    if a.value.high <= b.value.low:
        return a
    if b.value.high <= a.value.low:
        return b
    low, high = min(a.value.low, b.value.low), min(a.value.high, b.value.high)
    bend = _ZERO if a.slope == b.slope == _ZERO else EVERYTHING
    return Jet(Interval(low, high), a.slope.hull(b.slope), bend)


def _maximum(a: Jet, b: Jet) -> Jet:
    return -_minimum(-a, -b)


def _not(a: Jet) -> Jet:
    return 1.0 - a


def _truth(is_true: bool, is_false: bool) -> Jet:
    return Jet(_ONE if is_true else _ZERO if is_false else _MAYBE)


def _where(truth: Jet, a: Jet, b: Jet) -> Jet:
    if truth.value == _ONE:
        return a
    if truth.value == _ZERO:
        return b
    if a == b:
        return a
    return Jet(a.value.hull(b.value), EVERYTHING, EVERYTHING)


_OPERATIONS: Final[Mapping[str, Callable[..., Jet]]] = {
    "add": Jet.__add__,
    "subtract": Jet.__sub__,
    "multiply": Jet.__mul__,
    "divide": Jet.__truediv__,
    "negate": Jet.__neg__,
    "minimum": _minimum,
    "maximum": _maximum,
    "absolute": _absolute,
    "exponential": _exponential,
    "square_root": _root,
    "power": _power,
    "cosine": _cosine,
    "logarithm": _logarithm,
    "and": _minimum,
    "or": _maximum,
    "not": _not,
    "where": _where,
}


class Enclosed(Numbers[Jet]):
    """The algebra of jets.

    Attributes:
        is_open: Whether the jets are of all values strictly between two: a strictly
            monotone number that meets another one at an end only is on one side of it.
        names: The jets of variables, for formulas.
    """

    def __init__(self, *, is_open: bool, names: Mapping[str, Jet] = NOTHING) -> None:
        self.is_open, self.names = is_open, names

    def constant(self, number: float, /) -> Jet:
        """Return a number that is the same everywhere."""
        return _jet(number)

    def __call__(self, operation: str, /, *operands: Jet | float) -> Jet:
        """Return bounds of an operation; of everything for one that is not known."""
        jets = [_jet(one) for one in operands]
        if operation in ("less", "at_most", "equal"):
            return self._compared(operation, *jets)
        known = _OPERATIONS.get(operation)
        return (
            Jet(EVERYTHING, EVERYTHING, EVERYTHING) if known is None else known(*jets)
        )

    def table(self, operation: str, place: Jet, table: Sequence[float], /) -> Jet:
        """Return bounds of what `below` or `pick` finds in a table for a number."""
        low, high = place.value
        if operation == "below":
            is_moving = self.is_open and place.slope != _ZERO
            first = (bisect_right if is_moving else bisect_left)(table, low)
            return _jet_between(first, bisect_left(table, high))
        inside = table[int(low) : int(high) + 1]
        return _jet_between(min(inside), max(inside))

    def _compared(self, operation: str, a: Jet, b: Jet) -> Jet:
        """Return whether a number is less than, at most or equal to another one."""
        rise = a.slope.minus(b.slope)
        is_moving = self.is_open and (rise.low > 0.0 or rise.high < 0.0)
        above, below = a.value.low - b.value.high, a.value.high - b.value.low
        is_less = below < 0.0 or (is_moving and below == 0.0)
        is_more = above > 0.0 or (is_moving and above == 0.0)
        is_still = not self.is_open or a.slope == b.slope == _ZERO
        is_same = is_still and above == below == 0.0
        if operation == "less":
            return _truth(is_less, is_more or above == 0.0)
        if operation == "at_most":
            return _truth(is_less or below == 0.0, is_more)
        return _truth(is_same, is_less or is_more)


def plain_jet(function: MembershipFunction, low: float, high: float) -> Jet:
    """Return bounds as `jet` does, less narrow where the two numbers are far apart."""
    return function.degree(_OPEN, Jet(Interval(low, high), _ONE))


_OPEN: Final = Enclosed(is_open=True)
_CLOSED: Final = Enclosed(is_open=False)


def jet(function: MembershipFunction, low: float, high: float) -> Jet:
    """Return bounds of a function at all values strictly between two numbers.

    Of two neighbouring knots, or of numbers between such, they are narrow where the two
    numbers are near.

    Example:
        >>> from fuzzytree.model import Gaussian
        >>> near = jet(Gaussian(0.0, 1.0), 0.5, 0.5625)
        >>> near.slope.high < 0.0, near.bend.high < 0.0, near.value.width < 0.04
        (True, True, True)
    """
    whole = plain_jet(function, low, high)
    middle = low + (high - low) / 2.0
    if not low < middle < high or math.isinf(whole.slope.size):
        return whole
    far = Interval(low, high).minus(Interval(middle, middle))
    point = plain_jet(function, middle, middle)
    slope, value = whole.slope, point.value.plus(whole.slope.times(far))
    if math.isfinite(whole.bend.size) and math.isfinite(point.slope.size):
        slope = slope.within(point.slope.plus(whole.bend.times(far)))
        value = value.within(point.value.plus(slope.times(far)))
    return Jet(whole.value.within(value), slope, whole.bend)


def degree_bounds(function: MembershipFunction, x: float | Fraction) -> Interval:
    """Return bounds of the degree at a value.

    Example:
        >>> from fuzzytree.model import SCurve
        >>> degree_bounds(SCurve(0.0, 4.0), 1.0)
        Interval(low=0.125, high=0.125)
    """
    near = float(x)
    low = high = near
    if Fraction(near) != x:
        above = near > x
        low = math.nextafter(near, -_INF) if above else near
        high = near if above else math.nextafter(near, _INF)
    return function.degree(_CLOSED, Jet(Interval(low, high), _ONE)).value
