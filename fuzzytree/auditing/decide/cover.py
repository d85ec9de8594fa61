"""Where no rule reaches a level: gaps, boxes around them, and the least cover.

At level 0 a product is what a minimum is: 0 where one of its factors is. So gaps are
cells in which each rule has a literal of 0; only those of some width count, for where
two terms touch there is no gap.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Any

from fuzzytree.auditing.decide.answers import (
    ONE,
    ZERO,
    Answer,
    Budget,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.axes import Axis
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.claims import Claims, within
from fuzzytree.auditing.decide.levels import LevelView, TooManyError, common
from fuzzytree.auditing.decide.lines import Lines, value_at
from fuzzytree.auditing.decide.rules import Literal

Sides = dict[str, tuple[Fraction, Fraction]]
"""A box: the ends of some axes."""

_HALVINGS, _LOOKS = 10, 8
_HALF = Fraction(1, 2)


def gap(base: Base, budget: Budget, beside: Sequence[Sides] = ()) -> Answer:
    """Return whether no rule fires on a part of the domain of some width.

    `beside`: boxes that it is not in, nor a double beside them.
    """
    beside = [
        {
            name: (_next(low, -math.inf), _next(high, math.inf))
            for name, (low, high) in sides.items()
        }
        for sides in beside
    ]
    if base.is_empty:
        return Proved("the domain has no point")
    fine = base.fine
    if base.is_coupled:
        return within(budget, lambda own: _gap_by_solver(fine, beside, own))
    return within(budget, lambda own: _gap(fine, beside, own))


def _next(x: Fraction, to: float) -> Fraction:
    return Fraction(math.nextafter(float(x), to))


def _gap(base: Base, beside: Sequence[Sides], budget: Budget) -> Answer:
    values = _Walk(base, beside, 0, budget).values(budget)
    if values is None:
        return Proved("the stretches of 0 on all axes")
    if not base.is_exact:
        values = _Walk(base, beside, 1, budget).values(budget)
    point = None if values is None else base.point(values)
    if point is None or not base.contains(point):
        return Open("degrees are known within bounds alone", "FTD02")
    return Point(point, "the stretches of 0 on all axes")


class _Walk:
    """Over the axes: from each a stretch, so that together all rules are 0.

    Boxes are rules as well, which fire inside. `side`: the lower lines (0), which show
    that there is none, or the upper ones (1).
    """

    def __init__(
        self, base: Base, beside: Sequence[Sides], side: int, budget: Budget
    ) -> None:
        self.base, self.every = base, (1 << base.count + len(beside)) - 1
        self.options: list[tuple[str, dict[int, Fraction]]] = []
        names = dict.fromkeys(axis.name for axis in base.axes_in_use)
        names |= dict.fromkeys(name for sides in beside for name in sides)
        for name in names:
            axis = base.axes[name]
            budget.spend(len(axis.literals) ** 2 + 10)
            spans = [
                (users, stretch)
                for literal, users in axis.literals.items()
                for stretch in zeros(axis, literal, side)
            ]
            for place, sides in enumerate(beside, base.count):
                if name in sides:
                    low, high = sides[name]
                    spans += [(1 << place, (axis.least - 1, low))]
                    spans += [(1 << place, (high, axis.largest + 1))]
            self.options.append((name, self._stretches(axis, spans)))

    def _stretches(
        self, axis: Axis, spans: Sequence[tuple[int, tuple[Fraction, Fraction]]]
    ) -> dict[int, Fraction]:
        """Return the rules that may fire on each stretch of an axis, and a value."""
        result: dict[int, Fraction] = {}
        ends = {axis.low, axis.high, *(x for _, span in spans for x in span)}
        order = sorted(x for x in ends if axis.low <= x <= axis.high)
        places = [*axis.values] or [(a + b) / 2 for a, b in itertools.pairwise(order)]
        for x in places or [axis.low]:
            mask = self.every
            is_point = bool(axis.values) or axis.low == axis.high
            for users, (low, high) in spans:
                if low < x < high or (is_point and low <= x <= high):
                    mask &= ~users
            result.setdefault(mask, self._inside(axis, x))
        return result

    def _inside(self, axis: Axis, x: Fraction) -> Fraction:
        return Fraction(round(x)) if axis.is_whole else x

    def values(self, budget: Budget) -> dict[str, Fraction] | None:
        """Return a value for each axis, None if there are none."""
        budget.spend(10 * len(self.options))
        way = common([[*masks] for _, masks in self.options], self.every, budget)
        if way is None:
            return None
        pairs = zip(self.options, way, strict=True)
        return {name: masks[mask] for (name, masks), mask in pairs}


def _gap_by_solver(base: Base, beside: Sequence[Sides], budget: Budget) -> Answer:
    from fuzzytree.auditing.decide.solver import solver_for

    solver = solver_for(base, budget)
    if solver is None:
        return Open("axes share inputs; z3 might decide it", "FTD04")
    z3, number = solver.z3, solver.number
    no = z3.BoolVal(False, solver.context)

    def zero(name: str, literal: Literal) -> Iterator[Any]:
        """Yield where a literal is 0, without ends."""
        axis, x = base.axes[name], solver.values[name]
        for low, high in zeros(axis, literal, 1):
            if low == high or axis.values:
                yield z3.And(x >= number(low), x <= number(high))
            else:
                yield z3.And(
                    x > number(low if low > axis.low else low - 1),
                    x < number(high if high < axis.high else high + 1),
                )

    parts = [
        z3.Or(no, *(part for key in rule.literals for part in zero(*key)))
        for rule in base.rules
    ]
    for sides in beside:
        outside = [
            either
            for name, (low, high) in sides.items()
            for x in [solver.values[name]]
            for either in (x < number(low), x > number(high))
        ]
        parts.append(z3.Or(no, *outside))
    every = tuple(range(base.count))
    question = Question((), weak=every, level=ZERO)

    def holds(point: dict[str, Fraction]) -> bool:
        return question.holds(*base.strengths(point))

    return solver.ask_formula(z3.And(*parts), holds, budget, ())


def zeros(
    axis: Axis, literal: Literal, side: int
) -> tuple[tuple[Fraction, Fraction], ...]:
    """Return where a literal is 0, by its lower or its upper lines, with some width."""
    groups = [[*_zeros(axis, lines)] for lines in axis.parts[literal][side]]
    if literal.negated:
        return tuple(span for spans in groups for span in spans)
    result = groups[0]
    for spans in groups[1:]:
        both = itertools.product(result, spans)
        met = ((max(a, c), min(b, d)) for (a, b), (c, d) in both)
        result = [(a, b) for a, b in met if a < b or (a == b and axis.values)]
    return tuple(result)


def _zeros(axis: Axis, lines: Lines) -> Iterator[tuple[Fraction, Fraction]]:
    if axis.values or len(lines.x) == 1:
        yield from ((x, x) for x in axis.values or lines.x if value_at(lines, x) <= 0)
        return
    start: Fraction | None = None
    last = len(lines.x) - 2
    for k, (x, after) in enumerate(itertools.pairwise(lines.x)):
        if max(lines.after[k], lines.before[k]) > 0:
            continue
        if start is None:
            start = x
        is_end = k == last or lines.at[k + 1] > 0
        if is_end or max(lines.after[k + 1], lines.before[k + 1]) > 0:
            yield start, after
            start = None


_Step = tuple[Fraction, Fraction, Fraction, Fraction, Fraction]


def _extent(
    axis: Axis, lines: Lines, x: Fraction, level: Fraction
) -> tuple[Fraction, Fraction]:
    """Return the ends of a stretch around a value on which lines are below a level."""
    knots, last = axis.knots, len(axis.knots) - 1
    up = (
        (lines.after[k], lines.before[k], knots[k], knots[k + 1], lines.at[k + 1])
        for k in range(last)
        if x < knots[k + 1] <= axis.high
    )
    down = (
        (lines.before[k], lines.after[k], knots[k + 1], knots[k], lines.at[k])
        for k in reversed(range(last))
        if axis.low <= knots[k] < x
    )
    has_lines = not axis.values
    return (
        _end(x, down, level, has_lines=has_lines),
        _end(x, up, level, has_lines=has_lines),
    )


def _end(
    x: Fraction, steps: Iterable[_Step], level: Fraction, *, has_lines: bool
) -> Fraction:
    """Return how far one may go from a value: over lines, from knot to knot."""
    end = x
    for p, q, a, b, v in steps:
        if has_lines and a == end and not _is_low(p, level):
            return end
        if has_lines and not _is_low(q, level):
            return _before(a + (b - a) * (level - p) / (q - p), end)
        if not _is_low(v, level):
            return _before(b, end) if has_lines else end
        end = b
    return end


def _is_low(value: Fraction, level: Fraction) -> bool:
    return value < level or value <= 0


def _before(place: Fraction, start: Fraction) -> Fraction:
    """Return the last double before a place, on the way from another one."""
    near = Fraction(float(place))
    is_up = place > start
    while near >= place if is_up else near <= place:
        near = Fraction(math.nextafter(float(near), -math.inf if is_up else math.inf))
    return near if (near > start) is is_up else start


def _alone(base: Base, name: str, literal: Literal) -> Axis:
    """Return an axis with a single literal, whose knots are few."""
    return base.axes[name].with_literals(frozenset([literal]))


def around(base: Base, point: Mapping[str, Fraction], level: Fraction) -> Sides:
    """Return a box around a point in which each rule has a literal below a level.

    It has only sides that are needed; none if some rule has no such literal.
    """
    options: list[list[tuple[str, Literal]]] = []
    values = {name: base.value(axis, point) for name, axis in base.axes.items()}
    for rule in base.rules:
        some = [
            (name, literal)
            for name, literal in rule.literals
            if (
                v := value_at(
                    _alone(base, name, literal).bounds[literal].upper, values[name]
                )
            )
            < level
            or v <= 0
        ]
        if not some and rule.factor >= level and rule.factor > 0:
            return {}
        options.append(some)
    result: Sides = {}
    for some in sorted(filter(None, options), key=len):
        name, literal = next((key for key in some if key[0] in result), some[0])
        axis, x = _alone(base, name, literal), values[name]
        low, high = _extent(axis, axis.bounds[literal].upper, x, level)
        if x in axis.extra:
            low = high = x
        first, last = result.get(name, (low, high))
        result[name] = max(low, first), min(high, last)
    return result


def least_cover(claims: Claims, budget: Budget) -> tuple[Fraction, Fraction]:
    """Return bounds of the least strength that the strongest rule has anywhere."""
    base = claims.base
    every = tuple(range(base.count))
    ends: Sequence[Fraction] = ()
    if base.is_lattice and base.is_exact and not base.is_coupled:
        with suppress(TooManyError, OutOfStepsError):
            ends = LevelView(base, every, budget).levels
    if ends:
        marks = [*itertools.pairwise(ends)]
        first, last = 0, len(marks) - 1
        while first < last:  # the first stretch of levels below which there is a point
            middle = (first + last) // 2
            answer = claims.below(sum(marks[middle]) * _HALF, budget)
            if isinstance(answer, Open):
                return marks[first][0], marks[last][0]
            if isinstance(answer, Point):
                last = middle
            else:
                first = middle + 1
        if marks:
            is_top = first == len(marks) - 1
            if is_top and isinstance(
                claims.below(sum(marks[-1]) * _HALF, budget), Proved
            ):
                return marks[-1][1], marks[-1][1]
            return marks[first][0], marks[first][0]
    low, high = ZERO, ONE
    drawn = base.sample_strengths.max(axis=0, initial=0.0)  # of lines below the curves
    for number in drawn.argsort(kind="stable")[:_LOOKS].tolist():
        if base.contains(point := base.sample(number)):
            high = min(high, max(base.strengths(point)[1], default=ZERO))
    for _ in range(_HALVINGS):
        level = (low + high) / 2
        answer = claims.below(level, budget)
        if isinstance(answer, Open):
            break
        low, high = (low, level) if isinstance(answer, Point) else (level, high)
    return low, high
