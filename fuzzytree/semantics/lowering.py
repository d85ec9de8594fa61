"""From a tree to rules: one rule for each path, one proposition for each node on it.

**Relative rules equal the tree on every input.** On the path that the tree takes, each
proposition has degree exactly 1, for its terms' plateaus are the intervals of the taken
branch. Any other path leaves that path at some node, by a branch that is not taken
there, whose degree is below 1. Min and product never exceed their smallest operand, in
floating point too, so every other rule is below 1 and the taken path's rule, with
strength 1, wins alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal, overload

import msgspec
from msgspec.structs import replace

from fuzzytree.errors import InvalidModelError
from fuzzytree.model import (
    Branch,
    Conjunction,
    Document,
    FuzzySystem,
    FuzzyTree,
    Kind,
    Proposition,
    Rule,
    RuleBase,
    Term,
    Use,
    Variable,
    kind_of,
    remember,
    root_of,
)

Form = Literal["tree", "relative rules", "raw rules", "rules", "system"]
"""What can be made of a model, as people call it."""

TITLES: Mapping[Use, Form] = {
    "tree": "tree",
    "relative": "relative rules",
    "raw": "raw rules",
}
"""The form of a tree that serves each use."""


@overload
def forms(
    model: FuzzyTree | RuleBase, uses: Iterable[Use] | None = None
) -> Mapping[Form, FuzzyTree | RuleBase]: ...


@overload
def forms(
    model: Document, uses: Iterable[Use] | None = None
) -> Mapping[Form, Document]: ...


def forms(
    model: Document, uses: Iterable[Use] | None = None
) -> Mapping[Form, Document]:
    """Return what can be made of a model, by the name that people call it.

    Args:
        model: A tree, a rule base or a fuzzy system.
        uses: Only what serves these; all that the model can serve if None.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> list(forms(random_tree(1)))
        ['tree', 'relative rules', 'raw rules']
    """
    if not model.leaves:
        return {kind_of(model): model}
    wanted = set(TITLES if uses is None else uses)
    result: dict[Form, Document] = {}
    if "tree" in wanted:
        result[TITLES["tree"]] = model
    kinds: tuple[Kind, ...] = ("relative", "raw") if model.sets else ("relative",)
    for kind in kinds:
        if kind in wanted:
            result[TITLES[kind]] = rules_from_tree(model, kind)
    return result


@overload
def rules_of(model: FuzzyTree | RuleBase) -> RuleBase: ...


@overload
def rules_of(model: Document) -> RuleBase | FuzzySystem: ...


def rules_of(model: Document) -> RuleBase | FuzzySystem:
    """Return a model as rules: the relative rules of a tree, anything else as it is.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_of(random_tree(1))
        >>> rules_of(rules) is rules
        True
    """
    if isinstance(model, FuzzyTree):
        return remember(model, "relative rules", lambda: rules_from_tree(model))
    return model


def rules_from_tree(
    tree: Document,
    kind: Kind = "relative",
    *,
    conjunction: Conjunction | None = None,
) -> RuleBase:
    """Turn each path of a tree into a rule, in the order of the leaves.

    Args:
        tree: The tree: a model with leaves.
        kind: `relative` for rules that equal the tree on every input; `raw` for the
            paper's rules, whose terms are the fitted sets as they are.
        conjunction: The AND of the rules; the tree's own unless given.

    Returns:
        A rule base whose rule k is leaf k, with the variables that the nodes test.

    Raises:
        InvalidModelError: If `kind` is `raw` and the tree carries no sets.
    """
    if kind == "raw" and tree.nodes and not tree.sets:
        text = f"tree {tree.name!r} carries no fitted sets, so it has no raw rules"
        raise InvalidModelError([(("sets",), text)])
    semantics = tree.semantics
    if kind == "raw":  # probabilities belong to relative strengths
        semantics = msgspec.structs.replace(semantics, sharpness=msgspec.UNSET)
    if conjunction:
        semantics = msgspec.structs.replace(semantics, conjunction=conjunction)
    return RuleBase(
        name=tree.name,
        classes=tree.classes,
        variables=_variables(tree, kind),
        rules=_rules(tree, kind),
        semantics=semantics,
        kind=kind,
        columns=tree.columns,
    )


def _variables(tree: Document, kind: Kind) -> tuple[Variable, ...]:
    terms: dict[str, tuple[Term, ...]]
    if kind == "relative":
        terms = {v.name: v.terms for v in tree.variables}
    else:
        terms = {s.variable: s.terms for s in tree.sets}
    return tuple(replace(v, terms=terms.get(v.name, ())) for v in tree.variables)


def _rules(tree: Document, kind: Kind) -> tuple[Rule, ...]:
    rules: list[Rule] = []
    todo: list[tuple[Branch, tuple[Proposition, ...]]] = [(root_of(tree), ())]
    while todo:
        branch, path = todo.pop()
        if branch.leaf is not None:
            leaf = tree.leaves[branch.leaf - 1]
            shares = leaf.probabilities if kind == "relative" else msgspec.UNSET
            rules.append(Rule(path, leaf.label, leaf.support, shares, leaf.counts))
        elif branch.node is not None:
            node = tree.nodes[branch.node - 1]
            for step in reversed(node.branches):
                names = step.terms if kind == "relative" else step.sets
                todo.append((step, (*path, Proposition(node.variable, names))))
    return tuple(rules)
