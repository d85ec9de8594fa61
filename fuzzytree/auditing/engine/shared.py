"""Which rules can be equally strong on more than a surface at all, seen at once.

Under the minimum, where two rules are equally strong on an open set, each is as strong
as one of its curves there. Either that is the same curve on one axis, in one cell; or
the curves stand on two axes, and both are constant and of one level. Which rules share
a curve in a cell, and which constants each rule can be, is told by tables. What is
left is a question for `fuzzytree.auditing.engine.ties`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.auditing.engine.ground import Ground, Laid
from fuzzytree.auditing.engine.measures import local
from fuzzytree.auditing.engine.parts import START
from fuzzytree.auditing.engine.proportions import have_one_direction
from fuzzytree.model.interrupts import checkpoint

if TYPE_CHECKING:
    from fuzzytree.auditing.engine.ground import BoolArray
    from fuzzytree.model.contracts import IntArray


def may_tie(given: Ground) -> BoolArray:
    """Return which pairs of rules may be equally strong, and not 0, on an open set.

    Args:
        given: The rules and the box.

    Returns:
        Shape (rules, rules), symmetric. All are true under the product, where cells
        are too many to be kept, where an axis is a single value, and where two axes
        have one direction.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.auditing.engine.domain import Domain, Side
        >>> from fuzzytree.auditing.engine.ground import ground
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1))
        >>> box = Domain(tuple(Side(name, -9.0, 9.0) for name in rules.inputs))
        >>> may_tie(ground(rules, box)).shape
        (7, 7)
    """
    count = len(given.rules.rules)
    every: BoolArray = np.ones((count, count), dtype=bool)
    is_product = given.rules.semantics.conjunction == "product"
    if is_product or given.is_empty or not given.is_kept or not given.axes:
        return every
    laid, bands = given.laid
    if any(not len(one.cells.rank) for one in laid) or have_one_direction(given):
        return every
    flat = [_flat(one, bands.is_sharp) for one in laid]
    found = _constants(laid, flat, bands.is_sharp)
    for one, is_flat in zip(laid, flat, strict=True):
        rank, _, _, is_zero = _seen(one)
        alive = ~is_zero & ~is_flat  # constants are seen to
        for rule in range(count):
            checkpoint()
            cells = np.flatnonzero(alive[rule])
            same = rank[:, cells] == rank[rule, cells]
            found[rule] |= same.any(axis=1)
    return np.asarray(found | found.T)


def _seen(laid: Laid) -> tuple[IntArray, IntArray, IntArray, BoolArray]:
    """Return order, bands and zeros of the rules' degrees in cells: (rules, cells)."""
    columns = np.arange(laid.of.shape[1])
    return (
        laid.cells.rank[columns, laid.of],
        laid.least[laid.of, columns],
        laid.most[laid.of, columns],
        laid.is_zero[laid.of, columns],
    )


def is_constant(laid: Laid, element: int, cell: int) -> bool:
    """Return whether a curve is constant in a cell, or an axis a single value."""
    if cell == START:
        return True
    low, high = laid.cells.between[cell]
    return len(local(laid.axis.elements[element], (low + high) / 2)) == 1


def _flat(laid: Laid, is_sharp: BoolArray) -> BoolArray:
    """Return which rules' degrees are constant in a cell, and not 0: (rules, cells)."""
    flat = (laid.least == laid.most) & ~laid.is_zero
    # Within a band that is not one level, the curve itself tells.
    for row, cell in np.argwhere(flat & ~is_sharp[laid.least]).tolist():
        flat[row, cell] = is_constant(laid, row, cell)
    return np.asarray(flat[laid.of, np.arange(laid.of.shape[1])])


def _constants(
    laid: Sequence[Laid], flat: Sequence[BoolArray], is_sharp: BoolArray
) -> BoolArray:
    """Return which pairs may have one constant level in a box: (rules, rules).

    On one axis each is constant at the level; on the others it is too, or goes above.
    Within a band that is not one level, what goes above is not known.
    """
    seen = [_seen(one) for one in laid]
    held = [
        least[is_flat] for (_, least, _, _), is_flat in zip(seen, flat, strict=True)
    ]
    count = len(laid[0].of)
    found: BoolArray = np.zeros((count, count), dtype=bool)
    for band in np.unique(np.concatenate(held)).tolist():
        is_some: BoolArray = np.zeros(count, dtype=bool)
        both: BoolArray = np.ones((count, count), dtype=bool)
        for (_, least, most, _), is_flat in zip(seen, flat, strict=True):
            checkpoint()
            here = is_flat & (least == band)
            above = most > band if is_sharp[band] else most >= band
            is_some |= here.any(axis=1)
            reach = (here | above).astype(np.float32)
            both &= reach @ reach.T > 0.0
        found |= both & is_some & is_some[:, np.newaxis]
    return found
