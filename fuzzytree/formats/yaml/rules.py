"""Rules of a file or of another library to rules of the hub."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Iterable

from fuzzytree.formats.yaml import layout
from fuzzytree.formats.yaml.binding import shortened
from fuzzytree.formats.yaml.references import unknown_terms
from fuzzytree.formats.yaml.sentences import Vocabulary, guess, readings
from fuzzytree.model.rulebase import Clause, Mistake, Path, Rule
from fuzzytree.model.system import (
    And,
    Condition,
    Or,
    RuleBlock,
    SNorm,
    SystemRule,
    TNorm,
)


def read_rules(
    bound: list[layout.RuleOfModel | None],
    any_class: str,
    vocabulary: Vocabulary,
    mistakes: list[Mistake],
) -> tuple[Rule, ...]:
    """Return the rules, with one that is always right in the place of a broken one."""
    cache: dict[str | layout.WrittenOut, Clause | None] = {}
    rules: list[Rule] = []
    for position, one in enumerate(bound):
        if one is None:
            rules.append(Rule((), any_class))
            continue
        clauses: list[Clause] = []
        for index, clause in enumerate(one.if_):
            path: Path = ("rules", position, "when", index)
            if clause not in cache:
                meant = _clause(clause, vocabulary)
                cache[clause] = meant if isinstance(meant, Clause) else None
                if isinstance(meant, str):
                    mistakes.append((path, f"rule {position + 1}: {meant}"))
            read_clause = cache[clause]
            if read_clause is not None:
                clauses.append(read_clause)
        rules.append(Rule(tuple(clauses), one.then, one.support))
    return tuple(rules)


def _clause(given: str | layout.WrittenOut, vocabulary: Vocabulary) -> Clause | str:
    """Return a clause, or why the sentence cannot be one."""
    if isinstance(given, layout.WrittenOut):
        terms = given.is_ if given.is_ is not None else given.is_not or ()
        return Clause(given.variable, terms, negated=given.is_ is None)
    found = readings(given, vocabulary)
    if len(found) == 1:
        return found[0]
    if found:
        either = " or ".join(map(_written_out, found))
        return f"{shortened(given)} can be read in two ways; write {either}"
    meant = guess(given, vocabulary)
    if meant is None or not [*unknown_terms([((), "", meant)], vocabulary)]:
        return (
            f"{shortened(given)} is no clause; a clause is 'VARIABLE is TERM or TERM', "
            "or the same with 'is not'"
        )
    return meant


def _written_out(clause: Clause) -> str:
    verb = "is not" if clause.negated else "is"
    terms = ", ".join(map(repr, clause.terms))
    return f"{{variable: {clause.variable!r}, {verb}: [{terms}]}}"


def joined(join: type[And] | type[Or], left: Condition, right: Condition) -> Condition:
    """Return two conditions joined, without parentheses that change only rounding.

    Example:
        >>> from fuzzytree.model.system import Is
        >>> a, b, c = (Is("force", term) for term in "abc")
        >>> joined(Or, a, joined(Or, b, c)) == Or((a, b, c))
        True
    """
    first, last = (
        one.parts if isinstance(one, join) else (one,) for one in (left, right)
    )
    return join((*first, *last))


def blocks_of(
    rules: Iterable[tuple[SystemRule, TNorm, SNorm]], implication: TNorm | None
) -> tuple[RuleBlock, ...]:
    """Return blocks of rules in their order, a new one where the operators change.

    Args:
        rules: Each rule with its AND and its OR.
        implication: That of all blocks.
    """
    groups = itertools.groupby(rules, key=operator.itemgetter(1, 2))
    return tuple(
        RuleBlock(
            tuple(rule for rule, *_ in some), conjunction, disjunction, implication
        )
        for (conjunction, disjunction), some in groups
    )
