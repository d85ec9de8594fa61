"""What a rule base answers at a point of fractions, and where two of them differ."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from fuzzytree.auditing.engine.ground import rule_strengths
from fuzzytree.auditing.engine.linear import ZERO
from fuzzytree.auditing.engine.points import Point
from fuzzytree.auditing.engine.states import Claim, Witness, coordinates
from fuzzytree.model.rulebase import RuleBase


class Answered(NamedTuple):
    """What a rule base says at a point, exactly.

    Attributes:
        label: The class, or None for no class.
        rule: The number of the winning rule, 0 if none fires.
        is_tie: Whether another rule is as strong.
        margin: How far the strongest class is ahead of the next; not firing counts as
            a class of strength 0.
    """

    label: str | None
    rule: int
    is_tie: bool
    margin: Fraction


def answer_at(rules: RuleBase, point: Point) -> Answered:
    """Return what a rule base says at a point that need not be of doubles.

    Example:
        >>> from fuzzytree.model.rulebase import Rule
        >>> answer_at(RuleBase("a", ("x",), (), (Rule((), "x"),)), {}).label
        'x'
    """
    strengths = rule_strengths(rules, point)
    best = max(strengths)
    if best == 0:
        return Answered(rules.semantics.uncovered, 0, False, ZERO)
    winner = strengths.index(best)
    label = rules.rules[winner].then
    others = [
        s for s, rule in zip(strengths, rules.rules, strict=True) if rule.then != label
    ]
    margin = best - max(others, default=ZERO)
    return Answered(label, winner + 1, strengths.count(best) > 1, margin)


def difference_at(old: RuleBase, new: RuleBase, point: Point) -> Witness | None:
    """Return a point as a witness that two rule bases answer otherwise there, if so."""
    one, other = answer_at(old, point), answer_at(new, point)
    if one.label == other.label:
        return None
    return Witness(
        coordinates(point),
        (
            Claim("decides", of="old", label=one.label),
            Claim("decides", of="new", label=other.label),
        ),
    )
