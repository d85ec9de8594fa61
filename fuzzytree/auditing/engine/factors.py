"""A rule's degree on each axis as one polynomial in each cell.

Under the minimum a rule's degree on an axis is in each cell one of its curves; under
the product it is the product of its propositions there. Ratios and distances of two
rules are then questions about quotients and differences of polynomials, decided in
fractions.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import Final, NamedTuple

import msgspec
import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid
from fuzzytree.auditing.engine.measures import (
    Bounds,
    local_polynomial,
    sizes,
)
from fuzzytree.auditing.engine.pieces import ONE, ZERO, RuleCurve
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    derivative,
    difference,
    division,
    monic,
    multiplied,
    roots,
    value_at,
    values_near,
)
from fuzzytree.model import (
    BoolArray,
    FloatArray,
    Proposition,
    Shape,
    checkpoint,
    shapes_of,
)

UNKNOWN: Final = Fraction(1 << 4096)
"""The upper bound of a ratio of which none was found."""

Group = tuple[tuple[int, ...], bool]
"""A proposition: its elements, and whether the least counts, not the largest."""


class Factored(msgspec.Struct, frozen=True, eq=False, dict=True):
    """The rules of a ground, axis by axis."""

    base: Arrangement  # the rules and the box, which is not empty

    @property
    def is_product(self) -> bool:
        """Whether degrees are multiplied."""
        return self.base.rules.semantics.conjunction == "product"

    @property
    def grids(self) -> tuple[AxisGrid, ...]:
        """The axes on the box."""
        return self.base.grids

    @functools.cached_property
    def propositions(self) -> tuple[tuple[tuple[Group, ...], ...], ...]:
        """For each axis and rule, its propositions there."""
        shapes = shapes_of(self.base.rules.variables)
        return tuple(
            tuple(
                tuple(
                    _group(proposition, axis.elements, shapes)
                    for proposition in rule.when
                    if proposition.variable == axis.variable.name
                )
                for rule in self.base.rules.rules
            )
            for axis in self.base.axes
        )

    @functools.cached_property
    def polynomial(self) -> Callable[[int, int, int], Polynomial]:
        """A rule's degree on an axis in a cell; all are numbered from 0."""
        return functools.cache(self._polynomial)

    def _polynomial(self, axis: int, rule: int, cell: int) -> Polynomial:
        grid = self.grids[axis]
        low, high = grid.cells.between[cell]
        at = (low + high) / 2
        result: Polynomial = (ONE,)
        for one in self.chosen(axis, rule, cell):
            result = multiplied(result, local_polynomial(grid.axis.elements[one], at))
        return result

    def chosen(self, axis: int, rule: int, cell: int) -> tuple[int, ...]:
        """Return the elements of which a rule's degree is the product in a cell."""
        grid = self.grids[axis]
        if not self.is_product:
            return (int(grid.of[rule, cell]),)
        rank = grid.cells.rank[cell]
        return tuple(
            (min if is_least else max)(of, key=lambda one: int(rank[one]))
            for of, is_least in self.propositions[axis][rule]
        )

    def is_below(self, axis: int, one: int, other: int, cell: int) -> bool:
        """Return whether a rule's degree is surely not above another's in a cell."""
        low, high = self.chosen(axis, one, cell), self.chosen(axis, other, cell)
        if len(low) > 1 or len(high) > 1:
            return low == high
        rank = self.grids[axis].cells.rank[cell]  # element 0 is 1 everywhere
        return bool(rank[low[0] if low else 0] <= rank[high[0] if high else 0])

    @functools.cached_property
    def near(self) -> Callable[[int, Fraction], BoolArray]:
        """Which rules may be near one, by their degrees between cells."""
        return functools.cache(self._near)

    def _near(self, one: int, most: Fraction) -> BoolArray:
        checkpoint()
        limit = float(most)
        result: BoolArray = np.ones(len(self.base.rules.rules), dtype=bool)
        for low, high in self.at_zones:
            is_far = (low[one] - high > limit) | (low - high[one] > limit)
            result &= ~is_far.any(axis=1)
        return result

    def at_start(self, axis: int, rule: int) -> Fraction:
        """Return a rule's degree at the lower end of an axis."""
        grid = self.grids[axis]
        at = grid.cells.zones[0][0]
        result = ONE
        for of, is_least in self.propositions[axis][rule]:
            degrees = [grid.axis.elements[one].degree(at) for one in of]
            degree = min(degrees) if is_least else max(degrees)
            result = result * degree if self.is_product else min(result, degree)
        return result

    def has_start(self, axis: int) -> bool:
        """Return whether the lower end of an axis belongs to the box."""
        name = self.grids[axis].axis.variable.name
        side = self.base.domain.side(name)
        return side is None or not side.is_open

    @functools.cached_property
    def at_zones(self) -> tuple[tuple[FloatArray, FloatArray], ...]:
        """For each axis bounds of all rules' degrees at its places, rounded outwards.

        Each of shape (rules, zones).
        """
        result: list[tuple[FloatArray, FloatArray]] = []
        for axis, grid in enumerate(self.grids):
            low, high = grid.cells.left.astype(np.float64)
            result.append((self._joined(axis, low, -1), self._joined(axis, high, 1)))
        return tuple(result)

    @functools.cached_property
    def tops(self) -> tuple[FloatArray, ...]:
        """For each axis bounds from above of all rules' degrees in its cells.

        Each of shape (rules, 1 + cells): the lower end itself comes first.
        """
        result: list[FloatArray] = []
        for axis, grid in enumerate(self.grids):
            left = grid.cells.left[1].astype(np.float64)
            right = grid.cells.right[1].astype(np.float64)
            cells = np.maximum(right[:, :-1], left[:, 1:])
            result.append(self._joined(axis, np.column_stack([left[:, 0], cells]), 1))
        return tuple(result)

    def _joined(self, axis: int, degrees: FloatArray, towards: int) -> FloatArray:
        """Return rules' degrees from those of elements, rounded down or up."""
        rules = self.propositions[axis]
        result = np.ones((len(rules), degrees.shape[1]))
        for number, groups in enumerate(rules):
            for of, is_least in groups:
                each = degrees[list(of)]
                degree = each.min(axis=0) if is_least else each.max(axis=0)
                if self.is_product:
                    result[number] *= degree
                else:
                    result[number] = np.minimum(result[number], degree)
        # A product of n doubles carries n roundings, a conversion one more.
        off = 2.0**-50 * max(map(len, rules), default=1)
        return np.asarray(result * (1.0 + towards * off))


def _group(
    proposition: Proposition,
    elements: tuple[RuleCurve, ...],
    shapes: Mapping[tuple[str, str], Shape],
) -> Group:
    of = (
        RuleCurve(shapes[proposition.variable, t], proposition.negated)
        for t in proposition.terms
    )
    return tuple(elements.index(one) for one in of), proposition.negated


# --- ratios


def least_ratios(of: Factored) -> FloatArray:
    """Return bounds from below of how large r / q becomes, under the product.

    Returns:
        Shape (rules, rules): `[q, r]`, seen only at the places between cells.
    """
    count = len(of.base.rules.rules)
    result = np.ones((count, count))
    for axis, (low, high) in enumerate(of.at_zones):
        first = 0 if of.has_start(axis) else 1
        for weak in range(count):
            checkpoint()
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                each = low[weak, first:] / high[:, first:] * (1.0 - 2.0**-50)
                each = np.nan_to_num(each, nan=0.0, posinf=np.inf)
                result[:, weak] *= each.max(axis=1, initial=0.0)
    return np.nan_to_num(result, nan=0.0, posinf=np.inf)


def largest_ratio(of: Factored, strong: int, weak: int) -> Bounds | None:
    """Return the supremum of a rule's strength over another's, where it fires.

    Under the product, for free axes it is the product of the suprema on each axis.

    Returns:
        0 if `weak` never fires; None if there is no bound; up to `UNKNOWN` if none was
        found.
    """
    low = high = ONE
    is_known = True
    for axis in range(len(of.grids)):
        result = _axis_ratio(of, axis, strong, weak)
        if result is None:
            return None
        low, high = low * result.low, high * result.high
        is_known &= result.high < UNKNOWN
    return Bounds(low, high if is_known else UNKNOWN)


def _axis_ratio(of: Factored, axis: int, strong: int, weak: int) -> Bounds | None:
    if of.propositions[axis][strong] == of.propositions[axis][weak]:
        return Bounds(ONE, ONE)
    zones = of.grids[axis].cells.zones
    low, high = ZERO, ZERO
    if of.has_start(axis):
        top, bottom = of.at_start(axis, weak), of.at_start(axis, strong)
        if top and not bottom:
            return None
        if top:
            low = high = top / bottom
    below: list[bool] = []
    for cell, (a, b) in enumerate(of.grids[axis].cells.between):
        checkpoint()
        r, q = (of.polynomial(axis, rule, cell) for rule in (weak, strong))
        below.append(of.is_below(axis, weak, strong, cell))
        result = quotient(r, q, a, b)
        if result is None:
            return None
        low, high = max(low, result.low), max(high, result.high)
    lows, highs = of.at_zones[axis]
    for number, (a, b) in enumerate(zones):
        if a == b:
            continue  # continuous from the left: the cell before gave its value
        beside = below[max(number - 1, 0) : number + 1]
        most, least = Fraction(highs[weak, number]), Fraction(lows[strong, number])
        if not most:
            continue
        if all(beside) and is_single(of.grids[axis], a, b):
            high = max(high, ONE) if low < ONE else high
            continue
        high = max(high, most / least if least else UNKNOWN)
    return Bounds(low, high)


def meets(of: Factored, strong: int, weak: int) -> bool:
    """Return whether two rules are known to be equal on each axis, where they fire.

    They are then equally strong somewhere. It is looked for where curves coincide and
    at the ends of cells.
    """
    return all(_is_met(of, axis, strong, weak) for axis in range(len(of.grids)))


def _is_met(of: Factored, axis: int, one: int, other: int) -> bool:
    if of.propositions[axis][one] == of.propositions[axis][other]:
        return True
    if of.has_start(axis) and of.at_start(axis, one) == of.at_start(axis, other) != 0:
        return True
    cells = of.grids[axis].cells
    for cell, (_, high) in enumerate(cells.between):
        mine, theirs = (of.polynomial(axis, rule, cell) for rule in (one, other))
        if mine == theirs and any(mine):
            return True
        low, end = cells.zones[cell + 1]
        if low == end and value_at(mine, high) == value_at(theirs, high) != 0:
            return True
    return False


def is_single(grid: AxisGrid, low: Fraction, high: Fraction) -> bool:
    """Return whether a zone is one place: no cell lies hidden in it."""
    if low == high:
        return True
    zones = grid.cells.zones
    if low == zones[0][0] or high == zones[-1][1]:
        return False  # an end beside a place
    places = grid.axis.places
    met = [p for p in places if p.low <= high and p.high >= low]
    roots_of = {monic(p.of[0]) for p in met if p.of}
    return len(roots_of) == 1 and all(p.of and p.of[1].is_sure for p in met)


def quotient(
    top: Polynomial, bottom: Polynomial, low: Fraction, high: Fraction
) -> Bounds | None:
    """Return the supremum of a quotient of polynomials between two values.

    `top`: at least 0 there; `bottom`: at least 0 there, and positive inside unless it
    is 0 everywhere.

    Returns:
        0 where `top` is 0 everywhere; None if the quotient has no bound; up to
        `UNKNOWN` if none was found.

    Example:
        >>> x, square = (ZERO, ONE), (ZERO, ZERO, ONE)
        >>> quotient(square, x, Fraction(0), Fraction(3)).exact
        '3'
        >>> quotient(x, square, Fraction(0), Fraction(3)) is None
        True
    """
    top, bottom = difference(top, (ZERO,)), difference(bottom, (ZERO,))
    if top == (ZERO,):
        return Bounds(ZERO, ZERO)
    if top == bottom:
        return Bounds(ONE, ONE)
    if bottom == (ZERO,):
        return None
    for end in (low, high):
        while value_at(bottom, end) == 0:
            if value_at(top, end) != 0:
                return None
            top, bottom = (division(one, (-end, ONE))[0] for one in (top, bottom))
    if len(top) == len(bottom) == 1:
        ratio = top[0] / bottom[0]
        return Bounds(ratio, ratio)
    slope = difference(
        multiplied(derivative(top), bottom), multiplied(top, derivative(bottom))
    )
    ends = [value_at(top, end) / value_at(bottom, end) for end in (low, high)]
    least = most = max(ends)
    for root in roots(slope, low, high):
        above = values_near(top, root.low, root.high)
        below = values_near(bottom, root.low, root.high)
        if below[0] <= 0:
            return Bounds(least, UNKNOWN)
        least = max(least, above[0] / below[1])
        most = max(most, above[1] / below[0])
    return Bounds(least, most)


# --- distances


class RuleDistance(NamedTuple):
    """How far two rules' degrees are apart at most."""

    each: Bounds  # on the axis where they are farthest apart
    whole: Fraction  # no strength differs by more than this
    axis: int  # the position of that axis
    at: Fraction  # the value there at which they are farthest apart


def rule_distance(
    of: Factored, one: int, other: int, most: Fraction
) -> RuleDistance | None:
    """Return how far two rules are apart, None if it is more than `most`.

    Under the minimum strengths differ by at most the largest distance on an axis, under
    the product by at most the sum of them.
    """
    if not of.near(one, most)[other]:
        return None
    each, whole, result = Bounds(ZERO, ZERO), ZERO, (0, ZERO)
    for axis, grid in enumerate(of.grids):
        gap = Bounds(ZERO, ZERO)
        for at, near in _gaps(of, axis, one, other):
            if near.low > most:
                return None
            if near.high > gap.high:
                gap = near
                if near.high > each.high:
                    each, result = near, (axis, at)
        if not each.high:
            result = result if axis else (0, grid.cells.zones[0][0])
        whole = whole + gap.high if of.is_product else max(whole, gap.high)
    return None if each.low > most else RuleDistance(each, whole, *result)


def _gaps(
    of: Factored, axis: int, one: int, other: int
) -> Iterator[tuple[Fraction, Bounds]]:
    """Yield places of an axis with how far two rules' degrees are apart there."""
    zones = of.grids[axis].cells.zones
    if of.has_start(axis):
        gap = abs(of.at_start(axis, one) - of.at_start(axis, other))
        yield zones[0][0], Bounds(gap, gap)
    for cell, (low, high) in enumerate(of.grids[axis].cells.between):
        above, below = (of.polynomial(axis, rule, cell) for rule in (one, other))
        checkpoint()
        if above == below:
            continue
        yield from sizes(difference(above, below), low, high)
    lows, highs = of.at_zones[axis]
    for number, (a, b) in enumerate(zones):
        beside = range(max(number - 1, 0), min(number + 1, len(zones) - 1))
        if a < b and any(
            of.polynomial(axis, one, cell) != of.polynomial(axis, other, cell)
            for cell in beside
        ):
            sides = [(one, other), (other, one)]
            most = max(
                Fraction(highs[p, number]) - Fraction(lows[q, number]) for p, q in sides
            )
            yield (a + b) / 2, Bounds(ZERO, most)
