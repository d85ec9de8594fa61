"""Ties under the product: where are rules one function, and the strongest there?

In a box of cells a rule's strength is a product of polynomials, one on each axis. Two
such products agree on a set with an interior exactly if on every axis one polynomial is
a constant times the other, and the constants multiply to 1: polynomials that agree on
an open set are equal, and on free axes the factorization is unique. On axes that share
inputs this is true as well while no two of them have the same direction, for then no
factor of the one is a multiple of a factor of the other. Branch and bound decides
whether the rules are the strongest somewhere in such a box.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

import msgspec
from msgspec.structs import replace

from fuzzytree.auditing.engine.arrangement import Arrangement, AxisGrid
from fuzzytree.auditing.engine.bounding import wins_by_boxes
from fuzzytree.auditing.engine.clock import Clock, OutOfTimeError
from fuzzytree.auditing.engine.domain import Domain, DomainSide, Point, variable_value
from fuzzytree.auditing.engine.factors import Factored
from fuzzytree.auditing.engine.pieces import ONE, ZERO
from fuzzytree.auditing.engine.pivots import TieQuestion, tie_witness
from fuzzytree.auditing.engine.polynomials import Polynomial, difference, monic
from fuzzytree.auditing.engine.states import (
    Declined,
    Proved,
    State,
    Witness,
    counted,
    point_of,
)
from fuzzytree.auditing.engine.witnesses import (
    START,
    AxisStretch,
    coupled,
    direction_of,
    point_with,
)
from fuzzytree.numerics import outwards


class Run(NamedTuple):
    """Neighbouring cells of an axis, by number; `START` twice is its only value."""

    first: int
    last: int


Box = tuple[Run, ...]
"""A run on each axis."""

_Form = tuple[Fraction, Polynomial]


class Proportions(msgspec.Struct, frozen=True, eq=False, dict=True):
    """The rules of a ground, to be compared as functions on boxes of cells."""

    # the rules, joined by the product, and the box, which is not empty
    base: Arrangement

    @functools.cached_property
    def factored(self) -> Factored:
        """The rules as polynomials."""
        return Factored(self.base)

    @property
    def grids(self) -> tuple[AxisGrid, ...]:
        """The axes."""
        return self.base.grids

    @functools.cached_property
    def whole(self) -> Box:
        """All of the domain."""
        count = [len(grid.cells.between) for grid in self.grids]
        return tuple(Run(0, n - 1) if n else Run(START, START) for n in count)

    def boxes(self, one: int, other: int, within: Box) -> Iterator[Box]:
        """Yield all boxes on which two rules are one function that is not 0.

        `within`: where they are looked for.
        """
        runs: list[list[tuple[Run, Fraction]]] = []
        for axis, run in enumerate(within):
            result = [*self._runs(axis, one, other, run)]
            if not result:
                return
            runs.append(result)
        reach = [{ONE}]  # what the ratios of the last axes can multiply to
        for of in reversed(runs):
            reach.append({a * b for a in {ratio for _, ratio in of} for b in reach[-1]})
        reach.reverse()
        todo: list[tuple[Box, Fraction]] = [((), ONE)]
        while todo:
            box, ratio = todo.pop()
            if 1 / ratio not in reach[len(box)]:
                continue
            if len(box) == len(within):
                yield box
            else:
                todo += [((*box, run), ratio * by) for run, by in runs[len(box)]]

    def are_one(self, one: int, other: int, box: Box) -> bool:
        """Return whether two rules are one function on all of a box."""
        whole = ONE
        for axis, run in enumerate(box):
            if self.is_shared(axis, one, other):
                continue
            if any(self.vague(axis, run)):
                return False
            ratios = {
                self._ratio(axis, one, other, cell)
                for cell in _cells(run)
                if not self._is_zero(axis, one, cell)
                or not self._is_zero(axis, other, cell)
            }
            if not ratios:
                return True  # both are 0
            ratio = ratios.pop()
            if ratios or ratio is None:
                return False
            whole *= ratio
        return whole == 1

    def is_told(self, one: int, other: int) -> bool:
        """Return whether cells tell all about two rules: none is hidden in a zone."""
        return not any(
            any(self.vague(axis, run)) and not self.is_shared(axis, one, other)
            for axis, run in enumerate(self.whole)
        )

    def vague(self, axis: int, run: Run) -> Sequence[bool]:
        """Return of each place within a run, its ends too, if it may hide a cell."""
        result: list[bool] = self.grids[axis].cells.is_vague.tolist()
        return result[max(run.first, 0) : run.last + 2]

    @functools.cached_property
    def is_shared(self) -> Callable[[int, int, int], bool]:
        """Whether two rules ask the same of an axis, in whatever order."""
        return functools.cache(self._is_shared)

    def _is_shared(self, axis: int, one: int, other: int) -> bool:
        question = self.factored.propositions[axis]
        return sorted(question[one]) == sorted(question[other])

    def are_free(self, one: int, other: int) -> bool:
        """Return whether no two axes on which rules differ have one direction."""
        result: list[tuple[tuple[int, Fraction], ...]] = []
        for axis, grid in enumerate(self.grids):
            if self.is_shared(axis, one, other):
                continue
            direction = direction_of(self.base, axis)
            if direction and not grid.cells.between:
                return False  # one value of a combination makes inputs depend
            if direction in result:
                return False
            if direction:
                result.append(direction)
        return True

    @functools.cached_property
    def _form(self) -> Callable[[int, int, int], _Form]:
        return functools.cache(self._form_in)

    def _form_in(self, axis: int, rule: int, cell: int) -> _Form:
        """Return a rule's polynomial in a cell: the last number, and the rest by it."""
        if cell == START:
            polynomial: Polynomial = (self.factored.at_start(axis, rule),)
        else:
            polynomial = self.factored.polynomial(axis, rule, cell)
        polynomial = difference(polynomial, (ZERO,))
        return polynomial[-1], monic(polynomial)

    def _is_zero(self, axis: int, rule: int, cell: int) -> bool:
        return not self._form(axis, rule, cell)[0]

    def _ratio(self, axis: int, one: int, other: int, cell: int) -> Fraction | None:
        """Return one rule by another one in a cell; None if it varies, or is 0."""
        (a, p), (b, q) = (self._form(axis, rule, cell) for rule in (one, other))
        return a / b if a and b and p == q else None

    def _runs(
        self, axis: int, one: int, other: int, within: Run
    ) -> Iterator[tuple[Run, Fraction]]:
        """Yield runs on which two rules are in one ratio, as long as they can be."""
        if self.is_shared(axis, one, other):
            yield within, ONE
            return
        is_vague = self.grids[axis].cells.is_vague
        first, known = within.first, None
        for cell in _cells(within):
            ratio = self._ratio(axis, one, other, cell)
            if ratio == known and not (cell > first and is_vague[cell]):
                continue
            if known is not None:
                yield Run(first, cell - 1), known
            first, known = cell, ratio
        if known is not None:
            yield Run(first, within.last), known

    def ends(self, axis: int, run: Run) -> tuple[Fraction, Fraction]:
        """Return the ends of a run; those of the axis where it reaches them."""
        cells = self.grids[axis].cells
        if run == self.whole[axis]:
            return cells.zones[0][0], cells.zones[-1][1]
        low = cells.between[run.first][0] if run.first else cells.zones[0][0]
        is_last = run.last == len(cells.between) - 1
        high = cells.zones[-1][1] if is_last else cells.between[run.last][1]
        return low, high


def _cells(run: Run) -> range:
    return range(run.first, run.last + 1)


# --- ties

_MOST_BOXES: Final = 500  # of cells, in one question
_SHARE: Final = 0.25  # of the time that is left, for one box
_NEAR: Final = (3, 6, 12, 24, 48)  # halvings of the way from a point to the middle
_TOLERANCE: Final = 1e-6  # of a lead, at which boxes end


def tie_of_products(base: Arrangement, question: TieQuestion, clock: Clock) -> State:
    """Return what `ties.tie` does, under the product.

    Raises:
        OutOfTimeError: If the clock is over.
        TooManyCellsError: If the axes are too large.
    """
    search = _Search(Proportions(base), question, clock)
    mine, *others = (rule - 1 for rule in (*question.ours, *question.weak))
    if not all(search.of.is_told(mine, other) for other in others):
        search.of = Proportions(base.fine)
    result = search.run()
    if result is not None:
        return result
    if search.why:
        return question.open(search.why)
    if not all(search.of.are_free(mine, other) for other in others):
        reason = "the inputs of its variables depend on each other"
        return Declined("FTD04", reason)
    if not all(search.of.is_told(mine, other) for other in others):
        return Declined("FTD04", "two places of an axis are too near to tell")
    boxes = counted(len(search.visited), "box", "boxes")
    return Proved(f"{boxes} of cells visited in which they are one function")


class _Search:
    """One question.

    Attributes:
        of: The rules.
        question: Which of them.
        clock: How much time there is.
        visited: The boxes of the search so far.
        why: What left a box open, if any was.
    """

    def __init__(self, of: Proportions, question: TieQuestion, clock: Clock) -> None:
        self.of, self.question, self.clock = of, question, clock
        self.visited: set[Box] = set()
        self.why = ""
        base = of.base
        self.joined = {axis for group in coupled(base) for axis in group}

    def run(self) -> Witness | None:
        """Return a point, or None if there is none, or none was found."""
        mine, *others = (rule - 1 for rule in self.question.ours)
        todo: list[Iterable[Box]] = [
            self.of.boxes(mine, others[0], self.of.whole) if others else [self.of.whole]
        ]
        while todo:
            for box in todo.pop():
                self.clock.check()
                if box in self.visited:
                    continue
                if len(self.visited) == _MOST_BOXES:
                    raise OutOfTimeError
                self.visited.add(box)
                same = {
                    rule
                    for rule in self.question.rivals
                    if self.of.are_one(mine, rule - 1, box)
                }
                if same & {*self.question.strict}:
                    continue
                result = self._leads(box, same)
                if result is not None:
                    return result
                todo.append(self._parts(box, same))
        return None

    def _parts(self, box: Box, same: set[int]) -> Iterator[Box]:
        """Yield the parts of a box in which more rivals are the same function."""
        mine = self.question.ours[0] - 1
        for rule in self.question.weak:
            if rule not in same:
                yield from self.of.boxes(mine, rule - 1, box)

    def _leads(self, box: Box, same: set[int]) -> Witness | None:
        """Return a point of a box at which all but some rivals are weaker."""
        rivals = [rule for rule in self.question.rivals if rule not in same]
        rules, rule = self.of.base.rules, self.question.ours[0]
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
                result = self._near(box, point_of(state.point))
                if result is not None:
                    return result
        result = self._near(box, None)  # there may be no double in it
        if result is None:
            self.why = "no point is known where they lead, and none is excluded"
        return result

    def _near(self, box: Box, point: Point | None) -> Witness | None:
        """Return a point of a box at which they tie, if one near another does."""
        base = self.of.base
        ends = enumerate(self.of.ends(axis, run) for axis, run in enumerate(box))
        wanted = {n: AxisStretch(*of, is_open=of[0] < of[1]) for n, of in ends}
        middle = point_with(base, wanted)
        tried = [] if point is None else [point]
        if middle is not None:
            start = point or middle
            tried += [
                {name: x + (middle[name] - x) / 2**bits for name, x in start.items()}
                for bits in (_NEAR if point else (0,))
            ]
        for one in tried:
            if self._is_inside(box, one):
                result = tie_witness(base, self.question, one)
                if result is not None:
                    return result
        return None

    def _domain(self, box: Box, *, is_outer: bool) -> Domain | None:
        """Return a box with doubles for its ends, around it or within it."""
        domain = self.of.base.domain
        sides = {side.variable: side for side in domain.sides}
        for axis, run in enumerate(box):
            variable = self.of.grids[axis].axis.variable
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
            sides[variable.name] = DomainSide(
                variable.name, first, last, is_open=is_open
            )
        return Domain(tuple(sides.values()))

    def _is_inside(self, box: Box, point: Point) -> bool:
        """Return whether points with an interior about one, or below, are in a box."""
        for axis, run in enumerate(box):
            grid = self.of.grids[axis]
            value = variable_value(grid.axis.variable, point)
            if axis in self.joined and grid.cells.between:
                cells = grid.cells.between[run.first : run.last + 1]
                if not any(low < value < high for low, high in cells):
                    return False
                continue
            low, high = self.of.ends(axis, run)
            if not (low < value <= high or low == value == high):
                return False
        return True
