"""What a model means, in fractions: paths, rules, strengths, predictions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Literal

from fuzzytree.auditing.recheck.model_records import (
    Branch,
    Clause,
    Model,
    Node,
    Rule,
    Rules,
    Tree,
    Variable,
)
from fuzzytree.auditing.recheck.polynomials import ONE, ZERO, degree

Point = Mapping[str, Fraction]


def value_of(variable: Variable, point: Point) -> Fraction:
    """Return the value of an input or a combination at a point."""
    if not variable.parts:
        return point[variable.name]
    parts = variable.parts
    terms = (Fraction(p.weight) * (point[p.input] - Fraction(p.centre)) for p in parts)
    return sum(terms, start=ZERO)


def strengths(rules: Rules, point: Point) -> list[Fraction]:
    """Return the strength of every rule at a point."""
    variables = {v.name: v for v in rules.variables}
    shapes = {(v.name, t.name): t.shape for v in rules.variables for t in v.terms}
    clauses = dict.fromkeys(clause for rule in rules.rules for clause in rule.when)
    degrees: dict[Clause, Fraction] = {}
    for clause in clauses:
        x = value_of(variables[clause.variable], point)
        highest = max(degree(shapes[clause.variable, term], x) for term in clause.terms)
        degrees[clause] = 1 - highest if clause.negated else highest
    result = [[degrees[clause] for clause in rule.when] for rule in rules.rules]
    if rules.semantics.conjunction == "product":
        return [math.prod(one, start=ONE) for one in result]
    return [min(one, default=ONE) for one in result]


def answer_of(model: Model, point: Point) -> str | None:
    """Return the class that a model gives a point; None is no class."""
    if isinstance(model, Rules):
        result = strengths(model, point)
        best = max(result)
        if best == 0:
            return model.semantics.uncovered
        return model.rules[result.index(best)].then
    return model.leaves[leaf_of(model, point) - 1].label


def leaf_of(tree: Tree, point: Point) -> int:
    """Return the number of the leaf that a point reaches."""
    variables = {v.name: v for v in tree.variables}
    branch = Branch((), (), 1, None) if tree.nodes else Branch((), (), None, 1)
    while branch.node is not None:
        node = tree.nodes[branch.node - 1]
        x = value_of(variables[node.variable], point)
        branch = node.branches[node.owners[sum(x > cut for cut in node.cuts)]]
    return branch.leaf or 0


# --- trees

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
        used = tree.nodes[node - 1]
        todo += [(b.node, b.leaf, (*path, (used, b))) for b in reversed(used.branches)]


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
