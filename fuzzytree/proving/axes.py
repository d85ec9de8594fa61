"""One axis of a rule base, cut into cells in which nothing changes its order.

An *element* is a curve that rules use on a variable: a term's, or 1 minus a term's.
*Places* are where something can change: ends of pieces, turning points, where a curve
meets 0 or its cap, and where two curves cross. Each is a rational number, or an
irrational one within known bounds. Between two neighbouring places, in a *cell*, every
element is monotone and any two of them are in strict order or equal throughout. So one
point of a cell, compared exactly, tells the order in all of it, and a curve's values in
it lie between its limits at the two ends.

This is complete because nothing is sampled: a polynomial's sign changes only at its
roots, and `fuzzytree.proving.polynomials` finds all of them.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.numerics.enclosures import (
    Enclosure,
    Value,
    clause_enclosure,
    degree_enclosure,
)
from fuzzytree.numerics.exact import CAP, outwards
from fuzzytree.proving.curves import (
    ONE,
    ZERO,
    Piece,
    degree_after,
    piece_at,
    pieces,
)
from fuzzytree.proving.polynomials import (
    Polynomial,
    Root,
    common_factor,
    composed,
    derivative,
    difference,
    integer_roots,
    integers,
    refined,
    roots,
    value_at,
)
from fuzzytree.rulebase import Band, Clause, Points, Shape

if TYPE_CHECKING:
    import numpy.typing as npt

    from fuzzytree.contracts import FloatArray, IntArray

    BoolArray = npt.NDArray[np.bool_]
    Values = npt.NDArray[np.float64] | npt.NDArray[np.object_]

_FINE_BITS = 256  # to which irrational places are known where floats do not suffice

ALWAYS = Band()
"""The curve of a rule that asks nothing of a variable."""


class Element(NamedTuple):
    """A curve that rules use: a shape, or 1 minus it."""

    shape: Shape
    is_complement: bool = False

    def degree(self, x: Fraction) -> Fraction:
        """Return the exact degree at a value."""
        found = piece_at(pieces(self.shape), x).degree(x)
        return 1 - found if self.is_complement else found

    def degree_after(self, x: Fraction) -> Fraction:
        """Return the exact limit of the degree from the right."""
        found = degree_after(pieces(self.shape), x)
        return 1 - found if self.is_complement else found

    def pieces(self) -> tuple[tuple[Piece, Polynomial], ...]:
        """Return the pieces of the shape, each with its own polynomial on it."""
        return tuple(
            (
                piece,
                difference((ONE,), piece.polynomial)
                if self.is_complement
                else piece.polynomial,
            )
            for piece in pieces(self.shape)
        )


class Place(NamedTuple):
    """Where something can change on an axis: between `low` and `high`.

    Attributes:
        low: At most the place; the place itself if `low == high`.
        high: At least the place.
        of: What is zero there, and the root; None where the place is rational.
    """

    low: Fraction
    high: Fraction
    of: tuple[Polynomial, Root] | None = None


def places(elements: Sequence[Element]) -> tuple[Place, ...]:
    """Return all places where the order or direction of some curves can change."""
    found: set[Fraction] = set()
    irrational: list[Place] = []
    laid = [element.pieces() for element in elements]
    levels = sorted(
        {ZERO, ONE}
        | {
            level
            for of in laid
            for piece, polynomial in of
            if piece.cap == CAP and len(polynomial) > 1
            for level in (CAP, 1 - CAP)
        }
    )
    for element, of in zip(elements, laid, strict=True):
        is_kept = isinstance(element.shape, Points)  # lines that stay in [0, 1]
        for piece, polynomial in of:
            found.update(end for end in (piece.low, piece.high) if end is not None)
            if len(polynomial) > 1:
                ends = piece.low, piece.high
                turning = integers(derivative(polynomial))[0]
                if len(turning) > 1:
                    _solve(turning, *ends, found, irrational)
                for level in levels:
                    if not is_kept or ZERO < level < ONE:
                        met = _crossing(polynomial, (level,))
                        _solve(met, *ends, found, irrational)
    for one, other in itertools.combinations(laid, 2):
        for low, high, p, q in _overlaps(one, other):
            if len(p) > 1 or len(q) > 1:
                _solve(_crossing(p, q), low, high, found, irrational)
    return tuple(_apart([*(Place(x, x) for x in found), *irrational]))


def _apart(found: Iterable[Place]) -> list[Place]:
    """Return places apart from each other: one place that was met twice stands once.

    Two that cannot be told apart are left to touch.
    """
    kept: list[Place] = []
    for place in sorted(found, key=lambda one: (one.low, one.high)):
        after = place
        while kept and after.low <= kept[-1].high:
            before = kept.pop()
            same = _same(before, after)
            if same is not None:
                after = same
                continue
            one, other = _told_apart(before, after)
            kept += [one, other] if one.low <= other.low else [other, one]
            break
        else:
            kept.append(after)
    return kept


def _same(one: Place, other: Place) -> Place | None:
    """Return two places that touch as one, if they are the same for sure."""
    if one.of is None or other.of is None:
        exact, vague = (one, other) if one.of is None else (other, one)
        if vague.of is None:
            return exact if exact.low == vague.low else None
        return exact if _is_only_root(vague.of[0], exact.low, vague) else None
    low, high = max(one.low, other.low), min(one.high, other.high)
    if not (one.of[1].is_sure and other.of[1].is_sure and low < high):
        return None
    # A root of what two polynomials have in common is a root of both, and each has
    # only one in its place.
    shared = common_factor(one.of[0], other.of[0])
    if len(shared) > 1 and value_at(shared, low) * value_at(shared, high) < 0:
        return Place(low, high, (shared, Root(low, high)))
    return None


def _is_only_root(of: Polynomial, at: Fraction, place: Place) -> bool:
    """Return whether a polynomial is 0 at a value, and nowhere else in a place."""
    if value_at(of, at) != 0:
        return False
    while len(of) > 1 and value_at(of, at) == 0:
        of = _without(of, at)
    ends = place.low, place.high
    return all(value_at(of, end) for end in ends) and not roots(of, *ends)


def _without(of: Polynomial, root: Fraction) -> Polynomial:
    """Return a polynomial divided by x minus a root of it (Horner's scheme)."""
    sums = itertools.accumulate(reversed(of), lambda total, one: total * root + one)
    return tuple(sums)[-2::-1]


def _told_apart(one: Place, other: Place) -> tuple[Place, Place]:
    """Return two places that touch as narrow as it takes for them to be apart."""
    for bits in (64, 128, 512):
        one, other = (_narrowed(place, bits) for place in (one, other))
        if one.high < other.low or other.high < one.low:
            break
    return one, other


def _narrowed(place: Place, bits: int) -> Place:
    if place.of is None:
        return place
    size = max(abs(place.low), abs(place.high)) or ONE
    root = refined(*place.of, bits - math.frexp(float(size))[1])
    return Place(root.low, root.high, (place.of[0], root))


def _crossing(one: Polynomial, other: Polynomial) -> list[int]:
    """Return a positive multiple of a difference, in whole numbers."""
    a, of_a = integers(one)
    b, of_b = integers(other)
    common = math.gcd(of_a, of_b)
    of_a, of_b = of_a // common, of_b // common
    return [x * of_b - y * of_a for x, y in itertools.zip_longest(a, b, fillvalue=0)]


def _solve(
    numbers: Sequence[int],
    low: Fraction | None,
    high: Fraction | None,
    found: set[Fraction],
    irrational: list[Place],
) -> None:
    if low is None or high is None:
        return
    for root in integer_roots(numbers, low, high):
        if root.low == root.high:
            found.add(root.low)
        else:
            of = tuple(map(Fraction, numbers))
            irrational.append(Place(root.low, root.high, (of, root)))


def _overlaps(
    one: Sequence[tuple[Piece, Polynomial]], other: Sequence[tuple[Piece, Polynomial]]
) -> Iterator[tuple[Fraction | None, Fraction | None, Polynomial, Polynomial]]:
    """Yield where a piece of one curve and one of another both hold."""
    i = j = 0
    low: Fraction | None = None
    while True:
        (a, p), (b, q) = one[i], other[j]
        high = a.high if b.high is None or _is_first(a.high, b.high) else b.high
        if low is None or high is None or low < high:
            yield low, high, p, q
        if high is None:
            return
        i, j, low = i + (a.high == high), j + (b.high == high), high


def _is_first(one: Fraction | None, other: Fraction) -> bool:
    return one is not None and one < other


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
    elements: Sequence[Element],
    found: Iterable[Place],
    low: Fraction,
    high: Fraction,
    *,
    is_fine: bool = False,
) -> Cells:
    """Return an axis between two ends, cut at places.

    Args:
        elements: The curves on the axis.
        found: All places where they change.
        low: The lower end.
        high: The upper end, not below the lower one.
        is_fine: Whether bounds of values are fractions, narrow without limit, instead
            of doubles.
    """
    zones, is_vague = _zones(found, low, high, is_fine=is_fine)
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
    found: Iterable[Place], low: Fraction, high: Fraction, *, is_fine: bool
) -> tuple[tuple[tuple[Fraction, Fraction], ...], BoolArray]:
    within: list[tuple[Fraction, Fraction, bool]] = [(low, low, False)]
    if low < high:
        within.append((high, high, False))
    for place in found:
        if place.high <= low or place.low >= high:
            continue
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


def _bits(root: Root) -> int:
    """Return how fine a root is wanted, for its own size and that of its place."""
    size = max(abs(root.low), abs(root.high), root.high - root.low)
    return _FINE_BITS + max(0, -math.frexp(float(size) or 1.0)[1])


# --- the order in each cell


def _ranks(
    elements: Sequence[Element], zones: Sequence[tuple[Fraction, Fraction]]
) -> tuple[IntArray, BoolArray]:
    """Return the order of elements in each cell, and which are 0 in it.

    Where a curve meets 0 is a place, so it is 0 in all of a cell or nowhere in it.
    """
    ends = [(a[1], b[0]) for a, b in itertools.pairwise(zones)]
    points = [_between(a, b) for a, b in ends]
    near = np.array([float(point) for point in points])
    bounds = [_enclosed(element, near, None) for element in elements]
    low = np.array([one.low for one in bounds]).reshape(len(elements), len(points))
    high = np.array([one.high for one in bounds]).reshape(low.shape)
    order = np.argsort(low, axis=0, kind="stable")
    ranks = np.zeros((len(points), len(elements)), dtype=np.int64)
    for cell, point in enumerate(points):
        if Fraction(near[cell]) == point:
            given = _order_of_bounds(low[:, cell], high[:, cell], order[:, cell])
        else:
            given = None
        if given is None:
            given = _order([element.degree(point) for element in elements])
        ranks[cell] = given
    is_zero = high == 0.0
    for row, cell in np.argwhere((low == 0.0) & ~is_zero).tolist():
        is_zero[row, cell] = elements[row].degree(points[cell]) == 0
    return ranks, is_zero


def _zeros_at(
    elements: Sequence[Element],
    zones: Sequence[tuple[Fraction, Fraction]],
    left: Values,
) -> BoolArray:
    is_zero: BoolArray = np.asarray(left[1] == 0, dtype=bool)
    is_open = np.asarray(left[0] == 0, dtype=bool) & ~is_zero
    for row, place in np.argwhere(is_open).tolist():
        low, high = zones[place]
        is_zero[row, place] = low == high and elements[row].degree(low) == 0
    return is_zero


def _between(low: Fraction, high: Fraction) -> Fraction:
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


def _enclosed(element: Element, x: FloatArray, slack: FloatArray | None) -> Enclosure:
    found = degree_enclosure(element.shape, Value(x, slack))
    return clause_enclosure(Clause("", ("",), element.is_complement), [found])


def _values(
    elements: Sequence[Element], zones: Sequence[tuple[Fraction, Fraction]]
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
    laid = pieces(shape)
    return tuple(
        a.high
        for a, b in itertools.pairwise(laid)
        if a.high is not None and a.degree(a.high) != b.degree(a.high)
    )


def _fine_values(
    elements: Sequence[Element], zones: Sequence[tuple[Fraction, Fraction]]
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
    element: Element, low: Fraction, high: Fraction
) -> tuple[Fraction, Fraction]:
    """Return bounds of a curve's values on a narrow closed interval."""
    ends: list[Fraction] = []
    for piece in pieces(element.shape):
        a = low if piece.low is None else max(low, piece.low)
        b = high if piece.high is None else min(high, piece.high)
        if a > b:
            continue
        numbers, common = integers(composed(piece.polynomial, (a + b) / 2, (b - a) / 2))
        middle = Fraction(numbers[0], common)
        off = Fraction(sum(map(abs, numbers[1:])), common)
        ends += [min(max(one, ZERO), piece.cap) for one in (middle - off, middle + off)]
    least, most = min(ends), max(ends)
    return (1 - most, 1 - least) if element.is_complement else (least, most)
