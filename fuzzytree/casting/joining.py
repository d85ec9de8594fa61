"""Where it matters how several rules of one conclusion are joined."""

from __future__ import annotations

from collections import Counter

from fuzzytree.system import FuzzySystem, questions


def joined_outputs(system: FuzzySystem) -> frozenset[str]:
    """Return the weighted outputs with an aggregation that can change an answer.

    It joins the degrees of each term: where every term is concluded once at most, and
    no rule asks the output, there is nothing to join.

    Example:
        >>> from fuzzytree.lowering import rules_from_tree
        >>> from fuzzytree.casting import as_system
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
