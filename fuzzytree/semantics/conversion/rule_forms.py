"""Rules that conclude one number, and rules with OR as several rules with AND alone.

Under min and max an `a and (b or c)` is `(a and b) or (a and c)`, and 1 minus the
largest is the least of 1 minus each: rounding is monotone, so both are true to the last
bit. (A not of a not stays: 1 - (1 - d) is rounded.) A rule with an OR becomes several
rules with its conclusions where these are joined by maximum: implications by min and
product, and weights, are monotone too.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from fuzzytree.model import (
    And,
    Condition,
    Curve,
    FuzzySystem,
    Hedge,
    Loss,
    Not,
    Or,
    Proposition,
    RuleBase,
    RuleBlock,
    SystemOutput,
    SystemRule,
    combined,
    questions,
)


def joined_outputs(model: FuzzySystem | RuleBase) -> frozenset[str]:
    """Return the weighted outputs with an aggregation that can change an answer.

    It joins the degrees of each term: where every term is concluded once at most, and
    no rule references the output, there is nothing to join.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.semantics import as_system
        >>> from fuzzytree.testing import random_tree
        >>> joined_outputs(as_system(rules_from_tree(random_tree(0))))
        frozenset()
    """
    rules: list[SystemRule] = [rule for block in model.blocks for rule in block.rules]
    counts = Counter((part.output, part.term) for rule in rules for part in rule.then)
    several = {output for (output, _), count in counts.items() if count > 1}
    several |= {part.variable for rule in rules for part in questions(rule.when)}
    outputs: tuple[SystemOutput, ...] = model.outputs
    return frozenset(
        output.name
        for output in outputs
        if output.defuzzifier.is_weighted
        and output.aggregation
        and output.name in several
    )


def joined_by_number(system: FuzzySystem) -> FuzzySystem:
    """Return a system that joins rules by the numbers that they conclude.

    Where several terms of an output have one number, engines that join weighted
    conclusions take the terms for one. Rules conclude the first of them here.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.semantics import as_system
        >>> from fuzzytree.testing import random_tree
        >>> system = as_system(rules_from_tree(random_tree(0)))
        >>> joined_by_number(system) == system
        True
    """
    first = _first_terms(system)

    def joined(block: RuleBlock) -> RuleBlock:
        rules = [
            replace(
                rule,
                then=tuple(
                    replace(one, term=first.get((one.output, one.term), one.term))
                    for one in rule.then
                ),
            )
            for rule in block.rules
        ]
        return replace(block, rules=tuple(rules))

    return replace(system, blocks=tuple(map(joined, system.blocks)))


def number_losses(system: FuzzySystem) -> Iterator[Loss]:
    """Yield the outputs of which an engine that joins by number joins more rules."""
    joined = joined_by_number(system)
    for output in system.outputs:
        changed = {
            one.term: other.term
            for rule, after in zip(system.rules, joined.rules, strict=True)
            for one, other in zip(rule.then, after.then, strict=True)
            if one.output == output.name and one != other
        }
        for label, other in changed.items():
            yield Loss(
                f"terms {other!r} and {label!r} of {output.name!r}",
                f"they are one number, and rules of both are joined by "
                f"{output.aggregation}; here each term counts",
            )


def _first_terms(system: FuzzySystem) -> dict[tuple[str, str], str]:
    """Return the first term of each number, of outputs whose conclusions are joined."""
    first: dict[tuple[str, str], str] = {}
    for output in system.outputs:
        if not output.defuzzifier.is_weighted or output.aggregation in (None, "sum"):
            continue
        earlier: dict[tuple[Curve, float], str] = {}
        for label in output.terms:
            result = earlier.setdefault((label.function, label.height), label.name)
            first[output.name, label.name] = result
    return first


MOST_RULES = 64
"""The most rules that one becomes."""


def split(
    rule: SystemRule, block: RuleBlock, system: FuzzySystem
) -> tuple[SystemRule, ...]:
    """Return rules whose conditions are all and, that say together what one says.

    Returns:
        The rules; only the rule itself if it is one, if they would be more than 64, or
        if they would not say the same to the last bit.

    Example:
        >>> from fuzzytree.model import Conclusion
        >>> a, b, c = (Proposition(name, ("x",)) for name in "abc")
        >>> both = And((a, Or((b, c))))
        >>> alternatives(both) == [And((a, b)), And((a, c))]
        True
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
    result = alternatives(rule.when)
    if not 1 < len(result) <= MOST_RULES:
        return (rule,)
    return tuple(replace(rule, when=when) for when in result)


def alternatives(condition: Condition) -> list[Condition]:
    """Return what may hold for a condition to hold, an and of questions each.

    At most one more than `MOST_RULES`.
    """
    return [combined(And, parts) for parts in _alternatives(condition, 0)]


def _alternatives(condition: Condition, nots: int) -> list[tuple[Condition, ...]]:
    """Return the alternatives of a condition that stands in a number of nots."""
    match condition:
        case Proposition(hedges=hedges):
            outer: list[Hedge] = ["not" for _ in range(nots)]
            return [(replace(condition, hedges=(*outer, *hedges)),)]
        case Not(part=part):
            return _alternatives(part, nots + 1)
        case And(parts=parts) | Or(parts=parts):
            results = [_alternatives(part, nots) for part in parts]
            whole: Iterable[tuple[Condition, ...]]
            if isinstance(condition, Or) != bool(nots % 2):
                whole = itertools.chain.from_iterable(results)
            else:
                whole = (
                    tuple(itertools.chain.from_iterable(several))
                    for several in itertools.product(*results)
                )
            return [*itertools.islice(whole, MOST_RULES + 1)]
