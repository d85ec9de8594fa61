"""Points of the inputs that lie in a box of the axes, as doubles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.linear import ZERO, Row, feasible
from fuzzytree.auditing.engine.stretches import Key, Stretch
from fuzzytree.auditing.engine.variables import linear_form
from fuzzytree.model.rulebase import RuleBase, Variable

Point = Mapping[str, Fraction]


class Places:
    """The inputs of some rule bases on a domain, and where axes take them.

    Args:
        models: The rule bases.
        keys: The axes; see `fuzzytree.auditing.engine.stretches`.
        domain: A side for each input.

    Raises:
        ValueError: If an input has no side.
    """

    def __init__(
        self, models: Sequence[RuleBase], keys: Sequence[Key], domain: Domain
    ) -> None:
        self.inputs = tuple(dict.fromkeys(n for model in models for n in model.inputs))
        self.keys = keys
        self.has_sums = not all(isinstance(key, str) for key in keys)
        sides = {side.variable: side for side in domain.sides}
        missing = [name for name in self.inputs if name not in sides]
        if missing:
            raise ValueError(f"the domain has no side for {missing[0]!r}")
        self._place = {name: number for number, name in enumerate(self.inputs)}
        self._ranges = [
            (Fraction(sides[name].low), Fraction(sides[name].high))
            for name in self.inputs
        ]
        self._limits = [
            _row(v.parts, self._place, Stretch(Fraction(one.low), Fraction(one.high)))
            for model in models
            for v in model.variables
            if v.parts and (one := sides.get(v.name)) is not None
        ]

    def some(self, box: Sequence[Stretch]) -> list[Point]:
        """Return points of a box, where axes are inputs: its middle and its far end."""
        given = dict(zip(map(str, self.keys), box, strict=True))
        whole = {
            name: given.get(name, Stretch(low, high))
            for name, (low, high) in zip(self.inputs, self._ranges, strict=True)
        }
        return [
            {name: middle(one) for name, one in whole.items()},
            {name: one.high for name, one in whole.items()},
        ]

    def solved(self, box: Sequence[Stretch]) -> Point | None:
        """Return a point whose axes lie in a box, None if there is none."""
        rows = [
            _row(key, self._place, one, is_open=not one.is_closed)
            for key, one in zip(self.keys, box, strict=True)
        ]
        found = feasible(self._ranges, [*rows, *self._limits])
        return None if found is None else dict(zip(self.inputs, found, strict=True))

    def in_doubles(self, point: Point) -> Point | None:
        """Return the doubles nearest to a point, if they are on the domain."""
        near = {name: Fraction(float(point[name])) for name in self.inputs}
        values = list(near.values())
        pairs = zip(values, self._ranges, strict=True)
        is_within = all(low <= value <= high for value, (low, high) in pairs)
        is_within = is_within and all(_holds(row, values) for row in self._limits)
        return near if is_within else None


def middle(stretch: Stretch) -> Fraction:
    """Return the double nearest to the middle, or the middle if no double is inside.

    Example:
        >>> middle(Stretch(Fraction(0), Fraction(1)))
        Fraction(1, 2)
    """
    exact = (stretch.low + stretch.high) / 2
    near = Fraction(float(exact))
    return near if stretch.low < near < stretch.high else exact


def _row(
    key: Key, place: Mapping[str, int], stretch: Stretch, *, is_open: bool = False
) -> Row:
    """Return that an axis lies on a stretch, as an inequality of the inputs."""
    if isinstance(key, str):
        weights = {place[key]: Fraction(1)}
        return Row(weights, stretch.low, stretch.high, is_open)
    weights, constant = linear_form(Variable("", parts=key), place)
    return Row(weights, stretch.low - constant, stretch.high - constant, is_open)


def _holds(row: Row, values: Sequence[Fraction]) -> bool:
    total = sum((w * values[k] for k, w in row.weights.items()), ZERO)
    return (row.low is None or row.low <= total) and (
        row.high is None or total <= row.high
    )
