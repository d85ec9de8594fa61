"""The best split of a node, scored by the classes of the rows themselves.

A split's score is what it takes from the rows' entropy, in nats, less a price for each
column that it looks at. Single columns compete with linear combinations of columns:
logistic directions towards groups of the node's classes, or towards the sides of the
best single column. Where next to nothing helps, two splits are looked for together, as
an exclusive or needs them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np

from fuzzytree.learning.clouds import class_groups, parted_clouds
from fuzzytree.learning.cuts import SplitAxis, TreeSplit, single
from fuzzytree.learning.directions import axis_towards, logistic_cut
from fuzzytree.learning.rows import (
    DIGITS,
    Chosen,
    Clouds,
    SplitRules,
    TrainingRows,
    best_cut,
    between,
    information,
)
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray, tallied

Style = Literal["columns", "mixed", "centres"]
"""What splits a node: single columns; these or combinations; combinations alone, that
part the classes' centres."""

_PRICE = 2.0
_PRICE_OF_COLUMN = 0.5
_MOST_CELLS = 1 << 23
_FEW = 10
_PURE = 1e-6
_GOOD = 0.5

_ROWS_PER_COLUMN = 5  # in nodes where rows may say more than their classes' clouds
_PRICE_OF_ROWS = 1.0  # for each column

_LOOK_PRICE = 10.0  # of a split by chance; where none gains more, two are looked for
_LOOK_SHARE = 0.5  # of all rows, in nodes where this is done
_LOOK_COLUMNS = 24
_LOOK_PLACES = 12


def best_split(
    rows: TrainingRows,
    at: IntArray,
    rules: SplitRules,
    style: Style,
    whole: Clouds | None = None,
) -> TreeSplit | None:
    """Return the split of a node in two, or None where none pays.

    Args:
        rows: To learn from.
        at: Those of the node.
        rules: What a split must keep to.
        style: What splits the node.
        whole: What all rows of the tree say of the classes, if these are parted whole.
    """
    node = Chosen.of(rows, at)
    if node.classes < 2 or len(at) < 2 * rules.min_rows:
        return None
    total = tallied(node.codes, node.weights, node.classes)
    entropy = -float(information(total))
    if whole is not None:
        parted = _parted(node, rules, whole, entropy)
        if parted is not None:
            return parted
    best = None
    column = _best_column(node, rules, entropy)
    sides: list[BoolArray] = []
    if column is not None:
        best = column
        sides.append(column[1].branches(rows.values[at]) > 0)
    if style != "columns" and rules.columns > 1 and len(at) >= _FEW:
        groups = [*class_groups(node, rules), *sides]
        found = _combined(node, rules, entropy, groups)
        if found is not None and (best is None or found[0] > best[0]):
            best = found
    gain = 0.0 if best is None else best[0]
    is_large = len(at) >= _LOOK_SHARE * rows.size and entropy > 4 * _LOOK_PRICE
    if is_large and gain < _LOOK_PRICE:
        ahead = _looked_ahead(node, rules, entropy, max(gain, 0.0))
        if ahead is not None:
            return ahead
    return best[1] if best is not None and best[0] > 0 else None


def _counts(node: Chosen, groups: IntArray, size: int) -> FloatArray:
    """Return the weight of each class in each group, shape (size, classes)."""
    cells = groups * node.classes + node.codes
    found = tallied(cells, node.weights, size * node.classes)
    return found.reshape(size, node.classes)


def _best_column(
    node: Chosen, rules: SplitRules, entropy: float
) -> tuple[float, TreeSplit] | None:
    """Return the best split by one column and its score."""
    rows = node.rows
    if not len(rows.owners) or len(rows.owners) * node.classes > _MOST_CELLS:
        return None
    scores, owners = _bin_scores(node, rules.min_rows)
    if not np.isfinite(scores).any():
        return None
    cheap = -rules.costs[rows.searched][owners]
    best = int(np.lexsort((np.arange(len(owners))[::-1], cheap, scores))[-1])
    place = int(owners[best])
    column = int(rows.searched[place])
    if rows.categories[column] > 2:
        return _best_categories(node, column, rules.min_rows, entropy)
    moved = rows.moved[node.at, column]  # rows that share a place stay together
    found = best_cut(node, moved, rules.min_rows)
    if found is None:
        return None
    values, is_above = rows.values[node.at, column], moved > found[1]
    cut = between(float(values[~is_above].max()), float(values[is_above].min()))
    return _gain(entropy, found[0], _PRICE), _split(single(column), cut)


def _gain(entropy: float, score: float, price: float) -> float:
    """Return what a split gains; one that parts all classes has no price."""
    return entropy + score - (price if score < -_PURE else 0.0)


def _bin_scores(node: Chosen, min_rows: int) -> tuple[FloatArray, IntArray]:
    """Return the score of a cut behind each bin, and the searched column of each bin.

    Where a node has few rows, bins that hold none of them are left out.
    """
    rows = node.rows
    bins, owners = rows.bins[node.at], rows.owners
    columns = len(rows.searched)
    if bins.size < len(owners):
        used, places = np.unique(bins, return_inverse=True)
        bins, owners = places.reshape(bins.shape), owners[used]
    size = len(owners)
    starts = np.searchsorted(owners, np.arange(columns))
    cells = (bins * node.classes + node.codes[:, None]).ravel()
    weights = np.repeat(node.weights, columns)
    counts = tallied(cells, weights, size * node.classes)
    below = np.cumsum(counts.reshape(size, node.classes), axis=0)
    sizes = np.cumsum(np.bincount(bins.ravel(), minlength=size))
    first = starts[owners]
    below -= np.where(first > 0, 1.0, 0.0)[:, None] * below[first - 1]
    sizes = sizes - np.where(first > 0, sizes[first - 1], 0)
    total = below[starts[1] - 1] if columns > 1 else below[-1]
    above = np.maximum(total - below, 0.0)
    below = np.maximum(below, 0.0)
    scores = np.round(information(below) + information(above), DIGITS)
    is_open = (sizes >= min_rows) & (len(node.at) - sizes >= min_rows)
    return np.where(is_open, scores, -np.inf), owners


def _split(axis: SplitAxis, *cuts: float) -> TreeSplit:
    """Return a split in two whose intervals belong to the branches by turns."""
    return TreeSplit(axis, np.array(cuts), np.arange(len(cuts) + 1) % 2, ())


def _best_categories(
    node: Chosen, column: int, min_rows: int, entropy: float
) -> tuple[float, TreeSplit] | None:
    """Return the best split of a column's categories in two sets, and its score.

    The categories are ordered along the axis on which their shares of the classes
    differ most; for two classes the best set is a run of this order.
    """
    values = node.rows.values[node.at, column]
    places, inverse = np.unique(values, return_inverse=True)
    if len(places) < 2:
        return None
    counts = _counts(node, inverse, len(places))
    sizes = counts.sum(axis=1, keepdims=True)
    shares = counts / np.maximum(sizes, 1e-300)
    moved = shares - counts.sum(axis=0) / sizes.sum()
    _, axes = np.linalg.eigh((moved * sizes).T @ moved)
    along = np.round(moved @ axes[:, -1], DIGITS)
    order = np.argsort(along, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    found = best_cut(node, rank[inverse].astype(np.float64), min_rows)
    if found is None:
        return None
    score, cut = found
    is_right = rank > cut
    if is_right[0]:
        is_right = ~is_right
    changes = np.flatnonzero(np.diff(is_right))
    cuts = [float(np.floor((places[k] + places[k + 1]) / 2)) + 0.5 for k in changes]
    price = _PRICE + 0.5 * (len(places) - 2)
    return _gain(entropy, score, price), _split(single(column), *cuts)


def _combined(
    node: Chosen, rules: SplitRules, entropy: float, groups: Iterable[BoolArray]
) -> tuple[float, TreeSplit] | None:
    """Return the best split by a direction towards one of some groups of rows."""
    best: tuple[float, TreeSplit] | None = None
    seen: dict[bytes, BoolArray] = {}
    for is_right in groups:
        right = int(np.count_nonzero(is_right))
        if min(right, len(is_right) - right) >= 2:
            seen.setdefault(is_right.tobytes(), is_right)
    ways = [(is_right, False) for is_right in seen.values()]
    ways += [(is_right, True) for is_right in [*seen.values()][:1]]
    for is_right, is_fine in ways:
        if is_fine and best is not None and best[0] > _GOOD * entropy:
            continue
        axis = axis_towards(node, is_right, rules, is_fine=is_fine)
        if axis is None:
            continue
        values = axis.values(node.rows.values[node.at])
        if not np.isfinite(values).all():
            continue
        found = best_cut(node, values, rules.min_rows)
        if found is not None:
            gain = _gain(entropy, found[0], _price_of(axis))
            if best is None or gain > best[0]:
                best = gain, _split(axis, found[1])
    return best


def _price_of(axis: SplitAxis) -> float:
    return _PRICE + _PRICE_OF_COLUMN * (len(axis.features) - 1)


def _parted(
    node: Chosen, rules: SplitRules, whole: Clouds, entropy: float
) -> TreeSplit | None:
    """Return a split between whole classes, or None where it does not pay.

    It follows the classes' clouds, or the rows themselves where these are many and gain
    more by it than chance explains.
    """
    found = parted_clouds(node, rules, whole)
    if found is None:
        return None
    axis, is_right = found
    best = _between_groups(node, rules, axis, is_right, entropy)
    if len(node.at) >= _ROWS_PER_COLUMN * len(axis.features):
        other = axis_towards(node, is_right, rules)
        if other is not None:
            own = _between_groups(node, rules, other, is_right, entropy)
            price = _PRICE_OF_ROWS * len(other.features)
            if own is not None and (best is None or own[0] > best[0] + price):
                best = own
    return None if best is None else best[1]


def _between_groups(
    node: Chosen,
    rules: SplitRules,
    axis: SplitAxis,
    is_right: BoolArray,
    entropy: float,
) -> tuple[float, TreeSplit] | None:
    """Return the split where two groups are equally likely, if it gains anything."""
    values = axis.values(node.rows.values[node.at])
    if not np.isfinite(values).all():
        return None
    cut = logistic_cut(values, is_right, node.weights)
    above = values > cut
    size = int(np.count_nonzero(above))
    if min(size, len(above) - size) < rules.min_rows:
        return None
    cut = between(float(values[~above].max()), float(values[above].min()))
    counts = _counts(node, above.astype(np.int64), 2)
    gain = _gain(entropy, float(information(counts).sum()), _price_of(axis))
    return (gain, _split(axis, cut)) if gain > 0 else None


def _looked_ahead(
    node: Chosen, rules: SplitRules, entropy: float, gain: float
) -> TreeSplit | None:
    """Return the first of two splits that help together, if they help much more."""
    rows = node.rows
    is_small = len(node.at) < 4 * rules.min_rows
    if not len(rows.owners) or node.classes > _LOOK_PLACES or is_small:
        return None
    scores = np.full(len(rows.searched), -np.inf)
    found, owners = _bin_scores(node, rules.min_rows)
    np.maximum.at(scores, owners, found)
    columns = np.sort(np.argsort(-scores, kind="stable")[:_LOOK_COLUMNS]).tolist()
    coarse = [(column, *_coarse(node, column)) for column in columns]
    coarse = [one for one in coarse if len(one[2]) > 1]
    best, place = -np.inf, (0, 0.0)
    for number in range(len(coarse) - 1):
        here, others = coarse[number], coarse[number + 1 :]
        counts = _joint(node, here[1], np.stack([bins for _, bins, _ in others]))
        found = np.stack(
            [_best_of_two(counts), _best_of_two(counts.transpose(0, 2, 1, 3))], axis=1
        )
        firsts = [(here, other) for other in others]
        for pair, both in zip(found, firsts, strict=True):
            for scored, (_, _, ends) in zip(pair, both, strict=True):
                scored[len(ends) - 1 :] = -np.inf
        pair, turn, k = np.unravel_index(int(found.argmax()), found.shape)
        if found[pair, turn, k] > best:
            column, _, ends = firsts[pair][turn]
            best, place = float(found[pair, turn, k]), (column, float(ends[k]))
    if entropy + best - 2 * _LOOK_PRICE <= 2 * gain + _LOOK_PRICE:
        return None
    column = int(rows.searched[place[0]])
    values = rows.values[node.at, column]
    right = rows.moved[node.at, column] > place[1]
    if not right.any() or right.all():
        return None
    cut = between(float(values[~right].max()), float(values[right].min()))
    return _split(single(column), cut)


def _coarse(node: Chosen, place: int) -> tuple[IntArray, FloatArray]:
    """Return a column in few bins of the node's rows, and where each ends."""
    values = node.rows.moved[node.at, node.rows.searched[place]]
    ordered = np.sort(values)
    steps = np.arange(1, _LOOK_PLACES + 1) * len(ordered) // _LOOK_PLACES - 1
    ends = np.unique(ordered[np.maximum(steps, 0)])
    return np.searchsorted(ends, values), ends


def _joint(node: Chosen, one: IntArray, others: IntArray) -> FloatArray:
    """Return the weight of each class in the bins of a column and each other one.

    Args:
        node: The rows.
        one: The bin of each row.
        others: The same for each other column, shape (others, rows).

    Returns:
        Shape (others, places, places, classes).
    """
    pairs = np.arange(len(others))[:, None]
    cells = (pairs * _LOOK_PLACES + one) * _LOOK_PLACES + others
    cells = (cells * node.classes + node.codes).ravel()
    size = len(others) * _LOOK_PLACES**2 * node.classes
    counts = tallied(cells, np.tile(node.weights, len(others)), size)
    return counts.reshape(-1, _LOOK_PLACES, _LOOK_PLACES, node.classes)


def _best_of_two(counts: FloatArray) -> FloatArray:
    """Return the best information after a cut behind each bin of the first column.

    Args:
        counts: As `_joint` returns them.

    Returns:
        Shape (others, places - 1).
    """
    below = np.cumsum(counts, axis=1)
    result = np.zeros((len(counts), _LOOK_PLACES - 1))
    for half in (below[:, :-1], below[:, -1:] - below[:, :-1]):
        left = np.cumsum(half, axis=2)
        right = np.maximum(left[:, :, -1:] - left, 0.0)
        result += (information(left) + information(right)).max(axis=2)
    return np.round(result, DIGITS)
