"""The question of `cells` under the product, by ever smaller boxes.

On a box of cells the strength of a rule is bounded axis by axis, and so is the ratio
of two rules: of two lines it is largest at an end. A box is done where a rival is at
least as strong as one of the rules, or where the middle shows the opposite; else it is
halved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.rechecking.cells import (
    Axis,
    Cell,
    Cells,
    Interval,
    Needs,
    numbers_in,
)
from fuzzytree.rechecking.models import ONE, ZERO
from fuzzytree.rechecking.outcomes import UndecidedError

BOX = 500  # steps that a box takes
HALF = Fraction(1, 2)
_NONE = Fraction(2**4096)  # a ratio of which nothing is known


class _Stretch(NamedTuple):
    """Some cells of an axis, or a part of one."""

    axis: Axis
    cells: tuple[Cell, ...]


Box = tuple[_Stretch, ...]


def exists(
    cells: Cells,
    mine: Sequence[Needs],
    rivals: Sequence[Needs],
    low: Fraction = ZERO,
    high: Fraction = ONE,
) -> bool:
    """Return whether all of some rules reach a level that no rival does, somewhere.

    Raises:
        UndecidedError: If it takes too many boxes.
    """
    todo: list[Box] = [tuple(_Stretch(axis, tuple(axis.cells)) for axis in cells.axes)]
    while todo:
        box = todo.pop()
        cells.limit.spend(BOX)
        least, most = _between(box, mine, rivals)
        if most[0] <= max(low, least[1]) or least[1] >= high:
            continue
        if any(ratio(box, a, b) <= 1 for a in mine for b in rivals):
            continue
        least, most = _between(_middle(box), mine, rivals)
        if least[0] > max(low, most[1]) and most[1] < high:
            return True
        todo += _halves(box)
    return False


def _between(
    box: Box, mine: Sequence[Needs], rivals: Sequence[Needs]
) -> tuple[Interval, Interval]:
    """Return bounds of the weakest of some rules and of the strongest of others.

    The lower bounds of both, and the upper bounds of both.
    """
    ours, theirs = ([strength(box, one) for one in of] for of in (mine, rivals))
    lower, upper = (
        (
            min((one[side] for one in ours), default=ONE),
            max((one[side] for one in theirs), default=ZERO),
        )
        for side in (0, 1)
    )
    return lower, upper


def _middle(box: Box) -> Box:
    return tuple(
        _Stretch(axis, (cells[len(cells) // 2].part(HALF, HALF),))
        for axis, cells in box
    )


def _halves(box: Box) -> list[Box]:
    """Return the two halves of a box: of its longest row of cells, or widest change."""
    sizes = [
        (len(s.cells), max((abs(p - q) for p, q in s.cells[0].upper), default=ZERO))
        for s in box
    ]
    place = max(range(len(box)), key=sizes.__getitem__)
    axis, cells = box[place]
    half = len(cells) // 2
    if half:
        halves = [cells[:half], cells[half:]]
    elif sizes[place][1]:
        halves = [(cells[0].part(a, b),) for a, b in ((ZERO, HALF), (HALF, ONE))]
    else:
        raise UndecidedError("degrees that are enclosed too widely")
    return [(*box[:place], _Stretch(axis, one), *box[place + 1 :]) for one in halves]


def strength(box: Box, rule: Needs) -> Interval:
    """Return between which numbers the strength of a rule lies on a box."""
    low = high = ONE
    for (_, cells), needs in zip(box, rule, strict=True):
        own = numbers_in(needs)
        if own:
            low *= min(_product(cell.lower, own, min) for cell in cells)
            high *= max(_product(cell.upper, own, max) for cell in cells)
    return low, high


def _product(
    lines: Sequence[Interval],
    numbers: Sequence[int],
    choose: Callable[[Interval], Fraction],
) -> Fraction:
    return math.prod((choose(lines[n]) for n in numbers), start=ONE)


def ratio(box: Box, rule: Needs, rival: Needs) -> Fraction:
    """Return an upper bound of a rule's strength divided by a rival's, on a box."""
    result = ONE
    for (_, cells), one, other in zip(box, rule, rival, strict=True):
        if one != other:
            ours, theirs = numbers_in(one & ~other), numbers_in(other & ~one)
            result *= max(_ratio(cell, ours, theirs) for cell in cells)
    return result


def _ratio(cell: Cell, ours: Sequence[int], theirs: Sequence[int]) -> Fraction:
    if len(ours) == len(theirs) == 1:
        pairs = [*zip(cell.upper[ours[0]], cell.lower[theirs[0]], strict=True)]
        ends = [p / q for p, q in pairs if q]
        if ends and not any(p and not q for p, q in pairs):
            return max(ends)  # where both are 0, two lines have one ratio
    most = _product(cell.upper, ours, max)
    least = _product(cell.lower, theirs, min)
    return most / least if least else _NONE if most else ZERO


def tie(cells: Cells, one: int, other: int, rivals: Sequence[int]) -> bool:
    """Return whether two rules can be equal on an open set, no rival above them.

    Products are equal there only if on each axis their ratio is one number.
    """
    pair = cells.of[one], cells.of[other]
    choices: list[list[tuple[Fraction, _Stretch]]] = []
    for place, axis in enumerate(cells.axes):
        open_cells = (
            cell
            for cell in axis.cells
            if cell.low < cell.high or axis.ends[0] == axis.ends[1]
        )
        ratios = ((_fixed(c, pair[0][place], pair[1][place]), c) for c in open_cells)
        choices.append([(r, _Stretch(axis, (c,))) for r, c in ratios if r is not None])
    cells.limit.spend(BOX * math.prod(map(len, choices)))
    for chosen in itertools.product(*choices):
        box = tuple(stretch for _, stretch in chosen)
        is_one = math.prod((share for share, _ in chosen), start=ONE) == 1
        if not (is_one and strength(box, pair[0])[1]):
            continue
        if not any(_is_above(box, cells.of[r], pair[0]) for r in rivals):
            return True
    return False


def _is_above(box: Box, rival: Needs, rule: Needs) -> bool:
    """Return whether a rival is above a rule in all of the inside of a box."""
    return ratio(box, rule, rival) <= 1 and ratio(_middle(box), rule, rival) < 1


def _fixed(cell: Cell, one: int, other: int) -> Fraction | None:
    """Return the one ratio that two rules have in a cell; None if it changes.

    Raises:
        UndecidedError: If it may be one, and is not a ratio of lines.
    """
    both = [numbers_in(one & ~other), numbers_in(other & ~one)]
    every = [*both[0], *both[1]]
    has_change = any(len({*cell.lower[n]}) > 1 for n in every)
    if has_change and max(map(len, both)) > 1:
        raise UndecidedError("products of several degrees of one variable")
    if any(cell.lower[n] != cell.upper[n] for n in every):
        raise UndecidedError("a tie of curves that are no lines")
    (a, b), (c, d) = (
        [math.prod((cell.lower[n][k] for n in of), start=ONE) for k in (0, 1)]
        for of in both
    )
    if a * d != b * c or not (c or d):
        return None if c or d or a or b else ONE
    return a / c if c else b / d
