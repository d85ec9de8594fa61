"""Membership functions: read from a file, and between which fractions degrees lie.

Straight pieces are exact. Everything else is enclosed; both ends are rounded outwards,
to 40 decimal digits, so they are certain.
"""

from __future__ import annotations

import functools
import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable
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
    if curve.kind in ("product", "difference"):
        return sorted({x for part in n for x in knots(part)})
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
    if curve.kind in ("s", "semi ellipse"):
        ends.append((ends[0] + ends[1]) / 2)
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
        result = min(degrees), max(degrees)
    else:
        result = _enclosed(curve, low, high)
    result = max(result[0], ZERO) * curve.height, min(result[1], ONE) * curve.height
    for hedge in reversed(curve.hedges):
        result = _hedged(hedge, result)
    return result


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
    if curve.kind in ("product", "difference"):
        a, b = (_enclosed(part, low, high) for part in n)
        if curve.kind == "product":
            return a[0] * b[0], a[1] * b[1]
        least, most = a[0] - b[1], a[1] - b[0]
        return max(least, -most, ZERO), max(abs(least), abs(most))
    if curve.kind == "formula":
        raise UndecidedError("a curve (formula) is not evaluated here")
    turns = [x for x in knots(curve) if low < x < high]
    numbers = [*map(Fraction, n)]
    degree: Callable[..., Between] = DEGREES.get(curve.kind, _bell)
    ends = [degree(x, *numbers) for x in (low, *turns, high)]
    return min(end for end, _ in ends), max(end for _, end in ends)


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
        twice = [ZERO, *(2 * c for c in poly)]
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


def _bell(x: Fraction, center: Fraction, width: Fraction, slope: Fraction) -> Between:
    if x == center:
        return (ONE, ONE) if slope > 0 else (ZERO, ZERO)
    ends = [-2 * slope * end for end in _ln(abs(x - center) / width)]
    return _logistic(min(ends))[0], _logistic(max(ends))[1]


def _gaussian(x: Fraction, mean: Fraction, deviation: Fraction) -> Between:
    return _falling(((x - mean) / deviation) ** 2 / 2)


def _concave(x: Fraction, inflection: Fraction, end: Fraction) -> Between:
    wide, sign = abs(end - inflection), 1 if end >= inflection else -1
    far = wide + max((end - x) * sign, ZERO)
    return (wide / far, wide / far) if far else (ONE, ONE)


def _exact(degree: Fraction) -> Between:
    return degree, degree


def _share(x: Fraction) -> Fraction:
    return min(max(x, ZERO), ONE)


DEGREES: dict[str, Callable[[Fraction, Fraction, Fraction], Between]] = {
    "gaussian": _gaussian,
    "left half": lambda x, mean, d: _gaussian(min(x, mean), mean, d),
    "right half": lambda x, mean, d: _gaussian(max(x, mean), mean, d),
    "sigmoid": lambda x, inflection, slope: _logistic(slope * (x - inflection)),
    "spike": lambda x, center, width: _falling(10 * abs(x - center) / width),
    "s": lambda x, start, end: _exact(_s(x, start, end)),
    "cosine": _cosine,
    "concave": _concave,
    "arc": lambda x, a, b: _root(1 - (1 - _share((x - a) / (b - a))) ** 2),
    "semi ellipse": lambda x, a, b: _root(
        1 - _share(abs(2 * x - a - b) / abs(b - a)) ** 2
    ),
}
"""Between which numbers a degree lies at a point; `_bell` has three numbers."""

_HEDGES: dict[str, Callable[[Fraction], Between]] = {
    "any": lambda d: (ONE, ONE),
    "very": lambda d: _exact(d * d),
    "cubed": lambda d: _exact(d**3),
    "very very": lambda d: _exact(d**4),
    "somewhat": _root,
    "cube root": lambda d: _power(d, Fraction(1, 3)),
    "plus": lambda d: _power(d, Fraction(5, 4)),
    "minus": lambda d: _power(d, Fraction(3, 4)),
    "extremely": lambda d: _exact(_s(d, ZERO, ONE)),
    "seldom": lambda d: _root(d / 2) if 2 * d <= 1 else _complement(_root((1 - d) / 2)),
}
"""What a hedge makes of a degree; all rise with it."""


def _complement(degree: Between) -> Between:
    return 1 - degree[1], 1 - degree[0]


def _hedged(hedge: str, degree: Between) -> Between:
    if hedge == "not":
        return _complement(degree)
    low, high = map(_share, degree)
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


def keys(facts: Facts, needed: str, optional: str = "") -> None:
    """Refuse facts that lack a key, or have another one.

    Raises:
        CannotRunError: If they do.
    """
    must = {*needed.split(", ")}
    wrong = sorted(must - facts.keys() | facts.keys() - must - {*optional.split(", ")})
    if wrong:
        raise CannotRunError(f"missing or unknown: {', '.join(map(repr, wrong)):.200}")


def number_of(value: Any) -> float:
    """Return a finite number.

    Raises:
        CannotRunError: If it is none.
    """
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value):
        raise CannotRunError(f"no finite number: {value!r:.60}")
    return float(value)


def curve_of(facts: Facts) -> Curve:
    """Return the membership function of a term.

    Raises:
        CannotRunError: If it is not known here.
    """
    height = Fraction(number_of(facts.pop("height", 1)))
    if facts == {"degree": 1}:
        return Curve("band", (None,) * 4, height)
    if "mean" in facts and facts.keys() & {"spread", "left"}:
        own = "left, right" if "left" in facts else "spread, curve, reach"
        keys(facts, f"mean, {own}")
        sides = (facts.get(name, facts) for name in ("left", "right"))
        return Curve("lr", (number_of(facts["mean"]), *map(_lr_side, sides)), height)
    if facts and facts.keys() <= {"0 up to", "above", "up to", "0 from"}:
        names = ("above", "up to", "0 up to", "0 from")
        ends = tuple(None if n not in facts else number_of(facts[n]) for n in names)
        _check_order((ends[2], ends[0], ends[1], ends[3]), is_strict=True)
        return Curve("band", ends, height)
    ((kind, data),) = facts.items()
    return _curve(kind, data)._replace(height=height)


def _lr_side(facts: Facts) -> tuple[float, tuple[float, ...], float]:
    spread, reach = number_of(facts["spread"]), number_of(facts["reach"])
    if spread <= 0 or reach <= 1 or not 1 <= len(facts["curve"]) <= 8:
        raise CannotRunError("a side of no set")
    return spread, tuple(map(number_of, facts["curve"])), reach


def _check_order(ends: Iterable[float | None], *, is_strict: bool = False) -> None:
    order = [end for end in ends if end is not None]
    if order != (sorted({*order}) if is_strict else sorted(order)):
        raise CannotRunError("a curve whose ends are swapped")


def _curve(kind: str, data: Any) -> Curve:
    if kind == "formula":
        return Curve(kind, (str(data),))
    if kind == "points":
        values, degrees = (tuple(map(number_of, of)) for of in zip(*data, strict=True))
        _check_order(values)
        if not all(0 <= y <= 1 for y in degrees):
            raise CannotRunError("points that are no function")
        return Curve(kind, (values, degrees))
    if kind in SHAPES:
        keys(data, SHAPES[kind])
        numbers = {name: number_of(data[name]) for name in SHAPES[kind].split(", ")}
        if any(
            x <= 0 for n, x in numbers.items() if n.endswith(("width", "deviation"))
        ):
            raise CannotRunError("a curve without width")
        ends = (*numbers.values(),)
        if kind == "two gaussians":
            halves = Curve("left half", ends[:2]), Curve("right half", ends[2:])
            return Curve("product", halves)
        return Curve(kind, ends)
    if kind in ("sigmoid difference", "sigmoid product"):
        first, second = (_curve("sigmoid", of) for of in data)
        return Curve(kind.removeprefix("sigmoid "), (first, second))
    if kind == "pi":
        a, b, c, d = map(number_of, data)
        return Curve("product", (Curve("s", (a, b)), Curve("s", (d, c))))
    if kind in ("trapezoid", "triangle"):
        a, *inner, d = data
        b, c = map(number_of, inner if kind == "trapezoid" else inner * 2)
        left = None if a == -math.inf else number_of(a)
        right = None if d == math.inf else number_of(d)
        _check_order((left, b, c, right))
        return Curve("trapezoid", (left, b, c, right))
    if kind not in ("singleton", "at least", "at most"):
        raise CannotRunError(f"a curve ({kind:.60}) is not known")
    x = number_of(data)
    left, right = None if kind == "at most" else x, None if kind == "at least" else x
    return Curve("trapezoid", (left, x, x, right))
