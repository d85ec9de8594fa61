"""Random probes and local search in doubles: quick, confirmed in fractions.

The strengths of all rules at some thousand random points show most of the rules that
lead somewhere. A rule that leads at no probe is searched for on its own.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence
from fractions import Fraction
from typing import Final

import msgspec
import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, strength_above
from fuzzytree.auditing.engine.domain import Domain, DomainSide, Point
from fuzzytree.auditing.engine.states import Claim, Witness, coordinates
from fuzzytree.auditing.engine.witnesses import is_within, point_with
from fuzzytree.model import FloatArray, IntArray, RuleBase, checkpoint, shapes_of
from fuzzytree.numerics import (
    axis_value,
    degree_enclosure,
    proposition_enclosure,
)

_FIRST = 4096  # points drawn in the whole domain
_NEXT = 512  # points drawn around the best one, in each round
_ROUNDS = 24


def near_strengths(rules: RuleBase, values: FloatArray) -> FloatArray:
    """Return about how strong each rule is at some points.

    `values`: shape (inputs, points), finite.

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
        for proposition in rule.when:
            if proposition not in known:
                value = axis_value(variables[proposition.variable], columns)
                of = [
                    degree_enclosure(shapes[proposition.variable, term], value)
                    for term in proposition.terms
                ]
                known[proposition] = proposition_enclosure(proposition, of).low
            if rules.semantics.conjunction == "product":
                strengths[number] *= known[proposition]
            else:
                np.minimum(strengths[number], known[proposition], out=strengths[number])
    return strengths


def ends_of(domain: Domain, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends of some inputs, each of shape (inputs, 1)."""
    sides = [domain.side(name) for name in names]
    low = [side.low if side else 0.0 for side in sides]
    high = [side.high if side else 0.0 for side in sides]
    return np.array(low)[:, None], np.array(high)[:, None]


def drawn_values(side: DomainSide, shares: FloatArray) -> FloatArray:
    """Return values of rows, spread evenly as shares from 0 to 1 are.

    Example:
        >>> from fuzzytree.auditing.engine.domain import DomainSide
        >>> doors = DomainSide("doors", 1.0, 4.0, is_whole=True)
        >>> drawn_values(doors, np.array([0.0, 0.3, 0.99])).tolist()
        [1.0, 2.0, 4.0]
    """
    if side.values:
        values = np.array(side.points)
        result: FloatArray = values[(shares * len(values)).astype(np.int64)]
        return result
    if side.is_whole:
        return side.low + np.floor(shares * (side.high - side.low + 1.0))
    values = side.low * (1.0 - shares) + side.high * shares
    return np.clip(values, side.low, side.high)


def drawn_in(base: Arrangement, count: int, seed: int = 0) -> FloatArray | None:
    """Return points of a box that are drawn; None if it has no point.

    Where combinations are limited, points are drawn on the ways from one point inside
    to points of the inputs' box, as far as the limits let them.

    Returns:
        Shape (inputs, count); about within the sides of combinations.
    """
    chance = np.random.default_rng(seed)
    low, high = ends_of(base.domain, base.rules.inputs)
    shares = chance.random((len(low), count))
    sides = zip(map(base.domain.side, base.rules.inputs), shares, strict=True)
    drawn = [drawn_values(side, part) for side, part in sides if side is not None]
    values = np.array(drawn).reshape(shares.shape)
    limited = [
        (variable, side)
        for variable in base.rules.variables
        if variable.parts and (side := base.domain.side(variable.name)) is not None
    ]
    if not limited:
        return values
    inside = point_with(base, {})
    if inside is None:
        return None
    names = base.rules.inputs
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
    result: FloatArray = start + (values - start) * share
    return result


def leader(
    base: Arrangement, ours: Sequence[int], rivals: Sequence[int], seed: int = 0
) -> Point:
    """Return a point of the inputs' box at which some rules lead others by much.

    It is the best of some thousand points that were drawn, and nothing is claimed.
    """
    chance = np.random.default_rng([seed, *ours])
    low, high = ends_of(base.domain, base.rules.inputs)
    mine, others = [n - 1 for n in ours], [n - 1 for n in rivals]

    def leads(points: FloatArray) -> FloatArray:
        result = near_strengths(base.rules, points)
        lead: FloatArray = np.ones(points.shape[1])
        if mine:
            lead = result[mine].min(axis=0)
        if others:
            lead = lead - result[others].max(axis=0)
        return lead

    width = high - low
    points = low + width * chance.random((len(low), _FIRST))
    best, most, reach = points[:, :1], -np.inf, 1.0
    for _ in range(_ROUNDS):
        result = leads(points)
        top = int(result.argmax())
        if result[top] > most:
            best, most = points[:, top : top + 1], float(result[top])
        else:
            reach *= 0.6
        steps = chance.standard_normal((len(low), _NEXT)) * width * reach * 0.2
        steps *= chance.random(steps.shape) < chance.random((1, _NEXT))
        points = np.clip(best + steps, low, high)
    return {
        name: Fraction(float(value))
        for name, value in zip(base.rules.inputs, best[:, 0], strict=True)
    }


# --- random probes

_MOST_POINTS: Final = 4096
_MOST_STRENGTHS: Final = 1 << 23  # of all rules at all points
_STEPS: Final = 1024  # of each input, so that points have few digits
_CLEAR: Final = 1e-9  # leads below are not worth a look in fractions


class RandomProbes(msgspec.Struct, frozen=True, eq=False, dict=True):
    """What rules do at some points of a domain."""

    base: Arrangement  # the rules and the box
    seed: int = 0  # of what is drawn

    @functools.cached_property
    def _points(self) -> FloatArray:
        low, high = ends_of(self.base.domain, self.base.rules.inputs)
        count = min(_MOST_POINTS, _MOST_STRENGTHS // len(self.base.rules.rules))
        steps = np.random.default_rng(self.seed).integers(
            0, _STEPS, size=(len(low), max(count, 1)), endpoint=True
        )
        share = steps / _STEPS
        return np.clip(low * (1.0 - share) + high * share, low, high)

    @functools.cached_property
    def _strengths(self) -> FloatArray:
        return near_strengths(self.base.rules, self._points)

    @functools.cached_property
    def _of_classes(self) -> tuple[FloatArray, IntArray]:
        """How far each rule is ahead of other classes at best, and at which point."""
        rules = self.base.rules
        number = {label: n for n, label in enumerate(rules.classes)}
        owner = np.array([number[rule.then] for rule in rules.rules])
        best = np.zeros((len(rules.classes), self._points.shape[1]))
        np.maximum.at(best, owner, self._strengths)
        return self._ahead(best, owner)

    @functools.cached_property
    def _of_rules(self) -> tuple[FloatArray, IntArray]:
        """The same for all other rules."""
        return self._ahead(self._strengths, np.arange(len(self._strengths)))

    def _ahead(self, best: FloatArray, owner: IntArray) -> tuple[FloatArray, IntArray]:
        rows = np.arange(best.shape[1])
        first = best.argmax(axis=0)
        top = best[first, rows]
        others = best.copy()
        others[first, rows] = 0.0
        second = others.max(axis=0)
        lead = np.empty(len(owner))
        place = np.empty(len(owner), dtype=np.int64)
        for rule, own in enumerate(owner.tolist()):
            ahead = self._strengths[rule] - np.where(first == own, second, top)
            place[rule] = ahead.argmax()
            lead[rule] = ahead[place[rule]]
        return lead, place

    def is_ahead(self, rule: int) -> bool:
        """Return whether a rule seems to be ahead of all other classes somewhere."""
        return bool(self._of_classes[0][rule - 1] > _CLEAR)

    def wins(self, rule: int, rivals: Collection[int]) -> Witness | None:
        """Return a point at which a rule is stronger than all of other classes."""
        return self._witness(self._of_classes, rule, rivals)

    def wins_alone(self, rule: int, others: Collection[int]) -> Witness | None:
        """Return a point at which a rule is stronger than all others, if it is seen."""
        return self._witness(self._of_rules, rule, others)

    def _witness(
        self, leads: tuple[FloatArray, IntArray], rule: int, rivals: Collection[int]
    ) -> Witness | None:
        lead, place = leads
        if not lead[rule - 1] > _CLEAR:
            return None
        values = self._points[:, place[rule - 1]].tolist()
        point = {
            name: Fraction(value)
            for name, value in zip(self.base.rules.inputs, values, strict=True)
        }
        if not is_within(self.base, point):
            return None
        rivals = sorted(rivals)
        strength = strength_above(self.base, point, rule, rivals)
        if strength is None:
            return None
        claims = (
            Claim("beats", rules=(rule,), rivals=tuple(rivals)),
            Claim("strength", rules=(rule,), level=str(strength)),
        )
        return Witness(coordinates(point), claims)
