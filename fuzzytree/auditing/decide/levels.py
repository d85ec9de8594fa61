"""Levels and masks: the question under the minimum, complete where degrees are lines.

At one level every axis falls into cells, each with a mask of the rules that still reach
the level there. A point is one cell of each axis, and a rule reaches the level exactly
if its bit is in all masks. So a walk over the axes that keeps the smallest masks of
rivals decides a level, and one level between each two critical ones decides all.

Rivals join the question only when a point needs them, the strongest first: so axes have
few literals and few levels, and the rivals that suffice for a proof come out with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

from fuzzytree.auditing.decide.answers import (
    ONE,
    ZERO,
    Answer,
    Budget,
    Open,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.axes import Axis, Cell
from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.rules import Literal

_MOST_LAYERS = 20_000

_Choice = dict[str, tuple[Cell, int]]
_Ceiling = tuple[Fraction, bool]  # a level, and whether it is itself still to be tried
_TOP: _Ceiling = (ONE + 1, False)


class TooManyError(Exception):
    """There are more levels, lines or smallest masks than are looked at."""


_MOST_LEVELS = 4_000


class Interior(NamedTuple):
    """Only points around which it stays so: all but one of the axes are free to move.

    Attributes:
        axis: The axis that is not, on which a level is met within one of some pieces.
        pieces: Their ends.
    """

    axis: str = ""
    pieces: tuple[tuple[Fraction, Fraction], ...] = ()

    def cells(
        self, axis: Axis, level: Fraction, budget: Budget, *, is_at: bool
    ) -> Iterator[Cell]:
        """Yield the cells of an axis; at the very level, or at one that is like it."""
        if axis.name == self.axis:
            for cell in axis.cells_at(level, budget):
                if not cell.is_wide and any(a < cell.x < b for a, b in self.pieces):
                    yield cell
            return
        is_free = bool(axis.values) or axis.low == axis.high
        place = 0 if is_at else axis.place(level)
        cells = axis.cells_at(level, budget) if is_at else axis.cells(place, budget)
        yield from (cell for cell in cells if cell.is_wide or is_free)


class LevelView:
    """Some rules of a base that take the minimum, on axes with their literals alone."""

    def __init__(
        self,
        base: Base,
        rules: Iterable[int],
        budget: Budget,
        interior: Interior | None = None,
    ) -> None:
        self.base, self.interior = base, interior
        self.rules = tuple(sorted(set(rules)))
        literals: dict[str, set[Literal]] = {}
        self.alone: dict[tuple[str, Literal], int] = {}
        factors = {ZERO, ONE}
        for place in self.rules:
            rule = base.rules[place]
            factors.add(rule.factor)
            for name, literal in rule.literals:
                literals.setdefault(name, set()).add(literal)
                if sum(name == other for other, _ in rule.literals) == 1:
                    key = name, literal
                    self.alone[key] = self.alone.get(key, 0) | 1 << place
        self.axes = [
            base.axes[name].with_literals(frozenset(own))
            for name, own in literals.items()
        ]
        self.factors = factors
        budget.spend(10 * sum(map(len, literals.values())))
        if not all(axis.is_crossed for axis in self.axes):
            raise TooManyError
        for axis in self.axes:
            axis.arrange(budget)

    @cached_property
    def levels(self) -> list[Fraction]:
        """The critical levels in order, which a question with a level of its own skips.

        Raises:
            TooManyError: If there are too many.
        """
        own = self.factors.union(*(axis.levels for axis in self.axes))
        if len(own) > _MOST_LEVELS:
            raise TooManyError
        return sorted(level for level in own if 0 <= level <= 1)

    def choice(
        self, question: Question, level: Fraction, budget: Budget, *, loose: bool
    ) -> _Choice | None:
        """Return a cell of each axis in which together it is so, None if there is none.

        With `loose`, where degrees are enclosed, it may be so: none is a proof.

        Raises:
            TooManyError: If there are too many masks.
        """
        base, count = self.base, self.base.count
        ours = _bits(question.reach)
        strict = _bits(i for i in question.rivals if base.rules[i].factor >= level)
        weak = _bits(i for i in question.weak if base.rules[i].factor > level)
        start = strict | weak << count
        options: list[tuple[str, dict[int, Cell]]] = []
        for axis in self.axes:
            kept = self._companions(axis, question) if loose else 0
            masks: dict[int, Cell] = {}
            if self.interior is not None:
                cells = [*self.interior.cells(axis, level, budget, is_at=False)]
            elif question.level is not None:
                cells = [*axis.cells_at(level, budget)]
            else:
                cells = axis.cells(axis.place(level), budget)
            budget.spend(2 * len(cells) + 4)
            for cell in cells:
                mine = cell.masks.perhaps if loose else cell.masks.surely
                if mine & ours != ours:
                    continue
                if loose:
                    at, above = cell.masks.surely | kept, cell.masks.surely_above
                else:
                    at, above = cell.masks.perhaps, cell.masks.perhaps_above
                masks.setdefault((at & strict) | (above & weak) << count, cell)
            if not masks:
                return None
            options.append((axis.name, masks))
        way = common([[*masks] for _, masks in options], start, budget, _MOST_LAYERS)
        if way is None:
            return None
        pairs = zip(options, way, strict=True)
        return {name: (masks[mask], mask) for (name, masks), mask in pairs}

    def _companions(self, axis: Axis, question: Question) -> int:
        """Return the rules that reach a level on an axis because ours do.

        Their only literal there is one of ours, whatever its degree is.
        """
        result = 0
        for place in question.reach:
            for name, literal in self.base.rules[place].literals:
                if name == axis.name:
                    result |= self.alone.get((name, literal), 0)
        return result

    def point(
        self, level: Fraction, choice: _Choice, budget: Budget
    ) -> dict[str, Fraction] | None:
        """Return a point in chosen cells, taken at the very level."""
        values: dict[str, Fraction] = {}
        for axis in self.axes:
            masks = choice[axis.name][0].masks
            cells = axis.cells_at(level, budget)
            if self.interior is not None:
                cells = self.interior.cells(axis, level, budget, is_at=True)
            values[axis.name] = next(c.x for c in cells if c.masks == masks)
        return self.base.point(values)


def by_levels(
    base: Base, question: Question, interior: Interior | None, budget: Budget
) -> Answer:
    """Decide a question level by level; with `interior` on a part of some width.

    Where degrees are enclosed, `Proved` holds for the curves themselves, and a point is
    one at which bounds of their degrees suffice.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    try:
        return _Search(base, question, budget, interior).run()
    except TooManyError:
        return Open("there are too many levels, or ways to choose cells")


class _Search:
    def __init__(
        self,
        base: Base,
        question: Question,
        budget: Budget,
        interior: Interior | None,
    ) -> None:
        self.base, self.question, self.budget = base, question, budget
        self.interior = interior
        self.members: list[int] = []  # rivals and weak ones that joined
        if base.is_coupled:
            self.members = [*question.rivals, *question.weak]
        self.view = self._view()
        self.count = 0

    def _view(self) -> LevelView:
        rules = (*self.question.reach, *self.members)
        return LevelView(self.base, rules, self.budget, self.interior)

    def run(self) -> Answer:
        is_open, ceiling = False, _TOP
        while True:
            answer, rival, ceiling, is_left = self._descend(ceiling)
            is_open |= is_left
            if answer is not None:
                return answer
            if rival is None:
                break
            self.members.append(rival)
            self.view = self._view()
        if is_open:
            return Open("degrees are known within bounds alone", "FTD02")
        return Proved(f"{self.count} levels", self._necessary_rivals())

    def _descend(
        self, ceiling: _Ceiling
    ) -> tuple[Answer | None, int | None, _Ceiling, bool]:
        """Try levels below a ceiling; return a rival in the way, and where it was."""
        is_open = False
        for level, end in self._levels_below(ceiling):
            self.count += 1
            choice = self._choice(level, loose=True)
            if choice is None:
                continue
            if self.base.is_coupled:
                return Open("axes share inputs", "FTD04"), None, end, True
            answer, rival = self._look(level, choice)
            if answer is None and rival is None:
                answer, rival = self._strictly(level)
            if answer is not None or rival is not None:
                return answer, rival, end, is_open
            is_open = True
        return None, None, ceiling, is_open

    def _levels_below(self, ceiling: _Ceiling) -> Iterator[tuple[Fraction, _Ceiling]]:
        """Yield levels that stand for all up to a ceiling, and how far each does."""
        question, (top, is_closed) = self.question, ceiling
        if question.level is not None:
            yield question.level, ceiling
            return
        factors = [self.base.rules[i].factor for i in question.reach]
        most = min(factors, default=ONE)
        levels = self.view.levels
        for low, high in zip(levels[-2::-1], levels[:0:-1], strict=True):
            is_below = high < top or (is_closed and high == top)
            if question.weak and high <= most and is_below:
                yield high, (high, True)
            if low < min(top, most):
                end = min(high, top)
                yield (low + end) / 2, (end, False)

    def _short_question(self) -> Question:
        rules, question = set(self.members), self.question
        rules.update(question.reach)
        return question._replace(
            rivals=tuple(i for i in question.rivals if i in rules),
            weak=tuple(i for i in question.weak if i in rules),
        )

    def _choice(self, level: Fraction, *, loose: bool) -> _Choice | None:
        question = self._short_question()
        return self.view.choice(question, level, self.budget, loose=loose)

    def _strictly(self, level: Fraction) -> tuple[Point | None, int | None]:
        """Look for a point at which it is so for certain."""
        if self.base.is_exact:
            return None, None
        choice = self._choice(level, loose=False)
        return (None, None) if choice is None else self._look(level, choice)

    def _look(
        self, level: Fraction, choice: _Choice
    ) -> tuple[Point | None, int | None]:
        """Return a point if all holds there, or the strongest rival in the way."""
        question, base = self.question, self.base
        point = self.view.point(level, choice, self.budget)
        if point is None or not base.contains(point):
            return None, None
        self.budget.spend(20 * len(question.rules))
        low, high = base.strengths(point, question.rules)
        if question.holds(low, high):
            return Point(point, f"level {float(level):.4g}"), None
        top = question.level
        if top is None:
            top = min((low[i] for i in question.reach), default=ONE)
        rest = set(self.members)
        against = [i for i in question.rivals if high[i] >= top and i not in rest]
        against += [i for i in question.weak if high[i] > top and i not in rest]
        return None, max(against, key=high.__getitem__, default=None)

    def _necessary_rivals(self) -> tuple[int, ...]:
        """Return the rivals without which it would not be proved, one by one."""
        is_large = self.base.is_coupled and len(self.members) > 8
        if is_large or not self.question.reach:  # of a gap nobody reads them
            return tuple(sorted(self.members))
        for rival in [*self.members] if len(self.members) > 1 else ():
            self.members.remove(rival)
            self.view = self._view()
            levels = self._levels_below(_TOP)
            if any(self._choice(level, loose=True) for level, _ in levels):
                self.members.append(rival)
        return tuple(sorted(self.members))


def _bits(places: Iterable[int]) -> int:
    return sum(1 << place for place in set(places))


def common(
    options: Sequence[Sequence[int]], start: int, budget: Budget, most: float = math.inf
) -> list[int] | None:
    """Return one mask of each group, with no bit of a start in common; None if none.

    `most`: of how many smallest masks it is given up.

    Raises:
        OutOfStepsError: If the budget is spent.
        TooManyError: If there are more smallest masks.
    """
    layers: list[dict[int, tuple[int, int]]] = []
    states = [start]
    for masks in options:
        small = smallest(masks)
        budget.spend(len(small) * len(states))
        step: dict[int, tuple[int, int]] = {}
        for state in states:
            for mask in small:
                step.setdefault(state & mask, (state, mask))
        layers.append(step)
        states = smallest(step)
        if len(states) > most:
            raise TooManyError
    if 0 not in states:
        return None
    state, result = 0, list[int]()
    for step in reversed(layers):
        state, mask = step[state]
        result.append(mask)
    return result[::-1]


def smallest(masks: Iterable[int]) -> list[int]:
    """Return the masks that contain no other one."""
    result: list[int] = []
    for mask in sorted(masks, key=int.bit_count):
        if not any(other & mask == other for other in result):
            result.append(mask)
    return result
