"""Questions about rules whose firing strengths are known between bounds.

The lower rules show what a rule does somewhere, the upper ones what it never does; what
neither decides is a bracket. Without an inexact curve or a weight both are the same.

Where two rules share a proposition, its degree v is one number for both. If one rule is
nowhere weaker than the other with the upper degree u in both, it is so with v <= u too:
`min(u, a) >= min(w u, b)` makes `a >= min(w u, b) >= min(w v, b)` for a weight w of at
most 1, and `u a >= u b` makes `a >= b` where u is above 0. So a shared proposition is
taken from above in both.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Final

import msgspec
from msgspec.structs import replace

from fuzzytree.auditing.decide.lines import Between
from fuzzytree.auditing.engine.arrangement import Arrangement, arrange
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.compared import (
    Dominance,
    JointMaximum,
    RuleDistance,
    RulePairs,
)
from fuzzytree.auditing.engine.measures import Bounds, are_apart
from fuzzytree.auditing.engine.questions import below, least_cover, uncovered, wins
from fuzzytree.auditing.engine.states import Bracket, Claim, Proved, State, Witness
from fuzzytree.auditing.findings.rule_bounds import BoundedRules
from fuzzytree.auditing.findings.subject import Subject
from fuzzytree.model import (
    BoolArray,
    FloatArray,
    Proposition,
    Rule,
    Term,
    Variable,
)
from fuzzytree.numerics import (
    outwards,
)

_BELOW: Final = "from below: "


class BoundedArrangement(msgspec.Struct, frozen=True, eq=False, dict=True):
    """Rules from below and from above, on a box; no bounds if both are the same."""

    lower: Arrangement
    upper: Arrangement
    bounds: BoundedRules | None = None

    def is_inexact(self, *numbers: int) -> bool:
        """Return whether one of some rules is not known exactly."""
        return self.bounds is not None and not self.bounds.rules.isdisjoint(numbers)

    @functools.cached_property
    def from_below(self) -> RulePairs:
        """The lower rules, to be compared."""
        return RulePairs(self.lower)

    @functools.cached_property
    def from_above(self) -> RulePairs:
        """The upper rules, to be compared."""
        return self.from_below if self.upper is self.lower else RulePairs(self.upper)

    @property
    def is_product(self) -> bool:
        """Whether degrees are multiplied."""
        return self.from_below.is_product

    @property
    def fires(self) -> BoolArray:
        """Whether each rule may fire anywhere, if axes are free."""
        return self.from_above.fires

    def firing(self, number: int, clock: Clock) -> State:
        """Return whether a rule fires anywhere; see `wins`."""
        state = wins(self.lower, number, (), clock)
        if self.bounds is None or not self.is_inexact(number):
            return state
        if isinstance(state, Witness):
            return self.bounds.certified(state)
        most = wins(self.upper, number, (), clock)
        if isinstance(most, Proved):
            return most
        # Where the lower strength is 0, a proposition is, and its gap bounds the upper
        # one.
        high = self.bounds.gap if isinstance(state, Proved) else 1.0
        return Bracket(f"the strength of rule {number}", 0.0, high, self.bounds.why)

    def never_weaker(self, strong: int, weak: int) -> Dominance:
        """Return whether a rule is nowhere weaker than another one."""
        if not self.is_inexact(strong, weak):
            return self.from_below.never_weaker(strong, weak)
        if self._pair(strong, weak).never_weaker(1, 2) == "always":
            return "always"
        back = self._pair(weak, strong, shares=False).never_weaker(2, 1)
        return "not" if back == "not" else "open"

    def _pair(self, one: int, other: int, *, shares: bool = True) -> RulePairs:
        """Return two rules, the first from below and the second from above."""
        below, above = self.lower.rules, self.upper.rules
        mine, theirs = below.rules[one - 1], above.rules[other - 1]
        known = [*theirs.when] if shares else []
        when = [
            proposition
            if self._is_shared(proposition, mine, known)
            else _renamed(proposition)
            for proposition in mine.when
        ]
        variables = (
            replace(v, terms=(*v.terms, *_terms(w)))
            for v, w in zip(above.variables, below.variables, strict=True)
        )
        rules = replace(
            above,
            variables=tuple(variables),
            rules=(replace(mine, when=tuple(when)), theirs),
        )
        return RulePairs(arrange(rules, self.lower.domain))

    def _is_shared(
        self, proposition: Proposition, rule: Rule, others: Sequence[Proposition]
    ) -> bool:
        """Return whether other propositions have the key of one, with no more weight.

        Under the product they must do so as often: `v b` is not below `v v a`.
        """
        assert self.bounds is not None
        if self.is_product:
            return rule.when.count(proposition) <= others.count(proposition)
        mine, weight, _ = self.bounds.weighted_key(proposition)
        keys = map(self.bounds.weighted_key, others)
        return any(theirs == mine and most <= weight for theirs, _, most in keys)

    def distance(self, one: int, other: int, most: Fraction) -> RuleDistance | None:
        """Return how far two rules are apart, None if more; see `factors.distance`.

        Between inexact rules it is known only if their antecedents are equal.
        """
        if self.is_inexact(one, other) and self._keys[one - 1] != self._keys[other - 1]:
            return None
        return self.from_below.distance(one, other, most)

    def is_near(self, one: int, other: int, most: Fraction) -> bool:
        """Return whether it is open whether degrees of two rules differ by more.

        That is so only for inexact rules.
        """
        return self.is_inexact(one, other) and not any(
            self._are_apart(axis, one - 1, other - 1, most)
            for axis in range(len(self.lower.axes))
        )

    def _are_apart(self, axis: int, one: int, other: int, most: Fraction) -> bool:
        below, above = (
            of.levels.axes[axis] for of in (self.from_below, self.from_above)
        )
        key = axis, below.propositions[one], below.propositions[other], most
        if key not in self._known:
            mine, theirs = (
                Between(below.function(rule).lower, above.function(rule).upper)
                for rule in (one, other)
            )
            self._known[key] = are_apart(mine, theirs, most)
        return self._known[key]

    @functools.cached_property
    def _known(self) -> dict[object, bool]:
        """Which propositions are apart; both rule bases have the same ones."""
        return {}

    @functools.cached_property
    def _keys(self) -> tuple[tuple[object, ...], ...]:
        count = len(self.lower.rules.rules)
        return tuple(self.bounds.key(n) for n in range(1, count + 1) if self.bounds)

    def uncovered(self, clock: Clock) -> State:
        """Return whether every rule is somewhere exactly 0; see `cover`."""
        state = uncovered(self.upper, clock)
        if self.bounds is None or isinstance(state, Witness):
            return state
        least = uncovered(self.lower, clock)
        if isinstance(least, Proved):
            return least
        return Bracket("how many rules fire at least", 0.0, 1.0, self.bounds.why)

    def below(self, epsilon: Fraction, clock: Clock) -> State:
        """Return whether all rules are somewhere weaker than a level; see `cover`."""
        state = below(self.lower, epsilon, clock)
        if self.bounds is None or isinstance(state, Proved):
            return state
        most = below(self.upper, epsilon, clock)
        if isinstance(most, Witness):
            return most
        least = self.least_cover(clock)
        return Bracket(least.of, least.low, least.high, self.bounds.why)

    def least_cover(self, clock: Clock) -> Bracket:
        """Return bounds of the least strength that the strongest rule has anywhere."""
        bracket = least_cover(self.lower, clock)
        if self.bounds is None:
            return bracket
        high = least_cover(self.upper, clock).high
        return Bracket(bracket.of, bracket.low, max(high, bracket.low), self.bounds.why)

    def highest(self, one: int) -> FloatArray:
        """Return bounds of the levels that a rule reaches with each other one."""
        return self.from_above.joint_bounds(one)

    def meet(self, one: int, other: int, level: Fraction, clock: Clock) -> JointMaximum:
        """Return the highest level that two rules reach at one point; see `meeting`."""
        joint = self.from_below.joint_maximum(one, other, level, clock)
        if self.bounds is None or not self.is_inexact(one, other):
            return joint
        above = self.from_above.joint_maximum(one, other, level, clock)
        most = above.level.high
        if isinstance(joint.state, Witness):
            state = self.bounds.certified(joint.state)
            return JointMaximum(
                Bounds(joint.level.low, max(most, joint.level.low)), state
            )
        if most < level or isinstance(above.state, Proved):
            state = above.state
            if isinstance(state, Bracket):  # its point is one of the upper rules
                state = replace(state, low=0.0, point=(), claims=())
            return JointMaximum(Bounds(Fraction(0), most), state)
        # A level that is nearly reached is reported, with its point.
        easier = max(level - 4 * Fraction(self.bounds.gap), Fraction(0))
        near = self.from_below.joint_maximum(one, other, easier, clock)
        low = near.level.low if isinstance(near.state, Witness) else Fraction(0)
        name = f"the highest level that rules {one} and {other} both reach"
        ends = outwards(low)[0], outwards(most)[1]
        state = Bracket(name, *ends, self.bounds.why)
        if isinstance(near.state, Witness):
            claim = Claim("reaches", rules=(one, other), level=str(Fraction(ends[0])))
            state = replace(state, point=near.state.point, claims=(claim,))
        return JointMaximum(Bounds(low, most), state)


def bounded_arrangement(subject: Subject) -> BoundedArrangement:
    """Return a subject's rules from below and from above, on its domain."""
    if subject.bounds is None:
        arrangement = arrange(subject.rules, subject.domain)
        return BoundedArrangement(arrangement, arrangement)
    lower, upper = subject.bounds.lower, subject.bounds.upper
    return BoundedArrangement(
        arrange(lower, subject.domain), arrange(upper, subject.domain), subject.bounds
    )


def _renamed(proposition: Proposition) -> Proposition:
    return replace(
        proposition, terms=tuple(f"{_BELOW}{term}" for term in proposition.terms)
    )


def _terms(variable: Variable) -> Iterator[Term]:
    """Yield the terms of a variable of the lower rules, under names of their own."""
    for term in variable.terms:
        yield replace(term, name=f"{_BELOW}{term.name}")
