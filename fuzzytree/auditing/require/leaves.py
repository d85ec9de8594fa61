"""Two rows of a tree that differ in some inputs only: every pair of leaves is tried.

A leaf is a product of unions of intervals, so two rows with the same values of all
other inputs can reach two leaves exactly if these share a value of each.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection

import numpy as np

from fuzzytree.auditing.engine.domain import Domain, DomainSide
from fuzzytree.auditing.engine.regions import (
    EVERYWHERE,
    Union,
    common,
    cut_side,
    regions,
)
from fuzzytree.auditing.require.search import Rows
from fuzzytree.model import FuzzyTree


def pair_of_rows(
    tree: FuzzyTree,
    domain: Domain,
    changes: Collection[str],
    is_wrong: Callable[[str, str], bool],
    *,
    rises: bool,
) -> Rows | None:
    """Return two rows that differ in some inputs and have classes that are wrong.

    Sums of inputs count as free, and have no part in `changes`; where the tree has
    some, the model may give the two rows other classes.

    Args:
        tree: The tree.
        domain: Where the rows are.
        changes: The inputs in which they may differ.
        is_wrong: Whether the classes of the first and the second row are wrong.
        rises: Whether the changing input must be larger in the second row.
    """
    free = DomainSide("", -math.inf, math.inf)
    leaves = [(region.label, dict(region.sides)) for region in regions(tree)]
    for (label, mine), (other_label, other) in itertools.product(leaves, repeat=2):
        if not is_wrong(label, other_label):
            continue
        columns: list[tuple[float, float]] = []
        for variable in tree.variables:
            side = domain.side(variable.name) or free
            one = mine.get(variable.name, EVERYWHERE)
            two = other.get(variable.name, EVERYWHERE)
            if variable.name in changes:
                first, second = _values(side, one), _values(side, two)
            else:
                first = second = _values(side, common(one, two))[-1:]
            if not (first and second):
                break
            pair = min(first), max(second)
            if rises and variable.name in changes and pair[0] >= pair[1]:
                break
            columns.append(pair)
        else:
            places = [not variable.parts for variable in tree.variables]
            return np.array(columns)[places][..., None]
    return None


def _values(side: DomainSide, union: Union) -> list[float]:
    """Return values of a side in a union, among them the least and the largest."""
    result: list[float] = []
    for part in (cut for interval in union if (cut := cut_side(side, interval))):
        low = math.nextafter(part.low, math.inf) if part.is_open else part.low
        result += [] if part.missing is None else [part.missing]
        result += [low, part.high]
        if not (part.values or part.is_whole) and math.isfinite(low + part.high):
            result.append((low + part.high) / 2)
    return result
