"""Is there an input that no rule covers, or none well? How little is the least?"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from fuzzytree.auditing.engine.arrangement import Ground, Laid, strengths_at
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Point, variable_value
from fuzzytree.auditing.engine.duels import Question, searched
from fuzzytree.auditing.engine.options import (
    Contest,
    Part,
    at_most,
    choices,
    cover,
    maximal,
    union,
)
from fuzzytree.auditing.engine.probes import leader
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    Span,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.engine.witnesses import (
    Stretch,
    cell_of,
    coupled,
    is_within,
    point_with,
    zone_of,
)
from fuzzytree.numerics.exact import outwards

_MOST_CHOICES = 2_000  # of values for axes that share inputs
_MOST_FINE = 300  # levels that are worth knowing as fractions


def below(given: Ground, epsilon: Fraction, clock: Clock | None = None) -> State:
    """Return whether all rules are somewhere weaker than a level.

    Args:
        given: The rules and the box.
        epsilon: The level, in (0, 1].
        clock: How much time there is; no limit unless given.

    Returns:
        `Proved`: some rule reaches the level everywhere. `Witness`: here none does.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.auditing.engine.domain import Domain, Side
        >>> from fuzzytree.auditing.engine.arrangement import ground
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1))
        >>> box = Domain(tuple(Side(name, -9.0, 9.0) for name in rules.inputs))
        >>> below(ground(rules, box), Fraction(1, 2)).how.split(" with ")[0]
        '1 level'
    """
    clock = clock or Clock()
    if given.is_empty:
        return Proved("the domain has no point")
    if given.rules.semantics.conjunction == "product" or not given.is_kept:
        from fuzzytree.auditing.engine.bounding import below_by_boxes

        return below_by_boxes(given.rules, given.domain, epsilon, clock)
    every = tuple(range(1, len(given.rules.rules) + 1))
    return searched(
        given, Question((), every, epsilon, "how far all stay below the level"), clock
    )


def least_cover(given: Ground, clock: Clock | None = None) -> Bracket:
    """Return bounds of the least strength that the strongest rule has anywhere.

    Under the minimum the bounds are those of one critical level; where inputs depend on
    each other the lower one treats them as free, and the upper one is of a point.
    """
    clock = clock or Clock()
    if given.rules.semantics.conjunction == "product" or not given.is_kept:
        from fuzzytree.auditing.engine.bounding import least_cover_by_boxes

        return least_cover_by_boxes(given.rules, given.domain, clock)
    contest = Contest(given, (), tuple(range(len(given.rules.rules))))
    bands = contest.bands
    if not given.is_fine and len(bands.low) < _MOST_FINE:
        return least_cover(given.fine, clock)
    low, high = -1, len(bands.low) - 1  # open at the lower one, closed at the upper
    name = "the strength of the strongest rule where it is least"
    try:
        while high - low > 1:
            middle = (low + high) // 2
            families = [options.at_gap(middle) for options in contest.options]
            if cover(families, contest.full, clock) is None:
                low = middle
            else:
                high = middle
    except OutOfTimeError:
        ends = outwards(bands.low[low + 1])[0], outwards(bands.high[high])[1]
        return Bracket(name, *ends, "the budget was spent")
    ends = outwards(bands.low[high])[0], outwards(bands.high[high])[1]
    if coupled(given):
        every = range(1, len(given.rules.rules) + 1)
        point = leader(given, (), tuple(every))
        top = (
            max(strengths_at(given, point)) if is_within(given, point) else Fraction(1)
        )
        return Bracket(
            name, ends[0], outwards(top)[1], "its inputs depend on each other"
        )
    return Bracket(name, *ends, "these are bounds of one critical level")


def uncovered(given: Ground, clock: Clock | None = None) -> State:
    """Return whether every rule is somewhere exactly 0; for any conjunction.

    Returns:
        `Proved`: some rule fires everywhere. `Witness`: here none does. `Bracket`: the
        budget or inputs that depend on each other leave it open.
    """
    clock = clock or Clock()
    if given.is_empty:
        return Proved("the domain has no point")
    if not given.is_kept:
        from fuzzytree.auditing.engine.bounding import below_by_boxes

        return below_by_boxes(given.rules, given.domain, 0, clock)
    every = tuple(range(len(given.rules.rules)))
    contest = Contest(given, (), every)
    sure = [
        [*_bare(laid, every, is_open=given.opens(laid.axis.variable.name))]
        for laid in given.laid[0]
    ]
    cells = sum(map(len, sure))
    how = f"{cells} parts of {len(sure)} axes where rules are 0 visited"
    point_of = _shared_point if coupled(given) else _bare_point
    try:
        if cover([maximal(m for m, _ in of) for of in sure], contest.full, clock):
            point = point_of(given, sure, contest.full, clock)
            if point is not None:
                return _bare_witness(given, point)
        vague = [
            [*of, *_maybe_bare(laid)]
            for of, laid in zip(sure, given.laid[0], strict=True)
        ]
        if (
            cover([maximal(m for m, _ in of) for of in vague], contest.full, clock)
            and point_of(given, vague, contest.full, clock) is not None
        ):
            why = "a curve may touch 0 where it is not known exactly"
            return Bracket("how many rules fire at least", 0.0, 1.0, why)
    except OutOfTimeError:
        why = "the budget was spent"
        return Bracket("how many rules fire at least", 0.0, 1.0, why)
    return Proved(how)


def _mask(bits: object) -> int:
    packed = np.packbits(np.asarray(bits, dtype=bool), bitorder="little")
    return int.from_bytes(packed.tobytes(), "little")


def _bare(
    laid: Laid, rules: tuple[int, ...], *, is_open: bool
) -> Iterator[tuple[int, Stretch]]:
    """Yield the rules that are 0 on parts of an axis, with the part."""
    of = np.array(rules)
    zones = laid.cells.zones
    columns = np.arange(len(laid.cells.between))
    is_zero = laid.is_zero[laid.of[of], columns].T
    for cell, (low, high) in enumerate(laid.cells.between):
        yield _mask(is_zero[cell]), Stretch(low, high)
    for place, (low, high) in enumerate(zones):
        if low == high and not (is_open and place == 0):
            at = _zero_at(laid, laid.is_zero_at[:, place])
            yield _mask(at), Stretch(low, high, is_open=False)


def _maybe_bare(laid: Laid) -> Iterator[tuple[int, Stretch]]:
    for place, (low, high) in enumerate(laid.cells.zones):
        if low != high:
            at = _zero_at(laid, laid.may_be_zero_at[:, place])
            yield _mask(at), Stretch(low, high, is_open=False)


def _zero_at(laid: Laid, is_zero: object) -> list[bool]:
    """Return which rules are 0 where some elements are: a clause all of whose are."""
    zero = np.asarray(is_zero)
    return [
        any(all(bool(zero[one]) for one in group) for group in groups)
        for groups in laid.axis.asked
    ]


def _bare_point(
    given: Ground, options: list[list[tuple[int, Stretch]]], full: int, clock: Clock
) -> Point | None:
    """Return a point at which all rules are 0, on free axes, if there is one."""
    # Open parts first: a point there has others around it.
    ways = [
        _first_of_each(sorted(of, key=lambda one: not one[1].is_open)) for of in options
    ]
    chosen = cover([maximal(of) for of in ways], full, clock)
    if chosen is None:
        return None
    return point_with(given, {n: ways[n][mask] for n, mask in enumerate(chosen)})


def _shared_point(
    given: Ground, options: list[list[tuple[int, Stretch]]], full: int, clock: Clock
) -> Point | None:
    """Return a point at which all rules are 0, where axes share inputs, if any is."""
    joined = sorted({axis for group in coupled(given) for axis in group})
    parts = {axis: _joined(given.laid[0][axis], options[axis]) for axis in joined}
    free = [axis for axis in range(len(options)) if axis not in parts]
    ways = [_first_of_each(options[axis]) for axis in free]
    families = [maximal(of) for of in ways]
    rest = union(mask for of in ways for mask in of)
    tell = at_most(_MOST_CHOICES, clock)
    for wanted, covered in choices(given, parts, full, rest, {}, tell):
        chosen = cover(families, full & ~covered, clock)
        if chosen is None:
            continue
        others = zip(free, ways, chosen, strict=True)
        found = {axis: of[mask] for axis, of, mask in others}
        point = point_with(given, wanted | found)
        if point is not None:
            return point
    return None


def _joined(laid: Laid, options: list[tuple[int, Stretch]]) -> list[Part]:
    """Return parts of an axis, those of neighbouring cells as one; and all of it.

    What is 0 in the cells on both sides of a place is 0 there.
    """
    count = len(laid.cells.between)
    found: list[Part] = []
    for cell, (mask, part) in enumerate(options[:count]):
        if found and found[-1][1] == mask and not laid.cells.is_vague[cell]:
            part = Stretch(found.pop()[0].low, part.high)
        found.append((part, mask))
    found += [
        (part, mask)
        for mask, part in options[count:]
        if not any(
            of.low < part.low and part.high < of.high and mask & ~bare == 0
            for of, bare in found
        )
    ]
    zones = laid.cells.zones
    whole = Stretch(zones[0][0], zones[-1][1], is_open=False)
    return [*(one for one in found if one[1]), (whole, 0)]


def _first_of_each(ways: list[tuple[int, Stretch]]) -> dict[int, Stretch]:
    """Return the first way to each mask."""
    kept: dict[int, Stretch] = {}
    for mask, part in ways:
        kept.setdefault(mask, part)
    return kept


def _bare_witness(given: Ground, point: Point) -> State:
    strengths = strengths_at(given, point)
    if any(strengths) or not is_within(given, point):
        why = "a point that should be uncovered is not"
        return Bracket("how many rules fire at least", 0.0, 1.0, why)
    every = tuple(range(1, len(strengths) + 1))
    claims = (
        Claim("below", rules=every, level="0"),
        Claim("decides", label=given.rules.semantics.uncovered),
    )
    return Witness(coordinates(point), claims, _bare_region(given, point))


def _bare_region(given: Ground, point: Point) -> tuple[Span, ...]:
    """Return the box around a point on which what is 0 at the point is 0."""
    left = set(range(len(given.rules.rules)))
    at = [variable_value(axis.variable, point) for axis in given.axes]
    zero: list[set[int]] = []
    for axis, value in zip(given.axes, at, strict=True):
        bare = [element.degree(value) == 0 for element in axis.elements]
        zero.append(
            {
                rule
                for rule, groups in enumerate(axis.asked)
                if any(all(bare[one] for one in group) for group in groups)
            }
        )
    spans: list[Span] = []
    while left:
        best = max(range(len(zero)), key=lambda place: len(zero[place] & left))
        span = _bare_span(given.laid[0][best], at[best], sorted(zero[best] & left))
        if span is not None:
            if not (span.low or 0.0) <= at[best] <= (span.high or 0.0):
                return ()  # narrower than doubles tell
            spans.append(span)
        left -= zero[best]
    return tuple(spans)


def _bare_span(laid: Laid, x: Fraction, rules: list[int]) -> Span | None:
    """Return from where to where some rules are 0 along an axis; None if all along."""
    zones, cells = laid.cells.zones, laid.cells.between
    low = high = x
    place = zone_of(zones, x)

    def is_bare(cell: int) -> bool:
        return all(bool(laid.is_zero[laid.of[rule, cell], cell]) for rule in rules)

    def is_bare_at(zone: int) -> bool:
        at = _zero_at(laid, laid.is_zero_at[:, zone])
        return all(at[rule] for rule in rules)

    up = cell_of(zones, x) if place is None else place
    down = up if place is None else place - 1
    while up < len(cells) and is_bare(up):
        high = cells[up][1]
        up += 1
        if not is_bare_at(up):
            break
        high = zones[up][1]
    is_step = False  # only from below curves are not continuous
    while down >= 0 and is_bare(down):
        low = cells[down][0]
        if not is_bare_at(down):
            is_step = low == zones[down][0]
            break
        low = zones[down][0]
        down -= 1
    if low <= zones[0][0] and high >= zones[-1][1] and not is_step:
        return None
    first, last = outwards(low)[1], outwards(high)[0]
    if is_step and first == low:
        first = math.nextafter(first, math.inf)
    return Span(laid.axis.variable.name, first, last)
