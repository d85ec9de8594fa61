"""Two rules: how high both reach, how far apart they are, and where they tie.

On an axis a rule has one function: the least of its literals there, 1 if it has none.
Its values and limits at knots are the columns of a table, which shows the largest of
the smaller of two functions, and their largest difference.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from fractions import Fraction
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from fuzzytree.auditing.decide.answers import (
    ONE,
    Answer,
    Budget,
    Open,
    OutOfStepsError,
    Point,
    Proved,
    Question,
)
from fuzzytree.auditing.decide.axes import Axis
from fuzzytree.auditing.decide.claims import SPENT, Claims, within
from fuzzytree.auditing.decide.levels import Interior, by_levels
from fuzzytree.auditing.decide.lines import Lines, value_at
from fuzzytree.auditing.decide.rules import Literal
from fuzzytree.model import FloatArray

APART = Proved("they share no curve, and no constant")

_Set = frozenset[tuple[Literal, int]]  # each with how often a product has it
_Values = list[Fraction]
_EMPTY: _Set = frozenset()
_MOST_RATIOS = 4_000
_HALVINGS = 12
_NARROW = Fraction(1, 1000)  # bounds of a highest common level are no further apart
_NUDGE = Fraction(1, 1 << 20)  # of a range: points around a tie


class Distance(NamedTuple):
    """How far the functions of two rules are apart at most, and where."""

    low: Fraction
    high: Fraction
    axis: str = ""
    at: Fraction = ONE


class Common(NamedTuple):
    """The highest level that two rules reach together, and a point of about it."""

    low: Fraction
    high: Fraction
    point: Point | None
    answer: Answer | None = None


class Columns:
    """The functions of all rules on an axis, at its knots."""

    def __init__(self, axis: Axis, sets: Iterable[_Set]) -> None:
        self.axis = axis
        self.sets = {own: n for n, own in enumerate(dict.fromkeys((_EMPTY, *sets)))}
        knots = axis.knots
        inside = [k for k, x in enumerate(knots) if axis.low <= x <= axis.high]
        values = [k for k in inside if axis.contains(knots[k])]
        pieces = [] if axis.values else inside[:-1]
        self.x = [knots[k] for k in values] + [*axis.extra]
        self.attained = len(self.x)
        self.x += [knots[k] for k in pieces] + [knots[k + 1] for k in pieces]

        def columns(lines: Lines) -> _Values:
            return [
                *(lines.at[k] for k in values),
                *(value_at(lines, x) for x in axis.extra),
                *(lines.after[k] for k in pieces),
                *(lines.before[k] for k in pieces),
            ]

        self.low: list[_Values] = []
        self.high: list[_Values] = []
        sides = {
            literal: (columns(both.lower), columns(both.upper))
            for literal, both in axis.bounds.items()
        }
        for own in self.sets:
            for side, result in ((0, self.low), (1, self.high)):
                rows = [sides[literal][side] for literal, _ in own]
                if len(rows) > 1:
                    rows = [[min(v) for v in zip(*rows, strict=True)]]
                result.append(rows[0] if rows else [ONE] * len(self.x))

    @cached_property
    def most(self) -> FloatArray:
        """The upper functions in doubles."""
        return np.array([[float(v) for v in row] for row in self.high])


class Pairs:
    """What is asked of pairs of rules; see `Claims`."""

    def __init__(self, claims: Claims) -> None:
        self.claims, self.base = claims, claims.base
        self._columns: dict[tuple[str, frozenset[_Set]], Columns] = {}
        self._distances: dict[tuple[str, frozenset[_Set], Fraction], Distance] = {}

    @cached_property
    def sets(self) -> dict[str, list[_Set]]:
        """The literals of each rule on each axis."""
        result = {
            axis.name: [_EMPTY] * self.base.count for axis in self.base.axes_in_use
        }
        for place, rule in enumerate(self.base.rules):
            for name, literal in rule.literals:
                count = 1
                if rule.norm == "product":
                    count = rule.literals.count((name, literal))
                result[name][place] |= {(literal, count)}
        return result

    def columns(self, name: str, *sets: _Set) -> Columns:
        """Return some functions on an axis, on the knots of their literals alone."""
        key = name, frozenset(sets)
        if key not in self._columns:
            literals = frozenset(literal for own in sets for literal, _ in own)
            axis = self.base.axes[name].with_literals(literals)
            self._columns[key] = Columns(axis, sets)
        return self._columns[key]

    # --- how high two rules reach together

    def most(self, budget: Budget) -> FloatArray:
        """Return about how high each pair reaches together at most, by single axes.

        Raises:
            OutOfStepsError: If the budget is spent.
        """
        if "_most" not in vars(self):
            for name, sets in self.sets.items():
                bends = len(self.base.axes[name].bends) + 10
                budget.spend(len({*sets}) ** 2 * bends // 200)
        return self._most

    @cached_property
    def _most(self) -> FloatArray:
        factors = np.array([float(rule.factor) for rule in self.base.rules])
        result: FloatArray = np.minimum(factors[:, None], factors[None, :])
        for name, sets in self.sets.items():
            places = {own: n for n, own in enumerate(dict.fromkeys(sets))}
            both = self._joint(self.base.axes[name], [*places])
            of = np.array([places[own] for own in sets])
            result = np.minimum(result, both[of[:, None], of[None, :]])
        return result

    def _joint(self, axis: Axis, sets: list[_Set]) -> FloatArray:
        """Return about the largest of the smaller of each two functions on an axis."""
        size = len(sets)
        result = np.ones((size, size))
        ends: dict[int, FloatArray] = {}
        for n, own in enumerate(sets):
            rows = [
                row for literal, _ in own for row in axis.stretches.sides[literal][1]
            ]
            if len(rows) == 1 and not axis.values:
                ends[n] = rows[0].ends
            elif not rows:
                ends[n] = np.ones((2, 2 * axis.stretches.last + 1))
        for n, own in enumerate(sets):
            for m in range(n, size):
                if n in ends and m in ends:
                    continue
                columns = self.columns(axis.name, own, sets[m])
                least = np.minimum(
                    *(columns.most[columns.sets[k]] for k in (own, sets[m]))
                )
                result[n, m] = result[m, n] = least.max()
        places = [*ends]
        if places:
            table = np.array([ends[n] for n in places])
            for n, (p, q) in zip(places, table, strict=True):
                some = np.flatnonzero(np.maximum(p, q) > 0.0)
                if not len(some):
                    result[n, places] = 0.0
                    continue
                p, q = p[some], q[some]
                u, v = table[:, 0, some], table[:, 1, some]
                best = np.maximum(np.minimum(p, u), np.minimum(q, v))
                turn = (p - u) * (q - v) < 0  # they cross between the ends
                share = np.where(
                    turn, (u - p) / np.where(turn, q - p - v + u, 1.0), 0.0
                )
                best = np.where(turn, np.maximum(best, p + (q - p) * share), best)
                result[n, places] = best.max(axis=1)
        return result

    def common(self, i: int, j: int, level: Fraction, budget: Budget) -> Common:
        """Return the highest level of two rules; `answer`: whether it is `level`."""
        base = self.base
        rules = base.rules[i], base.rules[j]
        most = min(rule.factor for rule in rules)
        values: dict[str, Fraction] = {}
        for name, sets in self.sets.items():
            if sets[i] or sets[j]:
                columns = self.columns(name, sets[i], sets[j])
                mine, theirs = (columns.high[columns.sets[sets[k]]] for k in (i, j))
                least = [min(pair) for pair in zip(mine, theirs, strict=True)]
                most = min(most, max(least))
                if columns.attained:
                    top = max(range(columns.attained), key=least.__getitem__)
                    values[name] = columns.x[top]
        if most < level:
            return Common(most, most, None, Proved("the axes were looked at"))
        point = None if base.is_coupled else base.point(values)
        reached = self._level_at(i, j, point)
        is_exact = all(rule.norm == "minimum" for rule in rules) and not base.is_coupled
        is_exact &= all(base.axes[name].is_exact for name in values)
        if point is not None and reached == most:
            return Common(reached, most, Point(point), Point(point))
        answer = self.claims.ask(Question((i, j), level=level), budget)
        if not isinstance(answer, Point):
            return Common(reached, most, None, answer)
        drawn = np.minimum(base.sample_strengths[i], base.sample_strengths[j])
        tried = [answer.values, base.sample(int(drawn.argmax()))]
        tried += [point] if point is not None else []
        points = [dict(at) for at in tried if base.contains(at)]
        best = max(points, key=lambda at: self._level_at(i, j, at))
        reached = self._level_at(i, j, best)
        if is_exact:  # a limit at a jump, which none reaches, is told as such
            return Common(most, most, Point(best), answer)
        for _ in range(_HALVINGS):
            if most - reached < _NARROW:
                break
            level = (reached + most) / 2
            other = self.claims.ask(Question((i, j), level=level), budget)
            if isinstance(other, Point):
                best = dict(other.values)
                reached = self._level_at(i, j, best)
            elif isinstance(other, Proved):
                most = level
            else:
                break
        return Common(reached, most, Point(best), answer)

    def _level_at(self, i: int, j: int, point: dict[str, Fraction] | None) -> Fraction:
        if point is None or not self.base.contains(point):
            return Fraction(-1)
        low, _ = self.base.strengths(point, (i, j))
        return min(low[i], low[j])

    # --- how far their functions are apart

    def distance(self, i: int, j: int, limit: Fraction) -> Distance:
        """Return how far two rules are apart on an axis at most; no more than a limit.

        One that is larger is not told from others that are.
        """
        rules = self.base.rules[i], self.base.rules[j]
        off = abs(rules[0].factor - rules[1].factor)
        worst, total = Distance(off, off), off
        for name, sets in self.sets.items():
            if sets[i] == sets[j]:
                continue
            if self._is_far(name, sets[i], sets[j], limit):
                return Distance(ONE, ONE, name)
            key = name, frozenset((sets[i], sets[j])), limit
            if key not in self._distances:
                columns = self.columns(name, sets[i], sets[j])
                a, b = (columns.sets[sets[k]] for k in (i, j))
                self._distances[key] = _apart(columns, a, b, limit)
            total += self._distances[key].high
            worst = max(worst, self._distances[key])
            if worst.low > limit:
                break
        if any(rule.norm == "product" for rule in rules) and total > limit:
            worst = worst._replace(high=max(worst.high, total))
        return worst

    def _is_far(self, name: str, mine: _Set, theirs: _Set, limit: Fraction) -> bool:
        """Return whether doubles show at knots that two literals are apart."""
        every = [literal for literal, _ in (*mine, *theirs)]
        if (
            len(mine) != 1
            or len(theirs) != 1
            or any(len(f.functions) > 1 for f in every)
        ):
            return False
        sides = self.base.axes[name].stretches.sides
        (low, high), (least, most) = (sides[literal] for literal in every)
        apart = max((low[0].at - most[0].at).max(), (least[0].at - high[0].at).max())
        return bool(apart > float(limit) + 1e-9)

    # --- where they tie

    @cached_property
    def _has_twins(self) -> bool:
        """Whether two axes are one sum of inputs but for a factor."""
        seen = set()
        for axis in self.base.axes_in_use:
            first = next(iter(axis.weights.values()), ONE)
            seen.add(frozenset((of, w / first) for of, w in axis.weights.items()))
        return len(seen) < len(self.base.axes_in_use)

    def tie(self, i: int, j: int, budget: Budget) -> Answer:
        """Return whether two rules are as strong, and the strongest, on some width."""
        base, pair = self.base, (i, j)
        try:
            most = self.most(budget)[pair]
            budget.spend(base.count // 8)
        except OutOfStepsError:
            return SPENT
        if most <= 0.0:
            return Proved("they never fire together")
        rules = [base.rules[k] for k in pair]
        rest = tuple(k for k in range(base.count) if k not in pair)
        is_lattice = all(rule.norm == "minimum" for rule in rules)
        pieces = {
            axis: where
            for axis in base.axes_in_use
            if (where := self._common_pieces(axis, *pair))
        }
        levels = self._plateaus(i) & self._plateaus(j) if is_lattice else set()
        levels = {t for t in levels if float(t) <= most + 1e-12}
        if not self._has_twins:
            if is_lattice and not levels and not pieces:
                return APART
            if not is_lattice and not self._is_one_product(*pair):
                return APART
        if is_lattice and base.is_lattice and not base.is_coupled:
            questions = [
                (Question(pair, (), (*pair, *rest), level=t), Interior())
                for t in sorted(levels, reverse=True)
            ]
            questions += [
                (Question(pair, (), (*pair, *rest)), Interior(axis.name, where))
                for axis, where in pieces.items()
            ]
            is_open = False
            for question, interior in questions:
                answer = within(budget, partial(by_levels, base, question, interior))
                if isinstance(answer, Point):
                    return answer
                is_open |= isinstance(answer, Open)
            if not is_open:
                return Proved("levels and cells with an interior")
        drawn = self._tie_at_samples(i, j, rest, budget)
        if drawn is not None:
            return drawn
        answer = self.claims.ask(Question(pair, weak=rest), budget)
        if isinstance(answer, Point):
            code = "FTD04" if base.is_coupled else "FTD02"
            return Open("they tie somewhere, perhaps on a surface only", code)
        return answer

    def _plateaus(self, i: int) -> set[Fraction]:
        """Return the values above 0 that literals of a rule have on some width."""
        rule = self.base.rules[i]
        result = {rule.factor}
        for name, literal in rule.literals:
            result |= self._flat[name, literal]
        return {t for t in result if 0 < t <= rule.factor}

    @cached_property
    def _flat(self) -> dict[tuple[str, Literal], set[Fraction]]:
        result: dict[tuple[str, Literal], set[Fraction]] = {}
        for axis in self.base.axes_in_use:
            for literal, sides in axis.parts.items():
                values = [
                    {v for lines in side for v in _levels(axis, lines)}
                    for side in sides
                ]
                result[axis.name, literal] = values[0] & values[1]
        return result

    @cached_property
    def _slopes(self) -> dict[tuple[str, Literal], set[tuple[Fraction, Fraction]]]:
        """The lines of literals that are not level: the slope, and the value at 0."""
        return {
            (axis.name, literal): {
                (slope := (q - p) / (b - a), p - slope * a)
                for lines in sides[0]
                for a, b, p, q in lines.pieces()
                if p != q
            }
            for axis in self.base.axes_in_use
            for literal, sides in axis.parts.items()
        }

    def _common_pieces(
        self, axis: Axis, i: int, j: int
    ) -> tuple[tuple[Fraction, Fraction], ...]:
        """Return the pieces of an axis where two rules follow one line, not level."""
        mine, theirs = (self.sets[axis.name][k] for k in (i, j))
        if axis.values or not (mine and theirs):
            return ()
        slopes = [
            set().union(*(self._slopes[axis.name, literal] for literal, _ in own))
            for own in (mine, theirs)
        ]
        if slopes[0].isdisjoint(slopes[1]):
            return ()
        axis = self.columns(axis.name, mine, theirs).axis
        result: list[tuple[Fraction, Fraction]] = []
        for (f, _), (g, _) in itertools.product(mine, theirs):
            a, b = axis.bounds[f], axis.bounds[g]
            if f != g and not (a.is_exact and b.is_exact):
                continue
            slope = None
            for k, (x, y) in enumerate(itertools.pairwise(axis.knots)):
                p, q = a.lower.after[k], a.lower.before[k]
                is_same = (p, q) == (b.lower.after[k], b.lower.before[k]) and p != q
                if not (is_same and axis.low <= x < axis.high):
                    slope = None
                    continue
                is_straight = slope == (q - p) / (y - x) and p == a.lower.at[k]
                is_straight &= a.lower.at[k] == a.lower.before[k - 1]
                slope = (q - p) / (y - x)
                start = result.pop()[0] if is_straight else x
                result.append((start, y))
        return tuple(sorted(set(result)))

    def _is_one_product(self, i: int, j: int) -> bool:
        """Return whether products can be equal on some width: their factors are.

        That is so if on each axis both are proportional on some piece, and the ratios
        make up for each other.
        """
        base = self.base
        if any(
            base.rules[k].norm == "minimum" and len(base.rules[k].literals) > 1
            for k in (i, j)
        ):
            return True
        ratios = {base.rules[i].factor / base.rules[j].factor}
        for axis in base.axes_in_use:
            mine, theirs = (self.sets[axis.name][k] for k in (i, j))
            if not (mine or theirs):
                continue
            if (
                not axis.is_exact
                or max(len(mine), len(theirs)) > 1
                or axis.values
                or any(count > 1 for _, count in mine | theirs)
            ):
                if mine != theirs:
                    return True
                continue
            own = {*_ratios(axis, mine, theirs)}
            ratios = {a * b for a in ratios for b in own}
            if len(ratios) > _MOST_RATIOS:
                return True
        return ONE in ratios

    def _tie_at_samples(
        self, i: int, j: int, rest: tuple[int, ...], budget: Budget
    ) -> Answer | None:
        """Return a drawn point at which two rules tie, as they do all around it."""
        base, drawn = self.base, self.base.sample_strengths
        top = drawn[[*rest]].max(axis=0) if rest else np.zeros(drawn.shape[1])
        is_tie = (np.abs(drawn[i] - drawn[j]) < 1e-12) & (drawn[i] > top - 1e-12)
        is_tie &= drawn[i] > 0.0
        question = Question((i, j), (), (i, j, *rest))
        for number in np.flatnonzero(is_tie)[:8].tolist():
            point = base.sample(number)
            try:
                budget.spend(20 * base.count)
            except OutOfStepsError:
                return SPENT
            around = [point, *_around(base.inputs, point)]
            if all(
                base.contains(near) and question.holds(*base.strengths(near))
                for near in around
            ):
                return Point(point, "a point that was drawn, and points around it")
        return None


def _levels(axis: Axis, lines: Lines) -> set[Fraction]:
    """Return the values that lines have on some width, or at single values."""
    if axis.values or len(lines.x) == 1:
        return {value_at(lines, x) for x in axis.values or lines.x}
    return {p for p, q in zip(lines.after, lines.before, strict=True) if p == q}


def _apart(columns: Columns, a: int, b: int, limit: Fraction) -> Distance:
    """Return how far two functions are apart, and where."""
    places = range(len(columns.x))
    least, most = columns.low, columns.high
    if np.abs(columns.most[a] - columns.most[b]).max() <= float(limit) * 2:
        some: Iterable[int] = places
    else:
        some = (int(np.abs(columns.most[a] - columns.most[b]).argmax()),)
    worst = Distance(Fraction(0), Fraction(0))
    sets = [*columns.sets]
    if any(len(sets[n]) > 1 or any(c > 1 for _, c in sets[n]) for n in (a, b)):
        worst = Distance(Fraction(0), ONE, columns.axis.name)  # between its knots
    for n in some:
        high = max(most[a][n] - least[b][n], most[b][n] - least[a][n])
        low = max(least[a][n] - most[b][n], least[b][n] - most[a][n], Fraction(0))
        worst = max(worst, Distance(low, high, columns.axis.name, columns.x[n]))
    return worst


def _ratios(axis: Axis, mine: _Set, theirs: _Set) -> Iterator[Fraction]:
    """Yield the ratios of two functions on pieces where they are proportional."""
    axis = axis.with_literals(frozenset(literal for literal, _ in mine | theirs))
    first, last = (axis.knots.index(x) for x in (axis.low, axis.high))
    for k in range(first, last):
        ends = []
        for own in (mine, theirs):
            p = q = ONE
            for literal, _ in own:
                lines = axis.bounds[literal].lower
                p, q = lines.after[k], lines.before[k]
            ends.append((p, q))
        (p, q), (u, v) = ends
        if p * v == q * u and (p or q) and (u or v):
            yield p / u if u else q / v


def _around(
    inputs: dict[str, Axis], point: dict[str, Fraction]
) -> Iterator[dict[str, Fraction]]:
    """Yield points a little beside another one, in several directions."""
    for turn in range(1, 7):
        near = dict(point)
        for n, (name, axis) in enumerate(inputs.items()):
            if not (axis.values or axis.is_whole or point[name] in axis.extra):
                step = (axis.high - axis.low) * _NUDGE * ((turn * (2 * n + 3)) % 7 - 3)
                moved = point[name] + step
                near[name] = moved if axis.contains(moved) else point[name]
        yield near
