"""One axis of a rule base, cut into cells in which nothing changes its order.

An *element* is a curve that rules use on a variable: a term's, or 1 minus a term's.
*Places* are where something can change: ends of pieces, turning points, where a curve
meets 0 or its cap, and where two curves cross. Each is a rational number, or an
irrational one within known bounds. Between two neighbouring places, in a *cell*, every
element is monotone and any two of them are in strict order or equal throughout. So one
point of a cell, compared exactly, gives the order in all of it, and a curve's values in
it lie between its limits at the two ends.

This is complete because nothing is sampled: a polynomial's sign changes only at its
roots, and `fuzzytree.auditing.engine.polynomials` finds all of them.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.pieces import ONE, ZERO, ChangePoint, RuleCurve, pieces
from fuzzytree.auditing.engine.polynomials import (
    Root,
    magnitude,
    refined,
    value_at,
    values_near,
)
from fuzzytree.model import Clause, Shape, checkpoint
from fuzzytree.numerics import (
    EnclosedValue,
    Enclosure,
    clause_enclosure,
    degree_enclosure,
    outwards,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.model import FloatArray, IntArray

    BoolArray = npt.NDArray[np.bool_]
    Values = npt.NDArray[np.float64] | npt.NDArray[np.object_]

_FINE_BITS = 256  # to which irrational places are known where floats do not suffice


class Cells(NamedTuple):
    """An axis within two ends, cut.

    Attributes:
        zones: The places within the ends, apart from each other and in order, the
            ends first and last; irrational ones as narrow intervals.
        rank: Shape (cells, elements): the order of the elements in the cell between
            two neighbouring zones; equal elements have equal ranks.
        left: Shape (2, elements, zones): bounds of each element's value at a zone,
            seen from below; at a rational place the value itself.
        right: The same, seen from above; it differs at a step.
        start_rank: Shape (elements,): the order at the lower end itself.
        between: The open cells between neighbouring zones.
        is_vague: Shape (zones,): whether more than one place may be in a zone, so
            that a cell is hidden in it.
        is_zero: Shape (elements, cells): whether an element is 0 throughout.
        is_zero_at: Shape (elements, zones): whether it is 0 there, for sure.
    """

    zones: tuple[tuple[Fraction, Fraction], ...]
    rank: IntArray
    left: Values
    right: Values
    start_rank: IntArray
    between: tuple[tuple[Fraction, Fraction], ...]
    is_vague: BoolArray
    is_zero: BoolArray
    is_zero_at: BoolArray


def cut(
    elements: Sequence[RuleCurve],
    result: Iterable[ChangePoint],
    low: Fraction,
    high: Fraction,
    *,
    is_fine: bool = False,
) -> Cells:
    """Return an axis between two ends, cut at places.

    `high`: the upper end, not below the lower one; `is_fine`: whether bounds of values
    are fractions, narrow without limit, instead of doubles.
    """
    zones, is_vague = _zones(result, low, high, is_fine=is_fine)
    rank, is_zero = _ranks(elements, zones)
    start = _order([element.degree(low) for element in elements])
    left, right = (_fine_values if is_fine else _values)(elements, zones)
    return Cells(
        zones,
        rank,
        left,
        right,
        np.array(start, dtype=np.int64),
        tuple((a[1], b[0]) for a, b in itertools.pairwise(zones)),
        is_vague,
        is_zero,
        _zeros_at(elements, zones, left),
    )


def _zones(
    result: Iterable[ChangePoint], low: Fraction, high: Fraction, *, is_fine: bool
) -> tuple[tuple[tuple[Fraction, Fraction], ...], BoolArray]:
    within: list[tuple[Fraction, Fraction, bool]] = [(low, low, False)]
    if low < high:
        within.append((high, high, False))
    for place in result:
        if place.high <= low or place.low >= high:
            continue
        if _is_at(place, low) or _is_at(place, high):
            continue  # an end is a zone already
        a, b = place.low, place.high
        is_vague = place.of is not None and not place.of[1].is_sure
        if is_fine and place.of is not None:
            root = refined(*place.of, _bits(place.of[1]))
            a, b = root.low, root.high
        if a < high and b > low:
            within.append((max(a, low), min(b, high), is_vague))
    within.sort()
    merged = [within[0]]
    for a, b, is_vague in within[1:]:
        before = merged[-1]
        if a > before[1]:
            merged.append((a, b, is_vague))
        elif (a, b) != before[:2] or a < b:
            merged[-1] = (before[0], max(b, before[1]), True)
    zones = tuple((a, b) for a, b, _ in merged)
    return zones, np.array([is_vague for _, _, is_vague in merged])


def _is_at(place: ChangePoint, end: Fraction) -> bool:
    """Return whether a place that is known within bounds is an end, exactly."""
    if place.of is None or not place.low <= end <= place.high:
        return False
    polynomial, root = place.of
    is_within = root.is_sure and root.low < end < root.high
    return is_within and not value_at(polynomial, end)


def _bits(root: Root) -> int:
    """Return how fine a root is wanted, for its own size and that of its place."""
    size = max(abs(root.low), abs(root.high), root.high - root.low)
    return _FINE_BITS + max(0, -magnitude(size or ONE))


# --- the order in each cell


def _ranks(
    elements: Sequence[RuleCurve], zones: Sequence[tuple[Fraction, Fraction]]
) -> tuple[IntArray, BoolArray]:
    """Return the order of elements in each cell, and which are 0 in it.

    Where a curve meets 0 is a place, so it is 0 in all of a cell or nowhere in it.
    """
    ends = [(a[1], b[0]) for a, b in itertools.pairwise(zones)]
    points = [between(a, b) for a, b in ends]
    near = np.array([float(point) for point in points])
    # A point that is no double may be on the other side of a place than the nearest.
    is_double = np.array(
        [Fraction(x) == p for x, p in zip(near.tolist(), points, strict=True)],
        dtype=bool,
    )
    bounds = [_enclosed(element, near, None) for element in elements]
    low = np.array([one.low for one in bounds]).reshape(len(elements), len(points))
    high = np.array([one.high for one in bounds]).reshape(low.shape)
    order = np.argsort(low, axis=0, kind="stable")
    ranks = np.zeros((len(points), len(elements)), dtype=np.int64)
    for cell, point in enumerate(points):
        if is_double[cell]:
            order_here = _order_of_bounds(low[:, cell], high[:, cell], order[:, cell])
        else:
            order_here = None
        if order_here is None:
            order_here = _order([element.degree(point) for element in elements])
        ranks[cell] = order_here
    is_zero = (high == 0.0) & is_double
    for row, cell in np.argwhere((low == 0.0) & ~is_zero | ~is_double).tolist():
        is_zero[row, cell] = elements[row].degree(points[cell]) == 0
    return ranks, is_zero


def _zeros_at(
    elements: Sequence[RuleCurve],
    zones: Sequence[tuple[Fraction, Fraction]],
    left: Values,
) -> BoolArray:
    is_zero: BoolArray = np.asarray(left[1] == 0, dtype=bool)
    is_open = np.asarray(left[0] == 0, dtype=bool) & ~is_zero
    for row, place in np.argwhere(is_open).tolist():
        low, high = zones[place]
        is_zero[row, place] = low == high and elements[row].degree(low) == 0
    return is_zero


def between(low: Fraction, high: Fraction) -> Fraction:
    """Return a point between two others, a double if there is one."""
    middle = (low + high) / 2
    near = Fraction(float(middle))
    return near if low < near < high else middle


def _order_of_bounds(
    low: FloatArray, high: FloatArray, order: IntArray
) -> list[int] | None:
    """Return ranks where bounds tell the order, or None."""
    ranks = [0] * len(order)
    rank = 0
    for before, after in itertools.pairwise(order.tolist()):
        if high[before] < low[after]:
            rank += 1
        elif not low[before] == high[before] == low[after] == high[after]:
            return None
        ranks[after] = rank
    return ranks


def _order(values: Sequence[Fraction]) -> list[int]:
    place = {value: rank for rank, value in enumerate(sorted(set(values)))}
    return [place[value] for value in values]


# --- values at zones


def _enclosed(element: RuleCurve, x: FloatArray, slack: FloatArray | None) -> Enclosure:
    checkpoint()
    result = degree_enclosure(element.shape, EnclosedValue(x, slack))
    return clause_enclosure(Clause("", ("",), element.is_complement), [result])


def _values(
    elements: Sequence[RuleCurve], zones: Sequence[tuple[Fraction, Fraction]]
) -> tuple[Values, Values]:
    left = np.zeros((2, len(elements), len(zones)))
    exact = np.array([Fraction(float(a)) == b for a, b in zones])
    x = np.array([float(a) for a, _ in zones])
    low = np.array([outwards(a)[0] for a, _ in zones])
    high = np.array([outwards(b)[1] for _, b in zones])
    middle = low + (high - low) * 0.5
    slack = np.nextafter(np.maximum(high - middle, middle - low), np.inf) + 2.0**-1000
    for row, element in enumerate(elements):
        sharp = _enclosed(element, x, None)
        blurred = _enclosed(element, middle, slack)
        left[0, row] = np.where(exact, sharp.low, blurred.low)
        left[1, row] = np.where(exact, sharp.high, blurred.high)
    right = left.copy()
    steps = {zone[0]: place for place, zone in enumerate(zones) if zone[0] == zone[1]}
    for row, element in enumerate(elements):
        for x_step in _steps(element.shape):
            place = steps.get(x_step)
            if place is not None:
                right[:, row, place] = outwards(element.degree_after(x_step))
    return left, right


@functools.lru_cache(maxsize=1 << 12)
def _steps(shape: Shape) -> tuple[Fraction, ...]:
    """Return the values at which a shape is not continuous."""
    parts = pieces(shape)
    return tuple(
        a.high
        for a, b in itertools.pairwise(parts)
        if a.high is not None and a.degree(a.high) != b.degree(a.high)
    )


def _fine_values(
    elements: Sequence[RuleCurve], zones: Sequence[tuple[Fraction, Fraction]]
) -> tuple[Values, Values]:
    shape = (2, len(elements), len(zones))
    left, right = np.empty(shape, dtype=object), np.empty(shape, dtype=object)
    for row, element in enumerate(elements):
        for place, (a, b) in enumerate(zones):
            if a == b:
                left[:, row, place] = element.degree(a)
                right[:, row, place] = element.degree_after(a)
            else:
                left[:, row, place] = _range(element, a, b)
                right[:, row, place] = left[:, row, place]
    return left, right


def _range(
    element: RuleCurve, low: Fraction, high: Fraction
) -> tuple[Fraction, Fraction]:
    """Return bounds of a curve's values on a narrow closed interval."""
    ends: list[Fraction] = []
    for piece in pieces(element.shape):
        a = low if piece.low is None else max(low, piece.low)
        b = high if piece.high is None else min(high, piece.high)
        if a > b:
            continue
        values = values_near(piece.polynomial, a, b)
        ends += [min(max(one, ZERO), piece.cap) for one in values]
    least, most = min(ends), max(ends)
    return (1 - most, 1 - least) if element.is_complement else (least, most)
