"""Rule bases whose curves are points or polynomials of a lower degree, with bounds.

`by_points` and `by_degree` give another model and certify how far each of its degrees
can be from the original's, at any real value of the axis and without rounding: the
formulas of `fuzzytree.model.rulebase` over the stored doubles.

**Decisions of relative rules stay.** In a relative rule base every term is a band, and
a rule wins where all its propositions have degree exactly 1
(`fuzzytree.semantics.lowering`). Both functions keep, for every band, the set of values
at which the degree is 1. `by_degree` keeps the plateau itself. `by_points` ends it with
two points at one value, which are a
step: `(low, p), (low, 1)` and `(high, 1), (high, r)` with p and r below 1. So at `low`
itself the degree is p, on the line from `(low, 1)` to `(high, 1)` it is 1, and beyond
`high` it is r or less than 1: all other points are below 1, and a line is clamped
between its ends, in every number type. Every proposition is then exactly 1 where it was
and less where it was less, so the same rule wins, alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import msgspec
import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.model import (
    LR,
    Band,
    FloatArray,
    IntArray,
    Points,
    RuleBase,
    Shape,
    Side,
    Term,
)
from fuzzytree.numerics.curves import (
    body_coefficients,
    derivative,
    distance,
    lowest,
    values_at,
)
from fuzzytree.numerics.placing import points_of

_GRID = 512  # places at which a fit is looked at
_EXCHANGES = 200  # of places in a fit, at most
_MOST = 1e6  # of a fit's coefficients together; see `rulebase.Side`
_OVER = 0.25  # how far a fit first follows a curve beyond its limits
_REFITS = 6  # of a clipped curve


def lower_curve(p: FloatArray, degree: int) -> FloatArray:
    """Return a polynomial of at most a degree that is close to another one on [0, 1].

    Both are clipped to [0, 1], and 0 at 0. If p never falls there, neither does the
    result, for a straight line is mixed in, as little as it takes. What p does beyond
    its limits is of no account, but it may be easier to follow a little further: the
    best of several fits is taken, of lower degrees too where a line had to be mixed in.

    Args:
        p: c0 = 0, c1, ...
        degree: From 1 to 8, below that of p.

    Example:
        >>> lower_curve(np.array([0.0, 0.0, 1.0]), 1).round(3).tolist()
        [0.0, 0.828]
    """
    grid = (1.0 - np.cos(np.pi * np.arange(1, _GRID + 1) / _GRID)) / 2.0
    powers = grid.reshape(-1, 1) ** np.arange(1, len(p))
    height = powers @ p[1:]
    goal = np.clip(height, 0.0, 1.0)
    is_rising = bool((np.diff(goal) >= 0).all())
    best, least = np.zeros(degree + 1), math.inf
    for size in range(degree, 0, -1):
        is_plain = True
        for fit in _fits(powers[:, :size], height):
            found = np.concatenate([[0.0], fit, np.zeros(degree - size)])
            if is_rising:
                risen = _risen(found, float(goal[-1]))
                is_plain &= risen is found
                found = risen
            reached = powers[:, :degree] @ found[1:]
            error = float(np.abs(np.clip(reached, 0.0, 1.0) - goal).max())
            if error < least and np.abs(found).sum() <= _MOST:
                best, least = found, error
        if is_plain:
            break
    return best


def _fits(powers: FloatArray, height: FloatArray) -> Iterator[FloatArray]:
    """Yield c1, c2, ... of fits that differ in what they do where a curve is clipped.

    The first follows the clipped curve, the second the curve. For the others the goal
    beyond a limit is the fit before, as far as that is beyond the limit too; so what is
    left of the error can only become less.
    """
    yield _exchange(powers, np.clip(height, 0.0, 1.0))
    if height.max() <= 1.0 and height.min() >= 0.0:
        return
    yield _exchange(powers, height)
    fit = _exchange(powers, np.clip(height, -_OVER, 1.0 + _OVER))
    for _ in range(_REFITS):
        yield fit
        reached = powers @ fit
        goal = np.where(height >= 1.0, np.maximum(reached, 1.0), height)
        goal = np.where(height <= 0.0, np.minimum(reached, 0.0), goal)
        fit = _exchange(powers, goal)


def _risen(found: FloatArray, slope: float) -> FloatArray:
    """Return a polynomial that never falls where it is clipped, by mixing a line in."""
    c = found.reshape(-1, 1)
    grid = np.linspace(0.0, 1.0, _GRID + 1)
    above = np.flatnonzero(values_at(c, grid) >= 1.0)
    end = float(grid[above[0]]) if len(above) else 1.0
    is_kept = end == 1.0 or lowest(c, 1.0, first=end) >= 1.0
    fall = lowest(derivative(c), end if is_kept else 1.0)
    if fall >= 0.0 or slope <= 0.0:
        return found
    fall -= 2.0**-30 * slope  # for the rounding of the mixture
    share = -fall / (slope - fall)
    mixed = (1.0 - share) * found
    mixed[1] += share * slope
    return mixed


def _exchange(powers: FloatArray, goal: FloatArray) -> FloatArray:
    """Return c1, c2, ... with the least largest error at some places.

    On a reference of one place more than there are coefficients the best fit has errors
    of equal size and alternating sign; the place of the largest error takes that of a
    neighbour of its own sign, until there is none larger.

    Args:
        powers: z, z**2, ... of each place, of shape (places, coefficients).
        goal: What to fit.
    """
    places, degree = powers.shape
    ends = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    reference = ((1.0 - ends) / 2.0 * (places - 1)).astype(np.int64)
    sign = (-1.0) ** np.arange(degree + 1)
    found: FloatArray = np.zeros(degree)
    for _ in range(_EXCHANGES):
        system = np.column_stack([powers[reference], sign])
        try:
            solved: FloatArray = np.linalg.solve(system, goal[reference]).astype(float)
        except np.linalg.LinAlgError:
            break  # so close to 0 that doubles cannot distinguish powers
        if not np.isfinite(solved).all():
            break
        found, level = solved[:-1], float(solved[-1])
        error = goal - powers @ found
        worst = int(np.argmax(np.abs(error)))
        if abs(error[worst]) <= abs(level) * (1.0 + 2.0**-10) + 2.0**-50:
            break
        reference = _exchanged(reference, error, worst)
    return found


def _exchanged(reference: IntArray, error: FloatArray, worst: int) -> IntArray:
    """Return the reference with the worst place in it, its signs still alternating."""
    place = int(np.searchsorted(reference, worst))
    is_up = error[worst] > 0
    found = reference.copy()
    if place == 0 and (error[reference[0]] > 0) != is_up:
        found[1:] = reference[:-1]
        found[0] = worst
    elif place == len(reference) and (error[reference[-1]] > 0) != is_up:
        found[:-1] = reference[1:]
        found[-1] = worst
    else:
        below = max(place - 1, 0)
        near = below if (error[reference[below]] > 0) == is_up else place
        found[min(near, len(reference) - 1)] = worst
    return found


_ROUNDING = 1.0 + 2.0**-40


class ApproximateRules(msgspec.Struct, frozen=True):
    """A model in the place of another.

    Attributes:
        model: The model.
        terms: How far the degree of each term that changed can be off, by the names of
            its variable and itself.
        bound: The largest difference of a rule's strength, on any input.
        origin: Where the bound comes from.
    """

    model: RuleBase
    terms: Mapping[tuple[str, str], float]
    bound: float
    origin: str


Change = Callable[[Shape], tuple[Shape, float] | None]


def by_points(model: RuleBase, tolerance: float) -> ApproximateRules:
    """Return a rule base whose curves are points joined by lines.

    Points lie closer where a curve bends more: all lines are nearly as far from it as
    they may be, on either side. Ends, peaks and clipped stretches are kept: each is a
    point of its own. What consists of lines already stays as it is.

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
        return points_of(shape, tolerance) if isinstance(shape, LR) else None

    return _approximated(model, change, f"lines within {tolerance!r} of the curves")


def by_degree(model: RuleBase, degree: int) -> ApproximateRules:
    """Return a rule base whose curves are polynomials of at most a degree.

    Each body of an LR set is fitted again so that its largest error
    is least (by exchange), with the same value at its end, and made monotone where it
    was. Curves that are short enough, tails and points stay as they are.

    Args:
        model: The rule base.
        degree: The largest degree of a body `1 - t * (c0 + ...)`, from 1 to 8.

    Raises:
        ValueError: If the degree is not from 1 to 8.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.testing import random_tree
        >>> found = by_degree(rules_from_tree(random_tree(0), "raw"), 1)
        >>> 0.0 < found.bound < 0.1
        True
    """
    if not 1 <= degree <= 8:
        raise ValueError(f"the degree must be from 1 to 8, not {degree!r}")

    def change(shape: Shape) -> tuple[Shape, float] | None:
        match shape:
            case LR(mean=mean, left=first, right=second):
                down, up = _lower_side(first, degree), _lower_side(second, degree)
                found = LR(mean, down[0], up[0])
                return None if found == shape else (found, max(down[1], up[1]))
            case Band() | Points():
                return None

    return _approximated(model, change, f"curves of degree {degree}")


def _lower_side(side: Side, degree: int) -> tuple[Side, float]:
    if len(side.curve) <= degree:
        return side, 0.0
    body = np.array([float(c) for c in body_coefficients(side.curve)])
    fall = -body
    fall[0] = 0.0
    fitted = lower_curve(fall, degree)
    inner = np.polynomial.Polynomial(fitted[1:])(np.polynomial.Polynomial([0.5, 0.5]))
    curve = tuple(inner.coef.tolist())
    lowered = np.array([float(c) for c in body_coefficients(curve)])
    ends = np.zeros(1), np.ones(1)
    bound = distance(*ends, body.reshape(-1, 1), lowered.reshape(-1, 1), 1.0)
    return Side(side.spread, curve, side.reach), bound


def _approximated(model: RuleBase, change: Change, what: str) -> ApproximateRules:
    """Return a rule base with changed terms, and the bound of its strengths."""
    errors: dict[tuple[str, str], float] = {}
    reasons: list[str] = []

    def changed(variable: str, term: Term) -> Term:
        try:
            found = change(term.shape)
        except LossError as error:
            reasons.append(f"term {term.name!r} of {variable!r}: {error}")
            return term
        if found is None:
            return term
        shape, errors[variable, term.name] = found
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
    return ApproximateRules(replace(model, variables=variables), errors, bound, origin)


def _strength_bound(model: RuleBase, errors: Mapping[tuple[str, str], float]) -> float:
    """Return how far the strength of any rule can be from the original's.

    Min and max pass the largest error of a degree on, `1 - degree` keeps it, and a
    product of numbers in [0, 1] at most adds the errors of its factors.
    """
    worst = 0.0
    for rule in model.rules:
        propositions = [
            max(
                errors.get((proposition.variable, term), 0.0)
                for term in proposition.terms
            )
            for proposition in rule.when
        ]
        is_product = model.semantics.conjunction == "product"
        total = (
            sum(propositions) * _ROUNDING
            if is_product
            else max(propositions, default=0.0)
        )
        worst = max(worst, total)
    return min(worst, 1.0)
