"""Membership functions: read from a file, and between which fractions degrees lie.

What consists of lines is exact. Everything else is enclosed; both ends are rounded
outwards, to 40 decimal digits, so they are certain.
"""

from __future__ import annotations

import functools
import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any, NamedTuple

from fuzzytree.rechecking.outcomes import CannotRunError, UndecidedError

ZERO, ONE = Fraction(0), Fraction(1)
Facts = dict[str, Any]
Between = tuple[Fraction, Fraction]
Numbers = tuple[Fraction, ...]
CAP = 1 - Fraction(1, 2**53)  # the largest degree off a plateau
_DIGITS = Context(prec=40)
_PI = Fraction(31415926535897932384626433832795028841971693993751, 10**49)
_FAR = 1000  # e**-1000 and less is enclosed by 0 and that


class Knot(NamedTuple):
    """A place of a function of lines: its value, and the limits on both sides.

    The function is constant before the first and behind the last knot.
    """

    x: Fraction
    before: Fraction
    at: Fraction
    after: Fraction


class Curve(NamedTuple):
    """A membership function: its kind and numbers, its height, and hedges.

    The numbers of `lines` are knots; the height is in them.
    """

    kind: str
    numbers: tuple[Any, ...]
    height: Fraction = ONE
    hedges: tuple[str, ...] = ()

    @property
    def is_known(self) -> bool:
        """Whether its degrees are known here; of a formula they are not."""
        return self.kind not in ("formula", "unknown")

    @property
    def top(self) -> Fraction:
        """No degree is larger."""
        return ONE if self.hedges else self.height


def is_straight(curve: Curve) -> bool:
    """Return whether a curve consists of lines between its knots."""
    return curve.kind == "lines" and not curve.hedges


def turns(curve: Curve) -> list[Fraction]:
    """Return where a curve jumps, bends, or has another formula."""
    n = curve.numbers
    if curve.kind == "lines":
        return [knot.x for knot in n]
    if curve.kind == "lr":
        mean, (left, _, reach), (right, _, other) = n
        far = (-left * reach, -left, 0, right, right * other)
        return [mean + x for x in far]
    if curve.kind in ("product", "difference"):
        return sorted({x for part in n for x in turns(part)})
    if not curve.is_known:
        return []
    ends = {*n, (n[0] + n[1]) / 2} if curve.kind in ("s", "semi ellipse") else {*n}
    return sorted(ends)


def bounds(curve: Curve, low: Fraction, high: Fraction) -> Between:
    """Return between which numbers the degrees of the values of an interval lie."""
    if curve.kind == "lines":
        inner = [knot for knot in curve.numbers if low < knot.x < high]
        (_, first, *start), (*end, last, _) = (
            _sides(curve.numbers, x) for x in (low, high)
        )
        degrees = [first, last, *(y for _, *limits in inner for y in limits)]
        degrees += [*start, *end] if low < high else []
        result = min(degrees), max(degrees)
    else:
        result = _enclosure(curve, low, high)
        result = max(result[0], ZERO) * curve.height, min(result[1], ONE) * curve.height
    for hedge in reversed(curve.hedges):
        result = _apply_hedge(hedge, result)
    return result


def _sides(knots: tuple[Knot, ...], x: Fraction) -> tuple[Fraction, ...]:
    """Return the limit before a place, the value there, and the limit behind it."""
    place = bisect_left(knots, x, key=lambda knot: knot.x)
    if place < len(knots) and knots[place].x == x:
        return knots[place][1:]
    if place == 0:
        return (knots[0].before,) * 3
    start = end = knots[place - 1]
    if place < len(knots):
        end = knots[place]
        rise = (end.before - start.after) / (end.x - start.x)
        return (start.after + rise * (x - start.x),) * 3
    return (end.after,) * 3


def _enclosure(curve: Curve, low: Fraction, high: Fraction) -> Between:
    """Return the degrees of a curve that is no line.

    All but LR sets are monotone between the places where they turn, or are two curves
    that are.
    """
    n = curve.numbers
    if curve.kind == "lr":
        left = _side(n[0] - high, n[0] - low, n[1])
        right = _side(low - n[0], high - n[0], n[2])
        return min(left[0], right[0]), min(left[1], right[1])
    if curve.kind in ("product", "difference"):
        a, b = (_enclosure(part, low, high) for part in n)
        if curve.kind == "product":
            return a[0] * b[0], a[1] * b[1]
        least, most = a[0] - b[1], a[1] - b[0]
        return max(least, -most, ZERO), max(abs(least), abs(most))
    if not curve.is_known:
        raise UndecidedError(f"a curve ({n[0]}) is not evaluated here")
    inner = (x for x in turns(curve) if low < x < high)
    ends = [_degree(curve.kind, x, n) for x in (low, *inner, high)]
    return min(end for end, _ in ends), max(end for _, end in ends)


@functools.lru_cache(maxsize=1 << 14)
def _degree(kind: str, x: Fraction, numbers: Numbers) -> Between:
    return _CURVES[kind][1](x, numbers)


def _side(
    low: Fraction, high: Fraction, side: tuple[Fraction, tuple[float, ...], Fraction]
) -> Between:
    """Return the degrees of a side of an LR set at distances from its mean."""
    if high <= 0:
        return ONE, ONE
    spread, curve, reach = side
    u, v = (min(max(x / spread, ZERO), reach) for x in (low, high))
    a, b = min(u, ONE), min(v, ONE)
    if a == b:
        least = most = sum((c * a**k for k, c in enumerate(_body(curve))), start=ZERO)
    else:  # in doubles, of the distance from the middle
        poly = [*map(float, _body(curve))]
        off = sum(map(abs, poly)) * 2.0**-36  # more than all rounding
        middle, half = float(a + b) / 2, float(b - a) / 2 + 2.0**-50
        for start in range(len(poly)):
            for place in range(len(poly) - 2, start - 1, -1):
                poly[place] += middle * poly[place + 1]
        off += sum(abs(c) * half**k for k, c in enumerate(poly) if k)
        least, most = Fraction(poly[0] - off), Fraction(poly[0] + off)
    least, most = _share(least), _share(most)
    if v <= 1:
        return least, most
    tails = [min((reach - x) / (reach - 1), ONE) ** 4 for x in (v, u)]
    return least * tails[0], most * tails[1]


@functools.lru_cache(maxsize=4096)
def _body(curve: tuple[float, ...]) -> tuple[Fraction, ...]:
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
    t = _share((x - start) / (end - start))
    return 2 * t * t if 2 * t <= 1 else 1 - 2 * (1 - t) ** 2


# --- functions of the reals, enclosed


def _increase_bounds(function: Callable[[Decimal], Decimal], x: Fraction) -> Between:
    """Return between which numbers a rising function of x lies.

    Decimals round its values to the nearest one, so its neighbours are beyond.
    """
    near = _DIGITS.divide(Decimal(x.numerator), Decimal(x.denominator))
    ends = function(_DIGITS.next_minus(near)), function(_DIGITS.next_plus(near))
    return Fraction(_DIGITS.next_minus(ends[0])), Fraction(_DIGITS.next_plus(ends[1]))


def _exp_minus(x: Fraction) -> Between:
    """Return between which numbers e**-x lies, x >= 0."""
    if not x:
        return ONE, ONE
    if x > _FAR:
        return ZERO, Fraction(1, 2**_FAR)
    return _increase_bounds(_DIGITS.exp, -x)


def _ln(x: Fraction) -> Between:
    return _increase_bounds(_DIGITS.ln, x)


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
    return _exp_minus(-low * power)[0], min(_exp_minus(-high * power)[1], ONE)


def _logistic(z: Fraction) -> Between:
    """Return between which numbers 1 / (1 + e**-z) lies."""
    low, high = _exp_minus(abs(z))
    ends = low / (1 + low), high / (1 + high)
    return ends if z < 0 else _complement(ends)


def _cosine(x: Fraction, n: Numbers) -> Between:
    """Return between which numbers (1 + cos(2 pi (x - center) / width)) / 2 lies."""
    phase = 2 * abs(x - n[0]) / n[1]
    if phase >= 1:
        return ZERO, ZERO
    square, low, high = (phase * _PI) ** 2, -ONE, ONE
    for place in range(59, 0, -2):
        step = square / (place * (place + 1))
        ends = 1 - step * high, 1 - step * low
        low, high = (Fraction(math.floor(end * 2**160), 2**160) for end in ends)
        high += Fraction(1, 2**160)
    off = Fraction(1, 10**40)  # of the digits of pi
    return (1 + max(low - off, -ONE)) / 2, (1 + min(high + off, ONE)) / 2


def _bell(x: Fraction, n: Numbers) -> Between:
    center, width, slope = n
    if x == center:
        return _exact(ONE if slope > 0 else ZERO)
    ends = [-2 * slope * end for end in _ln(abs(x - center) / width)]
    return _logistic(min(ends))[0], _logistic(max(ends))[1]


def _gaussian(x: Fraction, n: Numbers) -> Between:
    return _exp_minus(((x - n[0]) / n[1]) ** 2 / 2)


def _concave(x: Fraction, n: Numbers) -> Between:
    wide, sign = abs(n[1] - n[0]), 1 if n[1] >= n[0] else -1
    far = wide + max((n[1] - x) * sign, ZERO)
    return _exact(wide / far if far else ONE)


def _exact(degree: Fraction) -> Between:
    return degree, degree


def _share(x: Fraction) -> Fraction:
    return min(max(x, ZERO), ONE)


_CURVES: dict[str, tuple[str, Callable[[Fraction, Numbers], Between]]] = {
    "gaussian": ("mean, deviation", _gaussian),
    "left half": ("mean, deviation", lambda x, n: _gaussian(min(x, n[0]), n)),
    "right half": ("mean, deviation", lambda x, n: _gaussian(max(x, n[0]), n)),
    "bell": ("center, width, slope", _bell),
    "sigmoid": ("inflection, slope", lambda x, n: _logistic(n[1] * (x - n[0]))),
    "spike": ("center, width", lambda x, n: _exp_minus(10 * abs(x - n[0]) / n[1])),
    "s": ("start, end", lambda x, n: _exact(_s(x, *n))),
    "cosine": ("center, width", _cosine),
    "concave": ("inflection, end", _concave),
    "arc": (
        "start, end",
        lambda x, n: _root(1 - (1 - _share((x - n[0]) / (n[1] - n[0]))) ** 2),
    ),
    "semi ellipse": (
        "start, end",
        lambda x, n: _root(1 - _share(abs(2 * x - sum(n)) / abs(n[1] - n[0])) ** 2),
    ),
}
"""The names of a curve's numbers, and its degree at a point, enclosed."""

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


def _apply_hedge(hedge: str, degree: Between) -> Between:
    if hedge == "not":
        return _complement(degree)
    low, high = map(_share, degree)
    return _HEDGES[hedge](low)[0], _HEDGES[hedge](high)[1]


# --- from a file


def keys(facts: Facts, needed: str, optional: str = "") -> None:
    """Refuse facts that lack a key, or have another one."""
    must = {*needed.split(", ")}
    wrong = sorted(must - facts.keys() | facts.keys() - must - {*optional.split(", ")})
    if wrong:
        raise CannotRunError(f"missing or unknown: {', '.join(map(repr, wrong)):.200}")


def number_of(value: Any) -> Fraction:
    """Return a finite number, as the double that it is."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value):
        raise CannotRunError(f"no finite number: {value!r:.60}")
    return Fraction(float(value))


def curve_of(term: Facts) -> Curve:
    """Return the membership function of a term."""
    facts = {key: value for key, value in term.items() if key not in ("name", "height")}
    height = number_of(term.get("height", 1))
    if facts == {"degree": 1}:
        curve = ANYTHING
    elif "mean" in facts and facts.keys() & {"spread", "left"}:
        own = "left, right" if "left" in facts else "spread, curve, reach"
        keys(facts, f"mean, {own}")
        sides = (_lr_side(facts.get(name, facts)) for name in ("left", "right"))
        curve = Curve("lr", (number_of(facts["mean"]), *sides))
    elif facts and facts.keys() <= {*_ENDS}:
        ends = [number_of(facts[n]) if n in facts else None for n in _ENDS]
        _check_order(ends, is_strict=True)
        curve = _plateau(ends, CAP)
    else:
        ((kind, data),) = facts.items()
        curve = _curve(kind, data)
    if curve.kind != "lines":
        return curve._replace(height=height)
    knots = (Knot(x, *(height * y for y in limits)) for x, *limits in curve.numbers)
    return Curve("lines", (*knots,), height)


def _lr_side(facts: Facts) -> tuple[Fraction, tuple[float, ...], Fraction]:
    spread, reach = number_of(facts["spread"]), number_of(facts["reach"])
    if spread <= 0 or reach <= 1 or not 1 <= len(facts["curve"]) <= 8:
        raise CannotRunError("a side of no set")
    return spread, tuple(float(number_of(c)) for c in facts["curve"]), reach


def _check_order(ends: Iterable[Fraction | None], *, is_strict: bool = False) -> None:
    order = [end for end in ends if end is not None]
    if order != (sorted({*order}) if is_strict else sorted(order)):
        raise CannotRunError("a curve whose ends are swapped")


def _lines(knots: Iterable[tuple[Fraction, ...]]) -> Curve:
    """Return a function of lines; knots at one place become one."""
    result: list[Knot] = []
    for knot in itertools.starmap(Knot, knots):
        if result and result[-1].x == knot.x:
            knot = result.pop()._replace(after=knot.after)
        result.append(knot)
    return Curve("lines", (*result,))


ANYTHING = _lines([(ZERO, ONE, ONE, ONE)])
"""The curve whose degree is 1 everywhere."""

_ENDS = ("0 up to", "above", "up to", "0 from")


def _plateau(ends: Sequence[Fraction | None], cap: Fraction) -> Curve:
    """Return a plateau above its second and up to its third end.

    Lines rise to it from the first, and fall to the last one, up to a cap.
    """
    start, low, high, end = ends
    knots: list[tuple[Fraction, ...]] = []
    if low is not None:
        if start is not None:
            knots.append((start, ZERO, ZERO, ZERO))
            knots.append((start + cap * (low - start), *[cap] * 3))
        foot = ZERO if start is None else cap
        knots.append((low, foot, foot, ONE))
    if high is not None:
        knots.append((high, ONE, ONE, ZERO if end is None else cap))
        if end is not None:
            knots.append((end + cap * (high - end), *[cap] * 3))
            knots.append((end, ZERO, ZERO, ZERO))
    return _lines(knots) if knots else ANYTHING


def _trapezoid(left: Any, low: Fraction, high: Fraction, right: Any) -> Curve:
    """Return a plateau between lines; one without width is 0 at the next double."""
    start = None if left == -math.inf else left
    end = None if right == math.inf else right
    _check_order((start, low, high, end))
    first: Fraction | None = None if start is None else low
    if start == low:
        start, first = None, Fraction(math.nextafter(float(low), -math.inf))
    last = None if end is None else high
    return _plateau((start, first, last, None if end == high else end), ONE)


def _curve(kind: str, data: Any) -> Curve:
    if kind == "formula":
        return Curve(kind, (kind,))
    if kind == "points":
        points = [(number_of(x), number_of(y)) for x, y in data]
        _check_order(x for x, _ in points)
        if not all(0 <= y <= 1 for _, y in points):
            raise CannotRunError("points that are no function")
        return _lines((x, y, y, y) for x, y in points)
    if kind == "two gaussians":
        keys(data, "left, left deviation, right, right deviation")
        halves = [
            {"mean": data[side], "deviation": data[f"{side} deviation"]}
            for side in ("left", "right")
        ]
        kinds = "left half", "right half"
        return Curve("product", (*map(_curve, kinds, halves),))
    if kind in _CURVES:
        names = _CURVES[kind][0]
        keys(data, names)
        numbers = {name: number_of(data[name]) for name in names.split(", ")}
        if any(numbers.get(name, 1) <= 0 for name in ("width", "deviation")):
            raise CannotRunError("a curve without width")
        return Curve(kind, (*numbers.values(),))
    if kind in ("sigmoid difference", "sigmoid product"):
        first, second = (_curve("sigmoid", of) for of in data)
        return Curve(kind.removeprefix("sigmoid "), (first, second))
    if kind == "pi":
        a, b, c, d = map(number_of, data)
        return Curve("product", (Curve("s", (a, b)), Curve("s", (d, c))))
    if kind in ("trapezoid", "triangle"):
        a, *inner, d = (x if x in (-math.inf, math.inf) else number_of(x) for x in data)
        b, c = inner if kind == "trapezoid" else inner * 2
        return _trapezoid(a, b, c, d)
    if kind not in ("singleton", "at least", "at most"):
        return Curve("unknown", (f"{kind:.60}",))  # or one that is added later
    x = number_of(data)
    left = -math.inf if kind == "at most" else x
    return _trapezoid(left, x, x, math.inf if kind == "at least" else x)
