"""What the outputs of a fuzzy system are computed by, as keys that can be compared.

Equal keys prove that two systems give an output the same number: by the same operations
on the same numbers, or, with curves and operands that may stand in any order, as the
same function of real numbers, so that they differ by rounding at most. Names, units,
notes, the order of terms, inputs and outputs, rules of weight 0 and terms that no rule
uses are no part of a key.
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterator
from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.decide.domain import Domain
from fuzzytree.model import (
    And,
    Condition,
    Formula,
    FuzzySystem,
    Linear,
    Not,
    Or,
    Points,
    Proposition,
    RuleBase,
    RuleBlock,
    SystemOutput,
    SystemRule,
    Term,
    Variable,
    checkpoint,
    names_in,
    questions,
    sampled_values,
)
from fuzzytree.semantics import joined_outputs, points_once, shape_of

_STEPPED = {
    *("drastic product", "nilpotent minimum", "drastic sum", "nilpotent maximum")
}
"""Norms that jump: rounding may be all the difference."""

_SMOOTH = ("centroid", "weighted average", "weighted sum")


class Curves:
    """Keys of curves: equal ones for curves of equal degrees everywhere."""

    def __init__(self) -> None:
        self._numbers: dict[Hashable, int] = {}

    def key(self, term: Term) -> tuple[int, float]:
        """Return the number of a term's curve, and its height."""
        shape = shape_of(term.function) or term.function
        if isinstance(shape, Points):
            shape = _without_bends(points_once(shape))
        return self._numbers.setdefault(shape, len(self._numbers)), term.height


def _without_bends(points: Points) -> Points:
    """Return points without those at which the line does not bend."""
    numbers = (map(Fraction, of) for of in (points.values, points.degrees))
    pairs = [*zip(*numbers, strict=True)]
    kept = pairs[:1]
    for (x, y), (u, v) in itertools.pairwise(pairs[1:]):
        a, p = kept[-1]
        if a == x or x == u or (y - p) * (u - x) != (v - y) * (x - a):
            kept.append((x, y))
    kept += pairs[1:][-1:]
    while len(kept) > 1 and kept[0][1] == kept[1][1]:
        del kept[0]
    while len(kept) > 1 and kept[-1][1] == kept[-2][1]:
        del kept[-1]
    values, degrees = zip(*((float(x), float(y)) for x, y in kept), strict=True)
    return Points(values, degrees)


class Entry(NamedTuple):
    """A conclusion of an output: how strong it is, and which term.

    Attributes:
        strength: What its degree is computed by.
        term: The term.
        most: What its degree is never above.
    """

    strength: Hashable
    term: Term
    most: float


class Keys:
    """A model, and how its parts become keys.

    Args:
        model: The system; of a rule base conditions have keys.
        domain: Where it is used: a range that contains it changes no value.
        curves: Numbers for curves; then operands whose order does not matter are
            sorted.
    """

    def __init__(
        self,
        model: FuzzySystem | RuleBase,
        domain: Domain | None = None,
        curves: Curves | None = None,
    ) -> None:
        self.inputs, self.domain, self.curves = model.inputs, domain, curves
        self.blocks: tuple[RuleBlock, ...] = model.blocks
        self.outputs = {output.name: output for output in model.outputs}
        variables: list[Variable | SystemOutput] = [*model.variables, *model.outputs]
        self.terms = {(v.name, term.name): term for v in variables for term in v.terms}
        self.sources: dict[str, Hashable] = {}
        for variable in model.variables:
            self.sources[variable.name] = self._source(variable)
        functions = [term.function for term in self.terms.values()]
        formulas = [f.expression for f in functions if isinstance(f, Formula)]
        names = {name for formula in formulas for name in names_in(formula)}
        rules = [rule for block in self.blocks for rule in block.rules]
        names |= {part.variable for rule in rules for part in questions(rule.when)}
        self.is_chained = not names.isdisjoint(self.outputs)
        self.joined = joined_outputs(model)

    def _source(self, variable: Variable) -> Hashable:
        """Return what the value of a variable is computed from."""
        side = self.domain.side(variable.name) if self.domain else None
        low, high = variable.low, variable.high
        is_inside = side is not None and not variable.parts
        if is_inside and side is not None:
            is_inside = low is None or low <= side.low
            is_inside &= high is None or side.high <= high
        parts = tuple(
            (part.weight, part.centre, self.sources[part.input])
            for part in variable.parts
        )
        ends = (low, high) if variable.clips and not is_inside else None
        return parts or variable.name, ends

    @property
    def is_smooth(self) -> bool:
        """Whether rounding changes numbers by little, as far as rules go."""
        blocks = self.blocks
        norms = {norm for b in blocks for norm in (b.conjunction, b.disjunction)}
        norms |= {block.implication for block in blocks}
        ways = {block.activation.method for block in blocks}
        return not (norms & _STEPPED or ways - {"general", "proportional"})

    def output(self, name: str) -> Hashable:
        """Return the key of an output; of all where one depends on another.

        Returns:
            With curves None for one that jumps, so that rounding may change it by much.
        """
        output = self.outputs[name]
        is_smooth = self.is_smooth and output.defuzzifier.method in _SMOOTH
        if self.curves and not (is_smooth and output.aggregation not in _STEPPED):
            return None
        if not self.is_chained:
            return self._output(output)
        every = tuple(map(self._output, self.outputs.values()))
        rules = tuple(
            tuple((self._rule(rule, block), rule.then) for rule in block.rules)
            for block in self.blocks
        )
        return name, every, rules

    def _output(self, output: SystemOutput) -> Hashable:
        entries = [
            (entry.strength, self._conclusion(output, entry.term))
            for entry in self.entries(output.name)
        ]
        joins, is_weighted = output.aggregation, output.defuzzifier.is_weighted
        is_free = self.curves is not None
        if is_free and is_weighted and output.name not in self.joined:
            joins = None
        is_free = is_free and joins != "normalized sum"
        if is_free and not self.is_chained:
            entries.sort(key=repr)
        order: tuple[Hashable, ...] = ()
        if is_weighted and joins is not None and not is_free:
            order = tuple(self._conclusion(output, term) for term in output.terms)
        return output.default, facts_of(output), joins, order, tuple(entries)

    def entries(self, output: str) -> Iterator[Entry]:
        """Yield the conclusions of an output; hedges act on those behind them too."""
        is_curve = not self.outputs[output].defuzzifier.is_weighted
        for block in self.blocks:
            how = block.activation
            rules = [rule for rule in block.rules if rule.weight]
            keys = tuple(self._rule(rule, block) for rule in rules)
            rivals = () if how.method in ("general", "threshold") else keys
            cut = (block.implication or "minimum") if is_curve else None
            for place, (rule, key) in enumerate(zip(rules, keys, strict=True)):
                hedges: tuple[str, ...] = ()
                for conclusion in rule.then:
                    hedges = (*conclusion.hedges, *hedges)
                    if conclusion.output == output:
                        is_plain = not hedges and how.method != "proportional"
                        number = place if rivals else None
                        yield Entry(
                            (how, rivals, number, key, hedges, cut),
                            self.terms[output, conclusion.term],
                            rule.weight if is_plain else 1.0,
                        )

    def _rule(self, rule: SystemRule, block: RuleBlock) -> Hashable:
        checkpoint()
        when = None if rule.when is None else self.condition(rule.when, block)
        return rule.weight, when

    def _conclusion(self, output: SystemOutput, term: Term) -> Hashable:
        """Return what a term of an output is, and which of those that are the same."""
        same = [
            other.name
            for other in output.terms
            if (other.function, other.height) == (term.function, term.height)
        ]
        is_number = output.defuzzifier.is_weighted
        return self._curve(term, is_number=is_number), same.index(term.name)

    def _curve(self, term: Term, *, is_number: bool = False) -> Hashable:
        curve = term.function
        if isinstance(curve, Formula):
            names = dict.fromkeys(names_in(curve.expression))
            return curve, term.height, *(self.sources.get(name) for name in names)
        if isinstance(curve, Linear):
            pairs = zip(self.inputs, curve.weights, strict=True)
            columns = tuple((n, w, self.sources[n]) for n, w in pairs if w)
            return curve.offset, term.height, *columns
        if self.curves and not is_number:
            return self.curves.key(term)
        return curve if is_number else shape_of(curve) or curve, term.height

    def _term(self, variable: str, name: str) -> Hashable:
        """Return a term of an input, or of an output that a rule uses."""
        term = self.terms[variable, name]
        if variable in self.outputs:
            return self._conclusion(self.outputs[variable], term)
        return self._curve(term)

    def condition(self, when: Condition, block: RuleBlock) -> Hashable:
        """Return the key of a condition."""
        match when:
            case Proposition(variable=variable, terms=terms, hedges=hedges):
                keys = frozenset(self._term(variable, name) for name in terms)
                return self.sources.get(variable, variable), hedges, keys
            case Not(part=part):
                return "not", self.condition(part, block)
            case And(parts=parts):
                norm: str = block.conjunction or "minimum"
            case Or(parts=parts):
                norm = block.disjunction or "maximum"
        operands = [self.condition(part, block) for part in parts]
        if self.curves and norm != "normalized sum":
            operands.sort(key=repr)
        return norm, tuple(operands)


def facts_of(output: SystemOutput) -> Hashable:
    """Return how an output becomes a number, but for its default."""
    how = output.defuzzifier
    ends = (output.low, output.high) if output.clips else None
    if how.is_weighted:
        return how.method, ends
    return how, ends, output.low, output.high, tuple(sampled_values(output))
