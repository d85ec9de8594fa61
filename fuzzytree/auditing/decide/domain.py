"""The domain of an audit, and the exact values of variables on it.

The domain is a closed box: a proof without one is useless, for far outside the data
nearly all of space is uncovered. So each input has two ends, with their origin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import Literal

from msgspec.structs import replace

from fuzzytree.model import Part, Value, Variable
from fuzzytree.rechecking import stretch

Origin = Literal["model", "data", "spreads", "curves", "unused", "limits"]
"""The origin of a side: the range in the model, the smallest and largest value of the
rows, k spreads around the fitted sets, the span of the curves, none (no prediction
depends on the variable), the user."""


class DomainSide(Value, frozen=True):
    """The values of one variable in the domain: those that rows can have.

    Attributes:
        variable: An input; or a combination, which limits its inputs together.
        low: The lower end, finite.
        high: The upper end, finite, not below `low`.
        origin: Where the two come from.
        is_open: Whether `low` itself is left out.
        values: The only values from low to high, ascending: the codes of categories.
            Empty if every number is one, or every whole number.
        is_whole: Whether only whole numbers are; both ends are whole then.
        missing: The stand-in of a missing value: one more value of rows, which may lie
            beyond the ends or between whole numbers.
        word: All values as a table has them, as of `Span`; only in results.
    """

    variable: str
    low: float
    high: float
    origin: Origin = "limits"
    is_open: bool = False
    values: tuple[float, ...] = ()
    is_whole: bool = False
    missing: float | None = None
    word: str = ""

    @property
    def points(self) -> tuple[float, ...]:
        """All values of an axis of categories, the stand-in too; empty for numbers."""
        stand_in = () if self.missing is None else (self.missing,)
        return tuple(sorted({*self.values, *stand_in})) if self.values else ()

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """The least and the largest value, exactly; one may be the stand-in."""
        low, high = Fraction(self.low), Fraction(self.high)
        if self.missing is None:
            return low, high
        return min(low, Fraction(self.missing)), max(high, Fraction(self.missing))

    def has(self, value: Fraction) -> bool:
        """Return whether a row can have a value, exactly.

        Example:
            >>> doors = DomainSide("doors", 1.0, 5.0, is_whole=True, missing=2.5)
            >>> [doors.has(Fraction(n, 2)) for n in (2, 3, 5, 12)]
            [True, False, True, False]
        """
        if self.is_open and value == self.low != self.missing:
            return False
        return stretch(self, value, value).ends(self) is not None

    def nearest(self, value: Fraction) -> Fraction:
        """Return the value nearest to a number that rows can have, the lower of two.

        Example:
            >>> doors = DomainSide("doors", 1.0, 5.0, is_whole=True)
            >>> [int(doors.nearest(Fraction(n, 2))) for n in (-3, 5, 7, 30)]
            [1, 2, 3, 5]
        """
        inside = min(max(value, Fraction(self.low)), Fraction(self.high))
        if self.is_whole:
            inside = Fraction(math.ceil(inside - Fraction(1, 2)))
        numbers = [*map(Fraction, self.points)] or [inside]
        if self.missing is not None:
            numbers.append(Fraction(self.missing))
        return min(numbers, key=lambda number: (abs(number - value), number))


class Domain(Value, frozen=True):
    """A box: a side for each input, and for combinations that are limited besides."""

    sides: tuple[DomainSide, ...]

    def side(self, variable: str) -> DomainSide | None:
        """Return the side of a variable, None if it has none."""
        return next((side for side in self.sides if side.variable == variable), None)


def whole_side(side: DomainSide) -> DomainSide:
    """Return the whole numbers of a side.

    Raises:
        ValueError: If there are none.

    Example:
        >>> side = whole_side(DomainSide("doors", 1.5, 4.5))
        >>> side.low, side.high, side.is_whole
        (2.0, 4.0, True)
    """
    low, high = float(math.ceil(side.low)), float(math.floor(side.high))
    if low > high:
        raise ValueError(
            f"{side.variable!r} is a whole number, and {side.low!r} to {side.high!r} "
            "has none"
        )
    return replace(side, low=low, high=high, is_whole=True)


# --- variables at a point and on a box

Point = dict[str, Fraction]
"""A value for each input."""


def variable_value(variable: Variable, point: Mapping[str, Fraction]) -> Fraction:
    """Return the exact value of a variable at a point of the inputs."""
    if not variable.parts:
        return point[variable.name]
    total = Fraction(0)
    for part in variable.parts:
        total += Fraction(part.weight) * (point[part.input] - Fraction(part.centre))
    return total


def linear_form(
    variable: Variable, number: Mapping[str, int]
) -> tuple[dict[int, Fraction], Fraction]:
    """Return a variable as weights of the inputs, by their numbers, and a constant."""
    if not variable.parts:
        return {number[variable.name]: Fraction(1)}, Fraction(0)
    return combination(variable.parts, number)


def combination(
    parts: Iterable[Part], number: Mapping[str, int]
) -> tuple[dict[int, Fraction], Fraction]:
    """Return a combination as weights of the inputs, by their numbers, and a constant.

    Summands of one input are added up; what cancels is left out.
    """
    weights: dict[int, Fraction] = {}
    constant = Fraction(0)
    for part in parts:
        weight, place = Fraction(part.weight), number[part.input]
        weights[place] = weights.get(place, Fraction(0)) + weight
        constant -= weight * Fraction(part.centre)
    return {place: weight for place, weight in weights.items() if weight}, constant


def span(variable: Variable, domain: Domain) -> tuple[Fraction, Fraction]:
    """Return the least and largest exact value of a variable on a box.

    A combination is linear, so both are reached at corners; its own side, if it has
    one, cuts them. The first is above the second if nothing is left.
    """
    side = domain.side(variable.name)
    if not variable.parts:
        assert side is not None  # checked when the ground was made
        return side.ends
    number = {of.variable: place for place, of in enumerate(domain.sides)}
    weights, low = linear_form(variable, number)
    high = low
    for place, weight in weights.items():
        of = domain.sides[place]
        ends = [weight * end for end in of.ends]
        low, high = low + min(ends), high + max(ends)
    if side is not None:
        low, high = max(low, Fraction(side.low)), min(high, Fraction(side.high))
    return low, high


def snap(
    domain: Domain, variables: Iterable[Variable], point: Mapping[str, Fraction]
) -> Point:
    """Return the values of rows nearest to a point; itself if they leave the domain."""
    sides = {side.variable: side for side in domain.sides}
    near = {
        name: sides[name].nearest(value) if name in sides else value
        for name, value in point.items()
    }
    return near if contains(domain, variables, near) else dict(point)


def contains(
    domain: Domain, variables: Iterable[Variable], point: Mapping[str, Fraction]
) -> bool:
    """Return whether a point of the inputs is in a domain, exactly.

    Example:
        >>> from fuzzytree.auditing.decide.domain import DomainSide
        >>> box = Domain((DomainSide("x", 0.0, 1.0, is_open=True),))
        >>> contains(box, [Variable("x")], {"x": Fraction(0)})
        False
    """
    for variable in variables:
        side = domain.side(variable.name)
        if side is None:
            continue
        if not side.has(variable_value(variable, point)):
            return False
    return True


_DIGITS = (2, 3, 5, 8, 12)  # tried for each value of a witness


def simplify(
    point: Mapping[str, Fraction],
    domain: Domain,
    holds: Callable[[Mapping[str, Fraction]], bool],
) -> dict[str, Fraction]:
    """Return a point of fewer digits near another one.

    `domain`: where the point stays; `holds`: whether a point will do.

    Example:
        >>> from fuzzytree.auditing.decide.domain import Domain, DomainSide
        >>> box = Domain((DomainSide("x", 0.0, 1.0),))
        >>> simplify({"x": Fraction(1, 3)}, box, lambda at: 3 * at["x"] < 1)
        {'x': Fraction(5944751508129055, 18014398509481984)}
    """
    best = dict(point)
    for name, value in point.items():
        side = domain.side(name)
        for digits in _DIGITS if side else ():
            near = float(f"{float(value):.{digits}g}")
            if side is None or not side.has(Fraction(near)):
                continue
            tried = {**best, name: Fraction(near)}
            if holds(tried):
                best = tried
                break
    return best
