"""The classes of a node as gaussian clouds that share one scatter.

Cuts part whole classes from others. How many rows of a class lie on the wrong side of
a cut is what its cloud says, so that nodes of few rows do not follow single ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fuzzytree.learning.cuts import SplitAxis, tail
from fuzzytree.learning.directions import (
    axis_of,
    logistic_direction,
    selected_columns,
    shrunk,
    spread_of,
)
from fuzzytree.learning.rows import Chosen, Clouds, SplitRules, TrainingRows, best_cut
from fuzzytree.learning.sampling import hashed
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray, tallied

_DIGITS = 9
_AXES = 2
_LEADING = 3
_ROUNDS = 10
_PLACES = 64
_MOST_PAIRS = 40
_FEWEST_PAIRS = 4
_PAIRS_BY_CLASSES = 20_000  # pairs times all classes of a table
_KEPT_STARTS = 10
_FEWEST_STARTS = 2
_STARTS_BY_CLASSES = 1_000
_RIDGE = 0.01
_STRAY = 0.2  # share of a class; what is less came to a node by chance
_FEW_COLUMNS = 16
_ENTRY = 2.0  # the smallest partial F of a further column, where there are many


def class_groups(node: Chosen, rules: SplitRules) -> list[BoolArray]:
    """Return groups of whole classes, as a cut on a discriminant axis parts them."""
    if node.classes == 2:
        return [node.codes == 1]
    found: list[BoolArray] = []
    standard = node.rows.standard[node.at]
    means, sizes, within = _centres(node, standard)
    scatter = shrunk(within, rules.shrinkage)
    for axis in _discriminant_axes(means, sizes, scatter, _AXES).T:
        values = np.round(standard @ axis, _DIGITS)
        cut = best_cut(node, values, rules.min_rows)
        if cut is None:
            continue
        above = tallied(node.codes, node.weights * (values > cut[1]), node.classes)
        is_right = 2 * above > sizes
        if is_right.any() and not is_right.all():
            found.append(is_right[node.codes])
    return found


def clouds_of(rows: TrainingRows, at: IntArray) -> Clouds:
    """Return what all rows of a tree say of the classes."""
    sizes = tallied(rows.codes[at], rows.weights[at], rows.classes)
    return Clouds(_centres(Chosen.of(rows, at), rows.standard[at])[2], sizes)


def parted_clouds(
    node: Chosen, rules: SplitRules, whole: Clouds
) -> tuple[SplitAxis, BoolArray] | None:
    """Return a combination that parts whole classes, and which rows are of the second.

    What counts is the expected number of rows on the wrong side for each bit that the
    cut tells. Classes of which a node has but a few rows have no say.

    Args:
        node: The rows.
        rules: How many columns it may have, and what each must bring.
        whole: What all rows say of the classes.
    """
    standard = node.rows.standard[node.at]
    if standard.shape[1] < 2:
        return None
    means, sizes, scatter = _centres(node, standard)
    columns, freedom = len(scatter), max(len(node.at) - node.classes, 0)
    scatter = freedom * scatter + columns * whole.scatter  # which few rows lean on
    scatter = shrunk(scatter / (freedom + columns), rules.shrinkage)
    present = np.unique(node.rows.codes[node.at])
    counts = sizes >= _STRAY * whole.sizes[present]
    if np.count_nonzero(counts) < 2:
        return None
    white = _whitening(scatter)
    middle = sizes @ means / sizes.sum()
    places = (means - middle) @ white
    pairs = max(_FEWEST_PAIRS, min(_MOST_PAIRS, _PAIRS_BY_CLASSES // len(whole.sizes)))
    starts = _STARTS_BY_CLASSES // len(whole.sizes)
    starts = max(_FEWEST_STARTS, min(_KEPT_STARTS, starts))
    found = _best_groups(places[counts], sizes[counts], pairs, starts)
    if found is None:
        return None
    axis, groups = found
    along = places @ axis
    own = along[counts]
    side = along > (own[groups].min() + own[~groups].max()) / 2
    side[counts] = groups
    is_right: BoolArray = side[node.codes]
    selected = np.arange(standard.shape[1])
    direction: FloatArray | None = white @ axis
    if len(selected) > min(_FEW_COLUMNS, rules.columns):
        costs = rules.costs[node.rows.combinable]
        strict = replace(rules, entry=max(rules.entry, _ENTRY))
        selected = selected_columns(standard, is_right, node.weights, strict, costs)
        white = _whitening(scatter[np.ix_(selected, selected)])
        places = (means - middle)[:, selected] @ white
        basis = _span(places[counts], sizes[counts])
        turned = _parting(places[counts] @ basis.T, sizes[counts], groups)
        direction = None if turned is None else white @ (turned @ basis)
    if len(selected) < 2 or direction is None:
        return None
    spread = spread_of(standard[:, selected] @ direction, is_right)
    combined = axis_of(node.rows, selected, direction, spread)
    return None if combined is None else (combined, is_right)


def _best_groups(
    places: FloatArray, sizes: FloatArray, pairs: int, starts: int
) -> tuple[FloatArray, BoolArray] | None:
    """Return the axis on which a cut parts clouds of spread 1 best, and the groups."""
    basis = _span(places, sizes)
    places = places @ basis.T
    one, other = _pairs(len(places), pairs)
    leading = np.eye(len(basis))[:_LEADING]
    tried: list[tuple[float, BoolArray, FloatArray]] = []
    for start in [*leading, *(places[one] - places[other])]:
        if start.any():
            loss, groups = _least_loss(places, sizes, start)
            tried.append((loss, groups, start))
    best, lowest = None, np.inf
    seen: set[bytes] = set()
    for loss, groups, start in sorted(tried, key=lambda one: one[0])[:starts]:
        axis, is_known = start, False
        for _ in range(_ROUNDS):
            if loss < lowest:
                best, lowest = (axis @ basis, groups), loss
            key = groups.tobytes()
            better = None if is_known else _parting(places, sizes, groups)
            if better is None:
                break
            is_known = key in seen
            seen.add(key)
            axis = better
            loss, groups = _least_loss(places, sizes, axis)
    return best


def _span(places: FloatArray, sizes: FloatArray) -> FloatArray:
    """Return the directions in which clouds differ, the strongest first; one a row."""
    weighted = places * np.sqrt(sizes)[:, None]
    _, strengths, basis = np.linalg.svd(weighted, full_matrices=False)
    return np.asarray(basis[strengths > 1e-9 * strengths.max()], np.float64)


def _pairs(count: int, most: int) -> tuple[IntArray, IntArray]:
    """Return pairs of classes: all, or some where there are many."""
    if count * (count - 1) <= 2 * most:
        one, other = np.triu_indices(count, 1)
        return one, other
    drawn = (hashed(np.arange(2 * most)) % np.uint64(count)).astype(np.int64)
    one, other = drawn[:most], drawn[most:]
    return one[one != other], other[one != other]


def _parting(
    places: FloatArray, sizes: FloatArray, groups: BoolArray
) -> FloatArray | None:
    return logistic_direction(places, groups, sizes, _RIDGE * len(places))


def _least_loss(
    places: FloatArray, sizes: FloatArray, axis: FloatArray
) -> tuple[float, BoolArray]:
    """Return the least loss of a cut between clouds on an axis, and what is right."""
    along = np.round(places @ (axis / np.sqrt(axis @ axis)), _DIGITS)
    order = np.argsort(along, kind="stable")
    ordered, weights = along[order], sizes[order]
    behind = np.arange(len(order) - 1)
    if len(behind) > _PLACES:
        behind = np.unique(np.linspace(0, len(order) - 2, _PLACES).astype(np.int64))
    cuts = ordered[behind] / 2 + ordered[behind + 1] / 2
    is_right = np.arange(len(order)) > behind[:, None]
    distance = np.where(is_right, ordered - cuts[:, None], cuts[:, None] - ordered)
    lost = tail(distance) @ weights
    share = np.cumsum(weights)[behind] / weights.sum()
    bits = -share * np.log(share) - (1 - share) * np.log1p(-share)
    losses = np.round((lost / weights.sum() + 1e-4) / bits, _DIGITS)
    best = int(losses.argmin())
    chosen = np.zeros(len(order), bool)
    chosen[order] = is_right[best]
    return float(losses[best]), chosen


def _centres(
    node: Chosen, standard: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the means of the classes, their weights, and the scatter within them."""
    order = np.argsort(node.codes, kind="stable")
    starts = np.searchsorted(node.codes[order], np.arange(node.classes))
    weighted = standard[order] * node.weights[order][:, None]
    sizes = tallied(node.codes, node.weights, node.classes)
    means = np.add.reduceat(weighted, starts, axis=0) / sizes[:, None]
    moved = standard[order] - means[node.codes[order]]
    within = (moved * node.weights[order][:, None]).T @ moved
    freedom = max(len(order) - node.classes, 1) / len(order)
    return means, sizes, within / (sizes.sum() * freedom)


def _whitening(scatter: FloatArray) -> FloatArray:
    """Return what turns the scatter into the identity."""
    values, vectors = np.linalg.eigh(scatter)
    whitening: FloatArray = vectors / np.sqrt(np.maximum(values, 1e-9 * values.max()))
    return whitening


def _discriminant_axes(
    means: FloatArray, sizes: FloatArray, within: FloatArray, count: int
) -> FloatArray:
    """Return Fisher's discriminant axes, the most powerful first; one a column."""
    if not len(within):
        return np.empty((0, 0))
    whitening = _whitening(within)
    moved = (means - sizes @ means / sizes.sum()) * np.sqrt(sizes)[:, None]
    spread = moved @ whitening
    _, axes = np.linalg.eigh(spread.T @ spread)
    count = min(len(means) - 1, count, axes.shape[1])
    found = whitening @ axes[:, ::-1][:, :count]
    largest = np.argmax(np.abs(np.round(found, _DIGITS)), axis=0)
    axes = found * np.sign(found[largest, np.arange(count)])
    return np.asarray(axes, np.float64)
