"""The paths of a tree, and its rules."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from fuzzytree.auditing.recheck.model_records import (
    Branch,
    Clause,
    Node,
    Rule,
    Rules,
    Tree,
)

Steps = tuple[tuple[Node, Branch], ...]


def paths(tree: Tree) -> Iterator[tuple[int, Steps]]:
    """Yield each leaf's number and the path to it, in the order of the leaves."""
    todo: list[tuple[int | None, int | None, Steps]]
    todo = [(1, None, ()) if tree.nodes else (None, 1, ())]
    while todo:
        node, leaf, path = todo.pop()
        if node is None:
            yield leaf or 0, path
            continue
        asked = tree.nodes[node - 1]
        todo += [
            (b.node, b.leaf, (*path, (asked, b))) for b in reversed(asked.branches)
        ]


def rules_of(tree: Tree, kind: Literal["relative", "raw"]) -> Rules:
    """Return the rules of a tree: rule k is the path to leaf k, a clause a node."""
    groups = {v.name: v.terms for v in tree.variables}
    if kind == "raw":
        groups = {group.variable: group.terms for group in tree.sets}
    variables = tuple(v._replace(terms=groups.get(v.name, ())) for v in tree.variables)
    rules = [
        Rule(
            tuple(
                Clause(node.variable, way.terms if kind == "relative" else way.sets)
                for node, way in path
            ),
            tree.leaves[number - 1].label,
            tree.leaves[number - 1].support,
        )
        for number, path in paths(tree)
    ]
    head = (tree.name, tree.classes, variables, tuple(rules), tree.semantics)
    return Rules(*head, kind, tree.columns)
