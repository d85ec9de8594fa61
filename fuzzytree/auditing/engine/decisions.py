"""Does one class decide everywhere on a box?

A class decides where the first of the strongest rules is one of its rules. So another
decision is made where some rule of another class is stronger than all of its rules;
where such a rule is as strong as some later ones, and stronger than the others; or
where no rule fires and the prediction for that differs (`questions`). Bounds of all
rules on many boxes at once, in doubles rounded outwards, exclude most rules first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Final

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import Arrangement, arrange, prediction_at
from fuzzytree.auditing.engine.bounding import simplified
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.domain import Domain, Point
from fuzzytree.auditing.engine.pieces import proposition_ranges
from fuzzytree.auditing.engine.probes import drawn_in, ends_of, near_strengths
from fuzzytree.auditing.engine.questions import decides_by_order, uncovered, wins
from fuzzytree.auditing.engine.states import (
    Claim,
    Proved,
    Representation,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.model import (
    BoolArray,
    FloatArray,
    Proposition,
    RuleBase,
    Variable,
    checkpoint,
    shapes_of,
)
from fuzzytree.numerics import Enclosure, U, axis_value, strength_enclosure

_STEPS: Final = 8  # towards the place where another class gets ahead
_BESIDE: Final = 1e-6  # of a range, to see which way degrees change
_BEYOND: Final = 1e-5  # of a radius, so that the other class is ahead for sure
_RANDOM_POINTS: Final = 512  # points around a centre where no step met another class
_OCTAVES: Final = 9.0  # over which their distances are spread
_NOTHING: Final = 2.0**-1000
_CHUNK: Final = 1 << 15  # points that are evaluated at once


class BoxBounds:
    """Rules, on boxes of a domain."""

    def __init__(self, rules: RuleBase, domain: Domain) -> None:
        self.rules, self.inputs = rules, rules.inputs
        self.low, self.high = ends_of(domain, rules.inputs)
        self.width = self.high - self.low
        self.variables = {variable.name: variable for variable in rules.variables}
        self.shapes = shapes_of(rules.variables)
        self.is_product = rules.semantics.conjunction == "product"

    def ball(self, centres: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
        """Return the ends of boxes that hold all of the domain within a radius.

        `centres`: shape (inputs, points); `radius`: in widths of the inputs' ranges.
        """
        reach = radius * self.width
        reach = reach * (1.0 + 4 * U) + 4 * U * np.abs(centres) + 2.0**-1000
        low = np.maximum(np.nextafter(centres - reach, -np.inf), self.low)
        high = np.minimum(np.nextafter(centres + reach, np.inf), self.high)
        return low, high

    def reached(self, low: FloatArray, high: FloatArray) -> Enclosure:
        """Return what each rule's strength lies between on boxes.

        `low`: shape (inputs, boxes): the lower ends.

        Returns:
            Both of shape (rules, boxes).
        """
        rules, count = self.rules.rules, low.shape[1]
        edges: dict[str, FloatArray] = {}
        known: dict[Proposition, Enclosure] = {}
        least, most = np.ones((len(rules), count)), np.ones((len(rules), count))
        for number, rule in enumerate(rules):
            checkpoint()
            whole = Enclosure(least[number], most[number])
            for proposition in rule.when:
                if proposition not in known:
                    name = proposition.variable
                    if name not in edges:
                        edges[name] = self._edges(self.variables[name], low, high)
                    cells = proposition_ranges(proposition, self.shapes, edges[name])[1]
                    known[proposition] = Enclosure(cells.low[:, 0], cells.high[:, 0])
                whole = strength_enclosure(
                    whole, known[proposition], is_product=self.is_product
                )
            least[number], most[number] = whole
        return Enclosure(least, most)

    def _edges(
        self, variable: Variable, low: FloatArray, high: FloatArray
    ) -> FloatArray:
        """Return a variable's ends on boxes, shape (boxes, 2); a cell is open below."""
        if variable.parts:
            first, last = self._combined(variable, low, high)
        else:
            place = self.inputs.index(variable.name)
            first, last = low[place], high[place]
        most = np.finfo(np.float64).max
        first = np.maximum(np.nextafter(first, -np.inf), -most)
        return np.stack([first, np.minimum(last, most)], axis=1)

    def _combined(
        self, variable: Variable, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return bounds of a combination: at the ends that make it least and largest.

        The ends are doubles, so that its value there is known as well as at a row.
        """
        weight = dict.fromkeys(self.inputs, 0.0)
        for part in variable.parts:
            weight[part.input] += part.weight
        names = self.inputs
        rising = np.array([[weight[name] > 0.0] for name in names])
        down = axis_value(
            variable, dict(zip(names, np.where(rising, low, high), strict=True))
        )
        up = axis_value(
            variable, dict(zip(names, np.where(rising, high, low), strict=True))
        )
        assert down.slack is not None  # of a combination
        assert up.slack is not None
        most = np.finfo(np.float64).max
        with np.errstate(over="ignore", invalid="ignore"):
            first = np.nextafter(down.x - down.slack, -np.inf)
            last = np.nextafter(up.x + up.slack, np.inf)
        first = np.where(np.isfinite(first), first, -most)
        return first, np.where(np.isfinite(last), last, most)

    def is_clear(
        self, low: FloatArray, high: FloatArray, labels: Sequence[str | None]
    ) -> BoolArray:
        """Return which boxes are for certain decided as their class everywhere.

        `low`: shape (inputs, boxes): the lower ends.
        """
        reached = self.reached(low, high)
        result = np.zeros(len(labels), dtype=bool)
        for label in dict.fromkeys(labels):
            at = np.array([one == label for one in labels])
            own = self._own(label)
            others = reached.high[~own][:, at].max(axis=0, initial=0.0)
            least = reached.low[own][:, at].max(axis=0, initial=0.0)
            clear = least > others
            if self.rules.semantics.uncovered == label:
                clear |= others == 0.0
            result[at] = clear
        return result

    def _own(self, label: str | None) -> BoolArray:
        return np.array([rule.then == label for rule in self.rules.rules])

    # --- towards another class

    def margins(self, points: FloatArray, label: str | None) -> FloatArray:
        """Return about how far a class is ahead of others at points; below 0 it is not.

        Where no rule fires, no class is ahead of no class.
        """
        own = self._own(label)
        parts: list[FloatArray] = [np.zeros(0)]
        for start in range(0, points.shape[1], _CHUNK):
            result = near_strengths(self.rules, points[:, start : start + _CHUNK])
            mine = result[own].max(axis=0, initial=0.0)
            ahead = mine - result[~own].max(axis=0, initial=0.0)
            if self.rules.semantics.uncovered != label:
                ahead = np.where(mine == 0.0, ahead - _NOTHING, ahead)
            parts.append(ahead)
        return np.concatenate(parts)

    def approached(
        self, centres: FloatArray, labels: Sequence[str | None]
    ) -> tuple[FloatArray, FloatArray]:
        """Return points near some others where another class seems to be ahead.

        Each step goes where the margin would be 0 if it went on as it does: all inputs
        by the same share of their ranges, each to the side on which the margin falls.
        Where that leads nowhere, points are drawn. Nothing is claimed.

        `centres`: shape (inputs, points).

        Returns:
            Points, and how far they are; infinity where none was met.
        """
        best, away = centres.copy(), np.full(centres.shape[1], np.inf)
        for label in dict.fromkeys(labels):
            at = np.flatnonzero([one == label for one in labels])
            best[:, at], away[at] = self._approached(centres[:, at], label)
        return best, away

    def _approached(
        self, centres: FloatArray, label: str | None
    ) -> tuple[FloatArray, FloatArray]:
        size, count = centres.shape
        points, best = centres.copy(), centres.copy()
        away = np.full(count, np.inf)
        beside = np.where(self.width > 0.0, self.width * _BESIDE, 0.0)
        for _ in range(_STEPS):
            step = np.where(points + beside <= self.high, beside, -beside)
            moved = np.repeat(points[:, np.newaxis], size + 1, axis=1)
            moved[np.arange(size), np.arange(size)] += step
            margins = self.margins(moved.reshape(size, -1), label)
            margins = margins.reshape(size + 1, count)
            here = margins[size]
            radius = self._away(points, centres)
            is_met = (here < 0.0) & (radius < away)
            best[:, is_met], away[is_met] = points[:, is_met], radius[is_met]
            with np.errstate(all="ignore"):
                slope = np.where(step != 0.0, (margins[:size] - here) / step, 0.0)
                goal = here + (slope * (centres - points)).sum(axis=0)
                reach = goal / (np.abs(slope) * self.width).sum(axis=0)
            reach = np.nan_to_num(reach, nan=0.0, posinf=1.0, neginf=0.0)
            reach = np.clip(reach * (1.0 + _BEYOND) + 2.0**-40, 0.0, 1.0)
            points = centres - np.sign(slope) * reach * self.width
            points = np.clip(points, self.low, self.high)
        for place in np.flatnonzero(np.isinf(away)).tolist():
            best[:, place], away[place] = self._drawn(centres[:, [place]], label)
        return best, away

    def _drawn(self, centre: FloatArray, label: str | None) -> tuple[FloatArray, float]:
        """Return the nearest of some points that are drawn, at all distances."""
        chance = np.random.default_rng(0)
        shape = len(centre), _RANDOM_POINTS
        reach = 2.0 ** (-_OCTAVES * chance.random(_RANDOM_POINTS)) * self.width
        points = centre + reach * chance.uniform(-1.0, 1.0, shape)
        points = np.where(
            chance.random(shape) < chance.random(_RANDOM_POINTS), centre, points
        )
        points = np.clip(points, self.low, self.high)
        away = self._away(points, centre)
        away[self.margins(points, label) >= 0.0] = np.inf
        nearest = int(away.argmin())
        return points[:, nearest], float(away[nearest])

    def pairs(self, points: FloatArray, others: FloatArray) -> list[tuple[int, float]]:
        """Return for each point the nearest of some others, and how far it is."""
        if not others.shape[1]:
            return [(0, np.inf)] * points.shape[1]
        result: list[tuple[int, float]] = []
        for column in points.T:
            away = self._away(others, column[:, np.newaxis])
            place = int(away.argmin())
            result.append((place, float(away[place])))
        return result

    def _away(self, points: FloatArray, centres: FloatArray) -> FloatArray:
        width = np.where(self.width > 0.0, self.width, np.inf)
        result: FloatArray = np.max(np.abs(points - centres) / width, axis=0)
        return result


def columns(
    points: Sequence[Mapping[str, Fraction]], inputs: Sequence[str]
) -> FloatArray:
    """Return points as an array of shape (inputs, points)."""
    items = [[float(point[name]) for point in points] for name in inputs]
    return np.array(items, dtype=np.float64).reshape(len(inputs), len(points))


# --- decisions

_DRAWN: Final = 256  # points in which another decision is looked for first


def decision_at(base: Arrangement, point: Mapping[str, Fraction]) -> str | None:
    """Return the class that rules decide for at a point, exactly."""
    return prediction_at(base.rules, point).label


def other_decision(
    base: Arrangement,
    label: str | None,
    clock: Clock | None = None,
    *,
    of: Representation = "rules",
) -> State:
    """Return whether some point of a box is decided otherwise than as a class.

    `of`: what claims call the rules.

    Returns:
        `Proved`: none is. `Witness`: one is; it claims the decision there. Any other
        state leaves it open.
    """
    clock = clock or Clock()
    if base.is_empty:
        return Proved("the domain has no point")
    rivalry = _Rivalry(base, label)
    if rivalry.is_over:
        return Proved("bounds on the box leave no other decision")
    values = drawn_in(base, _DRAWN)
    if values is None:
        return Proved("the domain has no point")
    drawn = _drawn(base, label, values)
    if drawn is not None:
        claim = Claim("decides", of=of, label=decision_at(base, drawn))
        return Witness(coordinates(drawn), (claim,))
    left_open: State | None = None
    count = 0
    for state in rivalry.results(clock):
        count += 1
        if isinstance(state, Witness):
            other = decision_at(base, point_of(state.point))
            assert other != label  # the claims of the witness say so
            claim = Claim("decides", of=of, label=other)
            return Witness(state.point, (claim,), state.region)
        if not isinstance(state, Proved):
            left_open = left_open or state
            if clock.is_over:
                break
    return left_open or Proved(f"{count} questions about other decisions answered no")


class _Rivalry:
    """The rules that may matter to whether a class decides everywhere on a box."""

    def __init__(self, base: Arrangement, label: str | None) -> None:
        self.base = base
        self.is_own = np.array([rule.then == label for rule in base.rules.rules])
        ends = ends_of(base.domain, base.rules.inputs)
        reached = BoxBounds(base.rules, base.domain).reached(*ends)
        self.low, self.high = reached.low[:, 0], reached.high[:, 0]
        own = self.low[self.is_own]
        self.least = float(own.max(initial=0.0))
        self.may_be_bare = (
            base.rules.semantics.uncovered != label and not self.low.max() > 0.0
        )

    @property
    def is_over(self) -> bool:
        """Whether no rule of another class comes up to the class's own."""
        return not self.may_be_bare and not self._others(is_tie=True)

    def results(self, clock: Clock) -> Iterator[State]:
        """Yield the answer to each question of which one must be yes, quick ones first.

        Own rules that are below another one on all of the box are no rivals.
        """
        own = (np.flatnonzero(self.is_own & (self.high >= self.least)) + 1).tolist()
        ahead, level = self._others(is_tie=False), self._others(is_tie=True)
        # Of few rules axes have few places; the others matter only to what is bare.
        kept = sorted({*own, *level})
        base, number_of = self._among(kept)
        mine = [number_of[number] for number in own]
        for number in ahead:
            yield wins(base, number_of[number], mine, clock)
        if self.may_be_bare:
            yield uncovered(self.base, clock)
        for number in map(number_of.__getitem__, level):
            after = [rival for rival in mine if rival > number]
            if after:
                before = [rival for rival in mine if rival < number]
                yield decides_by_order(base, number, before, after, clock)

    def _among(self, kept: Sequence[int]) -> tuple[Arrangement, dict[int, int]]:
        """Return the box with some rules only, and their numbers among these."""
        rules = self.base.rules
        few = replace(rules, rules=tuple(rules.rules[number - 1] for number in kept))
        numbers = {number: place for place, number in enumerate(kept, 1)}
        return arrange(few, self.base.domain), numbers

    def _others(self, *, is_tie: bool) -> list[int]:
        """Return the numbers of other rules that may be as strong, or stronger."""
        least = self.least
        fits = (self.high >= least) if is_tie else (self.high > least)
        fits &= ~self.is_own & (self.high > 0.0)
        return [number + 1 for number in np.flatnonzero(fits).tolist()]


def _drawn(base: Arrangement, label: str | None, values: FloatArray) -> Point | None:
    """Return a point that is decided otherwise, if one of some that are drawn is."""
    low, high = ends_of(base.domain, base.rules.inputs)
    strengths = near_strengths(base.rules, np.clip(values, low, high))
    is_own = np.array([rule.then == label for rule in base.rules.rules])
    own = np.max(strengths, axis=0, where=is_own[:, np.newaxis], initial=0.0)
    others = np.max(strengths, axis=0, where=~is_own[:, np.newaxis], initial=0.0)
    best = int(np.argmax(others - own))
    point = {
        name: Fraction(float(value))
        for name, value in zip(base.rules.inputs, values[:, best], strict=True)
    }
    if not is_within(base, point) or decision_at(base, point) == label:
        return None
    return simplified(base, point, lambda near: decision_at(base, near) != label)
