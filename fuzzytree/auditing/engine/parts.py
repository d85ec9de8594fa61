"""From an option of an axis to the values of the axis on which it holds at a level."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.engine.curves import piece_at, pieces
from fuzzytree.auditing.engine.elements import Element
from fuzzytree.auditing.engine.ground import Laid
from fuzzytree.auditing.engine.polynomials import (
    difference,
    magnitude,
    refined,
    roots,
    value_at,
)

START = -1  # the number of the option at an axis's lower end itself


class Stretch(NamedTuple):
    """Values of an axis on which an option holds at a level: all between low and high.

    Attributes:
        low: The lower end.
        high: The upper end.
        is_open: Whether the ends themselves are left out.
    """

    low: Fraction
    high: Fraction
    is_open: bool = True


def stretch(
    laid: Laid,
    cell: int,
    level: Fraction,
    high_ones: Iterable[int],
    low_ones: Iterable[int],
) -> Stretch | None:
    """Return where in a cell some elements are at a level or above, others below it.

    Args:
        laid: The axis.
        cell: The cell, or `START`.
        level: A level that is in no band.
        high_ones: The elements that must reach it.
        low_ones: The elements that must stay below it.

    Returns:
        A part of the cell, shorter than the true one by next to nothing; None if there
        is none.
    """
    sides = [*((one, True) for one in high_ones), *((one, False) for one in low_ones)]
    elements = laid.axis.elements
    if cell == START:
        at = laid.cells.zones[0][0]
        fits = all((elements[e].degree(at) >= level) is up for e, up in sides)
        return Stretch(at, at, is_open=False) if fits else None
    ends = laid.cells.between[cell]
    for bits in (64, 256, 1024):
        low, high = ends
        for one, is_high in sides:
            found = part_of(elements[one], ends, level, is_high=is_high, bits=bits)
            low, high = max(low, found.low), min(high, found.high)
        if low < high:
            return Stretch(low, high)
    return None


def part_of(
    element: Element,
    ends: tuple[Fraction, Fraction],
    level: Fraction,
    *,
    is_high: bool,
    bits: int,
) -> Stretch:
    """Return the part of a cell where a monotone element is on a side of a level.

    A cell is within one piece, which is clipped on all of it or nowhere.
    """
    low, high = ends
    middle = (low + high) / 2
    piece = piece_at(pieces(element.shape), middle)
    goal = 1 - level if element.is_complement else level
    crossed = difference(piece.polynomial, (goal,))
    found = () if piece.degree(middle) in (0, piece.cap) else roots(crossed, low, high)
    if not found:
        is_met = (element.degree(middle) >= level) is is_high
        return Stretch(low, high) if is_met else Stretch(high, low)
    size = max(0, -magnitude(high - low))
    place = refined(crossed, found[0], size + bits)
    starts_above = value_at(crossed, low) > 0
    if starts_above is (is_high is not element.is_complement):
        return Stretch(low, place.low)
    return Stretch(place.high, high)


def widest(
    laid: Laid,
    cell: int,
    levels: tuple[Fraction, Fraction],
    high_ones: Iterable[int],
    low_ones: Iterable[int],
) -> Stretch | None:
    """Return closed bounds of where a cell's option holds at any level of some.

    Nothing is left out: the elements of `high_ones` must reach the lower level and
    those of `low_ones` be below the upper one, and the zones at the cell's ends count.
    """
    elements = laid.axis.elements
    zones = laid.cells.zones
    if cell == START:
        at = zones[0][0]
        fits = all(elements[one].degree(at) >= levels[0] for one in high_ones) and all(
            elements[one].degree(at) < levels[1] for one in low_ones
        )
        return Stretch(at, at, is_open=False) if fits else None
    low, high = laid.cells.between[cell]
    ends = low, high
    first, last = zones[cell][0], zones[cell + 1][1]
    for one in high_ones:
        part = _outer(
            part_of(elements[one], ends, levels[0], is_high=True, bits=64), ends
        )
        low, high = max(low, part.low), min(high, part.high)
    for one in low_ones:
        part = _outer(
            part_of(elements[one], ends, levels[1], is_high=False, bits=64), ends
        )
        low, high = max(low, part.low), min(high, part.high)
    if low > high:
        return None
    return Stretch(
        first if low <= ends[0] else low,
        last if high >= ends[1] else high,
        is_open=False,
    )


def _outer(part: Stretch, ends: tuple[Fraction, Fraction]) -> Stretch:
    """Return bounds of a part that its own ends, inner ones, fall short of."""
    if part.low > part.high:
        return part
    margin = (ends[1] - ends[0]) / 2**60
    return Stretch(part.low - margin, part.high + margin)
