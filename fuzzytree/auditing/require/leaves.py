"""Two rows of a tree that differ in some inputs only: every pair of leaves is tried.

A leaf is a product of unions of intervals, so two rows with the same values of all
other inputs can reach two leaves exactly if these share a value of each.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.regions import cut_side
from fuzzytree.auditing.require.search import Rows
from fuzzytree.model import FuzzyTree

_Parts = dict[str, tuple[DomainSide, ...]]
"""The parts of the sides of variables that reach a leaf."""


def _leaves(tree: FuzzyTree, sides: _Parts) -> Iterator[tuple[str, _Parts]]:
    """Yield the class of each leaf that can be reached, and how."""
    todo: list[tuple[int | None, int | None, _Parts]]
    todo = [(1, None, sides) if tree.nodes else (None, 1, sides)]
    while todo:
        number, leaf, parts = todo.pop()
        if number is None:
            yield tree.leaves[(leaf or 1) - 1].label, parts
            continue
        node = tree.nodes[number - 1]
        intervals = [*itertools.pairwise((None, *node.cuts, None))]
        for place, branch in enumerate(node.branches):
            own = [
                one
                for one, owner in zip(intervals, node.owners, strict=True)
                if owner == place
            ]
            pairs = itertools.product(parts[node.variable], own)
            cuts = tuple(cut for side, one in pairs if (cut := cut_side(side, one)))
            if cuts:
                todo.append((branch.node, branch.leaf, parts | {node.variable: cuts}))


def pair_of_rows(
    tree: FuzzyTree,
    domain: Domain,
    changing: tuple[str, ...],
    is_wrong: Callable[[str, str], bool],
    *,
    rises: bool,
) -> Rows | None:
    """Return two rows that differ in some inputs and have classes that are wrong.

    Sums of inputs count as free, and have no part in `changing`; where the tree has
    some, the model may give the two rows other classes.

    Args:
        tree: The tree.
        domain: Where the rows are.
        changing: The inputs in which they may differ.
        is_wrong: Whether the classes of the first and the second row are wrong.
        rises: Whether the changing input must be larger in the second row.
    """
    free = DomainSide("", -math.inf, math.inf)
    sides: _Parts = {
        one.name: (domain.side(one.name) or free,) for one in tree.variables
    }
    leaves = [*_leaves(tree, sides)]
    for (label, mine), (other_label, other) in itertools.product(leaves, repeat=2):
        if not is_wrong(label, other_label):
            continue
        columns: list[tuple[float, float]] = []
        for variable in tree.variables:
            name = variable.name
            pair: tuple[float, float] | None
            if name in changing:
                pair = (
                    min(map(_least, mine[name])),
                    max(one.high for one in other[name]),
                )
                pair = None if rises and not pair[0] < pair[1] else pair
            else:
                shared = _shared(mine[name], other[name])
                pair = None if shared is None else (shared, shared)
            if pair is None:
                break
            if not variable.parts:
                columns.append(pair)
        else:
            return np.array(columns)
    return None


def _least(part: DomainSide) -> float:
    """Return the least double of a part of a side."""
    return math.nextafter(part.low, math.inf) if part.is_open else part.low


def _shared(
    mine: tuple[DomainSide, ...], other: tuple[DomainSide, ...]
) -> float | None:
    """Return a double that two unions of parts share, None if they share none."""
    for one, two in itertools.product(mine, other):
        low, high = max(_least(one), _least(two)), min(one.high, two.high)
        if one.values:
            if common := {*one.values} & {*two.values}:
                return min(common)
        elif low <= high:
            is_plain = math.isfinite(low + high) and not one.is_whole
            return (low + high) / 2 if is_plain else high
        if one.missing is not None and one.missing == two.missing:
            return one.missing
    return None
