"""Names in a file that nothing declares.

The hub names what is close to an unknown name. Where a hostile file holds so many of
them that this would take minutes, they are only listed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from fuzzytree.readers.binding import shortened
from fuzzytree.readers.sentences import Vocabulary
from fuzzytree.rulebase import Clause, Mistake, Path, Rule, Variable, clause_text
from fuzzytree.tree import Node

_MOST_COMPARED: Final = 200_000

Asked = tuple[Path, str, Clause]
"""Where a clause stands, in the model and in words, and the clause."""


def clauses_of_rules(rules: Sequence[Rule]) -> Iterator[Asked]:
    """Yield the clauses of rules."""
    for number, rule in enumerate(rules, 1):
        for index, clause in enumerate(rule.when):
            yield ("rules", number - 1, "when", index), f"rule {number}", clause


def clauses_of_nodes(nodes: Sequence[Node]) -> Iterator[Asked]:
    """Yield the branches of nodes as clauses."""
    for number, node in enumerate(nodes, 1):
        for index, branch in enumerate(node.branches):
            path: Path = ("nodes", number - 1, "branches", index)
            yield path, f"node {number}", Clause(node.variable, branch.terms)


def unknown_terms(asked: Iterable[Asked], vocabulary: Vocabulary) -> Iterator[Mistake]:
    """Yield the clauses that name an unknown variable or term."""
    known: dict[int, Clause] = {}  # rules share clauses
    for path, where, clause in asked:
        declared = vocabulary.get(clause.variable)
        if id(clause) in known:
            continue
        if declared is not None and declared.terms.issuperset(clause.terms):
            known[id(clause)] = clause
        else:
            text = shortened(clause_text(clause))
            yield path, f"{where}: {text} names what is not declared"


def unknown_classes(
    rules: Sequence[Rule], classes: tuple[str, ...]
) -> Iterator[Mistake]:
    """Yield the rules that conclude an unknown class."""
    known = frozenset(classes)
    for number, rule in enumerate(rules, 1):
        if rule.then not in known:
            text = f"rule {number}: no class {shortened(rule.then)}"
            yield ("rules", number - 1, "then"), text


def unknown_inputs(variables: Sequence[Variable]) -> Iterator[Mistake]:
    """Yield the summands of unknown inputs."""
    known = {variable.name for variable in variables if not variable.parts}
    for position, variable in enumerate(variables):
        for index, part in enumerate(variable.parts):
            if part.input not in known:
                path: Path = ("variables", position, "parts", index, "input")
                yield path, f"no input {shortened(part.input)}"


def is_flood(
    unknown: Sequence[Mistake], vocabulary: Vocabulary, classes: Sequence[str]
) -> bool:
    """Return whether so much is unknown that looking for similar names takes long."""
    names = len(classes) + sum(1 + len(one.terms) for one in vocabulary.values())
    return len(unknown) * names > _MOST_COMPARED
