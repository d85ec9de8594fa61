"""Rules of a file to rules of the hub: their sentences get their meaning."""

from __future__ import annotations

from fuzzytree.readers import layout
from fuzzytree.readers.binding import shortened
from fuzzytree.readers.references import unknown_terms
from fuzzytree.readers.sentences import Vocabulary, guess, readings
from fuzzytree.rulebase import Clause, Mistake, Path, Rule


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
