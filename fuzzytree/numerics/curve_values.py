"""The degree that a curve has at a fraction, between two fractions, proved.

The curves of systems are made of `exp`, `cos`, roots and powers, which have no exact
value. Here they are taken over the real numbers and enclosed: in decimals of 50 digits,
of which the library (libmpdec) rounds square roots, `exp` and `ln` correctly, so that
each is within half a unit of the last digit. Everything else is done in fractions.

- A fraction that is rounded to a decimal is off by at most `d = 10**-49` of itself.
- `exp(q)` for the rounded q is off by the factor `1 + 2 d |q|` at most, as long as
  `d |q|` is below 1/2, and by one rounding more.
- `u**p` is `exp(p ln u)`. What ln is off by, `d (1 + |ln u|)`, is multiplied by p.
- `cos` of an angle below pi / 2 is its series, whose terms fall and alternate in sign
  from the second on: two neighbouring sums hold it between them.

This module shares no line with `fuzzytree.semantics.inference`, of which it says the
truth.
"""

from __future__ import annotations

from decimal import MAX_EMAX, MIN_EMIN, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction
from typing import Final, NamedTuple

from fuzzytree.model import (
    LR,
    Arc,
    Band,
    Bell,
    Binary,
    Concave,
    Cosine,
    Curve,
    Formula,
    Gaussian,
    Linear,
    PiCurve,
    Points,
    SCurve,
    SemiEllipse,
    Sigmoid,
    SigmoidDifference,
    SigmoidProduct,
    Singleton,
    Spike,
    Trapezoid,
    TwoGaussians,
)
from fuzzytree.numerics.exact import exact_degree

_DIGITS: Final = Context(
    prec=50, rounding=ROUND_HALF_EVEN, Emin=MIN_EMIN, Emax=MAX_EMAX, traps=[]
)
_OFF: Final = Fraction(1, 10**49)
_FAR: Final = Fraction(10**6)  # exp beyond this is taken for 0 or for without end
_ZERO, _ONE, _HALF = Fraction(0), Fraction(1), Fraction(1, 2)
_PI: Final = Fraction("3.14159265358979323846264338327950288419716939937510")
_PI_OFF: Final = Fraction(1, 10**50)


class Between(NamedTuple):
    """Two numbers between which one lies, or that it is equal to."""

    low: Fraction
    high: Fraction


def degree_between(curve: Curve, x: Fraction) -> Between | None:
    """Return bounds of a curve's degree at a value, over the real numbers.

    Returns:
        Bounds in [0, 1], equal where the degree is a fraction; None if a curve is a
        formula or a sum, of which nothing is known.

    Example:
        >>> low, high = degree_between(Gaussian(0.0, 1.0), Fraction(1))
        >>> round(float(low), 6), high - low < Fraction(1, 10**40)
        (0.606531, True)
        >>> degree_between(SCurve(0.0, 4.0), Fraction(1)).low
        Fraction(1, 8)
    """
    match curve:
        case Band() | LR() | Points():
            return _exactly(exact_degree(curve, x))
        case Formula() | Linear():
            return None
        case Trapezoid() | SCurve() | PiCurve() | Concave() | Binary() | Singleton():
            return _exactly(_rational(curve, x))
        case Gaussian(mean=mean, deviation=deviation):
            return _exp(-_square(x, mean, deviation) / 2)
        case TwoGaussians():
            below = _square(min(x, Fraction(curve.left)), curve.left, 1.0)
            above = _square(max(x, Fraction(curve.right)), curve.right, 1.0)
            below /= Fraction(curve.left_deviation) ** 2
            above /= Fraction(curve.right_deviation) ** 2
            return _exp(-(below + above) / 2)
        case Spike(center=center, width=width):
            return _exp(-abs(10 * (x - Fraction(center)) / Fraction(width)))
        case Sigmoid():
            return _sigmoid(curve, x)
        case SigmoidProduct(first=first, second=second):
            one, other = _sigmoid(first, x), _sigmoid(second, x)
            return Between(one.low * other.low, one.high * other.high)
        case SigmoidDifference(first=first, second=second):
            return _apart(_sigmoid(first, x), _sigmoid(second, x))
        case Bell():
            return _bell(curve, x)
        case Cosine(center=center, width=width):
            return _cosine(abs(x - Fraction(center)) / Fraction(width))
        case Arc(start=start, end=end):
            u = (x - Fraction(start)) / (Fraction(end) - Fraction(start))
            u = min(max(u, _ZERO), _ONE)
            return root(u * (2 - u))
        case SemiEllipse(start=start, end=end):
            a, b = Fraction(start), Fraction(end)
            return root(max(4 * (x - a) * (b - x) / (b - a) ** 2, _ZERO))


def root(square: Fraction) -> Between:
    """Return bounds of the root of a number in [0, 1].

    Example:
        >>> root(Fraction(1)) == (1, 1), root(Fraction(0)) == (0, 0)
        (True, True)
    """
    if square in (_ZERO, _ONE):
        return _exactly(square)
    near = Fraction(_DIGITS.sqrt(_decimal(square)))
    return _around(near, _OFF * 2)


def _exactly(value: Fraction) -> Between:
    return Between(value, value)


def _around(value: Fraction, share: Fraction) -> Between:
    return Between(max(value * (1 - share), _ZERO), min(value * (1 + share), _ONE))


def _decimal(value: Fraction) -> Decimal:
    return _DIGITS.divide(Decimal(value.numerator), Decimal(value.denominator))


def _exp(q: Fraction) -> Between:
    """Return bounds of `exp(q)`, clamped to 1."""
    if q >= 0:
        return _exactly(_ONE)
    if q < -_FAR:
        return Between(_ZERO, Fraction(_DIGITS.exp(_decimal(-_FAR))) * 2)
    near = Fraction(_DIGITS.exp(_decimal(q)))
    return _around(near, _OFF * (2 - 2 * q))


def _log(value: Fraction) -> tuple[Fraction, Fraction]:
    """Return the logarithm of a number above 0, and how far it can be off."""
    near = Fraction(_DIGITS.ln(_decimal(value)))
    return near, _OFF * (2 + 2 * abs(near))


def _odds(low: Fraction, high: Fraction) -> Between:
    """Return bounds of `1 / (1 + exp(t))` for t between two numbers."""
    ends: list[Fraction] = []
    for t, side in ((high, 0), (low, 1)):
        small = _exp(-abs(t))
        # 1 / (1 + e) falls with e, and e / (1 + e) grows
        e = small[1 - side] if t < 0 else small[side]
        ends.append(1 / (1 + e) if t < 0 else e / (1 + e))
    return Between(*ends)


def _sigmoid(curve: Sigmoid, x: Fraction) -> Between:
    t = -Fraction(curve.slope) * (x - Fraction(curve.inflection))
    return _exactly(_HALF) if not t else _odds(t, t)


def _apart(one: Between, other: Between) -> Between:
    low = max(one.low - other.high, other.low - one.high, _ZERO)
    return Between(low, max(one.high - other.low, other.high - one.low))


def _bell(curve: Bell, x: Fraction) -> Between:
    """Return bounds of `1 / (1 + u**p)`: with `u**p = exp(t)`, `1 / (1 + exp(t))`."""
    u = abs(x - Fraction(curve.center)) / Fraction(curve.width)
    power = 2 * Fraction(curve.slope)
    if not power or u == 1:
        return _exactly(_HALF)
    if not u:
        return _exactly(_ONE if power > 0 else _ZERO)
    log, off = _log(u)
    off *= abs(power)
    return _odds(power * log - off, power * log + off)


def _cosine(t: Fraction) -> Between:
    """Return bounds of `(1 + cos(2 pi t)) / 2 = cos(pi t)**2`, 0 from 1/2 on."""
    if t >= _HALF:
        return _exactly(_ZERO)
    if not t:
        return _exactly(_ONE)
    square = Fraction(_decimal((_PI * t) ** 2))
    total, term, number = _ONE, _ONE, 0
    while term > _OFF:
        number += 2
        term *= square / (number * (number - 1))
        total += term if number % 4 == 0 else -term
    # The square's rounding and that of pi move the angle by 5 of its last digits.
    off = term + 5 * (_OFF + _PI_OFF)
    low, high = max(total - off, _ZERO), min(total + off, _ONE)
    return Between(low * low, high * high)


def _square(x: Fraction, middle: float, width: float) -> Fraction:
    return ((x - Fraction(middle)) / Fraction(width)) ** 2


def _rational(
    curve: Trapezoid | SCurve | PiCurve | Concave | Binary | Singleton, x: Fraction
) -> Fraction:
    match curve:
        case Trapezoid(a=a, b=b, c=c, d=d):
            return min(_ramp(x, a, b), _ramp(-x, _minus(d), -c))
        case SCurve(start=start, end=end):
            return _s(x, start, end)
        case PiCurve(a=a, b=b, c=c, d=d):
            falling = _ONE if x <= c else _ZERO if x >= d else _s(x, d, c)
            return _s(x, a, b) * falling
        case Concave(inflection=inflection, end=end):
            width, behind = abs(Fraction(end) - Fraction(inflection)), x - Fraction(end)
            before = -behind if inflection <= end else behind
            return _ONE if before <= 0 else width / (width + before)
        case Binary(start=start, is_above=is_above):
            return Fraction(x >= start if is_above else x <= start)
        case Singleton(value=value):
            return Fraction(x == value)


def _minus(value: float | None) -> float | None:
    return None if value is None else -value


def _ramp(x: Fraction, foot: float | None, top: float) -> Fraction:
    """Return 0 before the foot and 1 from the top on."""
    if foot is None or x >= top:
        return _ONE
    if x < foot:
        return _ZERO
    return (x - Fraction(foot)) / (Fraction(top) - Fraction(foot))


def _s(x: Fraction, start: float, end: float) -> Fraction:
    if start == end:
        return Fraction(x > start)
    t = (x - Fraction(start)) / (Fraction(end) - Fraction(start))
    t = min(max(t, _ZERO), _ONE)
    return 2 * t * t if t <= _HALF else 1 - 2 * (1 - t) ** 2
