"""Degrees of curves that are no polynomials, between two fractions.

Both ends are rounded outwards, to 2**-160 or 60 decimal digits, so they are certain.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from functools import reduce
from typing import Any

from fuzzytree.auditing.recheck.model_records import Curve, Scaled, Shape
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.auditing.recheck.polynomials import ONE, ZERO, degree

BITS, TERMS = 160, 48
UNIT = 1 << BITS
DIGITS = Context(prec=60)
Between = tuple[Fraction, Fraction]

_PI = Fraction(31415926535897932384626433832795028841971693993751, 10**49)
PI: Between = (_PI, _PI + Fraction(1, 10**48))


def down(x: Fraction) -> Fraction:
    """Return a number of few digits just below one, or the number itself."""
    return Fraction((x.numerator << BITS) // x.denominator, 1 << BITS)


def up(x: Fraction) -> Fraction:
    """Return a number of few digits just above one, or the number itself."""
    return -down(-x)


def falling(x: Fraction) -> Between:
    """Return between which numbers e**-x lies, x >= 0.

    Example:
        >>> low, high = falling(Fraction(1))
        >>> float(low) == float(high) == 0.36787944117144233
        True
    """
    if not x:
        return ONE, ONE
    return _rising(DIGITS.exp, -x) if x <= BITS else (ZERO, Fraction(1, UNIT))


def _rising(function: Callable[[Decimal], Decimal], x: Fraction) -> Between:
    """Return between which numbers a rising function of x lies.

    Decimals round its values to the nearest one, so its neighbours are beyond.
    """
    parts = Decimal(x.numerator), Decimal(x.denominator)
    near = DIGITS.divide(*parts)  # the nearest decimal; x is between its neighbours
    ends = function(DIGITS.next_minus(near)), function(DIGITS.next_plus(near))
    return Fraction(DIGITS.next_minus(ends[0])), Fraction(DIGITS.next_plus(ends[1]))


def logistic(low: Fraction, high: Fraction) -> Between:
    """Return between which numbers 1 / (1 + e**-z) lies, z between two numbers."""
    ends: list[Fraction] = []
    for z, place in ((low, 0), (high, 1)):
        tails = falling(abs(z))
        tail = tails[place] if z < 0 else tails[1 - place]
        ends.append(tail / (1 + tail) if z < 0 else 1 / (1 + tail))
    return ends[0], ends[1]


def logarithm(x: Fraction) -> Between:
    """Return between which numbers the natural logarithm of x > 0 lies."""
    return _rising(DIGITS.ln, x)


def cosine(turns: Fraction) -> Between:
    """Return between which numbers cos(2 pi t) lies, 0 <= t <= 1/2."""
    # It falls up to pi, and the angle may be a hair above: then cos is at least -1.
    low, high = (_cosine(2 * turns * end) for end in PI[::-1])
    return low[0], high[1]


def _cosine(angle: Fraction) -> Between:
    square, low, high = angle * angle, -ONE, ONE
    for place in range(2 * TERMS - 1, 0, -2):
        step = square / (place * (place + 1))
        low, high = down(1 - step * high), up(1 - step * low)
    return max(low, -ONE), min(high, ONE)


def root(x: Fraction, power: int) -> Between:
    """Return between which numbers the root of x >= 0 lies."""
    whole = (x.numerator << (power * BITS)) // x.denominator
    result, above = 0, 1 << (whole.bit_length() // power + 1)
    while above - result > 1:
        middle = (result + above) // 2
        if middle**power <= whole:
            result = middle
        else:
            above = middle
    low = Fraction(result, UNIT)
    return low, low if low**power == x else low + Fraction(1, UNIT)


def bounds(shape: Shape, x: Fraction) -> Between:
    """Return between which degrees that of x lies; both are one where it is exact.

    Raises:
        UndecidedError: If a curve is not known here.
    """
    with contextlib.suppress(UndecidedError):
        return _certain(degree(shape, x))
    if isinstance(shape, Scaled):
        height = Fraction(shape.height)
        low, high = (height * end for end in bounds(shape.shape, x))
        for hedge in reversed(shape.hedges):
            low, high = hedged(hedge, (low, high))
        return low, high
    assert isinstance(shape, Curve)  # the others are exact
    low, high = _curve(shape.kind, dict(shape.facts), x)
    return max(low, ZERO), min(high, ONE)


def _curve(kind: str, data: dict[str, Any], x: Fraction) -> Between:
    number = {k: Fraction(v) for k, v in data.items() if isinstance(v, float)}
    match kind:
        case "gaussian":
            return _gaussian(x - number["mean"], number["deviation"])
        case "two gaussians":
            left = _gaussian(min(x - number["left"], ZERO), number["left_deviation"])
            right = _gaussian(max(x - number["right"], ZERO), number["right_deviation"])
            return left[0] * right[0], left[1] * right[1]
        case "bell":
            far = abs(x - number["center"]) / number["width"]
            if not far:
                return _certain(ONE if number["slope"] > 0 else ZERO)
            ends = [-2 * number["slope"] * end for end in logarithm(far)]
            return logistic(min(ends), max(ends))
        case "sigmoid":
            z = number["slope"] * (x - number["inflection"])
            return logistic(z, z)
        case "sigmoid product":
            a, b = (bounds(data[name], x) for name in ("first", "second"))
            return a[0] * b[0], a[1] * b[1]
        case "sigmoid difference":
            a, b = (bounds(data[name], x) for name in ("first", "second"))
            low, high = a[0] - b[1], a[1] - b[0]
            return max(low, -high, ZERO), max(abs(low), abs(high))
        case "cosine":
            turns = abs(x - number["center"]) / number["width"]
            if turns > Fraction(1, 2):
                return _certain(ZERO)
            low, high = cosine(turns)
            return (1 + low) / 2, (1 + high) / 2
        case "spike":
            return falling(abs(10 * (x - number["center"]) / number["width"]))
        case "concave":
            wide, behind = number["end"] - number["inflection"], number["end"] - x
            is_sloped = behind > 0 if wide >= 0 else behind < 0
            return _certain(wide / (wide + behind) if is_sloped else ONE)
        case "arc":
            u = (x - number["start"]) / (number["end"] - number["start"])
            u = min(max(u, ZERO), ONE)
            return root(u * (2 - u), 2)
        case "semi ellipse":
            start, end = number["start"], number["end"]
            low, high = root(max((x - start) * (end - x), ZERO) / (end - start) ** 2, 2)
            return 2 * low, 2 * high
        case _:
            raise UndecidedError(f"a curve ({kind}) is not evaluated here")


def _certain(one: Fraction) -> Between:
    return one, one


def _gaussian(away: Fraction, deviation: Fraction) -> Between:
    return falling((away / deviation) ** 2 / 2)


_RISING: dict[str, Callable[[Fraction], Between]] = {
    "any": lambda d: _certain(ONE),
    "very": lambda d: _certain(d * d),
    "cubed": lambda d: _certain(d**3),
    "very very": lambda d: _certain(d**4),
    "somewhat": lambda d: root(d, 2),
    "cube root": lambda d: root(d, 3),
    "plus": lambda d: root(d**5, 4),
    "minus": lambda d: root(d**3, 4),
    "extremely": lambda d: _certain(2 * d * d if 2 * d <= 1 else 1 - 2 * (1 - d) ** 2),
    "seldom": lambda d: (
        root(d / 2, 2) if 2 * d <= 1 else _opposite(root((1 - d) / 2, 2))
    ),
}
"""What a hedge makes of a degree; all rise with it."""


def _opposite(one: Between) -> Between:
    return 1 - one[1], 1 - one[0]


def hedged(hedge: str, one: Between) -> Between:
    """Return what a hedge makes of a degree between two numbers."""
    if hedge == "not":
        return _opposite(one)
    low, high = (min(max(end, ZERO), ONE) for end in one)
    return _RISING[hedge](low)[0], _RISING[hedge](high)[1]


Norm = Callable[[Fraction, Fraction], Fraction]
NORMS: dict[str, Norm] = {
    "minimum": min,
    "product": lambda a, b: a * b,
    "bounded difference": lambda a, b: max(a + b - 1, ZERO),
    "drastic product": lambda a, b: min(a, b) if max(a, b) == 1 else ZERO,
    "einstein product": lambda a, b: a * b / (2 - (a + b - a * b)),
    "hamacher product": lambda a, b: a * b / (a + b - a * b) if a or b else ZERO,
    "nilpotent minimum": lambda a, b: min(a, b) if a + b > 1 else ZERO,
    "maximum": max,
    "algebraic sum": lambda a, b: a + b - a * b,
    "bounded sum": lambda a, b: min(a + b, ONE),
    "drastic sum": lambda a, b: ONE if min(a, b) else max(a, b),
    "einstein sum": lambda a, b: (a + b) / (1 + a * b),
    "hamacher sum": lambda a, b: (
        (a + b - 2 * a * b) / (1 - a * b) if a * b < 1 else ONE
    ),
    "nilpotent maximum": lambda a, b: max(a, b) if a + b < 1 else ONE,
    "normalized sum": lambda a, b: (a + b) / max(a + b, ONE),
    "sum": lambda a, b: a + b,
}
"""What joins two degrees; each rises with both."""


def joined(norm: str | None, degrees: Sequence[Between]) -> Between:
    """Return what a norm makes of degrees, each between two numbers; 1 of none."""
    lows, highs = zip(*degrees, strict=True) if degrees else ((ONE,), (ONE,))
    if len(degrees) < 2:
        return lows[0], highs[0]
    return reduce(NORMS[norm or ""], lows), reduce(NORMS[norm or ""], highs)
