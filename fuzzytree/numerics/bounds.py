"""How far float32 can take a degree, a strength or an axis from its double.

Every bound is a priori: it follows from the coefficients, the widths and the values, by
the usual model of rounding, fl(a op b) = (a op b)(1 + e) with |e| <= u and u = 2**-24
for float32. Terms of order u**2 and the doubles' own rounding (2**-53) are covered by
the factor `_SECOND_ORDER`.

The use of such a bound: where the margin between the two strongest classes exceeds
twice the bound of a strength, both number types decide alike.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fuzzytree.contracts import Dtype
from fuzzytree.rulebase import (
    LR,
    Band,
    Flank,
    Points,
    RuleBase,
    Shape,
    Side,
    Variable,
)

if TYPE_CHECKING:
    from fuzzytree.contracts import FloatArray

UNIT = 2.0**-24
"""The unit roundoff of float32."""

FLOAT32_MAX = 3.4028234663852886e38
"""The largest float32."""

_SECOND_ORDER = 1.0 + 2.0**-10


class DegreeBound(NamedTuple):
    """The largest error of a degree: `fixed + per_unit * (error of the value)`.

    Attributes:
        fixed: What the shape's own arithmetic costs.
        per_unit: What an error of the value costs, per unit of the variable.
    """

    fixed: float
    per_unit: float


def strength_bounds(
    rules: RuleBase, dtype: Dtype, values: FloatArray
) -> tuple[FloatArray, str]:
    """Return the largest difference of any strength from its double, for each row.

    Min passes the largest error of a degree on; a product at most adds the errors of
    its factors, and a rounding for each multiplication.

    Args:
        rules: The rule base.
        dtype: The type in which degrees and strengths are computed.
        values: Shape (inputs, rows).

    Returns:
        The bounds, each at most 1, and a sentence that says where they come from. The
        bound is 1 where a value is beyond the type's range.
    """
    rows = values.shape[1]
    worst = np.zeros(rows)
    if dtype == "float64":
        return worst, "the same operations in the same type"
    for variable in rules.variables:
        if variable.terms:
            bounds = [degree_bound(term.shape, dtype) for term in variable.terms]
            fixed = max(bound.fixed for bound in bounds)
            per_unit = max(bound.per_unit for bound in bounds)
            worst = np.maximum(worst, fixed)
            if per_unit and variable.parts:
                slack = axis_errors(variable, rules.inputs, values)
                with np.errstate(over="ignore"):
                    worst = np.maximum(worst, fixed + per_unit * slack)
    if any(clause.negated for rule in rules.rules for clause in rule.when):
        worst = worst + UNIT
    longest = max(len(rule.when) for rule in rules.rules)
    how = "largest"
    if rules.semantics.conjunction == "product":
        worst = longest * (worst + UNIT)
        how = f"{longest} times the largest"
    worst = np.minimum(worst * _SECOND_ORDER, 1.0)
    if dtype == "float32":
        worst[~(np.abs(values) <= FLOAT32_MAX).all(axis=0)] = 1.0
    return worst, f"{how} derived error of a degree in {dtype}"


def axis_errors(
    variable: Variable, inputs: tuple[str, ...], values: FloatArray
) -> FloatArray:
    """Return how far each value of a variable in float32 can be from its double.

    An input is rounded once. A combination rounds inputs, centres, differences,
    products and sums: at most (number of parts + 3) roundings of each summand.

    Args:
        variable: An input or a combination.
        inputs: The names of the rows of `values`.
        values: Shape (inputs, rows).
    """
    absolute = dict(zip(inputs, np.abs(values), strict=True))
    unit = UNIT * _SECOND_ORDER
    total: FloatArray = np.zeros(values.shape[1])
    if not variable.parts:
        total += unit * absolute[variable.name]
    with np.errstate(over="ignore"):
        for part in variable.parts:
            size = absolute[part.input] + abs(part.centre)
            total += unit * (len(variable.parts) + 3) * abs(part.weight) * size
    return total


def degree_bound(shape: Shape, dtype: Dtype) -> DegreeBound:
    """Return the largest difference of a degree from its double.

    Args:
        shape: The shape.
        dtype: `mixed` rounds the position on a flank; `float32` also rounds the value,
            the shape's numbers and their difference. A degree that steps can be wrong
            by 1 in float32, for a value may round across the step.
    """
    if dtype == "float64":
        return DegreeBound(0.0, 0.0)
    match shape:
        case Band(low=low, high=high, left=left, right=right):
            flanks = [flank for flank in (left, right) if flank is not None]
            bounds = [_flank_bound(flank, dtype) for flank in flanks]
            edges = (low is not None) + (high is not None)
            if dtype == "float32" and edges > len(flanks):
                bounds.append(DegreeBound(1.0, 0.0))
        case LR(mean=mean, left=below, right=above):
            bounds = [_side_bound(side, mean, dtype) for side in (below, above)]
        case Points():
            bounds = [_points_bound(shape, dtype)]
    return DegreeBound(
        min(max((bound.fixed for bound in bounds), default=0.0), 1.0),
        max((bound.per_unit for bound in bounds), default=0.0),
    )


def _flank_bound(flank: Flank, dtype: Dtype) -> DegreeBound:
    size = sum(map(abs, flank.curve))
    slope = sum(power * abs(c) for power, c in enumerate(flank.curve, 1))
    rounding = UNIT * (size * (2 * len(flank.curve) + 2) + 1.0)
    if dtype == "mixed":
        return DegreeBound(slope * UNIT + rounding, 0.0)
    span = abs(flank.start - flank.end)
    reach = max(abs(flank.start), abs(flank.end))
    position = 4 * UNIT + 4 * UNIT * reach / span
    jump = abs(1.0 - sum(flank.curve))  # a value may round across the edge
    return DegreeBound(slope * position + rounding + jump, slope / span)


def _side_bound(side: Side, mean: float, dtype: Dtype) -> DegreeBound:
    size = sum(map(abs, side.curve))
    bend = sum(2 * power * abs(c) for power, c in enumerate(side.curve))
    slope = size + bend + 4.0 / (side.reach - 1.0)
    rounding = UNIT * (size * (2 * len(side.curve) + 2) + 12.0)
    if dtype == "mixed":
        return DegreeBound(slope * UNIT * side.reach + rounding, 0.0)
    reach = abs(mean) + side.reach * side.spread
    position = 5 * UNIT * side.reach + 4 * UNIT * reach / side.spread
    return DegreeBound(slope * position + rounding, slope / side.spread)


def _points_bound(points: Points, dtype: Dtype) -> DegreeBound:
    """Return the bound of lines between points.

    Rounded degrees move a line by one unit at most, and its sum costs another; the
    quotient, the difference and the product cost one each, of the line's height.
    Rounded values of points and of x move a place by four units of the largest: along a
    line, or, at worst, across every step.
    """
    lines = [
        (b - a, abs(r - p))
        for (a, p), (b, r) in itertools.pairwise(
            zip(points.values, points.degrees, strict=True)
        )
    ]
    height = max((height for width, height in lines if width > 0), default=0.0)
    if dtype == "mixed":
        return DegreeBound(UNIT * (2.0 + 3.0 * height), 0.0)
    slope = max((height / width for width, height in lines if width > 0), default=0.0)
    jumps = sum(height for width, height in lines if width == 0)
    moved = 4.0 * UNIT * max(map(abs, points.values))
    rounding = UNIT * (2.0 + 6.0 * height)
    slope = min(slope, 1e300)  # times 0 it is 0
    return DegreeBound(slope * moved + jumps + rounding, slope)
