"""The question of `cells` under the product, by ever smaller boxes.

On a box of cells the strength of a rule is bounded axis by axis, and so is the ratio
of two rules: of two lines it is largest at an end. A box is done where a rival is at
least as strong as one of the rules, or where the middle shows the opposite; else it is
halved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.recheck.cells import Axis, Cell, Cells, Function, Needs
from fuzzytree.auditing.recheck.models import ONE, ZERO
from fuzzytree.auditing.recheck.outcomes import UndecidedError

MOST_BOXES = 3_000
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
    for _ in range(MOST_BOXES):
        if not todo:
            return False
        box = todo.pop()
        if _is_settled(box, mine, rivals, low, high):
            continue
        if _is_shown(box, mine, rivals, low, high):
            return True
        todo += _halves(box)
    raise UndecidedError(f"more than {MOST_BOXES:,} boxes")


def _is_settled(
    box: Box,
    mine: Sequence[Needs],
    rivals: Sequence[Needs],
    low: Fraction,
    high: Fraction,
) -> bool:
    most = min((strength(box, one)[1] for one in mine), default=ONE)
    least = max((strength(box, one)[0] for one in rivals), default=ZERO)
    if most <= max(low, least) or least >= high:
        return True
    return any(ratio(box, a, b) <= 1 for a in mine for b in rivals)


def _is_shown(
    box: Box,
    mine: Sequence[Needs],
    rivals: Sequence[Needs],
    low: Fraction,
    high: Fraction,
) -> bool:
    middle = tuple(
        _Stretch(axis, (_part(cells[len(cells) // 2], Fraction(1, 2), Fraction(1, 2)),))
        for axis, cells in box
    )
    least = min((strength(middle, one)[0] for one in mine), default=ONE)
    most = max((strength(middle, one)[1] for one in rivals), default=ZERO)
    return least > max(low, most) and most < high


def _part(cell: Cell, u: Fraction, v: Fraction) -> Cell:
    """Return the part of a cell between two shares of its width."""
    ends = cell.low, cell.high
    low, high = (ends[0] + w * (ends[1] - ends[0]) for w in (u, v))
    return Cell(low, high, [(p + u * (q - p), p + v * (q - p)) for p, q in cell.lines])


def _halves(box: Box) -> list[Box]:
    """Return the two halves of a box: of its longest row of cells, or widest change."""
    sizes = [
        (len(s.cells), max((abs(p - q) for p, q in s.cells[0].lines), default=ZERO))
        for s in box
    ]
    place = max(range(len(box)), key=sizes.__getitem__)
    axis, cells = box[place]
    half = len(cells) // 2
    if half:
        halves = [cells[:half], cells[half:]]
    elif sizes[place][1]:
        middle = Fraction(1, 2)
        halves = [(_part(cells[0], a, b),) for a, b in ((ZERO, middle), (middle, ONE))]
    else:
        raise UndecidedError("degrees that are enclosed too widely")
    return [(*box[:place], _Stretch(axis, one), *box[place + 1 :]) for one in halves]


def strength(box: Box, rule: Needs) -> tuple[Fraction, Fraction]:
    """Return between which numbers the strength of a rule lies on a box."""
    low = high = ONE
    for (axis, cells), needs in zip(box, rule, strict=True):
        own = [f for n, f in enumerate(axis.functions) if needs >> n & 1]
        if own:
            ranges = [_product(own, cell) for cell in cells]
            low, high = (
                low * min(a for a, _ in ranges),
                high * max(b for _, b in ranges),
            )
    return low, high


def _product(functions: Sequence[Function], cell: Cell) -> tuple[Fraction, Fraction]:
    low = math.prod((min(f.ends(cell, is_upper=False)) for f in functions), start=ONE)
    high = math.prod((max(f.ends(cell, is_upper=True)) for f in functions), start=ONE)
    return low, high


def ratio(box: Box, rule: Needs, rival: Needs) -> Fraction:
    """Return an upper bound of a rule's strength divided by a rival's, on a box."""
    result = ONE
    for (axis, cells), one, other in zip(box, rule, rival, strict=True):
        ours, theirs = (
            [f for n, f in enumerate(axis.functions) if bits >> n & 1]
            for bits in (one & ~other, other & ~one)
        )
        if ours or theirs:
            result *= max(_ratio(cell, ours, theirs) for cell in cells)
    return result


def _ratio(
    cell: Cell, ours: Sequence[Function], theirs: Sequence[Function]
) -> Fraction:
    if len(ours) == len(theirs) == 1:
        a, b = ours[0].ends(cell, is_upper=True), theirs[0].ends(cell, is_upper=False)
        ends = [p / q for p, q in zip(a, b, strict=True) if q]
        if len(ends) == 2 or (
            ends and not any(p and not q for p, q in zip(a, b, strict=True))
        ):
            return max(ends)  # where both are 0, two lines have one ratio
    most, least = _product(ours, cell)[1], _product(theirs, cell)[0]
    return most / least if least else _NONE if most else ZERO


def tie(cells: Cells, one: int, other: int, rivals: Sequence[int]) -> bool:
    """Return whether two rules can be equal on an open set, no rival above them.

    Products are equal there only if on each axis their ratio is one number.
    """
    pair = cells.of[one], cells.of[other]
    choices: list[list[tuple[Fraction, _Stretch]]] = []
    for place, axis in enumerate(cells.axes):
        own: list[tuple[Fraction, _Stretch]] = []
        for cell in axis.cells:
            if cell.low == cell.high and axis.ends[0] < axis.ends[1]:
                continue
            stretch = _Stretch(axis, (cell,))
            ratios = [
                _fixed(axis, cell, a[place], b[place]) for a, b in (pair, pair[::-1])
            ]
            if ratios[0] is not None:
                own.append((ratios[0], stretch))
        choices.append(own)
    if math.prod(map(len, choices)) > MOST_BOXES:
        raise UndecidedError(f"more than {MOST_BOXES:,} boxes")
    for chosen in itertools.product(*choices):
        if math.prod((share for share, _ in chosen), start=ONE) != 1:
            continue
        box = tuple(stretch for _, stretch in chosen)
        if not strength(box, pair[0])[1]:
            continue
        if not any(_is_above(box, cells.of[r], pair[0]) for r in rivals):
            return True
    return False


def _is_above(box: Box, rival: Needs, rule: Needs) -> bool:
    """Return whether a rival is above a rule in all of the inside of a box."""
    if ratio(box, rule, rival) > 1:
        return False
    middle = tuple(
        _Stretch(a, (_part(c[0], Fraction(1, 2), Fraction(1, 2)),)) for a, c in box
    )
    return ratio(middle, rule, rival) < 1


def _fixed(axis: Axis, cell: Cell, one: int, other: int) -> Fraction | None:
    """Return the one ratio that two rules have in a cell; None if it changes.

    Raises:
        UndecidedError: If it may be one, and is not a ratio of lines.
    """
    ours, theirs = (
        [f for n, f in enumerate(axis.functions) if bits >> n & 1]
        for bits in (one & ~other, other & ~one)
    )
    if len(ours) > 1 or len(theirs) > 1:
        flat = [f for f in (*ours, *theirs) if len({*f.ends(cell, is_upper=False)}) > 1]
        if flat:
            raise UndecidedError("products of several degrees of one variable")
    ends = [
        [f.ends(cell, is_upper=up) for f in of]
        for of in (ours, theirs)
        for up in (False, True)
    ]
    if ends[0] != ends[1] or ends[2] != ends[3]:
        raise UndecidedError("a tie of curves that are no lines")
    products = [
        [math.prod((e[k] for e in of), start=ONE) for k in (0, 1)]
        for of in (ends[0], ends[2])
    ]
    (a, b), (c, d) = products
    if a * d != b * c or not (c or d):
        return None if c or d or a or b else ONE
    return a / c if c else b / d
