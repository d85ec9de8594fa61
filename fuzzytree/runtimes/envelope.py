"""Bounds of clauses on cells of their axes, and exact degrees from few terms.

Each axis is cut into cells that cover all numbers, narrow where its terms are. For each
clause and cell three things are computed once: an upper and a lower bound of its degree
there, and its *candidates*, the terms whose upper bound is not below the largest lower
bound.

The bounds hold for the degrees as computed, not only for the formula:

- A rounded difference, quotient, minimum, maximum, and product of numbers that are not
  negative is monotone. So the distance u (or q) of any value of a cell lies between
  those at the cell's ends, and so do t, w and the tail, to the bit.
- On [t0, t1] a polynomial stays within M (t1 - t0)^2 / 8 of its chord, where M bounds
  its second derivative; it need not be monotone. M is a sum over the coefficients.
  Evaluating it, v included, costs less than 32 eps (1 + sum |c|), twice (at an end and
  at the value): that is the margin.
- The degree on a line between points is monotone, in rounded numbers too, and clamped
  between those of its ends: all over a cell it lies between those at the cell's ends
  and at the points inside.
- Bounds are kept in float32, rounded outwards.

The largest degree of a clause in a cell belongs to a candidate: it is not below any
lower bound, and its own term's upper bound is not below it. A term that is no candidate
stays below, so the maximum of the candidates is the maximum of all, to the bit. A term
that is 0 all over the cell is a candidate only if all are, and then one is enough.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fuzzytree.model import (
    LR,
    Band,
    BoolArray,
    Clause,
    FloatArray,
    IntArray,
    Points,
    RuleBase,
    Shape,
    Side,
    shapes_of,
)
from fuzzytree.numerics import Segments, segments_of
from fuzzytree.runtimes.degrees import DOUBLE, NUMBERS, halved, join

if TYPE_CHECKING:
    import numpy.typing as npt

    Singles = npt.NDArray[np.float32]
_ENTRIES, _FEWEST, _MOST = 1 << 21, 32, 1 << 10  # of the table; of cells on an axis
_CLOSE = 1e-12  # of an axis mapped to (-1, 1): more than rounding moves a cell's end
_EPS = float(np.finfo(np.float64).eps)
_LARGEST = float(np.finfo(np.float64).max)
_CAP = float(NUMBERS["float64"].cap)
_FAR = 0.95  # the share of landmarks within a unit of the grid's centre


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
class Slopes:
    """The sides of LR sets, left and right in turn; `curve` has a line a power."""

    mean: FloatArray
    spread: FloatArray
    reach: FloatArray
    curve: FloatArray


@dataclass(frozen=True, slots=True)
class Edges:
    """The ends of bands, and their flanks, left and right in turn.

    A flank that is absent has the height 0, others 1; an open end is infinite.
    """

    low: FloatArray
    high: FloatArray
    end: FloatArray
    span: FloatArray
    height: FloatArray


@dataclass(frozen=True, slots=True)
class Shapes:
    """The shapes of all clauses, by kind.

    Attributes:
        slopes: The LR sets.
        edges: The bands.
        points: The points.
        lines: Their lines.
    """

    slopes: Slopes
    edges: Edges
    points: Sequence[Points]
    lines: Segments

    @property
    def bands_from(self) -> int:
        """The number of the first band."""
        return len(self.slopes.mean)

    @property
    def points_from(self) -> int:
        """The number of the first shape of points."""
        return self.bands_from + len(self.edges.low)


@dataclass(frozen=True, slots=True)
class Envelope:
    """What is known of each clause in each cell; entry `clause * cells + cell`.

    Attributes:
        grid: The cells.
        line: The axis of each clause.
        negated: Which clauses are negated.
        lower: A lower bound of the degree, in each entry.
        upper: An upper bound.
        start: Where the candidates of each entry begin; one more at the end.
        candidates: Numbers of shapes: LR sets first, then bands, then points.
        shapes: The shapes.
    """

    grid: AxisCells
    line: IntArray
    negated: BoolArray
    lower: Singles
    upper: Singles
    start: IntArray
    candidates: npt.NDArray[np.int32]
    shapes: Shapes


def plan_envelope(
    rules: RuleBase, clauses: Sequence[Clause], at_line: Mapping[str, int]
) -> Envelope:
    """Return the envelope of some clauses.

    `at_line` is the line of each variable's values. A clause without terms is always
    true.
    """
    shapes = shapes_of(rules.variables)
    always = Band(None, None)
    of_clause = [
        list(dict.fromkeys(shapes[c.variable, term] for term in c.terms)) or [always]
        for c in clauses
    ]
    distinct = dict.fromkeys(shape for result in of_clause for shape in result)
    sets = [shape for shape in distinct if isinstance(shape, LR)]
    bands = [shape for shape in distinct if isinstance(shape, Band)]
    points = [shape for shape in distinct if isinstance(shape, Points)]
    ordered: list[Shape] = [*sets, *bands, *points]
    number = {shape: position for position, shape in enumerate(ordered)}
    line = np.array([at_line[c.variable] if c.terms else 0 for c in clauses], np.int64)
    members = [np.array([number[s] for s in result], np.int64) for result in of_clause]
    lines = segments_of(points, DOUBLE, DOUBLE)
    by_kind = Shapes(_slopes(sets), _edges(bands), points, lines)
    negated = np.array([clause.negated for clause in clauses])
    with np.errstate(all="ignore"):
        grid = _grid(line, members, by_kind, len(at_line))
    tables = _tables(grid, line, members, by_kind)
    lower, upper, start, candidates = tables
    lower[negated], upper[negated] = 1.0 - upper[negated], 1.0 - lower[negated]
    return Envelope(
        grid,
        line,
        negated,
        _outwards(lower, -np.inf).ravel(),
        _outwards(upper, np.inf).ravel(),
        start,
        candidates,
        by_kind,
    )


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
        low = np.append(-np.inf, ends(share[1:-1] - _CLOSE, -1.0))
        high = np.append(ends(share[1:-1] + _CLOSE, 1.0), np.inf)
    low = np.minimum(np.where(np.isnan(low), -np.inf, low), _LARGEST)
    high = np.maximum(np.where(np.isnan(high), np.inf, high), -_LARGEST)
    return low, high


def exact_degrees(envelope: Envelope, entries: IntArray, x: FloatArray) -> FloatArray:
    """Return degrees of clauses, bit-equal to the reference.

    An entry is `clause * cells + cell`, with the cell of its value; `x` is finite.
    """
    if not len(entries):
        return np.empty(0)
    first = envelope.start.take(entries)
    count = envelope.start.take(entries + 1) - first
    owner, offset, begin = spread(count)
    shape = envelope.candidates.take(first.take(owner) + offset).astype(np.int64)
    degrees = _degrees(envelope.shapes, shape, x.take(owner))
    result: FloatArray = np.maximum.reduceat(degrees, begin)
    if envelope.negated.any():
        negated = envelope.negated.take(entries // envelope.grid.count)
        np.subtract(1.0, result, out=result, where=negated)
    return result


def spread(count: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return owner and offset of each of many members, and where each owner begins.

    Example:
        >>> owner, offset, begin = spread(np.array([2, 1]))
        >>> owner.tolist(), offset.tolist(), begin.tolist()
        ([0, 0, 1], [0, 1, 0], [0, 2])
    """
    owner = np.repeat(np.arange(len(count)), count)
    begin = np.cumsum(count) - count
    offset = np.arange(len(owner)) - begin.take(owner)
    return owner, offset, begin


def _degrees(shapes: Shapes, shape: IntArray, x: FloatArray) -> FloatArray:
    if shapes.bands_from == shapes.points_from and not shapes.points:
        return _slope_degrees(shapes.slopes, shape, x)
    result = np.empty(len(x))
    mine = np.flatnonzero(shape < shapes.bands_from)
    result[mine] = _slope_degrees(shapes.slopes, shape.take(mine), x.take(mine))
    is_joined = shape >= shapes.points_from
    mine = np.flatnonzero((shape >= shapes.bands_from) & ~is_joined)
    bands = shape.take(mine) - shapes.bands_from
    result[mine] = _edge_degrees(shapes.edges, bands, x.take(mine))
    mine = np.flatnonzero(is_joined)
    points = shape.take(mine) - shapes.points_from
    values = x.take(mine)
    result[mine] = join(shapes.lines, halved(shapes.lines, points, values), values)
    return result


def _slope_degrees(slopes: Slopes, shape: IntArray, x: FloatArray) -> FloatArray:
    """Return degrees of LR sets by the side on which x lies; the other's is 1."""
    d = x - slopes.mean.take(shape)
    side = 2 * shape
    side += d > 0
    reach = slopes.reach.take(side)
    u = np.abs(d, out=d)
    u /= slopes.spread.take(side)
    np.minimum(u, reach, out=u)
    t = np.minimum(u, 1.0)
    body = _body(slopes.curve.take(side, axis=1), t)
    np.maximum(body, 0.0, out=body)
    np.minimum(body, 1.0, out=body)
    body *= _tail(reach, u)
    return body


def _body(curve: FloatArray, t: FloatArray) -> FloatArray:
    v = t * 2.0
    v -= 1.0
    result = _horner(curve, v)
    result *= t
    np.subtract(1.0, result, out=result)
    return result


def _tail(reach: FloatArray, u: FloatArray) -> FloatArray:
    w = reach - u
    w /= reach - 1.0
    np.minimum(w, 1.0, out=w)
    w *= w
    w *= w
    return w


def _horner(curve: FloatArray, x: FloatArray) -> FloatArray:
    """Return c0 + x (c1 + ...); leading zeros change nothing."""
    result = np.empty(np.broadcast_shapes(curve[-1].shape, x.shape))
    result[:] = curve[-1]
    for coefficient in curve[-2::-1]:
        result *= x
        result += coefficient
    return result


def _edge_degrees(edges: Edges, shape: IntArray, x: FloatArray) -> FloatArray:
    is_left, is_right = x <= edges.low.take(shape), x > edges.high.take(shape)
    side = 2 * shape
    side += is_right
    q = x - edges.end.take(side)
    q /= edges.span.take(side)
    np.maximum(q, 0.0, out=q)
    np.minimum(q, _CAP, out=q)
    q *= edges.height.take(side)
    q[~(is_left | is_right)] = 1.0
    return q


def _slopes(sets: Sequence[LR]) -> Slopes:
    sides: list[Side] = [s for shape in sets for s in (shape.left, shape.right)]
    return Slopes(
        np.array([shape.mean for shape in sets], np.float64),
        np.array([side.spread for side in sides], np.float64),
        np.array([side.reach for side in sides], np.float64),
        _curves([side.curve for side in sides]),
    )


def _edges(bands: Sequence[Band]) -> Edges:
    sides = [
        (edge, end)
        for band in bands
        for edge, end in ((band.low, band.left), (band.high, band.right))
    ]
    lows = [-np.inf if band.low is None else band.low for band in bands]
    highs = [np.inf if band.high is None else band.high for band in bands]
    return Edges(
        np.array(lows, np.float64),
        np.array(highs, np.float64),
        np.array([end or 0.0 for _, end in sides], np.float64),
        np.array([_span(edge, end) for edge, end in sides], np.float64),
        np.array([float(end is not None) for _, end in sides], np.float64),
    )


def _span(edge: float | None, end: float | None) -> float:
    return 1.0 if edge is None or end is None else edge - end


def _curves(curves: Sequence[tuple[float, ...]]) -> FloatArray:
    """Return a line for each power, low ones first, and a column for each curve."""
    longest = max(map(len, curves), default=1)
    result = np.zeros((longest, len(curves)))
    for position, curve in enumerate(curves):
        result[: len(curve), position] = curve
    return result


def _grid(
    line: IntArray,
    members: Sequence[IntArray],
    shapes: Shapes,
    axes: int,
) -> AxisCells:
    """Return cells that are narrow where means, ends of bands and points are."""
    slopes, edges = shapes.slopes, shapes.edges
    centre, unit = np.zeros((axes, 1)), np.ones((axes, 1))
    for axis in range(axes):
        mine = [members[clause] for clause in np.flatnonzero(line == axis).tolist()]
        used = np.unique(np.concatenate([np.empty(0, np.int64), *mine]))
        sets, bands, joined = _by_kind(shapes, used)
        points = [np.array(shapes.points[place].values) for place in joined.tolist()]
        marks = np.concatenate(
            [slopes.mean[sets], edges.low[bands], edges.high[bands], *points]
        )
        marks = marks[np.isfinite(marks)]
        if len(marks):
            centre[axis] = np.median(marks)
            far = np.quantile(np.abs(marks - centre[axis]), _FAR)
            widths = slopes.spread[2 * sets]
            far = max(far, np.median(widths)) if len(widths) else far
            unit[axis] = far if np.isfinite(far) and far > 0 else 1.0
    count = min(max(_ENTRIES // max(len(line), 1), _FEWEST), _MOST)
    return AxisCells(centre, unit, count)


def _by_kind(shapes: Shapes, used: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return which LR sets, bands and points are among ascending numbers of shapes."""
    kinds = [shapes.bands_from, shapes.points_from]
    sets, bands, points = np.split(used, np.searchsorted(used, kinds))
    return sets, bands - kinds[0], points - kinds[1]


def _tables(
    grid: AxisCells,
    line: IntArray,
    members: Sequence[IntArray],
    shapes: Shapes,
) -> tuple[FloatArray, FloatArray, IntArray, npt.NDArray[np.int32]]:
    """Return bounds of shape (clauses, cells), and the candidates of each entry."""
    lower, upper = (np.empty((len(line), grid.count)) for _ in range(2))
    counts = np.empty((len(line), grid.count), np.int64)
    candidates: dict[int, npt.NDArray[np.int32]] = {}
    for axis in np.unique(line):
        mine = np.flatnonzero(line == axis)
        used = np.unique(np.concatenate([members[clause] for clause in mine.tolist()]))
        low, high = _shape_bounds(shapes, used, cell_ends(grid, int(axis)))
        for clause in mine.tolist():
            at = np.searchsorted(used, members[clause])
            tops = high.take(at, axis=0)
            lower[clause] = low.take(at, axis=0).max(axis=0)
            upper[clause] = tops.max(axis=0)
            stays = (tops >= lower[clause]) & (tops > 0)
            stays[0] |= ~stays.any(axis=0)
            counts[clause] = stays.sum(axis=0)
            which = np.nonzero(stays.T)[1]
            candidates[clause] = members[clause].take(which).astype(np.int32)
    start = np.append(0, np.cumsum(counts.ravel()))
    ordered = [candidates[clause] for clause in range(len(line))]
    return lower, upper, start, np.concatenate(ordered)


def _shape_bounds(
    shapes: Shapes, used: IntArray, ends: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return bounds of shape (shapes, cells)."""
    sets, bands, points = _by_kind(shapes, used)
    with np.errstate(all="ignore"):
        below = _side_bounds(shapes.slopes, sets, 0, ends)
        above = _side_bounds(shapes.slopes, sets, 1, ends)
        flat = _band_bounds(shapes.edges, bands, ends)
        joined = _line_bounds(shapes, points, ends)
    low = np.concatenate([np.minimum(below[0], above[0]), flat[0], joined[0]])
    high = np.concatenate([np.minimum(below[1], above[1]), flat[1], joined[1]])
    return np.nan_to_num(low, nan=0.0), np.nan_to_num(high, nan=1.0)


def _side_bounds(
    slopes: Slopes, sets: IntArray, which: int, ends: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    sides = 2 * sets + which
    mean, reach = slopes.mean[sets, np.newaxis], slopes.reach[sides, np.newaxis]
    scale = slopes.spread[sides, np.newaxis] * (1.0 if which else -1.0)
    near, far = ends if which else ends[::-1]
    u0, u1 = (np.clip((end - mean) / scale, 0.0, reach) for end in (near, far))
    t0, t1 = np.minimum(u0, 1.0), np.minimum(u1, 1.0)
    curve = slopes.curve.take(sides, axis=1)[:, :, np.newaxis]
    powers = np.arange(1, len(curve) + 1)[:, np.newaxis, np.newaxis]
    joined = curve + np.concatenate([curve[1:], np.zeros_like(curve[:1])])
    bend = 2.0 * np.sum(powers * (powers - 1) * np.abs(joined), axis=0)
    values = _body(curve, t0), _body(curve, t1)
    low, high = _between(values, bend, t1 - t0, curve)
    low, high = np.clip(low, 0.0, 1.0), np.clip(high, 0.0, 1.0)
    return low * _tail(reach, u1), high * _tail(reach, u0)


def _between(
    values: tuple[FloatArray, FloatArray],
    bend: FloatArray,
    width: FloatArray,
    curve: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return bounds of a polynomial from its values at the ends of a stretch.

    `bend` bounds the size of the second derivative; `curve` has a line for each power.
    """
    margin = 64 * _EPS * (1.0 + np.abs(curve).sum(axis=0))
    slack = bend * (width * width) / 8.0 * (1.0 + 1e-9) + margin
    return np.minimum(*values) - slack, np.maximum(*values) + slack


def _band_bounds(
    edges: Edges, bands: IntArray, ends: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    start, stop = ends
    low, high = edges.low[bands, np.newaxis], edges.high[bands, np.newaxis]
    is_core = (stop > low) & (start <= high)
    bottom, top = np.where(is_core, 1.0, np.inf), np.where(is_core, 1.0, -np.inf)
    for which, is_here in enumerate(((start <= low) & (low > -np.inf), stop > high)):
        sides = 2 * bands + which
        end, span = edges.end[sides, np.newaxis], edges.span[sides, np.newaxis]
        height = edges.height[sides, np.newaxis]
        q0, q1 = (np.clip((x - end) / span, 0.0, _CAP) * height for x in ends)
        bottom = np.where(is_here, np.minimum(bottom, np.minimum(q0, q1)), bottom)
        top = np.where(is_here, np.maximum(top, np.maximum(q0, q1)), top)
    return bottom, top


def _line_bounds(
    shapes: Shapes, points: IntArray, ends: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    low, high = (np.empty((len(points), len(ends[0]))) for _ in range(2))
    ends = (np.maximum(ends[0], -_LARGEST), np.minimum(ends[1], _LARGEST))
    for row, place in enumerate(points.tolist()):
        number, shape = np.array(place), shapes.points[place]
        here, there = (
            join(shapes.lines, halved(shapes.lines, number, end), end) for end in ends
        )
        low[row], high[row] = np.minimum(here, there), np.maximum(here, there)
        first, last = (np.searchsorted(shape.values, end) for end in ends)
        inside = np.append(shape.degrees, 0.0)
        between = np.stack([first, last], axis=1).ravel()
        least = np.minimum.reduceat(inside, between)[::2]
        most = np.maximum.reduceat(inside, between)[::2]
        has_point = first < last
        np.minimum(low[row], least, out=low[row], where=has_point)
        np.maximum(high[row], most, out=high[row], where=has_point)
    return low, high


def _outwards(bounds: FloatArray, towards: float) -> Singles:
    """Return bounds in float32, not on the inner side of what they were."""
    result = bounds.astype(np.float32)
    is_inside = result < bounds if towards > 0 else result > bounds
    moved = np.nextafter(result, np.float32(towards))
    return np.where(is_inside, moved, result)
