"""Intervals that hold exact degrees and strengths, in numpy: the oracle's filter.

Each function returns two doubles for each row between which the exact value lies. The
proof rests on the standard model of IEEE 754 doubles, fl(a op b) = (a op b)(1 + e) with
|e| <= U = 2**-53, where a product or quotient may besides be off by 2**-1075 because it
underflows (a sum or difference never is), and on three facts: rounding is monotone,
`clip` brings no two numbers further apart, and a computed difference has the sign of
the exact one, 0 included.

- **Value of a variable.** An input is exact. A combination of n parts carries at most
  n + 1 roundings in each summand, which makes (n + 1) U S, S the sum of the summands'
  sizes; `slack` is (n + 3) U S, for S is rounded itself.
- **Flank.** Difference, width and quotient make 3 U of the degree, and what x is off
  by, divided by the width, is added: without it the interval is as narrow as the degree
  is small.
- **Side.** u as above; t and v = 2 t - 1 pass on 4 U and 9 U. `t Q(v)` costs
  t ((2 n + 6) sum |c_k| + 9 sum k |c_k|) U, and 1 minus it one more. The tail's
  base w is off by 4 U w and by what u is off by over `reach - 1`; its ends are raised
  to the fourth power, in three roundings. It is exactly 1 where u is below 1 for sure.
- **Points.** The quotient and the product make 4 U |p - r|, the sum one rounding more;
  what x is off by counts with the steepest line.
- **Propositions and rules.** The larger or smaller of two intervals' ends is exact. `1
  - d` and products are moved outwards by their roundings.
- Where x is as close to a step as its slack, both sides of it are taken.
- Numbers below 2**-1000 are 0 as a lower end and 2**-1000 as an upper one, unless they
  are exactly 0: so no underflow can reach a result, and every other rounding is
  relative.

Each coefficient above is rounded up, and `_MORE` = 1 + 2**-20 covers products of
roundings and the rounding of the errors' own arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, assert_never

import numpy as np

from fuzzytree.model import (
    LR,
    Band,
    FloatArray,
    Points,
    Proposition,
    Shape,
    Side,
    Variable,
    checkpoint,
)

U = 2.0**-53
"""The unit roundoff of doubles."""

LEAST = 2.0**-1000
"""The smallest upper end of an interval that is not 0."""

_MORE = 1.0 + 2.0**-20
_CAP = 1.0 - U
_LARGEST = float(np.finfo(np.float64).max)


class EnclosedValue(NamedTuple):
    """The value of a variable in many rows.

    Attributes:
        x: As a chain of doubles gives it.
        slack: How far each may be from the exact one, at least `LEAST` (so that even
            the steepest slope that doubles can hold makes more than 1 of it); None if
            none is off.
    """

    x: FloatArray
    slack: FloatArray | None


class Enclosure(NamedTuple):
    """Intervals, closed at both ends, that hold exact numbers.

    Attributes:
        low: The lower ends, at least 0.
        high: The upper ends, at most 1.
    """

    low: FloatArray
    high: FloatArray


def filled_values(variables: Sequence[Variable], values: FloatArray) -> FloatArray:
    """Return rows with the stand-ins in the place of values that are not finite.

    `values` has shape (inputs, rows); it is returned as it is if nothing is replaced.

    Example:
        >>> filled_values([Variable("age", missing=30.0)], np.array([[7.0, np.nan]]))
        array([[ 7., 30.]])
    """
    known = [v.missing for v in variables if not v.parts]
    if not any(one is not None for one in known) or np.isfinite(values).all():
        return values
    stand = np.array([[np.nan if one is None else one] for one in known])
    replaced = ~np.isfinite(values) & np.isfinite(stand)
    filled: FloatArray = np.where(replaced, stand, values)
    return filled


def axis_value(variable: Variable, values: Mapping[str, FloatArray]) -> EnclosedValue:
    """Return the value of a variable by its chain of doubles, and how far it is off.

    Args:
        variable: An input or a combination.
        values: The rows' values of each input.
    """
    if not variable.parts:
        return EnclosedValue(values[variable.name], None)
    with np.errstate(all="ignore"):
        first, *others = (
            part.weight * (values[part.input] - part.centre) for part in variable.parts
        )
        total, size = first, np.abs(first)
        for term in others:
            total, size = total + term, size + np.abs(term)
        slack = size * ((len(variable.parts) + 3) * U * _MORE) + LEAST
        return EnclosedValue(total, np.minimum(slack, _LARGEST))


def degree_enclosure(shape: Shape, value: EnclosedValue) -> Enclosure:
    """Return intervals that hold the exact degrees of finite values.

    Example:
        >>> third = Band(0.0, 1.0, right=4.0)
        >>> value = EnclosedValue(np.array([1.0, 3.0]), None)
        >>> low, high = degree_enclosure(third, value)
        >>> float(low[0]), float(high[0]), bool(low[1] < 1 / 3 < high[1])
        (1.0, 1.0, True)
    """
    checkpoint()
    with np.errstate(all="ignore"):
        match shape:
            case Band():
                return _band(shape, value)
            case LR(mean=mean, left=left, right=right):
                below = _side(left, mean - value.x, value.slack)
                above = _side(right, value.x - mean, value.slack)
                return _merged(np.minimum, (below, above))
            case Points():
                return _points(shape, value)
        assert_never(shape)


def _band(band: Band, value: EnclosedValue) -> Enclosure:
    x, slack = value
    low, high = np.ones(x.shape), np.ones(x.shape)
    for bound, end, sign in ((band.low, band.left, -1), (band.high, band.right, 1)):
        if bound is None:
            continue
        gap = sign * (x - bound)
        surely = maybe = gap > 0.0 if sign > 0 else gap >= 0.0
        if slack is not None:
            surely, maybe = gap > slack, gap >= -slack
        found = _nothing(x) if end is None else _flank(bound, end, value)
        np.minimum(low, found.low, out=low, where=maybe)
        np.minimum(high, found.high, out=high, where=surely)
    return Enclosure(low, high)


def _nothing(x: FloatArray) -> Enclosure:
    return Enclosure(np.zeros(x.shape), np.zeros(x.shape))


def _flank(edge: float, end: float, value: EnclosedValue) -> Enclosure:
    x, slack = value
    span = edge - end
    away = np.copysign(1.0, span) * (x - end)
    degree = np.clip(away / abs(span), 0.0, 1.0)
    error = degree * (4 * U * _MORE) + LEAST
    is_zero = away <= 0.0
    if slack is not None:
        error += _MORE * np.minimum(slack / abs(span), 1.0)
        is_zero = away <= -slack
    high = np.clip(degree + error, 0.0, _CAP)
    high[is_zero] = 0.0
    return Enclosure(np.clip(degree - error, 0.0, _CAP), high)


def _side(side: Side, distance: FloatArray, slack: FloatArray | None) -> Enclosure:
    reach = side.reach
    far = np.minimum(distance / side.spread, _LARGEST)
    off: FloatArray | float = LEAST
    if slack is not None:
        off = np.minimum(slack / side.spread * _MORE + LEAST, _LARGEST)
    u = np.clip(far, 0.0, reach)
    error = u * (4 * U * _MORE) + off
    low, high = _body(side, np.minimum(u, 1.0), off)
    is_inner = u + error < 1.0
    near, beyond = _tail(reach, u, error)
    np.multiply(low, near, out=low, where=~is_inner)
    np.multiply(high, beyond, out=high, where=~is_inner)
    low = np.where(low < 1.0, low * (1.0 - 4 * U), low)
    high = np.minimum(high * (1.0 + 4 * U), 1.0)
    low[low < LEAST] = 0.0
    high = np.maximum(high, LEAST)
    is_zero = far * (1.0 - 8 * U) - off >= reach
    is_one = distance <= 0.0 if slack is None else distance <= -slack
    is_unknown = ~np.isfinite(distance)  # too far for doubles: nothing is claimed
    low[is_zero | is_unknown] = 0.0
    high[is_zero] = 0.0
    low[is_one] = high[is_one] = 1.0
    high[is_unknown] = 1.0
    return Enclosure(low, high)


def _body(side: Side, t: FloatArray, off: FloatArray | float) -> Enclosure:
    curve = side.curve
    size = sum(map(abs, curve))
    bend = sum(power * abs(c) for power, c in enumerate(curve))
    body = np.clip(1.0 - t * _horner(curve, 2.0 * t - 1.0), 0.0, 1.0)
    error = t * (((2 * len(curve) + 6) * size + 9 * bend) * U * _MORE)
    error += off * ((2 * bend + size) * _MORE)
    error += 2 * U * _MORE
    return Enclosure(np.maximum(body - error, 0.0), np.minimum(body + error, 1.0))


def _tail(reach: float, u: FloatArray, error: FloatArray) -> Enclosure:
    length = reach - 1.0
    w = np.clip((reach - u) / length, 0.0, 1.0)
    error = w * (5 * U * _MORE) + error / length * _MORE + LEAST
    low, high = np.maximum(w - error, 0.0), np.minimum(w + error, 1.0)
    low, high = low * low, high * high
    low, high = low * low * (1.0 - 8 * U), high * high * (1.0 + 8 * U)
    low[low < LEAST] = 0.0
    return Enclosure(low, np.clip(high, LEAST, 1.0))


def _points(points: Points, value: EnclosedValue) -> Enclosure:
    x, slack = value
    values, degrees = np.array(points.values), np.array(points.degrees)
    after = np.searchsorted(values, x, side="left")
    right = np.minimum(after, len(values) - 1)
    left = np.maximum(after - 1, 0)
    a, b, p, r = values[left], values[right], degrees[left], degrees[right]
    is_level = (p == r) | (x == b)
    share = np.where(is_level, 0.0, (x - b) / np.where(a < b, a - b, -1.0))
    degree = r + share * (p - r)
    error = share * np.abs(p - r) * (5 * U * _MORE) + (2 * U) * degree + LEAST
    low, high = np.minimum(p, r), np.maximum(p, r)
    if slack is None:
        error[is_level] = 0.0
    else:
        # On the level of the first or last point, or of a line, it stays exact.
        start = np.where(after > 0, a, -np.inf)
        end = np.where(after < len(values), b, np.inf)
        is_safe = (p == r) & (x - slack > start) & (x + slack <= end)
        error = np.where(is_safe, 0.0, error + _moved(points, x, slack))
        low[~is_safe], high[~is_safe] = degrees.min(), degrees.max()
    return Enclosure(
        np.clip(degree - error, low, high), np.clip(degree + error, low, high)
    )


def _moved(points: Points, x: FloatArray, slack: FloatArray) -> FloatArray:
    """Return how much a degree changes where x does by at most its slack."""
    values, degrees = np.array(points.values), np.array(points.degrees)
    width, height = np.diff(values), np.abs(np.diff(degrees))
    is_step = (width == 0.0) & (height > 0.0)
    steepest = np.max(height[width > 0.0] / width[width > 0.0], initial=0.0)
    slope = np.nextafter(min(float(steepest) * _MORE, _LARGEST), _LARGEST)
    moved = np.minimum(slack * slope, 1.0)
    first = np.searchsorted(values[1:][is_step], x - slack, side="left")
    last = np.searchsorted(values[1:][is_step], x + slack, side="right")
    return np.where(first < last, 1.0, moved)


def _horner(curve: Sequence[float], x: FloatArray) -> FloatArray:
    total = np.full(x.shape, curve[-1])
    for coefficient in reversed(curve[:-1]):
        total *= x
        total += coefficient
    return total


def proposition_enclosure(
    proposition: Proposition, terms: Sequence[Enclosure]
) -> Enclosure:
    """Return intervals that hold the exact degrees of a proposition.

    Args:
        proposition: The proposition.
        terms: Those of its terms' degrees, in its order.
    """
    low, high = _merged(np.maximum, terms)
    return _negated(low, high) if proposition.negated else Enclosure(low, high)


def _negated(low: FloatArray, high: FloatArray) -> Enclosure:
    """Return 1 minus an interval; the difference is exact from 1/2 on, and at 0."""
    below, above = 1.0 - high, 1.0 - low
    below = np.where((high == 0.0) | (high >= 0.5), below, below * (1.0 - 2 * U))
    above = np.where((low == 0.0) | (low >= 0.5), above, above * (1.0 + 2 * U))
    return Enclosure(below, np.minimum(above, 1.0))


def _merged(
    pick: Callable[[FloatArray, FloatArray], FloatArray], parts: Sequence[Enclosure]
) -> Enclosure:
    low, high = parts[0]
    for part in parts[1:]:
        low, high = pick(low, part.low), pick(high, part.high)
    return Enclosure(low, high)


def strength_enclosure(
    before: Enclosure, proposition: Enclosure, *, is_product: bool
) -> Enclosure:
    """Return intervals for the strength of propositions, with one more of them.

    Args:
        before: The strength of those before it.
        proposition: The degree of the next one.
        is_product: Whether AND is the product; the minimum otherwise.
    """
    if not is_product:
        return _merged(np.minimum, (before, proposition))
    low, high = before.low * proposition.low, before.high * proposition.high
    low = np.where(low < 1.0, low * (1.0 - 2 * U), low)
    high = np.minimum(high * (1.0 + 2 * U), np.minimum(before.high, proposition.high))
    low[low < LEAST] = 0.0
    is_zero = (before.high == 0.0) | (proposition.high == 0.0)
    return Enclosure(low, np.where(is_zero, 0.0, np.maximum(high, LEAST)))
