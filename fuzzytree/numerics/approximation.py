"""Rule bases whose curves are points or polynomials of a lower degree, with bounds.

`by_points` and `by_degree` give another model and certify how far each of its degrees
can be from the original's, at any real value of the axis and without rounding: the
formulas of `fuzzytree.rulebase` over the stored doubles.

**Decisions of relative rules stay.** In a relative rule base every term is a band, and
a rule wins where all its clauses have degree exactly 1 (`fuzzytree.lowering`). Both
functions keep, for every band, the set of values at which the degree is 1. `by_degree`
keeps the plateau itself. `by_points` ends it with two points at one value, which are a
step: `(low, p), (low, 1)` and `(high, 1), (high, r)` with p and r below 1. So at `low`
itself the degree is p, on the line from `(low, 1)` to `(high, 1)` it is 1, and beyond
`high` it is r or less than 1: all other points are below 1, and a line is held between
its ends, in every number type. Every clause is then exactly 1 where it was and less
where it was less, so the same rule wins, alone.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np
from msgspec.structs import replace

from fuzzytree.errors import LossError
from fuzzytree.numerics.curves import (
    BELOW_ONE,
    Stretch,
    body_coefficients,
    derivative,
    distance,
    flank_stretch,
    lowest,
    side_stretches,
    values_at,
)
from fuzzytree.rulebase import (
    LR,
    MOST_POINTS,
    Band,
    Flank,
    Points,
    RuleBase,
    Shape,
    Side,
    Term,
)

if TYPE_CHECKING:
    from fuzzytree.contracts import FloatArray, IntArray

_GRID = 512  # places on a curve at which its bend is looked at
_EXCHANGES = 200  # of places in a fit, at most
_MOST = 1e6  # of a fit's coefficients together; see `rulebase.Flank`
_OVER = 0.25  # how far a fit first follows a curve beyond its limits
_REFITS = 6  # of a clipped curve
_TRIES = 12  # of placing points before the bound counts as out of reach
_SHORT = math.sqrt(0.5)  # the length of a line with an end on the curve
_ROUNDING = 1.0 + 2.0**-40
_TOO_MANY = f"it would need more than {MOST_POINTS} points"


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
        >>> from fuzzytree.lowering import rules_from_tree
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


def points_of(shape: Band | LR, tolerance: float) -> tuple[Points, float]:
    """Return points in the place of a shape, and the largest error of a degree.

    Raises:
        LossError: If there would be too many, or doubles are too far apart for them.
    """
    if isinstance(shape, Band):
        left = _band_half(shape.low, shape.left, tolerance)
        right = _band_half(shape.high, shape.right, tolerance)
        peak = [] if left.points or right.points else [(0.0, 1.0)]
    else:
        left = _side_half(shape, -1, tolerance)
        right = _side_half(shape, 1, tolerance)
        peak = [(shape.mean, 1.0)]
    points = [*left.points, *peak, *reversed(right.points)]
    if len(points) > MOST_POINTS:
        raise LossError(_TOO_MANY)
    values, degrees = zip(*points, strict=True)
    return Points(values, degrees), max(left.bound, right.bound)


class _Half(NamedTuple):
    """Points from outside inwards, and how far lines between them are from a curve."""

    points: list[tuple[float, float]]
    bound: float


def _band_half(edge: float | None, flank: Flank | None, tolerance: float) -> _Half:
    """Return the points up to one end of a plateau: last off it, then on it."""
    if edge is None:
        return _Half([], 0.0)
    step = [(edge, 0.0), (edge, 1.0)]
    if flank is None:
        return _Half(step, 0.0)
    stretch = flank_stretch(flank, edge)
    if stretch.last == 0:
        return _Half(step, 0.0)
    inner = flank.start if stretch.last == 1 else edge
    points, bound = _joined(stretch, (flank.end, inner), tolerance)
    height = points[-1][1]
    if inner != edge:
        points.append((edge, height))
    return _Half([*points, (edge, 1.0)], bound)


def _side_half(shape: LR, sign: int, tolerance: float) -> _Half:
    """Return the points of one side of an LR set, without its peak.

    Neither the support's end nor the end of the first spread need be doubles. The
    point in the place of the former is the next double outside, so that the same
    doubles have degree 0. Between a point and the end that it stands for another
    formula holds than the one that it was compared with: `slack` is how far the two
    can be apart there.
    """
    side = shape.right if sign > 0 else shape.left
    tail, body = side_stretches(side, shape.mean, sign)
    knee = tail.origin + tail.unit
    outer, inner = _double(tail.origin), _double(knee)
    if (Fraction(outer) - tail.origin) * sign < 0:
        outer = math.nextafter(outer, sign * math.inf)
    slack = _steepness(tail) * abs(Fraction(outer) - tail.origin)
    slack += (_steepness(tail) + _steepness(body)) * abs(Fraction(inner) - knee)
    lost = float(slack) * _ROUNDING
    points, bound = _joined(tail, (outer, inner), tolerance - lost)
    others, other = _joined(body, (inner, shape.mean), tolerance - lost)
    return _Half([*points, *others[1:-1]], max(bound, other) + lost)


def _double(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        raise LossError("it reaches beyond the largest double") from None


def _steepness(stretch: Stretch) -> Fraction:
    """Return what the slope of a stretch is at most, per unit of the variable."""
    slope = sum(k * abs(c) * 1.125**k for k, c in enumerate(stretch.coefficients))
    return Fraction(slope * _ROUNDING) / abs(stretch.unit)


def _joined(
    stretch: Stretch, ends: tuple[float, float], tolerance: float
) -> tuple[list[tuple[float, float]], float]:
    """Return points along a stretch, its ends included, and the error of the lines."""
    curve = np.array(stretch.coefficients).reshape(-1, 1)
    knots = _knots(stretch)
    share = 1.0 - 2.0**-6  # the bound may be above the error by a hundredth
    for _ in range(_TRIES):
        if tolerance <= 0:
            break
        z, degrees = _placed(curve, knots, stretch.top, share * tolerance)
        points, exact = _rounded(stretch, ends, z, degrees)
        if not all(-0.125 <= place <= 1.125 for place in exact):
            break
        bound = _line_error(curve, np.array(exact), points, stretch.top)
        if bound <= tolerance:
            return points, bound
        share *= 0.95
    raise LossError(f"doubles around {ends[1]!r} are too coarse for them")


def _knots(stretch: Stretch) -> list[float]:
    """Return the places of a stretch where points must lie, in its direction.

    They are its ends, where its polynomial leaves [0, top], and where it bends from
    one side to the other.
    """
    first, last = float(stretch.first), float(stretch.last)
    p = np.polynomial.Polynomial(stretch.coefficients)
    roots = [r for q in (p, p - stretch.top, p.deriv(2)) for r in _real_roots(q)]
    near = 2.0**-45 * abs(last - first)  # roots that rounding has split
    low, high = min(first, last) + near, max(first, last) - near
    inner = sorted(root for root in roots if low < root < high)
    apart = [b for a, b in zip([-1.0, *inner], inner, strict=False) if b - a > near]
    return [first, *(apart if first < last else reversed(apart)), last]


def _real_roots(p: np.polynomial.Polynomial) -> Iterator[float]:
    for root in p.trim().roots():
        if abs(root.imag) <= 2.0**-30:
            yield float(root.real)


def _placed(
    curve: FloatArray, knots: Sequence[float], top: float, tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """Return places along a curve, knots included, and the degrees of points there.

    A line of length h between two points of a curve is `|p''| h**2 / 8` away from it,
    always on the same side. Points that are off the curve by half of that, to the
    other side, divide it: so lines may be longer by the root of 2, but where an end
    must lie on the curve. Places are chosen so that all lines need the same.
    """
    places, offsets = [np.array(knots[:1])], [np.zeros(1)]
    second = derivative(curve, 2)
    for start, end in itertools.pairwise(knots):
        middle = float(values_at(curve, np.array([start / 2 + end / 2]))[0])
        inner = np.empty(0)
        shift = 0.0
        if 0.0 < middle < top:
            grid = np.linspace(start, end, _GRID + 1)
            bend = values_at(second, grid)
            density = np.sqrt(np.abs(bend) / (16.0 * tolerance))
            steps = (density[1:] + density[:-1]) / 2 * (abs(end - start) / _GRID)
            needed = np.append(0.0, np.cumsum(steps))
            room = 1.0 if needed[-1] <= _SHORT else _room(float(needed[-1]))
            if room > MOST_POINTS:
                raise LossError(_TOO_MANY)
            share = float(needed[-1]) / room
            marks = np.arange(_SHORT, room, 1.0) * share if room > 1.0 else inner
            inner = np.interp(marks, needed, grid)
            shift = -math.copysign(tolerance * share * share, bend[_GRID // 2])
        places += [inner, np.array([end])]
        offsets += [np.full(len(inner), shift), np.zeros(1)]
    z, offset = np.concatenate(places), np.concatenate(offsets)
    degrees = np.clip(values_at(curve, z), 0.0, top)
    moved = np.clip(degrees + offset, np.nextafter(0.0, 1.0), BELOW_ONE)
    return z, np.where(offset == 0.0, degrees, moved)


def _room(needed: float) -> float:
    """Return the least room of two short lines and some whole ones."""
    return math.ceil(max(needed - 2 * _SHORT, 0.0)) + 2 * _SHORT


def _rounded(
    stretch: Stretch,
    ends: tuple[float, float],
    z: FloatArray,
    degrees: FloatArray,
) -> tuple[list[tuple[float, float]], list[float]]:
    """Return points at doubles, each once, and the exact place of each in z."""
    origin, unit = stretch.origin, stretch.unit
    (first, last), sign = ends, math.copysign(1.0, ends[1] - ends[0])
    points = [(first, float(degrees[0]))]
    for place, degree in zip(z[1:-1].tolist(), degrees[1:-1].tolist(), strict=True):
        value = float(origin + unit * Fraction(place))
        if points[-1][0] * sign < value * sign < last * sign:
            points.append((value, degree))
    points.append((last, float(degrees[-1])))
    exact = [float((Fraction(value) - origin) / unit) for value, _ in points]
    return points, exact


def _line_error(
    curve: FloatArray,
    z: FloatArray,
    points: Sequence[tuple[float, float]],
    top: float,
) -> float:
    """Return how far lines between points can be from a curve, clipped."""
    degrees = np.array([degree for _, degree in points])
    width = np.diff(z)
    is_wide = width != 0  # places that doubles cannot tell apart are one
    slope = np.diff(degrees)[is_wide] / width[is_wide]
    first, last = z[:-1][is_wide], z[1:][is_wide]
    lines = np.stack([degrees[:-1][is_wide] - slope * first, slope])
    return distance(first, last, curve, lines, top)


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
        >>> from fuzzytree.lowering import rules_from_tree
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
    bound = _curve_error(p, fitted, last, BELOW_ONE)
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
    bound = _curve_error(body, lowered, 1.0, 1.0)
    return Side(side.spread, curve, side.reach), bound


def _curve_error(p: FloatArray, r: FloatArray, last: float, top: float) -> float:
    start, end = np.zeros(1), np.array([last])
    return distance(start, end, p.reshape(-1, 1), r.reshape(-1, 1), top)


def lower_curve(p: FloatArray, degree: int, last: float, top: float) -> FloatArray:
    """Return a polynomial of at most a degree that is close to another one, clipped.

    Both are 0 at 0. If p never falls on [0, last], clipped, neither does the result,
    for a straight line is mixed in, as little as it takes. What p does beyond its
    limits is of no account, but it may be easier to follow a little further: the best
    of several fits is taken, of lower degrees too where a line had to be mixed in.

    Args:
        p: c0 = 0, c1, ...
        degree: From 1 to 8, below that of p.
        last: Up to where; above 0.
        top: Where p is clipped.

    Example:
        >>> lower_curve(np.array([0.0, 0.0, 1.0]), 1, 1.0, 1.0).round(3).tolist()
        [0.0, 0.828]
    """
    grid = last * (1.0 - np.cos(np.pi * np.arange(1, _GRID + 1) / _GRID)) / 2.0
    powers = grid.reshape(-1, 1) ** np.arange(1, len(p))
    height = powers @ p[1:]
    goal = np.clip(height, 0.0, top)
    is_rising = bool((np.diff(goal) >= 0).all())
    best, least = np.zeros(degree + 1), math.inf
    for size in range(degree, 0, -1):
        is_plain = True
        for fit in _fits(powers[:, :size], height, top):
            found = np.concatenate([[0.0], fit, np.zeros(degree - size)])
            if is_rising:
                risen = _risen(found, last, top, float(goal[-1]))
                is_plain &= risen is found
                found = risen
            reached = powers[:, :degree] @ found[1:]
            error = float(np.abs(np.clip(reached, 0.0, top) - goal).max())
            if error < least and np.abs(found).sum() <= _MOST:
                best, least = found, error
        if is_plain:
            break
    return best


def _fits(powers: FloatArray, height: FloatArray, top: float) -> Iterator[FloatArray]:
    """Yield c1, c2, ... of fits that differ in what they do where a curve is clipped.

    The first follows the clipped curve, the second the curve. For the others the goal
    beyond a limit is the fit before, as far as that is beyond the limit too; so what is
    left of the error can only become less.
    """
    yield _exchange(powers, np.clip(height, 0.0, top))
    if height.max() <= top and height.min() >= 0.0:
        return
    yield _exchange(powers, height)
    fit = _exchange(powers, np.clip(height, -_OVER, top + _OVER))
    for _ in range(_REFITS):
        yield fit
        reached = powers @ fit
        goal = np.where(height >= top, np.maximum(reached, top), height)
        goal = np.where(height <= 0.0, np.minimum(reached, 0.0), goal)
        fit = _exchange(powers, goal)


def _risen(found: FloatArray, last: float, top: float, height: float) -> FloatArray:
    """Return a polynomial that never falls where it is clipped, by mixing a line in."""
    c = found.reshape(-1, 1)
    grid = np.linspace(0.0, last, _GRID + 1)
    above = np.flatnonzero(values_at(c, grid) >= top)
    end = float(grid[above[0]]) if len(above) else last
    is_kept = end == last or lowest(c, last, first=end) >= top
    fall = lowest(derivative(c), end if is_kept else last)
    slope = height / last
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
        solved = np.linalg.solve(system, goal[reference])
        found, level = solved[:-1], float(solved[-1])
        error = goal - powers @ found
        worst = int(np.argmax(np.abs(error)))
        if abs(error[worst]) <= abs(level) * (1.0 + 2.0**-10) + 2.0**-50:
            break
        reference = _exchanged(reference, error, worst)
    return found


def _exchanged(reference: IntArray, error: FloatArray, worst: int) -> IntArray:
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
