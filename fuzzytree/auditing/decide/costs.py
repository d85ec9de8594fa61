"""What a change of a row costs: the largest of what the changes of its inputs cost.

So all changes up to some cost are a box around the row. An input changes by numbers, in
shares of the domain's width of it; a category changes or does not, which costs as much
as a whole width; so does a change from a number to the stand-in of a missing value.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from fractions import Fraction

from msgspec.structs import replace

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.domain import Domain, DomainSide, Point
from fuzzytree.model import Value
from fuzzytree.numerics import outwards

NARROW = Fraction(1, 1000)
"""The bounds of a cost differ by about this share, unless they say why."""

LEAST = Fraction(1, 2**40)
"""Costs below it are taken for 0."""


class Nearest(Value, frozen=True):
    """Bounds of what the cheapest change of some kind costs.

    Attributes:
        low: No such change costs less.
        high: The cost of `point`; None if no such change is known.
        point: The row that the change leads to.
        why: Why the bounds are not narrow, or why there is no point.
        is_none: Whether it is proved that no row of the domain is of the kind.
    """

    low: Fraction
    high: Fraction | None = None
    point: Point | None = None
    why: str = ""
    is_none: bool = False

    @property
    def is_narrow(self) -> bool:
        """Whether the bounds are as narrow as `NARROW` requires."""
        if self.high is None:
            return self.is_none
        return self.high - self.low <= max(2 * NARROW * self.high, 2 * LEAST)


class Costs:
    """What changes cost in a domain.

    Args:
        domain: The values of the inputs.
        inputs: The inputs.
        fixed: Those that do not change.
        costs: What a change by 1 costs, by input, or any change of a category.

    Example:
        >>> box = Domain((DomainSide("x", 0.0, 4.0), DomainSide("y", 0.0, 1.0)))
        >>> zero = {"x": Fraction(0), "y": Fraction(0)}
        >>> costs = Costs(box, ("x", "y"))
        >>> str(costs.distance(zero, {"x": Fraction(1), "y": Fraction(1, 8)}))
        '1/4'
    """

    def __init__(
        self,
        domain: Domain,
        inputs: Collection[str],
        fixed: Collection[str] = (),
        costs: Mapping[str, Fraction] | None = None,
    ) -> None:
        given = {name: Fraction(cost) for name, cost in (costs or {}).items()}
        unknown = [name for name in (*fixed, *given) if name not in inputs]
        if unknown:
            names = ", ".join(inputs)
            raise ValueError(f"{unknown[0]!r} is no input; the inputs are {names}")
        if any(cost <= 0 for cost in given.values()):
            raise ValueError("a change must cost more than 0; fix inputs that stay")
        self.sides = {side.variable: side for side in domain.sides}
        self.inputs, self.fixed = tuple(inputs), frozenset(fixed)
        self.rate: dict[str, Fraction] = {}
        self.whole: dict[str, Fraction] = {}
        for name in self.inputs:
            side = self.sides[name]
            width = Fraction(side.high) - Fraction(side.low)
            if side.values:
                self.rate[name], self.whole[name] = ZERO, given.get(name, ONE)
            else:
                rate = given.get(name, 1 / width if width else ZERO)
                self.rate[name] = rate
                self.whole[name] = rate * width or ONE

    def stand_in(self, name: str) -> Fraction | None:
        """Return the stand-in of an input that is none of its numbers."""
        side = self.sides[name]
        if side.missing is None or side.values:
            return None
        missing = Fraction(side.missing)
        return None if replace(side, missing=None).has(missing) else missing

    def of(self, name: str, old: Fraction, new: Fraction) -> Fraction:
        """Return what a change of an input costs."""
        if old == new:
            return ZERO
        if self.sides[name].values or self.stand_in(name) in (old, new):
            return self.whole[name]
        return abs(new - old) * self.rate[name]

    def distance(
        self, old: Mapping[str, Fraction], new: Mapping[str, Fraction]
    ) -> Fraction:
        """Return what a change of a row costs."""
        every = (self.of(name, old[name], new[name]) for name in self.inputs)
        return max(every, default=ZERO)

    @property
    def most(self) -> Fraction:
        """What no change costs more than."""
        return max(self.whole.values(), default=ZERO)

    def within(self, point: Mapping[str, Fraction], most: Fraction) -> Domain:
        """Return the part of the domain of all changes up to a cost, about.

        Where ends are no doubles, they are rounded outwards.
        """
        sides = self.sides.values()
        return Domain(
            tuple(
                self._near(side, point[side.variable], most)
                if side.variable in self.whole
                else side
                for side in sides
            )
        )

    def _near(self, side: DomainSide, x: Fraction, most: Fraction) -> DomainSide:
        """Return the part of a side around a value of it up to a cost."""
        name = side.variable
        reach = ZERO if name in self.fixed else most
        values = [v for v in side.values if self.of(name, x, Fraction(v)) <= reach]
        missing = side.missing
        if missing is not None and self.of(name, x, Fraction(missing)) > reach:
            missing = None
        low, high = side.low, side.high
        if side.values or (x == self.stand_in(name) and self.whole[name] > reach):
            values = values or [float(x)]  # a stand-in alone
            low, high, missing = values[0], values[-1], missing if side.values else None
        elif x != self.stand_in(name) and self.rate[name]:
            width = reach / self.rate[name]
            low = max(low, outwards(x - width)[0])
            high = min(high, outwards(x + width)[1])
            if side.is_whole:
                low, high = float(math.ceil(low)), float(math.floor(high))
        return replace(
            side,
            low=low,
            high=high,
            values=tuple(values),
            missing=missing,
            is_open=side.is_open and low == side.low,
            is_whole=side.is_whole and not values,
        )

    def nearest(self, side: DomainSide, x: Fraction) -> tuple[Fraction, Fraction]:
        """Return the least cost of a change into a part of an input, and the value.

        The open end of a part counts as a value of it.
        """
        name = side.variable
        values = [*map(Fraction, side.points)]
        if not values:
            values = [min(max(x, Fraction(side.low)), Fraction(side.high))]
            if side.is_whole:  # from which a stand-in may be a half
                values = [replace(side, missing=None).nearest(x)]
            if side.missing is not None:
                values.append(Fraction(side.missing))
        return min((self.of(name, x, value), value) for value in values)
