"""Rules that mix and and or, as several rules that are all and.

Under min and max an `a and (b or c)` is `(a and b) or (a and c)`, and 1 minus the
largest is the least of 1 minus each: rounding is monotone, so both hold to the last
bit. (A not of a not stays: 1 - (1 - d) is rounded.) A rule with an or becomes several
rules with its conclusions where these are joined by maximum: implications by min and
product, and weights, are monotone too.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

from msgspec.structs import replace

from fuzzytree.model.system import (
    And,
    Condition,
    FuzzySystem,
    Hedge,
    Is,
    Not,
    Or,
    RuleBlock,
    SystemRule,
)

MOST_RULES = 64
"""The most rules that one becomes."""


def split(
    rule: SystemRule, block: RuleBlock, system: FuzzySystem
) -> tuple[SystemRule, ...]:
    """Return rules whose conditions are all and, that say together what one says.

    Args:
        rule: The rule.
        block: The block it stands in.
        system: The system it stands in.

    Returns:
        The rules; only the rule itself if it is one, if they would be more than 64, or
        if they would not say the same to the last bit.

    Example:
        >>> from fuzzytree.model.system import Conclusion
        >>> both = And((Is("a", "x"), Or((Is("b", "y"), Is("c", "z")))))
        >>> [len(one.parts) for one in alternatives(both)]
        [2, 2]
    """
    outputs = {one.name: one for one in system.outputs}
    is_monotone = (
        block.conjunction == "minimum"
        and block.disjunction == "maximum"
        and block.implication in (None, "minimum", "product")
        and block.activation.method == "general"
        and all(
            outputs[one.output].aggregation == "maximum" and not one.hedges
            for one in rule.then
        )
    )
    if rule.when is None or not is_monotone:
        return (rule,)
    found = alternatives(rule.when)
    if not 1 < len(found) <= MOST_RULES:
        return (rule,)
    return tuple(replace(rule, when=when) for when in found)


def alternatives(condition: Condition) -> list[And]:
    """Return what may hold for a condition to hold, an and of questions each.

    At most one more than `MOST_RULES`.
    """
    return [And(parts) for parts in _alternatives(condition, 0)]


def _alternatives(condition: Condition, nots: int) -> list[tuple[Condition, ...]]:
    """Return the alternatives of a condition that stands in a number of nots."""
    match condition:
        case Is(variable=variable, label=label, hedges=hedges):
            outer: list[Hedge] = ["not" for _ in range(nots)]
            return [(Is(variable, label, (*outer, *hedges)),)]
        case Not(part=part):
            return _alternatives(part, nots + 1)
        case And(parts=parts) | Or(parts=parts):
            found = [_alternatives(part, nots) for part in parts]
            whole: Iterable[tuple[Condition, ...]]
            if isinstance(condition, Or) != bool(nots % 2):
                whole = itertools.chain.from_iterable(found)
            else:
                whole = (
                    tuple(itertools.chain.from_iterable(several))
                    for several in itertools.product(*found)
                )
            return [*itertools.islice(whole, MOST_RULES + 1)]
