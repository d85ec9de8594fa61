"""Points in the place of the curves that a format lacks, with certified bounds.

Shapes of rule bases are placed by `fuzzytree.numerics.placing`; trapezoids, singletons
and steps are points already (`shape_of`). Along the other curves points are put as far
apart as the tolerance allows (`conversion.point_plans`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeVar

from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model import (
    LR,
    Band,
    Binary,
    Curve,
    FuzzySystem,
    Loss,
    MembershipFunction,
    Points,
    RuleBase,
    Shape,
    Singleton,
    SystemOutput,
    Term,
    Trapezoid,
    Variable,
)
from fuzzytree.numerics import BELOW_ONE, points_of
from fuzzytree.semantics.conversion.point_plans import plan_of

EXACT = 2.0**-52
"""Bounds up to this are no loss: rounding alone makes as much."""

D = TypeVar("D", RuleBase, FuzzySystem)
V = TypeVar("V", Variable, SystemOutput)


Keeps = Callable[[Variable | SystemOutput, Term], bool]
"""Whether a term of a variable stays as it is; one of rules is one of an input."""


def has_numbers(variable: Variable | SystemOutput) -> bool:
    """Return whether a variable is an output of weighted numbers."""
    return isinstance(variable, SystemOutput) and variable.defuzzifier.is_weighted


def _is_kept(variable: Variable | SystemOutput, term: Term) -> bool:
    return has_numbers(variable) or isinstance(term.function, Points)


def term_title(variable: Variable | SystemOutput, term: Term) -> str:
    """Return what a loss calls a term.

    Example:
        >>> term_title(Variable("heat", ()), Term("low", Singleton(1.0)))
        "term 'low' of 'heat'"
    """
    return f"term {term.name!r} of {variable.name!r}"


def pointed(
    document: D, tolerance: float, *, keeps: Keeps = _is_kept
) -> tuple[D, tuple[Loss, ...]]:
    """Return a document whose curves are points, and how far each can be off.

    The bound is of the degree, at any real value of the axis.

    Args:
        document: A rule base or a system.
        tolerance: The largest difference of a degree that is allowed; above 0 and
            below 1.
        keeps: Whether a term stays as it is: `Points` and the weighted numbers of
            outputs unless given.

    Returns:
        The document, and a loss for each curve whose points are further off than
        2^-52.

    Raises:
        ValueError: If the tolerance is not above 0 and below 1.
        LossError: If a curve would need more than 4096 points, doubles around it are
            too coarse, or it is a formula.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> rules, losses = pointed(rules_from_tree(random_tree(0), "raw"), 1e-3)
        >>> all(0.0 < loss.bound <= 1e-3 for loss in losses)
        True
    """
    check_tolerance(tolerance)
    change: _Change = _Change(tolerance, keeps)
    result: D = replace(document, variables=change.variables(document.variables))
    if result.outputs:
        result = replace(result, outputs=change.variables(result.outputs))
    if change.reasons:
        head = f"cannot write the curves of {document.name} as points:"
        raise LossError("\n  ".join([head, *change.reasons]))
    return result, tuple(change.losses)


def check_tolerance(tolerance: float) -> None:
    """Refuse a tolerance that no degree can meet, or that allows every degree.

    Raises:
        ValueError: If it is not above 0 and below 1.
    """
    if not 0.0 < tolerance < 1.0:
        raise ValueError(
            f"tolerance: must be above 0 and below 1, such as 1e-3, not {tolerance!r}"
        )


class _Change:
    """Changes curves, and remembers what was lost and what cannot be done."""

    def __init__(self, tolerance: float, keeps: Keeps) -> None:
        self.tolerance, self.keeps = tolerance, keeps
        self.losses: list[Loss] = []
        self.reasons: list[str] = []

    def variables(self, variables: tuple[V, ...]) -> tuple[V, ...]:
        return tuple(
            replace(one, terms=tuple(self._term(one, term) for term in one.terms))
            for one in variables
        )

    def _term(self, variable: Variable | SystemOutput, label: Term) -> Term:
        if self.keeps(variable, label):
            return label
        where = term_title(variable, label)
        try:
            result = points_for(label.function, self.tolerance)
        except LossError as error:
            self.reasons.append(f"{where}: {error}")
            return label
        if result.bound > EXACT:
            count = len(result.points.values)
            tail = f"; {result.tail}" if result.tail else ""
            what = f"it becomes {count} points joined by lines{tail}"
            self.losses.append(Loss(where, what, result.bound))
        return replace(label, function=result.points)


class PlacedPoints(NamedTuple):
    """Points in the place of a curve."""

    points: Points
    bound: float
    tail: str = ""


def points_for(curve: Curve, tolerance: float) -> PlacedPoints:
    """Return points in the place of a curve, and how far they can be off.

    Raises:
        ValueError: If the tolerance is not above 0 and below 1.
        LossError: If no points are that close, or a curve has no degrees of its own.

    Example:
        >>> from fuzzytree.model import Gaussian
        >>> found = points_for(Gaussian(0.0, 1.0), 0.01)
        >>> len(found.points.values), found.bound <= 0.01
        (18, True)
    """
    check_tolerance(tolerance)
    tolerance = min(tolerance, 0.5)  # half of all degrees: no plan needs more
    shape = shape_of(curve)
    if isinstance(shape, Points):
        return PlacedPoints(shape, 0.0)
    if isinstance(shape, Band):
        return PlacedPoints(*straight_points(shape))
    if shape is not None:
        return PlacedPoints(*points_of(shape, tolerance))
    assert isinstance(curve, MembershipFunction)  # the others are shapes
    return _placed(curve, tolerance)


def straight_points(band: Band) -> tuple[Points, float]:
    """Return the points of a band, and how far they are off.

    Where a flank begins it is clamped below 1, by 2^-53.

    Raises:
        LossError: If its ends are further apart than the largest double.

    Example:
        >>> straight_points(Band(high=1.0, right=2.0))[0].values
        (1.0, 1.0, 2.0)
    """
    points = _corners(band)
    if math.isinf(points.values[-1] - points.values[0]):
        raise LossError("it reaches beyond the largest double")
    return points, 2.0**-53 if band.flanks else 0.0


def _corners(band: Band) -> Points:
    points: list[tuple[float, float]] = []
    sides = (band.low, band.left, -1), (band.high, band.right, 1)
    for edge, end, sign in sides:
        if edge is None:
            continue
        half = [(edge, 0.0), (edge, 1.0)]
        if end is not None:
            half = [(end, 0.0), (edge, BELOW_ONE), (edge, 1.0)]
        points += half if sign < 0 else reversed(half)
    values, degrees = zip(*(points or [(0.0, 1.0)]), strict=True)
    return Points(values, degrees)


def band_of(shape: Shape) -> Band | None:
    """Return the band that has exactly these points, as `straight_points` places them.

    Example:
        >>> band_of(straight_points(Band(high=1.0, right=2.0))[0])
        Band(low=None, high=1.0, left=None, right=2.0)
        >>> band_of(Points((0.0, 1.0), (0.0, 1.0))) is None
        True
    """
    if not isinstance(shape, Points) or 1.0 not in shape.degrees:
        return None
    values, degrees = shape.values, shape.degrees
    plateau = [v for v, d in zip(values, degrees, strict=True) if d == 1.0]
    low = plateau[0] if degrees[0] == 0.0 else None
    high = plateau[-1] if degrees[-1] == 0.0 else None
    left = values[0] if low is not None and values[0] < low else None
    right = values[-1] if high is not None and values[-1] > high else None
    band = Band(low, high, left, right)
    return band if _corners(band) == shape and not any(band.mistakes()) else None


def _placed(curve: MembershipFunction, tolerance: float) -> PlacedPoints:
    """Return points along a curve."""
    plan = plan_of(curve, tolerance)
    values, degrees = zip(*plan.points, strict=True)
    if math.isinf(values[-1] - values[0]):
        raise LossError("it reaches beyond the largest double")
    tail = ""
    if plan.is_cut:
        first, last = degrees[0], degrees[-1]
        tail = f"before them it stays at {first:.2g}, after them at {last:.2g}"
    return PlacedPoints(Points(values, degrees), plan.bound, tail)


_Pairs = list[tuple[float, float]]


def shape_of(curve: Curve) -> Shape | None:
    """Return a shape with the degrees of a curve, the same bits at every double.

    A step of points has its first degree at the value itself. Where a curve is 1 at its
    left edge already, the step stands one double below.

    Returns:
        The shape, or None if none has these degrees.

    Example:
        >>> shape_of(Trapezoid(0.0, 1.0, 1.0, 3.0))
        Points(values=(0.0, 1.0, 3.0), degrees=(0.0, 1.0, 0.0))
    """
    match curve:
        case Band() | LR() | Points():
            return curve
        case Trapezoid(a=a, b=b, c=c, d=d):
            left = [(b, 1.0)] if a is None else _rise(a, b)
            right = [(c, 1.0)] if d is None else _fall(c, d)
            if a is None:
                left = []
            elif d is None:
                right = []
            return _points_of(left, right)
        case Singleton(value=value):
            return _points_of(_rise(value, value), _fall(value, value))
        case Binary(start=start, is_above=is_above):
            return _points_of(
                _rise(start, start) if is_above else _fall(start, start), []
            )
        case _:
            return None


def stepped(values: Iterable[float]) -> tuple[float, ...]:
    """Return the values of points; of two neighbouring doubles the first comes twice.

    No double lies between such two, so a step at the first has the same degrees. A
    value that comes twice already stays.

    Example:
        >>> import math
        >>> stepped((0.0, 1.0, math.nextafter(1.0, 2.0), 2.0))
        (0.0, 1.0, 1.0, 2.0)
    """
    results: list[float] = []
    for value in values:
        is_second = len(results) > 1 and results[-1] == results[-2]
        is_next = bool(results) and value == math.nextafter(results[-1], math.inf)
        results.append(results[-1] if is_next and not is_second else value)
    return tuple(results)


def _rise(start: float, end: float) -> _Pairs:
    if start < end:
        return [(start, 0.0), (end, 1.0)]
    before = math.nextafter(end, -math.inf)
    if math.isinf(before):
        return [(end, 1.0)]
    return [(before, 0.0), (before, 1.0)]


def _fall(start: float, end: float) -> _Pairs:
    return [(start, 1.0), (end, 0.0)]


def _points_of(left: _Pairs, right: _Pairs) -> Points:
    if left and right and left[-1] == right[0]:
        right = right[1:]
    values, degrees = zip(*left, *right, strict=True)
    return Points(values, degrees)
