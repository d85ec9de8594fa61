"""What the outputs of a fuzzy system are computed by, as keys that can be compared.

Equal keys prove that two systems give an output the same number: `computed` by the same
operations on the same numbers, `meant` as the same function of real numbers, so that
they differ by rounding at most. Names, units, notes, the order of terms, inputs and
outputs, rules of weight 0 and terms that no rule uses are no part of a key.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import NamedTuple

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.auditing.diff.matching import Curves
from fuzzytree.model import (
    And,
    Condition,
    Formula,
    FuzzySystem,
    Linear,
    Not,
    Or,
    Proposition,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    checkpoint,
    names_in,
    questions,
)
from fuzzytree.semantics import joined_outputs, shape_of

_STEPPED = {
    *("drastic product", "nilpotent minimum", "drastic sum", "nilpotent maximum")
}
"""Norms that jump: rounding may be all the difference."""


_SMOOTH = ("centroid", "weighted average", "weighted sum")


class Contribution(NamedTuple):
    """What concludes an output: how strongly, and which of its terms.

    Attributes:
        strength: What its degree is computed by.
        label: The term; None for a block of which only some rules are activated.
        most: The weight of the rule, which no degree is above.
    """

    strength: Hashable
    label: Term | None
    most: float


def operation_keys(
    system: FuzzySystem, domain: Domain | None = None
) -> dict[str, Hashable]:
    """Return for each output the operations and numbers that it is computed by.

    A range that contains the domain changes no value; without a domain, none does.
    """
    read = _Read(system, None, domain)
    return {one.name: read.output(one.name) for one in system.outputs}


def function_keys(
    system: FuzzySystem, curves: Curves, domain: Domain | None = None
) -> dict[str, Hashable]:
    """Return for each output the function of real numbers that it is.

    Returns:
        Nothing of those that jump, so that rounding may change them by much.
    """
    norms = {norm for b in system.blocks for norm in (b.conjunction, b.disjunction)}
    norms |= {block.implication for block in system.blocks}
    ways = {block.activation.method for block in system.blocks}
    if norms & _STEPPED or ways - {"general", "proportional"}:
        return {}
    read = _Read(system, curves, domain)
    return {
        one.name: read.output(one.name)
        for one in system.outputs
        if one.aggregation not in _STEPPED and one.defuzzifier.method in _SMOOTH
    }


def contributions(
    system: FuzzySystem, output: str, domain: Domain
) -> tuple[Contribution, ...]:
    """Return what concludes an output on a domain, in the order of the rules."""
    return tuple(_Read(system, None, domain).contributions(output))


class _Read:
    """A system, and how its parts become keys.

    With `curves`, operands whose order does not matter are sorted.
    """

    def __init__(
        self, system: FuzzySystem, curves: Curves | None, domain: Domain | None
    ) -> None:
        self.system, self.curves, self.domain = system, curves, domain
        self.outputs = {one.name: one for one in system.outputs}
        self.labels = {
            (one.name, label.name): label
            for one in system.all_variables
            for label in one.terms
        }
        self.known: dict[tuple[str, str], Hashable] = {}
        self.sources: dict[str, Hashable] = {}
        for one in system.variables:
            self.sources[one.name] = self._source(one)
        formulas = [
            label.function.expression
            for label in self.labels.values()
            if isinstance(label.function, Formula)
        ]
        named = {name for one in formulas for name in names_in(one)}
        named |= {a.variable for rule in system.rules for a in questions(rule.when)}
        self.is_chained = not named.isdisjoint(self.outputs)

    def _source(self, one: Variable) -> Hashable:
        ends = (one.low, one.high) if one.clips and not self._contains(one) else None
        parts = tuple(
            (part.weight, part.centre, self.sources[part.input]) for part in one.parts
        )
        return (parts or one.name, ends)

    def _contains(self, one: Variable) -> bool:
        """Return whether the range of an input holds its part of the domain."""
        side = self.domain.side(one.name) if self.domain and not one.parts else None
        return side is not None and (
            (one.low is None or one.low <= side.low)
            and (one.high is None or side.high <= one.high)
        )

    def output(self, name: str) -> Hashable:
        """Return the key of an output; of all where one depends on another."""
        if self.is_chained:
            every = tuple(map(self._output, self.system.outputs))
            rules = tuple(
                tuple(self._said(rule, block) for rule in block.rules if rule.weight)
                for block in self.system.blocks
            )
            return name, every, rules
        return self._output(self.outputs[name])

    def _output(self, one: SystemOutput) -> Hashable:
        entries = [
            (entry.strength, entry.label and self._concluded(one, entry.label))
            for entry in self.contributions(one.name)
        ]
        joins, is_weighted = one.aggregation, one.defuzzifier.is_weighted
        if self.curves is not None and is_weighted:
            joins = joins if one.name in joined_outputs(self.system) else None
        is_free = self.curves is not None and joins != "normalized sum"
        if is_free and not self.is_chained:
            entries.sort(key=repr)
        order: tuple[Hashable, ...] = ()
        if is_weighted and joins is not None and not is_free:
            order = tuple(self._concluded(one, label) for label in one.terms)
        return facts_of(one), joins, order, tuple(entries)

    def _concluded(self, one: SystemOutput, label: Term) -> Hashable:
        """Return what a term of an output is, and which of those that are the same."""
        key = self._curve(label, is_number=one.defuzzifier.is_weighted)
        same = [
            other.name
            for other in one.terms
            if (other.function, other.height) == (label.function, label.height)
        ]
        return key, same.index(label.name)

    def _term(self, variable: str, label: str) -> Hashable:
        """Return a term of an input, or of an output that a rule uses."""
        term = self.labels[variable, label]
        if variable in self.outputs:
            return variable, self._concluded(self.outputs[variable], term)
        return self.sources[variable], self._curve(term)

    def _curve(self, label: Term, *, is_number: bool = False) -> Hashable:
        curve = label.function
        shape = None if is_number else shape_of(curve)
        key: Hashable = curve if shape is None else shape
        if shape is not None and self.curves is not None:
            key = self.curves.number(shape)
        if isinstance(curve, Formula):
            names = dict.fromkeys(names_in(curve.expression))
            key = (curve, *(self.sources.get(name) for name in names))
        if isinstance(curve, Linear):
            pairs = zip(self.system.inputs, curve.weights, strict=True)
            key = (curve.offset, *((n, w, self.sources[n]) for n, w in pairs if w))
        return key, label.height

    def contributions(self, output: str) -> Iterator[Contribution]:
        """Yield what concludes an output."""
        for block in self.system.blocks:
            how = block.activation
            rules = [rule for rule in block.rules if rule.weight]
            if how.method in ("general", "threshold"):
                key = None if how.method == "general" else (how.threshold, how.relation)
                for rule in rules:
                    for label, said in self._then(rule, block, output):
                        yield Contribution(
                            (key, self._rule(rule, block), said), label, rule.weight
                        )
            elif any(one.output == output for rule in rules for one in rule.then):
                said_by = tuple(self._chosen(rule, block, output) for rule in rules)
                yield Contribution((how, said_by), None, 1.0)

    def _rule(self, rule: SystemRule, block: RuleBlock) -> Hashable:
        checkpoint()
        when = None if rule.when is None else self._condition(rule.when, block)
        return rule.weight, when

    def _said(self, rule: SystemRule, block: RuleBlock) -> Hashable:
        """Return a rule with all that it concludes, in order."""
        then = [
            (
                one.output,
                self._concluded(
                    self.outputs[one.output], self.labels[one.output, one.term]
                ),
                one.hedges,
            )
            for one in rule.then
        ]
        return self._rule(rule, block), tuple(then)

    def _chosen(self, rule: SystemRule, block: RuleBlock, output: str) -> Hashable:
        """Return a rule of a block of which only some are activated."""
        one = self.outputs[output]
        said = [
            (self._concluded(one, label), how)
            for label, how in self._then(rule, block, output)
        ]
        return self._rule(rule, block), tuple(said)

    def _then(
        self, rule: SystemRule, block: RuleBlock, output: str
    ) -> Iterator[tuple[Term, Hashable]]:
        """Yield the terms of an output that a rule concludes; hedges add up."""
        hedges: tuple[str, ...] = ()
        is_curve = not self.outputs[output].defuzzifier.is_weighted
        for one in rule.then:
            hedges = (*one.hedges, *hedges)
            if one.output == output:
                cut = (block.implication or "minimum") if is_curve else None
                yield self.labels[output, one.term], (hedges, cut)

    def _condition(self, when: Condition, block: RuleBlock) -> Hashable:
        match when:
            case Proposition(variable=variable, term=label, hedges=hedges):
                if label is None:
                    return "is", None, hedges
                place = variable, label
                if place not in self.known:
                    self.known[place] = self._term(*place)
                return "is", self.known[place], hedges
            case Not(part=part):
                return "not", self._condition(part, block)
            case And(parts=parts):
                norm: str = block.conjunction or "minimum"
            case Or(parts=parts):
                norm = block.disjunction or "maximum"
        operands = [self._condition(part, block) for part in parts]
        if self.curves is not None and norm != "normalized sum":
            operands.sort(key=repr)
        return norm, tuple(operands)


def facts_of(one: SystemOutput) -> tuple[Hashable, ...]:
    """Return how an output becomes a number, its default first."""
    how = one.defuzzifier
    ends = (one.low, one.high) if one.clips else None
    if how.is_weighted:
        return one.default, how.method, ends
    return one.default, how, ends, one.low, one.high
