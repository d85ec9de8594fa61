"""Bounds of a system's output, and of its slope, on boxes.

A weighted output is `sum z s / sum s` (or `sum z s`), s how far conclusions are
activated and z their numbers, constants or sums of inputs. A centroid is the same with
samples x in the place of z and the aggregated curve mu in that of s. With y the output
and D the divisor, its slope is `sum s' (z - y) / D`, and the average of the slopes of z
besides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from typing import Final, NamedTuple

import numpy as np

from fuzzytree.auditing.decide.base import Base
from fuzzytree.auditing.decide.bounds import (
    Bounds,
    Change,
    average,
    exact,
    largest,
    stack,
)
from fuzzytree.auditing.decide.boxes import Boxes
from fuzzytree.auditing.decide.rules import rules_of
from fuzzytree.model import (
    Conclusion,
    Document,
    FloatArray,
    Linear,
    RuleBlock,
    Singleton,
    Term,
    sampled_values,
)
from fuzzytree.semantics import curve_degree

_JOINS: Final[Mapping[str, Callable[[FloatArray, FloatArray], FloatArray]]] = {
    "maximum": np.maximum,
    "sum": np.add,
    "algebraic sum": lambda a, b: a + b - a * b,
}


class NotBoundedError(ValueError):
    """A number or a slope that is not bounded here; the sentence names the part."""


class _Group(NamedTuple):
    """Conclusions that count once, as far as the strongest of their rules."""

    rules: tuple[int, ...]
    term: Term
    is_product: bool
    degrees: FloatArray  # of the term at the samples

    def conclude(self, strength: FloatArray) -> FloatArray:
        """Return the degrees of the samples that the rules conclude."""
        if self.is_product:
            return strength * self.degrees
        return np.minimum(strength, self.degrees)


class OutputBounds:
    """How an output of a system follows from the strengths of rules.

    Args:
        base: Rules of the system.
        system: The system.
        name: The output.
        model: The place of the system, where the base has rules of two.

    Attributes:
        output: The output.
        rules: The positions of all rules that can give it a number.
        work: How many strengths a box costs as much as.

    Raises:
        NotBoundedError: If it cannot be bounded.
    """

    def __init__(
        self, base: Base, system: Document, name: str, *, model: int = 0
    ) -> None:
        self.base, self.system = base, system
        self.output = next(output for output in system.outputs if output.name == name)
        self.is_weighted = self.output.defuzzifier.is_weighted
        self.is_sum = self.output.defuzzifier.method == "weighted sum"
        for obstacle in self._obstacles():
            raise NotBoundedError(f"{obstacle} is not bounded")
        xs = [] if self.is_weighted else sampled_values(self.output)
        self.samples = np.array(xs)[:, None]
        self.shares = np.ones(self.samples.shape)
        if self.output.defuzzifier.grid == "half ends":
            self.shares[[0, -1]] = 0.5
        self.groups = [*self._groups(model)]
        if not self.groups:
            raise NotBoundedError(f"no rule concludes {name!r}")
        self.rules = tuple({k: 0 for group in self.groups for k in group.rules})
        self.work = 1 + len(xs) // 16

    def _conclusions(self) -> Iterator[tuple[int, int, RuleBlock, Conclusion]]:
        """Yield what concludes the output: the number of its rule, its place there."""
        pairs = ((block, rule) for block in self.system.blocks for rule in block.rules)
        for number, (block, rule) in enumerate(pairs, 1):
            for place, conclusion in enumerate(rule.then):
                if conclusion.output == self.output.name:
                    yield number, place, block, conclusion

    def _obstacles(self) -> Iterator[str]:
        """Yield what of the output has no bounds."""
        name, how = self.output.name, self.output.defuzzifier
        joins = {None, *_JOINS} - ({"algebraic sum"} if self.is_weighted else set())
        if not self.is_weighted and (how.method != "centroid" or how.grid == "lines"):
            yield f"the {how.method} ({how.grid}) of output {name!r}"
        if self.output.aggregation not in joins:
            yield f"the aggregation {self.output.aggregation} of {name!r}"
        lost = {rule.number: rule for rule in rules_of(self.system).left_out}
        for number, _, block, conclusion in self._conclusions():
            if number in lost:
                yield f"{lost[number].name} ({lost[number].reason})"
            if conclusion.hedges:
                yield f"what rule {number} concludes with hedges"
            if block.activation.method != "general":
                yield f"the activation {block.activation.method} of rule {number}"
            is_plain = block.implication in ("minimum", "product")
            if not (is_plain or self.is_weighted):
                yield f"the implication {block.implication} of rule {number}"
            function = self._term(conclusion).function
            if self.is_weighted and not isinstance(function, Singleton | Linear):
                yield f"the number of the term {conclusion.term!r}"

    def _term(self, conclusion: Conclusion) -> Term:
        terms = self.output.terms
        return next(term for term in terms if term.name == conclusion.term)

    def _groups(self, model: int) -> Iterator[_Group]:
        """Yield the conclusions: by the maximum, those of a term count once."""
        groups: dict[tuple[object, ...], _Group] = {}
        for number, place, block, conclusion in self._conclusions():
            term, is_product = self._term(conclusion), block.implication == "product"
            rules = enumerate(self.base.rules)
            ways = (k for k, of in rules if (of.number, of.model) == (number, model))
            own = () if self.output.aggregation == "maximum" else (number, place)
            key = term.name, is_product, own
            if key not in groups:
                groups[key] = _Group((), term, is_product, self._degrees(term))
            more = (*groups[key].rules, *ways)
            groups[key] = groups[key]._replace(rules=more)
        for group in groups.values():
            if group.rules and (self.is_weighted or group.degrees.any()):
                yield group

    def _degrees(self, term: Term) -> FloatArray:
        """Return the degrees of the samples.

        Raises:
            NotBoundedError: If one is no number.
        """
        xs = self.samples[:, 0].tolist()
        degrees = np.array([term.height * curve_degree(term.function, x) for x in xs])
        if not np.isfinite(degrees).all():
            raise NotBoundedError(f"the curve of the term {term.name!r} is not bounded")
        return degrees[:, None]

    # --- numbers

    def numbers(self, boxes: Boxes) -> Bounds:
        """Return bounds of the output; low is above high where no rule can fire."""
        strengths = [
            Bounds(
                np.max([boxes.strength(k, 0) for k in group.rules], 0),
                np.max([boxes.strength(k, 1) for k in group.rules], 0),
            )
            for group in self.groups
        ]
        number = self._number(*self._summands(boxes, strengths))
        if not self.output.clips:
            return number
        ends = self.output.low, self.output.high
        return Bounds(
            *(np.where(np.isfinite(end), np.clip(end, *ends), end) for end in number)
        )

    def _number(self, values: Bounds, weights: Bounds) -> Bounds:
        return (
            values.times(weights).total() if self.is_sum else average(values, weights)
        )

    def _summands(
        self, boxes: Boxes, strengths: Sequence[Bounds]
    ) -> tuple[Bounds, Bounds]:
        """Return bounds of what is averaged, and of its weights."""
        if self.is_weighted:
            values = [self._value(boxes, group.term) for group in self.groups]
            return stack(values), stack(strengths)
        join = _JOINS[self.output.aggregation or "maximum"]
        low, high = (reduce(join, self._heights(strengths, side)) for side in (0, 1))
        return exact(self.samples), Bounds(low * self.shares, high * self.shares)

    def _heights(self, strengths: Sequence[Bounds], side: int) -> list[FloatArray]:
        pairs = zip(self.groups, strengths, strict=True)
        return [group.conclude(strength[side]) for group, strength in pairs]

    def _value(self, boxes: Boxes, term: Term) -> Bounds:
        """Return bounds of the number of a term on each box."""
        zero = np.zeros(len(boxes.low))
        if isinstance(term.function, Singleton):
            return exact(zero + term.function.value)
        assert isinstance(term.function, Linear)  # others are refused
        result = exact(zero + term.function.offset)
        for name, weight in zip(self.system.inputs, term.function.weights, strict=True):
            if weight:
                ends = Bounds(*boxes.value(name))
                result = result.plus(ends.times(exact(zero + weight)))
        return result

    # --- slopes

    def slopes(self, boxes: Boxes, name: str) -> Bounds:
        """Return bounds of the slope with an input, where a rule fires.

        Raises:
            NotBoundedError: If rows can have only some values of the input, or the
                aggregation is the algebraic sum.
        """
        if self.base.inputs[name].values or self.base.inputs[name].is_whole:
            text = f"{name!r} has only some values, between which there is no slope"
            raise NotBoundedError(text)
        if self.output.aggregation == "algebraic sum":
            text = f"the slope of {self.output.name!r}, an algebraic sum,"
            raise NotBoundedError(f"{text} is not bounded")
        changes = [
            largest([rule_change(boxes, k, name) for k in group.rules])
            for group in self.groups
        ]
        strengths = [change.value for change in changes]
        values, weights = self._summands(boxes, strengths)
        far = values
        if not self.is_sum:
            y = -Bounds(
                *(np.where(np.isinf(x), 0.0, x) for x in average(values, weights))
            )
            far = values.plus(y)
        moves = zip(self._moves(strengths, far), changes, strict=True)
        result = stack([move.times(change.slope) for move, change in moves]).total()
        result = result if self.is_sum else result.over(weights.total())
        place = self.system.inputs.index(name)
        functions = [group.term.function for group in self.groups]
        own = [
            function.weights[place] if isinstance(function, Linear) else 0.0
            for function in functions
        ]
        if any(own):
            result = result.plus(self._number(exact(np.array(own)[:, None]), weights))
        if self.output.clips:
            return Bounds(np.minimum(result.low, 0.0), np.maximum(result.high, 0.0))
        return result

    def _moves(self, strengths: Sequence[Bounds], far: Bounds) -> Iterator[Bounds]:
        """Yield by how much each group, as it rises, moves `sum mu (x - y)`.

        It moves the samples that it decides: that it does not reach up to, by the
        minimum, and that no other group decides, by the maximum.
        """
        low, high = self._heights(strengths, 0), self._heights(strengths, 1)
        for k, (group, strength) in enumerate(zip(self.groups, strengths, strict=True)):
            if self.is_weighted:
                yield Bounds(far.low[k], far.high[k])
                continue
            is_sure = may_be = np.ones(far.low.shape, np.bool_)
            if not group.is_product:
                is_sure = strength.high < group.degrees
                may_be = strength.low <= group.degrees
            if self.output.aggregation == "maximum":
                for j in {*range(len(low))} - {k}:
                    is_sure = is_sure & (low[k] > high[j])
                    may_be = may_be & (high[k] >= low[j])
            factor = self.shares * (group.degrees if group.is_product else 1.0)
            least, most = (np.where(may_be, end * factor, 0.0) for end in far)
            yield Bounds(
                np.where(is_sure, least, np.minimum(least, 0.0)),
                np.where(is_sure, most, np.maximum(most, 0.0)),
            ).total()


def rule_change(boxes: Boxes, place: int, name: str) -> Change:
    """Return bounds of a rule's strength, and of its slope with an input."""
    rule, zero = boxes.base.rules[place], np.zeros(len(boxes.low))
    changes = [Change(exact(zero + float(rule.factor)), exact(zero))]
    for axis, literal in rule.literals:
        slope = exact(zero)
        if weight := boxes.base.axes[axis].weights.get(name):
            slope = Bounds(*boxes.slope(axis, literal))
            slope = slope.times(exact(zero + float(weight)))
        changes.append(Change(Bounds(*boxes.degree(axis, literal)), slope))
    if rule.norm == "product":
        return reduce(Change.times, changes)
    return -largest([-change for change in changes])


def scale_of(model: Document, name: str) -> float:
    """Return the largest number of an output, by which its rounding is judged."""
    output = next(output for output in model.outputs if output.name == name)
    ends = [
        max(abs(variable.low or 0.0), abs(variable.high or 0.0))
        for variable in model.variables
        if not variable.parts
    ]
    sizes = [abs(output.low or 0.0), abs(output.high or 0.0)]
    for term in output.terms:
        match term.function:
            case Singleton(value=value):
                sizes.append(abs(value))
            case Linear(weights=weights, offset=offset):
                sizes.append(abs(offset) + float(np.abs(weights) @ ends))
            case _:
                pass
    return max(sizes) or 1.0
