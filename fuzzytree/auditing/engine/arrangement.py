"""A rule base on a box: what rules ask of variables, and strengths at points."""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import msgspec

from fuzzytree.auditing.engine.domain import Domain, span, variable_value
from fuzzytree.auditing.engine.linear import ZERO
from fuzzytree.auditing.engine.pieces import ALWAYS, RuleCurve
from fuzzytree.auditing.engine.states import Claim, Witness, coordinates
from fuzzytree.model import (
    Proposition,
    Rule,
    RuleBase,
    Variable,
    checkpoint,
    shapes_of,
)
from fuzzytree.numerics import exact_degree

if TYPE_CHECKING:
    pass


class RuleAxis(msgspec.Struct, frozen=True, eq=False, dict=True):
    """What the rules ask of one variable."""

    variable: Variable
    # the distinct curves; the first is 1 everywhere: no proposition
    elements: tuple[RuleCurve, ...]
    # for each rule its propositions here, each as the elements of which it takes the
    # largest; the rule takes the least of its propositions
    propositions: tuple[tuple[tuple[int, ...], ...], ...]


class Arrangement(msgspec.Struct, frozen=True, eq=False, dict=True):
    """A rule base on a box."""

    rules: RuleBase
    domain: Domain  # the box
    axes: tuple[RuleAxis, ...]  # what the rules ask, variable by variable
    # the two ends of each axis on the box, of combinations too; None where no point of
    # the box is within the sides of a combination
    ends: tuple[tuple[Fraction, Fraction], ...] | None

    def opens(self, variable: str) -> bool:
        """Return whether the lower end of a variable is left out."""
        side = self.domain.side(variable)
        return side is not None and side.is_open

    @property
    def is_empty(self) -> bool:
        """Whether no point of the inputs' box is within all sides."""
        return self.ends is None


@functools.lru_cache(maxsize=4)  # many questions share one arrangement
def arrange(rules: RuleBase, domain: Domain) -> Arrangement:
    """Return a rule base made ready for questions on a box.

    Raises:
        ValueError: If an input has no side.

    Example:
        >>> from fuzzytree.semantics.lowering import rules_from_tree
        >>> from fuzzytree.auditing.engine.domain import DomainSide
        >>> from fuzzytree.testing import random_tree
        >>> rules = rules_from_tree(random_tree(1))
        >>> box = Domain(tuple(DomainSide(name, -1.0, 1.0) for name in rules.inputs))
        >>> arrange(rules, box).is_empty
        False
    """
    missing = [name for name in rules.inputs if domain.side(name) is None]
    if missing:
        raise ValueError(f"the domain has no side for {missing[0]!r}")
    axes = _axes(rules)
    return Arrangement(rules, domain, axes, _ends(axes, domain))


def restricted(base: Arrangement, domain: Domain) -> Arrangement:
    """Return the same rules on another box; the axes' places are kept."""
    return Arrangement(base.rules, domain, base.axes, _ends(base.axes, domain))


def _ends(
    axes: Sequence[RuleAxis], domain: Domain
) -> tuple[tuple[Fraction, Fraction], ...] | None:
    ends: list[tuple[Fraction, Fraction]] = []
    for axis in axes:
        low, high = span(axis.variable, domain)
        if low > high:
            return None
        ends.append((low, high))
    return tuple(ends)


@functools.lru_cache(maxsize=64)
def _axes(rules: RuleBase) -> tuple[RuleAxis, ...]:
    shapes = shapes_of(rules.variables)
    items: list[RuleAxis] = []
    for variable in rules.variables:
        elements: dict[RuleCurve, int] = {RuleCurve(ALWAYS): 0}
        propositions = tuple(
            _propositions_on(variable.name, rule.when, shapes, elements)
            for rule in rules.rules
        )
        is_last = variable is rules.variables[-1]
        if any(propositions) or (
            is_last and not items
        ):  # rules that ask nothing have one too
            of = tuple(elements)
            items.append(RuleAxis(variable, of, propositions))
    return tuple(items)


def _propositions_on(
    variable: str,
    when: Sequence[Proposition],
    shapes: Mapping[tuple[str, str], object],
    elements: dict[RuleCurve, int],
) -> tuple[tuple[int, ...], ...]:
    """Return what a rule tests of a variable: the least of the largest of elements."""
    checkpoint()
    groups: list[tuple[int, ...]] = []
    for proposition in when:
        if proposition.variable != variable:
            continue
        of = [
            elements.setdefault(
                RuleCurve(shapes[variable, term], proposition.negated),  # type: ignore[arg-type]
                len(elements),
            )
            for term in proposition.terms
        ]
        # 1 - max(a, b) is the least of 1 - a and 1 - b
        groups += [(one,) for one in of] if proposition.negated else [tuple(of)]
    return tuple(groups)


def strengths_at(base: Arrangement, point: Mapping[str, Fraction]) -> list[Fraction]:
    """Return every rule's exact strength at a point of the inputs."""
    return rule_strengths(base.rules, point)


def lead_at(
    base: Arrangement,
    point: Mapping[str, Fraction],
    ours: Collection[int],
    rivals: Collection[int],
) -> Fraction:
    """Return by how much the weakest of some rules leads the strongest of others."""
    strengths = strengths_at(base, point)
    mine = min((strengths[number - 1] for number in ours), default=Fraction(1))
    return mine - max((strengths[n - 1] for n in rivals), default=Fraction(0))


def rule_strengths(
    rules: RuleBase, point: Mapping[str, Fraction], of: Sequence[Rule] | None = None
) -> list[Fraction]:
    """Return every rule's exact strength, or that of some rules, without a domain."""
    checkpoint()
    strength = _strength_at(rules, point)
    return [strength(rule, ZERO) for rule in (rules.rules if of is None else of)]


def strength_above(
    base: Arrangement, point: Mapping[str, Fraction], rule: int, rivals: Iterable[int]
) -> Fraction | None:
    """Return a rule's exact strength if it is above that of each of some others.

    The propositions of a rival are evaluated until it is known to be weaker.
    """
    every, strength = base.rules.rules, _strength_at(base.rules, point)
    mine = strength(every[rule - 1], ZERO)
    is_above = all(strength(every[n - 1], mine) < mine for n in rivals)
    return mine if mine and is_above else None


def _strength_at(
    rules: RuleBase, point: Mapping[str, Fraction]
) -> Callable[[Rule, Fraction], Fraction]:
    """Return what evaluates a rule at a point, until it is below some number."""
    is_product = rules.semantics.conjunction == "product"
    shapes = shapes_of(rules.variables)
    variables = {variable.name: variable for variable in rules.variables}

    @functools.cache
    def value(variable: str) -> Fraction:
        return variable_value(variables[variable], point)

    @functools.cache
    def degree(variable: str, term: str) -> Fraction:
        return exact_degree(shapes[variable, term], value(variable))

    def strength(rule: Rule, enough: Fraction) -> Fraction:
        result = Fraction(1)
        for proposition in rule.when:
            one = max(degree(proposition.variable, term) for term in proposition.terms)
            one = 1 - one if proposition.negated else one
            result = result * one if is_product else min(result, one)
            if result < enough or not result:
                break
        return result

    return strength


# --- predictions at a point


class ExactPrediction(NamedTuple):
    """What a rule base says at a point, exactly."""

    label: str | None  # the class, or None for no class
    rule: int  # the number of the winning rule, 0 if none fires
    is_tie: bool  # whether another rule is as strong


def prediction_at(rules: RuleBase, point: Mapping[str, Fraction]) -> ExactPrediction:
    """Return what a rule base says at a point that need not be of doubles.

    Example:
        >>> from fuzzytree.model.rulebase import Rule
        >>> prediction_at(RuleBase("a", ("x",), (), (Rule((), "x"),)), {}).label
        'x'
    """
    strengths = rule_strengths(rules, point)
    best = max(strengths)
    if best == 0:
        return ExactPrediction(rules.semantics.uncovered, 0, False)
    winner = strengths.index(best)
    is_tie = strengths.count(best) > 1
    return ExactPrediction(rules.rules[winner].then, winner + 1, is_tie)


def difference_at(
    old: RuleBase, new: RuleBase, point: Mapping[str, Fraction]
) -> Witness | None:
    """Return a point as a witness that two rule bases answer otherwise there, if so."""
    one, other = prediction_at(old, point), prediction_at(new, point)
    if one.label == other.label:
        return None
    return Witness(
        coordinates(point),
        (
            Claim("decides", of="old", label=one.label),
            Claim("decides", of="new", label=other.label),
        ),
    )
