"""The parts of a tree: nodes with their branches, leaves, and fitted sets."""

from __future__ import annotations

import msgspec

from fuzzytree.model.probabilities import Probabilities
from fuzzytree.model.values import Value
from fuzzytree.model.variables import Term


class Leaf(Value, frozen=True):
    """Where a path ends.

    Attributes:
        label: The class.
        pattern: The fuzzy pattern that it holds; the class itself, or one of several
            shapes of the class, such as `hand #2`.
        support: How many training rows reached it, if known; estimated from a sample
            where learning kept one (`rows_per_class`).
        probabilities: As those of its rule.
        counts: The support by class, in the order of the model's; empty if unknown.
    """

    label: str
    pattern: str = ""
    support: int | None = None
    probabilities: Probabilities = msgspec.UNSET
    counts: tuple[int, ...] = ()


class Branch(Value, frozen=True):
    """One way on from a node: to the node or leaf of that number.

    Attributes:
        terms: The relative terms of the node's variable, joined by OR, one for each
            interval that the branch owns, in their order: bands whose plateaus are
            these intervals, so that the degree is 1 exactly where the branch is taken.
        sets: The patterns whose fitted sets on that variable make up the raw degree
            of the branch, joined by OR; empty in a tree that carries no sets.
        node: The number of the next node, or None.
        leaf: The number of the leaf, or None; exactly one of the two is given.
    """

    terms: tuple[str, ...]
    sets: tuple[str, ...] = ()
    node: int | None = None
    leaf: int | None = None


class Node(Value, frozen=True):
    """A question about one variable.

    Attributes:
        variable: The variable it looks at.
        cuts: b1 < b2 < ... < bk: where the decision changes.
        owners: For each of the k + 1 intervals (b_i, b_i+1], the position of its
            branch in `branches`; every branch owns at least one, and neighbours
            belong to different branches.
        branches: At least two.
    """

    variable: str
    cuts: tuple[float, ...]
    owners: tuple[int, ...]
    branches: tuple[Branch, ...]


class Sets(Value, frozen=True):
    """The fitted sets (LR type) of the patterns on one variable, named by pattern."""

    variable: str
    terms: tuple[Term, ...]
