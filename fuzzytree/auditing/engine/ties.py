"""Are rules equally strong on a set with an interior, and nobody stronger?

Under the minimum, rules tie on more than a surface where their weakest clause is the
same curve on one axis, the *pivot*: there the level is that curve's value, all the
rules reach it on the other axes, and every rival stays at or below it: on some other
axis strictly below, or on the pivot as a curve that is below or equal. The level moves
with the pivot's value, so levels between two critical ones suffice; a curve that is
constant has its one level, which is then a critical one. Two rules may be constant at
one level on different axes too; there are two pivots then.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.contests import Contest
from fuzzytree.auditing.engine.covering import cover
from fuzzytree.auditing.engine.ground import Ground, TooManyCellsError
from fuzzytree.auditing.engine.linear import simple
from fuzzytree.auditing.engine.parts import Stretch
from fuzzytree.auditing.engine.pivots import (
    Pivot,
    crossed,
    ends_of,
    flat_family,
    levels_of,
    part_at,
    pivots,
    value_of,
    whole,
)
from fuzzytree.auditing.engine.products import tie_of_products
from fuzzytree.auditing.engine.proportions import have_one_direction
from fuzzytree.auditing.engine.states import Declined, Proved, State, Witness
from fuzzytree.auditing.engine.tied import Asked, checked
from fuzzytree.auditing.engine.tied_inputs import Sharing
from fuzzytree.auditing.engine.witnesses import coupled, point_with


def tie(given: Ground, one: int, other: int, clock: Clock | None = None) -> State:
    """Return whether two rules tie as the strongest, on a set with an interior.

    Args:
        given: The rules and the box.
        one: The number of a rule, from 1.
        other: The number of another one.
        clock: How much time there is; no limit unless given.

    Returns:
        `Proved`: they never do. `Witness`: here they do. `Bracket`: the budget leaves
        it open. `Declined`: inputs that depend on each other do.
    """
    every = range(1, len(given.rules.rules) + 1)
    rest = tuple(n for n in every if n not in (one, other))
    return _asked(given, Asked((one, other), (), rest), clock or Clock())


def decides_by_order(
    given: Ground,
    rule: int,
    before: Collection[int],
    behind: Collection[int],
    clock: Clock | None = None,
) -> State:
    """Return whether a rule is somewhere as strong as any, on a set with an interior.

    Args:
        given: The rules and the box.
        rule: The number of the rule, from 1.
        before: The numbers of the rivals that win ties against it.
        behind: The numbers of the rivals that lose them.
        clock: How much time there is; no limit unless given.

    Returns:
        As `tie`.
    """
    asked = Asked((rule,), tuple(sorted(before)), tuple(sorted(behind)))
    return _asked(given, asked, clock or Clock())


def _asked(given: Ground, asked: Asked, clock: Clock) -> State:
    if given.is_empty:
        return Proved("the domain has no point")
    if not given.axes:
        point = point_with(given, {})
        found = None if point is None else checked(given, asked, point)
        return found or Proved("no rule asks anything")
    try:
        if given.rules.semantics.conjunction == "product":
            return tie_of_products(given, asked, clock)
        return _searched(given, asked, clock)
    except OutOfTimeError:
        return asked.open("the budget was spent")
    except TooManyCellsError as error:
        return asked.open(str(error))


def _searched(given: Ground, asked: Asked, clock: Clock) -> State:
    contest = Contest(
        given,
        tuple(n - 1 for n in asked.ours),
        tuple(n - 1 for n in asked.rivals),
    )
    sharing = Sharing(contest, asked, clock) if coupled(given) else None
    led = None if sharing is None else sharing.leader()
    if led is not None:
        return led
    is_each = sharing is not None
    held_by = [
        pivot
        for axis in range(len(given.laid[0]))
        for pivot in pivots(contest, asked, axis, is_each=is_each)
    ]
    held_by += crossed(contest, asked, is_each=is_each)
    bands, levels = contest.bands, 0
    is_vague = is_open = False
    floors = [options.at_gap for options in contest.inner_options]
    for pivot in held_by:
        held = {part.axis: part.mask for part in pivot.all}
        masks = [(mask,) for mask in held.values()]
        least, most = ends_of(given.laid[0][pivot.axis], pivot.element, pivot.cell)
        is_flat = least == most
        if is_flat and not bands.is_sharp[least]:
            clock.check()
            vague = [
                flat_family(contest, asked, axis, least, is_within=True)
                for axis in range(len(floors))
                if axis not in held
            ]
            if cover([*masks, *vague], contest.full, clock) is None:
                continue
            # What may be there is looked for as at a level that is known exactly.
            is_vague = True
        tried = [least] if is_flat else levels_of(contest, least, most, is_each=is_each)
        for band in tried:
            clock.check()
            levels += 1
            families = [
                flat_family(contest, asked, axis, band)
                if is_flat
                else floors[axis](band)
                for axis in range(len(floors))
                if axis not in held
            ]
            chosen = cover([*masks, *families], contest.full, clock)
            if chosen is None:
                continue
            if sharing is not None:
                found, is_left = sharing.search(pivot, band, is_flat=is_flat)
                is_open |= is_left
            else:
                rest = chosen[len(held) :]
                found = _witness(contest, asked, pivot, band, rest, is_flat=is_flat)
                is_vague |= found is None
            if found is not None:
                return found
    if is_vague and not given.is_fine:
        return _searched(given.fine, asked, clock)
    if is_vague:
        return asked.open("two critical levels are too near to tell")
    if is_open or have_one_direction(given):
        reason = "the inputs of its variables depend on each other"
        return Declined("FTD04", reason)
    return Proved(f"{len(held_by)} cells where they share a curve, {levels} levels")


def _witness(
    contest: Contest,
    asked: Asked,
    pivot: Pivot,
    band: int,
    chosen: Sequence[int],
    *,
    is_flat: bool,
) -> Witness | None:
    """Return a point at which ours tie, if one is found."""
    given = contest.ground
    laid = given.laid[0][pivot.axis]
    if is_flat:
        at: Fraction | None = simple(*whole(laid, pivot.cell)[:2])
    else:
        levels = contest.bands.high[band], contest.bands.low_after(band)
        at = value_of(laid, pivot, levels)
    if at is None:
        return None
    level = laid.axis.elements[pivot.element].degree(at)
    wanted = {pivot.axis: Stretch(at, at, is_open=False)}
    left = contest.full
    for held in pivot.all:
        if is_flat:
            wanted[held.axis] = whole(given.laid[0][held.axis], held.cell)
        left &= ~held.mask
    others = [axis for axis in range(len(given.laid[0])) if axis not in wanted]
    for axis, mask in zip(others, chosen, strict=True):
        flat = band if is_flat else None
        found = part_at(contest, axis, level, mask & left, flat)
        if found is None:
            return None
        wanted[axis] = found
        left &= ~mask
    point = point_with(given, wanted)
    return None if point is None else checked(given, asked, point)
