"""From values of the axes to points of the inputs, by linear inequalities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from fuzzytree.auditing.engine.arrangement import Arrangement
from fuzzytree.auditing.engine.domain import (
    Domain,
    Point,
    contains,
    linear_form,
)
from fuzzytree.auditing.engine.linear import (
    Row,
    feasible,
    inequalities,
    row_of,
    simple,
)

if TYPE_CHECKING:
    pass


class AxisStretch(NamedTuple):
    """The values of an axis with which an option reaches a level: an interval."""

    low: Fraction  # the lower end
    high: Fraction  # the upper end
    is_open: bool = True  # whether the ends themselves are left out


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
        value, side = simple(low, high), base.domain.side(names[place])
        if side is not None and not side.has(value):
            near = side.nearest((low + high) / 2)
            value = near if low <= near <= high else value
        point.append(value)
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
            if side is None or not side.has(Fraction(near)):
                continue
            tried = {**best, name: Fraction(near)}
            if holds(tried):
                best = tried
                break
    return best
