"""Look for a point in floats: quick, and no answer before fractions confirm it."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.auditing.engine.domain import Domain
from fuzzytree.auditing.engine.ground import Ground, strengths_at
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.variables import Point
from fuzzytree.auditing.engine.witnesses import is_within, point_with
from fuzzytree.model.interrupts import checkpoint
from fuzzytree.model.rulebase import RuleBase, shapes_of
from fuzzytree.numerics.enclosures import axis_value, clause_enclosure, degree_enclosure

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_FIRST = 4096  # points drawn in the whole domain
_NEXT = 512  # points drawn around the best one, in each round
_ROUNDS = 24


def near_strengths(rules: RuleBase, values: FloatArray) -> FloatArray:
    """Return about how strong each rule is at some points.

    Args:
        rules: The rules.
        values: Shape (inputs, points), finite.

    Returns:
        Shape (rules, points): lower bounds, short by rounding only.
    """
    shapes = shapes_of(rules.variables)
    columns = dict(zip(rules.inputs, values, strict=True))
    variables = {variable.name: variable for variable in rules.variables}
    known: dict[object, FloatArray] = {}
    strengths = np.ones((len(rules.rules), values.shape[1]))
    for number, rule in enumerate(rules.rules):
        checkpoint()
        for clause in rule.when:
            if clause not in known:
                value = axis_value(variables[clause.variable], columns)
                of = [
                    degree_enclosure(shapes[clause.variable, term], value)
                    for term in clause.terms
                ]
                known[clause] = clause_enclosure(clause, of).low
            if rules.semantics.conjunction == "product":
                strengths[number] *= known[clause]
            else:
                np.minimum(strengths[number], known[clause], out=strengths[number])
    return strengths


def ends_of(rules: RuleBase, domain: Domain) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends of the inputs, each of shape (inputs, 1)."""
    sides = [domain.side(name) for name in rules.inputs]
    low = np.array([[0.0 if side is None else side.low] for side in sides])
    high = np.array([[0.0 if side is None else side.high] for side in sides])
    return low, high


def drawn_in(given: Ground, count: int, seed: int = 0) -> FloatArray | None:
    """Return points of a box that are drawn; None if it has no point.

    Where combinations are limited, points are drawn on the ways from one point inside
    to points of the inputs' box, as far as the limits let them.

    Args:
        given: Where.
        count: How many points.
        seed: Of what is drawn.

    Returns:
        Shape (inputs, count); about within the sides of combinations.
    """
    chance = np.random.default_rng(seed)
    low, high = ends_of(given.rules, given.domain)
    values = low + chance.random((len(low), count)) * (high - low)
    limited = [
        (variable, side)
        for variable in given.rules.variables
        if variable.parts and (side := given.domain.side(variable.name)) is not None
    ]
    if not limited:
        return values
    inside = point_with(given, {})
    if inside is None:
        return None
    names = given.rules.inputs
    start = np.array([[float(inside[name])] for name in names])
    corners = np.where(chance.random(values.shape) < 0.5, low, high)
    values[:, ::2] = corners[:, ::2]
    room = np.ones(count)
    for variable, side in limited:
        here = axis_value(variable, dict(zip(names, start, strict=True))).x
        step = axis_value(variable, dict(zip(names, values, strict=True))).x - here
        with np.errstate(all="ignore"):
            most = np.where(step > 0.0, side.high - here, side.low - here) / step
        room = np.where(step != 0.0, np.clip(most, 0.0, room), room)
    share = room * chance.random(count) ** (1.0 / len(names))
    found: FloatArray = start + (values - start) * share
    return found


def leader(
    given: Ground, ours: Sequence[int], rivals: Sequence[int], seed: int = 0
) -> Point:
    """Return a point of the inputs' box at which some rules lead others by much.

    It is the best of some thousand points that were drawn, and nothing is claimed.

    Args:
        given: Where.
        ours: The numbers of the rules, from 1; without any, the others shall be weak.
        rivals: The numbers of the others.
        seed: Of what is drawn.
    """
    chance = np.random.default_rng([seed, *ours])
    low, high = ends_of(given.rules, given.domain)
    mine, others = [n - 1 for n in ours], [n - 1 for n in rivals]

    def leads(points: FloatArray) -> FloatArray:
        found = near_strengths(given.rules, points)
        lead: FloatArray = np.ones(points.shape[1])
        if mine:
            lead = found[mine].min(axis=0)
        if others:
            lead = lead - found[others].max(axis=0)
        return lead

    width = high - low
    points = low + width * chance.random((len(low), _FIRST))
    best, most, reach = points[:, :1], -np.inf, 1.0
    for _ in range(_ROUNDS):
        found = leads(points)
        top = int(found.argmax())
        if found[top] > most:
            best, most = points[:, top : top + 1], float(found[top])
        else:
            reach *= 0.6
        steps = chance.standard_normal((len(low), _NEXT)) * width * reach * 0.2
        steps *= chance.random(steps.shape) < chance.random((1, _NEXT))
        points = np.clip(best + steps, low, high)
    return {
        name: Fraction(float(value))
        for name, value in zip(given.rules.inputs, best[:, 0], strict=True)
    }


def plainer(
    given: Ground, point: Point, ours: Sequence[int], rivals: Sequence[int]
) -> Point:
    """Return a point of fewer digits at which rules still lead by half as much.

    Args:
        given: Where.
        point: A point of the domain at which they lead.
        ours: The numbers of the rules, from 1.
        rivals: The numbers of the others.
    """
    goal = _lead(given, point, ours, rivals) / 2
    found = dict(point)
    for name in given.rules.inputs:
        side = given.domain.side(name)
        assert side is not None  # checked when the ground was made
        width = Fraction(side.high) - Fraction(side.low)
        for share in (Fraction(1, 50), Fraction(1, 1000), Fraction(1, 10**5)):
            low = max(found[name] - width * share, Fraction(side.low))
            high = min(found[name] + width * share, Fraction(side.high))
            if not low < high:
                break
            tried = {**found, name: simple(low, high)}
            is_good = _lead(given, tried, ours, rivals) > max(goal, Fraction(0))
            if is_good and is_within(given, tried):
                found = tried
                break
    return found


def _lead(
    given: Ground, point: Point, ours: Sequence[int], rivals: Sequence[int]
) -> Fraction:
    strengths = strengths_at(given, point)
    mine = min((strengths[number - 1] for number in ours), default=Fraction(1))
    return mine - max((strengths[n - 1] for n in rivals), default=Fraction(0))
