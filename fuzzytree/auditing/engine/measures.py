"""Heights, areas, overlaps, dips and distances of curves, between exact bounds.

An axis is cut (`fuzzytree.auditing.engine.axes`) so that within a cell every curve is
one polynomial, and each question becomes one about polynomials, in fractions. Only
where a cell ends at an irrational place is the result a narrow interval.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.engine.axes import Cells, cut
from fuzzytree.auditing.engine.pieces import (
    ONE,
    ZERO,
    RuleCurve,
    piece_at,
    pieces,
    places,
    shape_ranges,
)
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    derivative,
    difference,
    integral,
    roots,
    value_at,
    values_near,
)
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
    """Curves on an axis between two ends, cut into cells."""

    elements: tuple[RuleCurve, ...]  # the curves
    cells: Cells
    is_open: bool = False  # whether the lower end itself is left out

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """The lower and the upper end."""
        return self.cells.zones[0][0], self.cells.zones[-1][1]


def curve_axis(
    shapes: Sequence[Shape], low: Fraction, high: Fraction, *, is_open: bool = False
) -> CurveAxis:
    """Return shapes on an axis, cut where something changes.

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
    elements = tuple(RuleCurve(shape) for shape in shapes)
    cells = cut(elements, places(elements), low, high)
    return CurveAxis(elements, cells, is_open)


def separate_axis(shapes: Sequence[Shape], low: Fraction, high: Fraction) -> CurveAxis:
    """Return shapes on an axis, cut where one of them changes; not where two cross.

    In a cell each curve is one polynomial, but their order may change: enough for sums.
    """
    elements = tuple(RuleCurve(shape) for shape in shapes)
    result = [place for element in elements for place in places([element])]
    return CurveAxis(elements, cut(elements, result, low, high))


def local_polynomial(element: RuleCurve, at: Fraction) -> Polynomial:
    """Return the polynomial that a curve is in the cell of a point, clipped or not.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> local_polynomial(RuleCurve(Points((0.0, 2.0), (0.0, 1.0)), True), ONE)
        (Fraction(1, 1), Fraction(-1, 2))
    """
    checkpoint()
    piece = piece_at(pieces(element.shape), at)
    degree = piece.degree(at)
    clipped = degree in (ZERO, piece.cap)
    polynomial = (degree,) if clipped else piece.polynomial
    return difference((ONE,), polynomial) if element.is_complement else polynomial


def extremes(
    polynomial: Polynomial, low: Fraction, high: Fraction
) -> Iterator[tuple[Fraction, Bounds]]:
    """Yield the ends and the turning points of a polynomial, with its values there.

    The largest and the least value on `low <= x <= high` are among them.

    Example:
        >>> bump = (Fraction(0), Fraction(1), Fraction(-1))
        >>> [float(b.high) for _, b in extremes(bump, Fraction(0), Fraction(1))]
        [0.0, 0.25, 0.0]
    """
    yield low, Bounds(*values_near(polynomial, low, low))
    if low < high:
        if len(polynomial) > 2:
            for root in roots(derivative(polynomial), low, high):
                yield root.low, Bounds(*values_near(polynomial, root.low, root.high))
        yield high, Bounds(*values_near(polynomial, high, high))


def sizes(
    polynomial: Polynomial, low: Fraction, high: Fraction
) -> Iterator[tuple[Fraction, Bounds]]:
    """Yield what `extremes` does, with how far the values are from 0."""
    for at, value in extremes(polynomial, low, high):
        near, far = sorted((abs(value.low), abs(value.high)))
        yield at, Bounds(ZERO if value.low < 0 < value.high else near, far)


def area(of: CurveAxis, chosen: Callable[[int, Fraction], Polynomial]) -> Bounds:
    """Return the area under a curve with degrees in [0, 1] on a line.

    `chosen`: given a cell's number and a point of it, the curve's polynomial there.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = curve_axis([Points((0.0, 2.0), (0.0, 1.0))], ZERO, Fraction(3))
        >>> area(ramp, lambda cell, at: local_polynomial(ramp.elements[0], at)).exact
        '2'
    """
    total = sum(
        (
            integral(chosen(number, (low + high) / 2), low, high)
            for number, (low, high) in enumerate(of.cells.between)
        ),
        start=ZERO,
    )
    # On the narrow places between cells a degree may be anything.
    slack = sum((b - a for a, b in of.cells.zones), start=ZERO)
    return Bounds(total, total + slack)


def heights(of: CurveAxis) -> tuple[CurveValue, ...]:
    """Return the supremum of each curve on a line, and a point where it is near.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = curve_axis([Points((0.0, 2.0), (0.0, 1.0))], ZERO, ONE)
        >>> heights(ramp)[0][0].exact
        '1/2'
    """
    return tuple(_height(of, one) for one in range(len(of.elements)))


def _height(of: CurveAxis, one: int) -> CurveValue:
    result = [(bounds, at) for bounds, at in walk(of, one)]
    most = max(bounds.high for bounds, _ in result)
    low = max(bounds.low for bounds, _ in result)
    at = next(at for bounds, at in result if bounds.low == low)
    return Bounds(low, most), at


def walk(of: CurveAxis, one: int) -> Iterator[CurveValue]:
    """Yield a curve's values from left to right; it is monotone between neighbours.

    At a step both its values are yielded, each with a point where it is reached or
    approached.
    """
    before: tuple[int, Bounds] | None = None
    for zone, is_after in _sides(of):
        value = value_at_place(of, one, zone, is_after=is_after)
        if (zone, value) != before:
            yield value, _middle(of, zone)
        before = zone, value


def _sides(of: CurveAxis) -> Iterator[tuple[int, bool]]:
    """Yield the places of a line, by number, each seen from below and from above."""
    count = len(of.cells.zones)
    for zone in range(count):
        if zone > 0 or not of.is_open or count == 1:
            yield zone, False
        if zone + 1 < count:
            yield zone, True


def _middle(of: CurveAxis, zone: int) -> Fraction:
    low, high = of.cells.zones[zone]
    return (low + high) / 2


def value_at_place(
    of: CurveAxis, one: int, zone: int, *, is_after: bool = False
) -> Bounds:
    """Return a curve's value at a place, or its limit from above."""
    low, high = of.cells.zones[zone]
    if low == high:
        element = of.elements[one]
        value = element.degree_after(low) if is_after else element.degree(low)
        return Bounds(value, value)
    values = (of.cells.right if is_after else of.cells.left)[:, one, zone]
    return Bounds(Fraction(values[0]), Fraction(values[1]))


# --- overlap of two curves

_CELLS = 256  # on which degrees are enclosed before areas are exact


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
    """Return how much the two curves of a line share, exactly but for slivers.

    Raises:
        ValueError: If the line has not two curves.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> down, up = (Points((0.0, 1.0), ends) for ends in ((1.0, 0.0), (0.0, 1.0)))
        >>> from fuzzytree.auditing.engine.measures import curve_axis
        >>> result = overlap(curve_axis([down, up], Fraction(0), Fraction(1)))
        >>> result.jaccard.exact, result.possibility.exact
        ('1/3', '1/2')
    """
    if len(of.elements) != 2:
        raise ValueError(f"two curves overlap, not {len(of.elements)}")
    rank = of.cells.rank
    lower = [int(a > b) for a, b in rank]
    shared = area(of, lambda cell, at: local_polynomial(of.elements[lower[cell]], at))
    joined = area(
        of, lambda cell, at: local_polynomial(of.elements[1 - lower[cell]], at)
    )
    met: list[CurveValue] = []
    for zone, is_after in _sides(of):
        a, b = (value_at_place(of, n, zone, is_after=is_after) for n in (0, 1))
        least = Bounds(min(a.low, b.low), min(a.high, b.high))
        met.append((least, _middle(of, zone)))
    low = max(bounds.low for bounds, _ in met)
    high = max(bounds.high for bounds, _ in met)
    start = of.cells.start_rank
    orders = [] if of.is_open and len(rank) else [int(start[0]) - int(start[1])]
    orders += [int(a) - int(b) for a, b in rank]
    return Overlap(
        shared,
        joined,
        Bounds(low, high),
        next(at for bounds, at in met if bounds.low == low),
        tuple(_crossings(of)),
        all(order <= 0 for order in orders),
        all(order >= 0 for order in orders),
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


def _crossings(of: CurveAxis) -> Iterator[tuple[Fraction, Bounds]]:
    before = 0
    since = 0
    for cell, (a, b) in enumerate(of.cells.rank):
        order = int(a > b) - int(a < b)
        if order and before and order != before:
            low, high = of.cells.zones[since]
            yield (low + high) / 2, value_at_place(of, 0, since)
        if order:
            before, since = order, cell + 1


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


def excesses(shape: Shape, low: Fraction, high: Fraction) -> Iterator[Excess]:
    """Yield where a shape's polynomials leave [0, 1] before they are clipped.

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
        if a >= b or _is_inside(piece.polynomial, a, b):
            continue
        for goal, sign in ((ONE, 1), (ZERO, -1)):
            over = difference(piece.polynomial, (goal,))
            ends = [a, *((r.low + r.high) / 2 for r in roots(over, a, b)), b]
            for start, end in itertools.pairwise(ends):
                if sign * value_at(over, (start + end) / 2) <= 0:
                    continue
                result = [*extremes(over, start, end)]
                at, depth = max(
                    ((at, sign * (v.low + v.high) / 2) for at, v in result),
                    key=lambda one: one[1],
                )
                yield Excess(start, end, at, depth, sign > 0)


def _is_inside(polynomial: Polynomial, low: Fraction, high: Fraction) -> bool:
    """Return whether a polynomial is a line within [0, 1]."""
    ends = value_at(polynomial, low), value_at(polynomial, high)
    return len(polynomial) == 2 and all(ZERO <= end <= ONE for end in ends)


class Excess(NamedTuple):
    """A stretch on which a polynomial leaves [0, 1]."""

    low: Fraction  # from where
    high: Fraction  # to where
    at: Fraction  # where it is farthest outside
    depth: Fraction  # how far
    is_above: bool  # whether it is above 1, otherwise below 0


# --- distance of two curves


class CurveDistance(NamedTuple):
    """The largest difference of two curves on an interval."""

    low: Fraction  # it is at least this; reached, or approached from above, at `at`
    high: Fraction  # it is at most this
    at: Fraction  # where


def curve_distance(
    one: Shape, other: Shape, low: Fraction, high: Fraction
) -> CurveDistance:
    """Return how far two curves are apart at most on a closed interval.

    The interval is cut where a curve changes; in each cell both are polynomials, whose
    difference is largest at an end or where it turns.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> steep = Points((0.0, 1.0), (0.0, 1.0))
        >>> slow = Points((0.0, 2.0), (0.0, 1.0))
        >>> result = curve_distance(steep, slow, Fraction(0), Fraction(4))
        >>> str(result.low), str(result.high), str(result.at)
        ('1/2', '1/2', '1')
    """
    result = [*_gaps(one, other, low, high)]
    least, at = max(((gap.low, at) for at, gap in result), key=lambda best: best[0])
    return CurveDistance(least, max(gap.high for _, gap in result), at)


def _gaps(
    one: Shape, other: Shape, low: Fraction, high: Fraction
) -> Iterator[tuple[Fraction, Bounds]]:
    """Yield places with how far two curves are apart there; the largest is among them.

    A limit from above is yielded with the place where it is approached.
    """
    axis = separate_axis([one, other], low, high)
    first, second = axis.elements
    start = abs(first.degree(low) - second.degree(low))
    yield low, Bounds(start, start)
    for a, b in axis.cells.between:
        middle = (a + b) / 2
        gap = difference(
            local_polynomial(first, middle), local_polynomial(second, middle)
        )
        yield from sizes(gap, a, b)
    # Where a curve changes at an irrational place, that is known as a narrow interval.
    lows, highs = axis.cells.left
    for number, (a, b) in enumerate(axis.cells.zones):
        if a < b:
            sides = (0, 1), (1, 0)
            most = max(
                Fraction(highs[p, number]) - Fraction(lows[q, number]) for p, q in sides
            )
            yield (a + b) / 2, Bounds(ZERO, max(most, ZERO))
