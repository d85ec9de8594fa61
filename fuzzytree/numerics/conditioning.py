"""How well a fitted curve can be evaluated, and whether it is a membership function.

Everything here is decided, not sampled: coefficients are doubles, hence rationals, and
a polynomial on an interval lies between its smallest and its largest Bernstein
coefficient, exactly. Halving the interval halves (at least) the distance of the two,
so maxima are bracketed as closely as wanted, and the sign of a derivative is proved on
all of [0, 1] but slivers of width 2**-20 around its roots.

Each curve is taken in its own position, from 0 where the degree is lowest to 1 at the
flank's start, or from 0 at the mean to 1 a spread away.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple, assert_never

from fuzzytree.model import LR, Band, Points, Shape, Side
from fuzzytree.numerics.exact import outwards

Curve = tuple[Fraction, ...]
"""Coefficients of powers of the position, the lowest first."""

_WIDTH = Fraction(1, 2**40)  # of the bracket of a maximum
_SLIVER = Fraction(1, 2**20)  # of position: where signs are no longer sought
_FLOOR = Fraction(1, 2**10)  # degrees below are compared with this one


class NumberBounds(NamedTuple):
    """A number that lies in [low, high], by proof."""

    low: float
    high: float


class Rise(NamedTuple):
    """A stretch on which a degree rises while the value moves away from the peak.

    Attributes:
        start: Where it begins, in the variable's unit, nearer to the peak.
        end: Where it ends.
        height: How much higher the clipped degree is at the end than at the start,
            rounded up.
    """

    start: float
    end: float
    height: float


class Conduct(NamedTuple):
    """How the curve of one side of a shape behaves, by proof.

    Attributes:
        side: `left` or `right`.
        size: The largest `sum |c_k| |v|**k` of the stored form: an evaluation in a
            type with unit roundoff u is wrong by at most about 2 n size u, n terms.
        condition: The largest `sum |c_k| |v|**k / |p(v)|` where the degree is at
            least 2**-10, and with 2**-10 for the degree below.
        above: By how much the polynomial exceeds 1 before it is clipped; 0 if not.
        below: By how much it falls below 0 before it is clipped; 0 if not.
        rises: Where the clipped degree rises outwards, the highest first.
    """

    side: str
    size: NumberBounds
    condition: NumberBounds
    above: NumberBounds
    below: NumberBounds
    rises: tuple[Rise, ...]


def conduct(shape: Shape) -> tuple[Conduct, ...]:
    """Return how each fitted side of a shape behaves; nothing for lines and steps.

    A list of points is evaluated as one quotient between two stored degrees, which
    leaves no room for any of this.

    Example:
        >>> from fuzzytree.model.rulebase import Side
        >>> bulge = Side(1.0, (0.25, 0.75))  # 1 - t (0.25 + 0.75 (2 t - 1))
        >>> left, right = conduct(LR(0.0, bulge, bulge))
        >>> round(right.above.high, 6)
        0.041667
        >>> [round(rise.end, 3) for rise in right.rises]
        []
    """
    match shape:
        case LR(mean=mean, left=below, right=above):
            return (_of_side("left", below, mean), _of_side("right", above, mean))
        case Band() | Points():
            return ()
    assert_never(shape)


def _of_side(name: str, side: Side, mean: float) -> Conduct:
    """Judge 1 - t Q(2 t - 1), which should fall with t, from 1 down to 0 at least."""
    stored = tuple(map(Fraction, side.curve))
    curve = _side_curve(stored)
    sign = -1 if name == "left" else 1
    spread = sign * Fraction(side.spread)

    def place(t: Fraction) -> float:
        return float(Fraction(mean) + t * spread)

    rises = [Rise(place(a), place(b), outwards(h)[1]) for a, b, h in _rises(curve)]
    pieces = _side_sizes(stored, curve)
    largest = [maximum(size) for size, _ in pieces]
    ratios = [_largest_ratio(size, part) for size, part in pieces]
    top = maximum(curve)
    bottom = maximum(tuple(-c for c in curve))
    return Conduct(
        name,
        _rounded(max(b[0] for b in largest), max(b[1] for b in largest)),
        _rounded(max(b[0] for b in ratios), max(b[1] for b in ratios)),
        _rounded(max(top[0] - 1, Fraction(0)), max(top[1] - 1, Fraction(0))),
        _rounded(max(bottom[0], Fraction(0)), max(bottom[1], Fraction(0))),
        tuple(sorted(rises, key=lambda rise: -rise.height)),
    )


def _side_curve(stored: Curve) -> Curve:
    """Return 1 - t Q(2 t - 1) in powers of t."""
    inner: list[Fraction] = [Fraction(0)]
    for coefficient in reversed(stored):
        inner = _times(inner, (Fraction(-1), Fraction(2)))
        inner[0] += coefficient
    body = [Fraction(1), *(-c for c in inner)]
    while len(body) > 1 and body[-1] == 0:
        body.pop()
    return tuple(body)


def _side_sizes(stored: Curve, curve: Curve) -> list[tuple[Curve, Curve]]:
    """Return 1 + t sum |c_k| |v|**k on both halves of [0, 1], and the curve there.

    |2 t - 1| is no polynomial, but it is one on each half; both are taken to [0, 1].
    """
    pieces: list[tuple[Curve, Curve]] = []
    for start in (Fraction(0), Fraction(1, 2)):
        # s in [0, 1]: t = start + s / 2, |v| = 1 - s on the first half, s on the second
        absolute = (
            (Fraction(1), Fraction(-1)) if start == 0 else (Fraction(0), Fraction(1))
        )
        size: list[Fraction] = [Fraction(0)]
        for coefficient in reversed(stored):
            size = _times(size, absolute)
            size[0] += abs(coefficient)
        size = _times(size, (start, Fraction(1, 2)))
        size[0] += 1
        pieces.append((tuple(size), _substituted(curve, start, Fraction(1, 2))))
    return pieces


# --- polynomials on [0, 1], exactly


def maximum(curve: Curve) -> tuple[Fraction, Fraction]:
    """Return bounds, at most 2**-40 apart, of the largest value on [0, 1].

    Example:
        >>> hill = (Fraction(0), Fraction(4), Fraction(-4))  # 4 x (1 - x)
        >>> maximum(hill)
        (Fraction(1, 1), Fraction(1, 1))
    """
    todo = [bernstein(curve)]
    low = max(todo[0][0], todo[0][-1])
    high = low
    while todo:
        part = todo.pop()
        low = max(low, part[0], part[-1])
        top = max(part)
        if top <= low or top - low <= _WIDTH:
            high = max(high, top)
        else:
            todo += halves(part)
    return low, max(low, high)


def _largest_ratio(size: Curve, curve: Curve) -> tuple[Fraction, Fraction]:
    """Return bounds of the largest size / max(|curve|, 2**-10), within a tenth."""
    todo = [(bernstein(size), bernstein(curve))]
    low = high = Fraction(0)
    while todo:
        above, part = todo.pop()
        for end in (0, -1):
            low = max(low, above[end] / max(abs(part[end]), _FLOOR))
        least = max(min(part), -max(part), _FLOOR)
        top = max(above) / least
        if top <= low * Fraction(11, 10):
            high = max(high, top)
        else:
            todo += zip(halves(above), halves(part), strict=True)
    return low, max(low, high)


def _rises(curve: Curve) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
    """Yield where a curve clipped to [0, 1] increases, and by how much."""
    slope = [power * c for power, c in enumerate(curve)][1:] or [Fraction(0)]
    for start, end in _positive(tuple(slope)):
        before, after = (_clipped(_value(curve, x)) for x in (start, end))
        if after > before:
            yield start, end, after - before


def _positive(curve: Curve) -> list[tuple[Fraction, Fraction]]:
    """Return the stretches of [0, 1] on which a polynomial may be above 0.

    On all others it is proved to be 0 or below. Each stretch ends within 2**-20 of
    where the polynomial is last above 0; stretches that touch are one.
    """
    found: list[tuple[Fraction, Fraction]] = []
    todo = [(Fraction(0), Fraction(1), bernstein(curve))]
    while todo:
        start, end, part = todo.pop()
        if max(part) <= 0:
            continue
        if min(part) < 0 and end - start > _SLIVER:
            middle = (start + end) / 2
            first, second = halves(part)
            todo += [(middle, end, second), (start, middle, first)]
        elif found and found[-1][1] == start:
            found[-1] = (found[-1][0], end)
        else:
            found.append((start, end))
    return found


def bernstein(curve: Curve) -> Curve:
    """Return the Bernstein coefficients on [0, 1] of a polynomial in powers.

    Their smallest and largest bound the polynomial on [0, 1]; the first and the last
    are its values at 0 and 1.

    Example:
        >>> bernstein((Fraction(0), Fraction(0), Fraction(1)))
        (Fraction(0, 1), Fraction(0, 1), Fraction(1, 1))
    """
    n = len(curve) - 1
    return tuple(
        sum(
            (
                Fraction(math.comb(k, j), math.comb(n, j)) * curve[j]
                for j in range(k + 1)
            ),
            Fraction(0),
        )
        for k in range(n + 1)
    )


def halves(part: Curve) -> tuple[Curve, Curve]:
    """Return the Bernstein coefficients on both halves (de Casteljau's scheme)."""
    first, second = [part[0]], [part[-1]]
    line = list(part)
    while len(line) > 1:
        line = [(a + b) / 2 for a, b in itertools.pairwise(line)]
        first.append(line[0])
        second.append(line[-1])
    return tuple(first), tuple(reversed(second))


def _value(curve: Curve, x: Fraction) -> Fraction:
    total = Fraction(0)
    for coefficient in reversed(curve):
        total = total * x + coefficient
    return total


def _substituted(curve: Curve, start: Fraction, step: Fraction) -> Curve:
    """Return the polynomial of s that the curve is at start + s * step."""
    total: list[Fraction] = [Fraction(0)]
    for coefficient in reversed(curve):
        total = _times(total, (start, step))
        total[0] += coefficient
    return tuple(total)


def _times(one: Sequence[Fraction], two: Sequence[Fraction]) -> list[Fraction]:
    product = [Fraction(0)] * (len(one) + len(two) - 1)
    for i, a in enumerate(one):
        for j, b in enumerate(two):
            product[i + j] += a * b
    return product


def _clipped(value: Fraction) -> Fraction:
    return min(max(value, Fraction(0)), Fraction(1))


def _rounded(low: Fraction, high: Fraction) -> NumberBounds:
    return NumberBounds(-outwards(-low)[1], outwards(high)[1])
