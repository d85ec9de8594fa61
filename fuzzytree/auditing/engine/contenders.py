"""Which rules may win on a box: bounds of their strengths, and which beat which.

Two models have common axes: an input's name, or the summands of a combination. On a
stretch of an axis a proposition has bounds of its degree, from Bernstein coefficients
in fractions, and the number of a form: propositions of one form are the same function
there.

A rule is *beaten* on a box if another one is preferred to it wherever it fires there:
certainly stronger, or as strong and before it. At a point this is an order of the
rules, so the winner is never beaten.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.engine.pieces import (
    ONE,
    ZERO,
    PolynomialPiece,
    RuleCurve,
    piece_at,
    pieces,
)
from fuzzytree.auditing.engine.polynomials import (
    Polynomial,
    bernstein,
    composed,
    difference,
    roots,
)
from fuzzytree.model import Conjunction, Part, RuleBase, Shape, checkpoint, shapes_of
from fuzzytree.numerics import outwards

AxisKey = str | tuple[Part, ...]
"""What an axis is known by in any model: an input, or the summands of a combination."""

PropositionCurves = tuple[bool, tuple[Shape, ...]]
"""A proposition: whether it is negated, and the curves of which it is the largest, each
once and in an order that depends on nothing but them."""

PropositionNumber = tuple[int, int]
"""A proposition in a rule: the number of its axis, and its number there."""

Bounds = tuple[Fraction, Fraction]

NEVER, ALWAYS = 0, 1
"""The numbers of the forms that are 0 and 1 throughout."""

_MOST_CROSSED = 400  # pairs of pieces, of which crossings are looked for


class AxisPart(NamedTuple):
    """A part of an axis: `low < x <= high`, and `low` itself where it is closed."""

    low: Fraction
    high: Fraction
    is_closed: bool = False


class PropositionBounds(NamedTuple):
    """A proposition on a stretch."""

    form: int  # propositions of one form are equal at every point of the stretch
    low: float  # at most the degree
    high: float  # at least the degree
    is_below: bool = False  # whether the degree is below `high` at every point


class SharedAxis:
    """An axis with the propositions that two models ask of it."""

    def __init__(self, key: AxisKey, whole: AxisPart) -> None:
        self.key = key
        self.whole = whole
        self.propositions: dict[PropositionCurves, int] = {}
        self._forms: dict[object, int] = {NEVER: NEVER, ALWAYS: ALWAYS}
        self._known_bounds: dict[AxisPart, tuple[PropositionBounds, ...]] = {}
        self._above: dict[tuple[AxisPart, int, int], bool] = {}

    def number(self, proposition: PropositionCurves) -> int:
        """Return the number of a proposition, which is new or known."""
        return self.propositions.setdefault(proposition, len(self.propositions))

    def bounds_on(self, stretch: AxisPart) -> tuple[PropositionBounds, ...]:
        """Return every proposition on a stretch."""
        result = self._known_bounds.get(stretch)
        if result is None:
            result = tuple(
                self._see(proposition, stretch) for proposition in self.propositions
            )
            self._known_bounds[stretch] = result
        return result

    def _see(
        self, proposition: PropositionCurves, stretch: AxisPart
    ) -> PropositionBounds:
        checkpoint()
        is_negated, shapes = proposition
        parts = [_clipped(shape, stretch) for shape in shapes]
        bounds = [_bounds(part) for part in parts]
        low = max(one for one, _ in bounds)
        high = max(one for _, one in bounds)
        best = bounds.index(max(bounds))
        met = frozenset(
            part
            for k, (part, (_, most)) in enumerate(zip(parts, bounds, strict=True))
            if k == best or most > low
        )
        is_below = not is_negated and all(
            most < high or _falls_short(part, stretch)
            for part, (_, most) in zip(parts, bounds, strict=True)
        )
        if is_negated:
            low, high = 1 - high, 1 - low
        form: object = (is_negated, met)
        if low == high == 1:
            form = ALWAYS
        elif high == 0:
            form = NEVER
        elif low == high:
            form = low
        number = self._forms.setdefault(form, len(self._forms))
        return PropositionBounds(number, outwards(low)[0], outwards(high)[1], is_below)

    def is_above(self, one: int, other: int, stretch: AxisPart) -> bool:
        """Return whether one proposition is at least as true as another on a stretch.

        False where it is not known.
        """
        key = (stretch, one, other)
        if key not in self._above:
            proposition = list(self.propositions)
            self._above[key] = _proposition_is_above(
                proposition[one], proposition[other], stretch
            )
        return self._above[key]

    @functools.cached_property
    def edges(self) -> tuple[tuple[Fraction, ...], ...]:
        """Where the curves of each proposition begin or cease to be constant."""
        return tuple(
            self._inside(end for shape in curves for end in _edges(shape))
            for _, curves in self.propositions
        )

    @functools.cached_property
    def marks(self) -> tuple[Fraction, ...]:
        """Where a curve changes its formula or crosses another, within the whole."""
        shapes = list(
            dict.fromkeys(s for _, curves in self.propositions for s in curves)
        )
        result = {end for s in shapes for p in pieces(s) if (end := p.high) is not None}
        for one, other in itertools.combinations(shapes, 2):
            if len(pieces(one)) * len(pieces(other)) <= _MOST_CROSSED:
                result.update(_crossings(one, other, self.whole))
        return self._inside(result)

    def _inside(self, marks: Iterable[Fraction]) -> tuple[Fraction, ...]:
        low, high = self.whole.low, self.whole.high
        return tuple(sorted({mark for mark in marks if low <= mark < high}))


def _edges(shape: Shape) -> Iterator[Fraction]:
    for one, other in itertools.pairwise(pieces(shape)):
        is_edge = min(len(one.polynomial), len(other.polynomial)) == 1
        if is_edge and one.high is not None:
            yield one.high


def common_axes(
    models: Iterable[RuleBase], ends: Iterable[tuple[AxisKey, AxisPart]]
) -> tuple[tuple[SharedAxis, ...], list[list[tuple[PropositionNumber, ...]]]]:
    """Lay models on common axes.

    `ends`: the part of each axis that the models use.

    Returns:
        The axes; and for each model the propositions of each of its rules.
    """
    axes = [SharedAxis(key, whole) for key, whole in ends]
    places = {axis.key: place for place, axis in enumerate(axes)}
    rules: list[list[tuple[PropositionNumber, ...]]] = []
    for model in models:
        keys = {v.name: v.parts or v.name for v in model.variables}
        shapes = shapes_of(model.variables)
        rules.append([])
        for rule in model.rules:
            when: list[PropositionNumber] = []
            for proposition in rule.when:
                place = places[keys[proposition.variable]]
                curves = {shapes[proposition.variable, t] for t in proposition.terms}
                curves_of = (proposition.negated, tuple(sorted(curves, key=repr)))
                when.append((place, axes[place].number(curves_of)))
            rules[-1].append(tuple(when))
    return tuple(axes), rules


class ClippedPiece(NamedTuple):
    """A piece of a curve, ended by a stretch: on `low <= x <= high`."""

    low: Fraction
    high: Fraction
    polynomial: Polynomial
    cap: Fraction


def _clipped(shape: Shape, stretch: AxisPart) -> tuple[ClippedPiece, ...]:
    """Return a curve's pieces on a stretch, those of equal formulas joined."""
    result: list[ClippedPiece] = []
    if stretch.is_closed:
        piece = piece_at(pieces(shape), stretch.low)
        if stretch.low == stretch.high or piece.high == stretch.low:
            degree = piece.degree(stretch.low)
            result.append(ClippedPiece(stretch.low, stretch.low, (degree,), ONE))
    for part in _parts(pieces(shape), stretch):
        last = result[-1] if result else None
        if last and last[2:] == part[2:]:
            result[-1] = last._replace(high=part.high)
        else:
            result.append(part)
    return tuple(result)


def _parts(
    parts: Iterable[PolynomialPiece], stretch: AxisPart
) -> Iterator[ClippedPiece]:
    for piece in parts:
        low = stretch.low if piece.low is None else max(piece.low, stretch.low)
        high = stretch.high if piece.high is None else min(piece.high, stretch.high)
        if low >= high:
            continue
        least, most = spread(piece.polynomial, low, high)
        if most <= 0:
            yield ClippedPiece(low, high, (ZERO,), ONE)
        elif least >= piece.cap:
            yield ClippedPiece(low, high, (piece.cap,), ONE)
        else:
            # A cap that is not reached makes no difference.
            cap = ONE if most <= piece.cap else piece.cap
            yield ClippedPiece(low, high, difference(piece.polynomial, (ZERO,)), cap)


def _falls_short(parts: tuple[ClippedPiece, ...], stretch: AxisPart) -> bool:
    """Return whether a curve reaches its upper bound nowhere but at an open low end."""
    _, high = _bounds(parts)
    first, *others = parts
    if (
        stretch.is_closed
        or first.low == first.high
        or _bounds(tuple(others))[1] == high
    ):
        return False
    start, *rest = _bends(first.polynomial, first.low, first.high)
    return start <= first.cap and bool(rest) and max(rest) < start


def _bounds(parts: tuple[ClippedPiece, ...]) -> Bounds:
    low, high = ONE, ZERO
    for part in parts:
        least, most = spread(part.polynomial, part.low, part.high)
        low = min(low, max(least, ZERO), part.cap)
        high = max(high, min(max(most, ZERO), part.cap))
    return low, high


def spread(polynomial: Polynomial, low: Fraction, high: Fraction) -> Bounds:
    """Return two numbers between which a polynomial stays on a closed interval.

    They are the least and the largest Bernstein coefficient: exact for lines, and
    wherever the largest and least value lie at the ends.

    Example:
        >>> [str(one) for one in spread((ZERO, ZERO, ONE), -ONE, ONE)]
        ['-1', '1']
    """
    bends = _bends(polynomial, low, high)
    return min(bends), max(bends)


@functools.lru_cache(maxsize=1 << 15)
def _bends(
    polynomial: Polynomial, low: Fraction, high: Fraction
) -> tuple[Fraction, ...]:
    """Return the Bernstein coefficients; the first is the value at the low end."""
    if len(polynomial) == 1:
        return polynomial
    if len(polynomial) == 2:
        constant, slope = polynomial
        return constant + slope * low, constant + slope * high
    return bernstein(composed(polynomial, low, high - low))


def _proposition_is_above(
    one: PropositionCurves, other: PropositionCurves, stretch: AxisPart
) -> bool:
    if one[0] != other[0]:
        return False
    uppers, lowers = (other[1], one[1]) if one[0] else (one[1], other[1])
    return all(
        any(_curve_is_above(upper, lower, stretch) for upper in uppers)
        for lower in lowers
    )


def _curve_is_above(upper: Shape, lower: Shape, stretch: AxisPart) -> bool:
    at = stretch.low
    if stretch.is_closed and RuleCurve(upper).degree(at) < RuleCurve(lower).degree(at):
        return False
    return all(_piece_is_above(*both) for both in _overlaps(upper, lower, stretch))


def _overlaps(
    one: Shape, other: Shape, stretch: AxisPart
) -> Iterator[tuple[ClippedPiece, ClippedPiece, Fraction, Fraction]]:
    """Yield the pieces of two curves that meet on a stretch, with where they do."""
    parts = _clipped(one, stretch), _clipped(other, stretch)
    for first, second in itertools.product(*parts):
        low, high = max(first.low, second.low), min(first.high, second.high)
        if low < high:
            yield first, second, low, high


def _crossings(one: Shape, other: Shape, stretch: AxisPart) -> Iterator[Fraction]:
    """Yield a point at, or beside, each crossing of two curves within a stretch."""
    for first, second, low, high in _overlaps(one, other, stretch):
        gap = difference(first.polynomial, second.polynomial)
        for root in roots(gap, low, high) if len(gap) > 1 else ():
            is_exact = root.low == root.high
            yield root.low if is_exact else Fraction(float(root.low))


def _piece_is_above(
    above: ClippedPiece, below: ClippedPiece, low: Fraction, high: Fraction
) -> bool:
    _, most = spread(below.polynomial, low, high)
    if most <= 0:
        return True
    least, _ = spread(above.polynomial, low, high)
    if min(least, above.cap) >= min(most, below.cap):
        return True
    if above.cap < below.cap and most > above.cap:
        return False
    gap, _ = spread(difference(above.polynomial, below.polynomial), low, high)
    return gap >= 0


# --- rules on a box

Box = tuple[AxisPart, ...]
"""A stretch of each axis."""

_MOST_PAIRED = 12  # rules that may win, of which each two are compared


class Contender(NamedTuple):
    """A rule on a box."""

    then: str  # its class
    # the forms of its propositions that say something; rules of equal forms are equally
    # strong at every point of the box
    form: tuple[PropositionNumber, ...]
    propositions: tuple[PropositionNumber, ...]  # these propositions
    # the least and the largest degree of each
    bounds: Mapping[PropositionNumber, tuple[float, float]]
    low: float  # at most its strength
    high: float  # at least its strength
    is_below: bool  # whether its strength is below `high` at every point
    place: int  # where it stands among the rules


class Remainder(NamedTuple):
    """What is left of a rule base on a box."""

    rules: list[Contender]  # those that may win, in order
    is_sure: bool  # whether some rule fires at every point
    margin: float  # at least the largest margin of the strongest class


def contenders_on(
    rules: RuleBase,
    proposition: Sequence[tuple[PropositionNumber, ...]],
    axes: Sequence[SharedAxis],
    box: Box,
    among: Iterable[int] | None = None,
) -> Remainder:
    """Return which rules may win on a box.

    `among`: the places of the rules that may win on a box around this one, in order;
    all unless given.
    """
    conjunction = rules.semantics.conjunction
    bounds = [axis.bounds_on(s) for axis, s in zip(axes, box, strict=True)]
    items: list[Contender] = []
    for place in range(len(proposition)) if among is None else among:
        checkpoint()
        then = rules.rules[place].then
        result = _on_box(then, proposition[place], bounds, conjunction, place)
        if result is not None and result.high > 0.0:
            items.append(result)
    top = max((rule.low for rule in items), default=0.0)
    first = next((rule.place for rule in items if rule.low == top), 0)
    may_win = [
        rule
        for rule in items
        if rule.high > top
        or (rule.high == top and rule.place <= first and not rule.is_below)
    ]
    if len(may_win) <= _MOST_PAIRED:
        may_win = [
            rule
            for rule in may_win
            if not any(
                _beats(other, rule, axes, box, conjunction)
                for other in may_win
                if other is not rule
            )
        ]
    else:
        may_win = _first_of_equals(may_win)
    margin = _margin(items)
    if len(may_win) <= _MOST_PAIRED:
        margin = min(margin, _paired_margin(may_win, conjunction))
    return Remainder(may_win, top > 0.0, margin)


def _on_box(
    then: str,
    propositions: tuple[PropositionNumber, ...],
    known: Sequence[Sequence[PropositionBounds]],
    conjunction: Conjunction,
    place: int,
) -> Contender | None:
    """Return a rule on a box, None if it never fires there."""
    form: list[PropositionNumber] = []
    kept: list[PropositionNumber] = []
    bounds: dict[PropositionNumber, tuple[float, float]] = {}
    short: list[float] = []
    for axis, number in propositions:
        kind, low, high, is_short = known[axis][number]
        if kind == NEVER:
            return None
        if kind == ALWAYS or (conjunction == "minimum" and (axis, kind) in form):
            continue
        form.append((axis, kind))
        kept.append((axis, number))
        bounds[axis, number] = (low, high)
        short.append(high if is_short else 2.0)
    lows = [bounds[proposition][0] for proposition in kept]
    highs = [bounds[proposition][1] for proposition in kept]
    high = _joined(highs, conjunction, up=True)
    return Contender(
        then,
        tuple(form),
        tuple(kept),
        bounds,
        _joined(lows, conjunction, up=False),
        high,
        high in short,
        place,
    )


def _joined(degrees: Sequence[float], conjunction: Conjunction, *, up: bool) -> float:
    """Return a bound of a strength; each product is moved outwards by its rounding."""
    lowest = min(degrees, default=1.0)
    if conjunction == "minimum" or len(degrees) < 2:
        return lowest
    result = 1.0
    for degree in degrees:
        result = math.nextafter(result * degree, math.inf if up else -math.inf)
    return min(result, lowest) if up else max(result, 0.0)


def _beats(
    one: Contender,
    other: Contender,
    axes: Sequence[SharedAxis],
    box: Box,
    conjunction: Conjunction,
) -> bool:
    """Return whether one rule is preferred to another wherever that one fires.

    Propositions that both have cancel. Of two rules at most one is found to beat the
    other, so the winner at a point is never left out.
    """
    if conjunction == "product" and not (_is_plain(one) and _is_plain(other)):
        return False
    mine, theirs, shared = _split(one, other)
    common = min((one.bounds[c][1] for c in shared), default=1.0)
    least = _joined([one.bounds[c][0] for c in mine], conjunction, up=False)
    most = _joined([other.bounds[c][1] for c in theirs], conjunction, up=True)
    if one.place < other.place:
        if conjunction == "minimum":
            most = min(most, common)
        return least >= most or _is_above(mine, theirs, axes, box, conjunction)
    floor = min((one.bounds[c][0] for c in shared), default=1.0)
    return least > most and (conjunction == "product" or floor > most)


def _is_above(
    mine: Sequence[PropositionNumber],
    theirs: Sequence[PropositionNumber],
    axes: Sequence[SharedAxis],
    box: Box,
    conjunction: Conjunction,
) -> bool:
    """Return whether each of some propositions has one of others below it."""
    checkpoint()
    free = list(theirs)
    for axis, proposition in mine:
        below = next(
            (
                (place, number)
                for place, number in free
                if place == axis and axes[axis].is_above(proposition, number, box[axis])
            ),
            None,
        )
        if below is None:
            return False
        if conjunction == "product":
            free.remove(below)
    return True


def _is_plain(rule: Contender) -> bool:
    """Return whether no two propositions of a rule have one form."""
    return len({*rule.form}) == len(rule.form)


def _split(
    one: Contender, other: Contender
) -> tuple[list[PropositionNumber], list[PropositionNumber], list[PropositionNumber]]:
    """Return the propositions of one rule alone, of the other alone, and of both."""
    mine = dict(zip(one.form, one.propositions, strict=True))
    theirs = dict(zip(other.form, other.propositions, strict=True))
    return (
        [c for f, c in mine.items() if f not in theirs],
        [c for f, c in theirs.items() if f not in mine],
        [c for f, c in mine.items() if f in theirs],
    )


def _paired_margin(rules: Sequence[Contender], conjunction: Conjunction) -> float:
    """Return at least the largest margin, by the rules that may win taken in pairs."""
    return max(
        (
            min(
                (_gap(one, q, conjunction) for q in rules if q.then != one.then),
                default=one.high,
            )
            for one in rules
        ),
        default=0.0,
    )


def _gap(one: Contender, other: Contender, conjunction: Conjunction) -> float:
    """Return at least how much stronger one rule is than another.

    What both share is at most 1 under the product, and under the minimum it brings
    no two numbers further apart; so it can be left out.
    """
    if not (_is_plain(one) and _is_plain(other)):
        return max(one.high - other.low, 0.0)
    mine, theirs, _ = _split(one, other)
    most = _joined([one.bounds[c][1] for c in mine], conjunction, up=True)
    least = _joined([other.bounds[c][0] for c in theirs], conjunction, up=False)
    return max(math.nextafter(min(most - least, one.high - other.low), math.inf), 0.0)


def _first_of_equals(rules: Sequence[Contender]) -> list[Contender]:
    """Return rules without those that are as strong as an earlier one everywhere."""
    kept: dict[object, Contender] = {}
    for rule in rules:
        kept.setdefault(tuple(sorted(rule.form)), rule)
    return list(kept.values())


def _margin(rules: Sequence[Contender]) -> float:
    """Return at least the largest margin of the strongest class on a box."""
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    for rule in rules:
        low[rule.then] = max(low.get(rule.then, 0.0), rule.low)
        high[rule.then] = max(high.get(rule.then, 0.0), rule.high)
    return max(
        (
            most - max((low[other] for other in low if other != label), default=0.0)
            for label, most in high.items()
        ),
        default=0.0,
    )


def same_contenders(
    one: Remainder, other: Remainder, conjunctions: Sequence[Conjunction]
) -> bool:
    """Return whether the same rules are left of both, in an order that says the same.

    The order of neighbours of one class says nothing.
    """
    first, second = (
        [
            (then, frozenset(_strength(rule, conjunction) for rule in run))
            for then, run in itertools.groupby(left.rules, lambda rule: rule.then)
        ]
        for left, conjunction in zip((one, other), conjunctions, strict=True)
    )
    return first == second


def _strength(rule: Contender, conjunction: Conjunction) -> object:
    """Return what is equal for rules of equal strength at every point of a box."""
    if len(rule.form) < 2:
        return rule.form
    return conjunction, tuple(sorted(rule.form))
