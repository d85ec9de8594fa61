"""Where it matters how several rules of one conclusion are joined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from msgspec.structs import replace

from fuzzytree.model.contracts import Loss
from fuzzytree.model.system import Curve, FuzzySystem, RuleBlock, questions


def joined_outputs(system: FuzzySystem) -> frozenset[str]:
    """Return the weighted outputs with an aggregation that can change an answer.

    It joins the degrees of each term: where every term is concluded once at most, and
    no rule asks the output, there is nothing to join.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.semantics.conversion import as_system
        >>> from fuzzytree.testing import random_tree
        >>> joined_outputs(as_system(rules_from_tree(random_tree(0))))
        frozenset()
    """
    counts = Counter((one.output, one.label) for r in system.rules for one in r.then)
    several = {output for (output, _), count in counts.items() if count > 1}
    several |= {asked.variable for r in system.rules for asked in questions(r.when)}
    return frozenset(
        one.name
        for one in system.outputs
        if one.defuzzifier.is_weighted and one.aggregation and one.name in several
    )


def joined_by_number(system: FuzzySystem) -> FuzzySystem:
    """Return a system that joins rules by the numbers that they conclude.

    Where several terms of an output have one number, engines that join weighted
    conclusions take the terms for one. Rules conclude the first of them here.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.semantics.conversion import as_system
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
                    replace(one, label=first.get((one.output, one.label), one.label))
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
            one.label: other.label
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
        seen: dict[tuple[Curve, float], str] = {}
        for label in output.labels:
            found = seen.setdefault((label.curve, label.height), label.name)
            first[output.name, label.name] = found
    return first
