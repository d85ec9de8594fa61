"""Levels and masks: the question under the minimum, complete where degrees are lines.

At one level every axis falls into cells, each with a mask of the rules that still reach
the level there. A point is one cell of each axis, and a rule reaches the level exactly
if its bit is in all masks. So a walk over the axes that keeps the smallest masks of
rivals decides a level, and one level between each two critical ones decides all.

Rivals join the question only when a point needs them: the few that suffice for a proof
come out with it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from fractions import Fraction

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

_MOST_LAYERS = 20_000


class _TooManyError(Exception):
    """There are more smallest masks than are kept."""


class Levels:
    """The critical levels of all rules of a base that take the minimum."""

    def __init__(self, base: Base) -> None:
        self.base = base
        own = {level for axis in base.used for level in axis.levels}
        own |= {rule.factor for rule in base.rules}
        self.levels = sorted({v for v in own if 0 < v <= 1} | {ZERO, ONE})
        self.only: dict[tuple[str, object], int] = {}
        for place, rule in enumerate(base.rules):
            for name, literal in rule.literals:
                if sum(name == other for other, _ in rule.literals) == 1:
                    key = name, literal
                    self.only[key] = self.only.get(key, 0) | 1 << place
        self._cells: dict[tuple[str, int, int], list[Cell]] = {}

    def tried(self, question: Question) -> list[Fraction]:
        """Return the levels that stand for all, the highest first."""
        if question.level is not None:
            return [question.level]
        middles = [(a + b) / 2 for a, b in itertools.pairwise(self.levels)]
        if question.weak:
            middles += self.levels[1:]
        top = min((self.base.rules[i].factor for i in question.reach), default=ONE)
        return sorted((level for level in middles if level <= top), reverse=True)

    def cells(
        self, axis: Axis, level: Fraction, ours: int, *, loose: bool
    ) -> list[Cell]:
        """Return the cells of an axis in which some rules reach a level."""
        place = axis.place(level)
        key = axis.name, 2 * place + loose, ours
        if key not in self._cells:
            self._cells[key] = [
                cell
                for cell in axis.cells(place)
                if (cell.masks.perhaps if loose else cell.masks.surely) & ours == ours
            ]
        return self._cells[key]

    def choice(
        self, question: Question, level: Fraction, budget: Budget, *, loose: bool
    ) -> dict[str, tuple[Cell, int]] | None:
        """Return a cell of each axis in which together it is so, None if there is none.

        With `loose`, where degrees are enclosed, it may be so: none is a proof.

        Raises:
            _TooManyError: If there are too many masks.
        """
        base = self.base
        ours = _bits(question.reach)
        strict, weak = _bits(question.rivals), _bits(question.weak)
        for place, rule in enumerate(base.rules):  # rules whose factor stays below
            if rule.factor < level:
                strict &= ~(1 << place)
            if rule.factor <= level:
                weak &= ~(1 << place)
        count = base.count
        start = strict | weak << count
        options: list[tuple[str, dict[int, Cell]]] = []
        for axis in base.used:
            cells = self.cells(axis, level, ours, loose=loose)
            budget.spend(4 * len(cells) + 4)
            if not cells:
                return None
            keep = self._kept(axis, question) if loose else 0
            masks: dict[int, Cell] = {}
            for cell in cells:
                if loose:
                    at, above = cell.masks.surely | keep, cell.masks.surely_above
                else:
                    at, above = cell.masks.perhaps, cell.masks.perhaps_above
                masks.setdefault((at & strict) | (above & weak) << count, cell)
            options.append((axis.name, masks))
        layers: list[dict[int, tuple[int, int]]] = []
        states = [start]
        for _, masks in options:
            small = _smallest(masks)
            budget.spend(len(small) * len(states))
            step: dict[int, tuple[int, int]] = {}
            for state in states:
                for mask in small:
                    step.setdefault(state & mask, (state, mask))
            layers.append(step)
            states = _smallest(step)
            if len(states) > _MOST_LAYERS:
                raise _TooManyError
        if 0 not in states:
            return None
        state, result = 0, dict[str, tuple[Cell, int]]()
        for (name, masks), step in zip(
            reversed(options), reversed(layers), strict=True
        ):
            state, mask = step[state]
            result[name] = masks[mask], mask
        return result

    def _kept(self, axis: Axis, question: Question) -> int:
        """Return the rules that reach a level on an axis because ours do.

        Their only literal there is one of ours, whatever its degree is.
        """
        result = 0
        for place in question.reach:
            for name, literal in self.base.rules[place].literals:
                if name == axis.name:
                    result |= self.only.get((name, literal), 0)
        return result

    def point(
        self,
        question: Question,
        level: Fraction,
        choice: dict[str, tuple[Cell, int]],
        *,
        loose: bool,
    ) -> dict[str, Fraction] | None:
        """Return a point in chosen cells, taken at the very level."""
        ours, values = _bits(question.reach), dict[str, Fraction]()
        for name, (cell, _) in choice.items():
            for other in self.base.axes[name].cells_at(level):
                reached = other.masks.perhaps if loose else other.masks.surely
                if other.masks == cell.masks and reached & ours == ours:
                    values[name] = other.x
                    break
        return self.base.point(values)


def by_levels(levels: Levels, question: Question, budget: Budget) -> Answer:
    """Decide a question level by level.

    Where degrees are enclosed, `Proved` holds for the curves themselves, and a point is
    one at which bounds of their degrees suffice.

    Raises:
        OutOfStepsError: If the budget is spent.
    """
    search = _Search(levels, question, budget)
    try:
        return search.run()
    except _TooManyError:
        return Open("there are too many ways to choose cells")


class _Search:
    def __init__(self, levels: Levels, question: Question, budget: Budget) -> None:
        self.levels, self.question, self.budget = levels, question, budget
        self.base = levels.base
        self.asked: list[int] = []  # rivals and weak ones that joined
        if self.base.is_coupled:
            self.asked = [*question.rivals, *question.weak]

    def run(self) -> Answer:
        tried, is_open = self.levels.tried(self.question), False
        for level in tried:
            while (choice := self._choice(level, loose=True)) is not None:
                if self.base.is_coupled:
                    return Open("axes share inputs")
                answer, rival = self._look(level, choice, loose=True)
                if answer is None and rival is None:
                    answer, rival = self._strictly(level)
                if answer is not None:
                    return answer
                if rival is None:
                    is_open = True
                    break
                self.asked.append(rival)
        if is_open:
            return Open("degrees are known within bounds alone")
        return Proved(f"{len(tried)} levels", self._needed(tried))

    def _restricted(self) -> Question:
        asked, question = set(self.asked), self.question
        return question._replace(
            rivals=tuple(i for i in question.rivals if i in asked),
            weak=tuple(i for i in question.weak if i in asked),
        )

    def _choice(
        self, level: Fraction, *, loose: bool
    ) -> dict[str, tuple[Cell, int]] | None:
        return self.levels.choice(self._restricted(), level, self.budget, loose=loose)

    def _strictly(self, level: Fraction) -> tuple[Point | None, int | None]:
        """Look for a point at which it is so for certain."""
        if self.base.is_exact:
            return None, None
        choice = self._choice(level, loose=False)
        return (
            (None, None) if choice is None else self._look(level, choice, loose=False)
        )

    def _look(
        self, level: Fraction, choice: dict[str, tuple[Cell, int]], *, loose: bool
    ) -> tuple[Point | None, int | None]:
        """Return a point if all holds there, or the strongest rival in the way."""
        question, base = self.question, self.base
        point = self.levels.point(question, level, choice, loose=loose)
        if point is None or not base.contains(point):
            return None, None
        self.budget.spend(20 * len(question.rules))
        low, high = base.strengths(point, question.rules)
        if question.holds(low, high):
            return Point(point, f"level {float(level):.4g}"), None
        top = question.level
        if top is None:
            top = min((low[i] for i in question.reach), default=ONE)
        rest = set(self.asked)
        against = [i for i in question.rivals if high[i] >= top and i not in rest]
        against += [i for i in question.weak if high[i] > top and i not in rest]
        return None, max(against, key=high.__getitem__, default=None)

    def _needed(self, tried: Sequence[Fraction]) -> tuple[int, ...]:
        """Return the rivals without which it would not be proved, one by one."""
        if self.base.is_coupled and len(self.asked) > 8:
            return tuple(sorted(self.asked))
        for rival in [*self.asked] if len(self.asked) > 1 else ():
            self.asked.remove(rival)
            if any(self._choice(level, loose=True) is not None for level in tried):
                self.asked.append(rival)
        return tuple(sorted(self.asked))


def _bits(places: Sequence[int]) -> int:
    return sum(1 << place for place in set(places))


def _smallest(masks: Iterable[int]) -> list[int]:
    """Return the masks that contain no other one."""
    result: list[int] = []
    for mask in sorted(masks, key=int.bit_count):
        if not any(other & mask == other for other in result):
            result.append(mask)
    return result
