"""Step 7 of the paper: the next powerful feature is linearly combined.

The best bipartition of a node's patterns is sought along few directions, then Fisher's
direction for it, until neither moves; features enter one after another, the most
powerful first, until another one no longer helps (a partial F test). Needs the
patterns' means and covariances only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fuzzytree.learning.cuts import SplitAxis, rounded_to, single, tail
from fuzzytree.learning.patterns import Patterns
from fuzzytree.learning.units import BoolArray, FloatArray, IntArray

_ROUNDS = 10
_PLACES = 32
_MANY = 48
_OWN = 1e-12
_DIGITS = 9
_CHEAPEST = 2.0**-100  # gains divided by it are finite


@dataclass(frozen=True)
class NodeView:
    """A node's patterns in standard units.

    Attributes:
        labels: The class of each pattern.
        weights: Their rows.
        means: Shape (patterns, features).
        scatter: Covariance of each pattern, or one for all (shape (1, ...)).
        within: The weighted mean covariance, off-diagonals shrunk, diagonal above 0.
    """

    labels: IntArray
    weights: FloatArray
    means: FloatArray
    scatter: FloatArray
    within: FloatArray


def node_view(patterns: Patterns, chosen: IntArray, shrinkage: float) -> NodeView:
    """Return what a combination needs to know of a node."""
    features = patterns.combinable
    weights = patterns.weights[chosen]
    raw = patterns.moments.means[np.ix_(chosen, features)]
    means = (raw - patterns.centre[features]) / patterns.scale[features]
    is_apart = len(patterns.scatter) == patterns.size
    scatter = patterns.scatter[chosen] if is_apart else patterns.scatter
    if is_apart:
        freedom = np.maximum(weights - 1.0, 1e-3)
        within = np.tensordot(freedom / freedom.sum(), scatter, axes=1)
    else:
        within = scatter[0].copy()
    diagonal = np.einsum("ii->i", within)
    floor = np.maximum((1e-2 * np.ptp(means, axis=0)) ** 2, 1e-12)
    variances = np.maximum(diagonal, floor)
    within *= 1.0 - shrinkage
    np.einsum("ii->i", within)[:] = variances
    return NodeView(patterns.labels[chosen], weights, means, scatter, within)


def best_bipartition(view: NodeView) -> BoolArray:
    """Return which of a node's patterns go right: the cut of least expected error."""
    if len(view.labels) == 2:
        return np.array([False, True])
    best: BoolArray | None = None
    lowest = np.inf
    seen: set[bytes] = set()
    for axis in _directions(view).T:
        error, is_right = _best_place(view, axis)
        for _ in range(_ROUNDS):
            if is_right.tobytes() in seen:
                break
            seen.add(is_right.tobytes())
            if error < lowest:
                lowest, best = error, is_right
            if len(view.labels) > _MANY:
                break
            axis = fisher_direction(view, is_right)
            error, is_right = _best_place(view, axis)
    if best is None:
        best = view.means[:, 0] > np.median(view.means[:, 0])
    return best


def _directions(view: NodeView) -> FloatArray:
    """Return axes to start from: discriminant ones and the most powerful features."""
    total = view.weights.sum()
    moved = view.means - view.weights @ view.means / total
    between = (moved * view.weights[:, None]).T @ moved / total
    power = np.diag(between) / np.diag(view.within)
    count = min(len(power), 2 if len(view.labels) <= _MANY else 16)
    leading = np.argsort(-power, kind="stable")[:count]
    singles = np.zeros((len(power), count))
    singles[leading, np.arange(count)] = 1.0
    values, vectors = np.linalg.eigh(view.within)
    whitening = vectors / np.sqrt(np.maximum(values, 1e-9 * values.max()))
    _, axes = np.linalg.eigh(whitening.T @ between @ whitening)
    count = min(len(view.labels) - 1, 3, axes.shape[1])
    return np.hstack([whitening @ axes[:, ::-1][:, :count], singles])


def fisher_direction(view: NodeView, is_right: BoolArray) -> FloatArray:
    """Return W^-1 (mean of the right - mean of the left)."""
    return _solved(view.within, _mean_step(view, is_right))


def _mean_step(view: NodeView, is_right: BoolArray) -> FloatArray:
    right, left = view.weights * is_right, view.weights * ~is_right
    step: FloatArray = right @ view.means / right.sum() - left @ view.means / left.sum()
    return step


def _solved(within: FloatArray, step: FloatArray) -> FloatArray:
    try:
        solution = np.linalg.solve(within, step)
    except np.linalg.LinAlgError:
        solution = np.linalg.lstsq(within, step, rcond=1e-12)[0]
    return solution.astype(np.float64, copy=False)


def _best_place(view: NodeView, axis: FloatArray) -> tuple[float, BoolArray]:
    """Return the least expected error of a cut on an axis, and what is right of it."""
    means = view.means @ axis
    usual = math.sqrt(max(float(axis @ view.within @ axis), 1e-300))
    if len(view.scatter) == len(means):
        spreads = np.sqrt(np.maximum((view.scatter @ axis) @ axis, 1e-6 * usual**2))
    else:
        spreads = np.full(len(means), usual)
    order = np.argsort(means, kind="stable")
    places = _places(len(means))
    m, s = means[order], spreads[order]
    cuts = (m[:-1] * s[1:] + m[1:] * s[:-1]) / (s[1:] + s[:-1])
    cuts = cuts[places]
    is_right = np.arange(len(m)) > places[:, None]
    u = np.where(is_right, m - cuts[:, None], cuts[:, None] - m) / s
    lost = tail(u) * view.weights[order]
    errors = (lost * _foreign(view, order, is_right)).sum(axis=1)
    errors = errors + 1e-9 * np.abs(is_right.mean(axis=1) - 0.5) * view.weights.sum()
    best = int(errors.argmin())
    chosen = np.zeros(len(m), bool)
    chosen[order] = is_right[best]
    return float(errors[best]), chosen


def _places(size: int) -> IntArray:
    """Return after which patterns a cut may lie: all, or some in the middle of many.

    The middle keeps a tree over very many patterns shallow.
    """
    if size <= _MANY:
        return np.arange(size - 1)
    return np.unique(np.linspace(size * 0.2, size * 0.8, _PLACES).astype(np.int64))


def _foreign(view: NodeView, order: IntArray, is_right: BoolArray) -> FloatArray:
    """Return for each cut and pattern how much of the other side is another class.

    A row that strays to a side where its own class lives too is not lost.
    """
    if len(view.labels) > _MANY:
        return np.ones((1, 1))
    same = view.labels[order][:, None] == view.labels[order]
    weights = view.weights[order]
    right = is_right * weights
    left = ~is_right * weights
    own_right = right @ same / right.sum(axis=1, keepdims=True)
    own_left = left @ same / left.sum(axis=1, keepdims=True)
    foreign: FloatArray = 1.0 - np.where(is_right, own_left, own_right)
    return foreign


def selected_features(
    view: NodeView,
    is_right: BoolArray,
    *,
    rows: float,
    entry: float,
    costs: FloatArray,
    most: int = 64,
) -> IntArray:
    """Return the features of a combination, most powerful first.

    A feature enters if its partial F, divided by its cost, is at least `entry`.

    Args:
        view: The node.
        is_right: Which patterns go right.
        rows: How many rows the statistics rest on.
        entry: The smallest partial F.
        costs: Per combinable feature.
        most: The largest number of features.
    """
    rest = view.within.copy()
    step = _mean_step(view, is_right)
    total = view.weights.sum()
    share = float(view.weights[is_right].sum() / total)
    factor = share * (1.0 - share)
    original = np.diag(view.within).copy()
    prices = np.maximum(costs, _CHEAPEST)
    selected: list[int] = []
    power = 0.0
    for _ in range(min(most, len(step))):
        variances = np.einsum("ii->i", rest)
        is_free = variances > _OWN * original
        is_free[selected] = False
        gains = np.where(is_free, step**2 / np.where(is_free, variances, 1.0), 0.0)
        best = int(np.argmax(gains / prices))
        gain = float(gains[best])
        freedom = max(rows - 2 - len(selected), 1.0)
        helps = freedom * factor * gain / (1.0 + factor * power) / prices[best]
        if gain <= 0.0 or (selected and helps < entry):
            break
        selected.append(best)
        power += gain
        column = rest[:, best] / rest[best, best]
        step = step - column * step[best]
        rest = rest - np.outer(column, rest[best])
    return np.array(selected or [0], np.int64)


def combined_axis(
    patterns: Patterns, view: NodeView, is_right: BoolArray, selected: IntArray
) -> SplitAxis:
    """Return Fisher's direction over the selected features, in the table's units."""
    if len(selected) == 1:
        return single(int(patterns.combinable[selected[0]]))
    within = view.within[np.ix_(selected, selected)]
    step = _mean_step(view, is_right)[selected]
    return axis_of(patterns, selected, _solved(within, step), within)


def axis_of(
    patterns: Patterns,
    selected: IntArray,
    direction: FloatArray,
    within: FloatArray,
) -> SplitAxis:
    """Return an axis in the table's units from a direction in standard units.

    Its unit is the spread within patterns. A weight is rounded so finely that a spread
    of its column changes by no more than a thousandth of that unit; the cuts are
    placed afterwards. Centres are the columns' origins, values of the table, so that
    the first step of an axis, value less centre, has the digits that learning saw.
    """
    features = patterns.combinable[selected]
    length = math.sqrt(max(float(direction @ within @ direction), 0.0))
    if not math.isfinite(length) or length == 0.0:
        return single(int(features[0]))
    scales = patterns.scale[features]
    weights = np.array(
        [
            rounded_to(weight, -_DIGITS - math.frexp(scale)[1])
            for weight, scale in zip(
                (direction / length / scales).tolist(), scales.tolist(), strict=True
            )
        ]
    )
    keep = (weights != 0) & patterns.units.is_combinable[features]
    keep &= np.abs(direction) > 1e-6 * np.abs(direction).max()
    if np.count_nonzero(keep) < 2:
        return single(int(features[np.argmax(np.abs(direction))]))
    chosen = features[keep]
    units = patterns.units
    raw = np.ldexp(weights[keep], -units.exponents[chosen])
    return SplitAxis(chosen, raw, units.origins[chosen], True)
