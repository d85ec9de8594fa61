"""Window counts (paper, 2.2.1), exact at the windows' edges.

S(k) counts the values in `[M + ((k - 1)/n) SD, M + ((k + 1)/n) SD]`, closed at both
ends as the paper prints it, so that neighbours overlap by half. A value x lies at step
`s = n (x - M) / SD`, and in the windows from `s - 1` to `s + 1`: in two of them, or in
three if s is a whole number. Mean and variance are quotients of whole numbers, so that
the floor of s is one too, although SD is a root: with N values of sum S and sum of
squares Q

    s^2 = n^2 (x N - S)^2 (N - 1) / (N (N Q - S^2)),

whose whole root is found in integers wherever floating point cannot decide.
"""

from __future__ import annotations

import math

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
