"""The cheapest change of a row that gives another class, or a wanted one.

Of a tree the regions of its leaves say it (`polytopes`). Of rules, points that are
drawn and moved towards the row give an upper bound; boxes around the row, the nearest
first, give the lower one: each is shown to have no such point, or is halved. What boxes
leave, because rules only touch there, the decider is asked.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from fractions import Fraction

from fuzzytree.auditing.decide.answers import (
    ZERO,
    Budget,
)
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.contest import Contest, decided
from fuzzytree.auditing.decide.costs import Costs, Nearest
from fuzzytree.auditing.decide.polytopes import Leaves
from fuzzytree.auditing.decide.search import Search


def nearest(
    base: Base | Leaves,
    point: Mapping[str, Fraction],
    wanted: str | None = None,
    fixed: Collection[str] = (),
    costs: Mapping[str, Fraction] | None = None,
    budget: Budget | None = None,
) -> Nearest:
    """Return what the cheapest change costs that gives another class.

    A change costs as much as that of the input that costs most: by default a number
    its share of the domain's width, a category 1.

    Args:
        base: Rules of which the strongest decides, or the regions of a tree's leaves.
        point: From where; a row of the domain.
        wanted: The class that is wanted; any other than that of the row by default.
        fixed: Inputs that do not change.
        costs: What a change by 1 costs, or of a category any change, by input.
        budget: How many steps may be taken; what is known then is returned.

    Raises:
        ValueError: If an input is unknown, or a cost is not above 0.

    Example:
        >>> from fuzzytree.auditing.decide.domain import Domain, DomainSide
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> box = Domain(tuple(DomainSide(name, -9.0, 9.0) for name in tree.inputs))
        >>> leaves = Leaves(tree, box)
        >>> row = dict.fromkeys(tree.inputs, ZERO)
        >>> change = nearest(leaves, row)
        >>> change.is_narrow, leaves.decided(change.point) != leaves.decided(row)
        (True, True)
    """
    budget = budget or Budget()
    inputs = base.inputs
    of = Costs(base.domain, tuple(inputs), fixed, costs)
    if isinstance(base, Leaves):
        own, _ = base.decided(point)
        if own == wanted:
            return Nearest(ZERO, ZERO, dict(point))
        return base.parts.nearest(point, base.chosen(own, wanted), of, budget)
    label, _ = decided(base, point)
    if label == wanted is not None:
        return Nearest(ZERO, ZERO, dict(point))
    contest = Contest(base, label, wanted)
    return Search(contest, point, of, budget).run()
