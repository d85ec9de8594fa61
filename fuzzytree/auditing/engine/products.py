"""Ties under the product: on boxes where rules are one function, are they strongest?

Where rules tie on a set with an interior they are one function on a box of cells
(`fuzzytree.auditing.engine.proportions`). Whether they are the strongest somewhere in
it, but for rivals that are that function too, is asked of branch and bound.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from msgspec.structs import replace

from fuzzytree.auditing.engine.bounding import wins_by_boxes
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Domain, Side
from fuzzytree.auditing.engine.ground import Ground
from fuzzytree.auditing.engine.parts import Stretch
from fuzzytree.auditing.engine.proportions import Box, Proportions
from fuzzytree.auditing.engine.states import Declined, Proved, State, Witness, point_of
from fuzzytree.auditing.engine.tied import Asked, checked
from fuzzytree.auditing.engine.variables import Point, variable_value
from fuzzytree.auditing.engine.witnesses import coupled, point_with
from fuzzytree.auditing.engine.wording import counted
from fuzzytree.numerics.exact import outwards

_MOST_BOXES: Final = 500  # of cells, in one question
_SHARE: Final = 0.25  # of the time that is left, for one box
_NEAR: Final = (3, 6, 12, 24, 48)  # halvings of the way from a point to the middle
_TOLERANCE: Final = 1e-6  # of a lead, at which boxes end


def tie_of_products(given: Ground, asked: Asked, clock: Clock) -> State:
    """Return whether rules are the strongest on a set with an interior.

    Args:
        given: The rules, joined by the product, and the box, which is not empty.
        asked: Which of them.
        clock: How much time there is.

    Returns:
        `Proved`: they nowhere are. `Witness`: here they are. `Bracket`: time, or a
        lead that is too small to tell, leaves it open. `Declined`: axes of one
        direction do, or places too near to each other.

    Raises:
        OutOfTimeError: If the clock is over.
        TooManyCellsError: If the axes are too large.
    """
    search = _Search(Proportions(given), asked, clock)
    mine, *others = (rule - 1 for rule in (*asked.ours, *asked.weak))
    if not all(search.of.is_told(mine, other) for other in others):
        search.of = Proportions(given.fine)
    found = search.found()
    if found is not None:
        return found
    if search.why:
        return asked.open(search.why)
    if not all(search.of.are_free(mine, other) for other in others):
        reason = "the inputs of its variables depend on each other"
        return Declined("FTD04", reason)
    if not all(search.of.is_told(mine, other) for other in others):
        return Declined("FTD04", "two places of an axis are too near to tell")
    boxes = counted(len(search.seen), "box", "boxes")
    return Proved(f"{boxes} of cells visited in which they are one function")


class _Search:
    """One question.

    Attributes:
        of: The rules.
        asked: Which of them.
        clock: How much time there is.
        seen: The boxes that were asked about.
        why: What left a box open, if any was.
    """

    def __init__(self, of: Proportions, asked: Asked, clock: Clock) -> None:
        self.of, self.asked, self.clock = of, asked, clock
        self.seen: set[Box] = set()
        self.why = ""
        given = of.ground
        self.joined = {axis for group in coupled(given) for axis in group}

    def found(self) -> Witness | None:
        """Return a point, or None if there is none, or none was found."""
        mine, *others = (rule - 1 for rule in self.asked.ours)
        todo: list[Iterable[Box]] = [
            self.of.boxes(mine, others[0], self.of.whole) if others else [self.of.whole]
        ]
        while todo:
            for box in todo.pop():
                self.clock.check()
                if box in self.seen:
                    continue
                if len(self.seen) == _MOST_BOXES:
                    raise OutOfTimeError
                self.seen.add(box)
                same = {
                    rule
                    for rule in self.asked.rivals
                    if self.of.are_one(mine, rule - 1, box)
                }
                if same & {*self.asked.strict}:
                    continue
                found = self._leads(box, same)
                if found is not None:
                    return found
                todo.append(self._parts(box, same))
        return None

    def _parts(self, box: Box, same: set[int]) -> Iterator[Box]:
        """Yield the parts of a box in which more rivals are the same function."""
        mine = self.asked.ours[0] - 1
        for rule in self.asked.weak:
            if rule not in same:
                yield from self.of.boxes(mine, rule - 1, box)

    def _leads(self, box: Box, same: set[int]) -> Witness | None:
        """Return a point of a box at which all but some rivals are weaker."""
        rivals = [rule for rule in self.asked.rivals if rule not in same]
        rules, rule = self.of.ground.rules, self.asked.ours[0]
        for is_outer in (True, False):
            domain = self._domain(box, is_outer=is_outer)
            if domain is None:
                break
            clock = self.clock.share(_SHARE)
            state = wins_by_boxes(
                rules, domain, rule, rivals, clock, tolerance=_TOLERANCE
            )
            if isinstance(state, Proved) and is_outer:
                return None
            if isinstance(state, Witness):
                found = self._near(box, point_of(state.point))
                if found is not None:
                    return found
        found = self._near(box, None)  # there may be no double in it
        if found is None:
            self.why = "no point is known where they lead, and none is excluded"
        return found

    def _near(self, box: Box, point: Point | None) -> Witness | None:
        """Return a point of a box at which they tie, if one near another does."""
        given = self.of.ground
        ends = enumerate(self.of.ends(axis, run) for axis, run in enumerate(box))
        wanted = {n: Stretch(*of, is_open=of[0] < of[1]) for n, of in ends}
        middle = point_with(given, wanted)
        tried = [] if point is None else [point]
        if middle is not None:
            start = point or middle
            tried += [
                {name: x + (middle[name] - x) / 2**bits for name, x in start.items()}
                for bits in (_NEAR if point else (0,))
            ]
        for one in tried:
            if self._is_inside(box, one):
                found = checked(given, self.asked, one)
                if found is not None:
                    return found
        return None

    def _domain(self, box: Box, *, is_outer: bool) -> Domain | None:
        """Return a box with doubles for its ends, around it or within it."""
        domain = self.of.ground.domain
        sides = {side.variable: side for side in domain.sides}
        for axis, run in enumerate(box):
            variable = self.of.laid[axis].axis.variable
            known = sides.get(variable.name)
            if run == self.of.whole[axis]:
                if known is not None and known.low < known.high:
                    # What holds at an end alone has no interior.
                    sides[variable.name] = replace(known, is_open=True)
                continue
            low, high = self.of.ends(axis, run)
            (below, first), (last, above) = outwards(low), outwards(high)
            if is_outer:
                first, last = below, above
            # The value at a lower end belongs to the cell before.
            is_open = first == low
            if first > last or (first == last and is_open):
                return None
            sides[variable.name] = Side(variable.name, first, last, is_open=is_open)
        return Domain(tuple(sides.values()))

    def _is_inside(self, box: Box, point: Point) -> bool:
        """Return whether points with an interior about one, or below, are in a box."""
        for axis, run in enumerate(box):
            laid = self.of.laid[axis]
            value = variable_value(laid.axis.variable, point)
            if axis in self.joined and laid.cells.between:
                cells = laid.cells.between[run.first : run.last + 1]
                if not any(low < value < high for low, high in cells):
                    return False
                continue
            low, high = self.of.ends(axis, run)
            if not (low < value <= high or low == value == high):
                return False
        return True
