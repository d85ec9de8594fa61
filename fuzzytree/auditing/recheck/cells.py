"""An axis cut into cells: how a `never` is decided again, under the minimum.

A rule is stronger than some rivals at a point exactly if, at some level t, all of its
clauses are at t or above and each rival has a clause below t. An axis is cut where a
piece ends, where two degrees cross, and where one turns: in a cell between two cuts
all are monotone and in one order. Their values at cuts are the critical levels; nothing
changes between two of these, so one level there decides for all. Which clauses can be
at t or above together is computed per axis, and combined in `grid`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.recheck.model_records import Shape
from fuzzytree.auditing.recheck.outcomes import UndecidedError
from fuzzytree.auditing.recheck.polynomials import (
    ONE,
    ZERO,
    Piece,
    Poly,
    Root,
    at,
    derivative,
    enclosed,
    is_same,
    piece_at,
    pieces,
    plus,
    roots,
    times,
)

MOST_ROOTS, MOST_CRITICAL = 4_000, 4_000
FINE = Fraction(1, 2**50)

End = Root | Fraction
Function = tuple[tuple[Shape, ...], bool, Fraction]
"""The largest of some degrees, or 1 minus it; and what that is multiplied by."""


class Cell(NamedTuple):
    """A part of an axis where functions are in one order: per function, by number."""

    rank: list[int]
    left: list[int]  # the level at its left end
    right: list[int]


class Line(NamedTuple):
    """The values of a variable in the domain."""

    low: Fraction
    high: Fraction


class Levels:
    """The critical levels, numbered as they come, and later by bands."""

    def __init__(self) -> None:
        self.numbers: dict[object, int] = {}
        self.known: list[tuple[Poly, End]] = []
        self.band: list[int] = []
        self.bands: list[tuple[Fraction, Fraction]] = []

    def add(self, poly: Poly, end: End) -> int:
        """Return the number of the level that a polynomial has at an end."""
        if isinstance(end, Root) and end.low == end.high:
            end = end.low
        if isinstance(end, Fraction) or len(poly) < 2:
            value = at(poly, end if isinstance(end, Fraction) else ZERO)
            poly, end = (value,), ZERO
        number = self.numbers.setdefault((poly, end), len(self.known))
        if number == len(self.known):
            self.known.append((poly, end))
        if number > MOST_CRITICAL:
            raise UndecidedError(f"more than {MOST_CRITICAL} critical levels")
        return number

    def sort(self) -> None:
        """Give every level its band: levels that cannot be distinguished share one."""
        order = sorted((*self._bounds(n), n) for n in range(len(self.known)))
        self.band = [0] * len(order)
        for low, high, number in order:
            if not self.bands or low > self.bands[-1][1]:
                self.bands.append((low, high))
            else:
                self.bands[-1] = (self.bands[-1][0], max(high, self.bands[-1][1]))
            self.band[number] = len(self.bands) - 1

    def _bounds(self, number: int) -> tuple[Fraction, Fraction]:
        poly, end = self.known[number]
        if isinstance(end, Fraction):
            return poly[0], poly[0]
        low, high = enclosed(poly, end.low, end.high)
        width = end.high - end.low
        while high - low > FINE:
            width = min(width, end.high - end.low) / 2**16
            end.narrow(width)
            low, high = enclosed(poly, end.low, end.high)
        return low, high


def cells(functions: Sequence[Function], line: Line, levels: Levels) -> list[Cell]:
    """Return the cells of a line, and its lower end as a cell of its own."""
    result: list[Cell] = []
    is_wide = line.low < line.high
    for left, right, polys in stretches(functions, line) if is_wide else ():
        inside = between(left, right)
        ends = [[levels.add(poly, end) for poly in polys] for end in (left, right)]
        result.append(Cell(_ranks([at(poly, inside) for poly in polys]), *ends))
    here = {s: piece_at(s, line.low) for group, *_ in functions for s in group}
    values = [at(_chosen(f, here, line.low), line.low) for f in functions]
    lowest = [levels.add((value,), ZERO) for value in values]
    return [*result, Cell(_ranks(values), lowest, lowest)]


def _ranks(values: Sequence[Fraction]) -> list[int]:
    """Return the place of each value in their order; equal ones share it."""
    order = {value: place for place, value in enumerate(sorted(set(values)))}
    return [order[value] for value in values]


def stretches(
    functions: Sequence[Function], line: Line
) -> Iterator[tuple[End, End, list[Poly]]]:
    """Yield the parts of an axis, from left to right, and what functions are there."""
    shapes = dict.fromkeys(shape for group, *_ in functions for shape in group)
    ends = {e for s in shapes for p in pieces(s) for e in p[:2] if e is not None}
    inner = sorted(end for end in ends if line.low < end < line.high)
    cuts = [line.low, *inner, line.high]
    for a, b in itertools.pairwise(cuts):
        here = {shape: piece_at(shape, (a + b) / 2) for shape in shapes}
        met: list[End] = [a, *crossings(_curves(functions, here), a, b), b]
        for left, right in itertools.pairwise(met):
            inside = between(left, right)
            yield left, right, [_chosen(one, here, inside) for one in functions]


def between(left: End, right: End) -> Fraction:
    """Return a fraction between two ends."""
    low = left.high if isinstance(left, Root) else left
    return (low + (right.low if isinstance(right, Root) else right)) / 2


def _chosen(function: Function, here: Mapping[Shape, Piece], x: Fraction) -> Poly:
    """Return the polynomial that a function is around x."""
    best: tuple[Fraction, Poly] = (-ONE, ())
    for shape in function[0]:
        piece = here[shape]
        value = at(piece.poly, x)
        part = () if value <= 0 else piece.poly if value < piece.cap else (piece.cap,)
        best = max(best, (at(part, x), part), key=lambda pair: pair[0])
    result = plus((ONE,), best[1], -1) if function[1] else best[1]
    return result if function[2] == 1 else times(result, (function[2],))


def _curves(functions: Sequence[Function], here: Mapping[Shape, Piece]) -> list[Poly]:
    """Return every polynomial that a function can be in a part of the axis."""
    result: dict[Poly, None] = {}
    for group, negated, weight in functions:
        for shape in group:
            for part in (here[shape].poly, (here[shape].cap,), ()):
                one = plus((ONE,), part, -1) if negated else part
                result[one if weight == 1 else times(one, (weight,))] = None
    return list(result)


def crossings(curves: Sequence[Poly], a: Fraction, b: Fraction) -> list[Root]:
    """Return where two of some polynomials cross or one turns, in order."""
    polynomials = dict.fromkeys(derivative(poly) for poly in curves)
    pairs = itertools.combinations(curves, 2)
    polynomials |= dict.fromkeys(plus(one, other, -1) for one, other in pairs)
    if len(polynomials) > MOST_ROOTS:
        raise UndecidedError(
            f"more than {MOST_ROOTS} crossings to look for in one place"
        )
    met: list[Root] = []
    for poly in polynomials:
        for root in roots(poly, a, b):
            while root.low <= a or root.high >= b:
                root.halve()
            if not any(is_same(root, other) for other in met):
                met.append(root)
    return sorted(met, key=lambda root: root.low)


# --- heights and areas of terms


def height(shape: Shape, line: Line, level: Fraction) -> Fraction:
    """Return the largest degree on a line, from below; exactly at or below a level."""
    levels = Levels()
    mark = levels.add((level,), ZERO)
    result = cells([((shape,), False, ONE)], line, levels)
    levels.sort()
    most = max(levels.band[end] for cell in result for end in (*cell.left, *cell.right))
    bounds = levels.bands[most]
    if most == levels.band[mark] and bounds[0] < bounds[1]:
        raise UndecidedError("a height is too near to the level to decide")
    return bounds[0] if most <= levels.band[mark] else max(bounds[0], level)


def shared(one: Shape, other: Shape, line: Line) -> tuple[Fraction, Fraction] | None:
    """Return between which numbers the integral of min by that of max lies."""
    least = most = slack = ZERO
    if line.low == line.high:
        return None
    both = [((one,), False, ONE), ((other,), False, ONE)]
    for left, right, curves in stretches(both, line):
        inside = between(left, right)
        for root in (end for end in (left, right) if isinstance(end, Root)):
            root.narrow(FINE * (line.high - line.low))
            slack += root.high - root.low
        a = left.high if isinstance(left, Root) else left
        b = right.low if isinstance(right, Root) else right
        order = sorted(curves, key=lambda poly: at(poly, inside))
        wholes = [(ZERO, *(c / n for n, c in enumerate(p, 1))) for p in order]
        areas = [at(whole, b) - at(whole, a) for whole in wholes]
        least, most = least + areas[0], most + areas[1]
    return (least / (most + slack), (least + slack) / most) if most else None
