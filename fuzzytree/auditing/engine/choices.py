"""Axes that share inputs: values of theirs that a point of the inputs has together.

What each axis can be is a stretch with the rivals that it leaves below. One stretch for
each of the axes is a choice; linear inequalities in fractions tell whether any inputs
have such values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.contests import Contest, Options, weakest
from fuzzytree.auditing.engine.ground import Ground, Laid
from fuzzytree.auditing.engine.parts import START, Stretch, stretch, widest
from fuzzytree.auditing.engine.witnesses import point_with

Part = tuple[Stretch, int]
"""A stretch of an axis, and the rivals that it leaves below, as bits."""


def union(masks: Iterable[int]) -> int:
    """Return all bits of some masks.

    Example:
        >>> union([0b001, 0b100])
        5
    """
    found = 0
    for mask in masks:
        found |= mask
    return found


def at_most(calls: int, clock: Clock | None = None) -> Callable[[], None]:
    """Return what raises OutOfTimeError when called too often, or too late."""
    left = iter(range(calls))

    def tell() -> None:
        if clock is not None:
            clock.check()
        if next(left, None) is None:
            raise OutOfTimeError

    return tell


def choices(
    given: Ground,
    parts: Mapping[int, Sequence[Part]],
    goal: int,
    rest: int,
    held: Mapping[int, Stretch],
    tell: Callable[[], None],
) -> Iterator[tuple[dict[int, Stretch], int]]:
    """Yield choices that some point has, each with what it leaves below.

    Args:
        given: The rules and the box.
        parts: What each axis can be.
        goal: What must be left below, by the other axes too.
        rest: What the other axes can leave below.
        held: What axes must be besides.
        tell: Called before inequalities are solved; it may raise.
    """
    axes = list(parts)
    reach = [rest]
    for axis in reversed(axes):
        reach.append(reach[-1] | union(mask for _, mask in parts[axis]))
    reach.reverse()
    todo: list[tuple[int, dict[int, Stretch], int]] = [(0, dict(held), 0)]
    while todo:
        place, wanted, covered = todo.pop()
        if (covered | reach[place]) & goal != goal:
            continue
        if wanted:
            tell()
            if point_with(given, wanted) is None:
                continue
        if place == len(axes):
            yield wanted, covered
            continue
        axis = axes[place]
        todo += [
            (place + 1, {**wanted, axis: part}, covered | mask)
            for part, mask in parts[axis]
        ]


def parts_of(
    contest: Contest,
    options: Options,
    axis: int,
    band: int,
    levels: tuple[Fraction, Fraction],
    *,
    is_outer: bool,
) -> Iterator[Part]:
    """Yield the stretches of an axis, each with the rivals left below there.

    Args:
        contest: The question.
        options: Those of the axis that count.
        axis: The axis.
        band: The band below the levels.
        levels: The rule must reach the lower one, the rivals stay below the upper.
        is_outer: Whether what may suffice at some level between counts.
    """
    laid = contest.ground.laid[0][axis]
    for number in ((options.top > band) & (options.where >= START)).nonzero()[0]:
        cell = int(options.where[number])
        mine = weakest(laid, contest.ours, cell)
        floors = options.floor[number]
        theirs = {
            n: weakest(laid, [contest.rivals[n]], cell)
            for n in range(len(floors))
            if floors[n] <= band
        }
        yield from nested(laid, cell, levels, mine, theirs, is_outer=is_outer)


def nested(
    laid: Laid,
    cell: int,
    levels: tuple[Fraction, Fraction],
    mine: int,
    theirs: Mapping[int, int],
    *,
    is_outer: bool,
) -> Iterator[Part]:
    """Yield stretches of a cell, each with the rivals left below there.

    What is left below is nested: everything up to some element of the order.

    Args:
        laid: The axis.
        cell: The cell.
        levels: As for `parts_of`.
        mine: The element that is the rule's degree.
        theirs: That of each rival that may be left below.
        is_outer: As for `parts_of`.
    """
    rank = laid.cells.start_rank if cell == START else laid.cells.rank[cell]
    for limit in sorted({-1, *(int(rank[e]) for e in theirs.values())}):
        kept = {n: e for n, e in theirs.items() if int(rank[e]) <= limit}
        below = set(kept.values())
        if is_outer:
            part = widest(laid, cell, levels, [mine], below)
        else:
            part = stretch(laid, cell, levels[0], [mine], below)
        if part is not None:
            yield part, union(1 << n for n in kept)
