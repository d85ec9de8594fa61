"""The questions of an audit about all rules: who wins and leads, cover, ties.

Under the minimum the levels of lines decide (`levels`), under the product, and where
these leave something open, boxes do (`bounding`). A witness is a point at which all
that is claimed was evaluated in fractions.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from fractions import Fraction
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import Arrangement, lead_at, strengths_at
from fuzzytree.auditing.engine.bounding import (
    below_by_boxes,
    largest_lead_by_boxes,
    least_cover_by_boxes,
    plainer,
    wins_by_boxes,
)
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.compared import RulePairs
from fuzzytree.auditing.engine.domain import Domain, Point
from fuzzytree.auditing.engine.levels import (
    Levels,
    Sides,
    Tries,
    bits,
    first_accepted,
    levels_of,
)
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.auditing.engine.probes import leader
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Declined,
    Proved,
    Span,
    State,
    Witness,
    coordinates,
    counted,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import (
    AxisStretch,
    have_one_direction,
    is_within,
    point_with,
)
from fuzzytree.model import BoolArray
from fuzzytree.numerics import outwards

_TOLERANCE: Final = 1e-6  # of a lead, at which boxes end
_BRIEF_S: Final = 5.0  # for boxes at first, where degrees are enclosed
_MOST_BOXES: Final = 512  # on which two products are one function
_STEPS: Final = 10  # halvings of the upper end of a lead
_DEPENDENT: Final = "the inputs of its variables depend on each other"
_ENCLOSED: Final = "the degrees of its membership functions are enclosed"
_NO_POINT: Final = Proved("the domain has no point")


def _is_product(base: Arrangement) -> bool:
    return base.rules.semantics.conjunction == "product"


def _every(base: Arrangement) -> tuple[int, ...]:
    return tuple(range(1, len(base.rules.rules) + 1))


# --- is there a level that rules reach and rivals do not?


class _Question(NamedTuple):
    """Is there a point at which ours are at least at a level, and rivals below it?"""

    base: Arrangement
    ours: tuple[int, ...]  # numbers of rules; without any, nothing need reach it
    rivals: tuple[int, ...]
    ceiling: Fraction | None  # the level, if it is a given one

    @property
    def sides(self) -> Sides:
        """Both as bits."""
        return Sides(bits(self.ours), bits(self.rivals))

    def accept(self, point: Mapping[str, Fraction]) -> Witness | None:
        """Return a point as a witness, if it is one in fractions."""
        base, ours, rivals, ceiling = self
        strengths = strengths_at(base, point)
        mine = min((strengths[n - 1] for n in ours), default=ceiling or ONE)
        best = max((strengths[n - 1] for n in rivals), default=ZERO)
        if not (mine > best and is_within(base, {**point})):
            return None
        claims: tuple[Claim, ...]
        if ceiling is not None:
            claims = (Claim("below", rules=rivals, level=str(ceiling)),)
        else:
            claims = (
                Claim("beats", rules=ours, rivals=rivals),
                *(
                    Claim("strength", rules=(n,), level=str(strengths[n - 1]))
                    for n in ours
                ),
            )
        region: tuple[Span, ...] = ()
        if not _is_product(base):
            level = ceiling or simple(best, mine)
            region = levels_of(base).region(point, self.sides, level)
        return Witness(coordinates(point), claims, region)


def _searched(question: _Question, of: str, clock: Clock) -> State:
    """Return the answer by levels; a bracket of what the text names if it is open."""
    base = question.base
    levels, tries = levels_of(base), Tries(clock)
    try:
        if levels.joined:
            found = _led(question)
            if found is not None:
                return found
        witness, is_open = _at_levels(question, levels, tries)
    except OutOfTimeError:
        return Bracket(of, 0.0, 1.0, f"the budget was spent: {_how(levels, tries)}")
    if witness is not None:
        return witness
    if is_open:
        why = _DEPENDENT if levels.is_exact else _ENCLOSED
        return Bracket(of, 0.0, 1.0, f"{why}: {_how(levels, tries)}")
    return Proved(_how(levels, tries))


def _led(question: _Question) -> Witness | None:
    """Return a witness that floats led to, if there is one."""
    base, ours, rivals, _ = question
    point = leader(base, ours, rivals)
    found = question.accept(point)
    if found is None:
        return None
    return question.accept(plainer(base, point, ours, rivals)) or found


def _at_levels(
    question: _Question, levels: Levels, tries: Tries
) -> tuple[Witness | None, bool]:
    sides, is_open = question.sides, False
    if not levels.axes:
        return question.accept(_middle(question.base)), False
    ranges: Iterable[tuple[Fraction, Fraction]] = [(ZERO, ONE)]
    if question.ceiling is not None:
        ranges = [(question.ceiling, question.ceiling)]
    elif levels.is_exact:
        ranges = levels.apart(sides, tries.clock)
    for ends in ranges:
        found, is_left = levels.search(sides, ends, tries, question.accept)
        if found is not None:
            return found, False
        is_open |= is_left
    return None, is_open


def _middle(base: Arrangement) -> Point:
    return point_with(base, {}) or {}


def _how(levels: Levels, tries: Tries) -> str:
    axes = counted(len(levels.axes), "axis", "axes")
    text = f"{counted(len(levels.levels), 'level')} on {axes} visited"
    if not tries.used:
        return text
    return f"{text}, {counted(tries.used, 'choice')} of inputs"


def wins(
    base: Arrangement, rule: int, rivals: Collection[int], clock: Clock | None = None
) -> State:
    """Return whether a rule is somewhere stronger than each of some others.

    Returns:
        `Proved`: it never is. `Witness`: it is, at a point that was evaluated in
        fractions. `Bracket`: the largest lead, where time or inputs that depend on each
        other leave it open.
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    if base.is_empty:
        return _NO_POINT
    by_boxes = partial(
        wins_by_boxes, base.rules, base.domain, rule, others, tolerance=_TOLERANCE
    )
    if _is_product(base):
        return by_boxes(clock)
    question = _Question(base, (rule,), others, None)
    by_levels = partial(_searched, question, f"the largest lead of rule {rule}")
    # Boxes see that propositions cancel, and know inputs that depend on each other.
    state = _first_known(base, by_levels, by_boxes, clock)
    if isinstance(state, Witness) and not state.region:
        return question.accept(point_of(state.point)) or state
    return state


def _first_known(
    base: Arrangement,
    by_levels: Callable[[Clock], State],
    by_boxes: Callable[[Clock], State],
    clock: Clock,
) -> State:
    """Return what levels or boxes find; boxes are first where degrees are enclosed."""
    is_exact, left = levels_of(base).is_exact, clock.left_s
    results: list[State] = []
    if not is_exact:
        is_short = left < 2.0 * _BRIEF_S
        results.append(by_boxes(clock.share(0.5) if is_short else Clock(_BRIEF_S)))
    if not results or isinstance(results[0], Bracket):
        results.append(by_levels(clock.share(0.5)))
    if isinstance(results[-1], Bracket):
        results.append(by_boxes(clock.share(0.9)))
    known = [one for one in results if not isinstance(one, Bracket)]
    if known:
        return known[0]
    brackets = [one for one in results if isinstance(one, Bracket)]
    return min(brackets, key=lambda one: one.high - one.low)


# --- by how much a rule leads


def largest_lead(
    base: Arrangement,
    rule: int,
    rivals: Collection[int],
    won: Witness,
    enough: Fraction,
    clock: Clock | None = None,
) -> Bracket:
    """Return bounds of a rule's largest lead over the strongest of some others.

    Under the minimum a lead is excluded where the rule, weaker by that much everywhere,
    never wins. From below it is the best point that floats led to, evaluated in
    fractions.

    `won`: A point at which the rule wins; `enough`: once a lead of this much is found,
    the upper end is not worked out.
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    best = point_of(won.point)
    low = lead_at(base, best, (rule,), others)
    if low < enough:
        result = leader(base, (rule,), others)
        if is_within(base, result) and lead_at(base, result, (rule,), others) > low:
            best = plainer(base, result, (rule,), others)
            low = lead_at(base, best, (rule,), others)
    name = f"the largest lead of rule {rule}"
    claims = (
        Claim("beats", rules=(rule,), rivals=others),
        *_strengths(base, best, (rule, *others)),
    )
    high, why = ONE, "a lead that large is enough"
    if low < enough:
        if _is_product(base) or not levels_of(base).is_exact:
            wide = largest_lead_by_boxes(base.rules, base.domain, rule, others, clock)
            high, why = Fraction(wide.high), wide.why
        else:
            high, why = _bound(base, rule, others, low, clock)
    return Bracket(
        name, outwards(low)[0], outwards(high)[1], why, coordinates(best), claims
    )


def _strengths(
    base: Arrangement, point: Point, rules: Collection[int]
) -> tuple[Claim, ...]:
    """Return claims of the strengths of a rule and of the strongest of others."""
    strengths = strengths_at(base, point)
    first, *others = rules
    strongest = [first]
    if others:
        strongest.append(max(others, key=lambda number: strengths[number - 1]))
    return tuple(
        Claim("strength", rules=(number,), level=str(strengths[number - 1]))
        for number in strongest
    )


def _bound(
    base: Arrangement, rule: int, rivals: tuple[int, ...], low: Fraction, clock: Clock
) -> tuple[Fraction, str]:
    """Return what the lead does not exceed, and how that is known."""
    levels, sides = levels_of(base), Sides(bits((rule,)), bits(rivals))
    high = ONE
    try:
        for step in range(_STEPS):
            # The true lead tends to be small: begin near the lower end.
            middle = low + (high - low) / (64 if step == 0 else 2)
            if middle <= low:
                break
            weaker = levels.lowered(rule - 1, middle)
            if next(weaker.apart(sides, clock), None) is None:
                high = middle
            else:
                low = middle
    except OutOfTimeError:
        return high, "the budget was spent"
    return high, "it was halved so many times"


# --- what is covered


def below(base: Arrangement, epsilon: Fraction, clock: Clock | None = None) -> State:
    """Return whether all rules are somewhere weaker than a level.

    `epsilon`: the level, in (0, 1].

    Returns:
        `Proved`: some rule reaches the level everywhere. `Witness`: here none does.
    """
    clock = clock or Clock()
    if base.is_empty:
        return _NO_POINT
    by_boxes = partial(below_by_boxes, base.rules, base.domain, epsilon)
    if _is_product(base):
        return by_boxes(clock)
    question = _Question(base, (), _every(base), epsilon)
    of = "how far all stay below the level"
    return _first_known(base, partial(_searched, question, of), by_boxes, clock)


def least_cover(base: Arrangement, clock: Clock | None = None) -> Bracket:
    """Return bounds of the least strength that the strongest rule has anywhere.

    Under the minimum both are one critical level; where inputs depend on each other the
    lower one treats them as free, and the upper one is of a point.
    """
    clock = clock or Clock()
    if _is_product(base):
        return least_cover_by_boxes(base.rules, base.domain, clock)
    name = "the strength of the strongest rule where it is least"
    levels = levels_of(base)
    try:
        low, high = levels.at_least(clock)
    except OutOfTimeError:
        return Bracket(name, 0.0, 1.0, "the budget was spent")
    why = "this is a critical level" if levels.is_exact else _ENCLOSED
    if levels.joined:
        point = leader(base, (), _every(base))
        high = max(strengths_at(base, point)) if is_within(base, point) else ONE
        why = "its inputs depend on each other"
    return Bracket(name, outwards(low)[0], outwards(high)[1], why)


def uncovered(base: Arrangement, clock: Clock | None = None) -> State:
    """Return whether every rule is somewhere exactly 0; for any conjunction.

    Returns:
        `Proved`: some rule fires everywhere. `Witness`: here none does. `Bracket`: the
        budget or inputs that depend on each other leave it open.
    """
    clock = clock or Clock()
    if base.is_empty:
        return _NO_POINT
    levels = levels_of(base)
    name = "how many rules fire at least"
    try:
        for is_sure in (True, False):
            every = levels.zeros(is_sure=is_sure)
            some = levels.selections(every, bits(_every(base)), Tries(clock))
            found, is_open = first_accepted(base, some, partial(_bare_witness, base))
            if found is not None:
                return found
            if not is_sure and is_open and not levels.is_exact:
                return below_by_boxes(base.rules, base.domain, 0, clock)
            if is_open and levels.is_exact:
                return Bracket(name, 0.0, 1.0, _DEPENDENT)
    except OutOfTimeError:
        return Bracket(name, 0.0, 1.0, "the budget was spent")
    axes = counted(len(levels.axes), "axis", "axes")
    return Proved(f"the parts of {axes} where rules are 0 were visited")


def _bare_witness(base: Arrangement, point: Point) -> Witness | None:
    strengths = strengths_at(base, point)
    if any(strengths) or not is_within(base, point):
        return None
    every = _every(base)
    claims = (
        Claim("below", rules=every, level="0"),
        Claim("decides", label=base.rules.semantics.uncovered),
    )
    region = levels_of(base).region(point, Sides(0, bits(every)), ZERO)
    return Witness(coordinates(point), claims, region)


# --- ties


class _TieQuestion(NamedTuple):
    """Is there a set with an interior on which rules are the strongest?"""

    base: Arrangement
    ours: tuple[int, ...]  # the rules that shall tie; or a single one
    strict: tuple[int, ...]  # the rivals that must be weaker
    weak: tuple[int, ...]  # the rivals that may be equally strong

    def open(self, why: str) -> Bracket:
        """Return the answer that it is not known."""
        names = " and ".join(map(str, self.ours))
        verb = "tie" if len(self.ours) > 1 else "is first"
        noun = "rules" if len(self.ours) > 1 else "rule"
        return Bracket(f"whether {noun} {names} {verb} (1) or not (0)", 0.0, 1.0, why)

    def accept(self, point: Point) -> Witness | None:
        """Return a point as a witness, if it is one in fractions."""
        strengths = strengths_at(self.base, point)
        mine = strengths[self.ours[0] - 1]
        holds = (
            all(strengths[n - 1] == mine for n in self.ours)
            and all(strengths[n - 1] < mine for n in self.strict)
            and all(strengths[n - 1] <= mine for n in self.weak)
            and mine > 0
            and is_within(self.base, point)
        )
        if not holds:
            return None
        every = self.ours + self.strict + self.weak
        level = tuple(sorted(n for n in every if strengths[n - 1] == mine))
        lower = tuple(sorted(n for n in every if strengths[n - 1] < mine))
        claims = (
            Claim("ties", rules=level, rivals=lower),
            Claim("strength", rules=(self.ours[0],), level=str(mine)),
        )
        return Witness(coordinates(point), claims)


def tie(base: Arrangement, one: int, other: int, clock: Clock | None = None) -> State:
    """Return whether two rules tie as the strongest, on a set with an interior.

    Returns:
        `Proved`: they never do. `Witness`: here they do. `Bracket`: the budget leaves
        it open. `Declined`: inputs that depend on each other do.
    """
    rest = tuple(n for n in _every(base) if n not in (one, other))
    return _tied(_TieQuestion(base, (one, other), (), rest), clock or Clock())


def decides_by_order(
    base: Arrangement,
    rule: int,
    before: Collection[int],
    behind: Collection[int],
    clock: Clock | None = None,
) -> State:
    """Return whether a rule is somewhere as strong as any, on a set with an interior.

    `before`: the rules that must be weaker; `behind`: those that may be as strong.

    Returns:
        As `tie`.
    """
    question = _TieQuestion(base, (rule,), tuple(sorted(before)), tuple(sorted(behind)))
    return _tied(question, clock or Clock())


def _tied(question: _TieQuestion, clock: Clock) -> State:
    base = question.base
    if base.is_empty:
        return _NO_POINT
    if _is_product(base):
        return _tied_products(question, clock)
    levels, is_open = levels_of(base), False
    try:
        if not levels.axes:
            return question.accept(_middle(base)) or Proved("no rule has a proposition")
        if len(question.ours) == 1:
            rivals = question.strict + question.weak
            state = wins(base, question.ours[0], rivals, clock.share(0.5))
            if isinstance(state, Witness):
                return question.accept(point_of(state.point)) or state
            is_open = isinstance(state, Bracket)
        if not levels.is_exact:
            tied = _tied_enclosed(question, clock)
            is_left = is_open and isinstance(tied, Proved)
            return question.open(_ENCLOSED) if is_left else tied
        ours = [n - 1 for n in question.ours]
        strict, weak = bits(question.strict), bits(question.weak)
        some = levels.tied(ours, strict, weak, clock)
        found, is_any = first_accepted(base, some, question.accept)
        if found is not None:
            return found
        is_open |= is_any
    except OutOfTimeError:
        return question.open("the budget was spent")
    if is_open or (levels.joined and have_one_direction(base)):
        return Declined("FTD04", "the inputs of its variables depend on each other")
    return Proved(f"{counted(len(levels.levels), 'level')} visited")


def _tied_products(question: _TieQuestion, clock: Clock) -> State:
    """Return whether two products tie: one function on a box, and strongest there."""
    base, ours = question.base, question.ours
    if levels_of(base).joined:
        return Declined("FTD04", "the inputs of its variables depend on each other")
    pairs = RulePairs(base)
    tried = 0
    for other in ours[1:] or question.weak:
        boxes = pairs.alike(ours[0], other, _MOST_BOXES)
        if boxes is None:
            return question.open("the products are one function on too many boxes")
        for box in boxes:
            tried += 1
            inner = _inside(base, box)
            rest = _others_on(pairs, question, box)
            if rest is None:
                return question.open("they are one function on a box, and near others")
            state = wins_by_boxes(base.rules, inner, ours[0], rest, clock.share(0.5))
            if isinstance(state, Witness):
                found = question.accept(point_of(state.point))
                if found is not None:
                    return found
            if not isinstance(state, Proved):
                return question.open("the budget was spent")
    return Proved(f"{counted(tried, 'box', 'boxes')} where they are one function")


def _others_on(
    pairs: RulePairs, question: _TieQuestion, box: Mapping[int, AxisStretch]
) -> list[int] | None:
    """Return the rivals that differ from ours all over a box; None if some do partly.

    A rival that may be as strong, and is one function with ours, is no rival there.
    """
    result: list[int] = []
    for other in question.strict + question.weak:
        boxes = pairs.alike(question.ours[0], other, _MOST_BOXES)
        if boxes is None:
            return None
        near = [one for one in boxes if _overlap(one, box)]
        if not near:
            result.append(other)
        elif other in question.strict or not any(_overlap(n, box) == box for n in near):
            return None
    return result


def _overlap(
    one: Mapping[int, AxisStretch], other: Mapping[int, AxisStretch]
) -> dict[int, AxisStretch]:
    """Return what two boxes have in common; nothing if that has no interior."""
    common: dict[int, AxisStretch] = {}
    for axis, part in one.items():
        low, high = max(part.low, other[axis].low), min(part.high, other[axis].high)
        if low > high or (low == high and part.low < part.high):
            return {}
        common[axis] = AxisStretch(low, high, other[axis].is_open)
    return common


def _inside(base: Arrangement, box: Mapping[int, AxisStretch]) -> Domain:
    """Return the part of a domain in which the axes, single inputs, have a box."""
    sides = {side.variable: side for side in base.domain.sides}
    for number, part in box.items():
        name = base.axes[number].variable.name
        low, high = outwards(part.low)[1], outwards(part.high)[0]
        if name in sides and low <= high:
            sides[name] = replace(sides[name], low=low, high=high)
    return Domain(tuple(sides.values()))


def _tied_enclosed(question: _TieQuestion, clock: Clock) -> State:
    """Return whether rules with a common curve tie, at points that are tried."""
    base, levels = question.base, levels_of(question.base)
    ours = [n - 1 for n in question.ours]
    strict, weak = bits(question.strict), bits(question.weak)
    some = levels.pinned_by_curve(ours, strict, weak, clock)
    found, _ = first_accepted(base, some, question.accept)
    if found is not None:
        return found
    # A single rule ties with any that may be as strong; it was found not to win.
    others = ours[1:] or [n - 1 for n in question.weak]
    if not may_tie(base)[ours[0], others].any():
        return Proved("they share no curve, and no constant")
    return question.open(_ENCLOSED)


def may_tie(base: Arrangement) -> BoolArray:
    """Return which pairs of rules may be equally strong, and not 0, on an open set.

    Returns:
        Shape (rules, rules), symmetric. All are true under the product, and where two
        axes have one direction.
    """
    count = len(base.rules.rules)
    every: BoolArray = np.ones((count, count), dtype=bool)
    if _is_product(base) or base.is_empty or not base.axes or have_one_direction(base):
        return every
    return RulePairs(base).may_tie
