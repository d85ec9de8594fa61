"""From cells of the axes to points of the inputs, and the boxes around these.

A stretch is the part of a cell on which chosen curves reach a level and others stay
below it. Linear inequalities in fractions find the inputs that have such values.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid
from fuzzytree.auditing.engine.domain import (
    Domain,
    Point,
    contains,
    linear_form,
    variable_value,
)
from fuzzytree.auditing.engine.linear import (
    Row,
    feasible,
    inequalities,
    row_of,
    simple,
)
from fuzzytree.auditing.engine.pieces import ONE, ZERO, RuleCurve, piece_at, pieces
from fuzzytree.auditing.engine.polynomials import (
    difference,
    magnitude,
    refined,
    roots,
    value_at,
)
from fuzzytree.auditing.engine.states import Span
from fuzzytree.model import BoolArray
from fuzzytree.numerics import outwards

if TYPE_CHECKING:
    from fuzzytree.auditing.engine.axes import Values


START = -1  # the number of the option at an axis's lower end itself


class AxisStretch(NamedTuple):
    """The values of an axis with which an option reaches a level: an interval."""

    low: Fraction  # the lower end
    high: Fraction  # the upper end
    is_open: bool = True  # whether the ends themselves are left out


def stretch(
    grid: AxisGrid,
    cell: int,
    level: Fraction,
    high_ones: Iterable[int],
    low_ones: Iterable[int],
) -> AxisStretch | None:
    """Return where in a cell some elements are at a level or above, others below it.

    `level`: A level that is in no band.

    Returns:
        A part of the cell, shorter than the true one by next to nothing; None if there
        is none.
    """
    limits = _limits(grid, (level, level), high_ones, low_ones)
    if cell == START:
        return _start(grid, limits)
    for bits in (64, 256, 1024):
        low, high = _common(limits, grid.cells.between[cell], bits)
        if low < high:
            return AxisStretch(low, high)
    return None


class _Limit(NamedTuple):
    """A curve that must reach a level, or stay below it."""

    curve: RuleCurve
    level: Fraction
    is_high: bool


def _limits(
    grid: AxisGrid,
    levels: tuple[Fraction, Fraction],
    high_ones: Iterable[int],
    low_ones: Iterable[int],
) -> list[_Limit]:
    curves = grid.axis.elements
    return [
        *(_Limit(curves[one], levels[0], True) for one in high_ones),
        *(_Limit(curves[one], levels[1], False) for one in low_ones),
    ]


def _start(grid: AxisGrid, limits: Iterable[_Limit]) -> AxisStretch | None:
    """Return the lower end of an axis, if limits hold there."""
    at = grid.cells.zones[0][0]
    fits = all((curve.degree(at) >= level) is up for curve, level, up in limits)
    return AxisStretch(at, at, is_open=False) if fits else None


def _common(
    limits: Iterable[_Limit],
    ends: tuple[Fraction, Fraction],
    bits: int,
    margin: Fraction = ZERO,
) -> tuple[Fraction, Fraction]:
    """Return where in a cell limits hold: parts that are inner ones, or wider."""
    low, high = ends
    for curve, level, is_high in limits:
        part = part_of(curve, ends, level, is_high=is_high, bits=bits)
        if part.low <= part.high:
            part = AxisStretch(part.low - margin, part.high + margin)
        low, high = max(low, part.low), min(high, part.high)
    return low, high


def part_of(
    element: RuleCurve,
    ends: tuple[Fraction, Fraction],
    level: Fraction,
    *,
    is_high: bool,
    bits: int,
) -> AxisStretch:
    """Return the part of a cell where a monotone element is on a side of a level.

    A cell is within one piece, which is clipped on all of it or nowhere.
    """
    low, high = ends
    middle = (low + high) / 2
    piece = piece_at(pieces(element.shape), middle)
    goal = 1 - level if element.is_complement else level
    offset = difference(piece.polynomial, (goal,))
    result = () if piece.degree(middle) in (0, piece.cap) else roots(offset, low, high)
    if not result:
        is_met = (element.degree(middle) >= level) is is_high
        return AxisStretch(low, high) if is_met else AxisStretch(high, low)
    size = max(0, -magnitude(high - low))
    place = refined(offset, result[0], size + bits)
    starts_above = value_at(offset, low) > 0
    if starts_above is (is_high is not element.is_complement):
        return AxisStretch(low, place.low)
    return AxisStretch(place.high, high)


def widest(
    grid: AxisGrid,
    cell: int,
    levels: tuple[Fraction, Fraction],
    high_ones: Iterable[int],
    low_ones: Iterable[int],
) -> AxisStretch | None:
    """Return closed bounds of where a cell's option holds at any level of some.

    Nothing is left out: the elements of `high_ones` must reach the lower level and
    those of `low_ones` be below the upper one, and the zones at the cell's ends count.
    """
    limits = _limits(grid, levels, high_ones, low_ones)
    if cell == START:
        return _start(grid, limits)
    zones, ends = grid.cells.zones, grid.cells.between[cell]
    low, high = _common(limits, ends, 64, (ends[1] - ends[0]) / 2**60)
    if low > high:
        return None
    return AxisStretch(
        zones[cell][0] if low <= ends[0] else low,
        zones[cell + 1][1] if high >= ends[1] else high,
        is_open=False,
    )


# --- points of the inputs

_DIGITS = (2, 3, 5, 8, 12)  # tried for each value of a witness


def coupled(base: Arrangement) -> tuple[tuple[int, ...], ...]:
    """Return the groups of axes that share inputs, so that they are not free.

    An axis alone is free: an input takes every value of its side, and a combination
    every value between its least and its largest. Where the domain limits a
    combination, it is in a group with the axes that it shares inputs with.
    """
    inputs = [
        {part.input for part in axis.variable.parts} or {axis.variable.name}
        for axis in base.axes
    ]
    limited = [
        {part.input for part in variable.parts}
        for variable in base.rules.variables
        if variable.parts and base.domain.side(variable.name) is not None
    ]
    groups: list[tuple[set[int], set[str]]] = []
    for axis, names in [*enumerate(inputs), *((-1, names) for names in limited)]:
        members, joined = {axis} - {-1}, set(names)
        apart: list[tuple[set[int], set[str]]] = []
        for other in groups:
            if other[1] & joined:
                members |= other[0]
                joined |= other[1]
            else:
                apart.append(other)
        groups = [*apart, (members, joined)]
    return tuple(tuple(sorted(members)) for members, _ in groups if len(members) > 1)


def direction_of(base: Arrangement, axis: int) -> tuple[tuple[int, Fraction], ...]:
    """Return the weights of an axis's inputs that vary, as multiples of the first."""
    number = {name: place for place, name in enumerate(base.rules.inputs)}
    weights, _ = linear_form(base.axes[axis].variable, number)
    limits = [base.domain.side(name) for name in base.rules.inputs]
    kept = [
        (place, weight)
        for place, weight in sorted(weights.items())
        if (side := limits[place]) is not None and side.low < side.high
    ]
    return tuple((place, weight / kept[0][1]) for place, weight in kept)


def have_one_direction(base: Arrangement) -> bool:
    """Return whether curves of two axes can be one function of the inputs."""
    known = [direction_of(base, axis) for axis in range(len(base.axes))]
    result = [one for one in known if one]
    return len(set(result)) < len(result)


def point_with(base: Arrangement, wanted: Mapping[int, AxisStretch]) -> Point | None:
    """Return a point of the box whose axes have wanted values; None if there is none.

    Inputs on which nothing is wanted get a plain value near the middle of their side.

    `wanted`: for axes, by position, what they must be between.
    """
    names = base.rules.inputs
    number = {name: place for place, name in enumerate(names)}
    ranges, rows = inequalities(base.domain, names, base.rules.variables)
    for axis, part in wanted.items():
        variable, ends = base.axes[axis].variable, (part.low, part.high)
        is_open = part.is_open
        rows.append(
            row_of(variable, number, ends, is_open_low=is_open, is_open_high=is_open)
        )
    if not all(_may_hold(row) for row in rows if not row.weights):
        return None
    joined = {place for row in rows if len(row.weights) > 1 for place in row.weights}
    point: list[Fraction] = []
    for place, (low, high) in enumerate(ranges):
        if place in joined:
            point.append(low)
            continue
        for row in rows:
            if place in row.weights:  # and nothing else
                first, last = _ends(row, row.weights[place])
                low = low if first is None else max(low, first)
                high = high if last is None else min(high, last)
        if low > high:
            return None
        point.append(simple(low, high))
    if joined:
        order = sorted(joined)
        inner = {place: at for at, place in enumerate(order)}
        kept = [
            row._replace(weights={inner[p]: w for p, w in row.weights.items()})
            for row in rows
            if joined.issuperset(row.weights)
        ]
        result = feasible([ranges[place] for place in order], kept)
        if result is None:
            return None
        for place, at in inner.items():
            point[place] = result[at]
    return dict(zip(names, point, strict=True))


def _may_hold(row: Row) -> bool:
    """Return whether 0 is within a row's bounds; open ones are checked later."""
    return (row.low is None or row.low <= 0) and (row.high is None or row.high >= 0)


def _ends(row: Row, weight: Fraction) -> tuple[Fraction | None, Fraction | None]:
    """Return what the only input of a row must be between, given its weight."""
    first, last = (
        None if bound is None else bound / weight for bound in (row.low, row.high)
    )
    return (first, last) if weight > 0 else (last, first)


def is_within(base: Arrangement, point: Mapping[str, Fraction]) -> bool:
    """Return whether a point of the inputs lies in the domain."""
    return contains(base.domain, base.rules.variables, point)


def simplified(
    point: Mapping[str, Fraction],
    domain: Domain,
    holds: Callable[[Mapping[str, Fraction]], bool],
) -> dict[str, Fraction]:
    """Return a point of fewer digits near another one.

    `domain`: where the point stays; `holds`: whether a point will do.

    Example:
        >>> from fuzzytree.auditing.engine.domain import Domain, DomainSide
        >>> box = Domain((DomainSide("x", 0.0, 1.0),))
        >>> simplified({"x": Fraction(1, 3)}, box, lambda at: 3 * at["x"] < 1)
        {'x': Fraction(5944751508129055, 18014398509481984)}
    """
    best = dict(point)
    for name, value in point.items():
        side = domain.side(name)
        for digits in _DIGITS if side else ():
            near = float(f"{float(value):.{digits}g}")
            if side is None or not side.low <= near <= side.high:
                continue
            tried = {**best, name: Fraction(near)}
            if holds(tried):
                best = tried
                break
    return best


# --- the box around a point


class LevelSides(NamedTuple):
    """What must hold along an axis."""

    level: Fraction  # A level
    # what values must reach to reach it: the level, or the least double that does,
    # where values are doubles
    bound: Fraction | float
    above: Sequence[int]  # the positions of the rules that must reach it
    below: Sequence[int]  # the positions of the rules that must stay below it


def region_around(
    base: Arrangement,
    point: Mapping[str, Fraction],
    above: Sequence[int],
    below: Sequence[int],
    *,
    between: tuple[Fraction, Fraction],
) -> tuple[Span, ...]:
    """Return a box around a point on which rules keep to two sides of a level.

    On all of it each of `above` is at least as strong as some level, and each of
    `below` is weaker than it, or 0, under the minimum. Only variables that matter have
    a span; the ends of spans are doubles. It is empty where no doubles are around.
    """
    level = simple(*between)
    missing = {number - 1 for number in below}
    at = [variable_value(axis.variable, point) for axis in base.axes]
    low_at: list[set[int]] = []
    for axis, value in zip(base.axes, at, strict=True):
        of = [element.degree(value) for element in axis.elements]
        degrees = [
            min((max(of[one] for one in group) for group in groups), default=ONE)
            for groups in axis.propositions
        ]
        low_at.append(
            {rule for rule in missing if degrees[rule] < level or not degrees[rule]}
        )
    wanted: dict[int, set[int]] = {}
    while missing:
        best = _widest(low_at, missing)
        if not low_at[best] & missing:
            return ()
        wanted[best] = low_at[best] & missing
        missing -= low_at[best]
    spans: list[Span] = []
    mine = [number - 1 for number in above]
    bound = level if base.is_fine else outwards(level)[1]
    for number, grid in enumerate(base.grids):
        sides = LevelSides(level, bound, mine, sorted(wanted.get(number, ())))
        span = _span(grid, at[number], sides)
        if span is None:
            continue
        if not (span.low or 0.0) <= at[number] <= (span.high or 0.0):
            return ()  # narrower than doubles tell
        spans.append(span)
    return tuple(spans)


def _widest(sets: Sequence[set[int]], missing: set[int]) -> int:
    """Return the position of the set that holds most of what is left."""
    return max(range(len(sets)), key=lambda place: len(sets[place] & missing))


def _span(grid: AxisGrid, x: Fraction, sides: LevelSides) -> Span | None:
    """Return from where to where it holds along an axis; None if all along it."""
    zones = grid.cells.zones
    low, high = _walked(grid, x, sides, -1), _walked(grid, x, sides, 1)
    # It may not hold at the ends themselves, be they the axis's own.
    is_from, is_to = (_holds_there(grid, end, sides) for end in (low, high))
    if low <= zones[0][0] and high >= zones[-1][1] and is_from and is_to:
        return None
    first, last = outwards(low)[1], outwards(high)[0]
    if first == low and low != x and not is_from:
        first = math.nextafter(first, math.inf)
    if last == high and high != x and not is_to:
        last = math.nextafter(last, -math.inf)
    return Span(grid.axis.variable.name, first, last)


def _holds_there(grid: AxisGrid, x: Fraction, sides: LevelSides) -> bool:
    """Return whether it holds at a value for sure; False for one within a cell."""
    place = zone_of(grid.cells.zones, x)
    return place is not None and _holds_at(grid, place, sides)


def zone_of(zones: Sequence[tuple[Fraction, Fraction]], x: Fraction) -> int | None:
    """Return the number of the zone that a value is in, None if it is in a cell."""
    place = bisect_left(zones, x, key=lambda zone: zone[1])
    return place if place < len(zones) and zones[place][0] <= x else None


def cell_of(zones: Sequence[tuple[Fraction, Fraction]], x: Fraction) -> int:
    """Return the number of the cell that a value outside all zones is in."""
    return bisect_left(zones, (x, x)) - 1


def _walked(grid: AxisGrid, x: Fraction, sides: LevelSides, step: int) -> Fraction:
    """Return how far it holds from a value, in one direction."""
    zones, cells = grid.cells.zones, grid.cells.between
    far = x
    place = zone_of(zones, x)
    if place is None:
        cell = cell_of(zones, x)
    else:
        if step > 0 and not _holds_after(grid, place, sides):
            return far
        cell = place if step > 0 else place - 1
    while 0 <= cell < len(cells):
        low, high = cells[cell]
        start = max(low, x) if step > 0 else min(high, x)
        end = _end(grid, cell, start, sides, step)
        if end is not None:
            return end
        place = cell + 1 if step > 0 else cell
        far = zones[place][0] if step > 0 else zones[place][1]
        if not _holds_at(grid, place, sides):
            return far
        far = zones[place][1] if step > 0 else zones[place][0]
        if step > 0 and not _holds_after(grid, place, sides):
            return far
        cell += step
    return far


def _end(
    grid: AxisGrid, cell: int, start: Fraction, sides: LevelSides, step: int
) -> Fraction | None:
    """Return where in a cell it ends to hold; None if it holds to the cell's end."""
    elements = grid.axis.elements
    limits = [(int(grid.of[rule, cell]), True) for rule in sides.above]
    limits += [(int(grid.of[rule, cell]), False) for rule in sides.below]
    ends = grid.cells.between[cell]
    result: list[Fraction] = []
    for one, is_high in dict.fromkeys(limits):
        if _is_sure(grid, cell, one, sides.bound, is_high=is_high):
            continue
        part = part_of(elements[one], ends, sides.level, is_high=is_high, bits=64)
        if step > 0:
            if part.low > start or part.high < start:
                return start
            if part.high < ends[1]:
                result.append(part.high)
        else:
            if part.high < start or part.low > start:
                return start
            if part.low > ends[0]:
                result.append(part.low)
    if not result:
        return None
    return min(result) if step > 0 else max(result)


def _is_sure(
    grid: AxisGrid, cell: int, one: int, bound: Fraction | float, *, is_high: bool
) -> bool:
    """Return whether an element keeps to its side in all of a cell, by its bounds."""
    first, last = grid.cells.right[:, one, cell], grid.cells.left[:, one, cell + 1]
    if is_high:
        return bool(min(first[0], last[0]) >= bound)
    return bool(max(first[1], last[1]) < bound or grid.is_zero[one, cell])


def _holds_at(grid: AxisGrid, place: int, sides: LevelSides) -> bool:
    return _holds(grid, place, sides, grid.cells.left, grid.is_zero_at)


def _holds_after(grid: AxisGrid, place: int, sides: LevelSides) -> bool:
    is_last = place == len(grid.cells.between)
    is_zero = grid.is_zero_at if is_last else grid.is_zero
    return _holds(grid, place, sides, grid.cells.right, is_zero)


def _holds(
    grid: AxisGrid, place: int, sides: LevelSides, values: Values, is_zero: BoolArray
) -> bool:
    """Return whether it holds at a zone for sure, by the bounds of values there."""
    low = values[0][:, place].tolist()
    high = np.where(is_zero[:, place], 0.0, values[1][:, place]).tolist()
    # A level is above 0, or what stays below it is 0.
    bound = sides.bound or math.ulp(0.0)

    def degree(rule: int, of: Sequence[float]) -> float:
        groups = grid.axis.propositions[rule]
        return min(
            (max(of[one] for one in group) for group in groups), default=math.inf
        )

    return all(degree(rule, low) >= sides.bound for rule in sides.above) and all(
        degree(rule, high) < bound for rule in sides.below
    )
