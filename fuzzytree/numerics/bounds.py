"""How far float32 can take a degree, a strength or an axis from its double.

Every bound is a priori: it follows from the coefficients, the widths and the largest
values, by the usual model of rounding, fl(a op b) = (a op b)(1 + e) with |e| <= u and
u = 2**-24 for float32. Terms of order u**2 and the doubles' own rounding (2**-53) are
covered by the factor `_SECOND_ORDER`.

The use of such a bound: where the margin between the two strongest classes exceeds
twice the bound of a strength, both number types decide alike.
"""

from __future__ import annotations

from collections.abc import Mapping

from fuzzytree.contracts import Dtype
from fuzzytree.rulebase import LR, Band, Flank, RuleBase, Shape, Side, Variable

UNIT = 2.0**-24
"""The unit roundoff of float32."""

_SECOND_ORDER = 1.0 + 2.0**-10


def strength_bound(
    rules: RuleBase, dtype: Dtype, largest: Mapping[str, float]
) -> tuple[float, str]:
    """Return the largest difference of any strength from its double, and its origin.

    Min passes the largest error of a degree on; a product at most adds the errors of
    its factors, and a rounding for each multiplication.

    Args:
        rules: The rule base.
        dtype: The type in which degrees and strengths are computed.
        largest: The largest absolute value of each input among the rows in question;
            only the all-float32 type depends on it.

    Returns:
        The bound, at most 1, and a sentence that says where it comes from.
    """
    if dtype == "float64":
        return 0.0, "the same operations in the same type"
    variables = {v.name: v for v in rules.variables}
    slack = {
        name: _axis_slack(variable, largest) if dtype == "float32" else 0.0
        for name, variable in variables.items()
    }
    degree = {
        (v.name, t.name): degree_bound(t.shape, dtype, slack[v.name])
        for v in rules.variables
        for t in v.terms
    }
    worst = 0.0
    for rule in rules.rules:
        errors = [
            max(degree[clause.variable, term] for term in clause.terms)
            + (UNIT if clause.negated else 0.0)
            for clause in rule.when
        ]
        if rules.semantics.conjunction == "product":
            worst = max(worst, sum(errors) + UNIT * max(len(errors) - 1, 0))
        else:
            worst = max(worst, max(errors, default=0.0))
    how = "largest" if rules.semantics.conjunction == "min" else "summed"
    return min(worst * _SECOND_ORDER, 1.0), f"{how} error bound of the terms in {dtype}"


def degree_bound(shape: Shape, dtype: Dtype, slack: float = 0.0) -> float:
    """Return the largest difference of a degree from its double.

    Args:
        shape: The shape.
        dtype: `mixed` rounds the position on a flank; `float32` also rounds the value,
            the shape's numbers and their difference.
        slack: The absolute error of the value itself, in the variable's unit.
    """
    if dtype == "float64":
        return 0.0
    match shape:
        case Band(left=left, right=right):
            flanks = [flank for flank in (left, right) if flank is not None]
            if dtype == "float32" and not flanks:
                return 1.0  # a step: a value that rounds across its edge
            errors = [_flank_bound(flank, dtype, slack) for flank in flanks]
            steps = (shape.low is not None and left is None) or (
                shape.high is not None and right is None
            )
            if dtype == "float32" and steps:
                return 1.0
            return min(max(errors, default=0.0), 1.0)
        case LR(mean=mean, left=below, right=above):
            error = max(_side_bound(s, mean, dtype, slack) for s in (below, above))
            return min(error, 1.0)


def axis_bound(variable: Variable, largest: Mapping[str, float]) -> float:
    """Return how far a variable's value in float32 can be from its double.

    An input is rounded once. A combination rounds inputs, centres, differences,
    products and sums: at most (number of parts + 3) roundings of each summand.
    """
    return _axis_slack(variable, largest) * _SECOND_ORDER


def _axis_slack(variable: Variable, largest: Mapping[str, float]) -> float:
    if not variable.parts:
        return UNIT * largest.get(variable.name, 0.0)
    steps = len(variable.parts) + 3
    return sum(
        UNIT * steps * abs(p.weight) * (largest.get(p.input, 0.0) + abs(p.centre))
        for p in variable.parts
    )


def _flank_bound(flank: Flank, dtype: Dtype, slack: float) -> float:
    size = sum(map(abs, flank.curve))
    slope = sum(power * abs(c) for power, c in enumerate(flank.curve, 1))
    position = UNIT
    jump = 0.0
    if dtype == "float32":
        span = abs(flank.start - flank.end)
        reach = max(abs(flank.start), abs(flank.end))
        position = 4 * UNIT + (slack + 3 * UNIT * reach) / span
        jump = abs(1.0 - sum(flank.curve))  # a value may round across the edge
    rounding = UNIT * (size * (2 * len(flank.curve) + 2) + 1.0)
    return slope * position + rounding + jump


def _side_bound(side: Side, mean: float, dtype: Dtype, slack: float) -> float:
    size = sum(map(abs, side.curve))
    bend = sum(2 * power * abs(c) for power, c in enumerate(side.curve))
    slope = size + bend + 4.0 / (side.reach - 1.0)
    position = UNIT * side.reach
    if dtype == "float32":
        largest = abs(mean) + side.reach * side.spread
        position = 5 * UNIT * side.reach + (slack + 3 * UNIT * largest) / side.spread
    rounding = UNIT * (size * (2 * len(side.curve) + 2) + 12.0)
    return slope * position + rounding
