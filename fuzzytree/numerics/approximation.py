"""Rule bases whose curves are points or polynomials of a lower degree, with bounds.

`by_points` and `by_degree` give another model and certify how far each of its degrees
can be from the original's, at any real value of the axis and without rounding: the
formulas of `fuzzytree.model.rulebase` over the stored doubles.

**Decisions of relative rules stay.** In a relative rule base every term is a band, and
a rule wins where all its clauses have degree exactly 1
(`fuzzytree.semantics.lowering`). Both functions keep, for every band, the set of values
at which the degree is 1. `by_degree` keeps the plateau itself. `by_points` ends it with
two points at one value, which are a
step: `(low, p), (low, 1)` and `(high, 1), (high, r)` with p and r below 1. So at `low`
itself the degree is p, on the line from `(low, 1)` to `(high, 1)` it is 1, and beyond
`high` it is r or less than 1: all other points are below 1, and a line is held between
its ends, in every number type. Every clause is then exactly 1 where it was and less
where it was less, so the same rule wins, alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import msgspec
import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model.rulebase import (
    LR,
    Band,
    Flank,
    Points,
    RuleBase,
    Shape,
    Side,
    Term,
)
from fuzzytree.numerics.curves import BELOW_ONE, body_coefficients, flank_stretch
from fuzzytree.numerics.fitting import curve_error, lower_curve
from fuzzytree.numerics.placing import points_of

_ROUNDING = 1.0 + 2.0**-40


class TermError(msgspec.Struct, frozen=True):
    """How far a term's degree can be from that of the term it stands for.

    Attributes:
        variable: The variable.
        term: The term.
        bound: The largest difference at any value.
        points: How many points it has, if it became points.
        degree: The largest degree of its polynomials, if they were fitted again.
    """

    variable: str
    term: str
    bound: float
    points: int | None = None
    degree: int | None = None


class Approximated(msgspec.Struct, frozen=True):
    """A model in the place of another.

    Attributes:
        model: The model.
        terms: The terms that changed.
        bound: The largest difference of a rule's strength, on any input.
        origin: Where the bound comes from.
    """

    model: RuleBase
    terms: tuple[TermError, ...]
    bound: float
    origin: str


Change = Callable[[Shape], tuple[Shape, float] | None]


def by_points(model: RuleBase, tolerance: float) -> Approximated:
    """Return a rule base whose curves are points joined by lines.

    Points lie closer where a curve bends more: all lines are nearly as far from it as
    they may be, on either side. Ends, edges, peaks and clipped stretches are kept: each
    is a point of its own. Points that are there already stay as they are.

    Args:
        model: The rule base.
        tolerance: The largest difference of a degree that is allowed; above 0.

    Raises:
        ValueError: If the tolerance is not above 0.
        LossError: If a term would need more than 4096 points, or the doubles around it
            are too far apart.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> found = by_points(rules_from_tree(random_tree(0), "raw"), 1e-3)
        >>> 0.0 < found.bound <= 1e-3
        True
    """
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise ValueError(f"the tolerance must be above 0, not {tolerance!r}")

    def change(shape: Shape) -> tuple[Shape, float] | None:
        if isinstance(shape, Points):
            return None
        return points_of(shape, tolerance)

    return _approximated(model, change, f"lines within {tolerance!r} of the curves")


def by_degree(model: RuleBase, degree: int) -> Approximated:
    """Return a rule base whose curves are polynomials of at most a degree.

    Each flank, and each body of an LR set, is fitted again so that its largest error
    is least (by exchange), with the same value at its end, and made monotone where it
    was. Curves that are short enough, tails and points stay as they are.

    Args:
        model: The rule base.
        degree: The largest degree of a flank `q * (c0 + ...)` or body
            `1 - t * (c0 + ...)`, from 1 to 8.

    Raises:
        ValueError: If the degree is not from 1 to 8.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> found = by_degree(rules_from_tree(random_tree(0)), 1)
        >>> {term.degree for term in found.terms}
        {1}
    """
    if not 1 <= degree <= 8:
        raise ValueError(f"the degree must be from 1 to 8, not {degree!r}")

    def change(shape: Shape) -> tuple[Shape, float] | None:
        match shape:
            case Band(low=low, high=high, left=left, right=right):
                below = _lower_flank(left, low, degree)
                above = _lower_flank(right, high, degree)
                found: Shape = Band(low, high, below[0], above[0])
            case LR(mean=mean, left=first, right=second):
                down, up = _lower_side(first, degree), _lower_side(second, degree)
                found = LR(mean, down[0], up[0])
                below, above = (None, down[1]), (None, up[1])
            case Points():
                return None
        return None if found == shape else (found, max(below[1], above[1]))

    return _approximated(model, change, f"curves of degree {degree}")


def _lower_flank(
    flank: Flank | None, edge: float | None, degree: int
) -> tuple[Flank | None, float]:
    if flank is None or edge is None or len(flank.curve) <= degree:
        return flank, 0.0
    stretch = flank_stretch(flank, edge)
    p = np.array([0.0, *flank.curve])
    last = float(stretch.last) or 1.0
    fitted = lower_curve(p, degree, last, BELOW_ONE)
    curve = tuple(fitted[1:].tolist())
    bound = curve_error(p, fitted, last, BELOW_ONE)
    error = None if flank.error is None else flank.error + bound
    return Flank(flank.start, flank.end, curve, error), bound


def _lower_side(side: Side, degree: int) -> tuple[Side, float]:
    if len(side.curve) <= degree:
        return side, 0.0
    body = np.array([float(c) for c in body_coefficients(side.curve)])
    fall = -body
    fall[0] = 0.0
    fitted = lower_curve(fall, degree, 1.0, 1.0)
    inner = np.polynomial.Polynomial(fitted[1:])(np.polynomial.Polynomial([0.5, 0.5]))
    curve = tuple(inner.coef.tolist())
    lowered = np.array([float(c) for c in body_coefficients(curve)])
    bound = curve_error(body, lowered, 1.0, 1.0)
    return Side(side.spread, curve, side.reach), bound


def _approximated(model: RuleBase, change: Change, what: str) -> Approximated:
    """Return a rule base with changed terms, and the bound of its strengths."""
    errors: list[TermError] = []
    reasons: list[str] = []

    def changed(variable: str, term: Term) -> Term:
        try:
            found = change(term.shape)
        except LossError as error:
            reasons.append(f"term {term.name!r} of {variable!r}: {error}")
            return term
        if found is None:
            return term
        shape, bound = found
        errors.append(TermError(variable, term.name, bound, **_size(shape)))
        return Term(term.name, shape)

    variables = tuple(
        replace(v, terms=tuple(changed(v.name, term) for term in v.terms))
        for v in model.variables
    )
    if reasons:
        listed = "\n  ".join([f"cannot approximate {model.name} by {what}:", *reasons])
        raise LossError(listed)
    bound = _strength_bound(model, errors)
    is_product = model.semantics.conjunction == "product"
    how = "summed" if is_product else "largest"
    origin = f"{how} certified error of a degree: {what}"
    return Approximated(
        replace(model, variables=variables), tuple(errors), bound, origin
    )


def _size(shape: Shape) -> dict[str, int]:
    """Return how many points a shape has, or the degree of its curves."""
    match shape:
        case Points(values=values):
            return {"points": len(values)}
        case Band(left=left, right=right):
            return {"degree": max(len(f.curve) for f in (left, right) if f)}
        case LR(left=left, right=right):
            return {"degree": max(len(left.curve), len(right.curve))}


def _strength_bound(model: RuleBase, errors: Sequence[TermError]) -> float:
    """Return how far the strength of any rule can be from the original's.

    Min and max pass the largest error of a degree on, `1 - degree` keeps it, and a
    product of numbers in [0, 1] at most adds the errors of its factors.
    """
    known = {(error.variable, error.term): error.bound for error in errors}
    worst = 0.0
    for rule in model.rules:
        clauses = [
            max(known.get((clause.variable, term), 0.0) for term in clause.terms)
            for clause in rule.when
        ]
        is_product = model.semantics.conjunction == "product"
        total = sum(clauses) * _ROUNDING if is_product else max(clauses, default=0.0)
        worst = max(worst, total)
    return min(worst, 1.0)
