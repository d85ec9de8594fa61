"""The domain of an audit: a closed box on which everything is asked.

A proof without a domain is useless: far outside the data nearly all of space is
uncovered. So each input has two ends, and where they come from is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from fuzzytree.model.contracts import Document
from fuzzytree.model.rulebase import Value, name_choice
from fuzzytree.model.system import FuzzySystem

Origin = Literal["model", "data", "spreads", "curves", "unused", "limits"]
"""Where a side comes from: the range in the model, the rows' smallest and largest
value, k spreads around the fitted sets, the span of the curves, nowhere (no answer
depends on the variable), the user."""


class Side(Value, frozen=True):
    """The values of one variable that are asked about: `low <= x <= high`.

    Attributes:
        variable: An input; or a combination, which limits its inputs together.
        low: The lower end, finite.
        high: The upper end, finite, not below `low`.
        origin: Where the two come from.
        is_open: Whether `low` itself is left out.
    """

    variable: str
    low: float
    high: float
    origin: Origin = "limits"
    is_open: bool = False


class Domain(Value, frozen=True):
    """A box: a side for each input, and for combinations that are limited besides."""

    sides: tuple[Side, ...]

    def side(self, variable: str) -> Side | None:
        """Return the side of a variable, None if it has none."""
        return next((one for one in self.sides if one.variable == variable), None)


def limited(
    domain: Domain,
    limits: Mapping[str, tuple[float, float]],
    model: Document,
) -> Domain:
    """Return a domain with other ends for some variables.

    Raises:
        ValueError: If a variable is unknown, or ends are swapped or not finite.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> limited(Domain(()), {tree.inputs[0]: (0.0, 1.0)}, tree).sides[0].high
        1.0
    """
    variables = model.inputs if isinstance(model, FuzzySystem) else model.variables
    names = [variable.name for variable in variables]
    for name, (low, high) in limits.items():
        if name not in names:
            raise ValueError(
                f"limits for {name!r}, which is no variable; {name_choice(name, names)}"
            )
        if not (math.isfinite(low) and math.isfinite(high)):
            raise ValueError(
                f"the limits of {name!r} must be finite, not {low!r} to {high!r}"
            )
        if low > high:
            raise ValueError(
                f"the limits of {name!r} are swapped: {low!r} to {high!r}; "
                "the smaller one stands first"
            )
    sides = [side for side in domain.sides if side.variable not in limits]
    sides += [Side(name, low, high) for name, (low, high) in limits.items()]
    order = {name: place for place, name in enumerate(names)}
    return Domain(tuple(sorted(sides, key=lambda side: order[side.variable])))
