"""How much each column of a table matters to a tree that was learnt from it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fuzzytree.learning.rows import information
from fuzzytree.model import FuzzyTree, Variable


def importances(tree: FuzzyTree) -> dict[str, float]:
    """Return the share of each column in what the nodes learn about the classes.

    A node gains what the entropy of its rows falls by, in the unit of rows. The rows of
    a leaf are its support, and their classes its probabilities. A combination's gain is
    divided in proportion to the weights of its columns, times their ranges.

    Returns:
        By column, with the sum 1; all 0 if no node gains anything.

    Raises:
        TypeError: If the model has no leaves.

    Example:
        >>> from fuzzytree.learning import learn_arrays
        >>> values = np.array([[1.0, 5.0], [2.0, 6.0], [7.0, 5.0], [8.0, 6.0]])
        >>> codes = np.array([0, 0, 1, 1])
        >>> found = learn_arrays(values, codes, columns=["a", "b"], classes=["n", "y"])
        >>> importances(found.tree)
        {'a': 1.0, 'b': 0.0}
    """
    if not tree.leaves:
        kind = f"{tree.name} is a rule base"  # as of more than 200 classes
        raise TypeError(f"importances takes a tree, and {kind}")
    variables = {variable.name: variable for variable in tree.variables}
    result = dict.fromkeys(tree.columns or tree.inputs, 0.0)
    shares = [
        leaf.probabilities or [float(name == leaf.label) for name in tree.classes]
        for leaf in tree.leaves
    ]
    leaves = np.array(shares) * [[leaf.support or 0] for leaf in tree.leaves]
    inside = np.zeros((len(tree.nodes), len(tree.classes)))
    for number in reversed(range(len(tree.nodes))):  # parents stand before children
        node = tree.nodes[number]
        below = np.array(
            [
                leaves[(branch.leaf or 1) - 1]
                if branch.node is None
                else inside[branch.node - 1]
                for branch in node.branches
            ]
        )
        inside[number] = below.sum(axis=0)
        gain = float(information(below).sum() - information(inside[number]))
        for name, share in _shares(variables[node.variable], variables).items():
            result[name] += max(gain, 0.0) * share
    total = sum(result.values())
    return {name: gain / total if total else 0.0 for name, gain in result.items()}


def _shares(variable: Variable, known: Mapping[str, Variable]) -> dict[str, float]:
    """Return the share of each column in a variable; their sum is 1."""
    if not variable.parts:
        return {variable.name: 1.0}
    found: dict[str, float] = {}
    for part in variable.parts:
        low, high = known[part.input].low, known[part.input].high
        width = 1.0 if low is None or high is None else high - low
        found[part.input] = abs(part.weight) * width
    total = sum(found.values())
    return {name: size / total for name, size in found.items()}
