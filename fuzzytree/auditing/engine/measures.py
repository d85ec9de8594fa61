"""Heights, areas and distances of curves on an axis, between exact bounds.

An axis is cut (`fuzzytree.auditing.engine.axes`) so that within a cell every curve is
one polynomial. What is asked of a curve is then asked of polynomials, in fractions.
Only where a cell ends at an irrational place is the answer a narrow interval.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from fuzzytree.auditing.engine.axes import Cells, cut
from fuzzytree.auditing.engine.curves import ONE, ZERO, piece_at, pieces
from fuzzytree.auditing.engine.elements import Element, places
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    composed,
    derivative,
    difference,
    integers,
    integral,
    roots,
    value_at,
)
from fuzzytree.model.interrupts import checkpoint
from fuzzytree.model.rulebase import Shape

if TYPE_CHECKING:
    pass


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


Seen = tuple[Bounds, Fraction]
"""A value, and a point where a curve has it or comes near it."""


class Line(NamedTuple):
    """Curves on an axis between two ends, cut into cells.

    Attributes:
        elements: The curves.
        cells: The cells.
        is_open: Whether the lower end itself is left out.
    """

    elements: tuple[Element, ...]
    cells: Cells
    is_open: bool = False

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """The lower and the upper end."""
        return self.cells.zones[0][0], self.cells.zones[-1][1]


def line(
    shapes: Sequence[Shape], low: Fraction, high: Fraction, *, is_open: bool = False
) -> Line:
    """Return shapes on an axis, cut where something changes.

    Raises:
        ValueError: If `low` is above `high`.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = Points((0.0, 2.0), (0.0, 1.0))
        >>> found = line([ramp], Fraction(-1), Fraction(1))
        >>> tuple(map(int, found.ends))
        (-1, 1)
    """
    if low > high:
        raise ValueError(f"no axis from {low} to {high}")
    elements = tuple(Element(shape) for shape in shapes)
    cells = cut(elements, places(elements), low, high)
    return Line(elements, cells, is_open)


def apart(shapes: Sequence[Shape], low: Fraction, high: Fraction) -> Line:
    """Return shapes on an axis, cut where one of them changes; not where two cross.

    In a cell each curve is one polynomial, but their order may change: enough for sums.
    """
    elements = tuple(Element(shape) for shape in shapes)
    found = [place for element in elements for place in places([element])]
    return Line(elements, cut(elements, found, low, high))


def local(element: Element, at: Fraction) -> Polynomial:
    """Return the polynomial that a curve is in the cell of a point, clipped or not.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> local(Element(Points((0.0, 2.0), (0.0, 1.0)), True), Fraction(1))
        (Fraction(1, 1), Fraction(-1, 2))
    """
    checkpoint()
    piece = piece_at(pieces(element.shape), at)
    degree = piece.degree(at)
    clipped = degree in (ZERO, piece.cap)
    polynomial = (degree,) if clipped else piece.polynomial
    return difference((ONE,), polynomial) if element.is_complement else polynomial


def multiplied(one: Polynomial, other: Polynomial) -> Polynomial:
    """Return the product of two polynomials.

    Example:
        >>> multiplied((Fraction(1), Fraction(1)), (Fraction(0), Fraction(2)))
        (Fraction(0, 1), Fraction(2, 1), Fraction(2, 1))
    """
    found = [ZERO] * (len(one) + len(other) - 1)
    for i, a in enumerate(one):
        for j, b in enumerate(other):
            found[i + j] += a * b
    return tuple(found)


def values_near(polynomial: Polynomial, low: Fraction, high: Fraction) -> Bounds:
    """Return bounds of a polynomial's values on a narrow closed interval."""
    if low == high:
        value = value_at(polynomial, low)
        return Bounds(value, value)
    numbers, common = integers(composed(polynomial, (low + high) / 2, (high - low) / 2))
    middle = Fraction(numbers[0], common)
    off = Fraction(sum(map(abs, numbers[1:])), common)
    return Bounds(middle - off, middle + off)


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
    yield low, values_near(polynomial, low, low)
    if low < high:
        if len(polynomial) > 2:
            for root in roots(derivative(polynomial), low, high):
                yield root.low, values_near(polynomial, root.low, root.high)
        yield high, values_near(polynomial, high, high)


def sizes(
    polynomial: Polynomial, low: Fraction, high: Fraction
) -> Iterator[tuple[Fraction, Bounds]]:
    """Yield what `extremes` does, with how far the values are from 0."""
    for at, value in extremes(polynomial, low, high):
        near, far = sorted((abs(value.low), abs(value.high)))
        yield at, Bounds(ZERO if value.low < 0 < value.high else near, far)


def area(of: Line, chosen: Callable[[int, Fraction], Polynomial]) -> Bounds:
    """Return the area under a curve with degrees in [0, 1] on a line.

    Args:
        of: The line.
        chosen: Given a cell's number and a point of it, the curve's polynomial there.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = line([Points((0.0, 2.0), (0.0, 1.0))], Fraction(0), Fraction(3))
        >>> area(ramp, lambda cell, at: local(ramp.elements[0], at)).exact
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


def heights(of: Line) -> tuple[Seen, ...]:
    """Return the supremum of each curve on a line, and a point where it is near.

    Example:
        >>> from fuzzytree.model.rulebase import Points
        >>> ramp = line([Points((0.0, 2.0), (0.0, 1.0))], Fraction(0), Fraction(1))
        >>> heights(ramp)[0][0].exact
        '1/2'
    """
    return tuple(_height(of, one) for one in range(len(of.elements)))


def _height(of: Line, one: int) -> Seen:
    found = [(bounds, at) for bounds, at in walk(of, one)]
    most = max(bounds.high for bounds, _ in found)
    low = max(bounds.low for bounds, _ in found)
    at = next(at for bounds, at in found if bounds.low == low)
    return Bounds(low, most), at


def walk(of: Line, one: int) -> Iterator[Seen]:
    """Yield a curve's values from left to right; it is monotone between neighbours.

    At a step both its values are yielded, each with a point where it is reached or
    approached.
    """
    zones = of.cells.zones
    for number, (a, b) in enumerate(zones):
        at = (a + b) / 2
        has_here = number > 0 or not of.is_open or len(zones) == 1
        if has_here:
            yield seen(of, one, number), at
        if number + 1 < len(zones):
            after = seen(of, one, number, is_after=True)
            if not has_here or after != seen(of, one, number):
                yield after, at


def seen(of: Line, one: int, zone: int, *, is_after: bool = False) -> Bounds:
    """Return a curve's value at a place, or its limit from above."""
    low, high = of.cells.zones[zone]
    if low == high:
        element = of.elements[one]
        value = element.degree_after(low) if is_after else element.degree(low)
        return Bounds(value, value)
    values = (of.cells.right if is_after else of.cells.left)[:, one, zone]
    return Bounds(Fraction(values[0]), Fraction(values[1]))
