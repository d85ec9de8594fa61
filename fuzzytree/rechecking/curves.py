"""Membership functions: read from a file, and between which fractions degrees lie.

Straight pieces are exact. Everything else is enclosed; both ends are rounded outwards,
to 40 decimal digits, so they are certain.
"""

from __future__ import annotations

import functools
import itertools
import math
from bisect import bisect_left
from collections.abc import Callable
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any, NamedTuple

from fuzzytree.rechecking.outcomes import CannotRunError, UndecidedError

ZERO, ONE = Fraction(0), Fraction(1)
Facts = dict[str, Any]
Between = tuple[Fraction, Fraction]
STRAIGHT = ("band", "points", "trapezoid")
CAP = 1 - Fraction(1, 2**53)  # the largest degree off a plateau
_DIGITS = Context(prec=40)
_PI = Fraction(31415926535897932384626433832795028841971693993751, 10**49)
_FAR = 1000  # e**-1000 and less is enclosed by 0 and that


class Curve(NamedTuple):
    """A membership function: its kind and numbers, its height, and hedges."""

    kind: str
    numbers: tuple[Any, ...]
    height: Fraction = ONE
    hedges: tuple[str, ...] = ()


def is_straight(curve: Curve) -> bool:
    """Return whether a curve consists of lines between its knots."""
    return curve.kind in STRAIGHT and not curve.hedges


def knots(curve: Curve) -> list[Fraction]:
    """Return where a curve jumps or bends; of others where their formula changes."""
    n = curve.numbers
    if curve.kind == "points":
        return sorted({*map(Fraction, n[0])})
    if curve.kind == "lr":
        sides = [Fraction(s) * k for s, _, r in n[1:] for k in (ONE, Fraction(r))]
        signs = zip((-1, -1, 1, 1), sides, strict=True)
        mean = Fraction(n[0])
        return sorted([mean, *(mean + sign * far for sign, far in signs)])
    ends = [Fraction(end) for end in n if isinstance(end, float)]
    if curve.kind == "band":
        pairs = [(n[0], n[2]), (n[1], n[3])]
        ends += [
            Fraction(end) + CAP * (Fraction(top) - Fraction(end))
            for top, end in pairs
            if top is not None and end is not None
        ]
    if curve.kind == "trapezoid" and n[0] is not None and n[0] == n[1]:
        ends.append(Fraction(math.nextafter(n[1], -math.inf)))  # 1 from there on
    if curve.kind in ("pi", "s", "semi ellipse"):
        ends += [(a + b) / 2 for a, b in zip(ends[::2], ends[1::2], strict=True)]
    return sorted({*ends})


def bounds(curve: Curve, low: Fraction, high: Fraction) -> Between:
    """Return between which numbers the degrees of the values of an interval lie.

    Of a straight curve the interval must be a point.

    Raises:
        UndecidedError: If the curve is not known here.
    """
    if is_straight(curve) and low == high:
        degree = curve.height * _straight(curve, low)
        return degree, degree
    if curve.kind in STRAIGHT:
        inner = [x for x in knots(curve) if low < x < high]
        ends = [low, *inner, high]
        degrees = [_straight(curve, x) for x in ends]
        for a, b in itertools.pairwise(ends):  # the limits at the ends of each line
            p, q = (_straight(curve, (k * a + (3 - k) * b) / 3) for k in (2, 1))
            degrees += [2 * p - q, 2 * q - p]
        one = max(min(degrees), ZERO), min(max(degrees), ONE)
    else:
        one = _enclosed(curve, low, high)
    one = max(one[0], ZERO) * curve.height, min(one[1], ONE) * curve.height
    for hedge in reversed(curve.hedges):
        one = _hedged(hedge, one)
    return one


def _straight(curve: Curve, x: Fraction) -> Fraction:
    """Return a straight curve's degree; a line beside a plateau is below 1."""
    n = curve.numbers
    if curve.kind == "points":
        values, degrees = n
        place = bisect_left(values, x)
        if place in (0, len(values)):
            return Fraction(degrees[min(place, len(values) - 1)])
        return _line(x, values[place - 1 : place + 1], degrees[place - 1 : place + 1])
    low, high, left, right = n
    if curve.kind == "trapezoid":
        left, low, high, right = n
        if left is not None and x < low:
            is_step = left == low and x > Fraction(math.nextafter(low, -math.inf))
            return (
                ONE if is_step else ZERO if x <= left else _line(x, (left, low), (0, 1))
            )
        if right is not None and x > high:
            return ZERO if x >= right else _line(x, (high, right), (1, 0))
        return ONE
    end, top = (left, low) if low is not None and x <= low else (right, high)
    if (low is None or x > low) and (high is None or x <= high):
        return ONE
    return ZERO if end is None else min(max(_line(x, (end, top), (0, 1)), ZERO), CAP)


def _line(x: Fraction, ends: tuple[float, ...], degrees: tuple[float, ...]) -> Fraction:
    a, b, p, q = map(Fraction, (*ends, *degrees))
    return p + (q - p) * (x - a) / (b - a)


def _enclosed(curve: Curve, low: Fraction, high: Fraction) -> Between:
    """Return the degrees of a curve that is no line.

    All but LR sets are monotone between the places where they turn, or are two curves
    that are.
    """
    n = curve.numbers
    if curve.kind == "lr":
        mean = Fraction(n[0])
        left = _side(mean - high, mean - low, n[1])
        right = _side(low - mean, high - mean, n[2])
        return min(left[0], right[0]), min(left[1], right[1])
    if curve.kind in PAIRS:
        a, b = (_enclosed(one, low, high) for one in PAIRS[curve.kind](*n))
        if curve.kind != "sigmoid difference":
            return a[0] * b[0], a[1] * b[1]
        least, most = a[0] - b[1], a[1] - b[0]
        return max(least, -most, ZERO), max(abs(least), abs(most))
    if curve.kind not in DEGREES:
        raise UndecidedError(f"a curve ({curve.kind}) is not evaluated here")
    turns = [x for x in knots(curve) if low < x < high]
    numbers = [*map(Fraction, n)]
    ends = [DEGREES[curve.kind](x, *numbers) for x in (low, *turns, high)]
    return min(one for one, _ in ends), max(one for _, one in ends)


def _side(
    low: Fraction, high: Fraction, side: tuple[float, tuple[float, ...], float]
) -> Between:
    """Return the degrees of a side of an LR set at distances from its mean."""
    if high <= 0:
        return ONE, ONE
    spread, reach = Fraction(side[0]), Fraction(side[2])
    u, v = (min(max(x / spread, ZERO), reach) for x in (low, high))
    a, b = min(u, ONE), min(v, ONE)
    least = most = (
        sum((c * a**k for k, c in enumerate(body(side[1]))), start=ZERO)
        if a == b
        else ZERO
    )
    if a < b:  # in doubles, of the distance from the middle
        poly = [*map(float, body(side[1]))]
        off = sum(map(abs, poly)) * 2.0**-36  # more than all rounding
        middle, half = float(a + b) / 2, float(b - a) / 2 + 2.0**-50
        for start in range(len(poly)):
            for place in range(len(poly) - 2, start - 1, -1):
                poly[place] += middle * poly[place + 1]
        off += sum(abs(c) * half**k for k, c in enumerate(poly) if k)
        least, most = Fraction(poly[0] - off), Fraction(poly[0] + off)
    least, most = (min(max(y, ZERO), ONE) for y in (least, most))
    if v <= 1:
        return least, most
    tails = [min((reach - x) / (reach - 1), ONE) ** 4 for x in (v, u)]
    return least * tails[0], most * tails[1]


@functools.lru_cache(maxsize=4096)
def body(curve: tuple[float, ...]) -> tuple[Fraction, ...]:
    """Return the polynomial `1 - t (c0 + (2 t - 1) (c1 + ...))`, the lowest first."""
    poly: list[Fraction] = [ZERO]
    for c in reversed(curve):
        twice = [ZERO, *(2 * one for one in poly)]
        poly = [a - b for a, b in zip(twice, [*poly, ZERO], strict=True)]
        poly[0] += Fraction(c)
    return (ONE, *(-c for c in poly))


def _s(x: Fraction, start: Fraction, end: Fraction) -> Fraction:
    if start == end:
        return ONE if x > start else ZERO
    t = min(max((x - start) / (end - start), ZERO), ONE)
    return 2 * t * t if 2 * t <= 1 else 1 - 2 * (1 - t) ** 2


# --- functions of the reals, enclosed


def _rising(function: Callable[[Decimal], Decimal], x: Fraction) -> Between:
    """Return between which numbers a rising function of x lies.

    Decimals round its values to the nearest one, so its neighbours are beyond.
    """
    near = _DIGITS.divide(Decimal(x.numerator), Decimal(x.denominator))
    ends = function(_DIGITS.next_minus(near)), function(_DIGITS.next_plus(near))
    return Fraction(_DIGITS.next_minus(ends[0])), Fraction(_DIGITS.next_plus(ends[1]))


def _falling(x: Fraction) -> Between:
    """Return between which numbers e**-x lies, x >= 0."""
    if not x:
        return ONE, ONE
    if x > _FAR:
        return ZERO, Fraction(1, 2**_FAR)
    return _rising(_DIGITS.exp, -x)


def _ln(x: Fraction) -> Between:
    return _rising(_DIGITS.ln, x)


def _root(x: Fraction) -> Between:
    """Return between which numbers the square root of x >= 0 lies."""
    whole = math.isqrt((x.numerator << 256) // x.denominator)
    low = Fraction(whole, 1 << 128)
    return low, low if low * low == x else low + Fraction(1, 1 << 128)


def _power(x: Fraction, power: Fraction) -> Between:
    """Return between which numbers a power of x lies, 0 <= x <= 1."""
    if x in (0, 1):
        return x, x
    low, high = _ln(x)
    return _falling(-low * power)[0], min(_falling(-high * power)[1], ONE)


def _bell(x: Fraction, center: Fraction, width: Fraction, slope: Fraction) -> Between:
    if x == center:
        return (ONE, ONE) if slope > 0 else (ZERO, ZERO)
    ends = [-2 * slope * one for one in _ln(abs(x - center) / width)]
    return _logistic(min(ends))[0], _logistic(max(ends))[1]


def _logistic(z: Fraction) -> Between:
    """Return between which numbers 1 / (1 + e**-z) lies."""
    low, high = _falling(abs(z))
    return (
        (low / (1 + low), high / (1 + high))
        if z < 0
        else (1 / (1 + high), 1 / (1 + low))
    )


def _cosine(x: Fraction, center: Fraction, width: Fraction) -> Between:
    """Return between which numbers (1 + cos(2 pi (x - center) / width)) / 2 lies."""
    turns = abs(x - center) / width
    if 2 * turns >= 1:
        return ZERO, ZERO
    square, low, high = (2 * turns * _PI) ** 2, -ONE, ONE
    for place in range(59, 0, -2):
        step = square / (place * (place + 1))
        ends = 1 - step * high, 1 - step * low
        low, high = (Fraction(math.floor(end * 2**160), 2**160) for end in ends)
        high += Fraction(1, 2**160)
    off = Fraction(1, 10**40)  # of the digits of pi
    return (1 + max(low - off, -ONE)) / 2, (1 + min(high + off, ONE)) / 2


def _concave(x: Fraction, inflection: Fraction, end: Fraction) -> Between:
    wide, sign = abs(end - inflection), 1 if end >= inflection else -1
    far = wide + max((end - x) * sign, ZERO)
    return (wide / far, wide / far) if far else (ONE, ONE)


def _arc(x: Fraction, start: Fraction, end: Fraction) -> Between:
    u = min(max((x - start) / (end - start), ZERO), ONE)
    return _root(u * (2 - u))


def _semi_ellipse(x: Fraction, start: Fraction, end: Fraction) -> Between:
    u = min(abs(2 * x - start - end) / abs(end - start), ONE)
    return _root(1 - u * u)


def _gaussian(x: Fraction, mean: Fraction, deviation: Fraction) -> Between:
    return _falling(((x - mean) / deviation) ** 2 / 2)


def _left_half(x: Fraction, mean: Fraction, deviation: Fraction) -> Between:
    return _gaussian(min(x, mean), mean, deviation)


def _right_half(x: Fraction, mean: Fraction, deviation: Fraction) -> Between:
    return _gaussian(max(x, mean), mean, deviation)


def _sigmoid(x: Fraction, inflection: Fraction, slope: Fraction) -> Between:
    return _logistic(slope * (x - inflection))


def _spike(x: Fraction, center: Fraction, width: Fraction) -> Between:
    return _falling(10 * abs(x - center) / width)


def _s_curve(x: Fraction, start: Fraction, end: Fraction) -> Between:
    degree = _s(x, start, end)
    return degree, degree


DEGREES: dict[str, Callable[..., Between]] = {
    "gaussian": _gaussian,
    "left half": _left_half,
    "right half": _right_half,
    "sigmoid": _sigmoid,
    "spike": _spike,
    "s": _s_curve,
    "bell": _bell,
    "cosine": _cosine,
    "concave": _concave,
    "arc": _arc,
    "semi ellipse": _semi_ellipse,
}
"""Between which numbers a degree lies at a point."""


def _sigmoids(*both: tuple[float, ...]) -> list[Curve]:
    return [Curve("sigmoid", one) for one in both]


def _halves(
    left: float, left_deviation: float, right: float, right_deviation: float
) -> list[Curve]:
    return [
        Curve("left half", (left, left_deviation)),
        Curve("right half", (right, right_deviation)),
    ]


def _slopes(a: float, b: float, c: float, d: float) -> list[Curve]:
    return [Curve("s", (a, b)), Curve("s", (d, c))]


PAIRS: dict[str, Callable[..., list[Curve]]] = {
    "two gaussians": _halves,
    "pi": _slopes,
    "sigmoid product": _sigmoids,
    "sigmoid difference": _sigmoids,
}
"""Curves that are a product, or a difference, of two others."""


_HEDGES: dict[str, Callable[[Fraction], Between]] = {
    "any": lambda d: (ONE, ONE),
    "very": lambda d: (d * d, d * d),
    "cubed": lambda d: (d**3, d**3),
    "very very": lambda d: (d**4, d**4),
    "somewhat": _root,
    "cube root": lambda d: _power(d, Fraction(1, 3)),
    "plus": lambda d: _power(d, Fraction(5, 4)),
    "minus": lambda d: _power(d, Fraction(3, 4)),
    "extremely": lambda d: (_s(d, ZERO, ONE), _s(d, ZERO, ONE)),
    "seldom": lambda d: (
        _root(d / 2)
        if 2 * d <= 1
        else (1 - _root((1 - d) / 2)[1], 1 - _root((1 - d) / 2)[0])
    ),
}
"""What a hedge makes of a degree; all rise with it."""


def _hedged(hedge: str, one: Between) -> Between:
    if hedge == "not":
        return 1 - one[1], 1 - one[0]
    low, high = (min(max(end, ZERO), ONE) for end in one)
    return _HEDGES[hedge](low)[0], _HEDGES[hedge](high)[1]


# --- from a file

SHAPES = {
    "gaussian": "mean, deviation",
    "two gaussians": "left, left deviation, right, right deviation",
    "bell": "center, width, slope",
    "sigmoid": "inflection, slope",
    "s": "start, end",
    "cosine": "center, width",
    "concave": "inflection, end",
    "spike": "center, width",
    "arc": "start, end",
    "semi ellipse": "start, end",
}
"""The curves whose numbers have names, and these names in order."""


def keys(one: Facts, needed: str, optional: str = "") -> None:
    """Refuse facts that lack a key, or have another one.

    Raises:
        CannotRunError: If they do.
    """
    must = {*needed.split(", ")}
    wrong = sorted(must - one.keys() | one.keys() - must - {*optional.split(", ")})
    if wrong:
        raise CannotRunError(f"missing or unknown: {', '.join(map(repr, wrong)):.200}")


def number_of(value: Any) -> float:
    """Return a finite number.

    Raises:
        CannotRunError: If it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise CannotRunError(f"no number: {value!r:.60}")
    if not math.isfinite(value):
        raise CannotRunError(f"not finite: {value!r:.60}")
    return float(value)


def curve_of(one: Facts) -> Curve:
    """Return the membership function of a term.

    Raises:
        CannotRunError: If it is not known here.
    """
    height = Fraction(number_of(one.pop("height", 1)))
    if one == {"degree": 1}:
        return Curve("band", (None,) * 4, height)
    if "mean" in one and one.keys() & {"spread", "left"}:
        keys(
            one, "mean, left, right" if "left" in one else "mean, spread, curve, reach"
        )
        sides = []
        for side in (one.get("left", one), one.get("right", one)):
            spread, reach = number_of(side["spread"]), number_of(side["reach"])
            if spread <= 0 or reach <= 1 or not 1 <= len(side["curve"]) <= 8:
                raise CannotRunError("a side of no set")
            sides.append((spread, tuple(map(number_of, side["curve"])), reach))
        return Curve("lr", (number_of(one["mean"]), *sides), height)
    if one and one.keys() <= {"0 up to", "above", "up to", "0 from"}:
        names = ("above", "up to", "0 up to", "0 from")
        ends = tuple(None if n not in one else number_of(one[n]) for n in names)
        order = [end for end in (ends[2], ends[0], ends[1], ends[3]) if end is not None]
        if order != sorted({*order}):
            raise CannotRunError("a plateau whose ends are swapped")
        return Curve("band", ends, height)
    ((kind, data),) = one.items()
    if kind == "formula":
        return Curve(kind, (str(data),), height)
    return Curve(*_numbers(kind, data), height)


def _numbers(kind: str, data: Any) -> tuple[str, tuple[Any, ...]]:
    if kind == "points":
        values, degrees = zip(*data, strict=True)
        points = tuple(map(number_of, values)), tuple(map(number_of, degrees))
        if [*points[0]] != sorted(points[0]) or not all(0 <= y <= 1 for y in points[1]):
            raise CannotRunError("points that are no function")
        return kind, points
    if kind in SHAPES:
        keys(data, SHAPES[kind])
        numbers = tuple(number_of(data[name]) for name in SHAPES[kind].split(", "))
        is_wide = all(
            numbers[i] > 0
            for i, n in enumerate(SHAPES[kind].split(", "))
            if n in ("width",) or n.endswith("deviation")
        )
        if not is_wide:
            raise CannotRunError("a curve without width")
        return kind, numbers
    if kind in ("trapezoid", "triangle"):
        a, *inner, d = data
        b, c = map(number_of, inner if kind == "trapezoid" else inner * 2)
        ends = (
            None if a == -math.inf else number_of(a),
            b,
            c,
            None if d == math.inf else number_of(d),
        )
        order = [end for end in ends if end is not None]
        if order != sorted(order):
            raise CannotRunError("a trapezoid whose ends are swapped")
        return "trapezoid", ends
    if kind in ("sigmoid difference", "sigmoid product"):
        first, second = data
        return kind, (_numbers("sigmoid", first)[1], _numbers("sigmoid", second)[1])
    if kind == "pi":
        a, b, c, d = map(number_of, data)
        return kind, (a, b, c, d)
    if kind not in ("singleton", "at least", "at most"):
        raise CannotRunError(f"a curve ({kind:.60}) is not known")
    x = number_of(data)
    if kind == "singleton":
        return "trapezoid", (x, x, x, x)
    return "trapezoid", (x, x, x, None) if kind == "at least" else (None, x, x, x)
