"""Polynomials of a lower degree in the place of others, as close as they can be."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.numerics.curves import derivative, distance, lowest, values_at

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

_GRID = 512  # places at which a fit is looked at
_EXCHANGES = 200  # of places in a fit, at most
_MOST = 1e6  # of a fit's coefficients together; see `rulebase.Flank`
_OVER = 0.25  # how far a fit first follows a curve beyond its limits
_REFITS = 6  # of a clipped curve


def curve_error(p: FloatArray, r: FloatArray, last: float, top: float) -> float:
    """Return a bound of the difference of two polynomials on [0, last], clipped.

    Args:
        p: c0, c1, ...
        r: The same of the other one.
        last: Up to where.
        top: The upper limit of both; the lower one is 0.
    """
    start, end = np.zeros(1), np.array([last])
    return distance(start, end, p.reshape(-1, 1), r.reshape(-1, 1), top)


def lower_curve(p: FloatArray, degree: int, last: float, top: float) -> FloatArray:
    """Return a polynomial of at most a degree that is close to another one, clipped.

    Both are 0 at 0. If p never falls on [0, last], clipped, neither does the result,
    for a straight line is mixed in, as little as it takes. What p does beyond its
    limits is of no account, but it may be easier to follow a little further: the best
    of several fits is taken, of lower degrees too where a line had to be mixed in.

    Args:
        p: c0 = 0, c1, ...
        degree: From 1 to 8, below that of p.
        last: Up to where; above 0.
        top: Where p is clipped.

    Example:
        >>> lower_curve(np.array([0.0, 0.0, 1.0]), 1, 1.0, 1.0).round(3).tolist()
        [0.0, 0.828]
    """
    grid = last * (1.0 - np.cos(np.pi * np.arange(1, _GRID + 1) / _GRID)) / 2.0
    powers = grid.reshape(-1, 1) ** np.arange(1, len(p))
    height = powers @ p[1:]
    goal = np.clip(height, 0.0, top)
    is_rising = bool((np.diff(goal) >= 0).all())
    best, least = np.zeros(degree + 1), math.inf
    for size in range(degree, 0, -1):
        is_plain = True
        for fit in _fits(powers[:, :size], height, top):
            found = np.concatenate([[0.0], fit, np.zeros(degree - size)])
            if is_rising:
                risen = _risen(found, last, top, float(goal[-1]))
                is_plain &= risen is found
                found = risen
            reached = powers[:, :degree] @ found[1:]
            error = float(np.abs(np.clip(reached, 0.0, top) - goal).max())
            if error < least and np.abs(found).sum() <= _MOST:
                best, least = found, error
        if is_plain:
            break
    return best


def _fits(powers: FloatArray, height: FloatArray, top: float) -> Iterator[FloatArray]:
    """Yield c1, c2, ... of fits that differ in what they do where a curve is clipped.

    The first follows the clipped curve, the second the curve. For the others the goal
    beyond a limit is the fit before, as far as that is beyond the limit too; so what is
    left of the error can only become less.
    """
    yield _exchange(powers, np.clip(height, 0.0, top))
    if height.max() <= top and height.min() >= 0.0:
        return
    yield _exchange(powers, height)
    fit = _exchange(powers, np.clip(height, -_OVER, top + _OVER))
    for _ in range(_REFITS):
        yield fit
        reached = powers @ fit
        goal = np.where(height >= top, np.maximum(reached, top), height)
        goal = np.where(height <= 0.0, np.minimum(reached, 0.0), goal)
        fit = _exchange(powers, goal)


def _risen(found: FloatArray, last: float, top: float, height: float) -> FloatArray:
    """Return a polynomial that never falls where it is clipped, by mixing a line in."""
    c = found.reshape(-1, 1)
    grid = np.linspace(0.0, last, _GRID + 1)
    above = np.flatnonzero(values_at(c, grid) >= top)
    end = float(grid[above[0]]) if len(above) else last
    is_kept = end == last or lowest(c, last, first=end) >= top
    fall = lowest(derivative(c), end if is_kept else last)
    slope = height / last
    if fall >= 0.0 or slope <= 0.0:
        return found
    fall -= 2.0**-30 * slope  # for the rounding of the mixture
    share = -fall / (slope - fall)
    mixed = (1.0 - share) * found
    mixed[1] += share * slope
    return mixed


def _exchange(powers: FloatArray, goal: FloatArray) -> FloatArray:
    """Return c1, c2, ... with the least largest error at some places.

    On a reference of one place more than there are coefficients the best fit has errors
    of equal size and alternating sign; the place of the largest error takes that of a
    neighbour of its own sign, until there is none larger.

    Args:
        powers: z, z**2, ... of each place, of shape (places, coefficients).
        goal: What to fit.
    """
    places, degree = powers.shape
    ends = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    reference = ((1.0 - ends) / 2.0 * (places - 1)).astype(np.int64)
    sign = (-1.0) ** np.arange(degree + 1)
    found: FloatArray = np.zeros(degree)
    for _ in range(_EXCHANGES):
        system = np.column_stack([powers[reference], sign])
        try:
            solved: FloatArray = np.linalg.solve(system, goal[reference]).astype(float)
        except np.linalg.LinAlgError:
            break  # so close to 0 that doubles cannot tell powers apart
        if not np.isfinite(solved).all():
            break
        found, level = solved[:-1], float(solved[-1])
        error = goal - powers @ found
        worst = int(np.argmax(np.abs(error)))
        if abs(error[worst]) <= abs(level) * (1.0 + 2.0**-10) + 2.0**-50:
            break
        reference = _exchanged(reference, error, worst)
    return found


def _exchanged(reference: IntArray, error: FloatArray, worst: int) -> IntArray:
    """Return the reference with the worst place in it, its signs still alternating."""
    place = int(np.searchsorted(reference, worst))
    is_up = error[worst] > 0
    found = reference.copy()
    if place == 0 and (error[reference[0]] > 0) != is_up:
        found[1:] = reference[:-1]
        found[0] = worst
    elif place == len(reference) and (error[reference[-1]] > 0) != is_up:
        found[:-1] = reference[1:]
        found[-1] = worst
    else:
        below = max(place - 1, 0)
        near = below if (error[reference[below]] > 0) == is_up else place
        found[min(near, len(reference) - 1)] = worst
    return found
