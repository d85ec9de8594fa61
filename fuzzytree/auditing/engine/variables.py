"""A variable of the inputs, exactly: its value at a point, its ends, its weights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.model.rulebase import Part, Variable

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
    return combined(variable.parts, number)


def combined(
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
        return Fraction(side.low), Fraction(side.high)
    number = {one.variable: place for place, one in enumerate(domain.sides)}
    weights, low = linear_form(variable, number)
    high = low
    for place, weight in weights.items():
        of = domain.sides[place]
        ends = [weight * Fraction(end) for end in (of.low, of.high)]
        low, high = low + min(ends), high + max(ends)
    if side is not None:
        low, high = max(low, Fraction(side.low)), min(high, Fraction(side.high))
    return low, high


def contains(
    domain: Domain, variables: Iterable[Variable], point: Mapping[str, Fraction]
) -> bool:
    """Return whether a point of the inputs is in a domain, exactly.

    Example:
        >>> from fuzzytree.auditing.engine.domain import Side
        >>> box = Domain((Side("x", 0.0, 1.0, is_open=True),))
        >>> contains(box, [Variable("x")], {"x": Fraction(0)})
        False
    """
    for variable in variables:
        side = domain.side(variable.name)
        if side is None:
            continue
        value = variable_value(variable, point)
        if not side.low <= value <= side.high or (side.is_open and value == side.low):
            return False
    return True
