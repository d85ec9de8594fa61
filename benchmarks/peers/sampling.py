"""Shapes as points, for engines that know nothing else, with a certified error.

Points lie on every landmark, on the doubles next to it, and between them. So plateaus
begin and end at the very double, and an engine that joins the points by lines keeps
every decision of relative rules: degree 1 on the plateaus, below 1 elsewhere. A shape
that is points is itself, its steps as wide as one double.
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from fuzzytree.model import LR, Band, Points, RuleBase, Shape, Side, shapes_of
from fuzzytree.runtimes.degrees import shape_degrees
from fuzzytree.semantics import landmarks

FloatArray = npt.NDArray[np.float64]

HIGHEST = 1.0 - 2.0**-50
"""The highest sample off a plateau: joined by lines, such samples stay below 1."""

_ROUNDING = 2.0**-40  # relative to a curve's coefficients; covers far more than it must


def proposition_shapes(rules: RuleBase) -> dict[tuple[str, str], Shape]:
    """Return the shapes that propositions name, in the order of the rules."""
    shapes = shapes_of(rules.variables)
    propositions = (proposition for rule in rules.rules for proposition in rule.when)
    keys = dict.fromkeys((c.variable, term) for c in propositions for term in c.terms)
    return {key: shapes[key] for key in keys}


def universe(shapes: Sequence[Shape], points: int) -> FloatArray:
    """Return increasing values at which to sample all shapes of one variable.

    Each curved piece gets `points` values.
    """
    result: list[FloatArray] = [np.array([0.0])]
    for shape in shapes:
        marks = np.array(_marks(shape))
        result += [marks, np.nextafter(marks, -np.inf), np.nextafter(marks, np.inf)]
        for start, end in _pieces(shape):
            share = np.arange(points + 1) / points
            result.append(start * (1.0 - share) + end * share)
    values = np.unique(np.concatenate(result))
    return values[np.isfinite(values)]


def samples(shape: Shape, values: FloatArray) -> FloatArray:
    """Return the degrees of a shape at some values, not above `HIGHEST` but for 1."""
    degrees = shape_degrees(shape, values)
    return np.where(degrees == 1.0, 1.0, np.minimum(degrees, HIGHEST))


def line_error(shape: Shape, values: FloatArray) -> float:
    """Return how far lines between the samples can be from the shape's degrees.

    On a piece where the degree is a polynomial p of u, a line between two points that
    are h apart in u is within `max |p''| h**2 / 8` of p. Where p is clamped to 0 and
    1, the line between the clamped ends adds at most by how much p exceeds the range at
    them. Both are computed for every pair of neighbours.

    `values` increase and have every landmark and its neighbours among them.
    """
    match shape:
        case LR(mean=mean, left=below, right=above):
            errors = [
                _side_error(side, (values - mean) * sign)
                for side, sign in ((below, -1.0), (above, 1.0))
            ]
        case Band() | Points():
            errors = [_ROUNDING]
    return max(errors, default=0.0)


def lines_bound(
    rules: RuleBase, errors: Mapping[tuple[str, str], float]
) -> tuple[float, str]:
    """Return how far strengths can be from those of the terms themselves, and why.

    The minimum passes on the largest error of a proposition; a product adds them up.

    `errors` has the `line_error` of each term that a proposition names.
    """
    is_product = rules.semantics.conjunction == "product"
    worst = 0.0
    for rule in rules.rules:
        propositions = [
            max(errors[c.variable, term] for term in c.terms) for c in rule.when
        ]
        worst = max(
            worst, sum(propositions) if is_product else max(propositions, default=0.0)
        )
    how = "summed" if is_product else "largest"
    return min(worst, 1.0), f"{how} error of lines between the points of the terms"


def _marks(shape: Shape) -> tuple[float, ...]:
    """Return the values at which a shape must be sampled, and beside them."""
    return shape.values if isinstance(shape, Points) else landmarks(shape)


def _pieces(shape: Shape) -> Iterator[tuple[float, float]]:
    match shape:
        case Band():
            yield from shape.flanks
        case LR(mean=mean, left=below, right=above):
            for side, sign in ((below, -1.0), (above, 1.0)):
                ends = [mean + sign * side.spread * u for u in (0.0, 1.0, side.reach)]
                for start, end in itertools.pairwise(ends):
                    if math.isfinite(start) and math.isfinite(end):
                        yield start, end
        case Points():
            return


def _side_error(side: Side, distance: FloatArray) -> float:
    u = np.clip(distance / side.spread, 0.0, side.reach)
    body = _body(side.curve)
    level = min(max(_at_one(body), 0.0), 1.0)
    gaps = np.abs(np.diff(np.clip(u, 1.0, side.reach))) / (side.reach - 1.0)
    tail = 12.0 * level * float(np.max(gaps, initial=0.0)) ** 2 / 8.0
    slack = _ROUNDING * (1.0 + sum(map(abs, side.curve)) * 4.0 ** len(side.curve))
    return max(_curve_error(np.array(body), np.clip(u, 0.0, 1.0)), tail) + slack


def _body(curve: Sequence[float]) -> list[float]:
    """Return 1 - t Q(2 t - 1), a side for t up to 1, by the powers of t.

    Example:
        >>> _body((0.5, 0.25))  # 1 - t (0.5 + 0.25 (2 t - 1))
        [1.0, -0.25, -0.5]
    """
    inner = [curve[-1]]
    for coefficient in reversed(curve[:-1]):
        pairs = zip([0.0, *inner], [*inner, 0.0], strict=True)
        inner = [2.0 * below - same for below, same in pairs]
        inner[0] += coefficient
    return [1.0, *(-coefficient for coefficient in inner)]


def _at_one(curve: Sequence[float]) -> float:
    return functools.reduce(operator.add, reversed(curve))


def _curve_error(curve: FloatArray, position: FloatArray) -> float:
    """Return the error of lines on a polynomial clamped to [0, 1], over [0, 1]."""
    powers = np.arange(len(curve))
    bend = float(np.sum(np.abs(curve) * powers * (powers - 1)))
    gaps = np.abs(np.diff(position))
    height = np.polynomial.polynomial.polyval(position, curve)
    over = np.maximum(height - 1.0, 0.0) + np.maximum(-height, 0.0)
    state = np.sign(np.maximum(height - 1.0, 0.0)) - np.sign(np.maximum(-height, 0.0))
    is_kink = state[1:] != state[:-1]
    error = bend * gaps**2 / 8.0 + np.where(is_kink, over[1:] + over[:-1], 0.0)
    slack = _ROUNDING * (1.0 + float(np.sum(np.abs(curve))))
    return float(np.max(error[gaps > 0], initial=0.0)) + slack
