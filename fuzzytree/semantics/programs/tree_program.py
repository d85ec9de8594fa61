"""A tree as a program, and the program of any model, whatever container it came from.

A row passes few of a tree's nodes, so runtimes and writers follow its path instead. Its
program asks every node; it is for whoever looks at the steps of any model.
"""

from __future__ import annotations

from fuzzytree.model import Branch, Document, FuzzySystem, FuzzyTree, RuleBase
from fuzzytree.semantics.programs.rule_program import (
    DECIDED,
    MISSING,
    from_rules,
    input_values,
)
from fuzzytree.semantics.programs.steps import Maker, Place, Program, result_of
from fuzzytree.semantics.programs.system_program import from_system


def from_tree(tree: FuzzyTree) -> Program:
    """Return the program of a tree: at each node the interval that holds its value.

    Its answers are those of `fuzzytree.semantics.reference.descend`.

    Returns:
        A program with the results `rule` (the leaf's number), `status` and `class`.

    Example:
        >>> from fuzzytree.testing import random_tree
        >>> [result.kind for result in from_tree(random_tree(0)).results]
        ['rule', 'status', 'class']
    """
    make = Maker()
    known, axes = input_values(make, tree.variables)
    leaves: dict[int, Place] = {}  # the number of the leaf that a node leads to

    def leaf_number(branch: Branch) -> Place:
        if branch.node is None:
            return make.constant(float(branch.leaf or 0))
        return leaves[branch.node]

    for number in range(len(tree.nodes), 0, -1):  # from the last on
        node = tree.nodes[number - 1]
        with make.topic(f"node {number}"):
            interval = make.table("below", axes[node.variable], node.cuts)
            way = make.table("pick", interval, map(float, node.owners))
            leaf = leaf_number(node.branches[-1])
            for place, branch in reversed([*enumerate(node.branches[:-1])]):
                is_taken = make.equal(way, make.constant(float(place)))
                leaf = make.where(is_taken, leaf_number(branch), leaf)
        leaves[number] = leaf
    zero = make.constant(0.0)
    rule = make.where(known, leaves.get(1, make.constant(1.0)), zero)
    status = make.where(known, DECIDED, MISSING)
    answer = tree.semantics.missing
    code = -1.0 if answer is None else float(tree.classes.index(answer))
    owners = [float(tree.classes.index(leaf.label)) for leaf in tree.leaves]
    label = make.table("pick", rule, [code, *owners])
    results = (
        result_of("rule", "rule", rule),
        result_of("status", "status", status),
        result_of("class", "class", label),
    )
    return make.program(tree.name, tree.inputs, results)


def program_of(
    model: Document, *, with_strengths: bool = True, with_probabilities: bool = False
) -> Program:
    """Return the program of any model.

    Args:
        model: A tree, a rule base or a fuzzy system.
        with_strengths: Whether the degrees of activation of a system's rules are
            results; the strengths of a rule base always are.
        with_probabilities: Whether the probabilities of classes are results; a rule
            base must have them, and nothing else has them.

    Example:
        >>> from fuzzytree.testing import random_system
        >>> program = program_of(random_system(2), with_strengths=False)
        >>> [result.kind for result in program.results]
        ['output', 'output', 'status']
    """
    match model:
        case FuzzyTree():
            return from_tree(model)
        case RuleBase():
            return from_rules(model, probabilities=with_probabilities)
        case FuzzySystem():
            return from_system(model, activations=with_strengths)
