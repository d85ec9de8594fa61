"""Rules for people: propositions on one variable as one, where nothing is lost."""

from __future__ import annotations

import math
from collections.abc import Sequence

from msgspec.structs import replace

from fuzzytree.model import Band, Proposition, Rule, Variable
from fuzzytree.rechecking import interval_word
from fuzzytree.report.text import number


def with_merged_propositions(rule: Rule, variables: Sequence[Variable]) -> Rule:
    """Return a rule for people, with an interval in the place of several propositions.

    Two of them are one where each is 1 wherever the other is strictly between 0 and 1:
    their minimum and their product are then the degree of the interval, bit for bit.

    Example:
        >>> from fuzzytree.model import Term, sentence
        >>> terms = Term("above 20", Band(low=20.0)), Term("up to 50", Band(high=50.0))
        >>> age = Variable("age", terms)
        >>> both = tuple(Proposition("age", (term.name,)) for term in terms)
        >>> sentence(with_merged_propositions(Rule(both, "yes"), [age]))
        'IF age is 20 to 50 THEN yes'
    """
    of = {one.name: one for one in variables}
    bands = {(v.name, t.name): t.function for v in variables for t in v.terms}
    merged: list[tuple[Proposition, Band | None]] = []
    for proposition in rule.when:
        is_plain = len(proposition.terms) == 1 and not proposition.hedges
        band = bands[proposition.variable, proposition.terms[0]] if is_plain else None
        own = proposition, band if isinstance(band, Band) else None
        for place, other in enumerate(merged):
            joint = joint_band(other[1], own[1])
            if other[0].variable == proposition.variable and joint is not None:
                words = [one.terms for one, whole in (own, other) if whole == joint]
                words += [(_interval_text(of[proposition.variable], joint),)]
                merged[place] = replace(proposition, terms=words[0]), joint
                break
        else:
            merged.append(own)
    return replace(rule, when=tuple(proposition for proposition, _ in merged))


def joint_band(first: Band | None, second: Band | None) -> Band | None:
    """Return the band that is the minimum and the product of two; None for no such."""
    if first is None or second is None:
        return None
    lower, upper = sorted((first, second), key=_rise)
    inner, outer = sorted((first, second), key=_fall)
    (low, start), (high, end) = _rise(upper), _fall(inner)
    if start < _rise(lower)[0] or end > _fall(outer)[0] or low >= high:
        return None
    return Band(upper.low, inner.high, upper.left, inner.right)


def _rise(band: Band) -> tuple[float, float]:
    """Return where a band begins to be 1, and where it begins to be above 0."""
    low = -math.inf if band.low is None else band.low
    return low, low if band.left is None else band.left


def _fall(band: Band) -> tuple[float, float]:
    """Return where a band ends to be 1, and where it ends to be above 0."""
    high = math.inf if band.high is None else band.high
    return high, high if band.right is None else band.right


def _interval_text(variable: Variable, band: Band) -> str:
    word = interval_word(variable, band.low, band.high)
    if not word and band.low is not None and band.high is not None:
        word = f"{number(band.low)} to {number(band.high)}"
    return word.removeprefix("> ")
