"""From values of the axes to a point of the inputs, checked in fractions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.ground import Ground
from fuzzytree.auditing.engine.linear import Row, feasible, simple
from fuzzytree.auditing.engine.parts import Stretch
from fuzzytree.auditing.engine.variables import Point, contains, linear_form

_DIGITS = (2, 3, 5, 8, 12)  # tried for each value of a witness


def coupled(given: Ground) -> tuple[tuple[int, ...], ...]:
    """Return the groups of axes that share inputs, so that they are not free.

    An axis alone is free: an input takes every value of its side, and a combination
    every value between its least and its largest. Where the domain limits a
    combination, it is in a group with the axes that it shares inputs with.
    """
    inputs = [
        {part.input for part in axis.variable.parts} or {axis.variable.name}
        for axis in given.axes
    ]
    limited = [
        {part.input for part in variable.parts}
        for variable in given.rules.variables
        if variable.parts and given.domain.side(variable.name) is not None
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


def point_with(given: Ground, wanted: Mapping[int, Stretch]) -> Point | None:
    """Return a point of the box whose axes have wanted values; None if there is none.

    Inputs on which nothing is wanted get a plain value near the middle of their side.

    Args:
        given: Where.
        wanted: For axes, by position, what they must be between.
    """
    names = given.rules.inputs
    number = {name: place for place, name in enumerate(names)}
    ranges: list[tuple[Fraction, Fraction]] = []
    rows: list[Row] = []
    for name in names:
        side = given.domain.side(name)
        assert side is not None  # checked when the ground was made
        ranges.append((Fraction(side.low), Fraction(side.high)))
        if side.is_open:
            start = ranges[-1][0]
            rows.append(Row({number[name]: Fraction(1)}, start, is_open_low=True))
    for variable in given.rules.variables:
        side = given.domain.side(variable.name)
        if variable.parts and side is not None:
            weights, constant = linear_form(variable, number)
            low, high = Fraction(side.low) - constant, Fraction(side.high) - constant
            rows.append(Row(weights, low, high, is_open_low=side.is_open))
    for axis, part in wanted.items():
        weights, constant = linear_form(given.axes[axis].variable, number)
        low, high = part.low - constant, part.high - constant
        rows.append(Row(weights, low, high, part.is_open, part.is_open))
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
        asked = sorted(joined)
        inner = {place: at for at, place in enumerate(asked)}
        kept = [
            row._replace(weights={inner[p]: w for p, w in row.weights.items()})
            for row in rows
            if joined.issuperset(row.weights)
        ]
        found = feasible([ranges[place] for place in asked], kept)
        if found is None:
            return None
        for place, at in inner.items():
            point[place] = found[at]
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


def is_within(given: Ground, point: Mapping[str, Fraction]) -> bool:
    """Return whether a point of the inputs lies in the domain."""
    return contains(given.domain, given.rules.variables, point)


def simplified(
    point: Mapping[str, Fraction],
    domain: Domain,
    holds: Callable[[Mapping[str, Fraction]], bool],
) -> dict[str, Fraction]:
    """Return a point of fewer digits near another one.

    Args:
        point: The point; what has no side in the domain stays.
        domain: Where the point stays.
        holds: Whether a point will do.

    Example:
        >>> from fuzzytree.auditing.engine.domain import Domain, Side
        >>> box = Domain((Side("x", 0.0, 1.0),))
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
