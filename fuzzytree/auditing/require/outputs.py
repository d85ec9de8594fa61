"""Bounds of a system's output, and of its slope, on boxes.

A weighted output is `sum z s / sum s` (or `sum z s`), s how far conclusions are
activated and z their numbers, constants or sums of inputs. A centroid is the same with
samples x in the place of z and the aggregated curve mu in that of s. With y the output
and D the divisor, its slope is `sum s' (z - y) / D`, and the average of the slopes of z
besides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from typing import Final, NamedTuple

import numpy as np

from fuzzytree.auditing.decide import Base, Boxes
from fuzzytree.auditing.require.bounds import Bounds, average, exact, largest, stacked
from fuzzytree.auditing.require.slopes import NotBoundedError, Slopes
from fuzzytree.model import (
    FloatArray,
    FuzzySystem,
    Linear,
    Singleton,
    SystemOutput,
    Term,
    sampled_values,
)
from fuzzytree.semantics import curve_degree

ROUNDING: Final = 1e-9
"""The share of an output's scale by which rounding may change what is claimed of it."""

_JOINS: Final[Mapping[str, Callable[[FloatArray, FloatArray], FloatArray]]] = {
    "maximum": np.maximum,
    "sum": np.add,
    "algebraic sum": lambda a, b: a + b - a * b,
}


class Group(NamedTuple):
    """Conclusions that count once, as far as the strongest of their rules."""

    rules: list[int]
    term: Term
    is_product: bool

    def implied(self, strength: FloatArray, degrees: FloatArray) -> FloatArray:
        """Return the degrees of the samples that the rules conclude."""
        return strength * degrees if self.is_product else np.minimum(strength, degrees)


class OutputBounds:
    """How an output follows from the strengths of rules.

    Attributes:
        output: The output.
        groups: What is concluded of it.
        rules: The positions of all rules that can give it a number.

    Raises:
        NotBoundedError: If it cannot be bounded.
    """

    def __init__(self, base: Base, system: FuzzySystem, name: str) -> None:
        self.base, self.system = base, system
        self.output = next(one for one in system.outputs if one.name == name)
        how = self.output.defuzzifier
        self.is_weighted, self.is_sum = how.is_weighted, how.method == "weighted sum"
        if not self.is_weighted and (how.method != "centroid" or how.grid == "lines"):
            kind = f"{how.method} ({how.grid})"
            raise NotBoundedError(f"the {kind} of output {name!r} is not bounded")
        join = self.output.aggregation
        if join not in (*_JOINS, None) or (
            join == "algebraic sum" and self.is_weighted
        ):
            raise NotBoundedError(f"the aggregation {join} of {name!r} is not bounded")
        self.groups = [*self._groups()]
        if not self.is_weighted:
            self.samples = np.array(sampled_values(self.output))[:, None]
            self.shares = np.ones(self.samples.shape)
            if how.grid == "half ends":
                self.shares[[0, -1]] = 0.5
            degrees = [self._degrees(group.term) for group in self.groups]
            pairs = [*zip(self.groups, degrees, strict=True)]
            self.degrees = [one for one in degrees if one.any()]
            self.groups = [group for group, one in pairs if one.any()]
        if not self.groups:
            raise NotBoundedError(f"no rule concludes {name!r}")
        self.rules = tuple({k: 0 for group in self.groups for k in group.rules})

    def _groups(self) -> Iterator[Group]:
        """Yield the conclusions of the output, each of a term, an implication, rules.

        Raises:
            NotBoundedError: If a rule cannot be bounded.
        """
        name = self.output.name
        blocks = [block for block in self.system.blocks for _ in block.rules]
        lost = {one.number: f"{one.name} ({one.reason})" for one in self.base.left_out}
        groups: dict[tuple[str, bool, tuple[int, ...]], list[int]] = {}
        for number, (rule, block) in enumerate(
            zip(self.system.rules, blocks, strict=True), 1
        ):
            ways = [k for k, one in enumerate(self.base.rules) if one.number == number]
            for place, one in enumerate(rule.then):
                if one.output != name:
                    continue
                is_product = block.implication == "product"
                if not (
                    self.is_weighted or is_product or block.implication == "minimum"
                ):
                    lost[number] = (
                        f"the implication {block.implication} of rule {number}"
                    )
                if one.hedges or block.activation.method != "general":
                    part = "hedges" if one.hedges else block.activation.method
                    lost[number] = f"the {part} in what rule {number} concludes"
                if number in lost:
                    raise NotBoundedError(f"{lost[number]} is not bounded")
                is_joined = self.output.aggregation == "maximum"
                own = () if is_joined else (number, place)
                key = (one.term, is_product, own)
                groups.setdefault(key, []).extend(ways)
        terms = {term.name: term for term in self.output.terms}
        for (term, is_product, _), rules in groups.items():
            function = terms[term].function
            if self.is_weighted and not isinstance(function, Singleton | Linear):
                raise NotBoundedError(f"the number of the term {term!r} is not bounded")
            if rules:
                yield Group(rules, terms[term], is_product)

    def _degrees(self, term: Term) -> FloatArray:
        xs = self.samples[:, 0].tolist()
        degrees = np.array([term.height * curve_degree(term.function, x) for x in xs])
        if not np.isfinite(degrees).all():
            raise NotBoundedError(f"the curve of the term {term.name!r} is not bounded")
        return degrees[:, None]

    # --- numbers

    @property
    def work(self) -> int:
        """How many strengths a box costs as much as."""
        return 1 if self.is_weighted else 1 + len(self.samples) // 16

    def numbers(self, boxes: Boxes) -> Bounds:
        """Return bounds of the output; low is above high where no rule can fire."""
        strengths = [
            Bounds(
                *(
                    np.max([boxes.strength(k, side) for k in group.rules], 0)
                    for side in (0, 1)
                )
            )
            for group in self.groups
        ]
        low, high = self._number(*self._summands(boxes, strengths))
        if self.output.clips:
            ends = self.output.low, self.output.high
            low, high = (
                np.where(np.isfinite(end), np.clip(end, *ends), end)
                for end in (low, high)
            )
        return Bounds(low, high)

    def _summands(self, boxes: Boxes, strengths: list[Bounds]) -> tuple[Bounds, Bounds]:
        """Return bounds of what is averaged, and of its weights."""
        if self.is_weighted:
            numbers = [self._value(boxes, group.term) for group in self.groups]
            return stacked(numbers), stacked(strengths)
        join = _JOINS[self.output.aggregation or "maximum"]
        ends = (reduce(join, self._heights(strengths, side)) for side in (0, 1))
        return exact(self.samples), Bounds(*(end * self.shares for end in ends))

    def _heights(self, strengths: list[Bounds], side: int) -> list[FloatArray]:
        parts = zip(self.groups, strengths, self.degrees, strict=True)
        return [group.implied(one[side], degrees) for group, one, degrees in parts]

    def _value(self, boxes: Boxes, term: Term) -> Bounds:
        """Return bounds of the number of a term on each box."""
        function, zero = term.function, np.zeros(len(boxes.low))
        if isinstance(function, Singleton):
            return exact(zero + function.value)
        assert isinstance(function, Linear)  # others are refused
        result = exact(zero + function.offset)
        for name, weight in zip(self.system.inputs, function.weights, strict=True):
            axis = self.base.inputs[name]
            ends = Bounds(zero + float(axis.least), zero + float(axis.largest))
            if name in boxes.places:
                xs = [float(x) for x in boxes.stretches[name].x]
                place, knots = boxes.places[name], range(len(xs))
                ends = Bounds(
                    *(
                        np.interp(end[:, place], knots, xs)
                        for end in (boxes.low, boxes.high)
                    )
                )
            if weight:
                result = result.plus(ends.times(exact(zero + weight)))
        return result

    def _number(self, values: Bounds, weights: Bounds) -> Bounds:
        if self.is_sum:
            return values.times(weights).total()
        return average(values, weights)

    # --- slopes

    def slopes(self, boxes: Boxes, slopes: Slopes) -> Bounds:
        """Return bounds of the slope with an input, where a rule fires.

        Raises:
            NotBoundedError: If the aggregation is the algebraic sum.
        """
        if self.output.aggregation == "algebraic sum":
            name = self.output.name
            text = f"the slope of {name!r}, an algebraic sum, is not bounded"
            raise NotBoundedError(text)
        strengths: list[Bounds] = []
        rises: list[Bounds] = []
        for group in self.groups:
            pairs = [slopes.rule(boxes, k) for k in group.rules]
            strength, rise = largest(
                [one for one, _ in pairs], [one for _, one in pairs]
            )
            strengths.append(strength)
            rises.append(rise)
        values, weights = self._summands(boxes, strengths)
        y = exact(np.zeros(len(boxes.low)))
        if not self.is_sum:
            y = Bounds(
                *(np.where(np.isinf(end), 0.0, end) for end in average(values, weights))
            )
        far = Bounds(values.low - y.high, values.high - y.low)
        if not self.is_weighted:
            parts = enumerate(self._reach(strengths, far))
            moved = stacked([reach.times(rises[k]) for k, reach in parts]).total()
        else:
            moved = stacked(rises).times(far).total()
        result = moved if self.is_sum else moved.over(weights.total())
        own = np.array(
            [[self._own_slope(group.term, slopes.name)] for group in self.groups]
        )
        if own.any():
            result = result.plus(self._number(exact(own), weights))
        if self.output.clips:
            return Bounds(np.minimum(result.low, 0.0), np.maximum(result.high, 0.0))
        return result

    def _own_slope(self, term: Term, name: str) -> float:
        function = term.function
        if not isinstance(function, Linear):
            return 0.0
        return function.weights[self.system.inputs.index(name)]

    def _reach(self, strengths: list[Bounds], far: Bounds) -> Iterator[Bounds]:
        """Yield by how much each group, as it rises, moves `sum mu (x - y)`.

        It moves the samples that it decides: that it does not reach up to, by the
        minimum, and that no other group decides, by the maximum.
        """
        low, high = self._heights(strengths, 0), self._heights(strengths, 1)
        for k, (group, strength, degrees) in enumerate(
            zip(self.groups, strengths, self.degrees, strict=True)
        ):
            is_sure = may_be = np.ones(far.low.shape, np.bool_)
            if not group.is_product:
                is_sure, may_be = strength.high < degrees, strength.low <= degrees
            others = [j for j in range(len(low)) if j != k]
            for j in others if self.output.aggregation == "maximum" else ():
                is_sure, may_be = (
                    is_sure & (low[k] > high[j]),
                    may_be & (high[k] >= low[j]),
                )
            factor = self.shares * (degrees if group.is_product else 1.0)
            least, most = far.low * factor, far.high * factor
            yield Bounds(
                np.where(is_sure, least, np.where(may_be, np.minimum(least, 0.0), 0.0)),
                np.where(is_sure, most, np.where(may_be, np.maximum(most, 0.0), 0.0)),
            ).total()


def scale_of(system: FuzzySystem, output: SystemOutput) -> float:
    """Return the size of an output's numbers, by which rounding is judged."""
    if not output.defuzzifier.is_weighted:
        return (output.high or 0.0) - (output.low or 0.0)
    sizes = [abs(output.low or 0.0), abs(output.high or 0.0)]
    ends = {
        v.name: max(abs(v.low or 0.0), abs(v.high or 0.0)) for v in system.variables
    }
    for term in output.terms:
        if isinstance(term.function, Singleton):
            sizes.append(abs(term.function.value))
        elif isinstance(term.function, Linear):
            pairs = zip(term.function.weights, system.inputs, strict=True)
            sizes.append(
                abs(term.function.offset) + sum(abs(w) * ends[n] for w, n in pairs)
            )
    return max(sizes) or 1.0
