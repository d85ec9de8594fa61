"""Bounds of propositions on cells of their axes.

Each axis is cut into cells that cover all numbers, narrow where its terms are. For each
proposition and cell an upper and a lower bound of its degree there are computed once.

The bounds hold for the degrees as computed, not only for the formula:

- A rounded difference, quotient, minimum, maximum, and product of numbers that are not
  negative is monotone. So the distance u of any value of a cell lies between those at
  the cell's ends, and so do t, w and the tail, to the bit.
- On [t0, t1] a polynomial stays within M (t1 - t0)^2 / 8 of its chord, where M bounds
  its second derivative; it need not be monotone. M is a sum over the coefficients.
  Evaluating it, v included, costs less than 32 eps (1 + sum |c|), twice (at an end and
  at the value): that is the margin.
- Bands and points are monotone between two neighbouring knots, in rounded numbers too:
  all over a cell a degree lies between those at its ends and at the knots inside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fuzzytree.model import (
    LR,
    FloatArray,
    IntArray,
    Proposition,
    RuleBase,
    Shape,
    Side,
    shapes_of,
)
from fuzzytree.runtimes.degrees import shape_degrees
from fuzzytree.semantics import landmarks

_ENTRIES, _FEWEST, _MOST = 1 << 21, 32, 1 << 10  # of the table; of cells on an axis
_CLOSE = 1e-12  # of an axis mapped to (-1, 1): more than rounding moves a cell's end
_EPS = float(np.finfo(np.float64).eps)
_LARGEST = float(np.finfo(np.float64).max)
_FAR = 0.95  # the share of landmarks within a unit of the grid's centre

Bounds = tuple[FloatArray, FloatArray]
"""The lower and the upper ones, or the ends of cells."""


@dataclass(frozen=True, slots=True)
class AxisCells:
    """Cells of every axis: equal parts of z / (1 + |z|) with z = (x - centre) / unit.

    Attributes:
        centre: Of shape (axes, 1).
        unit: Of shape (axes, 1); above 0.
        count: The number of cells of each axis.
    """

    centre: FloatArray
    unit: FloatArray
    count: int


@dataclass(frozen=True, slots=True)
class Envelope:
    """What is known of each proposition in each cell.

    Attributes:
        grid: The cells.
        line: The axis of each proposition.
        lower: A lower bound of the degree, in each entry.
        upper: An upper bound.
    """

    grid: AxisCells
    line: IntArray
    lower: FloatArray
    upper: FloatArray


def plan_envelope(
    rules: RuleBase, propositions: Sequence[Proposition], at_line: Mapping[str, int]
) -> Envelope:
    """Return the envelope of some propositions.

    `at_line` is the line of each variable's values. A proposition without terms is
    always true.
    """
    shapes = shapes_of(rules.variables)
    line = np.array(
        [at_line[c.variable] if c.terms else 0 for c in propositions], np.int64
    )
    members = [[shapes[c.variable, term] for term in c.terms] for c in propositions]
    used: list[list[Shape]] = [[] for _ in at_line]
    for axis, mine in zip(line.tolist(), members, strict=True):
        used[axis] += mine
    count = min(max(_ENTRIES // max(len(propositions), 1), _FEWEST), _MOST)
    lower, upper = np.ones((2, len(propositions), count))
    with np.errstate(all="ignore"):
        grid = _grid(used, count)
        for axis, every in enumerate(used):
            place = {shape: k for k, shape in enumerate(dict.fromkeys(every))}
            low, high = _shape_bounds([*place], cell_ends(grid, axis))
            for number in np.flatnonzero(line == axis).tolist():
                at = [place[shape] for shape in members[number]]
                if at:
                    lower[number] = low[at].max(axis=0)
                    upper[number] = high[at].max(axis=0)
    negated = np.array([proposition.negated for proposition in propositions])
    lower[negated], upper[negated] = 1.0 - upper[negated], 1.0 - lower[negated]
    return Envelope(grid, line, lower.ravel(), upper.ravel())


def cells_of(grid: AxisCells, lines: FloatArray) -> IntArray:
    """Return the cell of each value on its axis, of the shape of `lines`."""
    half = grid.count / 2
    z = lines - grid.centre
    z /= grid.unit
    far = np.abs(z)
    far += 1.0
    np.divide(half, far, out=far)
    np.subtract(half, far, out=far)
    np.copysign(far, z, out=far)
    far += half
    np.minimum(far, grid.count - 1, out=far)
    return far.astype(np.int64)


def cell_ends(grid: AxisCells, line: int) -> tuple[FloatArray, FloatArray]:
    """Return numbers between which all values of each cell of an axis lie."""
    share = np.linspace(-1.0, 1.0, grid.count + 1)
    centre, unit = grid.centre[line, 0], grid.unit[line, 0]

    def ends(moved: FloatArray, sign: float) -> FloatArray:
        z = moved / (1.0 - np.abs(moved))
        rounding = 8 * _EPS * (np.abs(centre) + np.abs(unit * z))
        result: FloatArray = centre + unit * z + sign * rounding
        return result

    with np.errstate(all="ignore"):
        low = np.append(-_LARGEST, ends(share[1:-1] - _CLOSE, -1.0))
        high = np.append(ends(share[1:-1] + _CLOSE, 1.0), _LARGEST)
    low = np.clip(np.where(np.isnan(low), -_LARGEST, low), -_LARGEST, _LARGEST)
    high = np.clip(np.where(np.isnan(high), _LARGEST, high), -_LARGEST, _LARGEST)
    return low, high


def _grid(used: Sequence[Sequence[Shape]], count: int) -> AxisCells:
    """Return cells that are narrow where the landmarks of each axis are."""
    centre, unit = np.zeros((len(used), 1)), np.ones((len(used), 1))
    for axis, shapes in enumerate(used):
        marks = np.array([mark for shape in shapes for mark in landmarks(shape)])
        marks = marks[np.isfinite(marks)]
        if len(marks):
            centre[axis] = np.median(marks)
            far = np.quantile(np.abs(marks - centre[axis]), _FAR)
            unit[axis] = far if np.isfinite(far) and far > 0 else 1.0
    return AxisCells(centre, unit, count)


def _shape_bounds(shapes: Sequence[Shape], ends: Bounds) -> Bounds:
    """Return bounds of shape (shapes, cells)."""
    low, high = np.empty((2, len(shapes), len(ends[0])))
    sets = [(k, shape) for k, shape in enumerate(shapes) if isinstance(shape, LR)]
    if sets:
        places = [k for k, _ in sets]
        mean = _column([shape.mean for _, shape in sets])
        below = _side_bounds(mean, [shape.left for _, shape in sets], -1.0, ends)
        above = _side_bounds(mean, [shape.right for _, shape in sets], 1.0, ends)
        low[places] = np.minimum(below[0], above[0])
        high[places] = np.minimum(below[1], above[1])
    for k, shape in enumerate(shapes):
        if not isinstance(shape, LR):
            low[k], high[k] = _monotone_bounds(shape, ends)
    return np.nan_to_num(low, nan=0.0), np.nan_to_num(high, nan=1.0)


def _monotone_bounds(shape: Shape, ends: Bounds) -> Bounds:
    """Return bounds of a shape that is monotone between its knots."""
    knots = np.array(shape.knots())
    beside = (np.nextafter(knots, -np.inf), knots, np.nextafter(knots, np.inf))
    marks = np.unique(np.clip(np.concatenate(beside), -_LARGEST, _LARGEST))
    at_ends = [shape_degrees(shape, end) for end in ends]
    at_marks = np.append(shape_degrees(shape, marks), 0.0)
    first = np.searchsorted(marks, ends[0])
    last = np.searchsorted(marks, ends[1], side="right")
    between = np.stack([first, last], axis=1).ravel()
    has_mark = first < last
    least = np.where(has_mark, np.minimum.reduceat(at_marks, between)[::2], np.inf)
    most = np.where(has_mark, np.maximum.reduceat(at_marks, between)[::2], -np.inf)
    low: FloatArray = np.minimum.reduce([*at_ends, least])
    high: FloatArray = np.maximum.reduce([*at_ends, most])
    return low, high


def _side_bounds(
    mean: FloatArray, sides: Sequence[Side], sign: float, ends: Bounds
) -> Bounds:
    """Return bounds of sides of LR sets; a value on the other side has degree 1."""
    reach = _column([side.reach for side in sides])
    scale = _column([side.spread * sign for side in sides])
    longest = max(len(side.curve) for side in sides)
    curve = np.array(
        [side.curve + (0.0,) * (longest - len(side.curve)) for side in sides]
    )
    near, far = ends if sign > 0 else ends[::-1]
    u0, u1 = (np.clip((end - mean) / scale, 0.0, reach) for end in (near, far))
    t0, t1 = np.minimum(u0, 1.0), np.minimum(u1, 1.0)
    powers = np.arange(1, longest + 1)
    joined = curve + np.pad(curve[:, 1:], ((0, 0), (0, 1)))
    bend = 2.0 * np.sum(powers * (powers - 1) * np.abs(joined), axis=1)
    margin = 64 * _EPS * (1.0 + np.abs(curve).sum(axis=1))
    width = t1 - t0
    slack = _column(bend) * (width * width) / 8.0 * (1.0 + 1e-9) + _column(margin)
    values = _body(curve, t0), _body(curve, t1)
    low = np.clip(np.minimum(*values) - slack, 0.0, 1.0)
    high = np.clip(np.maximum(*values) + slack, 0.0, 1.0)
    return low * _tail(reach, u1), high * _tail(reach, u0)


def _column(numbers: Sequence[float] | FloatArray) -> FloatArray:
    return np.array(numbers, np.float64).reshape(-1, 1)


def _body(curve: FloatArray, t: FloatArray) -> FloatArray:
    v = 2.0 * t - 1.0
    total = np.zeros_like(v)
    for coefficients in curve.T[::-1]:
        total = total * v + coefficients[:, np.newaxis]
    return 1.0 - total * t


def _tail(reach: FloatArray, u: FloatArray) -> FloatArray:
    w = np.minimum((reach - u) / (reach - 1.0), 1.0)
    w *= w
    return w * w
