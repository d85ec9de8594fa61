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

At an irrational place, the one root of q in an interval, a curve has the value of its
polynomial p there: an algebraic number. It is a zero of the first linear relation among
the powers of p modulo q. Two such numbers within one narrow interval are equal if all
that their two relations have there is a single zero; otherwise narrower intervals part
them, and that ends because numbers that differ are some distance apart.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.pieces import (
    ONE,
    ZERO,
    ChangePoint,
    RuleCurve,
    piece_at,
    pieces,
)
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    Root,
    difference,
    division,
    magnitude,
    multiplied,
    refined,
    roots,
    squarefree,
    value_at,
    values_near,
)
from fuzzytree.model import (
    BoolArray,
    FloatArray,
    IntArray,
    Proposition,
    Shape,
    checkpoint,
)
from fuzzytree.numerics import (
    EnclosedValue,
    Enclosure,
    degree_enclosure,
    outwards,
    proposition_enclosure,
)

if TYPE_CHECKING:
    import numpy.typing as npt

    Values = npt.NDArray[np.float64] | npt.NDArray[np.object_]


_BITS: Final = (0, 512, 1024, 4096)  # to which places are known, one after another


class AlgebraicLevel(NamedTuple):
    """A value of a curve at an irrational place."""

    polynomial: Polynomial  # the curve there
    # what is 0 at the place, and nowhere else in the interval of the root
    of: Polynomial
    root: Root  # the place
    least: Fraction = ZERO  # the curve is at least this
    most: Fraction = ONE  # the curve is at most this

    def between(self, bits: int) -> tuple[Fraction, Fraction]:
        """Return bounds of the value, from so many bits of the place; 0: as it is."""
        at = self.root
        if bits:
            size = max(abs(at.low), abs(at.high)) or ONE
            at = refined(self.of, at, bits - magnitude(size))
        return values_near(self.polynomial, at.low, at.high)


@functools.lru_cache(maxsize=1 << 14)
def level_at(
    element: RuleCurve, place: ChangePoint, low: Fraction, high: Fraction
) -> AlgebraicLevel | Fraction | None:
    """Return a curve's value at an irrational place; None if it is not certain."""
    if place.of is None or not place.of[1].is_sure:
        return None
    polynomial, root = place.of[0], Root(low, high)
    piece = piece_at(pieces(element.shape), place.low)
    least, most, own = ZERO, piece.cap, piece.polynomial
    if element.is_complement:
        least, most, own = 1 - most, ONE, difference((ONE,), own)
    polynomial = difference(polynomial, (ZERO,))
    _, own = division(own, polynomial)
    if len(own) == 1:
        return min(max(own[0], least), most)
    level = AlgebraicLevel(own, polynomial, root, least, most)
    low, high = level.between(_BITS[0])
    known = level if least < low and high < most else _clipped(level)
    # A fraction of few digits in so narrow an interval is hardly there by chance.
    near = ((low + high) / 2).limit_denominator(1 << 64)
    is_near = isinstance(known, AlgebraicLevel) and low <= near <= high
    return near if is_near and _compared(level, near) == 0 else known


def _clipped(level: AlgebraicLevel) -> AlgebraicLevel | Fraction | None:
    """Return the end of its range that a value is at or beyond, or the value."""
    for end, sign in ((level.least, -1), (level.most, 1)):
        order = _compared(level, end)
        if order is None:
            return None
        if order * sign >= 0:
            return end
    return level


def _compared(one: AlgebraicLevel, other: AlgebraicLevel | Fraction) -> int | None:
    """Return the sign of one value minus another; None if they are too near to tell."""
    for bits in _BITS:
        checkpoint()
        low, high = one.between(bits)
        least, most = _span(other, bits)
        if high < least:
            return -1
        if low > most:
            return 1
        joint = _joint(_relation(one), _relation(other))
        margin = high - low or ONE
        ends = min(low, least) - margin, max(high, most) + margin
        met = roots(joint, *ends)
        if len(met) == 1 and met[0].is_sure:
            return 0
    return None


def _relation(level: AlgebraicLevel | Fraction) -> Polynomial:
    if isinstance(level, Fraction):
        return (-level, ONE)
    return relation(level.polynomial, level.of)


@functools.lru_cache(maxsize=1 << 10)
def _joint(one: Polynomial, other: Polynomial) -> Polynomial:
    """Return a polynomial that is 0 where one of two is, and there only once."""
    return squarefree(one if one == other else multiplied(one, other))


@functools.lru_cache(maxsize=1 << 10)
def relation(polynomial: Polynomial, of: Polynomial) -> Polynomial:
    """Return what is 0 at the values of p where q is 0: p's relation modulo q.

    `of`: q, of degree 1 at least.

    Example:
        >>> square = (Fraction(0), Fraction(0), Fraction(1))
        >>> golden = (Fraction(-1), Fraction(-1), Fraction(1))  # x * x = x + 1
        >>> [int(one) for one in relation(square, golden)]  # t * t = 3 t - 1
        [1, -3, 1]
    """
    size = len(of) - 1
    rows: list[tuple[int, list[Fraction], list[Fraction]]] = []
    power: Polynomial = (ONE,)
    for degree in range(size + 1):
        row = [*power, *(ZERO,) * (size - len(power))]
        combination = [ZERO] * degree + [ONE]
        for pivot, known, by in rows:
            share = row[pivot]
            if share:
                row = [a - share * b for a, b in zip(row, known, strict=True)]
                for place, one in enumerate(by):
                    combination[place] -= share * one
        left = [place for place, one in enumerate(row) if one]
        if not left:
            return tuple(combination)
        scale = row[left[0]]
        rows.append(
            (left[0], [a / scale for a in row], [a / scale for a in combination])
        )
        _, power = division(multiplied(power, polynomial), of)
    raise AssertionError  # size + 1 rows of size numbers are dependent


# --- many levels


def separate_levels(
    band: IntArray,
    low: npt.NDArray[np.object_],
    high: npt.NDArray[np.object_],
    level_of: Callable[[int], AlgebraicLevel | Fraction | None],
) -> list[int]:
    """Set bounds of levels of one band to be the same, or apart, where that is known.

    `low`: the lower bounds, which are changed; `level_of`: what a level is, by number.

    Returns:
        The numbers of those that are known exactly now.
    """
    members: dict[int, list[int]] = {}
    for number, of in enumerate(band.tolist()):
        members.setdefault(of, []).append(number)
    sure: list[int] = []
    for numbers in members.values():
        if all(low[n] == high[n] == low[numbers[0]] for n in numbers):
            continue
        checkpoint()
        levels = [level_of(number) for number in numbers]
        known = [level for level in levels if level is not None]
        groups = equal_levels(known) if len(known) == len(levels) else None
        for span, places in (groups or {}).items():
            # All bounds of equal ones hold, and none leaves the band.
            equal = [numbers[place] for place in places]
            low[equal] = max(span[0], *low[equal])
            high[equal] = min(span[1], *high[equal])
            sure += equal
    return sure


def equal_levels(
    levels: Sequence[AlgebraicLevel | Fraction],
) -> dict[tuple[Fraction, Fraction], list[int]] | None:
    """Return levels, by position, that are one number, by bounds that are apart.

    None if some are too near to tell.

    Example:
        >>> two = (Fraction(-2), Fraction(0), Fraction(1))
        >>> root = roots(two, Fraction(1), Fraction(2))[0]
        >>> side, square = (ZERO, Fraction(1, 2)), (ZERO, ZERO, Fraction(1, 4))
        >>> a, b = (AlgebraicLevel(one, two, root) for one in (side, square))
        >>> list(equal_levels([a, b, Fraction(1, 2), a]).values())
        [[1, 2], [0, 3]]
    """
    for bits in _BITS:
        groups: list[tuple[Fraction, Fraction, list[int]]] = []
        spans = sorted((*_span(level, bits), n) for n, level in enumerate(levels))
        for low, high, number in spans:
            if groups and low <= groups[-1][1]:
                first, last, places = groups.pop()
                groups.append((min(first, low), max(last, high), [*places, number]))
            else:
                groups.append((low, high, [number]))
        if all(_are_one([levels[n] for n in places]) for _, _, places in groups):
            return {(low, high): places for low, high, places in groups}
    return None


def _span(level: AlgebraicLevel | Fraction, bits: int) -> tuple[Fraction, Fraction]:
    return (level, level) if isinstance(level, Fraction) else level.between(bits)


def _are_one(levels: Sequence[AlgebraicLevel | Fraction]) -> bool:
    """Return whether levels are known to be one number."""
    first, *others = sorted(
        dict.fromkeys(levels), key=lambda one: isinstance(one, Fraction)
    )
    return not others or (
        isinstance(first, AlgebraicLevel)
        and all(_compared(first, other) == 0 for other in others)
    )


# --- an axis, cut


_FINE_BITS = 256  # to which irrational places are known where floats do not suffice


class Cells(NamedTuple):
    """An axis within two ends, cut."""

    # the places within the ends, apart from each other and in order, the ends first and
    # last; irrational ones as narrow intervals
    zones: tuple[tuple[Fraction, Fraction], ...]
    # shape (cells, elements): the order of the elements in the cell between two
    # neighbouring zones; equal elements have equal ranks
    rank: IntArray
    # shape (2, elements, zones): bounds of each element's value at a zone, seen from
    # below; at a rational place the value itself
    left: Values
    right: Values  # the same, seen from above; it differs at a step
    start_rank: IntArray  # shape (elements,): the order at the lower end itself
    # the open cells between neighbouring zones
    between: tuple[tuple[Fraction, Fraction], ...]
    # shape (zones,): whether more than one place may be in a zone, so that a cell is
    # hidden in it
    is_vague: BoolArray
    is_zero: BoolArray  # shape (elements, cells): whether an element is 0 throughout
    is_zero_at: BoolArray  # shape (elements, zones): whether it is 0 there, for sure


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
    return proposition_enclosure(
        Proposition("", ("",), ("not",) if element.is_complement else ()), [result]
    )


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
