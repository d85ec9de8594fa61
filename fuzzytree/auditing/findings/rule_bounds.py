"""Lower and upper rule bases between which the strengths of a view's rules lie.

The *lower* rule base takes each curve from below and the *upper* one from above; in a
negated proposition it is the other way round. Both have the same rules, in which a
proposition may use a term that exists only for it.

A weight w is part of both. Under the minimum `w min(a, b) = min(w a, w b)`: each
proposition uses its terms times the weight, exactly where every product is a double,
and between its neighbours otherwise. Under the product, and in a rule without
propositions, a proposition is added whose degree is the weight everywhere.
(`fuzzytree.semantics.inference` multiplies the rounded degree of the condition by the
weight, in one rounding more.)
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

import msgspec

from fuzzytree.auditing.engine.states import Bracket, State, Witness
from fuzzytree.auditing.findings.curve_bounds import (
    CurveBounds,
    Interval,
    Name,
    Side,
    as_points,
    complement,
    gap,
    scale,
)
from fuzzytree.model import (
    Points,
    Proposition,
    Rule,
    RuleBase,
    Shape,
    Term,
    Variable,
    shapes_of,
)
from fuzzytree.numerics import outwards


class BoundedRules(msgspec.Struct, frozen=True, eq=False, dict=True):
    """Rules from below and from above.

    Attributes:
        terms: The terms of both that have no exact shape in the model.
        rules: The numbers of the rules that differ in both.
        gap: How far the lines of a curve are apart at most.
    """

    lower: RuleBase
    upper: RuleBase
    terms: Mapping[Name, CurveBounds]
    rules: frozenset[int]
    gap: float

    @property
    def why(self) -> str:
        """Why something is not known better, for a bracket."""
        return f"curves are known to within {self.gap:.2g}"

    def key(self, number: int) -> tuple[object, ...]:
        """Return a key that is equal for rules with the same antecedent."""
        keys = (
            (one.variable, one.negated, frozenset(self._keys(one)))
            for one in self.lower.rules[number - 1].when
        )
        return tuple(sorted(keys, key=repr))

    def weighted_key(
        self, proposition: Proposition
    ) -> tuple[tuple[object, ...], float, float]:
        """Return a proposition's key without weights, and its least and most weight."""
        weights, keys = set[float](), set[tuple[object, ...]]()
        for key in self._keys(proposition):
            is_weighted = isinstance(key[0], float)
            weights.add(float(str(key[0])) if is_weighted else 1.0)
            keys.add(key[1:] if is_weighted else key)
        what = proposition.variable, proposition.negated, frozenset(keys)
        return what, min(weights), max(weights)

    def _keys(self, proposition: Proposition) -> Iterator[tuple[object, ...]]:
        """Yield what the terms of a proposition are."""
        for term in proposition.terms:
            name = proposition.variable, term
            known = self.terms.get(name)
            yield (self._shapes[name],) if known is None else known.key

    @functools.cached_property
    def _shapes(self) -> Mapping[Name, Shape]:
        return shapes_of(self.lower.variables)

    def certified(self, state: State) -> State:
        """Return what a state of the lower rules says of the true ones.

        Strengths of inexact rules are left out: they are larger in truth.
        """
        if not isinstance(state, Witness | Bracket):
            return state
        claims = tuple(
            one
            for one in state.claims
            if one.kind != "strength" or self.rules.isdisjoint(one.rules)
        )
        return msgspec.structs.replace(state, claims=claims)


def bounded_rules(
    rules: RuleBase,
    weights: Sequence[float],
    terms: Mapping[Name, CurveBounds],
    ranges: Mapping[str, Interval | None],
) -> BoundedRules | None:
    """Return rules from below and from above; None if they are plain.

    Raises:
        ValueError: If a weight has no place: a rule without propositions, and no input.
    """
    if not terms and all(weight == 1.0 for weight in weights):
        return None
    builder = _Builder(rules, terms, ranges)
    own = tuple(
        Rule(tuple(builder.propositions(rule, weight)), rule.then)
        for rule, weight in zip(rules.rules, weights, strict=True)
    )
    inexact = {name for name, one in builder.terms.items() if not one.is_exact}
    used = [
        {
            (proposition.variable, term)
            for proposition in rule.when
            for term in proposition.terms
        }
        for rule in own
    ]
    known = {name for of in used for name in of} & inexact
    apart = (gap(builder.terms[one], of) for one in known if (of := ranges[one[0]]))
    return BoundedRules(
        msgspec.structs.replace(rules, rules=own, variables=builder.variables("lower")),
        msgspec.structs.replace(rules, rules=own, variables=builder.variables("upper")),
        builder.terms,
        frozenset(n for n, of in enumerate(used, 1) if of & inexact),
        outwards(max(apart, default=Fraction(0)))[1],
    )


class _Builder:
    """The terms of both rule bases, as they are made for propositions."""

    def __init__(
        self,
        rules: RuleBase,
        terms: Mapping[Name, CurveBounds],
        ranges: Mapping[str, Interval | None],
    ) -> None:
        self.rules, self.ranges = rules, ranges
        self.is_product = rules.semantics.conjunction == "product"
        self.plain: Mapping[Name, Shape] = shapes_of(rules.variables)
        self.terms = {**terms}

    def propositions(self, rule: Rule, weight: float) -> Iterator[Proposition]:
        """Yield the propositions of a rule, its weight among them."""
        for proposition in rule.when:
            if weight == 1.0 or self.is_product:
                yield self._sided(proposition)
            else:
                yield from self._weighted(proposition, weight)
        if weight != 1.0 and (self.is_product or not rule.when):
            yield self._constant(rule, weight)

    def _sided(self, proposition: Proposition) -> Proposition:
        """Return a proposition whose degree is lower in the lower rules."""
        names = [(proposition.variable, term) for term in proposition.terms]
        if not proposition.negated or not any(name in self.terms for name in names):
            return proposition
        terms = [
            self._named(f"{name[1]}, other side", name[0], self.terms[name].swapped)
            if name in self.terms
            else name[1]
            for name in names
        ]
        return Proposition(proposition.variable, tuple(terms), hedges=("not",))

    def _weighted(
        self, proposition: Proposition, weight: float
    ) -> Iterator[Proposition]:
        """Yield a proposition's degree times a weight; `w (1 - max(a, b))` as two."""
        names: list[str] = []
        for term in proposition.terms:
            one = self._points(proposition.variable, term)
            text = f"{term} x {weight!r}"
            if proposition.negated:
                one, text = complement(one) or one, f"not {text}"
            product = scale(one, weight)
            assert product is not None  # of points
            names.append(self._named(text, proposition.variable, product))
        if proposition.negated:
            yield from (Proposition(proposition.variable, (name,)) for name in names)
        else:
            yield Proposition(proposition.variable, tuple(names))

    def _points(self, variable: str, term: str) -> CurveBounds:
        """Return a term as points, between two lines if need be."""
        known = self.terms.get((variable, term))
        if known is not None:
            return known
        points = as_points(self.plain[variable, term], self.ranges[variable])
        if points is None:
            raise ValueError(f"the curve of {term!r} of {variable!r} has no points")
        return points

    def _constant(self, rule: Rule, weight: float) -> Proposition:
        """Return a proposition that has the same degree everywhere."""
        used = [proposition.variable for proposition in rule.when]
        names = used or [one.name for one in self.rules.variables]
        if not names:
            raise ValueError("there is no input that a weight could be laid upon")
        line = Points((0.0,), (weight,))
        bounds = CurveBounds(line, line, (line,))
        return Proposition(names[0], (self._named(f"x {weight!r}", names[0], bounds),))

    def _named(self, text: str, variable: str, one: CurveBounds) -> str:
        """Return the name of a term that is made, kept once."""
        while self.terms.get((variable, text), one) != one or (
            (variable, text) in self.plain and (variable, text) not in self.terms
        ):
            text += "'"
        self.terms[variable, text] = one
        return text

    def variables(self, side: Side) -> tuple[Variable, ...]:
        """Return the variables with all terms, from below or from above."""
        result: list[Variable] = []
        for variable in self.rules.variables:
            shapes = {term.name: term.shape for term in variable.terms}
            for (name, term), one in self.terms.items():
                if name == variable.name:
                    shapes[term] = one.lower if side == "lower" else one.upper
            terms = tuple(Term(term, shape) for term, shape in shapes.items())
            result.append(msgspec.structs.replace(variable, terms=terms))
        return tuple(result)
