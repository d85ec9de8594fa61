"""Rules on a domain, ready for questions: axes, exact strengths, points, samples."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property

import numpy as np

from fuzzytree.auditing.decide.answers import ONE, ZERO
from fuzzytree.auditing.decide.axes import (
    MOST_PIECES,
    MOST_WHOLE,
    Axis,
    literal_bounds,
)
from fuzzytree.auditing.decide.domain import Domain, combination
from fuzzytree.auditing.decide.lines import Lines
from fuzzytree.auditing.decide.rules import BaseRule, LeftOut, Literal, rules_of
from fuzzytree.model import BoolArray, Document, FloatArray, Variable

SAMPLES = 4096
"""Points that are drawn, which find most of what there is to find."""


class Base:
    """The rules of one model, or of several side by side, on a domain.

    Attributes:
        rules: The rules.
        axes: What they ask: the axes by the name of the variable; of several models an
            axis that differs has a name of its own.
        inputs: The inputs of all, as axes.
        domain: The domain.
        silent: Rules that never fire, as their text says.
        left_out: Rules that have no exact method.
        uncovered: The class where no rule fires.

    Example:
        >>> from fuzzytree.auditing.decide.domain import DomainSide
        >>> from fuzzytree.testing import random_tree
        >>> tree = random_tree(1)
        >>> box = Domain(tuple(DomainSide(name, -1.0, 1.0) for name in tree.inputs))
        >>> Base.of(tree, box).rules[0].number
        1
    """

    def __init__(
        self,
        rules: Sequence[BaseRule],
        variables: Mapping[str, Variable],
        domain: Domain,
        *,
        seed: int = 0,
        most_pieces: int = MOST_PIECES,
    ) -> None:
        self.rules, self.variables, self.domain = tuple(rules), variables, domain
        self.seed, self.most_pieces = seed, most_pieces
        self.silent: tuple[tuple[str, int, str], ...] = ()
        self.left_out: tuple[LeftOut, ...] = ()
        self.uncovered: str | None = None
        self.count = len(self.rules)
        self.every = (1 << self.count) - 1
        self.inputs: dict[str, Axis] = {}
        for variable in variables.values():
            if not variable.parts:
                self.inputs[variable.name] = self._input(variable)
        names = {name for rule in self.rules for name, _ in rule.literals}
        self.axes: dict[str, Axis] = {}
        self.is_empty = False
        for name, variable in variables.items():
            if name in names or (domain.side(name) is not None and variable.parts):
                self.axes[name] = self._axis(name, variable)
        for place, rule in enumerate(self.rules):
            for name, literal in rule.literals:
                users = self.axes[name].literals
                users[literal] = users.get(literal, 0) | 1 << place
        for axis in self.axes.values():
            axis.most_pieces = most_pieces

    @classmethod
    def of(cls, model: Document, domain: Domain, seed: int = 0) -> Base:
        """Return the rules of a model on a domain.

        Raises:
            ValueError: If an input has no side.
        """
        every = rules_of(model)
        variables = {variable.name: variable for variable in model.variables}
        base = cls(every.rules, variables, domain, seed=seed)
        base.silent, base.left_out = every.silent, every.left_out
        base.uncovered = every.uncovered
        return base

    @classmethod
    def of_both(
        cls, old: Document, new: Document, domain: Domain, seed: int = 0
    ) -> Base:
        """Return the rules of two models side by side, the old ones first.

        Inputs of one name are one axis; a sum of either is an axis of its own.

        Raises:
            ValueError: If an input has no side.
        """
        variables: dict[str, Variable] = {}
        rules: list[BaseRule] = []
        for place, model in enumerate((old, new)):
            names: dict[str, str] = {}
            for variable in model.variables:
                names[variable.name] = variable.name
                if variable.parts:
                    while variables.get(names[variable.name], variable) != variable:
                        names[variable.name] += "'"
                variables.setdefault(names[variable.name], variable)
            for rule in rules_of(model).rules:
                literals = tuple(
                    (names[name], literal) for name, literal in rule.literals
                )
                rules.append(rule._replace(literals=literals, model=place))
        return cls(rules, variables, domain, seed=seed)

    def with_rules(self, more: Iterable[BaseRule]) -> Base:
        """Return the same with further rules behind."""
        rules = (*self.rules, *more)
        result = Base(rules, self.variables, self.domain, seed=self.seed)
        for name, axis in self.axes.items():
            if name in result.axes:
                result.axes[name].kept = axis.kept
        vars(result)["samples"] = self.samples
        added = result._strengths_of_samples(range(self.count, len(rules)))
        vars(result)["sample_strengths"] = np.concatenate(
            [self.sample_strengths, added]
        )
        return result

    def on(self, domain: Domain) -> Base:
        """Return the same rules on another domain."""
        return Base(self.rules, self.variables, domain, seed=self.seed)

    @cached_property
    def fine(self) -> Base:
        """The same with curves between lines that are closer, for boxes."""
        if self.is_exact:
            return self
        return Base(
            self.rules, self.variables, self.domain, seed=self.seed, most_pieces=4096
        )

    def _input(self, variable: Variable) -> Axis:
        side = self.domain.side(variable.name)
        if side is None:
            raise ValueError(f"the domain has no side for {variable.name!r}")
        ends = Fraction(side.low), Fraction(side.high)
        axis = Axis(variable.name, {variable.name: ONE}, ZERO, ends)
        axis.is_open = side.is_open
        stand_in = () if side.missing is None else (side.missing,)
        if side.values:
            axis.set_values(Fraction(v) for v in (*side.values, *stand_in))
        elif side.is_whole and side.high - side.low < MOST_WHOLE:
            whole = range(int(side.low), int(side.high) + 1)
            axis.set_values(Fraction(v) for v in (*whole, *stand_in))
        else:
            axis.is_whole = side.is_whole
            extra = map(Fraction, stand_in)
            axis.extra = tuple(v for v in extra if not axis.contains(v))
        return axis

    def _axis(self, name: str, variable: Variable) -> Axis:
        if not variable.parts:
            return self.inputs[variable.name]
        places = {of: n for n, of in enumerate(self.inputs)}
        names = [*self.inputs]
        by_place, constant = combination(variable.parts, places)
        weights = {names[place]: weight for place, weight in by_place.items()}
        low = high = constant
        for of, weight in weights.items():
            axis = self.inputs[of]
            ends = weight * axis.least, weight * axis.largest
            low, high = low + min(ends), high + max(ends)
        side = self.domain.side(variable.name)
        if side is not None:
            low, high = max(low, Fraction(side.low)), min(high, Fraction(side.high))
        if low > high:
            self.is_empty, high = True, low
        return Axis(name, weights, constant, (low, high))

    # --- what kind of base it is

    @cached_property
    def is_coupled(self) -> bool:
        """Whether two axes share inputs, so that they are not free of each other."""
        names = [of for axis in self.axes.values() for of in axis.weights]
        return len(names) != len(set(names))

    @cached_property
    def is_exact(self) -> bool:
        """Whether all degrees are known exactly."""
        return all(axis.is_exact for axis in self.axes.values())

    @cached_property
    def is_lattice(self) -> bool:
        """Whether all rules take the minimum."""
        return all(rule.norm == "minimum" for rule in self.rules)

    @cached_property
    def size(self) -> int:
        """How many propositions the rules have."""
        return sum(len(rule.literals) for rule in self.rules)

    @cached_property
    def axes_in_use(self) -> tuple[Axis, ...]:
        """The axes that rules ask."""
        return tuple(axis for axis in self.axes.values() if axis.literals)

    # --- points

    def value(self, axis: Axis, point: Mapping[str, Fraction]) -> Fraction:
        """Return the value of an axis at a point of the inputs."""
        if axis.is_input:
            return point[axis.name]
        total = axis.constant
        for name, weight in axis.weights.items():
            total += weight * point[name]
        return total

    def contains(self, point: Mapping[str, Fraction]) -> bool:
        """Return whether a point is in the domain, of values that rows can have."""
        if not all(axis.contains(point[name]) for name, axis in self.inputs.items()):
            return False
        return all(
            axis.low <= self.value(axis, point) <= axis.high
            for name, axis in self.axes.items()
            if not axis.is_input and self.domain.side(name) is not None
        )

    def strengths(
        self, point: Mapping[str, Fraction], of: Iterable[int] | None = None
    ) -> tuple[list[Fraction], list[Fraction]]:
        """Return bounds of strengths at a point, equal where degrees are fractions.

        Args:
            point: A value for each input.
            of: The positions of the rules that are asked; all by default. The others
                are 0.
        """
        degrees: dict[tuple[str, Literal], tuple[Fraction, Fraction]] = {}
        values: dict[str, Fraction] = {}
        low, high = [ZERO] * self.count, [ZERO] * self.count
        for place in range(self.count) if of is None else of:
            rule = self.rules[place]
            least = most = rule.factor
            for key in rule.literals:
                if key not in degrees:
                    name, literal = key
                    if name not in values:
                        values[name] = self.value(self.axes[name], point)
                    degrees[key] = literal_bounds(literal, values[name])
                a, b = degrees[key]
                if rule.norm == "product":
                    least, most = least * a, most * b
                else:
                    least, most = min(least, a), min(most, b)
                if most <= 0:
                    break
            low[place], high[place] = least, most
        return low, high

    def point(self, values: Mapping[str, Fraction]) -> dict[str, Fraction] | None:
        """Return a point of the inputs at which axes that are free have values."""
        result: dict[str, Fraction] = {}
        for name, x in values.items():
            axis = self.axes[name]
            if axis.is_input:
                result[name] = x
                continue
            left = x - axis.constant
            ends = {
                of: sorted((w * self.inputs[of].least, w * self.inputs[of].largest))
                for of, w in axis.weights.items()
            }
            left -= sum((low for low, _ in ends.values()), ZERO)
            for of, weight in axis.weights.items():
                low, high = ends[of]
                step = min(high - low, max(left, ZERO))
                left -= step
                value = (low + step) / weight
                if result.setdefault(of, value) != value:
                    return None
            if left:
                return None
        for name, axis in self.inputs.items():
            if name not in result:
                result[name] = _plain(axis)
        return {name: result[name] for name in self.inputs}

    # --- doubles: points that are drawn, which find most witnesses

    @cached_property
    def samples(self) -> list[FloatArray]:
        """Values of each input at points that rows can have; half of them at knots.

        At the first of them rules are as high as they get, one after the other.
        """
        chance = np.random.default_rng(self.seed)
        columns: list[FloatArray] = []
        for name, axis in self.inputs.items():
            if axis.values:
                values = np.array([float(v) for v in axis.values])
                columns.append(chance.choice(values, size=SAMPLES))
                continue
            drawn = _draw(axis, chance)
            places = self._places(name, axis)
            if len(places):
                is_drawn = chance.random(SAMPLES) < 0.5
                drawn = np.where(is_drawn, drawn, chance.choice(places, size=SAMPLES))
            if axis.is_whole:
                near = np.clip(np.round(drawn), math.ceil(axis.low), float(axis.high))
                extra = [float(x) for x in axis.extra]
                drawn = np.where(np.isin(drawn, extra), drawn, near)
            if axis.is_open:
                drawn = np.where(drawn <= float(axis.low), float(axis.high), drawn)
            columns.append(drawn)
        by_name = dict(zip(self.inputs, columns, strict=True))
        for number, rule in enumerate(self.rules[: SAMPLES // 4]):
            for name, literal in rule.literals:
                if name in by_name:
                    by_name[name][number] = float(self.axes[name].peak(literal))
        return columns

    def _places(self, name: str, axis: Axis) -> FloatArray:
        own, extra = self.axes.get(name), [float(x) for x in axis.extra]
        if own is None or not own.literals:
            return np.array(extra)
        knots = [float(x) for x in own.bends if axis.low <= x <= axis.high][:400]
        middles = [(a + b) / 2 for a, b in itertools.pairwise(knots)]
        return np.array([*knots, *middles, *extra])

    def sample(self, number: int) -> dict[str, Fraction]:
        """Return a sampled point, by its number."""
        columns = zip(self.inputs, self.samples, strict=True)
        return {name: Fraction(float(column[number])) for name, column in columns}

    @cached_property
    def sample_strengths(self) -> FloatArray:
        """The strengths at sampled points in doubles, shape (rules, points)."""
        return self._strengths_of_samples(range(self.count))

    def _strengths_of_samples(self, of: Sequence[int]) -> FloatArray:
        columns = dict(zip(self.inputs, self.samples, strict=True))
        result = self.in_doubles(columns, of=of)
        if self.is_coupled:
            result[:, ~self._inside(columns)] = 0.0
        return result

    def in_doubles(
        self,
        columns: Mapping[str, FloatArray],
        *,
        of: Sequence[int] | None = None,
        is_upper: bool = False,
    ) -> FloatArray:
        """Return about the lower or upper bounds of strengths, shape (rules, points).

        The points are in the domain; of each input its values.
        """
        rules = [self.rules[n] for n in (range(self.count) if of is None else of)]
        values: dict[str, FloatArray] = {}
        degrees: dict[tuple[str, Literal], FloatArray] = {}
        size = len(next(iter(columns.values()), np.zeros(SAMPLES)))
        result = np.empty((len(rules), size))
        for strength, rule in zip(result, rules, strict=True):
            strength[:] = float(rule.factor)
            join = np.multiply if rule.norm == "product" else np.minimum
            for key in rule.literals:
                if key not in degrees:
                    name, literal = key
                    if name not in values:
                        values[name] = self._in_doubles(self.axes[name], columns, size)
                    pick = np.minimum if literal.negated else np.maximum
                    parts = self.axes[name].parts[literal][is_upper]
                    heights = [lines_at(lines, values[name]) for lines in parts]
                    degrees[key] = functools.reduce(pick, heights)
                join(strength, degrees[key], out=strength)
        return result

    def _in_doubles(
        self, axis: Axis, columns: Mapping[str, FloatArray], size: int
    ) -> FloatArray:
        x = np.full(size, float(axis.constant))
        for name, weight in axis.weights.items():
            x = x + float(weight) * columns[name]
        return x

    def _inside(self, columns: Mapping[str, FloatArray]) -> BoolArray:
        inside = np.ones(SAMPLES, dtype=bool)
        for name, axis in self.axes.items():
            if not axis.is_input and self.domain.side(name) is not None:
                x = self._in_doubles(axis, columns, SAMPLES)
                inside &= (x >= float(axis.low)) & (x <= float(axis.high))
        return inside


def _draw(axis: Axis, chance: np.random.Generator) -> FloatArray:
    """Return doubles within a range, of few digits."""
    low, high = float(axis.low), float(axis.high)
    digits = 3 - math.floor(math.log10(high - low)) if high > low else 0
    drawn = np.round(low + chance.random(SAMPLES) * (high - low), digits)
    return np.clip(drawn, low, high)


def lines_at(lines: Lines, x: FloatArray) -> FloatArray:
    """Return about the values of lines at some places, knots included."""
    xs = np.array([float(v) for v in lines.x])
    at = np.array([float(v) for v in lines.at])
    if len(xs) == 1:
        return np.full_like(x, at[0])
    if lines.at[:-1] == lines.after and lines.at[1:] == lines.before:
        heights: FloatArray = np.interp(x, xs, at)
        return heights
    piece = np.clip(np.searchsorted(xs, x, "right") - 1, 0, len(xs) - 2)
    p = np.array([float(v) for v in lines.after])[piece]
    q = np.array([float(v) for v in lines.before])[piece]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip((x - xs[piece]) / (xs[piece + 1] - xs[piece]), 0.0, 1.0)
    result = p + (q - p) * np.nan_to_num(share)
    place = np.clip(np.searchsorted(xs, x), 0, len(xs) - 1)
    outside = (x <= xs[0]) | (x >= xs[-1])
    values: FloatArray = np.where((xs[place] == x) | outside, at[place], result)
    return values


def _plain(axis: Axis) -> Fraction:
    """Return some value of an input on which nothing is wanted."""
    if axis.values:
        return axis.values[0]
    x = (axis.low + axis.high) / 2
    near = Fraction(f"{float(x):.3g}")
    for tried in (near, Fraction(float(x)), Fraction(round(x)), x):
        if axis.contains(tried):
            return tried
    return axis.high
