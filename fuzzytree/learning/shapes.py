"""Window counts and the fuzzy sets that are fitted to them (paper, 2.2).

S(k) counts the values in `[M + ((k - 1)/n) SD, M + ((k + 1)/n) SD]`, closed at both
ends as the paper prints it, so that neighbours overlap by half. A value x lies at step
`s = n (x - M) / SD`, and in the windows from `s - 1` to `s + 1`: in two of them, or in
three if s is a whole number. Mean and variance are quotients of whole numbers, so that
the floor of s is one too, although SD is a root: with N values of sum S and sum of
squares Q

    s^2 = n^2 (x N - S)^2 (N - 1) / (N (N Q - S^2)),

whose whole root is found in integers wherever floating point cannot decide.

A set's polynomial goes through the centre, where the degree is 1, and n points on each
side. With `t = u` within one spread and `v = 2 t - 1` the degree is `1 - t Q(v)`, so
the n coefficients of Q solve `Q(v_k) = (1 - degree_k) / t_k`: exact interpolation, in a
basis that keeps its digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from fuzzytree.learning.sums import Totals, whole
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray

_SLACK = 16 * 2.0**-52
"""What a step may be wrong by, relative to what it is made of; it is by less."""

_SMALLEST = 2.0**-900
"""A spread below this, in units of the largest value, has lost digits."""


def window_counts(
    values: FloatArray, groups: IntArray, totals: Totals, n: int
) -> IntArray:
    """Return S(k) for k = -n..n.

    Where all values of a group are equal they lie in the middle of any window around
    them, so they count in S(-1), S(0) and S(1).

    Args:
        values: One axis, shape (rows,); whole multiples of the totals' unit.
        groups: The group of each row.
        totals: The exact sums of the groups, of these values or of more.
        n: Windows on each side.

    Returns:
        Integers of shape (groups, 2n + 1).

    Example:
        >>> from fuzzytree.learning.sums import totals_of
        >>> values, groups = np.array([-1.0, 0.0, 1.0]), np.zeros(3, np.int64)
        >>> window_counts(values, groups, totals_of(values, groups, 1), 2).tolist()
        [[1, 2, 1, 2, 1]]
    """
    size = len(totals.counts)
    floors, is_whole = _steps(values, groups, totals, n)
    width = 2 * n + 4  # floors from -n - 1 to n + 1, and one place for all others
    place = np.clip(floors + n + 1, -1, width - 1) + groups * width
    inside = (floors >= -n - 1) & (floors <= n + 1)
    counts = np.bincount(place[inside], minlength=size * width).reshape(size, width)
    inside &= is_whole
    edges = np.bincount(place[inside], minlength=size * width).reshape(size, width)
    first = np.arange(2 * n + 1)  # the place of k - 1
    found: IntArray = counts[:, first] + counts[:, first + 1] + edges[:, first + 2]
    return found


def _steps(
    values: FloatArray, groups: IntArray, totals: Totals, n: int
) -> tuple[IntArray, BoolArray]:
    """Return the floor of each value's step, and whether the step is whole.

    A step is off by a few units of the last place of M / SD (mean and difference are
    rounded) and of its own; where a whole number is that near, integers decide.
    """
    exponent = max(
        math.frexp(float(np.abs(values).max(initial=0.0)))[1], totals.exponent
    )
    mean = totals.means(exponent=exponent)[groups]
    spread = totals.spreads(exponent)[groups]
    is_equal = np.array([totals.variance(g) == 0 for g in range(len(totals.counts))])
    is_clear = ~is_equal[groups] & (spread >= _SMALLEST)
    safe = np.where(is_clear, spread, 1.0)
    moved = np.where(is_clear, np.ldexp(values, -exponent) - mean, 0.0)
    with np.errstate(over="ignore"):
        steps = np.clip(moved / safe * n, -n - 3.5, n + 3.5)
        doubt = _SLACK * (np.abs(mean) / safe * n + np.abs(steps))
    floors: IntArray = np.floor(steps).astype(np.int64)
    is_whole = is_equal[groups]
    is_clear &= np.abs(steps - np.rint(steps)) > doubt
    known: dict[tuple[int, float], tuple[int, bool]] = {}
    for row in np.flatnonzero(~is_clear & ~is_whole).tolist():
        key = int(groups[row]), float(values[row])
        if key not in known:
            known[key] = _exact_step(key[1], key[0], totals, n)
        floors[row], is_whole[row] = known[key]
    return floors, is_whole


def _exact_step(value: float, group: int, totals: Totals, n: int) -> tuple[int, bool]:
    """Return the floor of a value's step and whether it is whole, by integers."""
    count = totals.counts[group]
    apart = whole(value, totals.unit) * count - totals.sums[group]
    top = n * n * apart * apart * (count - 1)
    bottom = count * totals.variance(group)
    root = math.isqrt(top // bottom)
    is_whole = root * root * bottom == top
    return root if apart >= 0 else -root - (not is_whole), is_whole


REACH = 5.0
"""Where a set's tail ends, in spreads."""

_SAMPLES = 33  # places at which a polynomial is looked at

_TOLERANCE = 1e-9


@dataclass(frozen=True)
class SetRepairs:
    """How often the data departed from what the paper assumes of it.

    Attributes:
        off_peak: Sets in which some S(k) is larger than S(0).
        empty_centre: Sets whose S(0) is 0; the largest S(k) stands in.
        clipped: Points above 1, set to 1.
        lowered: Points above an inner neighbour, lowered to it.
        overshooting: Sides whose polynomial leaves [0, 1] between its points.
        rising: Sides whose polynomial rises somewhere.
    """

    off_peak: int = 0
    empty_centre: int = 0
    clipped: int = 0
    lowered: int = 0
    overshooting: int = 0
    rising: int = 0


@dataclass(frozen=True)
class FittedSets:
    """LR sets on one axis, one for each pattern.

    Attributes:
        means: Shape (patterns,).
        spreads: Shape (patterns,); above 0.
        left: Coefficients of Q below the mean, shape (patterns, n).
        right: The same above the mean.
        repairs: What had to be repaired.
    """

    means: FloatArray
    spreads: FloatArray
    left: FloatArray
    right: FloatArray
    repairs: SetRepairs

    def degrees(self, chosen: IntArray, points: FloatArray) -> FloatArray:
        """Return the degree of some sets at each point, shape (chosen, points)."""
        with np.errstate(over="ignore"):  # so far away is beyond the reach anyway
            u = (points - self.means[chosen, None]) / self.spreads[chosen, None]
        below = _side(-u, self.left[chosen])
        return np.minimum(below, _side(u, self.right[chosen]))


def _side(u: FloatArray, curve: FloatArray) -> FloatArray:
    u = np.clip(u, 0.0, REACH)
    t = np.minimum(u, 1.0)
    v = 2.0 * t - 1.0
    total = np.broadcast_to(curve[:, -1:], u.shape)
    for k in range(curve.shape[1] - 2, -1, -1):
        total = total * v + curve[:, k : k + 1]
    w = np.clip((REACH - u) / (REACH - 1.0), 0.0, 1.0)
    w *= w
    return np.clip(1.0 - t * total, 0.0, 1.0) * (w * w)


def fitted_sets(
    means: FloatArray,
    spreads: FloatArray,
    counts: IntArray,
    *,
    separate_sides: bool,
    keeps_flaws: bool,
) -> FittedSets:
    """Fit LR sets to window counts.

    Args:
        means: M of each pattern.
        spreads: SD of each pattern, above 0.
        counts: S(-n) to S(n), shape (patterns, 2n + 1).
        separate_sides: Whether left and right are fitted apart; else their mean is.
        keeps_flaws: Whether a polynomial that leaves [0, 1] or rises stays, as in the
            paper; else a line to its last point replaces it.
    """
    n = (counts.shape[1] - 1) // 2
    centre = counts[:, n].astype(np.float64)
    largest = counts.max(axis=1).astype(np.float64)
    base = np.where(centre > 0, centre, np.maximum(largest, 1.0))[:, None]
    right = counts[:, n + 1 :] / base
    left = counts[:, n - 1 :: -1] / base if n > 0 else right
    if not separate_sides:
        left = right = (left + right) / 2.0
    sides = [left] if not separate_sides else [left, right]
    clipped = sum(int(np.count_nonzero(side > 1.0)) for side in sides)
    lowered = 0
    curves: list[FloatArray] = []
    overshooting = rising = 0
    for side in sides:
        points = np.minimum(side, 1.0)
        falling = np.minimum.accumulate(points, axis=1)
        lowered += int(np.count_nonzero(points > falling))
        curve = _interpolated(falling)
        over, up = _flaws(curve)
        overshooting += int(np.count_nonzero(over))
        rising += int(np.count_nonzero(up))
        if not keeps_flaws:
            straight = np.zeros_like(curve)
            straight[:, 0] = 1.0 - falling[:, -1]
            curve = np.where((over | up)[:, None], straight, curve)
        curves.append(curve)
    repairs = SetRepairs(
        off_peak=int(np.count_nonzero(largest > centre)),
        empty_centre=int(np.count_nonzero(centre == 0)),
        clipped=clipped,
        lowered=lowered,
        overshooting=overshooting,
        rising=rising,
    )
    return FittedSets(means, spreads, curves[0], curves[-1], repairs)


def _interpolated(degrees: FloatArray) -> FloatArray:
    """Return the coefficients of Q through the degrees at k/n, k = 1..n."""
    n = degrees.shape[1]
    wanted = (1.0 - degrees) / (np.arange(1, n + 1) / n)
    curve = np.zeros(degrees.shape)
    # In a fixed order, so that every machine has the same last digits.
    for k, column in enumerate(_inverse(n)):
        curve += wanted[:, k : k + 1] * column
    return curve


def _inverse(n: int) -> FloatArray:
    """Return the coefficients of the polynomials in v that are 1 at one `v_k` only.

    Row k belongs to `v_k = 2 k/n - 1`; its numbers are rational and rounded once.
    """
    places = [Fraction(2 * k, n) - 1 for k in range(1, n + 1)]
    rows: list[list[float]] = []
    for own in places:
        product = [Fraction(1)]
        for other in places:
            if other != own:
                shifted = [Fraction(0), *product]
                lowered = [*(c * other for c in product), Fraction(0)]
                product = [
                    (a - b) / (own - other)
                    for a, b in zip(shifted, lowered, strict=True)
                ]
        rows.append([float(c) for c in product])
    return np.array(rows)


def _flaws(curve: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return which polynomials leave [0, 1], and which rise."""
    t = np.linspace(0.0, 1.0, _SAMPLES)
    powers = np.vander(2.0 * t - 1.0, curve.shape[1], increasing=True)
    values = 1.0 - t * (curve @ powers.T)
    out = (values < -_TOLERANCE) | (values > 1.0 + _TOLERANCE)
    up = np.diff(values, axis=1) > _TOLERANCE
    return np.asarray(out.any(axis=1)), np.asarray(up.any(axis=1))
