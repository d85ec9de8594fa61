"""Points drawn once for all rules, at which most of them are seen to lead.

What rules do at some thousand points is worked out by doubles, for all rules together.
Where a rule is ahead of others the point is asked in fractions; a rule that is never
seen ahead may be none the less, and is worth a search of its own.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np

from fuzzytree.auditing.engine.ground import Ground
from fuzzytree.auditing.engine.seeking import ends_of, near_strengths
from fuzzytree.auditing.engine.states import Claim, Witness, coordinates
from fuzzytree.auditing.engine.variables import Point, variable_value
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.model.rulebase import Rule, shapes_of
from fuzzytree.numerics.exact import exact_degree

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray, IntArray

_MOST_POINTS: Final = 4096
_MOST_STRENGTHS: Final = 1 << 23  # of all rules at all points
_STEPS: Final = 1024  # of each input, so that points have few digits
_CLEAR: Final = 1e-9  # leads below are not worth a look in fractions


class Glimpses(msgspec.Struct, frozen=True, eq=False, dict=True):
    """What rules do at some points of a domain.

    Attributes:
        given: The rules and the box.
        seed: Of what is drawn.
    """

    given: Ground
    seed: int = 0

    @functools.cached_property
    def _points(self) -> FloatArray:
        low, high = ends_of(self.given.rules, self.given.domain)
        count = min(_MOST_POINTS, _MOST_STRENGTHS // len(self.given.rules.rules))
        steps = np.random.default_rng(self.seed).integers(
            0, _STEPS, size=(len(low), max(count, 1)), endpoint=True
        )
        share = steps / _STEPS
        return np.clip(low * (1.0 - share) + high * share, low, high)

    @functools.cached_property
    def _strengths(self) -> FloatArray:
        return near_strengths(self.given.rules, self._points)

    @functools.cached_property
    def _of_classes(self) -> tuple[FloatArray, IntArray]:
        """How far each rule is ahead of other classes at best, and at which point."""
        rules = self.given.rules
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
        """Return a point at which a rule is stronger than all of other classes.

        Args:
            rule: The number of the rule, from 1.
            rivals: The numbers of the rules of other classes.
        """
        return self._witness(self._of_classes, rule, rivals)

    def wins_alone(self, rule: int, others: Collection[int]) -> Witness | None:
        """Return a point at which a rule is stronger than all others, if it is seen."""
        return self._witness(self._of_rules, rule, others)

    def _witness(
        self, seen: tuple[FloatArray, IntArray], rule: int, rivals: Collection[int]
    ) -> Witness | None:
        lead, place = seen
        if not lead[rule - 1] > _CLEAR:
            return None
        values = self._points[:, place[rule - 1]].tolist()
        point = {
            name: Fraction(value)
            for name, value in zip(self.given.rules.inputs, values, strict=True)
        }
        if not is_within(self.given, point):
            return None
        rivals = sorted(rivals)
        strength = strength_above(self.given, point, rule, rivals)
        if strength is None:
            return None
        claims = (
            Claim("beats", rules=(rule,), rivals=tuple(rivals)),
            Claim("strength", rules=(rule,), level=str(strength)),
        )
        return Witness(coordinates(point), claims)


def strength_above(
    given: Ground, point: Point, rule: int, rivals: Sequence[int]
) -> Fraction | None:
    """Return a rule's exact strength if it is above that of each of some others.

    Of a rival only as many clauses are asked as it takes to see that it is weaker.

    Args:
        given: The rules.
        point: A point of the inputs.
        rule: The number of the rule, from 1.
        rivals: The numbers of the others.
    """
    rules = given.rules
    is_product = rules.semantics.conjunction == "product"
    shapes = shapes_of(rules.variables)
    variables = {variable.name: variable for variable in rules.variables}
    known: dict[tuple[str, str], Fraction] = {}
    values: dict[str, Fraction] = {}

    def degree(variable: str, term: str) -> Fraction:
        if (variable, term) not in known:
            if variable not in values:
                values[variable] = variable_value(variables[variable], point)
            known[variable, term] = exact_degree(
                shapes[variable, term], values[variable]
            )
        return known[variable, term]

    def strength(of: Rule, enough: Fraction) -> Fraction:
        """Return a rule's strength, or some number below `enough` if it is."""
        found = Fraction(1)
        for clause in of.when:
            one = max(degree(clause.variable, term) for term in clause.terms)
            one = 1 - one if clause.negated else one
            found = found * one if is_product else min(found, one)
            if found < enough:
                break
        return found

    mine = strength(rules.rules[rule - 1], Fraction(0))
    if not mine:
        return None
    for rival in rivals:
        if strength(rules.rules[rival - 1], mine) >= mine:
            return None
    return mine
