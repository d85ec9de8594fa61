"""Measures of membership functions on a range: heights, areas, overlaps, dips.

All are taken from straight lines (`lines`): exact for bands and points, between two
bounds for functions that are enclosed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np

from fuzzytree.auditing.decide.lines import (
    Between,
    Lines,
    at_knots,
    combined,
    lines_of,
    together,
)
from fuzzytree.auditing.engine.pieces import ONE, ZERO, pieces, shape_ranges
from fuzzytree.auditing.engine.polynomials import value_at
from fuzzytree.model import FloatArray, Shape, checkpoint


class Bounds(NamedTuple):
    """Two numbers between which one lies; it is known exactly if they are equal."""

    low: Fraction
    high: Fraction

    @property
    def nearest(self) -> float:
        """The double nearest to the middle."""
        return float((self.low + self.high) / 2)

    @property
    def exact(self) -> str | None:
        """The number as `p/q`, None if it is not known exactly."""
        return str(self.low) if self.low == self.high else None


CurveValue = tuple[Bounds, Fraction]
"""A value, and a point where a curve has it or comes near it."""


class CurveAxis(NamedTuple):
    """Membership functions on a range."""

    curves: tuple[Between, ...]
    ends: tuple[Fraction, Fraction]  # the lower and the upper end
    is_open: bool = False  # whether the lower end itself is left out

    @property
    def pieces(self) -> int:
        """How many straight lines there are."""
        return sum(max(len(one.lower.after), 1) for one in self.curves)


def curve_axis(
    shapes: Sequence[Shape], low: Fraction, high: Fraction, *, is_open: bool = False
) -> CurveAxis:
    """Return membership functions on a range.

    Raises:
        ValueError: If `low` is above `high`.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = Points((0.0, 2.0), (0.0, 1.0))
        >>> result = curve_axis([ramp], Fraction(-1), Fraction(1))
        >>> tuple(map(int, result.ends))
        (-1, 1)
    """
    if low > high:
        raise ValueError(f"no axis from {low} to {high}")
    curves = tuple(lines_of(shape, low, high) for shape in shapes)
    return CurveAxis(curves, (low, high), is_open and low < high)


def integral(lines: Lines) -> Fraction:
    """Return the area under lines.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = curve_axis([Points((0.0, 2.0), (0.0, 1.0))], ZERO, Fraction(3))
        >>> integral(ramp.curves[0].lower)
        Fraction(2, 1)
    """
    return sum(((b - a) * (p + q) / 2 for a, b, p, q in lines.pieces()), start=ZERO)


def area(of: Between) -> Bounds:
    """Return the area under a membership function on its range."""
    low = integral(of.lower)
    return Bounds(low, low if of.is_exact else integral(of.upper))


def heights(of: CurveAxis) -> tuple[CurveValue, ...]:
    """Return the supremum of each function on a range, and a point where it is near.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = curve_axis([Points((0.0, 2.0), (0.0, 1.0))], ZERO, ONE)
        >>> heights(ramp)[0][0].exact
        '1/2'
    """
    return tuple(_height(of, one) for one in range(len(of.curves)))


def _height(of: CurveAxis, one: int) -> CurveValue:
    lower, upper = of.curves[one]
    if of.curves[one].is_exact:
        return max(walk(of, one), key=lambda value: value[0].low)
    start = int(of.is_open)
    low, at = max(zip(lower.at[start:], lower.x[start:], strict=True))
    return Bounds(low, max(low, upper.highest)), at


def walk(of: CurveAxis, one: int) -> Iterator[CurveValue]:
    """Yield a function's values from left to right; at a step both, with its point.

    Between neighbours it is one line, or close to one where it is enclosed.
    """
    lower, upper = of.curves[one]
    last: CurveValue | None = None
    for place, x in enumerate(lower.x):
        values = [] if of.is_open and not place else [(lower.at, upper.at, place)]
        if of.curves[one].is_exact:  # limits; those of an enclosure are no values
            if place:
                values.insert(0, (lower.before, lower.before, place - 1))
            if place < len(lower.after):
                values.append((lower.after, lower.after, place))
        for low, high, number in values:
            value = Bounds(low[number], high[number]), x
            if value != last:
                yield value
            last = value


# --- overlap of two membership functions

_CELLS: Final = 256  # on which degrees are enclosed before areas are worked out


class Overlap(NamedTuple):
    """How much two curves share on a line."""

    shared: Bounds  # the area under both, the integral of their minimum
    joined: Bounds  # the area under either, the integral of their maximum
    possibility: Bounds  # the supremum of their minimum
    at: Fraction  # A point near where it is reached
    # points at which they cross, each with the degree there
    crossings: tuple[tuple[Fraction, Bounds], ...]
    is_within: bool  # whether the first is nowhere above the second
    is_around: bool  # whether the first is nowhere below the second

    @property
    def jaccard(self) -> Bounds | None:
        """The shared area over the joined area; None if that may be 0."""
        if self.joined.low <= 0:
            return None
        high = self.shared.high / self.joined.low
        return Bounds(self.shared.low / self.joined.high, min(high, ONE))


def overlap(of: CurveAxis) -> Overlap:
    """Return how much the two membership functions of a range share.

    Raises:
        ValueError: If there are not two.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> down, up = (Points((0.0, 1.0), ends) for ends in ((1.0, 0.0), (0.0, 1.0)))
        >>> from fuzzytree.auditing.engine.measures import curve_axis
        >>> result = overlap(curve_axis([down, up], Fraction(0), Fraction(1)))
        >>> result.jaccard.exact, result.possibility.exact
        ('1/3', '1/2')
    """
    if len(of.curves) != 2:
        raise ValueError(f"two curves overlap, not {len(of.curves)}")
    one, other = of.curves
    least, most = (
        Between(*(combined([one[side], other[side]], pick) for side in (0, 1)))
        for pick in (min, max)
    )
    possibility, at = _height(CurveAxis((_same(least),), of.ends, of.is_open), 0)
    return Overlap(
        area(least),
        area(most),
        possibility,
        at,
        tuple(_crossings(one.lower, other.lower)),
        one == other or _is_within(one.upper, other.lower, of.is_open),
        one == other or _is_within(other.upper, one.lower, of.is_open),
    )


def _same(of: Between) -> Between:
    """Return bounds as one function where they are the same."""
    return Between(of.lower, of.lower) if of.lower == of.upper else of


def _is_within(one: Lines, other: Lines, is_open: bool) -> bool:
    """Return whether a function is nowhere above another one."""
    values = [(a, b) for _, a, b in at_knots(one, other)][is_open:]
    return all(a <= b for a, b in values) and all(
        p <= r and q <= s for _, _, p, q, r, s in together(one, other)
    )


def most_shared(shapes: Sequence[Shape], low: float, high: float) -> FloatArray:
    """Return bounds from above of the shared by the joined area of each two curves.

    Degrees are enclosed on each of some cells, so nothing is left to chance; only what
    comes near to an answer is worth the exact areas.

    Returns:
        Shape (shapes, shapes); 1 where nothing is known.
    """
    width = (high - low) / _CELLS
    if not width > 1e-6 * max(abs(low), abs(high)):
        return np.ones((len(shapes), len(shapes)))
    edges = np.linspace(low, high, _CELLS + 1, dtype=np.float64)
    cells = [shape_ranges(shape, edges)[1] for shape in shapes]
    least = np.array([one.low for one in cells])
    most = np.array([one.high for one in cells])
    result = np.ones((len(shapes), len(shapes)))
    for place in range(len(shapes)):
        shared = np.minimum(most, most[place]).sum(axis=1)
        joined = np.maximum(least, least[place]).sum(axis=1)
        # Edges and sums are off by roundings, which are far below this.
        result[place] = (shared + 1e-6) / np.maximum(joined - 1e-6, 1e-12)
    return np.minimum(result, 1.0)


def _crossings(one: Lines, other: Lines) -> Iterator[tuple[Fraction, Bounds]]:
    """Yield where two functions change their order, with the degree there."""
    before, since, value = 0, ZERO, ZERO
    for a, b, p, q, r, s in together(one, other):
        orders = [(p - r, a, p)]
        if (p - r) * (q - s) < 0:
            share = (p - r) / (p - r - q + s)
            orders.append((ZERO, a + (b - a) * share, p + (q - p) * share))
        for gap, x, degree in (*orders, (q - s, b, q)):
            order = (gap > 0) - (gap < 0)
            if order and before and order != before:
                yield since, Bounds(value, value)
            if order:
                before, since, value = order, x, degree
            else:
                since, value = x, degree


# --- dips and clipping


def dips(
    values: Sequence[CurveValue], least: Fraction
) -> Iterator[tuple[CurveValue, CurveValue, CurveValue]]:
    """Yield where a walk falls and rises again by at least some amount.

    `least`: the least depth that counts, above 0.

    Yields:
        The peak before, the valley, and the peak behind it.

    Example:
        >>> from fuzzytree.auditing.engine.measures import Bounds
        >>> walked = [(Bounds(Fraction(v), Fraction(v)), Fraction(k))
        ...           for k, v in enumerate((0, 3, 1, 2, 0))]
        >>> [[int(at) for _, at in dip] for dip in dips(walked, Fraction(1, 2))]
        [[1, 2, 3]]
    """
    before: CurveValue | None = None
    peak = valley = bottom = values[0]
    is_rising = True
    for value in values:
        height = value[0].low
        if is_rising:
            if height > peak[0].low:
                peak = value
            elif peak[0].low - height >= least:
                if before is not None:
                    yield before, bottom, peak
                before, valley, is_rising = peak, value, False
        elif height < valley[0].low:
            valley = value
        elif height - valley[0].low >= least:
            bottom, peak, is_rising = valley, value, True
    if is_rising and before is not None:
        yield before, bottom, peak


_SAMPLES: Final = 256  # of each piece


def excesses(shape: Shape, low: Fraction, high: Fraction) -> Iterator[Excess]:
    """Yield where a shape's polynomials leave [0, 1] before they are clipped.

    Each piece is evaluated in fractions at some values, evenly apart.

    Example:
        >>> from fuzzytree.model.rulebase import LR, Side
        >>> side = Side(1.0, (0.25, 0.75))
        >>> [(round(float(e.depth), 3), e.is_above)
        ...  for e in excesses(LR(0.0, side, side), Fraction(0), Fraction(3))]
        [(0.042, True)]
    """
    for piece in pieces(shape):
        if piece.low is None or piece.high is None or len(piece.polynomial) < 2:
            continue
        a, b = max(piece.low, low), min(piece.high, high)
        if a < b:
            places = [a + (b - a) * n / _SAMPLES for n in range(_SAMPLES + 1)]
            if len(piece.polynomial) == 2:
                places = [a, b]
            checkpoint()
            yield from _outside([(x, value_at(piece.polynomial, x)) for x in places])


def _outside(values: Sequence[tuple[Fraction, Fraction]]) -> Iterator[Excess]:
    """Yield where values leave [0, 1]; lines between them say from where to where."""
    x, value = ([*of] for of in zip(*values, strict=True))
    for goal, sign in ((ONE, 1), (ZERO, -1)):
        depth = [sign * (one - goal) for one in value]
        run: list[int] = []
        for place in range(len(depth) + 1):
            if place < len(depth) and depth[place] > 0:
                run.append(place)
            elif run:
                first, last = max(run[0] - 1, 0), min(run[-1] + 1, len(depth) - 1)
                low = _zero(x[first], x[run[0]], depth[first], depth[run[0]])
                high = _zero(x[last], x[run[-1]], depth[last], depth[run[-1]])
                deepest = max(run, key=depth.__getitem__)
                yield Excess(low, high, x[deepest], depth[deepest], sign > 0)
                run = []


def _zero(a: Fraction, b: Fraction, p: Fraction, q: Fraction) -> Fraction:
    """Return where a line is 0 between two places; the second where it is not."""
    return a + (b - a) * p / (p - q) if p <= 0 < q else b


class Excess(NamedTuple):
    """A stretch on which a polynomial leaves [0, 1]."""

    low: Fraction  # from where
    high: Fraction  # to where
    at: Fraction  # where it is farthest outside
    depth: Fraction  # how far
    is_above: bool  # whether it is above 1, otherwise below 0


# --- distance of two membership functions


class CurveDistance(NamedTuple):
    """The largest difference of two membership functions on an interval."""

    low: Fraction  # it is at least this; reached, or approached, at `at`
    high: Fraction  # it is at most this
    at: Fraction  # where


def curve_distance(
    one: Shape, other: Shape, low: Fraction, high: Fraction
) -> CurveDistance:
    """Return how far two membership functions are apart at most between two ends.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> steep = Points((0.0, 1.0), (0.0, 1.0))
        >>> slow = Points((0.0, 2.0), (0.0, 1.0))
        >>> result = curve_distance(steep, slow, Fraction(0), Fraction(4))
        >>> str(result.low), str(result.high), str(result.at)
        ('1/2', '1/2', '1')
    """
    gap, at = largest_gap(lines_of(one, low, high), lines_of(other, low, high))
    return CurveDistance(gap.low, min(gap.high, ONE), at)


def largest_gap(one: Between, other: Between) -> tuple[Bounds, Fraction]:
    """Return how far two functions are apart at most, and where."""
    low = high = ZERO
    place = one.lower.x[0]
    for first, second in ((one, other), (other, one)):
        low = max(low, *(gap for _, gap in _gaps(first.lower, second.upper)))
        for x, gap in _gaps(first.upper, second.lower):
            if gap > high:
                high, place = gap, x
    return Bounds(low, high), place


def are_apart(one: Between, other: Between, most: Fraction) -> bool:
    """Return whether two functions surely differ by more than a number somewhere."""
    return any(
        gap > most
        for first, second in ((one, other), (other, one))
        for _, gap in _gaps(first.lower, second.upper)
    )


def _gaps(one: Lines, other: Lines) -> Iterator[tuple[Fraction, Fraction]]:
    """Yield by how much a function is above another one, where that can be most."""
    for x, value, rival in at_knots(one, other):
        yield x, value - rival
    for a, b, p, q, r, s in together(one, other):
        yield a, p - r
        yield b, q - s
