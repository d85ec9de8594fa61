"""Is there an input that no rule covers, or none well? How little is the least?"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid, strengths_at
from fuzzytree.auditing.engine.bounding import below_by_boxes, least_cover_by_boxes
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Point
from fuzzytree.auditing.engine.duels import (
    Duel,
    LevelQuestion,
    Part,
    at_most,
    cover,
    maximal,
    search_level,
    selections,
)
from fuzzytree.auditing.engine.pieces import ZERO
from fuzzytree.auditing.engine.probes import leader
from fuzzytree.auditing.engine.states import (
    Bracket,
    Claim,
    Proved,
    State,
    Witness,
    coordinates,
)
from fuzzytree.auditing.engine.witnesses import (
    AxisStretch,
    coupled,
    is_within,
    point_with,
    region_around,
)
from fuzzytree.numerics import outwards

_MOST_CHOICES = 2_000  # of values for axes that share inputs
_MOST_FINE = 300  # levels that are worth knowing as fractions


def below(base: Arrangement, epsilon: Fraction, clock: Clock | None = None) -> State:
    """Return whether all rules are somewhere weaker than a level.

    `epsilon`: the level, in (0, 1].

    Returns:
        `Proved`: some rule reaches the level everywhere. `Witness`: here none does.
    """
    clock = clock or Clock()
    if base.is_empty:
        return Proved("the domain has no point")
    if base.rules.semantics.conjunction == "product" or not base.is_kept:
        return below_by_boxes(base.rules, base.domain, epsilon, clock)
    every = tuple(range(1, len(base.rules.rules) + 1))
    return search_level(
        base,
        LevelQuestion((), every, epsilon, "how far all stay below the level"),
        clock,
    )


def least_cover(base: Arrangement, clock: Clock | None = None) -> Bracket:
    """Return bounds of the least strength that the strongest rule has anywhere.

    Under the minimum the bounds are those of one critical level; where inputs depend on
    each other the lower one treats them as free, and the upper one is of a point.
    """
    clock = clock or Clock()
    if base.rules.semantics.conjunction == "product" or not base.is_kept:
        return least_cover_by_boxes(base.rules, base.domain, clock)
    duel = Duel(base, (), tuple(range(len(base.rules.rules))))
    bands = duel.bands
    if not base.is_fine and len(bands.low) < _MOST_FINE:
        return least_cover(base.fine, clock)
    low, high = -1, len(bands.low) - 1  # open at the lower one, closed at the upper
    name = "the strength of the strongest rule where it is least"
    try:
        while high - low > 1:
            middle = (low + high) // 2
            families = [options.at_gap(middle) for options in duel.options]
            if cover(families, duel.full, clock) is None:
                low = middle
            else:
                high = middle
    except OutOfTimeError:
        ends = outwards(bands.low[low + 1])[0], outwards(bands.high[high])[1]
        return Bracket(name, *ends, "the budget was spent")
    ends = outwards(bands.low[high])[0], outwards(bands.high[high])[1]
    if coupled(base):
        every = range(1, len(base.rules.rules) + 1)
        point = leader(base, (), tuple(every))
        top = max(strengths_at(base, point)) if is_within(base, point) else Fraction(1)
        return Bracket(
            name, ends[0], outwards(top)[1], "its inputs depend on each other"
        )
    return Bracket(name, *ends, "these are bounds of one critical level")


def uncovered(base: Arrangement, clock: Clock | None = None) -> State:
    """Return whether every rule is somewhere exactly 0; for any conjunction.

    Returns:
        `Proved`: some rule fires everywhere. `Witness`: here none does. `Bracket`: the
        budget or inputs that depend on each other leave it open.
    """
    clock = clock or Clock()
    if base.is_empty:
        return Proved("the domain has no point")
    if not base.is_kept:
        return below_by_boxes(base.rules, base.domain, 0, clock)
    every = tuple(range(len(base.rules.rules)))
    duel = Duel(base, (), every)
    sure = [
        [*_bare(grid, every, is_open=base.opens(grid.axis.variable.name))]
        for grid in base.grids
    ]
    cells = sum(map(len, sure))
    how = f"{cells} parts of {len(sure)} axes where rules are 0 visited"
    try:
        if cover([maximal(m for m, _ in of) for of in sure], duel.full, clock):
            point = _bare_point(base, sure, duel.full, clock)
            if point is not None:
                return _bare_witness(base, point)
        vague = [
            [*of, *_maybe_bare(grid)] for of, grid in zip(sure, base.grids, strict=True)
        ]
        if (
            cover([maximal(m for m, _ in of) for of in vague], duel.full, clock)
            and _bare_point(base, vague, duel.full, clock) is not None
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
    grid: AxisGrid, rules: tuple[int, ...], *, is_open: bool
) -> Iterator[tuple[int, AxisStretch]]:
    """Yield the rules that are 0 on parts of an axis, with the part."""
    of = np.array(rules)
    zones = grid.cells.zones
    columns = np.arange(len(grid.cells.between))
    is_zero = grid.is_zero[grid.of[of], columns].T
    for cell, (low, high) in enumerate(grid.cells.between):
        yield _mask(is_zero[cell]), AxisStretch(low, high)
    for place, (low, high) in enumerate(zones):
        if low == high and not (is_open and place == 0):
            at = _zero_at(grid, grid.is_zero_at[:, place])
            yield _mask(at), AxisStretch(low, high, is_open=False)


def _maybe_bare(grid: AxisGrid) -> Iterator[tuple[int, AxisStretch]]:
    for place, (low, high) in enumerate(grid.cells.zones):
        if low != high:
            at = _zero_at(grid, grid.may_be_zero_at[:, place])
            yield _mask(at), AxisStretch(low, high, is_open=False)


def _zero_at(grid: AxisGrid, is_zero: object) -> list[bool]:
    """Return which rules are 0 where some elements are, all those of a proposition."""
    zero = np.asarray(is_zero)
    return [
        any(all(bool(zero[one]) for one in group) for group in groups)
        for groups in grid.axis.propositions
    ]


def _bare_point(
    base: Arrangement,
    options: list[list[tuple[int, AxisStretch]]],
    full: int,
    clock: Clock,
) -> Point | None:
    """Return a point at which all rules are 0, if there is one."""
    joined = sorted({axis for group in coupled(base) for axis in group})
    parts = {axis: _joined(base.grids[axis], options[axis]) for axis in joined}
    # Open parts first: a point there has others around it.
    ways = {
        axis: sorted(of, key=lambda one: not one[1].is_open)
        for axis, of in enumerate(options)
        if axis not in parts
    }

    def realize(axis: int, mask: int) -> AxisStretch:
        return next(part for bare, part in ways[axis] if mask & ~bare == 0)

    families = {axis: maximal(mask for mask, _ in of) for axis, of in ways.items()}
    count = at_most(_MOST_CHOICES, clock)
    every = selections(base, parts, families, full, count, clock, realize)
    points = (point_with(base, wanted) for wanted in every)
    return next((point for point in points if point is not None), None)


def _joined(grid: AxisGrid, options: list[tuple[int, AxisStretch]]) -> list[Part]:
    """Return parts of an axis, those of neighbouring cells as one; and all of it.

    What is 0 in the cells on both sides of a place is 0 there.
    """
    count = len(grid.cells.between)
    result: list[Part] = []
    for cell, (mask, part) in enumerate(options[:count]):
        if result and result[-1][1] == mask and not grid.cells.is_vague[cell]:
            part = AxisStretch(result.pop()[0].low, part.high)
        result.append((part, mask))
    result += [
        (part, mask)
        for mask, part in options[count:]
        if not any(
            of.low < part.low and part.high < of.high and mask & ~bare == 0
            for of, bare in result
        )
    ]
    zones = grid.cells.zones
    whole = AxisStretch(zones[0][0], zones[-1][1], is_open=False)
    return [*(one for one in result if one[1]), (whole, 0)]


def _bare_witness(base: Arrangement, point: Point) -> State:
    strengths = strengths_at(base, point)
    if any(strengths) or not is_within(base, point):
        why = "a point that should be uncovered is not"
        return Bracket("how many rules fire at least", 0.0, 1.0, why)
    every = tuple(range(1, len(strengths) + 1))
    claims = (
        Claim("below", rules=every, level="0"),
        Claim("decides", label=base.rules.semantics.uncovered),
    )
    region = region_around(base, point, (), every, between=(ZERO, ZERO))
    return Witness(coordinates(point), claims, region)
