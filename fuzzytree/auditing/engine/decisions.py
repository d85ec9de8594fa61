"""Is a box decided alike everywhere?

A class decides where the first of the strongest rules is one of its rules. So another
decision than a class's is made where some rule of another class is stronger than all of
its rules (`fuzzytree.auditing.engine.wins`); where such a rule is as strong as some
that stand behind it, and stronger than the others (`fuzzytree.auditing.engine.ties`);
or where no rule fires and that is answered otherwise
(`fuzzytree.auditing.engine.cover`). Rules that do not come up to the class anywhere on
the box, by bounds of doubles, are not asked about.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Final

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.engine.answers import answer_at
from fuzzytree.auditing.engine.around import Around
from fuzzytree.auditing.engine.branching import simplified
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.cover import uncovered
from fuzzytree.auditing.engine.ground import Ground, ground
from fuzzytree.auditing.engine.seeking import drawn_in, ends_of, near_strengths
from fuzzytree.auditing.engine.states import (
    Carrier,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.auditing.engine.ties import decides_by_order
from fuzzytree.auditing.engine.variables import Point
from fuzzytree.auditing.engine.wins import wins
from fuzzytree.auditing.engine.witnesses import is_within

if TYPE_CHECKING:
    from fuzzytree.model.contracts import FloatArray

_DRAWN: Final = 256  # points in which another decision is looked for first


def decision_at(given: Ground, point: Mapping[str, Fraction]) -> str | None:
    """Return the class that rules decide for at a point, exactly.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.auditing.engine.domain import Domain, Side
        >>> from fuzzytree.auditing.engine.ground import ground
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(3))
        >>> box = Domain(tuple(Side(name, -9.0, 9.0) for name in rules.inputs))
        >>> decision_at(ground(rules, box), dict.fromkeys(rules.inputs, Fraction(0)))
        'class 2'
    """
    return answer_at(given.rules, point).label


def other_decision(
    given: Ground,
    label: str | None,
    clock: Clock | None = None,
    *,
    of: Carrier = "rules",
) -> State:
    """Return whether some point of a box is decided otherwise than as a class.

    Args:
        given: The rules and the box.
        label: The class; None is no class.
        clock: How much time there is; no limit unless given.
        of: What claims call the rules.

    Returns:
        `Proved`: none is. `Witness`: one is; it claims the decision there. Any other
        state leaves it open.
    """
    clock = clock or Clock()
    if given.is_empty:
        return Proved("the domain has no point")
    contest = _Contest(given, label)
    if contest.is_over:
        return Proved("bounds on the box leave no other decision")
    values = drawn_in(given, _DRAWN)
    if values is None:
        return Proved("the domain has no point")
    drawn = _drawn(given, label, values)
    if drawn is not None:
        claim = Claim("decides", of=of, label=decision_at(given, drawn))
        return Witness(coordinates(drawn), (claim,))
    left_open: State | None = None
    asked = 0
    for state in contest.asked(clock):
        asked += 1
        if isinstance(state, Witness):
            other = decision_at(given, point_of(state.point))
            assert other != label  # the claims of the witness say so
            claim = Claim("decides", of=of, label=other)
            return Witness(state.point, (claim,), state.region)
        if not isinstance(state, Proved):
            left_open = left_open or state
            if clock.is_over:
                break
    return left_open or Proved(f"{asked} questions about other decisions answered no")


class _Contest:
    """The rules that may matter to whether a class decides everywhere on a box.

    Args:
        given: The rules and the box.
        label: The class.
    """

    def __init__(self, given: Ground, label: str | None) -> None:
        self.given = given
        self.is_own = np.array([rule.then == label for rule in given.rules.rules])
        ends = ends_of(given.rules, given.domain)
        reached = Around(given.rules, given.domain).reached(*ends)
        self.low, self.high = reached.low[:, 0], reached.high[:, 0]
        own = self.low[self.is_own]
        self.least = float(own.max(initial=0.0))
        self.may_be_bare = (
            given.rules.semantics.uncovered != label and not self.low.max() > 0.0
        )

    @property
    def is_over(self) -> bool:
        """Whether no rule of another class comes up to the class's own."""
        return not self.may_be_bare and not self._others(is_tie=True)

    def asked(self, clock: Clock) -> Iterator[State]:
        """Yield the answer to each question of which one must be yes, quick ones first.

        Own rules that are below another one on all of the box are no rivals.
        """
        own = (np.flatnonzero(self.is_own & (self.high >= self.least)) + 1).tolist()
        ahead, level = self._others(is_tie=False), self._others(is_tie=True)
        # Of few rules axes have few places; the others matter only to what is bare.
        kept = sorted({*own, *level})
        given, number_of = self._among(kept)
        mine = [number_of[number] for number in own]
        for number in ahead:
            yield wins(given, number_of[number], mine, clock)
        if self.may_be_bare:
            yield uncovered(self.given, clock)
        for number in map(number_of.__getitem__, level):
            after = [rival for rival in mine if rival > number]
            if after:
                before = [rival for rival in mine if rival < number]
                yield decides_by_order(given, number, before, after, clock)

    def _among(self, kept: Sequence[int]) -> tuple[Ground, dict[int, int]]:
        """Return the box with some rules only, and their numbers among these."""
        rules = self.given.rules
        few = replace(rules, rules=tuple(rules.rules[number - 1] for number in kept))
        numbers = {number: place for place, number in enumerate(kept, 1)}
        return ground(few, self.given.domain), numbers

    def _others(self, *, is_tie: bool) -> list[int]:
        """Return the numbers of other rules that may be as strong, or stronger."""
        least = self.least
        fits = (self.high >= least) if is_tie else (self.high > least)
        fits &= ~self.is_own & (self.high > 0.0)
        return [number + 1 for number in np.flatnonzero(fits).tolist()]


def _drawn(given: Ground, label: str | None, values: FloatArray) -> Point | None:
    """Return a point that is decided otherwise, if one of some that are drawn is."""
    low, high = ends_of(given.rules, given.domain)
    strengths = near_strengths(given.rules, np.clip(values, low, high))
    is_own = np.array([rule.then == label for rule in given.rules.rules])
    own = np.max(strengths, axis=0, where=is_own[:, np.newaxis], initial=0.0)
    others = np.max(strengths, axis=0, where=~is_own[:, np.newaxis], initial=0.0)
    best = int(np.argmax(others - own))
    point = {
        name: Fraction(float(value))
        for name, value in zip(given.rules.inputs, values[:, best], strict=True)
    }
    if not _is_other(given, point, label):
        return None
    return simplified(given, point, lambda near: decision_at(given, near) != label)


def _is_other(given: Ground, point: Point, label: str | None) -> bool:
    return is_within(given, point) and decision_at(given, point) != label
