"""Linear combinations of columns.

A combination parts two groups of a node's rows. Columns enter it one after another, the
most powerful first, until another one no longer helps (a partial F test); its weights
are those of a penalised logistic regression on them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fuzzytree.learning.cuts import SplitAxis, rounded_to
from fuzzytree.learning.rows import Chosen, SplitRules, TrainingRows
from fuzzytree.learning.units import BoolArray, ColumnUnits, FloatArray, IntArray

MOST_COLUMNS = 64
"""A combination has no more columns than this."""

_MOST_ROWS = 4_000
_NEWTON_STEPS = 6
_OWN = 1e-12
_FINE = 1e-5
_SMALLEST = 1e-6
_ROWS_PER_COLUMN = 10
_DIGITS = 9
_CHEAPEST = 2.0**-100  # gains divided by it are finite


def shrunk(scatter: FloatArray, shrinkage: float) -> FloatArray:
    """Return a scatter with smaller entries beside its diagonal."""
    diagonal = np.maximum(np.diag(scatter), 1e-6)
    shrunk: FloatArray = scatter * (1.0 - shrinkage)
    np.einsum("ii->i", shrunk)[:] = diagonal
    return shrunk


def solved(scatter: FloatArray, step: FloatArray) -> FloatArray:
    """Return the solution of a linear system, the shortest one if it is singular."""
    try:
        solution = np.linalg.solve(scatter, step)
    except np.linalg.LinAlgError:
        solution = np.linalg.lstsq(scatter, step, rcond=1e-12)[0]
    return solution.astype(np.float64, copy=False)


def axis_towards(
    node: Chosen, is_right: BoolArray, rules: SplitRules, *, is_fine: bool = False
) -> SplitAxis | None:
    """Return a combination of columns that parts two groups of a node's rows.

    None where it would be a single column. Where there are many more rows than columns
    a difference of columns that are nearly equal is worth a look too: `is_fine` takes
    Fisher's direction with next to no shrinkage.

    Args:
        node: The rows.
        is_right: Which of them belong to the second group.
        rules: How many columns it may have, and what each must bring.
        is_fine: Whether columns may be nearly equal.
    """
    step = 1 + len(node.at) // _MOST_ROWS
    at, weights, sides = node.at[::step], node.weights[::step], is_right[::step]
    points = node.rows.standard[at]
    if points.shape[1] < 2 or sides.all() or not sides.any():
        return None
    costs = rules.costs[node.rows.combinable]
    if is_fine:
        if len(at) < _ROWS_PER_COLUMN * points.shape[1]:
            return None
        rules = replace(rules, shrinkage=_FINE * rules.shrinkage)
    selected = selected_columns(points, sides, weights, rules, costs)
    if len(selected) < 2:
        return None
    chosen = points[:, selected]
    direction: FloatArray | None
    if is_fine:
        means, scatter = _two_groups(chosen, sides, weights, rules.shrinkage)
        direction = solved(scatter, means[1] - means[0])
    else:
        direction = logistic_direction(chosen, sides, weights, 1.0)
    if direction is None:
        return None
    return axis_of(node.rows, selected, direction, spread_of(chosen @ direction, sides))


def spread_of(places: FloatArray, is_right: BoolArray) -> float:
    """Return the spread of two groups around their own means."""
    middle = np.where(is_right, places[is_right].mean(), places[~is_right].mean())
    return float(np.sqrt(np.mean((places - middle) ** 2)))


def turned(
    axis: SplitAxis, rows: TrainingRows, at: IntArray, is_right: BoolArray
) -> SplitAxis | None:
    """Return the logistic direction towards some rows over a combination's columns."""
    selected = np.searchsorted(rows.combinable, axis.features)
    points = rows.standard[np.ix_(at, selected)]
    direction = logistic_direction(points, is_right, rows.weights[at], 1.0)
    if direction is None:
        return None
    return axis_of(rows, selected, direction, spread_of(points @ direction, is_right))


def selected_columns(
    points: FloatArray,
    is_right: BoolArray,
    weights: FloatArray,
    rules: SplitRules,
    costs: FloatArray,
) -> IntArray:
    """Return the columns of a combination, most powerful first.

    A column enters if its partial F, divided by its cost, is at least `entry`.

    Args:
        points: In standard units, shape (rows, columns).
        is_right: The group of each row.
        weights: Of the rows.
        rules: How many columns there may be, and the smallest partial F.
        costs: Per column.
    """
    means, rest = _two_groups(points, is_right, weights, rules.shrinkage)
    step = means[1] - means[0]
    share = float(weights[is_right].sum() / weights.sum())
    factor = share * (1.0 - share)
    prices = np.maximum(costs, _CHEAPEST)
    selected: list[int] = []
    power = 0.0
    least = _OWN * np.diag(rest)
    variances = np.einsum("ii->i", rest)  # a view: `rest` changes in place
    gains = np.zeros(len(step))
    for _ in range(min(rules.columns, MOST_COLUMNS, len(step))):
        gains.fill(0.0)
        np.divide(step * step, variances, out=gains, where=variances > least)
        best = int((gains / prices).round(12).argmax())
        gain = float(gains[best])
        freedom = max(len(points) - 2 - len(selected), 1.0)
        helps = freedom * factor * gain / (1.0 + factor * power) / prices[best]
        if gain <= 0.0 or (selected and helps < rules.entry):
            break
        selected.append(best)
        least[best] = np.inf
        power += gain
        column = rest[:, best] / rest[best, best]
        step = step - column * step[best]
        rest -= column[:, None] * rest[best]
    return np.array(selected or [0], np.int64)


def _two_groups(
    points: FloatArray, is_right: BoolArray, weights: FloatArray, shrinkage: float
) -> tuple[list[FloatArray], FloatArray]:
    """Return the means of two groups of rows, and the scatter within them."""
    sides = weights * ~is_right, weights * is_right
    means = [side @ points / side.sum() for side in sides]
    moved = points - np.where(is_right[:, None], means[1], means[0])
    scatter = (moved * weights[:, None]).T @ moved / weights.sum()
    return means, shrunk(scatter, shrinkage)


def logistic_direction(
    points: FloatArray, is_right: BoolArray, weights: FloatArray, ridge: float
) -> FloatArray | None:
    """Return the penalised logistic direction, or None if Newton's steps fail.

    Args:
        points: In standard units, shape (rows, columns).
        is_right: The side of each row.
        weights: Of the rows.
        ridge: Penalty on squared weights, in rows.
    """
    solution = _logistic(points, is_right, weights, ridge)
    if solution is None:
        return None
    direction: FloatArray = solution[:-1]
    return direction if np.isfinite(direction).all() and direction.any() else None


def logistic_cut(values: FloatArray, is_right: BoolArray, weights: FloatArray) -> float:
    """Return where two groups on an axis are equally likely; infinite for nowhere.

    It is that of a logistic regression, which single rows at the border move little.
    """
    middle = float(np.average(values, weights=weights))
    spread = float(np.sqrt(np.average((values - middle) ** 2, weights=weights)))
    if not 0.0 < spread < math.inf:
        return math.inf
    points = ((values - middle) / spread)[:, None]
    solution = _logistic(points, is_right, weights, 0.1)
    if solution is None or not solution[0] > 0.0:
        return math.inf
    return middle - spread * float(solution[1] / solution[0])


def _logistic(
    points: FloatArray, is_right: BoolArray, weights: FloatArray, ridge: float
) -> FloatArray | None:
    """Return the weights of a logistic regression and its constant."""
    design = np.hstack([points, np.ones((len(points), 1))])
    share = weights / weights.mean()
    penalty = np.full(design.shape[1], ridge)
    penalty[-1] = 1e-6
    penalties = np.diag(penalty)
    solution = np.zeros(design.shape[1])
    for _ in range(_NEWTON_STEPS):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ solution, -30.0, 30.0)))
        slope = design.T @ (share * (is_right - chance)) - penalty * solution
        steep = share * np.maximum(chance * (1.0 - chance), 1e-4)
        curvature = (design * steep[:, None]).T @ design + penalties
        try:
            step = np.linalg.solve(curvature, slope)
        except np.linalg.LinAlgError:
            return None
        solution = solution + step
        if np.abs(step).max() < 1e-3:
            break
    return solution


def axis_of(
    rows: TrainingRows, selected: IntArray, direction: FloatArray, unit: float
) -> SplitAxis | None:
    """Return an axis in the table's units from a direction in standard units."""
    columns, spreads = rows.combinable[selected], rows.spreads[selected]
    return rounded_axis(columns, direction, unit, spreads, rows.units)


def rounded_axis(
    columns: IntArray,
    direction: FloatArray,
    unit: float,
    spreads: FloatArray,
    units: ColumnUnits,
) -> SplitAxis | None:
    """Return an axis in the table's units from a direction in units of spreads.

    Its unit is the spread of the groups that it parts. A weight is rounded so finely
    that a spread of its column changes by no more than a thousandth of that unit.
    Centres are the columns' origins, values of the table, so that the first step of an
    axis, value less centre, has the digits that learning saw. None where fewer than two
    columns have a weight.

    Args:
        columns: Their numbers.
        direction: The weight of each column.
        unit: The spread along the direction.
        spreads: Of the columns, in their units.
        units: The columns' units.
    """
    longest = math.sqrt(float(direction @ direction))
    length = max(unit, _SMALLEST * longest)
    weights = np.array(
        [
            rounded_to(weight, -_DIGITS - math.frexp(scale)[1])
            for weight, scale in zip(
                (direction / length / spreads).tolist(), spreads.tolist(), strict=True
            )
        ]
    )
    keep = (weights != 0) & (np.abs(direction) > 1e-6 * np.abs(direction).max())
    if np.count_nonzero(keep) < 2:
        return None
    chosen = columns[keep]
    raw = np.ldexp(weights[keep], -units.exponents[chosen])
    return SplitAxis(chosen, raw, units.origins[chosen], True)
