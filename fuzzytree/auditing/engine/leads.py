"""By how much can a rule lead others at most?"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection
from fractions import Fraction

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.contests import Contest
from fuzzytree.auditing.engine.covering import cover
from fuzzytree.auditing.engine.ground import Ground, strengths_at
from fuzzytree.auditing.engine.seeking import leader, plainer
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Witness,
    coordinates,
    point_of,
)
from fuzzytree.auditing.engine.variables import Point
from fuzzytree.auditing.engine.witnesses import is_within
from fuzzytree.numerics.exact import outwards

_STEPS = 10  # halvings of the upper end


def largest_lead(
    given: Ground,
    rule: int,
    rivals: Collection[int],
    won: Witness,
    enough: Fraction,
    clock: Clock | None = None,
) -> Bracket:
    """Return bounds of a rule's largest lead over the strongest of some others.

    Under the minimum a lead of d somewhere means that a choice of cells has the rule
    reach a level d above one below which every rival has values. The places within the
    cells are not asked for, so this bounds the lead from above. From below it is the
    best point that floats led to, evaluated in fractions.

    Args:
        given: The rules and the box.
        rule: The number of the rule, from 1.
        rivals: The numbers of the others.
        won: A point at which the rule wins.
        enough: Once a lead of this much is found, the upper end is not worked out.
        clock: How much time there is; no limit unless given.
    """
    clock = clock or Clock()
    others = tuple(sorted(rivals))
    best = point_of(won.point)
    low = _lead(given, best, rule, others)
    if low < enough:
        found = leader(given, (rule,), others)
        if is_within(given, found) and _lead(given, found, rule, others) > low:
            best = plainer(given, found, (rule,), others)
            low = _lead(given, best, rule, others)
    name = f"the largest lead of rule {rule}"
    claims = (
        Claim("beats", rules=(rule,), rivals=others),
        *_strengths(given, best, (rule, *others)),
    )
    high, why = Fraction(1), "a lead that large is enough"
    if low < enough:
        if given.rules.semantics.conjunction == "product" or not given.is_kept:
            from fuzzytree.auditing.engine.bounding import largest_lead_by_boxes

            wide = largest_lead_by_boxes(given.rules, given.domain, rule, others, clock)
            high, why = Fraction(wide.high), wide.why
        else:
            high, why = _bound(given, rule, others, low, clock)
    return Bracket(
        name, outwards(low)[0], outwards(high)[1], why, coordinates(best), claims
    )


def _lead(given: Ground, point: Point, rule: int, rivals: Collection[int]) -> Fraction:
    strengths = strengths_at(given, point)
    return strengths[rule - 1] - max(
        (strengths[number - 1] for number in rivals), default=Fraction(0)
    )


def _strengths(
    given: Ground, point: Point, rules: Collection[int]
) -> tuple[Claim, ...]:
    """Return claims of the strengths of a rule and of the strongest of others."""
    strengths = strengths_at(given, point)
    first, *others = rules
    told = [first]
    if others:
        told.append(max(others, key=lambda number: strengths[number - 1]))
    return tuple(
        Claim("strength", rules=(number,), level=str(strengths[number - 1]))
        for number in told
    )


def _bound(
    given: Ground, rule: int, rivals: tuple[int, ...], low: Fraction, clock: Clock
) -> tuple[Fraction, str]:
    """Return what the lead does not exceed, and how that is known."""
    contest = Contest(given, (rule - 1,), tuple(number - 1 for number in rivals))
    high = Fraction(1)
    try:
        for step in range(_STEPS):
            # The true lead tends to be small: begin near the lower end.
            middle = low + (high - low) / (64 if step == 0 else 2)
            if middle <= low:
                break
            if _may_reach(contest, middle, clock):
                low = middle
            else:
                high = middle
    except OutOfTimeError:
        return high, "the budget was spent"
    return high, "the places within the cells are not asked for"


def _may_reach(contest: Contest, lead: Fraction, clock: Clock) -> bool:
    """Return whether a lead cannot be excluded."""
    bands = contest.bands
    for band in contest.events:
        top = bisect_left(bands.high, bands.low[band] + lead)
        families = [
            options.masks(options.top >= top, band) for options in contest.options
        ]
        if cover(families, contest.full, clock) is not None:
            return True
    return False
