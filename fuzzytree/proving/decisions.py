"""Is a box decided alike everywhere?

A class decides where the first of the strongest rules is one of its rules. So another
decision than a class's is made where some rule of another class is stronger than all of
its rules (`fuzzytree.proving.wins`); where such a rule is as strong as some that stand
behind it, and stronger than the others (`fuzzytree.proving.ties`); or where no
rule fires and that is answered otherwise (`fuzzytree.proving.cover`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Final

import numpy as np

from fuzzytree.proving.answers import answer_at
from fuzzytree.proving.branching import simplified
from fuzzytree.proving.clock import Clock
from fuzzytree.proving.cover import uncovered
from fuzzytree.proving.ground import Ground
from fuzzytree.proving.seeking import ends_of, near_strengths
from fuzzytree.proving.states import (
    Carrier,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.proving.ties import decides_by_order
from fuzzytree.proving.variables import Point
from fuzzytree.proving.wins import wins
from fuzzytree.proving.witnesses import is_within

_DRAWN: Final = 256  # points in which another decision is looked for first


def decision_at(given: Ground, point: Mapping[str, Fraction]) -> str | None:
    """Return the class that rules decide for at a point, exactly.

    Example:
        >>> from fuzzytree.lowering import rules_from_tree
        >>> from fuzzytree.proving.domain import Domain, Side
        >>> from fuzzytree.proving.ground import ground
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
    drawn = _drawn(given, label)
    if drawn is not None:
        claim = Claim("decides", of=of, label=decision_at(given, drawn))
        return Witness(coordinates(drawn), (claim,))
    left_open: State | None = None
    asked = 0
    for state in _asked(given, label, clock):
        asked += 1
        if isinstance(state, Witness):
            other = decision_at(given, point_of(state.point))
            assert other != label  # the claims of the witness say so
            claim = Claim("decides", of=of, label=other)
            return Witness(state.point, (claim,), state.region)
        if not isinstance(state, Proved):
            left_open = left_open or state
    return left_open or Proved(f"{asked} questions about other decisions answered no")


def _asked(given: Ground, label: str | None, clock: Clock) -> Iterator[State]:
    """Yield the answer to each question of which one must be yes, the quick first."""
    numbered = [*enumerate(given.rules.rules, 1)]
    own = [number for number, rule in numbered if rule.then == label]
    others = [number for number, rule in numbered if rule.then != label]
    for number in others:
        yield wins(given, number, own, clock)
    if given.rules.semantics.uncovered != label:
        yield uncovered(given, clock)
    for number in others:
        after = [rival for rival in own if rival > number]
        if after:
            before = [rival for rival in own if rival < number]
            yield decides_by_order(given, number, before, after, clock)


def _drawn(given: Ground, label: str | None) -> Point | None:
    """Return a point that is decided otherwise, if one of some that are drawn is."""
    chance = np.random.default_rng(0)
    low, high = ends_of(given.rules, given.domain)
    values = low + chance.random((len(low), _DRAWN)) * (high - low)
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
