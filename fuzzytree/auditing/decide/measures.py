"""Measures of degrees along an axis: heights, dips, areas, overlaps, distances.

All are taken from functions of straight lines (`lines`): exact for bands and points,
between two bounds for curves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from operator import itemgetter
from typing import Final, NamedTuple

import numpy as np

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.lines import (
    Between,
    Lines,
    at_knots,
    combine,
    lines_of,
    together,
)
from fuzzytree.model import FloatArray, MembershipFunction

_CELLS: Final = 256  # on which areas are bounded before they are worked out
_SLACK: Final = 1e-9  # for what rounding takes, on a range of length 1


class Bounds(NamedTuple):
    """Two numbers between which one lies; it is known exactly if they are equal."""

    low: Fraction
    high: Fraction


def integral(lines: Lines) -> Fraction:
    """Return the area under lines."""
    return sum(((b - a) * (p + q) / 2 for a, b, p, q in lines.pieces()), start=ZERO)


def area(of: Between) -> Bounds:
    """Return the area under a function."""
    return Bounds(integral(of.lower), integral(of.upper))


def height(of: Between) -> tuple[Bounds, Fraction]:
    """Return the supremum of a function, and the first place where it is near.

    Example:
        >>> from fuzzytree.model import Points
        >>> height(lines_of(Points((0.0, 2.0), (0.0, 1.0)), ZERO, ONE))[0].low
        Fraction(1, 2)
    """
    values = [(degree, -x) for x, _, degree in _walk(of)]
    low, at = max(values)
    return Bounds(low, low if of.is_exact else of.upper.highest), -at


Dip = tuple[tuple[Fraction, Fraction], ...]
"""A peak, the valley behind it and the peak behind that: places and degrees."""


def dips(of: Between, least: Fraction) -> list[Dip]:
    """Return where a function falls and rises again, by at least some amount above 0.

    Example:
        >>> from fuzzytree.model import Points
        >>> zigzag = Points((0.0, 1.0, 2.0, 3.0), (0.0, 1.0, 0.25, 0.5))
        >>> made = dips(lines_of(zigzag, ZERO, Fraction(9)), Fraction(1, 8))
        >>> [[int(x) for x, _ in dip] for dip in made]
        [[1, 2, 3]]
    """
    places = [(x, degree) for x, _, degree in _walk(of)]
    turns = places[:1]  # a peak, a valley, a peak and so on
    for place in places[1:]:
        rise = place[1] - turns[-1][1]
        farther = rise if len(turns) % 2 else -rise
        if farther > 0:
            turns[-1] = place
        elif -farther >= least:
            turns.append(place)
    return [*zip(turns[::2], turns[1::2], turns[2::2], strict=False)]


def _walk(of: Between) -> list[tuple[Fraction, int, Fraction]]:
    """Return degrees from left to right; where it is exact also limits at jumps."""
    values = [(x, 1, degree) for x, degree in zip(of.lower.x, of.lower.at, strict=True)]
    if of.is_exact:
        for a, b, p, q in of.lower.pieces():
            values += [(a, 2, p), (b, 0, q)]
    return sorted(values)


# --- two functions


class Overlap(NamedTuple):
    """How much two functions share."""

    jaccard: Bounds  # the area under both over the area under either
    possibility: Bounds  # the supremum of their minimum
    crossing: tuple[Fraction, Fraction] | None  # the highest: the degree, the place
    is_within: bool  # whether the first is nowhere above the second
    is_around: bool  # whether the first is nowhere below the second


def overlap(first: Between, second: Between) -> Overlap | None:
    """Return how much two functions share, None if they have no area.

    Example:
        >>> from fuzzytree.model import Points
        >>> ramps = (Points((0.0, 1.0), ends) for ends in ((1.0, 0.0), (0.0, 1.0)))
        >>> result = overlap(*(lines_of(ramp, ZERO, ONE) for ramp in ramps))
        >>> result.jaccard.low, result.possibility.low
        (Fraction(1, 3), Fraction(1, 2))
    """
    lower = upper = combine([first.lower, second.lower], min)
    if not (first.is_exact and second.is_exact):
        upper = combine([first.upper, second.upper], min)
    shared = area(Between(lower, upper))
    sums = map(sum, zip(area(first), area(second), strict=True))
    least, most = (both - part for both, part in zip(sums, shared, strict=True))
    if least <= 0:
        return None
    return Overlap(
        Bounds(shared.low / most, min(shared.high / least, ONE)),
        height(Between(lower, upper))[0],
        _order_change(first.lower, second.lower),
        first == second or all(gap <= 0 for gap, _ in _gaps(first.upper, second.lower)),
        first == second or all(gap <= 0 for gap, _ in _gaps(second.upper, first.lower)),
    )


def _order_change(first: Lines, second: Lines) -> tuple[Fraction, Fraction] | None:
    """Return the highest place where two functions change their order."""
    places: list[tuple[Fraction, Fraction]] = []
    order, last = ZERO, (ZERO, ZERO)
    for a, b, p, q, r, s in together(first, second):
        events = [(p - r, p, a), (q - s, q, b)]
        if (p - r) * (q - s) < 0:
            share = (p - r) / (p - r - q + s)
            events.insert(1, (ZERO, p + (q - p) * share, a + (b - a) * share))
        for gap, *place in events:
            if gap * order < 0:
                places.append(last)
            order, last = gap or order, (place[0], place[1])
    return max(places, key=itemgetter(0), default=None)


def most_overlap(curves: Sequence[Between]) -> FloatArray:
    """Return bounds from above of the shared by the joined area of each two functions.

    On a cell two share no more than the smaller of their areas, and join no less than
    the larger one. It is 1 where nothing is known.
    """
    least, most = (
        np.array([_cell_areas(of[side]) for of in curves]) for side in (0, 1)
    )
    result = np.ones((len(curves), len(curves)))
    for place in range(len(curves)):
        shared = np.minimum(most, most[place]).sum(axis=1) + _SLACK
        joined = np.maximum(least, least[place]).sum(axis=1) - _SLACK
        np.divide(shared, joined, out=result[place], where=joined > _SLACK)
    return np.minimum(result, 1.0)


def _cell_areas(lines: Lines) -> FloatArray:
    """Return the area under lines on each of some cells, as if their range were 1."""
    low, width = lines.x[0], lines.x[-1] - lines.x[0]
    if not width:
        return np.zeros(_CELLS)
    x = np.array([float((knot - low) / width) for knot in lines.x])
    p, q = (np.array([*map(float, ends)]) for ends in (lines.after, lines.before))
    size = np.diff(x)
    start = np.append(0.0, np.cumsum(size * (p + q) / 2.0))
    edges = np.linspace(0.0, 1.0, _CELLS + 1)
    k = np.searchsorted(x[1:-1], edges, side="right")
    part = (edges - x[k]) / np.maximum(size[k], 1e-300)
    return np.diff(start[k] + (edges - x[k]) * (p[k] + (q[k] - p[k]) * part / 2.0))


class CurveDistance(NamedTuple):
    """The largest difference of two functions."""

    low: Fraction  # it is at least this
    high: Fraction  # it is at most this
    at: Fraction  # where it is reached, or approached


def curve_distance(
    first: MembershipFunction, second: MembershipFunction, low: Fraction, high: Fraction
) -> CurveDistance:
    """Return how far two membership functions are apart at most between two ends.

    Example:
        >>> from fuzzytree.model import Points
        >>> steep, slow = (Points((0.0, end), (0.0, 1.0)) for end in (1.0, 2.0))
        >>> [str(x) for x in curve_distance(steep, slow, Fraction(0), Fraction(4))]
        ['1/2', '1/2', '1']
    """
    mine, rival = (lines_of(of, low, high) for of in (first, second))
    least = (*_gaps(mine.lower, rival.upper), *_gaps(rival.lower, mine.upper))
    most = (*_gaps(mine.upper, rival.lower), *_gaps(rival.upper, mine.lower))
    largest, at = max(most, key=itemgetter(0))
    return CurveDistance(max(ZERO, *(gap for gap, _ in least)), largest, at)


def _gaps(first: Lines, second: Lines) -> Iterator[tuple[Fraction, Fraction]]:
    """Yield by how much a function is above another one, where that can be most."""
    yield from ((value - rival, x) for x, value, rival in at_knots(first, second))
    for a, b, p, q, r, s in together(first, second):
        yield p - r, a
        yield q - s, b
