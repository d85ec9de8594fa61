"""Names in a file that nothing declares.

The hub names what is close to an unknown name. Where a hostile file holds so many of
them that this would take minutes, they are only listed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from fuzzytree.formats.yaml.binding import shortened
from fuzzytree.formats.yaml.sentences import Vocabulary
from fuzzytree.model.rulebase import Clause, Mistake, Path, Rule, Variable, clause_text
from fuzzytree.model.tree import Branch, Node

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
    for path, where, node, branch in _branches(nodes):
        yield path, where, Clause(node.variable, branch.terms)


def sets_of_nodes(nodes: Sequence[Node]) -> Iterator[Asked]:
    """Yield the fitted sets of branches as clauses."""
    for path, where, node, branch in _branches(nodes):
        if branch.sets:
            yield path, where, Clause(node.variable, branch.sets)


def _branches(nodes: Sequence[Node]) -> Iterator[tuple[Path, str, Node, Branch]]:
    for number, node in enumerate(nodes, 1):
        for index, branch in enumerate(node.branches):
            path: Path = ("nodes", number - 1, "branches", index)
            yield path, f"node {number}", node, branch


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


def unknown_inputs(
    variables: Sequence[Variable], columns: Sequence[str]
) -> Iterator[Mistake]:
    """Yield the summands of unknown inputs, and inputs that are no columns."""
    known = {variable.name for variable in variables if not variable.parts}
    of_table = frozenset(columns) if columns else known
    for position, variable in enumerate(variables):
        if not variable.parts and variable.name not in of_table:
            path: Path = ("variables", position, "name")
            yield path, f"input {shortened(variable.name)} is not among the columns"
        for index, part in enumerate(variable.parts):
            if part.input not in known:
                path = ("variables", position, "parts", index, "input")
                yield path, f"no input {shortened(part.input)}"


def is_flood(unknown: Sequence[Mistake], known: int) -> bool:
    """Return whether so much is unknown that looking for similar names takes long."""
    return len(unknown) * known > _MOST_COMPARED
