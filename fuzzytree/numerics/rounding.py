"""How far rounding can take a value or a degree from the exact one.

Every bound is a priori: it follows from the coefficients, the widths and the values, by
the standard model of rounding, fl(a op b) = (a op b)(1 + e) with |e| <= u, and u is
2**-53 for double and 2**-24 for float32. It holds for the stated sequence of operations
(`fuzzytree.model.rulebase`) in each of three number types: `float64`; `float32`, where
every number of the model and every value is rounded first; and `mixed`, which finds the
place on a curve in double, casts it, and goes on in float32.

A degree is off by at most `fixed + per_unit * s` where its value is off by s, and where
s reaches across a step also by the step's height:

- **Flank.** Difference, width, quotient and cast make 3 or 4 u of q; float32 moves the
  end by u |end|, which the width divides, and the largest number below 1 by u. At the
  plateau's edge what is missing to 1 is a step.
- **Side.** q as for a flank; 1 - t Q(2 t - 1) turns it into at most its steepest slope
  times it. Coefficient k goes through 2 k + 2 roundings of Horner's rule (and its own,
  in float32), which makes sum (2 k + 2) |c_k| u. The tail w**4 is 4 times as steep as
  w, whose place is off by (u-relative error) * reach / (reach - 1) at most, and costs
  16 roundings.
- **Points.** Rounded values move the points and x, which is as if x alone moved twice
  as far; a line turns this into its slope times it. Lines narrower than that are steps.

`MORE` covers terms of second order and the rounding of these sums themselves.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, assert_never

import numpy as np

from fuzzytree.model import (
    LR,
    Band,
    Dtype,
    FloatArray,
    Points,
    Shape,
    Side,
    Variable,
    checkpoint,
)
from fuzzytree.numerics.enclosures import U
from fuzzytree.numerics.exact import CAP

if TYPE_CHECKING:
    Reals = FloatArray

UNIT = 2.0**-24
"""The unit roundoff of float32."""

FLOAT32_MAX = 3.4028234663852886e38
"""The largest float32."""

MORE = 1.0 + 2.0**-10
"""A factor that covers terms of second order."""

_MOST = 1e300  # of a slope: finite, for 0 times it; the value must be exact, then


class Type(NamedTuple):
    """What rounding costs in a number type.

    Attributes:
        axis: The unit roundoff of values, differences and quotients.
        degree: That of everything after the quotient.
        stored: That of the model's own numbers on the axis, and of the input: 0 where
            they stay what they are.
        cast: What it costs to take a place on a curve to the degrees' type.
        curve: What it costs to take a coefficient to the degrees' type.
        least: An error that underflow can make of a number on the axis.
        largest: The largest number on the axis.
        tiny: More than what underflow can make of a degree.
    """

    axis: float
    degree: float
    stored: float
    cast: float
    curve: float
    least: float
    largest: float
    tiny: float


_DOUBLE_MAX = float(np.finfo(np.float64).max)

TYPES: Mapping[Dtype, Type] = {
    "float64": Type(U, U, 0.0, 0.0, 0.0, 2.0**-1074, _DOUBLE_MAX, 2.0**-900),
    "mixed": Type(U, UNIT, 0.0, UNIT, UNIT, 2.0**-1074, _DOUBLE_MAX, 2.0**-100),
    "float32": Type(UNIT, UNIT, UNIT, 0.0, UNIT, 2.0**-149, FLOAT32_MAX, 2.0**-100),
}


class Steps(NamedTuple):
    """Places where a degree jumps, in ascending order.

    Attributes:
        places: Where, in the variable's unit.
        heights: By how much.
        blur: How far rounding can move such a place.
    """

    places: tuple[float, ...] = ()
    heights: tuple[float, ...] = ()
    blur: float = 0.0


class DegreeBound(NamedTuple):
    """The largest error of a degree: `fixed + per_unit * (error of the value)`.

    Attributes:
        fixed: What the shape's own arithmetic costs.
        per_unit: What an error of the value costs, per unit of the variable.
        steps: What it costs besides where the value is as near to a step as its error.
        active: Beyond this size of the value, in either direction, the degree is level.
    """

    fixed: float
    per_unit: float
    steps: Steps = Steps()
    active: float = 0.0


@functools.lru_cache(maxsize=1 << 14)  # fractions take their time
def degree_bound(shape: Shape, dtype: Dtype) -> DegreeBound:
    """Return the largest difference of a degree from the exact one.

    Args:
        shape: The shape.
        dtype: The number type.

    Example:
        >>> ramp = Band(high=1.0, right=3.0)
        >>> bound = degree_bound(ramp, "float32")
        >>> f"{bound.fixed:.1e}, and {bound.per_unit:.1g} for each unit of the value"
        '3.3e-07, and 0.5 for each unit of the value'
    """
    checkpoint()
    kind = TYPES[dtype]
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            edges = [
                _edge_bound(edge, end, kind)
                for edge, end in ((low, left), (high, right))
                if edge is not None
            ]
            found = _together(edges)
        case LR(mean=mean, left=left, right=right):
            found = _together([_side_bound(s, mean, kind) for s in (left, right)])
        case Points():
            found = _points_bound(shape, kind)
        case _:
            assert_never(shape)
    if not 2.0 * found.active < kind.largest:
        return found._replace(fixed=1.0)
    return found._replace(fixed=min(found.fixed * MORE, 1.0))


def _together(parts: Sequence[DegreeBound]) -> DegreeBound:
    """Return the bound of the smallest of some degrees."""
    return DegreeBound(
        max((part.fixed for part in parts), default=0.0),
        max((part.per_unit for part in parts), default=0.0),
        Steps(
            tuple(place for part in parts for place in part.steps.places),
            tuple(height for part in parts for height in part.steps.heights),
            max((part.steps.blur for part in parts), default=0.0),
        ),
        max((part.active for part in parts), default=0.0),
    )


def _edge_bound(edge: float, end: float | None, kind: Type) -> DegreeBound:
    blur = _stored(edge, kind)
    if end is None:
        return DegreeBound(0.0, 0.0, Steps((edge,), (1.0,), blur), abs(edge))
    span = abs(edge - end)
    moved = _stored(end, kind) + _stored(0.0, kind)  # the end, and the width
    place = 3 * kind.axis + kind.cast + moved / span
    per_unit = _per_unit(1.0, span)
    gap = float(1 - CAP)
    return DegreeBound(
        place + kind.curve + kind.tiny,
        per_unit,
        Steps((edge,), (gap * MORE + per_unit * blur,), blur),
        max(abs(edge), abs(end)),
    )


def _side_bound(side: Side, mean: float, kind: Type) -> DegreeBound:
    """Bound one side: within a spread by its curve, beyond by its tail."""
    curve, reach = side.curve, side.reach
    length = reach - 1.0
    slope = sum(k * abs(a + b) for k, (a, b) in enumerate(_pairs(curve), 1))
    rounds = sum(
        ((2 * k + 2 + k) * kind.degree + kind.curve) * abs(c)
        for k, c in enumerate(curve)
    )
    rounds += kind.degree + kind.tiny
    relative = 3 * kind.axis + kind.cast + _stored(0.0, kind) / side.spread
    moved = _stored(mean, kind) / side.spread
    shift = (
        abs(float(np.float32(min(reach, FLOAT32_MAX))) - reach) if kind.curve else 0.0
    )
    last = min(max(1.0 - sum(curve) + sum(map(abs, curve)) * 2.0**-40, 0.0), 1.0)
    w = min(0.75 * reach / length, 1.0)  # where u-relative errors weigh most
    peak = max(w**3 * (reach - w * length), 1.0)
    tail = last * 4.0 * (moved + relative * peak + shift) / length
    within = slope * (moved + relative)
    if shift:
        within += 4.0 * shift / length + 16 * kind.degree
    rounds += last * 16 * kind.degree  # a value within may be rounded into the tail
    return DegreeBound(
        max(within, tail) + rounds,
        _per_unit(max(slope, last * 4.0 / length), side.spread),
        active=abs(mean) + reach * side.spread,
    )


def _pairs(curve: Sequence[float]) -> Iterator[tuple[float, float]]:
    return itertools.pairwise((*curve, 0.0))


def _points_bound(points: Points, kind: Type) -> DegreeBound:
    """Bound lines between points; what is narrower than rounding counts as a step."""
    active = max(map(abs, points.values))
    moved = _stored(active, kind)
    slope = height = narrow = 0.0
    places: list[float] = []
    heights: list[float] = []
    joined = zip(points.values, points.degrees, strict=True)
    for (a, p), (b, r) in itertools.pairwise(joined):
        if b - a > 4 * moved:
            slope = max(slope, _per_unit(abs(r - p), b - a))
        elif p != r:
            places.append(a)
            heights.append(abs(r - p))
            narrow = max(narrow, b - a)
        height = max(height, abs(r - p))
    rounds = height * (3 * kind.axis + kind.cast + 2 * kind.degree)
    rounds += kind.degree + 2 * kind.curve + kind.tiny
    steps = Steps(tuple(places), tuple(heights), 2 * moved + narrow)
    return DegreeBound(slope * 2 * moved + rounds, slope, steps, active)


def _stored(value: float, kind: Type) -> float:
    """Return how far a number of the model is moved by being stored, at most."""
    return kind.stored * abs(value) + kind.least if kind.stored else 0.0


def _per_unit(rise: float, width: float) -> float:
    """Return a slope, rounded up: above 0, in doubles too, if the rise is."""
    return min(rise / width * MORE + 2.0**-1074, _MOST) if rise else 0.0


# --- values


def value_error(
    variable: Variable, dtype: Dtype, ranges: Mapping[str, tuple[Reals, Reals]]
) -> Reals | None:
    """Return how far a value can be from the exact one; None if it is exact.

    An input is rounded once, in float32. Of n parts, each carries the rounding of its
    input, centre and weight in float32, and n + 2 others in any type.

    Args:
        variable: An input or a combination.
        dtype: The number type.
        ranges: For each input, its lowest and its highest value, or its value twice.
    """
    kind = TYPES[dtype]
    if not variable.parts:
        if not kind.stored:
            return None
        return kind.stored * _size(*ranges[variable.name]) + kind.least
    total: Reals = np.zeros(())
    whole: Reals = np.zeros(())
    for part in variable.parts:
        low, high = ranges[part.input]
        size, weight = _size(low, high), abs(part.weight)
        away = _size(low - part.centre, high - part.centre)
        total = total + weight * away * (kind.axis * (len(variable.parts) + 2))
        total = total + kind.stored * weight * (size + abs(part.centre))
        total = total + kind.least * (weight + away + 1.0)
        whole = whole + (weight + 1.0) * (size + abs(part.centre))
    return np.where(whole < kind.largest, total * MORE, np.inf)


def _size(low: Reals, high: Reals) -> Reals:
    return np.maximum(np.abs(low), np.abs(high))


def degree_errors(
    bound: DegreeBound, x: Reals, off: Reals | None, *, is_input: bool
) -> Reals:
    """Return the largest error of a degree at each value, which is off by so much.

    Beyond `active` the degree is level: no error of a value that is there for sure is
    felt, nor an input's own rounding, which is relative. Of a shape too steep for
    doubles to say how steep, no value that is off has a bound.
    """
    blur = bound.steps.blur
    if off is None:
        return np.full(x.shape, bound.fixed)
    felt = np.minimum(off, UNIT * bound.active * MORE + 2.0**-149) if is_input else off
    is_level = np.abs(x) - 2.0 * off > bound.active * MORE + blur
    felt = np.where(is_level, 0.0, felt)
    found = bound.fixed + felt * bound.per_unit
    if bound.steps.places:
        near = off * MORE + blur
        places = np.array(bound.steps.places)
        first = np.searchsorted(places, x - near, side="left")
        last = np.searchsorted(places, x + near, side="right")
        sums = np.append(0.0, np.cumsum(bound.steps.heights))
        found = found + (sums[last] - sums[first])
    is_bound = np.isfinite(off) & (bound.per_unit < _MOST)
    return np.where(is_bound, np.minimum(found * MORE, 1.0), 1.0)
