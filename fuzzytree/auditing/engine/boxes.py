"""The box around a point on which some rules stay above a level and others below."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from fuzzytree.auditing.engine.curves import ONE
from fuzzytree.auditing.engine.ground import Ground, Laid
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.parts import part_of
from fuzzytree.auditing.engine.states import Span
from fuzzytree.auditing.engine.variables import variable_value
from fuzzytree.numerics.exact import outwards

if TYPE_CHECKING:
    from fuzzytree.auditing.engine.axes import Values


class Held(NamedTuple):
    """What must hold along an axis.

    Attributes:
        level: A level.
        bound: What values must reach to reach it: the level, or the least double that
            does, where values are doubles.
        above: The positions of the rules that must reach it.
        below: The positions of the rules that must stay below it.
    """

    level: Fraction
    bound: Fraction | float
    above: Sequence[int]
    below: Sequence[int]


def region_around(
    given: Ground,
    point: Mapping[str, Fraction],
    above: Sequence[int],
    below: Sequence[int],
    *,
    between: tuple[Fraction, Fraction],
) -> tuple[Span, ...]:
    """Return a box around a point on which rules keep to two sides of a level.

    On all of it each of `above` is at least as strong as some level, and each of
    `below` is weaker than it, under the minimum. Only variables that matter have a
    span; the ends of spans are doubles. It is empty where no doubles are around.

    Args:
        given: The rules and the box.
        point: A point of it.
        above: Numbers of rules, from 1.
        below: Numbers of others.
        between: The strengths at the point between which the level is chosen: the
            largest of `below` and the least of `above`.
    """
    level = simple(*between)
    left = {number - 1 for number in below}
    at = [variable_value(axis.variable, point) for axis in given.axes]
    low_at: list[set[int]] = []
    for axis, value in zip(given.axes, at, strict=True):
        of = [element.degree(value) for element in axis.elements]
        degrees = [
            min((max(of[one] for one in group) for group in groups), default=ONE)
            for groups in axis.asked
        ]
        low_at.append({rule for rule in left if degrees[rule] < level})
    wanted: dict[int, set[int]] = {}
    while left:
        best = _widest(low_at, left)
        if not low_at[best] & left:
            return ()
        wanted[best] = low_at[best] & left
        left -= low_at[best]
    spans: list[Span] = []
    mine = [number - 1 for number in above]
    bound = level if given.is_fine else outwards(level)[1]
    for number, laid in enumerate(given.laid[0]):
        held = Held(level, bound, mine, sorted(wanted.get(number, ())))
        span = _span(laid, at[number], held)
        if span is None:
            continue
        if not (span.low or 0.0) <= at[number] <= (span.high or 0.0):
            return ()  # narrower than doubles tell
        spans.append(span)
    return tuple(spans)


def _widest(sets: Sequence[set[int]], left: set[int]) -> int:
    """Return the position of the set that holds most of what is left."""
    return max(range(len(sets)), key=lambda place: len(sets[place] & left))


def _span(laid: Laid, x: Fraction, held: Held) -> Span | None:
    """Return from where to where it holds along an axis; None if all along it."""
    zones = laid.cells.zones
    low, high = _walked(laid, x, held, -1), _walked(laid, x, held, 1)
    # It may not hold at the ends themselves, be they the axis's own.
    is_from = low <= zones[0][0] and _holds_at(laid, 0, held)
    is_to = high >= zones[-1][1] and _holds_at(laid, len(zones) - 1, held)
    if is_from and is_to:
        return None
    first, last = outwards(low)[1], outwards(high)[0]
    if first == low and low != x and not is_from:
        first = math.nextafter(first, math.inf)
    if last == high and high != x and not is_to:
        last = math.nextafter(last, -math.inf)
    return Span(laid.axis.variable.name, first, last)


def zone_of(zones: Sequence[tuple[Fraction, Fraction]], x: Fraction) -> int | None:
    """Return the number of the zone that a value is in, None if it is in a cell."""
    place = bisect_left(zones, x, key=lambda zone: zone[1])
    return place if place < len(zones) and zones[place][0] <= x else None


def cell_of(zones: Sequence[tuple[Fraction, Fraction]], x: Fraction) -> int:
    """Return the number of the cell that a value outside all zones is in."""
    return bisect_left(zones, (x, x)) - 1


def _walked(laid: Laid, x: Fraction, held: Held, step: int) -> Fraction:
    """Return how far it holds from a value, in one direction."""
    zones, cells = laid.cells.zones, laid.cells.between
    far = x
    place = zone_of(zones, x)
    if place is None:
        cell = cell_of(zones, x)
    else:
        if step > 0 and not _holds_after(laid, place, held):
            return far
        cell = place if step > 0 else place - 1
    while 0 <= cell < len(cells):
        low, high = cells[cell]
        start = max(low, x) if step > 0 else min(high, x)
        end = _end(laid, cell, start, held, step)
        if end is not None:
            return end
        place = cell + 1 if step > 0 else cell
        far = zones[place][0] if step > 0 else zones[place][1]
        if not _holds_at(laid, place, held):
            return far
        far = zones[place][1] if step > 0 else zones[place][0]
        if step > 0 and not _holds_after(laid, place, held):
            return far
        cell += step
    return far


def _end(
    laid: Laid, cell: int, start: Fraction, held: Held, step: int
) -> Fraction | None:
    """Return where in a cell it ends to hold; None if it holds to the cell's end."""
    elements = laid.axis.elements
    sides = [(int(laid.of[rule, cell]), True) for rule in held.above]
    sides += [(int(laid.of[rule, cell]), False) for rule in held.below]
    ends = laid.cells.between[cell]
    found: list[Fraction] = []
    for one, is_high in dict.fromkeys(sides):
        if _is_sure(laid, cell, one, held.bound, is_high=is_high):
            continue
        part = part_of(elements[one], ends, held.level, is_high=is_high, bits=64)
        if step > 0:
            if part.low > start or part.high < start:
                return start
            if part.high < ends[1]:
                found.append(part.high)
        else:
            if part.high < start or part.low > start:
                return start
            if part.low > ends[0]:
                found.append(part.low)
    if not found:
        return None
    return min(found) if step > 0 else max(found)


def _is_sure(
    laid: Laid, cell: int, one: int, bound: Fraction | float, *, is_high: bool
) -> bool:
    """Return whether an element keeps to its side in all of a cell, by its bounds."""
    first, last = laid.cells.right[:, one, cell], laid.cells.left[:, one, cell + 1]
    if is_high:
        return bool(min(first[0], last[0]) >= bound)
    return bool(max(first[1], last[1]) < bound)


def _holds_at(laid: Laid, place: int, held: Held) -> bool:
    return _holds(laid, place, held, laid.cells.left)


def _holds_after(laid: Laid, place: int, held: Held) -> bool:
    return _holds(laid, place, held, laid.cells.right)


def _holds(laid: Laid, place: int, held: Held, values: Values) -> bool:
    """Return whether it holds at a zone for sure, by the bounds of values there."""
    low, high = values[0][:, place].tolist(), values[1][:, place].tolist()

    def degree(rule: int, of: Sequence[float]) -> float:
        groups = laid.axis.asked[rule]
        return min(
            (max(of[one] for one in group) for group in groups), default=math.inf
        )

    return all(degree(rule, low) >= held.bound for rule in held.above) and all(
        degree(rule, high) < held.bound for rule in held.below
    )
