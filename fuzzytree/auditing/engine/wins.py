"""Is there an input at which a rule is stronger than some others?"""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import Final

from fuzzytree.auditing.engine.bounding import wins_by_boxes
from fuzzytree.auditing.engine.clock import Clock
from fuzzytree.auditing.engine.ground import Ground
from fuzzytree.auditing.engine.questions import Question, searched
from fuzzytree.auditing.engine.states import Bracket, Proved, State

_TOLERANCE: Final = 1e-6  # of a lead, at which boxes end


def wins(
    given: Ground, rule: int, rivals: Collection[int], clock: Clock | None = None
) -> State:
    """Return whether a rule is somewhere stronger than each of some others.

    Args:
        given: The rules and the box.
        rule: The number of the rule, from 1.
        rivals: The numbers of the others; without any it is asked whether the rule
            fires at all.
        clock: How much time there is; no limit unless given.

    Returns:
        `Proved`: it never is. `Witness`: it is, at a point that was evaluated in
        fractions. `Bracket`: the largest lead, where time or inputs that depend on each
        other leave it open.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.auditing.engine.domain import Domain, Side
        >>> from fuzzytree.auditing.engine.ground import ground
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1))
        >>> box = Domain(tuple(Side(name, -9.0, 9.0) for name in rules.inputs))
        >>> found = wins(ground(rules, box), 1, {2, 3})
        >>> [(one.kind, one.rules, one.rivals, one.level) for one in found.claims]
        [('beats', (1,), (2, 3), None), ('strength', (1,), (), '1')]
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    if given.is_empty:
        return Proved("the domain has no point")
    by_boxes = partial(
        wins_by_boxes, given.rules, given.domain, rule, others, tolerance=_TOLERANCE
    )
    if given.rules.semantics.conjunction == "product" or not given.is_kept:
        return by_boxes(clock)
    question = Question((rule,), others, None, f"the largest lead of rule {rule}")
    # Half of the time for cells, the rest for boxes: they see that clauses cancel, and
    # know inputs that depend on each other.
    found = searched(given, question, clock.share(0.5))
    if not isinstance(found, Bracket):
        return found
    other = by_boxes(clock.share(0.9))
    if not isinstance(other, Bracket):
        return other
    return min(found, other, key=lambda one: one.high)
