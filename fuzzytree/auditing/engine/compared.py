"""Two rules compared, axis by axis: is one never weaker, how far apart, do they meet?

Under the minimum a rule is weaker than another one somewhere exactly if it is so on one
axis, at a degree that the other one exceeds on all other axes. Under the product the
ratio of two strengths is the product of the ratios on the axes. Both are worked out for
each pair of degrees on an axis and kept, and hold for axes that are free of each other;
where inputs are shared, `always` still does.
"""

from __future__ import annotations

import functools
import itertools
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Final, Literal, NamedTuple

import numpy as np

from fuzzytree.auditing.decide.lines import Lines, at_knots, together
from fuzzytree.auditing.engine.arrangement import Arrangement, strengths_at
from fuzzytree.auditing.engine.bounding import highest_by_boxes
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import contains
from fuzzytree.auditing.engine.levels import (
    LevelAxis,
    Levels,
    Propositions,
    Sides,
    Tries,
    bits,
    first_accepted,
    levels_of,
    runs,
)
from fuzzytree.auditing.engine.measures import Bounds, largest_gap
from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    Span,
    State,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import AxisStretch, point_with
from fuzzytree.model import BoolArray, FloatArray, checkpoint
from fuzzytree.numerics import outwards

Dominance = Literal["always", "not", "open"]
"""It holds everywhere, it does not, or it is too near to tell."""

_HALVINGS: Final = 20
_CLOSE: Final = Fraction(1, 10**6)


class JointMaximum(NamedTuple):
    """The highest level that two rules reach at one point, and how it is known."""

    level: Bounds
    state: State


class RuleDistance(NamedTuple):
    """How far two rules' degrees are apart at most."""

    each: Bounds  # on one axis, where that is most
    whole: Fraction  # of strengths, from above
    axis: int  # where that is, by number
    at: Fraction  # its value there


class _Infimum(NamedTuple):
    """A number that some values come as near to as one likes, from above."""

    value: Fraction
    is_reached: bool  # whether it is one of them


class RulePairs:
    """The rules of an arrangement, ready to be compared two by two.

    Attributes:
        base: The rules and the box, which is not empty.
    """

    def __init__(self, base: Arrangement) -> None:
        self.base = base

    @functools.cached_property
    def levels(self) -> Levels:
        """The rules on their axes."""
        return levels_of(self.base)

    @property
    def is_product(self) -> bool:
        """Whether degrees are multiplied."""
        return self.base.rules.semantics.conjunction == "product"

    @functools.cached_property
    def _kept(self) -> dict[object, object]:
        return {}

    def _once(self, key: object, make: Callable[[], object]) -> object:
        if key not in self._kept:
            checkpoint()
            self._kept[key] = make()
        return self._kept[key]

    # --- does a rule fire

    @functools.cached_property
    def fires(self) -> BoolArray:
        """Whether each rule may fire anywhere, if axes are free; shape (rules,)."""
        count = len(self.base.rules.rules)
        return np.array([self._top(rule) > 0 for rule in range(count)], dtype=bool)

    def _top(self, rule: int) -> Fraction:
        """Return what a rule does not exceed."""

        def made() -> Fraction:
            tops = (axis.function(rule).upper.highest for axis in self.levels.axes)
            return functools.reduce(self._and, tops, ONE)

        return self._once(("top", rule), made)  # type: ignore[return-value]

    def _and(self, one: Fraction, other: Fraction) -> Fraction:
        return one * other if self.is_product else min(one, other)

    # --- is a rule nowhere weaker, or stronger, than another one

    def never_weaker(self, strong: int, weak: int) -> Dominance:
        """Return whether a rule is nowhere weaker than another one."""
        return self._compared(strong - 1, weak - 1, is_strict=False)

    def above(self, strong: int, weak: int) -> Dominance:
        """Return whether a rule is stronger than another wherever that fires."""
        return self._compared(strong - 1, weak - 1, is_strict=True)

    def _compared(self, strong: int, weak: int, *, is_strict: bool) -> Dominance:
        if not self.levels.axes:
            return "not" if is_strict else "always"
        decide = self._by_ratios if self.is_product else self._by_orders
        if decide(strong, weak, is_strict, is_sure=True):
            return "always"
        if self.is_multiple(strong, weak):
            return "open"
        if self.levels.is_exact:
            return "not"
        return "open" if decide(strong, weak, is_strict, is_sure=False) else "not"

    def is_multiple(self, *rules: int) -> bool:
        """Return whether rules, by position, have several factors on an axis."""
        return self.is_product and any(
            len(axis.propositions[rule]) > 1
            for axis in self.levels.axes
            for rule in rules
        )

    def _by_orders(
        self, strong: int, weak: int, is_strict: bool, *, is_sure: bool
    ) -> bool:
        """Return whether a rule is nowhere weaker, or no stronger, on any axis."""
        if self._top(weak) <= 0:
            return True
        for number, axis in enumerate(self.levels.axes):
            mine, theirs = axis.propositions[strong], axis.propositions[weak]
            if not is_strict and set(mine) <= set(theirs):
                continue
            lowest = self._lowest(axis, (strong, weak), is_strict, is_sure)
            if lowest is None:
                continue
            most, is_reached = self._rest(weak, number)
            if lowest.value < most or (
                is_strict and lowest == (most, True) and is_reached
            ):
                return False
        return True

    def _rest(self, rule: int, but: int) -> tuple[Fraction, bool]:
        """Return a rule's supremum on all other axes, and whether it is reached."""
        most, is_reached = ONE, True
        for number, axis in enumerate(self.levels.axes):
            if number == but:
                continue
            lines = axis.function(rule).upper
            top = lines.highest
            here = top in self._values(axis, lines)
            if top < most:
                most, is_reached = top, here
            elif top == most:
                is_reached &= here
        return most, is_reached

    def _values(self, axis: LevelAxis, lines: Lines) -> set[Fraction]:
        """Return the values that lines reach at knots, or keep along a line."""
        flat = {p for _, _, p, q in lines.pieces() if p == q}
        return {*lines.at[axis.is_open :], *flat}

    def _lowest(
        self, axis: LevelAxis, rules: tuple[int, int], is_strict: bool, is_sure: bool
    ) -> _Infimum | None:
        """Return the infimum of a rule's degree where it is below another's.

        Or where it is not above the other, which is above 0, if strict. Where degrees
        are enclosed, the first counts from below and the second from above, if sure.
        """
        strong, weak = rules
        key = (
            axis.propositions[strong],
            axis.propositions[weak],
            is_strict,
            is_sure,
            id(axis),
        )

        def made() -> _Infimum | None:
            one, other = axis.function(strong), axis.function(weak)
            mine = one.lower if is_sure else one.upper
            theirs = other.upper if is_sure else other.lower
            test = _is_no_stronger if is_strict else operator.lt
            return _least(_values_where(axis, mine, theirs, test))

        return self._once(key, made)  # type: ignore[return-value]

    def _by_ratios(
        self, strong: int, weak: int, is_strict: bool, *, is_sure: bool
    ) -> bool:
        if self._top(weak) <= 0:
            return True
        least, is_reached = ONE, True
        for axis in self.levels.axes:
            mine, theirs = _without_common(
                axis.propositions[strong], axis.propositions[weak]
            )
            if len(mine) > 1 or len(theirs) > 1:
                return False
            ratio = self._ratio(axis, (mine, theirs), is_sure)
            if ratio is None:
                return True
            least *= ratio.value
            is_reached &= ratio.is_reached
        return least > 1 or (least == 1 and not (is_strict and is_reached))

    def _ratio(
        self, axis: LevelAxis, of: tuple[Propositions, Propositions], is_sure: bool
    ) -> _Infimum | None:
        """Return the infimum of a degree by another; None if the other is never > 0."""

        def made() -> _Infimum | None:
            one, other = map(axis.function_of, of)
            mine = one.lower if is_sure else one.upper
            theirs = other.upper if is_sure else other.lower
            return _least(_ratios(axis, mine, theirs))

        return self._once((*of, is_sure, id(axis)), made)  # type: ignore[return-value]

    # --- how far are they apart

    def distance(self, one: int, other: int, most: Fraction) -> RuleDistance | None:
        """Return how far two rules are apart, None if it is more than `most`.

        Under the minimum strengths differ by at most the largest distance on an axis,
        under the product by at most the sum of them.
        """
        each, whole, result = Bounds(ZERO, ZERO), ZERO, (0, ZERO)
        if self.levels.axes:
            result = 0, self.levels.axes[0].ends[0]
        for number, axis in enumerate(self.levels.axes):
            pair = sorted((axis.propositions[one - 1], axis.propositions[other - 1]))
            if pair[0] == pair[1] or (
                self.is_product and sorted(pair[0]) == sorted(pair[1])
            ):
                continue
            if self.is_product and max(map(len, pair)) > 1:
                return None  # not worked out
            gap, at = self._gap(axis, one - 1, other - 1)
            if gap.low > most:
                return None
            if gap.high > each.high:
                each, result = gap, (number, at)
            whole = whole + gap.high if self.is_product else max(whole, gap.high)
        return RuleDistance(each, whole, *result)

    def _gap(self, axis: LevelAxis, one: int, other: int) -> tuple[Bounds, Fraction]:
        key = "gap", id(axis), axis.propositions[one], axis.propositions[other]
        made = self._once(
            key, lambda: largest_gap(axis.function(one), axis.function(other))
        )
        return made  # type: ignore[return-value]

    # --- may they tie

    @functools.cached_property
    def may_tie(self) -> BoolArray:
        """Which pairs may be equally strong, and not 0, on an open set of a box.

        Both are as one line, or as one curve, on one axis; or both are constant.
        Shape (rules, rules), symmetric; axes are treated as free.
        """
        count = len(self.base.rules.rules)
        result: BoolArray = np.zeros((count, count), dtype=bool)
        for one in range(count):
            for other in range(one):
                result[one, other] = result[other, one] = self._may_tie(one, other)
        return result

    def _may_tie(self, one: int, other: int) -> bool:
        axes = self.levels.axes
        meet = [self._meeting(axis, one, other)[0] for axis in axes]
        highest = min(meet, default=ONE)
        if highest <= 0:
            return False
        flat = self._constants(one) & self._constants(other)
        if any(0 < level <= highest for level in flat):
            return True
        for number, axis in enumerate(axes):
            low = self._least_shared(axis, one, other)
            rest = (top for place, top in enumerate(meet) if place != number)
            if low is not None and min(rest, default=ONE) > low:
                return True
        return False

    def _constants(self, rule: int) -> set[Fraction]:
        """Return the degrees that a rule keeps along a part of some axis."""

        def made() -> set[Fraction]:
            result: set[Fraction] = set()
            for axis in self.levels.axes:
                lines = axis.function(rule)
                if lines.is_exact:
                    result |= {p for _, _, p, q in lines.lower.pieces() if p == q}
                    result |= {*lines.lower.at} if len(lines.lower.x) == 1 else set()
            return result or {ONE}

        return self._once(("constants", rule), made)  # type: ignore[return-value]

    def _least_shared(self, axis: LevelAxis, one: int, other: int) -> Fraction | None:
        """Return the least degree of parts where both are the same rising line."""
        mine, theirs = axis.propositions[one], axis.propositions[other]

        def made() -> Fraction | None:
            f, g = axis.function_of(mine), axis.function_of(theirs)
            if not (f.is_exact and g.is_exact):
                return ZERO if {*mine} & {*theirs} else None
            ends = (
                min(p, q)
                for _, _, p, q, r, s in together(f.lower, g.lower)
                if p == r and q == s and p != q
            )
            return min(ends, default=None)

        key = "shared", id(axis), mine, theirs
        return self._once(key, made)  # type: ignore[return-value]

    def alike(
        self, one: int, other: int, most: int
    ) -> list[dict[int, AxisStretch]] | None:
        """Return boxes of the axes on which two products are one function, not 0.

        None if there are more than `most`, or they are not worked out.
        """
        boxes: list[tuple[dict[int, AxisStretch], Fraction]] = [({}, ONE)]
        for number, axis in enumerate(self.levels.axes):
            parts = _proportions(axis, one - 1, other - 1)
            if parts is None:
                return None
            boxes = [
                (box | {number: part}, whole * ratio)
                for box, whole in boxes
                for part, ratio in parts
            ]
            if len(boxes) > most:
                return None
        return [box for box, whole in boxes if whole == 1]

    # --- where do they meet

    def joint_bounds(self, one: int) -> FloatArray:
        """Return bounds from above of the levels that a rule reaches with each other.

        Returns:
            Shape (rules,). Under the minimum they are the levels themselves, but for
            rounding upwards, where degrees are known exactly.
        """
        count = len(self.base.rules.rules)
        return np.array(
            [outwards(self._joint(one - 1, other))[1] for other in range(count)]
        )

    def _joint(self, one: int, other: int) -> Fraction:
        highest, mean = ONE, ONE
        for axis in self.levels.axes:
            least, half = self._meeting(axis, one, other)
            highest, mean = min(highest, least), mean * half
        if not self.is_product:
            return highest
        return min(highest, mean, self._top(one), self._top(other))

    def _meeting(
        self, axis: LevelAxis, one: int, other: int
    ) -> tuple[Fraction, Fraction]:
        """Return the suprema of the smaller of two degrees and of their mean."""
        key = (
            "joint",
            id(axis),
            *sorted((axis.propositions[one], axis.propositions[other])),
        )

        def made() -> tuple[Fraction, Fraction]:
            f, g = axis.function(one).upper, axis.function(other).upper
            ends = [(p, r) for _, p, r in at_knots(f, g)]
            for _, _, p, q, r, s in together(f, g):
                ends += [(p, r), (q, s)]
                if (p - r) * (q - s) < 0:
                    value = p + (q - p) * (p - r) / (p - r - q + s)
                    ends.append((value, value))
            return max(map(min, ends)), max(p + r for p, r in ends) / 2

        return self._once(key, made)  # type: ignore[return-value]

    def joint_maximum(
        self, one: int, other: int, level: Fraction, clock: Clock | None = None
    ) -> JointMaximum:
        """Return the highest level that two rules reach at one point.

        `level`: A witness must reach at least this.
        """
        clock = clock or Clock()
        high = self._joint(one - 1, other - 1)
        name = f"the highest level that rules {one} and {other} both reach"
        if high < level:
            why = "no point is sought below the level"
            return JointMaximum(
                Bounds(ZERO if self.is_product else high, high),
                Bracket(name, 0.0, outwards(high)[1], why),
            )
        if self.is_product:
            return self._by_boxes((one, other), level, high, clock)
        try:
            return self._by_levels((one, other), level, high, clock)
        except OutOfTimeError:
            why = "the budget was spent"
            state = Bracket(name, 0.0, outwards(high)[1], why)
            return JointMaximum(Bounds(ZERO, high), state)

    def _by_levels(
        self, rules: tuple[int, int], level: Fraction, high: Fraction, clock: Clock
    ) -> JointMaximum:
        goals = [high, high - (high - level) / 2**40, level]
        if self.levels.joined or not self.levels.is_exact:
            goals = [high, level]
        for goal in dict.fromkeys(goals):
            witness, is_never = self._reaching(rules, goal, level, clock)
            if witness is None:
                if goal == level and is_never:
                    how = f"{float(level)!r} is reached by no values of the inputs"
                    return JointMaximum(Bounds(ZERO, level), Proved(how))
                continue
            low = _reached(witness)
            if self.levels.joined or not self.levels.is_exact:
                witness, low = self._raised(rules, witness, (high, level), clock)
                return JointMaximum(Bounds(low, high), witness)
            return JointMaximum(Bounds(high, high), witness)
        why = "the inputs of their variables depend on each other"
        if not self.levels.is_exact:
            why = "their degrees are enclosed, and no point there reaches the level"
        name = "the highest level that rules {} and {} both reach".format(*rules)
        bracket = Bracket(name, 0.0, outwards(high)[1], why)
        return JointMaximum(Bounds(ZERO, high), bracket)

    def _raised(
        self,
        rules: tuple[int, int],
        witness: Witness,
        between: tuple[Fraction, Fraction],
        clock: Clock,
    ) -> tuple[Witness, Fraction]:
        """Return a witness at a higher level, if one is found."""
        high, level = between
        low = _reached(witness)
        for _ in range(_HALVINGS):
            if high - low < _CLOSE:
                break
            goal = (low + high) / 2
            try:
                result, _ = self._reaching(rules, goal, level, clock)
            except OutOfTimeError:
                break
            if result is None or _reached(result) <= low:
                high = goal
            else:
                witness, low = result, _reached(result)
        return witness, low

    def _reaching(
        self, rules: tuple[int, int], goal: Fraction, level: Fraction, clock: Clock
    ) -> tuple[Witness | None, bool]:
        """Return a point where both reach a goal, and whether surely none does."""
        mine = bits(rules)
        is_never = True
        for is_sure in (True, False):
            every: list[list[tuple[AxisStretch, int]]] = []
            for axis in self.levels.axes:
                cells = axis.cells(goal, goal, is_sure=is_sure, has_points=True)
                every.append(runs((c.part, 0) for c in cells if not mine & ~c.reach))
            some = self.levels.selections(every, 0, Tries(clock))
            accept = functools.partial(self._checked, rules, level=level)
            found, is_any = first_accepted(self.base, itertools.islice(some, 1), accept)
            if found is not None:
                return found, False
            is_never &= not is_any
            if self.levels.is_exact:
                break
        return None, is_never

    def _checked(
        self, rules: tuple[int, int], point: Mapping[str, Fraction], level: Fraction
    ) -> Witness | None:
        base = self.base
        strengths = strengths_at(base, point)
        reached = min(strengths[rule - 1] for rule in rules)
        if reached < level or not contains(base.domain, base.rules.variables, point):
            return None
        region: tuple[Span, ...] = ()
        if not self.is_product:
            region = self.levels.region(point, Sides(bits(rules), 0), level)
        weakest = min(rules, key=lambda rule: strengths[rule - 1])
        claims = (
            Claim("reaches", rules=rules, level=str(level)),  # on all of the region
            Claim("strength", rules=(weakest,), level=str(reached)),
        )
        return Witness(coordinates(point), claims, region)

    def _by_boxes(
        self, rules: tuple[int, int], level: Fraction, high: Fraction, clock: Clock
    ) -> JointMaximum:
        base = self.base
        best = {
            number: AxisStretch(x, x, is_open=False)
            for number, axis in enumerate(self.levels.axes)
            for x in [_meeting_place(axis, *rules)]
        }
        point = point_with(base, best)
        witness = None if point is None else self._checked(rules, point, level)
        if witness is not None and _reached(witness) == high:
            return JointMaximum(Bounds(high, high), witness)
        for tolerance in (float(_CLOSE), 1e-12):
            found = highest_by_boxes(
                base.rules, base.domain, *rules, clock, tolerance=tolerance
            )
            if not found.low < level <= found.high:
                break  # it is known whether they reach the level
        most = max(min(high, Fraction(found.high)), Fraction(found.low))
        tried = (
            self._checked(rules, point_of(found.point), level) if found.point else None
        )
        known = [one for one in (tried, witness) if one is not None]
        if not known:
            return JointMaximum(Bounds(Fraction(found.low), most), found)
        witness = max(known, key=_reached)
        low = _reached(witness)
        return JointMaximum(Bounds(low, max(low, most)), witness)


def _reached(witness: Witness) -> Fraction:
    """Return the smaller of both strengths at a witness, which it claims last."""
    return Fraction(witness.claims[-1].level or 0)


def _without_common(
    one: Propositions, other: Propositions
) -> tuple[Propositions, Propositions]:
    """Return two products without the factors that they share."""
    mine, theirs = [*one], [*other]
    for group in one:
        if group in theirs:
            mine.remove(group)
            theirs.remove(group)
    return tuple(mine), tuple(theirs)


# --- two functions on one axis


def _meeting_place(axis: LevelAxis, one: int, other: int) -> Fraction:
    """Return where the smaller of two rules' degrees is largest, or nearly so."""
    f, g = axis.function(one - 1).lower, axis.function(other - 1).lower
    places = [(min(p, r), x) for x, p, r in at_knots(f, g)]
    for a, b, p, q, r, s in together(f, g):
        if (p - r) * (q - s) < 0:
            share = (p - r) / (p - r - q + s)
            places.append((p + (q - p) * share, a + (b - a) * share))
    return max(places)[1]


def _least(values: Iterable[_Infimum]) -> _Infimum | None:
    least: _Infimum | None = None
    for one in values:
        if least is None or one.value < least.value:
            least = one
        elif one.value == least.value:
            least = _Infimum(one.value, one.is_reached or least.is_reached)
    return least


def _reached_values(
    axis: LevelAxis, one: Lines, other: Lines
) -> Iterator[tuple[Fraction, Fraction]]:
    """Yield the values of two functions at all knots that belong to an axis."""
    for number, (_, value, rival) in enumerate(at_knots(one, other)):
        if number or not axis.is_open:
            yield value, rival


def _is_no_stronger(one: Fraction, other: Fraction) -> bool:
    return one <= other and other > 0


def _values_where(
    axis: LevelAxis,
    one: Lines,
    other: Lines,
    test: Callable[[Fraction, Fraction], bool],
) -> Iterator[_Infimum]:
    """Yield infima of a function where it passes a test against another one."""
    for value, rival in _reached_values(axis, one, other):
        if test(value, rival):
            yield _Infimum(value, True)
    for _, _, p, q, r, s in together(one, other):
        middle = (p + q) / 2
        if (p - r) * (q - s) < 0:  # they cross: one side of that passes
            value = p + (q - p) * (p - r) / (p - r - q + s)
            yield _Infimum(value, test(value, value))
            yield _Infimum(p if p < r else q, False)
        elif test(middle, (r + s) / 2):
            yield _Infimum(min(p, q), p == q)


def _ratios(axis: LevelAxis, one: Lines, other: Lines) -> Iterator[_Infimum]:
    """Yield infima of a function by another one, where that is above 0."""
    for value, rival in _reached_values(axis, one, other):
        if rival > 0:
            yield _Infimum(value / rival, True)
    for _, _, p, q, r, s in together(one, other):
        is_still = p * s == q * r
        yield from (_Infimum(a / b, is_still) for a, b in ((p, r), (q, s)) if b > 0)


def _proportions(
    axis: LevelAxis, one: int, other: int
) -> list[tuple[AxisStretch, Fraction]] | None:
    """Return the longest parts on which two degrees above 0 are in one ratio.

    None if one is a product there that the other does not have, or is enclosed.
    """
    mine, theirs = _without_common(axis.propositions[one], axis.propositions[other])
    if len(mine) > 1 or len(theirs) > 1:
        return None
    shared = tuple(g for g in axis.propositions[one] if g in axis.propositions[other])
    common = axis.function_of(shared).upper
    f, g = axis.function_of(mine), axis.function_of(theirs)
    if not (f.is_exact and g.is_exact):
        return None
    result: list[tuple[AxisStretch, Fraction]] = []
    for part in _positive(common):
        for inner, ratio in _ratio_parts(f.lower, g.lower):
            low, high = max(part.low, inner.low), min(part.high, inner.high)
            if low < high or low == high == inner.low == inner.high:
                result.append((AxisStretch(low, high, inner.is_open), ratio))
    return result


def _positive(lines: Lines) -> list[AxisStretch]:
    """Return the parts on which a function is above 0, as long as they can be."""
    if len(lines.x) == 1:
        return [AxisStretch(lines.x[0], lines.x[0], is_open=False)] * (lines.at[0] > 0)
    every = ((AxisStretch(a, b), 0) for a, b, p, q in lines.pieces() if p > 0 or q > 0)
    return [part for part, _ in runs(every)]


def _ratio_parts(f: Lines, g: Lines) -> Iterator[tuple[AxisStretch, Fraction]]:
    """Yield the parts on which two functions above 0 are in one ratio."""
    if len(f.x) == 1:
        if f.at[0] > 0 and g.at[0] > 0:
            yield AxisStretch(f.x[0], f.x[0], is_open=False), f.at[0] / g.at[0]
        return
    last: tuple[AxisStretch, Fraction] | None = None
    for a, b, p, q, r, s in together(f, g):
        if p * s != q * r or not (p or q) or not (r or s):
            continue
        ratio = p / r if r else q / s
        if last and last[1] == ratio and last[0].high == a:
            last = AxisStretch(last[0].low, b), ratio
            continue
        if last:
            yield last
        last = AxisStretch(a, b), ratio
    if last:
        yield last
